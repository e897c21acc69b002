//! Finds the packets of the bus in a byte stream, of one direction or of both. Both kinds of boards
//! have the same framings, of packets of their own.

use super::wire::{PositionResponse, ReadRequest, VelocityResponse, WriteRequest};

/// The framings of a kind of board and what they find, of the packets that are in scope.
macro_rules! framings {
    (accept_batch: $accept_batch:expr) => {
        /// Longest packet of such a bus, bytes.
        pub const MAX_LEN: usize = WriteRequest::LEN;

        /// Decoder with the smallest buffer that such a bus needs.
        pub type Decoder<F = ToMaster> = $crate::stream::Decoder<F, MAX_LEN>;

        /// Packets from a master, as a slave hears them: READ and WRITE.
        #[derive(Clone, Copy, Debug)]
        pub enum ToSlave {}

        /// Packets from slaves, as the master hears them: velocity and position responses.
        #[derive(Clone, Copy, Debug)]
        pub enum ToMaster {}

        /// Everything on the bus, as heard by a monitor or recorded from both pairs.
        #[derive(Clone, Copy, Debug)]
        pub enum BothDirections {}

        /// A packet for a slave.
        #[derive(Clone, Copy, Debug, Eq, PartialEq)]
        #[cfg_attr(feature = "defmt", derive(defmt::Format))]
        pub enum Request<'a> {
            /// Request for the status.
            Read(&'a ReadRequest),
            /// Command to the motors.
            Write(&'a WriteRequest),
        }

        /// A packet for the master.
        #[derive(Clone, Copy, Debug, Eq, PartialEq)]
        #[cfg_attr(feature = "defmt", derive(defmt::Format))]
        pub enum Response<'a> {
            /// Status of a velocity node.
            Velocity(&'a VelocityResponse),
            /// Status of a position node.
            Position(&'a PositionResponse),
        }

        /// A packet of either direction.
        #[derive(Clone, Copy, Debug, Eq, PartialEq)]
        #[cfg_attr(feature = "defmt", derive(defmt::Format))]
        pub enum Packet<'a> {
            /// For a slave.
            Request(Request<'a>),
            /// For the master.
            Response(Response<'a>),
        }

        $crate::ikeya::framing::framing! {
            ToSlave: Request, $accept_batch,
            to_slave: true, to_master: false, min_len: ReadRequest::LEN,
            READ => Request::Read,
            _ => Request::Write,
        }

        $crate::ikeya::framing::framing! {
            ToMaster: Response, $accept_batch,
            to_slave: false, to_master: true, min_len: VelocityResponse::LEN,
            VELOCITY => Response::Velocity,
            _ => Response::Position,
        }

        $crate::ikeya::framing::framing! {
            BothDirections: Packet, $accept_batch,
            to_slave: true, to_master: true, min_len: ReadRequest::LEN,
            VELOCITY => |velocity| Packet::Response(Response::Velocity(velocity)),
            POSITION => |position| Packet::Response(Response::Position(position)),
            READ => |read| Packet::Request(Request::Read(read)),
            _ => |write| Packet::Request(Request::Write(write)),
        }
    };
}
pub(super) use framings;

/// A framing of the bus: the directions it finds, the length of the shortest packet, and the view
/// of a packet for each header.
macro_rules! framing {
    (
        $framing:ident: $frame:ident, $accept_batch:expr,
        to_slave: $to_slave:literal, to_master: $to_master:literal, min_len: $min_len:expr,
        $($header:pat => $view:expr,)+
    ) => {
        impl $crate::stream::Framing for $framing {
            type Frame<'a> = $frame<'a>;
            const MIN_LEN: usize = $min_len;
            const MAX_LEN: usize = MAX_LEN;

            #[inline(always)]
            fn judge(bytes: &[u8]) -> $crate::stream::Verdict {
                $crate::ikeya::judge::judge::<MAX_LEN, $to_slave, $to_master>(bytes)
            }

            #[inline]
            fn view(frame: &[u8]) -> Option<Self::Frame<'_>> {
                #[allow(unused_imports, reason = "each framing names some of them")]
                use $crate::ikeya::wire::{header::{POSITION, READ, VELOCITY}, view};
                match *frame.first()? {
                    $($header => view(frame).map($view),)+
                }
            }

            #[inline(always)]
            fn accept_batch(bytes: &[u8]) -> usize {
                $accept_batch(bytes)
            }

            #[inline(always)]
            fn reject_batch(bytes: &[u8]) -> $crate::stream::Rejected {
                $crate::ikeya::batch::reject_batch::<MAX_LEN, $to_slave, $to_master>(bytes)
            }
        }
    };
}
pub(super) use framing;

framings! { accept_batch: super::batch::accept_batch }
