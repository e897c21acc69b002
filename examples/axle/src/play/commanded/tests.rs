//! Commanded nodes on a line within the process.

use std::collections::VecDeque;

use axlewire::ikeya::{Mode, Position, Rps, WriteRequest, board::OneMotor};

use super::{
    super::{Limits, Side, effect},
    *,
};
use crate::{
    args::{PortArgs, Protocol},
    bus::MasterArgs,
    clock,
    played::{self, BusState, Node, Played, Said},
};

const HELD: i32 = 8192 * 16_000;

fn speed(node: NodeId, rps: f32) -> (WriteRequest, Option<Mode>) {
    (WriteRequest::velocity(node, Rps::new(rps).unwrap()), Some(Mode::Velocity))
}

fn way(node: NodeId, turns: i32) -> (WriteRequest, Option<Mode>) {
    (WriteRequest::position(node, Position::from_counts(turns * 8192).unwrap()), None)
}

fn with_plan<T>(writes: &[(WriteRequest, Option<Mode>)], run: impl FnOnce(&Plan<'_>) -> T) -> T {
    let bus = MasterArgs::new(PortArgs::new(None), false, false);
    let due = |(write, meant): &(WriteRequest, Option<Mode>)| {
        let (_, effect) = effect::of(Protocol::Ikeya, write.as_bytes()).unwrap();
        Due { after_us: 0, bytes: write.as_bytes()[..].into(), meant: *meant, effect }
    };
    let frames: VecDeque<_> = writes.iter().map(due).collect();
    let limits = Limits { max_rps: Rps::new(20.0).unwrap(), max_turns: 100.0 };
    let (protocol, side) = (Protocol::Ikeya, Side::Commander);
    run(&Plan { bus: &bus, protocol, side, frames, linger_us: 0, limits, is_json: false })
}

fn prepare(
    line: &Played<BusState>,
    writes: &[(WriteRequest, Option<Mode>)],
    signals: &Signals,
) -> Result<Option<Commanded<OneMotor>>, Failure> {
    with_plan(writes, |plan| Commanded::prepare(plan, &line.line, signals))
}

fn nodes() -> [Node; 2] {
    [Node::velocity(1), Node::position(2, 8192 * 50)]
}

fn assert_nothing_written(line: &Played<BusState>) {
    assert!(line.speeds().is_empty(), "{:?}", line.said());
}

#[test]
fn every_command_of_every_node_is_checked_before_anything_is_sent() {
    let good = [speed(NodeId::N1, 20.0), speed(NodeId::N1, -20.0), way(NodeId::N2, 150)];
    let line = played::bus(&nodes(), |_, _| {});
    let ready = prepare(&line, &good, &Signals::none()).unwrap().unwrap();
    assert_eq!(ready.modes.of(NodeId::N1), Some(Mode::Velocity));
    assert_eq!(ready.modes.of(NodeId::N2), Some(Mode::Position));
    for (bad, says) in [
        (speed(NodeId::N1, 20.5), "20.5 rps for node 1 is more than --max-rps 20"),
        (speed(NodeId::N1, -21.0), "-21.0 rps for node 1 is more than --max-rps 20"),
        (way(NodeId::N2, 151), "151.0000 turns for node 2, which is at 50.0000, is farther than"),
        (way(NodeId::N2, -51), "-51.0000 turns for node 2, which is at 50.0000, is farther than"),
        (speed(NodeId::N2, 1.0), "node 2 is in position mode, but a command is for velocity"),
        (speed(NodeId::N3, 1.0), "node 3 does not answer: without its mode, nothing is sent to"),
    ] {
        let writes: Vec<_> = good.iter().copied().chain([bad]).collect();
        let Err(error) = prepare(&line, &writes, &Signals::none()) else { panic!("{says}") };
        assert!(error.to_string().starts_with(says), "{error}");
    }
    assert_nothing_written(&line);
}

#[test]
fn a_signal_before_the_first_command_sends_none() {
    let line = played::bus(&nodes(), |_, _| {});
    let signals = Signals::none();
    signals.raise();
    assert!(prepare(&line, &[speed(NodeId::N1, 1.0)], &signals).unwrap().is_none());
    assert_nothing_written(&line);
}

#[test]
fn each_node_is_stopped_in_its_mode_and_told_at_rest() {
    let line = played::bus(&nodes(), |_, _| {});
    let writes = [speed(NodeId::N1, 1.0), way(NodeId::N2, 60)];
    let ready = prepare(&line, &writes, &Signals::none()).unwrap().unwrap();
    line.state.borrow_mut().nodes[0].rps = 1.0;
    let seen = ready.modes;
    let told = ready.stop(seen).unwrap();
    assert_eq!(told, [(NodeId::N1, "0.00 rps".into()), (NodeId::N2, "50.0000 turns".into())]);
    let said = line.said();
    let is_stop = |said: &Said| matches!(said, Said::Write(1, 0.0, _) | Said::Write(2, _, 409_600));
    let writes: Vec<_> = said.iter().filter(|said| matches!(said, Said::Write(..))).collect();
    assert!(writes.len() >= 4 && writes.iter().all(|said| is_stop(said)), "{writes:?}");
}

#[test]
fn without_commands_nothing_is_asked_and_nothing_is_stopped() {
    let line = played::bus(&nodes(), |_, _| {});
    let ready = prepare(&line, &[], &Signals::none()).unwrap().unwrap();
    assert_eq!(ready.stop(Modes::default()).unwrap(), []);
    assert!(line.said().is_empty());
}

#[test]
fn a_node_that_has_turned_unheard_is_held_in_its_new_mode_and_the_others_are_stopped_too() {
    let turned_at = std::rc::Rc::new(std::cell::Cell::new(None::<std::time::Instant>));
    let when = std::rc::Rc::clone(&turned_at);
    let all = [Node::velocity(1), Node { rps: 3.0, ..Node::velocity(3) }];
    let line = played::bus(&all, move |_, bus| {
        // Longer than the tool waits for fresh answers.
        let is_silent = |at: std::time::Instant| clock::since(at).as_millis() < 400;
        bus.nodes[0].is_dumb = when.get().is_some_and(is_silent);
    });
    let writes = [speed(NodeId::N1, 1.0), speed(NodeId::N3, 1.0)];
    let ready = prepare(&line, &writes, &Signals::none()).unwrap().unwrap();
    let mut seen = ready.modes;
    {
        let node = &mut line.state.borrow_mut().nodes[0];
        (node.mode, node.counts, node.follows) = (Mode::Position, HELD, false);
        turned_at.set(Some(clock::now()));
        // The line has heard it, but its master has not.
        seen.learn(NodeId::N1, Mode::Position);
    }
    let error = ready.stop(seen).unwrap_err().to_string();
    let says = "node 1 has changed to position mode: it may have taken commands for velocity mode";
    assert_eq!(error, says);
    let said = line.said();
    let of_turned: Vec<_> = said.iter().filter(|said| matches!(said, Said::Write(1, ..))).collect();
    let is_hold = |said: &&Said| matches!(said, Said::Write(1, _, HELD));
    assert!(of_turned.len() >= 2 && of_turned.iter().copied().all(|it| is_hold(&it)), "{said:?}");
    assert_eq!(line.state.borrow().nodes[1].rps, 0.0);
}

#[test]
fn nodes_that_have_turned_and_fall_silent_may_be_moving_each_of_them() {
    let all = [Node::velocity(1), Node::velocity(3)];
    let line = played::bus(&all, |_, _| {});
    let writes = [speed(NodeId::N1, 1.0), speed(NodeId::N3, 1.0)];
    let ready = prepare(&line, &writes, &Signals::none()).unwrap().unwrap();
    let mut seen = ready.modes;
    for (node, id) in line.state.borrow_mut().nodes.iter_mut().zip([NodeId::N1, NodeId::N3]) {
        node.is_dumb = true;
        seen.learn(id, Mode::Position);
    }
    let error = ready.stop(seen).unwrap_err().to_string();
    let says = |node: u8| {
        format!("node {node} was commanded and does not answer any more: it may be moving")
    };
    assert_eq!(error, format!("{}; {}", says(1), says(3)));
    assert_nothing_written(&line);
}

#[test]
fn a_port_that_fails_for_one_master_is_told_although_the_other_master_stops_its_node() {
    let line = played::bus(&[Node::velocity(1), Node::velocity(3)], |_, _| {});
    let writes = [speed(NodeId::N1, 1.0), speed(NodeId::N3, 1.0)];
    let ready = prepare(&line, &writes, &Signals::none()).unwrap().unwrap();
    let mut seen = ready.modes;
    // The other master has to hear this one first.
    seen.learn(NodeId::N3, Mode::Position);
    line.state.borrow_mut().nodes[1].rps = 1.0;
    // A stop is waited for for 3 s; the next one has 3 s again.
    line.is_gone.set(true);
    line.back_at.set(Some(clock::now() + std::time::Duration::from_millis(3500)));
    let error = ready.stop(seen).unwrap_err().to_string();
    let says = "port \"played\" failed: unplugged; node 1 was told to stop and has not \
                confirmed it: it may be moving";
    assert_eq!(error, says);
    assert_eq!(line.state.borrow().nodes[1].rps, 0.0);
}

#[test]
fn a_node_that_has_turned_without_a_word_gets_no_stop_of_its_old_mode() {
    let line = played::bus(&[Node::velocity(1)], |_, _| {});
    let ready = prepare(&line, &[speed(NodeId::N1, 1.0)], &Signals::none()).unwrap().unwrap();
    {
        let node = &mut line.state.borrow_mut().nodes[0];
        (node.mode, node.counts, node.follows) = (Mode::Position, HELD, false);
    }
    let seen = ready.modes;
    let error = ready.stop(seen).unwrap_err().to_string();
    assert!(error.starts_with("node 1 has changed to position mode"), "{error}");
    let said = line.said();
    let writes: Vec<_> = said.iter().filter(|said| matches!(said, Said::Write(..))).collect();
    let is_hold = |said: &&Said| matches!(said, Said::Write(1, _, HELD));
    assert!(writes.len() >= 2 && writes.iter().copied().all(|said| is_hold(&said)), "{said:?}");
}
