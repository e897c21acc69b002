//! Finds the packets of the bus in a byte stream, of one direction or of both.

use zerocopy::{Immutable, KnownLayout, TryFromBytes, Unaligned};

use super::{
    batch,
    judge::judge,
    three,
    wire::{
        PositionResponse, ReadRequest, VelocityResponse, WriteRequest,
        header::{POSITION, READ, VELOCITY},
    },
};
use crate::stream::{self, Framing, Rejected, Verdict};

/// Longest packet of a standard bus, bytes.
pub const MAX_LEN: usize = WriteRequest::LEN;

/// Decoder with the smallest buffer that a standard bus needs.
pub type Decoder<F = ToMaster> = stream::Decoder<F, MAX_LEN>;

/// Packets from a master, as a slave sees them: READ (4 bytes) and WRITE (8).
#[derive(Clone, Copy, Debug)]
pub enum ToSlave {}

/// Packets from slaves, as the master sees them: velocity and position responses (8 bytes).
#[derive(Clone, Copy, Debug)]
pub enum ToMaster {}

/// Everything on the bus, as seen by a monitor or in a capture of both pairs.
#[derive(Clone, Copy, Debug)]
pub enum BothDirections {}

/// A packet for a slave.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Request<'a> {
    /// Request for the status.
    Read(&'a ReadRequest),
    /// Command to a motor.
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

/// A framing of the bus: the directions it finds, the length of everything but a READ, and the view
/// of a packet for each header.
macro_rules! framing {
    (
        $framing:ty: $($frame:ident)::+,
        to_slave: $to_slave:literal, to_master: $to_master:literal,
        min_len: $min_len:expr, max_len: $max_len:expr,
        $($header:pat => $view:expr,)+
    ) => {
        impl Framing for $framing {
            type Frame<'a> = $($frame)::+<'a>;
            const MIN_LEN: usize = $min_len;
            const MAX_LEN: usize = $max_len;

            #[inline(always)]
            fn judge(bytes: &[u8]) -> Verdict {
                judge::<{ Self::MAX_LEN }, $to_slave, $to_master>(bytes)
            }

            #[inline]
            fn view(frame: &[u8]) -> Option<Self::Frame<'_>> {
                match *frame.first()? {
                    $($header => view(frame).map($view),)+
                }
            }

            // Nothing for a three-motor bus: its captures are small.
            #[inline(always)]
            fn accept_batch(bytes: &[u8]) -> usize {
                if Self::MAX_LEN == MAX_LEN { batch::accept_batch(bytes) } else { 0 }
            }

            #[inline(always)]
            fn reject_batch(bytes: &[u8]) -> Rejected {
                batch::reject_batch::<{ Self::MAX_LEN }, $to_slave, $to_master>(bytes)
            }
        }
    };
}

framing! {
    ToSlave: Request,
    to_slave: true, to_master: false,
    min_len: ReadRequest::LEN, max_len: WriteRequest::LEN,
    READ => Request::Read,
    _ => Request::Write,
}

framing! {
    ToMaster: Response,
    to_slave: false, to_master: true,
    min_len: VelocityResponse::LEN, max_len: VelocityResponse::LEN,
    VELOCITY => Response::Velocity,
    _ => Response::Position,
}

framing! {
    BothDirections: Packet,
    to_slave: true, to_master: true,
    min_len: ReadRequest::LEN, max_len: WriteRequest::LEN,
    VELOCITY => |velocity| Packet::Response(Response::Velocity(velocity)),
    POSITION => |position| Packet::Response(Response::Position(position)),
    READ => |read| Packet::Request(Request::Read(read)),
    _ => |write| Packet::Request(Request::Write(write)),
}

framing! {
    three::ToSlave: three::Request,
    to_slave: true, to_master: false,
    min_len: ReadRequest::LEN, max_len: three::WriteRequest::LEN,
    READ => three::Request::Read,
    _ => three::Request::Write,
}

framing! {
    three::ToMaster: three::Response,
    to_slave: false, to_master: true,
    min_len: three::VelocityResponse::LEN, max_len: three::VelocityResponse::LEN,
    VELOCITY => three::Response::Velocity,
    _ => three::Response::Position,
}

framing! {
    three::BothDirections: three::Packet,
    to_slave: true, to_master: true,
    min_len: ReadRequest::LEN, max_len: three::WriteRequest::LEN,
    VELOCITY => |velocity| three::Packet::Response(three::Response::Velocity(velocity)),
    POSITION => |position| three::Packet::Response(three::Response::Position(position)),
    READ => |read| three::Packet::Request(three::Request::Read(read)),
    _ => |write| three::Packet::Request(three::Request::Write(write)),
}

/// Views a judged packet as its type.
#[inline(always)]
fn view<P>(frame: &[u8]) -> Option<&P>
where
    P: TryFromBytes + Immutable + KnownLayout + Unaligned,
{
    P::try_ref_from_bytes(frame).ok()
}
