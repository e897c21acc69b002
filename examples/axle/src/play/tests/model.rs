//! Models of the player, in virtual time: each fault, at every byte of the traffic, through a port
//! that takes whole frames and one that takes single bytes, with answers in between.

use std::{
    cell::Cell,
    collections::VecDeque,
    rc::Rc,
    time::{Duration, Instant},
};

use axlewire::ikeya::Position;

use super::*;
use crate::{
    pcapng::Direction,
    played::{BusEar, BusState, Node, Said},
};

/// What happens from some byte on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Fault {
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

/// Longest time in which a plan of less than a second and the stop behind it are over.
const PATIENCE: Duration = Duration::from_secs(10);

/// A run with a fault behind this byte of both directions, and whether the port takes single bytes.
#[derive(Clone, Copy, Debug)]
pub(super) struct Case {
    pub(super) fault: Fault,
    at: usize,
    in_bytes: bool,
}

impl Case {
    /// Plays; returns the result, whether it tells that everything is at rest, and the number of
    /// bytes that have passed.
    pub(super) fn play<T: 'static>(
        self,
        line: &Played<T>,
        run: &Run,
        frames: &Frames<'_>,
        begin: fn(&mut T, Fault),
        read: fn(&mut T, &[u8]),
    ) -> (Result<(), String>, bool, usize) {
        line.most.set(if self.in_bytes { 1 } else { usize::MAX });
        let (passed, signals) = (Rc::new(Cell::new(0)), Rc::new(Signals::none()));
        let (count, ctrl_c, state) = (passed.clone(), signals.clone(), line.state.clone());
        let since = clock::now();
        let tapped = line.line.clone().tapped(move |direction, bytes| {
            match direction {
                // Otherwise no time would pass on a busy line.
                Direction::Out => clock::sleep(Duration::from_micros(20 * bytes.len() as u64)),
                Direction::In => read(&mut state.borrow_mut(), bytes),
            }
            let before = count.replace(count.get() + bytes.len());
            let is_time = (before..count.get()).contains(&self.at);
            match self.fault {
                _ if clock::since(since) > PATIENCE => ctrl_c.raise(),
                Fault::Signal if is_time => ctrl_c.raise(),
                fault if is_time => begin(&mut state.borrow_mut(), fault),
                _ => {}
            }
        });
        let played = run.on_line(&tapped, frames, &signals);
        assert!(clock::since(since) < PATIENCE, "{self:?}: only Ctrl-C has ended it: {played:?}");
        assert!(self.at < usize::MAX || played.is_ok(), "{played:?}");
        let is_at_rest = played.as_ref().err().is_none_or(|failure| failure.contains("at rest"));
        (played, is_at_rest, passed.get())
    }
}

/// Plays each fault at every byte, or at one of each `step`.
pub(super) fn at_every_byte(faults: &[Fault], step: usize, play: impl Fn(Case) -> usize + Sync) {
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

/// Modes of nodes 1 and 3 before a fault.
const MODES: [Mode; 2] = [Mode::Velocity, Mode::Position];

/// Nodes 1 and 3.
#[derive(Default)]
struct Motors {
    bus: BusState,
    ear: BusEar,
    /// What the player has heard of them and last told them, and where that sends their motors.
    heard: [Option<(Mode, Instant)>; 2],
    told: [Option<f32>; 2],
    goals: [Option<i32>; 2],
    moved_at: Option<Instant>,
    answers: VecDeque<(Instant, Vec<u8>)>,
    /// Index of the node with the fault.
    faulty: usize,
    fault: Option<Fault>,
    has_cut: bool,
    wrong: Vec<String>,
}

impl Motors {
    /// Goes on to now, at 10 turns per second; returns whether all motors are at rest.
    fn advance(&mut self) -> bool {
        let way = clock::since(self.moved_at.replace(clock::now()).unwrap_or_else(clock::now));
        let way = (way.as_secs_f32() * 81_920.0) as i32;
        self.goals.iter().zip(&mut self.bus.nodes).fold(true, |all, (goal, node)| {
            let left = goal.map_or(0, |goal| goal - node.counts);
            node.counts += left.clamp(-way, way);
            all && node.rps == 0.0 && left.abs() <= 8
        })
    }

    /// Gets these bytes, which take so long to be answered; returns the answer that is due.
    fn hear(&mut self, bytes: &[u8], delay: u64) -> Vec<u8> {
        self.advance();
        let answer = self.ear.hear(&mut self.bus, bytes, |_, _| {});
        for (said, _) in std::mem::take(&mut self.bus.said) {
            self.obey(said);
        }
        let is_late = self.fault == Some(Fault::ModeAndLate);
        if !answer.is_empty() {
            let delay = Duration::from_millis(if is_late { 45 } else { delay });
            self.answers.push_back((clock::now() + delay, answer));
        }
        // The first late one comes sooner if it can cut a WRITE in two.
        let is_between = is_late && bytes.starts_with(&[0xBB]) && !self.answers.is_empty();
        let is_first = is_between && !std::mem::replace(&mut self.has_cut, true);
        let until = clock::now() + Duration::from_millis(if is_first { 45 } else { 0 });
        let is_due = self.answers.front().is_some_and(|(at, _)| *at <= until);
        let due = is_due.then(|| self.answers.pop_front()).flatten();
        due.map(|(_, answer)| answer).unwrap_or_default()
    }

    fn obey(&mut self, said: Said) {
        let (Said::Read(id) | Said::Write(id, ..)) = said;
        let index = usize::from(id) / 2;
        let fault = self.fault.filter(|_| self.faulty == index);
        let node = &mut self.bus.nodes[index];
        let Said::Write(_, rps, counts) = said else {
            node.is_dumb |= fault == Some(Fault::ModeAndMute);
            return;
        };
        let meant = MODES[usize::from(![0.0, 1.0, 2.0].contains(&rps))];
        let heard = self.heard[index].map(|(mode, at)| (mode, clock::since(at)));
        let is_wrong =
            |(mode, ago)| mode == node.mode && mode != meant || rps != 0.0 && ago > NODE_SILENCE;
        if heard.is_none_or(is_wrong) {
            self.wrong.push(format!("{said:?}, last heard: {heard:?} ago"));
        }
        self.told[index] = Some(rps);
        match node.mode {
            _ if fault == Some(Fault::Deaf) => {}
            Mode::Velocity => node.rps = rps,
            Mode::Position => self.goals[index] = Some(counts),
        }
    }

    /// The player gets answers, whole ones.
    fn read(&mut self, bytes: &[u8]) {
        for answer in bytes.chunks(8) {
            let mode = MODES[usize::from(answer[0] == 0x56)];
            self.heard[usize::from(answer[1]) / 2] = Some((mode, clock::now()));
        }
    }

    fn begin(&mut self, fault: Fault) {
        self.fault = Some(fault);
        let node = &mut self.bus.nodes[self.faulty];
        node.is_dumb = matches!(fault, Fault::Mute | Fault::Deaf);
        if !node.is_dumb {
            (node.mode, node.rps, self.goals[self.faulty]) = (MODES[1 - self.faulty], 0.0, None);
        }
    }
}

/// Moves a velocity node and a position node; the fault is one of the node at this index.
fn play_to_nodes(case: Case, faulty: usize) -> usize {
    // Taken as speeds, these positions are as fast as can be.
    let (counts, there) = (-200 * 8192, Position::from_counts(-190 * 8192).unwrap());
    let nodes = [Node { counts, ..Node::velocity(1) }, Node::position(3, counts)];
    let nodes = nodes.map(|node| Node { follows: false, ..node }).into();
    let bus = BusState { nodes, ..BusState::default() };
    let motors = Motors { bus, faulty, ..Motors::default() };
    let delay = if case.in_bytes { 3 } else { 0 };
    let line = played::played(motors, move |it, bytes| it.hear(bytes, delay));
    let (slow, fast) = (&speed(NodeId::N1, 1.0)[..], &speed(NodeId::N1, 2.0)[..]);
    let way = WriteRequest::position(NodeId::N3, there);
    let (way, asks) = (&way.as_bytes()[..], [NodeId::N1, NodeId::N3].map(read));
    // Commands leave before, while and after the answers to two questions come.
    let mut frames = vec![(0, slow), (0, way), (10, &asks[0]), (10, &asks[1])];
    frames.extend((12..15).flat_map(|at| [(at, fast), (at, way)]));
    frames.extend([(150, slow), (300, way), (300, fast)]);
    let run = Run { reads_back: !case.in_bytes, ..BUS };
    let (played, says_at_rest, passed) =
        case.play(&line, &run, &frames, Motors::begin, Motors::read);
    let mut motors = line.state.borrow_mut();
    let (is_at_rest, mut is_known) = (motors.advance(), true);
    let what = format!("{case:?}, node {faulty}: {played:?} {:?}", motors.bus.nodes);
    assert!(motors.wrong.is_empty(), "it should not have written {:?}: {what}", motors.wrong);
    for (index, node) in motors.bus.nodes.iter().enumerate() {
        let (heard, told) = (motors.heard[index].map(|(mode, _)| mode), motors.told[index]);
        // A mode that was not heard cannot be known.
        is_known &= heard.is_none_or(|mode| mode == node.mode);
        // What cannot be heard and may be in another mode cannot be told (ruling I11).
        let is_beyond = case.fault == Fault::ModeAndMute || heard == Some(Mode::Position);
        assert!(told.unwrap_or(0.0) == 0.0 || is_beyond, "it was not told to stop: {what}");
        let has_changed = told.is_some() && heard != Some(MODES[index]);
        assert!(played.is_err() || !has_changed, "the changed mode is not reported: {what}");
    }
    assert!(is_at_rest || !says_at_rest || !is_known, "it says that all are at rest: {what}");
    passed
}

#[test]
fn no_write_is_taken_in_a_mode_that_was_heard_to_be_another() {
    let faults = [Fault::Mode, Fault::ModeAndLate, Fault::ModeAndMute];
    at_every_byte(&faults, 1, |case| [0, 1].map(|node| play_to_nodes(case, node))[0]);
}

#[test]
fn a_silent_node_is_not_moved_and_not_called_at_rest_while_another_one_answers() {
    // No packet is shorter than 4 bytes.
    let faults = [Fault::Mute, Fault::Deaf, Fault::Signal];
    at_every_byte(&faults, 3, |case| [0, 1].map(|node| play_to_nodes(case, node))[0]);
}
