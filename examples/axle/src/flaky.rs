//! Stops over a port that fails for a while and then recovers.

use std::{
    cell::RefCell,
    io::{self, ErrorKind},
    rc::Rc,
    time::{Duration, Instant as Clock},
};

use axlewire::{
    endpoint::Endpoint,
    ikeya::{Mode, NodeId, master::MasterConfig},
    sim::MotorNode,
    time::Instant,
    ucp::{Robot, Telemetry, robot::RobotConfig},
};
use embedded_io::{ErrorType, Read, ReadReady, Write};

use crate::{
    args::PortArgs,
    bus::{Bus, Halt},
    clock,
    line::{Line, Wire},
    played,
    rover::Rover,
};

/// How reads and writes fail.
#[derive(Default)]
struct Faults {
    read: Option<ErrorKind>,
    write: Option<ErrorKind>,
}

/// A port that fails at times, which count from its start, milliseconds.
struct Flaky {
    wire: Rc<RefCell<dyn Wire>>,
    start: Clock,
    faults: fn(u128) -> Faults,
}

impl Flaky {
    fn faults(&self) -> Faults {
        (self.faults)(clock::since(self.start).as_millis())
    }
}

fn check(fault: Option<ErrorKind>) -> io::Result<()> {
    if fault == Some(ErrorKind::TimedOut) {
        clock::sleep(Duration::from_millis(20));
    }
    fault.map_or(Ok(()), |kind| Err(kind.into()))
}

impl ErrorType for Flaky {
    type Error = io::Error;
}

impl Wire for Flaky {
    fn wait(&mut self, patience: Duration) -> io::Result<bool> {
        self.wire.borrow_mut().wait(patience)
    }
}

impl ReadReady for Flaky {
    fn read_ready(&mut self) -> io::Result<bool> {
        self.wire.borrow_mut().read_ready()
    }
}

impl Read for Flaky {
    fn read(&mut self, bytes: &mut [u8]) -> io::Result<usize> {
        check(self.faults().read).and_then(|()| self.wire.borrow_mut().read(bytes))
    }
}

impl Write for Flaky {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        check(self.faults().write)?;
        // Without the time on the line, a bus that is read as fast as possible would stop the
        // clock.
        clock::sleep(Duration::from_micros(20 * bytes.len() as u64));
        self.wire.borrow_mut().write(bytes)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.wire.borrow_mut().flush()
    }
}

/// Half a second in which nothing works.
fn broken_at_first(millis: u128) -> Faults {
    let fault = (millis < 500).then_some(ErrorKind::Other);
    Faults { read: fault, write: fault }
}

/// A port with these faults, and this role at the other end.
fn flaky<E: Endpoint + 'static>(
    faults: fn(u128) -> Faults,
    role: impl FnOnce(Instant) -> E,
    mut react: impl FnMut(&mut E, Instant) + 'static,
) -> Line {
    clock::play();
    let start = clock::now();
    let now = move || Instant::from_micros(clock::since(start).as_micros() as u64);
    let mut role = role(now());
    let played = played::played((), move |(), bytes| {
        role.handle_input(bytes, now());
        role.handle_timeout(now());
        while role.poll_event().is_some() {}
        react(&mut role, now());
        let mut said = Vec::new();
        while let Some(frame) = role.poll_transmit(now()) {
            said.extend_from_slice(frame);
        }
        said
    });
    played.line.through(|wire| Flaky { wire, start, faults })
}

#[test]
fn a_port_that_fails_for_a_while_does_not_end_the_stop_of_a_bus() {
    let node = |_| MotorNode::new(NodeId::N1, Mode::Velocity);
    let line = flaky(broken_at_first, node, |_, _| {});
    let mut config = MasterConfig::usb_adapter();
    config.accepts_early = true;
    let mut bus: Bus = Bus::new(line, config);
    bus.stop(NodeId::N1.into()).unwrap();
    assert_eq!(bus.halt(NodeId::N1), Halt::Still);
}

#[test]
fn a_port_that_fails_for_a_while_does_not_end_the_stop_of_a_rover() {
    let robot = |now| Robot::new(RobotConfig::default(), now);
    let line = flaky(broken_at_first, robot, |robot, now| {
        robot.set_telemetry(&Telemetry::default(), now);
    });
    let mut rover = Rover::on(line, &PortArgs::new(None));
    rover.stop().unwrap();
    assert!(rover.host().is_stop_sent());
}

#[test]
fn a_stop_of_a_rover_is_not_over_while_the_last_one_sent_has_not_left() {
    // Enough stops leave and are heard first. Then the port fails, and later only takes
    // nothing, which may pass.
    let faults = |millis| {
        let write = match millis {
            700..1000 => Some(ErrorKind::Other),
            1000..1400 => Some(ErrorKind::TimedOut),
            _ => None,
        };
        Faults { write, ..Faults::default() }
    };
    let (begin, robot) = (clock::now(), |now| Robot::new(RobotConfig::default(), now));
    let line = flaky(faults, robot, |robot, now| {
        // It reports once the host has failed to repeat its stop, which it does each 100 ms.
        if now >= Instant::from_millis(850) {
            robot.set_telemetry(&Telemetry::default(), now);
        }
    });
    let mut rover = Rover::on(line, &PortArgs::new(None));
    rover.stop().unwrap();
    assert!(clock::since(begin) >= Duration::from_millis(1400), "{:?}", clock::since(begin));
    assert!(rover.host().is_stop_sent());
}
