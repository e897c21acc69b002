//! Decoders: bytes in, frames and gaps out.

use core::{marker::PhantomData, mem::MaybeUninit, slice};

use axlewire::{
    ikeya::{self, three},
    stream::{self, Counters, Event, Framing, Reason, Rejected, Verdict},
    ucp,
};

use crate::{
    memory::{Memory, Out, apart, bytes, enter, enter_with, get, init, read, slots},
    result::{AXLE_ERROR_FULL, AXLE_ERROR_VALUE, AXLE_NONE, AXLE_OK, axle_result, of},
};

/// A frame or a gap.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct axle_stream_event {
    /// One of `AXLE_STREAM_`.
    pub kind: u8,
    /// Why the first byte of a gap begins no frame: one of `AXLE_REASON_`; 0 for a frame. The
    /// other bytes of the gap may have other reasons: the counters have them all.
    pub reason: u8,
    /// The frame, with a matching CRC, in the bytes that were handed in or in the decoder: valid
    /// until either changes. Null for a gap.
    pub bytes: *const u8,
    /// Length of the frame, bytes; 0 for a gap.
    pub length: usize,
    /// Length of the gap, bytes; 0 for a frame.
    pub skipped: u64,
}

/// A frame, whole and undamaged.
pub const AXLE_STREAM_FRAME: u8 = 1;
/// A gap: bytes that belong to no frame.
pub const AXLE_STREAM_SKIPPED: u8 = 2;

kinds! {
    /// The name of a reason, such as "crc"; "?" for another number.
    axle_reason_name: u8;
    /// The CRC does not match.
    AXLE_REASON_CRC = 1, c"crc";
    /// Not the first bytes of a frame.
    AXLE_REASON_HEADER = 2, c"header";
    /// A node id outside 1 to 8.
    AXLE_REASON_ID = 3, c"id";
    /// A length that no frame has.
    AXLE_REASON_LENGTH = 4, c"length";
    /// The line went quiet inside the frame.
    AXLE_REASON_IDLE = 5, c"idle";
}

/// Account of a stream: each received byte is in a frame, in a gap, or still pending.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default)]
pub struct axle_counters {
    /// Bytes received.
    pub received: u64,
    /// Frames, and the bytes in them.
    pub frames: u64,
    /// Bytes in frames.
    pub framed: u64,
    /// Gaps between frames.
    pub gaps: u64,
    /// Bytes in gaps, by reason: CRC.
    pub skipped_crc: u64,
    /// By reason: header.
    pub skipped_header: u64,
    /// By reason: node id.
    pub skipped_id: u64,
    /// By reason: length.
    pub skipped_length: u64,
    /// By reason: silence inside a frame.
    pub skipped_idle: u64,
}

impl From<Counters> for axle_counters {
    fn from(counters: Counters) -> Self {
        Self {
            received: counters.received,
            frames: counters.frames,
            framed: counters.framed,
            gaps: counters.gaps,
            skipped_crc: counters.crc,
            skipped_header: counters.header,
            skipped_id: counters.id,
            skipped_length: counters.length,
            skipped_idle: counters.idle,
        }
    }
}

/// From the master to slaves with one motor.
pub const AXLE_IKEYA_TO_SLAVE: u8 = 1;
/// From slaves with one motor to the master.
pub const AXLE_IKEYA_TO_MASTER: u8 = 2;
/// Both directions of a bus of boards with one motor, as on two wires.
pub const AXLE_IKEYA_BOTH_DIRECTIONS: u8 = 3;
/// From the master to slaves with three motors.
pub const AXLE_IKEYA3_TO_SLAVE: u8 = 4;
/// From slaves with three motors to the master.
pub const AXLE_IKEYA3_TO_MASTER: u8 = 5;
/// Both directions of a bus of boards with three motors.
pub const AXLE_IKEYA3_BOTH_DIRECTIONS: u8 = 6;

/// A framing whose frames are their bytes: the parsers of the header look into them.
#[derive(Clone, Copy, Debug)]
pub struct Raw<F>(PhantomData<F>);

impl<F: Framing> Framing for Raw<F> {
    type Frame<'a> = &'a [u8];
    const MIN_LEN: usize = F::MIN_LEN;
    const MAX_LEN: usize = F::MAX_LEN;

    #[inline(always)]
    fn judge(bytes: &[u8]) -> Verdict {
        F::judge(bytes)
    }

    #[inline(always)]
    fn view(frame: &[u8]) -> Option<&[u8]> {
        Some(frame)
    }

    #[inline(always)]
    fn reject_batch(bytes: &[u8]) -> Rejected {
        F::reject_batch(bytes)
    }
}

/// A decoder of any framing of a motor bus.
#[derive(Clone, Debug)]
pub enum IkeyaDecoder {
    /// One motor.
    ToSlave(ikeya::Decoder<Raw<ikeya::ToSlave>>),
    /// One motor.
    ToMaster(ikeya::Decoder<Raw<ikeya::ToMaster>>),
    /// One motor.
    Both(ikeya::Decoder<Raw<ikeya::BothDirections>>),
    /// Three motors.
    ToSlave3(three::Decoder<Raw<three::ToSlave>>),
    /// Three motors.
    ToMaster3(three::Decoder<Raw<three::ToMaster>>),
    /// Three motors.
    Both3(three::Decoder<Raw<three::BothDirections>>),
}

/// Calls a method of the decoder, whatever its framing.
macro_rules! of_framing {
    ($decoder:expr, $inner:ident => $call:expr) => {
        match $decoder {
            IkeyaDecoder::ToSlave($inner) => $call,
            IkeyaDecoder::ToMaster($inner) => $call,
            IkeyaDecoder::Both($inner) => $call,
            IkeyaDecoder::ToSlave3($inner) => $call,
            IkeyaDecoder::ToMaster3($inner) => $call,
            IkeyaDecoder::Both3($inner) => $call,
        }
    };
}

impl IkeyaDecoder {
    fn new(framing: u8) -> Result<Self, axle_result> {
        Ok(match framing {
            AXLE_IKEYA_TO_SLAVE => Self::ToSlave(ikeya::Decoder::new()),
            AXLE_IKEYA_TO_MASTER => Self::ToMaster(ikeya::Decoder::new()),
            AXLE_IKEYA_BOTH_DIRECTIONS => Self::Both(ikeya::Decoder::new()),
            AXLE_IKEYA3_TO_SLAVE => Self::ToSlave3(three::Decoder::new()),
            AXLE_IKEYA3_TO_MASTER => Self::ToMaster3(three::Decoder::new()),
            AXLE_IKEYA3_BOTH_DIRECTIONS => Self::Both3(three::Decoder::new()),
            _ => return Err(AXLE_ERROR_VALUE),
        })
    }
}

/// What C calls of a decoder.
pub(crate) trait Decode {
    /// Writes the next events in the held bytes and the input, and returns their number. Ends
    /// behind a frame in the held bytes: the next event would overwrite it.
    fn decode_to(&mut self, input: &mut &[u8], events: Slots<'_>) -> usize;
    /// The same of the held bytes alone.
    fn poll_to(&mut self, event: Slot<'_>) -> bool;
    fn push(&mut self, byte: u8) -> bool;
    fn spare(&mut self) -> &mut [u8];
    fn commit(&mut self, len: usize);
    fn idle(&mut self);
    fn pending(&self) -> usize;
    fn counters(&self) -> Counters;
}

/// Where C wants an event. It is written there without a copy: it is as long as four frames of a
/// bus.
type Slot<'a> = &'a mut MaybeUninit<axle_stream_event>;
type Slots<'a> = &'a mut [MaybeUninit<axle_stream_event>];

#[inline(always)]
fn write(event: Event<&[u8]>, to: Slot<'_>) -> *const u8 {
    to.write(match event {
        Event::Frame(bytes) => axle_stream_event {
            kind: AXLE_STREAM_FRAME,
            reason: 0,
            bytes: bytes.as_ptr(),
            length: bytes.len(),
            skipped: 0,
        },
        Event::Skipped(gap) => axle_stream_event {
            kind: AXLE_STREAM_SKIPPED,
            reason: match gap.reason {
                Reason::Crc => AXLE_REASON_CRC,
                Reason::Header => AXLE_REASON_HEADER,
                Reason::Id => AXLE_REASON_ID,
                Reason::Length => AXLE_REASON_LENGTH,
                Reason::Idle => AXLE_REASON_IDLE,
                _ => u8::MAX,
            },
            bytes: core::ptr::null(),
            length: 0,
            skipped: gap.len,
        },
    })
    .bytes
}

impl<F: Framing, const N: usize> Decode for stream::Decoder<Raw<F>, N> {
    #[inline]
    fn decode_to(&mut self, input: &mut &[u8], events: Slots<'_>) -> usize {
        let mut count = 0;
        for slot in events {
            let Some(event) = self.decode(input) else { break };
            let bytes = write(event, slot);
            count += 1;
            if bytes.addr().wrapping_sub((&raw const *self).addr()) < size_of::<Self>() {
                break;
            }
        }
        count
    }

    #[inline]
    fn poll_to(&mut self, event: Slot<'_>) -> bool {
        self.poll().map(|found| write(found, event)).is_some()
    }

    #[inline]
    fn push(&mut self, byte: u8) -> bool {
        self.push(byte)
    }

    #[inline]
    fn spare(&mut self) -> &mut [u8] {
        self.spare()
    }

    #[inline]
    fn commit(&mut self, len: usize) {
        self.commit(len);
    }

    #[inline]
    fn idle(&mut self) {
        self.idle();
    }

    #[inline]
    fn pending(&self) -> usize {
        self.pending()
    }

    #[inline]
    fn counters(&self) -> Counters {
        self.counters()
    }
}

impl Decode for IkeyaDecoder {
    #[inline]
    fn decode_to(&mut self, input: &mut &[u8], events: Slots<'_>) -> usize {
        of_framing!(self, it => it.decode_to(input, events))
    }

    #[inline]
    fn poll_to(&mut self, event: Slot<'_>) -> bool {
        of_framing!(self, it => it.poll_to(event))
    }

    #[inline]
    fn push(&mut self, byte: u8) -> bool {
        of_framing!(self, it => it.push(byte))
    }

    #[inline]
    fn spare(&mut self) -> &mut [u8] {
        of_framing!(self, it => it.spare())
    }

    #[inline]
    fn commit(&mut self, len: usize) {
        of_framing!(self, it => it.commit(len));
    }

    #[inline]
    fn idle(&mut self) {
        of_framing!(self, it => it.idle());
    }

    #[inline]
    fn pending(&self) -> usize {
        of_framing!(self, it => it.pending())
    }

    #[inline]
    fn counters(&self) -> Counters {
        of_framing!(self, it => it.counters())
    }
}

/// A decoder of the link of a rover.
type UcpDecoder = stream::Decoder<Raw<ucp::Ucp>, { ucp::MAX_LEN }>;

object! {
    /// A decoder of a motor bus.
    axle_ikeya_decoder, AXLE_IKEYA_DECODER_SIZE = 144, 18 words of IkeyaDecoder, b"axDi"
}

object! {
    /// A decoder of the link of a rover.
    axle_ucp_decoder, AXLE_UCP_DECODER_SIZE = 184, 23 words of UcpDecoder, b"axDu"
}

/// Makes an empty decoder of this framing: `AXLE_IKEYA_TO_SLAVE`, `AXLE_IKEYA_TO_MASTER`, or, for a
/// recording of both, `AXLE_IKEYA_BOTH_DIRECTIONS`; the same with `AXLE_IKEYA3_` for boards with
/// three motors. `size` is `sizeof *decoder`. Never call it during another call with the same
/// object.
#[unsafe(no_mangle)]
pub extern "C" fn axle_ikeya_decoder_init(
    decoder: *mut axle_ikeya_decoder,
    size: usize,
    framing: u8,
) -> axle_result {
    init(decoder, size, || IkeyaDecoder::new(framing))
}

/// Makes an empty decoder. `size` is `sizeof *decoder`. Never call it during another call with the
/// same object.
#[unsafe(no_mangle)]
pub extern "C" fn axle_ucp_decoder_init(
    decoder: *mut axle_ucp_decoder,
    size: usize,
) -> axle_result {
    init(decoder, size, || Ok(UcpDecoder::new()))
}

/// Decodes into the slots; the number of events.
#[inline]
fn decode<M: Memory>(
    decoder: *mut M,
    data: *mut *const u8,
    length: *mut usize,
    events: Slots<'_>,
) -> Result<usize, axle_result>
where
    M::Value: Decode,
{
    let (out_data, out_length) = (Out::new(data)?, Out::new(length)?);
    let (data, length) = (read(data)?, read(length)?);
    let size = size_of_val(events);
    apart(bytes(data, length)?, events.as_ptr().cast(), size)?;
    enter_with(decoder, data, length, |decoder, bytes| {
        let mut rest = bytes;
        let count = decoder.decode_to(&mut rest, events);
        out_data.write(data.wrapping_add(length - rest.len()));
        out_length.write(rest.len());
        count
    })
}

fn decode_one<M: Memory>(
    decoder: *mut M,
    data: *mut *const u8,
    length: *mut usize,
    event: *mut axle_stream_event,
) -> axle_result
where
    M::Value: Decode,
{
    let next = || decode(decoder, data, length, slice::from_mut(Out::new(event)?.slot()));
    match next() {
        Ok(0) => AXLE_NONE,
        Ok(_) => AXLE_OK,
        Err(error) => error,
    }
}

fn decode_many<M: Memory>(
    decoder: *mut M,
    data: *mut *const u8,
    length: *mut usize,
    events: *mut axle_stream_event,
    capacity: usize,
    count: *mut usize,
) -> axle_result
where
    M::Value: Decode,
{
    let next = || {
        let count = Out::new(count)?;
        let events = slots(events, capacity)?;
        let found = decode(decoder, data, length, events)?;
        count.write(found);
        Ok(if found > 0 { AXLE_OK } else { AXLE_NONE })
    };
    next().unwrap_or_else(|error| error)
}

fn poll<M: Memory>(decoder: *mut M, event: *mut axle_stream_event) -> axle_result
where
    M::Value: Decode,
{
    let next = || {
        let event = Out::new(event)?;
        let has_event = enter(decoder, |decoder| decoder.poll_to(event.slot()))?;
        Ok(if has_event { AXLE_OK } else { AXLE_NONE })
    };
    next().unwrap_or_else(|error| error)
}

fn push<M: Memory>(decoder: *mut M, byte: u8) -> axle_result
where
    M::Value: Decode,
{
    let push = |decoder: &mut M::Value| {
        let before = decoder.pending();
        if !decoder.push(byte) {
            AXLE_NONE
        } else if decoder.pending() == before {
            AXLE_ERROR_FULL
        } else {
            AXLE_OK
        }
    };
    enter(decoder, push).unwrap_or_else(|error| error)
}

fn spare<M: Memory>(decoder: *mut M, bytes: *mut *mut u8, length: *mut usize) -> axle_result
where
    M::Value: Decode,
{
    let get = || {
        let (bytes, length) = (Out::new(bytes)?, Out::new(length)?);
        let (start, count) = enter(decoder, |decoder| {
            let spare = decoder.spare();
            (spare.as_mut_ptr(), spare.len())
        })?;
        bytes.write(start);
        Ok(length.write(count))
    };
    get().unwrap_or_else(|error| error)
}

fn counters<M: Memory>(decoder: *const M, counters: *mut axle_counters) -> axle_result
where
    M::Value: Decode,
{
    get(decoder, counters, |decoder| Some(decoder.counters().into()))
}

fn pending<M: Memory>(decoder: *const M, count: *mut usize) -> axle_result
where
    M::Value: Decode,
{
    get(decoder, count, |decoder| Some(decoder.pending()))
}

/// The functions of a decoder with these names.
macro_rules! decoder {
    ($decoder:ident: $decode:ident $decode_many:ident $push:ident $poll:ident $spare:ident $commit:ident $idle:ident
        $pending:ident $counters:ident) => {
        /// The next frame or gap in the bytes that are held and in `*data`; advances `*data` and
        /// `*length` past the bytes used. `AXLE_NONE` once all are used up.
        ///
        /// Call it until it returns `AXLE_NONE`, or go on later with the rest.
        #[unsafe(no_mangle)]
        pub extern "C" fn $decode(
            decoder: *mut $decoder,
            data: *mut *const u8,
            length: *mut usize,
            event: *mut axle_stream_event,
        ) -> axle_result {
            decode_one(decoder, data, length, event)
        }

        /// The next frames and gaps, at most `capacity` of them, for a long recording: one call
        /// instead of one for each. Writes their number to `*count`; `AXLE_NONE` and 0 once all
        /// bytes are used up.
        ///
        /// Fewer than `capacity` do not tell that all are used up: a frame that began in earlier
        /// data is the last one of its call, as it is held in the decoder.
        #[unsafe(no_mangle)]
        pub extern "C" fn $decode_many(
            decoder: *mut $decoder,
            data: *mut *const u8,
            length: *mut usize,
            events: *mut axle_stream_event,
            capacity: usize,
            count: *mut usize,
        ) -> axle_result {
            decode_many(decoder, data, length, events, capacity, count)
        }

        /// Takes in one byte: `AXLE_OK` if there may be an event to poll, `AXLE_NONE` if not.
        ///
        /// Poll until `AXLE_NONE` before the next byte: a full decoder refuses it, with
        /// `AXLE_ERROR_FULL`.
        #[unsafe(no_mangle)]
        pub extern "C" fn $push(decoder: *mut $decoder, byte: u8) -> axle_result {
            push(decoder, byte)
        }

        /// The next frame or gap in the bytes that are held; `AXLE_NONE` if there is none.
        #[unsafe(no_mangle)]
        pub extern "C" fn $poll(
            decoder: *mut $decoder,
            event: *mut axle_stream_event,
        ) -> axle_result {
            poll(decoder, event)
        }

        /// Free space behind the bytes that are held, for a port or a DMA to write into; then
        /// `commit` them. At least one byte once `poll` has returned `AXLE_NONE`.
        #[unsafe(no_mangle)]
        pub extern "C" fn $spare(
            decoder: *mut $decoder,
            bytes: *mut *mut u8,
            length: *mut usize,
        ) -> axle_result {
            spare(decoder, bytes, length)
        }

        /// Takes in the first bytes of the spare space; more than its length count as that.
        #[unsafe(no_mangle)]
        pub extern "C" fn $commit(decoder: *mut $decoder, length: usize) -> axle_result {
            of(enter(decoder, |decoder| decoder.commit(length)))
        }

        /// Tells that the line went quiet: the bytes that are held will not be completed (ruling
        /// B3). Then poll until `AXLE_NONE`.
        ///
        /// A possible start of a frame at the very end is still held: if nothing follows at all, as
        /// at the end of a file, repeat it, and poll, until `get_pending` gives 0.
        #[unsafe(no_mangle)]
        pub extern "C" fn $idle(decoder: *mut $decoder) -> axle_result {
            of(enter(decoder, |decoder| decoder.idle()))
        }

        /// Number of bytes that are held and undecided.
        #[unsafe(no_mangle)]
        pub extern "C" fn $pending(decoder: *const $decoder, count: *mut usize) -> axle_result {
            pending(decoder, count)
        }

        /// The account of all bytes so far.
        #[unsafe(no_mangle)]
        pub extern "C" fn $counters(
            decoder: *const $decoder,
            account: *mut axle_counters,
        ) -> axle_result {
            counters(decoder, account)
        }
    };
}

decoder!(axle_ikeya_decoder:
    axle_ikeya_decoder_decode axle_ikeya_decoder_decode_many axle_ikeya_decoder_push
    axle_ikeya_decoder_poll
    axle_ikeya_decoder_spare axle_ikeya_decoder_commit axle_ikeya_decoder_idle
    axle_ikeya_decoder_get_pending axle_ikeya_decoder_get_counters);
decoder!(axle_ucp_decoder:
    axle_ucp_decoder_decode axle_ucp_decoder_decode_many axle_ucp_decoder_push
    axle_ucp_decoder_poll
    axle_ucp_decoder_spare axle_ucp_decoder_commit axle_ucp_decoder_idle
    axle_ucp_decoder_get_pending axle_ucp_decoder_get_counters);
