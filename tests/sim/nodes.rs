//! Nodes: a role with what it moves. The role keeps the contract of a driver, and what it reports
//! is how the thing moves.

use axlewire::{
    endpoint::{Arrival, Endpoint, LineRules, Unsent},
    ikeya::{Mode, NodeId, Position, ReadRequest, Rps, Slave, WriteRequest, slave::SlaveConfig},
    sim::{Motor, MotorNode, Rover, RoverNode},
    time::{Duration, Instant},
    ucp::{Body, Frame, Message, MotorControl, robot::RobotConfig},
};

const MS: fn(u32) -> Duration = Duration::from_millis;

fn at_ms(millis: u64) -> Instant {
    Instant::from_millis(millis)
}

#[test]
fn an_answer_of_a_motor_node_that_did_not_leave_is_due_again_and_outdated_by_more_bytes() {
    let mut node = MotorNode::new(NodeId::N1, Mode::Velocity);
    let read = ReadRequest::new(NodeId::N1);
    node.handle_input(read.as_bytes(), at_ms(1));
    let answer = node.poll_transmit(at_ms(1)).unwrap().to_vec();
    assert!(!node.is_outdated());
    assert_eq!(node.poll_transmit(at_ms(1)), None, "handed out once");
    node.handle_transmit(Unsent::Untouched, at_ms(1));
    assert_eq!(node.poll_transmit(at_ms(1)), Some(&answer[..]));
    node.handle_input(&[0], at_ms(1));
    assert!(node.is_outdated());
    assert_eq!(node.slave().statistics().replies, 1);
}

#[test]
fn a_motor_node_holds_where_it_is_when_its_switch_is_moved() {
    let mut node = MotorNode::new(NodeId::N1, Mode::Velocity);
    let turn = WriteRequest::velocity(NodeId::N1, Rps::new(2.0).unwrap());
    node.handle_input(turn.as_bytes(), at_ms(1));
    node.handle_timeout(at_ms(1001));
    let moved = node.motor().position();
    assert!(moved.revolutions() > 1.8);
    node.set_mode(Mode::Position);
    node.handle_timeout(at_ms(1501));
    assert_eq!((node.motor().position(), node.motor().velocity()), (moved, Rps::ZERO));
    node.set_mode(Mode::Velocity);
    node.handle_timeout(at_ms(2001));
    assert_eq!(node.motor().position(), moved, "without a command it stands still");
    // A shaft turned by hand is reported where it is.
    *node.motor_mut() = Motor::new().at(Position::new(5, 6));
    node.set_mode(Mode::Position);
    node.handle_input(ReadRequest::new(NodeId::N1).as_bytes(), at_ms(2002));
    let answer = node.poll_transmit(at_ms(2002)).unwrap();
    assert_eq!((answer[0], &answer[2..6]), (0x56, &[5, 0, 6, 0][..]));
}

#[test]
fn a_new_motor_reaches_63_percent_in_50_ms_and_goes_to_a_position_at_5_rps() {
    assert_eq!(Motor::default(), Motor::new());
    let mut motor = Motor::new();
    motor.turn(Rps::new(1.0).unwrap());
    motor.step(MS(50));
    assert!((motor.velocity().get() - 0.632).abs() < 0.001);
    let mut motor = Motor::new();
    motor.go_to(Position::new(0, 1));
    motor.step(MS(100));
    assert_eq!((motor.position().revolutions(), motor.velocity().get()), (0.5, 5.0));
}

#[test]
fn a_report_of_a_rover_node_that_did_not_leave_is_due_again_with_its_index() {
    let mut config = RobotConfig::default();
    config.bias_request_period = None;
    let mut node = RoverNode::new(config, at_ms(0));
    let index = |frame: &[u8]| {
        let frame = Frame::parse(frame).unwrap();
        assert!(matches!(frame.message(), Message::Report(_)));
        frame.index()
    };
    assert_eq!(index(node.poll_transmit(at_ms(0)).unwrap()), 0);
    assert_eq!(node.poll_transmit(at_ms(0)), None);
    node.handle_transmit(Unsent::Untouched, at_ms(0));
    assert_eq!(index(node.poll_transmit(at_ms(0)).unwrap()), 0);
    assert_eq!(node.robot().statistics().reports, 1);
    assert_eq!(index(node.poll_transmit(at_ms(20)).unwrap()), 1);
    assert!(!node.is_outdated());
}

#[test]
fn a_rover_node_stops_when_its_command_has_ended_even_if_it_is_only_polled() {
    let mut node = RoverNode::new(RobotConfig::default(), at_ms(0));
    node.handle_input(MotorControl::new(50, 0).unwrap().frame(0).as_bytes(), at_ms(0));
    node.poll_transmit(at_ms(499));
    let moved = node.rover().distance_m();
    assert!(moved > 0.1);
    // The wheels need a second to stop.
    for millis in (500..3000).step_by(20) {
        node.poll_transmit(at_ms(millis));
    }
    let stopped = node.rover().distance_m();
    node.poll_transmit(at_ms(4000));
    assert!(node.rover().distance_m() - stopped < 1e-3);
    assert_eq!(node.rover().telemetry().rpm, [0; 4]);
}

#[test]
fn a_new_rover_measures_what_one_at_rest_that_looks_north_would() {
    assert_eq!(Rover::default(), Rover::new());
    let told = Rover::new().telemetry();
    assert_eq!(
        (told.battery_pct, told.voltage_dv, told.power_w, told.current_ca),
        (100, 126, 4, 31)
    );
    assert_eq!((told.acc, told.gyro, told.rpm), ([0, 0, 16384], [0; 3], [0; 4]));
    assert_eq!((told.mag, told.heading_deg), ([300, 0, -400], 0));
    for (percent, battery, voltage_dv) in
        [(50.0, 50, 111), (0.0, 0, 96), (-5.0, 0, 96), (150.0, 100, 126)]
    {
        let told = Rover::new().with_battery(percent).telemetry();
        assert_eq!((told.battery_pct, told.voltage_dv), (battery, voltage_dv), "{percent} %");
    }
}

#[test]
fn a_rover_that_turns_right_on_the_spot_measures_that() {
    let mut rover = Rover::new();
    rover.command(&MotorControl::turn_right(0, 100).unwrap());
    rover.step(MS(2000));
    let told = rover.telemetry();
    // 70 % of 120 rpm; x is ahead and y to the left, so a turn to the right is negative.
    assert_eq!(told.rpm, [84, -84, 84, -84]);
    assert!(told.gyro[2] < -1000, "{told:?}");
    assert_eq!(told.heading_deg, rover.heading_deg() as i16);
    assert!(rover.distance_m().abs() < 1e-9);
    // Driving takes 20 W at full speed: here 70 %, less while it sets off.
    assert!((16..=18).contains(&told.power_w), "{told:?}");
    // Until it looks east: then north is to the left.
    while !(89.0..91.0).contains(&rover.heading_deg()) {
        rover.step(MS(1));
    }
    let [ahead, left, down] = rover.telemetry().mag;
    assert!(ahead.abs() < 10 && left > 290 && down == -400, "{ahead} {left} {down}");
}

#[test]
fn what_a_driver_asks_a_node_is_answered_by_its_role() {
    let node = MotorNode::new(NodeId::N1, Mode::Velocity);
    let rover = RoverNode::new(RobotConfig::default(), at_ms(0));
    assert_eq!(node.line_rules(), node.slave().line_rules());
    assert_eq!(rover.line_rules(), rover.robot().line_rules());
    // These differ from the defaults of the trait.
    let (node, rover, default) = (node.line_rules(), rover.line_rules(), LineRules::default());
    assert!(node.held_up_after.is_some() && rover.held_up_after.is_some());
    assert!(node.baud > 0 && rover.baud > 0 && node.frame_pause != default.frame_pause);
}

#[test]
fn a_command_that_waited_longer_than_the_watchdog_moves_no_simulated_motor() {
    let mut config = SlaveConfig::default();
    config.watchdog = Some(MS(100));
    let turn = WriteRequest::velocity(NodeId::N1, Rps::new(2.0).unwrap());
    for (since, is_moved) in [(1, false), (950, true)] {
        let slave = Slave::new(NodeId::N1, Mode::Velocity, config, at_ms(0));
        let mut node = MotorNode::from_parts(slave, Motor::new());
        node.handle_input(
            turn.as_bytes(),
            Arrival::Between { since: at_ms(since), now: at_ms(1000) },
        );
        node.handle_timeout(at_ms(1020));
        assert_eq!(node.motor().velocity() != Rps::ZERO, is_moved, "{since} ms");
    }
}

#[test]
fn a_command_that_waited_longer_than_the_watchdog_moves_no_simulated_rover() {
    let drive = MotorControl::new(50, 0).unwrap();
    let frame = drive.frame(0);
    for (since, is_moved) in [(1, false), (900, true)] {
        let mut node = RoverNode::new(RobotConfig::default(), at_ms(0));
        node.handle_input(
            frame.as_bytes(),
            Arrival::Between { since: at_ms(since), now: at_ms(1000) },
        );
        node.handle_timeout(at_ms(1100));
        assert_eq!(node.rover().distance_m() > 0.0, is_moved, "{since} ms");
    }
}

#[test]
fn the_robot_that_a_rover_node_lends_is_its_own() {
    let mut node = RoverNode::new(RobotConfig::default(), at_ms(0));
    let lent: *const _ = node.robot_mut();
    assert!(core::ptr::eq(lent, node.robot()));
}

#[test]
fn the_answer_of_a_motor_node_is_how_its_motor_moves() {
    let (read, turn) =
        (ReadRequest::new(NodeId::N1), WriteRequest::velocity(NodeId::N1, Rps::new(2.0).unwrap()));
    let mut node = MotorNode::new(NodeId::N1, Mode::Velocity);
    node.handle_input(turn.as_bytes(), at_ms(1));
    node.handle_timeout(at_ms(51));
    node.handle_input(read.as_bytes(), at_ms(51));
    let answer = node.poll_transmit(at_ms(51)).unwrap().to_vec();
    let rps = node.motor().velocity().get();
    assert!((1.2..1.3).contains(&rps), "{rps}: 63 % after 50 ms");
    assert_eq!(answer[2..6], rps.to_le_bytes());
}

#[test]
fn a_motor_node_wants_to_be_called_when_its_watchdog_is_due() {
    let mut config = SlaveConfig::default();
    config.watchdog = Some(MS(100));
    let slave = Slave::new(NodeId::N1, Mode::Velocity, config, at_ms(0));
    let mut node = MotorNode::from_parts(slave, Motor::new());
    let turn = WriteRequest::velocity(NodeId::N1, Rps::new(2.0).unwrap());
    node.handle_input(turn.as_bytes(), at_ms(1));
    assert_eq!(node.poll_timeout(), Some(at_ms(101)));
}

#[test]
fn the_answer_of_three_motors_is_how_they_move() {
    let read = ReadRequest::new(NodeId::N1);
    for mode in [Mode::Velocity, Mode::Position] {
        let mut node = MotorNode::three_motors(NodeId::N1, mode);
        for (motor, counts) in node.motor_mut().iter_mut().zip([5, -6, 7]) {
            *motor = Motor::new().at(Position::new(counts, 0));
            motor.turn(Rps::new(f32::from(counts)).unwrap());
            motor.step(Duration::from_micros(1));
        }
        let motors = node.motor().clone();
        node.handle_input(read.as_bytes(), at_ms(0));
        let answer = node.poll_transmit(at_ms(0)).unwrap();
        let expected: Vec<u8> = match mode {
            Mode::Velocity => {
                motors.iter().flat_map(|motor| motor.velocity().get().to_le_bytes()).collect()
            }
            // All counts, then all rotations.
            Mode::Position => {
                let counts = motors.iter().map(|motor| motor.position().count());
                let rotations = motors.iter().map(|motor| motor.position().rotation());
                counts.chain(rotations).flat_map(i16::to_le_bytes).collect()
            }
        };
        assert_eq!(answer[2..14], expected, "{mode:?}");
        assert!(motors.iter().all(|motor| motor.velocity() != Rps::ZERO));
    }
}
