//! A master whose packets fail late, whose attempts outlast its patience, or whose set-points keep
//! changing.

use axlewire::ikeya::slave::SlaveConfig;

use crate::rig::*;

#[test]
fn a_read_has_failed_when_its_node_is_abnormal_however_many_attempts_are_left() {
    let config = with(direct(), |config| config.attempts = 9);
    let mut desk = Desk::turning(config, 1.0);
    desk.master.confirm(NodeId::N1, desk.now).unwrap();
    desk.master.read(NodeId::N1, desk.now).unwrap();
    desk.lose(NodeId::N1);
    let (node, cause) = (NodeId::N1, Cause::Silent);
    assert_eq!(desk.master.read_outcome(node), Some(Err(cause)));
    let news = desk.news();
    assert_eq!(
        news[..2],
        [MasterEvent::ReadFailed { node, cause }, MasterEvent::NotConfirmed { node, cause },]
    );
    assert_eq!(desk.master.node_statistics(node).failures, 1);
    assert_eq!(desk.master.health(node), Some(Health::Abnormal));
}

#[test]
fn the_silence_after_a_cut_off_packet_begins_when_the_failure_was_noticed() {
    for noticed_us in [0, 50, 5000] {
        let mut desk = Desk::with_nodes(manual(), &[N1]);
        desk.master.read(NodeId::N1, desk.now).unwrap();
        assert_eq!(desk.packet(), read(NodeId::N1));
        desk.now += US(noticed_us);
        desk.master.handle_transmit(Unsent::CutOff, desk.now);
        let noticed = desk.now;
        assert_eq!(desk.packet(), read(NodeId::N1));
        // The packet may still be leaving: 80 us, twice the five byte times of a pause, and the
        // time within which a node may answer.
        assert_eq!(desk.now, noticed + US(80 + 2 * 100 + 500), "{noticed_us} us");
    }
}

#[test]
fn set_points_of_several_nodes_take_turns_however_often_all_of_them_change() {
    let nodes = [NodeId::N2, NodeId::N3, NodeId::N7];
    let mut desk = Desk::with_nodes(manual(), &nodes.map(|node| (node, Mode::Velocity)));
    let mut served = [0; 3];
    for step in 0..30_u8 {
        for node in nodes {
            desk.master.set_velocity(node, rps(f32::from(step) + 1.0), desk.now).unwrap();
        }
        let (header, id) = kind(&desk.packet());
        assert_eq!(header, WRITE);
        served[nodes.iter().position(|node| node.get() == id).unwrap()] += 1;
    }
    assert_eq!(served, [10; 3]);
}

#[test]
fn a_flush_that_fails_behind_a_paid_half_does_not_move_the_held_position() {
    let mut desk = Desk::stopping_at(manual(), turns(30));
    assert_eq!(desk.packets(2), [read(NodeId::N3), hold(NodeId::N3, turns(30))]);
    desk.answer(NodeId::N3, Answer::Position(turns(40)));
    assert_eq!(desk.packets(1), [read(NodeId::N3)]);
    for _ in 0..3 {
        desk.master.handle_transmit(Unsent::Unflushed, desk.now);
        desk.now += MS(100);
    }
    assert_eq!(desk.packet(), hold(NodeId::N3, turns(30)));
}

#[test]
fn a_changed_mode_owes_a_stop_even_to_a_node_that_was_still_and_released() {
    for is_released in [false, true] {
        let mut desk = Desk::stopping(manual(), N1);
        desk.packets(9);
        assert_eq!(desk.master.stop_progress(NodeId::N1), StopProgress::StandingStill);
        if is_released {
            desk.master.release(NodeId::N1);
        }
        desk.answer(NodeId::N1, Answer::Position(turns(3)));
        desk.master.read(NodeId::N1, desk.now).unwrap();
        // A set-point that is left goes in front of the first READ.
        desk.packets(if is_released { 2 } else { 3 });
        assert_eq!(desk.master.mode(NodeId::N1), Some(Mode::Position));
        // A repeated 0 rps may have been read in the new mode: "go to 0".
        assert_eq!(desk.master.stop_progress(NodeId::N1), StopProgress::Owed);
        let written = writes(&desk.packets(9));
        assert!(written.len() > 1 && written.iter().all(|it| *it == hold(NodeId::N1, turns(3))));
    }
}

#[test]
fn a_node_that_has_missed_its_only_attempt_keeps_its_set_point() {
    let config = with(direct(), |config| config.attempts = 1);
    let mut desk = Desk::turning(config, 1.0);
    for missed in 1..3 {
        desk.miss();
        assert_eq!(desk.master.health(NodeId::N1), Some(Health::Suspect(missed)));
        assert_eq!(desk.master.set_point(NodeId::N1), Some(Target::Velocity(rps(1.0))));
        assert_eq!(desk.master.stops_owed(), NodeSet::NONE);
    }
    desk.miss();
    assert_eq!(desk.master.set_point(NodeId::N1), None);
    assert_eq!(desk.master.stops_owed(), NodeId::N1.into());
}

#[test]
fn a_position_of_the_permitted_age_is_held_for_20_ms_from_the_call() {
    for (late_us, is_held) in [(0, true), (20_160, true), (20_161, false)] {
        let config = with(manual(), |config| config.hold_age = MS(1000));
        let mut desk = Desk::with_nodes(config, &[N3]);
        desk.now += MS(900);
        desk.master.stop(NodeId::N3, desk.now);
        desk.now += US(late_us);
        let held = hold(NodeId::N3, Position::new(7, 3));
        assert_eq!(desk.packet(), if is_held { held } else { read(NodeId::N3) }, "{late_us} us");
    }
}

#[test]
fn nothing_follows_a_cut_off_write_before_the_silence_is_over() {
    for (is_stop, noticed_us) in [(false, 0), (false, 700), (true, 0), (true, 700)] {
        let mut desk = Desk::with_nodes(manual(), &[N1, N3]);
        desk.master.read(NodeId::N3, desk.now).unwrap();
        if is_stop {
            desk.master.stop(NodeId::N1, desk.now);
        } else {
            desk.master.set_velocity(NodeId::N1, rps(1.0), desk.now).unwrap();
        }
        assert_eq!(kind(&desk.packet()), (WRITE, 1));
        desk.now += US(noticed_us);
        desk.master.handle_transmit(Unsent::CutOff, desk.now);
        let noticed = desk.now;
        // The same again, or the READ of the other node.
        assert!([(WRITE, 1), (READ, 3)].contains(&kind(&desk.packet())));
        assert_eq!(desk.now, noticed + US(160 + 2 * 100 + 500), "stop {is_stop}, {noticed_us} us");
    }
}

#[test]
fn a_read_that_is_under_way_confirms_no_set_point_that_came_after_it() {
    let mut desk = Desk::asking(direct());
    for speed in [1.0, 2.0] {
        // Its window is open.
        desk.master.set_velocity(NodeId::N1, rps(speed), desk.now).unwrap();
        desk.master.confirm(NodeId::N1, desk.now).unwrap();
        desk.hear(300, &velocity(NodeId::N1, 0.0));
        assert_eq!(desk.news(), []);
        desk.sent.clear();
        desk.turn();
        assert_eq!(desk.sent, [write(NodeId::N1, speed)]);
        // Asked again, it needs another WRITE.
        desk.master.confirm(NodeId::N1, desk.now).unwrap();
        desk.hear(460, &velocity(NodeId::N1, 0.0));
        assert_eq!(desk.news(), []);
        desk.turn_with(460, &velocity(NodeId::N1, 0.0));
        assert_eq!(desk.news(), [MasterEvent::Confirmed { node: NodeId::N1 }]);
        desk.turn();
    }
}

#[test]
fn a_measurement_has_the_time_at_which_its_answer_was_complete() {
    let mut desk = Desk::with_nodes(direct(), &[N1, N3]);
    for (node, answer) in
        [(NodeId::N1, velocity(NodeId::N1, 2.5)), (NodeId::N3, position(NodeId::N3, turns(8)))]
    {
        while desk.turn() != read(node) {
            desk.silence();
        }
        let asked = desk.now;
        desk.hear(333, &answer);
        let (status, at) = desk.master.status(node).unwrap();
        assert_eq!(at, asked + US(333));
        let expected = match node {
            NodeId::N1 => Status::Velocity(2.5),
            _ => Status::Position(turns(8)),
        };
        assert_eq!(status, expected);
    }
}

#[test]
fn behind_a_part_of_a_packet_the_line_is_silent_for_as_long_as_a_node_waits_for_its_rest() {
    for (config, idle) in [
        (MasterConfig::direct(), SlaveConfig::direct().idle),
        (MasterConfig::usb_adapter(), SlaveConfig::usb_adapter().idle),
    ] {
        let config = with(config, |config| config.polling = Polling::Manual);
        let mut desk = Desk::with_nodes(config, &[N1]);
        desk.master.set_velocity(NodeId::N1, rps(1.0), desk.now).unwrap();
        assert_eq!(kind(&desk.packet()), (WRITE, 1));
        desk.master.handle_transmit(Unsent::CutOff, desk.now);
        let noticed = desk.now;
        assert_eq!(kind(&desk.packet()), (WRITE, 1));
        assert!(desk.now - noticed > idle, "{:?}", desk.now - noticed);
    }
}
