//! Every high-level call of a host and of a robot, blocking and async: a failing port, a refusal
//! and a silent robot come back as they are.

use axlewire::ucp::{Telemetry, host::CommandError, message::FirmwareReport};

use crate::rig::*;

const IMU: CalibrationKind = CalibrationKind::Imu;
const NOBODY: CalibrationKind = CalibrationKind::Other(9);

fn unplugged() -> Rover {
    let rover = host();
    rover.port().unplugged.set(true);
    rover
}

/// The result of both forms of a call, each with a host of its own.
macro_rules! result {
    ($host:ident, $name:ident($($argument:expr),*)) => {
        both(|is_async| {
            let mut driver = $host();
            call!(is_async, driver, $name($($argument),*))
        })
    };
}

#[test]
fn a_port_that_has_gone_is_the_error_of_every_call_of_a_host() {
    let (soon, span) = (ms(5), ms(5));
    assert_eq!(result!(unplugged, ping(soon)), Err(GONE));
    assert_eq!(result!(unplugged, drive(5, 5)), Err(GONE));
    assert_eq!(result!(unplugged, drive_for(5, 5, span)), Err(GONE));
    let begun = result!(unplugged, start_calibration(IMU, soon));
    assert_eq!(begun, Err(GONE));
    let ended = result!(unplugged, end_calibration(IMU, soon));
    assert_eq!(ended, Err(GONE));
    for is_async in BOTH {
        let mut rover = unplugged();
        // A report is not waited for; a stop is retried for 100 ms.
        let report = call!(is_async, rover, next_report(soon));
        assert_eq!((report, rover.now()), (Err(GONE), at_ms(0)));
        assert_eq!(call!(is_async, rover, stop()), Err(GONE));
        assert!((100_000..102_000).contains(&rover.now().as_micros()), "{:?}", rover.now());
    }
}

#[test]
fn a_robot_that_is_silent_is_a_timeout_at_the_deadline_of_the_call() {
    let soon = ms(5);
    let timeout = |operation| Err(DriveError::Timeout(operation));
    let ping = result!(host, ping(soon));
    assert_eq!(ping, timeout(Operation::Ping).map(|()| Duration::ZERO));
    let begun = result!(host, start_calibration(IMU, soon));
    assert_eq!(begun, timeout(Operation::Calibration));
    let ended = result!(host, end_calibration(IMU, soon));
    assert_eq!(ended, timeout(Operation::Calibration));
    assert_eq!(result!(host, next_report(soon)), Ok(None));
}

#[test]
fn a_refusal_of_the_host_is_the_error_of_its_call_and_changes_nothing() {
    let (soon, span) = (ms(5), ms(5));
    let refused = |error| Err(DriveError::<Unplugged>::Rover(error));
    let unknown = refused(CommandError::CalibrationKind { kind: 9 });
    let begun = result!(host, start_calibration(NOBODY, soon));
    assert_eq!(begun, unknown);
    let ended = result!(host, end_calibration(NOBODY, soon));
    assert_eq!(ended, unknown);

    /// A host that updates its robot.
    fn updating() -> Rover {
        let mut rover =
            on(Host::new(HostConfig::default(), at_ms(0)), Port::new(&World::default(), BYTE_US));
        rover.service().unwrap();
        for index in 0..15 {
            rover.port().world.step(100_000);
            let report = FirmwareReport::new(&Telemetry::default(), 38).frame(index);
            let now = rover.now();
            rover.role_mut().handle_input(report.as_bytes(), now);
            rover.service().unwrap();
        }
        let now = rover.now();
        rover.role_mut().start_firmware_update(50, now).unwrap();
        rover.service().unwrap();
        rover
    }
    let updating_now = refused(CommandError::Updating);
    assert_eq!(result!(updating, drive(5, 5)), updating_now);
    assert_eq!(result!(updating, drive_for(5, 5, span)), updating_now);
    let begun = result!(updating, start_calibration(IMU, soon));
    assert_eq!(begun, updating_now);
    for (speed, angular) in [(101, 0), (0, -101)] {
        let value = MotorControl::new(speed, angular).unwrap_err();
        let out = Err(DriveError::Value(value));
        for is_async in BOTH {
            let mut rover = host();
            assert_eq!(call!(is_async, rover, drive(speed, angular)), out);
            let driven = call!(is_async, rover, drive_for(speed, angular, span));
            assert_eq!(driven, out);
            assert_eq!(rover.port().written, [], "not even a round");
        }
    }
}

#[test]
fn a_drive_whose_port_fails_on_the_way_ends_with_a_stop_and_returns_the_error() {
    type Fault = fn(&mut Port);
    let faults: [Fault; 3] = [
        |port| port.reads.push_back(Step::Error),
        |port| port.flushes.push_back(Step::Error),
        |port| port.writes.extend([Step::Few(10), Step::Error]),
    ];
    for fault in faults {
        for is_async in BOTH {
            let (_, mut rover, _robot) = rover(|_| ());
            rover.service().unwrap();
            fault(rover.port_mut());
            let driven = call!(is_async, rover, drive_for(50, 0, ms(50)));
            assert_eq!(driven, Err(GONE));
            assert!(rover.role().is_stop_sent());
            assert_eq!(rover.role().command().map(|it| it.speed()), Some(0));
            // The last motor command on the line.
            let written = &rover.port().written;
            let last = written.windows(8).rposition(|it| it[..5] == [0xFD, 0xFF, 20, 0, 2]);
            assert_eq!(written[last.unwrap() + 6], 0);
        }
    }
}

#[test]
fn a_port_that_has_gone_is_the_error_of_a_robot_that_waits_for_a_command() {
    for is_async in BOTH {
        let (mut robot, _far) = robot();
        robot.port().unplugged.set(true);
        let within = at_ms(5) - robot.now();
        let command = call!(is_async, robot, next_command(within));
        assert_eq!(command, Err(GONE));
    }
}
