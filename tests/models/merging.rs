//! The fingerprint itself: which states it merges, and which it separates.

use super::{
    action::{Action, Call, Exchange, Menu},
    bus::Bus,
    fingerprint::COUNTERS_AND_STATUS,
    names::*,
};

const N1: NodeId = NodeId::N1;

fn fingerprint(master: &Master, now: Instant) -> u64 {
    Merge { now, skipped: COUNTERS_AND_STATUS }.fingerprint(master)
}

/// Answers `reads` READs of node 1, each after `latency`, and then commands it.
fn lives(start: u64, reads: u32, latency: u32) -> (Master, Instant) {
    let mut config = MasterConfig::direct();
    config.nodes = [N1].into_iter().collect();
    config.polling = Polling::Manual;
    let mut now = Instant::from_micros(start);
    let mut master = Master::new(config, now);
    master.discover(now);
    for _ in 0..reads {
        assert!(master.poll_transmit(now).is_some());
        now += Duration::from_micros(80 + latency + 160);
        master.handle_input(VelocityResponse::new(N1, Rps::ZERO).as_bytes(), now);
        while master.poll_event().is_some() {}
        master.read(N1, now).unwrap();
    }
    master.set_velocity(N1, Rps::ZERO, now).unwrap();
    (master, now)
}

#[test]
fn masters_that_differ_in_time_and_counters_alone_have_the_same_fingerprint() {
    let (early, now) = lives(0, 3, 50);
    let (late, later) = lives(u64::MAX - 100, 40, 90);
    assert_ne!(format!("{early:?}"), format!("{late:?}"));
    assert_eq!(fingerprint(&early, now), fingerprint(&late, later));
}

#[test]
fn every_difference_in_what_a_master_will_do_changes_the_fingerprint() {
    let (before, now) = lives(0, 3, 50);
    type Change = fn(&mut Master, Instant);
    let changes: [Change; 8] = [
        |_, _| {},
        |master, now| master.stop(N1, now),
        |master, now| master.stop(NodeId::N2, now),
        |master, _| master.release(N1),
        |master, now| master.confirm(N1, now).unwrap(),
        |master, now| master.discover(now),
        |master, now| master.set_velocity(N1, Rps::new(1.0).unwrap(), now).unwrap(),
        |master, now| assert!(master.poll_transmit(now).is_some()),
    ];
    let all: std::collections::HashSet<_> = changes
        .iter()
        .map(|change| {
            let mut after = before.clone();
            change(&mut after, now);
            fingerprint(&after, now)
        })
        .collect();
    // Discovery ends at once if all nodes are online: it leaves an event behind.
    assert_eq!(all.len(), changes.len());
}

#[test]
fn a_time_that_matters_changes_the_fingerprint() {
    let (mut master, now) = lives(0, 3, 50);
    assert!(master.poll_transmit(now).is_some());
    let later = now + Duration::from_micros(1);
    assert_ne!(fingerprint(&master, now), fingerprint(&master, later));
}

#[test]
fn the_world_behind_a_master_is_part_of_the_fingerprint() {
    let start = [Action::Call(Call::Discover), Action::Exchange(Exchange::Right)];
    let config = MasterConfig::direct();
    let bus = Bus::<OneMotor>::new(&[Mode::Velocity], config, Menu::COARSE).after(&start);
    let moved = bus.clone().after(&[Action::Switch(N1)]);
    assert_ne!(bus.fingerprint(), moved.fingerprint());
    let back = moved.after(&[Action::Switch(N1), Action::Reset(N1)]);
    assert_eq!(bus.clone().after(&[Action::Reset(N1)]).fingerprint(), back.fingerprint());
}
