//! Driver enable of a port alone: on before the first byte, off after the last, off on every error.

use std::error::Error;

use embedded_io::Error as _;

use crate::{
    pin::{Delay, Pinned, Stuck, delayed, flush, logged, write},
    rig::*,
};

#[test]
fn the_pin_is_on_from_before_the_first_byte_until_after_the_flush() {
    for is_async in BOTH {
        let (mut port, log, _) = undelayed(Port::default());
        assert_eq!(drain(&log), "off");
        assert_eq!(write(&mut port, is_async, b"12"), Ok(2));
        assert!(port.is_on());
        assert_eq!(write(&mut port, is_async, b"34"), Ok(2));
        assert_eq!(flush(&mut port, is_async), Ok(()));
        assert!(!port.is_on());
        assert_eq!(drain(&log), "on write write flush off");
        // Without bytes, the pin does not change.
        assert_eq!(flush(&mut port, is_async), Ok(()));
        assert_eq!(write(&mut port, is_async, b""), Ok(0));
        assert_eq!(drain(&log), "flush");
    }
}

#[test]
fn the_delays_are_between_pin_and_bytes() {
    for is_async in BOTH {
        let (mut port, log) = delayed(Port::default(), 0);
        assert_eq!(write(&mut port, is_async, b"12"), Ok(2));
        assert_eq!(write(&mut port, is_async, b"34"), Ok(2));
        assert_eq!(flush(&mut port, is_async), Ok(()));
        assert_eq!(drain(&log), "off on 5000 ns write write flush 7000 ns off");
    }
}

#[test]
fn the_pin_is_off_after_every_error_of_the_port() {
    for is_async in BOTH {
        let failing = [Step::Error, Step::Few(1), Step::Error, Step::Zero];
        let (mut port, log, _) = undelayed(Port::writing(failing));
        drain(&log);
        assert_eq!(write(&mut port, is_async, b"12"), Err(Rs485Error::Port(Unplugged)));
        assert_eq!(drain(&log), "on write flush off");
        assert_eq!(write(&mut port, is_async, b"12"), Ok(1));
        assert_eq!(write(&mut port, is_async, b"2"), Err(Rs485Error::Port(Unplugged)));
        assert_eq!(drain(&log), "on write write flush off");
        assert_eq!(write(&mut port, is_async, b"2"), Ok(0));
        assert_eq!(drain(&log), "on write flush off");
        port.port_mut().flushes.push_back(Step::Error);
        assert_eq!(write(&mut port, is_async, b"2"), Ok(1));
        assert_eq!(flush(&mut port, is_async), Err(Rs485Error::Port(Unplugged)));
        assert_eq!(drain(&log), "on write flush off");
        assert!(!port.is_on());
    }
}

#[test]
fn bytes_taken_before_a_failed_write_leave_before_the_pin_goes_off_or_are_reported_as_lost() {
    for (is_async, refusal) in
        [false, true].into_iter().flat_map(|it| [(it, Step::Error), (it, Step::Zero)])
    {
        let steps = || [Step::Few(1), refusal.clone()];
        let (mut port, log, _) = undelayed(Port::writing(steps()));
        let refused = |written| match refusal {
            Step::Zero => assert_eq!(written, Ok(0)),
            _ => assert_eq!(written, Err(Rs485Error::Port(Unplugged))),
        };
        drain(&log);
        assert_eq!(write(&mut port, is_async, b"12"), Ok(1));
        refused(write(&mut port, is_async, b"2"));
        assert_eq!(drain(&log), "on write write flush off");
        assert_eq!(flush(&mut port, is_async), Ok(()));
        drain(&log);

        port.port_mut().writes.extend(steps());
        port.port_mut().flushes.push_back(Step::Error);
        assert_eq!(write(&mut port, is_async, b"12"), Ok(1));
        refused(write(&mut port, is_async, b"2"));
        assert_eq!(drain(&log), "on write write flush off");
        assert_eq!(flush(&mut port, is_async), Err(Rs485Error::Lost), "bytes may be lost");
        assert_eq!(flush(&mut port, is_async), Ok(()), "reported once");

        // Or by the following flush, if that one fails.
        port.port_mut().writes.extend(steps());
        port.port_mut().flushes.extend([Step::Error, Step::Error]);
        assert_eq!(write(&mut port, is_async, b"12"), Ok(1));
        refused(write(&mut port, is_async, b"2"));
        assert_eq!(flush(&mut port, is_async), Err(Rs485Error::Port(Unplugged)));
        assert_eq!(flush(&mut port, is_async), Ok(()));
    }
}

#[test]
fn a_second_write_that_fails_does_not_forget_that_bytes_were_lost() {
    for is_async in BOTH {
        let (mut port, ..) = undelayed(Port::writing([Step::Few(1), Step::Error, Step::Error]));
        port.port_mut().flushes.push_back(Step::Error);
        assert_eq!(write(&mut port, is_async, b"12"), Ok(1));
        for _ in 0..2 {
            assert_eq!(write(&mut port, is_async, b"2"), Err(Rs485Error::Port(Unplugged)));
        }
        assert_eq!(flush(&mut port, is_async), Err(Rs485Error::Lost));
    }
}

#[test]
fn the_pin_stays_on_for_its_time_behind_a_write_that_failed() {
    for is_async in BOTH {
        let steps = [Step::Few(1), Step::Error];
        let (mut port, log) = delayed(Port::writing(steps), 0);
        drain(&log);
        assert_eq!(write(&mut port, is_async, b"12"), Ok(1));
        assert_eq!(write(&mut port, is_async, b"2"), Err(Rs485Error::Port(Unplugged)));
        assert_eq!(drain(&log), "on 5000 ns write write flush 7000 ns off");
    }
}

#[test]
fn a_failing_pin_sends_nothing_and_is_retried() {
    for is_async in BOTH {
        let (mut port, log, pin) = undelayed(Port::default());
        drain(&log);
        pin.failures.set(1);
        assert_eq!(write(&mut port, is_async, b"12"), Err(Rs485Error::Pin(Stuck)));
        assert_eq!(drain(&log), "on! off");
        assert_eq!(write(&mut port, is_async, b"12"), Ok(2));
        pin.failures.set(1);
        assert_eq!(flush(&mut port, is_async), Err(Rs485Error::Pin(Stuck)));
        assert!(port.is_on());
        assert_eq!(flush(&mut port, is_async), Ok(()));
        assert_eq!(drain(&log), "on write flush off! flush off");
    }
    let pin = Pin::default();
    pin.failures.set(1);
    let port = logged(Port::default(), &pin.log);
    assert!(matches!(Rs485::new(port, pin), Err(Stuck)));
}

#[test]
fn a_cancelled_write_keeps_the_pin_on_until_it_is_finished_or_dropped() {
    let stalled =
        Port { flushes: [Step::Stall].into(), ..Port::writing([Step::Few(1), Step::Stall]) };
    let (mut port, log) = delayed(stalled, 1);
    let cancelled = |port: &mut Pinned<Delay>, bytes: &[u8]| {
        assert!(poll(std::pin::pin!(embedded_io_async::Write::write(port, bytes))).is_pending());
    };
    cancelled(&mut port, b"12"); // in the delay before the write, which is then repeated
    assert_eq!(write(&mut port, true, b"12"), Ok(1));
    assert_eq!(drain(&log), "off on 5000 ns on 5000 ns write");
    cancelled(&mut port, b"2");
    assert!(port.is_on());
    assert_eq!(write(&mut port, true, b"2"), Ok(1));
    assert!(poll(std::pin::pin!(embedded_io_async::Write::flush(&mut port))).is_pending());
    assert!(port.is_on());
    assert_eq!(drain(&log), "write write flush");
    assert_eq!(port.release(), Ok(()));
    assert_eq!((drain(&log).as_str(), port.is_on()), ("off", false));
}

#[test]
fn reading_does_not_touch_the_pin() {
    let steps = [Step::Bytes(b"in".into()), Step::Bytes(b"in".into()), Step::Error];
    let (mut port, log, _) = undelayed(Port::reading(steps));
    drain(&log);
    let mut buffer = [0; 8];
    assert_eq!(embedded_io::ReadReady::read_ready(&mut port), Ok(true));
    assert_eq!(embedded_io::Read::read(&mut port, &mut buffer), Ok(2));
    assert_eq!(ready(embedded_io_async::Read::read(&mut port, &mut buffer)), Ok(2));
    let failed = embedded_io::Read::read(&mut port, &mut buffer);
    assert_eq!(failed, Err(Rs485Error::Port(Unplugged)));
    assert_eq!(drain(&log), "");
}

#[test]
fn an_empty_write_switches_the_pin_off() {
    for is_async in BOTH {
        let (mut port, log, pin) = undelayed(Port::default());
        assert_eq!(write(&mut port, is_async, b""), Ok(0));
        assert_eq!(drain(&log), "off", "from the start");
        assert_eq!(write(&mut port, is_async, b"12"), Ok(2));
        pin.failures.set(1);
        assert_eq!(write(&mut port, is_async, b""), Err(Rs485Error::Pin(Stuck)));
        assert!(port.is_on());
        assert_eq!(write(&mut port, is_async, b""), Ok(0));
        assert_eq!(drain(&log), "on write off! off");
        assert!(!port.is_on());
    }
}

#[test]
fn the_error_distinguishes_port_and_pin() {
    let (port, pin) = (Rs485Error::Port(Unplugged), Rs485Error::Pin(Stuck));
    let (port, pin): (Rs485Error<Unplugged, Stuck>, Rs485Error<Unplugged, Stuck>) = (port, pin);
    assert_eq!(port.to_string(), "unplugged");
    assert!(port.source().is_none(), "of `Unplugged`");
    assert_eq!(port.kind(), embedded_io::ErrorKind::NotConnected);
    assert_eq!(pin.to_string(), "driver-enable pin failed: Stuck");
    assert!(pin.source().is_none());
    assert_eq!(pin.kind(), embedded_io::ErrorKind::Other);
    let lost = Rs485Error::<Unplugged, Stuck>::Lost;
    let text = "bytes may have been lost: the port failed while sending them";
    assert_eq!((lost.to_string().as_str(), lost.source().is_none()), (text, true));
    assert_eq!(lost.kind(), embedded_io::ErrorKind::Other);
}

#[test]
fn a_pin_that_failed_to_go_off_is_switched_on_again_before_the_next_byte() {
    for is_async in BOTH {
        let (mut port, log, pin) = undelayed(Port::default());
        assert_eq!(write(&mut port, is_async, b"12"), Ok(2));
        pin.failures.set(1);
        assert_eq!(flush(&mut port, is_async), Err(Rs485Error::Pin(Stuck)));
        drain(&log);
        // It may be off all the same.
        assert_eq!(write(&mut port, is_async, b"12"), Ok(2));
        assert_eq!(drain(&log), "on write");
    }
}
