//! The bodies, in the order of their ids (ruling U4). All numbers are little-endian (B5).

use zerocopy::{FromBytes, Immutable, IntoBytes, KnownLayout, Unaligned};

use super::{
    CalibrationKind, ErrorCode, Frame, FrameOf, MessageId, NetworkState, OtaStatus, RawFrame,
    Report,
};
use crate::error::EncodeError;

/// The body of a known message: a struct of bytes that knows its id.
///
/// Which message a frame holds follows from its id and the length of its body, so no two bodies
/// share both. Implemented by this crate's bodies and by nothing else.
pub trait Body:
    FromBytes + IntoBytes + Immutable + KnownLayout + Unaligned + Copy + sealed::Sealed
{
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

/// Declares bodies: a struct of private byte fields, alignment 1, and the id it travels under.
macro_rules! body {
    ($(
        $(#[$meta:meta])*
        pub struct $name:ident($id:ident) { $($field:ident: $ty:ty),* }
    )+) => {$(
        $(#[$meta])*
        #[derive(Clone, Copy, Debug, Eq, Hash, PartialEq)]
        #[derive(
            zerocopy::FromBytes, zerocopy::IntoBytes, zerocopy::Immutable, zerocopy::KnownLayout,
            zerocopy::Unaligned,
        )]
        #[cfg_attr(feature = "bytemuck", derive(bytemuck::Pod, bytemuck::Zeroable))]
        #[cfg_attr(feature = "defmt", derive(defmt::Format))]
        #[repr(C)]
        pub struct $name { $($field: $ty),* }

        impl $crate::ucp::message::sealed::Sealed for $name {}

        impl $crate::ucp::message::Body for $name {
            const ID: $crate::ucp::MessageId = $crate::ucp::MessageId::$id;
        }
    )+};
}
pub(super) use body;

body! {
    /// Host to robot: are you there? No body.
    pub struct Ping(Ping) {}

    /// Robot to host, answers a ping: `err`, 1 byte.
    pub struct Pong(Ping) { err: u8 }

    /// Host to robot, speed, turn and lamp: eight fields, 16 bytes.
    ///
    /// `speed: i16 | angular: i16 | front_led: i16 | back_led: i16 | version: u16 | reserve1: u16 |
    /// reserve2: u32`
    ///
    /// A constructor leaves everything behind `front_led` at 0, because a `version` above 38
    /// starts a firmware update in a shipped robot (ruling U7). A *received* command keeps all its
    /// fields, and so does a copy of it: ask [`starts_update`](Self::starts_update) before
    /// relaying one.
    ///
    /// The robot stops after 500 ms without a valid command, so repeat it every 100 ms (U10).
    pub struct MotorControl(MotorControl) {
        speed: [u8; 2],
        angular: [u8; 2],
        front_led: [u8; 2],
        back_led: [u8; 2],
        version: [u8; 2],
        reserve1: [u8; 2],
        reserve2: [u8; 4]
    }

    /// Host to robot, begins a calibration: `type`, 1 byte (ruling U11).
    pub struct CalibrationStart(CalibrationStart) { kind: u8 }

    /// Robot to host, answers at once: `type | err`, 2 bytes.
    pub struct CalibrationStartAck(CalibrationStart) { kind: u8, err: u8 }

    /// Host to robot, ends a calibration: `type`, 1 byte (ruling U11).
    pub struct CalibrationEnd(CalibrationEnd) { kind: u8 }

    /// Robot to host, answers at once: `type | err`, 2 bytes.
    ///
    /// The vendor firmware tells the type of the last *start* here.
    pub struct CalibrationEndAck(CalibrationEnd) { kind: u8, err: u8 }

    /// Robot to host, the result of an IMU calibration: `acc: 3 × i16 | gyro: 3 × i16`, 12 bytes.
    ///
    /// Repeated every 1000 ms until acknowledged; the robot does not store it (ruling U11).
    pub struct ImuBias(ImuBias) { acc: [[u8; 2]; 3], gyro: [[u8; 2]; 3] }

    /// Host to robot, acknowledges an [`ImuBias`]: `err`, 1 byte.
    pub struct ImuBiasAck(ImuBias) { err: u8 }

    /// Robot to host, the result of a magnetometer calibration: `mag: 3 × i16`, 6 bytes.
    ///
    /// Repeated every 1000 ms until acknowledged; the robot does not store it (ruling U11).
    pub struct MagBias(MagBias) { mag: [[u8; 2]; 3] }

    /// Host to robot, acknowledges a [`MagBias`]: `err`, 1 byte.
    pub struct MagBiasAck(MagBias) { err: u8 }

    /// Robot to host, asks for the stored biases at boot, every 1000 ms until answered. No body.
    pub struct BiasRequest(Biases) {}

    /// Host to robot, the stored biases: `err | acc: 3 × i16 | gyro: 3 × i16 | mag: 3 × i16`, 19
    /// bytes. The vendor firmware takes them whatever `err` says.
    pub struct Biases(Biases) {
        err: u8,
        acc: [[u8; 2]; 3],
        gyro: [[u8; 2]; 3],
        mag: [[u8; 2]; 3]
    }

    /// Host to robot, **starts a firmware update** where `version: i16` is above the robot's own,
    /// 2 bytes. The robot then leaves this protocol and waits for YMODEM on the same line.
    pub struct OtaRequest(Ota) { version: [u8; 2] }

    /// Robot to host, answers an [`OtaRequest`]: `err`, 1 byte. Shipped robots never send it.
    pub struct OtaAck(Ota) { status: u8 }

    /// Host to robot, state of the host's network: 1 byte, what a host should send (ruling U8).
    pub struct SetNetworkState(NetworkState) { state: u8 }

    /// Host to robot, state of the host's network in the 4 bytes that a Linux `enum` takes.
    /// Read, never built.
    pub struct SetNetworkStateWide(NetworkState) { state: [u8; 4] }
}

impl Pong {
    /// Answers a ping.
    #[must_use]
    pub fn new(err: ErrorCode) -> Self {
        Self { err: err.into() }
    }

    /// Whether the ping arrived undamaged (ruling U12).
    #[must_use]
    pub fn err(&self) -> ErrorCode {
        self.err.into()
    }
}

impl MotorControl {
    /// Stand still, lamp off.
    pub const STOP: Self = Self {
        speed: [0; 2],
        angular: [0; 2],
        front_led: [0; 2],
        back_led: [0; 2],
        version: [0; 2],
        reserve1: [0; 2],
        reserve2: [0; 4],
    };

    /// Largest magnitude of `speed` and `angular`.
    pub const LIMIT: i16 = 100;

    /// Value of `front_led` that means on.
    const LAMP_ON: i16 = 100;

    /// Newest firmware version that a command can carry without starting an update.
    const LAST_HARMLESS_VERSION: i16 = 38;

    /// Drives at `speed`, positive forward, with the wire's own `angular`; both -100..=100.
    ///
    /// The document says that a positive `angular` turns left; the vendor firmware and three host
    /// programs turn right (ruling U6). [`turn_right`](Self::turn_right) and
    /// [`turn_left`](Self::turn_left) do as the firmware does.
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

    /// Drives at `speed` and turns right by `turn`, 0..=100: a positive `angular` (ruling U6).
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

    /// Drives at `speed` and turns left by `turn`, 0..=100: a negative `angular` (ruling U6).
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

    /// The same command with the front lamp on (100) or off (0).
    #[must_use]
    pub const fn with_front_led(self, on: bool) -> Self {
        let front_led = if on { Self::LAMP_ON } else { 0 };
        Self { front_led: front_led.to_le_bytes(), ..self }
    }

    /// Speed, positive forward; -100..=100 unless the sender was careless.
    #[must_use]
    pub const fn speed(&self) -> i16 {
        i16::from_le_bytes(self.speed)
    }

    /// Turn, positive to the right in the vendor firmware (ruling U6).
    #[must_use]
    pub const fn angular(&self) -> i16 {
        i16::from_le_bytes(self.angular)
    }

    /// Lamp field: 100 on, 0 off.
    #[must_use]
    pub const fn front_led(&self) -> i16 {
        i16::from_le_bytes(self.front_led)
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

    /// Would this command start a firmware update in a shipped robot (ruling U7)?
    #[must_use]
    pub const fn starts_update(&self) -> bool {
        i16::from_le_bytes(self.version) > Self::LAST_HARMLESS_VERSION
    }
}

impl CalibrationStart {
    /// Begins a calibration.
    #[must_use]
    pub fn new(kind: CalibrationKind) -> Self {
        Self { kind: kind.into() }
    }

    /// What is to be calibrated.
    #[must_use]
    pub fn kind(&self) -> CalibrationKind {
        self.kind.into()
    }
}

impl CalibrationStartAck {
    /// Answers a [`CalibrationStart`].
    #[must_use]
    pub fn new(kind: CalibrationKind, err: ErrorCode) -> Self {
        Self { kind: kind.into(), err: err.into() }
    }

    /// What is being calibrated.
    #[must_use]
    pub fn kind(&self) -> CalibrationKind {
        self.kind.into()
    }

    /// Whether the request arrived undamaged.
    #[must_use]
    pub fn err(&self) -> ErrorCode {
        self.err.into()
    }
}

impl CalibrationEnd {
    /// Ends a calibration; the result follows later.
    #[must_use]
    pub fn new(kind: CalibrationKind) -> Self {
        Self { kind: kind.into() }
    }

    /// What was calibrated.
    #[must_use]
    pub fn kind(&self) -> CalibrationKind {
        self.kind.into()
    }
}

impl CalibrationEndAck {
    /// Answers a [`CalibrationEnd`].
    #[must_use]
    pub fn new(kind: CalibrationKind, err: ErrorCode) -> Self {
        Self { kind: kind.into(), err: err.into() }
    }

    /// What was calibrated.
    #[must_use]
    pub fn kind(&self) -> CalibrationKind {
        self.kind.into()
    }

    /// Whether the request arrived undamaged.
    #[must_use]
    pub fn err(&self) -> ErrorCode {
        self.err.into()
    }
}

impl ImuBias {
    /// Biases in the raw units of the [report](Report): x, y, z.
    #[must_use]
    pub fn new(acc: [i16; 3], gyro: [i16; 3]) -> Self {
        Self { acc: acc.map(i16::to_le_bytes), gyro: gyro.map(i16::to_le_bytes) }
    }

    /// Accelerometer biases x, y, z, raw.
    #[must_use]
    pub fn acc(&self) -> [i16; 3] {
        self.acc.map(i16::from_le_bytes)
    }

    /// Gyroscope biases x, y, z, raw.
    #[must_use]
    pub fn gyro(&self) -> [i16; 3] {
        self.gyro.map(i16::from_le_bytes)
    }
}

impl ImuBiasAck {
    /// Acknowledges an [`ImuBias`].
    #[must_use]
    pub fn new(err: ErrorCode) -> Self {
        Self { err: err.into() }
    }

    /// Whether it arrived undamaged; the vendor firmware ignores it.
    #[must_use]
    pub fn err(&self) -> ErrorCode {
        self.err.into()
    }
}

impl MagBias {
    /// Biases in the raw units of the [report](Report): x, y, z.
    #[must_use]
    pub fn new(mag: [i16; 3]) -> Self {
        Self { mag: mag.map(i16::to_le_bytes) }
    }

    /// Magnetometer biases x, y, z, raw.
    #[must_use]
    pub fn mag(&self) -> [i16; 3] {
        self.mag.map(i16::from_le_bytes)
    }
}

impl MagBiasAck {
    /// Acknowledges a [`MagBias`].
    #[must_use]
    pub fn new(err: ErrorCode) -> Self {
        Self { err: err.into() }
    }

    /// Whether it arrived undamaged; the vendor firmware ignores it.
    #[must_use]
    pub fn err(&self) -> ErrorCode {
        self.err.into()
    }
}

impl Biases {
    /// What the host has kept from the last calibrations.
    #[must_use]
    pub fn new(imu: ImuBias, mag: MagBias) -> Self {
        Self { err: ErrorCode::Fine.into(), acc: imu.acc, gyro: imu.gyro, mag: mag.mag }
    }

    /// 0 unless the host has reason to say otherwise; the vendor firmware ignores it.
    #[must_use]
    pub fn err(&self) -> ErrorCode {
        self.err.into()
    }

    /// The same biases with another `err`.
    #[must_use]
    pub fn with_err(self, err: ErrorCode) -> Self {
        Self { err: err.into(), ..self }
    }

    /// The accelerometer and gyroscope part.
    #[must_use]
    pub const fn imu(&self) -> ImuBias {
        ImuBias { acc: self.acc, gyro: self.gyro }
    }

    /// The magnetometer part.
    #[must_use]
    pub const fn mag(&self) -> MagBias {
        MagBias { mag: self.mag }
    }
}

impl OtaRequest {
    /// **Starts a firmware update** in a robot whose firmware is older than `version`.
    #[must_use]
    pub const fn start_firmware_update(version: i16) -> Self {
        Self { version: version.to_le_bytes() }
    }

    /// The version on offer.
    #[must_use]
    pub const fn version(&self) -> i16 {
        i16::from_le_bytes(self.version)
    }
}

impl OtaAck {
    /// Answers an [`OtaRequest`].
    #[must_use]
    pub fn new(status: OtaStatus) -> Self {
        Self { status: status.into() }
    }

    /// What the robot makes of the request.
    #[must_use]
    pub fn status(&self) -> OtaStatus {
        self.status.into()
    }
}

impl SetNetworkState {
    /// Tells the robot which state its lamp is to show; `None` for a state above 255, which one
    /// byte cannot carry.
    #[must_use]
    pub fn new(state: NetworkState) -> Option<Self> {
        Some(Self { state: u8::try_from(u32::from(state)).ok()? })
    }

    /// The state.
    #[must_use]
    pub fn state(&self) -> NetworkState {
        u32::from(self.state).into()
    }
}

impl SetNetworkStateWide {
    /// The state.
    #[must_use]
    pub fn state(&self) -> NetworkState {
        u32::from_le_bytes(self.state).into()
    }
}

/// What a frame says, borrowed from its body.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[expect(missing_docs, reason = "each variant is the body it holds")]
#[non_exhaustive]
pub enum Message<'a> {
    Ping(&'a Ping),
    Pong(&'a Pong),
    MotorControl(&'a MotorControl),
    CalibrationStart(&'a CalibrationStart),
    CalibrationStartAck(&'a CalibrationStartAck),
    CalibrationEnd(&'a CalibrationEnd),
    CalibrationEndAck(&'a CalibrationEndAck),
    Report(Report<'a>),
    ImuBias(&'a ImuBias),
    ImuBiasAck(&'a ImuBiasAck),
    MagBias(&'a MagBias),
    MagBiasAck(&'a MagBiasAck),
    BiasRequest(&'a BiasRequest),
    Biases(&'a Biases),
    OtaRequest(&'a OtaRequest),
    OtaAck(&'a OtaAck),
    SetNetworkState(&'a SetNetworkState),
    SetNetworkStateWide(&'a SetNetworkStateWide),
    /// An unknown id, or a known one with a body that no message has (ruling U3).
    Unknown(RawFrame<'a>),
}

impl<'a> Message<'a> {
    /// Tells the message from the id and the length of the body; the first that fits is the only
    /// one that does.
    pub(super) fn of(frame: &'a Frame) -> Self {
        let body = frame.body();
        let unknown = Self::Unknown(RawFrame { id: frame.id(), index: frame.index(), body });
        let Some(id) = MessageId::from_u8(frame.id()) else { return unknown };
        match id {
            MessageId::Ping => cast(body, Self::Ping).or_else(|| cast(body, Self::Pong)),
            MessageId::MotorControl => cast(body, Self::MotorControl),
            MessageId::CalibrationStart => {
                cast(body, Self::CalibrationStart).or_else(|| cast(body, Self::CalibrationStartAck))
            }
            MessageId::CalibrationEnd => {
                cast(body, Self::CalibrationEnd).or_else(|| cast(body, Self::CalibrationEndAck))
            }
            MessageId::Report => cast(body, Report::Firmware)
                .or_else(|| cast(body, Report::Document))
                .map(Self::Report),
            MessageId::ImuBias => {
                cast(body, Self::ImuBias).or_else(|| cast(body, Self::ImuBiasAck))
            }
            MessageId::MagBias => {
                cast(body, Self::MagBias).or_else(|| cast(body, Self::MagBiasAck))
            }
            MessageId::Biases => cast(body, Self::BiasRequest).or_else(|| cast(body, Self::Biases)),
            MessageId::Ota => cast(body, Self::OtaRequest).or_else(|| cast(body, Self::OtaAck)),
            MessageId::NetworkState => {
                cast(body, Self::SetNetworkState).or_else(|| cast(body, Self::SetNetworkStateWide))
            }
        }
        .unwrap_or(unknown)
    }
}

/// The body as a `B` if it has the length of one.
fn cast<'a, B: Body + 'a, T>(body: &'a [u8], variant: impl FnOnce(&'a B) -> T) -> Option<T> {
    B::ref_from_bytes(body).ok().map(variant)
}
