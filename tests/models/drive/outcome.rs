//! The result of a call to a master's driver, and the state in which it left its port.

use super::{
    account::Before,
    action::Call,
    master::{COAST, IDLE, Outcome, SPAN, Told},
    node::Entry,
    *,
};
use crate::names::*;

impl<P: Wired> MasterLife<P> {
    /// The port and the pin are left in order, and the time limits were kept.
    pub(super) fn check_port(
        &self,
        call: Call,
        before: &Before,
        outcome: Outcome,
        polls: usize,
    ) -> Result<(), String> {
        let line = self.line.line();
        line.is_left_in_order(self.driver.unsent())?;
        if matches!(outcome, Err(Told::Failure(_))) && polls == 1 {
            return Err("a call that failed at once did not let others run".into());
        }
        // The pin takes 30 us.
        let is_prompt = line.first_write_us.is_some_and(|at_us| at_us <= before.begun_us + 30);
        if before.is_due && line.is_touched && !is_prompt && !line.has_pin_failed() {
            return Err("a due packet is delayed".into());
        }
        let role = self.driver.role();
        let bound = match call {
            Call::Idle => IDLE,
            Call::Set(_) | Call::Read | Call::Discover => self.send_bound(),
            Call::Stop | Call::StopAll => role.stop_bound() + COAST,
            Call::DriveFor => self.send_bound() + SPAN + role.stop_bound() + COAST,
            Call::Service | Call::Discard | Call::KeepAlive => Duration::ZERO,
        };
        let took_us = line.now_us - before.begun_us;
        if took_us > u64::from(bound.as_micros()) + 5_000 + before.stalls * STALL_US {
            return Err(format!("the call takes {took_us} us"));
        }
        Ok(())
    }

    pub(super) fn send_bound(&self) -> Duration {
        self.driver.role().read_bound().saturating_mul(4)
    }

    /// The result is truthful.
    pub(super) fn check_outcome(
        &self,
        call: Call,
        before: &Before,
        outcome: Outcome,
        was_owed: bool,
    ) -> Result<(), String> {
        let line = self.line.line();
        let first = line.first_failure();
        let is_owed = self.driver.role().stops_owed().contains(N1);
        let took_us = line.now_us - before.begun_us;
        let is_stop = matches!(call, Call::Stop | Call::StopAll | Call::DriveFor);
        let told = self.node.borrow().told;
        if let (true, Ok(()), Some(told)) = (is_stop, outcome, told) {
            return Err(format!("Ok of {call:?}, but the node obeys {told:?}"));
        }
        if outcome == Err(Told::Moving) {
            // A call may join a stop that is confirmed, and its time to become still.
            let is_early = took_us < u64::from(COAST.as_micros()) && !before.is_coasting;
            if is_early || is_owed || !self.driver.role().coasting().contains(N1) {
                return Err("StillMoving too early".into());
            }
        }
        match call {
            Call::Stop | Call::StopAll => {
                let bound_us = u64::from(self.driver.role().stop_bound().as_micros());
                match outcome {
                    Ok(()) if is_owed => return Err("Ok, but the stop is owed".into()),
                    Err(Told::Owed) if took_us < bound_us || !is_owed => {
                        return Err("StopsOwed too early".into());
                    }
                    Err(Told::Failure(_) | Told::Other) => {
                        return Err(format!("a stop ends with {outcome:?}"));
                    }
                    Err(Told::Owed | Told::Moving) if before.is_passable => {
                        return Err(format!("{outcome:?} without a cause"));
                    }
                    _ => {}
                }
            }
            Call::DriveFor if !before.is_refused => {
                if is_owed != (outcome == Err(Told::Owed)) {
                    return Err(format!("{outcome:?} of a drive, owed: {is_owed}"));
                }
                let span_us = u64::from(SPAN.as_micros());
                let is_early = line
                    .failures
                    .first()
                    .is_some_and(|&(at_us, _)| at_us < before.begun_us + span_us);
                // A set-point that is refused after all fails before anything else.
                let is_told = matches!(outcome, Err(Told::Owed | Told::Moving | Told::Other))
                    || line.may_be_untold && outcome.is_ok();
                if is_early && !is_told && first.map(Told::Failure) != outcome.err() {
                    return Err(format!("{outcome:?} of a drive that failed with {first:?}"));
                }
            }
            _ => {
                let told = match outcome {
                    Err(Told::Failure(failure)) => Some(failure),
                    _ => None,
                };
                let has_stalled = line.may_have_stalled && told == Some(Failure::Stalled);
                let is_untold = line.may_be_untold && told.is_none();
                if told != first && !has_stalled && !is_untold {
                    return Err(format!("{outcome:?}, but the port failed with {first:?}"));
                }
            }
        }
        if let (Call::Set(number), Ok(())) = (call, outcome) {
            let payload = target_payload(self.setup.mode, number);
            let is_sent = line.wire.taken.iter().any(|taken| {
                taken.is_flushed && taken.frame[0] == 0xBB && taken.frame[2..6] == payload
            });
            if !is_sent && self.account.allowed != Some(number) {
                return Err("Ok, but the set-point has not left".into());
            }
        }
        if let (Call::Read, Ok(())) = (call, outcome) {
            let log = &self.node.borrow().log;
            let begun_us = before.begun_us;
            let mut answers = log.iter();
            let is_heard = answers.any(|entry| match *entry {
                Entry::Answered(at_us) => at_us >= begun_us,
                _ => false,
            });
            broken_if!(!is_heard, "a reading that no node gave");
        }
        // After the dead-man has expired, a drive's set-point may be refused.
        let may_be_over = self.setup.dead_man_ms.is_some() && call == Call::DriveFor;
        let is_quiet = before.is_clear && outcome.is_err() && !may_be_over;
        broken_if!(is_quiet && !is_owed && !before.is_refused, "{outcome:?} without a cause");
        if call == Call::Idle && before.is_clear && was_owed && !self.account.is_stop_offered {
            return Err("an owed stop is not sent".into());
        }
        Ok(())
    }
}
