//! A first-order lag: how a motor approaches a new target.

use crate::time::Duration;

/// A span in seconds.
pub(super) fn seconds(span: Duration) -> f64 {
    f64::from(span.as_micros()) / 1e6
}

/// First order: 63 % of the way in one time constant. Exact for steps of any length.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Lag {
    pub(super) value: f64,
    pub(super) target: f64,
    pub(super) time_constant: Duration,
}

impl Lag {
    /// Advances by `dt`; returns the integral of the value over it, in the value's unit times
    /// seconds.
    pub(super) fn step(&mut self, dt: Duration) -> f64 {
        let (dt, constant) = (seconds(dt), seconds(self.time_constant));
        let off = self.value - self.target;
        let left = if constant > 0.0 { (-dt / constant).exp() } else { 0.0 };
        self.value = self.target + off * left;
        self.target * dt + off * constant * (1.0 - left)
    }
}
