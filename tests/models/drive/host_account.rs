//! What a driver of a host owes its caller and its rover after every call, by an independent
//! account.

use std::hash::Hash;

use axlewire::ucp::host::{COAST, Link};

use super::{
    host::{Call, HostLife, IDLE, Outcome, SPAN, TIMEOUT_US, Told},
    wire::Taken,
    *,
};

/// Time within which a stop has to be flushed (U16).
const STOP_US: u64 = 100_000;

#[derive(Debug, Default)]
pub(crate) struct Account {
    /// The speed wanted by the application, and the time of its last call, in role time.
    speed: i16,
    said_us: u64,
    /// A zero command has left, whole and flushed: others may follow (U16).
    is_begun: bool,
    /// The last motor command was a stop, and has left.
    is_still: bool,
    /// Zero commands still to be sent after a cut-off frame or a failed flush.
    copies: u8,
}

impl Account {
    pub(super) fn digest(&self, line: &DrivenLine) -> impl Hash + use<> {
        let said_us = line.role_now().as_micros().saturating_sub(self.said_us).min(TIMEOUT_US + 1);
        (self.speed, said_us, self.is_begun, self.is_still, self.copies)
    }
}

/// The state when a call began.
pub(super) struct Before {
    begun_us: u64,
    role_us: u64,
    stalls: u64,
    faults: usize,
    is_whole: bool,
    is_lost: bool,
}

/// The speed commanded by a frame.
fn speed(frame: &[u8]) -> Option<i16> {
    (frame[4] == 2).then(|| i16::from_le_bytes([frame[6], frame[7]]))
}

impl<P: Wired> HostLife<P> {
    pub(super) fn before(&self) -> Before {
        let line = self.line.line();
        Before {
            begun_us: line.now_us,
            role_us: line.role_now().as_micros(),
            stalls: line.stalls(),
            faults: line.faults(),
            is_whole: line.wire.open.is_empty() && self.driver.unsent().is_empty(),
            is_lost: self.driver.role().link() == Link::Down,
        }
    }

    pub(super) fn after(
        &mut self,
        call: Call,
        before: Before,
        outcome: Outcome,
    ) -> Result<(), String> {
        if let Some(broken) = self.line.line().broken.take() {
            return Err(broken);
        }
        if before.is_lost && matches!(call, Call::Drive(_) | Call::DriveFor) {
            let is_refused = outcome == Err(Told::Other);
            return if is_refused { Ok(()) } else { Err("it drives unheard".into()) };
        }
        self.check_offers(call, &before)?;
        if call == Call::Discard {
            return Ok(());
        }
        let line = self.line.line();
        line.is_left_in_order(self.driver.unsent())?;
        // A robot whose link was lost may have restarted, and this one reports 0 all the time.
        let has_lost = self.driver.role().statistics().links_lost > 0;
        let is_clear = before.faults == 0 && before.is_whole && !has_lost;
        // Three reports, each in answer to a command.
        let coast_us = if is_clear { 40_000 } else { u64::from(COAST.as_micros()) };
        let bound_us = match call {
            Call::Idle => u64::from(IDLE.as_micros()),
            Call::Stop => STOP_US,
            Call::DriveFor => STOP_US + u64::from(SPAN.as_micros()) + coast_us,
            Call::Ping => 60_000,
            _ => 0,
        };
        let took_us = line.now_us - before.begun_us;
        // A slow port blocks for longer than a pause, and up to eight frames may be sent at a time.
        let extra_us = 40_000 + 25_000 * before.faults as u64 + before.stalls * STALL_US;
        broken_if!(took_us > bound_us + extra_us, "the call takes {took_us} us");
        let first = line.first_failure();
        let is_stop = matches!(call, Call::Stop | Call::DriveFor);
        let is_late_pong = call == Call::Ping && outcome == Err(Told::Other) && first.is_none();
        if !is_stop && !is_late_pong && outcome.err() != first.map(Told::Failure) {
            return Err(format!("{outcome:?}, but the port failed with {first:?}"));
        }
        if is_stop && outcome.is_ok() && (!self.account.is_still || self.account.copies > 0) {
            return Err("Ok, but the stop has not left".into());
        }
        if call == Call::Stop && outcome.is_err() {
            broken_if!(took_us < STOP_US, "a stop gave up too early");
            if before.stalls == 0 && before.faults <= 4 {
                return Err(format!("{outcome:?}, but only transient errors occurred"));
            }
        }
        let span_us = u64::from(SPAN.as_micros());
        let is_early =
            line.failures.first().is_some_and(|&(at_us, _)| at_us < before.begun_us + span_us);
        if call == Call::DriveFor && is_early && outcome.is_ok() {
            return Err(format!("Ok of a drive that failed with {first:?}"));
        }
        if is_clear && outcome.is_err() && call != Call::Ping {
            return Err(format!("{outcome:?} without a cause"));
        }
        if call == Call::Idle && is_clear {
            let commands = line.wire.taken.iter().filter(|taken| speed(&taken.frame).is_some());
            broken_if!(commands.count() == 0, "the command was not repeated");
        }
        Ok(())
    }

    /// Only a command in force is ever offered to the port.
    fn check_offers(&mut self, call: Call, before: &Before) -> Result<(), String> {
        let (line, account) = (self.line.line(), &mut self.account);
        let mut limit_us = TIMEOUT_US;
        match call {
            Call::Drive(speed) => (account.speed, account.said_us) = (speed, before.role_us),
            Call::DriveFor => (account.speed, account.said_us) = (60, before.role_us),
            Call::Stop => account.speed = 0,
            _ => {}
        }
        if call == Call::DriveFor {
            // No longer than its span, plus the writes in which the port blocks.
            let stays_us = 25_000 * before.faults as u64 + before.stalls * STALL_US;
            limit_us = u64::from(SPAN.as_micros()) + 5_000 + stays_us;
        }
        for offer in &line.wire.offers {
            let speed = speed(&offer.frame);
            // A port that has taken the first may fail to flush it: the next is a stop as well.
            if !account.is_begun && offer.taken == 0 && speed != Some(0) {
                return Err("something is sent before the first stop".into());
            }
            let Some(speed) = speed.filter(|&speed| speed != 0) else { continue };
            broken_if!(speed != account.speed, "{speed} is sent, but no longer in force");
            broken_if!(offer.role_us - account.said_us > limit_us, "an expired command is sent");
        }
        if line.wire.cuts > 0 {
            account.copies = 2;
        }
        for Taken { frame, is_flushed, .. } in &line.wire.taken {
            account.is_begun |= *is_flushed;
            if let Some(speed) = speed(frame) {
                account.is_still = speed == 0 && *is_flushed;
                account.copies = account.copies.saturating_sub(1);
            }
        }
        if call == Call::DriveFor {
            account.speed = 0;
        }
        Ok(())
    }
}
