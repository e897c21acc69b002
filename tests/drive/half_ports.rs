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
        let round = call!(is_async, driver, service());
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
        let within = deadline - driver.now();
        let mut next = || call!(is_async, driver, next_command(within));
        assert_eq!(next(), Ok(Some(SlaveEvent::Command(Target::Velocity(rps(1.5))))));
        // Without a command to report, a failure is reported.
        far.write_all(ReadRequest::new(NodeId::N2).as_bytes()).unwrap();
        assert_eq!(next(), Err(GONE));
    }
}

#[cfg(feature = "ucp")]
#[test]
fn a_receiver_that_fails_does_not_end_the_frame_whose_rest_it_holds() {
    use axlewire::ucp::{Body, MotorControl};
    let stop = MotorControl::new(0, 0).unwrap().frame(0);
    for is_async in BOTH {
        for (failing_us, is_received) in [(1000, true), (19_000, true), (25_000, false)] {
            let (mut driver, mut far) = robot();
            far.write_all(&stop.as_bytes()[..7]).unwrap();
            far.world.step(2000);
            call!(is_async, driver, service()).unwrap();
            // The rest is received while the receiver fails.
            far.write_all(&stop.as_bytes()[7..]).unwrap();
            far.world.step(18_000);
            for _ in 0..failing_us / 1000 {
                driver.port_mut().reads.push_back(Step::Error);
                far.world.step(1000);
                assert_eq!(call!(is_async, driver, service()), Err(GONE));
            }
            call!(is_async, driver, service()).unwrap();
            assert_eq!(driver.role().command(far.world.now()).speed(), 0);
            assert_eq!(driver.role().statistics().commands == 1, is_received, "{failing_us} us");
        }
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
        let within = deadline - driver.now();
        let mut next = || call!(is_async, driver, next_command(within));
        assert_eq!(next(), Ok(Some(command)));
        assert_eq!(next(), Err(GONE));
    }
}

#[test]
fn a_slave_does_not_answer_while_its_receiver_fails_because_it_may_have_been_overtaken() {
    for is_async in BOTH {
        let (mut driver, mut far) = slave(SlaveConfig::direct());
        far.write_all(ReadRequest::new(NodeId::N2).as_bytes()).unwrap();
        far.world.step(100);
        call!(is_async, driver, service()).unwrap();
        let answers = driver.role().statistics().replies;
        // The request for another node is in the port when the receiver fails.
        let read = ReadRequest::new(NodeId::N2);
        driver.role_mut().handle_input(read.as_bytes(), far.world.now());
        far.write_all(ReadRequest::new(NodeId::N3).as_bytes()).unwrap();
        far.world.step(100);
        driver.port_mut().reads.push_back(Step::Error);
        assert_eq!(call!(is_async, driver, service()), Err(GONE));
        assert_eq!(driver.role().statistics().replies, answers);
    }
}
