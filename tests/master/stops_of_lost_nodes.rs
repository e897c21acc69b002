//! Stops of nodes that do not answer, and nodes that are lost while moving (I12, I13).

use crate::rig::*;

const STOPPED_1: MasterEvent = MasterEvent::Stopped { node: NodeId::N1 };

#[test]
fn an_abnormal_velocity_node_is_stopped_blind_at_once_and_then_every_20_ms() {
    let mut desk = Desk::losing(direct());
    // The search has just failed to find it.
    desk.packets(2);
    desk.now += US(500);
    desk.master.stop(NodeId::N1, desk.now);
    let sent = desk.follow(NodeId::N1, MS(300), |_| Answer::Silence);
    assert_eq!(sent[..2], [(0, write(NodeId::N1, 0.0)), (0, read(NodeId::N1))], "at once");
    let blind: Vec<_> = sent.iter().filter(|it| it.1 == write(NodeId::N1, 0.0)).collect();
    for pair in blind.windows(2) {
        // At most an exchange is under way.
        assert!((20_000..20_740).contains(&(pair[1].0 - pair[0].0)), "{pair:?}");
    }
    assert_eq!(blind.len(), 15, "it may still receive");
    assert_eq!(desk.master.stops_owed(), NodeId::N1.into());
}

#[test]
fn an_abnormal_position_node_is_stopped_after_its_next_good_answer() {
    let mut desk = Desk::with_nodes(direct(), &[N3]);
    desk.lose(NodeId::N3);
    desk.now += MS(3_600_000);
    desk.master.stop(NodeId::N3, desk.now);
    assert_eq!(desk.packet(), read(NodeId::N3), "read at once");
    desk.silence();
    assert_eq!(writes(&desk.packets(10)), [[0; 0]; 0], "an old position is not held");
    desk.answer(NodeId::N3, Answer::Position(turns(40)));
    let sent = desk.packets(3);
    assert_eq!(sent[1..2], [hold(NodeId::N3, turns(40))]);
}

#[test]
fn a_stop_that_waits_survives_the_third_strike() {
    let mut desk = Desk::with_nodes(direct(), &[N1]);
    for _ in 0..2 {
        desk.miss();
    }
    desk.turn();
    desk.master.stop(NodeId::N1, desk.now);
    desk.silence();
    assert_eq!(desk.master.health(NodeId::N1), Some(Health::Abnormal));
    assert_eq!(desk.packet(), write(NodeId::N1, 0.0));
}

#[test]
fn a_half_paid_stop_starts_over_after_its_node_was_abnormal() {
    let mut desk = Desk::stopping(manual(), N1);
    desk.packets(2);
    desk.lose(NodeId::N1);
    desk.answer(NodeId::N1, Answer::Velocity(5.0));
    desk.news();
    // The answer that brings it back may follow a WRITE that it has received, and pays for that
    // one.
    let written = writes(&desk.run(MS(50)));
    assert!(written.len() >= 2 && written.iter().all(|it| *it == write(NodeId::N1, 0.0)));
    assert_eq!(desk.news(), [STOPPED_1]);
}

#[test]
fn a_node_that_becomes_abnormal_under_a_set_point_is_owed_a_stop() {
    let mut desk = Desk::turning(direct(), 5.0);
    desk.lose(NodeId::N1);
    assert_eq!(desk.master.stops_owed(), NodeId::N1.into());
    let refused = CommandError::NotOnline { node: NodeId::N1 };
    assert_eq!(desk.master.set_velocity(NodeId::N1, rps(5.0), desk.now), Err(refused));
    desk.answer(NodeId::N1, Answer::Velocity(5.0));
    let written = writes(&desk.run(MS(50)));
    assert!(written.len() > 2 && written.iter().all(|it| *it == write(NodeId::N1, 0.0)));
    assert!(desk.news().contains(&STOPPED_1));
    // It does not move without a new set-point.
    assert_eq!(desk.master.set_point(NodeId::N1), Some(Target::Velocity(rps(0.0))));
    assert_eq!(desk.master.set_velocity(NodeId::N1, rps(5.0), desk.now), Ok(()));
}

#[test]
fn a_released_node_that_becomes_abnormal_is_also_owed_a_stop() {
    let mut desk = Desk::turning(direct(), 5.0);
    desk.packets(2);
    desk.master.release(NodeId::N1);
    desk.lose(NodeId::N1);
    assert_eq!(desk.master.stops_owed(), NodeId::N1.into(), "it keeps its last command");
}

#[test]
fn a_node_that_was_never_told_to_move_is_owed_nothing_when_it_becomes_abnormal() {
    let mut desk = Desk::with_nodes(direct(), &[N1, N3]);
    desk.lose(NodeId::N1);
    desk.answer(NodeId::N1, Answer::Velocity(0.0));
    assert_eq!(writes(&desk.run(MS(50))), [[0; 0]; 0]);
    assert_eq!(desk.master.health(NodeId::N1), Some(Health::Online));
    assert_eq!(desk.master.stops_owed(), NodeSet::NONE);
}

#[test]
fn without_stops_abnormal_a_node_that_comes_back_gets_no_write_at_all() {
    let config = with(direct(), |config| config.stops_abnormal = false);
    let mut desk = Desk::turning(config, 5.0);
    desk.lose(NodeId::N1);
    assert_eq!(desk.master.stops_owed(), NodeSet::NONE);
    desk.answer(NodeId::N1, Answer::Velocity(5.0));
    assert_eq!(writes(&desk.run(MS(50))), [[0; 0]; 0], "the set-point is dropped anyway");
    assert_eq!(desk.master.health(NodeId::N1), Some(Health::Online));
    // A stop requested by the application is still owed.
    desk.master.stop(NodeId::N1, desk.now);
    desk.lose(NodeId::N1);
    assert_eq!(desk.master.stops_owed(), NodeId::N1.into());
}

#[test]
fn a_node_that_comes_back_during_its_stop_pays_it_and_stays_at_rest() {
    let mut desk = Desk::with_nodes(manual(), &[N1]);
    desk.lose_by_hand(NodeId::N1);
    desk.master.stop(NodeId::N1, desk.now);
    desk.run(MS(100));
    assert_eq!(desk.master.stop_progress(NodeId::N1), StopProgress::Owed);
    desk.answer(NodeId::N1, Answer::Velocity(0.0));
    desk.run(MS(100));
    assert_eq!(desk.master.stop_progress(NodeId::N1), StopProgress::StandingStill);
    assert_eq!(desk.master.poll_timeout(), None);
}

#[test]
fn an_id_that_was_never_heard_is_read_again_and_again_on_an_idle_line() {
    let mut desk = Desk::new(manual());
    desk.master.stop(NodeId::N5, desk.now);
    let begin = desk.now;
    assert_eq!(desk.packets(3), [read(NodeId::N5), read(NodeId::N5), read(NodeId::N5)]);
    assert!(desk.now < begin + MS(5));
}

#[test]
fn a_stopped_node_that_is_lost_is_no_longer_known_to_be_at_rest() {
    let config = with(direct(), |config| config.stops_abnormal = false);
    let mut desk = Desk::stopping(config, N1);
    let mut coasting = desk.clone();
    desk.until(NodeId::N1, StopProgress::StandingStill);
    desk.lose(NodeId::N1);
    assert_eq!(desk.master.stop_progress(NodeId::N1), StopProgress::NotAsked);
    // One that was not seen to be still is owed its stop anew.
    coasting.until(NodeId::N1, StopProgress::Confirmed);
    coasting.lose(NodeId::N1);
    assert_eq!(coasting.master.stops_owed(), NodeId::N1.into());
}

#[test]
fn hold_age_does_not_hold_for_a_node_that_is_lost() {
    let mut desk = Desk::tuned(|config| config.hold_age = MS(60_000), &[N3]);
    desk.lose(NodeId::N3);
    desk.master.stop(NodeId::N3, desk.now);
    assert_eq!(writes(&desk.packets(5)), [[0; 0]; 0]);
}

#[test]
fn a_doubt_does_not_let_a_lost_node_exceed_the_search_rate() {
    let mut desk = Desk::with_nodes(direct(), &[N1, N3]);
    desk.lose(NodeId::N1);
    desk.master.stop(NodeId::N1, desk.now);
    for _ in 0..5 {
        // Late, and in the other mode.
        desk.hear(100, &position(NodeId::N1, turns(7)));
    }
    assert!(desk.master.is_mode_in_doubt(NodeId::N1));
    let sent = desk.follow(NodeId::N1, MS(150), |_| Answer::Silence);
    // The attempt that is made at once, and 5 % of the time.
    assert!((5..=11).contains(&sent.len()), "{} packets", sent.len());
    assert!(sent.iter().all(|it| it.1 == read(NodeId::N1)), "no WRITE in doubt");
}

#[test]
fn a_node_that_is_lost_again_under_the_same_stop_gets_another_immediate_attempt() {
    let mut desk = Desk::stopping(manual(), N1);
    for _ in 0..3 {
        while desk.master.health(NodeId::N1) != Some(Health::Abnormal) {
            desk.miss();
        }
        let begin = desk.now;
        assert_eq!(desk.packet(), write(NodeId::N1, 0.0));
        assert_eq!(desk.packet(), read(NodeId::N1));
        assert!(desk.now - begin < US(1000), "immediately, not at the search rate");
        desk.silence();
        // It answers once, during the search, which pays half of the stop.
        desk.turn_with(450, &velocity(NodeId::N1, 1.0));
        assert_eq!(desk.master.health(NodeId::N1), Some(Health::Online));
        assert_eq!(desk.master.stops_owed(), NodeId::N1.into());
    }
}
