//! The framings known to the oracle: its rules for each, and the bytes of a frame.

use axlewire::{
    ikeya::{self, three},
    stream::Framing,
    ucp,
};

use super::oracle::Rules;

/// A framing that the oracle also knows.
pub(crate) trait Known: Framing {
    const RULES: Rules;

    /// The bytes of a frame, in place. (`'a: 'a` because a projection alone leaves it open whether
    /// a caller may name the lifetime, and the impls have to agree.)
    fn bytes<'a: 'a>(frame: &Self::Frame<'a>) -> &'a [u8];
}

/// The framings of a kind of boards, whose packets but the READ have `long` bytes.
macro_rules! known_boards {
    ($board:ident, $request:ident, $response:ident, $long:literal) => {
        fn $request<'a>(frame: &$board::Request<'a>) -> &'a [u8] {
            match frame {
                $board::Request::Read(packet) => packet.as_bytes(),
                $board::Request::Write(packet) => packet.as_bytes(),
            }
        }

        fn $response<'a>(frame: &$board::Response<'a>) -> &'a [u8] {
            match frame {
                $board::Response::Velocity(packet) => packet.as_bytes(),
                $board::Response::Position(packet) => packet.as_bytes(),
            }
        }

        impl Known for $board::ToSlave {
            const RULES: Rules = Rules::Ikeya { to_slave: true, to_master: false, long: $long };

            fn bytes<'a: 'a>(frame: &$board::Request<'a>) -> &'a [u8] {
                $request(frame)
            }
        }

        impl Known for $board::ToMaster {
            const RULES: Rules = Rules::Ikeya { to_slave: false, to_master: true, long: $long };

            fn bytes<'a: 'a>(frame: &$board::Response<'a>) -> &'a [u8] {
                $response(frame)
            }
        }

        impl Known for $board::BothDirections {
            const RULES: Rules = Rules::Ikeya { to_slave: true, to_master: true, long: $long };

            fn bytes<'a: 'a>(frame: &$board::Packet<'a>) -> &'a [u8] {
                match frame {
                    $board::Packet::Request(request) => $request(request),
                    $board::Packet::Response(response) => $response(response),
                }
            }
        }
    };
}

known_boards!(ikeya, request_bytes, response_bytes, 8);
known_boards!(three, three_request_bytes, three_response_bytes, 16);

impl<const CAP: usize> Known for ucp::Ucp<CAP> {
    const RULES: Rules = Rules::Ucp { cap: CAP };

    fn bytes<'a: 'a>(frame: &&'a ucp::Frame) -> &'a [u8] {
        frame.as_bytes()
    }
}
