//! `drive::TokioSerialPort` on a pseudo-terminal.

use std::{
    future::Future,
    io::{ErrorKind, Read, Write},
    pin::pin,
    task::{Context, Poll, Waker},
    thread,
    time::Duration,
};

use axlewire::{
    drive::{Clock, DriveError, TokioClock, TokioSerialPort, asynch::Driver},
    ikeya::{BAUD, Mode, NodeId, Rps, master::MasterConfig},
    time,
};
use embedded_hal_async::delay::DelayNs;
use embedded_io_async::{Read as _, Write as _};
use serialport::{SerialPort as _, TTYPort};

use crate::motor::{Motor, in_time, patient, wait_until};

/// Runs a future in a runtime of one thread, until the end of all patience.
fn run<F: Future<Output: Send + 'static>>(
    future: impl FnOnce() -> F + Send + 'static,
) -> F::Output {
    in_time(|| {
        let runtime = tokio::runtime::Builder::new_current_thread().enable_all().build().unwrap();
        runtime.block_on(async { future().await })
    })
}

/// A port, and the other end of its line. The third value keeps the line when the port is closed.
fn line() -> (TokioSerialPort, TTYPort, TTYPort) {
    let (far, held) = TTYPort::pair().unwrap();
    (TokioSerialPort::open(&held.name().unwrap(), BAUD).unwrap(), far, held)
}

/// What a future gives when it is polled once, and then dropped.
fn once<T>(future: impl Future<Output = T>) -> Option<T> {
    match pin!(future).poll(&mut Context::from_waker(Waker::noop())) {
        Poll::Ready(found) => Some(found),
        Poll::Pending => None,
    }
}

#[test]
fn a_master_turns_a_motor_and_stops_it() {
    let motor = Motor::new();
    let path = motor.path.clone();
    let turned = run(move || async move {
        let port = TokioSerialPort::open(&path, BAUD).unwrap();
        assert!(port.is_pseudo_terminal());
        let mut bus = Driver::master(patient(), port, TokioClock::new());
        assert_eq!(bus.discover().await?[..], [(NodeId::N1, Mode::Velocity)]);
        let speed = Rps::new(2.0).unwrap();
        bus.drive_for(NodeId::N1, speed, time::Duration::from_millis(100)).await?;
        bus.stop_all().await
    });
    turned.unwrap();
    assert_eq!(motor.speeds(), [2.0, 0.0]);
}

#[test]
fn bytes_from_before_the_opening_are_gone() {
    run(|| async {
        let (mut far, held) = TTYPort::pair().unwrap();
        far.write_all(b"old").unwrap();
        wait_until(|| held.bytes_to_read().unwrap() == 3);
        let mut port = TokioSerialPort::open(&held.name().unwrap(), BAUD).unwrap();
        far.write_all(b"new").unwrap();
        let mut buffer = [0; 64];
        let count = port.read(&mut buffer).await.unwrap();
        assert_eq!(&buffer[..count], b"new");
    });
}

#[test]
fn a_read_that_is_dropped_has_moved_no_bytes() {
    run(|| async {
        let (mut port, mut far, held) = line();
        let mut buffer = [0; 64];
        assert!(once(port.read(&mut buffer)).is_none());
        {
            let mut reading = pin!(port.read(&mut buffer));
            let mut context = Context::from_waker(Waker::noop());
            assert!(reading.as_mut().poll(&mut context).is_pending());
            far.write_all(b"abc").unwrap();
            wait_until(|| held.bytes_to_read().unwrap() == 3);
            // The runtime learns of the bytes, but the read is not polled again.
            tokio::time::sleep(Duration::from_millis(5)).await;
        }
        assert_eq!(port.read(&mut buffer).await.unwrap(), 3);
        assert_eq!(&buffer[..3], b"abc");
    });
}

#[test]
fn bytes_that_come_while_the_runtime_is_busy_are_found_by_the_first_look() {
    run(|| async {
        let (mut port, mut far, held) = line();
        let mut buffer = [0; 64];
        assert!(once(port.read(&mut buffer)).is_none());
        for round in 0..10 {
            far.write_all(&[round]).unwrap();
            // Without an await, the runtime hears of nothing.
            wait_until(|| held.bytes_to_read().unwrap() == 1);
            assert_eq!(once(port.read(&mut buffer)).expect("it is there").unwrap(), 1);
            assert_eq!(buffer[0], round);
            assert!(once(port.read(&mut buffer)).is_none());
        }
    });
}

#[test]
fn a_write_to_a_full_port_takes_what_fits_and_moves_nothing_when_it_is_dropped() {
    run(|| async {
        let (mut port, mut far, _held) = line();
        let mut written: Vec<u8> = vec![];
        loop {
            // No size of a frame fills the buffer exactly.
            let frame: Vec<u8> = (0..61).map(|at| (written.len() + at) as u8).collect();
            let patience = Duration::from_millis(200);
            match tokio::time::timeout(patience, port.write(&frame)).await {
                Ok(count) => written.extend(&frame[..count.unwrap()]),
                Err(_) => break,
            }
        }
        assert!(written.len() > 61);
        for _ in 0..3 {
            assert!(once(port.write(b"dropped")).is_none());
        }
        far.set_timeout(Duration::from_secs(20)).unwrap();
        let mut received = vec![0; written.len()];
        far.read_exact(&mut received).unwrap();
        assert_eq!(received, written);
        // And it goes on.
        assert_eq!(port.write(b"more").await.unwrap(), 4);
        port.flush().await.unwrap();
        let mut more = [0; 4];
        far.read_exact(&mut more).unwrap();
        assert_eq!(&more, b"more");
        assert_eq!(port.write(b"").await.unwrap(), 0);
    });
}

#[test]
fn every_call_of_a_port_that_was_unplugged_fails_or_is_at_its_end() {
    run(|| async {
        let (mut port, far, _held) = line();
        drop(far);
        assert_eq!(port.read(&mut [0; 8]).await.map_err(|error| error.kind()).unwrap_or(0), 0);
        for error in [port.write(b"1").await.unwrap_err(), port.flush().await.unwrap_err()] {
            assert!(error.to_string().starts_with("disconnected"), "{error}");
        }
    });
}

#[test]
fn a_driver_whose_port_is_unplugged_says_so_and_does_not_wait() {
    let error = run(|| async {
        let (port, far, _held) = line();
        let config = MasterConfig::usb_adapter();
        let mut bus = Driver::master(config, port, TokioClock::new());
        let an_hour = time::Duration::from_secs(3600);
        thread::spawn(move || {
            thread::sleep(Duration::from_millis(100));
            drop(far);
        });
        loop {
            if let Err(error) = bus.next_event(an_hour).await {
                return error;
            }
        }
    });
    assert!(matches!(error, DriveError::Port(_) | DriveError::Closed), "{error}");
}

#[test]
fn a_path_without_a_port_is_named_with_the_reason() {
    run(|| async {
        let error = TokioSerialPort::open("/dev/no-such-port", BAUD).unwrap_err();
        assert_eq!(error.kind(), ErrorKind::NotFound);
        assert_eq!(error.to_string(), r#"cannot use port "/dev/no-such-port": no such path"#);
        let (_port, _far, held) = line();
        let error = TokioSerialPort::open(&held.name().unwrap(), BAUD).unwrap_err();
        assert_eq!(error.kind(), ErrorKind::ResourceBusy);
    });
}

#[test]
fn the_port_of_tokio_serial_is_lent_and_given_back() {
    run(|| async {
        let (mut port, _far, held) = line();
        let name = held.name();
        assert!(name.is_some());
        assert_eq!(port.get_mut().name(), name);
        assert_eq!(port.into_inner().name(), name);
    });
}

#[test]
fn outside_a_runtime_there_is_no_port() {
    let (_far, held) = TTYPort::pair().unwrap();
    let error = TokioSerialPort::open(&held.name().unwrap(), BAUD).unwrap_err();
    assert_eq!(error.kind(), ErrorKind::Other);
}

#[test]
fn the_clock_passes_at_least_the_time_of_its_delay() {
    run(|| async {
        let mut clock = TokioClock::default();
        let before = clock.now();
        clock.delay_us(30_000).await;
        assert!(clock.now() - before >= time::Duration::from_millis(30));
    });
}
