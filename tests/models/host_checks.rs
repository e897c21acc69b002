//! What a host receives, and the invariants after every step.

use axlewire::ucp::{
    host::FailureCause,
    message::{BiasRequest, CalibrationEndAck, CalibrationStartAck, FirmwareReport, OtaAck},
};

use super::{
    host::{Hear, ROOM, Site, command},
    host_account::Update,
    host_request::{Ack, Results},
    names::*,
    sleep::check_sleep,
    ucp::{Checked, bytes, damaged, queue, unknown},
};

fn imu(value: i16) -> ImuBias {
    ImuBias::new([value; 3], [-value; 3])
}

fn mag(value: i16) -> MagBias {
    MagBias::new([value; 3])
}

/// Number of bytes before the pause inside a frame that comes in halves.
const HALF: usize = 11;

fn wire(hear: Hear) -> Vec<u8> {
    let started = |kind, err| bytes(CalibrationStartAck::new(kind, err));
    match hear {
        Hear::Report => bytes(FirmwareReport::new(&Telemetry::default(), 38)),
        Hear::Pong => bytes(Pong::new(ErrorCode::Fine)),
        Hear::StartAck(kind, err) => started(kind, err),
        Hear::EndAck(kind) => bytes(CalibrationEndAck::new(kind, ErrorCode::Fine)),
        Hear::Imu(value) => bytes(imu(value)),
        Hear::Mag(value) => bytes(mag(value)),
        Hear::BiasRequest => bytes(BiasRequest {}),
        Hear::UpdateAnswer(status) => bytes(OtaAck::new(status)),
        Hear::Unknown => unknown(),
        Hear::Damaged => damaged(started(CalibrationKind::Imu, ErrorCode::Fine)),
        Hear::Echo => bytes(command(1)),
        Hear::Front => bytes(imu(1))[..HALF].to_vec(),
        Hear::Rest => bytes(imu(1))[HALF..].to_vec(),
    }
}

/// Events that recur by themselves, and those of which only the latest counts.
pub(crate) fn is_frequent(event: &HostEvent) -> bool {
    matches!(
        event,
        HostEvent::Report(_)
            | HostEvent::Pong { .. }
            | HostEvent::Unknown(_)
            | HostEvent::BiasesMissing { .. }
            | HostEvent::BiasesSent
            | HostEvent::BiasesNotAnswered
            | HostEvent::BiasNotStored(_)
            | HostEvent::LinkUp
            | HostEvent::LinkDown
            | HostEvent::UpdateAnswered(_)
    )
}

impl Site {
    /// The robot sends something.
    pub(super) fn hear(&mut self, hear: Hear) -> Checked {
        let before = queue(&self.host);
        let bytes = wire(hear);
        let was_half = std::mem::replace(&mut self.feed.is_half, hear == Hear::Front);
        match hear {
            Hear::Front | Hear::Damaged => {}
            Hear::Rest if was_half => self.feed.push(Hear::Imu(1), HALF + bytes.len(), true),
            Hear::Rest => {}
            whole => self.feed.push(whole, bytes.len(), false),
        }
        self.host.handle_input(&bytes, self.now);
        let counters = self.host.counters();
        for (arrived, at) in self.feed.arrived(&counters, self.now)? {
            self.heard(arrived, at, &before)?;
        }
        self.feed.took(bytes.len(), &counters, self.now);
        Ok(())
    }

    /// The role has taken in a whole frame.
    pub(super) fn heard(&mut self, hear: Hear, at: Instant, before: &[HostEvent]) -> Checked {
        if hear == Hear::Echo {
            return Ok(());
        }
        let account = &mut self.account;
        account.heard(at);
        match hear {
            Hear::Pong => account.pong(),
            Hear::StartAck(kind, err) => account.acknowledged(CalibrationStep::Start, kind, err),
            Hear::EndAck(kind) => {
                account.acknowledged(CalibrationStep::End, kind, ErrorCode::Fine);
            }
            Hear::Imu(_) | Hear::Mag(_) => self.result(hear, before)?,
            Hear::BiasRequest => {
                account.is_network_due = account.network.is_some();
                let shelf = self.host.store();
                let is_stored = shelf.imu.is_some() && shelf.mag.is_some();
                account.biases = match is_stored {
                    _ if account.low_ids_only => Ack::No,
                    true => Ack::Must,
                    false => Ack::May,
                };
            }
            Hear::UpdateAnswer(status)
                if status != OtaStatus::Accepted && account.update == Update::Silent =>
            {
                self.end_update();
            }
            _ => {}
        }
        Ok(())
    }

    /// A result is acknowledged if and only if the application will find it (ruling U15).
    fn result(&mut self, hear: Hear, before: &[HostEvent]) -> Checked {
        let events = queue(&self.host);
        let shelf = self.host.store().clone();
        let (results, event, is_stored): (&mut Results, _, _) = match hear {
            Hear::Mag(value) => {
                let (bias, results) = (mag(value), &mut self.account.mag);
                (results, HostEvent::MagBias(bias), shelf.mag == Some(bias))
            }
            Hear::Imu(value) => {
                let (bias, results) = (imu(value), &mut self.account.imu);
                (results, HostEvent::ImuBias(bias), shelf.imu == Some(bias))
            }
            _ => return Ok(()),
        };
        let is_told = events.contains(&event) || results.popped.as_ref() == Some(&event);
        results.is_kept = if shelf.is_open { is_told } else { is_stored };
        // A new link is reported first, and may take the last free slot.
        let has_excuse = shelf.fails || shelf.is_open && events.len() >= ROOM;
        let is_doubtful = shelf.fails || before.len() >= ROOM;
        results.ack = match results.is_kept {
            false if has_excuse => Ack::No,
            false => return Err(format!("{hear:?} is not kept")),
            true if is_doubtful => Ack::May,
            true => Ack::Must,
        };
        if self.account.low_ids_only {
            results.ack = Ack::No;
        }
        Ok(())
    }

    /// An event is taken: what it reports has happened, and is reported once.
    pub(super) fn told(&mut self, event: &HostEvent) -> Checked {
        let end = match event {
            HostEvent::CalibrationStarted(kind) => (CalibrationStep::Start, *kind, true),
            HostEvent::CalibrationEnded(kind) => (CalibrationStep::End, *kind, true),
            HostEvent::CalibrationFailed(failure) => {
                let is_late = failure.cause == FailureCause::NoAnswer;
                if failure.attempts != 3 && is_late {
                    return Err(format!("{failure:?} before the last attempt"));
                }
                (failure.step, failure.kind, false)
            }
            HostEvent::ImuBias(_) => {
                self.account.imu.popped = Some(event.clone());
                return Ok(());
            }
            HostEvent::MagBias(_) => {
                self.account.mag.popped = Some(event.clone());
                return Ok(());
            }
            _ => return Ok(()),
        };
        if self.account.untold.first() != Some(&end) {
            return Err(format!("{event:?} has not happened"));
        }
        self.account.untold.remove(0);
        Ok(())
    }

    /// Everything due has been sent and flushed: nothing is owed now, and the deadline is in the
    /// future.
    pub(super) fn check_rest(&mut self) -> Checked {
        // Decisions made at the time of sending have been made.
        for ack in [&mut self.account.imu.ack, &mut self.account.mag.ack, &mut self.account.biases]
        {
            if *ack == Ack::May && self.account.update != Update::Silent {
                *ack = Ack::No;
            }
        }
        let owed = self.account.owed(self.now);
        if owed.is_some_and(|at| at <= self.now) {
            return Err(format!("owed and not sent: {:?}", self.account));
        }
        check_sleep(&self.host, self.now)?;
        if self.host.link() != self.account.link {
            return Err(format!("the link is {:?}", self.host.link()));
        }
        Ok(())
    }

    /// Invariants at any time.
    pub(super) fn check(&self, events: &[HostEvent]) -> Checked {
        let account = &self.account;
        let wake_up = self.host.poll_timeout();
        if let Some(owed) = account.owed(self.now).map(|at| at.max(self.now)) {
            let is_late = wake_up.is_none_or(|at| at > owed);
            if is_late {
                return Err(format!("wakes up at {wake_up:?}, and {owed:?} is owed: {account:?}"));
            }
        }
        if self.host.is_stop_sent() != account.motion.is_stop_sent() {
            return Err(format!("is_stop_sent: {}", self.host.is_stop_sent()));
        }
        if self.host.command() != account.motion.wanted {
            return Err(format!("the command is {:?}", self.host.command()));
        }
        let comes_often = |event: &&HostEvent| {
            matches!(event, HostEvent::Report(_) | HostEvent::Pong { .. } | HostEvent::Unknown(_))
        };
        if events.iter().filter(comes_often).count() > ROOM / 2 {
            return Err("frequent events take the room of rare ones".into());
        }
        let is_end = |event: &&HostEvent| {
            matches!(
                event,
                HostEvent::CalibrationStarted(_)
                    | HostEvent::CalibrationEnded(_)
                    | HostEvent::CalibrationFailed(_)
            )
        };
        if events.iter().filter(is_end).count() != account.untold.len() {
            return Err(format!("ends of requests: {:?}, {events:?}", account.untold));
        }
        self.check_calibration()
    }

    /// A request ends as the robot answers, or by its timeout.
    pub(super) fn check_calibration(&self) -> Checked {
        let outcome = self.host.calibration_outcome().map(|outcome| outcome.is_ok());
        if outcome != self.account.settled {
            return Err(format!("the outcome is {outcome:?}: {:?}", self.account.request));
        }
        Ok(())
    }
}
