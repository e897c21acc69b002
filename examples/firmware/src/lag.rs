//! First-order lag: how a motor follows its command.

use axlewire::time::Duration;

/// A value that follows its target with a time constant.
#[derive(Clone, Copy, Debug)]
pub struct Lag {
    /// Current value.
    pub value: f32,
    /// Target value.
    pub target: f32,
    /// Time to about 63 % of the way, seconds.
    time_constant: f32,
}

impl Lag {
    /// At rest at 0. The time constant is in seconds and more than 0.
    pub const fn new(time_constant: f32) -> Self {
        Self { value: 0.0, target: 0.0, time_constant }
    }

    /// Advances by `dt` with the implicit Euler method: coarse, but stable for steps of any length.
    pub fn step(&mut self, dt: Duration) {
        let dt = seconds(dt);
        self.value += (self.target - self.value) * dt / (self.time_constant + dt);
    }
}

/// A time in seconds.
pub fn seconds(time: Duration) -> f32 {
    time.as_micros() as f32 * 1e-6
}
