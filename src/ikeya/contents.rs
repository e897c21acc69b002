//! Packets of both kinds of boards as text for people: names, revolutions per second and turns.

use core::fmt;

use super::{
    framing::{Packet, Request, Response},
    three::{Packet as PacketOfThree, Request as RequestOfThree, Response as ResponseOfThree},
    units::{Mode, NodeId, Position},
};
use crate::text::Line;

/// Contents of a packet as text without its name and node, on one line, with units; empty for a
/// READ. From `contents` of a packet, such as [`Packet::contents`]; three motors give three values.
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Contents {
    values: Values,
    mode: Option<Mode>,
}

impl Contents {
    /// Limits a WRITE to the reading of its node's mode, if that is known: without it, both are
    /// shown, because the bytes do not tell a speed from a position (ruling I3).
    ///
    /// ```
    /// use axlewire::ikeya::{Mode, NodeId, Request, Rps, WriteRequest};
    ///
    /// let write = WriteRequest::velocity(NodeId::N1, Rps::new(1.5)?);
    /// let contents = Request::Write(&write).contents();
    /// assert_eq!(
    ///     contents.to_string(),
    ///     "1.5 rps or 16320.0000 turns (rotation 16320, count 0)",
    /// );
    /// assert_eq!(contents.in_mode(Mode::Velocity).to_string(), "1.5 rps");
    /// # Ok::<(), axlewire::error::EncodeError>(())
    /// ```
    #[must_use]
    pub fn in_mode(self, mode: impl Into<Option<Mode>>) -> Self {
        Self { mode: mode.into(), ..self }
    }
}

/// What a packet of either kind of board says.
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub(super) enum Values {
    /// A READ: nothing.
    None,
    /// A WRITE, in both readings (ruling I3).
    Command(Motors<f32>, Motors<Position>),
    /// Speeds, any bits.
    Speeds(Motors<f32>),
    Positions(Motors<Position>),
}

/// One value, or one for each of three motors.
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub(super) enum Motors<T> {
    One([T; 1]),
    Three([T; 3]),
}

impl<T> Motors<T> {
    pub(super) const fn as_slice(&self) -> &[T] {
        match self {
            Self::One(value) => value,
            Self::Three(values) => values,
        }
    }
}

impl From<f32> for Motors<f32> {
    fn from(speed: f32) -> Self {
        Self::One([speed])
    }
}

impl From<Position> for Motors<Position> {
    fn from(position: Position) -> Self {
        Self::One([position])
    }
}

impl<T> From<[T; 3]> for Motors<T> {
    fn from(values: [T; 3]) -> Self {
        Self::Three(values)
    }
}

/// Names, bytes and text of the packets of one kind of board.
macro_rules! printed {
    ($request:ident, $response:ident, $packet:ident, $positions:ident) => {
        impl<'a> $request<'a> {
            /// The name in snake case, as in the JSON of `axle decode`: `read_request` or `write`.
            #[must_use]
            pub const fn name(&self) -> &'static str {
                match self {
                    Self::Read(_) => "read_request",
                    Self::Write(_) => "write",
                }
            }

            /// The addressed node.
            #[must_use]
            pub const fn id(&self) -> NodeId {
                match self {
                    Self::Read(packet) => packet.id(),
                    Self::Write(packet) => packet.id(),
                }
            }

            /// The packet as bytes on the wire.
            #[must_use]
            pub fn as_bytes(&self) -> &'a [u8] {
                match self {
                    Self::Read(packet) => packet.as_bytes(),
                    Self::Write(packet) => packet.as_bytes(),
                }
            }

            /// The contents as text without name and node, for tables; see [`Contents::in_mode`].
            #[must_use]
            pub fn contents(&self) -> Contents {
                Contents { values: self.values(), mode: None }
            }

            pub(super) fn values(&self) -> Values {
                match self {
                    Self::Read(_) => Values::None,
                    Self::Write(packet) => {
                        Values::Command(packet.as_velocity().into(), packet.as_position().into())
                    }
                }
            }
        }

        impl<'a> $response<'a> {
            /// The name in snake case, as in the JSON of `axle decode`: `velocity_response` or
            /// `position_response`.
            #[must_use]
            pub const fn name(&self) -> &'static str {
                match self {
                    Self::Velocity(_) => "velocity_response",
                    Self::Position(_) => "position_response",
                }
            }

            /// The responding node.
            #[must_use]
            pub const fn id(&self) -> NodeId {
                match self {
                    Self::Velocity(packet) => packet.id(),
                    Self::Position(packet) => packet.id(),
                }
            }

            /// The packet as bytes on the wire.
            #[must_use]
            pub fn as_bytes(&self) -> &'a [u8] {
                match self {
                    Self::Velocity(packet) => packet.as_bytes(),
                    Self::Position(packet) => packet.as_bytes(),
                }
            }

            /// The contents as text without name and node, for tables.
            #[must_use]
            pub fn contents(&self) -> Contents {
                Contents { values: self.values(), mode: None }
            }

            pub(super) fn values(&self) -> Values {
                match self {
                    Self::Velocity(packet) => Values::Speeds(packet.rps().into()),
                    Self::Position(packet) => Values::Positions(packet.$positions().into()),
                }
            }
        }

        impl<'a> $packet<'a> {
            /// The name in snake case, as in the JSON of `axle decode`: `read_request`, `write`,
            /// `velocity_response` or `position_response`.
            #[must_use]
            pub const fn name(&self) -> &'static str {
                match self {
                    Self::Request(packet) => packet.name(),
                    Self::Response(packet) => packet.name(),
                }
            }

            /// The addressed or responding node.
            #[must_use]
            pub const fn id(&self) -> NodeId {
                match self {
                    Self::Request(packet) => packet.id(),
                    Self::Response(packet) => packet.id(),
                }
            }

            /// The packet as bytes on the wire.
            #[must_use]
            pub fn as_bytes(&self) -> &'a [u8] {
                match self {
                    Self::Request(packet) => packet.as_bytes(),
                    Self::Response(packet) => packet.as_bytes(),
                }
            }

            /// The contents as text without name and node, for tables; see [`Contents::in_mode`].
            #[must_use]
            pub fn contents(&self) -> Contents {
                Contents { values: self.values(), mode: None }
            }

            pub(super) fn values(&self) -> Values {
                match self {
                    Self::Request(packet) => packet.values(),
                    Self::Response(packet) => packet.values(),
                }
            }
        }

        printed!($request, $response, $packet);
    };
    ($($packet:ident),+) => {$(
        /// Name, node and contents.
        impl fmt::Display for $packet<'_> {
            fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                let mut line = Line::new(f);
                line.text(self.name());
                line.text(", node ");
                line.integer(self.id().get().into(), 0);
                let contents = self.contents();
                if !matches!(contents.values, Values::None) {
                    line.text(": ");
                    contents.print(&mut line);
                }
                line.end()
            }
        }
    )+};
}

printed!(Request, Response, Packet, position);
printed!(RequestOfThree, ResponseOfThree, PacketOfThree, positions);

impl fmt::Display for Contents {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut line = Line::new(f);
        self.print(&mut line);
        line.end()
    }
}

impl Contents {
    fn print(&self, line: &mut Line<'_>) {
        match (&self.values, self.mode) {
            (Values::None, _) => {}
            (Values::Command(speed, position), None) => {
                speeds(line, speed);
                line.text(" or ");
                positions(line, position);
            }
            (Values::Command(speed, _), Some(Mode::Velocity)) | (Values::Speeds(speed), _) => {
                speeds(line, speed);
            }
            (Values::Command(_, position), Some(Mode::Position))
            | (Values::Positions(position), _) => positions(line, position),
        }
    }
}

fn speeds(line: &mut Line<'_>, speeds: &Motors<f32>) {
    line.spaced(speeds.as_slice(), |line, speed| line.float(*speed));
    line.text(" rps");
}

fn positions(line: &mut Line<'_>, positions: &Motors<Position>) {
    let positions = positions.as_slice();
    line.spaced(positions, |line, position| turns(line, *position));
    line.text(" turns (rotation ");
    line.spaced(positions, |line, position| line.integer(position.rotation().into(), 0));
    line.text(", count ");
    line.spaced(positions, |line, position| line.integer(position.count().into(), 0));
    line.text(")");
}

/// Turns to four decimals, rounded half to even, as core rounds [`Position::revolutions`].
fn turns(line: &mut Line<'_>, position: Position) {
    const COUNTS: u32 = Position::COUNTS_PER_REVOLUTION as u32;
    let counts = position.counts().unsigned_abs();
    let (whole, scaled) = (counts / COUNTS, counts % COUNTS * 10_000);
    let (floor, rest) = (scaled / COUNTS, scaled % COUNTS);
    let rounds_up = 2 * rest > COUNTS || (2 * rest == COUNTS && floor % 2 == 1);
    let magnitude = whole * 10_000 + floor + u32::from(rounds_up);
    line.fixed::<4>(position.counts() < 0, magnitude, 0);
}
