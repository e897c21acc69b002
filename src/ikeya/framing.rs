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
#[derive(Debug)]
pub enum ToSlave {}

/// What slaves send, as the master sees it: velocity and position responses (8 bytes).
#[derive(Debug)]
pub enum ToMaster {}

/// Everything on the bus, as a monitor or a capture of both pairs sees it.
#[derive(Debug)]
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

impl Framing for ToSlave {
    type Frame<'a> = Request<'a>;
    const MIN_LEN: usize = ReadRequest::LEN;
    const MAX_LEN: usize = WriteRequest::LEN;

    #[inline(always)]
    fn judge(bytes: &[u8]) -> Verdict {
        judge::<{ Self::MAX_LEN }, true, false>(bytes)
    }

    #[inline(always)]
    fn good_run(bytes: &[u8], wide: bool) -> GoodRun {
        good_run::<true, false>(bytes, wide)
    }

    #[inline(always)]
    fn is_short(bytes: &[u8]) -> bool {
        bytes.first() == Some(&READ)
    }

    #[inline(always)]
    fn sweep(bytes: &[u8]) -> Swept {
        sweep::<Self, true, false>(bytes)
    }

    #[inline]
    fn view(frame: &[u8]) -> Option<Request<'_>> {
        match frame.first()? {
            &READ => view(frame).map(Request::Read),
            _ => view(frame).map(Request::Write),
        }
    }
}

impl Framing for ToMaster {
    type Frame<'a> = Response<'a>;
    const MIN_LEN: usize = VelocityResponse::LEN;
    const MAX_LEN: usize = VelocityResponse::LEN;

    #[inline(always)]
    fn judge(bytes: &[u8]) -> Verdict {
        judge::<{ Self::MAX_LEN }, false, true>(bytes)
    }

    #[inline(always)]
    fn good_run(bytes: &[u8], wide: bool) -> GoodRun {
        good_run::<false, true>(bytes, wide)
    }

    #[inline(always)]
    fn sweep(bytes: &[u8]) -> Swept {
        sweep::<Self, false, true>(bytes)
    }

    #[inline]
    fn view(frame: &[u8]) -> Option<Response<'_>> {
        match *frame.first()? {
            VELOCITY => view(frame).map(Response::Velocity),
            _ => view(frame).map(Response::Position),
        }
    }
}

impl Framing for Either {
    type Frame<'a> = Packet<'a>;
    const MIN_LEN: usize = ReadRequest::LEN;
    const MAX_LEN: usize = WriteRequest::LEN;

    #[inline(always)]
    fn judge(bytes: &[u8]) -> Verdict {
        judge::<{ Self::MAX_LEN }, true, true>(bytes)
    }

    #[inline(always)]
    fn good_run(bytes: &[u8], wide: bool) -> GoodRun {
        good_run::<true, true>(bytes, wide)
    }

    #[inline(always)]
    fn is_short(bytes: &[u8]) -> bool {
        bytes.first() == Some(&READ)
    }

    #[inline(always)]
    fn sweep(bytes: &[u8]) -> Swept {
        sweep::<Self, true, true>(bytes)
    }

    #[inline]
    fn view(frame: &[u8]) -> Option<Packet<'_>> {
        match *frame.first()? {
            VELOCITY => view(frame).map(Response::Velocity).map(Packet::Response),
            POSITION => view(frame).map(Response::Position).map(Packet::Response),
            READ => view(frame).map(Request::Read).map(Packet::Request),
            _ => view(frame).map(Request::Write).map(Packet::Request),
        }
    }
}

impl Framing for three::ToSlave {
    type Frame<'a> = three::Request<'a>;
    const MIN_LEN: usize = ReadRequest::LEN;
    const MAX_LEN: usize = three::WriteRequest::LEN;

    #[inline(always)]
    fn judge(bytes: &[u8]) -> Verdict {
        judge::<{ Self::MAX_LEN }, true, false>(bytes)
    }

    #[inline(always)]
    fn sweep(bytes: &[u8]) -> Swept {
        sweep::<Self, true, false>(bytes)
    }

    #[inline]
    fn view(frame: &[u8]) -> Option<three::Request<'_>> {
        match frame.first()? {
            &READ => view(frame).map(three::Request::Read),
            _ => view(frame).map(three::Request::Write),
        }
    }
}

impl Framing for three::ToMaster {
    type Frame<'a> = three::Response<'a>;
    const MIN_LEN: usize = three::VelocityResponse::LEN;
    const MAX_LEN: usize = three::VelocityResponse::LEN;

    #[inline(always)]
    fn judge(bytes: &[u8]) -> Verdict {
        judge::<{ Self::MAX_LEN }, false, true>(bytes)
    }

    #[inline(always)]
    fn sweep(bytes: &[u8]) -> Swept {
        sweep::<Self, false, true>(bytes)
    }

    #[inline]
    fn view(frame: &[u8]) -> Option<three::Response<'_>> {
        match *frame.first()? {
            VELOCITY => view(frame).map(three::Response::Velocity),
            _ => view(frame).map(three::Response::Position),
        }
    }
}

impl Framing for three::Either {
    type Frame<'a> = three::Packet<'a>;
    const MIN_LEN: usize = ReadRequest::LEN;
    const MAX_LEN: usize = three::WriteRequest::LEN;

    #[inline(always)]
    fn judge(bytes: &[u8]) -> Verdict {
        judge::<{ Self::MAX_LEN }, true, true>(bytes)
    }

    #[inline(always)]
    fn sweep(bytes: &[u8]) -> Swept {
        sweep::<Self, true, true>(bytes)
    }

    #[inline]
    fn view(frame: &[u8]) -> Option<three::Packet<'_>> {
        match *frame.first()? {
            VELOCITY => view(frame).map(three::Response::Velocity).map(three::Packet::Response),
            POSITION => view(frame).map(three::Response::Position).map(three::Packet::Response),
            READ => view(frame).map(three::Request::Read).map(three::Packet::Request),
            _ => view(frame).map(three::Request::Write).map(three::Packet::Request),
        }
    }
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
