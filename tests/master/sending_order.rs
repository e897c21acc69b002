//! The order in which packets are sent, and the longest wait of each (I13).

use crate::rig::*;

const MIXED: [(NodeId, Mode); 4] = [
    (NodeId::N1, Mode::Position),
    (NodeId::N2, Mode::Velocity),
    (NodeId::N3, Mode::Position),
    (NodeId::N4, Mode::Velocity),
];

fn mixed() -> MasterConfig {
    only(&MIXED.map(|it| it.0))
}

#[test]
fn stops_of_velocity_nodes_go_first_then_positions_in_turn() {
    let mut desk = Desk::with_nodes(mixed(), &MIXED);
    desk.master.stop_all(desk.now);
    let sent = desk.run(MS(20));
    assert_eq!(kinds(&sent[..2]), [(WRITE, 2), (WRITE, 4)]);
    let first_of = |node| sent.iter().position(|it| kind(it) == (WRITE, node)).unwrap();
    let first_read = |node| sent.iter().position(|it| kind(it) == (READ, node)).unwrap();
    for node in [1, 3] {
        assert_eq!(first_of(node), first_read(node) + 1, "a measured position is written next");
    }
    // Each is read once before any is read again.
    let reads: Vec<u8> = sent.iter().filter(|it| it[0] == READ).map(|it| it[1]).take(4).collect();
    let mut once = reads.clone();
    once.sort_unstable();
    assert_eq!(once, [1, 2, 3, 4], "{reads:?}");
}

#[test]
fn a_measured_position_is_written_before_a_stop_given_behind_its_read() {
    let mut desk = Desk::with_nodes(mixed(), &MIXED);
    desk.master.stop(NodeId::N1, desk.now);
    while desk.exchange() != Some(read(NodeId::N1)) {}
    desk.master.stop(NodeId::N2, desk.now);
    assert_eq!(kinds(&desk.packets(2)), [(WRITE, 1), (WRITE, 2)]);
}

#[test]
fn between_two_exchanges_for_one_stop_the_cycle_reads_the_next_node() {
    let nodes = [(NodeId::N1, Mode::Velocity), (NodeId::N2, Mode::Velocity)];
    let mut desk = Desk::with_nodes(only(&nodes.map(|it| it.0)), &nodes);
    // Node 1 has had its turn in the cycle.
    assert_eq!(desk.packets(1), [read(NodeId::N1)]);
    desk.master.stop(NodeId::N1, desk.now);
    let sent = kinds(&desk.packets(5));
    assert_eq!(sent, [(WRITE, 1), (READ, 1), (WRITE, 1), (READ, 2), (READ, 1)]);
    assert_eq!(desk.master.stop_progress(NodeId::N1), StopProgress::Confirmed);
}

#[test]
fn stops_go_before_set_points_set_points_before_discovery_and_discovery_before_the_cycle() {
    let mut desk = Desk::with_nodes(direct(), &MIXED);
    desk.master.discover(desk.now);
    desk.master.set_velocity(NodeId::N2, rps(1.0), desk.now).unwrap();
    desk.master.stop(NodeId::N4, desk.now);
    let sent = kinds(&desk.packets(7));
    let stop = [(WRITE, 4), (READ, 4), (WRITE, 4)];
    assert_eq!(sent[..3], stop);
    assert_eq!(sent[3..5], [(WRITE, 2), (READ, 5)], "a round ends with one of the rest");
    assert_eq!(sent[5..], [(READ, 4), (READ, 6)]);
    while desk.master.is_discovering() {
        let packet = desk.exchange().unwrap();
        assert!(packet[1] > 4, "the cycle waits for the discovery: {packet:02x?}");
    }
}

#[test]
fn a_stop_of_a_silent_node_has_one_attempt_per_round_and_delays_no_other_node() {
    let mut desk = Desk::with_nodes(mixed(), &MIXED);
    desk.answer(NodeId::N1, Answer::Silence);
    desk.master.stop(NodeId::N1, desk.now);
    desk.master.stop(NodeId::N3, desk.now);
    let sent = kinds(&desk.packets(12));
    let mut since = 0;
    for packet in &sent {
        since = if *packet == (READ, 1) { 0 } else { since + 1 };
    }
    assert!(sent.contains(&(WRITE, 3)));
    let attempts = sent.iter().filter(|it| **it == (READ, 1)).count();
    assert!((2..=4).contains(&attempts), "{sent:02x?}");
    let twice = sent.windows(2).any(|it| it == [(READ, 1), (READ, 1)]);
    assert!(!twice, "{sent:02x?}");
}

/// Eight nodes; all but the last get a new set-point before each packet, and are stopped
/// occasionally. The longest wait of anything for node 8, in exchanges and in other WRITEs.
fn longest_wait(
    mode: Mode,
    begin: impl Fn(&mut Desk),
    is_done: impl Fn(&Desk, &[u8]) -> bool,
) -> (usize, usize) {
    let nodes = NodeId::ALL.map(|node| match node {
        NodeId::N8 => (node, mode),
        _ if node.get() % 2 == 0 => (node, Mode::Position),
        _ => (node, Mode::Velocity),
    });
    let mut longest = (0, 0);
    for offset in 0..40 {
        let mut desk = Desk::with_nodes(direct(), &nodes);
        let (mut exchanges, mut other_writes, mut has_begun) = (0, 0, false);
        for turn in 0..600 {
            for (node, mode) in nodes.into_iter().take(7) {
                // Refused while its stop is owed.
                let _ = match mode {
                    Mode::Velocity => desk.master.set_velocity(node, rps(1.0), desk.now),
                    Mode::Position => desk.master.set_position(node, turns(1), desk.now),
                };
                if turn % 3 == 0 && desk.master.stop_progress(node) != StopProgress::Owed {
                    desk.master.stop(node, desk.now);
                }
            }
            if turn == 100 + offset {
                begin(&mut desk);
                has_begun = true;
            }
            let packet = desk.exchange().unwrap();
            if has_begun && is_done(&desk, &packet) {
                break;
            }
            exchanges += usize::from(has_begun && packet[0] == READ);
            other_writes += usize::from(has_begun && packet[0] == WRITE);
            assert!(turn < 599, "it waits forever");
        }
        longest = (longest.0.max(exchanges), longest.1.max(other_writes));
    }
    longest
}

#[test]
fn a_velocity_stop_waits_for_the_exchange_under_way_and_at_most_seven_other_stops() {
    let begin = |desk: &mut Desk| desk.master.stop(NodeId::N8, desk.now);
    let (exchanges, writes) =
        longest_wait(Mode::Velocity, begin, |_, packet| *packet == write(NodeId::N8, 0.0));
    assert!(exchanges == 0 && writes <= 7, "{exchanges} exchanges, {writes} WRITEs");
}

#[test]
fn a_position_stop_is_read_after_at_most_16_exchanges() {
    let begin = |desk: &mut Desk| desk.master.stop(NodeId::N8, desk.now);
    let (exchanges, _) =
        longest_wait(Mode::Position, begin, |_, packet| *packet == read(NodeId::N8));
    assert!((1..=16).contains(&exchanges), "{exchanges}");
}

#[test]
fn a_new_set_point_waits_for_at_most_16_exchanges_and_14_other_writes() {
    let begin = |desk: &mut Desk| desk.master.set_velocity(NodeId::N8, rps(4.0), desk.now).unwrap();
    let (exchanges, writes) =
        longest_wait(Mode::Velocity, begin, |_, packet| *packet == write(NodeId::N8, 4.0));
    assert!(exchanges <= 16 && writes <= 14, "{exchanges} exchanges, {writes} WRITEs");
}

#[test]
fn a_node_in_the_cycle_waits_for_at_most_8_rounds_of_17_exchanges() {
    let begin = |desk: &mut Desk| desk.master.read(NodeId::N8, desk.now).unwrap();
    let (exchanges, _) =
        longest_wait(Mode::Velocity, begin, |_, packet| *packet == read(NodeId::N8));
    assert!((1..=8 * 17).contains(&exchanges), "{exchanges}");
}

#[test]
fn behind_a_write_that_is_leaving_only_reads_and_stops_are_handed_out() {
    let mut desk = Desk::with_nodes(direct(), &[N1, (NodeId::N2, Mode::Velocity)]);
    desk.master.set_velocity(NodeId::N1, rps(1.0), desk.now).unwrap();
    desk.master.set_velocity(NodeId::N2, rps(2.0), desk.now).unwrap();
    let begin = desk.now;
    assert_eq!(desk.packet(), write(NodeId::N2, 2.0));
    assert_eq!(desk.master.poll_transmit(desk.now), None, "set-points do not pile up in the port");
    desk.master.stop(NodeId::N1, desk.now);
    assert_eq!(desk.packet(), write(NodeId::N1, 0.0));
    assert_eq!(desk.packet(), read(NodeId::N1));
    assert_eq!(desk.now, begin);
}

#[test]
fn even_if_positions_can_be_written_at_once_velocity_nodes_go_first() {
    let config = with(mixed(), |config| config.hold_age = MS(1000));
    let mut desk = Desk::with_nodes(config, &MIXED);
    desk.master.stop_all(desk.now);
    let mut sent = kinds(&desk.packets(4));
    sent[..2].sort_unstable();
    sent[2..].sort_unstable();
    assert_eq!(sent, [(WRITE, 2), (WRITE, 4), (WRITE, 1), (WRITE, 3)]);
}

/// Eight velocity nodes, node 2 of them lost, and an application that sets continuously.
fn one_is_gone(change: impl Fn(&mut MasterConfig)) -> Desk {
    let mut config = direct();
    change(&mut config);
    let mut desk = Desk::with_nodes(config, &NodeId::ALL.map(|node| (node, Mode::Velocity)));
    lose_a_busy_one(&mut desk, NodeId::N2);
    desk
}

/// A node falls silent, and is found to be abnormal although the line is busy.
fn lose_a_busy_one(desk: &mut Desk, node: NodeId) {
    desk.answer(node, Answer::Silence);
    let fell_silent = desk.now;
    while desk.master.health(node) != Some(Health::Abnormal) {
        assert!(desk.now < fell_silent + desk.master.read_bound(), "node {node} is not read");
        set_all(desk);
    }
}

/// A new set-point for every node that accepts one, and the next packet.
fn set_all(desk: &mut Desk) -> (u8, u8) {
    for node in NodeId::ALL {
        let _ = desk.master.set_velocity(node, rps(1.0), desk.now);
    }
    kind(&desk.exchange().expect("something to do"))
}

#[test]
fn the_search_for_a_node_that_is_gone_keeps_no_other_from_being_read_whatever_its_share() {
    for (share, gap) in [(5, 0), (20, 0), (40, 0), (50, 0), (20, 500), (5, 2000)] {
        let mut desk = one_is_gone(|config| {
            (config.recovery_share_pct, config.turnaround_gap) = (share, US(gap));
        });
        let (mut since, mut longest, mut sought) = ([0; 8], 0, 0);
        for _ in 0..2000 {
            let packet = set_all(&mut desk);
            sought += usize::from(packet == (READ, 2));
            for (node, since) in (1..).zip(&mut since).filter(|it| it.0 != 2) {
                *since = if packet == (READ, node) { 0 } else { *since + 1 };
                longest = longest.max(*since);
            }
        }
        // Seven turns of the others, one more of the search, and seven WRITEs before each.
        assert!(longest <= 7 * 8 + 8 * 9, "{share} %, {gap} us: {longest} packets without a READ");
        assert!(sought > 5, "{share} %, {gap} us: {sought} attempts");

        lose_a_busy_one(&mut desk, NodeId::N3);
        assert!(desk.master.stops_owed().contains(NodeId::N3), "it was under a set-point");
    }
}
