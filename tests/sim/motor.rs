//! A simulated motor: how it reaches a speed and a position, and where it stays.

use axlewire::ikeya::{Position, Rps};

use crate::talker::*;

#[test]
fn a_motor_moves_the_same_in_one_step_and_in_many() {
    let motion = |target: f32, steps: u32| {
        let mut motor = Motor::new();
        motor.turn(Rps::new(target).unwrap());
        for _ in 0..steps {
            motor.step(us(200_000 / steps));
        }
        (motor.velocity().get(), motor.position().revolutions())
    };
    let ((fast, far), (slow, near)) = (motion(4.0, 1), motion(4.0, 1000));
    assert!((fast - slow).abs() < 1e-5 && (far - near).abs() < 2e-4);
    // 4 rps over 0.2 s, less what a lag of 50 ms costs.
    assert!((far - (4.0 * 0.2 - 4.0 * 0.05 * (1.0 - (-4.0_f64).exp()))).abs() < 2e-4, "{far}");
    let (back, behind) = motion(-4.0, 7);
    assert!((back + fast).abs() < 1e-3 && (behind + far).abs() < 2e-3);
}

#[test]
fn a_motor_goes_to_a_position_at_its_limit_and_stays() {
    let mut motor = Motor::new().with_speed_limit(Rps::new(-2.0).unwrap());
    motor.go_to(Position::from_revolutions(1.0).unwrap());
    motor.step(us(250_000));
    assert_eq!((motor.position().revolutions(), motor.velocity().get()), (0.5, 2.0));
    motor.step(us(10_000_000));
    assert_eq!((motor.position().revolutions(), motor.velocity().get()), (1.0, 0.0));
    motor.turn(Rps::new(1.0).unwrap());
    motor.step(us(100_000));
    motor.hold();
    let held = motor.position();
    motor.step(us(100_000));
    assert_eq!((motor.position(), motor.velocity()), (held, Rps::ZERO));
}

#[test]
fn a_motor_beyond_the_wire_stays_at_its_end() {
    let mut motor = Motor::new().with_time_constant(Duration::ZERO);
    motor.turn(Rps::new(-1e30).unwrap());
    motor.step(Duration::from_millis(4_000_000));
    assert_eq!(motor.position().counts(), -268_443_647);
    motor.turn(Rps::new(1e30).unwrap());
    motor.step(Duration::from_millis(4_294_967));
    assert_eq!(motor.position().counts(), 268_435_455);
}
