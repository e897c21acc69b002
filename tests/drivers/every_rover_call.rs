//! Every high-level call of a host and of a robot, blocking and async: a failing port, a refusal
//! and a silent robot come back as they are.

use axlewire::{
    drive::{DriveError, Driver, Operation},
    time::{Duration, Instant},
    ucp::{
        Host, Robot,
        host::{self, HostConfig},
        message::CalibrationKind,
        robot::RobotConfig,
    },
};

use crate::{
    port::Unplugged,
    virtual_time::{End, VirtualClock, World},
};

const GONE: DriveError<Unplugged> = DriveError::Port(Unplugged);
const IMU: CalibrationKind = CalibrationKind::Imu;
const NOBODY: CalibrationKind = CalibrationKind::Other(9);

struct Link {
    world: World,
    bus: Driver<Host, End, VirtualClock>,
}

/// A host whose robot does not answer.
fn link() -> Link {
    let world = World::default();
    let clock = VirtualClock(world.clone());
    let host = Host::new(HostConfig::default(), Instant::from_micros(0));
    Link { bus: Driver::new(host, End::new(&world, 87), clock), world }
}

fn unplugged() -> Link {
    let link = link();
    link.bus.port().unplugged.set(true);
    link
}

#[test]
fn a_port_that_has_gone_is_the_error_of_every_call_of_a_host() {
    let (soon, span) = (Instant::from_millis(5), Duration::from_millis(5));
    let ping = both!(unplugged(), |bus| bus.ping(soon), bus.ping_async(soon));
    assert_eq!(ping, Err(GONE));
    let driven = both!(unplugged(), |bus| bus.drive(5, 5), bus.drive_async(5, 5));
    assert_eq!(driven, Err(GONE));
    let driven =
        both!(unplugged(), |bus| bus.drive_for(5, 5, span), bus.drive_for_async(5, 5, span));
    assert_eq!(driven, Err(GONE));
    let stopped = both!(unplugged(), |bus| bus.stop(), bus.stop_async());
    assert_eq!(stopped, Err(GONE));
    let report = both!(unplugged(), |bus| bus.next_report(soon), bus.next_report_async(soon));
    assert_eq!(report, Err(GONE));
    let begun = both!(
        unplugged(),
        |bus| bus.start_calibration(IMU, soon),
        bus.start_calibration_async(IMU, soon)
    );
    assert_eq!(begun, Err(GONE));
    let ended = both!(
        unplugged(),
        |bus| bus.end_calibration(IMU, soon),
        bus.end_calibration_async(IMU, soon)
    );
    assert_eq!(ended, Err(GONE));
}

#[test]
fn a_robot_that_is_silent_is_a_timeout_at_the_deadline_of_the_call() {
    let soon = Instant::from_millis(5);
    let timeout = |operation| Err(DriveError::Timeout(operation));
    let ping = both!(link(), |bus| bus.ping(soon), bus.ping_async(soon));
    assert_eq!(ping, timeout(Operation::Ping).map(|()| Duration::ZERO));
    let begun = both!(
        link(),
        |bus| bus.start_calibration(IMU, soon),
        bus.start_calibration_async(IMU, soon)
    );
    assert_eq!(begun, timeout(Operation::Calibration));
    let ended =
        both!(link(), |bus| bus.end_calibration(IMU, soon), bus.end_calibration_async(IMU, soon));
    assert_eq!(ended, timeout(Operation::Calibration));
    let report = both!(link(), |bus| bus.next_report(soon), bus.next_report_async(soon));
    assert_eq!(report, Ok(None));
}

#[test]
fn a_refusal_of_the_host_is_the_error_of_its_call_and_changes_nothing() {
    let (soon, span) = (Instant::from_millis(5), Duration::from_millis(5));
    let refused = |error| Err(DriveError::<Unplugged>::Rover(error));
    let unknown = refused(host::CommandError::CalibrationKind { kind: 9 });
    let begun = both!(
        link(),
        |bus| bus.start_calibration(NOBODY, soon),
        bus.start_calibration_async(NOBODY, soon)
    );
    assert_eq!(begun, unknown);
    let ended = both!(
        link(),
        |bus| bus.end_calibration(NOBODY, soon),
        bus.end_calibration_async(NOBODY, soon)
    );
    assert_eq!(ended, unknown);

    /// A host that updates its robot.
    fn updating() -> Link {
        let mut link = link();
        link.bus.service().unwrap();
        let now = link.bus.now();
        link.bus.role_mut().start_firmware_update(50, now).unwrap();
        link.bus.service().unwrap();
        link
    }
    let updating_now = refused(host::CommandError::Updating);
    let driven = both!(updating(), |bus| bus.drive(5, 5), bus.drive_async(5, 5));
    assert_eq!(driven, updating_now);
    let driven =
        both!(updating(), |bus| bus.drive_for(5, 5, span), bus.drive_for_async(5, 5, span));
    assert_eq!(driven, updating_now);
    let begun = both!(
        updating(),
        |bus| bus.start_calibration(IMU, soon),
        bus.start_calibration_async(IMU, soon)
    );
    assert_eq!(begun, updating_now);
    for (speed, angular) in [(101, 0), (0, -101)] {
        let mut link = link();
        let value = axlewire::ucp::MotorControl::new(speed, angular).unwrap_err();
        let out = refused(host::CommandError::Value(value));
        assert_eq!(link.bus.drive(speed, angular), out);
        assert_eq!(link.bus.drive_for(speed, angular, span), out);
        let world = link.world.clone();
        assert_eq!(world.block_on(link.bus.drive_async(speed, angular)), out);
        assert_eq!(world.block_on(link.bus.drive_for_async(speed, angular, span)), out);
        assert_eq!(link.bus.port().written, [], "not even a round");
    }
}

#[test]
fn a_drive_whose_port_fails_on_the_way_ends_with_a_stop_and_returns_the_error() {
    type Fault = fn(&mut End);
    let faults: [Fault; 3] = [
        |port| port.failing_reads = 1,
        |port| port.fails_flush = true,
        |port| port.fails_after = Some(10),
    ];
    let span = Duration::from_millis(50);
    for fault in faults {
        for is_async in [false, true] {
            let mut link = link();
            link.bus.service().unwrap();
            fault(link.bus.port_mut());
            let driven = match is_async {
                false => link.bus.drive_for(50, 0, span),
                true => link.world.clone().block_on(link.bus.drive_for_async(50, 0, span)),
            };
            assert_eq!(driven, Err(GONE));
            assert!(link.bus.role().is_stop_sent());
            assert_eq!(link.bus.role().command().map(|it| it.speed()), Some(0));
            // The last motor command on the line.
            let written = &link.bus.port().written;
            let last = written.windows(8).rposition(|it| it[..5] == [0xFD, 0xFF, 20, 0, 2]);
            assert_eq!(written[last.unwrap() + 6], 0);
        }
    }
}

#[test]
fn a_port_that_has_gone_is_the_error_of_a_robot_that_waits_for_a_command() {
    for is_async in [false, true] {
        let world = World::default();
        let robot = Robot::new(RobotConfig::default(), Instant::from_micros(0));
        let mut driver = Driver::new(robot, End::new(&world, 87), VirtualClock(world.clone()));
        driver.port().unplugged.set(true);
        let command = match is_async {
            false => driver.next_command(Instant::from_millis(5)),
            true => world.block_on(driver.next_command_async(Instant::from_millis(5))),
        };
        assert_eq!(command, Err(GONE));
    }
}
