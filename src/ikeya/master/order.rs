//! Orders: what a node has been told, whether it is repeated, and the stop that it is owed (I6, I8,
//! I12).

use super::{
    config::{MasterConfig, Polling},
    event::{Change, Changes},
};
use crate::{
    ikeya::{
        board::{Board, Status, Target},
        units::Mode,
    },
    time::{Duration, Instant},
};

/// Stop WRITEs that must be followed by a good answer before a stop is confirmed.
const CONFIRMATIONS: u8 = 2;

/// Time within which a WRITE of a measured position must be followed by an answer, besides its own
/// time on the wire, or the node is read again. It doubles each time, so that even on a slow line
/// an answer eventually follows. If the WRITE has not left, it only grows by as much: a port that
/// fails makes no hold old.
const HOLD_PATIENCE: Duration = Duration::from_millis(20);

/// Minimum time between two answers that show a standstill.
const STILL_TIME: Duration = Duration::from_millis(20);

/// Longest time from a request to its answer in which nothing can have moved far.
const PROMPT: Duration = Duration::from_millis(1);

/// Longest way in [`STILL_TIME`] that counts as a standstill, counts: 0.05 rps.
const STILL_COUNTS: u32 = 8;

/// Longest way from the position that a node holds at which it obeys, counts: 1/32 of a turn. A
/// loaded motor may stand beside the position that it was told.
const HOLD_COUNTS: u32 = 256;

/// Longest time between two stop WRITEs, where the line allows it (I12, I13).
const REPEAT_TIME: Duration = Duration::from_millis(20);

/// The latest order to a node.
// Flags first: short instructions can reach them there.
#[derive(Clone, Debug)]
#[repr(C)]
pub(super) struct Order<B: Board> {
    /// Whether the node has had a WRITE since its last exchange ended: it is read before the order
    /// is repeated.
    is_written: bool,
    /// Whether the node has ever had a WRITE from this master.
    was_written: bool,
    confirm: Confirm,
    state: State<B>,
}

#[derive(Clone, Debug)]
enum State<B: Board> {
    None,
    SetPoint(SetPoint<B>),
    /// A set-point that is no longer repeated. The node keeps it.
    Released,
    Stop(Stop<B>),
}

/// A target that is repeated in every cycle.
#[derive(Clone, Copy, Debug)]
struct SetPoint<B: Board> {
    /// Whether it has not been sent yet.
    is_new: bool,
    target: Target<B>,
}

/// Progress of confirming a WRITE.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
enum Confirm {
    /// The application has not asked for a confirmation.
    Unasked,
    /// The next WRITE is to be confirmed.
    AfterWrite,
    /// The WRITE has been sent; the next answer confirms it.
    AfterAnswer,
}

impl<B: Board> Order<B> {
    // Not a constant: it would be copied from a table in flash.
    pub(super) const fn new() -> Self {
        Self {
            state: State::None,
            confirm: Confirm::Unasked,
            is_written: false,
            was_written: false,
        }
    }

    /// Takes a new set-point; the latest wins.
    pub(super) fn aim(&mut self, target: Target<B>) {
        self.state = State::SetPoint(SetPoint { target, is_new: true });
    }

    /// No longer repeats the set-point, or the target of a stop once the node is still. Returns
    /// whether the application is waiting for its confirmation.
    pub(super) fn release(&mut self) -> bool {
        match &mut self.state {
            State::SetPoint(_) => self.state = State::Released,
            State::Stop(stop) => stop.is_released = true,
            State::None | State::Released => {}
        }
        self.end_confirmation()
    }

    /// Makes the node owed a stop, or joins the one that it is owed until it is still. Returns
    /// whether the application is waiting for the confirmation of the set-point that ends with
    /// this.
    ///
    /// It holds what an earlier stop has held, if the node is still there when it is read. A node
    /// that `is_certain`, that is, online and in its mode, may hold the position `measured`,
    /// treated as measured `now`.
    pub(super) fn owe_stop(
        &mut self,
        is_certain: bool,
        measured: Option<Status<B>>,
        now: Instant,
    ) -> bool {
        let held = match &mut self.state {
            State::Stop(stop) if stop.stage != Stage::Still => {
                stop.join(now);
                return self.end_confirmation();
            }
            State::Stop(stop) if !stop.is_released => stop.hold,
            _ => None,
        };
        let mut stop = Stop::new(held);
        if let (true, Some(Status::Position(position))) = (is_certain, measured) {
            stop.hold_at(position, now);
        }
        self.state = State::Stop(stop);
        self.end_confirmation()
    }

    /// The node is abnormal: it keeps its last command and is owed a stop, if that `is_stopped`.
    pub(super) fn lose(&mut self, is_stopped: bool) {
        let held = match &mut self.state {
            State::Stop(stop) if stop.stage != Stage::Still => return stop.lose(),
            State::Stop(stop) if is_stopped && !stop.is_released => stop.hold,
            State::SetPoint(_) | State::Released if is_stopped => None,
            State::SetPoint(_) | State::Released => return self.state = State::Released,
            State::None | State::Stop(_) => return self.state = State::None,
        };
        self.state = State::Stop(Stop::new(held));
    }

    /// The mode is in doubt: what was measured does not count, so a motor that was still may move,
    /// unless the node was released. Returns whether that ends a confirmation.
    pub(super) fn doubt(&mut self) -> bool {
        if let State::Stop(stop) = &mut self.state {
            if stop.stage != Stage::Still || !stop.is_released {
                stop.restart();
                return self.end_confirmation();
            }
        }
        if self.confirm == Confirm::AfterAnswer {
            // The WRITE may have been read in the other mode.
            self.confirm = Confirm::AfterWrite;
        }
        false
    }

    /// The mode is certain again, and as before.
    pub(super) fn end_doubt(&mut self) {
        if let State::Stop(stop) = &mut self.state {
            if stop.stage == Stage::Owed {
                stop.restart();
            }
        }
    }

    /// The mode has changed: the order was meant for the old one. Any WRITE so far, even of a stop
    /// or of an order that was released, may have been read in the new one, where 0 rps means "go
    /// to 0": the node is owed a stop if it has ever had one (I11). Returns whether that ends a
    /// confirmation.
    pub(super) fn change_mode(&mut self) -> bool {
        let is_commanded = self.was_written || self.is_set_point();
        match &mut self.state {
            State::Stop(stop) if stop.stage != Stage::Still => stop.restart(),
            state if is_commanded => *state = State::Stop(Stop::new(None)),
            state => *state = State::None,
        }
        self.end_confirmation()
    }

    /// Asks for a confirmation; returns whether there is a set-point to confirm.
    pub(super) fn confirm(&mut self, polling: Polling) -> bool {
        let is_confirmable = self.cycle_target(polling).is_some();
        if is_confirmable {
            self.confirm = Confirm::AfterWrite;
        }
        is_confirmable
    }

    /// Ends the confirmation; returns whether the application is waiting for one.
    pub(super) fn end_confirmation(&mut self) -> bool {
        core::mem::replace(&mut self.confirm, Confirm::Unasked) != Confirm::Unasked
    }

    pub(super) fn awaits_confirmation(&self) -> bool {
        self.confirm != Confirm::Unasked
    }
}

/// What is to be sent.
impl<B: Board> Order<B> {
    /// The target that is repeated: a set-point, or that of a stop that is confirmed.
    #[inline(never)]
    pub(super) fn target(&self) -> Option<Target<B>> {
        match &self.state {
            State::SetPoint(set_point) => Some(set_point.target),
            State::Stop(stop) => stop.repeated(),
            State::None | State::Released => None,
        }
    }

    /// The target that goes in front of a READ in the cycle. With no cycle, a node that is still
    /// gets none: it may have been moved by hand since it was read.
    pub(super) fn cycle_target(&self, polling: Polling) -> Option<Target<B>> {
        self.target().filter(|_| polling != Polling::Manual || !self.is_still())
    }

    /// Whether the target has not been sent yet.
    pub(super) fn is_new(&self) -> bool {
        match &self.state {
            State::SetPoint(set_point) => set_point.is_new,
            State::Stop(stop) => stop.stage == Stage::Confirmed && stop.written_at.is_none(),
            State::None | State::Released => false,
        }
    }

    /// Whether the node has had a WRITE since its last exchange ended.
    pub(super) const fn is_written(&self) -> bool {
        self.is_written
    }

    /// Whether the latest command, sent or not, is a set-point: neither a stop nor none at all.
    pub(super) const fn is_set_point(&self) -> bool {
        matches!(self.state, State::SetPoint(_) | State::Released)
    }

    /// The latest command, if it is a stop.
    pub(super) const fn stop(&self) -> Option<&Stop<B>> {
        match &self.state {
            State::Stop(stop) => Some(stop),
            _ => None,
        }
    }

    /// The stop, unless it is confirmed.
    #[inline(never)]
    pub(super) fn stop_owed(&self) -> Option<&Stop<B>> {
        self.stop().filter(|stop| stop.stage == Stage::Owed)
    }

    /// The stop, unless the node is seen to be still.
    pub(super) fn stop_unseen(&self) -> Option<&Stop<B>> {
        self.stop().filter(|stop| stop.stage != Stage::Still)
    }

    /// The stop, if it is confirmed and the node not still.
    pub(super) fn coasting(&self) -> Option<&Stop<B>> {
        self.stop().filter(|stop| stop.stage == Stage::Confirmed)
    }

    /// Whether the node is seen to be still after a stop.
    fn is_still(&self) -> bool {
        self.stop().is_some_and(|stop| stop.stage == Stage::Still)
    }

    pub(super) fn progress(&self) -> StopProgress {
        match self.stop() {
            None => StopProgress::NotAsked,
            Some(stop) => match stop.stage {
                Stage::Owed => StopProgress::Owed,
                Stage::Confirmed if stop.is_told => StopProgress::StillMoving,
                Stage::Confirmed => StopProgress::Confirmed,
                Stage::Still => StopProgress::StandingStill,
            },
        }
    }

    /// Reads the node again if no answer has come in time behind a measured position.
    pub(super) fn forget_old_hold(&mut self, now: Instant, write_time: Duration) {
        if let State::Stop(stop) = &mut self.state {
            stop.forget_old_hold(now, write_time);
        }
    }
}

/// What happens to it.
impl<B: Board> Order<B> {
    /// Its WRITE has been handed out.
    pub(super) fn wrote(&mut self, now: Instant) {
        (self.is_written, self.was_written) = (true, true);
        match &mut self.state {
            State::Stop(stop) => stop.wrote(now),
            State::SetPoint(set_point) => set_point.is_new = false,
            State::None | State::Released => {}
        }
        if self.confirm == Confirm::AfterWrite {
            self.confirm = Confirm::AfterAnswer;
        }
    }

    /// Its WRITE has not left after all, or nobody knows.
    pub(super) fn take_back_write(&mut self) {
        self.is_written = false;
        match &mut self.state {
            State::Stop(stop) => stop.take_back_write(),
            State::SetPoint(set_point) => set_point.is_new = true,
            State::None | State::Released => {}
        }
        if self.confirm == Confirm::AfterAnswer {
            self.confirm = Confirm::AfterWrite;
        }
    }

    /// The node has been asked.
    pub(super) fn asked(&mut self, is_online: bool) {
        if let State::Stop(stop) = &mut self.state {
            stop.is_asked = true;
            stop.lost_attempts = stop.lost_attempts.saturating_add((!is_online).into());
        }
    }

    /// The node has not been asked after all.
    pub(super) fn take_back_request(&mut self, is_online: bool) {
        if let State::Stop(stop) = &mut self.state {
            stop.lost_attempts = stop.lost_attempts.saturating_sub((!is_online).into());
        }
    }

    /// An exchange with the node has ended, with an answer or without.
    pub(super) const fn end_exchange(&mut self) {
        self.is_written = false;
    }

    /// The node has not answered: the WRITE may have been lost too, and a stop is repeated.
    pub(super) fn missed(&mut self) {
        if let State::Stop(stop) = &mut self.state {
            stop.missed();
        }
    }

    /// Keeps the position of an answer for the stop to hold.
    pub(super) fn measure(&mut self, status: &Status<B>, now: Instant) {
        if let State::Stop(stop) = &mut self.state {
            stop.measure(status, now);
        }
    }

    /// The node has answered in its mode, a request that ended at `asked_at`: that may confirm a
    /// stop, or show that the node is still.
    // In line it would take 90 more bytes of flash.
    #[inline(never)]
    pub(super) fn answered(
        &mut self,
        status: &Status<B>,
        asked_at: Instant,
        config: &MasterConfig,
        now: Instant,
    ) -> Changes {
        let settled = match &mut self.state {
            State::Stop(stop) => stop.answered(status, asked_at, config, now),
            _ => Changes::NONE,
        };
        let is_confirmed = self.confirm == Confirm::AfterAnswer && self.end_confirmation();
        // A node that is still gets no WRITE to be confirmed if it was released or is not polled.
        let is_dropped = self.cycle_target(config.polling).is_none() && self.end_confirmation();
        settled.with(Change::Confirmed, is_confirmed).with(Change::Dropped, is_dropped)
    }
}

/// A stop. It is owed to the node until the node is seen to be still (I12).
// This order was found by trying: it takes less flash than others.
#[derive(Clone, Copy, Debug)]
#[repr(C)]
pub(super) struct Stop<B: Board> {
    /// When it was read there.
    measured_at: Instant,
    /// Whether a stop WRITE has been sent and waits for an answer.
    is_written: bool,
    stage: Stage,
    /// Whether it is no longer repeated once the node is still.
    is_released: bool,
    /// Whether the open window, if any, was opened after the stop was requested.
    is_asked: bool,
    /// Attempts made while the node was not online.
    lost_attempts: u8,
    /// Whether it was confirmed, even if that was lost again.
    was_confirmed: bool,
    /// Whether the application was told that the node is still moving.
    is_told: bool,
    /// Whether `seen` agrees with an earlier answer.
    is_second: bool,
    /// Stop WRITEs that were followed by a good answer.
    followed: u8,
    /// Whether the node was read since it may have moved, or been moved, away from `hold`.
    is_there: bool,
    /// Time from which the node has to become still: that of the first confirmation, or of a stop
    /// that was asked for again.
    confirmed_at: Instant,
    /// An answer behind a stop WRITE that may be the first of those that show a standstill.
    seen: Option<(Status<B>, Instant)>,
    /// Time within which an answer must follow its WRITE.
    patience: Duration,
    /// The position that a position node is to hold; `None` until it has been measured.
    hold: Option<B::Position>,
    /// Time of the latest stop WRITE, unless it was taken back.
    written_at: Option<Instant>,
}

/// How far a stop has come.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
enum Stage {
    /// Not confirmed.
    Owed,
    /// Confirmed: two stop WRITEs have each been followed by a good answer.
    Confirmed,
    /// The node is seen to be still.
    Still,
}

impl<B: Board> Stop<B> {
    /// A new debt. An earlier stop has `held` this position.
    fn new(held: Option<B::Position>) -> Self {
        Self {
            stage: Stage::Owed,
            is_written: false,
            is_released: false,
            is_asked: false,
            is_told: false,
            was_confirmed: false,
            is_second: false,
            followed: 0,
            lost_attempts: 0,
            is_there: false,
            hold: held,
            measured_at: Instant::from_micros(0),
            patience: HOLD_PATIENCE,
            written_at: None,
            confirmed_at: Instant::from_micros(0),
            seen: None,
        }
    }

    /// Its target for a node in this mode, once there is one.
    ///
    /// While the mode is in doubt: only a position that means standstill to a velocity node (I11).
    pub(super) fn target(&self, mode: Mode, is_in_doubt: bool) -> Option<Target<B>> {
        let hold = self.held();
        match mode {
            _ if is_in_doubt => {
                hold.filter(|it| B::is_still_as_velocity(*it)).map(Target::Position)
            }
            Mode::Velocity => Some(Target::STANDSTILL),
            Mode::Position => hold.map(Target::Position),
        }
    }

    /// The position to hold, unless the node is to be read first.
    fn held(&self) -> Option<B::Position> {
        self.hold.filter(|_| self.is_there)
    }

    /// Its target, if it is confirmed and repeated. A position stop is not confirmed until there is
    /// a position to hold.
    fn repeated(&self) -> Option<Target<B>> {
        let is_repeated = match self.stage {
            Stage::Owed => false,
            Stage::Confirmed => true,
            Stage::Still => !self.is_released,
        };
        is_repeated.then(|| self.held().map_or(Target::STANDSTILL, Target::Position))
    }

    /// Whether its WRITE waits for an answer.
    pub(super) const fn is_written(&self) -> bool {
        self.is_written
    }

    /// Whether a position has been measured for it but not written yet.
    pub(super) fn is_measured(&self) -> bool {
        let is_unheard = self.followed == 0 && self.written_at.is_none();
        self.is_asked && is_unheard && self.held().is_some()
    }

    pub(super) const fn lost_attempts(&self) -> u8 {
        self.lost_attempts
    }

    /// Whether it is written again, whatever else is due: not before its first WRITE.
    pub(super) fn is_repeated(&self) -> bool {
        self.stage == Stage::Confirmed || self.written_at.is_some()
    }

    /// When it is; `None` for at once.
    pub(super) fn repeat_at(&self) -> Option<Instant> {
        self.written_at.map(|at| at + REPEAT_TIME)
    }

    /// Discards everything measured or confirmed so far: the mode is, or was, in doubt.
    fn restart(&mut self) {
        if self.stage == Stage::Still {
            (self.was_confirmed, self.is_told) = (false, false);
        }
        (self.stage, self.followed, self.seen) = (Stage::Owed, 0, None);
        (self.is_written, self.written_at) = (false, None);
        (self.hold, self.is_there) = (None, false);
    }

    /// The node is abnormal. It has no more time to become still than before.
    fn lose(&mut self) {
        let hold = self.hold;
        self.restart();
        self.hold = hold;
        (self.is_asked, self.lost_attempts) = (false, 0);
    }

    fn wrote(&mut self, now: Instant) {
        (self.is_written, self.written_at) = (true, Some(now));
    }

    /// The application asks again: it is told again, `coast` later, that the node still moves.
    /// Asking often must not postpone that.
    fn join(&mut self, now: Instant) {
        self.is_released = false;
        if core::mem::take(&mut self.is_told) {
            self.confirmed_at = now;
        }
    }

    fn take_back_write(&mut self) {
        (self.is_written, self.written_at) = (false, None);
    }

    /// Keeps the position of an answer to hold, if it was requested after the stop and the stop is
    /// owed: a velocity node that is still has none, and may just be in doubt.
    fn measure(&mut self, status: &Status<B>, now: Instant) {
        let is_due = self.is_asked && self.stage == Stage::Owed && !self.is_there;
        if let (Status::Position(position), true) = (status, is_due) {
            self.hold_at(*position, now);
        }
    }

    /// Holds a position that was measured now, or what it has held before, if that is near: a
    /// loaded motor stands beside what it holds, and would creep away if that were held next.
    fn hold_at(&mut self, position: B::Position, now: Instant) {
        let is_near = self.hold.is_some_and(|held| B::distance(held, position) <= HOLD_COUNTS);
        if !is_near {
            self.hold = Some(position);
        }
        (self.measured_at, self.is_there) = (now, true);
    }

    /// If the node has perhaps never heard the position to hold, it is read first. Not each time: a
    /// loaded node that never answers behind a WRITE would creep away.
    fn missed(&mut self) {
        self.is_written = false;
        if self.is_there && self.followed == 0 && self.patience <= HOLD_PATIENCE + HOLD_PATIENCE {
            self.read_again();
        }
    }

    /// Reads the node again if no answer has come in time behind the measured position.
    fn forget_old_hold(&mut self, now: Instant, write_time: Duration) {
        if self.has_old_hold(now, write_time) {
            self.read_again();
        }
    }

    /// Whether no answer has come in time behind the measured position, allowing for the
    /// `write_time`, which includes the gap in front of the WRITE.
    pub(super) fn has_old_hold(&self, now: Instant, write_time: Duration) -> bool {
        let is_due = self.stage == Stage::Owed && self.is_there && self.followed == 0;
        is_due && now - self.measured_at > self.patience + write_time
    }

    fn read_again(&mut self) {
        // The order of the fields and of these lines saves flash.
        let more = if self.is_written { self.patience } else { HOLD_PATIENCE };
        (self.is_there, self.is_written, self.written_at) = (false, false, None);
        self.patience = self.patience + more;
    }

    /// Takes a good answer of the node in its mode, to a request that ended at `asked_at`.
    fn answered(
        &mut self,
        status: &Status<B>,
        asked_at: Instant,
        config: &MasterConfig,
        now: Instant,
    ) -> Changes {
        let mut settled = Changes::NONE;
        if core::mem::take(&mut self.is_written) {
            self.followed = self.followed.saturating_add(1);
        }
        if self.stage == Stage::Owed && self.followed >= CONFIRMATIONS {
            self.stage = Stage::Confirmed;
            if !core::mem::replace(&mut self.was_confirmed, true) {
                self.confirmed_at = now;
            }
            settled = settled.with(Change::Stopped, true);
        }
        // An answer to a READ in front of all stop WRITEs shows nothing.
        let sight =
            if self.followed > 0 { self.see(status, asked_at, now) } else { Sight::Unclear };
        match (self.stage, sight) {
            (Stage::Confirmed, Sight::Still) => {
                self.stage = Stage::Still;
                settled = settled.with(Change::Still, true);
            }
            (Stage::Confirmed, Sight::MovingSince(since))
                if !self.is_told && since - self.confirmed_at >= config.coast =>
            {
                self.is_told = true;
                settled = settled.with(Change::StillMoving, true);
            }
            // It looked still, but had not obeyed, or obeys no longer. If it is not told any more
            // to hold its position, it must not be driven back there.
            (Stage::Still, Sight::MovingSince(_))
                if !self.is_released && config.polling != Polling::Manual =>
            {
                self.stage = Stage::Confirmed;
                (self.confirmed_at, self.is_told) = (now, false);
            }
            _ => {}
        }
        settled
    }

    /// Compares an answer with an earlier one. One alone may be of a motor that is just reversing.
    ///
    /// A position node overruns the position that it holds and comes back, so that two answers may
    /// be of the same place: it takes three, and no answer in between that is far away. A node that
    /// stands elsewhere has not obeyed.
    fn see(&mut self, status: &Status<B>, asked_at: Instant, now: Instant) -> Sight {
        let is_still = self.stage == Stage::Still;
        let limit = if is_still { 2 * HOLD_COUNTS } else { HOLD_COUNTS };
        let is_away = match (status, &self.hold) {
            (Status::Velocity(speed), _) => !B::is_still(*speed),
            (Status::Position(here), Some(hold)) => B::distance(*here, *hold) > limit,
            (Status::Position(_), None) => false,
        };
        if is_away {
            self.seen = None;
            return Sight::MovingSince(now);
        }
        if is_still {
            return Sight::Still;
        }
        let is_enough = matches!(status, Status::Velocity(_)) || self.is_second;
        let way = match (&self.seen, status) {
            (Some((Status::Position(there), _)), Status::Position(here)) => {
                B::distance(*here, *there)
            }
            _ => 0,
        };
        let (is_far, is_very_far) = (way > STILL_COUNTS, way > 2 * STILL_COUNTS);
        // A late answer may have been measured as soon as it was asked for.
        let measured_at = now.min(asked_at + PROMPT);
        let sight = match self.seen.map(|(_, at)| (at, measured_at - at)) {
            Some((at, age)) if is_very_far || is_far && age >= STILL_TIME + STILL_TIME => {
                self.is_second = false;
                Sight::MovingSince(at)
            }
            Some((_, age)) if is_far || age < STILL_TIME => return Sight::Unclear,
            Some(_) if is_enough => return Sight::Still,
            seen => {
                self.is_second = seen.is_some();
                Sight::Unclear
            }
        };
        self.seen = Some((*status, now));
        sight
    }
}

/// What an answer shows, with those before it.
enum Sight {
    Still,
    /// The motor has moved since then.
    MovingSince(Instant),
    Unclear,
}

/// Progress of a stop, see [`Master::stop_progress`](crate::ikeya::Master::stop_progress) (I12).
#[derive(Clone, Copy, Debug, Eq, Hash, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum StopProgress {
    /// No stop is watched: the node's latest command, if any, is not a stop; or the node was lost
    /// after it was still, and it was released or
    /// [`stops_abnormal`](super::MasterConfig::stops_abnormal) is off.
    NotAsked,
    /// The stop is not confirmed: set-points are refused.
    Owed,
    /// Confirmed: two stop WRITEs have each been followed by an answer. They may have been lost
    /// although the READs behind them were answered, and the motor may still be slowing down: the
    /// stop is repeated.
    Confirmed,
    /// Confirmed, but the motor still moves after
    /// [`MasterConfig::coast`](super::MasterConfig::coast), or is more than 1/32 of a turn away
    /// from the position that it was told to hold. The stop is repeated.
    StillMoving,
    /// Answers at least 20 ms apart have shown a motor that is still: two below 0.05 rps, or three
    /// positions within 8 counts, no more than 1/32 of a turn away from the position to hold. An
    /// answer above 0.05 rps, or more than 1/16 of a turn away, ends this, unless the node was
    /// [released](crate::ikeya::Master::release) or is polled by hand
    /// ([`Polling::Manual`](super::Polling::Manual)). So does an answer in another mode (I11),
    /// unless the node was released.
    StandingStill,
}
