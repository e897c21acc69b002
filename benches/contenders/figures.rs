//! Figures as lines, `name value goal`, of which more is better.

use std::{
    env,
    process::ExitCode,
    sync::atomic::{AtomicBool, Ordering::Relaxed},
};

static IS_BELOW: AtomicBool = AtomicBool::new(false);

/// Prints a figure with so many digits, and a dash for a missing goal.
pub fn print(name: &str, value: f64, digits: usize, goal: Option<f64>) {
    let shown = goal.map_or("-".into(), |goal| goal.to_string());
    println!("{name} {value:.digits$} {shown}");
    if wants_goals() && goal.is_some_and(|goal| value < goal) {
        eprintln!("{name} is {value:.digits$}, below its goal {shown}");
        IS_BELOW.store(true, Relaxed);
    }
}

/// A failure if the command line has `--goals` and a figure was below its goal.
#[must_use]
pub fn outcome() -> ExitCode {
    if IS_BELOW.load(Relaxed) { ExitCode::FAILURE } else { ExitCode::SUCCESS }
}

fn wants_goals() -> bool {
    env::args().any(|argument| argument == "--goals")
}
