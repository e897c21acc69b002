//! The robot answers at once, and reports on schedule (U9, U12).

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
fn answers_are_due_since_the_oldest_request() {
    let mut robot = quiet_robot();
    robot.handle_input(&bytes(Ping {}), ms(3));
    robot.handle_input(&bytes(CalibrationStart::new(IMU)), ms(5));
    assert_eq!(robot.poll_timeout(), Some(ms(3)));
    assert_eq!(sent(&mut robot, ms(5)).len(), 2);
    assert_eq!(robot.poll_timeout(), None);
}

#[test]
fn a_frame_in_two_pieces_is_whole() {
    let mut robot = quiet_robot();
    let command = bytes(go(60));
    robot.handle_input(&command[..7], ms(0));
    robot.handle_timeout(ms(4)); // within the margin
    robot.handle_input(&command[7..], ms(4));
    assert_eq!(robot.command(ms(4)).speed(), 60);
}

#[test]
fn a_flooding_host_gets_one_answer_of_each_kind_at_a_time() {
    let mut robot = quiet_robot();
    let mut flood = Vec::new();
    for version in 0..1000 {
        flood.extend(bytes(Ping {}));
        flood.extend(bytes(CalibrationStart::new(IMU)));
        flood.extend(bytes(OtaRequest::start_firmware_update(version)));
    }
    robot.handle_input(&flood, ms(0));
    assert_eq!(sent(&mut robot, ms(0)).len(), 2);
    assert_eq!((robot.statistics().pings, robot.statistics().pongs), (1000, 1));
    assert_eq!(events(&mut robot).len(), 16);
    // A repeated start is already queued; a request without room is not lost unnoticed.
    assert_eq!((robot.lost_events(), robot.statistics().without_room), (0, 1000 - 15));
}

#[test]
fn everything_that_a_robot_has_to_send_goes_in_order_and_is_in_its_deadline() {
    type Act = fn(&mut Robot);
    let acts: [(u8, Act); 7] = [
        (3, |robot| robot.handle_input(&bytes(CalibrationStart::new(IMU)), ms(7))),
        (4, |robot| robot.handle_input(&bytes(CalibrationEnd::new(IMU)), ms(7))),
        (9, |robot| {
            robot.handle_input(&bytes(OtaRequest::start_firmware_update(9)), ms(7));
            assert!(robot.answer_update(OtaStatus::Accepted, ms(7)));
        }),
        (1, |robot| robot.handle_input(&bytes(Ping {}), ms(7))),
        (6, |robot| robot.calibration_result_imu(imu_bias(), ms(7))),
        (7, |robot| robot.calibration_result_mag(mag_bias(), ms(7))),
        (5, |robot| robot.set_telemetry(&Telemetry::default(), ms(7))),
    ];
    let ids =
        |robot: &mut Robot| sent(robot, ms(7)).iter().map(|frame| frame[4]).collect::<Vec<_>>();
    for (id, act) in acts {
        let mut robot = quiet_robot();
        act(&mut robot);
        assert_eq!(robot.poll_timeout(), Some(ms(7)), "id {id}");
        assert_eq!(ids(&mut robot), [id]);
    }
    let mut robot = Robot::new(RobotConfig::default(), ms(7));
    assert_eq!(robot.poll_timeout(), Some(ms(7)), "its biases");
    acts.iter().rev().for_each(|(_, act)| act(&mut robot));
    assert_eq!(ids(&mut robot), [3, 4, 9, 1, 6, 7, 8, 5]);
}

#[test]
fn reports_of_both_layouts_are_counted_by_their_index() {
    for layout in [ReportLayout::Document, ReportLayout::Firmware { version: 40 }] {
        let mut config = RobotConfig::default();
        (config.layout, config.bias_request_period) = (layout, None);
        let mut robot = Robot::new(config, ms(0));
        robot.set_telemetry(&Telemetry { power_w: 9, ..Telemetry::default() }, ms(0));
        let mut host = quiet_host();
        for index in 0..=256 {
            let frames = sent(&mut robot, ms(20 * index));
            let frame = Frame::parse(&frames[0]).unwrap();
            let Message::Report(report) = frame.message() else { panic!("{frames:?}") };
            assert_eq!((frame.index(), report.telemetry().power_w), (index as u8, 9));
            let version = if layout == ReportLayout::Document { None } else { Some(40) };
            assert_eq!(report.version(), version);
            host.handle_input(&frames[0], ms(20 * index));
            let read = host.take_report().unwrap();
            assert_eq!((read.telemetry.power_w, read.version), (9, version));
        }
    }
}

#[test]
fn each_time_of_a_robot_has_a_setting_of_its_own() {
    let after = Duration::from_millis;
    let mut config = RobotConfig::default();
    (config.watchdog, config.report_period) = (after(450), after(250));
    (config.result_period, config.bias_request_period) = (after(300), Some(after(350)));
    let mut robot = Robot::new(config, ms(0));
    robot.set_telemetry(&Telemetry::default(), ms(0));
    both_results(&mut robot, 0);
    robot.handle_input(&bytes(go(5)), ms(0));
    let frames = wait(&mut robot, ms(1000));
    for (id, expected) in [
        (5, &[0, 250, 500, 750, 1000][..]),
        (6, &[0, 300, 600, 900]),
        (7, &[0, 300, 600, 900]),
        (8, &[0, 350, 700]),
    ] {
        let found = frames.iter().filter(|(_, frame)| frame[4] == id);
        assert_eq!(found.map(|(at, _)| at.as_micros() / 1000).collect::<Vec<_>>(), expected);
    }
    assert_eq!((robot.command(us(449_999)).speed(), robot.statistics().watchdog), (0, 1));
    let mut robot = Robot::new(config, ms(0));
    robot.handle_input(&bytes(go(5)), ms(0));
    assert_eq!(robot.command(us(449_999)).speed(), 5);
    assert_eq!(robot.command(ms(450)).speed(), 0);
}
