//! How long an async port may take for a frame.

use crate::{exact_waits::Pausing, rig::*};

/// A port that takes this time for each write and for each flush, microseconds.
fn slow<R: Endpoint>(role: R, write_us: u64, flush_us: u64) -> On<R> {
    let mut port = Port::writing(vec![Step::Late(write_us); 8]);
    port.flushes.extend(vec![Step::Late(flush_us); 8]);
    on(role, port)
}

#[test]
fn a_port_has_stalled_after_a_second_in_a_write_or_in_a_flush() {
    for (write_ms, flush_ms, expected) in
        [(999, 0, Ok(())), (1001, 0, Err(())), (0, 999, Ok(())), (0, 1001, Err(()))]
    {
        let role = Recorder::sending(&[b"123"]);
        let mut driver = slow(role, write_ms * 1000, flush_ms * 1000);
        let world = driver.port().world.clone();
        let sent = world.block_on(driver.asynch().service());
        assert_eq!(sent, expected.map_err(|()| DriveError::Stalled), "{write_ms}, {flush_ms}");
        let took = world.now().as_micros();
        assert!((999_000..=1_000_040).contains(&took), "{took} us: {write_ms}, {flush_ms}");
        // A frame that the port has not taken is back at its role.
        assert_eq!(driver.unsent(), b"");
        let told = match (expected, write_ms) {
            (Ok(()), _) => vec![],
            (_, 0) => vec![Unsent::Unflushed],
            _ => vec![Unsent::Untouched, Unsent::Unflushed],
        };
        assert_eq!(driver.role().unsent(), told);
    }
}

#[test]
fn each_frame_has_a_second_of_its_own() {
    for (write_ms, flush_ms) in [(600, 0), (0, 600), (600, 600)] {
        let role = Recorder::sending(&[b"123"]);
        let mut driver = slow(role, write_ms * 1000, flush_ms * 1000);
        let world = driver.port().world.clone();
        for frame in 1..4 {
            assert_eq!(world.block_on(driver.asynch().service()), Ok(()), "{write_ms}, {flush_ms}");
            assert_eq!(driver.port().written, b"123".repeat(frame));
            driver.role_mut().frames.push_back(b"123".into());
            world.step(5_000_000);
        }
    }
}

#[test]
fn a_port_that_was_not_asked_for_seconds_has_the_time_of_a_frame_to_take_it() {
    for is_flush in [false, true] {
        let world = World::default();
        let mut role = Recorder::sending(&[b"123"]);
        role.repeats = true;
        let mut driver = on(role, Port::new(&world, 20));
        driver.port_mut().stutters = true;
        // A call that is dropped while it waits for the write, or for the flush.
        assert_eq!(world.poll_times(if is_flush { 2 } else { 1 }, driver.asynch().service()), None);
        world.step(5_000_000);
        // The port needs a moment, as before.
        assert_eq!(world.block_on(driver.asynch().service()), Ok(()), "flush {is_flush}");
        assert_eq!(driver.port().written, b"123");
    }
}

#[test]
fn the_time_of_a_frame_is_twice_that_of_the_longest_and_a_millisecond() {
    // 64 bytes take 1280 us.
    for (write_us, expected) in [(3559, Ok(())), (3561, Err(DriveError::Stalled))] {
        let role = Pausing { repeats: true, ..Pausing::default() };
        let mut driver = slow(role, write_us, 0);
        driver.port_mut().writes.push_front(Step::Stall);
        let world = driver.port().world.clone();
        assert_eq!(world.poll_times(1, driver.asynch().service()), None);
        world.step(999_000 - write_us);
        assert_eq!(world.block_on(driver.asynch().service()), expected, "{write_us} us");
    }
}

/// The speeds of all motor commands that have left.
#[cfg(feature = "ucp")]
fn speeds(port: &Port) -> Vec<i16> {
    use axlewire::{
        stream::Frames,
        ucp::{Message, Ucp},
    };
    let speed = |message| match message {
        Message::MotorControl(command) => Some(command.speed()),
        _ => None,
    };
    Frames::<Ucp>::new(&port.written).filter_map(|frame| speed(frame.message())).collect()
}

#[cfg(feature = "ucp")]
#[test]
fn a_command_that_waits_for_a_slow_port_is_not_sent_after_it_has_ended() {
    use axlewire::ucp::MotorControl;
    let mut rover = host();
    let world = rover.port().world.clone();
    world.block_on(rover.asynch().stop()).unwrap();
    rover.port_mut().written.clear();
    // It would take the command after 900 ms, if it were still asked to.
    rover.port_mut().writes = vec![Step::Late(900_000)].into();
    let now = rover.now();
    rover.role_mut().drive(MotorControl::new(50, 0).unwrap(), now).unwrap();
    let end = now + ms(1500);
    let span = end - rover.now();
    world.block_on(rover.asynch().run_for(span, |_, _, _| ())).unwrap();
    let speeds = speeds(rover.port());
    assert!(!speeds.is_empty() && speeds.iter().all(|&speed| speed == 0), "{speeds:?}");
}

#[cfg(feature = "ucp")]
#[test]
fn a_command_that_waits_for_a_slow_port_is_not_sent_after_its_call_or_after_a_hold_up() {
    for hold_ms in [0, 2000] {
        let mut rover = host();
        let world = rover.port().world.clone();
        world.block_on(rover.asynch().stop()).unwrap();
        rover.port_mut().written.clear();
        rover.port_mut().writes = vec![Step::Late(300_000)].into();
        {
            let mut drive = std::pin::pin!(rover.asynch().drive_for(50, 0, ms(100)));
            assert!(poll(drive.as_mut()).is_pending());
            world.step(hold_ms * 1000);
            // No robot answers, so nobody sees it stand still.
            assert!(world.block_on(drive).is_err());
        }
        let speeds = speeds(rover.port());
        assert!(!speeds.is_empty() && speeds.iter().all(|&speed| speed == 0), "{hold_ms} ms");
    }
}

#[cfg(feature = "ucp")]
#[test]
fn a_thread_that_wakes_late_does_not_repeat_a_command_behind_the_end_of_its_call() {
    /// Its first idling takes half a second longer.
    struct WakesLate(World, std::rc::Rc<std::cell::Cell<u64>>);
    impl Clock for WakesLate {
        fn now(&self) -> Instant {
            World::now(&self.0)
        }
        fn idle_until(&mut self, until: Instant) {
            self.0.step(self.1.take());
            self.0.idle_until(until);
        }
    }
    let world = World::default();
    let role = Host::new(HostConfig::default(), at_ms(0));
    let late_us = std::rc::Rc::default();
    let clock = WakesLate(world.clone(), std::rc::Rc::clone(&late_us));
    let mut rover = On::new(role, Port::new(&world, 87), clock);
    rover.stop().unwrap();
    rover.port_mut().written.clear();
    world.step(30_000);
    late_us.set(500_000);
    assert!(rover.drive_for(50, 0, ms(190)).is_err(), "no robot answers");
    let speeds = speeds(rover.port());
    assert_eq!(speeds.iter().filter(|&&speed| speed != 0).count(), 1, "{speeds:?}");
}

#[test]
fn a_port_that_always_has_more_does_not_starve_other_tasks() {
    let endless = (0..1000).map(|_| Step::Bytes(vec![0; 64]));
    let mut driver = on(Recorder::default(), Port::reading(endless));
    let mut call = std::pin::pin!(driver.asynch().service());
    assert!(poll(call.as_mut()).is_pending(), "it yields after 4096 bytes");
    assert_eq!(poll(call.as_mut()), std::task::Poll::Ready(Ok(())));
}
