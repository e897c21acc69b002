//! Finds the packets of the bus in a byte stream, from either end or from the middle.

use zerocopy::{Immutable, KnownLayout, TryFromBytes, Unaligned};

use super::{
    PositionResponse, ReadRequest, VelocityResponse, WriteRequest,
    runs::good_run,
    sweep::sweep,
    three,
    wire::header::{POSITION, READ, VELOCITY, WRITE},
};
use crate::{
    crc16,
    stream::{Framing, GoodRun, Reason, Swept, Verdict},
};

/// What a master sends, as a slave sees it: READ (4 bytes) and WRITE (8).
#[derive(Clone, Copy, Debug)]
pub enum ToSlave {}

/// What slaves send, as the master sees it: velocity and position responses (8 bytes).
#[derive(Clone, Copy, Debug)]
pub enum ToMaster {}

/// Everything on the bus, as a monitor or a capture of both pairs sees it.
#[derive(Clone, Copy, Debug)]
pub enum Either {}

/// A packet for a slave.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Request<'a> {
    /// Asks for the status.
    Read(&'a ReadRequest),
    /// Commands a motor.
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

/// A framing of the bus: who sends what it finds, how long everything but a READ is, and the view of a
/// packet for each header.
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

            #[inline(always)]
            fn sweep(bytes: &[u8]) -> Swept {
                sweep::<Self, $to_slave, $to_master>(bytes)
            }

            #[inline(always)]
            fn good_run(bytes: &[u8], wide: bool) -> GoodRun {
                good_run::<{ Self::MAX_LEN }, $to_slave, $to_master>(bytes, wide)
            }

            #[inline(always)]
            fn is_short(bytes: &[u8]) -> bool {
                bytes.first() == Some(&READ)
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
    Either: Packet,
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
    three::Either: three::Packet,
    to_slave: true, to_master: true,
    min_len: ReadRequest::LEN, max_len: three::WriteRequest::LEN,
    VELOCITY => |velocity| three::Packet::Response(three::Response::Velocity(velocity)),
    POSITION => |position| three::Packet::Response(three::Response::Position(position)),
    READ => |read| three::Packet::Request(three::Request::Read(read)),
    _ => |write| three::Packet::Request(three::Request::Write(write)),
}

/// The rule of all six framings: the header gives the length, the CRC decides, then the id.
///
/// `LONG` is the length of everything but a READ. An impossible id with a good CRC is somebody
/// else's packet and skipped whole (ruling I1); with a bad one it is noise like any other.
#[inline(always)]
fn judge<const LONG: usize, const TO_SLAVE: bool, const TO_MASTER: bool>(bytes: &[u8]) -> Verdict {
    match bytes.first() {
        Some(&WRITE) if TO_SLAVE => judge_packet::<LONG>(bytes),
        Some(&(VELOCITY | POSITION)) if TO_MASTER => judge_packet::<LONG>(bytes),
        Some(&READ) if TO_SLAVE => judge_packet::<{ ReadRequest::LEN }>(bytes),
        Some(_) => {
            Verdict::Reject { reason: Reason::Header, more: noise::<TO_SLAVE, TO_MASTER>(bytes) }
        }
        None => Verdict::Partial { need: 1 },
    }
}

/// How many bytes behind the first are no headers.
fn noise<const TO_SLAVE: bool, const TO_MASTER: bool>(bytes: &[u8]) -> usize {
    let is_header = |byte: &u8| match *byte {
        READ | WRITE => TO_SLAVE,
        VELOCITY | POSITION => TO_MASTER,
        _ => false,
    };
    bytes.iter().skip(1).take_while(|byte| !is_header(byte)).count()
}

/// Judges a packet of `LEN` bytes whose header is right.
#[inline(always)]
fn judge_packet<const LEN: usize>(bytes: &[u8]) -> Verdict {
    let Some(packet) = bytes.first_chunk::<LEN>() else {
        return Verdict::Partial { need: LEN };
    };
    if !crc16::check_packet(packet) {
        Verdict::Reject { reason: Reason::Crc, more: 0 }
    } else if !matches!(packet.get(1), Some(1..=8)) {
        Verdict::Reject { reason: Reason::Id, more: LEN - 1 }
    } else {
        Verdict::Frame { len: LEN }
    }
}

/// One judged packet as its type.
#[inline(always)]
fn view<P>(frame: &[u8]) -> Option<&P>
where
    P: TryFromBytes + Immutable + KnownLayout + Unaligned,
{
    P::try_ref_from_bytes(frame).ok()
}
