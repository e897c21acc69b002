//! Drives on a line within the process.

use std::sync::{Arc, Mutex};

use serde_json::Value;

use super::*;
use crate::{
    args::PortArgs,
    clock,
    played::{self, Played, RoverState},
};

/// A drive that is ready to begin, and its lines.
fn ready(line: &Played<RoverState>) -> (Drive, Arc<Mutex<Vec<String>>>) {
    let mut rover = Rover::on(line.line.clone(), &PortArgs::new(None));
    assert!(rover.find(|| false).unwrap());
    let (teller, lines) = Teller::to_memory();
    let start = rover.now();
    (Drive { rover, start, form: Form::Json, teller, page: Page::default(), left: Ok(()) }, lines)
}

fn command() -> MotorControl {
    rover::motor_control(30, -10).unwrap()
}

#[test]
fn the_command_is_repeated_for_its_time_and_reports_are_told_every_quarter_of_a_second() {
    let line = played::rover(|_| {});
    let (mut drive, lines) = ready(&line);
    // The times are those since the command, not since the line was opened.
    clock::sleep(std::time::Duration::from_millis(300));
    drive.start = drive.rover.now();
    drive.drive(command(), 620_000, &Signals::none()).unwrap();
    let driven = line.state.borrow().commands.iter().filter(|it| **it == (30, -10)).count();
    assert!((5..=8).contains(&driven), "every 100 ms: {driven}");
    drive.stop().unwrap();
    assert_eq!(line.state.borrow().commands.last(), Some(&(0, 0)));
    drop(drive.teller.finish());
    let lines = lines.lock().unwrap();
    let told: Vec<Value> = lines.iter().map(|line| serde_json::from_str(line).unwrap()).collect();
    let names: Vec<_> = told.iter().map(|line| line["event"].as_str().unwrap()).collect();
    assert_eq!(names, ["report", "report", "stopped"]);
    let seconds: Vec<_> = told.iter().map(|line| line["seconds"].as_f64().unwrap()).collect();
    assert!((0.25..0.45).contains(&seconds[0]) && (0.5..0.7).contains(&seconds[1]), "{seconds:?}");
    assert!((0.62..3.0).contains(&seconds[2]), "{seconds:?}");
    assert_eq!(told[0]["rpm"], serde_json::json!([20, 40, 20, 40]));
    assert_eq!((&told[2]["rpm"][0], &told[2]["reports_lost"]), (&0.into(), &0.into()));
}

#[test]
fn a_signal_ends_the_drive_at_once() {
    let line = played::rover(|_| {});
    let (mut drive, _) = ready(&line);
    let signals = Signals::none();
    signals.raise();
    let before = line.state.borrow().commands.len();
    drive.drive(command(), 600_000_000, &signals).unwrap();
    assert_eq!(line.state.borrow().commands.len(), before);
}

#[test]
fn a_robot_that_is_not_heard_or_a_dead_man_ends_the_drive_with_a_failure() {
    let line = played::rover(|_| {});
    let (mut drive, _) = ready(&line);
    line.state.borrow_mut().is_dumb = true;
    let error = drive.drive(command(), 10_000_000, &Signals::none()).unwrap_err();
    assert_eq!(error.to_string(), "the robot is no longer heard");
    let line = played::rover(|_| {});
    let (mut drive, _) = ready(&line);
    drive.rover.has_dead_man_fired = true;
    let error = drive.drive(command(), 10_000_000, &Signals::none()).unwrap_err();
    assert_eq!(error.to_string(), DEAD_MAN);
}

#[test]
fn what_ended_a_drive_is_told_with_the_rest_behind_it() {
    let line = played::rover(|_| {});
    let (mut drive, lines) = ready(&line);
    drive.rover.has_dead_man_fired = true;
    let error = drive.run(command(), 10_000_000, &Signals::none()).unwrap_err().to_string();
    assert_eq!(error, format!("{DEAD_MAN}; it was stopped and is at rest"));
    let lines = lines.lock().unwrap();
    let outcome: Value = serde_json::from_str(lines.last().unwrap()).unwrap();
    let expected = serde_json::json!({"event": "outcome", "at_rest": true, "failure": error});
    assert_eq!(outcome, expected);
}

#[test]
fn an_output_that_fails_is_told_behind_the_stop() {
    let line = played::rover(|_| {});
    let (mut drive, _) = ready(&line);
    drive.teller = Teller::that_fails();
    let error = drive.run(command(), 300_000, &Signals::none()).unwrap_err().to_string();
    assert!(error.starts_with("cannot write the output: "), "{error}");
    assert_eq!(line.state.borrow().commands.last(), Some(&(0, 0)));
}

#[cfg(feature = "dashboard")]
#[test]
fn a_page_that_gave_up_is_told_behind_the_stop() {
    let line = played::rover(|_| {});
    let (mut drive, _) = ready(&line);
    drive.page = Page::that_gave_up();
    let error = drive.run(command(), 300_000, &Signals::none()).unwrap_err().to_string();
    assert_eq!(error, "the tool has a bug: its page gave up");
    assert_eq!(line.state.borrow().commands.last(), Some(&(0, 0)));
}

#[test]
fn a_port_that_is_lost_ends_the_drive() {
    let line = played::rover(|_| {});
    let (mut drive, _) = ready(&line);
    line.is_gone.set(true);
    let error = drive.drive(command(), 10_000_000, &Signals::none()).unwrap_err();
    assert_eq!(error.to_string(), "port \"played\" failed: unplugged");
}

#[test]
fn lost_reports_are_told() {
    let line = played::rover(|rover| rover.is_dumb = (3..6).contains(&rover.commands.len()));
    let (mut drive, lines) = ready(&line);
    drive.drive(command(), 800_000, &Signals::none()).unwrap();
    drop(drive.teller.finish());
    let lines = lines.lock().unwrap();
    let last: Value = serde_json::from_str(lines.last().unwrap()).unwrap();
    assert!(last["reports_lost"].as_u64().unwrap() > 3, "{last}");
}

#[test]
fn an_absence_ends_the_drive_and_nothing_is_commanded_after_it() {
    let mut absences = 0;
    let line = played::rover(move |rover| {
        if rover.commands.last() == Some(&(30, -10)) && absences == 0 {
            absences += 1;
            clock::sleep(std::time::Duration::from_millis(600));
            rover.commands.clear();
        }
    });
    let (mut drive, _) = ready(&line);
    let error = drive.drive(command(), 10_000_000, &Signals::none()).unwrap_err().to_string();
    assert!(error.starts_with("the tool did not run for 0."), "{error}");
    drive.stop().unwrap();
    let commands = &line.state.borrow().commands;
    assert!(commands.iter().all(|command| *command == (0, 0)), "{commands:?}");
}
