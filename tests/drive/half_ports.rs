//! Ports of which one half fails: what the other half has done counts, and the failure is returned
//! where it matters.

use axlewire::ikeya::board::Target;
use embedded_io::Write;

use crate::rig::*;

#[test]
fn a_receiver_that_fails_while_a_frame_is_sent_is_an_error_of_the_round_that_sent_it() {
    for is_async in BOTH {
        let port = Port { is_deafened: true, ..Port::default() };
        let mut driver = on(Recorder::sending(&[b"123", b"45"]), port);
        let round = call!(is_async, driver, service, service_async());
        assert_eq!(round, Err(GONE));
        assert_eq!(driver.port().written, b"12345");
    }
}

#[test]
fn a_command_counts_although_the_answers_cannot_be_sent() {
    for is_async in BOTH {
        let (mut driver, mut far) = slave(SlaveConfig::direct());
        driver.port_mut().is_mute = true;
        far.write_all(WriteRequest::velocity(NodeId::N2, rps(1.5)).as_bytes()).unwrap();
        far.write_all(ReadRequest::new(NodeId::N2).as_bytes()).unwrap();
        far.world.step(500);
        let deadline = at_ms(10);
        let mut next = || call!(is_async, driver, next_command, next_command_async(deadline));
        assert_eq!(next(), Ok(Some(Target::Velocity(rps(1.5)))));
        // Without a command to report, a failure is reported.
        far.write_all(ReadRequest::new(NodeId::N2).as_bytes()).unwrap();
        assert_eq!(next(), Err(GONE));
    }
}

#[cfg(feature = "ucp")]
#[test]
fn a_command_of_a_rover_counts_although_its_reports_cannot_be_sent() {
    use axlewire::ucp::{Body, MotorControl, Telemetry};
    for is_async in BOTH {
        let (mut driver, mut far) = robot();
        driver.role_mut().set_telemetry(&Telemetry::default(), at_ms(0));
        driver.port_mut().is_mute = true;
        let command = MotorControl::new(5, 6).unwrap();
        far.write_all(command.frame(0).as_bytes()).unwrap();
        far.world.step(3000);
        let deadline = at_ms(10);
        let mut next = || call!(is_async, driver, next_command, next_command_async(deadline));
        assert_eq!(next(), Ok(Some(command)));
        assert_eq!(next(), Err(GONE));
    }
}
