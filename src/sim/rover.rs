//! A rover with four wheels, two on each side.

use super::lag::{Lag, seconds};
use crate::{
    time::Duration,
    ucp::{MotorControl, Telemetry},
};

/// A rover on flat ground: motor commands and time go in, telemetry comes out.
///
/// It steers as the vendor's `motor.c` does (ruling U6), like a steering wheel and in whole
/// percent. The left wheels get `speed * (100 + 0.7 * angular) / 100`, the right ones the same with
/// a minus sign: a positive `angular` turns right when moving forward; in reverse the nose swings
/// *left*. A speed of ±5 or less counts as zero: with an `angular` beyond ±10 the rover then turns
/// on the spot, at 0.7 of that value. An `angular` of ±5 or less does not steer, and adds 0.7 of
/// its value to both sides. If neither selects a direction, the direction of the previous command
/// stays selected. A result of 5 % or less is no motion, and 95 % or more is full speed.
///
/// At full speed a wheel turns at 120 rpm, and 63 % of a new speed is reached in 150 ms. The
/// heading is that of a compass, growing to the right. The battery holds 40 Wh and gives 12.6 V
/// when full and 9.6 V when empty; an empty battery turns no wheel.
///
/// It has no watchdog: the [`Robot`](crate::ucp::Robot) has one.
///
/// ```
/// use axlewire::{sim::Rover, time::Duration, ucp::MotorControl};
///
/// let mut rover = Rover::new();
/// rover.command(&MotorControl::turn_right(60, 50)?);
/// rover.step(Duration::from_secs(1));
/// let [front_left, front_right, ..] = rover.telemetry().rpm;
/// assert_eq!((front_left, front_right), (97, 47)); // 81 % and 39 % of 120 rpm
/// assert!(rover.heading_deg() > 0.0);
/// # Ok::<(), axlewire::error::EncodeError>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Rover {
    /// Wheel speeds as fractions of full speed.
    left: Lag,
    right: Lag,
    /// The direction selected by the latest command that selects one.
    direction: Direction,
    heading_deg: f64,
    turn_deg_per_s: f64,
    forward_acc_g: f64,
    distance_m: f64,
    battery_wh: f64,
    power_w: f64,
}

impl Rover {
    /// Speed of a wheel at 100 %, rpm.
    pub const FULL_RPM: f64 = 120.0;

    const WHEEL_ROUND_M: f64 = 0.4;
    const TRACK_M: f64 = 0.3;
    const BATTERY_WH: f64 = 40.0;
    const FULL_V: f64 = 12.6;
    const EMPTY_V: f64 = 9.6;
    const IDLE_W: f64 = 4.0;
    const DRIVING_W: f64 = 20.0;
    const GRAVITY_M_PER_S2: f64 = 9.81;
    /// The earth's field along the ground and into it, sensor counts.
    const FIELD: (f64, f64) = (300.0, -400.0);

    /// A rover at standstill, heading north, fully charged.
    #[must_use]
    pub const fn new() -> Self {
        let time_constant = Duration::from_millis(150);
        let wheel = Lag { value: 0.0, target: 0.0, time_constant };
        Self {
            left: wheel,
            right: wheel,
            direction: Direction::None,
            heading_deg: 0.0,
            turn_deg_per_s: 0.0,
            forward_acc_g: 0.0,
            distance_m: 0.0,
            battery_wh: Self::BATTERY_WH,
            power_w: Self::IDLE_W,
        }
    }

    /// The same rover with this charge, percent, 0 to 100.
    #[must_use]
    pub const fn with_battery(mut self, percent: f64) -> Self {
        self.battery_wh = Self::BATTERY_WH * percent.clamp(0.0, 100.0) / 100.0;
        self
    }

    /// Carries out a command from now on.
    pub fn command(&mut self, command: &MotorControl) {
        let (speed, angular) = (i32::from(command.speed()), i32::from(command.angular()));
        if let Some(selected) = Direction::selected(speed, angular) {
            self.direction = selected;
        }
        let (left_sign, right_sign) = self.direction.signs();
        let (left, right) = duties(speed, angular);
        self.left.target = f64::from(left_sign * limited(left)) / 100.0;
        self.right.target = f64::from(right_sign * limited(right)) / 100.0;
    }

    /// Advances by `dt`.
    pub fn step(&mut self, dt: Duration) {
        let span = seconds(dt);
        if span <= 0.0 {
            return;
        }
        if self.battery_wh <= 0.0 {
            (self.left.target, self.right.target) = (0.0, 0.0);
        }
        let speed_m_per_s = Self::FULL_RPM / 60.0 * Self::WHEEL_ROUND_M;
        let before = (self.left.value + self.right.value) / 2.0;
        let (left, right) = (self.left.step(dt), self.right.step(dt));
        let after = (self.left.value + self.right.value) / 2.0;

        self.distance_m += (left + right) / 2.0 * speed_m_per_s;
        self.forward_acc_g = (after - before) * speed_m_per_s / span / Self::GRAVITY_M_PER_S2;
        let turned = ((left - right) * speed_m_per_s / Self::TRACK_M).to_degrees();
        self.heading_deg = (self.heading_deg + turned).rem_euclid(360.0);
        self.turn_deg_per_s = turned / span;

        let effort = (left.abs() + right.abs()) / 2.0 / span;
        self.power_w = Self::IDLE_W + Self::DRIVING_W * effort;
        self.battery_wh = (self.battery_wh - self.power_w * span / 3600.0).max(0.0);
    }

    /// Heading, degrees clockwise from north, 0 up to 360.
    #[must_use]
    pub const fn heading_deg(&self) -> f64 {
        self.heading_deg
    }

    /// Distance travelled, metres; reversing counts negative.
    #[must_use]
    pub const fn distance_m(&self) -> f64 {
        self.distance_m
    }

    /// Battery charge, percent.
    #[must_use]
    pub const fn battery(&self) -> f64 {
        self.battery_wh / Self::BATTERY_WH * 100.0
    }

    /// Readings of its sensors: x is ahead, y is to the left, z is up. Accelerations and turn rates
    /// are means over the last step.
    #[must_use]
    pub fn telemetry(&self) -> Telemetry {
        let volts = Self::EMPTY_V + (Self::FULL_V - Self::EMPTY_V) * self.battery() / 100.0;
        let rpm = |wheel: &Lag| (wheel.value * Self::FULL_RPM).round() as i16;
        let (left, right) = (rpm(&self.left), rpm(&self.right));
        let one_g = f64::from(Telemetry::ACC_PER_G);
        let (sin, cos) = self.heading_deg.to_radians().sin_cos();
        let (along, into) = Self::FIELD;
        // A right turn is negative around an axis that points up.
        let turn = -self.turn_deg_per_s * f64::from(Telemetry::GYRO_PER_DEG_PER_S);
        Telemetry {
            battery_pct: self.battery() as u16,
            rpm: [left, right, left, right],
            acc: [(self.forward_acc_g * one_g) as i16, 0, one_g as i16],
            gyro: [0, 0, turn as i16],
            mag: [(along * cos) as i16, (along * sin) as i16, into as i16],
            heading_deg: self.heading_deg as i16,
            power_w: self.power_w as u8,
            voltage_dv: (volts * 10.0) as u8,
            current_ca: (self.power_w / volts * 100.0) as u16,
        }
    }
}

/// Direction of the wheels, whatever their speed.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
enum Direction {
    None,
    Forward,
    Backward,
    SpotRight,
    SpotLeft,
}

impl Direction {
    /// The direction that a command selects; `None` if the previous one stays selected.
    const fn selected(speed: i32, angular: i32) -> Option<Self> {
        Some(match (speed, angular) {
            (6.., _) => Self::Forward,
            (..=-6, _) => Self::Backward,
            (_, 11..) => Self::SpotRight,
            (_, ..=-11) => Self::SpotLeft,
            _ => return None,
        })
    }

    /// Signs of the left and the right wheels.
    const fn signs(self) -> (i32, i32) {
        match self {
            Self::None => (0, 0),
            Self::Forward => (1, 1),
            Self::Backward => (-1, -1),
            Self::SpotRight => (1, -1),
            Self::SpotLeft => (-1, 1),
        }
    }
}

/// Magnitudes for the left and the right wheels, percent, truncated as by the vendor.
const fn duties(speed: i32, angular: i32) -> (i32, i32) {
    let magnitude = speed.abs();
    match (speed, angular) {
        (-5..=5, 11.. | ..=-11) => (7 * angular.abs() / 10, 7 * angular.abs() / 10),
        (_, -5..=5) => {
            let both = magnitude + 7 * angular.abs() / 10;
            (both, both)
        }
        _ => (magnitude * (1000 + 7 * angular) / 1000, magnitude * (1000 - 7 * angular) / 1000),
    }
}

/// Turns a small duty into 0 and a large one into 100.
const fn limited(duty: i32) -> i32 {
    match duty {
        ..=5 => 0,
        95.. => 100,
        duty => duty,
    }
}

impl Default for Rover {
    fn default() -> Self {
        Self::new()
    }
}
