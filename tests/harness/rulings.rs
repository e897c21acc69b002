//! What a master may send to its nodes, by the rulings alone: I6 (a stop holds a position measured
//! after it), I11 (doubt), I12 (debts) and I13 (dead-man).
//!
//! [`judge`] is the rule for one WRITE. The models call it with an account of their own of every
//! mode, order and debt. A [`Node`] is for worlds in which bytes may be damaged and it is not known
//! what the master has heard: there it follows the modes, doubts and debts that the master reports.

use axlewire::{
    ikeya::{Mode, master::NodeSet},
    time::{Duration, Instant},
};

use crate::kit::Write;

/// Time in which a measured position has to be written first.
pub(crate) const HOLD_PATIENCE: Duration = Duration::from_millis(20);

/// A set-point: a speed, or count and rotation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Aim {
    Rps(f32),
    Place((i16, i16)),
}

impl Aim {
    pub(crate) const fn mode(self) -> Mode {
        match self {
            Self::Rps(_) => Mode::Velocity,
            Self::Place(_) => Mode::Position,
        }
    }

    fn is_in(self, write: &Write) -> bool {
        match self {
            Self::Rps(rps) => write.speed == rps.to_bits(),
            Self::Place(place) => write.place == place,
        }
    }
}

/// The latest order for a node.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Order {
    SetPoint(Option<Aim>),
    /// Whether the written position was measured after the stop was requested.
    Stop {
        is_measured: bool,
    },
}

/// Whether this WRITE may be sent to a node in this mode, which may be in doubt.
pub(crate) fn judge(
    write: &Write,
    is_three: bool,
    mode: Option<Mode>,
    is_in_doubt: bool,
    order: Order,
) -> Result<(), String> {
    let Some(mode) = mode else {
        return Err("a WRITE to a node that has never answered".into());
    };
    // Halves of 0 to 12,287 are less than 1e-9 rps.
    let is_small = |half: i16| (0..=12_287).contains(&half);
    let is_still = is_small(write.place.1) && (!is_three || is_small(write.place.0));
    let is_allowed = match order {
        Order::SetPoint(aim) => {
            !is_in_doubt && aim.is_some_and(|aim| aim.mode() == mode && aim.is_in(write))
        }
        Order::Stop { is_measured } if is_in_doubt => is_measured && is_still,
        Order::Stop { is_measured } => match mode {
            Mode::Velocity => write.speed == 0,
            Mode::Position => is_measured,
        },
    };
    match is_allowed {
        true => Ok(()),
        false => Err(format!("{write:?} in {mode} mode (in doubt: {is_in_doubt}) after {order:?}")),
    }
}

/// A position that a node has reported.
#[derive(Clone, Copy, Debug)]
struct Measured {
    place: (i16, i16),
    /// When the node measured it, and when the master received it.
    at: Instant,
    heard_at: Option<Instant>,
}

/// What the master reports about a node: its own debts and doubts are followed, its packets judged.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Seen {
    pub(crate) mode: Option<Mode>,
    pub(crate) is_owed: bool,
    /// Its stop is confirmed, but it is not seen to be still.
    pub(crate) is_coasting: bool,
    pub(crate) is_in_doubt: bool,
    pub(crate) is_abnormal: bool,
}

#[derive(Debug, Default)]
pub(crate) struct Node {
    /// The set-point in force.
    pub(crate) aim: Option<Aim>,
    /// Time since which its latest order is a stop.
    stopped_at: Option<Instant>,
    /// It is under an order that a mode change would reinterpret.
    is_commanded: bool,
    /// The mode of the latest answer.
    heard: Option<Mode>,
    measured: Vec<Measured>,
    /// The position that it was last told to hold.
    held: Option<(i16, i16)>,
    /// Packet numbers of stop WRITEs not yet followed by an answer.
    unanswered: Vec<u64>,
    /// Number of stop WRITEs that an answer has followed.
    answered: u32,
    seen: Seen,
}

impl Node {
    pub(crate) const fn is_stopped(&self) -> bool {
        self.stopped_at.is_some()
    }

    fn owe(&mut self, now: Instant) {
        if self.stopped_at.is_none() {
            (self.stopped_at, self.held) = (Some(now), None);
        }
        (self.aim, self.is_commanded, self.seen.is_owed) = (None, true, true);
        self.forget_payments();
    }

    fn forget_payments(&mut self) {
        self.answered = 0;
        self.unanswered.clear();
    }

    pub(crate) fn stop(&mut self, now: Instant) {
        if !self.seen.is_owed && !self.seen.is_coasting {
            self.owe(now);
        }
    }

    /// The master has accepted a set-point.
    pub(crate) fn accept(&mut self, aim: Aim) -> Result<(), String> {
        if self.seen.is_owed {
            return Err("a set-point was accepted while a stop is owed".into());
        }
        if self.heard != Some(aim.mode()) || self.seen.is_in_doubt {
            return Err("a set-point was accepted in a mode other than the last one heard".into());
        }
        (self.aim, self.stopped_at, self.is_commanded) = (Some(aim), None, true);
        Ok(())
    }

    pub(crate) fn release(&mut self) {
        self.aim = None;
        // An owed stop stays in force.
        self.is_commanded &= !self.is_stopped() || self.seen.is_owed;
    }

    /// The node answers a request that ended at `at`.
    pub(crate) fn measure(&mut self, place: (i16, i16), at: Instant) {
        self.measured.push(Measured { place, at, heard_at: None });
    }

    /// The master receives the answer to this packet number.
    pub(crate) fn hear(&mut self, mode: Mode, place: (i16, i16), number: u64, now: Instant) {
        self.heard = Some(mode);
        for measured in self.measured.iter_mut().filter(|measured| measured.place == place) {
            measured.heard_at = Some(now);
        }
        let waiting = self.unanswered.len();
        self.unanswered.retain(|&write| write > number);
        // One answer pays once, however many WRITEs came before.
        self.answered += u32::from(self.unanswered.len() < waiting);
    }

    /// Follows what the master reports; it must not forget a debt.
    pub(crate) fn follow(&mut self, seen: Seen, now: Instant) -> Result<(), String> {
        let before = core::mem::replace(&mut self.seen, seen);
        if before.is_owed && !seen.is_owed && self.answered < 2 {
            return Err(format!("a stop is paid by {} answered WRITEs", self.answered));
        }
        if before.mode.is_some() && before.mode != seen.mode {
            self.aim = None;
            if self.is_commanded && !seen.is_owed {
                return Err("the mode changed under an order, but no stop is owed".into());
            }
        }
        if seen.is_owed && !before.is_owed {
            self.owe(now);
        }
        if seen.is_in_doubt && !before.is_in_doubt || seen.is_abnormal && !before.is_abnormal {
            self.forget_payments();
        }
        Ok(())
    }

    /// Whether this WRITE may be sent.
    pub(crate) fn judge(&self, write: &Write, is_three: bool, now: Instant) -> Result<(), String> {
        let Seen { mode, is_in_doubt, is_owed, .. } = self.seen;
        let Some(stopped_at) = self.stopped_at else {
            return match is_owed || self.heard != mode {
                true => Err("a set-point in another mode or while a stop is owed".into()),
                false => judge(write, is_three, mode, is_in_doubt, Order::SetPoint(self.aim)),
            };
        };
        let mut measured = self.measured.iter().filter(|it| it.place == write.place);
        let measured = measured.find(|it| it.at >= stopped_at);
        let order = Order::Stop { is_measured: measured.is_some() };
        judge(write, is_three, mode, is_in_doubt, order)?;
        let is_old =
            measured.is_some_and(|it| it.heard_at.is_none_or(|at| now > at + HOLD_PATIENCE));
        let is_hold = is_in_doubt || mode == Some(Mode::Position);
        if !is_hold && self.heard != mode {
            return Err("0 rps to a node that was last heard in another mode".into());
        }
        match is_hold && is_old && self.held != Some(write.place) {
            true => Err("a position to hold that is too old".into()),
            false => Ok(()),
        }
    }

    /// The WRITE with this number has left completely.
    pub(crate) fn sent(&mut self, write: &Write, number: u64) {
        if self.is_stopped() {
            self.unanswered.push(number);
            self.held = Some(write.place);
        }
    }

    /// What was sent may not have left.
    pub(crate) fn unflushed(&mut self) {
        self.unanswered.clear();
    }
}

/// The dead-man of I13.
#[derive(Clone, Copy, Debug)]
pub(crate) struct DeadMan {
    pub(crate) limit: Option<Duration>,
    pub(crate) alive_at: Instant,
}

impl DeadMan {
    /// Stops the nodes with outdated set-points; from now on they must be owed a stop.
    pub(crate) fn expire(&self, nodes: &mut [Node], now: Instant) -> NodeSet {
        let mut expired = NodeSet::NONE;
        if self.limit.is_some_and(|limit| now > self.alive_at + limit) {
            for (node, id) in nodes.iter_mut().zip(axlewire::ikeya::NodeId::ALL) {
                if node.aim.is_some() {
                    node.owe(now);
                    expired.insert(id);
                }
            }
        }
        expired
    }
}
