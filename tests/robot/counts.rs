//! Counts: each event changes its own count by one and no other.

use crate::rig::*;

#[test]
fn every_event_of_a_robot_is_counted_once_and_in_one_place() {
    assert_counted! {
        quiet_robot();
        "a command": commands => |robot| {
            robot.handle_input(&bytes(go(1)), ms(1));
        }
        "a command whose turn is clamped": commands, commands_clamped => |robot| {
            robot.handle_input(&careless(100, -101, 0, 0), ms(1));
        }
        "a command that would start an update": commands_refused => |robot| {
            robot.handle_input(&careless(1, 1, 0, 39), ms(1));
        }
        "the watchdog": commands, watchdog => |robot| {
            robot.handle_input(&bytes(go(1)), ms(1));
            robot.handle_timeout(ms(501));
            robot.handle_timeout(ms(2000));
        }
        "two pings that share a pong, which leaves the second time only":
            pings, pings, pongs
        => |robot| {
            robot.handle_input(&bytes(Ping {}), ms(1));
            robot.handle_input(&bytes(Ping {}), ms(1));
            robot.poll_transmit(ms(1)).unwrap();
            robot.handle_transmit(Unsent::Untouched, ms(1));
            sent(robot, ms(1));
        }
        "a start, repeated": calibration_repeats => |robot| {
            for _ in 0..2 {
                robot.handle_input(&bytes(CalibrationStart::new(IMU)), ms(1));
            }
        }
        "an end of another calibration than the one that runs": calibration_refused => |robot| {
            robot.handle_input(&bytes(CalibrationStart::new(IMU)), ms(1));
            robot.handle_input(&bytes(CalibrationEnd::new(MAG)), ms(1));
            assert_eq!(robot.calibrating(), Some(IMU));
        }
        "a start of unknown kind": calibration_refused => |robot| {
            let kind = CalibrationKind::Other(9);
            robot.handle_input(&bytes(CalibrationStart::new(kind)), ms(1));
            assert_eq!(robot.calibrating(), None);
        }
        "a result of each kind": results, results => |robot| {
            both_results(robot, 1);
            sent(robot, ms(1));
        }
        "acknowledgements of nothing": acks_refused, acks_refused => |robot| {
            robot.handle_input(&bytes(ImuBiasAck::new(ErrorCode::Fine)), ms(1));
            robot.handle_input(&bytes(MagBiasAck::new(ErrorCode::Fine)), ms(1));
        }
        "a report, after two that were skipped":
            reports, reports_skipped, reports_skipped
        => |robot| {
            robot.set_telemetry(&Telemetry::default(), ms(0));
            sent(robot, ms(59));
        }
        "an unknown frame": unknown => |robot| {
            let mut buffer = [0; 64];
            let frame = RawFrame { id: 0x20, index: 0, body: &[1] };
            robot.handle_input(frame.encode(&mut buffer).unwrap(), ms(1));
        }
        "a frame of a robot": misdirected => |robot| {
            robot.handle_input(&report(0), ms(1));
        }
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
