//! Output and arguments of the two kinds of boards.

use std::fmt;

use axlewire::ikeya::{
    Position, Rps, Status, Target,
    board::{Board, OneMotor, ThreeMotors},
};
use serde::Serialize;

use crate::args::Protocol;

/// Largest difference between a position and its target, counts.
const TARGET_COUNTS: u32 = 8;

/// A kind of board whose values can be read from the command line and printed.
pub(crate) trait Boards: Board {
    const PROTOCOL: Protocol;

    /// Number of motors.
    const MOTORS: usize;

    /// A speed for each of its motors, if there are as many.
    fn velocity(speeds: &[Rps]) -> Option<Self::Velocity>;

    /// A position for each of its motors, if there are as many.
    fn position(positions: &[Position]) -> Option<Self::Position>;

    /// A target as a motor that has reached it would report it.
    fn reached(target: Target<Self>) -> Status<Self>;

    /// Its values, one by one.
    fn values(status: Status<Self>) -> Values;

    /// A status as data.
    fn data(status: Status<Self>) -> Data;

    /// The positions of its motors, in position mode.
    fn positions(status: Status<Self>) -> Option<Vec<Position>> {
        match Self::values(status) {
            Values::Rps(_) => None,
            Values::Positions(positions) => Some(positions),
        }
    }

    /// A status as text.
    fn describe(status: Status<Self>) -> String {
        Self::values(status).to_string()
    }

    /// Whether the motors have reached a target, each of them.
    fn is_reached(target: Target<Self>, status: Status<Self>) -> bool {
        match (Self::values(Self::reached(target)), Self::values(status)) {
            (Values::Rps(targets), Values::Rps(now)) => targets
                .iter()
                .zip(&now)
                .all(|(target, now)| (now - target).abs() <= tolerance(*target)),
            (Values::Positions(targets), Values::Positions(now)) => targets
                .iter()
                .zip(&now)
                .all(|(target, now)| now.counts().abs_diff(target.counts()) <= TARGET_COUNTS),
            _ => false,
        }
    }
}

/// The values of a status.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Values {
    Rps(Vec<f32>),
    Positions(Vec<Position>),
}

/// A status as data, with the fields of a response.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
#[serde(untagged)]
pub(crate) enum Data {
    One(Status<OneMotor>),
    Three(Status<ThreeMotors>),
}

impl Boards for OneMotor {
    const PROTOCOL: Protocol = Protocol::Ikeya;
    const MOTORS: usize = 1;

    fn velocity(speeds: &[Rps]) -> Option<Rps> {
        <[Rps; 1]>::try_from(speeds).ok().map(|[speed]| speed)
    }

    fn position(positions: &[Position]) -> Option<Position> {
        <[Position; 1]>::try_from(positions).ok().map(|[position]| position)
    }

    fn reached(target: Target) -> Status {
        match target {
            Target::Velocity(rps) => Status::Velocity(rps.get()),
            Target::Position(position) => Status::Position(position),
        }
    }

    fn values(status: Status) -> Values {
        match status {
            Status::Velocity(rps) => Values::Rps(vec![rps]),
            Status::Position(position) => Values::Positions(vec![position]),
        }
    }

    fn data(status: Status) -> Data {
        Data::One(status)
    }
}

impl Boards for ThreeMotors {
    const PROTOCOL: Protocol = Protocol::Ikeya3;
    const MOTORS: usize = 3;

    fn velocity(speeds: &[Rps]) -> Option<[Rps; 3]> {
        speeds.try_into().ok()
    }

    fn position(positions: &[Position]) -> Option<[Position; 3]> {
        positions.try_into().ok()
    }

    fn reached(target: Target<Self>) -> Status<Self> {
        match target {
            Target::Velocity(speeds) => Status::Velocity(speeds.map(Rps::get)),
            Target::Position(positions) => Status::Position(positions),
        }
    }

    fn values(status: Status<Self>) -> Values {
        match status {
            Status::Velocity(speeds) => Values::Rps(speeds.to_vec()),
            Status::Position(positions) => Values::Positions(positions.to_vec()),
        }
    }

    fn data(status: Status<Self>) -> Data {
        Data::Three(status)
    }
}

/// The values and their unit.
impl fmt::Display for Values {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Rps(values) => {
                values.iter().try_for_each(|rps| write!(f, "{rps:.2} "))?;
                f.write_str("rps")
            }
            Self::Positions(values) => {
                values.iter().try_for_each(|it| write!(f, "{:.4} ", it.revolutions()))?;
                f.write_str("turns")
            }
        }
    }
}

impl fmt::Display for Data {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match *self {
            Self::One(status) => OneMotor::values(status).fmt(f),
            Self::Three(status) => ThreeMotors::values(status).fmt(f),
        }
    }
}

/// Largest difference between a speed and its target, rps. A motor at rest has not reached a slow
/// target speed, unless that speed itself counts as rest.
fn tolerance(target: f32) -> f32 {
    let target = target.abs();
    (target * 0.1).max((target * 0.5).min(0.1)).max(0.05)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn is_reached(target: Target, status: Status) -> bool {
        OneMotor::is_reached(target, status)
    }

    fn velocity(target: f32, now: f32) -> bool {
        is_reached(Target::Velocity(Rps::new(target).unwrap()), Status::Velocity(now))
    }

    #[test]
    fn a_speed_is_reached_within_10_percent_or_a_tenth() {
        assert!(velocity(10.0, 9.01) && velocity(10.0, 10.99) && velocity(-10.0, -9.01));
        assert!(!velocity(10.0, 8.99) && !velocity(10.0, 11.01) && !velocity(-10.0, 10.0));
        assert!(velocity(0.5, 0.41) && !velocity(0.5, 0.39));
    }

    #[test]
    fn half_of_a_slow_speed_has_to_be_reached() {
        assert!(velocity(0.15, 0.076) && !velocity(0.15, 0.074));
    }

    #[test]
    fn a_motor_that_stands_still_has_not_reached_a_slow_speed() {
        assert!(!velocity(0.12, 0.0) && !velocity(-0.12, 0.0) && velocity(0.12, 0.08));
        assert!(velocity(0.0, 0.04) && !velocity(0.0, 0.06) && !velocity(1.0, f32::NAN));
    }

    #[test]
    fn a_position_is_reached_within_8_counts_and_no_speed_is_a_position() {
        let target = Target::Position(Position::from_counts(8000).unwrap());
        let at = |counts| Status::Position(Position::from_counts(counts).unwrap());
        assert!(is_reached(target, at(8008)) && is_reached(target, at(7992)));
        assert!(!is_reached(target, at(8009)) && !is_reached(target, at(7991)));
        assert!(!is_reached(target, Status::Velocity(8000.0)));
    }

    #[test]
    fn a_board_takes_one_value_for_each_motor_in_their_order() {
        let speeds = [1.0, -2.0, 3.5].map(|it| Rps::new(it).unwrap());
        let places = [7, -8, 9000].map(|it| Position::from_counts(it).unwrap());
        assert_eq!(ThreeMotors::velocity(&speeds), Some(speeds));
        assert_eq!(ThreeMotors::position(&places), Some(places));
        assert_eq!(OneMotor::velocity(&speeds[..1]), Some(speeds[0]));
        assert_eq!(OneMotor::position(&places[1..2]), Some(places[1]));
        for count in [0, 1, 2] {
            assert!(ThreeMotors::velocity(&speeds[..count]).is_none());
            assert!(ThreeMotors::position(&places[..count]).is_none());
        }
        assert!(OneMotor::velocity(&speeds).is_none() && OneMotor::position(&places).is_none());
        let reached = ThreeMotors::reached(Target::Velocity(speeds));
        assert_eq!(ThreeMotors::describe(reached), "1.00 -2.00 3.50 rps");
        let reached = ThreeMotors::reached(Target::Position(places));
        assert_eq!(ThreeMotors::positions(reached), Some(places.to_vec()));
        assert_eq!(ThreeMotors::describe(reached), "0.0009 -0.0010 1.0986 turns");
        for motor in 0..3 {
            let mut now = places;
            now[motor] = Position::from_counts(now[motor].counts() + 9).unwrap();
            assert!(!ThreeMotors::is_reached(Target::Position(places), Status::Position(now)));
        }
    }

    #[test]
    fn each_of_three_motors_has_to_reach_its_target() {
        let target =
            Target::<ThreeMotors>::Velocity([1.0, 0.0, -2.0].map(|it| Rps::new(it).unwrap()));
        assert!(ThreeMotors::is_reached(target, Status::Velocity([1.0, 0.0, -2.0])));
        for motor in 0..3 {
            let mut speeds = [1.0, 0.0, -2.0];
            speeds[motor] += 0.5;
            assert!(!ThreeMotors::is_reached(target, Status::Velocity(speeds)), "{motor}");
        }
    }
}
