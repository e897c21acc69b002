//! Motor commands: those that may be sent, and those that were received.

use zerocopy::{FromBytes, Immutable, IntoBytes, KnownLayout, Unaligned, transmute};

use super::{
    frame::{Body, debug_values, sealed::Sealed},
    header::MessageId,
};
use crate::error::EncodeError;

/// Host to robot: speed, turn and lamp, 16 bytes. Always harmless (ruling U7).
///
/// `speed: i16 | angular: i16 | front_led: i16 | 10 bytes of 0`
///
/// Speed and turn are -100..=100, the lamp is 100 or 0. The last ten bytes are `back_led`,
/// `version` and the reserved fields, all 0: a `version` above 38 starts a firmware update in a
/// shipped robot. No bytes can be cast to this type. A received command is a [`RawMotorControl`];
/// `try_from` converts it to this type if it is in range and starts no update.
///
/// The robot stops after 500 ms without a valid command, so repeat the command every 100 ms (U10).
///
/// # Steering
///
/// `angular` is a steering wheel, not a yaw rate (ruling U6). The vendor's firmware drives the left
/// wheels at `speed * (100 + 0.7 * angular) / 100` and the right ones at
/// `speed * (100 - 0.7 * angular) / 100`, both limited to 100 %:
///
/// | speed, angular | left, right | the nose swings |
/// |---|---|---|
/// | 60, 50 | 81, 39 | right |
/// | -60, 50 | -81, -39 | **left** |
/// | 0, 50 | 35, -35 | right, on the spot |
///
/// So a positive `angular` turns the nose right when driving forward or on the spot, and the
/// *other* way in reverse, like a car with its wheel turned right. [`turn_right`](Self::turn_right)
/// and [`turn_left`](Self::turn_left) turn the wheel; [`yaw_right`](Self::yaw_right) and
/// [`yaw_left`](Self::yaw_left) turn the nose, in reverse too.
///
/// A speed of -5..=5 counts as 0: the robot then turns on the spot if `angular` is beyond ±10.
#[derive(Clone, Copy, Eq, Hash, PartialEq)]
#[derive(IntoBytes, Immutable, KnownLayout, Unaligned)]
#[cfg_attr(feature = "bytemuck", derive(bytemuck::NoUninit))]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[repr(C)]
pub struct MotorControl {
    speed: [u8; 2],
    angular: [u8; 2],
    front_led: [u8; 2],
    zero: [u8; 10],
}

/// Limits a percentage to -100..=100.
const fn limited(percent: i32) -> i16 {
    if percent > 100 {
        100
    } else if percent < -100 {
        -100
    } else {
        percent as i16
    }
}

debug_values! { MotorControl: speed, angular, front_led }

impl Sealed for MotorControl {}

impl Body for MotorControl {
    const ID: MessageId = MessageId::MotorControl;
}

impl MotorControl {
    /// Standstill, lamp off.
    pub const STOP: Self =
        Self { speed: [0; 2], angular: [0; 2], front_led: [0; 2], zero: [0; 10] };

    /// Largest magnitude of `speed` and `angular`.
    pub const LIMIT: i16 = 100;

    /// Largest magnitude of a speed that the vendor's firmware treats as 0 (ruling U6).
    pub(crate) const SPEED_DEAD_BAND: i16 = 5;

    /// Value of `front_led` for on.
    const LAMP_ON: i16 = 100;

    /// Drives at `speed`, positive forward, with the raw wire value `angular`; both -100..=100.
    ///
    /// The document says that a positive `angular` turns left; the vendor firmware and three host
    /// programs turn right (ruling U6). [`turn_right`](Self::turn_right) and
    /// [`turn_left`](Self::turn_left) follow the firmware.
    ///
    /// # Errors
    ///
    /// [`EncodeError::Percent`] out of range: nothing is clamped.
    ///
    /// ```
    /// use axlewire::ucp::{Body, MotorControl};
    /// let frame = MotorControl::new(60, 0)?.with_front_led(true).frame(0);
    /// assert_eq!(frame.as_bytes()[..10], [0xFD, 0xFF, 0x14, 0x00, 0x02, 0x00, 60, 0, 0, 0]);
    /// assert!(MotorControl::new(101, 0).is_err());
    /// # Ok::<(), axlewire::error::EncodeError>(())
    /// ```
    pub const fn new(speed: i16, angular: i16) -> Result<Self, EncodeError> {
        let (min, max) = (-Self::LIMIT, Self::LIMIT);
        if speed < min || speed > max {
            return Err(EncodeError::Percent { value: speed, min, max });
        }
        if angular < min || angular > max {
            return Err(EncodeError::Percent { value: angular, min, max });
        }
        Ok(Self { speed: speed.to_le_bytes(), angular: angular.to_le_bytes(), ..Self::STOP })
    }

    /// Drives at `speed` with the steering wheel turned right by `turn`, 0..=100: a positive
    /// `angular` (ruling U6).
    ///
    /// Forward and on the spot the nose swings right. In reverse (`speed` below -5) it swings
    /// *left*: see [Steering](Self#steering), and [`yaw_right`](Self::yaw_right).
    ///
    /// # Errors
    ///
    /// [`EncodeError::Percent`] for a speed outside -100..=100 or a turn outside 0..=100.
    pub const fn turn_right(speed: i16, turn: i16) -> Result<Self, EncodeError> {
        let (min, max) = (0, Self::LIMIT);
        if turn < min || turn > max {
            return Err(EncodeError::Percent { value: turn, min, max });
        }
        Self::new(speed, turn)
    }

    /// Drives at `speed` with the steering wheel turned left by `turn`, 0..=100: a negative
    /// `angular` (ruling U6).
    ///
    /// Forward and on the spot the nose swings left. In reverse (`speed` below -5) it swings
    /// *right*: see [Steering](Self#steering), and [`yaw_left`](Self::yaw_left).
    ///
    /// # Errors
    ///
    /// [`EncodeError::Percent`] for a speed outside -100..=100 or a turn outside 0..=100.
    pub const fn turn_left(speed: i16, turn: i16) -> Result<Self, EncodeError> {
        match Self::turn_right(speed, turn) {
            Ok(_) => Self::new(speed, -turn),
            Err(error) => Err(error),
        }
    }

    /// Drives at `speed` and swings the nose right by `turn`, 0..=100, whatever the direction of
    /// travel: in reverse the steering wheel is turned left (ruling U6).
    ///
    /// A speed of 0 turns on the spot if `turn` is above 10. This is still no yaw rate: how fast
    /// the nose swings also depends on the speed.
    ///
    /// # Errors
    ///
    /// [`EncodeError::Percent`] for a speed outside -100..=100 or a turn outside 0..=100.
    ///
    /// ```
    /// use axlewire::ucp::MotorControl;
    /// assert_eq!(MotorControl::yaw_right(60, 50)?, MotorControl::turn_right(60, 50)?);
    /// assert_eq!(MotorControl::yaw_right(-60, 50)?, MotorControl::turn_left(-60, 50)?);
    /// assert_eq!(MotorControl::yaw_right(0, 50)?, MotorControl::turn_right(0, 50)?);
    /// # Ok::<(), axlewire::error::EncodeError>(())
    /// ```
    pub const fn yaw_right(speed: i16, turn: i16) -> Result<Self, EncodeError> {
        if speed < -Self::SPEED_DEAD_BAND {
            Self::turn_left(speed, turn)
        } else {
            Self::turn_right(speed, turn)
        }
    }

    /// Drives at `speed` and swings the nose left by `turn`, 0..=100, whatever the direction of
    /// travel: in reverse the steering wheel is turned right (ruling U6).
    ///
    /// # Errors
    ///
    /// Same as [`yaw_right`](Self::yaw_right).
    pub const fn yaw_left(speed: i16, turn: i16) -> Result<Self, EncodeError> {
        if speed < -Self::SPEED_DEAD_BAND {
            Self::turn_right(speed, turn)
        } else {
            Self::turn_left(speed, turn)
        }
    }

    /// The same command with the front lamp on (100) or off (0).
    #[must_use]
    pub const fn with_front_led(self, on: bool) -> Self {
        let front_led = if on { Self::LAMP_ON } else { 0 };
        Self { front_led: front_led.to_le_bytes(), ..self }
    }

    /// Speed, -100..=100, positive forward.
    #[must_use]
    pub const fn speed(&self) -> i16 {
        i16::from_le_bytes(self.speed)
    }

    /// Turn of the steering wheel, -100..=100, positive to the right in the vendor firmware (U6).
    #[must_use]
    pub const fn angular(&self) -> i16 {
        i16::from_le_bytes(self.angular)
    }

    /// Lamp field: 100 on, 0 off.
    #[must_use]
    pub const fn front_led(&self) -> i16 {
        i16::from_le_bytes(self.front_led)
    }

    /// Speeds of the left and right wheels, -100..=100 percent, positive forward: for a robot that
    /// should steer like the vendor's firmware, see [Steering](Self#steering).
    ///
    /// Both are 0 if neither speed nor `angular` is beyond its dead band; the vendor's wheels then
    /// creep on in the direction of the previous command, at up to 8 %. From -5 to 5 `angular` does
    /// not steer.
    ///
    /// ```
    /// use axlewire::ucp::MotorControl;
    /// assert_eq!(MotorControl::new(60, 50)?.wheels_pct(), (81, 39));
    /// assert_eq!(MotorControl::new(-60, 50)?.wheels_pct(), (-81, -39));
    /// assert_eq!(MotorControl::new(0, 50)?.wheels_pct(), (35, -35));
    /// assert_eq!(MotorControl::STOP.wheels_pct(), (0, 0));
    /// # Ok::<(), axlewire::error::EncodeError>(())
    /// ```
    #[must_use]
    pub const fn wheels_pct(&self) -> (i16, i16) {
        let (speed, angular) = (self.speed() as i32, self.angular() as i32);
        let (left, right) = match (speed, angular) {
            (-5..=5, -10..=10) => (0, 0),
            (-5..=5, _) => (7 * angular / 10, -7 * angular / 10),
            (_, -5..=5) => (speed, speed),
            _ => (speed * (1000 + 7 * angular) / 1000, speed * (1000 - 7 * angular) / 1000),
        };
        (limited(left), limited(right))
    }

    /// Whether the command is neither to drive nor to turn.
    #[must_use]
    pub const fn stands_still(&self) -> bool {
        self.speed() == 0 && self.angular() == 0
    }

    /// Speed and turn 0, the lamp unchanged: a stop does not make a robot harder to see.
    pub(super) const fn halted(&self) -> Self {
        Self { front_led: self.front_led, ..Self::STOP }
    }
}

/// Converts a received command that may be sent: speed, turn, and the lamp on or off as the vendor
/// firmware reads it. All other fields become 0.
///
/// Fails with [`EncodeError::StartsUpdate`] or [`EncodeError::Percent`] (ruling U7).
impl TryFrom<RawMotorControl> for MotorControl {
    type Error = EncodeError;

    fn try_from(received: RawMotorControl) -> Result<Self, EncodeError> {
        if received.starts_update() {
            return Err(EncodeError::StartsUpdate { version: received.version() });
        }
        let command = Self::new(received.speed(), received.angular())?;
        Ok(command.with_front_led(received.lamp_is_on()))
    }
}

/// A motor command as received: eight fields, 16 bytes, any values.
///
/// `speed: i16 | angular: i16 | front_led: i16 | back_led: i16 | version: u16 | reserve1: u16 |
/// reserve2: u32`
///
/// It may be out of range, and it may start a firmware update (ruling U7): see
/// [`starts_update`](Self::starts_update). Therefore it cannot be framed. `MotorControl::try_from`
/// turns it into a harmless command; [`Frame::relay_unchecked`](super::Frame::relay_unchecked)
/// passes on its frame, byte for byte.
///
/// ```compile_fail
/// use axlewire::ucp::{message::RawMotorControl, Body};
/// fn send(received: RawMotorControl) {
///     let _ = received.frame(0); // no such method
/// }
/// ```
#[derive(Clone, Copy, Eq, Hash, PartialEq)]
#[derive(FromBytes, IntoBytes, Immutable, KnownLayout, Unaligned)]
#[cfg_attr(feature = "bytemuck", derive(bytemuck::Pod, bytemuck::Zeroable))]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[repr(C)]
pub struct RawMotorControl {
    speed: [u8; 2],
    angular: [u8; 2],
    front_led: [u8; 2],
    back_led: [u8; 2],
    version: [u8; 2],
    reserve1: [u8; 2],
    reserve2: [u8; 4],
}

debug_values! {
    RawMotorControl: speed, angular, front_led, back_led, version, reserve1, reserve2
}

impl RawMotorControl {
    /// Newest firmware version that a command can carry without starting an update.
    const LAST_HARMLESS_VERSION: i16 = 38;

    /// Speed, positive forward; -100..=100 from a correct sender.
    #[must_use]
    pub const fn speed(&self) -> i16 {
        i16::from_le_bytes(self.speed)
    }

    /// Turn of the steering wheel, positive to the right in the vendor firmware (ruling U6).
    #[must_use]
    pub const fn angular(&self) -> i16 {
        i16::from_le_bytes(self.angular)
    }

    /// Lamp field: 100 on, 0 off.
    #[must_use]
    pub const fn front_led(&self) -> i16 {
        i16::from_le_bytes(self.front_led)
    }

    /// Whether the vendor firmware lights the lamp. It checks only the low byte.
    #[must_use]
    pub const fn lamp_is_on(&self) -> bool {
        !matches!(self.front_led[0], 0x00 | 0xFF)
    }

    /// Reserved by the document.
    #[must_use]
    pub const fn back_led(&self) -> i16 {
        i16::from_le_bytes(self.back_led)
    }

    /// Reserved by the document; see [`starts_update`](Self::starts_update).
    #[must_use]
    pub const fn version(&self) -> u16 {
        u16::from_le_bytes(self.version)
    }

    /// Reserved by the document.
    #[must_use]
    pub const fn reserve1(&self) -> u16 {
        u16::from_le_bytes(self.reserve1)
    }

    /// Reserved by the document.
    #[must_use]
    pub const fn reserve2(&self) -> u32 {
        u32::from_le_bytes(self.reserve2)
    }

    /// Whether this command would start a firmware update in a shipped robot (ruling U7).
    #[must_use]
    pub const fn starts_update(&self) -> bool {
        i16::from_le_bytes(self.version) > Self::LAST_HARMLESS_VERSION
    }
}

impl From<MotorControl> for RawMotorControl {
    fn from(command: MotorControl) -> Self {
        transmute!(command)
    }
}
