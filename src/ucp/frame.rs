//! Frames as received and as sent.

use core::fmt;

use zerocopy::{Immutable, IntoBytes, KnownLayout, TryFromBytes, Unaligned};

use super::header::{Header, LEN_WITHOUT_BODY, MAX_BODY_LEN, MessageId, OUTSIDE_LEN, SYNC};
use crate::{
    crc16,
    encode::{Encode, encode_bytes},
    error::{EncodeError, ParseError},
};

/// A frame on the wire: `FD | FF | len: u16 | id | index | body | crc: u16` (ruling U1).
///
/// A reference to a frame is a view of the bytes in which it arrived. The decoder and
/// [`parse`](Self::parse) return only frames with a valid length and CRC; a raw zerocopy cast
/// checks neither.
///
/// ```
/// use axlewire::ucp::{Frame, Message};
///
/// let frame = Frame::parse(&[0xFD, 0xFF, 0x05, 0x00, 0x01, 0x00, 0x00, 0xBE, 0x00])?;
/// assert_eq!((frame.id(), frame.body()), (1, &[0][..]));
/// assert!(matches!(frame.message(), Message::Pong(_)));
/// # Ok::<(), axlewire::error::ParseError>(())
/// ```
#[derive(Eq, Hash, PartialEq)]
#[derive(TryFromBytes, IntoBytes, Immutable, KnownLayout, Unaligned)]
#[repr(C)]
pub struct Frame {
    header: Header,
    /// Body and CRC.
    tail: [u8],
}

impl Frame {
    /// Borrows `bytes`, exactly one frame of up to 256 bytes, as a frame.
    ///
    /// # Errors
    ///
    /// [`ParseError::Length`] for fewer than 8 bytes or a number other than the length field says,
    /// [`ParseError::Field`] if it does not begin with FD FF, otherwise [`ParseError::Crc`].
    pub fn parse(bytes: &[u8]) -> Result<&Self, ParseError> {
        let found = bytes.len();
        let smallest = LEN_WITHOUT_BODY + OUTSIDE_LEN;
        if found < smallest {
            return Err(ParseError::Length { expected: smallest, found });
        }
        let frame = Self::try_ref_from_bytes(bytes).map_err(|_| ParseError::Field)?;
        // With a 16-bit usize, adding to a length field may overflow.
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

    /// The six bytes before the body.
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

    /// The frame as bytes on the wire.
    #[must_use]
    pub fn as_bytes(&self) -> &[u8] {
        IntoBytes::as_bytes(self)
    }

    /// Passes the frame on byte for byte, **whatever it does to its receiver**: no rule of this
    /// crate is applied (rulings U2, U7, U13).
    ///
    /// The frame may start a firmware update, be out of range, or hang or corrupt a shipped robot:
    /// a relay is as dangerous as its source. To pass on only harmless motor commands, convert a
    /// received one to [`MotorControl`](super::MotorControl) with `try_from`.
    #[must_use]
    pub const fn relay_unchecked(&self) -> RelayedFrame<'_> {
        RelayedFrame(self)
    }
}

/// A received frame to be passed on byte for byte; see [`Frame::relay_unchecked`].
#[derive(Clone, Copy, Debug, PartialEq)]
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

/// The body of a known message that may be sent: a struct of bytes with an id.
///
/// The id of a frame and the length of its body determine its message, so no two bodies share both.
/// Implemented only by this crate's bodies. [`RawMotorControl`](super::message::RawMotorControl)
/// and [`RawOtaRequest`](super::message::RawOtaRequest) are not bodies (ruling U7): a motor command
/// is sent as a [`MotorControl`](super::MotorControl), which is always harmless, and an update
/// request as an [`OtaRequest`](super::message::OtaRequest), which has one constructor.
pub trait Body: IntoBytes + Immutable + KnownLayout + Unaligned + Copy + sealed::Sealed {
    /// The message id of its frames.
    const ID: MessageId;

    /// The complete frame, as a value with a valid CRC. `index` is the sender's counter (U9).
    fn frame(self, index: u8) -> FrameOf<Self> {
        FrameOf::new(index, self)
    }
}

/// Implements `Debug` for a type of bytes with the values of its getters.
macro_rules! debug_values {
    ($name:ident: $($getter:ident),*) => {
        impl core::fmt::Debug for $name {
            fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
                f.debug_struct(stringify!($name))
                    $(.field(stringify!($getter), &self.$getter()))*
                    .finish()
            }
        }
    };
}
pub(super) use debug_values;

pub(super) mod sealed {
    /// Limits `Body` to this crate.
    pub trait Sealed {}
}

/// A complete frame with a body of known type, as a value.
///
/// [`Body::frame`] builds one. A value cast from bytes may have any header and CRC:
/// [`encode`](Encode::encode) refuses an id or length that is not the body's, and every receiver
/// refuses a damaged CRC.
///
/// ```
/// use axlewire::ucp::{message::Ping, Body};
/// assert_eq!(Ping {}.frame(0).as_bytes(), [0xFD, 0xFF, 0x04, 0, 0x01, 0, 0x01, 0x42]);
/// ```
#[derive(Clone, Copy, Eq, Hash, PartialEq)]
#[derive(TryFromBytes, IntoBytes, Immutable, KnownLayout, Unaligned)]
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

    /// Builds the frame with the sender's counter `index` and a valid CRC.
    #[must_use]
    pub fn new(index: u8, body: B) -> Self {
        let frame = Self { header: Self::header(index), body, crc: [0; 2] };
        Self { crc: crc16::seal(IntoBytes::as_bytes(&frame)), ..frame }
    }

    /// The frame as bytes on the wire.
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

impl<B: fmt::Debug> fmt::Debug for FrameOf<B> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("FrameOf").field("index", &self.index()).field("body", self.body()).finish()
    }
}

/// Refuses with [`EncodeError::Header`] a frame that was cast from bytes and has an id or length
/// other than its body's: a report's id, for example, hangs shipped robots (ruling U13).
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

/// A frame given by its parts, for ids for which this crate has no message (ruling U3).
///
/// A shipped robot gives such a frame up at its id, and its place in the stream with it: it may not
/// take the next frame either, nor the one behind that, **a stop included**. A
/// [`Host`](super::Host) repeats a stop every 100 ms;
/// [`is_stop_sent`](super::Host::is_stop_sent) says only that it has left.
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
    /// The message id; to be sent, it must not be one of [`MessageId`].
    pub id: u8,
    /// The sender's counter.
    pub index: u8,
    /// The body; to be sent, it must be at most 56 bytes, and the frame must have no second FD FF.
    pub body: &'a [u8],
}

/// Refuses with [`EncodeError::KnownId`], [`EncodeError::BodyTooLong`] and
/// [`EncodeError::NestedHeader`] what hangs, corrupts or misleads shipped robots (ruling U13): they
/// give up a frame with an id that they do not know, and search the rest of it for another one,
/// such as a motor command. A frame whose index or CRC is at fault can be sent with another index.
impl Encode for RawFrame<'_> {
    fn encoded_len(&self) -> usize {
        self.body.len() + LEN_WITHOUT_BODY + OUTSIDE_LEN
    }

    fn encode<'b>(&self, buffer: &'b mut [u8]) -> Result<&'b [u8], EncodeError> {
        if MessageId::from_u8(self.id).is_some() {
            return Err(EncodeError::KnownId { id: self.id });
        }
        let length = self.body.len();
        let too_long = EncodeError::BodyTooLong { length, limit: MAX_BODY_LEN };
        let mut longest = [0; MAX_BODY_LEN + LEN_WITHOUT_BODY + OUTSIDE_LEN];
        let frame = longest.get_mut(..self.encoded_len()).ok_or(too_long)?;
        let (header, tail) = frame.split_first_chunk_mut::<{ Header::LEN }>().ok_or(too_long)?;
        let (body, _) = tail.split_last_chunk_mut::<2>().ok_or(too_long)?;
        *header = zerocopy::transmute!(Header::new(self.id, self.index, length as u8));
        body.copy_from_slice(self.body);
        let crc = crc16::seal(frame);
        if let Some(field) = frame.last_chunk_mut::<2>() {
            *field = crc;
        }
        match nested_header(frame) {
            Some(at) => Err(EncodeError::NestedHeader { at }),
            None => encode_bytes(frame, buffer),
        }
    }
}

/// Where FD FF occurs in a frame behind its own.
fn nested_header(frame: &[u8]) -> Option<usize> {
    frame.windows(2).skip(1).position(|pair| pair == SYNC).map(|at| at + 1)
}
