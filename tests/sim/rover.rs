//! A simulated rover: how its wheels follow commands, and what its telemetry reports.

use axlewire::{sim::Rover, time::Duration, ucp::MotorControl};

const SECOND: Duration = Duration::from_millis(1000);

#[test]
fn a_rover_drives_ahead_and_keeps_its_heading() {
    let mut rover = Rover::new();
    rover.command(&MotorControl::new(50, 0).unwrap());
    rover.step(SECOND);
    rover.step(SECOND);
    let telemetry = rover.telemetry();
    assert_eq!((telemetry.rpm, telemetry.heading_deg), ([60; 4], 0));
    // 60 rpm of 0.4 m, less what a lag of 150 ms costs.
    assert!((rover.distance_m() - 0.4 * (2.0 - 0.15)).abs() < 1e-4);
    rover.command(&MotorControl::STOP);
    rover.step(SECOND);
    rover.step(SECOND);
    assert_eq!(rover.telemetry().rpm, [0; 4]);
}

#[test]
fn a_positive_turn_is_to_the_right() {
    let mut rover = Rover::new();
    rover.command(&MotorControl::turn_right(0, 20).unwrap());
    rover.step(SECOND);
    let telemetry = rover.telemetry();
    assert_eq!(telemetry.rpm, [17, -17, 17, -17]);
    assert!((1..180).contains(&telemetry.heading_deg), "{telemetry:?}");
    assert!(telemetry.gyro[2] < 0 && telemetry.mag[1] > 0, "{telemetry:?}");
    let turned = rover.heading_deg();
    rover.command(&MotorControl::turn_left(0, 20).unwrap());
    rover.step(SECOND);
    rover.step(SECOND);
    let back = rover.heading_deg();
    assert!(back < turned || back > 180.0, "{back}");
}

/// Wheel speeds once they are steady, percent: left, right.
fn wheels(commands: &[(i16, i16)]) -> (i16, i16) {
    let mut rover = Rover::new();
    for &(speed, angular) in commands {
        rover.command(&MotorControl::new(speed, angular).unwrap());
        (0..10).for_each(|_| rover.step(SECOND));
    }
    let percent = |rpm: i16| (f64::from(rpm) / Rover::FULL_RPM * 100.0).round() as i16;
    let [left, right, ..] = rover.telemetry().rpm;
    (percent(left), percent(right))
}

#[test]
fn a_rover_mixes_like_the_vendors_motor_c() {
    assert_eq!(wheels(&[(60, 50)]), (81, 39));
    assert_eq!(wheels(&[(60, -50)]), (39, 81));
    assert_eq!(wheels(&[(-60, 50)]), (-81, -39), "in reverse the nose swings left");
    assert_eq!(wheels(&[(-60, -50)]), (-39, -81));
    assert_eq!(wheels(&[(100, 100)]), (100, 30), "limited");
    assert_eq!(wheels(&[(0, 50)]), (35, -35), "on the spot");
    assert_eq!(wheels(&[(0, -50)]), (-35, 35));
}

#[test]
fn a_yaw_to_the_right_swings_the_nose_right_in_reverse_too() {
    for speed in [-100, -60, -6, -5, 0, 5, 6, 60, 100] {
        for (yaw, expected) in [
            (MotorControl::yaw_right(speed, 50).unwrap(), 1.0),
            (MotorControl::yaw_left(speed, 50).unwrap(), -1.0),
        ] {
            let mut rover = Rover::new();
            rover.command(&yaw);
            rover.step(Duration::from_millis(100));
            let turned = (rover.heading_deg() + 180.0).rem_euclid(360.0) - 180.0;
            assert!(turned * expected > 0.0, "{yaw:?}: {turned}");
        }
    }
}

#[test]
fn a_rover_has_the_dead_bands_of_the_vendors_motor_c() {
    assert_eq!(wheels(&[(0, 10)]), (0, 0), "turning on the spot needs more than 10");
    assert_eq!(wheels(&[(0, 11)]), (7, -7));
    assert_eq!(wheels(&[(5, 0)]), (0, 0), "a duty of 5 % moves nothing");
    assert_eq!(wheels(&[(6, 0)]), (6, 6));
    assert_eq!(wheels(&[(94, 0)]), (94, 94));
    assert_eq!(wheels(&[(95, 0)]), (100, 100), "from 95 % on it is full speed");
    assert_eq!(wheels(&[(60, 5)]), (63, 63), "little steering does not steer");
    // Below both thresholds the direction of the previous command stays selected.
    assert_eq!(wheels(&[(-50, 0), (5, 5)]), (-8, -8));
    assert_eq!(wheels(&[(50, 0), (-5, 5)]), (8, 8));
    assert_eq!(wheels(&[(50, 0), (0, 0)]), (0, 0));
}

#[test]
fn the_battery_drains_and_an_empty_one_stops_the_wheels() {
    let full = Rover::new().telemetry();
    assert_eq!((full.battery(), full.voltage_dv), (Some(100), 126));
    let mut rover = Rover::new().with_battery(50.0);
    rover.command(&MotorControl::new(100, 0).unwrap());
    rover.step(SECOND);
    let driving = rover.telemetry();
    assert!(driving.power_w > full.power_w && driving.current_ca > full.current_ca);
    assert!(driving.voltage_dv < full.voltage_dv && rover.battery() < 50.0);
    for _ in 0..3600 {
        rover.step(SECOND);
    }
    assert_eq!((rover.telemetry().battery(), rover.telemetry().rpm), (Some(0), [0; 4]));
}

/// Speed at 100 %, m/s.
const FULL_SPEED: f64 = 0.8;

#[test]
fn a_rover_measures_its_mean_acceleration_of_the_last_step() {
    let mut rover = Rover::new();
    rover.command(&MotorControl::new(50, 0).unwrap());
    // In each 150 ms a wheel makes up for 63 % of what is missing to 50 %.
    let lag = (-1.0_f64).exp();
    let speeds = [0.0, 0.5 * (1.0 - lag), 0.5 * (1.0 - lag * lag)];
    for (before, after) in [(speeds[0], speeds[1]), (speeds[1], speeds[2])] {
        rover.step(Duration::from_millis(150));
        let g = (after - before) * FULL_SPEED / 0.15 / 9.81;
        let [ahead, left, up] = rover.telemetry().acc;
        assert!((f64::from(ahead) - g * 16384.0).abs() <= 1.0, "{ahead}, {g} g");
        assert_eq!((left, up), (0, 16384));
    }
}

#[test]
fn a_rover_measures_its_turn_rate_of_the_last_step() {
    let mut rover = Rover::new();
    rover.command(&MotorControl::turn_right(0, 20).unwrap());
    rover.step(Duration::from_millis(3000));
    rover.step(Duration::from_millis(500));
    let [left, right, ..] = rover.telemetry().rpm;
    assert_eq!((left, right), (17, -17));
    // 14 % of full speed, each in its direction, on wheels 0.3 m apart.
    let degrees_per_s = (2.0 * 0.14 * FULL_SPEED / 0.3).to_degrees();
    let expected = -degrees_per_s * 16.4;
    let turn = f64::from(rover.telemetry().gyro[2]);
    assert!((turn - expected).abs() < 2.0, "{turn}, not {expected}");
    assert_eq!(rover.telemetry().acc[0], 0, "it does not go ahead");
}

#[test]
fn a_battery_of_40_wh_loses_what_the_rover_takes() {
    let mut rover = Rover::new();
    for _ in 0..60 {
        rover.step(Duration::from_millis(30_000));
    }
    // 4 W for half an hour.
    assert!((rover.battery() - 95.0).abs() < 1e-6, "{}", rover.battery());
    rover.command(&MotorControl::new(100, 0).unwrap());
    rover.step(Duration::from_millis(10_000));
    let at_speed = rover.battery();
    rover.step(Duration::from_millis(900_000));
    // 24 W for a quarter of an hour.
    assert!((at_speed - rover.battery() - 15.0).abs() < 1e-6, "{}", rover.battery());
}
