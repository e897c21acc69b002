//! What a master may do to a node, derived by the test from calls, sent packets and received
//! packets.
//!
//! Nothing here looks inside the master. The rulings are I6 (hold), I8 (confirmation), I11 (doubt),
//! I12 (debts) and I13 (order).

use super::{
    kit::Write,
    names::*,
    rulings::{Aim, HOLD_PATIENCE, Order, judge},
};

/// Number of windows without the answer after which a node is abnormal.
pub(crate) const STRIKES: u8 = 3;

/// Time between two stop WRITEs until the node is still: the longest, and to a node that does not
/// answer also the shortest (I12, I13).
pub(crate) const REPEAT: Duration = Duration::from_millis(20);

/// Longest way from the position that a node holds at which that is still held.
const HOLD_COUNTS: u16 = 256;

/// A motor under way shows another place with each reading, 20 counts further.
fn bit(count: i16) -> u64 {
    1 << (count / 20 % 64)
}

/// Number of exchanges with a node in doubt after which the application is notified.
const UNDECIDED: u8 = 6;

#[derive(Clone, Copy, Debug, Default, Eq, PartialEq)]
pub(crate) enum Confirm {
    #[default]
    Unasked,
    AfterWrite,
    AfterAnswer,
    /// Has to end now, with this result.
    Succeeds,
    Fails,
}

#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Account {
    /// The last mode received, unless it is in doubt.
    pub(crate) record: Option<Mode>,
    pub(crate) is_in_doubt: bool,
    /// Number of exchanges in doubt without a decision.
    pub(crate) undecided: u8,
    /// The unresolved doubt, and a stop waiting for it, have been reported.
    pub(crate) is_doubt_told: bool,
    pub(crate) is_block_told: bool,
    /// Consecutive windows without the answer.
    pub(crate) misses: u8,
    /// The set-point that was accepted and not dropped since: its number, 1 or 2.
    pub(crate) target: Option<u8>,
    /// The number of the last accepted set-point.
    pub(crate) last_target: u8,
    /// The set-point has not been sent.
    pub(crate) is_target_new: bool,
    /// The last order was a set-point.
    pub(crate) is_under_order: bool,
    /// The last order was a stop.
    pub(crate) is_halted: bool,
    /// The node has ever been sent a WRITE.
    was_written: bool,
    /// Toggles with each first stop after a set-point, so that a position shows for which stop it
    /// was measured.
    pub(crate) is_odd_stop: bool,
    pub(crate) is_owed: bool,
    /// A stop WRITE has to be sent or resent.
    pub(crate) is_stop_due: bool,
    /// A stop WRITE has been sent and nothing was missed since.
    pub(crate) is_stop_written: bool,
    pub(crate) paid: u8,
    /// Payments for a position to hold that was not too old by then.
    paid_in_time: u8,
    /// Since when it has to become still, while the stop is confirmed.
    pub(crate) coasting_since: Option<Instant>,
    /// The same, even if the confirmation is lost: when it was the first time, or the stop was
    /// asked for again.
    pub(crate) coasts_from: Option<Instant>,
    /// The application was told that it still moves.
    pub(crate) is_told: bool,
    /// Answers that it still moves which were heard when it had no more time for that; up to 2.
    pub(crate) late_moves: u8,
    /// There was one before the stop was confirmed again.
    pub(crate) has_moved_late: bool,
    /// It was seen to be still.
    pub(crate) is_still: bool,
    /// When the last stop WRITE was sent, and whether anybody was asked since.
    pub(crate) stopped_at: Option<Instant>,
    pub(crate) was_asked_since: bool,
    /// The position that the node was told to hold, and whether another one is allowed.
    hold: Option<Position>,
    pub(crate) may_hold_anew: bool,
    /// When the last answer in front of its WRITE was heard.
    hold_heard_at: Option<Instant>,
    pub(crate) is_released: bool,
    /// Released since the stop, which continues until the node is still.
    pub(crate) is_let_go: bool,
    /// Its last answer showed it away from that position.
    pub(crate) is_away: bool,
    /// How often the node has measured a position for this stop, and when the last ones were
    /// heard.
    places_heard: u32,
    places_heard_at: [Option<(i16, Instant)>; 4],
    /// All that it has measured, one bit each.
    places_shown: u64,
    pub(crate) confirm: Confirm,
    /// The node must not be asked before this time.
    pub(crate) guard_until: Option<Instant>,
    /// Exchanges of other nodes while it had an urgent one due, and while its cycle turn was due.
    pub(crate) waits: u8,
    pub(crate) cycle_waits: u8,
}

impl Account {
    pub(crate) fn is_online(&self) -> bool {
        self.record.is_some() && self.misses < STRIKES
    }

    /// The rotation that a READ handed out now will return.
    pub(crate) fn rotation(&self) -> i16 {
        if self.is_halted { 20 + i16::from(self.is_odd_stop) } else { 10 }
    }

    /// A set-point was accepted.
    pub(crate) fn aim(&mut self) {
        let number = 3 - self.last_target.max(1);
        (self.target, self.last_target, self.is_target_new) = (Some(number), number, true);
        (self.is_under_order, self.is_halted, self.hold) = (true, false, None);
        self.is_let_go = false;
        (self.coasting_since, self.is_still, self.waits) = (None, false, 0);
        self.begin_coasting(None);
    }

    /// The set-point is dropped.
    pub(crate) fn drop_target(&mut self) {
        (self.target, self.is_target_new) = (None, false);
        if self.confirm != Confirm::Unasked {
            self.confirm = Confirm::Fails;
        }
    }

    /// The application asks for a stop; it joins one whose node is not still yet. If it was told
    /// that the node still moves, that begins anew.
    pub(crate) fn stop(&mut self, is_told: bool, now: Instant) {
        self.is_let_go = false;
        match self.coasting_since {
            Some(_) => {
                self.drop_target();
                self.is_released = false;
                if is_told {
                    self.begin_coasting(Some(now));
                    self.coast(now);
                }
            }
            None => {
                // What it held is kept if the node is there, unless it was released.
                self.may_hold_anew |= self.is_still;
                if self.is_owed && self.is_told {
                    self.begin_coasting(Some(now));
                }
                self.hold = self.hold.filter(|_| !(self.is_still && self.is_released));
                self.owe();
            }
        }
    }

    /// It has all of its time again to become still.
    pub(crate) fn begin_coasting(&mut self, from: Option<Instant>) {
        (self.coasts_from, self.is_told, self.has_moved_late) = (from, false, false);
    }

    /// The stop is confirmed: it has to become still, unless that has begun before.
    pub(crate) fn coast(&mut self, now: Instant) {
        self.coasting_since = Some(*self.coasts_from.get_or_insert(now));
        self.late_moves = 0;
    }

    /// It was still, and is not any longer.
    pub(crate) fn moves_again(&mut self, now: Instant) {
        self.begin_coasting(None);
        self.coast(now);
    }

    /// The node is owed a stop, if it is not already.
    pub(crate) fn owe(&mut self) {
        self.drop_target();
        if !self.is_halted {
            self.begin_coasting(None);
            (self.is_odd_stop, self.hold, self.may_hold_anew) = (!self.is_odd_stop, None, true);
            (self.places_heard, self.places_heard_at, self.places_shown) = (0, [None; 4], 0);
        }
        (self.is_halted, self.is_under_order, self.is_released) = (true, false, false);
        self.owe_again();
    }

    /// The same stop is owed, or owed again.
    pub(crate) fn owe_again(&mut self) {
        if self.is_still {
            self.begin_coasting(None);
        }
        (self.coasting_since, self.is_still) = (None, false);
        if !self.is_owed {
            (self.is_owed, self.paid, self.stopped_at, self.waits) = (true, 0, None, 0);
            self.paid_in_time = 0;
            (self.is_stop_due, self.is_stop_written) = (true, false);
        }
    }

    /// All payments and measurements are discarded, unless the node is still.
    fn restart_stop(&mut self) {
        if self.coasting_since.is_some() {
            let is_released = self.is_released;
            self.owe();
            self.is_released = is_released;
        }
        (self.paid, self.paid_in_time) = (0, 0);
        (self.is_stop_written, self.is_stop_due) = (false, self.is_owed);
        (self.may_hold_anew, self.stopped_at) = (true, None);
    }

    /// A WRITE is handed out: checks whether it is allowed.
    pub(crate) fn write(
        &mut self,
        write: Write,
        is_three: bool,
        at: Instant,
        gap: Duration,
    ) -> Result<(), String> {
        let zero = write.speed == 0;
        let aim = self.target.map(|number| match self.record {
            Some(Mode::Position) => Aim::Place((7, 100 + i16::from(number))),
            _ => Aim::Rps(f32::from(number)),
        });
        let order = match self.is_halted {
            true => Order::Stop { is_measured: write.place.1 % 1000 == self.rotation() },
            false => Order::SetPoint(aim),
        };
        judge(&write, is_three, self.record, self.is_in_doubt, order)?;
        // Since the last one it has not answered: an answer would have brought it online.
        let is_blind = zero && self.record == Some(Mode::Velocity) && !self.is_online();
        if is_blind && !is_three && self.stopped_at.is_some_and(|last| at < last + REPEAT) {
            return Err("two blind stops less than 20 ms apart".into());
        }
        let is_hold = self.is_halted && !(self.record == Some(Mode::Velocity) && zero);
        if is_hold {
            let place = Position::new(write.place.0, write.place.1);
            let way = |hold: Position| hold.counts().abs_diff(place.counts());
            if self.hold.is_some_and(|hold| way(hold) > 0) && !self.may_hold_anew {
                return Err("a different position to hold".into());
            }
            let doublings = self.places_heard.saturating_sub(1).min(9);
            let patience = HOLD_PATIENCE.saturating_mul(1 << doublings) + gap;
            let mut heard = self.places_heard_at.iter().flatten();
            // It keeps an earlier one if the last one is near.
            let is_young = |&(count, heard_at): &(i16, _)| {
                count.abs_diff(write.place.0) <= HOLD_COUNTS && at <= heard_at + patience
            };
            let is_shown = self.places_shown & bit(write.place.0) != 0;
            if !(is_shown && heard.any(is_young)) && self.hold != Some(place) {
                return Err("a position to hold that is too old".into());
            }
            (self.hold, self.may_hold_anew) = (Some(place), false);
            self.hold_heard_at = self.last_heard().map(|(_, heard_at)| heard_at);
        }
        (self.is_target_new, self.was_written) = (false, true);
        (self.stopped_at, self.was_asked_since) = (self.is_halted.then_some(at), false);
        if self.is_owed {
            (self.is_stop_written, self.is_stop_due) = (true, false);
        } else if self.confirm == Confirm::AfterWrite {
            self.confirm = Confirm::AfterAnswer;
        }
        Ok(())
    }

    /// The last WRITE handed out did not leave, or possibly did not.
    pub(crate) fn take_back_write(&mut self) {
        (self.is_target_new, self.stopped_at) = (self.target.is_some(), None);
        if self.is_owed {
            (self.is_stop_written, self.is_stop_due) = (false, true);
            // The node may never have received the position to hold: it may be measured again.
            self.may_hold_anew = true;
        } else if self.confirm == Confirm::AfterAnswer {
            self.confirm = Confirm::AfterWrite;
        }
    }

    fn begin_doubt(&mut self) {
        if !self.is_in_doubt {
            (self.is_in_doubt, self.undecided) = (true, 0);
            (self.is_doubt_told, self.is_block_told) = (false, false);
            // The stop is owed again, unless the node was released: that ends its confirmation.
            let is_left = self.is_still && self.is_let_go;
            if self.is_halted && !is_left && self.confirm != Confirm::Unasked {
                self.confirm = Confirm::Fails;
            }
            // A WRITE that may have been read in the other mode confirms nothing.
            if self.confirm == Confirm::AfterAnswer {
                self.confirm = Confirm::AfterWrite;
            }
            self.restart_stop();
        }
    }

    /// A complete answer arrived outside its window: it may begin a doubt.
    pub(crate) fn hear_outside(&mut self, mode: Mode) {
        if self.record.is_some_and(|record| record != mode) {
            self.begin_doubt();
        }
    }

    /// The count that it has shown last, for this stop, and when that was heard.
    fn last_heard(&self) -> Option<(i16, Instant)> {
        let last = self.places_heard.checked_sub(1)?;
        self.places_heard_at[last as usize % 4]
    }

    pub(crate) fn last_count(&self) -> Option<i16> {
        self.last_heard().map(|(count, _)| count)
    }

    /// The answer arrived in its window.
    pub(crate) fn hear_answer(&mut self, mode: Mode, place: (i16, i16), at: Instant) {
        (self.misses, self.guard_until) = (0, None);
        let here = Position::new(place.0, place.1).counts();
        let is_far = |hold: Position| here.abs_diff(hold.counts()) > HOLD_COUNTS.into();
        self.is_away = mode == Mode::Position && self.hold.is_some_and(is_far);
        if mode == Mode::Position {
            self.places_heard_at[self.places_heard as usize % 4] = Some((place.0, at));
            self.places_heard += 1;
            self.places_shown |= bit(place.0);
        }
        match self.record {
            Some(record) if record != mode && !self.is_in_doubt => return self.begin_doubt(),
            Some(record) if record != mode => {
                self.is_let_go &= !self.is_still;
                self.restart_stop();
                let was_commanded = self.is_under_order || self.was_written;
                self.drop_target();
                if was_commanded {
                    self.owe();
                }
            }
            Some(_) if self.is_in_doubt => self.restart_stop(),
            _ => {}
        }
        (self.record, self.is_in_doubt) = (Some(mode), false);
        if self.confirm == Confirm::AfterAnswer {
            self.confirm = Confirm::Succeeds;
        }
        if self.is_owed {
            // The node has perhaps never heard what it holds, and was read again.
            let is_overdue = self.hold_heard_at.is_some_and(|heard| at > heard + HOLD_PATIENCE);
            self.may_hold_anew |= is_overdue && self.paid_in_time == 0;
            self.paid += u8::from(self.is_stop_written);
            self.paid_in_time += u8::from(self.is_stop_written && !is_overdue);
            (self.is_stop_written, self.is_stop_due) = (false, true);
        }
    }

    /// Its window has closed without the answer.
    pub(crate) fn miss(&mut self, guard_until: Instant, stops_abnormal: bool) {
        self.guard_until = Some(guard_until);
        (self.is_stop_written, self.is_stop_due) = (false, self.is_owed);
        self.may_hold_anew |= self.paid_in_time == 0;
        if self.is_in_doubt {
            self.undecided = (self.undecided + 1).min(UNDECIDED);
        }
        if self.record.is_none() || self.misses == STRIKES {
            return;
        }
        self.misses += 1;
        if self.misses == STRIKES {
            let had_set_point = self.target.is_some() || self.is_under_order;
            self.drop_target();
            self.restart_stop();
            if stops_abnormal && had_set_point {
                self.owe();
            }
        }
    }

    /// Whether an urgent exchange with it is due and allowed.
    pub(crate) fn is_urgent(&self, now: Instant) -> bool {
        let is_readable = self.is_in_doubt && self.undecided < UNDECIDED;
        let has_work = (self.is_owed || self.is_target_new) && !self.is_in_doubt;
        self.is_askable(now) && (is_readable || has_work)
    }

    /// Whether its stop WRITE is repeated, whatever else is due, until it is still.
    pub(crate) fn is_stop_repeated(&self, answers_write: bool) -> bool {
        let is_blind = self.is_owed && self.record == Some(Mode::Velocity) && !answers_write;
        let is_repeated = if self.is_online() { self.coasting_since.is_some() } else { is_blind };
        is_repeated && !self.is_in_doubt
    }

    /// Whether it may be asked.
    pub(crate) fn is_askable(&self, now: Instant) -> bool {
        self.is_online() && self.guard_until.is_none_or(|until| now >= until)
    }

    /// Whether a doubt without a decision still has to be reported.
    pub(crate) fn untold(&self) -> Option<&'static str> {
        if !self.is_in_doubt || self.undecided < UNDECIDED {
            return None;
        }
        match self.is_owed {
            true if !self.is_block_told => Some("StopBlocked was not reported"),
            false if !self.is_doubt_told => Some("ModeInDoubt was not reported"),
            _ => None,
        }
    }
}
