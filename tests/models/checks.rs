//! Invariants of a motor bus, after every step.

use axlewire::ikeya::master::{MasterEvent, StopProgress};

use super::{
    account::{Confirm, REPEAT, STRIKES},
    bus::Bus,
    kit::Sent,
    names::*,
};

/// Most exchanges of each other node for which an urgent one waits. The fifth is that of a node
/// whose mode changes, so that it is held twice.
const URGENT_WAITS: u8 = 5;

/// The same in the cycle.
const CYCLE_WAITS: u8 = 10;

/// Longest time until the search returns to a node that is owed a stop: one window at 1 %.
const LONGEST_PAUSE: Duration = Duration::from_millis(150);

impl<B: Kit> Bus<B> {
    /// No node waits longer than stated in `queue.rs`.
    pub(super) fn check_order(&mut self, sent: &Sent) -> Checked {
        let (now, is_discovering) = (self.now, self.master.is_discovering());
        let is_exchange = sent.is_exchange::<B>();
        let polls = self.menu.polls_fastest;
        let others = self.motors.len() as u8 - 1;
        for (account, node) in self.accounts.iter_mut().zip(NodeId::ALL) {
            if node == sent.node {
                if is_exchange && account.guard_until.is_some_and(|until| now < until) {
                    return Err(format!(
                        "node {node} is asked while a late answer may still arrive"
                    ));
                }
                (account.waits, account.cycle_waits) = (0, 0);
                account.was_asked_since |= is_exchange;
                continue;
            }
            // One that was taken back is new, and has its turn like a set-point.
            let is_late = match account.stopped_at {
                Some(at) => now >= at + REPEAT && account.was_asked_since && !B::ANSWERS_WRITE,
                None => !account.is_online(),
            };
            account.was_asked_since |= is_exchange;
            if is_exchange && is_late && account.is_stop_repeated(B::ANSWERS_WRITE) {
                return Err(format!("a READ of node {} before a stop is repeated", sent.node));
            }
            if !is_exchange || !account.is_askable(now) {
                continue;
            }
            let is_velocity = account.record == Some(Mode::Velocity) && !B::ANSWERS_WRITE;
            if is_velocity && account.is_owed && account.is_stop_due && !account.is_in_doubt {
                return Err(format!("a READ of node {} before a velocity stop", sent.node));
            }
            if account.is_urgent(now) {
                account.waits += 1;
            } else if polls && !is_discovering && !account.is_owed && !account.is_in_doubt {
                account.cycle_waits += 1;
            }
            if account.waits > URGENT_WAITS * others || account.cycle_waits > CYCLE_WAITS * others {
                return Err(format!("node {node} waits too long"));
            }
        }
        Ok(())
    }

    /// Every reported event has happened, and every event is reported.
    pub(super) fn take_events(&mut self) -> Checked {
        while let Some(event) = self.takes_events.then(|| self.master.poll_event()).flatten() {
            match event {
                MasterEvent::Stopped { node } => {
                    let paid = self.account(node).paid;
                    broken_if!(paid < 2, "Stopped, with {paid} payments");
                }
                MasterEvent::Confirmed { node } => {
                    let confirm = std::mem::take(&mut self.account(node).confirm);
                    if confirm != Confirm::Succeeds {
                        return Err(format!("Confirmed without a reason: {confirm:?}"));
                    }
                }
                MasterEvent::NotConfirmed { node, .. } => {
                    let attempts = self.master.config().attempts.clamp(1, STRIKES);
                    let is_still = self.master.stop_progress(node) == StopProgress::StandingStill;
                    let is_manual = self.master.config().polling == Polling::Manual;
                    let has_target = self.master.set_point(node).is_some();
                    let is_left = is_still && (is_manual || !has_target);
                    let account = self.account(node);
                    let confirm = std::mem::take(&mut account.confirm);
                    // A stop that was released, or is not polled, has no more WRITE once it is
                    // still.
                    let is_dropped = confirm == Confirm::Fails || is_left;
                    if !is_dropped && account.misses < attempts {
                        return Err(format!("NotConfirmed without a reason: {confirm:?}"));
                    }
                }
                MasterEvent::StopBlocked { node } => self.account(node).is_block_told = true,
                MasterEvent::ModeInDoubt { node } => self.account(node).is_doubt_told = true,
                _ => {}
            }
        }
        self.check_accounts()
    }

    /// The master owes the same stops, and agrees on which nodes are present.
    fn check_accounts(&mut self) -> Checked {
        let owed = self.master.stops_owed();
        for (index, account) in self.accounts.iter_mut().enumerate() {
            let node = NodeId::ALL[index];
            let progress = self.master.stop_progress(node);
            if account.is_owed && !owed.contains(node) {
                broken_if!(account.paid < 2, "node {node}: the stop is forgotten");
                (account.is_owed, account.is_stop_due) = (false, false);
                account.coast(self.now);
            }
            if account.coasting_since.is_some() && !owed.contains(node) {
                // Of a position node, two answers show that it moves.
                let is_velocity = account.record == Some(Mode::Velocity);
                let (least, most) = (1, if is_velocity { 1 } else { 2 });
                match progress {
                    StopProgress::StandingStill if !self.motors[index].is_told_to_stop => {
                        return Err(format!("node {node} is still, but it was told to move"));
                    }
                    StopProgress::StandingStill if account.is_away => {
                        return Err(format!("node {node} is still, but not where it holds"));
                    }
                    StopProgress::StandingStill => {
                        (account.coasting_since, account.is_still) = (None, true);
                    }
                    StopProgress::Confirmed if !account.is_told && account.late_moves < most => {}
                    StopProgress::StillMoving
                        if account.late_moves >= least || account.has_moved_late =>
                    {
                        account.is_told = true
                    }
                    StopProgress::StillMoving if account.is_told => {}
                    _ => return Err(format!("node {node} coasts, and is {progress:?}")),
                }
            } else if account.is_still && !owed.contains(node) {
                // A stop that was released ends when the node is abnormal.
                account.is_still = progress == StopProgress::StandingStill;
                if progress == StopProgress::NotAsked {
                    account.begin_coasting(None);
                }
                if !account.is_still && account.is_online() {
                    if progress != StopProgress::Confirmed || !account.is_away {
                        return Err(format!("node {node} was still, and is {progress:?}"));
                    }
                    account.moves_again(self.now);
                }
            }
            if progress == StopProgress::StandingStill && account.is_in_doubt && !account.is_let_go
            {
                return Err(format!("node {node} stands still although its mode is in doubt"));
            }
            if !account.is_owed && owed.contains(node) {
                // The stop of a still node is owed again if it is abnormal or in doubt.
                let is_renewed = account.is_in_doubt || !account.is_online();
                if !(account.is_still && is_renewed) {
                    return Err(format!("node {node}: a stop that was not requested"));
                }
                account.owe_again();
            }
            if self.takes_events {
                if let Confirm::Succeeds | Confirm::Fails = account.confirm {
                    return Err(format!("node {node}: the end of a confirmation was not reported"));
                }
                if let Some(untold) = account.untold() {
                    return Err(format!("node {node}: {untold}"));
                }
            }
            let is_abnormal = self.master.health(node) == Some(Health::Abnormal);
            if is_abnormal != (account.record.is_some() && !account.is_online()) {
                return Err(format!("node {node}: abnormal: {is_abnormal}"));
            }
        }
        Ok(())
    }

    /// If the master has nothing to send, there is a future deadline at which it will.
    pub(super) fn check_rest(&self) -> Checked {
        let timeout = self.master.poll_timeout();
        broken_if!(timeout.is_some_and(|at| at <= self.now), "a deadline in the past");
        // A packet handed out behind a WRITE that is still leaving would not leave any earlier.
        if timeout.is_none_or(|at| at > self.line_free) {
            check_sleep(&self.master, self.now)?;
        }
        let is_owed = self.accounts.iter().any(|account| account.is_owed);
        let is_waiting = self.accounts.iter().any(|account| account.confirm != Confirm::Unasked);
        if timeout.is_none() && (is_owed || is_waiting) {
            return Err("a stop or a confirmation is owed, but there is no deadline".into());
        }
        if is_owed && timeout.is_some_and(|at| at > self.now + LONGEST_PAUSE) {
            return Err("a stop is owed, but no node is asked for it".into());
        }
        let is_late = timeout.is_none_or(|at| at > self.now + REPEAT);
        if is_late && self.accounts.iter().any(|it| it.is_stop_repeated(B::ANSWERS_WRITE)) {
            return Err("a stop is not repeated".into());
        }
        Ok(())
    }
}
