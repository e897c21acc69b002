//! Driver enable: on before the first byte, off after the last, off on every error.

use std::{cell::Cell, error::Error, rc::Rc, task::Poll};

use axlewire::{
    drive::{Directed, DirectedError, DriveError, Driver},
    time::Duration,
};
use embedded_io::Error as _;

use crate::{
    port::{Script, Step, Unplugged, poll},
    recorder::{Log, Recorder},
    virtual_time::{VirtualClock, World},
};

/// A part that writes down what it does.
struct Logged<T> {
    inner: T,
    log: Log,
}

#[derive(Clone, Default)]
struct Pin {
    log: Log,
    /// The next so many calls fail.
    failures: Rc<Cell<usize>>,
}

#[derive(Clone, Copy, Debug, Eq, PartialEq)]
struct Stuck;

impl embedded_hal::digital::Error for Stuck {
    fn kind(&self) -> embedded_hal::digital::ErrorKind {
        embedded_hal::digital::ErrorKind::Other
    }
}

impl embedded_hal::digital::ErrorType for Pin {
    type Error = Stuck;
}

impl Pin {
    fn set(&self, to: &str) -> Result<(), Stuck> {
        if self.failures.get() > 0 {
            self.failures.set(self.failures.get() - 1);
            self.log.borrow_mut().push(format!("{to}!"));
            return Err(Stuck);
        }
        self.log.borrow_mut().push(to.into());
        Ok(())
    }
}

impl embedded_hal::digital::OutputPin for Pin {
    fn set_low(&mut self) -> Result<(), Stuck> {
        self.set("off")
    }

    fn set_high(&mut self) -> Result<(), Stuck> {
        self.set("on")
    }
}

impl embedded_io::ErrorType for Logged<Script> {
    type Error = Unplugged;
}

impl embedded_io::ReadReady for Logged<Script> {
    fn read_ready(&mut self) -> Result<bool, Unplugged> {
        self.inner.read_ready()
    }
}

impl embedded_io::Read for Logged<Script> {
    fn read(&mut self, buffer: &mut [u8]) -> Result<usize, Unplugged> {
        embedded_io::Read::read(&mut self.inner, buffer)
    }
}

impl embedded_io::Write for Logged<Script> {
    fn write(&mut self, buffer: &[u8]) -> Result<usize, Unplugged> {
        self.log.borrow_mut().push("write".into());
        embedded_io::Write::write(&mut self.inner, buffer)
    }

    fn flush(&mut self) -> Result<(), Unplugged> {
        self.log.borrow_mut().push("flush".into());
        embedded_io::Write::flush(&mut self.inner)
    }
}

impl embedded_io_async::Read for Logged<Script> {
    async fn read(&mut self, buffer: &mut [u8]) -> Result<usize, Unplugged> {
        embedded_io_async::Read::read(&mut self.inner, buffer).await
    }
}

impl embedded_io_async::Write for Logged<Script> {
    async fn write(&mut self, buffer: &[u8]) -> Result<usize, Unplugged> {
        self.log.borrow_mut().push("write".into());
        embedded_io_async::Write::write(&mut self.inner, buffer).await
    }

    async fn flush(&mut self) -> Result<(), Unplugged> {
        self.log.borrow_mut().push("flush".into());
        embedded_io_async::Write::flush(&mut self.inner).await
    }
}

struct Delay {
    log: Log,
    /// Async delays stay for ever, so many times.
    stalls: usize,
}

impl embedded_hal::delay::DelayNs for Delay {
    fn delay_ns(&mut self, ns: u32) {
        self.log.borrow_mut().push(format!("{ns} ns"));
    }
}

impl embedded_hal_async::delay::DelayNs for Delay {
    async fn delay_ns(&mut self, ns: u32) {
        self.log.borrow_mut().push(format!("{ns} ns"));
        if self.stalls > 0 {
            self.stalls -= 1;
            std::future::pending::<()>().await;
        }
    }
}

type Port<D> = Directed<Logged<Script>, Pin, D>;

fn undelayed(script: Script) -> (Port<axlewire::drive::NoDelay>, Log, Pin) {
    let pin = Pin::default();
    let log = pin.log.clone();
    let port = Logged { inner: script, log: log.clone() };
    (Directed::new(port, pin.clone()).unwrap(), log, pin)
}

fn delayed(script: Script, stalls: usize) -> (Port<Delay>, Log) {
    let pin = Pin::default();
    let log = pin.log.clone();
    let port = Logged { inner: script, log: log.clone() };
    let delay = Delay { log: log.clone(), stalls };
    let (before, after) = (Duration::from_micros(5), Duration::from_micros(7));
    (Directed::with_delays(port, pin, delay, before, after).unwrap(), log)
}

fn drain(log: &Log) -> String {
    let entries = std::mem::take(&mut *log.borrow_mut());
    entries.join(" ")
}

/// An async call that is ready at once, or has yielded because it fails.
fn ready<T>(future: impl Future<Output = T>) -> T {
    let mut future = std::pin::pin!(future);
    for _ in 0..2 {
        if let Poll::Ready(output) = poll(future.as_mut()) {
            return output;
        }
    }
    panic!("not ready")
}

/// A write and a flush, blocking and async.
fn write<D>(
    port: &mut Port<D>,
    is_async: bool,
    bytes: &[u8],
) -> Result<usize, DirectedError<Unplugged, Stuck>>
where
    D: embedded_hal::delay::DelayNs + embedded_hal_async::delay::DelayNs,
{
    if is_async {
        ready(embedded_io_async::Write::write(port, bytes))
    } else {
        embedded_io::Write::write(port, bytes)
    }
}

fn flush<D>(port: &mut Port<D>, is_async: bool) -> Result<(), DirectedError<Unplugged, Stuck>>
where
    D: embedded_hal::delay::DelayNs + embedded_hal_async::delay::DelayNs,
{
    if is_async {
        ready(embedded_io_async::Write::flush(port))
    } else {
        embedded_io::Write::flush(port)
    }
}

#[test]
fn the_pin_is_on_from_before_the_first_byte_until_after_the_flush() {
    for is_async in [false, true] {
        let (mut port, log, _) = undelayed(Script::default());
        assert_eq!(drain(&log), "off");
        assert_eq!(write(&mut port, is_async, b"12"), Ok(2));
        assert!(port.is_on());
        assert_eq!(write(&mut port, is_async, b"34"), Ok(2));
        assert_eq!(flush(&mut port, is_async), Ok(()));
        assert!(!port.is_on());
        assert_eq!(drain(&log), "on write write flush off");
        // Without bytes nothing is switched.
        assert_eq!(flush(&mut port, is_async), Ok(()));
        assert_eq!(write(&mut port, is_async, b""), Ok(0));
        assert_eq!(drain(&log), "flush");
    }
}

#[test]
fn the_delays_stand_between_pin_and_bytes() {
    for is_async in [false, true] {
        let (mut port, log) = delayed(Script::default(), 0);
        assert_eq!(write(&mut port, is_async, b"12"), Ok(2));
        assert_eq!(write(&mut port, is_async, b"34"), Ok(2));
        assert_eq!(flush(&mut port, is_async), Ok(()));
        assert_eq!(drain(&log), "off on 5000 ns write write flush 7000 ns off");
    }
}

#[test]
fn the_pin_is_off_after_every_error_of_the_port() {
    for is_async in [false, true] {
        let failing = [Step::Error, Step::Bytes(vec![0]), Step::Error, Step::Zero];
        let (mut port, log, _) = undelayed(Script::writing(failing));
        drain(&log);
        assert_eq!(write(&mut port, is_async, b"12"), Err(DirectedError::Port(Unplugged)));
        assert_eq!(drain(&log), "on write flush off");
        assert_eq!(write(&mut port, is_async, b"12"), Ok(1));
        assert_eq!(write(&mut port, is_async, b"2"), Err(DirectedError::Port(Unplugged)));
        assert_eq!(drain(&log), "on write write flush off");
        assert_eq!(write(&mut port, is_async, b"2"), Ok(0));
        assert_eq!(drain(&log), "on write flush off");
        port.port_mut().inner.flushes.push_back(Step::Error);
        assert_eq!(write(&mut port, is_async, b"2"), Ok(1));
        assert_eq!(flush(&mut port, is_async), Err(DirectedError::Port(Unplugged)));
        assert_eq!(drain(&log), "on write flush off");
        assert!(!port.is_on());
    }
}

#[test]
fn what_a_port_has_taken_before_a_write_fails_is_out_before_the_pin_goes_off_or_told_to_be_lost() {
    for (is_async, refusal) in
        [false, true].into_iter().flat_map(|it| [(it, Step::Error), (it, Step::Zero)])
    {
        let steps = || [Step::Bytes(vec![0]), refusal.clone()];
        let (mut port, log, _) = undelayed(Script::writing(steps()));
        let refused = |written| match refusal {
            Step::Zero => assert_eq!(written, Ok(0)),
            _ => assert_eq!(written, Err(DirectedError::Port(Unplugged))),
        };
        drain(&log);
        assert_eq!(write(&mut port, is_async, b"12"), Ok(1));
        refused(write(&mut port, is_async, b"2"));
        assert_eq!(drain(&log), "on write write flush off");
        assert_eq!(flush(&mut port, is_async), Ok(()));
        drain(&log);

        port.port_mut().inner.writes.extend(steps());
        port.port_mut().inner.flushes.push_back(Step::Error);
        assert_eq!(write(&mut port, is_async, b"12"), Ok(1));
        refused(write(&mut port, is_async, b"2"));
        assert_eq!(drain(&log), "on write write flush off");
        assert_eq!(flush(&mut port, is_async), Err(DirectedError::Lost), "it cannot know");
        assert_eq!(flush(&mut port, is_async), Ok(()), "told once");

        // Or by the flush behind, if that fails itself.
        port.port_mut().inner.writes.extend(steps());
        port.port_mut().inner.flushes.extend([Step::Error, Step::Error]);
        assert_eq!(write(&mut port, is_async, b"12"), Ok(1));
        refused(write(&mut port, is_async, b"2"));
        assert_eq!(flush(&mut port, is_async), Err(DirectedError::Port(Unplugged)));
        assert_eq!(flush(&mut port, is_async), Ok(()));
    }
    let (mut port, log) = delayed(Script::writing([Step::Bytes(vec![0]), Step::Error]), 0);
    drain(&log);
    assert_eq!(write(&mut port, false, b"12"), Ok(1));
    assert!(write(&mut port, false, b"2").is_err());
    assert_eq!(drain(&log), "on 5000 ns write write flush 7000 ns off");
}

#[test]
fn a_pin_that_fails_sends_nothing_and_is_tried_again() {
    for is_async in [false, true] {
        let (mut port, log, pin) = undelayed(Script::default());
        drain(&log);
        pin.failures.set(1);
        assert_eq!(write(&mut port, is_async, b"12"), Err(DirectedError::Pin(Stuck)));
        assert_eq!(drain(&log), "on! off");
        assert_eq!(write(&mut port, is_async, b"12"), Ok(2));
        pin.failures.set(1);
        assert_eq!(flush(&mut port, is_async), Err(DirectedError::Pin(Stuck)));
        assert!(port.is_on());
        assert_eq!(flush(&mut port, is_async), Ok(()));
        assert_eq!(drain(&log), "on write flush off! flush off");
    }
    let pin = Pin::default();
    pin.failures.set(1);
    let port = Logged { inner: Script::default(), log: pin.log.clone() };
    assert!(matches!(Directed::new(port, pin), Err(Stuck)));
}

#[test]
fn a_cancelled_write_keeps_the_pin_until_it_is_finished_or_given_up() {
    let stalled = Script {
        writes: [Step::Bytes(vec![0]), Step::Stall].into(),
        flushes: [Step::Stall].into(),
        ..Script::default()
    };
    let (mut port, log) = delayed(stalled, 1);
    let cancelled = |port: &mut Port<Delay>, bytes: &[u8]| {
        assert!(poll(std::pin::pin!(embedded_io_async::Write::write(port, bytes))).is_pending());
    };
    cancelled(&mut port, b"12"); // in the delay in front, which is then waited for again
    assert_eq!(write(&mut port, true, b"12"), Ok(1));
    assert_eq!(drain(&log), "off on 5000 ns 5000 ns write");
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
    let (mut port, log, _) = undelayed(Script::reading(steps));
    drain(&log);
    let mut buffer = [0; 8];
    assert_eq!(embedded_io::ReadReady::read_ready(&mut port), Ok(true));
    assert_eq!(embedded_io::Read::read(&mut port, &mut buffer), Ok(2));
    assert_eq!(ready(embedded_io_async::Read::read(&mut port, &mut buffer)), Ok(2));
    let failed = embedded_io::Read::read(&mut port, &mut buffer);
    assert_eq!(failed, Err(DirectedError::Port(Unplugged)));
    assert_eq!(drain(&log), "");
}

#[test]
fn a_driver_switches_once_per_round_and_lets_go_when_its_port_fails() {
    for is_async in [false, true] {
        let (port, log, _) = undelayed(Script::writing([Step::Bytes(vec![0; 2])]));
        drain(&log);
        let role = Recorder::sending(&[b"12", b"34"]);
        let mut driver = Driver::new(role, port, VirtualClock(World::default()));
        let round = |driver: &mut Driver<_, _, _>| {
            if is_async { ready(driver.service_async()) } else { driver.service() }
        };
        assert_eq!(round(&mut driver), Ok(()));
        assert_eq!(drain(&log), "on write write flush off");
        driver.role_mut().frames.push_back(b"56".into());
        let steps = [Step::Bytes(vec![0]), Step::Error];
        driver.port_mut().port_mut().inner.writes.extend(steps);
        let failed = DriveError::Port(DirectedError::Port(Unplugged));
        assert_eq!(round(&mut driver), Err(failed));
        assert_eq!(drain(&log), "on write write flush off flush");
        assert_eq!(round(&mut driver), Ok(()));
        assert_eq!(drain(&log), "on write flush off");
    }
}

/// Is the pin on, as far as it has done what it was told?
fn is_on(log: &Log) -> bool {
    let log = log.borrow();
    log.iter().rev().find(|entry| ["on", "off"].contains(&entry.as_str())).unwrap() == "on"
}

#[test]
fn the_pin_is_off_after_every_call_whatever_fails() {
    let one = || Step::Bytes(vec![0]);
    let reads = [vec![], vec![Step::Error], vec![Step::Zero], vec![one(), Step::Error]];
    let writes = [
        vec![],
        vec![Step::Error],
        vec![Step::Zero],
        vec![one(), Step::Error],
        vec![one(), Step::Error, Step::Error],
        vec![one(), Step::Zero, one(), Step::Error],
    ];
    let flushes = [vec![], vec![Step::Error], vec![Step::Error, Step::Error]];
    for (read, write) in reads.iter().flat_map(|read| writes.iter().map(move |it| (read, it))) {
        for (flush, is_async) in flushes.iter().flat_map(|it| [(it, false), (it, true)]) {
            let script = Script {
                reads: read.clone().into(),
                writes: write.clone().into(),
                flushes: flush.clone().into(),
                ..Script::default()
            };
            let (port, log, _) = undelayed(script);
            let role = Recorder::sending(&[b"12", b"34"]);
            let mut driver = Driver::new(role, port, VirtualClock(World::default()));
            for call in 0..5 {
                let _ = if is_async { ready(driver.service_async()) } else { driver.service() };
                let story = (read, write, flush, call);
                assert!(!is_on(&log) && !driver.port_mut().is_on(), "{story:?}");
            }
        }
    }
}

#[test]
fn a_pin_that_failed_to_go_off_goes_off_with_the_next_call_whatever_fails_besides() {
    let one = || Step::Bytes(vec![0]);
    for write in [vec![], vec![Step::Error], vec![one(), Step::Error, Step::Error]] {
        for (calls, failures) in (0..4).flat_map(|calls| [(calls, 1), (calls, 2)]) {
            for is_async in [false, true] {
                let world = World::default();
                let (port, log, pin) = undelayed(Script::writing(write.clone()));
                let role = Recorder::sending(&[b"12", b"34"]);
                let mut driver = Driver::new(role, port, VirtualClock(world.clone()));
                for call in 0..8 {
                    if call == calls {
                        pin.failures.set(failures);
                    }
                    let _ = if is_async { ready(driver.service_async()) } else { driver.service() };
                    // The rest of the frame may be given up meanwhile.
                    world.step(25_000);
                }
                assert_eq!(pin.failures.get() % failures, 0, "it is tried again");
                assert!(!is_on(&log) && !driver.port_mut().is_on(), "{write:?} {calls}");
            }
        }
    }
}

#[test]
fn the_pin_that_a_dropped_call_has_left_on_goes_off_with_the_next_one() {
    let one = || Step::Bytes(vec![0]);
    for (writes, flushes) in [
        (vec![Step::Stall], vec![]),
        (vec![one(), Step::Stall], vec![]),
        (vec![], vec![Step::Stall]),
        // The rest of a frame that has been flushed in between.
        (vec![one(), Step::Error, Step::Stall], vec![]),
    ] {
        for late_us in [0, 25_000] {
            let world = World::default();
            let script = Script {
                writes: writes.clone().into(),
                flushes: flushes.clone().into(),
                ..Script::default()
            };
            let (port, log, _) = undelayed(script);
            let role = Recorder::sending(&[b"12"]);
            let mut driver = Driver::new(role, port, VirtualClock(world.clone()));
            let is_dropped = |driver: &mut Driver<_, _, _>| {
                let mut call = std::pin::pin!(driver.service_async());
                poll(call.as_mut()).is_pending() && poll(call.as_mut()).is_pending()
            };
            while !is_dropped(&mut driver) {}
            world.step(late_us);
            assert_eq!(ready(driver.service_async()), Ok(()));
            assert!(!is_on(&log), "{writes:?} {late_us}");
        }
    }
}

#[test]
fn a_port_that_stalls_for_a_second_does_not_leave_the_driver_enable_pin_on() {
    let one = || Step::Bytes(vec![0]);
    let again = || [Step::Stall, Step::Stall];
    for (writes, flushes) in [
        (vec![Step::Stall], vec![]),
        (vec![one(), Step::Stall], vec![]),
        (vec![], vec![Step::Stall]),
        (vec![], again().into()),
        (again().into(), vec![]),
    ] {
        let world = World::default();
        let (count, story) = (writes.len().max(flushes.len()), format!("{writes:?} {flushes:?}"));
        let script = Script { writes: writes.into(), flushes: flushes.into(), ..Script::default() };
        let (port, log, _) = undelayed(script);
        let role = Recorder::sending(&[b"12", b"34", b"56"]);
        let mut driver = Driver::new(role, port, VirtualClock(world.clone()));
        let mut stalls = 0;
        for _ in 0..count + 1 {
            let mut call = std::pin::pin!(driver.service_async());
            if poll(call.as_mut()).is_pending() {
                assert!(is_on(&log) || stalls > 0, "{story}");
                world.step(1_000_000);
                assert_eq!(ready(call), Err(DriveError::Stalled), "{story}");
                stalls += 1;
            }
            assert!(!is_on(&log), "{story}");
        }
        assert!(stalls > 0 && !driver.port_mut().is_on(), "{story}");
    }
}

#[test]
fn a_write_of_no_bytes_puts_the_pin_off() {
    for is_async in [false, true] {
        let (mut port, log, pin) = undelayed(Script::default());
        assert_eq!(write(&mut port, is_async, b""), Ok(0));
        assert_eq!(drain(&log), "off", "from the start");
        assert_eq!(write(&mut port, is_async, b"12"), Ok(2));
        pin.failures.set(1);
        assert_eq!(write(&mut port, is_async, b""), Err(DirectedError::Pin(Stuck)));
        assert!(port.is_on());
        assert_eq!(write(&mut port, is_async, b""), Ok(0));
        assert_eq!(drain(&log), "on write off! off");
        assert!(!port.is_on());
    }
}

#[test]
fn the_error_tells_port_and_pin_apart() {
    let (port, pin) = (DirectedError::Port(Unplugged), DirectedError::Pin(Stuck));
    let (port, pin): (DirectedError<Unplugged, Stuck>, DirectedError<Unplugged, Stuck>) =
        (port, pin);
    assert_eq!(port.to_string(), "unplugged");
    assert_eq!(port.source().unwrap().to_string(), "unplugged");
    assert_eq!(port.kind(), embedded_io::ErrorKind::NotConnected);
    assert_eq!(pin.to_string(), "driver-enable pin failed: Stuck");
    assert!(pin.source().is_none());
    assert_eq!(pin.kind(), embedded_io::ErrorKind::Other);
}
