//! A firmware update starts only on request, after a stop, and is followed by silence (U7, U13).

use crate::rig::*;

#[test]
fn a_firmware_update_is_requested_once_and_followed_by_silence() {
    let mut host = Host::new(HostConfig::default(), ms(0));
    host.start_calibration(IMU, ms(0)).unwrap();
    assert_eq!(host.start_firmware_update(40, ms(0)), Err(CommandError::Calibrating));
    sent(&mut host, ms(0));
    host.handle_input(&bytes(CalibrationStartAck::new(IMU, ErrorCode::Fine)), ms(10));
    host.drive(go(10), ms(50)).unwrap();
    sent(&mut host, ms(50));
    assert_eq!(host.start_firmware_update(40, ms(100)), Err(CommandError::Moving));
    assert_eq!(sent(&mut host, ms(100)), [] as [Vec<u8>; 0], "a refused call sends nothing");
    host.stop(ms(110));
    assert_eq!(speeds(&wait(&mut host, ms(110))), [(110_000, 0)]);
    host.start_firmware_update(40, ms(110)).unwrap();
    assert_eq!(host.drive(go(10), ms(110)), Err(CommandError::Updating));
    assert_eq!(host.start_calibration(IMU, ms(110)), Err(CommandError::Updating));
    let frames = sent(&mut host, ms(110));
    assert_eq!(speed(&frames[0]), Some(0));
    assert!(matches!(message(&frames[1]), Message::OtaRequest(request) if request.version() == 40));
    assert_eq!(frames.len(), 2);
    // Whatever arrives meanwhile, nothing is sent.
    host.handle_input(&bytes(imu_bias()), ms(120));
    host.handle_input(&bytes(OtaAck::new(OtaStatus::Accepted)), ms(130));
    assert_eq!(wait(&mut host, ms(60_000)), []);
    assert!(events(&mut host).contains(&HostEvent::UpdateAnswered(OtaStatus::Accepted)));
    host.end_firmware_update(ms(60_000));
    assert_eq!(host.poll_timeout(), Some(ms(60_000)), "the deadline is not in the past");
    host.handle_timeout(ms(60_000));
    assert!(sent(&mut host, ms(60_000)).iter().any(|frame| is_ping(frame)));
}

#[test]
fn a_refused_update_and_a_stop_end_the_silence() {
    let mut host = quiet_host();
    host.start_firmware_update(40, ms(0)).unwrap();
    assert_eq!(sent(&mut host, ms(0)).len(), 1);
    host.handle_input(&bytes(OtaAck::new(OtaStatus::Forbidden)), ms(10));
    host.drive(go(10), ms(20)).unwrap();
    assert_eq!(sent(&mut host, ms(20)).len(), 1);
    host.stop(ms(30));
    sent(&mut host, ms(30));
    host.start_firmware_update(40, ms(30)).unwrap();
    sent(&mut host, ms(30));
    host.stop(ms(60));
    assert_eq!(speeds(&wait(&mut host, ms(60))), [(60_000, 0)]);
}

/// A host whose robot has been told to drive.
fn driving() -> Host {
    let mut host = fresh_host();
    sent(&mut host, ms(0));
    host.drive(go(60), ms(30)).unwrap();
    sent(&mut host, ms(30));
    host
}

fn ids(frames: &[Vec<u8>]) -> Vec<u8> {
    frames.iter().map(|frame| frame[4]).collect()
}

#[test]
fn an_update_is_refused_until_the_stop_has_been_sent() {
    let mut host = fresh_host();
    let refused = Err(CommandError::Moving);
    assert_eq!(host.start_firmware_update(40, ms(0)), refused, "the first frame is due");

    for unsent in [Unsent::Untouched, Unsent::CutOff, Unsent::Unflushed] {
        let mut host = driving();
        host.stop(ms(40));
        assert_eq!(host.start_firmware_update(40, ms(40)), refused, "requested");
        assert_eq!(host.poll_transmit(ms(40)).and_then(speed), Some(0));
        host.handle_unsent(unsent, ms(41));
        assert_eq!(host.start_firmware_update(40, ms(41)), refused, "{unsent:?}");
        sent(&mut host, ms(41));
        assert_eq!(host.start_firmware_update(40, ms(41)), Ok(()));
    }
}

#[test]
fn one_more_stop_precedes_an_update_request() {
    let mut host = driving();
    let mut robot = quiet_robot();
    robot.handle_input(&bytes(go(60)), ms(30));
    host.stop(ms(40));
    let mut stop = sent(&mut host, ms(40)).concat();
    stop[7] ^= 4; // damaged on the line
    robot.handle_input(&stop, ms(41));
    host.start_firmware_update(40, ms(42)).unwrap();
    for frame in sent(&mut host, ms(42)) {
        robot.handle_input(&frame, ms(43));
    }
    let asked = RobotEvent::UpdateRequested { version: 40, by: UpdateSource::Request };
    assert!(events(&mut robot).contains(&asked));
    assert_eq!(robot.command(ms(43)).speed(), 0);
}

#[test]
fn an_update_request_waits_for_a_stop_that_did_not_leave() {
    for unsent in [Unsent::Untouched, Unsent::CutOff, Unsent::Unflushed] {
        let stops = if unsent == Unsent::CutOff { vec![2, 2] } else { vec![2] };
        // The stop is lost before the request, or along with it.
        for frames in [1, 2] {
            let mut host = driving();
            host.stop(ms(40));
            sent(&mut host, ms(40));
            host.start_firmware_update(40, ms(42)).unwrap();
            (0..frames).for_each(|_| assert!(host.poll_transmit(ms(42)).is_some()));
            host.handle_unsent(unsent, ms(43));
            assert!(!host.is_stop_sent(), "{unsent:?}");
            let again = sent(&mut host, ms(43));
            assert_eq!(ids(&again), [&stops[..], &[9]].concat(), "{unsent:?}");
            assert_eq!(wait(&mut host, ms(60_000)), [], "and then silence");
        }
    }
}

#[test]
fn an_update_never_starts_by_itself() {
    let mut robot = quiet_robot();
    robot.handle_input(&bytes(go(10)), ms(0));
    robot.handle_input(&careless(90, 0, 0, 39), ms(10));
    assert_eq!(robot.command(ms(10)).speed(), 10, "its speed is ignored");
    assert_eq!(robot.command(ms(500)).speed(), 0, "and it does not feed the watchdog");
    assert!(!robot.answer_update(OtaStatus::Accepted, ms(10)), "nothing to answer");
    robot.handle_input(&bytes(OtaRequest::start_firmware_update(41)), ms(20));
    let by_motor = RobotEvent::UpdateRequested { version: 39, by: UpdateSource::MotorCommand };
    let by_request = RobotEvent::UpdateRequested { version: 41, by: UpdateSource::Request };
    assert_eq!(events(&mut robot)[1..], [by_motor, by_request]);
    assert_eq!(sent(&mut robot, ms(20)), [] as [Vec<u8>; 0], "the application decides");
    assert!(robot.answer_update(OtaStatus::Forbidden, ms(30)));
    assert_eq!(sent(&mut robot, ms(30)), [bytes(OtaAck::new(OtaStatus::Forbidden))]);
    assert!(!robot.answer_update(OtaStatus::Forbidden, ms(30)), "once");
}

#[test]
fn a_command_that_a_false_header_held_back_is_as_old_as_its_bytes() {
    let mut robot = Robot::new(RobotConfig::default(), ms(0));
    // The start of a 64-byte frame that never comes, a command after it, and a late driver.
    let held = [&[0xFD, 0xFF, 60, 0][..], go(60).frame(0).as_bytes()].concat();
    robot.handle_input(&held, ms(10));
    assert_eq!(robot.command(ms(11)).speed(), 0, "not visible yet");
    robot.handle_input(&[0; 36], ms(400));
    assert_eq!(robot.command(ms(400)).speed(), 60, "it holds for 500 ms ...");
    assert_eq!(robot.command(ms(510)).speed(), 0, "... from when it had arrived");

    let mut robot = Robot::new(RobotConfig::default(), ms(0));
    robot.handle_input(&held, ms(10));
    robot.handle_input(&[0; 36], ms(2000));
    assert_eq!(robot.command(ms(2000)).speed(), 0, "it is no longer wanted");
}
