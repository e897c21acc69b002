//! The six bytes before every body, the names of the ids, and the sizes of a frame.

use core::fmt;

use zerocopy::{Immutable, IntoBytes, KnownLayout, TryFromBytes, Unaligned};

use super::catalogue::catalogue;

/// Speed of the line, bit/s.
pub const BAUD: u32 = 115_200;

/// Longest frame that is sent and, by default, accepted, bytes (ruling U2).
pub const MAX_LEN: usize = 64;

/// Longest body that is sent, bytes.
pub(super) const MAX_BODY_LEN: usize = MAX_LEN - Header::LEN - 2;

/// `len` of a frame without a body.
pub(super) const LEN_WITHOUT_BODY: usize = 4;

/// Bytes of a frame that `len` does not count: the sync and the CRC.
pub(super) const OUTSIDE_LEN: usize = 4;

/// First byte of a frame; any other value makes an invalid header.
#[derive(Clone, Copy, Debug, Eq, Hash, PartialEq)]
#[derive(TryFromBytes, IntoBytes, Immutable, KnownLayout, Unaligned)]
#[cfg_attr(feature = "bytemuck", derive(bytemuck::CheckedBitPattern, bytemuck::NoUninit))]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[repr(u8)]
enum FirstSync {
    Value = 0xFD,
}

/// Second byte of a frame.
#[derive(Clone, Copy, Debug, Eq, Hash, PartialEq)]
#[derive(TryFromBytes, IntoBytes, Immutable, KnownLayout, Unaligned)]
#[cfg_attr(feature = "bytemuck", derive(bytemuck::CheckedBitPattern, bytemuck::NoUninit))]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[repr(u8)]
enum SecondSync {
    Value = 0xFF,
}

/// The first two bytes of every frame.
pub const SYNC: [u8; 2] = [FirstSync::Value as u8, SecondSync::Value as u8];

/// The fields before every body: `FD | FF | len: u16 | id | index`, 6 bytes (ruling U1).
#[derive(Clone, Copy, Eq, Hash, PartialEq)]
#[derive(TryFromBytes, IntoBytes, Immutable, KnownLayout, Unaligned)]
#[cfg_attr(feature = "bytemuck", derive(bytemuck::CheckedBitPattern, bytemuck::NoUninit))]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[repr(C)]
pub struct Header {
    first: FirstSync,
    second: SecondSync,
    len: [u8; 2],
    id: u8,
    index: u8,
}

impl Header {
    /// Size on the wire, bytes.
    pub const LEN: usize = size_of::<Self>();

    /// Header of a frame with a body of `body_len` bytes, at most 251.
    pub(super) const fn new(id: u8, index: u8, body_len: u8) -> Self {
        let len = [body_len + LEN_WITHOUT_BODY as u8, 0];
        Self { first: FirstSync::Value, second: SecondSync::Value, len, id, index }
    }

    /// The length field: 4 + body length, which is the frame length minus 4.
    #[must_use]
    pub const fn len(&self) -> u16 {
        u16::from_le_bytes(self.len)
    }

    /// Whether the length field is 0, which no frame has; it says nothing about the body.
    #[must_use]
    pub const fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The message id, known or not.
    #[must_use]
    pub const fn id(&self) -> u8 {
        self.id
    }

    /// The sender's wrapping counter; many senders leave it at 0 (ruling U9).
    #[must_use]
    pub const fn index(&self) -> u8 {
        self.index
    }
}

impl fmt::Debug for Header {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Header")
            .field("len", &self.len())
            .field("id", &self.id())
            .field("index", &self.index())
            .finish()
    }
}

/// Makes the ids of the table of messages.
macro_rules! message_ids {
    ($(
        $(#[$doc:meta])*
        $id:ident = $number:literal { $($messages:tt)+ }
    )+) => {
        /// The ids of the known messages (ruling U4).
        #[derive(Clone, Copy, Debug, Eq, Hash, PartialEq)]
        #[cfg_attr(feature = "defmt", derive(defmt::Format))]
        #[repr(u8)]
        pub enum MessageId {
            $($(#[$doc])* $id = $number,)+
        }

        impl MessageId {
            /// The known message with this id, if there is one.
            #[must_use]
            pub const fn from_u8(id: u8) -> Option<Self> {
                Some(match id {
                    $($number => Self::$id,)+
                    _ => return None,
                })
            }
        }
    };
}

catalogue! { message_ids }
