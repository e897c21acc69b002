//! Answer windows: which packet counts as the answer to a request, and which is late (I7).

use crate::rig::*;

#[test]
fn the_window_is_the_timeout_plus_the_wire_time_after_the_end_of_the_request() {
    let mut desk = Desk::asking(direct());
    // 80 us of request, 500 us of patience, 160 us of answer.
    assert_eq!(desk.master.poll_timeout(), Some(desk.now + US(740)));
    desk.hear(740, &velocity(NodeId::N1, 1.0));
    assert!(
        matches!(desk.told()[..], [MasterEvent::Status { .. }]),
        "at the deadline counts as in time"
    );

    desk.turn_with(741, &velocity(NodeId::N1, 1.0));
    desk.master.handle_timeout(desk.now);
    assert_eq!(desk.told(), [turned(NodeId::N1, Health::Suspect(1))], "after it does not");
    assert_eq!(desk.master.node_statistics(NodeId::N1).late, 1);
}

#[test]
fn a_request_that_the_port_held_back_within_its_window_has_a_window_from_there() {
    for (flushed_us, deadline_us) in [(0, 740), (80, 740), (81, 741), (400, 1060), (740, 1400)] {
        let mut desk = Desk::asking(direct());
        let begin = desk.now;
        desk.master.handle_transmit(Transmit::Taken, begin);
        desk.master.handle_transmit(Transmit::Flushed, begin + US(flushed_us));
        assert_eq!(desk.master.poll_timeout(), Some(begin + US(deadline_us)), "{flushed_us} us");
        let mut late = desk.clone();
        desk.hear(deadline_us, &velocity(NodeId::N1, 1.0));
        assert!(matches!(desk.told()[..], [MasterEvent::Status { .. }]), "{flushed_us} us");
        assert_eq!(desk.turn(), read(NodeId::N1), "the line is free");
        assert_eq!(desk.now, begin + US(deadline_us));

        late.hear(deadline_us + 1, &velocity(NodeId::N1, 1.0));
        assert_eq!(late.told(), [], "{flushed_us} us");
        assert_eq!(late.master.node_statistics(NodeId::N1).late, 1);
    }
}

#[test]
fn a_request_that_left_after_its_window_keeps_the_line_free_for_an_answer_that_is_not_taken() {
    // The write takes long, or the flush.
    for (taken_us, flushed_us) in [(741, 741), (741, 9000), (0, 741), (0, 9000)] {
        let mut desk = Desk::with_nodes(direct(), &[N1, N3]);
        desk.turn();
        let begin = desk.now;
        desk.master.handle_transmit(Transmit::Taken, begin + US(taken_us));
        desk.now = begin + US(740.max(taken_us));
        desk.master.handle_timeout(desk.now);
        assert_eq!(desk.told(), [turned(NodeId::N1, Health::Suspect(1))]);
        assert_eq!(desk.master.poll_transmit(desk.now), None);
        desk.master.handle_transmit(Transmit::Flushed, begin + US(flushed_us));
        desk.now = begin + US(flushed_us);
        desk.hear(210, &velocity(NodeId::N1, 1.0));
        assert_eq!(desk.told(), []);
        assert_eq!(desk.master.node_statistics(NodeId::N1).late, 1);
        // 500 us of patience and 160 us of answer behind the flush.
        let end = begin + US(flushed_us + 660);
        assert_eq!(desk.master.poll_timeout(), Some(end));
        assert_eq!(desk.turn(), read(NodeId::N3));
        assert_eq!(desk.now, end);
        desk.hear(290, &position(NodeId::N3, turns(2)));
        assert_eq!(desk.told(), [reading(NodeId::N3, Status::Position(turns(2)))]);
        // The node may be late by its guard, as always.
        while desk.turn() != read(NodeId::N1) {
            desk.hear(290, &position(NodeId::N3, turns(2)));
        }
        assert!(desk.now >= end + US(500));
    }
}

#[test]
fn a_flush_that_begins_in_the_window_and_ends_after_it_closes_it_without_an_answer() {
    let mut desk = Desk::asking(direct());
    let begin = desk.now;
    desk.master.handle_transmit(Transmit::Taken, begin);
    // Nobody has let time pass meanwhile.
    desk.now = begin + US(741);
    desk.master.handle_transmit(Transmit::Flushed, desk.now);
    assert_eq!(desk.told(), [turned(NodeId::N1, Health::Suspect(1))]);
    desk.hear(1, &velocity(NodeId::N1, 1.0));
    assert_eq!(desk.told(), []);
    // The line is free then, but the node may be late by its guard.
    assert_eq!(desk.master.poll_timeout(), Some(begin + US(741 + 660 + 500)));
}

#[test]
fn an_answer_shows_that_its_request_has_left() {
    let mut desk = Desk::asking(direct());
    desk.master.handle_transmit(Transmit::Taken, desk.now);
    desk.hear(290, &velocity(NodeId::N1, 1.0));
    assert_eq!(desk.turn(), read(NodeId::N1), "the line is free");
    let begin = desk.now;
    desk.master.handle_transmit(Transmit::Taken, begin);
    desk.hear(290, &velocity(NodeId::N1, 2.0));
    assert_eq!(desk.told().len(), 2, "and the next answer counts");
}

#[test]
fn while_a_port_does_not_flush_requests_go_on_after_a_second_but_no_answer_counts() {
    let mut desk = Desk::asking(direct());
    let held_at = desk.now;
    desk.master.handle_transmit(Transmit::Taken, held_at);
    for _ in 0..2 {
        assert_eq!(desk.turn(), read(NodeId::N1));
        assert!(desk.now >= held_at + MS(1000));
        desk.master.handle_transmit(Transmit::Taken, desk.now);
        // Whose answer is it?
        desk.hear(290, &velocity(NodeId::N1, 1.0));
        desk.silence();
    }
    assert_eq!(desk.now, held_at + MS(1000) + US(740 + 500 + 740), "no second is lost again");
    assert_eq!(desk.master.node_statistics(NodeId::N1).late, 2);
    let statuses = desk.told();
    assert!(!statuses.iter().any(|event| matches!(event, MasterEvent::Status { .. })));

    // Everything has left: an answer to one of those may come, and then they count again.
    let flushed_at = desk.now + US(100);
    desk.master.handle_transmit(Transmit::Flushed, flushed_at);
    assert_eq!(desk.turn(), read(NodeId::N1));
    assert!(desk.now >= flushed_at + US(660));
    desk.hear(290, &velocity(NodeId::N1, 3.0));
    assert!(desk.told().contains(&reading(NodeId::N1, Status::Velocity(3.0))));
}

/// A port that holds back a READ of node 3, and after a second takes a WRITE to node 1 as well.
fn holding_back() -> Desk {
    let mut desk = Desk::with_nodes(manual(), &[N1, N3]);
    desk.master.read(NodeId::N3, desk.now).unwrap();
    desk.turn();
    desk.master.handle_transmit(Transmit::Taken, desk.now);
    desk.silence();
    desk.master.set_velocity(NodeId::N1, rps(1.0), desk.now).unwrap();
    assert_eq!(desk.packet(), write(NodeId::N1, 1.0));
    desk
}

#[test]
fn a_late_flush_keeps_the_line_free_for_the_answer_also_behind_a_write() {
    for next_is_stop in [false, true] {
        let mut desk = holding_back();
        desk.master.handle_transmit(Transmit::Taken, desk.now);
        desk.master.handle_transmit(Transmit::Flushed, desk.now);
        let end = desk.now + US(660);
        if next_is_stop {
            desk.master.stop(NodeId::N1, desk.now);
        } else {
            desk.master.read(NodeId::N1, desk.now).unwrap();
        }
        assert_eq!(desk.master.poll_transmit(desk.now), None, "stop {next_is_stop}");
        desk.hear(300, &position(NodeId::N3, turns(2)));
        assert_eq!(desk.master.node_statistics(NodeId::N3).late, 1);
        let stop = write(NodeId::N1, 0.0);
        let expected = if next_is_stop { stop } else { read(NodeId::N1) };
        assert_eq!((desk.packet(), desk.now), (expected, end));
    }
}

#[test]
fn every_node_whose_request_left_late_is_guarded_and_no_node_that_was_only_told_something() {
    for is_asked in [false, true] {
        let mut desk = holding_back();
        desk.master.read(NodeId::N1, desk.now).unwrap();
        if is_asked {
            assert_eq!(desk.turn(), read(NodeId::N1), "both have been asked");
            desk.master.handle_transmit(Transmit::Taken, desk.now);
        }
        desk.master.handle_transmit(Transmit::Flushed, desk.now);
        let end = desk.now + US(660);
        if !is_asked {
            assert_eq!((desk.turn(), desk.now), (read(NodeId::N1), end));
            desk.hear(340, &velocity(NodeId::N1, 1.0));
        }
        // An answer up to the end of the guard meets no window.
        desk.now = end + US(499);
        desk.hear(0, &position(NodeId::N3, turns(9)));
        assert_eq!(desk.master.node_statistics(NodeId::N3).late, 1);
        let mut asked = vec![];
        while asked != read(NodeId::N3) {
            asked = desk.turn();
            assert!(desk.now >= end + US(500), "{asked:02x?} at {:?}", desk.now);
            desk.silence();
        }
    }
}

#[test]
fn a_flush_that_ends_while_several_requests_may_be_answered_closes_the_window() {
    let mut desk = Desk::asking(direct());
    desk.master.handle_transmit(Transmit::Taken, desk.now);
    desk.turn();
    desk.master.handle_transmit(Transmit::Taken, desk.now);
    desk.master.handle_transmit(Transmit::Flushed, desk.now + US(10));
    desk.told();
    // In the window that it had.
    desk.hear(290, &velocity(NodeId::N1, 1.0));
    assert_eq!(desk.told(), []);
    assert_eq!(desk.master.poll_transmit(desk.now), None);
}

#[test]
fn a_request_given_up_in_doubt_keeps_the_line_free_for_its_answer() {
    let mut desk = Desk::asking(direct());
    let begin = desk.now;
    desk.master.handle_transmit(Transmit::Taken, begin + US(400));
    desk.master.handle_transmit(Unsent::CutOff, begin + US(400));
    desk.master.handle_transmit(Transmit::Flushed, begin + US(400));
    desk.now = begin + US(400);
    desk.hear(300, &velocity(NodeId::N1, 1.0));
    assert_eq!(desk.told(), []);
    assert_eq!(desk.master.poll_timeout(), Some(begin + US(400 + 660 + 500)), "and the guard");
    assert_eq!(desk.master.poll_transmit(begin + US(400 + 660)), None);
    desk.master.set_velocity(NodeId::N1, rps(1.0), desk.now).unwrap();
    assert_eq!(desk.packet(), write(NodeId::N1, 1.0), "it waits for no late answer");
    assert_eq!(desk.now, begin + US(400 + 660));
}

#[test]
fn behind_a_write_the_window_begins_when_both_requests_have_left() {
    let mut desk = Desk::turning(direct(), 1.0);
    desk.turn();
    assert_eq!(desk.master.poll_timeout(), Some(desk.now + US(160 + 740)));
}

#[test]
fn bytes_from_before_the_request_are_dropped() {
    let mut desk = Desk::with_nodes(direct(), &[N1]);
    let answer = velocity(NodeId::N1, 9.0);
    desk.hear(10, &answer[..5]);
    desk.turn();
    desk.hear(290, &answer[5..]);
    assert_eq!(desk.told(), []);
    assert_eq!(desk.master.statistics().stale_bytes, 5);
}

#[test]
fn a_stray_byte_before_every_answer_costs_nothing() {
    for stray in 0..=u8::MAX {
        let mut desk = Desk::with_nodes(direct(), &[N1]);
        for turn in 0..5 {
            desk.turn();
            let answer = [&[stray][..], &velocity(NodeId::N1, turn as f32)].concat();
            desk.hear(310, &answer);
            assert_eq!(
                desk.told(),
                [reading(NodeId::N1, Status::Velocity(turn as f32))],
                "{stray:#x}"
            );
        }
    }
}

#[test]
fn an_answer_of_another_node_is_counted_and_never_accepted() {
    let mut desk = Desk::with_nodes(direct(), &[N1, N3]);
    assert_eq!(desk.turn(), read(NodeId::N1));
    desk.hear(290, &position(NodeId::N3, Position::new(1, 1)));
    assert_eq!(desk.told(), []);
    assert_eq!(desk.master.node_statistics(NodeId::N3).late, 1);
    desk.hear(100, &velocity(NodeId::N1, 2.0));
    assert_eq!(desk.told(), [reading(NodeId::N1, Status::Velocity(2.0))], "the window stayed open");
}

#[test]
fn a_late_answer_is_not_taken_for_the_next_one() {
    let mut desk = Desk::with_nodes(direct(), &[N1]);
    desk.miss();
    // The node is not asked again before the guard ends, and the late answer meets no window.
    desk.hear(400, &velocity(NodeId::N1, 9.0));
    assert_eq!(desk.master.poll_transmit(desk.now), None);
    desk.turn_with(290, &velocity(NodeId::N1, 1.0));
    let mut told = desk.told();
    told.retain(|event| matches!(event, MasterEvent::Status { .. }));
    assert_eq!(told, [reading(NodeId::N1, Status::Velocity(1.0))]);
    assert_eq!(desk.master.node_statistics(NodeId::N1).late, 1);
}

#[test]
fn a_write_that_is_not_answered_does_not_wait_for_a_late_answer() {
    for is_stop in [false, true] {
        let mut desk = Desk::with_nodes(direct(), &[N1]);
        desk.miss();
        assert_eq!(desk.master.poll_timeout(), Some(desk.now + US(500)), "the guard");
        if is_stop {
            desk.master.stop(NodeId::N1, desk.now);
        } else {
            desk.master.set_velocity(NodeId::N1, rps(2.0), desk.now).unwrap();
        }
        let sent = desk.master.poll_transmit(desk.now).map(<[u8]>::to_vec);
        assert_eq!(sent, Some(write(NodeId::N1, if is_stop { 0.0 } else { 2.0 })));
    }
}

#[test]
fn while_one_node_is_guarded_the_others_are_read() {
    let mut desk = Desk::with_nodes(direct(), &[N1, N3]);
    assert_eq!(desk.turn(), read(NodeId::N1));
    desk.silence();
    let closed = desk.now;
    assert_eq!(desk.turn(), read(NodeId::N3));
    assert_eq!(desk.now, closed);
}

#[test]
fn a_second_answer_to_one_request_is_late() {
    let mut desk = Desk::asking(direct());
    let twice = [velocity(NodeId::N1, 1.0), velocity(NodeId::N1, 2.0)].concat();
    desk.hear(450, &twice);
    assert_eq!(desk.told(), [reading(NodeId::N1, Status::Velocity(1.0))]);
    assert_eq!(desk.master.node_statistics(NodeId::N1).late, 1);
}

#[test]
fn any_f32_is_a_status() {
    let mut desk = Desk::asking(direct());
    let nan = [0x55, 0x01, 0x00, 0x00, 0xC0, 0x7F];
    let mut answer = nan.to_vec();
    answer.extend(axlewire::crc16::compute(&nan).to_le_bytes());
    desk.hear(290, &answer);
    let [MasterEvent::Status { status: Status::Velocity(rps), .. }] = desk.told()[..] else {
        panic!()
    };
    assert!(rps.is_nan());
}

#[test]
fn latencies_are_measured_from_the_end_of_the_request_to_the_beginning_of_the_answer() {
    let mut desk = Desk::with_nodes(direct(), &[N1]);
    for latency in [10, 20, 90] {
        desk.turn();
        desk.hear(80 + latency + 160, &velocity(NodeId::N1, 0.0));
    }
    let statistics = desk.master.node_statistics(NodeId::N1);
    let latency = statistics.latency;
    let found = [latency.min(), latency.mean(), latency.max()];
    // The discovery's answer took 50 us.
    assert_eq!(found, [US(10), US((10 + 20 + 90 + 50) / 4), US(90)].map(Some));
    assert_eq!((latency.count(), latency.last()), (4, Some(US(90))));
    assert_eq!((statistics.requests, statistics.replies), (4, 4));
}

#[test]
fn a_late_answer_to_the_third_strike_does_not_answer_the_search_for_the_node() {
    let mut desk = Desk::with_nodes(direct(), &[N1]);
    for _ in 0..3 {
        desk.miss();
    }
    desk.told();
    assert_eq!(desk.master.poll_transmit(desk.now), None);
    assert_eq!(desk.master.poll_timeout(), Some(desk.now + US(500)));
    desk.hear(400, &velocity(NodeId::N1, 9.0));
    assert_eq!((desk.told(), desk.master.health(NodeId::N1)), (vec![], Some(Health::Abnormal)));
    desk.turn_with(290, &velocity(NodeId::N1, 1.0));
    assert_eq!(desk.master.status(NodeId::N1).unwrap().0, Status::Velocity(1.0));
}

#[test]
fn bytes_that_may_be_older_than_the_request_are_no_answer_and_are_told_as_unexpected() {
    let mut desk = Desk::with_nodes(direct(), &[N1]);
    let mut told = vec![];
    for _ in 0..3 {
        let asked = desk.now;
        assert_eq!(desk.turn(), read(NodeId::N1));
        desk.now += US(290);
        desk.master.handle_input(
            &velocity(NodeId::N1, 1.0),
            Arrival::Between { since: asked, now: desk.now },
        );
        assert!(desk.told().is_empty(), "it is no answer");
        desk.silence();
        told.append(&mut desk.told());
    }
    let failed = MasterEvent::ReadFailed { node: NodeId::N1, cause: Cause::Unexpected };
    assert!(told.contains(&failed), "{told:?}");
    let statistics = desk.master.node_statistics(NodeId::N1);
    assert_eq!((statistics.late, statistics.timeouts), (3, 3));
    // Those that came behind it are.
    assert_eq!(desk.turn(), read(NodeId::N1));
    let now = desk.now + US(290);
    desk.master.handle_input(&velocity(NodeId::N1, 1.0), Arrival::Between { since: now, now });
    desk.now = now;
    assert_eq!(desk.master.health(NodeId::N1), Some(Health::Online));
}

#[test]
fn an_own_answer_that_is_too_early_or_too_late_is_told_as_unexpected_and_is_no_damage() {
    for (after_us, is_early) in [(100, true), (900, false)] {
        let mut desk = Desk::with_nodes(direct(), &[N1]);
        let mut told = vec![];
        for _ in 0..3 {
            desk.turn();
            desk.hear(after_us, &velocity(NodeId::N1, 1.0));
            let end = desk.master.poll_timeout().unwrap();
            desk.now = desk.now.max(end);
            desk.master.handle_timeout(desk.now);
            told.append(&mut desk.told());
        }
        let failed = MasterEvent::ReadFailed { node: NodeId::N1, cause: Cause::Unexpected };
        assert!(told.contains(&failed), "{told:?}");
        let seen = desk.master.node_statistics(NodeId::N1);
        assert_eq!((seen.early, seen.late), if is_early { (3, 0) } else { (0, 3) });
        assert_eq!((seen.timeouts, seen.crc_errors), (3, 0));
    }
}
