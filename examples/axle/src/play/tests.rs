//! Frames for a rover on a line within the process.

use axlewire::{
    ikeya::Rps,
    ucp::{Body, MotorControl, message::Ping},
};

use super::*;
use crate::{
    args::PortArgs,
    bus::MasterArgs,
    played::{self, Played, RoverState},
};

fn run_on(
    line: &Played<RoverState>,
    side: Side,
    frames: &[(u64, &[u8])],
    signals: &Signals,
) -> Result<(), String> {
    let bus = MasterArgs::new(PortArgs::new(None), false, false);
    let due = |(after_ms, bytes): &(u64, &[u8])| {
        let (_, effect) = effect_of(Protocol::Ucp, bytes).unwrap();
        Due { after_us: after_ms * 1000, bytes: (*bytes).into(), meant: None, effect }
    };
    let limits = Limits { max_rps: Rps::new(20.0).unwrap(), max_turns: 100.0 };
    let (protocol, linger_us, is_json) = (Protocol::Ucp, 0, true);
    let frames = frames.iter().map(due).collect();
    let plan = Plan { bus: &bus, protocol, side, frames, linger_us, limits, is_json };
    play_on_rover(plan, line.line.clone(), signals).map_err(|failure| failure.to_string())
}

fn drive() -> Vec<u8> {
    MotorControl::new(30, 0).unwrap().frame(0).as_bytes().to_vec()
}

#[test]
fn a_rover_that_was_driven_is_stopped_and_one_that_is_asked_is_stopped_first() {
    let (drive, ping) = (drive(), Ping {}.frame(0));
    let line = played::rover(|_| {});
    run_on(&line, Side::Commander, &[(0, &drive), (50, &drive)], &Signals::none()).unwrap();
    let commands = line.state.borrow().commands.clone();
    let driven: Vec<_> = commands.iter().filter(|command| **command == (30, 0)).collect();
    assert_eq!(driven.len(), 2, "{commands:?}");
    assert!(commands.iter().rev().take(3).all(|command| *command == (0, 0)), "{commands:?}");

    for (side, stops) in [(Side::Commander, 1), (Side::Device, 0)] {
        let line = played::rover(|_| {});
        run_on(&line, side, &[(0, ping.as_bytes())], &Signals::none()).unwrap();
        assert_eq!(line.state.borrow().commands, [(0, 0)].repeat(stops), "{side}");
    }
}

#[test]
fn a_signal_ends_it_and_what_was_not_sent_is_counted() {
    let drive = drive();
    let signals = Signals::none();
    signals.raise();
    let line = played::rover(|_| {});
    let error = run_on(&line, Side::Commander, &[(0, &drive)], &signals).unwrap_err();
    assert_eq!(error, "interrupted before anything moved");
    let ping = Ping {}.frame(0);
    let line = played::rover(|_| {});
    let frames: [(u64, &[u8]); 2] = [(0, ping.as_bytes()), (1, ping.as_bytes())];
    let error = run_on(&line, Side::Commander, &frames, &signals).unwrap_err();
    assert_eq!(error, "2 frames not sent: interrupted; nothing moves");
    assert!(!line.state.borrow().commands.contains(&(30, 0)));
}

#[test]
fn a_line_that_is_lost_is_told_with_what_it_means() {
    let ping = Ping {}.frame(0);
    let line = played::rover(|_| {});
    line.is_gone.set(true);
    let error = run_on(&line, Side::Commander, &[(0, ping.as_bytes())], &Signals::none());
    assert_eq!(error.unwrap_err(), "port \"played\" failed: unplugged; nothing moves");
}
