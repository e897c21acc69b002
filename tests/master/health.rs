//! Health: strikes, and the search for abnormal nodes (I7).

use crate::rig::*;

#[test]
fn three_strikes_make_a_node_abnormal_and_one_answer_brings_it_back() {
    let mut desk = Desk::with_nodes(direct(), &[N1]);
    let mut told = vec![];
    for _ in 0..3 {
        desk.miss();
        told.append(&mut desk.told());
    }
    let health = |health| MasterEvent::Health { node: NodeId::N1, health };
    let failed = MasterEvent::ReadFailed { node: NodeId::N1, cause: Cause::Silent };
    let expected =
        [health(Health::Suspect(1)), health(Health::Suspect(2)), health(Health::Abnormal), failed];
    assert_eq!(told, expected);
    assert_eq!(desk.master.node_statistics(NodeId::N1).timeouts, 3);
    assert_eq!(desk.master.node_statistics(NodeId::N1).retries, 2);

    assert_eq!(desk.turn(), read(NodeId::N1));
    desk.hear(290, &velocity(NodeId::N1, 0.0));
    assert_eq!(desk.told()[0], health(Health::Online));
}

#[test]
fn a_read_that_is_asked_again_is_a_retry_also_while_a_stop_is_owed_and_none_after_an_answer() {
    for is_stopping in [false, true] {
        let mut desk = Desk::with_nodes(direct(), &[N1]);
        if is_stopping {
            desk.master.stop(NodeId::N1, desk.now);
        }
        for retries in [1, 2] {
            desk.miss();
            desk.turn();
            assert_eq!(desk.master.node_statistics(NodeId::N1).retries, retries);
            desk.hear(600, &velocity(NodeId::N1, 0.0));
            for _ in 0..5 {
                desk.turn_with(600, &velocity(NodeId::N1, 0.0));
            }
            assert_eq!(desk.master.node_statistics(NodeId::N1).retries, retries);
        }
    }
}

#[test]
fn one_answer_ends_a_series_of_strikes() {
    let mut desk = Desk::with_nodes(direct(), &[N1]);
    for _ in 0..10 {
        for _ in 0..2 {
            desk.miss();
        }
        desk.turn_with(290, &velocity(NodeId::N1, 0.0));
        assert_eq!(desk.master.health(NodeId::N1), Some(Health::Online));
    }
}

#[test]
fn a_write_does_not_reset_the_strikes() {
    let mut desk = Desk::with_nodes(direct(), &[N1]);
    for _ in 0..3 {
        assert_ne!(desk.master.health(NodeId::N1), Some(Health::Abnormal));
        desk.master.set_velocity(NodeId::N1, rps(1.0), desk.now).unwrap();
        desk.turn();
        assert!(!desk.sent.is_empty(), "a WRITE");
        desk.sent.clear();
        desk.silence();
    }
    assert_eq!(desk.master.health(NodeId::N1), Some(Health::Abnormal));
}

#[test]
fn garbage_in_the_window_is_a_strike_that_names_its_cause() {
    for (bytes, cause) in [
        (vec![0x55, 1, 2, 3, 4, 5, 6, 7, 8], Cause::Damaged),
        (velocity(NodeId::N7, 1.0), Cause::Unexpected),
        (vec![], Cause::Silent),
    ] {
        let mut desk = Desk::with_nodes(direct(), &[N1]);
        for _ in 0..3 {
            desk.turn();
            desk.hear(300, &bytes);
            desk.silence();
        }
        let failed = MasterEvent::ReadFailed { node: NodeId::N1, cause };
        assert_eq!(desk.told().last(), Some(&failed));
        let damaged = if cause == Cause::Damaged { 3 } else { 0 };
        assert_eq!(desk.master.node_statistics(NodeId::N1).crc_errors, damaged);
    }
}

#[test]
fn the_search_for_abnormal_nodes_costs_no_more_than_its_share() {
    let mut desk = Desk::with_nodes(direct(), &[N1, N3]);
    while desk.master.health(NodeId::N3) != Some(Health::Abnormal) {
        match desk.turn()[1] {
            1 => desk.hear(290, &velocity(NodeId::N1, 0.0)),
            _ => desk.silence(),
        }
    }
    let (begin, mut probing) = (desk.now, 0);
    while desk.now - begin < MS(1000) {
        let request = desk.turn();
        if request[1] == 1 {
            desk.hear(290, &velocity(NodeId::N1, 0.0));
        } else {
            let asked = desk.now;
            desk.silence();
            probing += (desk.now - asked).as_micros();
        }
        desk.told();
    }
    assert!((20_000..=50_000).contains(&probing), "{probing} us per second, 5 % is allowed");
}

#[test]
fn a_read_has_succeeded_once_the_node_has_answered_whatever_fails_afterwards() {
    let mut desk = Desk::with_nodes(direct(), &[N1]);
    let outcome = |desk: &Desk| desk.master.read_outcome(NodeId::N1);
    desk.master.read(NodeId::N1, desk.now).unwrap();
    assert_eq!(outcome(&desk), None);
    desk.turn_with(290, &velocity(NodeId::N1, 0.0));
    assert_eq!(outcome(&desk), Some(Ok(())));
    // The reads of the cycle that follow fail before anyone looks.
    for _ in 0..2 {
        desk.miss();
    }
    desk.master.read(NodeId::N1, desk.now).unwrap();
    desk.miss();
    assert_eq!(desk.master.last_failure(NodeId::N1), Some(Cause::Silent));
    assert_eq!(outcome(&desk), Some(Err(Cause::Silent)));
    // An answer after a failure counts as well.
    desk.turn_with(290, &velocity(NodeId::N1, 0.0));
    assert_eq!(outcome(&desk), Some(Ok(())));
}

#[test]
fn a_read_that_was_answered_is_not_undone_by_a_later_failure() {
    let mut desk = Desk::with_nodes(direct(), &[N1]);
    desk.master.read(NodeId::N1, desk.now).unwrap();
    desk.turn_with(290, &velocity(NodeId::N1, 0.0));
    for _ in 0..3 {
        desk.miss();
    }
    assert_eq!(desk.master.last_failure(NodeId::N1), Some(Cause::Silent));
    assert_eq!(desk.master.read_outcome(NodeId::N1), Some(Ok(())));
}

#[test]
fn the_outcome_of_a_read_is_unknown_until_it_has_one_of_its_own() {
    let mut desk = Desk::with_nodes(manual(), &[N1]);
    let outcome = |desk: &Desk| desk.master.read_outcome(NodeId::N1);
    desk.answer(NodeId::N1, Answer::Silence);
    desk.master.read(NodeId::N1, desk.now).unwrap();
    desk.packets(2);
    assert_eq!(outcome(&desk), None, "two of three attempts");
    desk.answer(NodeId::N1, Answer::Velocity(0.0));
    desk.packets(1);
    assert_eq!(outcome(&desk), Some(Ok(())));
    let config = with(manual(), |config| config.attempts = 1);
    let mut desk = Desk::with_nodes(config, &[N1]);
    for answer in [Answer::Silence, Answer::Velocity(0.0), Answer::Silence, Answer::Silence] {
        desk.answer(NodeId::N1, answer);
        desk.master.read(NodeId::N1, desk.now).unwrap();
        assert_eq!(outcome(&desk), None, "not that of the one before");
        desk.packets(1);
        let expected = if answer == Answer::Silence { Err(Cause::Silent) } else { Ok(()) };
        assert_eq!(outcome(&desk), Some(expected));
    }
}

#[test]
fn the_guard_is_kept_after_every_missed_answer_the_last_attempt_included() {
    for (attempts, polling) in [
        (1, Polling::Fastest),
        (1, Polling::Every(MS(1))),
        (2, Polling::Fastest),
        (2, Polling::Every(MS(1))),
        (3, Polling::Every(MS(1))),
    ] {
        let mut config = direct();
        (config.attempts, config.late_guard, config.polling) = (attempts, MS(7), polling);
        let mut desk = Desk::with_nodes(config, &[N1]);
        for missed in 0..2 {
            desk.miss();
            let closed = desk.now;
            assert_eq!(desk.turn(), read(NodeId::N1));
            assert_eq!(desk.now, closed + MS(7), "{attempts}, {polling:?}, {missed}");
            desk.hear(290, &velocity(NodeId::N1, 0.0));
        }
    }
}

#[test]
fn noise_behind_the_packet_of_another_node_does_not_change_the_cause() {
    let other = velocity(NodeId::N7, 1.0);
    let noise = vec![0x55, 1, 2, 3, 4, 5, 6, 7, 8];
    for heard in [[&other, &noise], [&noise, &other]] {
        let mut desk = Desk::with_nodes(direct(), &[N1]);
        for _ in 0..3 {
            desk.turn();
            heard.into_iter().for_each(|bytes| desk.hear(200, bytes));
            desk.silence();
        }
        let cause = Cause::Unexpected;
        assert_eq!(desk.told().last(), Some(&MasterEvent::ReadFailed { node: NodeId::N1, cause }));
        assert_eq!(desk.master.node_statistics(NodeId::N1).crc_errors, 0);
    }
}

#[test]
fn the_last_failure_is_the_latest_one_with_its_own_cause() {
    let config = with(manual(), |config| config.attempts = 1);
    let mut desk = Desk::with_nodes(config, &[N1]);
    assert_eq!(desk.master.last_failure(NodeId::N1), None);
    let noise = vec![0x55, 1, 2, 3, 4, 5, 6, 7, 8];
    for (heard, cause) in [
        (vec![], Cause::Silent),
        (noise, Cause::Damaged),
        (velocity(NodeId::N7, 1.0), Cause::Unexpected),
    ] {
        desk.master.read(NodeId::N1, desk.now).unwrap();
        desk.turn();
        desk.hear(300, &heard);
        desk.silence();
        assert_eq!(desk.master.last_failure(NodeId::N1), Some(cause));
        assert_eq!(desk.master.read_outcome(NodeId::N1), Some(Err(cause)));
        // An answer in between does not make it forget the failure.
        desk.master.read(NodeId::N1, desk.now).unwrap();
        desk.turn_with(290, &velocity(NodeId::N1, 0.0));
        assert_eq!(desk.master.last_failure(NodeId::N1), Some(cause));
    }
}
