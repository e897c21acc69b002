//! Clocks that are wrong once, and ports that never get ready.

use std::{
    pin::pin,
    task::{Context, Poll, Waker},
};

use axlewire::{
    drive::DriveError,
    ikeya::{Mode, NodeId, Polling, Rps},
    time::Duration,
};

use crate::{motor::Motor, wire::Wire};

#[test]
fn one_wrong_reading_of_the_clock_holds_up_no_stop() {
    for readings in 0..20 {
        let wire = Wire::bus(vec![Motor::new(NodeId::N1, Mode::Velocity)]);
        let mut bus = wire.master(|_| ());
        bus.discover().unwrap();
        bus.set_velocity(NodeId::N1, Rps::new(5.0).unwrap()).unwrap();
        for _ in 0..100 {
            bus.service().unwrap();
            wire.pass(10);
        }
        // An hour ahead.
        wire.world().glitch = Some((readings, 3_600_000_000));
        let begin_us = wire.world().now_us;
        let stopped = bus.stop(NodeId::N1);
        let took_us = wire.world().now_us - begin_us;
        let bound_us = u64::from(bus.role().stop_bound().as_micros());
        assert!(took_us <= bound_us + 1000, "reading {readings}: stopped after {took_us} us");
        // A deadline may seem to be over: then the stop is owed, and the next call pays it.
        if stopped.is_err() {
            assert_eq!(stopped, Err(DriveError::StopsOwed(NodeId::N1.into())));
            assert_eq!(bus.stop(NodeId::N1), Ok(()), "reading {readings}");
        }
        assert_eq!(wire.rps(), 0.0, "reading {readings}");
        let took_us = wire.world().now_us - begin_us;
        assert!(took_us <= 2 * bound_us, "reading {readings}: paid after {took_us} us");
    }
}

#[test]
fn one_wrong_reading_of_the_clock_does_not_make_a_call_idle_longer() {
    let wire = Wire::bus(vec![Motor::new(NodeId::N1, Mode::Velocity)]);
    let mut bus = wire.master(|config| config.polling = Polling::Manual);
    bus.discover().unwrap();
    wire.world().glitch = Some((0, 3_600_000_000));
    bus.service().unwrap();
    let begin_us = wire.world().now_us;
    let end = bus.now() + Duration::from_millis(5);
    bus.run_until(end, |_, _, _| ()).unwrap();
    let took_us = wire.world().now_us - begin_us;
    assert!((5000..6000).contains(&took_us), "5 ms take {took_us} us");
}

#[test]
fn an_async_port_that_never_gets_ready_does_not_hold_up_a_stop_for_ever() {
    for flushes_hang in [false, true] {
        let wire = Wire::bus(vec![Motor::new(NodeId::N1, Mode::Velocity)]);
        let mut bus = wire.master(|_| ());
        bus.discover().unwrap();
        bus.set_velocity(NodeId::N1, Rps::new(5.0).unwrap()).unwrap();
        (wire.world().writes_hang, wire.world().flushes_hang) = (!flushes_hang, flushes_hang);
        let begin_us = wire.world().now_us;
        let stopped = wire.block_on(bus.stop_async(NodeId::N1));
        assert_eq!(stopped, Err(DriveError::StopsOwed(NodeId::N1.into())));
        let took_us = wire.world().now_us - begin_us;
        assert!(took_us < 1_500_000, "it gives up after {took_us} us");
        let stalled = wire.block_on(bus.service_async());
        assert_eq!(stalled, Err(DriveError::Stalled), "flushes hang: {flushes_hang}");
        // The port is well again: the stop is sent anew.
        (wire.world().writes_hang, wire.world().flushes_hang) = (false, false);
        assert_eq!(wire.block_on(bus.stop_async(NodeId::N1)), Ok(()));
        assert_eq!(wire.rps(), 0.0);
    }
}

#[test]
fn a_stalled_port_is_found_by_calls_that_are_dropped_before_a_second_is_over() {
    for flushes_hang in [false, true] {
        let wire = Wire::bus(vec![Motor::new(NodeId::N1, Mode::Velocity)]);
        let mut bus = wire.master(|_| ());
        bus.discover().unwrap();
        bus.set_velocity(NodeId::N1, Rps::new(5.0).unwrap()).unwrap();
        (wire.world().writes_hang, wire.world().flushes_hang) = (!flushes_hang, flushes_hang);
        let begin_us = wire.world().now_us;
        loop {
            let mut call = pin!(bus.service_async());
            let mut context = Context::from_waker(Waker::noop());
            if call.as_mut().poll(&mut context).is_ready() {
                // Nothing is due yet.
                wire.pass(100);
                continue;
            }
            wire.pass(100_100);
            // As whoever yields is polled again at once.
            let _ = call.as_mut().poll(&mut context);
            if let Poll::Ready(result) = call.as_mut().poll(&mut context) {
                assert_eq!(result, Err(DriveError::Stalled));
                break;
            }
            let waits_us = wire.world().now_us - begin_us;
            assert!(waits_us < 1_300_000, "not found, flushes hang: {flushes_hang}");
        }
    }
}

#[test]
fn a_port_that_was_not_asked_for_a_while_after_a_dropped_call_has_not_stalled() {
    let wire = Wire::bus(vec![Motor::new(NodeId::N1, Mode::Velocity)]);
    let mut bus = wire.master(|_| ());
    bus.discover().unwrap();
    bus.set_velocity(NodeId::N1, Rps::new(5.0).unwrap()).unwrap();
    wire.pass(10_000);
    wire.world().flushes_hang = true;
    let mut context = Context::from_waker(Waker::noop());
    assert!(pin!(bus.service_async()).poll(&mut context).is_pending());
    wire.pass(10_000_000);
    // It takes its time, and no more.
    let mut call = pin!(bus.service_async());
    assert!(call.as_mut().poll(&mut context).is_pending());
    wire.pass(2000);
    wire.world().flushes_hang = false;
    assert_eq!(call.as_mut().poll(&mut context), Poll::Ready(Ok(())));
}
