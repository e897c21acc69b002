//! Models of the player, in virtual time: each fault, at every byte of the traffic, through a port
//! that takes whole frames and one that takes single bytes, with answers in between.

use std::{
    cell::{Cell, RefCell},
    collections::{BTreeMap, VecDeque},
    rc::Rc,
    time::{Duration, Instant},
};

use axlewire::{
    ikeya::{Decoder, Position, Response, ToMaster},
    stream::Event,
    ucp::{Body, MotorControl, message::ErrorCode, message::Pong},
};

use super::*;
use crate::{
    pcapng::Direction,
    played::{BusEar, BusState, Node, PlayedRover, RoverState, Said},
};

/// What happens from some byte on.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Fault {
    /// The mode switch of a node is moved.
    Mode,
    /// The same, and all answers are late from then on.
    ModeAndLate,
    /// The same, and the node answers only once more.
    ModeAndMute,
    /// It obeys, and says nothing.
    Mute,
    /// It no longer obeys. A node says nothing either; a robot reports what it does.
    Deaf,
    /// A robot answers pings, and does not report.
    NoReports,
    /// Ctrl-C.
    Signal,
}

/// A run with a fault behind this byte of both directions, and whether the port takes single bytes.
#[derive(Clone, Copy, Debug)]
struct Case {
    fault: Fault,
    at: usize,
    in_bytes: bool,
}

impl Case {
    /// Plays; returns the result, whether it tells that everything is at rest, and the number of
    /// bytes that have passed.
    fn play<T: 'static>(
        self,
        line: &Played<T>,
        run: &Run,
        frames: &Frames<'_>,
        fault: impl FnOnce() + 'static,
        mut on_read: impl FnMut(&[u8]) + 'static,
    ) -> (Result<(), String>, bool, usize) {
        line.most.set(if self.in_bytes { 1 } else { usize::MAX });
        let (passed, signals) = (Rc::new(Cell::new(0)), Rc::new(Signals::none()));
        let (count, ctrl_c, mut fault) = (passed.clone(), signals.clone(), Some(fault));
        let tapped = line.line.clone().tapped(move |direction, bytes| {
            match direction {
                // Otherwise no time would pass on a busy line.
                Direction::Out => clock::sleep(Duration::from_micros(20 * bytes.len() as u64)),
                Direction::In => on_read(bytes),
            }
            count.set(count.get() + bytes.len());
            if count.get() > self.at {
                match self.fault {
                    Fault::Signal => ctrl_c.raise(),
                    _ => fault.take().into_iter().for_each(|happen| happen()),
                }
            }
        });
        let played = run.on_line(&tapped, frames, &signals);
        assert!(self.at < usize::MAX || played.is_ok(), "{played:?}");
        let is_at_rest = played.as_ref().err().is_none_or(|failure| failure.contains("at rest"));
        (played, is_at_rest, passed.get())
    }
}

/// Plays each fault at every byte, or at one of each `step`.
fn at_every_byte(faults: &[Fault], step: usize, play: impl Fn(Case) -> usize + Sync) {
    let run = &|in_bytes| {
        let end = play(Case { fault: faults[0], at: usize::MAX, in_bytes });
        for &fault in faults {
            for at in (0..end).step_by(step) {
                play(Case { fault, at, in_bytes });
            }
        }
    };
    std::thread::scope(|scope| {
        [false, true].map(|in_bytes| scope.spawn(move || run(in_bytes))).len()
    });
}

/// Longest silence of a node behind which a command to move still leaves: the period in which it is
/// read, and three answers that do not come.
const NODE_SILENCE: Duration = Duration::from_millis(250);

/// The motors of a bus, and what the player has heard of them.
#[derive(Default)]
struct Motors {
    /// Where position nodes go, and since when.
    goals: BTreeMap<u8, i32>,
    moved_at: Option<Instant>,
    /// Fault and id of a node.
    fault: Option<(Fault, u8)>,
    /// Number of answers since.
    answers: u32,
    heard: BTreeMap<u8, (Mode, Instant)>,
    decoder: Decoder<ToMaster>,
    last_write: BTreeMap<u8, f32>,
    wrong: Vec<String>,
}

impl Motors {
    /// Goes on to now, at 10 turns per second; returns whether all motors are at rest.
    fn advance(&mut self, bus: &mut BusState) -> bool {
        let way = clock::since(self.moved_at.replace(clock::now()).unwrap_or_else(clock::now));
        let way = (way.as_secs_f32() * 81_920.0) as i32;
        bus.nodes.iter_mut().all(|node| {
            let left = self.goals.get(&node.id).map_or(0, |goal| goal - node.counts);
            node.counts += left.clamp(-way, way);
            node.rps == 0.0 && left.abs() <= 8
        })
    }

    fn hear(&mut self, said: Said, bus: &mut BusState) {
        self.advance(bus);
        let (Said::Read(id) | Said::Write(id, ..)) = said;
        let Some(node) = bus.nodes.iter_mut().find(|node| node.id == id) else { return };
        let Said::Write(_, rps, counts) = said else {
            if self.fault == Some((Fault::ModeAndMute, id)) {
                self.answers += 1;
                node.is_dumb = self.answers > 1;
            }
            return;
        };
        let is_speed = [0.0, 1.0, 2.0].contains(&rps);
        let meant = if is_speed { Mode::Velocity } else { Mode::Position };
        let (mode, at) = self.heard[&id];
        if node.mode == mode && mode != meant || rps != 0.0 && clock::since(at) > NODE_SILENCE {
            self.wrong.push(format!("{said:?}, {mode} mode heard {:?} ago", clock::since(at)));
        }
        self.last_write.insert(id, rps);
        match node.mode {
            _ if self.fault == Some((Fault::Deaf, id)) => {}
            Mode::Velocity => node.rps = rps,
            Mode::Position => drop(self.goals.insert(id, counts)),
        }
    }

    fn read(&mut self, mut bytes: &[u8]) {
        while let Some(event) = self.decoder.decode(&mut bytes) {
            let (id, mode) = match event {
                Event::Frame(Response::Velocity(it)) => (it.id(), Mode::Velocity),
                Event::Frame(Response::Position(it)) => (it.id(), Mode::Position),
                Event::Skipped(_) => continue,
            };
            self.heard.insert(id.get(), (mode, clock::now()));
        }
    }

    fn begin(&mut self, fault: Fault, node: &mut Node) {
        self.fault = Some((fault, node.id));
        node.is_dumb = matches!(fault, Fault::Mute | Fault::Deaf);
        if !node.is_dumb {
            let is_speed = node.mode == Mode::Velocity;
            node.mode = if is_speed { Mode::Position } else { Mode::Velocity };
            node.rps = 0.0;
            self.goals.remove(&node.id);
        }
    }
}

/// Moves a velocity node and a position node; the fault is one of the node at this index.
fn play_to_nodes(case: Case, index: usize) -> usize {
    // Taken as speeds, these positions are as fast as can be.
    let (counts, there) = (-200 * 8192, Position::from_counts(-190 * 8192).unwrap());
    let nodes = [Node { counts, ..Node::velocity(1) }, Node::position(3, counts)];
    let nodes = nodes.map(|node| Node { follows: false, ..node }).into();
    let (motors, mut ear, mut answers) =
        (Rc::new(RefCell::new(Motors::default())), BusEar::default(), VecDeque::new());
    let (ours, theirs, readers) = (motors.clone(), motors.clone(), motors.clone());
    let line = played::played(BusState { nodes, ..BusState::default() }, move |bus, bytes| {
        let said = ear.hear(bus, bytes, |said, bus| theirs.borrow_mut().hear(said, bus));
        let is_late = matches!(theirs.borrow().fault, Some((Fault::ModeAndLate, _)));
        if !said.is_empty() {
            let delay = if is_late { 45 } else { 3 * u64::from(case.in_bytes) };
            answers.push_back((clock::now() + Duration::from_millis(delay), said));
        }
        let due = answers.pop_front_if(|(at, _)| *at <= clock::now());
        due.map(|(_, said)| said).unwrap_or_default()
    });
    let bus = line.state.clone();
    let happen = move || ours.borrow_mut().begin(case.fault, &mut bus.borrow_mut().nodes[index]);
    let (slow, fast) = (&speed(NodeId::N1, 1.0)[..], &speed(NodeId::N1, 2.0)[..]);
    let way = WriteRequest::position(NodeId::N3, there);
    let (way, asks) = (&way.as_bytes()[..], [NodeId::N1, NodeId::N3].map(read));
    // Commands leave before, while and after the answers to two questions come.
    let mut frames = vec![(0, slow), (0, way), (10, &asks[0]), (10, &asks[1])];
    frames.extend((12..15).flat_map(|at| [(at, fast), (at, way)]));
    frames.extend([(150, slow), (300, way), (300, fast)]);
    let run = Run { reads_back: !case.in_bytes, ..BUS };
    let (played, says_at_rest, passed) =
        case.play(&line, &run, &frames, happen, move |bytes| readers.borrow_mut().read(bytes));
    let (mut motors, mut bus) = (motors.borrow_mut(), line.state.borrow_mut());
    let is_at_rest = motors.advance(&mut bus);
    let is_in = |id, mode| motors.heard[&id].0 == mode;
    // A mode that was not heard cannot be known.
    let is_known =
        bus.nodes.iter().all(|it| motors.heard.get(&it.id).is_none_or(|heard| heard.0 == it.mode));
    let mut written = motors.last_write.iter();
    // What cannot be heard and may be in another mode cannot be told (ruling I11).
    let is_told = case.fault == Fault::ModeAndMute
        || written.clone().all(|(&id, rps)| *rps == 0.0 || is_in(id, Mode::Position));
    let has_changed =
        written.any(|(&id, _)| !is_in(id, [Mode::Velocity, Mode::Position][usize::from(id) / 2]));
    assert!(
        motors.wrong.is_empty()
            && is_told
            && (is_at_rest || !says_at_rest || !is_known)
            && (played.is_err() || !has_changed),
        "{case:?}, node {index}: {played:?} {:?} {bus:?}",
        motors.wrong
    );
    passed
}

#[test]
fn no_write_is_taken_in_a_mode_that_was_heard_to_be_another() {
    for index in [0, 1] {
        let faults = [Fault::Mode, Fault::ModeAndLate, Fault::ModeAndMute];
        at_every_byte(&faults, 1, |case| play_to_nodes(case, index));
    }
}

#[test]
fn a_silent_node_is_not_moved_and_not_called_at_rest_while_another_one_answers() {
    for index in [0, 1] {
        // No packet is shorter than 4 bytes.
        let faults = [Fault::Mute, Fault::Deaf, Fault::Signal];
        at_every_byte(&faults, 3, |case| play_to_nodes(case, index));
    }
}

/// Longest silence of a robot behind which a command to move still leaves (ruling U10).
const ROBOT_SILENCE: Duration = Duration::from_millis(510);

/// When a robot was driven and heard.
#[derive(Clone, Copy)]
struct Times {
    fault_at: Option<Instant>,
    moved_at: Instant,
    heard_at: Instant,
    /// Longest silence in front of a command to move.
    silence: Duration,
}

/// Drives a robot.
fn play_to_a_robot(case: Case) -> usize {
    clock::play();
    let now = clock::now();
    let (moved_at, heard_at, silence) = (now, now, Duration::ZERO);
    let times = Rc::new(Cell::new(Times { fault_at: None, moved_at, heard_at, silence }));
    let (ours, theirs, readers) = (times.clone(), times.clone(), times.clone());
    let mut robot = PlayedRover::default();
    let line = played::played(RoverState::default(), move |state, bytes| {
        let (commands, pings) = (state.commands.len(), state.pings);
        let (said, it, now) = (robot.hear(state, bytes), theirs.get(), clock::now());
        if state.commands[commands..].iter().any(|command| *command != (0, 0)) {
            let silence = it.silence.max(clock::since(it.heard_at));
            theirs.set(Times { moved_at: now, silence, ..it });
        }
        match (case.fault, it.fault_at) {
            (Fault::NoReports, Some(_)) if state.pings == pings => Vec::new(),
            (Fault::NoReports, Some(_)) => Pong::new(ErrorCode::Fine).frame(0).as_bytes().to_vec(),
            _ => said,
        }
    });
    let rover = line.state.clone();
    let happen = move || {
        ours.set(Times { fault_at: Some(clock::now()), ..ours.get() });
        let mut rover = rover.borrow_mut();
        rover.is_dumb = case.fault == Fault::Mute;
        rover.wheels = (case.fault == Fault::Deaf).then_some([9; 4]);
    };
    let heard = move |_: &[u8]| readers.set(Times { heard_at: clock::now(), ..readers.get() });
    let drive = [30, 60].map(|speed| MotorControl::new(speed, 0).unwrap().frame(0));
    let frames: Vec<_> = (0..7).map(|it| (it * 100, drive[it as usize % 2].as_bytes())).collect();
    let run = Run { protocol: Protocol::Ucp, ..BUS };
    let (played, says_at_rest, passed) = case.play(&line, &run, &frames, happen, heard);
    let (times, commands) = (times.get(), &line.state.borrow().commands);
    // Three reports behind the last command to move show that the wheels stand still.
    let seen_at = times.moved_at + Duration::from_millis(60);
    let is_seen = times.fault_at.is_none_or(|at| at > seen_at);
    assert!(
        times.silence <= ROBOT_SILENCE
            && commands.last() == Some(&(0, 0))
            && (is_seen || !says_at_rest),
        "{case:?}: {played:?} {:?} {commands:?}",
        times.silence
    );
    passed
}

#[test]
fn a_robot_that_is_not_heard_or_not_seen_to_stop_is_stopped_and_not_called_at_rest() {
    // No command and no report is shorter than 22 bytes.
    let faults = [Fault::Mute, Fault::NoReports, Fault::Deaf, Fault::Signal];
    at_every_byte(&faults, 22, play_to_a_robot);
}
