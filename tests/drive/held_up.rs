//! A driver that is held up: how often it looks, and from when on the bytes it finds count as old.

use crate::rig::*;

/// A role that acts on commands: bytes that waited for more than 4 ms are old. Notes since when.
#[derive(Default)]
struct Dated(Vec<(Option<u64>, u64)>);

impl Endpoint for Dated {
    type Event = ();
    fn handle_input(&mut self, _: &[u8], arrived: impl Into<Arrival>) {
        let arrived = arrived.into();
        let since = match arrived {
            Arrival::Now(_) => None,
            Arrival::Between { since, .. } => Some(since.as_micros()),
        };
        self.0.push((since, arrived.now().as_micros()));
    }
    fn line_rules(&self) -> LineRules {
        LineRules { held_up_after: Some(ms(4)), ..LineRules::default() }
    }
    fn handle_timeout(&mut self, _: Instant) {}
    fn poll_transmit(&mut self, _: Instant) -> Option<&[u8]> {
        None
    }
    fn poll_event(&mut self) -> Option<()> {
        None
    }
    fn poll_timeout(&self) -> Option<Instant> {
        None
    }
}

fn story() -> (World, On<Dated>, Port) {
    let world = World::default();
    world.step(1000);
    let (near, far) = Port::pair(&world, 20);
    (world.clone(), on(Dated::default(), near), far)
}

#[test]
fn bytes_count_as_old_if_the_port_was_not_seen_empty_for_longer_than_the_limit() {
    for is_async in BOTH {
        for (late_us, since) in [(3999, None), (4000, None), (4001, Some(6000)), (9000, Some(6000))]
        {
            let (world, mut driver, mut far) = story();
            world.step(5000);
            call!(is_async, driver, service()).unwrap();
            // Nothing was there at 6 ms.
            embedded_io::Write::write(&mut far, b"a").unwrap();
            world.step(late_us);
            call!(is_async, driver, service()).unwrap();
            let now = 6000 + late_us;
            assert_eq!(driver.role().0, [(since, now)], "{late_us} us, async {is_async}");
            // That round saw the port empty again.
            embedded_io::Write::write(&mut far, b"b").unwrap();
            world.step(4000);
            call!(is_async, driver, service()).unwrap();
            assert_eq!(driver.role().0[1], (None, now + 4000));
        }
    }
}

#[test]
fn bytes_from_before_the_first_round_are_as_old_as_the_driver() {
    for (late_us, since) in [(4000, None), (4001, Some(1000))] {
        let (world, mut driver, mut far) = story();
        embedded_io::Write::write(&mut far, b"a").unwrap();
        world.step(late_us);
        driver.service().unwrap();
        assert_eq!(driver.role().0, [(since, 1000 + late_us)]);
    }
}

#[test]
fn a_driver_looks_at_its_port_twice_within_the_limit_even_if_the_role_waits_for_nothing() {
    for is_async in BOTH {
        let (world, mut driver, _far) = story();
        let at = |micros| Some(Instant::from_micros(micros));
        assert_eq!(driver.poll_timeout(), at(3000));
        world.step(500);
        call!(is_async, driver, service()).unwrap();
        assert_eq!(driver.poll_timeout(), at(3500));
        // Waiting, it does so by itself.
        let deadline = at_ms(100);
        let within = deadline - driver.now();
        let event = call!(is_async, driver, next_event(within));
        assert_eq!(event, Ok(None));
        assert_eq!(driver.poll_timeout(), at(102_000));
    }
}
