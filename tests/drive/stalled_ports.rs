//! Ports that never become ready: a call gives up after a second, and a later stop is sent again.

use std::{
    collections::VecDeque,
    pin::pin,
    task::{Context, Poll, Waker},
};

use crate::{motor_line::Wire, rig::*};

/// A bus whose only motor turns at 5 rps.
fn turning() -> (Wire, Bus) {
    let (wire, mut bus) = Wire::one_motor(Mode::Velocity, |_| ());
    bus.set_velocity(NodeId::N1, Rps::new(5.0).unwrap()).unwrap();
    (wire, bus)
}

/// The same; async writes or flushes are never ready.
fn hanging(flushes_hang: bool) -> (Wire, Bus) {
    let (wire, mut bus) = turning();
    script(&mut bus, flushes_hang).extend(vec![Step::Stall; 10_000]);
    (wire, bus)
}

fn script(bus: &mut Bus, is_of_flushes: bool) -> &mut VecDeque<Step> {
    let port = bus.port_mut();
    if is_of_flushes { &mut port.flushes } else { &mut port.writes }
}

#[test]
fn an_async_port_that_never_becomes_ready_does_not_delay_a_stop_forever() {
    for flushes_hang in [false, true] {
        let (wire, mut bus) = hanging(flushes_hang);
        let begin_us = wire.world.now_us();
        let stopped = wire.world.block_on(bus.asynch().stop(NodeId::N1));
        assert_eq!(stopped, Err(DriveError::StopsOwed(NodeId::N1.into())));
        let took_us = wire.world.now_us() - begin_us;
        assert!(took_us < 1_500_000, "it gives up after {took_us} us");
        // A silence follows what may have been cut off.
        wire.world.step(2000);
        let stalled = wire.world.block_on(bus.asynch().service());
        assert_eq!(stalled, Err(DriveError::Stalled), "flushes hang: {flushes_hang}");
        // The port works again: the stop is sent again.
        script(&mut bus, flushes_hang).clear();
        assert_eq!(wire.world.block_on(bus.asynch().stop(NodeId::N1)), Ok(()));
        assert_eq!(wire.rps(), 0.0);
    }
}

#[test]
fn a_stalled_port_is_found_by_calls_that_are_dropped_before_a_second_is_over() {
    for flushes_hang in [false, true] {
        let (wire, mut bus) = hanging(flushes_hang);
        let begin_us = wire.world.now_us();
        loop {
            let mut call = pin!(bus.asynch().service());
            let mut context = Context::from_waker(Waker::noop());
            if call.as_mut().poll(&mut context).is_ready() {
                // Nothing is due yet.
                wire.world.step(100);
                continue;
            }
            wire.world.step(100_100);
            // A task that yielded is polled again at once.
            let _ = call.as_mut().poll(&mut context);
            if let Poll::Ready(result) = call.as_mut().poll(&mut context) {
                assert_eq!(result, Err(DriveError::Stalled));
                break;
            }
            let waits_us = wire.world.now_us() - begin_us;
            assert!(waits_us < 1_300_000, "not found, flushes hang: {flushes_hang}");
        }
    }
}

#[test]
fn a_port_not_polled_for_a_while_after_a_dropped_call_has_not_stalled() {
    let (wire, mut bus) = turning();
    wire.world.step(10_000);
    // Then it takes its time, but no longer.
    bus.port_mut().flushes.extend([Step::Stall, Step::Late(2000)]);
    let mut context = Context::from_waker(Waker::noop());
    assert!(pin!(bus.asynch().service()).poll(&mut context).is_pending());
    wire.world.step(10_000_000);
    let mut call = pin!(bus.asynch().service());
    assert!(call.as_mut().poll(&mut context).is_pending());
    wire.world.step(2000);
    assert_eq!(call.as_mut().poll(&mut context), Poll::Ready(Ok(())));
}

#[test]
fn a_port_that_has_stalled_is_given_a_second_again() {
    for flushes_hang in [false, true] {
        let (wire, mut bus) = hanging(flushes_hang);
        while wire.world.block_on(bus.asynch().service()) != Err(DriveError::Stalled) {
            wire.world.step(100);
        }
        // It needs half a second for the next frame.
        script(&mut bus, flushes_hang).clear();
        script(&mut bus, flushes_hang).push_back(Step::Late(500_100));
        let mut context = Context::from_waker(Waker::noop());
        for _ in 0..30 {
            let mut call = pin!(bus.asynch().service());
            if call.as_mut().poll(&mut context).is_ready() {
                wire.world.step(100);
                continue;
            }
            wire.world.step(500_000);
            assert!(call.as_mut().poll(&mut context).is_pending(), "flushes hang: {flushes_hang}");
            let begin_us = wire.world.now_us();
            assert_eq!(wire.world.block_on(call), Ok(()));
            assert!(wire.world.now_us() - begin_us < 1000, "longer than the port");
            break;
        }
        assert!(script(&mut bus, flushes_hang).is_empty(), "no frame was due");
    }
}

#[test]
fn a_call_that_was_dropped_long_ago_does_not_make_a_slow_port_a_stalled_one() {
    for flushes_hang in [false, true] {
        let (wire, mut bus) = turning();
        script(&mut bus, flushes_hang).push_back(Step::Stall);
        let mut context = Context::from_waker(Waker::noop());
        while pin!(bus.asynch().service()).poll(&mut context).is_ready() {
            wire.world.step(100);
        }
        wire.world.step(5_000_000);
        script(&mut bus, flushes_hang).push_back(Step::Late(50_000));
        while !script(&mut bus, flushes_hang).is_empty() {
            assert_eq!(wire.world.block_on(bus.asynch().service()), Ok(()), "{flushes_hang}");
            wire.world.step(100);
        }
    }
}

#[test]
fn settings_without_a_line_speed_are_slow_but_no_panic() {
    let mut config = MasterConfig::direct();
    config.baud = 0;
    let world = World::default();
    let mut bus: Bus = on(Master::new(config, world.now()), Port::new(&world, 20));
    let world = bus.port().world.clone();
    let now = bus.now();
    bus.role_mut().discover(now);
    assert_eq!(world.block_on(bus.asynch().service()), Ok(()));
    assert_eq!(bus.service(), Ok(()));
}

#[test]
fn a_write_that_was_given_up_long_ago_does_not_make_a_slow_port_a_stalled_one() {
    let mut driver = on(Recorder::sending(&[b"123"]), Port::writing([Step::Stall]));
    let world = driver.port().world.clone();
    assert!(poll(pin!(driver.asynch().service())).is_pending());
    for _ in 0..30 {
        world.step(100_000);
        assert_eq!(world.block_on(driver.asynch().service()), Ok(()));
    }
    driver.port_mut().writes.push_back(Step::Late(9000));
    driver.role_mut().frames.push_back(b"456".into());
    assert_eq!(world.block_on(driver.asynch().service()), Ok(()));
    assert_eq!(driver.port().written, b"456");
}

/// The speeds that have been written since.
fn written_rps(bus: &Bus, from: usize) -> Vec<f32> {
    use axlewire::{ikeya::Request, ikeya::ToSlave, stream::Frames};
    let requests = Frames::<ToSlave>::new(&bus.port().written[from..]);
    let speeds = requests.filter_map(|it| match it {
        Request::Write(write) => Some(write.as_velocity()),
        Request::Read(_) => None,
    });
    speeds.collect()
}

#[test]
fn a_set_point_that_waits_for_a_slow_port_does_not_outlive_the_dead_man_nor_a_held_up_executor() {
    // The port is slow, or the task is not polled.
    for (late_ms, held_ms) in [(500, 0), (50, 500), (50, 10_000)] {
        let (wire, mut bus) = Wire::one_motor(Mode::Velocity, |config| {
            config.dead_man = Some(ms(100));
        });
        let from = bus.port().written.len();
        bus.port_mut().writes = vec![Step::Late(late_ms * 1000); 2].into();
        {
            let mut aimed = pin!(bus.asynch().set_velocity(NodeId::N1, Rps::new(5.0).unwrap()));
            let mut context = Context::from_waker(Waker::noop());
            assert!(aimed.as_mut().poll(&mut context).is_pending());
            wire.world.step(held_ms * 1000);
            let _ = wire.world.block_on(aimed);
        }
        for _ in 0..100 {
            let _ = wire.world.block_on(bus.asynch().service());
            wire.world.step(1000);
        }
        let speeds = written_rps(&bus, from);
        assert!(!speeds.contains(&5.0), "{late_ms}, {held_ms}: {speeds:?}");
    }
}
