//! A small motor model.

use axlewire::{
    ikeya::{Mode, Position, Rps, Target},
    time::Duration,
};

use crate::lag::{Lag, seconds};

/// Encoder counts per revolution.
const COUNTS_PER_REVOLUTION: f32 = Position::COUNTS_PER_REVOLUTION as f32;

/// Speed on the way to a position, revolutions per second.
const TRAVEL_RPS: f32 = 5.0;

/// A motor that turns at a speed, which it reaches with a time constant of 50 ms, or goes to a
/// position at 5 revolutions per second and holds it.
#[derive(Debug)]
pub struct Motor {
    speed: Lag,
    counts: i32,
    /// Remainder of the last steps, less than one count.
    part: f32,
    /// Target position, counts; `None` when turning.
    goal: Option<i32>,
}

impl Motor {
    /// A motor at rest at position 0.
    pub const fn new() -> Self {
        Self { speed: Lag::new(0.05), counts: 0, part: 0.0, goal: None }
    }

    /// Follows a slave's command; without one it stops or holds its position.
    pub fn obey(&mut self, command: Option<Target>, mode: Mode) {
        match (command, mode) {
            (Some(Target::Velocity(to)), _) => (self.goal, self.speed.target) = (None, to.get()),
            (Some(Target::Position(to)), _) => self.goal = Some(to.counts()),
            (None, Mode::Velocity) => (self.goal, self.speed.target) = (None, 0.0),
            (None, Mode::Position) => {
                self.goal.get_or_insert(self.counts);
            }
        }
    }

    /// Advances the model by `dt`.
    pub fn step(&mut self, dt: Duration) {
        match self.goal {
            None => {
                self.speed.step(dt);
                self.turn(self.speed.value, dt);
            }
            Some(goal) => {
                let way = goal.saturating_sub(self.counts);
                let reach = TRAVEL_RPS * COUNTS_PER_REVOLUTION * seconds(dt);
                if way.unsigned_abs() as f32 <= reach {
                    (self.counts, self.part, self.speed.value) = (goal, 0.0, 0.0);
                } else {
                    self.speed.value = if way < 0 { -TRAVEL_RPS } else { TRAVEL_RPS };
                    self.turn(self.speed.value, dt);
                }
            }
        }
    }

    fn turn(&mut self, rps: f32, dt: Duration) {
        let way = rps * COUNTS_PER_REVOLUTION * seconds(dt) + self.part;
        let whole = way as i32; // truncates, saturates
        self.part = way - whole as f32;
        // Stops at the limit of the wire format.
        let counts = self.counts.saturating_add(whole);
        if Position::from_counts(counts).is_ok() {
            self.counts = counts;
        }
    }

    /// The speed of the shaft.
    pub fn velocity(&self) -> Rps {
        Rps::new(self.speed.value).unwrap_or(Rps::ZERO)
    }

    /// The position of the shaft.
    pub fn position(&self) -> Position {
        Position::from_counts(self.counts).unwrap_or_default()
    }
}

impl Default for Motor {
    fn default() -> Self {
        Self::new()
    }
}
