//! The next frame of a host, and frames that come back unsent.

use super::{
    bias::BiasStore,
    calibration::Request,
    event::{CalibrationStep, HostEvent},
    outgoing::Outgoing,
    standstill::StopProgress,
    state::State,
    update::Update,
};
use crate::{
    endpoint::Unsent,
    stats::{count, uncount},
    time::{Instant, earliest},
    ucp::{
        body::{Biases, CalibrationEnd, CalibrationStart, ImuBiasAck, MagBiasAck, Ping},
        codes::ErrorCode,
        header::MAX_LEN,
        role::{fate, write},
        update::OtaRequest,
    },
};

impl<S: BiasStore> State<S> {
    /// Encodes the most urgent frame that is due; returns its length.
    pub(super) fn fill(&mut self, buffer: &mut [u8; MAX_LEN], now: Instant) -> Option<usize> {
        self.motor.begin_round(now);
        if let Some(request) = &mut self.calibration {
            request.begin(now, &self.config);
        }
        let Some(outgoing) = self.next(now) else {
            self.motor.end_round();
            return None;
        };
        (self.last, self.is_last_taken) = (Some(outgoing), false);
        let index = self.index;
        self.index = index.wrapping_add(1);
        Some(match outgoing {
            Outgoing::Motor(command) => write(command, index, buffer),
            Outgoing::ImuAck => write(ImuBiasAck::new(ErrorCode::Fine), index, buffer),
            Outgoing::MagAck => write(MagBiasAck::new(ErrorCode::Fine), index, buffer),
            Outgoing::Biases(biases) => write(biases, index, buffer),
            Outgoing::Calibration(CalibrationStep::Start, kind, _) => {
                write(CalibrationStart::new(kind), index, buffer)
            }
            Outgoing::Calibration(CalibrationStep::End, kind, _) => {
                write(CalibrationEnd::new(kind), index, buffer)
            }
            Outgoing::Network(body) => write(body, index, buffer),
            Outgoing::Update(version) => {
                write(OtaRequest::start_firmware_update(version), index, buffer)
            }
            Outgoing::Ping => write(Ping {}, index, buffer),
        })
    }

    /// The most urgent frame to send; it counts as sent.
    fn next(&mut self, now: Instant) -> Option<Outgoing> {
        if self.update.is_silent() {
            return None;
        }
        if let Some(command) = self.motor.take_due(now, &self.config) {
            count(&mut self.stats.commands);
            return Some(Outgoing::Motor(command));
        }
        if self.imu.ack_due.take().is_some() {
            return Some(Outgoing::ImuAck);
        }
        if self.mag.ack_due.take().is_some() {
            return Some(Outgoing::MagAck);
        }
        if let Some(biases) = self.next_biases() {
            return Some(Outgoing::Biases(biases));
        }
        let request = self.calibration.as_mut();
        if let Some((step, kind, again)) =
            request.and_then(|request| request.take_due(now, &self.config))
        {
            if again {
                count(&mut self.stats.calibration_retries);
            }
            return Some(Outgoing::Calibration(step, kind, again));
        }
        if let Some(body) = self.network.filter(|_| self.network_due.take().is_some()) {
            return Some(Outgoing::Network(body));
        }
        if let Update::Asked { version, .. } = self.update {
            if self.is_ready_for_update() {
                self.begin_update(now);
                return Some(Outgoing::Update(version));
            }
            self.give_up_update(now);
        }
        if self.ping.take_due(now, &self.config) {
            count(&mut self.stats.pings);
            return Some(Outgoing::Ping);
        }
        None
    }

    /// Whether the request of an update may be sent: what allowed it may be over, because reports
    /// waited in the port when it was asked for.
    fn is_ready_for_update(&self) -> bool {
        self.motor.is_stop_sent() && self.motor.stop_progress() == StopProgress::StandingStill
    }

    /// The biases stored at this moment, if they were requested.
    fn next_biases(&mut self) -> Option<Biases> {
        self.biases_due.take()?;
        let stored = self.store.load();
        let (Some(imu), Some(mag)) = stored else {
            let (imu, mag) = (stored.0.is_none(), stored.1.is_none());
            self.events.push_frequent(HostEvent::BiasesMissing { imu, mag });
            return None;
        };
        count(&mut self.stats.biases);
        if !core::mem::replace(&mut self.biases_told, true) {
            self.events.push_frequent(HostEvent::BiasesSent);
        }
        Some(Biases::new(imu, mag))
    }

    /// The port has taken all of the frame handed out last.
    pub(super) fn taken(&mut self) {
        self.is_last_taken = true;
        if matches!(self.last, Some(Outgoing::Motor(_))) {
            self.motor.taken();
        }
    }

    /// All that the port has taken has left, so it cannot come back.
    pub(super) fn flushed(&mut self, now: Instant) {
        self.motor.flushed(now);
        if self.is_last_taken {
            self.last = None;
        }
    }

    /// Whether the frame handed out last is a motor command that moves the robot, and is no longer
    /// the latest or goes to a robot that may no longer be heard; asks for an update that was ended
    /// or is no longer allowed; or would acknowledge a result that was refused.
    pub(super) fn has_sent_old_command(&self) -> bool {
        match self.last {
            Some(Outgoing::Motor(command)) => {
                let is_old = self.motor.latest() != Some(command) || self.is_overdue;
                !command.stands_still() && is_old
            }
            Some(Outgoing::Update(_)) => {
                let may_go = self.update.is_silent() && self.is_ready_for_update();
                !may_go || self.is_overdue
            }
            Some(Outgoing::ImuAck) => self.imu.is_refused,
            Some(Outgoing::MagAck) => self.mag.is_refused,
            _ => false,
        }
    }

    /// Takes back the frame handed out last: its content is decided again.
    ///
    /// After a failed flush the frame may have arrived, so anything that the robot requests again
    /// anyway is not repeated: a duplicate acknowledgement would count for the next result.
    pub(super) fn unsent(&mut self, unsent: Unsent, now: Instant) {
        let unsent = fate(unsent, self.is_last_taken);
        // It stays on record after a failed flush: it may have arrived.
        let was_motor = matches!(self.last, Some(Outgoing::Motor(_)));
        if unsent == Unsent::Unflushed {
            self.network_due = self.network.map(|_| now);
        } else if let Some(outgoing) = self.last.take() {
            self.index = self.index.wrapping_sub(1);
            self.take_back(outgoing, now);
        }
        self.motor.unsent(unsent, was_motor, now);
    }

    /// Takes back a frame of which nothing that the robot could act on has left.
    fn take_back(&mut self, outgoing: Outgoing, now: Instant) {
        match outgoing {
            Outgoing::Motor(_) => uncount(&mut self.stats.commands),
            Outgoing::ImuAck => self.imu.ack_unsent(now),
            Outgoing::MagAck => self.mag.ack_unsent(now),
            Outgoing::Biases(_) => {
                uncount(&mut self.stats.biases);
                self.biases_due = Some(now);
            }
            Outgoing::Calibration(_, _, again) => {
                if again {
                    uncount(&mut self.stats.calibration_retries);
                }
                if let Some(request) = &mut self.calibration {
                    request.unsent(now);
                }
            }
            Outgoing::Network(_) => self.network_due = self.network.map(|_| now),
            Outgoing::Update(_) if self.update.is_silent() => self.give_up_update(now),
            Outgoing::Update(_) => {} // the application has ended it
            Outgoing::Ping => {
                if self.ping.unsent(now) {
                    uncount(&mut self.stats.pings);
                }
            }
        }
    }

    pub(super) fn deadline(&self) -> Option<Instant> {
        if self.update.is_silent() {
            let waits = matches!(self.last, Some(Outgoing::Update(_))) && !self.is_overdue;
            return earliest(&[self.link_until, self.update.overdue_at().filter(|_| waits)]);
        }
        let asked = match self.update {
            Update::Asked { at, .. } => Some(at),
            _ => None,
        };
        earliest(&[
            self.link_until,
            self.motor.deadline(),
            self.ping.deadline(),
            self.calibration.as_ref().map(Request::deadline),
            self.imu.ack_due,
            self.mag.ack_due,
            self.biases_due,
            self.network_due,
            asked,
        ])
    }
}
