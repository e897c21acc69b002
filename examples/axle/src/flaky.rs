//! Stops over a port that fails for a while and then recovers.

use std::{
    io::{self, ErrorKind, Read, Write},
    thread,
    time::{Duration, Instant as Clock},
};

use axlewire::{
    drive,
    endpoint::Endpoint,
    ikeya::{Mode, NodeId, master::MasterConfig},
    sim::MotorNode,
    time::Instant,
    ucp::{Robot, Telemetry, robot::RobotConfig},
};
use serialport::{
    ClearBuffer, DataBits, FlowControl, Parity, Result, SerialPort, StopBits, TTYPort,
};

use crate::{
    args::PortArgs,
    bus::{Bus, Halt},
    line::Line,
    quiet::undisturbed,
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
    port: TTYPort,
    start: Clock,
    faults: fn(u128) -> Faults,
}

impl Flaky {
    fn faults(&self) -> Faults {
        (self.faults)(self.start.elapsed().as_millis())
    }
}

fn check(fault: Option<ErrorKind>) -> io::Result<()> {
    fault.map_or(Ok(()), |kind| Err(kind.into()))
}

impl Read for Flaky {
    fn read(&mut self, bytes: &mut [u8]) -> io::Result<usize> {
        check(self.faults().read).and_then(|()| self.port.read(bytes))
    }
}

impl Write for Flaky {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        check(self.faults().write).and_then(|()| self.port.write(bytes))
    }

    fn flush(&mut self) -> io::Result<()> {
        self.port.flush()
    }
}

/// Forwards these calls unchanged.
macro_rules! hand_on {
    ($(fn $name:ident(&$($this:ident)+ $(, $arg:ident: $kind:ty)*) -> $result:ty;)+) => {
        $(fn $name(&$($this)+ $(, $arg: $kind)*) -> $result {
            hand_on!(@ $($this)+).port.$name($($arg),*)
        })+
    };
    (@ mut $this:ident) => { $this };
    (@ $this:ident) => { $this };
}

impl SerialPort for Flaky {
    hand_on! {
        fn name(&self) -> Option<String>;
        fn baud_rate(&self) -> Result<u32>;
        fn data_bits(&self) -> Result<DataBits>;
        fn flow_control(&self) -> Result<FlowControl>;
        fn parity(&self) -> Result<Parity>;
        fn stop_bits(&self) -> Result<StopBits>;
        fn timeout(&self) -> Duration;
        fn set_baud_rate(&mut self, baud: u32) -> Result<()>;
        fn set_data_bits(&mut self, bits: DataBits) -> Result<()>;
        fn set_flow_control(&mut self, control: FlowControl) -> Result<()>;
        fn set_parity(&mut self, parity: Parity) -> Result<()>;
        fn set_stop_bits(&mut self, bits: StopBits) -> Result<()>;
        fn set_timeout(&mut self, timeout: Duration) -> Result<()>;
        fn write_request_to_send(&mut self, level: bool) -> Result<()>;
        fn write_data_terminal_ready(&mut self, level: bool) -> Result<()>;
        fn read_clear_to_send(&mut self) -> Result<bool>;
        fn read_data_set_ready(&mut self) -> Result<bool>;
        fn read_ring_indicator(&mut self) -> Result<bool>;
        fn read_carrier_detect(&mut self) -> Result<bool>;
        fn bytes_to_read(&self) -> Result<u32>;
        fn bytes_to_write(&self) -> Result<u32>;
        fn clear(&self, buffer: ClearBuffer) -> Result<()>;
        fn try_clone(&self) -> Result<Box<dyn SerialPort>>;
        fn set_break(&self) -> Result<()>;
        fn clear_break(&self) -> Result<()>;
    }
}

/// Half a second in which nothing goes.
fn broken_at_first(millis: u128) -> Faults {
    let fault = (millis < 500).then_some(ErrorKind::Other);
    Faults { read: fault, write: fault }
}

/// A port with these faults, and this role at the other end.
fn flaky<E: Endpoint + Send + 'static>(
    faults: fn(u128) -> Faults,
    role: impl FnOnce(Instant) -> E,
    mut react: impl FnMut(&mut E, Instant) + Send + 'static,
) -> Line {
    let (mut theirs, ours) = TTYPort::pair().unwrap();
    let start = Clock::now();
    let flaky = Flaky { port: ours, start, faults };
    let now = move || Instant::from_micros(start.elapsed().as_micros() as u64);
    let mut role = role(now());
    theirs.set_timeout(Duration::from_millis(5)).unwrap();
    thread::spawn(move || {
        let mut buffer = [0; 256];
        while start.elapsed() < Duration::from_secs(10) {
            let len = theirs.read(&mut buffer).unwrap_or(0);
            role.handle_input(&buffer[..len], now());
            role.handle_timeout(now());
            while role.poll_event().is_some() {}
            react(&mut role, now());
            while let Some(frame) = role.poll_transmit(now()) {
                let _ = theirs.write_all(frame);
            }
        }
    });
    let port: Box<dyn SerialPort> = Box::new(flaky);
    Line::new("flaky", drive::SerialPort::from(port), true)
}

#[test]
fn a_port_that_fails_for_a_while_does_not_end_the_stop_of_a_bus() {
    undisturbed(|| {
        let node = |_| MotorNode::new(NodeId::N1, Mode::Velocity);
        let line = flaky(broken_at_first, node, |_, _| {});
        let mut config = MasterConfig::usb_adapter();
        config.accepts_early = true;
        let mut bus: Bus = Bus::new(line, config);
        bus.stop(NodeId::N1.into()).unwrap();
        assert_eq!(bus.halt(NodeId::N1), Halt::Still);
    });
}

#[test]
fn a_port_that_fails_for_a_while_does_not_end_the_stop_of_a_rover() {
    undisturbed(|| {
        let robot = |now| Robot::new(RobotConfig::default(), now);
        let line = flaky(broken_at_first, robot, |robot, now| {
            robot.set_telemetry(&Telemetry::default(), now);
        });
        let mut rover = Rover::on(line, &PortArgs::new(None));
        rover.stop().unwrap();
        assert!(rover.host().is_stop_sent());
    });
}

#[test]
fn a_stop_of_a_rover_is_not_over_while_the_last_one_sent_has_not_left() {
    undisturbed(|| {
        // Enough stops leave and are heard before. Then the port fails, and later only takes
        // nothing, which may pass.
        let faults = |millis| {
            let write = match millis {
                700..1000 => Some(ErrorKind::Other),
                1000..1400 => Some(ErrorKind::TimedOut),
                _ => None,
            };
            Faults { write, ..Faults::default() }
        };
        let (begin, robot) = (Clock::now(), |now| Robot::new(RobotConfig::default(), now));
        let line = flaky(faults, robot, |robot, now| {
            // It reports once the host has failed to repeat its stop, which it does each 100 ms.
            if now >= Instant::from_millis(850) {
                robot.set_telemetry(&Telemetry::default(), now);
            }
        });
        let mut rover = Rover::on(line, &PortArgs::new(None));
        rover.stop().unwrap();
        assert!(begin.elapsed() >= Duration::from_millis(1400), "{:?}", begin.elapsed());
        assert!(rover.host().is_stop_sent());
    });
}
