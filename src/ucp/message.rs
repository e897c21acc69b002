//! The content of frames: the messages, their bodies and their values (ruling U4).
//!
//! [`Frame::message`] reads one, [`Body::frame`](super::Body::frame) builds one. A message prints
//! itself, as a whole or without its name: [`Message::contents`].

use core::fmt;

use zerocopy::{FromBytes, Immutable, KnownLayout};

pub use super::{
    body::{
        BiasRequest, Biases, CalibrationEnd, CalibrationEndAck, CalibrationStart,
        CalibrationStartAck, ImuBias, ImuBiasAck, MagBias, MagBiasAck, OtaAck, Ping, Pong,
        SetNetworkState, SetNetworkStateWide,
    },
    codes::{CalibrationKind, ErrorCode, NetworkState, OtaStatus},
    motor::RawMotorControl,
    report::{DocumentReport, FirmwareReport, Report},
    update::{OtaRequest, RawOtaRequest},
};
use super::{
    frame::{Frame, RawFrame},
    header::MessageId,
};

/// The message in a frame, borrowed from its body.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[expect(missing_docs, reason = "each variant is named after the body it holds")]
#[non_exhaustive]
pub enum Message<'a> {
    Ping(&'a Ping),
    Pong(&'a Pong),
    MotorControl(&'a RawMotorControl),
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
    OtaRequest(&'a RawOtaRequest),
    OtaAck(&'a OtaAck),
    SetNetworkState(&'a SetNetworkState),
    SetNetworkStateWide(&'a SetNetworkStateWide),
    /// An unknown id, or a known one with a body length that no message has (ruling U3).
    Unknown(RawFrame<'a>),
}

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

impl<'a> Message<'a> {
    /// The name in snake case, as in the JSON of `axle decode`: `ping`, `motor_control`. The two
    /// widths of a network state have one name, and so have the two layouts of a report.
    #[must_use]
    pub const fn name(&self) -> &'static str {
        match self {
            Self::Ping(_) => "ping",
            Self::Pong(_) => "pong",
            Self::MotorControl(_) => "motor_control",
            Self::CalibrationStart(_) => "calibration_start",
            Self::CalibrationStartAck(_) => "calibration_start_ack",
            Self::CalibrationEnd(_) => "calibration_end",
            Self::CalibrationEndAck(_) => "calibration_end_ack",
            Self::Report(_) => "report",
            Self::ImuBias(_) => "imu_bias",
            Self::ImuBiasAck(_) => "imu_bias_ack",
            Self::MagBias(_) => "mag_bias",
            Self::MagBiasAck(_) => "mag_bias_ack",
            Self::BiasRequest(_) => "bias_request",
            Self::Biases(_) => "biases",
            Self::OtaRequest(_) => "ota_request",
            Self::OtaAck(_) => "ota_ack",
            Self::SetNetworkState(_) | Self::SetNetworkStateWide(_) => "network_state",
            Self::Unknown(_) => "unknown",
        }
    }

    /// The id on the wire (ruling U4).
    #[must_use]
    pub const fn id(&self) -> u8 {
        let id = match self {
            Self::Ping(_) | Self::Pong(_) => MessageId::Ping,
            Self::MotorControl(_) => MessageId::MotorControl,
            Self::CalibrationStart(_) | Self::CalibrationStartAck(_) => MessageId::CalibrationStart,
            Self::CalibrationEnd(_) | Self::CalibrationEndAck(_) => MessageId::CalibrationEnd,
            Self::Report(_) => MessageId::Report,
            Self::ImuBias(_) | Self::ImuBiasAck(_) => MessageId::ImuBias,
            Self::MagBias(_) | Self::MagBiasAck(_) => MessageId::MagBias,
            Self::BiasRequest(_) | Self::Biases(_) => MessageId::Biases,
            Self::OtaRequest(_) | Self::OtaAck(_) => MessageId::Ota,
            Self::SetNetworkState(_) | Self::SetNetworkStateWide(_) => MessageId::NetworkState,
            Self::Unknown(frame) => return frame.id,
        };
        id as u8
    }

    /// Whether only a host sends it, `Some(false)` if only a robot does (ruling U4). `None` for
    /// [`Unknown`](Self::Unknown), which either side may send.
    ///
    /// ```
    /// use axlewire::ucp::{Message, message::Ping};
    ///
    /// assert_eq!(Message::Ping(&Ping {}).is_from_host(), Some(true));
    /// ```
    #[must_use]
    pub const fn is_from_host(&self) -> Option<bool> {
        Some(match self {
            Self::Ping(_)
            | Self::MotorControl(_)
            | Self::CalibrationStart(_)
            | Self::CalibrationEnd(_)
            | Self::ImuBiasAck(_)
            | Self::MagBiasAck(_)
            | Self::Biases(_)
            | Self::OtaRequest(_)
            | Self::SetNetworkState(_)
            | Self::SetNetworkStateWide(_) => true,
            Self::Pong(_)
            | Self::CalibrationStartAck(_)
            | Self::CalibrationEndAck(_)
            | Self::Report(_)
            | Self::ImuBias(_)
            | Self::MagBias(_)
            | Self::BiasRequest(_)
            | Self::OtaAck(_) => false,
            Self::Unknown(_) => return None,
        })
    }

    /// Determines the message from the id and the length of the body; the first match is the only
    /// one.
    fn of(frame: &'a Frame) -> Self {
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

/// The body as a `B`, if it has the right length.
fn cast<'a, B, T>(body: &'a [u8], variant: impl FnOnce(&'a B) -> T) -> Option<T>
where
    B: FromBytes + Immutable + KnownLayout + 'a,
{
    B::ref_from_bytes(body).ok().map(variant)
}
