//! Stops that are interrupted: by a mode in doubt, a late driver or a silent application.

use crate::rig::*;

#[test]
fn what_was_confirmed_before_a_mode_was_in_doubt_does_not_count() {
    let mut desk = Desk::stopping(manual(), N1);
    let zero = write(NodeId::N1, 0.0);
    assert_eq!(desk.packets(2), [zero.clone(), read(NodeId::N1)]);
    // One half is confirmed. Then the node answers in the other mode, and again in its own.
    desk.answer(NodeId::N1, Answer::Position(turns(-3)));
    assert_eq!(desk.packets(2), [zero.clone(), read(NodeId::N1)]);
    assert!(desk.master.is_mode_in_doubt(NodeId::N1));
    desk.answer(NodeId::N1, Answer::Velocity(0.0));
    assert_eq!(desk.packets(1), [read(NodeId::N1)]);
    assert!(!desk.master.is_mode_in_doubt(NodeId::N1));
    let again = [zero.clone(), read(NodeId::N1), zero, read(NodeId::N1)];
    for (count, packet) in again.into_iter().enumerate() {
        assert_eq!(desk.master.stop_progress(NodeId::N1), StopProgress::Owed, "{count}");
        assert_eq!(desk.packets(1), [packet]);
    }
    assert_eq!(desk.master.stop_progress(NodeId::N1), StopProgress::Confirmed);
}

#[test]
fn a_position_from_before_a_mode_was_in_doubt_is_not_held() {
    let mut desk = Desk::stopping_at(manual(), turns(30));
    assert_eq!(desk.packets(2), [read(NodeId::N3), hold(NodeId::N3, turns(30))]);
    desk.answer(NodeId::N3, Answer::Velocity(2.0));
    assert_eq!(desk.packets(1), [read(NodeId::N3)]);
    assert!(desk.master.is_mode_in_doubt(NodeId::N3));
    // It has moved on.
    desk.answer(NodeId::N3, Answer::Position(turns(40)));
    let written = writes(&desk.until(NodeId::N3, StopProgress::Confirmed));
    assert_eq!(written, [hold(NodeId::N3, turns(40)), hold(NodeId::N3, turns(40))]);
}

#[test]
fn a_stop_in_doubt_holds_no_position_from_before_it_however_old_it_may_be() {
    for is_asked_before in [true, false] {
        let config = with(manual(), |config| config.hold_age = MS(1000));
        let mut desk = Desk::with_nodes(config, &[N3]);
        // Just heard, and harmless in either mode: it would be held but for the doubt.
        desk.answer(NodeId::N3, Answer::Position(turns(3)));
        desk.master.read(NodeId::N3, desk.now).unwrap();
        desk.packets(1);
        desk.hear(10, &velocity(NodeId::N3, 0.0));
        assert!(desk.master.is_mode_in_doubt(NodeId::N3));
        if is_asked_before {
            desk.answer(NodeId::N3, Answer::Silence);
            assert_eq!(desk.packets(1), [read(NodeId::N3)]);
        }
        desk.master.stop(NodeId::N3, desk.now);
        assert_eq!(desk.turn(), read(NodeId::N3));
        assert_eq!(desk.sent, [[0; 0]; 0], "no WRITE before it");
    }
}

/// Whether a position node that has just been read for a stop is told to hold that position by a
/// driver that is called so much later; otherwise it is read again.
fn is_held_after(desk: &mut Desk, late_us: u32) -> bool {
    // The answer, and then nothing for a while.
    let heard = desk.now;
    let mut late = desk.clone();
    late.now = heard + US(late_us);
    let packet = late.master.poll_transmit(late.now).unwrap().to_vec();
    *desk = late;
    packet[0] == WRITE
}

#[test]
fn a_position_is_held_for_20_ms_after_it_was_measured_and_20_ms_longer_each_time_after() {
    for gap_us in [0, 300] {
        let config = with(manual(), |config| config.turnaround_gap = US(gap_us));
        let mut desk = Desk::stopping(config, N3);
        assert_eq!(desk.packet(), read(NodeId::N3));
        for patience_ms in [20, 40, 60, 80] {
            desk.hear(340, &position(NodeId::N3, turns(3)));
            let patience_us = patience_ms * 1000 + 160 + gap_us;
            assert!(is_held_after(&mut desk.clone(), patience_us), "{patience_us} us");
            assert!(!is_held_after(&mut desk, patience_us + 1), "{patience_us} us");
        }
    }
}

#[test]
fn a_busy_line_is_searched_for_its_share_and_an_idle_one_all_the_time() {
    for (gap_us, share_pct, counts_as) in
        [(0, 5, 5), (1000, 5, 5), (0, 50, 50), (0, 51, 50), (1000, 255, 50), (0, 1, 1)]
    {
        let mut config = direct();
        (config.turnaround_gap, config.recovery_share_pct) = (US(gap_us), share_pct);
        // READ, window and answer.
        let exchange = 80 + 500 + 160 + gap_us;
        let mut desk = Desk::losing(config);
        // Nobody else is there: only the guard is waited for.
        let reads = desk.follow(NodeId::N1, MS(20), |_| Answer::Silence);
        for pair in reads.windows(2) {
            assert_eq!(pair[1].0 - pair[0].0, 740 + 500, "{share_pct} %");
        }
        let mut desk = Desk::with_nodes(config, &[N1, N3]);
        desk.lose(NodeId::N1);
        let reads = desk.follow(NodeId::N1, MS(500), |_| Answer::Silence);
        for pair in reads.windows(2) {
            // The READ of the other node that is under way goes on.
            let (pause, most) = (exchange * 100 / counts_as, 2 * (340 + gap_us));
            let between = pair[1].0 - pair[0].0;
            assert!((pause..=pause + most).contains(&between), "{share_pct} %: {between} us");
        }
        assert!(reads.len() > 2, "{share_pct} %");
    }
}

#[test]
fn a_search_at_0_percent_looks_only_for_nodes_that_are_owed_a_stop_and_for_these_at_1_percent() {
    let config = with(direct(), |config| config.recovery_share_pct = 0);
    let desk = Desk::losing(config);
    assert_eq!(desk.master.poll_timeout(), None, "it was never told to move");
    let mut desk = Desk::with_nodes(config, &[N1, N3]);
    desk.lose(NodeId::N1);
    desk.run(MS(1));
    desk.master.stop(NodeId::N1, desk.now);
    let sent = desk.follow(NodeId::N1, MS(500), |_| Answer::Silence);
    assert_eq!(sent[..2], [(0, write(NodeId::N1, 0.0)), (0, read(NodeId::N1))], "at once");
    let asked: Vec<_> = sent.iter().filter(|it| it.1[0] == READ).map(|it| it.0).collect();
    // Then the search.
    let pauses = asked[1..].windows(2).map(|pair| pair[1] - pair[0]);
    let is_kept = |pause| (74_000..75_000).contains(&pause);
    assert!(asked.len() > 4 && pauses.into_iter().all(is_kept), "{asked:?}");
}

fn armed() -> MasterConfig {
    with(manual(), |config| config.dead_man = Some(MS(100)))
}

#[test]
fn no_sign_of_life_that_comes_too_late_revives_a_command() {
    type Sign = fn(&mut Desk);
    let signs: [(&str, Sign); 4] = [
        ("keep_alive", |desk| desk.master.keep_alive(desk.now)),
        ("a stop of another node", |desk| desk.master.stop(NodeId::N3, desk.now)),
        ("a set-point of another node", |desk| {
            desk.master.set_position(NodeId::N3, turns(1), desk.now).unwrap();
        }),
        ("its own set-point", |desk| {
            let refused = CommandError::StopOwed { node: NodeId::N1 };
            let again = desk.master.set_velocity(NodeId::N1, rps(1.0), desk.now);
            assert_eq!(again, Err(refused));
        }),
    ];
    for (name, sign) in signs {
        for (late_us, is_dead) in [(99_999, false), (100_000, true)] {
            if name == "its own set-point" && !is_dead {
                continue;
            }
            let mut desk = Desk::with_nodes(armed(), &[N1, N3]);
            desk.master.set_velocity(NodeId::N1, rps(1.0), desk.now).unwrap();
            let told = desk.now;
            desk.packets(1);
            // Meanwhile the driver is not called.
            desk.now = told + US(late_us);
            sign(&mut desk);
            assert_eq!(desk.news().contains(&MasterEvent::DeadMan), is_dead, "{name}");
            assert_eq!(desk.master.stops_owed().contains(NodeId::N1), is_dead, "{name}");
            assert_eq!(desk.master.statistics().dead_man, u32::from(is_dead), "{name}");
        }
    }
}

#[test]
fn a_stop_that_confirms_a_paid_one_holds_the_same_position_however_late_the_driver_is() {
    for late in [MS(0), MS(20), MS(21), MS(500)] {
        let mut desk = Desk::stopping_at(manual(), turns(30));
        desk.packets(9);
        desk.answer(NodeId::N3, Answer::Position(beside(turns(30), 200)));
        desk.master.stop(NodeId::N3, desk.now);
        desk.now += late;
        assert_eq!(desk.packets(1), [read(NodeId::N3)]);
        desk.now += late;
        if late > MS(20) {
            assert_eq!(desk.packets(1), [read(NodeId::N3)]);
        }
        assert_eq!(desk.packet(), hold(NodeId::N3, turns(30)));
    }
}

#[test]
fn a_stop_of_all_that_comes_too_late_is_preceded_by_the_dead_man() {
    for (late_us, is_dead) in [(99_999, false), (100_000, true)] {
        let mut desk = Desk::with_nodes(armed(), &[N1, N3]);
        desk.master.set_velocity(NodeId::N1, rps(1.0), desk.now).unwrap();
        desk.packets(1);
        desk.now += US(late_us);
        desk.master.stop_all(desk.now);
        assert_eq!(desk.master.statistics().dead_man, u32::from(is_dead));
        // Nobody is under an order any more.
        desk.packets(9);
        desk.now += MS(500);
        desk.master.handle_timeout(desk.now);
        assert_eq!(desk.master.statistics().dead_man, u32::from(is_dead));
    }
}

#[test]
fn a_paid_stop_leaves_the_held_position_behind_and_not_the_one_to_which_the_shaft_has_run() {
    let mut desk = Desk::stopping_at(direct(), turns(30));
    assert_eq!(desk.packets(1), [read(NodeId::N3)]);
    // It runs on while the stop is paid, and after.
    for at in 31..40 {
        desk.answer(NodeId::N3, Answer::Position(turns(at)));
        assert_eq!(desk.packets(2), [hold(NodeId::N3, turns(30)), read(NodeId::N3)], "{at}");
    }
    let held = Target::Position(turns(30));
    assert_eq!(desk.master.set_point(NodeId::N3), Some(held));
    assert_eq!(desk.master.stop_progress(NodeId::N3), StopProgress::Confirmed);
}

#[test]
fn a_node_in_doubt_that_is_owed_a_stop_refuses_because_of_the_stop() {
    let mut desk = Desk::stopping(manual(), N1);
    desk.answer(NodeId::N1, Answer::Position(turns(-3)));
    desk.packets(2);
    assert!(desk.master.is_mode_in_doubt(NodeId::N1));
    let owed = Err(CommandError::StopOwed { node: NodeId::N1 });
    assert_eq!(desk.master.set_velocity(NodeId::N1, rps(1.0), desk.now), owed);
    assert_eq!(desk.master.check(NodeId::N1, &Target::Position(turns(1))), owed);
    // One that is not online refuses because of that.
    let absent = Err(CommandError::NotOnline { node: NodeId::N5 });
    desk.master.stop(NodeId::N5, desk.now);
    assert_eq!(desk.master.set_velocity(NodeId::N5, rps(1.0), desk.now), absent);
}
