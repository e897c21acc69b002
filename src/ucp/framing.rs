//! Frames: found in a byte stream, read as a view, built as a value or in place.

use zerocopy::{Immutable, IntoBytes, KnownLayout, TryFromBytes, Unaligned};

use super::{Body, Header, LEN_WITHOUT_BODY, MAX_BODY_LEN, Message, MessageId, SYNC, sweep::sweep};
use crate::{
    crc16,
    error::{EncodeError, ParseError},
    stream::{Encode, Framing, Reason, Swept, Verdict, encode_bytes},
};

/// Finds UCP frames whose length field is 4..=`CAP` (ruling U2).
///
/// The default of 60, frames of at most 64 bytes, is the most that a shipped robot survives, and
/// far above the largest known message. A larger cap, at most 252, lets foreign frames through and
/// holds good ones back longer behind a false header.
#[derive(Debug)]
pub enum Ucp<const CAP: usize = 60> {}

impl<const CAP: usize> Framing for Ucp<CAP> {
    type Frame<'a> = &'a Frame;

    const MIN_LEN: usize = LEN_WITHOUT_BODY + OUTSIDE_LEN;
    const MAX_LEN: usize = {
        assert!(CAP >= LEN_WITHOUT_BODY && CAP <= 252, "the cap is 4..=252");
        CAP + OUTSIDE_LEN
    };

    #[inline(always)]
    fn judge(bytes: &[u8]) -> Verdict {
        let Some(start) = bytes.first_chunk() else { return judge_start::<CAP>(bytes) };
        let len = match len_of::<CAP>(*start) {
            Ok(len) => len,
            Err(reason) => {
                let more = if reason == Reason::Header { noise(bytes) } else { 0 };
                return Verdict::Reject { reason, more };
            }
        };
        match bytes.get(..len) {
            Some(frame) if crc16::check(frame) => Verdict::Frame { len },
            Some(_) => Verdict::Reject { reason: Reason::Crc, more: 0 },
            None => Verdict::Partial { need: len },
        }
    }

    #[inline(always)]
    fn sweep(bytes: &[u8]) -> Swept {
        sweep::<CAP>(bytes)
    }

    #[inline]
    fn view(frame: &[u8]) -> Option<&Frame> {
        Frame::try_ref_from_bytes(frame).ok()
    }
}

/// Judges less than a sync and a length field.
#[inline(always)]
fn judge_start<const CAP: usize>(bytes: &[u8]) -> Verdict {
    match len_of::<CAP>(fill_up(bytes)) {
        Ok(_) => Verdict::Partial { need: bytes.len() + 1 },
        Err(reason) => Verdict::Reject { reason, more: 0 },
    }
}

/// The length of the whole frame, or what is wrong.
#[inline(always)]
fn len_of<const CAP: usize>([first, second, low, high]: [u8; 4]) -> Result<usize, Reason> {
    if [first, second] != SYNC {
        return Err(Reason::Header);
    }
    let len = usize::from(u16::from_le_bytes([low, high]));
    if (LEN_WITHOUT_BODY..=CAP).contains(&len) {
        Ok(len + OUTSIDE_LEN)
    } else {
        Err(Reason::Length)
    }
}

/// With a sync and the length of the shortest frame where bytes are missing: what is there is wrong
/// exactly when the whole is.
#[cold]
fn fill_up(bytes: &[u8]) -> [u8; 4] {
    let mut start = [SYNC[0], SYNC[1], LEN_WITHOUT_BODY as u8, 0];
    start.iter_mut().zip(bytes).for_each(|(filled, byte)| *filled = *byte);
    start
}

/// How many bytes behind the first start no sync.
#[inline(always)]
fn noise(bytes: &[u8]) -> usize {
    let behind = bytes.get(1..).unwrap_or_default();
    if cfg!(not(target_pointer_width = "64")) {
        return noise_by_bytes(behind);
    }
    // In a crowd of false headers the next FD is a few bytes away: a branch that is foreseen is
    // then sooner done than arithmetic.
    let few = noise_by_bytes(behind.first_chunk::<3>().map_or(behind, |near| near));
    match behind.get(3..) {
        Some(far) if few == 3 => few + noise_by_words(far),
        _ => few,
    }
}

/// How many bytes in front of the first FD.
#[inline(always)]
fn noise_by_bytes(bytes: &[u8]) -> usize {
    bytes.iter().take_while(|&&byte| byte != SYNC[0]).count()
}

/// The same, eight at a time.
#[inline(never)]
fn noise_by_words(bytes: &[u8]) -> usize {
    let every = |byte| u64::from_ne_bytes([byte; 8]);
    let mut rest = bytes;
    while let Some((word, behind)) = rest.split_first_chunk() {
        // FD becomes zero, and the first zero has the first borrow: in front of it no high bit is
        // set.
        let word = u64::from_le_bytes(*word) ^ every(SYNC[0]);
        let zeros = word.wrapping_sub(every(1)) & !word & every(0x80);
        if zeros != 0 {
            return bytes.len() - rest.len() + zeros.trailing_zeros() as usize / 8;
        }
        rest = behind;
    }
    bytes.len() - rest.len() + noise_by_bytes(rest)
}

/// Bytes of a frame that `len` does not count: the sync and the CRC.
const OUTSIDE_LEN: usize = 4;

/// A frame on the wire: `FD | FF | len: u16 | id | index | body | crc: u16` (ruling U1).
///
/// A reference to one is a view of the bytes it arrived in. The decoder and [`parse`](Self::parse)
/// hand out only frames whose length and CRC are right; a raw zerocopy cast checks neither.
///
/// ```
/// use axlewire::ucp::{Frame, Message};
///
/// let frame = Frame::parse(&[0xFD, 0xFF, 0x05, 0x00, 0x01, 0x00, 0x00, 0xBE, 0x00])?;
/// assert_eq!((frame.id(), frame.body()), (1, &[0][..]));
/// assert!(matches!(frame.message(), Message::Pong(_)));
/// # Ok::<(), axlewire::error::ParseError>(())
/// ```
#[derive(
    Debug, Eq, Hash, PartialEq, TryFromBytes, IntoBytes, Immutable, KnownLayout, Unaligned,
)]
#[repr(C)]
pub struct Frame {
    header: Header,
    /// Body and CRC.
    tail: [u8],
}

impl Frame {
    /// Borrows `bytes`, exactly one frame of any length up to 256, as a frame.
    ///
    /// # Errors
    ///
    /// [`ParseError::Length`] when there are fewer than 8 bytes or another number than the length
    /// field says, [`ParseError::Field`] without FD FF in front, otherwise [`ParseError::Crc`].
    pub fn parse(bytes: &[u8]) -> Result<&Self, ParseError> {
        let found = bytes.len();
        let smallest = LEN_WITHOUT_BODY + OUTSIDE_LEN;
        if found < smallest {
            return Err(ParseError::Length { expected: smallest, found });
        }
        let frame = Self::try_ref_from_bytes(bytes).map_err(|_| ParseError::Field)?;
        // Where usize has 16 bits, a length field may leave no room for the rest.
        let expected = usize::from(frame.header.len()).saturating_add(OUTSIDE_LEN);
        if found != expected {
            return Err(ParseError::Length { expected, found });
        }
        crc16::verify(bytes)?;
        Ok(frame)
    }

    /// The six bytes in front of the body.
    #[must_use]
    pub const fn header(&self) -> &Header {
        &self.header
    }

    /// The message id, known or not.
    #[must_use]
    pub const fn id(&self) -> u8 {
        self.header.id()
    }

    /// The sender's counter (ruling U9).
    #[must_use]
    pub const fn index(&self) -> u8 {
        self.header.index()
    }

    /// The bytes between header and CRC.
    #[must_use]
    pub const fn body(&self) -> &[u8] {
        match self.tail.split_last_chunk::<2>() {
            Some((body, _)) => body,
            None => &[],
        }
    }

    /// What the frame says.
    #[must_use]
    pub fn message(&self) -> Message<'_> {
        Message::of(self)
    }

    /// The frame as it went over the wire.
    #[must_use]
    pub fn as_bytes(&self) -> &[u8] {
        IntoBytes::as_bytes(self)
    }

    /// Passes the frame on byte for byte, **whatever it does to its receiver**: no rule of this
    /// crate is applied (rulings U2, U7, U13).
    ///
    /// The frame may start a firmware update, be out of range, or hang or corrupt a shipped robot:
    /// a relay is as dangerous as its source. To pass on only harmless motor commands, make a
    /// [`MotorControl`](super::MotorControl) of a received one by `try_from`.
    #[must_use]
    pub const fn relay_unchecked(&self) -> RelayedFrame<'_> {
        RelayedFrame(self)
    }
}

#[cfg(feature = "defmt")]
impl defmt::Format for Frame {
    fn format(&self, f: defmt::Formatter<'_>) {
        defmt::write!(f, "{} index {}: {}", self.id(), self.index(), self.message());
    }
}

/// A received frame to be sent on byte for byte; see [`Frame::relay_unchecked`].
#[derive(Clone, Copy, Debug)]
pub struct RelayedFrame<'a>(&'a Frame);

impl Encode for RelayedFrame<'_> {
    fn encoded_len(&self) -> usize {
        self.0.as_bytes().len()
    }

    fn encode<'b>(&self, buffer: &'b mut [u8]) -> Result<&'b [u8], EncodeError> {
        encode_bytes(self.0.as_bytes(), buffer)
    }
}

/// A whole frame with a body of known type, as a value.
///
/// [`Body::frame`] builds one. A value that was cast from bytes may say anything in its header and
/// its CRC: [`encode`](Encode::encode) refuses an id or length that is not the body's, and a
/// damaged CRC is refused by every receiver.
///
/// ```
/// use axlewire::ucp::{Body, Ping};
/// assert_eq!(Ping {}.frame(0).as_bytes(), [0xFD, 0xFF, 0x04, 0, 0x01, 0, 0x01, 0x42]);
/// ```
#[derive(
    Clone,
    Copy,
    Debug,
    Eq,
    Hash,
    PartialEq,
    TryFromBytes,
    IntoBytes,
    Immutable,
    KnownLayout,
    Unaligned,
)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[repr(C)]
pub struct FrameOf<B> {
    header: Header,
    body: B,
    crc: [u8; 2],
}

impl<B: Body> FrameOf<B> {
    /// Size on the wire, bytes.
    pub const LEN: usize = {
        assert!(size_of::<B>() <= MAX_BODY_LEN, "shipped robots overflow");
        size_of::<Self>()
    };

    /// The frame with the sender's counter `index` and its right CRC.
    #[must_use]
    pub fn new(index: u8, body: B) -> Self {
        let frame = Self { header: Self::header(index), body, crc: [0; 2] };
        Self { crc: crc16::seal(IntoBytes::as_bytes(&frame)), ..frame }
    }

    /// The frame as it goes over the wire.
    #[must_use]
    pub fn as_bytes(&self) -> &[u8] {
        IntoBytes::as_bytes(self)
    }

    /// Header of this frame with the sender's counter `index`.
    const fn header(index: u8) -> Header {
        Header::new(B::ID as u8, index, (Self::LEN - LEN_WITHOUT_BODY - OUTSIDE_LEN) as u8)
    }
}

impl<B> FrameOf<B> {
    /// The sender's counter.
    #[must_use]
    pub const fn index(&self) -> u8 {
        self.header.index()
    }

    /// The body.
    #[must_use]
    pub const fn body(&self) -> &B {
        &self.body
    }
}

/// Refuses with [`EncodeError::Header`] a frame that was cast from bytes and has another id or
/// length than its body: a report's id, for one, hangs shipped robots (ruling U13).
impl<B: Body> Encode for FrameOf<B> {
    fn encoded_len(&self) -> usize {
        Self::LEN
    }

    fn encode<'b>(&self, buffer: &'b mut [u8]) -> Result<&'b [u8], EncodeError> {
        if self.header != Self::header(self.index()) {
            let (id, len) = (self.header.id(), self.header.len());
            return Err(EncodeError::Header { id, len });
        }
        encode_bytes(self.as_bytes(), buffer)
    }
}

/// A frame by its parts, for ids that this crate has no message for (ruling U3).
///
/// ```
/// use axlewire::{stream::Encode, ucp::RawFrame};
///
/// let mut buffer = [0; 64];
/// let frame = RawFrame { id: 0x20, index: 0, body: &[1, 2, 3] }.encode(&mut buffer)?;
/// assert_eq!(frame.len(), 11);
/// assert!(RawFrame { id: 5, index: 0, body: &[] }.encode(&mut buffer).is_err());
/// # Ok::<(), axlewire::error::EncodeError>(())
/// ```
#[derive(Clone, Copy, Debug, Eq, Hash, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct RawFrame<'a> {
    /// The message id; to be sent, none of [`MessageId`].
    pub id: u8,
    /// The sender's counter.
    pub index: u8,
    /// The body; to be sent, at most 56 bytes.
    pub body: &'a [u8],
}

/// Built in place. Refuses with [`EncodeError::KnownId`] and [`EncodeError::BodyTooLong`] what
/// hangs or corrupts shipped robots (ruling U13).
impl Encode for RawFrame<'_> {
    fn encoded_len(&self) -> usize {
        self.body.len() + LEN_WITHOUT_BODY + OUTSIDE_LEN
    }

    fn encode<'b>(&self, buffer: &'b mut [u8]) -> Result<&'b [u8], EncodeError> {
        if MessageId::from_u8(self.id).is_some() {
            return Err(EncodeError::KnownId { id: self.id });
        }
        let length = self.body.len();
        if length > MAX_BODY_LEN {
            return Err(EncodeError::BodyTooLong { length, limit: MAX_BODY_LEN });
        }
        let (needed, available) = (self.encoded_len(), buffer.len());
        let too_small = EncodeError::BufferTooSmall { needed, available };
        let frame = buffer.get_mut(..needed).ok_or(too_small)?;
        let (header, tail) = frame.split_first_chunk_mut::<{ Header::LEN }>().ok_or(too_small)?;
        let (body, _) = tail.split_last_chunk_mut::<2>().ok_or(too_small)?;
        *header = zerocopy::transmute!(Header::new(self.id, self.index, length as u8));
        body.copy_from_slice(self.body);
        let crc = crc16::seal(frame);
        if let Some(field) = frame.last_chunk_mut::<2>() {
            *field = crc;
        }
        Ok(frame)
    }
}
