//! Stops of nodes that answer: owed until confirmed (I6, I12).

use crate::rig::*;

const STOPPED_1: MasterEvent = MasterEvent::Stopped { node: NodeId::N1 };
const STOPPED_3: MasterEvent = MasterEvent::Stopped { node: NodeId::N3 };

#[test]
fn stop_means_zero_for_velocity_and_hold_for_position_but_never_go_to_zero() {
    let mut desk = Desk::with_nodes(only(&[NodeId::N1, NodeId::N3]), &[N1, N3]);
    desk.master.stop_all(desk.now);
    let mut written = writes(&desk.run(MS(20)));
    written.sort();
    written.dedup();
    let hold = hold(NodeId::N3, Position::new(7, 3));
    assert_eq!(written, [write(NodeId::N1, 0.0), hold]);
    let news = desk.news();
    assert!(news.contains(&STOPPED_1) && news.contains(&STOPPED_3), "{news:?}");
}

#[test]
fn a_stop_is_confirmed_by_two_writes_that_have_each_been_followed_by_an_answer() {
    let mut desk = Desk::stopping(manual(), N1);
    let (stop, read) = (write(NodeId::N1, 0.0), read(NodeId::N1));
    assert_eq!(desk.packets(2), [stop.clone(), read.clone()]);
    assert_eq!(desk.master.stop_progress(NodeId::N1), StopProgress::Owed);
    assert_eq!(desk.news(), []);
    // The next WRITE may be lost together with its READ: it does not count.
    desk.answer(NodeId::N1, Answer::Silence);
    assert_eq!(desk.packets(2), [stop.clone(), read.clone()]);
    assert_eq!(desk.master.stops_owed(), NodeId::N1.into());
    desk.answer(NodeId::N1, Answer::Velocity(3.0));
    assert_eq!(desk.until(NodeId::N1, StopProgress::Confirmed), [stop, read]);
    assert_eq!(desk.news(), [STOPPED_1]);
    assert_eq!(desk.master.stops_owed(), NodeSet::NONE);
    assert_eq!(desk.master.coasting(), NodeId::N1.into());
}

#[test]
fn an_answer_to_a_read_from_before_the_stop_confirms_nothing() {
    let mut desk = Desk::with_nodes(manual(), &[N1]);
    desk.master.read(NodeId::N1, desk.now).unwrap();
    desk.turn();
    desk.master.stop(NodeId::N1, desk.now);
    desk.hear(290, &velocity(NodeId::N1, 0.0));
    let kinds = kinds(&desk.until(NodeId::N1, StopProgress::Confirmed));
    assert_eq!(kinds, [(WRITE, 1), (READ, 1), (WRITE, 1), (READ, 1)]);
}

#[test]
fn a_position_stop_reads_first_and_holds_what_this_read_returned() {
    let mut desk = Desk::with_nodes(manual(), &[N3]);
    desk.answer(NodeId::N3, Answer::Position(turns(40)));
    desk.now += MS(8000);
    desk.master.stop(NodeId::N3, desk.now);
    let (read, hold) = (read(NodeId::N3), hold(NodeId::N3, turns(40)));
    let expected = [read.clone(), hold.clone(), read.clone(), hold, read];
    assert_eq!(desk.until(NodeId::N3, StopProgress::Confirmed), expected);
    assert_eq!(desk.news(), [STOPPED_3]);
}

#[test]
fn a_position_being_read_when_the_stop_was_requested_is_not_held() {
    let mut desk = Desk::with_nodes(manual(), &[N3]);
    desk.master.read(NodeId::N3, desk.now).unwrap();
    desk.turn();
    desk.master.stop(NodeId::N3, desk.now);
    desk.hear(290, &position(NodeId::N3, turns(40)));
    desk.answer(NodeId::N3, Answer::Position(turns(41)));
    let sent = desk.packets(9);
    assert_eq!(sent[0], read(NodeId::N3));
    assert_eq!(sent[1], hold(NodeId::N3, turns(41)));
}

#[test]
fn hold_age_is_the_maximum_age_of_a_position_held_without_a_read() {
    for (age_us, is_held) in [(999, true), (1000, false), (1001, false)] {
        let config = with(manual(), |config| config.hold_age = US(1000));
        let mut desk = Desk::with_nodes(config, &[N3]);
        desk.answer(NodeId::N3, Answer::Position(turns(40)));
        let heard = desk.master.status(NodeId::N3).unwrap().1;
        desk.now = heard + US(age_us);
        desk.master.stop(NodeId::N3, desk.now);
        let old = hold(NodeId::N3, Position::new(7, 3));
        let expected = if is_held { old } else { read(NodeId::N3) };
        assert_eq!(desk.packet(), expected, "{age_us} us");
    }
}

#[test]
fn a_hold_is_the_set_point_and_is_repeated_with_the_same_value() {
    let mut desk = Desk::stopping_at(direct(), turns(40));
    let mut written = writes(&desk.packets(5));
    // A shaft that is pushed is not held at the new position.
    for drift in 41..60 {
        desk.answer(NodeId::N3, Answer::Position(turns(drift)));
        written.extend(writes(&desk.packets(2)));
    }
    assert_eq!(desk.master.set_point(NodeId::N3), Some(Target::Position(turns(40))));
    assert!(written.len() > 15 && written.iter().all(|it| *it == hold(NodeId::N3, turns(40))));
    // Nor after another stop call, if it stands just beside that.
    desk.answer(NodeId::N3, Answer::Position(beside(turns(40), 256)));
    desk.until(NodeId::N3, StopProgress::StandingStill);
    desk.news();
    desk.master.stop(NodeId::N3, desk.now);
    assert_eq!(desk.master.stop_progress(NodeId::N3), StopProgress::Owed);
    let (read, hold) = (read(NodeId::N3), hold(NodeId::N3, turns(40)));
    assert_eq!(desk.packets(5), [read.clone(), hold.clone(), read.clone(), hold, read]);
    assert_eq!(desk.news(), [STOPPED_3]);
}

#[test]
fn a_new_stop_of_a_node_that_was_turned_meanwhile_does_not_drive_it_back() {
    for away in [257, -257, 50 * 8192] {
        let mut desk = Desk::stopping_at(manual(), turns(40));
        desk.until(NodeId::N3, StopProgress::StandingStill);
        // It is switched off, turned by hand and switched on, while nobody reads it.
        desk.now += MS(10_000);
        let here = beside(turns(40), away);
        desk.answer(NodeId::N3, Answer::Position(here));
        desk.news();
        desk.master.stop(NodeId::N3, desk.now);
        let sent = desk.until(NodeId::N3, StopProgress::StandingStill);
        assert!(writes(&sent).iter().all(|it| *it == hold(NodeId::N3, here)), "{sent:02x?}");
    }
}

#[test]
fn a_node_that_is_still_and_not_polled_is_read_without_a_write_in_front() {
    for node in [N1, N3] {
        let mut desk = Desk::stopping(manual(), node);
        desk.until(node.0, StopProgress::StandingStill);
        desk.now += MS(10_000);
        desk.master.read(node.0, desk.now).unwrap();
        assert_eq!(desk.packets(4), [read(node.0)]);
    }
}

#[test]
fn a_read_of_a_node_that_was_turned_by_hand_does_not_drive_it_back() {
    for (node, moving) in [(N1, Answer::Velocity(0.5)), (N3, Answer::Position(turns(90)))] {
        let mut desk = Desk::stopping(manual(), node);
        desk.until(node.0, StopProgress::StandingStill);
        desk.now += MS(10_000);
        desk.answer(node.0, moving);
        desk.master.read(node.0, desk.now).unwrap();
        assert_eq!(desk.packets(4), [read(node.0)]);
        // A failed flush of something else does not make it due either.
        desk.master.handle_transmit(Unsent::Unflushed, desk.now);
        assert_eq!(desk.packets(4), Vec::<Vec<u8>>::new());
        assert_eq!(desk.master.stops_owed(), NodeSet::NONE);
    }
}

#[test]
fn a_confirmation_of_a_stop_that_is_still_ends_and_is_refused_if_nobody_polls() {
    for polling in [Polling::Fastest, Polling::Every(MS(20)), Polling::Manual] {
        for node in [N1, N3] {
            let mut desk = Desk::stopping(with(direct(), |it| it.polling = polling), node);
            desk.until(node.0, StopProgress::StandingStill);
            desk.news();
            let asked = desk.master.confirm(node.0, desk.now);
            let sent = desk.run(MS(100));
            if polling == Polling::Manual {
                assert_eq!(asked, Err(CommandError::NoSetPoint { node: node.0 }));
                assert_eq!((sent, desk.news()), (vec![], vec![]));
            } else {
                assert_eq!(desk.news(), [MasterEvent::Confirmed { node: node.0 }]);
            }
        }
    }
}

#[test]
fn a_stop_that_was_released_is_not_repeated_once_it_is_still_whenever_that_was() {
    for (released_at, is_lost) in [
        (StopProgress::Owed, false),
        (StopProgress::Owed, true),
        (StopProgress::Confirmed, false),
        (StopProgress::Confirmed, true),
        (StopProgress::StandingStill, true),
    ] {
        let mut desk = Desk::stopping_at(direct(), turns(40));
        desk.until(NodeId::N3, released_at);
        desk.master.release(NodeId::N3);
        if is_lost {
            desk.lose(NodeId::N3);
            desk.answer(NodeId::N3, Answer::Position(turns(40)));
        }
        desk.run(MS(300));
        let progress = desk.master.stop_progress(NodeId::N3);
        let is_over = released_at == StopProgress::StandingStill;
        let expected = if is_over { StopProgress::NotAsked } else { StopProgress::StandingStill };
        assert_eq!(progress, expected, "{released_at:?}, {is_lost}");
        // Somebody works on it.
        desk.answer(NodeId::N3, Answer::Position(turns(43)));
        assert_eq!(writes(&desk.run(MS(2000))), Vec::<Vec<u8>>::new());
    }
}

#[test]
fn a_confirmation_that_is_asked_for_just_before_standstill_writes_nothing_to_a_node_not_polled() {
    for exchanges in 1..12 {
        let mut desk = Desk::stopping_at(manual(), turns(40));
        desk.packets(exchanges);
        let is_asked = desk.master.confirm(NodeId::N3, desk.now).is_ok();
        desk.until(NodeId::N3, StopProgress::StandingStill);
        assert_eq!(desk.packets(4), Vec::<Vec<u8>>::new(), "{exchanges}");
        let news = desk.news().into_iter();
        let ends = news.filter(|it| {
            matches!(it, MasterEvent::Confirmed { .. } | MasterEvent::NotConfirmed { .. })
        });
        assert_eq!(ends.count(), usize::from(is_asked), "{exchanges}");
    }
}

#[test]
fn a_hold_behind_which_no_answer_has_come_is_looked_at_again_after_a_pause() {
    for misses in 0..6 {
        let mut desk = Desk::stopping_at(direct(), turns(40));
        desk.turn_with(340, &position(NodeId::N3, turns(40)));
        for _ in 0..misses {
            // The WRITE and the READ behind it are lost.
            desk.miss();
        }
        desk.now += MS(3000);
        desk.answer(NodeId::N3, Answer::Position(turns(70)));
        let sent = desk.run(MS(50));
        let last = writes(&sent).into_iter().find(|it| it[0] == WRITE).unwrap();
        assert_eq!(last, hold(NodeId::N3, turns(70)), "{misses}");
    }
}

#[test]
fn a_hold_that_is_kept_and_cannot_be_written_for_20_ms_is_looked_at_again() {
    for (late_us, is_read) in [(20_160, false), (20_161, true), (3_000_000, true)] {
        let mut desk = Desk::stopping_at(manual(), turns(40));
        desk.until(NodeId::N3, StopProgress::StandingStill);
        desk.master.stop(NodeId::N3, desk.now);
        assert_eq!(desk.packets(1), [read(NodeId::N3)]);
        // The port fails, and meanwhile the shaft is turned.
        let begin = desk.now;
        desk.answer(NodeId::N3, Answer::Position(turns(90)));
        assert_eq!(desk.packet(), hold(NodeId::N3, turns(40)));
        desk.master.handle_transmit(Unsent::Untouched, desk.now);
        desk.now = begin + US(late_us);
        let place = if is_read { turns(90) } else { turns(40) };
        let written = writes(&desk.packets(3));
        assert_eq!(written[0], hold(NodeId::N3, place), "{late_us} us");
    }
}

/// What follows when a port refuses the first WRITE of each measured position for so long, ms.
fn behind_outages(desk: &mut Desk, outages_ms: &[u32]) -> Vec<u8> {
    let mut packet = read(NodeId::N3).to_vec();
    for &outage in outages_ms {
        assert_eq!(desk.packets(1)[0][0], WRITE);
        desk.master.handle_transmit(Unsent::Untouched, desk.now);
        desk.now += MS(outage);
        packet = desk.packets(1).remove(0);
        if packet[0] == WRITE {
            break;
        }
    }
    packet
}

#[test]
fn a_port_that_fails_again_and_again_makes_a_hold_only_20_ms_older_each_time() {
    let stopped = || {
        let mut desk = Desk::with_nodes(direct(), &[N3]);
        desk.answer(NodeId::N3, Answer::Position(turns(40)));
        desk.master.stop(NodeId::N3, desk.now);
        assert_eq!(desk.packets(1), [read(NodeId::N3)]);
        desk
    };
    for outages in [&[30, 50, 90, 170, 330, 650, 1200][..], &[21, 41, 61, 81, 101, 121]] {
        assert_eq!(behind_outages(&mut stopped(), outages), read(NodeId::N3), "{outages:?}");
    }
    // A port that always takes this long takes it in the end.
    for (outages, is_taken) in [(&[155; 7][..], false), (&[155; 8], true)] {
        let last = behind_outages(&mut stopped(), outages);
        assert_eq!(last[0] == WRITE, is_taken, "{outages:?}");
    }
}

#[test]
fn stops_of_position_nodes_are_confirmed_however_long_a_round_of_all_nodes_takes() {
    for (timeout, baud) in [(MS(20), 9600), (MS(100), 500_000), (MS(500), 9600)] {
        let config = with(MasterConfig::usb_adapter(), |config| {
            (config.reply_timeout, config.late_guard, config.baud) = (timeout, timeout, baud);
            config.accepts_early = true;
        });
        let nodes = NodeId::ALL.map(|node| (node, Mode::Position));
        let mut desk = Desk::with_nodes(config, &nodes);
        for node in NodeId::ALL {
            desk.answer(node, Answer::Position(turns(40)));
            desk.master.stop(node, desk.now);
        }
        for node in NodeId::ALL {
            let sent = desk.until(node, StopProgress::StandingStill);
            assert!(sent.len() < 1000, "{timeout:?} {}", sent.len());
        }
    }
}

#[test]
fn a_loaded_node_that_is_lost_again_and_again_does_not_sink() {
    for between in [MS(3), MS(200)] {
        let mut desk = Desk::stopping_at(direct(), turns(40));
        let mut told = turns(40);
        for _ in 0..50 {
            // It is held where it was, and its load turns it by 250 counts from there.
            let sent = desk.run(between);
            told = writes(&sent).last().map_or(told, |last| place_of(last));
            desk.lose(NodeId::N3);
            desk.answer(NodeId::N3, Answer::Position(beside(told, -250)));
        }
        assert_eq!(told, turns(40), "{between:?}");
    }
}

fn place_of(write: &[u8]) -> Position {
    let half = |at: usize| i16::from_le_bytes([write[at], write[at + 1]]);
    Position::new(half(2), half(4))
}

#[test]
fn a_loaded_node_that_misses_each_read_behind_a_write_does_not_creep_from_hold_to_hold() {
    for sag in [40, 256] {
        let mut desk = Desk::with_nodes(direct(), &[N3]);
        desk.answer(NodeId::N3, Answer::Position(turns(40)));
        desk.master.stop(NodeId::N3, desk.now);
        let mut told = turns(40);
        for _ in 0..1000 {
            let packet = desk.packet();
            if packet[0] == WRITE {
                told = place_of(&packet);
                desk.packet();
                desk.silence();
            } else {
                desk.hear(340, &position(NodeId::N3, beside(told, -sag)));
            }
        }
        assert_eq!(told, beside(turns(40), -sag));
    }
}

#[test]
fn a_loaded_node_that_misses_each_read_behind_a_write_sinks_a_few_times_at_most_before_it_is_lost()
{
    for config in [direct(), MasterConfig::usb_adapter()] {
        let mut desk = Desk::with_nodes(config, &[N3]);
        desk.answer(NodeId::N3, Answer::Position(turns(40)));
        desk.master.stop(NodeId::N3, desk.now);
        let (mut told, mut losses, mut holds) = (turns(40), 0, 1);
        for _ in 0..3000 {
            let was_online = desk.master.health(NodeId::N3) != Some(Health::Abnormal);
            let packet = desk.packet();
            if packet[0] == WRITE {
                holds += u32::from(place_of(&packet) != told);
                told = place_of(&packet);
                // All READs until the next answer is needed for a hold.
                while desk.packet()[0] == WRITE {}
                desk.silence();
            } else {
                desk.hear(340, &position(NodeId::N3, beside(told, -300)));
            }
            let is_lost = desk.master.health(NodeId::N3) == Some(Health::Abnormal);
            losses += u32::from(was_online && is_lost);
        }
        assert!(holds <= 9 + losses, "{holds} {losses}");
    }
}

#[test]
fn a_node_that_stands_away_from_what_it_was_told_to_hold_is_not_still() {
    // All stop WRITEs are lost, and it has reached its old set-point.
    for (away, is_still) in [(256, true), (-256, true), (257, false), (-257, false)] {
        let mut desk = Desk::stopping_at(direct(), turns(40));
        desk.packets(2);
        desk.answer(NodeId::N3, Answer::Position(beside(turns(40), away)));
        desk.run(MS(2500));
        let progress = desk.master.stop_progress(NodeId::N3);
        let expected =
            if is_still { StopProgress::StandingStill } else { StopProgress::StillMoving };
        assert_eq!(progress, expected, "{away}");
    }
}

#[test]
fn a_motor_that_moves_again_is_no_longer_still_and_is_stopped_again() {
    for polling in [Polling::Fastest, Polling::Every(MS(20))] {
        for (node, moving, at_rest) in [
            (N1, Answer::Velocity(5.0), Answer::Velocity(0.0)),
            (N3, Answer::Position(turns(9)), Answer::Position(turns(3))),
        ] {
            let mut desk = Desk::stopping(with(direct(), |it| it.polling = polling), node);
            desk.answer(node.0, at_rest);
            desk.until(node.0, StopProgress::StandingStill);
            desk.run(MS(5000));
            desk.news();
            desk.answer(node.0, moving);
            desk.run(MS(1900));
            assert_eq!(desk.master.stop_progress(node.0), StopProgress::Confirmed);
            assert_eq!(desk.news(), []);
            desk.run(MS(200));
            assert!(matches!(desk.news()[..], [MasterEvent::StillMoving { .. }]));
            desk.answer(node.0, at_rest);
            desk.run(MS(100));
            assert_eq!(desk.news(), [MasterEvent::StandingStill { node: node.0 }]);
            // Once the application has released it, it may move.
            desk.master.release(node.0);
            desk.answer(node.0, moving);
            let sent = desk.run(MS(100));
            assert_eq!(writes(&sent), Vec::<Vec<u8>>::new());
            assert_eq!(desk.master.stop_progress(node.0), StopProgress::StandingStill);
        }
    }
}

#[test]
fn a_node_whose_mode_was_in_doubt_has_all_of_its_time_to_become_still_again() {
    let mut desk = Desk::stopping_at(direct(), turns(3));
    desk.until(NodeId::N3, StopProgress::StandingStill);
    desk.run(MS(5000));
    desk.news();
    desk.turn_with(340, &velocity(NodeId::N3, 1.0));
    desk.answer(NodeId::N3, Answer::Position(turns(4)));
    desk.packets(6);
    desk.answer(NodeId::N3, Answer::Position(turns(6)));
    desk.run(MS(1900));
    assert_eq!(desk.news(), [STOPPED_3]);
    desk.run(MS(200));
    assert!(matches!(desk.news()[..], [MasterEvent::StillMoving { .. }]));
}

#[test]
fn a_hold_is_measured_again_after_the_node_was_abnormal() {
    let mut desk = Desk::stopping_at(direct(), turns(40));
    desk.run(MS(10));
    desk.news();
    desk.lose(NodeId::N3);
    assert_eq!(desk.master.stop_progress(NodeId::N3), StopProgress::Owed);
    desk.answer(NodeId::N3, Answer::Position(turns(30)));
    let written = writes(&desk.run(MS(50)));
    assert!(written.len() > 2 && written.iter().all(|it| *it == hold(NodeId::N3, turns(30))));
    assert!(desk.news().contains(&STOPPED_3));
}

#[test]
fn a_hold_that_was_perhaps_never_heard_is_measured_again_and_one_that_was_is_kept() {
    for is_followed in [false, true] {
        let mut desk = Desk::stopping_at(direct(), turns(40));
        while writes(&desk.sent).is_empty() {
            let packet = desk.exchange().unwrap();
            desk.sent.push(packet);
        }
        if is_followed {
            desk.exchange();
        }
        // Two windows, in which the shaft turns on.
        desk.answer(NodeId::N3, Answer::Silence);
        desk.run(MS(2));
        assert_eq!(desk.master.health(NodeId::N3), Some(Health::Suspect(2)));
        desk.answer(NodeId::N3, Answer::Position(turns(30)));
        let held = if is_followed { turns(40) } else { turns(30) };
        let written = writes(&desk.run(MS(10)));
        assert_eq!(written.last(), Some(&hold(NodeId::N3, held)), "{is_followed}");
    }
}

#[test]
fn an_answer_that_measures_a_hold_again_does_not_follow_the_write_of_the_old_one() {
    let mut desk = Desk::stopping_at(direct(), turns(40));
    while writes(&desk.sent).is_empty() {
        let packet = desk.exchange().unwrap();
        desk.sent.push(packet);
    }
    // The WRITE is lost, and the application is away twice.
    for place in [turns(60), turns(90)] {
        desk.now += MS(3000);
        desk.answer(NodeId::N3, Answer::Position(place));
        assert_eq!(desk.exchange(), Some(read(NodeId::N3)), "a hold that is 3 s old");
    }
    assert_eq!(desk.packet(), hold(NodeId::N3, turns(90)));
}

#[test]
fn a_repeated_stop_joins_the_one_that_is_not_done() {
    // Two WRITEs confirm it; it is repeated until the node is still.
    for (node, way, count) in [(N1, 6, 3), (N3, 9, 4)] {
        let mut desk = Desk::with_nodes(manual(), &[node]);
        let mut sent = vec![];
        for _ in 0..way {
            desk.master.stop(node.0, desk.now);
            sent.extend(desk.packets(1));
        }
        assert_eq!(desk.master.stop_progress(node.0), StopProgress::StandingStill);
        assert_eq!(writes(&sent).len(), count);
    }
}

#[test]
fn while_a_stop_is_owed_set_points_are_refused_and_not_kept() {
    let mut desk = Desk::with_nodes(manual(), &[N1, N3]);
    for node in [NodeId::N1, NodeId::N3] {
        desk.master.stop(node, desk.now);
        let owed = CommandError::StopOwed { node };
        assert_eq!(owed.to_string(), format!("node {node} has not confirmed its stop yet"));
        let set = match node {
            NodeId::N1 => desk.master.set_velocity(node, rps(1.0), desk.now),
            _ => desk.master.set_position(node, turns(1), desk.now),
        };
        assert_eq!(set, Err(owed));
        assert_eq!(desk.master.set_point(node), None);
    }
    let mut written = writes(&desk.until(NodeId::N1, StopProgress::Confirmed));
    written.extend(writes(&desk.until(NodeId::N3, StopProgress::Confirmed)));
    let places = [write(NodeId::N1, 0.0), hold(NodeId::N3, Position::new(7, 3))];
    assert!(written.len() == 4 && written.iter().all(|it| places.contains(it)), "{written:02x?}");
    // Once it is confirmed, they are accepted again.
    assert_eq!(desk.master.set_velocity(NodeId::N1, rps(1.0), desk.now), Ok(()));
    assert_eq!(desk.master.stop_progress(NodeId::N1), StopProgress::NotAsked);
    assert_eq!(desk.packets(1), [write(NodeId::N1, 1.0)]);
}

#[test]
fn a_stop_drops_the_set_point_at_once_sent_or_not() {
    let mut desk = Desk::turning(direct(), 5.0);
    desk.master.stop(NodeId::N1, desk.now);
    let written = writes(&desk.run(MS(20)));
    assert!(written.len() > 2 && written.iter().all(|it| *it == write(NodeId::N1, 0.0)));
}

#[test]
fn a_release_cancels_no_stop_whether_owed_or_confirmed() {
    let mut desk = Desk::turning(manual(), 5.0);
    desk.master.stop(NodeId::N1, desk.now);
    desk.master.release(NodeId::N1);
    assert_eq!(desk.master.stops_owed(), NodeId::N1.into());
    desk.answer(NodeId::N1, Answer::Velocity(3.0));
    let written = writes(&desk.until(NodeId::N1, StopProgress::Confirmed));
    assert_eq!(written, [write(NodeId::N1, 0.0), write(NodeId::N1, 0.0)]);
    desk.master.release(NodeId::N1);
    let written = writes(&desk.run(MS(500)));
    assert!(written.len() > 20 && written.iter().all(|it| *it == write(NodeId::N1, 0.0)));
    desk.answer(NodeId::N1, Answer::Velocity(0.0));
    desk.until(NodeId::N1, StopProgress::StandingStill);
    assert_eq!(desk.master.set_point(NodeId::N1), None, "released now");
}

#[test]
fn a_stop_is_confirmed_even_if_no_events_are_taken() {
    let mut desk = Desk::with_nodes(direct(), &[N1]);
    for turn in 0..100 {
        let request = desk.packet();
        assert_eq!(request[0], READ);
        match turn % 3 {
            0 => desk.hear(290, &velocity(NodeId::N1, 0.0)),
            _ => desk.silence(),
        }
    }
    assert!(desk.master.lost_events() > 50);
    let lost = desk.master.lost_events();
    desk.master.stop(NodeId::N1, desk.now);
    let mut written = 0;
    while desk.master.stop_progress(NodeId::N1) == StopProgress::Owed {
        let packet = desk.packet();
        written += usize::from(packet == write(NodeId::N1, 0.0));
        if packet[0] == READ {
            desk.hear(450, &velocity(NodeId::N1, 0.0));
        }
    }
    assert_eq!(written, 2);
    assert!(desk.master.lost_events() > lost, "there was room for its event");
}

#[test]
fn a_stop_of_an_id_that_was_never_heard_reads_it_first() {
    let mut desk = Desk::new(manual());
    desk.answer(NodeId::N5, Answer::Position(turns(9)));
    desk.master.stop(NodeId::N5, desk.now);
    let (read, hold) = (read(NodeId::N5), hold(NodeId::N5, turns(9)));
    let expected = [read.clone(), hold.clone(), read.clone(), hold, read];
    assert_eq!(desk.until(NodeId::N5, StopProgress::Confirmed), expected);
    let found = MasterEvent::Discovered { node: NodeId::N5, mode: Mode::Position };
    assert_eq!(desk.news()[..2], [found, MasterEvent::Stopped { node: NodeId::N5 }]);
}

#[test]
fn a_stop_of_all_on_a_fresh_master_stops_whatever_answers_and_lists_the_silent_ids() {
    let mut desk = Desk::new(direct());
    desk.answer(NodeId::N1, Answer::Velocity(9.0));
    desk.answer(NodeId::N3, Answer::Position(turns(9)));
    desk.master.stop_all(desk.now);
    assert_eq!(desk.master.stops_owed(), NodeSet::ALL);
    let sent = desk.run(MS(100));
    let is_silent = |it: &(u8, u8)| ![1, 3].contains(&it.1);
    let six: Vec<_> = kinds(&sent).into_iter().filter(is_silent).take(6).collect();
    let mut asked: Vec<_> = six.iter().map(|it| it.1).collect();
    asked.sort_unstable();
    assert_eq!(asked, [2, 4, 5, 6, 7, 8], "all are asked before any is asked again");
    let mut silent = NodeSet::ALL;
    silent.remove(NodeId::N1);
    silent.remove(NodeId::N3);
    assert_eq!(desk.master.stops_owed(), silent);
    let written = writes(&sent);
    assert!(written.contains(&write(NodeId::N1, 0.0)));
    assert!(written.contains(&hold(NodeId::N3, turns(9))));
    // A node that is plugged in later is stopped then.
    desk.news();
    desk.answer(NodeId::N6, Answer::Velocity(2.0));
    let written = writes(&desk.run(MS(200)));
    assert!(written.contains(&write(NodeId::N6, 0.0)));
    assert!(desk.news().contains(&MasterEvent::Stopped { node: NodeId::N6 }));
}

#[test]
fn a_stop_of_all_goes_to_the_nodes_of_the_settings_and_to_others_that_have_answered() {
    let mut desk = Desk::new(only(&[NodeId::N1]));
    desk.answer(NodeId::N1, Answer::Velocity(0.0));
    desk.answer(NodeId::N8, Answer::Velocity(0.0));
    desk.master.stop(NodeId::N8, desk.now);
    desk.until(NodeId::N8, StopProgress::StandingStill);
    desk.master.stop_all(desk.now);
    let both: NodeSet = [NodeId::N1, NodeId::N8].into_iter().collect();
    assert_eq!(desk.master.stops_owed(), both);
    desk.run(MS(20));
    assert_eq!(desk.master.stops_owed(), NodeSet::NONE);
}

#[test]
fn all_nodes_are_stopped_before_the_next_exchange() {
    let nodes = NodeId::ALL.map(|node| (node, Mode::Velocity));
    let mut desk = Desk::with_nodes(direct(), &nodes);
    desk.master.stop_all(desk.now);
    let begin = desk.now;
    desk.turn();
    let mut stops = NodeId::ALL.map(|node| write(node, 0.0)).to_vec();
    desk.sent.sort();
    stops.sort();
    assert_eq!(desk.sent, stops);
    // Handed out together, they leave one after the other.
    assert_eq!(desk.now, begin);
    assert_eq!(desk.master.poll_timeout(), Some(begin + US(8 * 160 + 740)));
}

#[test]
fn a_position_is_held_however_long_the_gap_between_packets() {
    for gap in [MS(19), MS(20), MS(21), MS(200)] {
        let config = with(direct(), |config| config.turnaround_gap = gap);
        let mut desk = Desk::stopping(config, N3);
        let sent = desk.until(NodeId::N3, StopProgress::StandingStill);
        let stop = hold(NodeId::N3, Position::new(7, 3));
        assert_eq!(sent[1], stop, "{gap:?}: {sent:02x?}");
    }
}

#[test]
fn a_position_node_that_is_not_where_it_was_told_to_hold_keeps_its_hold_until_it_is_moved() {
    // If a stop measured it anew, a loaded axis would sink a little with each one.
    let mut desk = Desk::stopping_at(direct(), turns(12));
    desk.run(MS(10));
    desk.answer(NodeId::N3, Answer::Position(turns(0)));
    desk.until(NodeId::N3, StopProgress::StillMoving);
    desk.master.stop(NodeId::N3, desk.now);
    let written = writes(&desk.run(MS(100)));
    assert!(written.len() > 2 && written.iter().all(|it| *it == hold(NodeId::N3, turns(12))));
    // Its counter has restarted: this ends it.
    desk.master.set_position(NodeId::N3, turns(0), desk.now).unwrap();
    let written = writes(&desk.run(MS(100)));
    assert!(written.len() > 2 && written.iter().all(|it| *it == hold(NodeId::N3, turns(0))));
}
