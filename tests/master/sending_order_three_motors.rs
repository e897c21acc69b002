//! The longest wait of each packet on a bus of boards with three motors, where each WRITE is an
//! exchange (I13).

use crate::{boards::Boards, rig::*};

fn set(boards: &mut Boards, node: NodeId, to: i16) {
    // Refused while its stop is owed.
    let _ = match boards.mode(node) {
        Mode::Velocity => boards.master.set_velocity(node, [rps(f32::from(to)); 3], boards.now),
        Mode::Position => boards.master.set_position(node, [turns(to); 3], boards.now),
    };
}

/// All but node 8 get a new set-point before each packet, and are stopped often, rarely or never.
/// The most exchanges before something of node 8 that `begin` starts, not counting its own.
fn longest_wait(
    modes: [Mode; 8],
    begin: impl Fn(&mut Boards),
    is_done: impl Fn(&[u8]) -> bool,
) -> usize {
    let mut longest = 0;
    let starts = (0..5).flat_map(|offset| [1, 2, 3, 4, 5, 7, 1000].map(|period| (offset, period)));
    let starts = starts.flat_map(|start| [(start, direct()), (start, manual())]);
    for ((offset, period), config) in starts {
        let mut boards = Boards::new(config, modes, 900);
        let mut waited = None;
        for turn in 0..1000 {
            for &node in &NodeId::ALL[..7] {
                set(&mut boards, node, 1);
                if turn % period == 0 && boards.master.stop_progress(node) != StopProgress::Owed {
                    boards.master.stop(node, boards.now);
                }
            }
            if turn == 100 + offset {
                begin(&mut boards);
                waited = Some(0);
            }
            let packet = boards.exchange().expect("something to do");
            if waited.is_some() && is_done(&packet) {
                break;
            }
            if packet[1] != 8 {
                waited = waited.map(|count| count + 1);
            }
            assert!(turn < 999, "it waits forever");
        }
        longest = longest.max(waited.unwrap());
    }
    longest
}

/// Node 8 and its seven neighbours, in every mixture that treats some of them differently.
fn mixtures(last: Mode) -> [[Mode; 8]; 3] {
    let (velocity, position) = (Mode::Velocity, Mode::Position);
    [
        [position, position, position, position, position, position, position, last],
        [velocity, position, velocity, position, velocity, position, velocity, last],
        [velocity, velocity, velocity, velocity, velocity, velocity, velocity, last],
    ]
}

#[test]
fn a_velocity_stop_waits_for_at_most_seven_other_stops_and_the_hold_under_way() {
    for modes in mixtures(Mode::Velocity) {
        let begin = |boards: &mut Boards| boards.master.stop(NodeId::N8, boards.now);
        let waited = longest_wait(modes, begin, |packet| (packet[0], packet[1]) == (WRITE, 8));
        assert!(waited <= 8, "{waited} of {modes:?}");
    }
}

#[test]
fn a_node_that_was_stopped_and_turned_again_is_stopped_before_others_are_turned() {
    // By hand, a round may last forever.
    let mut boards = Boards::new(manual(), [Mode::Velocity; 8], 900);
    for node in NodeId::ALL {
        set(&mut boards, node, 1);
        boards.exchange();
    }
    let next = |boards: &mut Boards| {
        let packet = boards.exchange().expect("something to do");
        (packet[0], packet[1])
    };
    for speed in 2..5 {
        boards.master.stop(NodeId::N8, boards.now);
        assert_eq!(next(&mut boards), (WRITE, 8), "{speed}");
        while boards.master.stop_progress(NodeId::N8) == StopProgress::Owed {
            next(&mut boards);
        }
        // Its new set-point leaves, the others wait for theirs.
        set(&mut boards, NodeId::N8, speed);
        assert_eq!(next(&mut boards), (WRITE, 8));
        for &node in &NodeId::ALL[..7] {
            set(&mut boards, node, speed);
        }
    }
}

#[test]
fn a_position_stop_is_read_after_at_most_24_exchanges_and_written_next() {
    for modes in mixtures(Mode::Position) {
        let begin = |boards: &mut Boards| boards.master.stop(NodeId::N8, boards.now);
        let waited = longest_wait(modes, begin, |packet| (packet[0], packet[1]) == (READ, 8));
        assert!((1..=24).contains(&waited), "{waited} of {modes:?}");
        let written = longest_wait(modes, begin, |packet| (packet[0], packet[1]) == (WRITE, 8));
        assert_eq!(written, waited, "its READ is followed by its WRITE");
    }
}

#[test]
fn a_new_set_point_waits_for_at_most_24_exchanges() {
    for mode in [Mode::Velocity, Mode::Position] {
        for modes in mixtures(mode) {
            let begin = |boards: &mut Boards| set(boards, NodeId::N8, 4);
            let waited = longest_wait(modes, begin, |packet| (packet[0], packet[1]) == (WRITE, 8));
            assert!((1..=24).contains(&waited), "{waited} of {modes:?}");
        }
    }
}

#[test]
fn a_node_in_the_cycle_waits_for_at_most_8_rounds_of_25_exchanges() {
    for mode in [Mode::Velocity, Mode::Position] {
        for modes in mixtures(mode) {
            let begin = |boards: &mut Boards| boards.master.read(NodeId::N8, boards.now).unwrap();
            let waited = longest_wait(modes, begin, |packet| (packet[0], packet[1]) == (READ, 8));
            assert!((1..=8 * 25).contains(&waited), "{waited} of {modes:?}");
        }
    }
}
