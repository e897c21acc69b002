//! Two processes on a pseudo-terminal: one simulates the devices on the line, the other is the tool
//! as a new user would run it. Each test starts its own pair and ends both by process id.
#![cfg(unix)]

#[path = "../support/mod.rs"]
mod support;

mod bugreport;
mod drive;
mod extcap;
mod faults;
mod gone;
mod input;
mod line;
#[cfg(feature = "dashboard")]
mod page;
mod played;
mod progress;
mod record;
mod replay;
mod rover;
mod scan;
mod send;
mod signals;
mod sim;
mod spin;
mod stop;
mod stress;
mod tcp;
mod three;
mod watch;

use std::{
    thread,
    time::{Duration, Instant},
};

use support::process::Process;

/// A simulation and the path of its port.
fn sim(args: &str) -> (Process, String) {
    let sim = Process::start(&format!("sim {args}"));
    let first = sim.line("");
    let path = first.strip_prefix("pty: ").expect("the path is the first line").to_owned();
    (sim, path)
}

const TWO_NODES: &str = "ikeya --node 1:velocity --node 3:position";

/// The numbers before `unit` in lines that contain it.
fn values(lines: &[String], unit: &str) -> Vec<f64> {
    let value = |line: &String| {
        let words: Vec<_> = line.split([' ', ',']).filter(|word| !word.is_empty()).collect();
        let at = words.iter().position(|word| *word == unit)?;
        words[at - 1].parse().ok()
    };
    lines.iter().filter_map(value).collect()
}

/// Waits until a condition holds; the limit is generous, even for a busy machine.
fn wait_until(what: &str, is_so: impl Fn() -> bool) {
    let start = Instant::now();
    while !is_so() {
        assert!(start.elapsed() < Duration::from_secs(60), "{what} did not happen");
        thread::sleep(Duration::from_millis(2));
    }
}
