//! Motor commands: their range, the resulting wheel speeds, and that none starts an update by
//! accident.
#![cfg(feature = "ucp")]

use crate::rig::*;

#[test]
fn a_speed_or_turn_out_of_range_is_an_error_with_the_value_and_the_limits() {
    for value in i16::MIN..=i16::MAX {
        let legal = (-100..=100).contains(&value);
        let error = EncodeError::Percent { value, min: -100, max: 100 };
        match MotorControl::new(value, 0) {
            Ok(command) => assert!(legal && command.speed() == value && command.angular() == 0),
            Err(found) => assert!(!legal && found == error),
        }
        match MotorControl::new(0, value) {
            Ok(command) => assert!(legal && command.speed() == 0 && command.angular() == value),
            Err(found) => assert!(!legal && found == error),
        }
    }
    let error = EncodeError::Percent { value: -101, min: -100, max: 100 };
    assert_eq!(MotorControl::new(-101, 200), Err(error), "the speed first");
    assert_eq!(error.to_string(), "-101 is outside -100..=100");
}

#[test]
fn turning_right_is_a_positive_angular_and_left_a_negative_one() {
    for turn in i16::MIN..=i16::MAX {
        let right = MotorControl::turn_right(30, turn).map(|command| command.angular());
        let left = MotorControl::turn_left(30, turn).map(|command| command.angular());
        if (0..=100).contains(&turn) {
            assert_eq!((right, left), (Ok(turn), Ok(-turn)));
        } else {
            let error = Err(EncodeError::Percent { value: turn, min: 0, max: 100 });
            assert_eq!((right, left), (error, error));
        }
    }
    assert!(MotorControl::turn_left(101, 0).is_err());
}

#[test]
fn no_constructor_of_a_motor_command_can_start_an_update() {
    for speed in -100..=100 {
        for angular in [-100, -1, 0, 1, 100] {
            for lamp in [false, true] {
                let command = MotorControl::new(speed, angular).unwrap().with_front_led(lamp);
                assert!(!RawMotorControl::from(command).starts_update());
                let frame = command.frame(0);
                assert_eq!(frame.as_bytes()[12..22], [0; 10]);
                assert_eq!(frame.as_bytes()[10..12], [if lamp { 100 } else { 0 }, 0]);
            }
        }
    }
    assert_eq!(MotorControl::STOP, MotorControl::new(0, 0).unwrap());
}

#[test]
fn a_received_command_that_starts_an_update_says_so() {
    for (version, starts) in
        [(0_u16, false), (38, false), (39, true), (0x7FFF, true), (0x8000, false), (0xFFFF, false)]
    {
        let mut body = [0; 16];
        body[8..10].copy_from_slice(&version.to_le_bytes());
        let bytes = frame(2, 0, &body);
        let Message::MotorControl(command) = Frame::parse(&bytes).unwrap().message() else {
            panic!()
        };
        assert_eq!((command.version(), command.starts_update()), (version, starts));
    }
}

/// A motor command as bytes: speed, angular, front lamp, version.
fn received(speed: i16, angular: i16, front_led: i16, version: u16) -> RawMotorControl {
    let mut body = [0xAB; 16];
    body[0..2].copy_from_slice(&speed.to_le_bytes());
    body[2..4].copy_from_slice(&angular.to_le_bytes());
    body[4..6].copy_from_slice(&front_led.to_le_bytes());
    body[8..10].copy_from_slice(&version.to_le_bytes());
    zerocopy::transmute!(body)
}

#[test]
fn a_motor_command_cast_from_bytes_neither_starts_an_update_nor_is_out_of_range() {
    for version in 0..=u16::MAX {
        let command = MotorControl::try_from(received(10, 20, 100, version));
        if received(10, 20, 100, version).starts_update() {
            assert_eq!(command, Err(EncodeError::StartsUpdate { version }));
        } else {
            // And nothing of its reserved fields remains.
            assert_eq!(command, MotorControl::new(10, 20).map(|it| it.with_front_led(true)));
        }
    }
    for value in i16::MIN..=i16::MAX {
        let by_speed = MotorControl::try_from(received(value, 0, 0, 0));
        let by_angular = MotorControl::try_from(received(0, value, 0, 0));
        assert_eq!(by_speed, MotorControl::new(value, 0));
        assert_eq!(by_angular, MotorControl::new(0, value));
        let lit = !matches!(value.to_le_bytes()[0], 0x00 | 0xFF);
        let lamp = MotorControl::try_from(received(0, 0, value, 0)).unwrap();
        assert_eq!(lamp, MotorControl::STOP.with_front_led(lit));
    }
    let error = EncodeError::StartsUpdate { version: 39 };
    assert_eq!(error.to_string(), "motor command with version 39 would start a firmware update");
}

#[test]
fn a_motor_command_copied_from_a_received_frame_is_not_sent_as_it_is() {
    let bytes = frame(2, 0, zerocopy::IntoBytes::as_bytes(&received(130, -500, 7, 99)));
    let mut buffer = [0; 64];
    let view = Frame::parse(&bytes).unwrap();
    assert_eq!(view.relay_unchecked().encoded_len(), 24);
    assert_eq!(view.relay_unchecked().encode(&mut buffer), Ok(&bytes[..]));
    let Message::MotorControl(command) = view.message() else { panic!() };
    assert_eq!((command.speed(), command.version(), command.starts_update()), (130, 99, true));
    assert!(MotorControl::try_from(*command).is_err());
    // In range and without an update, only speed, turn and lamp are copied.
    let command = MotorControl::try_from(received(50, -10, 1, 0)).unwrap();
    let harmless = MotorControl::new(50, -10).unwrap().with_front_led(true);
    assert_eq!(command.frame(7).as_bytes(), harmless.frame(7).as_bytes());
}

#[test]
fn a_yaw_swings_the_nose_to_its_side_whatever_the_direction_of_travel() {
    for speed in -100..=100 {
        for turn in 0..=100 {
            let right = MotorControl::yaw_right(speed, turn).unwrap();
            let left = MotorControl::yaw_left(speed, turn).unwrap();
            // In reverse the wheel is turned the other way; up to -5 % it turns on the spot.
            let angular = if speed < -5 { -turn } else { turn };
            assert_eq!((right.speed(), right.angular()), (speed, angular));
            assert_eq!((left.speed(), left.angular()), (speed, -angular));
        }
    }
    for speed in [-60, 60] {
        for turn in [-1, 101] {
            let error = Err(EncodeError::Percent { value: turn, min: 0, max: 100 });
            assert_eq!(MotorControl::yaw_right(speed, turn), error);
            assert_eq!(MotorControl::yaw_left(speed, turn), error);
        }
    }
    assert!(MotorControl::yaw_right(101, 0).is_err() && MotorControl::yaw_left(-101, 0).is_err());
}

#[test]
fn the_wheels_turn_like_the_vendors_and_not_at_all_in_the_dead_bands() {
    let wheels = |speed, angular| MotorControl::new(speed, angular).unwrap().wheels_pct();
    for (speed, angular, expected) in [
        // From a run of the vendor's motor.c (ruling U6).
        (60, 50, (81, 39)),
        (-60, 50, (-81, -39)),
        (100, 100, (100, 30)),
        (100, -100, (30, 100)),
        (0, 100, (70, -70)),
        (5, 11, (7, -7)),
        (5, 10, (0, 0)),
        (6, 0, (6, 6)),
        (50, 5, (50, 50)),
        (50, 6, (52, 47)),
    ] {
        assert_eq!(wheels(speed, angular), expected, "({speed}, {angular})");
    }
    for (speed, angular) in (-100..=100).flat_map(|s| (-100..=100).map(move |a| (s, a))) {
        let (left, right) = wheels(speed, angular);
        assert!(left.abs() <= 100 && right.abs() <= 100, "({speed}, {angular})");
        assert_eq!(wheels(speed, -angular), (right, left), "the other way: the sides are swapped");
        if speed.abs() > 5 {
            assert_eq!(wheels(-speed, angular), (-left, -right), "in reverse: the same, backward");
            assert_eq!(left.signum() * right.signum(), 1, "no side stops or turns back");
        }
    }
}

#[test]
fn only_no_speed_and_no_turn_at_all_stand_still() {
    for speed in -6..=6 {
        for angular in -11..=11 {
            let command = MotorControl::new(speed, angular).unwrap();
            for command in [command, command.with_front_led(true)] {
                assert_eq!(command.stands_still(), (speed, angular) == (0, 0));
            }
        }
    }
}
