//! What a driver of a master owes its caller and its node after every call, by an independent
//! account.

use super::{
    action::Call,
    master::{Outcome, SPAN, target},
    node::{is_stop, progress},
    *,
};
use crate::names::*;

#[derive(Debug, Default)]
pub(crate) struct Account {
    /// A stop is owed, starting at this entry of the node's log.
    owed_from: Option<usize>,
    /// A stop has since been offered to the port.
    pub(super) is_stop_offered: bool,
    /// The set-point that may be sent.
    pub(super) allowed: Option<u8>,
    /// The last sign of life, in role time.
    sign_us: u64,
}

impl Account {
    pub(super) fn digest(&self, node: &Node, line: &DrivenLine) -> impl std::hash::Hash + use<> {
        let paid = self.owed_from.map(|from| progress(&node.log[from..], node.mode, line.now_us));
        let sign_us = (line.role_now().as_micros() - self.sign_us).min(100_000);
        (paid, self.is_stop_offered, self.allowed, sign_us)
    }
}

/// The state when a call began.
pub(super) struct Before {
    pub(super) begun_us: u64,
    role_us: u64,
    log: usize,
    /// The role refuses this call's set-point.
    pub(super) is_refused: bool,
    /// The node is owed nothing but to become still: a stop joins that.
    pub(super) is_coasting: bool,
    /// Nothing prevents the call from succeeding.
    pub(super) is_clear: bool,
    /// The same, except for transient errors.
    pub(super) is_passable: bool,
    /// The role has something to send.
    pub(super) is_due: bool,
    pub(super) stalls: u64,
}

fn is_online<P>(driver: &Driver<Master, P, Shared>) -> bool {
    driver.role().health(N1) == Some(Health::Online)
}

impl<P: Wired> MasterLife<P> {
    pub(super) fn before(&self, call: Call) -> Before {
        let (line, node, role) = (self.line.line(), self.node.borrow(), self.driver.role());
        let number = match call {
            Call::Set(number) => Some(number),
            Call::DriveFor => Some(2),
            _ => None,
        };
        let is_whole = line.wire.open.is_empty() && self.driver.unsent().is_empty();
        let answers = node.answers.len();
        let is_there =
            !node.is_gone && !node.is_deaf && is_online(&self.driver) && line.inbox.is_empty();
        let faults = line.faults();
        let stalls = line.stalls();
        let now = line.role_now();
        let is_due = is_whole && !line.wire.is_in_parts && line.inbox.is_empty() && {
            let mut twin = role.clone();
            match call {
                Call::Stop => twin.stop(N1, now),
                Call::StopAll => twin.stop_all(now),
                _ => {}
            }
            twin.handle_timeout(now);
            twin.poll_transmit(now).is_some()
        };
        Before {
            begun_us: line.now_us,
            role_us: now.as_micros(),
            log: node.log.len(),
            is_refused: number
                .is_some_and(|number| role.check(N1, &target(node.mode, number)).is_err()),
            is_coasting: role.coasting().contains(N1),
            is_clear: is_there && is_whole && faults == 0 && answers == 0,
            is_passable: is_there && answers <= 1 && faults <= 4 && stalls == 0,
            is_due,
            stalls,
        }
    }

    /// What must hold after a call.
    pub(super) fn after(
        &mut self,
        call: Call,
        before: Before,
        end: End<Outcome>,
    ) -> Result<(), String> {
        if let Some(broken) = self.line.line().broken.take() {
            return Err(broken);
        }
        let is_stop = matches!(call, Call::Stop | Call::StopAll);
        let is_drive = call == Call::DriveFor && !before.is_refused;
        let is_new = is_stop && !before.is_coasting || is_drive;
        if is_new && self.account.owed_from.is_none() {
            self.account.owed_from = Some(before.log);
            self.account.is_stop_offered = false;
        }
        let was_owed = self.account.owed_from.is_some();
        self.check_offers(call, &before)?;
        self.check_debt(&before)?;
        if let End::Done(outcome, polls) = end {
            self.check_port(call, &before, outcome, polls)?;
            self.check_outcome(call, &before, outcome, was_owed)?;
            self.line.line().waits_since_us = None;
        }
        self.settle(call, &before, &end);
        Ok(())
    }

    /// Only a set-point in force is ever offered to the port.
    fn check_offers(&mut self, call: Call, before: &Before) -> Result<(), String> {
        let mode = self.setup.mode;
        if let (
            false,
            Call::Set(_) | Call::DriveFor | Call::KeepAlive | Call::Stop | Call::StopAll,
        ) = (before.is_refused, call)
        {
            self.account.sign_us = before.role_us;
        }
        let new = match call {
            Call::Set(number) => Some(number),
            Call::DriveFor => Some(2),
            _ => None,
        };
        let old = self.account.allowed.filter(|_| !matches!(call, Call::Stop | Call::StopAll));
        let mut limit_us = self.setup.dead_man_ms.map_or(u64::MAX, |limit| u64::from(limit) * 1000);
        if call == Call::DriveFor {
            limit_us = u64::from((self.send_bound() + SPAN).as_micros());
        }
        let mut is_stopping = false;
        for offer in &self.line.line().wire.offers {
            if offer.frame[0] != 0xBB {
                continue;
            }
            let payload = &offer.frame[2..6];
            if is_stop(mode, payload) {
                (self.account.is_stop_offered, is_stopping) = (true, true);
                continue;
            }
            let is_of = |number: Option<u8>| {
                number.is_some_and(|number| target_payload(mode, number) == payload)
            };
            if !is_of(old) && !is_of(new.filter(|_| !before.is_refused)) {
                return Err(format!("{payload:?} is sent, but no longer in force"));
            }
            if call == Call::DriveFor && is_stopping {
                return Err("a set-point is sent after the stop of its drive".into());
            }
            if offer.role_us - self.account.sign_us > limit_us {
                return Err("an expired set-point is sent".into());
            }
        }
        Ok(())
    }

    /// A stop is owed until it is paid, according to the node's log.
    fn check_debt(&mut self, before: &Before) -> Result<(), String> {
        let is_owed = self.driver.role().stops_owed().contains(N1);
        let (node, line) = (self.node.borrow(), self.line.line());
        match self.account.owed_from {
            Some(from) if !is_owed => {
                if progress(&node.log[from..], node.mode, line.now_us).0 < 2 {
                    let log = &node.log[from..];
                    return Err(format!("the stop is forgotten; the node's log: {log:?}"));
                }
                self.account.owed_from = None;
            }
            None if is_owed => {
                // The master owes a stop on its own initiative: an abnormal node, a dead-man.
                (self.account.owed_from, self.account.is_stop_offered) = (Some(before.log), false);
            }
            _ => {}
        }
        Ok(())
    }

    /// Updates what is in force.
    fn settle(&mut self, call: Call, before: &Before, end: &End<Outcome>) {
        let (line, mode) = (self.line.line(), self.setup.mode);
        self.account.allowed = match (call, end) {
            (Call::Set(_), _) if before.is_refused => self.account.allowed,
            (Call::Set(number), End::Done(Ok(()), _) | End::Dropped) => Some(number),
            (Call::Set(number), _) => {
                let payload = target_payload(mode, number);
                let has_left = |frame: &[u8]| frame[0] == 0xBB && frame[2..6] == payload;
                let mut taken = line.wire.taken.iter();
                taken.any(|taken| taken.is_flushed && has_left(&taken.frame)).then_some(number)
            }
            (Call::Stop | Call::StopAll, _) => None,
            (Call::DriveFor, _) if !before.is_refused => None,
            _ => self.account.allowed,
        };
        if self.account.owed_from.is_some() {
            self.account.allowed = None;
        }
    }
}
