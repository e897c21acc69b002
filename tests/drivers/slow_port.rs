//! How long an async port may take for a frame.

use axlewire::{
    drive::{DriveError, Driver},
    endpoint::Unsent,
};
use embedded_hal_async::delay::DelayNs;

use crate::{
    exact_waits::Pausing,
    port::Unplugged,
    recorder::Recorder,
    virtual_time::{End, VirtualClock, World},
};

/// A port that takes its time for each call.
struct Slow {
    clock: VirtualClock,
    write_us: u32,
    flush_us: u32,
    written: Vec<u8>,
}

impl embedded_io::ErrorType for Slow {
    type Error = Unplugged;
}

impl embedded_io_async::Read for Slow {
    async fn read(&mut self, _: &mut [u8]) -> Result<usize, Unplugged> {
        core::future::pending().await
    }
}

impl embedded_io_async::Write for Slow {
    async fn write(&mut self, bytes: &[u8]) -> Result<usize, Unplugged> {
        if !bytes.is_empty() {
            self.clock.delay_us(self.write_us).await;
        }
        self.written.extend(bytes);
        Ok(bytes.len())
    }

    async fn flush(&mut self) -> Result<(), Unplugged> {
        self.clock.delay_us(self.flush_us).await;
        Ok(())
    }
}

fn slow(world: &World, write_ms: u32, flush_ms: u32) -> Driver<Recorder, Slow, VirtualClock> {
    let clock = VirtualClock(world.clone());
    let (write_us, flush_us) = (write_ms * 1000, flush_ms * 1000);
    let port = Slow { clock: clock.clone(), write_us, flush_us, written: vec![] };
    Driver::new(Recorder::sending(&[b"123"]), port, clock)
}

#[test]
fn a_port_has_stalled_after_a_second_in_a_write_or_in_a_flush() {
    for (write_ms, flush_ms, expected) in
        [(999, 0, Ok(())), (1001, 0, Err(())), (0, 999, Ok(())), (0, 1001, Err(()))]
    {
        let world = World::default();
        let mut driver = slow(&world, write_ms, flush_ms);
        let sent = world.block_on(driver.service_async());
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
        let world = World::default();
        let mut driver = slow(&world, write_ms, flush_ms);
        for frame in 1..4 {
            assert_eq!(world.block_on(driver.service_async()), Ok(()), "{write_ms}, {flush_ms}");
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
        let mut driver = Driver::new(role, End::new(&world, 20), VirtualClock(world.clone()));
        driver.port_mut().stutters = true;
        // A call that is dropped while it waits for the write, or for the flush.
        assert_eq!(world.poll_times(if is_flush { 2 } else { 1 }, driver.service_async()), None);
        world.step(5_000_000);
        // The port needs a moment, as before.
        assert_eq!(world.block_on(driver.service_async()), Ok(()), "flush {is_flush}");
        assert_eq!(driver.port().written, b"123");
    }
}

#[test]
fn the_time_of_a_frame_is_twice_that_of_the_longest_and_a_millisecond() {
    // 64 bytes take 1280 us.
    for (write_us, expected) in [(3559, Ok(())), (3561, Err(DriveError::Stalled))] {
        let world = World::default();
        let clock = VirtualClock(world.clone());
        let port = Slow { clock: clock.clone(), write_us, flush_us: 0, written: vec![] };
        let role = Pausing { repeats: true, ..Pausing::default() };
        let mut driver = Driver::new(role, port, clock);
        assert_eq!(world.poll_times(1, driver.service_async()), None);
        world.step(5_000_000);
        assert_eq!(world.block_on(driver.service_async()), expected, "{write_us} us");
    }
}
