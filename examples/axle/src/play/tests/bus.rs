//! Frames for the nodes of a bus.

use std::{rc::Rc, time::Duration};

use axlewire::ikeya::Position;

use super::*;
use crate::played::{BusState, Node, Said};

const ONE: NodeId = NodeId::N1;
const THREE: NodeId = NodeId::N3;

fn way(node: NodeId, turns: i32) -> [u8; 8] {
    *WriteRequest::position(node, Position::from_counts(turns * 8192).unwrap()).as_bytes()
}

fn nodes() -> [Node; 2] {
    [Node::velocity(1), Node::position(3, 8192 * 50)]
}

fn is_speed(said: &Said, node: u8, rps: f32) -> bool {
    matches!(said, Said::Write(to, speed, _) if (*to, *speed) == (node, rps))
}

fn assert_nothing_written(line: &Played<BusState>) {
    assert!(line.speeds().is_empty(), "{:?}", line.said());
}

#[test]
fn every_command_of_every_node_is_checked_before_anything_is_sent() {
    let run = |more: &[u8], meant| {
        let line = played::bus(&nodes(), |_, _| {});
        let (fast, back, far) = (speed(ONE, 20.0), speed(ONE, -20.0), way(THREE, 150));
        let frames: [(u64, &[u8]); 4] = [(0, &fast), (1, &back), (2, &far), (3, more)];
        let result = Run { meant, ..BUS }.on(&line, &frames, &Signals::none());
        (line, result)
    };
    run(&speed(ONE, 1.0), None).1.unwrap();
    for (bad, meant, says) in [
        (speed(ONE, 20.5), None, "20.5 rps for node 1 is more than --max-rps 20"),
        (speed(ONE, -21.0), None, "-21.0 rps for node 1 is more than --max-rps 20"),
        (way(THREE, 151), None, "151.0000 turns for node 3, which is at 50.0000, is farther than"),
        (way(THREE, -51), None, "-51.0000 turns for node 3, which is at 50.0000, is farther than"),
        (
            speed(ONE, 1.0),
            Some(Mode::Velocity),
            "node 3 is in position mode, but a command is for velocity",
        ),
        (
            speed(NodeId::N2, 1.0),
            None,
            "node 2 does not answer: without its mode, nothing is sent to",
        ),
    ] {
        let (line, result) = run(&bad, meant);
        let error = result.unwrap_err();
        assert!(error.starts_with(says), "{error}");
        assert_nothing_written(&line);
    }
}

#[test]
fn a_signal_before_the_first_command_sends_none() {
    let line = played::bus(&nodes(), |_, _| {});
    let signals = Signals::none();
    signals.raise();
    let error = BUS.on(&line, &[(0, &speed(ONE, 1.0))], &signals).unwrap_err();
    assert_eq!(error, "interrupted before anything moved");
    assert_nothing_written(&line);
}

#[test]
fn each_command_leaves_in_its_order_and_each_node_is_stopped_in_its_mode() {
    let line = played::bus(&nodes(), |_, _| {});
    let (slow, fast, far) = (speed(ONE, 1.0), speed(ONE, 2.0), way(THREE, 60));
    let frames: [(u64, &[u8]); 4] = [(0, &slow), (0, &fast), (0, &far), (0, &slow)];
    BUS.on(&line, &frames, &Signals::none()).unwrap();
    let said = line.said();
    let mut speeds: Vec<_> = said
        .iter()
        .filter_map(|said| match said {
            Said::Write(1, rps, _) => Some(*rps),
            _ => None,
        })
        .collect();
    speeds.dedup();
    assert_eq!(speeds, [1.0, 2.0, 1.0, 0.0]);
    let holds = |said: &&Said| matches!(said, Said::Write(3, _, 491_520));
    assert!(said.iter().filter(holds).count() >= 3, "the command and two stops: {said:?}");
    let state = line.state.borrow();
    assert_eq!((state.nodes[0].rps, state.nodes[1].counts), (0.0, 491_520));
}

#[test]
fn behind_each_write_goes_a_read_of_the_same_node_if_that_was_asked_for() {
    for (reads_back, expected) in [(true, 3), (false, 0)] {
        let line = played::bus(&nodes(), |_, _| {});
        let (slow, fast) = (speed(ONE, 1.0), speed(ONE, 2.0));
        let frames: [(u64, &[u8]); 3] = [(0, &slow), (5, &fast), (10, &slow)];
        let run = Run { reads_back, linger_ms: 5, ..BUS };
        run.on(&line, &frames, &Signals::none()).unwrap();
        let said = line.said();
        let is_pair = |pair: &&[Said]| {
            pair[1] == Said::Read(1) && (is_speed(&pair[0], 1, 1.0) || is_speed(&pair[0], 1, 2.0))
        };
        assert_eq!(said.windows(2).filter(is_pair).count(), expected, "{said:?}");
    }
}

#[test]
fn a_question_about_a_node_that_does_not_answer_keeps_nobody_waiting() {
    let line = played::bus(&nodes(), |_, _| {});
    let (write, absent, present) = (speed(ONE, 1.0), read(NodeId::N5), read(THREE));
    let frames: [(u64, &[u8]); 4] = [(0, &absent), (0, &present), (1, &write), (2, &absent)];
    BUS.on(&line, &frames, &Signals::none()).unwrap();
    let said = line.said();
    let first = said.iter().position(|said| matches!(said, Said::Write(..))).unwrap();
    assert!(!said[first..].contains(&Said::Read(5)), "{said:?}");
    assert!(said[..first].ends_with(&[Said::Read(3)]), "{said:?}");
}

#[test]
fn a_silent_node_does_not_delay_the_stop_of_the_others() {
    for silent in [0, 1] {
        let line = played::bus(&[Node::velocity(1), Node::velocity(3)], move |said, bus| {
            bus.nodes[silent].is_dumb |= matches!(said, Said::Write(..));
        });
        let (one, three) = (speed(ONE, 1.0), speed(THREE, 2.0));
        let error = BUS.on(&line, &[(0, &one), (0, &three)], &Signals::none()).unwrap_err();
        assert!(error.contains("has not confirmed it"), "{error}");
        let said = &line.state.borrow().said;
        let at = |node, rps| said.iter().find(|(said, _)| is_speed(said, node, rps)).unwrap().1;
        for node in [1, 3] {
            let stopped_after = at(node, 0.0) - at(3, 2.0);
            assert!(stopped_after < Duration::from_millis(50), "{node}: {stopped_after:?}");
        }
    }
}

#[test]
fn nodes_behind_a_port_that_is_lost_and_comes_back_are_stopped() {
    let line = played::bus(&[Node { rps: 2.0, ..Node::velocity(1) }], |_, _| {});
    let (gone, back) = (Rc::clone(&line.is_gone), Rc::clone(&line.back_at));
    let line = Played {
        line: line.line.tapped(move |_, bytes| {
            if *bytes == speed(ONE, 1.0) && !gone.replace(true) {
                back.set(Some(clock::now() + Duration::from_millis(1500)));
            }
        }),
        ..line
    };
    let error = BUS.on(&line, &[(0, &speed(ONE, 1.0))], &Signals::none()).unwrap_err();
    let says = "port \"played\" failed: unplugged; what was commanded is stopped and at rest";
    assert_eq!(error, says);
    assert_eq!(line.state.borrow().nodes[0].rps, 0.0);
}

#[test]
fn what_was_due_during_an_absence_is_not_sent() {
    let line = played::bus(&[Node::velocity(1)], |said, bus| {
        let is_first = bus.said.iter().filter(|(said, _)| is_speed(said, 1, 1.0)).count() == 1;
        if is_speed(&said, 1, 1.0) && is_first {
            clock::sleep(Duration::from_millis(600));
        }
    });
    let (slow, fast) = (speed(ONE, 1.0), speed(ONE, 2.0));
    let error = BUS.on(&line, &[(0, &slow), (100, &fast)], &Signals::none()).unwrap_err();
    assert!(error.starts_with("the tool did not run for "), "{error}");
    assert!(!line.speeds().contains(&2.0));
}
