//! A small rover model.

use axlewire::{
    time::Duration,
    ucp::{MotorControl, Telemetry},
};

use crate::lag::{Lag, seconds};

/// Speed of a wheel at 100 %, rpm.
const FULL_RPM: f32 = 120.0;

/// Turn rate per rpm of difference between the two sides, degrees per second.
const TURN_PER_RPM: f32 = 4.0;

/// A rover on flat ground with a battery that stays full: takes commands, gives telemetry.
///
/// It steers as the vendor's firmware does (ruling U6).
#[derive(Debug)]
pub struct Rover {
    left_rpm: Lag,
    right_rpm: Lag,
    heading_deg: f32,
}

impl Rover {
    /// A rover at rest, heading north.
    pub const fn new() -> Self {
        Self { left_rpm: Lag::new(0.15), right_rpm: Lag::new(0.15), heading_deg: 0.0 }
    }

    /// Drives as commanded from now on.
    pub fn command(&mut self, command: &MotorControl) {
        let (left_pct, right_pct) = command.wheels_pct();
        let rpm = |percent: i16| f32::from(percent) / 100.0 * FULL_RPM;
        self.left_rpm.target = rpm(left_pct);
        self.right_rpm.target = rpm(right_pct);
    }

    /// Advances the model by `dt`, less than a second.
    pub fn step(&mut self, dt: Duration) {
        self.left_rpm.step(dt);
        self.right_rpm.step(dt);
        let turn = (self.left_rpm.value - self.right_rpm.value) * TURN_PER_RPM * seconds(dt);
        self.heading_deg += turn;
        if self.heading_deg >= 360.0 {
            self.heading_deg -= 360.0;
        } else if self.heading_deg < 0.0 {
            self.heading_deg += 360.0;
        }
    }

    /// Speeds of the wheels on the left and on the right, rpm.
    pub fn rpm(&self) -> (i16, i16) {
        let rounded = |rpm: f32| (rpm + if rpm < 0.0 { -0.5 } else { 0.5 }) as i16;
        (rounded(self.left_rpm.value), rounded(self.right_rpm.value))
    }

    /// Sensor readings.
    pub fn telemetry(&self) -> Telemetry {
        let (left, right) = self.rpm();
        Telemetry {
            battery_pct: 87,
            rpm: [left, right, left, right],
            acc: [0, 0, Telemetry::ACC_PER_G as i16],
            mag: [300, 0, -400],
            heading_deg: self.heading_deg as i16,
            power_w: 4,
            voltage_dv: 119,
            current_ca: 34,
            ..Telemetry::default()
        }
    }
}

impl Default for Rover {
    fn default() -> Self {
        Self::new()
    }
}
