//! The content of frames: the messages, their bodies and their values (ruling U4).
#![doc = include_str!("messages.md")]
//!
//! [`Frame::message`] reads one, [`Body::frame`](super::Body::frame) builds one. A message prints
//! itself, as a whole or without its name: [`Message::contents`].

use core::fmt;

use zerocopy::{FromBytes, Immutable, KnownLayout};

pub use super::{
    body::*,
    codes::*,
    motor::RawMotorControl,
    report::{DocumentReport, FirmwareReport, Report},
    update::{OtaRequest, RawOtaRequest},
};
use super::{
    catalogue::catalogue,
    frame::{Frame, RawFrame},
    header::{MAX_BODY_LEN, MessageId},
    value::Print,
};
use crate::text::Line;

impl Frame {
    /// The message in this frame.
    #[must_use]
    pub fn message(&self) -> Message<'_> {
        Message::of(self)
    }
}

impl fmt::Debug for Frame {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Frame")
            .field("id", &self.id())
            .field("index", &self.index())
            .field("message", &self.message())
            .finish()
    }
}

#[cfg(feature = "defmt")]
impl defmt::Format for Frame {
    fn format(&self, f: defmt::Formatter<'_>) {
        defmt::write!(f, "{} index {}: {}", self.id(), self.index(), self.message());
    }
}

/// What a variant of [`Message`] holds.
pub(super) trait Held<'a>: Sized {
    /// Lengths of the bodies that it can be, bytes.
    const LENGTHS: &'static [usize];

    /// Borrows it from a body, if that has the right length.
    fn of(body: &'a [u8]) -> Option<Self>;
}

impl<'a, B: FromBytes + Immutable + KnownLayout> Held<'a> for &'a B {
    const LENGTHS: &'static [usize] = &[size_of::<B>()];

    fn of(body: &'a [u8]) -> Option<Self> {
        B::ref_from_bytes(body).ok()
    }
}

impl<'a> Held<'a> for Report<'a> {
    const LENGTHS: &'static [usize] = &[size_of::<FirmwareReport>(), size_of::<DocumentReport>()];

    fn of(body: &'a [u8]) -> Option<Self> {
        let firmware = Held::of(body).map(Self::Firmware);
        firmware.or_else(|| Held::of(body).map(Self::Document))
    }
}

/// Whether the bodies of one id can be told apart by their lengths, and none is too long.
const fn are_distinct(messages: &[&[usize]]) -> bool {
    // A bit for each length that has occurred.
    let mut occurred = 0_u64;
    let mut rest = messages;
    while let [lengths, behind @ ..] = rest {
        let mut rest_of_lengths = *lengths;
        while let [length, behind @ ..] = rest_of_lengths {
            if *length > MAX_BODY_LEN || occurred & (1 << *length) != 0 {
                return false;
            }
            occurred |= 1 << *length;
            rest_of_lengths = behind;
        }
        rest = behind;
    }
    true
}

/// Makes [`Message`] of the table of messages.
macro_rules! messages {
    ($(
        $(#[$id_doc:meta])*
        $id:ident = $number:literal {$(
            $(#[$doc:meta])*
            $direction:ident $name:literal $variant:ident($held:ty) $body:tt
        )+}
    )+) => {
        /// The message in a frame, borrowed from its body.
        #[derive(Clone, Copy, Debug, Eq, PartialEq)]
        #[cfg_attr(feature = "defmt", derive(defmt::Format))]
        #[expect(missing_docs, reason = "each variant is named after the body it holds")]
        #[non_exhaustive]
        pub enum Message<'a> {
            $($($variant($held),)+)+
            /// An unknown id, or a known one with a body length that no message has (ruling U3).
            Unknown(RawFrame<'a>),
        }

        impl<'a> Message<'a> {
            /// Fails to compile if id and length do not determine the message.
            const LENGTHS_ARE_DISTINCT: () = {
                $(assert!(
                    are_distinct(&[$(<$held as Held<'a>>::LENGTHS),+]),
                    concat!(stringify!($id), ": two bodies have one length, or one is too long")
                );)+
            };

            /// The name in snake case, as in the JSON of `axle decode`: `ping`, `motor_control`.
            /// The two widths of a network state have one name, and so have the two layouts of a
            /// report.
            #[must_use]
            pub const fn name(&self) -> &'static str {
                match self {
                    $($(Self::$variant(_) => $name,)+)+
                    Self::Unknown(_) => "unknown",
                }
            }

            /// The id on the wire (ruling U4).
            #[must_use]
            pub const fn id(&self) -> u8 {
                match self {
                    $($(Self::$variant(_) => MessageId::$id as u8,)+)+
                    Self::Unknown(frame) => frame.id,
                }
            }

            /// Whether only a host sends it, `Some(false)` if only a robot does (ruling U4). `None`
            /// for [`Unknown`](Self::Unknown), which either side may send.
            ///
            /// ```
            /// use axlewire::ucp::{Message, message::Ping};
            ///
            /// assert_eq!(Message::Ping(&Ping {}).is_from_host(), Some(true));
            /// ```
            #[must_use]
            pub const fn is_from_host(&self) -> Option<bool> {
                match self {
                    $($(Self::$variant(_) => Some(is_from_host!($direction)),)+)+
                    Self::Unknown(_) => None,
                }
            }

            /// Determines the message from the id and the length of the body; the first match is
            /// the only one.
            fn of(frame: &'a Frame) -> Self {
                let body = frame.body();
                match MessageId::from_u8(frame.id()) {
                    $(Some(MessageId::$id) => {
                        $(if let Some(held) = Held::of(body) {
                            return Self::$variant(held);
                        })+
                    })+
                    None => {}
                }
                Self::Unknown(RawFrame { id: frame.id(), index: frame.index(), body })
            }

            /// Puts the fields of the message alone into `map`.
            #[cfg(feature = "serde")]
            pub(super) fn put_fields<M: serde::ser::SerializeMap>(
                &self,
                map: &mut M,
            ) -> Result<(), M::Error> {
                use crate::map::Fields;

                match self {
                    $($(Self::$variant(body) => body.put(map),)+)+
                    Self::Unknown(frame) => frame.put(map),
                }
            }
        }

        impl Print for Message<'_> {
            fn print(&self, line: &mut Line<'_>, before: &'static str) {
                match self {
                    $($(Self::$variant(body) => body.print(line, before),)+)+
                    Self::Unknown(frame) => frame.print(line, before),
                }
            }
        }
    };
}

/// Whether a message in this direction comes from a host.
macro_rules! is_from_host {
    (to_robot) => {
        true
    };
    (to_host) => {
        false
    };
}

catalogue! { messages }

const _: () = Message::LENGTHS_ARE_DISTINCT;

#[cfg(test)]
mod tests {
    use super::{MAX_BODY_LEN, are_distinct};

    #[test]
    fn messages_of_an_id_need_different_lengths_that_can_be_sent() {
        assert!(are_distinct(&[]));
        assert!(are_distinct(&[&[0]]));
        assert!(are_distinct(&[&[0], &[1], &[36, 34], &[MAX_BODY_LEN]]));
        assert!(!are_distinct(&[&[0], &[0]]));
        assert!(!are_distinct(&[&[1], &[36, 34], &[7, 36]]));
        assert!(!are_distinct(&[&[34, 34]]));
        assert!(!are_distinct(&[&[1], &[MAX_BODY_LEN + 1]]));
        assert!(!are_distinct(&[&[256]]));
    }
}
