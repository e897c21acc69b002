//! The robot answers at once, reports on schedule, and stops without commands (U9, U10, U12, U13).

use crate::rig::*;

#[test]
fn a_ping_is_answered_at_once_with_0() {
    let mut robot = quiet_robot();
    robot.handle_input(&bytes(Ping {}), ms(1));
    assert_eq!(robot.poll_timeout(), Some(ms(1)));
    assert_eq!(sent(&mut robot, ms(1)), [bytes(Pong::new(ErrorCode::Fine))]);
    assert_eq!(robot.poll_timeout(), None);
}

#[test]
fn a_damaged_ping_is_not_answered() {
    let mut robot = quiet_robot();
    let mut ping = bytes(Ping {});
    ping[7] ^= 1;
    robot.handle_input(&ping, ms(1));
    assert!(robot.statistics().pings == 0 && robot.counters().crc > 0);
    assert_eq!(wait(&mut robot, ms(1000)), []);
}

#[test]
fn no_valid_motor_frame_for_500_ms_means_standing_still() {
    let mut robot = quiet_robot();
    let command = MotorControl::new(60, -20).unwrap().with_front_led(true);
    robot.handle_input(&bytes(command), ms(100));
    assert_eq!(events(&mut robot), [RobotEvent::Motor(command)]);
    // Neither noise nor a damaged command nor a ping is a command.
    let mut damaged = bytes(command);
    damaged[9] ^= 0x10;
    for at in [200, 300, 400, 500] {
        robot.handle_input(&[0xFD; 30], ms(at));
        robot.handle_input(&damaged, ms(at));
        robot.handle_input(&bytes(Ping {}), ms(at));
        sent(&mut robot, ms(at));
    }
    wait(&mut robot, us(599_999));
    assert_eq!((robot.command(us(599_999)), events(&mut robot)), (command, vec![]));
    wait(&mut robot, ms(600));
    let still = MotorControl::STOP.with_front_led(true);
    assert_eq!(robot.command(ms(600)), still);
    assert_eq!(events(&mut robot), [RobotEvent::Watchdog]);
    wait(&mut robot, ms(5000));
    assert_eq!(events(&mut robot), [], "reported once");
    robot.handle_input(&bytes(command), ms(6000));
    assert_eq!(events(&mut robot), [RobotEvent::Motor(command)], "the next one is obeyed");
}

#[test]
fn a_robot_whose_driver_is_late_still_stands_still() {
    let mut robot = quiet_robot();
    robot.handle_input(&bytes(go(60)), ms(0));
    assert_eq!(robot.command(ms(500)).speed(), 0, "without handle_timeout");
    // The next command arrives before the timeout has been handled.
    robot.handle_input(&bytes(go(60)), ms(700));
    let go = RobotEvent::Motor(go(60));
    assert_eq!(events(&mut robot), [go, RobotEvent::Watchdog, go]);
}

#[test]
fn the_first_command_is_an_event_even_if_it_changes_nothing() {
    let mut robot = quiet_robot();
    robot.handle_input(&bytes(MotorControl::STOP), ms(0));
    robot.handle_input(&bytes(MotorControl::STOP), ms(100));
    assert_eq!(events(&mut robot), [RobotEvent::Motor(MotorControl::STOP)]);
}

#[test]
fn a_repeated_command_is_not_an_event() {
    let mut robot = quiet_robot();
    for at in (0..2000).step_by(100) {
        robot.handle_timeout(ms(at));
        robot.handle_input(&bytes(go(60)), ms(at));
    }
    assert_eq!(events(&mut robot), [RobotEvent::Motor(go(60))]);
    assert_eq!(robot.statistics().commands, 20);
}

#[test]
fn out_of_range_values_are_clamped_like_in_the_vendor_firmware() {
    let mut robot = quiet_robot();
    robot.handle_input(&careless(i16::MIN, 360, 0x0101, 0), ms(0));
    let command = robot.command(ms(0));
    assert_eq!((command.speed(), command.angular()), (-100, 100));
    assert_eq!(command.front_led(), 100, "any low byte but 00 and FF is on");
    robot.handle_input(&careless(1, 2, -1, 0), ms(1));
    assert_eq!(robot.command(ms(1)), MotorControl::new(1, 2).unwrap());
    robot.handle_input(&careless(100, -100, 0, 0), ms(2));
    assert_eq!((robot.statistics().commands, robot.statistics().commands_clamped), (3, 1));
    // Each of them, also if it repeats the last one.
    for at in [3, 4] {
        robot.handle_input(&careless(0, 360, 0, 0), ms(at));
    }
    assert_eq!((robot.statistics().commands, robot.statistics().commands_clamped), (5, 3));
}

#[test]
fn reports_come_every_20_ms_without_drift() {
    let mut robot = quiet_robot();
    assert_eq!(robot.poll_timeout(), None, "nothing is reported before a measurement");
    robot.set_telemetry(&Telemetry::default(), ms(7));
    let mut count = 0;
    while let Some(at) = robot.poll_timeout().filter(|&at| at < ms(10_007)) {
        assert_eq!(at, ms(7 + 20 * count));
        // A driver that is always slightly late.
        let now = at + Duration::from_micros(1 + (count * 977 % 19_000) as u32);
        robot.handle_timeout(now);
        let battery_pct = 80 + (count % 20) as u16;
        robot.set_telemetry(&Telemetry { battery_pct, ..Telemetry::default() }, now);
        let frames = sent(&mut robot, now);
        let frame = Frame::parse(&frames[0]).unwrap();
        assert_eq!((frames.len(), frame.index()), (1, count as u8));
        let Message::Report(report) = frame.message() else { panic!() };
        assert_eq!((report.telemetry().battery_pct, report.version()), (battery_pct, Some(38)));
        count += 1;
    }
    assert_eq!(count, 500);
    assert_eq!(robot.statistics().reports_skipped, 0);
}

#[test]
fn a_robot_that_was_held_up_skips_the_reports_it_missed() {
    let mut robot = quiet_robot();
    robot.set_telemetry(&Telemetry::default(), ms(0));
    assert_eq!(sent(&mut robot, ms(0)).len(), 1);
    assert_eq!(sent(&mut robot, ms(1005)).len(), 1, "no burst");
    assert_eq!(robot.poll_timeout(), Some(ms(1020)), "on schedule");
    assert_eq!((robot.statistics().reports, robot.statistics().reports_skipped), (2, 49));
    // Longer than a Duration can represent.
    assert_eq!(sent(&mut robot, ms(20_000_000)).len(), 1);
    assert_eq!(robot.poll_timeout(), Some(ms(20_000_020)));
    assert!(robot.statistics().reports_skipped > 200_000);
}

#[test]
fn a_robot_can_report_as_the_document_does() {
    let mut config = RobotConfig::default();
    config.layout = ReportLayout::Document;
    let mut rig = Rig::of(quiet_host(), Robot::new(config, ms(0)), ms(0));
    let telemetry = Telemetry { heading_deg: 123, ..Telemetry::default() };
    rig.robot.set_telemetry(&telemetry, ms(0));
    rig.run_for(100);
    let report = rig.host.last_report().unwrap();
    assert_eq!((report.telemetry, report.version), (telemetry, None));
}

#[test]
fn a_network_state_of_one_byte_or_four_is_an_event() {
    let mut robot = quiet_robot();
    robot.handle_input(&bytes(SetNetworkState::new(NetworkState::Connected).unwrap()), ms(0));
    let crc = axlewire::crc16::compute(&[0xFD, 0xFF, 8, 0, 0x0A, 0, 2, 0, 0, 0]).to_le_bytes();
    robot.handle_input(&[0xFD, 0xFF, 8, 0, 0x0A, 0, 2, 0, 0, 0, crc[0], crc[1]], ms(1));
    let states = [NetworkState::Connected, NetworkState::Disconnected];
    assert_eq!(events(&mut robot), states.map(RobotEvent::NetworkState));
}

#[test]
fn frames_of_a_robot_do_not_disturb_a_robot() {
    let mut robot = quiet_robot();
    robot.handle_input(&bytes(go(60)), ms(0));
    events(&mut robot);
    for frame in [
        bytes(FirmwareReport::new(&Telemetry::default(), 38)),
        bytes(Pong::new(ErrorCode::Fine)),
        bytes(imu_bias()),
        bytes(BiasRequest {}),
        bytes(CalibrationStartAck::new(IMU, ErrorCode::Fine)),
    ] {
        robot.handle_input(&frame, ms(1));
    }
    assert_eq!((robot.statistics().misdirected, events(&mut robot)), (5, vec![]));
    assert_eq!(sent(&mut robot, ms(1)), [] as [Vec<u8>; 0]);
    robot.handle_input(&bytes(Ping {}), ms(2));
    assert_eq!(sent(&mut robot, ms(2)).len(), 1, "and it still answers as before");
    // Unknown ids and invalid bodies are counted as well.
    let mut buffer = [0; 64];
    let raw = RawFrame { id: 0x77, index: 0, body: &[1] };
    robot.handle_input(raw.encode(&mut buffer).unwrap(), ms(3));
    assert_eq!((robot.statistics().unknown, events(&mut robot)), (1, vec![]));
}

#[test]
fn an_update_by_a_motor_command_that_has_no_room_is_counted_and_one_that_has_is_not() {
    let mut robot = quiet_robot();
    robot.handle_input(&careless(0, 0, 0, 39), ms(0));
    assert_eq!((robot.statistics().without_room, robot.statistics().commands_refused), (0, 1));
    // Other events that are never taken, until there is no room.
    for version in 0..40 {
        robot.handle_input(&bytes(OtaRequest::start_firmware_update(version)), ms(1));
    }
    let before = robot.statistics().without_room;
    robot.handle_input(&careless(0, 0, 0, 40), ms(2));
    assert_eq!(robot.statistics().without_room, before + 1);
}

#[test]
fn the_command_of_a_robot_whose_driver_is_late_has_ended_when_it_is_taken() {
    let mut robot = quiet_robot();
    robot.handle_input(&bytes(go(50).with_front_led(true)), ms(0));
    assert_eq!(robot.take_command(us(499_999)), Some(go(50).with_front_led(true)));
    assert_eq!(robot.take_command(us(499_999)), None, "taken");
    // Nobody has called `handle_timeout`.
    assert_eq!(robot.take_command(ms(500)), Some(MotorControl::STOP.with_front_led(true)));
    assert_eq!(robot.take_command(ms(500)), None);
    assert_eq!((robot.statistics().watchdog, robot.command(ms(0)).speed()), (1, 0));
    // Also of a robot that stands still: its stop by the watchdog is a change.
    robot.handle_input(&bytes(go(0)), ms(600));
    assert_eq!(robot.take_command(ms(600)), Some(go(0)));
    assert_eq!(robot.take_command(ms(1100)), Some(MotorControl::STOP));
    assert_eq!(robot.statistics().watchdog, 2, "each time");
}

#[test]
fn a_command_that_comes_at_the_end_of_the_last_one_does_not_hide_the_watchdog() {
    let mut robot = quiet_robot();
    robot.handle_input(&bytes(go(50)), ms(0));
    assert_eq!(robot.poll_event(), Some(RobotEvent::Motor(go(50))));
    robot.handle_input(&bytes(go(40)), ms(500));
    assert_eq!(robot.poll_event(), Some(RobotEvent::Watchdog));
    assert_eq!(robot.poll_event(), Some(RobotEvent::Motor(go(40))));
    // One that came in time has no watchdog before it, also if it is taken in late.
    robot.handle_old_input(&bytes(go(30)), ms(990), ms(1010));
    assert_eq!(robot.poll_event(), Some(RobotEvent::Motor(go(30))));
    assert_eq!(robot.statistics().watchdog, 1);
}

#[test]
fn answers_are_due_since_the_oldest_request() {
    let mut robot = quiet_robot();
    robot.handle_input(&bytes(Ping {}), ms(3));
    robot.handle_input(&bytes(CalibrationStart::new(IMU)), ms(5));
    assert_eq!(robot.poll_timeout(), Some(ms(3)));
    assert_eq!(sent(&mut robot, ms(5)).len(), 2);
    assert_eq!(robot.poll_timeout(), None);
}

#[test]
fn an_answer_to_an_update_request_that_did_not_leave_does_not_replace_a_newer_one() {
    let asks = bytes(OtaRequest::start_firmware_update(50));
    for unsent in EVERY {
        let mut robot = quiet_robot();
        robot.handle_input(&asks, ms(0));
        assert!(robot.answer_update(OtaStatus::Failed, ms(0)));
        assert!(!robot.answer_update(OtaStatus::Failed, ms(0)), "answered");
        robot.poll_transmit(ms(0)).unwrap();
        robot.handle_input(&asks, ms(1));
        assert!(robot.answer_update(OtaStatus::Forbidden, ms(1)));
        robot.handle_unsent(unsent, ms(1));
        assert_eq!(sent(&mut robot, ms(1)), [bytes(OtaAck::new(OtaStatus::Forbidden))]);
    }
}
