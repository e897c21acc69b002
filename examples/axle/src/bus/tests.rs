//! A bus on a line within the process.

use std::{cell::RefCell, rc::Rc};

use axlewire::ikeya::Rps;

use super::*;
use crate::{
    args::PortArgs,
    clock,
    played::{self, BusState, Node, Played, Said, confirmable_stops},
};

const POSITION: i32 = 8192 * 3;

fn on(line: &Line, nodes: NodeSet) -> Bus {
    let mut config = complete(MasterConfig::usb_adapter(), &PortArgs::new(None), line);
    config.nodes = nodes;
    Bus::new(line.clone(), config)
}

fn both() -> NodeSet {
    [NodeId::N1, NodeId::N2].into_iter().collect()
}

/// Node 1 turns, node 2 is at a position.
fn turning(on_request: impl FnMut(Said, &mut BusState) + 'static) -> Played<BusState> {
    let nodes = [Node { rps: 2.0, ..Node::velocity(1) }, Node::position(2, POSITION)];
    played::bus(&nodes, on_request)
}

#[test]
fn the_options_of_a_master_are_its_settings() {
    let config = |patience| MasterArgs::new(PortArgs::new(None), patience).config();
    assert_eq!(config(None), MasterConfig::usb_adapter());
    assert_eq!(config(Some(Patience::Direct)), MasterConfig::direct());
    let mut args = MasterArgs::new(PortArgs::new(None), None);
    (args.gap, args.coast) = (Some(Duration::from_millis(2)), Some(Duration::from_secs(9)));
    let config = args.config();
    assert_eq!((config.turnaround_gap, config.coast), (args.gap.unwrap(), args.coast.unwrap()));
}

#[test]
fn the_settings_are_completed_by_the_line() {
    let line = turning(|_, _| {}).line;
    let plain = MasterConfig::usb_adapter();
    for (baud, expected) in [(None, 500_000), (Some(9600), 9600)] {
        let config = complete(plain, &PortArgs::new(baud), &line);
        assert_eq!((config.baud, config.accepts_early), (expected, true));
        assert_eq!(config.polling, Polling::Every(Duration::from_millis(20)));
        assert_eq!(config.dead_man, Some(Duration::from_millis(500)));
        assert_eq!(config.reply_timeout, plain.reply_timeout);
    }
}

#[test]
fn only_a_line_that_takes_no_time_may_answer_early() {
    for is_instant in [true, false] {
        let line = played::silence(is_instant);
        let config = complete(MasterConfig::usb_adapter(), &PortArgs::new(None), &line);
        assert_eq!(config.accepts_early, is_instant);
    }
}

#[test]
fn a_stop_that_is_owed_is_told_with_what_was_heard() {
    let cases = [
        (true, true, Some(Cause::Damaged), ""),
        (false, false, Some(Cause::Damaged), " (damaged bytes received)"),
        (false, false, Some(Cause::Unexpected), " (other answers received)"),
        (false, false, Some(Cause::Silent), " (nothing received)"),
        (false, true, Some(Cause::Silent), " (its answers come too late)"),
        (false, false, None, " (nothing received)"),
    ];
    for (is_online, is_late, failure, expected) in cases {
        assert_eq!(heard(is_online, is_late, failure), expected);
    }
}

#[test]
fn a_read_gives_what_was_measured_after_it_and_nothing_older() {
    let signals = Signals::none();
    let reads = Rc::new(RefCell::new(0));
    let count = Rc::clone(&reads);
    let line = turning(move |said, bus| {
        if said == Said::Read(1) {
            *count.borrow_mut() += 1;
            bus.nodes[0].rps += 1.0;
        }
    });
    let mut bus = on(&line.line, both());
    assert!(bus.discover(&signals).unwrap());
    for _ in 0..3 {
        let before = *reads.borrow();
        let status = bus.read(NodeId::N1, &signals).unwrap();
        let Some(Status::Velocity(rps)) = status else { panic!("{status:?}") };
        assert!(rps > 2.0 + before as f32, "{rps} after {before}");
    }
    line.state.borrow_mut().nodes[0].is_dumb = true;
    assert_eq!(bus.read(NodeId::N1, &signals).unwrap(), None);
    signals.raise();
    assert_eq!(bus.read(NodeId::N2, &signals).unwrap(), None);
    let asked = line.said().len();
    assert!(!bus.discover(&signals).unwrap());
    assert_eq!(line.said().len(), asked, "at once");
}

#[test]
fn an_answer_in_another_mode_that_is_not_certain_is_no_status() {
    let signals = Signals::none();
    let line = turning(|said, bus| {
        let node = &mut bus.nodes[0];
        // One answer in the other mode, then none.
        if said == Said::Read(1) && node.rps == 5.0 {
            node.is_dumb = node.mode == Mode::Position;
            node.mode = Mode::Position;
        }
    });
    let mut bus = on(&line.line, both());
    assert!(bus.discover(&signals).unwrap());
    line.state.borrow_mut().nodes[0].rps = 5.0;
    assert_eq!(bus.read(NodeId::N1, &signals).unwrap(), None);
    assert!(bus.master().is_mode_in_doubt(NodeId::N1));
}

#[test]
fn a_status_does_not_count_if_another_answer_has_put_the_mode_in_doubt() {
    // Another node has the same id. Once the first one turns, both answer one READ, then none
    // does, and then only the first.
    let other = Node { is_dumb: true, ..Node::position(1, POSITION) };
    let mut reads = 0;
    let line = played::bus(&[Node::velocity(1), other], move |_, bus| {
        reads += u32::from(bus.nodes[0].rps == 2.0);
        (bus.nodes[0].is_dumb, bus.nodes[1].is_dumb) = (reads == 2, reads != 1);
    });
    let mut bus = on(&line.line, NodeId::N1.into());
    assert!(bus.discover(&Signals::none()).unwrap());
    let before = line.said().len();
    line.state.borrow_mut().nodes[0].rps = 2.0;
    let status = bus.read(NodeId::N1, &Signals::none()).unwrap();
    assert_eq!(status, Some(Status::Velocity(2.0)));
    assert!(!bus.master().is_mode_in_doubt(NodeId::N1));
    assert!(line.said().len() >= before + 3, "it was asked again");
}

#[test]
fn all_nodes_are_stopped_each_in_its_mode_and_confirm_it_twice() {
    let line = turning(|_, _| {});
    let mut bus = on(&line.line, NodeSet::ALL);
    bus.stop(both()).unwrap();
    assert_eq!(both().iter().map(|node| bus.halt(node)).collect::<Vec<_>>(), [Halt::Still; 2]);
    assert_eq!((bus.complaint(NodeId::N1), bus.complaint(NodeId::N2)), (None, None));
    let said = line.said();
    for said in said.iter().filter(|said| matches!(said, Said::Write(..))) {
        assert!(matches!(said, Said::Write(1, 0.0, _) | Said::Write(2, _, POSITION)), "{said:?}");
    }
    assert!(confirmable_stops(&said, 1) >= 2, "{said:?}");
    let holds = said.iter().filter(|said| matches!(said, Said::Write(2, ..))).count();
    assert!(holds >= 2, "{said:?}");
}

#[test]
fn an_id_counts_as_silent_only_after_as_many_requests_as_the_master_attempts() {
    let line = turning(|_, bus| bus.nodes[0].is_dumb = true);
    let mut config = complete(MasterConfig::usb_adapter(), &PortArgs::new(None), &line.line);
    config.nodes = NodeId::N1.into();
    // The second one is open after the second that an unanswered id is allowed.
    (config.attempts, config.reply_timeout) = (3, Duration::from_millis(600));
    let mut bus = Bus::<OneMotor>::new(line.line.clone(), config);
    let begin = clock::now();
    bus.stop(NodeId::N1.into()).unwrap();
    let asked = line.said().iter().filter(|said| **said == Said::Read(1)).count();
    assert!(asked >= 3, "{asked} in {:?}", clock::since(begin));
    assert_eq!(bus.halt(NodeId::N1), Halt::Silent);
}

#[test]
fn an_id_whose_answers_all_come_too_late_is_not_silent() {
    let answer = axlewire::ikeya::VelocityResponse::new(NodeId::N1, Rps::new(5.0).unwrap());
    let line = played::played(Vec::new(), move |answers: &mut Vec<std::time::Instant>, said| {
        if said.first() == Some(&0xAA) && said.get(1) == Some(&1) {
            answers.push(clock::now() + Span::from_millis(30));
        }
        let (due, later) = answers.iter().partition(|at| **at <= clock::now());
        *answers = later;
        answer.as_bytes().repeat(Vec::len(&due))
    });
    let mut bus = on(&line.line, NodeId::N1.into());
    bus.stop(NodeId::N1.into()).unwrap();
    assert_eq!(bus.halt(NodeId::N1), Halt::Untimely);
    let says = "id 1 gives only answers that are too late: its motor may be moving; use a longer \
                --reply-timeout";
    assert_eq!(bus.complaint(NodeId::N1).unwrap(), says);
    // With more time, they are answers: of a motor that does not stop.
    assert!(bus.could_wait_longer());
    bus.begin_patiently(bus.may_be_there(), 2);
    assert!(!bus.could_wait_longer());
    bus.stop(NodeId::N1.into()).unwrap();
    assert_eq!(bus.halt(NodeId::N1), Halt::Moving);
    assert_eq!(bus.needed_patience(), Some(Patience::Network));
}

#[test]
fn a_stop_that_is_not_confirmed_is_waited_for_two_seconds_and_on_a_slow_line_longer() {
    for (baud, is_slow) in [(500_000, false), (9600, true)] {
        let line = turning(|said, bus| bus.nodes[0].is_dumb |= matches!(said, Said::Write(..)));
        let args = MasterArgs::new(PortArgs::new(Some(baud)), Some(Patience::Direct));
        let mut bus: Bus =
            Bus::new(line.line.clone(), complete(args.config(), args.line(), &line.line));
        let (begin, bound) = (clock::now(), span(bus.master().stop_bound()));
        bus.stop(NodeId::N1.into()).unwrap();
        assert_eq!((bus.halt(NodeId::N1), bound > STOP_PATIENCE), (Halt::Owed, is_slow));
        let (took, least) = (clock::since(begin), bound.max(STOP_PATIENCE));
        assert!(took >= least && took < least + bound + Span::from_millis(100), "{took:?}");
    }
}

#[test]
fn a_motor_that_turns_on_is_told_two_seconds_after_it_has_confirmed_its_stop() {
    let line = turning(|_, bus| bus.nodes[0].follows = false);
    let (mut bus, begin) = (on(&line.line, both()), clock::now());
    bus.stop(both()).unwrap();
    assert_eq!(
        both().iter().map(|node| bus.halt(node)).collect::<Vec<_>>(),
        [Halt::Moving, Halt::Still]
    );
    let says = "node 1 confirmed the stop, but is still moving after 2 s: 2.00 rps";
    assert_eq!(bus.complaint(NodeId::N1).unwrap(), says);
    let took = clock::since(begin).as_millis();
    assert!((2000..2300).contains(&took), "{took} ms");
}

#[test]
fn a_motor_at_rest_whose_node_was_lost_and_came_back_late_is_not_said_to_move() {
    let bus = on(&turning(|_, _| {}).line, NodeId::N1.into());
    let longest = bus.master().stop_bound() + bus.master().config().coast;
    let complaints = (0..200).step_by(4).map(|before_ms| {
        let out = span(longest) - Span::from_millis(before_ms);
        let mut lost = None;
        let line = turning(move |_, bus| {
            let stops = bus.said.iter().filter(|(said, _)| matches!(said, Said::Write(1, ..)));
            if lost.is_none() && stops.count() == 3 {
                lost = Some(clock::now());
            }
            bus.nodes[0].is_dumb = lost.is_some_and(|at| clock::since(at) < out);
        });
        let mut bus = on(&line.line, NodeId::N1.into());
        bus.discover(&Signals::none()).unwrap();
        bus.stop(NodeId::N1.into()).unwrap();
        bus.complaint(NodeId::N1)
    });
    let complaints: Vec<_> = complaints.flatten().collect();
    let unseen = "node 1 confirmed the stop, but was not seen to be still: it may be moving";
    assert!(complaints.iter().any(|it| it == unseen), "{complaints:?}");
    assert!(!complaints.iter().any(|it| it.contains("still moving")), "{complaints:?}");
}

#[test]
fn a_stop_during_which_the_tool_is_suspended_has_all_of_its_time_afterwards() {
    // Until a second after it, the node does not answer, or the motor turns on.
    for is_dumb in [true, false] {
        let mut resumed = None;
        let line = turning(move |said, bus| {
            let writes = bus.said.iter().filter(|(said, _)| matches!(said, Said::Write(..)));
            if resumed.is_none() && said == Said::Read(1) && writes.count() >= 3 {
                clock::sleep(Span::from_secs(60));
                resumed = Some(clock::now());
            }
            let is_over = resumed.is_some_and(|at| clock::since(at) > Span::from_secs(1));
            bus.nodes[0].is_dumb = is_dumb && resumed.is_some() && !is_over;
            bus.nodes[0].follows = is_over;
        });
        let mut bus = on(&line.line, NodeId::N1.into());
        bus.discover(&Signals::none()).unwrap();
        bus.stop(NodeId::N1.into()).unwrap();
        assert_eq!(bus.halt(NodeId::N1), Halt::Still, "{is_dumb}");
    }
}

#[test]
fn the_dead_man_of_the_master_is_noticed() {
    let line = turning(|_, _| {});
    let mut bus = on(&line.line, NodeId::N1.into());
    assert!(bus.discover(&Signals::none()).unwrap());
    let now = bus.now();
    bus.master_mut().set_velocity(NodeId::N1, Rps::new(1.0).unwrap(), now).unwrap();
    let end = bus.now() + Duration::from_millis(700);
    while bus.now() < end {
        bus.round(end).unwrap();
    }
    assert!(bus.has_dead_man_fired);
    assert_eq!(line.state.borrow().nodes[0].rps, 0.0);
}
