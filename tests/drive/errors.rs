//! Errors of a driver: each message is one line, with its cause, which is no source then.

use std::error::Error;

use axlewire::ikeya::master::Cause;
#[cfg(feature = "ucp")]
use axlewire::ucp;

use crate::rig::*;

/// Each error has its text, and behind it the error of this text.
fn assert_texts(table: impl IntoIterator<Item = (DriveError<Unplugged>, String, Option<String>)>) {
    for (error, text, source) in table {
        assert_eq!(error.to_string(), text);
        assert_eq!(error.source().map(ToString::to_string), source, "{text}");
    }
}

#[test]
fn every_error_is_one_line_with_all_that_is_known() {
    let node = NodeId::N2;
    let told = |error: DriveError<Unplugged>, text: &str| (error, text.to_owned(), None);
    let failed = |cause| DriveError::ReadFailed { node, cause };
    assert_texts([
        (DriveError::Port(Unplugged), "port failed: unplugged".into(), None),
        told(DriveError::Closed, "port is closed: the other end has gone"),
        told(DriveError::WriteZero, "port took no bytes"),
        told(DriveError::Stalled, "port has stalled for a second"),
        told(
            DriveError::FrameTooLong { length: 65, limit: 64 },
            "frame of 65 bytes is longer than 64",
        ),
        told(DriveError::Timeout(Operation::Discovery), "the discovery did not finish in time"),
        told(DriveError::Timeout(Operation::SetPoint), "the set-point was not sent in time"),
        told(DriveError::Timeout(Operation::Read { node }), "node 2 was not read in time"),
        told(
            DriveError::StopsOwed([NodeId::N1, node].into_iter().collect()),
            "stop of node 1 and 2 not confirmed: a motor may be running",
        ),
        told(failed(Cause::Silent), "node 2 did not answer: nothing was heard"),
        told(failed(Cause::Damaged), "node 2 did not answer: only damaged bytes were heard"),
        told(failed(Cause::Unexpected), "node 2 did not answer: only other answers were heard"),
        told(failed(Cause::Dropped), "node 2 did not answer: its set-point was dropped"),
    ]);
    let bus = CommandError::NotOnline { node };
    assert_texts([(bus.into(), bus.to_string(), None)]);
}

#[cfg(feature = "ucp")]
#[test]
fn an_error_of_a_rover_says_what_the_robot_did_or_did_not_do() {
    use ucp::host::CommandError;
    let told = |operation, text: &str| (DriveError::Timeout(operation), text.to_owned(), None);
    assert_texts([
        told(Operation::Stop, "the stop was not sent in time: the robot may be driving"),
        told(Operation::Ping, "the robot did not answer a ping in time"),
        told(Operation::Calibration, "the robot did not answer a calibration in time"),
    ]);
    let value = MotorControl::new(101, 0).unwrap_err();
    let refused = CommandError::Value(value);
    assert_eq!(DriveError::<Unplugged>::from(refused), DriveError::Value(value));
    assert_eq!(refused.to_string(), "101 is outside -100..=100");
    let moving = CommandError::Moving;
    assert_texts([
        (refused.into(), refused.to_string(), None),
        (moving.into(), moving.to_string(), None),
    ]);
}

#[cfg(feature = "ucp")]
#[test]
fn a_failed_calibration_says_which_request_failed_and_how() {
    use axlewire::{
        endpoint::Endpoint,
        time::{Duration, Instant},
    };
    use ucp::{
        Body, Host,
        host::HostConfig,
        message::{CalibrationEndAck, CalibrationKind, CalibrationStartAck, ErrorCode},
    };
    let mut now = Instant::from_micros(0);
    let damaged = ErrorCode::Damaged;
    let mut failure = |is_start: bool, kind: CalibrationKind, is_answered: bool| {
        let mut host = Host::new(HostConfig::default(), now);
        let (begun, ack) = if is_start {
            let ack = CalibrationStartAck::new(kind, damaged).frame(0);
            (host.start_calibration(kind, now), ack.as_bytes().to_vec())
        } else {
            let ack = CalibrationEndAck::new(kind, damaged).frame(0);
            (host.end_calibration(kind, now), ack.as_bytes().to_vec())
        };
        begun.unwrap();
        for _ in 0..3 {
            while host.poll_transmit(now).is_some() {}
            if is_answered {
                host.handle_input(&ack, now);
            } else {
                now += Duration::from_millis(300);
                host.handle_timeout(now);
            }
        }
        DriveError::<Unplugged>::Calibration(host.calibration_outcome().unwrap().unwrap_err())
    };
    let (imu, mag) = (CalibrationKind::Imu, CalibrationKind::Magnetometer);
    let silence = "no answer to 3 requests";
    assert_texts([
        (
            failure(true, imu, true),
            "calibration of Imu did not start: the robot answered Damaged".into(),
            None,
        ),
        (
            failure(false, mag, true),
            "calibration of Magnetometer did not end: the robot answered Damaged".into(),
            None,
        ),
        (failure(false, imu, false), format!("calibration of Imu did not end: {silence}"), None),
    ]);
}
