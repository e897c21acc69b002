//! The frames that a robot sends, and the answers that are due.

use super::repeat::Beat;
use crate::{
    time::Instant,
    ucp::{
        body::{BiasRequest, ImuBias, MagBias},
        codes::{CalibrationKind, OtaStatus},
    },
};

/// Answers to be sent: the latest of each kind, however often the host asks.
#[derive(Clone, Debug, Default)]
pub(super) struct Answers {
    pub(super) pong: bool,
    pub(super) calibration_start: Option<CalibrationKind>,
    pub(super) calibration_end: Option<CalibrationKind>,
    pub(super) update: Option<OtaStatus>,
    /// Time of the oldest request.
    pub(super) since: Option<Instant>,
}

impl Answers {
    pub(super) fn ask(&mut self, at: Instant) {
        self.since.get_or_insert(at);
    }

    /// The most urgent answer; it counts as sent.
    pub(super) fn next(&mut self) -> Option<Outgoing> {
        if let Some(kind) = self.calibration_start.take() {
            return Some(Outgoing::StartAck(kind));
        }
        if let Some(kind) = self.calibration_end.take() {
            return Some(Outgoing::EndAck(kind));
        }
        if let Some(status) = self.update.take() {
            return Some(Outgoing::UpdateAnswer(status));
        }
        if core::mem::take(&mut self.pong) {
            return Some(Outgoing::Pong);
        }
        self.since = None;
        None
    }
}

/// Content of a frame.
#[derive(Clone, Copy, Debug)]
pub(super) enum Outgoing {
    StartAck(CalibrationKind),
    EndAck(CalibrationKind),
    UpdateAnswer(OtaStatus),
    Pong,
    Imu(ImuBias),
    Mag(MagBias),
    BiasRequest(BiasRequest),
    Report(Beat),
}
