//! Counts: each event changes its own count by one and no other.

use axlewire::ucp::robot::RobotStatistics;

use crate::rig::*;

#[test]
fn every_event_of_a_robot_is_counted_once_and_in_one_place() {
    type Act = fn(&mut Robot);
    type Count = fn(&mut RobotStatistics) -> &mut u32;
    let table: [(&str, Act, &[Count]); 13] = [
        ("a command", |robot| robot.handle_input(&bytes(go(1)), ms(1)), &[|it| &mut it.commands]),
        (
            "a command whose turn is clamped",
            |robot| robot.handle_input(&careless(100, -101, 0, 0), ms(1)),
            &[|it| &mut it.commands, |it| &mut it.commands_clamped],
        ),
        (
            "a command that would start an update",
            |robot| robot.handle_input(&careless(1, 1, 0, 39), ms(1)),
            &[|it| &mut it.commands_refused],
        ),
        (
            "the watchdog",
            |robot| {
                robot.handle_input(&bytes(go(1)), ms(1));
                robot.handle_timeout(ms(501));
                robot.handle_timeout(ms(2000));
            },
            &[|it| &mut it.commands, |it| &mut it.watchdog],
        ),
        (
            "two pings that share a pong, which leaves the second time only",
            |robot| {
                robot.handle_input(&bytes(Ping {}), ms(1));
                robot.handle_input(&bytes(Ping {}), ms(1));
                robot.poll_transmit(ms(1)).unwrap();
                robot.handle_unsent(Unsent::Untouched, ms(1));
                sent(robot, ms(1));
            },
            &[|it| &mut it.pings, |it| &mut it.pings, |it| &mut it.pongs],
        ),
        (
            "a start, repeated",
            |robot| {
                for _ in 0..2 {
                    robot.handle_input(&bytes(CalibrationStart::new(IMU)), ms(1));
                }
            },
            &[|it| &mut it.calibration_repeats],
        ),
        (
            "an end of another calibration than the one that runs",
            |robot| {
                robot.handle_input(&bytes(CalibrationStart::new(IMU)), ms(1));
                robot.handle_input(&bytes(CalibrationEnd::new(MAG)), ms(1));
                assert_eq!(robot.calibrating(), Some(IMU));
            },
            &[|it| &mut it.calibration_refused],
        ),
        (
            "a start of unknown kind",
            |robot| {
                let kind = CalibrationKind::Other(9);
                robot.handle_input(&bytes(CalibrationStart::new(kind)), ms(1));
                assert_eq!(robot.calibrating(), None);
            },
            &[|it| &mut it.calibration_refused],
        ),
        (
            "a result of each kind",
            |robot| {
                robot.calibration_result_imu(imu_bias(), ms(1));
                robot.calibration_result_mag(mag_bias(), ms(1));
                sent(robot, ms(1));
            },
            &[|it| &mut it.results, |it| &mut it.results],
        ),
        (
            "acknowledgements of nothing",
            |robot| {
                robot.handle_input(&bytes(ImuBiasAck::new(ErrorCode::Fine)), ms(1));
                robot.handle_input(&bytes(MagBiasAck::new(ErrorCode::Fine)), ms(1));
            },
            &[|it| &mut it.acks_refused, |it| &mut it.acks_refused],
        ),
        (
            "a report, after two that were skipped",
            |robot| {
                robot.set_telemetry(&Telemetry::default(), ms(0));
                sent(robot, ms(59));
            },
            &[|it| &mut it.reports, |it| &mut it.reports_skipped, |it| &mut it.reports_skipped],
        ),
        (
            "an unknown frame",
            |robot| {
                let mut buffer = [0; 64];
                let frame = RawFrame { id: 0x20, index: 0, body: &[1] };
                robot.handle_input(frame.encode(&mut buffer).unwrap(), ms(1));
            },
            &[|it| &mut it.unknown],
        ),
        (
            "a frame of a robot",
            |robot| robot.handle_input(&report(0), ms(1)),
            &[|it| &mut it.misdirected],
        ),
    ];
    for (name, act, counts) in table {
        let mut robot = quiet_robot();
        let mut expected = RobotStatistics::default();
        act(&mut robot);
        counts.iter().for_each(|count| *count(&mut expected) += 1);
        assert_eq!(*robot.statistics(), expected, "{name}");
    }
}

#[test]
fn only_the_reports_of_a_robot_are_counted() {
    let mut robot = Robot::new(RobotConfig::default(), ms(0));
    robot.set_telemetry(&Telemetry::default(), ms(0));
    wait(&mut robot, ms(100));
    let at = ms(1000);
    for request in [
        bytes(Ping {}),
        bytes(CalibrationStart::new(IMU)),
        bytes(CalibrationEnd::new(IMU)),
        bytes(OtaRequest::start_firmware_update(50)),
    ] {
        robot.handle_input(&request, at);
    }
    robot.answer_update(OtaStatus::Failed, at);
    robot.calibration_result_imu(imu_bias(), at);
    robot.calibration_result_mag(mag_bias(), at);
    let frames = sent(&mut robot, at);
    let found: Vec<_> = frames.iter().map(|frame| (frame[4], frame[5])).collect();
    assert_eq!(found, [(3, 0), (4, 0), (9, 0), (1, 0), (6, 0), (7, 0), (8, 0), (5, 6)]);
    // And none of the answers reports damage.
    for (id, body) in [(3, &[2, 0][..]), (4, &[2, 0]), (1, &[0])] {
        let frame = frames.iter().find(|frame| frame[4] == id).unwrap();
        assert_eq!(Frame::parse(frame).unwrap().body(), body);
    }
}
