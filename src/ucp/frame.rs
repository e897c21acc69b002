//! Frames: as they were received, and as they are sent.

use zerocopy::{Immutable, IntoBytes, KnownLayout, TryFromBytes, Unaligned};

use super::header::{Header, LEN_WITHOUT_BODY, MAX_BODY_LEN, MessageId, OUTSIDE_LEN};
use crate::{
    crc16,
    encode::{Encode, encode_bytes},
    error::{EncodeError, ParseError},
};

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

    /// Borrows bytes whose length and CRC a decoder has checked.
    #[inline]
    pub(super) fn view(frame: &[u8]) -> Option<&Self> {
        Self::try_ref_from_bytes(frame).ok()
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

/// A received frame to be sent on byte for byte; see [`Frame::relay_unchecked`].
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct RelayedFrame<'a>(&'a Frame);

impl Encode for RelayedFrame<'_> {
    fn encoded_len(&self) -> usize {
        self.0.as_bytes().len()
    }

    fn encode<'b>(&self, buffer: &'b mut [u8]) -> Result<&'b [u8], EncodeError> {
        encode_bytes(self.0.as_bytes(), buffer)
    }
}

/// The body of a known message that may be sent: a struct of bytes that knows its id.
///
/// Which message a frame holds follows from its id and the length of its body, so no two bodies
/// share both. Implemented by this crate's bodies and by nothing else. [`RawMotorControl`] and
/// [`RawOtaRequest`] are none (ruling U7): a motor command is sent as a
/// [`MotorControl`](super::MotorControl), which is always harmless, and a request to update as an
/// [`OtaRequest`](super::OtaRequest), which has one constructor.
pub trait Body: IntoBytes + Immutable + KnownLayout + Unaligned + Copy + sealed::Sealed {
    /// The id under which it travels.
    const ID: MessageId;

    /// The whole frame, as a value with the right CRC. `index` is the sender's counter (U9).
    fn frame(self, index: u8) -> FrameOf<Self> {
        FrameOf::new(index, self)
    }
}

pub(super) mod sealed {
    /// Keeps `Body` to this crate.
    pub trait Sealed {}
}

/// A whole frame with a body of known type, as a value.
///
/// [`Body::frame`] builds one. A value that was cast from bytes may say anything in its header and
/// its CRC: [`encode`](Encode::encode) refuses an id or length that is not the body's, and a
/// damaged CRC is refused by every receiver.
///
/// ```
/// use axlewire::ucp::{message::Ping, Body};
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
/// use axlewire::{encode::Encode, ucp::RawFrame};
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
