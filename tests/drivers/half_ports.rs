//! Ports of which one half fails: what the other half has done counts, and the failure is returned
//! where it matters.

use axlewire::{
    drive::{DriveError, Driver},
    ikeya::{Mode, NodeId, ReadRequest, Slave, WriteRequest, board::Target, slave::SlaveConfig},
    time::Instant,
};
use embedded_io::Write;

use crate::{
    bus_rig::rps,
    port::Unplugged,
    recorder::Recorder,
    virtual_time::{End, VirtualClock, World},
};

const GONE: DriveError<Unplugged> = DriveError::Port(Unplugged);

#[test]
fn a_receiver_that_fails_while_a_frame_is_sent_is_an_error_of_the_round_that_sent_it() {
    for is_async in [false, true] {
        let world = World::default();
        let role = Recorder::sending(&[b"123", b"45"]);
        let mut driver = Driver::new(role, End::new(&world, 20), VirtualClock(world.clone()));
        driver.port_mut().is_deafened = true;
        let round = match is_async {
            true => world.block_on(driver.service_async()),
            false => driver.service(),
        };
        assert_eq!(round, Err(GONE));
        assert_eq!(driver.port().written, b"12345");
    }
}

#[test]
fn a_command_counts_although_the_answers_cannot_be_sent() {
    for is_async in [false, true] {
        let world = World::default();
        let (near, mut far) = End::pair(&world, 20);
        let (node, now) = (NodeId::N2, Instant::from_micros(0));
        let slave: Slave = Slave::new(node, Mode::Velocity, SlaveConfig::direct(), now);
        let mut driver = Driver::new(slave, near, VirtualClock(world.clone()));
        driver.port_mut().is_mute = true;
        far.write_all(WriteRequest::velocity(node, rps(1.5)).as_bytes()).unwrap();
        far.write_all(ReadRequest::new(node).as_bytes()).unwrap();
        world.step(500);
        let deadline = Instant::from_millis(10);
        let mut next = || match is_async {
            true => world.block_on(driver.next_command_async(deadline)),
            false => driver.next_command(deadline),
        };
        assert_eq!(next(), Ok(Some(Target::Velocity(rps(1.5)))));
        // Without a command to report, a failure is reported.
        far.write_all(ReadRequest::new(node).as_bytes()).unwrap();
        assert_eq!(next(), Err(GONE));
    }
}

#[cfg(feature = "ucp")]
#[test]
fn a_command_of_a_rover_counts_although_its_reports_cannot_be_sent() {
    use axlewire::ucp::{Body, MotorControl, Robot, Telemetry, robot::RobotConfig};
    for is_async in [false, true] {
        let world = World::default();
        let (near, mut far) = End::pair(&world, 87);
        let mut robot = Robot::new(RobotConfig::default(), world.now());
        robot.set_telemetry(&Telemetry::default(), world.now());
        let mut driver = Driver::new(robot, near, VirtualClock(world.clone()));
        driver.port_mut().is_mute = true;
        let command = MotorControl::new(5, 6).unwrap();
        far.write_all(command.frame(0).as_bytes()).unwrap();
        world.step(3000);
        let deadline = Instant::from_millis(10);
        let mut next = || match is_async {
            true => world.block_on(driver.next_command_async(deadline)),
            false => driver.next_command(deadline),
        };
        assert_eq!(next(), Ok(Some(command)));
        assert_eq!(next(), Err(GONE));
    }
}

#[cfg(feature = "ucp")]
#[test]
fn a_stop_of_a_rover_that_has_left_is_done_although_the_receiver_fails() {
    use axlewire::ucp::{Host, host::HostConfig};
    for is_async in [false, true] {
        let world = World::default();
        let host = Host::new(HostConfig::default(), world.now());
        let mut rover = Driver::new(host, End::new(&world, 87), VirtualClock(world.clone()));
        rover.port_mut().is_deaf = true;
        let stopped = match is_async {
            true => world.block_on(rover.stop_async()),
            false => rover.stop(),
        };
        assert_eq!(stopped, Ok(()));
        assert_eq!(rover.port().written[4], 2);
        // Calls that need the answer fail.
        let deadline = Instant::from_millis(50);
        let report = match is_async {
            true => world.block_on(rover.next_report_async(deadline)),
            false => rover.next_report(deadline),
        };
        assert_eq!(report, Err(GONE));
    }
}
