//! The framings known to the oracle: its rules for each, and the bytes of a frame.

use axlewire::{
    ikeya::{self, three},
    stream::{Framing, Portable},
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

fn request_bytes<'a>(frame: &ikeya::Request<'a>) -> &'a [u8] {
    match frame {
        ikeya::Request::Read(packet) => packet.as_bytes(),
        ikeya::Request::Write(packet) => packet.as_bytes(),
    }
}

fn response_bytes<'a>(frame: &ikeya::Response<'a>) -> &'a [u8] {
    match frame {
        ikeya::Response::Velocity(packet) => packet.as_bytes(),
        ikeya::Response::Position(packet) => packet.as_bytes(),
    }
}

fn three_request_bytes<'a>(frame: &three::Request<'a>) -> &'a [u8] {
    match frame {
        three::Request::Read(packet) => packet.as_bytes(),
        three::Request::Write(packet) => packet.as_bytes(),
    }
}

fn three_response_bytes<'a>(frame: &three::Response<'a>) -> &'a [u8] {
    match frame {
        three::Response::Velocity(packet) => packet.as_bytes(),
        three::Response::Position(packet) => packet.as_bytes(),
    }
}

impl Known for ikeya::ToSlave {
    const RULES: Rules = Rules::Ikeya { to_slave: true, to_master: false, long: 8 };

    fn bytes<'a: 'a>(frame: &ikeya::Request<'a>) -> &'a [u8] {
        request_bytes(frame)
    }
}

impl Known for ikeya::ToMaster {
    const RULES: Rules = Rules::Ikeya { to_slave: false, to_master: true, long: 8 };

    fn bytes<'a: 'a>(frame: &ikeya::Response<'a>) -> &'a [u8] {
        response_bytes(frame)
    }
}

impl Known for ikeya::BothDirections {
    const RULES: Rules = Rules::Ikeya { to_slave: true, to_master: true, long: 8 };

    fn bytes<'a: 'a>(frame: &ikeya::Packet<'a>) -> &'a [u8] {
        match frame {
            ikeya::Packet::Request(request) => request_bytes(request),
            ikeya::Packet::Response(response) => response_bytes(response),
        }
    }
}

impl Known for three::ToSlave {
    const RULES: Rules = Rules::Ikeya { to_slave: true, to_master: false, long: 16 };

    fn bytes<'a: 'a>(frame: &three::Request<'a>) -> &'a [u8] {
        three_request_bytes(frame)
    }
}

impl Known for three::ToMaster {
    const RULES: Rules = Rules::Ikeya { to_slave: false, to_master: true, long: 16 };

    fn bytes<'a: 'a>(frame: &three::Response<'a>) -> &'a [u8] {
        three_response_bytes(frame)
    }
}

impl Known for three::BothDirections {
    const RULES: Rules = Rules::Ikeya { to_slave: true, to_master: true, long: 16 };

    fn bytes<'a: 'a>(frame: &three::Packet<'a>) -> &'a [u8] {
        match frame {
            three::Packet::Request(request) => three_request_bytes(request),
            three::Packet::Response(response) => three_response_bytes(response),
        }
    }
}

impl<const CAP: usize> Known for ucp::Ucp<CAP> {
    const RULES: Rules = Rules::Ucp { cap: CAP };

    fn bytes<'a: 'a>(frame: &&'a ucp::Frame) -> &'a [u8] {
        frame.as_bytes()
    }
}

impl<F: Known> Known for Portable<F> {
    const RULES: Rules = F::RULES;

    fn bytes<'a: 'a>(frame: &F::Frame<'a>) -> &'a [u8] {
        F::bytes(frame)
    }
}
