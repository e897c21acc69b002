//! Standstill is measured, separately from a paid stop (I12).

use axlewire::ikeya::PositionResponse;

use crate::rig::*;

const STILL_1: MasterEvent = MasterEvent::StandingStill { node: NodeId::N1 };
const STILL_3: MasterEvent = MasterEvent::StandingStill { node: NodeId::N3 };

/// A node known only by this answer, which has paid its stop.
fn paid_by(answer: Answer) -> Desk {
    let mut desk = Desk::with_nodes(manual(), &[N1]);
    desk.answer(NodeId::N1, answer);
    desk.master.stop(NodeId::N1, desk.now);
    desk.packets(4);
    desk
}

#[test]
fn a_speed_below_a_twentieth_of_a_turn_per_second_is_a_standstill_in_either_direction() {
    let (below, limit) = (0.05_f32.next_down(), 0.05);
    for (speed, is_still) in [
        (0.0, true),
        (-0.0, true),
        (below, true),
        (-below, true),
        (limit, false),
        (-limit, false),
        (3.0, false),
        (-3.0, false),
    ] {
        let mut desk = paid_by(Answer::Velocity(speed));
        let news = desk.news();
        let stopped = MasterEvent::Stopped { node: NodeId::N1 };
        assert_eq!(news[0], stopped);
        assert_eq!(news[1..] == [STILL_1], is_still, "{speed}: {news:?}");
        assert_eq!(news.len(), 1 + usize::from(is_still));
        let progress = desk.master.stop_progress(NodeId::N1);
        assert_eq!(progress == StopProgress::StandingStill, is_still);
        assert_eq!(progress == StopProgress::Confirmed, !is_still);
    }
}

#[test]
fn a_nan_speed_is_not_a_standstill() {
    let mut desk = paid_by(Answer::Velocity(3.0));
    desk.news();
    for bits in [0x7FC0_0000_u32, 0x7F80_0000, 0xFF80_0000] {
        desk.master.read(NodeId::N1, desk.now).unwrap();
        desk.turn();
        let [a, b, c, d] = bits.to_le_bytes();
        let mut answer = vec![0x55, 1, a, b, c, d];
        answer.extend(axlewire::crc16::compute(&answer).to_le_bytes());
        desk.hear(290, &answer);
    }
    assert_eq!(desk.news(), []);
}

#[test]
fn standstill_is_reported_once_and_only_when_true() {
    let mut desk = paid_by(Answer::Velocity(3.0));
    desk.news();
    let mut told = vec![];
    for speed in [2.0, 1.0, 0.01, 0.0, 4.0, 0.0] {
        desk.answer(NodeId::N1, Answer::Velocity(speed));
        desk.master.read(NodeId::N1, desk.now).unwrap();
        // The stop is repeated before each READ.
        assert_eq!(desk.packets(2), [write(NodeId::N1, 0.0), read(NodeId::N1)]);
        told.push(desk.news());
    }
    let expected = [vec![], vec![], vec![STILL_1], vec![], vec![], vec![]];
    assert_eq!(told, expected);
}

#[test]
fn two_positions_within_8_counts_and_20_ms_apart_are_a_standstill() {
    let place = |counts: i32| Position::from_counts(counts).unwrap();
    for (pause_us, way, is_still) in [
        (20_000, 8, true),
        (20_000, -8, true),
        (20_000, 9, false),
        (20_000, -9, false),
        (19_999, 0, false),
        (60_000, 0, true),
    ] {
        let mut desk = Desk::stopping_at(manual(), place(8190));
        assert_eq!(desk.packets(9).len(), 5);
        assert_eq!(desk.news(), [MasterEvent::Stopped { node: NodeId::N3 }]);
        let paid = desk.now;
        desk.master.read(NodeId::N3, desk.now).unwrap();
        desk.now = paid + US(pause_us - 450);
        desk.turn();
        let answer = PositionResponse::new(NodeId::N3, place(8190 + way));
        desk.hear(450, answer.as_bytes());
        assert_eq!(desk.now - paid, US(pause_us));
        assert_eq!(desk.news() == [STILL_3], is_still, "{way} counts in {pause_us} us");
    }
}

#[test]
fn a_slow_shaft_is_compared_with_where_it_was_20_ms_ago_and_not_with_its_last_reading() {
    let mut desk = Desk::stopping(direct(), N3);
    // 4 counts per millisecond: half a turn per second.
    for millis in 0..200 {
        let at = Position::from_counts(4 * millis).unwrap();
        desk.answer(NodeId::N3, Answer::Position(at));
        desk.run(MS(1));
    }
    let stopped = MasterEvent::Stopped { node: NodeId::N3 };
    assert_eq!(desk.news(), [stopped]);
    desk.run(MS(45));
    assert_eq!(desk.news(), [STILL_3]);
}

#[test]
fn a_new_set_point_ends_the_watch_for_standstill() {
    let mut desk = paid_by(Answer::Velocity(3.0));
    desk.news();
    desk.master.set_velocity(NodeId::N1, rps(3.0), desk.now).unwrap();
    desk.packets(1);
    desk.answer(NodeId::N1, Answer::Velocity(0.0));
    desk.master.read(NodeId::N1, desk.now).unwrap();
    assert_eq!(desk.packets(2).len(), 1, "one answered READ");
    assert_eq!(desk.news(), []);
    assert_eq!(desk.master.stop_progress(NodeId::N1), StopProgress::NotAsked);
    assert!(desk.master.poll_event().is_none());
}
