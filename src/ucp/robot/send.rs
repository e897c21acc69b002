//! The next frame of a robot, and frames that come back unsent.

use super::{config::ReportLayout, outgoing::Outgoing, state::State};
use crate::{
    endpoint::Unsent,
    stats::{count, uncount},
    time::{Duration, Instant, earliest, reached},
    ucp::{
        body::{CalibrationEndAck, CalibrationStartAck, OtaAck, Pong},
        codes::ErrorCode,
        header::MAX_LEN,
        report::{DocumentReport, FirmwareReport},
        role::{fate, write},
    },
};

/// Longest time from handing a frame out to the failure of its flush: a later one is not its own.
const FLUSH_TIME: Duration = Duration::from_secs(2);

impl State {
    /// Encodes the most urgent frame that is due; returns its length.
    pub(super) fn fill(&mut self, buffer: &mut [u8; MAX_LEN], now: Instant) -> Option<usize> {
        let outgoing = self.next(now)?;
        (self.last, self.is_last_taken) = (Some(outgoing), false);
        if let Outgoing::UpdateAnswer(status) = outgoing {
            self.update_answer = Some((status, Some(now + FLUSH_TIME)));
        }
        Some(match outgoing {
            Outgoing::StartAck(kind) => {
                write(CalibrationStartAck::new(kind, ErrorCode::Fine), 0, buffer)
            }
            Outgoing::EndAck(kind) => {
                write(CalibrationEndAck::new(kind, ErrorCode::Fine), 0, buffer)
            }
            Outgoing::UpdateAnswer(status) => write(OtaAck::new(status), 0, buffer),
            Outgoing::Pong => write(Pong::new(ErrorCode::Fine), 0, buffer),
            Outgoing::Imu(bias) => write(bias, 0, buffer),
            Outgoing::Mag(bias) => write(bias, 0, buffer),
            Outgoing::BiasRequest(request) => write(request, 0, buffer),
            Outgoing::Report(_) => self.report(buffer),
        })
    }

    /// The most urgent frame to send; it counts as sent.
    fn next(&mut self, now: Instant) -> Option<Outgoing> {
        if let Some(answer) = self.answers.next() {
            if matches!(answer, Outgoing::Pong) {
                count(&mut self.stats.pongs);
            }
            return Some(answer);
        }
        if let Some(bias) = self.imu_result.take_due(now, self.config.result_period) {
            count(&mut self.stats.results);
            return Some(Outgoing::Imu(bias));
        }
        if let Some(bias) = self.mag_result.take_due(now, self.config.result_period) {
            count(&mut self.stats.results);
            return Some(Outgoing::Mag(bias));
        }
        let period = self.config.bias_request_period;
        if let Some(request) = period.and_then(|period| self.bias_request.take_due(now, period)) {
            count(&mut self.stats.bias_requests);
            return Some(Outgoing::BiasRequest(request));
        }
        let beat = self.reports.take_due(now, self.config.report_period)?;
        self.stats.reports_skipped = self.stats.reports_skipped.saturating_add(beat.missed);
        count(&mut self.stats.reports);
        Some(Outgoing::Report(beat))
    }

    fn report(&mut self, buffer: &mut [u8; MAX_LEN]) -> usize {
        let index = self.index;
        self.index = index.wrapping_add(1);
        match self.config.layout {
            ReportLayout::Firmware { version } => {
                write(FirmwareReport::new(&self.telemetry, version), index, buffer)
            }
            ReportLayout::Document => write(DocumentReport::new(&self.telemetry), index, buffer),
        }
    }

    /// The port has taken all of the last frame.
    pub(super) fn taken(&mut self) {
        self.is_last_taken = true;
        if let (Some(Outgoing::UpdateAnswer(_)), Some((_, until))) =
            (self.last, &mut self.update_answer)
        {
            *until = None;
        }
    }

    /// All that the port has taken has left, so it cannot come back.
    pub(super) fn flushed(&mut self) {
        if self.is_last_taken {
            self.last = None;
        }
        if !matches!(self.last, Some(Outgoing::UpdateAnswer(_))) {
            self.update_answer = None;
        }
    }

    /// Takes back the frame handed out last: its content is decided again.
    ///
    /// After a failed flush the frame may have arrived, so anything that the host requests again
    /// anyway is not repeated. Results and requests are due at once: a host recognises a
    /// repetition.
    pub(super) fn unsent(&mut self, unsent: Unsent, now: Instant) {
        let unsent = fate(unsent, self.is_last_taken);
        let is_answer = matches!(self.last, Some(Outgoing::UpdateAnswer(_)));
        // It stays on record after a failed flush: its rest may still be sent.
        if unsent == Unsent::Unflushed {
            self.imu_result.again(now);
            self.mag_result.again(now);
            self.bias_request.again(now);
        } else if let Some(outgoing) = self.last.take() {
            self.take_back(outgoing, now);
        }
        // Nobody asks again for the answer to an update.
        let is_lost = (is_answer || unsent == Unsent::Unflushed) && !self.update_asked;
        if let Some((status, until)) = self.update_answer.filter(|_| is_lost) {
            // Without word of what was taken, a flush that fails late is not its own.
            if unsent != Unsent::Unflushed || !reached(until, now) {
                self.answers.update.get_or_insert(status);
                self.answers.ask(now);
            }
        }
    }

    /// Takes back a frame of which nothing that the host could act on has left.
    fn take_back(&mut self, outgoing: Outgoing, now: Instant) {
        match outgoing {
            Outgoing::StartAck(kind) => {
                self.answers.calibration_start.get_or_insert(kind);
                self.answers.ask(now);
            }
            Outgoing::EndAck(kind) => {
                self.answers.calibration_end.get_or_insert(kind);
                self.answers.ask(now);
            }
            Outgoing::UpdateAnswer(_) => {}
            Outgoing::Pong => {
                uncount(&mut self.stats.pongs);
                self.answers.pong = true;
                self.answers.ask(now);
            }
            Outgoing::Imu(_) => {
                uncount(&mut self.stats.results);
                self.imu_result.take_back(now);
            }
            Outgoing::Mag(_) => {
                uncount(&mut self.stats.results);
                self.mag_result.take_back(now);
            }
            Outgoing::BiasRequest(_) => {
                uncount(&mut self.stats.bias_requests);
                self.bias_request.take_back(now);
            }
            Outgoing::Report(beat) => {
                uncount(&mut self.stats.reports);
                let skipped = &mut self.stats.reports_skipped;
                *skipped = skipped.saturating_sub(beat.missed);
                self.index = self.index.wrapping_sub(1);
                self.reports.take_back(beat);
            }
        }
    }

    pub(super) fn deadline(&self) -> Option<Instant> {
        earliest(&[
            self.command_until,
            self.answers.since,
            self.imu_result.deadline(),
            self.mag_result.deadline(),
            self.bias_request.deadline(),
            self.reports.deadline(),
        ])
    }
}
