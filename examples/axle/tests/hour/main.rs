//! An hour on pseudo-terminals, in real time: a master with eight nodes at the pace of a line of
//! 500 kbit/s, a host with its rover, and two subcommands of the tool that record what they do.
//! Nothing leaks, nothing stalls, and the reports keep their beat of 20 ms.
//!
//! ```sh
//! AXLE_HOUR_MINUTES=60 cargo test --release -p axlewire-cli --test hour -- --ignored --nocapture
//! ```
//!
//! Without the variable it takes 30 seconds. The machine has other work to do: what the scheduler
//! kept waiting is measured for itself (`machine.rs`) and named beside every figure.
#![cfg(target_os = "linux")]

#[path = "../support/mod.rs"]
mod support;

mod bus;
mod machine;
mod processes;
mod rover;
mod tools;

use std::{env, thread, time::Duration};

use machine::Control;
use processes::Processes;
use support::process::Process;

/// A simulation and the path of its port.
fn sim(args: &str) -> (Process, String) {
    let sim = Process::start(&format!("sim {args}"));
    let path = sim.line("").strip_prefix("pty: ").expect("the path is the first line").to_owned();
    (sim, path)
}

fn length() -> Duration {
    let minutes = env::var("AXLE_HOUR_MINUTES").map_or(0.5, |text| text.parse().unwrap());
    Duration::from_secs_f64(minutes * 60.0)
}

#[test]
#[ignore = "takes as long as it is told to: see the top of this file"]
fn an_hour_on_pseudo_terminals_leaks_nothing_stalls_nowhere_and_keeps_its_beat() {
    let length = length();
    let control = Control::start();
    let (bus_sim, bus_path) = sim(&format!("ikeya {} --watchdog 2", bus::NODES));
    let (rover_sim, rover_path) = sim("ucp");
    let tools = tools::Tools::start(length);
    let mut processes = Processes::new();
    processes.add("sim ikeya", bus_sim.id());
    processes.add("sim ucp", rover_sim.id());
    tools.watch(&mut processes);
    processes.add("master and host", std::process::id());

    let (bus_id, rover_id) = (bus_sim.id(), rover_sim.id());
    let (of_bus, of_rover) = (control.clone(), control.clone());
    let bus = thread::spawn(move || bus::run(&bus_path, length, of_bus, bus_id));
    let rover = thread::spawn(move || rover::run(&rover_path, length, of_rover, rover_id));
    processes.sample_for(length);
    let (bus, rover) = (bus.join().unwrap(), rover.join().unwrap());

    let mut complaints = Vec::new();
    println!("{:.1} minutes; {control}", length.as_secs_f64() / 60.0);
    bus_sim.signal("INT");
    bus.report(&bus_sim.end().stdout, &mut complaints);
    rover_sim.signal("INT");
    rover.report(&rover_sim.end().stdout, &mut complaints);
    tools.report(length, &control, &mut complaints);
    processes.report(&mut complaints);
    assert!(complaints.is_empty(), "{complaints:#?}");
}
