//! A stop is done when the motor is seen to be still: two answers at least 20 ms apart (I12).

use crate::rig::*;

const STOPPED_1: MasterEvent = MasterEvent::Stopped { node: NodeId::N1 };
const STILL_1: MasterEvent = MasterEvent::StandingStill { node: NodeId::N1 };
const STILL_3: MasterEvent = MasterEvent::StandingStill { node: NodeId::N3 };

fn place(counts: i32) -> Position {
    Position::from_counts(counts).unwrap()
}

/// A node whose stop has just been confirmed, and the time of its first answer behind a stop WRITE.
/// It may answer within 100 ms.
fn confirmed(node: (NodeId, Mode), answer: &[u8]) -> (Desk, Instant) {
    let config = with(manual(), |config| config.reply_timeout = MS(100));
    let mut desk = Desk::stopping(config, node);
    if node == N3 {
        desk.turn_with(450, answer);
    }
    desk.turn_with(450, answer);
    let first = desk.now;
    desk.turn_with(450, answer);
    assert_eq!(desk.news(), [MasterEvent::Stopped { node: node.0 }]);
    (desk, first)
}

/// Asks a node, so that the READ, with a WRITE in front of it, has left at this time.
fn ask_by(desk: &mut Desk, node: NodeId, end: Instant) {
    while desk.now + US(240) < end {
        desk.now += US(1);
        desk.master.handle_timeout(desk.now);
    }
    desk.master.read(node, desk.now).unwrap();
    desk.turn();
    assert_eq!(desk.master.poll_timeout(), Some(end + MS(100) + US(160)));
}

/// Whether a node is said to be still within a second after its stop, and to be still moving in the
/// three seconds after the stop.
fn seen(node: (NodeId, Mode), motor: impl Fn(u32) -> Answer) -> (bool, bool) {
    let mut desk = Desk::stopping(direct(), node);
    let begin = desk.now;
    desk.follow(node.0, MS(1000), &motor);
    let is_still = desk.master.stop_progress(node.0) == StopProgress::StandingStill;
    // `follow` counts from its call.
    let offset = (desk.now - begin).as_micros();
    desk.follow(node.0, MS(2000), |at| motor(offset + at));
    let still_moving = |it: &MasterEvent| matches!(it, MasterEvent::StillMoving { .. });
    (is_still, desk.news().iter().any(still_moving))
}

#[test]
fn a_speed_below_a_twentieth_of_a_turn_per_second_is_a_standstill_in_either_direction() {
    let (below, limit) = (0.05_f32.next_down(), 0.05);
    for speed in [0.0, -0.0, 0.04, below, -below] {
        assert_eq!(seen(N1, |_| Answer::Velocity(speed)), (true, false), "{speed}");
    }
    for speed in [limit, -limit, 3.0, -3.0] {
        assert_eq!(seen(N1, |_| Answer::Velocity(speed)), (false, true), "{speed}");
    }
}

#[test]
fn one_still_answer_alone_is_no_standstill_and_two_19_ms_apart_are_none_either() {
    for (pause_us, is_still) in [(1000, false), (19_000, false), (19_999, false), (20_000, true)] {
        let answer = velocity(NodeId::N1, 0.0);
        let (mut desk, first) = confirmed(N1, &answer);
        ask_by(&mut desk, NodeId::N1, first + US(pause_us - 300));
        desk.hear(540, &answer);
        assert_eq!(desk.now - first, US(pause_us));
        assert_eq!(desk.news() == [STILL_1], is_still, "{pause_us} us");
    }
}

#[test]
fn a_late_answer_may_have_been_measured_when_it_was_asked_for() {
    for (node, answer) in [(N1, velocity(NodeId::N1, 0.0)), (N3, position(NodeId::N3, place(8190)))]
    {
        for (pause_us, is_still) in [(2000, false), (18_999, false), (19_000, true)] {
            let (mut desk, mut last) = confirmed(node, &answer);
            let count = if node == N1 { 1 } else { 2 };
            for _ in 0..count {
                assert_eq!(desk.news(), []);
                ask_by(&mut desk, node.0, last + US(pause_us));
                desk.hear(60_000, &answer);
                last = desk.now;
            }
            let is_told = desk.news() == [MasterEvent::StandingStill { node: node.0 }];
            assert_eq!(is_told, is_still, "{node:?}, {pause_us} us");
        }
    }
}

#[test]
fn a_motor_that_moves_between_two_still_answers_is_not_still() {
    let ms = |at: u32| at / 1000;
    // Still for 19 ms at a time; held by a load and jerking every 15 ms.
    assert_eq!(seen(N1, |at| Answer::Velocity(f32::from(ms(at) % 40 >= 19))), (false, true));
    let jerk = |at| Answer::Velocity(if ms(at) % 15 < 2 { -0.2 } else { 0.0 });
    assert_eq!(seen(N1, jerk), (false, true));
    // Reversing through 0 at the moment of the stop, it comes to rest only after 600 ms.
    let reversing = |at: u32| match at {
        0..=100_000 => (at as f32 - 1_000.0) / -20_000.0,
        100_001..=600_000 => -5.0 + (at as f32 - 100_000.0) / 100_000.0,
        _ => 0.0,
    };
    let mut desk = Desk::stopping(direct(), N1);
    desk.follow(NodeId::N1, MS(590), |at| Answer::Velocity(reversing(at)));
    assert_eq!(desk.news(), [STOPPED_1]);
    assert_eq!(seen(N1, |at| Answer::Velocity(reversing(at))), (true, false));
}

#[test]
fn of_a_node_whose_answers_are_frozen_nothing_can_be_seen() {
    assert_eq!(seen(N1, |_| Answer::Velocity(5.0)), (false, true));
    // Frozen at a standstill or at a position, it may run: the library cannot know.
    assert_eq!(seen(N1, |_| Answer::Velocity(0.0)), (true, false));
    assert_eq!(seen(N3, |_| Answer::Position(turns(40))), (true, false));
}

#[test]
fn a_position_node_that_hunts_by_10_counts_is_still_and_one_that_creeps_on_is_not() {
    let hunt = |at: u32| Answer::Position(place(8190 + 10 * (at as i32 / 7000 % 2)));
    assert_eq!(seen(N3, hunt), (true, false));
    // Half a turn per second, and 0.04 turns per second.
    assert_eq!(seen(N3, |at| Answer::Position(place(at as i32 / 250))), (false, true));
    assert_eq!(seen(N3, |at| Answer::Position(place(at as i32 / 3051))), (true, false));
}

#[test]
fn a_nan_speed_is_not_a_standstill() {
    let mut desk = Desk::stopping(manual(), N1);
    desk.answer(NodeId::N1, Answer::Velocity(3.0));
    desk.until(NodeId::N1, StopProgress::Confirmed);
    desk.news();
    for bits in [0x7FC0_0000_u32, 0x7F80_0000, 0xFF80_0000].repeat(3) {
        desk.turn();
        let [a, b, c, d] = bits.to_le_bytes();
        let mut answer = vec![0x55, 1, a, b, c, d];
        answer.extend(axlewire::crc16::compute(&answer).to_le_bytes());
        desk.hear(450, &answer);
    }
    assert_eq!(desk.news(), []);
}

#[test]
fn standstill_is_reported_once() {
    let mut desk = Desk::stopping(direct(), N1);
    desk.answer(NodeId::N1, Answer::Velocity(3.0));
    let mut told = vec![];
    for speed in [3.0, 2.0, 0.0, 0.0, 0.04, 0.0] {
        desk.answer(NodeId::N1, Answer::Velocity(speed));
        desk.run(MS(15));
        told.push(desk.news());
    }
    assert_eq!(told, [vec![STOPPED_1], vec![], vec![], vec![STILL_1], vec![], vec![]]);
}

#[test]
fn three_positions_within_8_counts_and_20_ms_apart_are_a_standstill_and_two_are_not() {
    for (pause_us, way, is_still) in [
        (20_000, 8, true),
        (20_000, -8, true),
        (20_000, 9, false),
        (20_000, -9, false),
        (19_999, 0, false),
        (60_000, 0, true),
    ] {
        let (mut desk, mut last) = confirmed(N3, &position(NodeId::N3, place(8190)));
        for is_last in [false, true] {
            ask_by(&mut desk, NodeId::N3, last + US(pause_us - 300));
            desk.hear(540, &position(NodeId::N3, place(8190 + way)));
            last = desk.now;
            let is_seen = desk.news() == [STILL_3];
            assert_eq!(is_seen, is_last && is_still, "{way} counts in {pause_us} us");
        }
    }
}

/// What a motor shows that overruns the position that it holds, and comes back.
fn overrun(lag_ms: f64, at_us: u32) -> Answer {
    let lags = f64::from(at_us) / 1000.0 / lag_ms;
    Answer::Position(place(8190 + (600.0 * lags * (-lags).exp()) as i32))
}

#[test]
fn a_position_node_that_passes_a_place_twice_as_it_comes_back_is_not_still() {
    for polling in [Polling::Fastest, Polling::Manual, Polling::Every(MS(20))] {
        for lag_ms in [5.0, 8.0, 12.0, 18.0, 25.0] {
            for phase_us in (0..20_000).step_by(1000) {
                let mut desk = Desk::stopping(with(direct(), |it| it.polling = polling), N3);
                desk.now += US(phase_us);
                let begin = desk.now;
                while desk.master.stop_progress(NodeId::N3) != StopProgress::StandingStill {
                    let offset = (desk.now - begin).as_micros() + phase_us;
                    desk.follow(NodeId::N3, US(100), |at| overrun(lag_ms, offset + at));
                }
                let shown = |at: u32| match overrun(lag_ms, at) {
                    Answer::Position(place) => place.counts(),
                    _ => unreachable!(),
                };
                let at = (desk.now - begin).as_micros() + phase_us;
                let way = shown(at).abs_diff(shown(at.saturating_sub(20_000)));
                assert!(
                    way <= 16,
                    "{way} counts in 20 ms: {polling:?}, lag {lag_ms} ms, {phase_us}"
                );
            }
        }
    }
}

#[test]
fn a_slow_shaft_is_compared_with_where_it_was_20_ms_ago_and_not_with_its_last_reading() {
    let mut desk = Desk::stopping(direct(), N3);
    // 4 counts per millisecond: half a turn per second.
    desk.follow(NodeId::N3, MS(60), |at| Answer::Position(place(at as i32 / 250)));
    assert_eq!(desk.news(), [MasterEvent::Stopped { node: NodeId::N3 }]);
    desk.run(MS(45));
    assert_eq!(desk.news(), [STILL_3]);
}

#[test]
fn a_set_point_between_confirmed_and_still_ends_the_repeats_and_the_watch_for_standstill() {
    let mut desk = Desk::stopping(manual(), N1);
    desk.answer(NodeId::N1, Answer::Velocity(3.0));
    desk.until(NodeId::N1, StopProgress::Confirmed);
    desk.news();
    desk.master.set_velocity(NodeId::N1, rps(3.0), desk.now).unwrap();
    assert_eq!(desk.master.stop_progress(NodeId::N1), StopProgress::NotAsked);
    desk.answer(NodeId::N1, Answer::Velocity(0.0));
    let sent = desk.follow(NodeId::N1, MS(3000), |_| Answer::Velocity(0.0));
    assert_eq!(sent, [(0, write(NodeId::N1, 3.0))]);
    assert_eq!(desk.news(), []);
}

#[test]
fn a_stop_is_repeated_every_20_ms_until_the_node_is_still_whatever_the_polling() {
    for polling in [Polling::Fastest, Polling::Every(MS(1000)), Polling::Manual] {
        for (node, is_released) in [(N1, false), (N3, false), (N1, true)] {
            let config = with(direct(), |config| config.polling = polling);
            let mut desk = Desk::stopping(config, node);
            // Under way for 300 ms.
            let motor = |at: u32| match node.1 {
                Mode::Velocity => Answer::Velocity(if at < 300_000 { 3.0 } else { 0.0 }),
                Mode::Position if at < 300_000 => Answer::Position(place(at as i32 / 100)),
                Mode::Position => Answer::Position(place(0)),
            };
            let writes = |sent: Vec<(u32, Vec<u8>)>| -> Vec<u32> {
                sent.into_iter().filter(|it| it.1[0] == WRITE).map(|it| it.0).collect()
            };
            let mut sent = writes(desk.follow(node.0, MS(299), motor));
            if is_released {
                desk.master.release(node.0);
            }
            let more = writes(desk.follow(node.0, MS(2), |at| motor(299_000 + at)));
            sent.extend(more.into_iter().map(|at| 299_000 + at));
            let gaps = sent.windows(2).map(|pair| pair[1] - pair[0]);
            assert!(gaps.max() <= Some(20_500), "{polling:?}, {node:?}: {sent:?}");
            desk.until(node.0, StopProgress::StandingStill);
            // Then its target is a set-point like any other.
            let sent = writes(desk.follow(node.0, MS(1500), |_| motor(400_000)));
            let most = match polling {
                _ if is_released => 0..=0,
                Polling::Fastest => 1000..=5000,
                Polling::Every(_) => 1..=2,
                Polling::Manual => 0..=0,
            };
            assert!(most.contains(&sent.len()), "{polling:?}, {node:?}: {sent:?}");
        }
    }
}

#[test]
fn a_stop_of_a_node_that_misses_its_reads_is_written_every_20_ms_behind_an_adapter_too() {
    let config = with(MasterConfig::usb_adapter(), |config| config.polling = Polling::Manual);
    let mut desk = Desk::stopping(config, N1);
    let mut begin = desk.now;
    let mut written = 0;
    while desk.master.health(NodeId::N1) != Some(Health::Abnormal) {
        let packet = desk.packet();
        if packet[0] == WRITE {
            // At most a window is under way.
            assert!(desk.now - begin <= US(20_000 + 400), "{:?}", desk.now - begin);
            (begin, written) = (desk.now, written + 1);
        } else {
            desk.silence();
        }
    }
    assert!(written > 3);
}

#[test]
fn a_motor_is_told_to_move_on_only_when_an_answer_shows_that_it_does() {
    for (node, moving, at_rest) in [
        (N1, Answer::Velocity(3.0), Answer::Velocity(0.0)),
        (N3, Answer::Position(place(8192)), Answer::Position(place(8300))),
    ] {
        let mut desk = Desk::stopping(direct(), node);
        desk.answer(node.0, moving);
        desk.until(node.0, StopProgress::Confirmed);
        desk.news();
        // The application comes back when there is no more time to coast.
        desk.now += MS(5000);
        desk.follow(node.0, MS(100), |_| at_rest);
        assert_eq!(desk.news(), [MasterEvent::StandingStill { node: node.0 }]);
    }
}

#[test]
fn a_motor_is_told_to_move_on_once_although_its_node_is_lost_again_and_again() {
    let mut desk = Desk::stopping(direct(), N1);
    let (begin, mut told) = (desk.now, vec![]);
    for _ in 0..20 {
        desk.follow(NodeId::N1, MS(280), |_| Answer::Velocity(3.0));
        desk.lose(NodeId::N1);
        let news = desk.news().into_iter();
        let still_moving = news.filter(|it| matches!(it, MasterEvent::StillMoving { .. }));
        told.extend(still_moving.map(|_| (desk.now - begin).as_micros() / 1000));
    }
    assert!(told.len() == 1 && (2000..2400).contains(&told[0]), "{told:?}");
}

#[test]
fn a_motor_that_coasts_on_is_told_once_and_again_when_it_is_stopped_again() {
    let status = Status::Velocity(3.0);
    let told = [MasterEvent::StillMoving { node: NodeId::N1, status }];
    for (coast, is_asked_often) in [(2000, false), (300, false), (2000, true)] {
        let config = with(manual(), |config| config.coast = MS(coast));
        let mut desk = Desk::stopping(config, N1);
        desk.answer(NodeId::N1, Answer::Velocity(3.0));
        desk.until(NodeId::N1, StopProgress::Confirmed);
        desk.news();
        let run = |desk: &mut Desk, ms: u32| {
            for _ in 0..ms / 20 {
                if is_asked_often {
                    desk.master.stop(NodeId::N1, desk.now);
                }
                desk.follow(NodeId::N1, MS(20), |_| Answer::Velocity(3.0));
            }
        };
        run(&mut desk, coast - 20);
        assert_eq!(desk.news(), []);
        assert_eq!(desk.master.stop_progress(NodeId::N1), StopProgress::Confirmed);
        run(&mut desk, 40);
        assert_eq!(desk.news(), told, "an application that stops often postpones nothing");
        if !is_asked_often {
            assert_eq!(desk.master.stop_progress(NodeId::N1), StopProgress::StillMoving);
            run(&mut desk, 10_000);
            assert_eq!(desk.news(), [], "told once");
            desk.master.stop(NodeId::N1, desk.now);
            assert_eq!(desk.master.stop_progress(NodeId::N1), StopProgress::Confirmed);
        }
        run(&mut desk, coast - 40);
        assert_eq!(desk.news(), []);
        run(&mut desk, 80);
        assert_eq!(desk.news(), told);
        // It is stopped further, and comes to rest after all.
        desk.follow(NodeId::N1, MS(50), |_| Answer::Velocity(0.0));
        assert_eq!(desk.news(), [STILL_1]);
    }
}

#[test]
fn a_stop_that_joins_a_released_one_is_repeated_like_any_other() {
    let mut desk = Desk::stopping(direct(), N1);
    desk.until(NodeId::N1, StopProgress::Confirmed);
    desk.master.release(NodeId::N1);
    desk.master.stop(NodeId::N1, desk.now);
    desk.until(NodeId::N1, StopProgress::StandingStill);
    assert_eq!(desk.master.set_point(NodeId::N1), Some(Target::Velocity(rps(0.0))));
}
