//! Frames that did not reach the line: the master decides again (I12).

use crate::rig::*;

const STOPPED_1: MasterEvent = MasterEvent::Stopped { node: NodeId::N1 };

/// The last packet handed out did not leave.
fn fail(desk: &mut Desk, unsent: Unsent) {
    desk.master.handle_transmit(unsent, desk.now);
}

#[test]
fn a_read_that_did_not_leave_opens_no_window_and_is_sent_again() {
    for unsent in [Unsent::Untouched, Unsent::CutOff] {
        let mut desk = Desk::with_nodes(manual(), &[N1]);
        let before = *desk.master.node_statistics(NodeId::N1);
        let reads = desk.master.statistics().reads;
        desk.master.read(NodeId::N1, desk.now).unwrap();
        for _ in 0..10 {
            assert_eq!(desk.packet(), read(NodeId::N1));
            fail(&mut desk, unsent);
            desk.now += MS(1);
        }
        // Ten port failures are not a strike of the node.
        assert_eq!(desk.master.health(NodeId::N1), Some(Health::Online));
        assert_eq!(*desk.master.node_statistics(NodeId::N1), before);
        assert_eq!(desk.master.statistics().reads, reads);
        assert_eq!(desk.exchange(), Some(read(NodeId::N1)));
        assert!(matches!(desk.told()[..], [MasterEvent::Status { .. }]));
    }
}

#[test]
fn a_repeated_read_that_did_not_leave_is_no_repetition() {
    for unsent in [Unsent::Untouched, Unsent::CutOff] {
        let mut desk = Desk::with_nodes(direct(), &[N1]);
        desk.miss();
        for _ in 0..3 {
            assert_eq!(desk.turn(), read(NodeId::N1));
            fail(&mut desk, unsent);
            desk.now += MS(1);
            assert_eq!(desk.master.node_statistics(NodeId::N1).retries, 0);
        }
        assert_eq!(desk.turn(), read(NodeId::N1));
        assert_eq!(desk.master.node_statistics(NodeId::N1).retries, 1);
        // Answered. A new READ is no repetition, whether it leaves or not.
        desk.hear(300, &velocity(NodeId::N1, 0.0));
        assert_eq!(desk.master.node_statistics(NodeId::N1).replies, 2);
        assert_eq!(desk.turn(), read(NodeId::N1));
        fail(&mut desk, unsent);
        assert_eq!(desk.master.node_statistics(NodeId::N1).retries, 1);
    }
}

#[test]
fn a_set_point_that_did_not_leave_is_new_again_unless_another_has_come() {
    for unsent in [Unsent::Untouched, Unsent::CutOff] {
        let mut desk = Desk::turning(manual(), 1.0);
        assert_eq!(desk.packet(), write(NodeId::N1, 1.0));
        assert!(desk.master.is_set_point_sent(NodeId::N1));
        fail(&mut desk, unsent);
        assert!(!desk.master.is_set_point_sent(NodeId::N1));
        assert_eq!(desk.master.statistics().writes, 0);
        let mut other = desk.clone();
        assert_eq!(desk.packet(), write(NodeId::N1, 1.0));
        other.master.set_velocity(NodeId::N1, rps(2.0), other.now).unwrap();
        assert_eq!(writes(&other.packets(9)), [write(NodeId::N1, 2.0)], "the latest wins");
    }
}

#[test]
fn a_set_point_that_did_not_leave_is_never_sent_once_it_is_dropped() {
    for unsent in [Unsent::Untouched, Unsent::CutOff] {
        let mut desk = Desk::turning(manual(), 1.0);
        assert_eq!(desk.packet(), write(NodeId::N1, 1.0));
        let mut released = desk.clone();
        // The driver learns of the failure late, after the application has acted.
        desk.master.stop(NodeId::N1, desk.now);
        fail(&mut desk, unsent);
        let sent = writes(&desk.packets(9));
        assert!(sent.len() > 1 && sent.iter().all(|it| *it == write(NodeId::N1, 0.0)));
        released.master.release(NodeId::N1);
        fail(&mut released, unsent);
        assert_eq!(released.packets(9), [[0; 0]; 0]);
    }
}

#[test]
fn a_stop_and_the_news_that_a_packet_did_not_leave_may_come_in_either_order() {
    for (node, answers) in [(N1, true), (N3, true), (N1, false), (N3, false)] {
        let mut desk = Desk::with_nodes(direct(), &[node]);
        if !answers {
            desk.answer(node.0, Answer::Silence);
        }
        for step in 0..60_u8 {
            match step % 20 {
                // A set-point to be confirmed, which fails if the node is lost.
                3 if node == N1 => drop(desk.master.set_velocity(node.0, rps(1.0), desk.now)),
                3 => drop(desk.master.set_position(node.0, turns(1), desk.now)),
                5 => drop(desk.master.confirm(node.0, desk.now)),
                12 => desk.master.stop(node.0, desk.now),
                _ => {}
            }
            let mut before = desk.clone();
            before.packet();
            for unsent in [Unsent::Untouched, Unsent::CutOff, Unsent::Unflushed] {
                let (mut first, mut last) = (before.clone(), before.clone());
                first.master.stop(node.0, first.now);
                fail(&mut first, unsent);
                fail(&mut last, unsent);
                last.master.stop(node.0, last.now);
                let [first, last] = [first, last].map(|desk| format!("{:?}", desk.master));
                assert_eq!(first, last, "{node:?} {answers} {step} {unsent:?}");
            }
            desk.exchange();
        }
    }
}

#[test]
fn a_stop_write_that_did_not_leave_confirms_nothing() {
    for unsent in [Unsent::Untouched, Unsent::CutOff, Unsent::Unflushed] {
        let mut desk = Desk::stopping(manual(), N1);
        let stop = write(NodeId::N1, 0.0);
        for _ in 0..3 {
            assert_eq!(desk.packet(), stop);
            fail(&mut desk, unsent);
        }
        let sent = desk.until(NodeId::N1, StopProgress::Confirmed);
        let expected = [stop, read(NodeId::N1)];
        assert_eq!(sent, [expected.clone(), expected].concat(), "{unsent:?}");
        assert_eq!(desk.news()[0], STOPPED_1);
    }
}

#[test]
fn after_a_failed_flush_an_answer_does_not_count_for_the_write_in_front_of_its_read() {
    let mut desk = Desk::stopping(manual(), N1);
    assert_eq!(kind(&desk.packet()), (WRITE, 1));
    assert_eq!(kind(&desk.packet()), (READ, 1));
    fail(&mut desk, Unsent::Unflushed);
    // The READ still left.
    desk.hear(450, &velocity(NodeId::N1, 9.0));
    assert_eq!(desk.master.stop_progress(NodeId::N1), StopProgress::Owed);
    assert_eq!(writes(&desk.until(NodeId::N1, StopProgress::Confirmed)).len(), 2);
}

#[test]
fn after_a_failed_flush_all_set_points_are_new_again_including_confirmed_stops() {
    let mut desk = Desk::with_nodes(manual(), &[N1, N3]);
    desk.master.set_position(NodeId::N3, turns(1), desk.now).unwrap();
    desk.packets(9);
    desk.master.stop(NodeId::N1, desk.now);
    desk.until(NodeId::N1, StopProgress::Confirmed);
    fail(&mut desk, Unsent::Unflushed);
    let mut sent = writes(&desk.packets(4));
    sent.sort();
    sent.dedup();
    assert_eq!(sent, [write(NodeId::N1, 0.0), hold(NodeId::N3, turns(1))]);
}

#[test]
fn a_write_that_did_not_leave_is_not_confirmed_by_the_read_after_it() {
    for unsent in [Unsent::Untouched, Unsent::CutOff, Unsent::Unflushed] {
        let mut desk = Desk::turning(manual(), 1.0);
        desk.master.confirm(NodeId::N1, desk.now).unwrap();
        assert_eq!(desk.packet(), write(NodeId::N1, 1.0));
        fail(&mut desk, unsent);
        let sent = desk.packets(9);
        let at =
            sent.iter().position(|it| *it == write(NodeId::N1, 1.0)).expect("it is sent again");
        assert!(sent[at..].contains(&read(NodeId::N1)));
        assert_eq!(desk.news(), [MasterEvent::Confirmed { node: NodeId::N1 }], "{unsent:?}");
    }
}

#[test]
fn a_discovery_on_a_failing_port_skips_no_node() {
    let mut desk = Desk::new(direct());
    NodeId::ALL.into_iter().for_each(|node| desk.answer(node, Answer::Velocity(0.0)));
    desk.master.discover(desk.now);
    for node in NodeId::ALL {
        for _ in 0..5 {
            assert_eq!(desk.packet(), read(node));
            fail(&mut desk, Unsent::Untouched);
        }
        assert_eq!(desk.exchange(), Some(read(node)));
    }
    assert!(!desk.master.is_discovering());
}

#[test]
fn a_failing_port_does_not_use_up_the_immediate_attempt_for_an_abnormal_node() {
    let mut desk = Desk::losing(direct());
    desk.packets(2);
    desk.now += US(500);
    desk.master.stop(NodeId::N1, desk.now);
    let begin = desk.now;
    for unsent in [Unsent::Untouched, Unsent::CutOff] {
        assert_eq!(desk.packet(), write(NodeId::N1, 0.0));
        fail(&mut desk, unsent);
    }
    assert_eq!(desk.packet(), write(NodeId::N1, 0.0));
    assert_eq!(desk.packet(), read(NodeId::N1));
    fail(&mut desk, Unsent::Untouched);
    assert_eq!(kind(&desk.packet()), (READ, 1));
    // The bytes already taken by the port are out after 160 us, followed by 700 us of silence and
    // the time of the WRITE.
    assert_eq!(desk.now, begin + US(160 + 700 + 160), "when the WRITE has left");
}

#[test]
fn a_frame_that_left_is_not_taken_back_twice() {
    let mut desk = Desk::turning(manual(), 1.0);
    assert_eq!(desk.packet(), write(NodeId::N1, 1.0));
    fail(&mut desk, Unsent::Untouched);
    fail(&mut desk, Unsent::Untouched);
    assert_eq!(desk.packets(9), [write(NodeId::N1, 1.0)]);
    let absent = CommandError::NotOnline { node: NodeId::N2 };
    assert_eq!(desk.master.read(NodeId::N2, desk.now), Err(absent));
    assert_eq!(desk.master.statistics().writes, 1);
}

#[test]
fn a_frame_that_did_not_leave_waits_for_bytes_that_are_still_leaving() {
    let mut desk = Desk::stopping(manual(), N1);
    let begin = desk.now;
    assert_eq!(kind(&desk.packet()), (WRITE, 1));
    assert_eq!(kind(&desk.packet()), (READ, 1));
    fail(&mut desk, Unsent::Untouched);
    // The WRITE takes 160 us, the READ after it 80.
    assert_eq!(desk.packet(), read(NodeId::N1));
    assert_eq!(desk.master.poll_timeout(), Some(begin + US(160 + 740)));
    let config = with(manual(), |config| config.turnaround_gap = US(100));
    let mut desk = Desk::with_nodes(config, &[N1]);
    desk.master.read(NodeId::N1, desk.now).unwrap();
    let heard = desk.now;
    desk.turn();
    fail(&mut desk, Unsent::CutOff);
    let cut = desk.now;
    desk.turn();
    // 700 us after the bytes in flight, so that no slave takes the next packet for the rest.
    assert_eq!((cut, desk.now), (heard, cut + US(80 + 100 + 700)), "the gap is kept");
}

#[test]
fn a_node_in_the_search_is_asked_again_at_once_when_its_read_did_not_leave() {
    let mut desk = Desk::losing(direct());
    desk.turn();
    let begin = desk.now;
    fail(&mut desk, Unsent::Untouched);
    assert_eq!((desk.turn(), desk.now), (read(NodeId::N1), begin));
}

#[test]
fn a_read_of_the_search_that_was_cut_off_is_repeated_as_soon_as_the_silence_is_over() {
    for (node, is_stop) in [(N1, false), (N1, true), (N3, false), (N3, true)] {
        let mut desk = Desk::with_nodes(direct(), &[node]);
        desk.lose(node.0);
        if is_stop {
            desk.master.stop(node.0, desk.now);
            // The attempt that is made at once.
            desk.miss();
        }
        assert_eq!(desk.turn(), read(node.0));
        for _ in 0..3 {
            // A moving node that is back must not run on for the pause of the search.
            desk.now += US(200);
            fail(&mut desk, Unsent::CutOff);
            let noticed = desk.now;
            assert_eq!(desk.turn(), read(node.0));
            assert_eq!(desk.now, noticed + US(80 + 2 * 100 + 500), "{node:?}, stop {is_stop}");
        }
    }
}

#[test]
fn a_discovery_of_silent_nodes_on_a_failing_port_makes_all_its_attempts() {
    let mut desk = Desk::new(direct());
    desk.master.discover(desk.now);
    let mut asked = 0;
    while desk.master.is_discovering() {
        desk.turn();
        fail(&mut desk, Unsent::Untouched);
        desk.exchange();
        asked += 1;
    }
    assert_eq!(asked, 24);
}

#[test]
fn the_silence_after_a_cut_off_read_begins_when_the_write_before_it_has_left() {
    let mut desk = Desk::stopping(manual(), N1);
    let begin = desk.now;
    assert_eq!(kind(&desk.packet()), (WRITE, 1));
    assert_eq!(kind(&desk.packet()), (READ, 1));
    assert_eq!(desk.now, begin, "a port may take both at once");
    fail(&mut desk, Unsent::CutOff);
    desk.packet();
    assert_eq!(desk.now, begin + US(160 + 80 + 700));
}

#[test]
fn a_half_sent_write_is_outdated_once_its_mode_is_in_doubt_or_another_one() {
    let aimed = || Desk::turning(manual(), 1.0);
    let stopped = || Desk::stopping(manual(), N1);
    let held = || {
        let mut desk = Desk::stopping_at(manual(), turns(-30));
        assert_eq!(desk.packet(), read(NodeId::N3));
        desk.hear(450, &position(NodeId::N3, turns(-30)));
        desk
    };
    let lost = || {
        let mut desk = Desk::losing(direct());
        desk.master.stop(NodeId::N1, desk.now);
        desk
    };
    let cases = [(aimed(), NodeId::N1), (stopped(), NodeId::N1), (held(), NodeId::N3)];
    for (mut desk, node) in cases.into_iter().chain([(lost(), NodeId::N1)]) {
        assert_eq!(kind(&desk.packet()), (WRITE, node.get()));
        assert!(!desk.master.is_outdated());
        // A late answer in the other mode, between two parts of the WRITE.
        match node {
            NodeId::N1 => desk.hear(50, &position(node, turns(-3))),
            _ => desk.hear(50, &velocity(node, 2.0)),
        }
        assert!(desk.master.is_mode_in_doubt(node) && desk.master.is_outdated());
        fail(&mut desk, Unsent::CutOff);
        assert_eq!(desk.packet(), read(node), "and nothing is written in doubt");
    }
}

#[test]
fn the_write_of_a_dropped_or_replaced_set_point_is_outdated() {
    let fresh = |config| {
        let mut desk = Desk::turning(config, 1.0);
        assert_eq!(desk.packet(), write(NodeId::N1, 1.0));
        assert!(!desk.master.is_outdated());
        desk
    };
    let repeated = || {
        let mut desk = fresh(direct());
        desk.packet();
        desk.hear(450, &velocity(NodeId::N1, 1.0));
        assert_eq!(desk.packet(), write(NodeId::N1, 1.0), "in the cycle");
        assert!(!desk.master.is_outdated());
        desk
    };
    for mut desk in [fresh(manual()), repeated()] {
        let now = desk.now;
        desk.master.set_velocity(NodeId::N1, rps(1.0), now).unwrap();
        assert!(!desk.master.is_outdated(), "the same value again");
        let mut other = desk.clone();
        other.master.set_velocity(NodeId::N1, rps(2.0), now).unwrap();
        assert!(other.master.is_outdated());
        let mut other = desk.clone();
        other.master.release(NodeId::N1);
        assert!(other.master.is_outdated());
        desk.master.stop(NodeId::N1, now);
        assert!(desk.master.is_outdated());
        desk.turn();
        assert!(!desk.master.is_outdated(), "neither a stop nor a READ ever is");
    }
}

#[test]
fn behind_a_packet_that_was_cut_off_the_silence_begins_with_its_flush() {
    for unsent in [Unsent::CutOff, Unsent::Unflushed] {
        let mut desk = Desk::turning(manual(), 1.0);
        assert_eq!(desk.packet(), write(NodeId::N1, 1.0));
        // The port has sent a part of it, or may have, as late as 5 ms after that.
        desk.now += MS(5);
        fail(&mut desk, unsent);
        desk.now += MS(5);
        desk.master.handle_transmit(Transmit::Flushed, desk.now);
        // Ten bytes of silence, twice what ends a packet.
        desk.now += Duration::from_micros(199);
        assert_eq!(desk.master.poll_transmit(desk.now), None, "{unsent:?}");
        desk.now += Duration::from_micros(1);
        assert_eq!(desk.packet(), write(NodeId::N1, 1.0));
    }
}

#[test]
fn through_a_port_that_spoils_every_write_each_node_has_its_turn_of_the_stops() {
    let nodes = [(NodeId::N1, Mode::Velocity), (NodeId::N4, Mode::Velocity)];
    let mut desk = Desk::with_nodes(manual(), &nodes);
    for (id, _) in nodes {
        desk.master.set_velocity(id, rps(5.0), desk.now).unwrap();
    }
    desk.run(MS(20));
    desk.master.stop_all(desk.now);
    let mut stops = vec![];
    for _ in 0..20 {
        let packet = desk.packet();
        if packet[0] == WRITE {
            stops.push(packet[1]);
        }
        fail(&mut desk, Unsent::CutOff);
        desk.now += MS(1);
        desk.master.handle_transmit(Transmit::Flushed, desk.now);
    }
    assert_eq!(stops[..4], [4, 1, 4, 1]);
    assert!(stops.len() >= 10, "{stops:?}");
}
