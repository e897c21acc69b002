//! Everything a master keeps about one node: whether it answers, and when it is asked (I7, I8).

use super::{
    config::{MasterConfig, Polling},
    event::{Cause, Change, Changes, CommandError, Health},
    mode::{Decision, KnownMode},
    order::{Order, Stop},
    statistics::NodeStatistics,
};
use crate::{
    ikeya::{
        board::{Board, Status, Target},
        units::{Mode, NodeId},
    },
    stats::{count_apart, uncount},
    time::{Duration, Instant},
};

/// Number of consecutive windows without its answer after which a node is abnormal.
const STRIKES: u8 = 3;

// The order and the flags first: short instructions can reach them there.
#[derive(Clone, Debug)]
#[repr(C)]
pub(super) struct Node<B: Board> {
    order: Order<B>,
    mode: KnownMode,
    /// `None` until it has answered once.
    health: Option<Health>,
    /// Number of consecutive windows that closed without its answer.
    strikes: u8,
    /// Failed attempts of the READ in progress.
    attempt: u8,
    last_failure: Option<Cause>,
    status: Option<(Status<B>, Instant)>,
    /// Whether the application, or a mode in doubt, asks for a READ.
    is_asked: bool,
    /// The node has answered since the application requested a READ.
    has_answered: bool,
    /// A READ has failed since then.
    has_failed: bool,
    /// Number of requests in the discovery in progress.
    scans: u8,
    /// Time before which it is not polled: a late answer may be on its way.
    guarded_until: Instant,
    /// Time of the next READ; only set with [`Polling::Every`].
    read_due: Option<Instant>,
    statistics: NodeStatistics,
}

/// Reason for a request to a node.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub(super) enum Reason {
    /// The WRITE of a freshly measured position: the second half of an attempt.
    Hold,
    /// A stop WRITE for a velocity node that is online.
    SpeedStop,
    /// A stop WRITE for any node that is online.
    Stop,
    /// A stop WRITE to a node that has had none for 20 ms and is not seen to be still; blind to a
    /// velocity node that is not online, if a WRITE is silent.
    Repeat,
    /// A READ that a stop or a mode in doubt is waiting for.
    StopRead,
    /// The first attempt for a node that is owed a stop and is not online.
    LostStop,
    SetPoint,
    Discovery,
    /// The search for a node that was heard before and is owed a stop.
    SearchLost,
    /// The search for any other.
    Search,
    Cycle,
}

impl Reason {
    /// The urgent reasons by priority, then the rest.
    pub(super) const ALL: [Self; 11] = [
        Self::Hold,
        Self::SpeedStop,
        Self::Stop,
        Self::Repeat,
        Self::StopRead,
        Self::LostStop,
        Self::SetPoint,
        Self::Discovery,
        Self::SearchLost,
        Self::Search,
        Self::Cycle,
    ];

    /// Whether it is for a stop or a mode in doubt.
    pub(super) const fn is_stop(self) -> bool {
        matches!(
            self,
            Self::Hold
                | Self::SpeedStop
                | Self::Stop
                | Self::Repeat
                | Self::StopRead
                | Self::LostStop
        )
    }
}

impl Reason {
    /// Whether it is for the search.
    pub(super) const fn is_search(self) -> bool {
        matches!(self, Self::SearchLost | Self::Search)
    }
}

/// Kind of request.
#[derive(Clone, Copy, Debug)]
pub(super) enum Request<B: Board> {
    Read,
    Write(Target<B>),
}

impl<B: Board> Request<B> {
    /// Whether it is answered; a silent request is not.
    pub(super) const fn is_exchange(&self) -> bool {
        B::ANSWERS_WRITE || matches!(self, Self::Read)
    }
}

/// Commands.
impl<B: Board> Node<B> {
    // In line it would take 90 more bytes of flash.
    #[inline(never)]
    pub(super) const fn new(now: Instant) -> Self {
        Self {
            health: None,
            mode: KnownMode::UNKNOWN,
            strikes: 0,
            attempt: 0,
            is_asked: false,
            scans: 0,
            last_failure: None,
            has_answered: false,
            has_failed: false,
            order: Order::new(),
            guarded_until: now,
            read_due: None,
            status: None,
            statistics: NodeStatistics::NEW,
        }
    }

    /// Takes a new set-point; the latest wins.
    ///
    /// Refused, and not kept, unless the node is online, is owed no stop, and is certain to be in
    /// that mode.
    pub(super) fn aim(&mut self, node: NodeId, target: Target<B>) -> Result<(), CommandError> {
        self.check(node, &target)?;
        self.order.aim(target);
        Ok(())
    }

    pub(super) fn check(&self, node: NodeId, target: &Target<B>) -> Result<(), CommandError> {
        let mode = self.mode.on_record().filter(|_| self.is_online());
        let mode = mode.ok_or(CommandError::NotOnline { node })?;
        if self.order.stop_owed().is_some() {
            return Err(CommandError::StopOwed { node });
        }
        if self.mode.is_in_doubt() {
            return Err(CommandError::ModeInDoubt { node });
        }
        if mode != target.mode() {
            return Err(CommandError::WrongMode { node, mode });
        }
        Ok(())
    }

    pub(super) fn release(&mut self) -> Changes {
        Changes::NONE.with(Change::Dropped, self.order.release())
    }

    /// Makes it owed a stop, unless it already is.
    pub(super) fn owe_stop(&mut self, hold_age: Duration, now: Instant) -> Changes {
        let is_new = self.order.stop_owed().is_none();
        let is_certain = self.is_online() && !self.mode.is_in_doubt();
        let measured = self.status.filter(|&(_, at)| now - at < hold_age).map(|it| it.0);
        let is_unconfirmed = self.order.owe_stop(is_certain, measured, now);
        let changes = Changes::NONE.with(Change::Dropped, is_unconfirmed);
        changes.with(Change::Undecided, is_new && self.mode.is_undecided())
    }

    pub(super) fn confirm(&mut self, node: NodeId, polling: Polling) -> Result<(), CommandError> {
        if !self.is_online() {
            return Err(CommandError::NotOnline { node });
        }
        if !self.order.confirm(polling) {
            return Err(CommandError::NoSetPoint { node });
        }
        Ok(())
    }

    pub(super) fn read(&mut self, node: NodeId) -> Result<(), CommandError> {
        if !self.is_online() {
            return Err(CommandError::NotOnline { node });
        }
        (self.is_asked, self.has_answered, self.has_failed) = (true, false, false);
        Ok(())
    }
}

/// What is known.
impl<B: Board> Node<B> {
    pub(super) const fn health(&self) -> Option<Health> {
        self.health
    }

    pub(super) const fn mode(&self) -> KnownMode {
        self.mode
    }

    pub(super) const fn order(&self) -> &Order<B> {
        &self.order
    }

    pub(super) const fn status(&self) -> Option<(Status<B>, Instant)> {
        self.status
    }

    pub(super) const fn statistics(&self) -> &NodeStatistics {
        &self.statistics
    }

    pub(super) const fn last_failure(&self) -> Option<Cause> {
        self.last_failure
    }

    /// How the READ has ended that the application asked for.
    pub(super) const fn read_outcome(&self) -> Option<Result<(), Cause>> {
        match self.last_failure {
            _ if self.has_answered => Some(Ok(())),
            Some(cause) if self.has_failed => Some(Err(cause)),
            _ => None,
        }
    }

    pub(super) fn is_online(&self) -> bool {
        self.health.is_some_and(Health::is_online)
    }

    /// Whether it is to be polled in a pass of a discovery.
    pub(super) fn is_scanned(&self, pass: u16) -> bool {
        !self.is_online() && u16::from(self.scans) <= pass
    }
}

/// What is to be sent.
impl<B: Board> Node<B> {
    /// The stop WRITE to be sent next, if one may be sent.
    fn stop_write(&self) -> Option<Target<B>> {
        self.order.stop_owed().filter(|stop| !stop.is_written())?;
        self.stop_target()
    }

    fn stop_target(&self) -> Option<Target<B>> {
        self.order.stop()?.target(self.mode.on_record()?, self.mode.is_in_doubt())
    }

    /// Whether this WRITE would still be sent to it.
    pub(super) fn takes(&self, target: Target<B>) -> bool {
        let is_wanted = match self.mode.is_in_doubt() {
            true => None,
            false => self.order.target(),
        };
        is_wanted.or_else(|| self.stop_target()) == Some(target)
    }

    /// Whether it has been heard, is owed a stop and does not answer.
    pub(super) fn is_lost(&self) -> bool {
        self.is_abnormal() && self.order.stop_owed().is_some()
    }

    fn is_abnormal(&self) -> bool {
        self.health == Some(Health::Abnormal)
    }

    /// Earliest time of a request for this reason; `None` if there is none to send.
    pub(super) fn due_at(
        &self,
        reason: Reason,
        config: &MasterConfig,
        now: Instant,
    ) -> Option<Instant> {
        // An answered WRITE waits, like a READ, until no late answer can arrive.
        let is_apart = matches!(
            reason,
            Reason::Hold | Reason::SpeedStop | Reason::Stop | Reason::Repeat | Reason::SetPoint
        );
        let guard = if B::ANSWERS_WRITE || !is_apart { self.guarded_until } else { now };
        let turn = match reason {
            Reason::Repeat => self.order.stop_unseen().and_then(Stop::repeat_at),
            Reason::Cycle if !self.is_wanted() => self.cycle_at(config),
            _ => None,
        };
        let at = turn.unwrap_or(now).max(guard);
        self.has(reason, config).then_some(at)
    }

    /// Whether there is a request for this reason, now or later.
    fn has(&self, reason: Reason, config: &MasterConfig) -> bool {
        let (stop, write) = (self.order.stop_owed(), self.stop_write());
        let (is_online, is_in_doubt) = (self.is_online(), self.mode.is_in_doubt());
        match reason {
            Reason::Hold => is_online && write.is_some() && stop.is_some_and(Stop::is_measured),
            Reason::SpeedStop => is_online && matches!(write, Some(Target::Velocity(_))),
            Reason::Stop => is_online && write.is_some(),
            Reason::Repeat if is_in_doubt => false,
            // The first WRITE to a node that is online has another reason.
            Reason::Repeat if is_online => self.order.stop_unseen().is_some_and(Stop::is_repeated),
            Reason::Repeat => {
                let is_blind = matches!(self.stop_target(), Some(Target::Velocity(_)));
                !B::ANSWERS_WRITE && stop.is_some() && is_blind
            }
            Reason::StopRead => is_online && (is_in_doubt || stop.is_some() && write.is_none()),
            Reason::LostStop => self.awaits_lost_stop(),
            Reason::SetPoint => self.order.is_new() && !is_in_doubt,
            Reason::SearchLost => self.is_lost(),
            Reason::Search if is_online => false,
            Reason::Search => match self.health {
                None => stop.is_some(),
                Some(_) => stop.is_none() && config.recovery_share_pct > 0,
            },
            Reason::Cycle => {
                let is_polled = self.is_wanted()
                    || config.polling != Polling::Manual
                    || self.order.coasting().is_some();
                is_online && is_polled && stop.is_none() && !is_in_doubt
            }
            Reason::Discovery => true,
        }
    }

    /// Its turn in the cycle; `None` for at once. Until it is still after a stop, it is read every
    /// 20 ms whatever the polling.
    fn cycle_at(&self, config: &MasterConfig) -> Option<Instant> {
        match (self.order.coasting(), config.polling) {
            (Some(_), _) if self.order.is_written() => None,
            (_, Polling::Fastest) => None,
            (Some(stop), Polling::Every(_)) => Some(self.read_due?.min(stop.repeat_at()?)),
            (Some(stop), Polling::Manual) => stop.repeat_at(),
            (None, _) => self.read_due,
        }
    }

    /// Whether it was heard before, is owed a stop, and has not had the attempt that is made at
    /// once while it is not online.
    fn awaits_lost_stop(&self) -> bool {
        self.is_abnormal() && self.has_attempts(1)
    }

    /// Whether it is owed a stop that needs its answer, and is asked at any search rate: a node
    /// that was heard before and gets no stop blind, or one that never was and has attempts
    /// left.
    pub(super) fn is_sought_first(&self, config: &MasterConfig) -> bool {
        if self.health.is_none() {
            return self.has_attempts(config.attempts);
        }
        self.is_lost() && (B::ANSWERS_WRITE || self.mode.on_record() == Some(Mode::Position))
    }

    /// Whether it is owed a stop and has had fewer attempts than this while it was not online.
    fn has_attempts(&self, limit: u8) -> bool {
        self.order.stop_owed().is_some_and(|stop| stop.lost_attempts() < limit)
    }

    /// Whether it is to be read regardless of the polling.
    fn is_wanted(&self) -> bool {
        self.attempt > 0 || self.is_asked || self.order.awaits_confirmation()
    }

    /// Its request for this reason. In the cycle a node gets its set-point, then a READ. A node
    /// that is not online gets its stop blind, apart from its READs; where a WRITE is answered,
    /// instead of them.
    pub(super) fn request(&self, reason: Reason, polling: Polling) -> Request<B> {
        let target = match reason {
            Reason::StopRead | Reason::Discovery => None,
            Reason::LostStop | Reason::SearchLost | Reason::Search if !B::ANSWERS_WRITE => None,
            Reason::Repeat => self.stop_target(),
            Reason::Cycle if self.order.is_written() => None,
            Reason::SetPoint | Reason::Cycle => self.order.cycle_target(polling),
            _ => self.stop_write(),
        };
        target.map_or(Request::Read, Request::Write)
    }

    pub(super) fn forget_old_hold(&mut self, now: Instant, write_time: Duration) {
        self.order.forget_old_hold(now, write_time);
    }

    pub(super) fn has_old_hold(&self, now: Instant, write_time: Duration) -> bool {
        self.order.stop_owed().is_some_and(|stop| stop.has_old_hold(now, write_time))
    }
}

/// What happens on the line.
impl<B: Board> Node<B> {
    /// Its stop or its set-point has been handed out.
    pub(super) fn wrote(&mut self, now: Instant) {
        self.order.wrote(now);
    }

    pub(super) fn take_back_write(&mut self) {
        self.order.take_back_write();
    }

    /// A request that expects an answer has been handed out.
    pub(super) fn asked(&mut self, is_scan: bool, config: &MasterConfig, now: Instant) {
        count_apart(&mut self.statistics.requests);
        if self.attempt > 0 {
            count_apart(&mut self.statistics.retries);
        }
        self.is_asked = false;
        self.scans = self.scans.saturating_add(is_scan.into());
        self.order.asked(self.is_online());
        if let Polling::Every(period) = config.polling {
            // Without drift, and without a burst after a pause.
            match self.read_due {
                Some(due) if due > now => {}
                Some(due) if due + period > now => self.read_due = Some(due + period),
                _ => self.read_due = Some(now + period),
            }
        }
    }

    /// That request has not left.
    pub(super) fn take_back_request(&mut self, is_scan: bool) {
        uncount(&mut self.statistics.requests);
        if self.attempt > 0 {
            uncount(&mut self.statistics.retries);
        }
        self.scans = self.scans.saturating_sub(is_scan.into());
        self.is_asked = self.is_online();
        self.order.take_back_request(self.is_asked);
    }

    /// A discovery begins.
    pub(super) const fn begin_scan(&mut self) {
        self.scans = 0;
    }

    /// Its answer may come until then.
    pub(super) const fn guard_until(&mut self, at: Instant) {
        self.guarded_until = at;
    }

    /// An answer outside its window, or too early: it can put the mode in doubt, but decides
    /// nothing.
    pub(super) fn hear_outside_window(&mut self, mode: Mode, is_early: bool) -> Changes {
        let counter = match is_early {
            true => &mut self.statistics.early,
            false => &mut self.statistics.late,
        };
        count_apart(counter);
        match self.mode.differs_from(mode) {
            true => self.doubt_mode(),
            false => Changes::NONE,
        }
    }

    fn doubt_mode(&mut self) -> Changes {
        count_apart(&mut self.statistics.other_mode);
        let is_unconfirmed = self.mode.doubt() && self.order.doubt();
        Changes::NONE.with(Change::Dropped, is_unconfirmed)
    }

    /// An answer in its window, to a request that ended at `asked_at`; it came this late.
    // In line it would take 20 more bytes of flash.
    #[inline(never)]
    pub(super) fn hear_answer(
        &mut self,
        status: &Status<B>,
        asked_at: Instant,
        latency: Duration,
        config: &MasterConfig,
        now: Instant,
    ) -> Changes {
        self.order.end_exchange();
        let was = self.health.replace(Health::Online);
        (self.strikes, self.attempt, self.guarded_until) = (0, 0, now);
        let decision = self.mode.decide(status.mode());
        let changes = Changes::NONE
            .with(Change::Discovered, was.is_none())
            .with(Change::Health, was.is_some_and(|was| was != Health::Online));
        let changes = match decision {
            Decision::Agreed => changes,
            Decision::Doubtful => changes.and(self.doubt_mode()),
            Decision::Settled => {
                self.order.end_doubt();
                changes
            }
            Decision::Changed => {
                let is_unconfirmed = self.order.change_mode();
                changes.with(Change::Dropped, is_unconfirmed).with(Change::Mode, true)
            }
        };
        self.order.measure(status, now);
        if self.mode.is_in_doubt() {
            return changes;
        }
        self.statistics.reply(latency);
        self.has_answered = true;
        self.status = Some((*status, now));
        let settled = self.order.answered(status, asked_at, config, now);
        changes.with(Change::Answered, true).and(settled)
    }

    /// Its window has closed without its answer. A late one may come until the guard is over.
    pub(super) fn miss(&mut self, cause: Cause, config: &MasterConfig, guard: Instant) -> Changes {
        self.guarded_until = guard;
        count_apart(&mut self.statistics.timeouts);
        if cause == Cause::Damaged {
            count_apart(&mut self.statistics.crc_errors);
        }
        self.order.end_exchange();
        self.order.missed();
        let changes = Changes::NONE.with(Change::Undecided, self.mode.miss());
        if !self.is_online() {
            return changes; // looked for, and not found
        }
        self.strikes = self.strikes.saturating_add(1);
        self.attempt = self.attempt.saturating_add(1);
        let is_abnormal = self.strikes >= STRIKES;
        let health = if is_abnormal { Health::Abnormal } else { Health::Suspect(self.strikes) };
        self.health = Some(health);
        let is_failed = is_abnormal || self.attempt >= config.attempts;
        let is_unconfirmed = is_failed && self.order.end_confirmation();
        if is_failed {
            (self.attempt, self.last_failure, self.has_failed) = (0, Some(cause), true);
            count_apart(&mut self.statistics.failures);
        }
        if is_abnormal {
            self.order.lose(config.stops_abnormal);
        }
        changes
            .with(Change::Health, true)
            .with(Change::Failed, is_failed)
            .with(Change::Unconfirmed, is_unconfirmed)
    }
}
