//! One object with all its fields: those of every line, those of every frame, and its own.

use core::slice;

use crate::field::{Field, Time, field};

/// An object of `axle decode --json`: a frame with one message, a gap, or another line. A message
/// with two layouts has a record for each.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
#[non_exhaustive]
pub struct Record {
    /// Kind of line: `frame`, `skipped`, `protocol` or `summary`.
    pub event: &'static str,
    /// `ucp`, `ikeya` or `ikeya-3`; `None` if it is not a frame.
    pub protocol: Option<&'static str>,
    /// Name of the message; the same as `event` if it is not a frame.
    pub message: &'static str,
    /// Id of a UCP message; `None` for `unknown`, which has any.
    pub id: Option<u8>,
    /// Length of its shortest and its longest frame, bytes.
    pub length: Option<(usize, usize)>,
    /// Its own fields, in parts.
    own: &'static [&'static [Field]],
    /// The fields behind them.
    end: &'static [Field],
}

const EVENT: Field = field! {
    /// Kind of line; only in the tool's output.
    "event": &str, by "tool", of_tool()
};

/// The place of a frame or a gap.
const PLACE: [Field; 4] = [
    field! {
        /// Position of the first byte in the input; in a capture with times, in the bytes of its
        /// interface and direction; only in the tool's output.
        "offset": u64, "byte" by "tool", of_tool()
    },
    field! {
        /// When its last byte had been received, since 1970; behind a USB adapter up to 16 ms after
        /// it was on the line; only in the tool's output, if the capture has times.
        "t": Time, "s" by "tool", of_tool(), optional()
    },
    field! {
        /// Interface of a pcapng file, from 0; only in the tool's output, if the capture has times.
        "interface": u64, by "tool", of_tool(), optional()
    },
    field! {
        /// Received or sent by the recording program; only in the tool's output, where it is known.
        "direction": &str, by "tool", named(&["in", "out"]), of_tool(), optional()
    },
];

pub(crate) const LENGTH: Field = field! {
    /// Length on the wire, CRC included.
    "length": u8, "byte" by "U1, U2, I10"
};
pub(crate) const PROTOCOL: Field = field! {
    /// Protocol; `ikeya-3` for boards with three motors.
    "protocol": &str, by "I10"
};
pub(crate) const MESSAGE: Field = field! {
    /// Name of the message, in snake case.
    "message": &str, by "U4, I3"
};
pub(crate) const ID: Field = field! {
    /// Id of the message; 1 to 10 if it is known.
    "id": u8, by "U4"
};
pub(crate) const INDEX: Field = field! {
    /// The sender's counter, wrapping; many senders leave it at 0.
    "index": u8, "frame" by "U9"
};
pub(crate) const BYTES: Field = field! {
    /// The whole frame as on the wire.
    "bytes": &[u8], by "B5"
};

impl Record {
    pub(super) const fn line(event: &'static str, own: &'static [&'static [Field]]) -> Self {
        Self { event, protocol: None, message: event, id: None, length: None, own, end: &[] }
    }

    /// A frame. Behind its own fields are its `BYTES` and what else is in `end`.
    pub(crate) const fn frame(
        protocol: &'static str,
        (message, id): (&'static str, Option<u8>),
        (least, most): (usize, usize),
        own: &'static [&'static [Field]],
        end: &'static [Field],
    ) -> Self {
        let (protocol, length) = (Some(protocol), Some((least, most)));
        Self { event: "frame", protocol, message, id, length, own, end }
    }

    /// All fields, in the order of the object. `axle decode --json` has all of them; `serde` has
    /// those that are not [`is_of_tool`](Field::is_of_tool).
    pub fn fields(&'static self) -> impl Iterator<Item = Field> {
        let place: &[Field] = if matches!(self.event, "frame" | "skipped") { &PLACE } else { &[] };
        let length = self.length.map(|(least, most)| LENGTH.within(least as u64, most as u64));
        let protocol = self.protocol.as_ref().map(|name| PROTOCOL.named(slice::from_ref(name)));
        let message = self.protocol.map(|_| MESSAGE.named(slice::from_ref(&self.message)));
        let is_of_tool = matches!(self.event, "protocol" | "summary");
        let is_ucp = self.protocol == Some("ucp");
        let id = self.id.map_or(ID, |id| ID.within(id.into(), id.into()));
        let of_ucp = [is_ucp.then_some(id), is_ucp.then_some(INDEX)];
        [EVENT.named(slice::from_ref(&self.event))]
            .into_iter()
            .chain(place.iter().copied())
            .chain([length, protocol, message].into_iter().chain(of_ucp).flatten())
            .chain(self.own.iter().copied().flatten().chain(self.end).copied())
            .map(move |field| if is_of_tool { field.of_tool() } else { field })
    }
}
