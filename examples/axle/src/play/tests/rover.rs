//! Frames for a rover.

use std::time::{Duration, Instant};

use axlewire::ucp::{
    Body, MotorControl,
    message::{ErrorCode, Ping, Pong},
};

use super::{
    model::{Case, Fault, at_every_byte},
    *,
};
use crate::played::{PlayedRover, RoverState};

const ROVER: Run = Run { protocol: Protocol::Ucp, ..BUS };

fn drive() -> Vec<u8> {
    MotorControl::new(30, 0).unwrap().frame(0).as_bytes().to_vec()
}

#[test]
fn a_rover_that_was_driven_is_stopped_and_one_that_is_asked_is_stopped_first() {
    let (drive, ping) = (drive(), Ping {}.frame(0));
    let line = played::rover(|_| {});
    ROVER.on(&line, &[(0, &drive), (50, &drive), (150, &drive)], &Signals::none()).unwrap();
    let commands = line.state.borrow().commands.clone();
    let driven: Vec<_> = commands.iter().filter(|command| **command == (30, 0)).collect();
    assert_eq!(driven.len(), 2, "at once, and the repetition of a host: {commands:?}");
    assert_eq!(commands.last(), Some(&(0, 0)), "{commands:?}");

    for (side, stops) in [(Side::Commander, 1), (Side::Device, 0)] {
        let line = played::rover(|_| {});
        Run { side, ..ROVER }.on(&line, &[(0, ping.as_bytes())], &Signals::none()).unwrap();
        let state = line.state.borrow();
        assert_eq!(state.commands, [(0, 0)].repeat(stops), "{side}");
        assert_eq!(state.pings, 1);
    }
}

#[test]
fn a_rover_that_was_only_told_to_stand_still_is_seen_to_do_so() {
    let stop = MotorControl::STOP.frame(0);
    let frames: [(u64, &[u8]); 1] = [(0, stop.as_bytes())];
    ROVER.on(&played::rover(|_| {}), &frames, &Signals::none()).unwrap();
    assert!(ROVER.on_line(&played::silence(true), &frames, &Signals::none()).is_err());
}

#[test]
fn a_rover_is_told_to_stop_every_100_ms_until_its_first_motor_command() {
    let ping = Ping {}.frame(7);
    let drive = MotorControl::new(10, 0).unwrap().with_front_led(true).frame(3);
    let line = played::rover(|_| {});
    let frames: [(u64, &[u8]); 3] =
        [(50, ping.as_bytes()), (350, drive.as_bytes()), (400, ping.as_bytes())];
    ROVER.on(&line, &frames, &Signals::none()).unwrap();
    let state = line.state.borrow();
    let first = state.commands.iter().position(|command| *command == (10, 0)).unwrap();
    // The host needs up to 100 ms to hear the robot.
    assert!((4..=6).contains(&first), "{:?}", state.commands);
    assert_eq!(state.lamps[first], 100);
    // Until it stops, the lamp stays as it was.
    assert!(state.lamps[first..].iter().all(|lamp| *lamp == 100));
}

#[test]
fn a_rover_whose_plan_falls_silent_is_told_to_stop_as_by_any_host() {
    let drive = drive();
    let line = played::rover(|_| {});
    let run = Run { linger_ms: 1500, ..ROVER };
    run.on(&line, &[(0, &drive)], &Signals::none()).unwrap();
    let commands = line.state.borrow().commands.clone();
    let driven = commands.iter().filter(|command| **command == (30, 0)).count();
    assert!((5..=6).contains(&driven), "for 500 ms: {commands:?}");
    assert!(commands.len() >= 15, "{commands:?}");
}

#[test]
fn what_was_due_during_an_absence_is_not_sent() {
    let drive = drive();
    let line = played::rover(|rover| {
        if rover.commands.last() == Some(&(30, 0)) && rover.pings < 1000 {
            rover.pings = 1000;
            clock::sleep(Duration::from_millis(600));
        }
    });
    let fast = MotorControl::new(60, 0).unwrap().frame(0);
    let frames: [(u64, &[u8]); 2] = [(0, &drive), (300, fast.as_bytes())];
    let error = ROVER.on(&line, &frames, &Signals::none()).unwrap_err();
    assert!(error.starts_with("the tool did not run for 0.6 s (suspended?); "), "{error}");
    assert!(!line.state.borrow().commands.contains(&(60, 0)));
}

#[test]
fn a_signal_ends_it_and_what_was_not_sent_is_counted() {
    let drive = drive();
    let signals = Signals::none();
    signals.raise();
    let line = played::rover(|_| {});
    let error = ROVER.on(&line, &[(0, &drive)], &signals).unwrap_err();
    assert_eq!(error, "interrupted before anything moved");
    let ping = Ping {}.frame(0);
    let line = played::rover(|_| {});
    let frames: [(u64, &[u8]); 2] = [(0, ping.as_bytes()), (1, ping.as_bytes())];
    let error = ROVER.on(&line, &frames, &signals).unwrap_err();
    assert_eq!(error, "2 frames not sent: interrupted; nothing moves");
    assert!(!line.state.borrow().commands.contains(&(30, 0)));
}

/// Longest silence of a robot behind which a command to move still leaves (ruling U10).
const ROBOT_SILENCE: Duration = Duration::from_millis(510);

/// A robot, and when it was driven and heard.
struct Driven {
    rover: RoverState,
    fault: Option<(Fault, Instant)>,
    moved_at: Instant,
    heard_at: Instant,
    /// Longest silence in front of a command to move.
    silence: Duration,
}

impl Driven {
    fn begin(&mut self, fault: Fault) {
        self.fault = Some((fault, clock::now()));
        self.rover.is_dumb = fault == Fault::Mute;
        self.rover.wheels = (fault == Fault::Deaf).then_some([9; 4]);
    }
}

/// Drives a robot.
fn play_to_a_robot(case: Case) -> usize {
    clock::play();
    let (rover, now, silence) = (RoverState::default(), clock::now(), Duration::ZERO);
    let driven = Driven { rover, fault: None, moved_at: now, heard_at: now, silence };
    let mut robot = PlayedRover::default();
    let line = played::played(driven, move |it, bytes| {
        let (commands, pings) = (it.rover.commands.len(), it.rover.pings);
        let said = robot.hear(&mut it.rover, bytes);
        if it.rover.commands[commands..].iter().any(|command| *command != (0, 0)) {
            it.silence = it.silence.max(clock::since(it.heard_at));
            it.moved_at = clock::now();
        }
        match it.fault {
            Some((Fault::NoReports, _)) if it.rover.pings == pings => Vec::new(),
            Some((Fault::NoReports, _)) => Pong::new(ErrorCode::Fine).frame(0).as_bytes().to_vec(),
            _ => said,
        }
    });
    let drive = [30, 60].map(|speed| MotorControl::new(speed, 0).unwrap().frame(0));
    let frames: Vec<_> = (0..7).map(|it| (it * 100, drive[it as usize % 2].as_bytes())).collect();
    let (played, says_at_rest, passed) =
        case.play(&line, &ROVER, &frames, Driven::begin, |it, _| it.heard_at = clock::now());
    let Driven { rover, fault, moved_at, silence, .. } = &*line.state.borrow();
    // Three reports behind the last command to move show that the wheels stand still.
    let seen_at = *moved_at + Duration::from_millis(60);
    let is_seen = fault.is_none_or(|(_, at)| at > seen_at);
    let what = format!("{case:?}: {played:?} {silence:?} {:?}", rover.commands);
    assert!(*silence <= ROBOT_SILENCE, "it has driven a silent robot: {what}");
    assert_eq!(rover.commands.last(), Some(&(0, 0)), "it was not told to stop: {what}");
    assert!(is_seen || !says_at_rest, "it says that the robot is at rest: {what}");
    passed
}

#[test]
fn a_robot_that_is_not_heard_or_not_seen_to_stop_is_stopped_and_not_called_at_rest() {
    // No command and no report is shorter than 22 bytes.
    let faults = [Fault::Mute, Fault::NoReports, Fault::Deaf, Fault::Signal];
    at_every_byte(&faults, 22, play_to_a_robot);
}
