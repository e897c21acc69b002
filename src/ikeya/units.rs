//! Node ids, speeds and positions: invalid values are unrepresentable.

use core::{f64::consts::TAU, fmt};

use zerocopy::{Immutable, IntoBytes, KnownLayout, TryFromBytes, Unaligned};

use crate::error::EncodeError;

/// Speed of the line, bit/s.
pub const BAUD: u32 = 500_000;

/// The speed of a setting: 0 means the usual one. Nothing would ever end on a line without a speed.
pub(super) const fn speed(baud: u32) -> u32 {
    if baud == 0 { BAUD } else { baud }
}

/// Address of a motor driver on the bus, 1 to 8 (ruling I1).
///
/// The master has no id on the wire; 0 and anything above 8 are not values of this type.
///
/// ```
/// use axlewire::ikeya::NodeId;
/// assert_eq!(NodeId::new(3), Ok(NodeId::N3));
/// assert!(NodeId::new(9).is_err());
/// assert_eq!(NodeId::ALL.len(), 8);
/// ```
#[derive(Clone, Copy, Debug, Eq, Hash, Ord, PartialEq, PartialOrd)]
#[derive(TryFromBytes, IntoBytes, Immutable, KnownLayout, Unaligned)]
#[cfg_attr(feature = "arbitrary", derive(arbitrary::Arbitrary))]
#[cfg_attr(feature = "bytemuck", derive(bytemuck::CheckedBitPattern, bytemuck::NoUninit))]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(try_from = "u8", into = "u8"))]
#[repr(u8)]
#[expect(missing_docs, reason = "the names say it")]
#[rustfmt::skip]
pub enum NodeId { N1 = 1, N2, N3, N4, N5, N6, N7, N8 }

impl NodeId {
    /// All nodes that a bus can have, in order.
    pub const ALL: [Self; 8] =
        [Self::N1, Self::N2, Self::N3, Self::N4, Self::N5, Self::N6, Self::N7, Self::N8];

    /// The node with this wire id.
    ///
    /// # Errors
    ///
    /// [`EncodeError::NodeId`] outside 1..=8.
    pub const fn new(id: u8) -> Result<Self, EncodeError> {
        match id {
            1 => Ok(Self::N1),
            2 => Ok(Self::N2),
            3 => Ok(Self::N3),
            4 => Ok(Self::N4),
            5 => Ok(Self::N5),
            6 => Ok(Self::N6),
            7 => Ok(Self::N7),
            8 => Ok(Self::N8),
            value => Err(EncodeError::NodeId { value }),
        }
    }

    /// The wire id, 1 to 8.
    #[must_use]
    pub const fn get(self) -> u8 {
        self as u8
    }
}

impl TryFrom<u8> for NodeId {
    type Error = EncodeError;

    fn try_from(id: u8) -> Result<Self, EncodeError> {
        Self::new(id)
    }
}

impl From<NodeId> for u8 {
    fn from(id: NodeId) -> Self {
        id.get()
    }
}

impl fmt::Display for NodeId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.get().fmt(f)
    }
}

/// What a motor driver controls: set by its DIP switch, reported in the header of its responses.
#[derive(Clone, Copy, Debug, Eq, Hash, PartialEq)]
#[cfg_attr(feature = "arbitrary", derive(arbitrary::Arbitrary))]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(rename_all = "lowercase"))]
pub enum Mode {
    /// Revolutions per second, as an `f32`.
    Velocity,
    /// Count and rotation, as two `i16`.
    Position,
}

impl fmt::Display for Mode {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(match self {
            Self::Velocity => "velocity",
            Self::Position => "position",
        })
    }
}

/// A speed in revolutions per second, always finite (ruling I4).
///
/// The sign is the direction, and -0.0 is kept. A packet may *carry* NaN or infinity, so packets
/// are read as plain `f32` and written from this type.
///
/// ```
/// use axlewire::ikeya::Rps;
/// assert_eq!(Rps::from_rpm(90.0)?.get(), 1.5);
/// assert!((Rps::new(1.0)?.rad_per_s() - 6.283_185).abs() < 1e-6);
/// assert!(Rps::new(f32::NAN).is_err());
/// # Ok::<(), axlewire::error::EncodeError>(())
/// ```
#[derive(Clone, Copy, Debug, Default, PartialEq, PartialOrd)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(try_from = "f32", into = "f32"))]
pub struct Rps(f32);

impl Rps {
    /// Zero speed.
    pub const ZERO: Self = Self(0.0);

    /// A speed in revolutions per second.
    ///
    /// # Errors
    ///
    /// [`EncodeError::NotFinite`] for NaN and infinities.
    pub const fn new(rps: f32) -> Result<Self, EncodeError> {
        if rps.is_finite() {
            Ok(Self(rps))
        } else {
            Err(EncodeError::NotFinite { value: rps as f64 })
        }
    }

    /// Converts from revolutions per minute: 60 rpm is 1 rps.
    ///
    /// # Errors
    ///
    /// [`EncodeError::NotFinite`] for NaN and infinities.
    pub const fn from_rpm(rpm: f32) -> Result<Self, EncodeError> {
        Self::new(rpm / 60.0)
    }

    /// Converts from radians per second: 2π rad/s is 1 rps.
    ///
    /// # Errors
    ///
    /// [`EncodeError::NotFinite`] for NaN and infinities.
    pub const fn from_rad_per_s(rad_per_s: f32) -> Result<Self, EncodeError> {
        Self::new(rad_per_s / core::f32::consts::TAU)
    }

    /// Revolutions per second.
    #[must_use]
    pub const fn get(self) -> f32 {
        self.0
    }

    /// Revolutions per minute; infinite above 5.7e36 rps, where `f32` overflows.
    #[must_use]
    pub const fn rpm(self) -> f32 {
        self.0 * 60.0
    }

    /// Radians per second; infinite above 5.4e37 rps, where `f32` overflows.
    #[must_use]
    pub const fn rad_per_s(self) -> f32 {
        self.0 * core::f32::consts::TAU
    }
}

impl fmt::Display for Rps {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} rps", self.get())
    }
}

impl TryFrom<f32> for Rps {
    type Error = EncodeError;

    fn try_from(rps: f32) -> Result<Self, EncodeError> {
        Self::new(rps)
    }
}

impl From<Rps> for f32 {
    fn from(rps: Rps) -> Self {
        rps.get()
    }
}

#[cfg(feature = "arbitrary")]
impl<'a> arbitrary::Arbitrary<'a> for Rps {
    fn arbitrary(u: &mut arbitrary::Unstructured<'a>) -> arbitrary::Result<Self> {
        Self::new(u.arbitrary()?).map_err(|_| arbitrary::Error::IncorrectFormat)
    }
}

/// A shaft position as carried on the wire: `rotation` turns and `count` encoder counts.
///
/// Any two `i16` are a position (ruling I4), and several pairs may mean the same one:
/// [`counts`](Self::counts) says where the shaft is. A total can be split in two ways (ruling I5):
/// truncating, the default, gives both parts the sign of the total; Euclidean gives a count of
/// 0..=8191.
///
/// ```
/// use axlewire::ikeya::Position;
///
/// assert_eq!(Position::new(4096, 1).revolutions(), 1.5);
/// let back = Position::from_counts(-12_288)?; // one and a half turns backwards
/// assert_eq!((back.count(), back.rotation()), (-4096, -1));
/// let back = Position::from_counts_euclidean(-12_288)?;
/// assert_eq!((back.count(), back.rotation()), (4096, -2));
/// assert_eq!(back.to_string(), "-1.5000 turns");
/// # Ok::<(), axlewire::error::EncodeError>(())
/// ```
#[derive(Clone, Copy, Debug, Default, Eq, Hash, PartialEq)]
#[cfg_attr(feature = "arbitrary", derive(arbitrary::Arbitrary))]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Position {
    count: i16,
    rotation: i16,
}

impl fmt::Display for Position {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{:.4} turns", self.revolutions())
    }
}

impl Position {
    /// Encoder counts per revolution: 2048 lines, four edges each.
    pub const COUNTS_PER_REVOLUTION: i32 = 8192;

    /// A position from its two wire fields; every pair is legal.
    #[must_use]
    pub const fn new(count: i16, rotation: i16) -> Self {
        Self { count, rotation }
    }

    /// A position from counts, split so that both parts have the same sign.
    ///
    /// # Errors
    ///
    /// [`EncodeError::Position`] if the rotation does not fit: outside -268,443,647..=268,435,455.
    pub const fn from_counts(counts: i32) -> Result<Self, EncodeError> {
        const LIMIT: i32 = Position::COUNTS_PER_REVOLUTION;
        const MIN: i32 = i16::MIN as i32 * LIMIT - (LIMIT - 1);
        const MAX: i32 = i16::MAX as i32 * LIMIT + (LIMIT - 1);
        if counts < MIN || counts > MAX {
            return Err(EncodeError::Position { counts: counts as i64, min: MIN, max: MAX });
        }
        Ok(Self::new((counts % LIMIT) as i16, (counts / LIMIT) as i16))
    }

    /// A position from counts, split so that the count is 0..=8191.
    ///
    /// # Errors
    ///
    /// [`EncodeError::Position`] if the rotation does not fit: outside -268,435,456..=268,435,455.
    pub const fn from_counts_euclidean(counts: i32) -> Result<Self, EncodeError> {
        const LIMIT: i32 = Position::COUNTS_PER_REVOLUTION;
        const MIN: i32 = i16::MIN as i32 * LIMIT;
        const MAX: i32 = i16::MAX as i32 * LIMIT + (LIMIT - 1);
        if counts < MIN || counts > MAX {
            return Err(EncodeError::Position { counts: counts as i64, min: MIN, max: MAX });
        }
        Ok(Self::new(counts.rem_euclid(LIMIT) as i16, counts.div_euclid(LIMIT) as i16))
    }

    /// Converts from revolutions, rounded to the nearest count, split as in
    /// [`from_counts`](Self::from_counts).
    ///
    /// # Errors
    ///
    /// [`EncodeError::NotFinite`] for NaN and infinities, [`EncodeError::Position`] out of range.
    pub fn from_revolutions(revolutions: f64) -> Result<Self, EncodeError> {
        if !revolutions.is_finite() {
            return Err(EncodeError::NotFinite { value: revolutions });
        }
        let counts = revolutions * f64::from(Self::COUNTS_PER_REVOLUTION);
        // `as` truncates and saturates, so adding half a count away from zero makes it round.
        let counts = (counts + if counts < 0.0 { -0.5 } else { 0.5 }) as i64;
        // What no i32 holds is out of range in any case.
        let near = i32::try_from(counts).unwrap_or(i32::MAX);
        Self::from_counts(near).map_err(|error| match error {
            EncodeError::Position { min, max, .. } => EncodeError::Position { counts, min, max },
            other => other,
        })
    }

    /// Converts from radians, rounded to the nearest count.
    ///
    /// # Errors
    ///
    /// Same as [`from_revolutions`](Self::from_revolutions).
    pub fn from_radians(radians: f64) -> Result<Self, EncodeError> {
        Self::from_revolutions(radians / TAU)
    }

    /// The count field: -32768..=32767, although one revolution is 8192.
    #[must_use]
    pub const fn count(self) -> i16 {
        self.count
    }

    /// The rotation field, revolutions.
    #[must_use]
    pub const fn rotation(self) -> i16 {
        self.rotation
    }

    /// The total position in encoder counts; always fits.
    #[must_use]
    pub const fn counts(self) -> i32 {
        self.rotation as i32 * Self::COUNTS_PER_REVOLUTION + self.count as i32
    }

    /// The total position in revolutions, exact.
    #[must_use]
    pub const fn revolutions(self) -> f64 {
        self.counts() as f64 / Self::COUNTS_PER_REVOLUTION as f64
    }

    /// The total position in radians.
    #[must_use]
    pub const fn radians(self) -> f64 {
        self.revolutions() * TAU
    }

    /// Reads `count | rotation`, little-endian.
    pub(crate) const fn from_le_bytes([a, b, c, d]: [u8; 4]) -> Self {
        Self::new(i16::from_le_bytes([a, b]), i16::from_le_bytes([c, d]))
    }

    /// Writes `count | rotation`, little-endian.
    pub(crate) const fn to_le_bytes(self) -> [u8; 4] {
        let ([a, b], [c, d]) = (self.count.to_le_bytes(), self.rotation.to_le_bytes());
        [a, b, c, d]
    }
}
