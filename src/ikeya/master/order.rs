//! Orders: what a node has been told, whether it is repeated, and the stop that it is owed (I6, I8,
//! I12).

use crate::{
    ikeya::{
        board::{Board, Status, Target},
        units::Mode,
    },
    time::{Duration, Instant},
};

/// Stop WRITEs that must be followed by a good answer before a stop is confirmed.
const CONFIRMATIONS: u8 = 2;

/// Time within which a measured position must be written, or it is measured again. It doubles with
/// each position that is given up, so that even a slow loop eventually writes one.
const HOLD_PATIENCE: Duration = Duration::from_millis(20);

/// Minimum time between two positions that are compared: 8 counts in this time are 0.05 rps.
const STANDSTILL_TIME: Duration = Duration::from_millis(20);

/// The latest order to a node.
#[derive(Clone, Debug)]
pub(super) struct Order<B: Board> {
    state: State<B>,
    confirm: Confirm,
    /// Whether the node has had a WRITE since it was last asked: it is read before the order is
    /// repeated.
    is_written: bool,
}

#[derive(Clone, Debug)]
enum State<B: Board> {
    None,
    SetPoint(SetPoint<B>),
    /// A set-point that is no longer repeated. The node keeps it.
    Released,
    /// A stop that is owed.
    Owed(Stop<B>),
    /// A stop that is paid. Its target is repeated, unless it was released.
    Paid(Option<SetPoint<B>>, Standstill<B>),
}

/// A target that is repeated in every cycle.
#[derive(Clone, Copy, Debug)]
struct SetPoint<B: Board> {
    target: Target<B>,
    /// Whether it has not been sent yet.
    is_new: bool,
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

/// What a good answer has settled.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Settled {
    /// The WRITE to be confirmed was followed by an answer.
    pub(super) is_confirmed: bool,
    /// The stop is paid.
    pub(super) is_stopped: bool,
    /// The node was found standing still after its stop, for the first time.
    pub(super) is_still: bool,
}

impl<B: Board> Order<B> {
    pub(super) const NONE: Self =
        Self { state: State::None, confirm: Confirm::Unasked, is_written: false };

    /// Takes a new set-point; the latest wins.
    pub(super) fn aim(&mut self, target: Target<B>) {
        self.state = State::SetPoint(SetPoint { target, is_new: true });
    }

    /// No longer repeats the set-point, or the target of a paid stop. Returns whether the
    /// application is waiting for its confirmation.
    pub(super) fn release(&mut self) -> bool {
        match &mut self.state {
            State::SetPoint(_) => self.state = State::Released,
            State::Paid(set_point, _) => *set_point = None,
            State::None | State::Released | State::Owed(_) => {}
        }
        self.end_confirmation()
    }

    /// Makes the node owed a stop, unless it already is. Returns whether the application is waiting
    /// for the confirmation of the set-point that ends with this.
    ///
    /// If the node `is_certain`, that is, online and in its mode, the stop holds what an earlier
    /// stop has held, or the position `measured`, treated as measured `now`.
    pub(super) fn owe_stop(
        &mut self,
        is_certain: bool,
        measured: Option<Status<B>>,
        now: Instant,
    ) -> bool {
        let (hold, measured_at) = match (&self.state, measured) {
            (State::Owed(_), _) => return self.end_confirmation(),
            _ if !is_certain => (None, None),
            (State::Paid(Some(paid), _), _) => (paid.target.position(), None),
            (_, Some(Status::Position(position))) => (Some(position), Some(now)),
            _ => (None, None),
        };
        self.state = State::Owed(Stop::new(hold, measured_at));
        self.end_confirmation()
    }

    /// The node is abnormal: it keeps its last command and is owed a stop, if that `is_stopped`.
    pub(super) fn lose(&mut self, is_stopped: bool) {
        let is_owed = matches!(self.state, State::Owed(_));
        self.state = if is_owed || (is_stopped && self.is_commanded()) {
            State::Owed(Stop::new(None, None))
        } else if self.is_set_point() {
            State::Released
        } else {
            State::None
        };
    }

    /// The mode is in doubt: what was measured does not count, and a position that is held must be
    /// measured again. Returns whether that ends a confirmation.
    pub(super) fn doubt(&mut self) -> bool {
        match &mut self.state {
            State::Owed(stop) => stop.restart(),
            State::Paid(Some(SetPoint { target: Target::Position(_), .. }), _) => {
                self.state = State::Owed(Stop::new(None, None));
                return self.end_confirmation();
            }
            _ => {}
        }
        if self.confirm == Confirm::AfterAnswer {
            // The WRITE may have been read in the other mode.
            self.confirm = Confirm::AfterWrite;
        }
        false
    }

    /// The mode is certain again, and as before.
    pub(super) fn end_doubt(&mut self) {
        if let State::Owed(stop) = &mut self.state {
            stop.restart();
        }
    }

    /// The mode has changed: the order was meant for the old one. The last WRITE may have been read
    /// in the new one, where 0 rps means "go to 0", so the node is owed a stop if it had any.
    /// Returns whether that ends a confirmation.
    pub(super) fn change_mode(&mut self) -> bool {
        if let State::Owed(stop) = &mut self.state {
            stop.restart();
        } else if self.is_commanded() {
            self.state = State::Owed(Stop::new(None, None));
        } else {
            self.state = State::None;
        }
        self.end_confirmation()
    }

    /// Asks for a confirmation; returns whether there is a set-point to confirm.
    pub(super) fn confirm(&mut self) -> bool {
        let is_confirmable = self.set_point().is_some();
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
    /// The target that is repeated: a set-point, or that of a paid stop.
    pub(super) const fn target(&self) -> Option<Target<B>> {
        match self.set_point() {
            Some(set_point) => Some(set_point.target),
            None => None,
        }
    }

    const fn set_point(&self) -> Option<&SetPoint<B>> {
        match &self.state {
            State::SetPoint(set_point) | State::Paid(Some(set_point), _) => Some(set_point),
            _ => None,
        }
    }

    /// Whether the target has not been sent yet.
    pub(super) fn is_new(&self) -> bool {
        self.set_point().is_some_and(|it| it.is_new)
    }

    /// Whether the node has had a WRITE since it was last asked.
    pub(super) const fn is_written(&self) -> bool {
        self.is_written
    }

    /// Whether the latest command, sent or not, is a set-point: neither a stop nor none at all.
    pub(super) const fn is_set_point(&self) -> bool {
        matches!(self.state, State::SetPoint(_) | State::Released)
    }

    /// Whether there is a command, a paid stop included, that the node has been given or will be.
    fn is_commanded(&self) -> bool {
        self.is_set_point() || self.set_point().is_some()
    }

    /// The stop that is owed.
    pub(super) const fn stop(&self) -> Option<&Stop<B>> {
        match &self.state {
            State::Owed(stop) => Some(stop),
            _ => None,
        }
    }

    pub(super) const fn progress(&self) -> StopProgress {
        match self.state {
            State::None | State::SetPoint(_) | State::Released => StopProgress::NotAsked,
            State::Owed(_) => StopProgress::Owed,
            State::Paid(_, Standstill::Watched(_)) => StopProgress::Paid,
            State::Paid(_, Standstill::Reached) => StopProgress::StandingStill,
        }
    }

    /// Gives up a measured position that could not be written at once.
    pub(super) fn forget_old_hold(&mut self, now: Instant, gap: Duration) {
        if let State::Owed(stop) = &mut self.state {
            stop.forget_old_hold(now, gap);
        }
    }
}

/// What happens to it.
impl<B: Board> Order<B> {
    /// Its WRITE has been handed out.
    pub(super) fn wrote(&mut self) {
        self.is_written = true;
        match &mut self.state {
            State::Owed(stop) => {
                stop.is_written = true;
                stop.writes = stop.writes.saturating_add(1);
            }
            State::SetPoint(set_point) | State::Paid(Some(set_point), _) => {
                set_point.is_new = false;
                if self.confirm == Confirm::AfterWrite {
                    self.confirm = Confirm::AfterAnswer;
                }
            }
            _ => {}
        }
    }

    /// Its WRITE has not left after all, or nobody knows.
    pub(super) fn take_back_write(&mut self) {
        self.is_written = false;
        match &mut self.state {
            State::Owed(stop) => {
                let was_written = core::mem::take(&mut stop.is_written);
                stop.writes = stop.writes.saturating_sub(was_written.into());
            }
            State::SetPoint(set_point) | State::Paid(Some(set_point), _) => {
                set_point.is_new = true;
                if self.confirm == Confirm::AfterAnswer {
                    self.confirm = Confirm::AfterWrite;
                }
            }
            _ => {}
        }
    }

    /// The node has been asked.
    pub(super) fn asked(&mut self, is_online: bool) {
        self.is_written = false;
        if let State::Owed(stop) = &mut self.state {
            stop.is_asked = true;
            stop.lost_attempts = stop.lost_attempts.saturating_add((!is_online).into());
        }
    }

    /// The node has not been asked after all.
    pub(super) fn take_back_request(&mut self, is_online: bool) {
        if let State::Owed(stop) = &mut self.state {
            stop.lost_attempts = stop.lost_attempts.saturating_sub((!is_online).into());
        }
    }

    /// The node has not answered: the WRITE may have been lost too, and a stop is repeated.
    pub(super) fn missed(&mut self) {
        if let State::Owed(stop) = &mut self.state {
            stop.is_written = false;
        }
    }

    /// Keeps the position of an answer for the stop to hold.
    pub(super) fn measure(&mut self, status: &Status<B>, now: Instant) {
        if let State::Owed(stop) = &mut self.state {
            stop.measure(status, now);
        }
    }

    /// The node has answered in its mode: that may measure or pay a stop, or show a standstill.
    pub(super) fn answered(&mut self, status: &Status<B>, now: Instant) -> Settled {
        let mut settled = Settled::default();
        if self.confirm == Confirm::AfterAnswer {
            self.confirm = Confirm::Unasked;
            settled.is_confirmed = true;
        }
        if let State::Owed(stop) = &mut self.state {
            stop.measure(status, now);
            settled.is_stopped = stop.pay();
            if settled.is_stopped {
                // A position stop is not written until there is a position to hold.
                let target = stop.hold.map_or(Target::STANDSTILL, Target::Position);
                let set_point = SetPoint { target, is_new: false };
                self.state = State::Paid(Some(set_point), Standstill::Watched(None));
            }
        }
        if let State::Paid(_, standstill) = &mut self.state {
            settled.is_still = standstill.watch(*status, now);
        }
        settled
    }
}

/// A stop that is owed to a node.
#[derive(Clone, Copy, Debug)]
pub(super) struct Stop<B: Board> {
    /// The position to hold for a position node; `None` until it has been measured.
    hold: Option<B::Position>,
    /// Time of that measurement.
    measured_at: Option<Instant>,
    /// Time within which it must be written.
    patience: Duration,
    /// Whether a stop WRITE has been sent and waits for an answer.
    is_written: bool,
    /// Stop WRITEs sent.
    writes: u8,
    /// Whether the open window, if any, was opened after the stop was requested.
    is_asked: bool,
    /// Stop WRITEs that were followed by a good answer.
    paid: u8,
    /// Attempts made while the node was not online.
    lost_attempts: u8,
}

impl<B: Board> Stop<B> {
    /// A new debt. `hold` is a position that may be held without measuring again, treated as
    /// measured at `measured_at`.
    const fn new(hold: Option<B::Position>, measured_at: Option<Instant>) -> Self {
        Self {
            hold,
            measured_at,
            patience: HOLD_PATIENCE,
            is_written: false,
            writes: 0,
            is_asked: false,
            paid: 0,
            lost_attempts: 0,
        }
    }

    /// The stop WRITE for a node in this mode, unless one waits for an answer.
    ///
    /// While the mode is in doubt: only a position that means standstill to a velocity node (I11).
    pub(super) fn write(&self, mode: Mode, is_in_doubt: bool) -> Option<Target<B>> {
        if self.is_written {
            return None;
        }
        let hold = self.hold.map(Target::Position);
        match mode {
            _ if is_in_doubt => hold.filter(|_| self.hold.is_some_and(B::is_still_as_velocity)),
            Mode::Velocity => Some(Target::STANDSTILL),
            Mode::Position => hold,
        }
    }

    /// Whether a position has been measured for this stop but not written yet.
    pub(super) const fn is_measured(&self) -> bool {
        self.is_asked && self.measured_at.is_some() && self.writes == 0
    }

    pub(super) const fn lost_attempts(&self) -> u8 {
        self.lost_attempts
    }

    /// Discards everything measured or paid so far: the node was abnormal, or its mode in doubt.
    #[inline(never)]
    fn restart(&mut self) {
        (self.hold, self.measured_at) = (None, None);
        (self.is_written, self.writes, self.paid) = (false, 0, 0);
    }

    /// Keeps the position of an answer to hold, if it was requested after the stop.
    fn measure(&mut self, status: &Status<B>, now: Instant) {
        if let (Status::Position(position), None, true) = (status, self.hold, self.is_asked) {
            (self.hold, self.measured_at, self.writes) = (Some(*position), Some(now), 0);
        }
    }

    /// Gives up a position that could not be written at once, allowing for the `gap` after each
    /// packet.
    fn forget_old_hold(&mut self, now: Instant, gap: Duration) {
        if self.writes > 0 {
            return;
        }
        if self.measured_at.is_some_and(|at| now - at > self.patience + gap) {
            (self.hold, self.measured_at) = (None, None);
            self.patience = self.patience + self.patience;
        }
    }

    /// Counts a good answer in the node's mode; returns whether the stop is now paid.
    fn pay(&mut self) -> bool {
        if core::mem::take(&mut self.is_written) {
            self.paid += 1;
        }
        self.paid >= CONFIRMATIONS
    }
}
/// Progress of a stop, see [`Master::stop_progress`](super::Master::stop_progress).
#[derive(Clone, Copy, Debug, Eq, Hash, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum StopProgress {
    /// The node's latest command, if any, is not a stop.
    NotAsked,
    /// The stop is owed: it has not been confirmed twice yet.
    Owed,
    /// The node has confirmed the stop twice, and may still be slowing down.
    Paid,
    /// The node has confirmed the stop twice, and was found standing still.
    StandingStill,
}

/// The watch for standstill after a stop is paid.
#[derive(Clone, Copy, Debug)]
enum Standstill<B: Board> {
    /// Watched, with a status to compare the next ones with.
    Watched(Option<(Status<B>, Instant)>),
    /// Standstill was measured.
    Reached,
}

impl<B: Board> Standstill<B> {
    /// Processes a status; returns whether it is the first to show a standstill.
    fn watch(&mut self, status: Status<B>, now: Instant) -> bool {
        let Self::Watched(before) = *self else { return false };
        let is_still = match (status, before) {
            (Status::Velocity(speed), _) => B::is_still(speed),
            (Status::Position(here), Some((Status::Position(there), at))) => {
                if now - at < STANDSTILL_TIME {
                    return false;
                }
                B::is_same_place(here, there)
            }
            (Status::Position(_), _) => false,
        };
        *self = if is_still { Self::Reached } else { Self::Watched(Some((status, now))) };
        is_still
    }
}
