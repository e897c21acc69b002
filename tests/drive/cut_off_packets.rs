//! Packets partly sent when the port fails: what the node makes of the rest.

use crate::{
    motor_line::{ALL, Wire, owe_stop, run},
    rig::*,
};

/// A motor at rest, with a set-point of 10 rps of which this many bytes have left. The node waits
/// 20 ms for the rest.
fn cut_after(count: usize) -> (Wire, Bus) {
    let wire = Wire::bus(Some(Mode::Velocity));
    wire.motor().idle_us = 20_000;
    let mut bus = wire.master(|config| config.polling = Polling::Manual);
    bus.discover().unwrap();
    wire.world.step(5000);
    bus.service().unwrap();
    wire.write_only(count);
    let now = bus.now();
    bus.role_mut().set_velocity(NodeId::N1, rps(10.0), now).unwrap();
    assert!(bus.service().is_err());
    assert_eq!(bus.unsent().len(), WriteRequest::LEN - count);
    (wire, bus)
}

#[test]
fn a_cut_off_set_point_that_is_released_is_not_completed() {
    let (wire, mut bus) = cut_after(5);
    bus.role_mut().release(NodeId::N1);
    wire.world.step(10_000);
    wire.write_all();
    run(&mut bus, 1000);
    assert_eq!(wire.rps(), 0.0, "it runs on a withdrawn set-point");
}

#[test]
fn a_cut_off_set_point_is_not_completed_after_a_stop() {
    let (wire, mut bus) = cut_after(5);
    owe_stop(&mut bus);
    wire.world.step(10_000);
    // Room for the rest, then the port fails again.
    wire.write_only(3);
    run(&mut bus, 1000);
    assert_eq!(wire.rps(), 0.0, "it was at rest when stopped, and runs now");
}

#[test]
fn a_cut_off_set_point_is_not_completed_by_the_call_that_stops() {
    for is_async in [false, true] {
        let (wire, mut bus) = cut_after(5);
        wire.write_all();
        call!(is_async, bus, stop(NodeId::N1)).unwrap();
        assert_eq!(wire.turns(), 0.0, "it was at rest when stopped, and has turned");
        // A set-point still in force is completed.
        let (wire, mut bus) = cut_after(5);
        wire.write_all();
        wire.world.step(50);
        bus.service().unwrap();
        assert_eq!(wire.rps(), 10.0);
    }
}

#[test]
fn a_cut_off_set_point_is_not_completed_while_the_mode_is_in_doubt() {
    let (wire, mut bus) = cut_after(5);
    wire.motor().switch(Mode::Position, wire.world.now_us());
    wire.receive(PositionResponse::new(NodeId::N1, Position::new(0, 0)).as_bytes());
    wire.world.step(1000);
    let _ = bus.service();
    assert!(bus.role().is_mode_in_doubt(NodeId::N1));
    wire.world.step(9000);
    wire.write_all();
    run(&mut bus, 3000);
    let motor = wire.motor();
    let mut payloads = motor.writes.iter().map(|&(_, payload)| payload);
    let is_completed = payloads.any(|payload| payload == 10.0_f32.to_le_bytes());
    assert!(!is_completed, "10 rps is a position that was never requested");
}

#[test]
fn a_port_that_takes_a_byte_occasionally_does_not_complete_a_set_point_after_a_stop() {
    let (wire, mut bus) = cut_after(2);
    owe_stop(&mut bus);
    for _ in 0..6 {
        wire.world.step(19_000);
        wire.write_only(1);
        let _ = bus.service();
    }
    assert_eq!(wire.motor().writes, [], "completed 114 ms after the stop");
}

#[test]
fn a_set_point_that_was_given_up_is_not_completed_by_the_next_header() {
    // The last byte of its CRC is the header of a READ.
    let ends_like_header =
        |&rps: &Rps| WriteRequest::velocity(NodeId::N1, rps).as_bytes()[7] == 0xAA;
    let target = (1..100_000).map(|milli| rps(milli as f32 * 1e-3)).find(ends_like_header).unwrap();
    let (wire, mut bus) = Wire::one_motor(Mode::Velocity, |_| ());
    wire.world.step(300);
    let begin = wire.sent().len();
    wire.write_only(7);
    assert!(bus.set_velocity(NodeId::N1, target).is_err());
    bus.discard();
    bus.role_mut().release(NodeId::N1);
    wire.write_all();
    run(&mut bus, 1000);
    let mut slave: Slave =
        Slave::new(NodeId::N1, Mode::Velocity, SlaveConfig::direct(), Instant::from_micros(0));
    for &(at, byte) in &wire.sent()[begin..] {
        let now = Instant::from_micros(at);
        if slave.poll_timeout().is_some_and(|due| now >= due) {
            slave.handle_timeout(now);
        }
        slave.handle_input(&[byte], now);
        let is_given_up = slave.command(now) == Some(Target::Velocity(target));
        assert!(!is_given_up, "it has received a withdrawn set-point");
    }
    assert!(slave.statistics().reads > 100, "it receives the READs");
    assert_eq!(wire.rps(), 0.0);
}

/// A port that cuts every WRITE in two: it takes one byte, fails, then takes the rest.
fn cut_in_two() -> impl FnMut(&[u8]) -> Step {
    let mut fails = false;
    move |bytes| match (core::mem::take(&mut fails), bytes.len()) {
        (true, _) => Step::Error,
        (false, WriteRequest::LEN) => {
            fails = true;
            Step::Few(1)
        }
        (false, _) => ALL,
    }
}

#[test]
fn a_stop_write_that_a_port_cut_in_two_pays_nothing() {
    for polling in [Polling::Manual, Polling::Fastest] {
        for is_async in [false, true] {
            let (wire, mut bus) =
                Wire::one_motor(Mode::Velocity, |config| config.polling = polling);
            bus.set_velocity(NodeId::N1, rps(10.0)).unwrap();
            wire.world.step(300_000);
            let _ = bus.service();
            wire.write_with(cut_in_two());
            let stopped = call!(is_async, bus, stop(NodeId::N1));
            let rps = wire.rps();
            assert!(stopped.is_err() || rps == 0.0, "reported as stopped, but turns at {rps} rps");
            wire.write_all();
            run(&mut bus, 100);
            assert_eq!(wire.rps(), 0.0, "the stop stays owed");
        }
    }
}

/// A driver-enable pin: when off, bytes still in the transmitter do not reach the line.
#[derive(Clone)]
struct Enable {
    world: World,
    leaving: crate::port::Wire,
}

impl embedded_hal::digital::ErrorType for Enable {
    type Error = core::convert::Infallible;
}

impl embedded_hal::digital::OutputPin for Enable {
    fn set_low(&mut self) -> Result<(), Self::Error> {
        let now_us = self.world.now_us();
        self.leaving.borrow_mut().retain(|&(at, _)| at <= now_us);
        Ok(())
    }

    fn set_high(&mut self) -> Result<(), Self::Error> {
        Ok(())
    }
}

/// The line of a port behind a driver-enable pin: the motor hears a byte only when it has left.
fn enable(wire: &Wire, port: &mut Port) -> Enable {
    let leaving = crate::port::Wire::default();
    port.outboxes.push(leaving.clone());
    let mut hear = port.peer.take().unwrap();
    let (world, line, inbox) = (wire.world.clone(), leaving.clone(), port.inbox.clone());
    wire.world.add(move || {
        let left = line.borrow().partition_point(|&(at, _)| at <= world.now_us());
        for (at, byte) in line.borrow_mut().drain(..left) {
            inbox.borrow_mut().extend(hear(byte, at));
        }
    });
    Enable { world: wire.world.clone(), leaving }
}

#[test]
fn behind_a_driver_enable_pin_a_stop_is_paid_only_if_it_was_heard_whatever_writes_fail() {
    let half = |wire: &Wire, _: &Enable| {
        let mut steps = [Step::Few(4), Step::Error, ALL].into_iter().cycle();
        wire.write_with(move |bytes| match bytes.len() {
            ReadRequest::LEN if bytes[0] == 0xAA => ALL,
            _ => steps.next().unwrap(),
        });
    };
    // It fails while earlier bytes are still being sent.
    let one_at_a_time = |wire: &Wire, pin: &Enable| {
        let leaving = pin.leaving.clone();
        wire.write_with(move |_| if leaving.borrow().is_empty() { ALL } else { Step::Error });
    };
    type Fail = fn(&Wire, &Enable);
    let writers: [(Fail, bool); 3] =
        [(|wire, _| wire.write_with(cut_in_two()), false), (half, false), (one_at_a_time, true)];
    for ((fail, is_heard), is_async) in writers.into_iter().flat_map(|it| [(it, false), (it, true)])
    {
        let wire = Wire::bus(Some(Mode::Velocity));
        let mut config = MasterConfig::direct();
        config.nodes = NodeId::N1.into();
        let mut port = wire.port();
        let pin = enable(&wire, &mut port);
        let Ok(port) = Rs485::new(port, pin.clone());
        let mut bus = On::with(|now| Master::new(config, now), port, wire.world.clone());
        bus.discover().unwrap();
        bus.set_velocity(NodeId::N1, rps(10.0)).unwrap();
        assert_eq!(wire.rps(), 10.0);
        fail(&wire, &pin);
        let stopped = match is_async {
            true => wire.world.block_on(bus.asynch().stop(NodeId::N1)),
            false => bus.stop(NodeId::N1),
        };
        let rps = wire.rps();
        assert!(stopped.is_err() || rps == 0.0, "reported as stopped, but turns at {rps} rps");
        assert!(stopped.is_ok() || !is_heard, "{stopped:?}");
        wire.write_all();
        assert_eq!((bus.stop(NodeId::N1), wire.rps()), (Ok(()), 0.0));
    }
}

#[test]
fn a_port_is_flushed_behind_the_part_of_a_frame_before_it_is_asked_to_take_the_next() {
    for is_async in BOTH {
        let role = Recorder::sending(&[b"123", b"456"]);
        let mut driver = on(role, Port::writing([Step::Few(2), Step::Error]));
        let log = crate::port::Log::default();
        driver.port_mut().log = Some(log.clone());
        // The first flush fails to be asked: the call is dropped, or it is too late for the rest.
        assert_eq!(call!(is_async, driver, service()), Err(GONE));
        driver.port().world.step(50_000);
        log.borrow_mut().clear();
        assert_eq!(call!(is_async, driver, service()), Ok(()));
        assert_eq!(log.borrow().join(" "), "flush write flush");
        assert_eq!(driver.port().written, b"12456");
    }
}

#[test]
fn a_port_whose_flush_failed_behind_a_part_is_flushed_once_more_before_it_takes_the_next_frame() {
    // It may have kept the part.
    for (is_async, (failures, calls)) in
        BOTH.into_iter().flat_map(|it| [(it, (1, "flush write flush")), (it, (2, "flush"))])
    {
        let role = Recorder::sending(&[b"123", b"456"]);
        let mut driver = on(role, Port::writing([Step::Few(2), Step::Error]));
        driver.port_mut().flushes = vec![Step::Error; failures].into();
        let log = crate::port::Log::default();
        driver.port_mut().log = Some(log.clone());
        assert_eq!(call!(is_async, driver, service()), Err(GONE));
        assert_eq!(log.borrow().join(" "), "write write flush");
        driver.port().world.step(50_000);
        log.borrow_mut().clear();
        let second = call!(is_async, driver, service());
        assert_eq!((second.is_ok(), log.borrow().join(" ").as_str()), (failures == 1, calls));
        // A port that cannot be flushed at all still gets the frame.
        let _ = call!(is_async, driver, service());
        assert_eq!(driver.port().written, b"12456");
    }
}
