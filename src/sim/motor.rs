//! A motor.

use super::lag::{Lag, seconds};
use crate::{
    ikeya::{Position, Rps},
    time::Duration,
};

/// A motor that approaches a speed with a time constant, or moves to a position at a limited speed.
/// Steps of any length give the same motion.
///
/// ```
/// use axlewire::{ikeya::{Position, Rps}, sim::Motor, time::Duration};
///
/// let mut motor = Motor::new().with_time_constant(Duration::from_millis(50));
/// motor.turn(Rps::new(2.0)?);
/// motor.step(Duration::from_millis(50));
/// assert!((motor.velocity().get() - 2.0 * 0.632).abs() < 0.001);
///
/// let mut motor = Motor::new().with_speed_limit(Rps::new(5.0)?);
/// motor.go_to(Position::from_revolutions(-1.0)?);
/// motor.step(Duration::from_millis(100));
/// assert_eq!(motor.position().revolutions(), -0.5);
/// assert_eq!(motor.velocity().get(), -5.0);
/// # Ok::<(), axlewire::error::EncodeError>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Motor {
    /// Speed, revolutions per second.
    speed: Lag,
    speed_limit: f64,
    revolutions: f64,
    /// Target position, revolutions; `None` in velocity mode.
    goal: Option<f64>,
}

impl Motor {
    /// A motor at standstill at position 0: 50 ms to 63 % of a new speed, 5 rps to a position.
    #[must_use]
    pub const fn new() -> Self {
        let time_constant = Duration::from_millis(50);
        let speed = Lag { value: 0.0, target: 0.0, time_constant };
        Self { speed, speed_limit: 5.0, revolutions: 0.0, goal: None }
    }

    /// The same motor with this time to 63 % of a new speed; zero reaches the speed at once.
    #[must_use]
    pub const fn with_time_constant(mut self, time_constant: Duration) -> Self {
        self.speed.time_constant = time_constant;
        self
    }

    /// The same motor with this speed on its way to a position; the sign is ignored.
    #[must_use]
    pub const fn with_speed_limit(mut self, limit: Rps) -> Self {
        self.speed_limit = limit.get().abs() as f64;
        self
    }

    /// The same motor, with its shaft at `position`.
    #[must_use]
    pub const fn at(mut self, position: Position) -> Self {
        self.revolutions = position.revolutions();
        self
    }

    /// Turns at this speed from now on.
    pub fn turn(&mut self, target: Rps) {
        (self.goal, self.speed.target) = (None, target.get().into());
    }

    /// Moves to this position, and holds it.
    pub fn go_to(&mut self, target: Position) {
        self.goal = Some(target.revolutions());
    }

    /// Holds the present position of the shaft.
    pub fn hold(&mut self) {
        self.goal = Some(self.revolutions);
    }

    /// Advances by `dt`.
    pub fn step(&mut self, dt: Duration) {
        let Some(goal) = self.goal else {
            self.revolutions += self.speed.step(dt);
            return;
        };
        let (way, reach) = (goal - self.revolutions, self.speed_limit * seconds(dt));
        if way.abs() <= reach || way == 0.0 {
            (self.revolutions, self.speed.value) = (goal, 0.0);
        } else {
            self.speed.value = self.speed_limit.copysign(way);
            self.revolutions += reach.copysign(way);
        }
    }

    /// The speed of the shaft.
    #[must_use]
    pub fn velocity(&self) -> Rps {
        // Finite: it lies between two finite speeds.
        Rps::new(self.speed.value as f32).unwrap_or(Rps::ZERO)
    }

    /// The position of the shaft, to the nearest count. Beyond the range of the wire it stays at
    /// the last position in range.
    #[must_use]
    pub fn position(&self) -> Position {
        Position::from_revolutions(self.revolutions)
            .unwrap_or(Self::END[usize::from(self.revolutions > 0.0)])
    }

    /// The first and the last position in the range of the wire.
    const END: [Position; 2] = [Position::new(-8191, i16::MIN), Position::new(8191, i16::MAX)];
}

impl Default for Motor {
    fn default() -> Self {
        Self::new()
    }
}
