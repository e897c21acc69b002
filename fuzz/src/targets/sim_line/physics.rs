//! The motor and the rover of the simulator obey physics.

use axlewire::{
    ikeya::{Position, Rps},
    sim::{Motor, Rover},
    time::Duration,
    ucp::MotorControl,
};

/// A motor approaches its speed, does not overshoot, and goes no faster than its limit.
pub(super) fn motor(speed: i8, limit: u8, constant_ms: u8, steps: &[(u8, u16)]) {
    let rps = |value: f64| Rps::new(value as f32).expect("finite");
    let limit = f64::from(limit) / 8.0;
    let mut motor = Motor::new()
        .with_time_constant(Duration::from_millis(constant_ms.into()))
        .with_speed_limit(rps(limit));
    let mut fastest = 0.0_f64;
    for &(what, micros) in steps.iter().take(40) {
        let span = Duration::from_micros(u32::from(micros) * 16);
        let seconds = f64::from(span.as_micros()) / 1e6;
        let before = motor.position().revolutions();
        match what % 4 {
            0 => {
                motor.turn(rps(f64::from(speed)));
                fastest = fastest.max(f64::from(speed).abs());
            }
            1 => motor.go_to(Position::new(0, i16::from(what) - 100)),
            2 => motor.hold(),
            _ => {}
        }
        fastest = fastest.max(limit);
        let mut halves = motor.clone();
        motor.step(span);
        let half = Duration::from_micros(span.as_micros() / 2);
        halves.step(half);
        halves.step(Duration::from_micros(span.as_micros() - half.as_micros()));
        let (here, there) = (motor.position().revolutions(), halves.position().revolutions());
        assert!((here - there).abs() < 2e-3, "one step of {span:?} leads elsewhere than two");
        assert!(f64::from(motor.velocity().get()).abs() <= fastest * 1.0001, "too fast");
        assert!((here - before).abs() <= fastest * seconds * 1.0001 + 2e-3, "too far");
    }
    motor.hold();
    let at = motor.position();
    motor.step(Duration::from_millis(1000));
    assert_eq!(motor.position(), at, "it does not hold");
}

/// A rover stays within full speed, and its readings within their ranges.
pub(super) fn rover(battery: u8, steps: &[(i8, i8, u16)]) {
    let mut rover = Rover::new().with_battery(f64::from(battery));
    let metres_per_s = Rover::FULL_RPM / 60.0 * 0.4;
    for &(speed, angular, micros) in steps.iter().take(40) {
        if let Ok(command) = MotorControl::new(speed.into(), angular.into()) {
            rover.command(&command);
        }
        let (before, charge) = (rover.distance_m(), rover.battery());
        let span = Duration::from_micros(u32::from(micros) * 16);
        rover.step(span);
        let way = (rover.distance_m() - before).abs();
        assert!(way <= metres_per_s * f64::from(span.as_micros()) / 1e6 + 1e-9, "too far");
        assert!((0.0..360.0).contains(&rover.heading_deg()) || rover.heading_deg() == 360.0);
        assert!((0.0..=charge).contains(&rover.battery()), "it charges itself");
        let told = rover.telemetry();
        assert!(told.battery_pct <= 100 && (0..=360).contains(&told.heading_deg));
        assert!(told.rpm.iter().all(|rpm| f64::from(rpm.unsigned_abs()) <= Rover::FULL_RPM));
    }
}
