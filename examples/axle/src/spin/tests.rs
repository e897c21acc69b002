//! From the goal to the target, on a line within the process.

use std::rc::Rc;

use axlewire::ikeya::{Mode, Position, master::MasterConfig};

use super::*;
use crate::{
    args::PortArgs,
    played::{self, BusState, Node, Played, Said},
};

fn goal(turns: i32) -> Goal<OneMotor> {
    Goal::Way(vec![Position::from_counts(turns * 8192).unwrap()])
}

fn aimed(
    line: &Played<BusState>,
    goal: &Goal<OneMotor>,
    tell: impl FnOnce(Target<OneMotor>) -> Result<(), Failure>,
    signals: &Signals,
) -> Result<Option<Target<OneMotor>>, Failure> {
    let mut config = bus::complete(MasterConfig::usb_adapter(), &PortArgs::new(None), &line.line);
    config.nodes = NodeId::N1.into();
    let aimed = aim(&mut Bus::new(line.line.clone(), config), NodeId::N1, goal, tell, signals);
    assert!(line.speeds().is_empty(), "nothing moves yet: {:?}", line.said());
    aimed
}

/// What happens at the second question to node 1.
fn at_the_second(mut react: impl FnMut(&mut Node) + 'static) -> impl FnMut(Said, &mut BusState) {
    move |said, bus| {
        let asked = bus.said.iter().filter(|(said, _)| *said == Said::Read(1)).count();
        if said == Said::Read(1) && asked >= 2 {
            react(&mut bus.nodes[0]);
        }
    }
}

#[test]
fn the_way_begins_where_the_motor_is_when_it_is_read_again() {
    let moved = at_the_second(|node| node.counts = 8192 * 5);
    let line = played::bus(&[Node::position(1, 8192)], moved);
    let (turns, mut told) = (|it: i32| Target::Position(Position::new(0, it as i16)), None);
    let tell = |found| {
        told = Some(found);
        Ok(())
    };
    let target = aimed(&line, &goal(2), tell, &Signals::none()).unwrap();
    assert_eq!((told, target), (Some(turns(3)), Some(turns(7))));
}

#[test]
fn a_signal_in_front_of_the_command_moves_nothing() {
    let signals = Rc::new(Signals::none());
    let raised = Rc::clone(&signals);
    let line = played::bus(&[Node::velocity(1)], at_the_second(move |_| raised.raise()));
    let goal = Goal::Speed(Rps::new(2.0).unwrap());
    assert_eq!(aimed(&line, &goal, |_| Ok(()), &signals).unwrap(), None);
    let told = |_| panic!("it is not even looked for");
    assert_eq!(aimed(&line, &goal, told, &signals).unwrap(), None);
}

#[test]
fn a_mode_in_doubt_or_another_one_moves_nothing() {
    let goal = Goal::Speed(Rps::new(2.0).unwrap());
    for (falls_silent, says) in [
        (true, "the mode of node 1 is in doubt"),
        (false, "node 1 is in position mode: use --revolutions"),
    ] {
        let turns = at_the_second(move |node| {
            node.is_dumb = falls_silent && node.mode == Mode::Position;
            node.mode = Mode::Position;
        });
        let line = played::bus(&[Node::velocity(1)], turns);
        let error = aimed(&line, &goal, |_| Ok(()), &Signals::none()).unwrap_err();
        assert_eq!(error.to_string(), says);
    }
}

#[test]
fn an_output_that_is_closed_moves_nothing() {
    let line = played::bus(&[Node::velocity(1)], |_, _| {});
    let goal = Goal::Speed(Rps::new(2.0).unwrap());
    let closed = |_| Err(Failure::Failed("closed".to_owned()));
    let error = aimed(&line, &goal, closed, &Signals::none()).unwrap_err();
    assert_eq!(error.to_string(), "closed");
}
