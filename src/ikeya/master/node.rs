//! Everything a master keeps about one node.

use super::{
    config::{MasterConfig, Polling},
    event::{Cause, CommandError},
    health::Health,
    set_point::{Confirm, SetPoint},
    statistics::NodeStatistics,
    stop::{Standstill, Stop, StopProgress},
    turns::Reason,
};
use crate::{
    ikeya::{
        board::{Board, Status, Target},
        units::{Mode, NodeId},
    },
    stats::count_apart,
    time::Instant,
};

/// Number of exchanges without a decision after which the application is told that a mode stays in
/// doubt (I11). The node has been abnormal since the third, and is read at the search rate.
pub(super) const DOUBT_EXCHANGES: u8 = 6;

// Flags first: short instructions can reach them there.
#[derive(Clone, Debug)]
#[repr(C)]
pub(super) struct Node<B: Board> {
    /// `None` until it has answered once.
    pub(super) health: Option<Health>,
    /// The mode on record.
    pub(super) mode: Option<Mode>,
    /// While the mode is in doubt: number of exchanges since then that decided nothing.
    pub(super) doubt: Option<u8>,
    /// Whether the latest command, sent or not, is a set-point: neither a stop nor none at all.
    pub(super) is_under_order: bool,
    /// Whether it has had a WRITE since it was last asked: it is read before its set-point is
    /// repeated.
    pub(super) is_written: bool,
    pub(super) confirm: Confirm,
    /// Number of consecutive windows that closed without its answer.
    pub(super) strikes: u8,
    /// Failed attempts of the READ in progress.
    pub(super) attempt: u8,
    /// Whether the application, or a mode in doubt, asks for a READ.
    pub(super) is_asked: bool,
    /// Number of requests in the discovery in progress.
    pub(super) scans: u8,
    pub(super) last_failure: Option<Cause>,
    /// The node has answered since the application requested a READ.
    pub(super) has_answered: bool,
    /// A READ has failed since then.
    pub(super) has_failed: bool,
    pub(super) stop: Option<Stop<B>>,
    pub(super) set_point: Option<SetPoint<B>>,
    /// Time before which it is not polled: a late answer may be on its way.
    pub(super) guarded_until: Option<Instant>,
    /// Time of the next READ; only set with [`Polling::Every`].
    pub(super) read_due: Option<Instant>,
    pub(super) standstill: Standstill<B>,
    pub(super) status: Option<(Status<B>, Instant)>,
    pub(super) statistics: NodeStatistics,
}

impl<B: Board> Node<B> {
    // In line it would take 90 more bytes of flash.
    #[inline(never)]
    pub(super) const fn new() -> Self {
        Self {
            health: None,
            mode: None,
            doubt: None,
            set_point: None,
            is_under_order: false,
            is_written: false,
            confirm: Confirm::Unasked,
            stop: None,
            standstill: Standstill::Unwatched,
            status: None,
            last_failure: None,
            has_answered: false,
            has_failed: false,
            strikes: 0,
            attempt: 0,
            is_asked: false,
            guarded_until: None,
            read_due: None,
            scans: 0,
            statistics: NodeStatistics::NEW,
        }
    }

    pub(super) fn is_online(&self) -> bool {
        self.health.is_some_and(Health::is_online)
    }

    pub(super) fn is_abnormal(&self) -> bool {
        self.health == Some(Health::Abnormal)
    }

    /// Whether it has been given a command, a paid stop included, or will be.
    pub(super) fn is_commanded(&self) -> bool {
        self.set_point.is_some() || self.is_under_order
    }

    pub(super) fn stop_progress(&self) -> StopProgress {
        match (&self.stop, &self.standstill) {
            (Some(_), _) => StopProgress::Owed,
            (None, Standstill::Unwatched) => StopProgress::NotAsked,
            (None, Standstill::Watched(_)) => StopProgress::Paid,
            (None, Standstill::Reached) => StopProgress::StandingStill,
        }
    }

    /// Takes a new set-point; the latest wins.
    ///
    /// Refused, and not kept, unless the node is online, is owed no stop, and is certain to be in
    /// that mode.
    pub(super) fn aim(&mut self, node: NodeId, target: Target<B>) -> Result<(), CommandError> {
        self.check(node, &target)?;
        self.set_point = Some(SetPoint::new(target));
        (self.is_under_order, self.standstill) = (true, Standstill::Unwatched);
        Ok(())
    }

    pub(super) fn check(&self, node: NodeId, target: &Target<B>) -> Result<(), CommandError> {
        let mode =
            self.mode.filter(|_| self.is_online()).ok_or(CommandError::NotOnline { node })?;
        if self.stop.is_some() {
            return Err(CommandError::StopOwed { node });
        }
        if self.doubt.is_some() {
            return Err(CommandError::ModeInDoubt { node });
        }
        if mode != target.mode() {
            return Err(CommandError::WrongMode { node, mode });
        }
        Ok(())
    }

    /// Drops the set-point; returns whether the application is waiting for its confirmation.
    pub(super) fn drop_set_point(&mut self) -> bool {
        self.set_point = None;
        core::mem::replace(&mut self.confirm, Confirm::Unasked) != Confirm::Unasked
    }

    /// The stop WRITE to be sent next, if one may be sent.
    ///
    /// While the mode is in doubt: only a position that means standstill to a velocity node (I11).
    pub(super) fn stop_write(&self) -> Option<Target<B>> {
        let stop = self.stop.as_ref().filter(|stop| !stop.is_written)?;
        let hold = stop.hold.map(Target::Position);
        match (self.mode?, self.doubt) {
            (Mode::Velocity, None) => Some(Target::STANDSTILL),
            (Mode::Position, None) => hold,
            (_, Some(_)) => hold.filter(|_| stop.hold.is_some_and(B::is_still_as_velocity)),
        }
    }

    /// Whether a request for this reason is due now.
    pub(super) fn is_due(&self, reason: Reason, config: &MasterConfig, now: Instant) -> bool {
        self.wants(reason, config) && self.earliest(reason).is_none_or(|at| now >= at)
    }

    /// Whether a request for this reason is to be sent, now or later.
    #[inline(never)]
    pub(super) fn wants(&self, reason: Reason, config: &MasterConfig) -> bool {
        let is_online = self.is_online();
        match reason {
            Reason::Hold | Reason::SpeedStop | Reason::Stop | Reason::StopRead if !is_online => {
                false
            }
            Reason::Hold => {
                self.stop.as_ref().is_some_and(Stop::is_measured) && self.stop_write().is_some()
            }
            Reason::SpeedStop => matches!(self.stop_write(), Some(Target::Velocity(_))),
            Reason::Stop => self.stop_write().is_some(),
            Reason::StopRead => {
                self.doubt.is_some() || (self.stop.is_some() && self.stop_write().is_none())
            }
            Reason::LostStop | Reason::Search if is_online => false,
            Reason::LostStop => self.awaits_lost_stop(config),
            Reason::SetPoint => {
                self.doubt.is_none() && self.set_point.as_ref().is_some_and(|it| it.is_new)
            }
            Reason::Search => {
                self.stop.is_some() || (self.is_abnormal() && config.recovery_share_pct > 0)
            }
            Reason::Cycle => is_online && self.is_in_cycle(config),
            Reason::Discovery => true,
        }
    }

    /// Earliest time of a request for this reason.
    #[inline(never)]
    pub(super) fn earliest(&self, reason: Reason) -> Option<Instant> {
        match reason {
            // An answered WRITE waits, like a READ, until no late answer can arrive.
            Reason::Hold | Reason::SpeedStop | Reason::Stop | Reason::SetPoint
                if !B::ANSWERS_WRITE =>
            {
                None
            }
            Reason::Cycle if !self.is_wanted() => self.read_due.max(self.guarded_until),
            _ => self.guarded_until,
        }
    }

    /// Whether it is owed a stop and has attempts left of those made at once while it is not
    /// online: one, or those of a READ if the node has never been heard.
    fn awaits_lost_stop(&self, config: &MasterConfig) -> bool {
        let limit = if self.health.is_none() { config.attempts.max(1) } else { 1 };
        self.stop.as_ref().is_some_and(|stop| stop.lost_attempts < limit)
    }

    /// Whether it takes part in the cycle: to be read, or to have its set-point repeated.
    fn is_in_cycle(&self, config: &MasterConfig) -> bool {
        let is_polled = self.is_wanted() || config.polling != Polling::Manual;
        is_polled && self.stop.is_none() && self.doubt.is_none()
    }

    /// Whether it is to be read regardless of the polling.
    fn is_wanted(&self) -> bool {
        self.attempt > 0 || self.is_asked || self.confirm != Confirm::Unasked
    }

    /// Records that a request that expects an answer has been sent.
    #[inline(never)]
    pub(super) fn sent_request(&mut self, config: &MasterConfig, now: Instant) {
        count_apart(&mut self.statistics.requests);
        if self.attempt > 0 {
            count_apart(&mut self.statistics.retries);
        }
        (self.is_asked, self.is_written) = (false, false);
        let is_lost = !self.is_online();
        if let Some(stop) = &mut self.stop {
            stop.is_asked = true;
            stop.lost_attempts = stop.lost_attempts.saturating_add(is_lost.into());
        }
        if let Polling::Every(period) = config.polling {
            // Without drift, and without a burst after a pause.
            match self.read_due {
                Some(due) if due > now => {}
                Some(due) if due + period > now => self.read_due = Some(due + period),
                _ => self.read_due = Some(now + period),
            }
        }
    }
}
