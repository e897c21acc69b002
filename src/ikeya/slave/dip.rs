//! The DIP switch of a slave: its id and its mode (ruling I2).

use core::str::FromStr;

use crate::{
    error::EncodeError,
    ikeya::units::{Mode, NodeId},
};

/// How the three id digits of a DIP switch are read (ruling I2).
///
/// The protocol document contradicts itself: its range 1..8 and its example `0101` = id 3 need
/// [`ValuePlusOne`](Self::ValuePlusOne), its example `0010` = id 1 needs [`Value`](Self::Value).
/// The crate does not guess. To find the truth, scan ids 1..=8 with READ.
#[derive(Clone, Copy, Debug, Eq, Hash, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum IdReading {
    /// 000 is node 1, 111 is node 8.
    ValuePlusOne,
    /// 001 is node 1, 111 is node 7, and 000 is an error.
    Value,
}

/// The four DIP digits of a motor driver: three for the id, the lowest for the mode.
///
/// ```
/// use axlewire::ikeya::{slave::{DipSwitch, IdReading}, Mode, NodeId};
///
/// let dip: DipSwitch = "0101".parse()?;
/// assert_eq!(dip.mode(), Mode::Position);
/// assert_eq!(dip.node_id(IdReading::ValuePlusOne), Ok(NodeId::N3));
/// assert_eq!(dip.node_id(IdReading::Value), Ok(NodeId::N2));
/// # Ok::<(), axlewire::error::EncodeError>(())
/// ```
#[derive(Clone, Copy, Debug, Eq, Hash, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct DipSwitch(u8);

impl DipSwitch {
    /// Converts from a number: bit 0 is the lowest digit, the mode; bits 1 to 3 are the id.
    ///
    /// # Errors
    ///
    /// [`EncodeError::DipSwitch`] above `0b1111`.
    pub const fn from_bits(bits: u8) -> Result<Self, EncodeError> {
        if bits > 0b1111 {
            return Err(EncodeError::DipSwitch { bits });
        }
        Ok(Self(bits))
    }

    /// The digits as a number, 0 to `0b1111`.
    #[must_use]
    pub const fn bits(self) -> u8 {
        self.0
    }

    /// The mode, from the lowest digit: 0 is velocity, 1 is position.
    #[must_use]
    pub const fn mode(self) -> Mode {
        if self.0 & 1 == 0 { Mode::Velocity } else { Mode::Position }
    }

    /// The id in the upper three digits, in the reading that the board's maker meant.
    ///
    /// # Errors
    ///
    /// [`EncodeError::DipSwitch`] for digits 000 under [`IdReading::Value`].
    pub const fn node_id(self, reading: IdReading) -> Result<NodeId, EncodeError> {
        let id = match reading {
            IdReading::ValuePlusOne => (self.0 >> 1) + 1,
            IdReading::Value => self.0 >> 1,
        };
        match NodeId::new(id) {
            Ok(id) => Ok(id),
            Err(_) => Err(EncodeError::DipSwitch { bits: self.0 }),
        }
    }
}

/// Parses four digits as printed on a board, `"0101"`.
impl FromStr for DipSwitch {
    type Err = EncodeError;

    fn from_str(digits: &str) -> Result<Self, EncodeError> {
        match (digits.len(), u8::from_str_radix(digits, 2)) {
            (4, Ok(bits)) if !digits.starts_with('+') => Self::from_bits(bits),
            (_, Ok(bits)) => Err(EncodeError::DipSwitch { bits }),
            (_, Err(_)) => Err(EncodeError::DipSwitch { bits: u8::MAX }),
        }
    }
}
