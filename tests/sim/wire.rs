//! A wire for simulations in real time: the faults of a line, with the time given from outside.

use axlewire::sim::Wire;

use crate::talker::*;

/// Everything that is due by `now`.
fn due(wire: &mut Wire, now: Instant) -> Vec<u8> {
    let mut buffer = [0; 7];
    let mut all = Vec::new();
    loop {
        match wire.receive(&mut buffer, now) {
            0 => return all,
            count => all.extend_from_slice(&buffer[..count]),
        }
    }
}

#[test]
fn a_clean_wire_hands_out_the_same_bytes_at_once() {
    let mut wire = Wire::new(Faults::CLEAN, 5);
    assert_eq!(wire.send(&random_bytes(100_000), at(0)), b"");
    assert_eq!(due(&mut wire, at(0)), random_bytes(100_000));
    let statistics = wire.statistics();
    assert_eq!((statistics.bytes, statistics.bit_errors), (100_000, 0));
    assert_eq!((statistics.lost, statistics.duplicated, statistics.inserted), (0, 0, 0));
}

#[test]
fn the_same_seed_gives_the_same_faults_and_another_seed_others() {
    let heard = |seed| {
        let mut wire = Wire::new(Faults::noise(0.01), seed);
        wire.send(&[0; 10_000], at(0));
        due(&mut wire, at(0))
    };
    assert_eq!(heard(1), heard(1));
    assert_ne!(heard(1), heard(2));
}

#[test]
fn bytes_are_due_after_the_delay_and_the_jitter_and_in_order() {
    let sent: Vec<u8> = (0..=255).collect();
    let mut wire = Wire::new(Faults::CLEAN, 3);
    (wire.faults_mut().delay, wire.faults_mut().jitter) = (us(300), us(100));
    wire.send(&sent, at(1000));
    assert_eq!(due(&mut wire, at(1299)), b"");
    let soon = due(&mut wire, at(1350));
    assert!(soon.len() < 256, "some have more than half of the jitter");
    let next = wire.next().expect("the rest is on its way");
    assert!(next > at(1350) && next <= at(1400), "{next:?}");
    assert_eq!([soon, due(&mut wire, at(1400))].concat(), sent);
    assert_eq!(wire.next(), None);
}

#[test]
fn a_later_transmission_does_not_overtake_when_the_delay_is_taken_away() {
    let mut wire = Wire::new(Faults::CLEAN, 3);
    wire.faults_mut().delay = Duration::from_millis(1);
    wire.send(b"first", at(0));
    wire.faults_mut().delay = Duration::ZERO;
    wire.send(b"second", at(10));
    assert_eq!(due(&mut wire, at(999)), b"");
    assert_eq!(due(&mut wire, at(1000)), b"firstsecond");
}

#[test]
fn a_sender_hears_its_own_damaged_bytes_even_if_the_wire_is_unplugged() {
    let mut faults = Faults::noise(1.0);
    faults.echo = true;
    let mut wire = Wire::new(faults, 1);
    assert_eq!(wire.send(&[0x0F, 0xF0], at(0)), [0xF0, 0x0F]);
    assert_eq!(due(&mut wire, at(0)), [0xF0, 0x0F]);
    wire.faults_mut().unplugged = true;
    assert_eq!(wire.send(&[0x01], at(0)), [0xFE]);
    assert_eq!((due(&mut wire, at(0)), wire.next()), (vec![], None));
    (wire.faults_mut().unplugged, wire.faults_mut().echo) = (false, false);
    assert_eq!(wire.send(&[0x01], at(0)), b"");
    assert_eq!(due(&mut wire, at(0)), [0xFE]);
}
