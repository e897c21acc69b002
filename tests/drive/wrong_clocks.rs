//! A clock with one wrong reading: it delays no stop, and no call idles longer.

use crate::{motor_line::Wire, rig::*};

#[test]
fn one_wrong_reading_of_the_clock_holds_up_no_stop() {
    for readings in 0..20 {
        let (wire, mut bus) = Wire::one_motor(Mode::Velocity, |_| ());
        bus.set_velocity(NodeId::N1, Rps::new(5.0).unwrap()).unwrap();
        for _ in 0..100 {
            bus.service().unwrap();
            wire.world.step(10);
        }
        // An hour ahead.
        wire.world.glitch(readings, 3_600_000_000);
        let begin_us = wire.world.now_us();
        let stopped = bus.stop(NodeId::N1);
        let took_us = wire.world.now_us() - begin_us;
        let bound_us = u64::from(bus.role().stop_bound().as_micros());
        assert!(took_us <= bound_us + 1000, "reading {readings}: stopped after {took_us} us");
        // A deadline may seem to have passed: then the stop is owed, and the next call pays it.
        if stopped.is_err() {
            assert_eq!(stopped, Err(DriveError::StopsOwed(NodeId::N1.into())));
            assert_eq!(bus.stop(NodeId::N1), Ok(()), "reading {readings}");
        }
        assert_eq!(wire.rps(), 0.0, "reading {readings}");
        let took_us = wire.world.now_us() - begin_us;
        assert!(took_us <= 2 * bound_us, "reading {readings}: paid after {took_us} us");
    }
}

#[test]
fn one_wrong_reading_of_the_clock_does_not_make_a_call_idle_longer() {
    let (wire, mut bus) =
        Wire::one_motor(Mode::Velocity, |config| config.polling = Polling::Manual);
    wire.world.glitch(0, 3_600_000_000);
    bus.service().unwrap();
    let begin_us = wire.world.now_us();
    bus.run_for(Duration::from_millis(5), |_, _, _| ()).unwrap();
    let took_us = wire.world.now_us() - begin_us;
    assert!((5000..6000).contains(&took_us), "5 ms took {took_us} us");
}

#[test]
fn a_driver_and_its_role_begin_at_the_same_reading_of_the_clock() {
    let clock = clock_that_says([5_000_000, 3]);
    let mut begun = None;
    let make = |now| {
        begun = Some(now);
        Recorder::default()
    };
    // The clock has gone back when it is read next.
    let driver = On::with(make, Port::default(), clock);
    assert_eq!((begun, driver.now()), (Some(at_ms(5000)), at_ms(5000)));
}
