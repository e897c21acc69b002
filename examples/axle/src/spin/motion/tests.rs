//! Turning on a line within the process.

use std::sync::{Arc, Mutex};

use axlewire::ikeya::{Mode, Position, Rps, Status, board::OneMotor, master::MasterConfig};
use serde_json::Value;

use super::{super::goal::Goal, *};
use crate::{
    args::PortArgs,
    bus, clock,
    line::Line,
    played::{self, BusState, Node, Played, Said},
    signals::DEAD_MAN,
};

const TURNS: i32 = 8192;

fn on(line: &Line) -> Bus<OneMotor> {
    let mut config = bus::complete(MasterConfig::usb_adapter(), &PortArgs::new(None), line);
    config.nodes = NodeId::N1.into();
    let mut bus = Bus::new(line.clone(), config);
    assert!(bus.discover(&Signals::none()).unwrap());
    bus
}

/// What is ready to turn, and its lines.
fn ready(line: &Played<BusState>) -> (Spin<OneMotor>, Arc<Mutex<Vec<String>>>) {
    let mut bus = on(&line.line);
    let (teller, lines) = Teller::to_memory();
    let start = bus.now();
    let (node, form, page, left) = (NodeId::N1, Form::Json, Page::default(), Ok(()));
    (Spin { bus, node, start, form, teller, page, left }, lines)
}

fn speed(rps: f32) -> Target<OneMotor> {
    Target::Velocity(Rps::new(rps).unwrap())
}

fn records(lines: &Mutex<Vec<String>>) -> Vec<Value> {
    lines.lock().unwrap().iter().map(|line| serde_json::from_str(line).unwrap()).collect()
}

#[test]
fn a_way_is_added_to_where_the_motor_is() {
    let line = played::bus(&[Node::position(1, 3 * TURNS)], |_, _| {});
    let bus = on(&line.line);
    let way = |turns: i32| Position::from_counts(turns * TURNS).unwrap();
    let target = |turns, status| Goal::Way(vec![way(turns)]).target(NodeId::N1, &bus, status);
    let at = |turns| Some(Status::<OneMotor>::Position(way(turns)));
    assert_eq!(target(2, at(3)).unwrap(), Target::Position(way(5)));
    assert_eq!(target(-4, at(3)).unwrap(), Target::Position(way(-1)));
    let error = target(20_000, at(20_000)).unwrap_err().to_string();
    assert!(error.ends_with("20000.0000 turns more exceed the range of a position"), "{error}");
    assert!(target(1, Some(Status::Velocity(0.0))).is_err() && target(1, None).is_err());
}

#[test]
fn a_motor_turns_for_its_time_and_is_told_every_quarter_of_a_second() {
    let line = played::bus(&[Node::velocity(1)], |_, _| {});
    let (mut spin, lines) = ready(&line);
    // The times are those since the command, not since the line was opened.
    clock::sleep(std::time::Duration::from_millis(300));
    spin.start = spin.bus.now();
    spin.run(speed(2.0), 620_000, &Signals::none()).unwrap();
    let at = |rps: f32| {
        let is_it = |said: &Said| matches!(said, Said::Write(1, it, _) if *it == rps);
        line.state.borrow().said.iter().find(|(said, _)| is_it(said)).unwrap().1
    };
    let turned = (at(0.0) - at(2.0)).as_secs_f64();
    assert!((0.58..0.9).contains(&turned), "{turned} s");
    let told = records(&lines);
    let names: Vec<_> = told.iter().map(|line| line["event"].as_str().unwrap()).collect();
    assert_eq!(names, ["measured", "measured", "stopped", "outcome"]);
    let seconds = |at: usize| told[at]["seconds"].as_f64().unwrap();
    assert!((0.25..0.45).contains(&seconds(0)) && (0.5..0.7).contains(&seconds(1)), "{told:?}");
    assert!((0.62..2.0).contains(&seconds(2)), "{told:?}");
    assert_eq!((&told[0]["rps"], &told[2]["rps"]), (&2.0.into(), &0.0.into()));
    assert_eq!(told[3], serde_json::json!({"event": "outcome", "at_rest": true}));
}

#[test]
fn a_signal_stops_the_motor_at_once_and_is_no_failure() {
    let line = played::bus(&[Node::velocity(1)], |_, _| {});
    let (mut spin, _) = ready(&line);
    let signals = Signals::none();
    signals.raise();
    spin.start = spin.bus.now();
    spin.run(speed(2.0), 600_000_000, &signals).unwrap();
    assert!(line.speeds().iter().all(|rps| *rps == 0.0), "{:?}", line.speeds());
}

#[test]
fn an_output_that_fails_is_told_behind_the_stop() {
    let line = played::bus(&[Node::velocity(1)], |_, _| {});
    let (mut spin, _) = ready(&line);
    spin.teller = Teller::that_fails();
    let error = spin.run(speed(2.0), 200_000, &Signals::none()).unwrap_err().to_string();
    assert!(error.starts_with("cannot write the output: "), "{error}");
    assert_eq!(line.state.borrow().nodes[0].rps, 0.0);
}

#[cfg(feature = "dashboard")]
#[test]
fn a_page_that_gave_up_is_told_behind_the_stop() {
    let line = played::bus(&[Node::velocity(1)], |_, _| {});
    let (mut spin, _) = ready(&line);
    spin.page = Page::that_gave_up();
    let error = spin.run(speed(2.0), 200_000, &Signals::none()).unwrap_err().to_string();
    assert_eq!(error, "the tool has a bug: its page gave up");
    assert_eq!(line.state.borrow().nodes[0].rps, 0.0);
}

#[test]
fn an_absence_ends_the_spin_and_nothing_is_commanded_after_it() {
    let mut absences = 0;
    let line = played::bus(&[Node::velocity(1)], move |_, bus| {
        if bus.nodes[0].rps == 2.0 && absences == 0 {
            absences += 1;
            clock::sleep(std::time::Duration::from_millis(600));
            bus.said.clear();
        }
    });
    let (spin, _) = ready(&line);
    let error = spin.run(speed(2.0), 10_000_000, &Signals::none()).unwrap_err().to_string();
    assert!(error.starts_with("the tool did not run for 0."), "{error}");
    assert!(line.speeds().iter().all(|rps| *rps == 0.0), "{:?}", line.speeds());
}

#[test]
fn a_single_lost_answer_ends_no_spin() {
    let line = played::bus(&[Node::velocity(1)], |_, bus| {
        let reads = bus.said.iter().filter(|(said, _)| *said == Said::Read(1)).count();
        bus.nodes[0].is_dumb = reads == 5 || reads == 9;
    });
    let (spin, _) = ready(&line);
    spin.run(speed(2.0), 400_000, &Signals::none()).unwrap();
}

#[test]
fn a_node_that_does_not_follow_is_told_with_what_it_does() {
    let line = played::bus(&[Node::velocity(1)], |_, _| {});
    let refusal = |change: &dyn Fn(&mut Spin<OneMotor>)| {
        let (mut spin, _) = ready(&line);
        spin.bus.command(spin.node, speed(2.0), spin.start).unwrap();
        spin.bus.check_follows(spin.node, speed(2.0)).unwrap();
        change(&mut spin);
        let refusal = spin.bus.check_follows(spin.node, speed(2.0)).unwrap_err().to_string();
        spin.stop().unwrap();
        refusal
    };
    assert_eq!(refusal(&|spin| spin.bus.has_dead_man_fired = true), DEAD_MAN);
    let stopped = refusal(&|spin| {
        let now = spin.bus.now();
        spin.bus.master_mut().stop(NodeId::N1, now);
    });
    assert_eq!(stopped, "node 1 has lost its command");
}

#[test]
fn a_mode_in_doubt_is_told_with_the_mode_of_the_answer() {
    let line = played::bus(&[Node::velocity(1)], |said, bus| {
        let node = &mut bus.nodes[0];
        // One answer in the other mode, then none.
        if said == Said::Read(1) && node.rps == 2.0 {
            node.is_dumb = node.mode == Mode::Position;
            node.mode = Mode::Position;
        }
    });
    let (mut spin, _) = ready(&line);
    spin.bus.command(spin.node, speed(2.0), spin.start).unwrap();
    let end = spin.bus.now() + Duration::from_secs(2);
    while !spin.bus.master().is_mode_in_doubt(NodeId::N1) && spin.bus.now() < end {
        let soon = spin.bus.now() + Duration::from_millis(5);
        spin.bus.round(soon).unwrap();
    }
    let error = spin.bus.check_follows(spin.node, speed(2.0)).unwrap_err().to_string();
    assert_eq!(error, "node 1 has answered in position mode");
}

#[test]
fn only_a_fresh_measurement_tells_that_the_target_is_reached() {
    let delay = std::time::Duration::from_millis(5);
    let line = played::bus(&[Node { rps: 2.0, delay, ..Node::velocity(1) }], |_, _| {});
    let (mut spin, _) = ready(&line);
    let stale = "node 1 has no current measurement at the end of the time";
    // From before the command.
    spin.start = spin.bus.now();
    assert_eq!(spin.check_reached(speed(2.0)).unwrap_err().to_string(), stale);
    // From after it.
    spin.start = Instant::from_micros(0);
    spin.check_reached(speed(2.0)).unwrap();
    let error = spin.check_reached(speed(3.0)).unwrap_err().to_string();
    assert_eq!(error, "node 1 was at 2.00 rps when the time was up, target 3.00 rps");
    clock::sleep(std::time::Duration::from_millis(260));
    assert_eq!(spin.check_reached(speed(2.0)).unwrap_err().to_string(), stale);
}
