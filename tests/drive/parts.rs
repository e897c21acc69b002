//! What a driver and a port are made of comes back out, and what a clock or a store leaves to
//! its trait does what the trait says.

use crate::rig::*;

#[test]
fn a_driver_gives_back_its_role_its_port_and_its_clock() {
    let clock = || Instant::from_micros(7);
    let mut driver = On::new(Recorder::default(), Port::reading([bytes(3)]), clock);
    driver.service().unwrap();
    let (role, mut port, clock) = driver.into_parts();
    assert_eq!(role.received.len(), 3);
    assert!(!embedded_io::ReadReady::read_ready(&mut port).unwrap(), "it has been read");
    assert_eq!(clock.now(), Instant::from_micros(7));
}

#[test]
fn a_port_with_a_driver_enable_pin_gives_back_its_parts_with_the_pin_as_it_is() {
    let (mut port, log, _pin) = undelayed(Port::default());
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
    let mut clock = clock_that_says(1..);
    clock.idle_until(Instant::from_micros(u64::MAX));
    assert_eq!(clock.now(), Instant::from_micros(1));
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
