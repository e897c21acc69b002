//! `drive::SerialPort` on a pseudo-terminal.

use std::{
    io::{self, ErrorKind, Read, Write},
    thread,
    time::Duration,
};

#[cfg(feature = "ucp")]
use axlewire::{
    drive::Rover,
    stream::Frames,
    ucp::{self, Message, Ucp},
};
use axlewire::{
    drive::{Bus, DriveError, Driver, SerialPort, StdClock},
    ikeya::{BAUD, Mode, NodeId, Rps, master::MasterConfig},
    time,
};
use embedded_io::{Read as _, ReadReady, Write as _};
use serialport::{SerialPort as _, TTYPort};

use crate::motor::{Motor, in_time, patient, wait_until};

/// A port, and the other end of its line. The third value keeps the line when the port is closed.
fn line() -> (SerialPort, TTYPort, TTYPort) {
    let (far, held) = TTYPort::pair().unwrap();
    (SerialPort::open(&held.name().unwrap(), BAUD).unwrap(), far, held)
}

#[test]
fn a_master_turns_a_motor_and_stops_it() {
    let motor = Motor::new();
    let port = SerialPort::open(&motor.path, BAUD).unwrap();
    assert!(port.is_pseudo_terminal());
    let turned = in_time(move || {
        let mut bus = Driver::master(patient(), port, StdClock::new());
        assert_eq!(bus.discover()?[..], [(NodeId::N1, Mode::Velocity)]);
        let speed = Rps::new(2.0).unwrap();
        bus.drive_for(NodeId::N1, speed, time::Duration::from_millis(100))?;
        bus.stop_all()
    });
    turned.unwrap();
    assert_eq!(motor.speeds(), [2.0, 0.0]);
}

#[test]
fn a_bus_that_is_dropped_stops_the_motor_that_it_turned() {
    let motor = Motor::new();
    let path = motor.path.clone();
    in_time(move || {
        let mut bus = Bus::open_with(&path, patient()).unwrap();
        bus.discover().unwrap();
        bus.set_velocity(NodeId::N1, Rps::new(2.0).unwrap()).unwrap();
    });
    wait_until(|| motor.speeds().len() == 2);
    assert_eq!(motor.speeds(), [2.0, 0.0]);
}

#[cfg(feature = "ucp")]
#[test]
fn a_rover_that_is_dropped_sends_the_stop_that_it_owes() {
    let (mut far, held) = TTYPort::pair().unwrap();
    let path = held.name().unwrap();
    in_time(move || Rover::open(&path).unwrap().drive(30, 0).unwrap());
    far.set_timeout(Duration::from_millis(5)).unwrap();
    let (mut bytes, mut buffer) = (vec![], [0; 256]);
    while let Ok(count @ 1..) = far.read(&mut buffer) {
        bytes.extend_from_slice(&buffer[..count]);
    }
    let speed = |frame: &ucp::Frame| match frame.message() {
        Message::MotorControl(command) => Some(command.speed()),
        _ => None,
    };
    let mut speeds: Vec<_> = Frames::<Ucp>::new(&bytes).filter_map(speed).collect();
    speeds.dedup();
    assert_eq!(speeds, [0, 30, 0]);
}

#[test]
fn bytes_from_before_the_opening_are_gone() {
    let (mut far, held) = TTYPort::pair().unwrap();
    far.write_all(b"old").unwrap();
    wait_until(|| held.bytes_to_read().unwrap() == 3);
    let mut port = SerialPort::open(&held.name().unwrap(), BAUD).unwrap();
    assert!(!port.read_ready().unwrap());
    far.write_all(b"new").unwrap();
    let mut buffer = [0; 64];
    let count = port.read(&mut buffer).unwrap();
    assert_eq!(&buffer[..count], b"new");
}

#[test]
fn no_second_program_can_open_a_port() {
    let (port, _far, held) = line();
    let path = held.name().unwrap();
    let error = SerialPort::open(&path, BAUD).unwrap_err();
    assert_eq!(error.kind(), ErrorKind::ResourceBusy);
    assert_eq!(error.to_string(), format!("cannot use port {path:?}: another program is using it"));
    drop(port);
    SerialPort::open(&path, BAUD).unwrap();
}

#[test]
fn a_path_without_a_port_is_named_with_the_reason() {
    let reason = |path: &str| {
        let error = SerialPort::open(path, BAUD).unwrap_err();
        let text = error.to_string();
        let cause = text.strip_prefix(&format!("cannot use port {path:?}: ")).unwrap();
        (error.kind(), cause.to_owned())
    };
    assert_eq!(reason("/dev/no-such-port"), (ErrorKind::NotFound, "no such path".to_owned()));
    let file = concat!(env!("CARGO_MANIFEST_DIR"), "/Cargo.toml");
    for path in [file, env!("CARGO_MANIFEST_DIR"), "/dev/null"] {
        assert_eq!(reason(path), (ErrorKind::InvalidInput, "not a serial port".to_owned()));
    }
}

#[test]
fn every_call_of_a_port_that_was_unplugged_fails() {
    let (mut port, far, _held) = line();
    assert!(!port.read_ready().unwrap());
    drop(far);
    in_time(move || {
        let mut buffer = [0; 8];
        let errors: [io::Error; 4] = [
            port.read_ready().unwrap_err(),
            port.read(&mut buffer).unwrap_err(),
            port.write(b"1").unwrap_err(),
            port.flush().unwrap_err(),
        ];
        for error in errors {
            assert!(error.to_string().starts_with("disconnected"), "{error}");
        }
    });
}

#[test]
fn the_other_end_of_a_pseudo_terminal_notices_that_it_is_alone() {
    let (far, held) = TTYPort::pair().unwrap();
    let mut far = SerialPort::from(Box::new(far) as Box<dyn serialport::SerialPort>);
    assert!(!far.read_ready().unwrap());
    drop(held);
    assert!(far.read_ready().is_err());
}

#[test]
fn a_read_that_waits_ends_when_the_port_is_unplugged() {
    let (mut port, far, _held) = line();
    let reading = thread::spawn(move || port.read(&mut [0; 8]).map_err(|error| error.kind()));
    thread::sleep(Duration::from_millis(100));
    drop(far);
    assert!(in_time(|| reading.join().unwrap()).is_err());
}

#[test]
fn a_driver_whose_port_is_unplugged_says_so_and_does_not_wait() {
    let (port, far, _held) = line();
    let error = in_time(move || {
        let mut bus = Driver::master(MasterConfig::usb_adapter(), port, StdClock::new());
        let an_hour = time::Duration::from_secs(3600);
        let unplugging = thread::spawn(move || {
            thread::sleep(Duration::from_millis(100));
            drop(far);
        });
        loop {
            match bus.next_event(an_hour) {
                Ok(_) => {}
                Err(error) => {
                    unplugging.join().unwrap();
                    return error;
                }
            }
        }
    });
    assert!(matches!(error, DriveError::Port(_)), "{error}");
    assert!(error.to_string().starts_with("port failed: disconnected ("), "{error}");
}

#[test]
fn a_write_to_a_full_port_takes_what_fits_then_fails_and_loses_nothing() {
    let (mut port, mut far, _held) = line();
    let (mut port, written) = in_time(move || {
        let mut written: Vec<u8> = vec![];
        let error = loop {
            // No size of a frame fills the buffer exactly.
            let frame: Vec<u8> = (0..61).map(|at| (written.len() + at) as u8).collect();
            match port.write(&frame) {
                Ok(count) => written.extend(&frame[..count]),
                Err(error) => break error,
            }
        };
        assert_eq!(error.kind(), ErrorKind::TimedOut);
        (port, written)
    });
    assert!(written.len() > 61);
    far.set_timeout(Duration::from_secs(20)).unwrap();
    let mut received = vec![0; written.len()];
    far.read_exact(&mut received).unwrap();
    assert_eq!(received, written);
    // And it goes on.
    assert_eq!(in_time(move || port.write(b"more").unwrap()), 4);
    let mut more = [0; 4];
    far.read_exact(&mut more).unwrap();
    assert_eq!(&more, b"more");
}

#[test]
fn a_long_write_does_not_wait_until_all_of_it_has_left() {
    let (mut port, _far, _held) = line();
    let count = in_time(move || port.write(&[0; 100_000]).unwrap());
    assert!((1..=256).contains(&count), "{count}");
}
