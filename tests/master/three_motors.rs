//! Boards with three motors: each WRITE is answered, and all three motors count (I10).

use axlewire::ikeya::three::{PositionResponse, WriteRequest};

use crate::{
    boards::{Boards, T0},
    rig::*,
};

/// Boards 1 and 8 in velocity mode.
fn two_boards(mut config: MasterConfig) -> Boards {
    config.nodes = [NodeId::N1, NodeId::N8].into_iter().collect();
    Boards::new(config, [Mode::Velocity; 8], 700)
}

#[test]
fn the_answer_of_a_stop_write_confirms_it() {
    let mut boards = two_boards(manual());
    boards.master.stop(NodeId::N8, boards.now);
    let stop = WriteRequest::velocity(NodeId::N8, [rps(0.0); 3]).as_bytes().to_vec();
    for _ in 0..2 {
        assert!(boards.master.stops_owed().contains(NodeId::N8));
        assert_eq!(boards.exchange(), Some(stop.clone()));
    }
    assert!(boards.events.contains(&MasterEvent::Stopped { node: NodeId::N8 }));
    assert_eq!(boards.exchange(), Some(stop), "and once more, 20 ms later");
    assert!(boards.events.contains(&MasterEvent::StandingStill { node: NodeId::N8 }));
    assert_eq!(boards.exchange(), None);
}

#[test]
fn a_write_waits_for_a_late_answer_because_it_is_answered_itself() {
    for is_stop in [false, true] {
        let mut boards = two_boards(manual());
        boards.master.read(NodeId::N8, boards.now).unwrap();
        assert!(boards.master.poll_transmit(boards.now).is_some());
        boards.now = boards.master.poll_timeout().expect("a window");
        boards.master.handle_timeout(boards.now);
        let targets = if is_stop { [0.0; 3] } else { [1.0, 2.0, 3.0] }.map(rps);
        if is_stop {
            boards.master.stop(NodeId::N8, boards.now);
        } else {
            boards.master.set_velocity(NodeId::N8, targets, boards.now).unwrap();
        }
        let (before, guarded_until) = (boards.now + US(499), boards.now + US(500));
        assert_eq!(boards.master.poll_timeout(), Some(guarded_until));
        assert_eq!(boards.master.poll_transmit(before), None);
        let sent = boards.master.poll_transmit(guarded_until).map(<[u8]>::to_vec);
        let expected = WriteRequest::velocity(NodeId::N8, targets).as_bytes().to_vec();
        assert_eq!(sent, Some(expected));
    }
}

#[test]
fn turning_on_the_spot_is_not_a_standstill() {
    for (speeds, is_still) in [
        ([0.04, -0.04, 0.0], true),
        ([1.0, -1.0, 0.0], false),
        ([0.0, 0.0, -0.05], false),
        ([0.05, 0.0, 0.0], false),
        ([0.0, 0.05, 0.0], false),
    ] {
        let mut boards = two_boards(manual());
        boards.speeds = speeds;
        boards.master.stop(NodeId::N1, boards.now);
        let mut sent = 0;
        while sent < 50 && boards.exchange().is_some() {
            sent += 1;
        }
        assert_eq!(sent < 50, is_still, "repeated until it stands");
        let is_still_told =
            |event: &&MasterEvent<_>| matches!(event, MasterEvent::StandingStill { .. });
        let told = boards.events.iter().filter(is_still_told).count();
        assert_eq!(told, usize::from(is_still), "{speeds:?}");
    }
}

#[test]
fn all_three_positions_have_to_stay_within_8_counts() {
    let place = |counts| Position::from_counts(counts).unwrap();
    for (moved, is_still) in [
        ([8, -8, 0], true),
        ([9, 0, 0], false),
        ([0, -9, 0], false),
        ([0, 0, 9], false),
        ([9, -9, 0], false),
    ] {
        let mut master = Master::<ThreeMotors>::for_board(manual(), T0);
        let mut now = T0;
        let mut answer = |master: &mut Master<ThreeMotors>, pause_ms, places: [i32; 3]| {
            now += MS(pause_ms);
            let sent = master.poll_transmit(now).map(|it| it[0]);
            now += MS(1);
            let answer = PositionResponse::new(NodeId::N1, places.map(place));
            master.handle_input(answer.as_bytes(), now);
            sent
        };
        let mut config = *master.config();
        config.reply_timeout = MS(30);
        master = Master::for_board(config, T0);
        master.stop(NodeId::N1, T0);
        let steps = [(READ, 0, [0; 3]), (WRITE, 0, [0; 3]), (WRITE, 25, moved), (WRITE, 25, moved)];
        for (expected, pause_ms, places) in steps {
            assert_eq!(answer(&mut master, pause_ms, places), Some(expected));
        }
        let events = core::iter::from_fn(|| master.poll_event());
        let told = events.filter(|it| matches!(it, MasterEvent::StandingStill { .. })).count();
        assert_eq!(told == 1, is_still, "{moved:?}");
    }
}

#[test]
fn in_doubt_positions_may_be_written_if_all_read_as_standstill() {
    // Sent as count x 3, then rotation x 3; read as f32 x 3: (count 1, count 2), (count 3, rotation
    // 1), (rotation 2, rotation 3), low half first.
    for (places, may) in [
        ([(0, 0), (0, 0), (0, 0)], true),
        ([(-1, 12_287), (12_287, -1), (-1, 12_287)], true),
        ([(0, 0), (12_288, 0), (0, 0)], false),
        ([(0, 0), (-1, 0), (0, 0)], false),
        ([(0, 12_288), (0, 0), (0, 0)], false),
        ([(0, -1), (0, 0), (0, 0)], false),
        ([(0, 0), (0, 0), (0, 12_288)], false),
        ([(0, 0), (0, 0), (0, -1)], false),
    ] {
        let places = places.map(|(count, rotation)| Position::new(count, rotation));
        let packet = WriteRequest::position(NodeId::N1, places);
        let harmless = packet.as_velocity().iter().all(|rps| rps.to_bits() < 0x3000_0000);
        assert_eq!(harmless, may, "the table agrees with the packet");
        let mut boards = two_boards(manual());
        boards.master.stop(NodeId::N1, boards.now);
        // Its WRITE of 0 rps is answered like a position node's.
        assert!(boards.master.poll_transmit(boards.now).is_some());
        boards.now += US(700);
        let answer = PositionResponse::new(NodeId::N1, places);
        boards.master.handle_input(answer.as_bytes(), boards.now);
        assert!(boards.master.is_mode_in_doubt(NodeId::N1));
        // It has had its turn in this round; the round ends because nothing else is due.
        let next = boards.master.poll_transmit(boards.now).map(<[u8]>::to_vec);
        let expected = if may { packet.as_bytes().to_vec() } else { read(NodeId::N1) };
        assert_eq!(next, Some(expected), "{places:?}");
    }
}

#[test]
fn a_stop_has_one_attempt_per_round_if_its_write_is_answered() {
    let mut boards = two_boards(direct());
    boards.master.set_velocity(NodeId::N1, [rps(1.0); 3], boards.now).unwrap();
    boards.master.stop(NodeId::N8, boards.now);
    let mut sent = || kind(&boards.exchange().unwrap());
    assert_eq!([sent(), sent()], [(WRITE, 8), (WRITE, 1)]);
    let rest = [sent(), sent()];
    assert!(rest.contains(&(WRITE, 8)), "{rest:02x?}");
}

/// A control loop with a new speed for seven boards before each packet, and one moving board in
/// position mode: node 1, 100 counts further with each answer.
struct Busy {
    boards: Boards,
    commands: u16,
}

impl Busy {
    fn new(config: MasterConfig, answer_us: u32) -> Self {
        let mut modes = [Mode::Velocity; 8];
        modes[0] = Mode::Position;
        let mut boards = Boards::new(config, modes, answer_us);
        (boards.speeds, boards.moves) = ([1.0; 3], 100);
        let mut busy = Self { boards, commands: 0 };
        for _ in 0..300 {
            busy.exchange();
        }
        assert_eq!(busy.boards.master.mode(NodeId::N1), Some(Mode::Position));
        busy
    }

    fn exchange(&mut self) -> Vec<u8> {
        let commands = &mut self.commands;
        let packet = self.boards.exchange_during(|boards| {
            *commands += 1;
            for node in &NodeId::ALL[1..] {
                let speeds = [rps(f32::from(*commands % 50)); 3];
                let _ = boards.master.set_velocity(*node, speeds, boards.now);
            }
        });
        packet.expect("something to do")
    }
}

#[test]
fn a_position_is_held_right_behind_its_read_however_many_set_points_wait() {
    for (config, answer_us) in [
        (direct(), 700),
        (MasterConfig::usb_adapter(), 5_000),
        (MasterConfig::usb_adapter(), 17_000),
    ] {
        for offset in 0..20 {
            let mut busy = Busy::new(config, answer_us);
            for _ in 0..offset {
                busy.exchange();
            }
            busy.boards.master.stop(NodeId::N1, busy.boards.now);
            let mut others = 0;
            let first = loop {
                match busy.exchange() {
                    packet if packet[1] == 1 => break packet,
                    _ => others += 1,
                }
            };
            assert_eq!(first[0], READ, "it is measured first");
            assert!(others <= 24, "{others} exchanges before the READ");
            let positions = [Position::from_counts(busy.boards.counts).unwrap(); 3];
            let hold = WriteRequest::position(NodeId::N1, positions).as_bytes().to_vec();
            assert_eq!(busy.exchange(), hold, "the answer is held, with no packet in between");
            let begin = busy.boards.now;
            while busy.boards.master.stop_progress(NodeId::N1) == StopProgress::Owed {
                busy.exchange();
            }
            assert!(busy.boards.now - begin < busy.boards.master.stop_bound());
        }
    }
}

#[test]
fn a_board_that_coasts_is_stopped_every_20_ms_and_a_round_however_many_set_points_wait() {
    let mut busy = Busy::new(direct(), 700);
    busy.boards.master.stop(NodeId::N1, busy.boards.now);
    let mut written_at = None;
    let begin = busy.boards.now;
    while busy.boards.now - begin < MS(1000) {
        if kind(&busy.exchange()) == (WRITE, 1) {
            let pause = written_at.map_or(Duration::ZERO, |at| busy.boards.now - at);
            // At most 24 exchanges of 700 us go first.
            assert!(pause <= US(20_000 + 25 * 700), "{pause:?}");
            written_at = Some(busy.boards.now);
        }
    }
    assert_eq!(busy.boards.master.stop_progress(NodeId::N1), StopProgress::Confirmed);
}

#[test]
fn a_dead_board_is_found_within_the_read_bound_however_busy_the_others_are() {
    for (config, answer_us) in [(direct(), 700), (MasterConfig::usb_adapter(), 17_000)] {
        let mut busy = Busy::new(config, answer_us);
        busy.boards.master.read(NodeId::N1, busy.boards.now).unwrap();
        let (begin, bound) = (busy.boards.now, busy.boards.master.read_bound());
        let failures = busy.boards.master.node_statistics(NodeId::N1).failures;
        busy.boards.dead = Some(NodeId::N1);
        while busy.boards.master.node_statistics(NodeId::N1).failures == failures {
            busy.exchange();
            assert!(busy.boards.now - begin <= bound, "not abnormal within {bound:?}");
        }
    }
}
