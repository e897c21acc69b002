//! Two processes on a pseudo-terminal: one plays what is on the line, the other is used as a
//! newcomer would use it. Each test starts its own pair and ends both by their ids.
#![cfg(unix)]

#[path = "../support/mod.rs"]
mod support;

mod drive;
mod input;
mod played;
#[path = "../../../../tests/support/quiet.rs"]
mod quiet;
mod scan;
mod signals;
mod sim;
mod spin;
mod stop;
mod watch;

use std::{
    thread,
    time::{Duration, Instant},
};

use quiet::undisturbed;
use support::process::Process;

/// A simulation and the path of its port.
fn sim(args: &str) -> (Process, String) {
    let sim = Process::start(&format!("sim {args}"));
    let first = sim.line("");
    let path = first.strip_prefix("pty: ").expect("the path is the first line").to_owned();
    (sim, path)
}

const TWO_NODES: &str = "ikeya --node 1:velocity --node 3:position";

/// The numbers in front of `unit` in lines that have one.
fn values(lines: &[String], unit: &str) -> Vec<f64> {
    let value = |line: &String| {
        let words: Vec<_> = line.split([' ', ',']).filter(|word| !word.is_empty()).collect();
        let at = words.iter().position(|word| *word == unit)?;
        words[at - 1].parse().ok()
    };
    lines.iter().filter_map(value).collect()
}

/// Waits until something is so; far longer than it takes, even on a machine that is busy.
fn wait_until(what: &str, is_so: impl Fn() -> bool) {
    let start = Instant::now();
    while !is_so() {
        assert!(start.elapsed() < Duration::from_secs(20), "{what} does not come");
        thread::sleep(Duration::from_millis(2));
    }
}
