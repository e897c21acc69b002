//! Ports that never become ready: a call gives up after a second, and a later stop is sent again.

use std::{
    pin::pin,
    task::{Context, Poll, Waker},
};

use crate::{
    motor_line::{Bus, Wire},
    rig::*,
};

/// A bus whose only motor turns at 5 rps.
fn turning() -> (Wire, Bus) {
    let (wire, mut bus) = Wire::one_motor(Mode::Velocity, |_| ());
    bus.set_velocity(NodeId::N1, Rps::new(5.0).unwrap()).unwrap();
    (wire, bus)
}

/// The same; async writes or flushes are never ready.
fn hanging(flushes_hang: bool) -> (Wire, Bus) {
    let (wire, bus) = turning();
    (wire.world().writes_hang, wire.world().flushes_hang) = (!flushes_hang, flushes_hang);
    (wire, bus)
}

#[test]
fn an_async_port_that_never_becomes_ready_does_not_delay_a_stop_forever() {
    for flushes_hang in [false, true] {
        let (wire, mut bus) = hanging(flushes_hang);
        let begin_us = wire.world().now_us;
        let stopped = wire.block_on(bus.stop_async(NodeId::N1));
        assert_eq!(stopped, Err(DriveError::StopsOwed(NodeId::N1.into())));
        let took_us = wire.world().now_us - begin_us;
        assert!(took_us < 1_500_000, "it gives up after {took_us} us");
        let stalled = wire.block_on(bus.service_async());
        assert_eq!(stalled, Err(DriveError::Stalled), "flushes hang: {flushes_hang}");
        // The port works again: the stop is sent again.
        (wire.world().writes_hang, wire.world().flushes_hang) = (false, false);
        assert_eq!(wire.block_on(bus.stop_async(NodeId::N1)), Ok(()));
        assert_eq!(wire.rps(), 0.0);
    }
}

#[test]
fn a_stalled_port_is_found_by_calls_that_are_dropped_before_a_second_is_over() {
    for flushes_hang in [false, true] {
        let (wire, mut bus) = hanging(flushes_hang);
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
            // A task that yielded is polled again at once.
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
fn a_port_not_polled_for_a_while_after_a_dropped_call_has_not_stalled() {
    let (wire, mut bus) = turning();
    wire.pass(10_000);
    wire.world().flushes_hang = true;
    let mut context = Context::from_waker(Waker::noop());
    assert!(pin!(bus.service_async()).poll(&mut context).is_pending());
    wire.pass(10_000_000);
    // It takes its time, but no longer.
    let mut call = pin!(bus.service_async());
    assert!(call.as_mut().poll(&mut context).is_pending());
    wire.pass(2000);
    wire.world().flushes_hang = false;
    assert_eq!(call.as_mut().poll(&mut context), Poll::Ready(Ok(())));
}

#[test]
fn a_port_that_has_stalled_is_given_a_second_again() {
    for flushes_hang in [false, true] {
        let (wire, mut bus) = hanging(flushes_hang);
        while wire.block_on(bus.service_async()) != Err(DriveError::Stalled) {
            wire.pass(100);
        }
        // It needs half a second for the next frame.
        let mut context = Context::from_waker(Waker::noop());
        for _ in 0..10 {
            let mut call = pin!(bus.service_async());
            if call.as_mut().poll(&mut context).is_ready() {
                wire.pass(100);
                continue;
            }
            wire.pass(500_000);
            assert!(call.as_mut().poll(&mut context).is_pending(), "flushes hang: {flushes_hang}");
            (wire.world().writes_hang, wire.world().flushes_hang) = (false, false);
            assert_eq!(call.as_mut().poll(&mut context), Poll::Ready(Ok(())));
            break;
        }
        let world = wire.world();
        assert!(!world.writes_hang && !world.flushes_hang, "no frame was due");
    }
}
