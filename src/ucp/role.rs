//! Common to both roles: frames to be sent, and the direction of a message.

use super::{frame::Body, header::MAX_LEN, message::Message};
use crate::{encode::Encode, time::Duration};

/// Shortest period or timeout of a role: a shorter one would make its driver spin.
pub(super) const SHORTEST: Duration = Duration::from_millis(1);

/// Longest pause inside a frame that is sent: a robot of this crate gives the frame up soon after.
/// Ruling U16 allows 20 ms.
pub(super) const FRAME_PAUSE: Duration = Duration::from_millis(5);

/// Encodes a frame to the front of `buffer`; returns its length.
pub(super) fn write<B: Body>(body: B, index: u8, buffer: &mut [u8; MAX_LEN]) -> usize {
    body.frame(index).encode(buffer).map_or(0, <[u8]>::len)
}

/// Whether only a host sends this message. `None` for a message of neither side (ruling U4).
pub(super) const fn is_from_host(message: &Message<'_>) -> Option<bool> {
    Some(match message {
        Message::Ping(_)
        | Message::MotorControl(_)
        | Message::CalibrationStart(_)
        | Message::CalibrationEnd(_)
        | Message::ImuBiasAck(_)
        | Message::MagBiasAck(_)
        | Message::Biases(_)
        | Message::OtaRequest(_)
        | Message::SetNetworkState(_)
        | Message::SetNetworkStateWide(_) => true,
        Message::Pong(_)
        | Message::CalibrationStartAck(_)
        | Message::CalibrationEndAck(_)
        | Message::Report(_)
        | Message::ImuBias(_)
        | Message::MagBias(_)
        | Message::BiasRequest(_)
        | Message::OtaAck(_) => false,
        Message::Unknown(_) => return None,
    })
}
