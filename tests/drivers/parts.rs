//! What a driver and a port are made of comes back out, and what a clock, an endpoint or a store
//! leaves to its trait does what the trait says.

use axlewire::{
    drive::{Clock, Driver},
    endpoint::{Endpoint, Unsent},
    time::Instant,
};

use crate::{
    driver_enable_rig::{drain, undelayed},
    port::Script,
    recorder::{Recorder, bytes},
};

#[test]
fn a_driver_gives_back_its_role_its_port_and_its_clock() {
    let clock = || Instant::from_micros(7);
    let mut driver = Driver::new(Recorder::default(), Script::reading([bytes(3)]), clock);
    driver.service().unwrap();
    let (role, mut port, mut clock) = driver.into_parts();
    assert_eq!(role.received.len(), 3);
    assert!(!embedded_io::ReadReady::read_ready(&mut port).unwrap(), "it has been read");
    assert_eq!(clock.now(), Instant::from_micros(7));
}

#[test]
fn a_port_with_a_driver_enable_pin_gives_back_its_parts_with_the_pin_as_it_is() {
    let (mut port, log, _pin) = undelayed(Script::default());
    embedded_io::Write::write(&mut port, b"1").unwrap();
    assert_eq!(drain(&log), "off on write");
    let (mut port, mut pin, _delay) = port.into_parts();
    assert_eq!(drain(&log), "", "the pin stays on");
    embedded_hal::digital::OutputPin::set_low(&mut pin).unwrap();
    embedded_io::Write::flush(&mut port).unwrap();
    assert_eq!(drain(&log), "off flush");
}

#[test]
fn a_closure_as_a_clock_does_not_idle() {
    let mut calls = 0;
    let mut clock = || {
        calls += 1;
        Instant::from_micros(calls)
    };
    clock.idle_until(Instant::from_micros(u64::MAX));
    assert_eq!(clock.now(), Instant::from_micros(1));
}

/// An endpoint that leaves to the trait what it can.
#[derive(Default)]
struct Plain(Vec<(Vec<u8>, Instant)>);

impl Endpoint for Plain {
    type Event = ();

    fn handle_input(&mut self, bytes: &[u8], now: Instant) {
        self.0.push((bytes.to_vec(), now));
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

#[test]
fn an_endpoint_without_commands_takes_old_bytes_as_new_and_loses_what_did_not_leave() {
    let mut plain = Plain::default();
    let (since, now) = (Instant::from_micros(1), Instant::from_micros(2));
    plain.handle_old_input(&[5], since, now);
    plain.handle_unsent(Unsent::CutOff, now);
    assert_eq!(plain.0, [(vec![5], now)]);
    assert!(plain.poll_transmit(now).is_none() && !plain.is_outdated());
    assert_eq!(plain.held_up_after(), None);
    assert_eq!((plain.frame_pause().as_micros(), plain.wire_time(8).as_micros()), (20_000, 0));
}

#[cfg(feature = "ucp")]
#[test]
fn a_borrowed_store_is_the_store() {
    use axlewire::ucp::host::{BiasStore, MemoryStore};
    use axlewire::ucp::message::{ImuBias, MagBias};

    fn of<S: BiasStore>(mut store: S) -> (Option<ImuBias>, Option<MagBias>) {
        assert!(store.keeps());
        store.store_imu(ImuBias::new([1, 2, 3], [4, 5, 6])).unwrap();
        store.store_mag(MagBias::new([7, 8, 9])).unwrap();
        store.load()
    }
    let mut store = MemoryStore::default();
    let loaded = of(&mut store);
    assert_eq!(loaded, (store.imu, store.mag));
    assert_eq!(store.imu.map(|bias| bias.acc()), Some([1, 2, 3]));
    assert_eq!(store.mag.map(|bias| bias.mag()), Some([7, 8, 9]));
}
