//! What a host receives, and the invariants after every step.

use axlewire::ucp::{
    host::FailureCause,
    message::{BiasRequest, CalibrationEndAck, CalibrationStartAck, FirmwareReport, OtaAck},
};

use super::{
    host::{Call, Hear, HostSide, Site, command},
    host_account::{Account, Update},
    host_request::{Ack, Results},
    host_store::Shelf,
    names::*,
    site::{Checks, HALF, Part, ROOM, Side},
};

impl Side for HostSide {
    type Role = Host<Shelf>;
    type Account = Account;
    type Call = Call;
    type Hear = Hear;

    fn counters(host: &Host<Shelf>) -> Counters {
        host.counters()
    }

    fn bytes(hear: Hear) -> Vec<u8> {
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

    fn part(hear: Hear) -> Part<Hear> {
        match hear {
            Hear::Damaged => Part::Nothing,
            Hear::Front => Part::Front,
            Hear::Rest => Part::Rest(Hear::Imu(1)),
            _ => Part::Whole,
        }
    }

    fn is_frequent(event: &HostEvent) -> bool {
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
}

impl Checks<HostSide> for Site {
    fn heard(&mut self, hear: Hear, at: Instant, before: &[HostEvent]) -> Checked {
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
                let shelf = self.role.store();
                let is_stored = shelf.imu.is_some() && shelf.mag.is_some();
                account.biases = match is_stored {
                    _ if account.low_ids_only => Ack::No,
                    true => Ack::Must,
                    false => Ack::May,
                };
            }
            _ => {}
        }
        Ok(())
    }

    fn told(&mut self, event: &HostEvent) -> Checked {
        let end = match event {
            HostEvent::CalibrationStarted(kind) => (CalibrationStep::Start, *kind, true),
            HostEvent::CalibrationEnded(kind) => (CalibrationStep::End, *kind, true),
            HostEvent::CalibrationFailed(failure) => {
                let is_late = failure.cause == FailureCause::NoAnswer;
                let was_sent = self.account.given_up != Some(failure.attempts);
                broken_if!(
                    failure.attempts != 3 && is_late && was_sent,
                    "{failure:?} before the last attempt"
                );
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
            HostEvent::UpdateNotSent => {
                broken_if!(self.account.untold_updates == 0, "{event:?} has not happened");
                self.account.untold_updates -= 1;
                return Ok(());
            }
            _ => return Ok(()),
        };
        broken_if!(self.account.untold.first() != Some(&end), "{event:?} has not happened");
        self.account.untold.remove(0);
        Ok(())
    }

    fn all_told(&self) -> Checked {
        broken_if!(self.account.untold_updates > 0, "an update was given up, and it is not told");
        match self.account.untold.first() {
            Some(end) => Err(format!("the end of a request is not reported: {end:?}")),
            None => Ok(()),
        }
    }

    fn check_rest(&mut self) -> Checked {
        // Decisions made at the time of sending have been made.
        for ack in [&mut self.account.imu.ack, &mut self.account.mag.ack, &mut self.account.biases]
        {
            if *ack == Ack::May && self.account.update != Update::Silent {
                *ack = Ack::No;
            }
        }
        broken_if!(self.role.link() != self.account.link, "the link is {:?}", self.role.link());
        Ok(())
    }

    fn check(&self, events: &[HostEvent]) -> Checked {
        let account = &self.account;
        let is_told = self.popped.iter().chain(events).any(|it| *it == HostEvent::DeadMan);
        if self.step.is_halted && !is_told && events.len() < ROOM {
            return Err("the dead-man has fired without an event".into());
        }
        if self.role.is_stop_sent() != account.motion.is_stop_sent() {
            return Err(format!("is_stop_sent: {}", self.role.is_stop_sent()));
        }
        if self.role.command() != account.motion.wanted {
            return Err(format!("the command is {:?}", self.role.command()));
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
}

impl Site {
    /// A result is acknowledged if and only if the application will find it (ruling U15).
    fn result(&mut self, hear: Hear, before: &[HostEvent]) -> Checked {
        let events = queue(&self.role);
        let shelf = self.role.store().clone();
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

    /// A request ends as the robot answers, or by its timeout.
    pub(super) fn check_calibration(&self) -> Checked {
        let outcome = self.role.calibration_outcome().map(|outcome| outcome.is_ok());
        if outcome != self.account.settled {
            return Err(format!("the outcome is {outcome:?}: {:?}", self.account.request));
        }
        Ok(())
    }
}
