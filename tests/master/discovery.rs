//! Discovery: which nodes are asked, how often, and what takes precedence.

use crate::rig::*;

#[test]
fn a_discovery_asks_every_id_once_and_silent_ones_again() {
    let mut desk = Desk::new(direct());
    desk.master.discover(desk.now);
    let mut asked = vec![];
    while desk.master.is_discovering() {
        let request = desk.turn();
        assert_eq!(request[0], 0xAA);
        asked.push(request[1]);
        match request[1] {
            1 => desk.hear(290, &velocity(NodeId::N1, 0.0)),
            3 => desk.hear(290, &position(NodeId::N3, Position::new(0, 1))),
            _ => desk.silence(),
        }
    }
    assert_eq!(asked, [1, 2, 3, 4, 5, 6, 7, 8, 2, 4, 5, 6, 7, 8, 2, 4, 5, 6, 7, 8]);
    let events = desk.told();
    assert_eq!(events[0], MasterEvent::Discovered { node: NodeId::N1, mode: Mode::Velocity });
    assert_eq!(events[2], MasterEvent::Discovered { node: NodeId::N3, mode: Mode::Position });
    assert_eq!(events.last(), Some(&MasterEvent::DiscoveryDone { online: 2 }));
    assert_eq!(desk.master.mode(NodeId::N3), Some(Mode::Position));
    assert_eq!(desk.master.health(NodeId::N2), None);
}

#[test]
fn a_discovery_of_an_empty_bus_ends_and_leaves_nothing_to_do() {
    let mut desk = Desk::with_nodes(direct(), &[]);
    assert_eq!(desk.master.statistics().reads, 24);
    assert_eq!(desk.master.poll_timeout(), None);
    assert_eq!(desk.master.poll_transmit(desk.now), None);
}

#[test]
fn a_discovery_of_a_full_bus_asks_eight_times() {
    let nodes = NodeId::ALL.map(|node| (node, Mode::Velocity));
    let desk = Desk::with_nodes(direct(), &nodes);
    assert_eq!(desk.master.statistics().reads, 8);
    assert!(NodeId::ALL.iter().all(|&node| desk.master.health(node) == Some(Health::Online)));
}

#[test]
fn a_second_discovery_asks_only_nodes_that_are_not_online_and_lets_stops_through() {
    let mut desk = Desk::with_nodes(direct(), &[N1]);
    desk.master.discover(desk.now);
    assert_eq!(desk.turn(), read(NodeId::N2));
    desk.master.stop(NodeId::N1, desk.now);
    desk.silence();
    let stop = write(NodeId::N1, 0.0);
    let expected = [stop.clone(), read(NodeId::N1), stop, read(NodeId::N3), read(NodeId::N1)];
    assert_eq!(desk.packets(5), expected, "a stop neither waits nor delays the others");
}

#[test]
fn a_repeated_discovery_joins_the_running_one() {
    let mut desk = Desk::new(direct());
    desk.master.discover(desk.now);
    for id in 1..=8 {
        desk.master.discover(desk.now);
        assert_eq!(desk.turn()[1], id);
        desk.silence();
    }
    let mut asked = 8;
    while desk.master.is_discovering() {
        desk.master.discover(desk.now);
        desk.miss();
        asked += 1;
    }
    assert_eq!(asked, 3 * 8, "as often as without the extra calls");
}

#[test]
fn an_application_that_discovers_all_the_time_does_not_keep_the_nodes_from_being_read() {
    let mut desk = Desk::with_nodes(direct(), &[N1, N3]);
    desk.master.set_velocity(NodeId::N1, rps(1.0), desk.now).unwrap();
    let (mut since, mut longest) = ([0, 0], 0);
    for _ in 0..600 {
        desk.master.discover(desk.now);
        let request = desk.exchange().unwrap();
        for (node, since) in [1, 3].into_iter().zip(&mut since) {
            *since = if kind(&request) == (READ, node) { 0 } else { *since + 1 };
            longest = longest.max(*since);
        }
    }
    // Two discoveries of six silent ids with three attempts each, and the turns of both nodes.
    assert!((36..=36 + 16).contains(&longest), "{longest} packets without a READ of a node");
    desk.answer(NodeId::N1, Answer::Silence);
    for _ in 0..4 * 52 {
        desk.master.discover(desk.now);
        desk.exchange().unwrap();
    }
    assert_eq!(desk.master.health(NodeId::N1), Some(Health::Abnormal));
    assert!(desk.master.stops_owed().contains(NodeId::N1), "it was under a set-point");
}

#[test]
fn an_application_that_discovers_all_the_time_does_not_keep_a_lost_node_from_being_stopped() {
    for config in [direct(), MasterConfig::usb_adapter()] {
        let mut desk = Desk::turning(config, 1.0);
        desk.lose(NodeId::N1);
        let (begin, mut stops) = (desk.now, 0);
        while desk.now < begin + MS(2000) {
            desk.master.discover(desk.now);
            stops += usize::from(desk.exchange().unwrap() == write(NodeId::N1, 0.0));
        }
        // At the search rate: 5 % of the time, one window each.
        let window = config.reply_timeout.as_micros();
        let expected = 2_000_000 / (20 * (window + 400));
        assert!(stops as u32 > expected / 2, "{stops} blind stops instead of {expected}");
    }
}

#[test]
fn continuous_discoveries_find_every_node_that_is_owed_a_stop() {
    // Node 2 is asked in every discovery, and is never there.
    let mut desk = Desk::with_nodes(only(&[NodeId::N1, NodeId::N2]), &[N1]);
    desk.master.stop(NodeId::N5, desk.now);
    for _ in 0..500 {
        desk.master.discover(desk.now);
        desk.exchange().unwrap();
    }
    desk.answer(NodeId::N5, Answer::Velocity(5.0));
    let back = desk.now;
    while desk.master.stop_progress(NodeId::N5) != StopProgress::Confirmed {
        desk.master.discover(desk.now);
        desk.exchange().unwrap();
        assert!(desk.now < back + MS(100), "its stop stays owed");
    }
}

#[test]
fn a_discovery_reads_a_node_that_is_owed_a_stop_and_writes_nothing_blind() {
    let mut config = direct();
    // The search has had its turn, and is not due for a while.
    config.recovery_share_pct = 1;
    let mut desk = Desk::turning(config, 1.0);
    desk.lose(NodeId::N1);
    while desk.exchange().unwrap() != read(NodeId::N1) {}
    while desk.exchange().unwrap() != read(NodeId::N1) {}
    desk.master.discover(desk.now);
    let sent = desk.packets(10);
    assert!(sent.contains(&read(NodeId::N1)), "{sent:02x?}");
    assert_eq!(writes(&sent), Vec::<Vec<u8>>::new());
}

#[test]
fn a_driver_that_sleeps_between_a_discovery_and_the_turns_that_go_first_is_never_late() {
    for period in [US(300), US(700), US(1100), MS(3)] {
        let mut config = only(&[NodeId::N1, NodeId::N2]);
        config.polling = Polling::Every(period);
        let mut desk = Desk::with_nodes(config, &[N1]);
        let mut reads = 0;
        for _ in 0..1000 {
            desk.master.discover(desk.now);
            // The rig checks whether anything was due earlier.
            reads += usize::from(desk.exchange().unwrap() == read(NodeId::N1));
        }
        assert!(reads > 100, "{reads} of {period:?}");
    }
}

#[test]
fn a_discovery_counts_the_nodes_that_are_online_or_suspect_at_its_end() {
    let mut desk = Desk::with_nodes(with(manual(), |config| config.attempts = 1), &[N1, N3]);
    desk.master.read(NodeId::N1, desk.now).unwrap();
    desk.miss();
    assert_eq!(desk.master.health(NodeId::N1), Some(Health::Suspect(1)));
    desk.master.discover(desk.now);
    desk.run(MS(50));
    assert!(desk.told().contains(&MasterEvent::DiscoveryDone { online: 2 }));
    let mut desk = Desk::with_nodes(direct(), &[N1, N3]);
    desk.lose(NodeId::N3);
    desk.told();
    for (answer, online) in [(Answer::Silence, 1), (Answer::Position(Position::new(7, 3)), 2)] {
        desk.answer(NodeId::N3, answer);
        desk.master.discover(desk.now);
        while desk.master.is_discovering() {
            desk.exchange().unwrap();
        }
        let done = MasterEvent::DiscoveryDone { online };
        assert!(desk.told().contains(&done), "{answer:?}");
    }
}
