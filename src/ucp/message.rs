//! The content of frames: the messages, their bodies and their values (ruling U4).
//!
//! [`Frame::message`] reads one, [`Body::frame`](super::Body::frame) builds one.

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

#[cfg(feature = "defmt")]
impl defmt::Format for Frame {
    fn format(&self, f: defmt::Formatter<'_>) {
        defmt::write!(f, "{} index {}: {}", self.id(), self.index(), self.message());
    }
}

impl<'a> Message<'a> {
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
