//! Modes: in doubt, changed, and what may be written meanwhile (I11).

use crate::rig::*;

#[test]
fn a_mode_change_at_run_time_is_accepted_the_second_time_and_ends_the_set_point() {
    let mut desk = Desk::turning(direct(), 1.0);
    desk.turn();
    let at = Position::new(5, 6);
    desk.hear(450, &position(NodeId::N1, at));
    assert_eq!(desk.told(), [], "not accepted yet");
    desk.turn_with(450, &position(NodeId::N1, at));
    let changed = MasterEvent::ModeChanged { node: NodeId::N1, mode: Mode::Position };
    let status = MasterEvent::Status { node: NodeId::N1, status: Status::Position(at) };
    assert_eq!(desk.told(), [changed, status]);
    desk.sent.clear();
    assert_eq!(desk.turn(), read(NodeId::N1));
    assert!(desk.sent.is_empty(), "1 rps would be 16,256 turns");
    assert_eq!(desk.master.node_statistics(NodeId::N1).other_mode, 1);
    assert_eq!(desk.master.health(NodeId::N1), Some(Health::Online));
}

#[test]
fn a_read_is_not_answered_by_an_answer_that_leaves_the_mode_in_doubt() {
    let mut desk = Desk::with_nodes(direct(), &[N1]);
    desk.master.read(NodeId::N1, desk.now).unwrap();
    desk.turn_with(450, &position(NodeId::N1, turns(3)));
    assert!(desk.master.is_mode_in_doubt(NodeId::N1));
    assert_eq!(desk.master.read_outcome(NodeId::N1), None, "the status is still the old one");
    desk.turn_with(450, &position(NodeId::N1, turns(3)));
    assert_eq!(desk.master.read_outcome(NodeId::N1), Some(Ok(())));
}

/// A velocity node with a set-point that has just answered as a position node.
fn in_doubt_at(at: Position) -> Desk {
    let mut desk = Desk::turning(direct(), 1.0);
    desk.answer(NodeId::N1, Answer::Position(at));
    assert_eq!(kinds(&desk.packets(2)), [(WRITE, 1), (READ, 1)]);
    assert!(desk.master.is_mode_in_doubt(NodeId::N1));
    desk.told();
    desk
}

#[test]
fn in_doubt_the_node_is_read_at_once_and_gets_no_write() {
    let mut desk = in_doubt_at(turns(7));
    let doubted = desk.now;
    assert_eq!(desk.packet(), read(NodeId::N1));
    assert_eq!(desk.now, doubted);
    desk.silence();
    // The guard, then another READ, whatever the polling.
    assert_eq!(desk.packet(), read(NodeId::N1));
    assert_eq!(desk.master.mode(NodeId::N1), Some(Mode::Velocity), "not decided yet");
}

#[test]
fn in_doubt_set_points_of_either_mode_are_refused_and_not_kept() {
    let mut desk = in_doubt_at(turns(7));
    let refused = CommandError::ModeInDoubt { node: NodeId::N1 };
    assert_eq!(refused.to_string(), "the mode of node 1 is in doubt");
    assert_eq!(desk.master.set_velocity(NodeId::N1, rps(2.0), desk.now), Err(refused));
    assert_eq!(desk.master.set_position(NodeId::N1, turns(2), desk.now), Err(refused));
    // The mode has changed, which ended the set-point: the node is stopped where it is.
    let hold = WriteRequest::position(NodeId::N1, turns(7)).as_bytes().to_vec();
    let writes = writes(&desk.run(MS(20)));
    assert!(!writes.is_empty() && writes.iter().all(|write| *write == hold), "{writes:02x?}");
    assert_eq!(desk.master.set_point(NodeId::N1), Some(Target::Position(turns(7))));
}

#[test]
fn an_answer_in_the_recorded_mode_settles_the_doubt_and_the_set_point_continues() {
    let mut desk = in_doubt_at(turns(7));
    desk.answer(NodeId::N1, Answer::Velocity(0.5));
    assert_eq!(desk.packets(1), [read(NodeId::N1)]);
    assert!(!desk.master.is_mode_in_doubt(NodeId::N1));
    assert_eq!(desk.packets(2), [write(NodeId::N1, 1.0), read(NodeId::N1)]);
    assert_eq!(desk.news(), []);
}

#[test]
fn a_doubt_does_not_confirm_what_was_written_before_it() {
    let mut desk = Desk::turning(direct(), 1.0);
    desk.master.confirm(NodeId::N1, desk.now).unwrap();
    desk.answer(NodeId::N1, Answer::Position(turns(7)));
    desk.packets(2);
    desk.answer(NodeId::N1, Answer::Velocity(0.5));
    desk.packets(1);
    assert_eq!(desk.news(), [], "it may have been read as a position");
    assert_eq!(desk.packets(2), [write(NodeId::N1, 1.0), read(NodeId::N1)]);
    assert_eq!(desk.news(), [MasterEvent::Confirmed { node: NodeId::N1 }]);
}

#[test]
fn a_changed_mode_ends_the_confirmation_with_the_set_point() {
    let mut desk = Desk::turning(direct(), 1.0);
    desk.master.confirm(NodeId::N1, desk.now).unwrap();
    desk.answer(NodeId::N1, Answer::Position(turns(7)));
    desk.packets(3);
    let dropped = MasterEvent::NotConfirmed { node: NodeId::N1, cause: Cause::Dropped };
    let changed = MasterEvent::ModeChanged { node: NodeId::N1, mode: Mode::Position };
    assert_eq!(desk.news(), [dropped, changed]);
}

#[test]
fn a_late_answer_in_another_mode_puts_the_mode_in_doubt_and_decides_nothing() {
    let mut desk = Desk::turning(manual(), 1.0);
    desk.packets(1);
    for _ in 0..3 {
        desk.hear(1000, &position(NodeId::N1, turns(7)));
        assert!(desk.master.is_mode_in_doubt(NodeId::N1));
        assert_eq!(desk.master.mode(NodeId::N1), Some(Mode::Velocity));
    }
    assert_eq!(
        desk.master.status(NodeId::N1).unwrap().0,
        Status::Velocity(0.0),
        "the late answer is not taken"
    );
    assert_eq!(desk.master.node_statistics(NodeId::N1).other_mode, 3, "each one is counted");
    assert_eq!(desk.packets(1), [read(NodeId::N1)]);
    assert!(!desk.master.is_mode_in_doubt(NodeId::N1));
}

#[test]
fn an_early_answer_in_another_mode_puts_the_mode_in_doubt() {
    let mut desk = Desk::with_nodes(manual(), &[N1]);
    desk.master.read(NodeId::N1, desk.now).unwrap();
    desk.turn_with(1, &position(NodeId::N1, turns(7)));
    assert!(desk.master.is_mode_in_doubt(NodeId::N1));
    assert_eq!(desk.master.node_statistics(NodeId::N1).early, 1);
}

#[test]
fn a_mode_that_was_never_heard_is_not_in_doubt() {
    let mut desk = Desk::new(manual());
    desk.hear(1000, &position(NodeId::N1, turns(7)));
    desk.hear(1000, &velocity(NodeId::N1, 1.0));
    assert!(!desk.master.is_mode_in_doubt(NodeId::N1));
    assert_eq!(desk.master.mode(NodeId::N1), None);
}

#[test]
fn in_doubt_a_stop_may_write_a_position_that_a_velocity_node_reads_as_standstill() {
    // Rotation 12287 with count -1 is the largest: 0x2FFF_FFFF is 4.66e-10 as an f32.
    for (at, may) in [
        (Position::new(0, 0), true),
        (Position::new(-1, 12_287), true),
        (Position::new(0, 12_288), false),
        (Position::new(0, -1), false),
        (Position::new(-1, -1), false),
        (Position::new(5, i16::MAX), false),
        (Position::new(5, i16::MIN), false),
    ] {
        let mut desk = in_doubt_at(at);
        desk.master.stop(NodeId::N1, desk.now);
        // The READ for which the stop waits is damaged in the mode only: the doubt stays.
        desk.miss();
        // One more answer would decide. A late one neither decides nor measures.
        desk.hear(10, &position(NodeId::N1, at));
        assert_eq!(kinds(&desk.packets(1)), [(READ, 1)], "{at:?}");
        assert_eq!(desk.master.mode(NodeId::N1), Some(Mode::Position));
        let first = writes(&desk.packets(4))[0].clone();
        assert_eq!(first, hold(NodeId::N1, at), "once decided, it is held wherever it is");

        // A stop requested before the doubt began is measured by the doubtful answer.
        let mut desk = Desk::with_nodes(manual(), &[N1]);
        desk.answer(NodeId::N1, Answer::Position(at));
        desk.master.stop(NodeId::N1, desk.now);
        assert_eq!(desk.packets(2), [write(NodeId::N1, 0.0), read(NodeId::N1)]);
        assert!(desk.master.is_mode_in_doubt(NodeId::N1));
        let next = if may { hold(NodeId::N1, at) } else { read(NodeId::N1) };
        assert_eq!(desk.packet(), next, "{at:?}");
    }
}

#[test]
fn a_stop_waits_for_the_mode_and_is_then_written_in_it() {
    let mut desk = in_doubt_at(turns(-7));
    desk.master.stop(NodeId::N1, desk.now);
    let hold = hold(NodeId::N1, turns(-7));
    assert_eq!(desk.packets(2), [read(NodeId::N1), hold]);
    let mut desk = in_doubt_at(turns(-7));
    desk.master.stop(NodeId::N1, desk.now);
    desk.answer(NodeId::N1, Answer::Velocity(1.0));
    assert_eq!(desk.packets(2), [read(NodeId::N1), write(NodeId::N1, 0.0)]);
}

#[test]
fn what_was_written_in_doubt_confirms_the_stop_in_neither_mode() {
    for (answer, is_changed) in [(Answer::Position(turns(7)), true), (Answer::Velocity(0.0), false)]
    {
        let mut desk = Desk::with_nodes(manual(), &[N1]);
        desk.answer(NodeId::N1, Answer::Position(turns(7)));
        desk.master.stop(NodeId::N1, desk.now);
        let (zero, read) = (write(NodeId::N1, 0.0), read(NodeId::N1));
        let hold = hold(NodeId::N1, turns(7));
        assert_eq!(desk.packets(3), [zero.clone(), read.clone(), hold.clone()]);
        desk.answer(NodeId::N1, answer);
        assert_eq!(desk.packets(1), std::slice::from_ref(&read));
        assert!(!desk.master.is_mode_in_doubt(NodeId::N1));
        let stop = if is_changed { hold } else { zero };
        let sent = desk.until(NodeId::N1, StopProgress::Confirmed);
        assert_eq!(sent, [stop.clone(), read.clone(), stop, read]);
        let stopped = MasterEvent::Stopped { node: NodeId::N1 };
        assert_eq!(desk.news()[usize::from(is_changed)..], [stopped]);
    }
}

#[test]
fn a_stop_still_blocked_after_six_exchanges_is_reported_and_retried_at_the_search_rate() {
    for (has_stop, event) in [
        (true, MasterEvent::StopBlocked { node: NodeId::N1 }),
        (false, MasterEvent::ModeInDoubt { node: NodeId::N1 }),
    ] {
        // The other node keeps the line busy.
        let mut desk = Desk::tuned(|config| config.stops_abnormal = false, &[N1, N3]);
        desk.answer(NodeId::N1, Answer::Position(turns(-7)));
        while !desk.master.is_mode_in_doubt(NodeId::N1) {
            desk.exchange();
        }
        desk.answer(NodeId::N1, Answer::Silence);
        if has_stop {
            desk.master.stop(NodeId::N1, desk.now);
        }
        let mut asked = 0;
        while !desk.news().contains(&event) {
            asked += u8::from(kind(&desk.exchange().unwrap()) == (READ, 1));
        }
        assert_eq!(asked, 6);
        let reads = desk.follow(NodeId::N1, MS(300), |_| Answer::Silence);
        assert!((10..=21).contains(&reads.len()), "the search rate: {}", reads.len());
        assert!(reads.iter().all(|it| it.1 == read(NodeId::N1)));
        assert_eq!(desk.news(), [], "reported once");
    }
}

#[test]
fn a_still_node_that_is_lost_in_doubt_is_searched_for_and_stopped() {
    let config = with(direct(), |config| config.stops_abnormal = false);
    let mut desk = Desk::stopping(config, N1);
    desk.until(NodeId::N1, StopProgress::StandingStill);
    desk.answer(NodeId::N1, Answer::Position(turns(7)));
    while !desk.master.is_mode_in_doubt(NodeId::N1) {
        desk.exchange();
    }
    desk.answer(NodeId::N1, Answer::Silence);
    desk.run(MS(100));
    assert_eq!(desk.master.health(NodeId::N1), Some(Health::Abnormal));
    assert_eq!(desk.master.stop_progress(NodeId::N1), StopProgress::Owed);
    desk.answer(NodeId::N1, Answer::Position(turns(7)));
    desk.until(NodeId::N1, StopProgress::StandingStill);
    assert_eq!(desk.master.mode(NodeId::N1), Some(Mode::Position));
}

#[test]
fn a_stop_requested_during_an_old_doubt_is_reported_as_blocked_at_once() {
    let mut desk = Desk::tuned(|config| config.stops_abnormal = false, &[N1]);
    desk.answer(NodeId::N1, Answer::Position(turns(-7)));
    desk.packets(1);
    desk.answer(NodeId::N1, Answer::Silence);
    desk.packets(6);
    desk.told();
    desk.master.stop(NodeId::N1, desk.now);
    assert_eq!(desk.told(), [MasterEvent::StopBlocked { node: NodeId::N1 }]);
}

#[test]
fn a_hold_is_measured_again_after_the_mode_was_in_doubt() {
    let mut desk = Desk::stopping_at(direct(), turns(40));
    desk.run(MS(10));
    desk.answer(NodeId::N3, Answer::Velocity(2.0));
    while !desk.master.is_mode_in_doubt(NodeId::N3) {
        desk.exchange();
    }
    assert_eq!(desk.master.stops_owed(), NodeId::N3.into(), "the hold may have been lost");
    desk.answer(NodeId::N3, Answer::Position(turns(30)));
    let written = writes(&desk.run(MS(10)));
    assert!(written.len() > 2 && written.iter().all(|it| *it == hold(NodeId::N3, turns(30))));
}

#[test]
fn a_hold_is_not_confirmed_when_the_mode_is_in_doubt() {
    let mut desk = Desk::stopping(direct(), N3);
    desk.run(MS(10));
    desk.news();
    desk.master.confirm(NodeId::N3, desk.now).unwrap();
    desk.hear(1000, &velocity(NodeId::N3, 2.0));
    desk.run(MS(10));
    let ends = |event: &MasterEvent| {
        matches!(event, MasterEvent::Confirmed { .. } | MasterEvent::NotConfirmed { .. })
    };
    let told: Vec<_> = desk.news().into_iter().filter(ends).collect();
    let dropped = MasterEvent::NotConfirmed { node: NodeId::N3, cause: Cause::Dropped };
    assert_eq!(told, [dropped]);
}

#[test]
fn a_node_that_comes_back_in_another_mode_is_stopped_in_that_one() {
    let mut desk = Desk::turning(direct(), 5.0);
    desk.lose(NodeId::N1);
    desk.answer(NodeId::N1, Answer::Position(turns(-3)));
    let sent = desk.run(MS(60));
    let back = sent.iter().position(|it| *it == hold(NodeId::N1, turns(-3))).unwrap();
    let written = writes(&sent[back..]);
    assert!(written.iter().all(|it| *it == hold(NodeId::N1, turns(-3))), "{written:02x?}");
    // Until it answers, it is stopped in the recorded mode.
    let blind = writes(&sent[..back]);
    assert!(blind.iter().all(|it| *it == write(NodeId::N1, 0.0)));
    assert!(desk.news().contains(&MasterEvent::Stopped { node: NodeId::N1 }));
}

#[test]
fn a_set_point_that_has_not_left_when_the_doubt_begins_is_not_sent() {
    let mut desk = Desk::turning(manual(), 1.0);
    desk.hear(1000, &position(NodeId::N1, turns(7)));
    desk.answer(NodeId::N1, Answer::Silence);
    assert_eq!(kinds(&desk.packets(6)), [(READ, 1); 6]);
}

#[test]
fn in_doubt_the_cycle_writes_nothing_however_late_the_driver_is() {
    let mut desk = in_doubt_at(turns(7));
    desk.miss();
    desk.now += MS(1);
    assert_eq!(desk.packet(), read(NodeId::N1));
}

#[test]
fn a_changed_mode_ends_a_paid_stop_and_owes_another() {
    let mut desk = Desk::with_nodes(direct(), &[N1]);
    desk.answer(NodeId::N1, Answer::Velocity(3.0));
    desk.master.stop(NodeId::N1, desk.now);
    desk.run(MS(10));
    assert_eq!(desk.master.stop_progress(NodeId::N1), StopProgress::Confirmed);
    desk.answer(NodeId::N1, Answer::Position(turns(7)));
    let sent = desk.run(MS(100));
    assert_eq!(desk.master.mode(NodeId::N1), Some(Mode::Position));
    // The last 0 rps may have been read as "go to 0".
    let hold = WriteRequest::position(NodeId::N1, turns(7)).as_bytes().to_vec();
    assert!(sent.contains(&hold));
    assert_eq!(desk.master.stop_progress(NodeId::N1), StopProgress::StandingStill);
    let stopped = MasterEvent::Stopped { node: NodeId::N1 };
    assert_eq!(desk.news().iter().filter(|event| **event == stopped).count(), 2);
}

#[test]
fn a_still_velocity_node_in_doubt_is_owed_its_stop_again() {
    // Of what is written in a doubt, only a hold above 0 is harmless to a velocity node (I11).
    for at in [turns(7), turns(-7)] {
        let mut desk = Desk::stopping(direct(), N1);
        desk.until(NodeId::N1, StopProgress::StandingStill);
        desk.answer(NodeId::N1, Answer::Position(at));
        while !desk.master.is_mode_in_doubt(NodeId::N1) {
            desk.exchange();
        }
        assert_eq!(desk.master.stop_progress(NodeId::N1), StopProgress::Owed);
        assert_eq!(desk.master.stops_owed(), NodeSet::from(NodeId::N1));
        desk.answer(NodeId::N1, Answer::Velocity(0.0));
        let hold = WriteRequest::position(NodeId::N1, turns(7)).as_bytes().to_vec();
        let written = writes(&desk.run(MS(50)));
        let is_harmless = |it: &Vec<u8>| *it == write(NodeId::N1, 0.0) || *it == hold;
        assert!(written.iter().all(is_harmless), "{written:02x?}");
        assert!(!desk.master.is_mode_in_doubt(NodeId::N1) && written.len() > 10);
        assert_eq!(desk.master.set_point(NodeId::N1), Some(Target::Velocity(rps(0.0))));
        assert_eq!(desk.master.stop_progress(NodeId::N1), StopProgress::StandingStill);
    }
}

#[test]
fn a_release_before_the_mode_is_settled_hides_no_changed_mode() {
    // Paid and still, its 0 rps is repeated; the switch is moved at rest.
    for at_read in [0, 1, 2] {
        let mut desk = Desk::stopping(direct(), N1);
        desk.until(NodeId::N1, StopProgress::StandingStill);
        desk.answer(NodeId::N1, Answer::Position(turns(40)));
        let mut reads = 0;
        while reads < 3 {
            if reads == at_read {
                desk.master.release(NodeId::N1);
            }
            reads += u8::from(desk.exchange().unwrap()[0] == READ);
        }
        assert_eq!(desk.master.mode(NodeId::N1), Some(Mode::Position));
        let written = writes(&desk.run(MS(100)));
        assert!(written.contains(&hold(NodeId::N1, turns(40))), "{at_read}: it goes to 0");
        assert_eq!(desk.master.stop_progress(NodeId::N1), StopProgress::StandingStill);
    }
}

#[test]
fn a_node_whose_answers_alternate_between_the_modes_is_never_said_to_be_stopped() {
    let answers = [Answer::Position(turns(7)), Answer::Velocity(0.5)];
    for first in [0, 1] {
        let mut desk = Desk::turning(direct(), 1.0);
        desk.packets(2);
        desk.master.stop(NodeId::N1, desk.now);
        let mut reads = first;
        while reads < 60 {
            desk.answer(NodeId::N1, answers[reads % 2]);
            let packet = desk.exchange().expect("no READ");
            if packet[0] == WRITE {
                // The latter means standstill in both modes.
                let stops = [write(NodeId::N1, 0.0), hold(NodeId::N1, turns(7))];
                assert!(stops.contains(&packet), "{packet:02x?}");
            } else {
                reads += 1;
            }
            assert_eq!(desk.master.stop_progress(NodeId::N1), StopProgress::Owed);
        }
        assert!(desk.master.node_statistics(NodeId::N1).other_mode > 20);
        assert!(!desk.news().contains(&MasterEvent::Stopped { node: NodeId::N1 }));
    }
}
