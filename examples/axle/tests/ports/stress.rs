//! A machine under stress: programs that are suspended for seconds, signals that rain, no
//! descriptors left, no terminal. What is full or suspended otherwise is in `record.rs`,
//! `signals.rs` and `page.rs`.

use std::{
    process::{Child, Command, Stdio},
    thread,
    time::Duration,
};

use super::{
    Process,
    record::{decoded, fresh},
    sim,
    support::axle,
};

/// The tool with these arguments, started by a shell after these commands.
fn behind(commands: &str, args: &str) -> Command {
    let axle = axle(&[]);
    let mut shell = Command::new("bash");
    shell.args(["-c", &format!("{commands} exec \"$0\" {args}")]).arg(axle.get_program());
    shell
}

/// The commands that a simulated node has got, as printed.
fn commands(sim: &Process) -> Vec<String> {
    sim.lines().into_iter().filter(|line| line.contains("command")).collect()
}

/// Signals, one after another, hundreds of times a second; ended when it is dropped.
struct Rain(Child);

impl Rain {
    fn on(process: &Process, signals: &[&str]) -> Self {
        let id = process.id();
        let kinds: Vec<_> = signals.iter().map(|name| format!("kill -{name} {id}")).collect();
        // The shell waits for a line that never comes: a `sleep` would be a process each time.
        let rain = format!("while {}; do read -t 0.001; done", kinds.join(" && "));
        let mut shell = Command::new("bash");
        let shell = shell.args(["-c", &rain]).stdin(Stdio::piped()).stderr(Stdio::null());
        Self(shell.spawn().unwrap())
    }

    /// It ends by itself when the process has ended.
    fn is_falling(&mut self) -> bool {
        self.0.try_wait().unwrap().is_none()
    }
}

impl Drop for Rain {
    fn drop(&mut self) {
        // It may have ended.
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

#[test]
fn a_bus_that_is_suspended_for_seconds_is_told_and_its_motor_is_stopped_when_it_is_back() {
    let (sim, port) = sim("ikeya --node 1:velocity");
    let spin = Process::start(&format!("spin -p {port} -n 1 --rps 3 -f 600"));
    sim.line("command 3.00 rps");
    sim.signal("STOP");
    thread::sleep(Duration::from_millis(2500));
    sim.signal("CONT");
    let complaint = spin.complaint(1);
    assert_eq!(complaint, "node 1 no longer answers; it was stopped and is at rest");
    assert!(commands(&sim).last().unwrap().ends_with("command 0.00 rps"), "{:?}", sim.lines());
    // And it can be used again.
    let scan = Process::start(&format!("scan -p {port}")).success();
    assert_eq!(scan.last().unwrap(), "1 node answers.");
}

#[test]
fn a_bus_that_stays_suspended_is_said_not_to_have_stopped() {
    let (sim, port) = sim("ikeya --node 1:velocity --watchdog 0.5");
    let spin = Process::start(&format!("spin -p {port} -n 1 --rps 3 -f 600"));
    sim.line("command 3.00 rps");
    sim.signal("STOP");
    let complaint = spin.complaint(1);
    assert!(
        complaint.ends_with("has not confirmed it (nothing received): it may be moving"),
        "{complaint}"
    );
    sim.signal("CONT");
    // The watchdog of the slave, or a stop that waited in the line.
    super::wait_until("rest", || sim.lines().iter().any(|line| line.contains("at rest")));
}

#[test]
fn a_rover_that_is_suspended_for_seconds_is_told_and_is_stopped() {
    let (sim, port) = sim("ucp");
    let drive = Process::start(&format!("drive -p {port} --speed 40 --turn 0 -f 600"));
    sim.line("command: speed 40 %");
    sim.signal("STOP");
    thread::sleep(Duration::from_millis(2500));
    sim.signal("CONT");
    let ended = drive.end();
    assert_eq!((ended.code, ended.stderr.len()), (Some(1), 1), "{ended:?}");
    sim.line("at rest after");
}

#[test]
fn signals_that_rain_on_a_recording_lose_no_frame() {
    let (_sim, port) = sim("ucp");
    let path = fresh("rain.pcapng");
    let record = Process::start(&format!("record -p {port} -P ucp -f 3 -o {path}"));
    // A suspension interrupts what waits in the system, and so does a signal with a handler.
    let mut rain = Rain::on(&record, &["STOP", "CONT", "WINCH", "CHLD", "URG"]);
    thread::sleep(Duration::from_millis(2500));
    assert!(rain.is_falling());
    drop(rain);
    record.signal("CONT");
    record.success();
    let (events, summary) = decoded(&path);
    let reports = events.iter().filter(|event| event["message"] == "report");
    let indices: Vec<_> = reports.map(|event| event["index"].as_u64().unwrap()).collect();
    assert!(indices.windows(2).all(|pair| (pair[0] + 1) % 256 == pair[1]), "{indices:?}");
    assert!((140..=152).contains(&indices.len()), "{} reports in 3 s", indices.len());
    assert_eq!(summary["skipped"], 0);
}

#[test]
fn signals_that_rain_on_a_motor_lose_no_answer_and_do_not_abandon_its_stop() {
    let (sim, port) = sim("ikeya --node 1:velocity");
    let path = fresh("rain.pcapng");
    let spin = format!("spin -p {port} -n 1 --rps 10 -f 600 --record {path}");
    let spin = Process::start(&spin);
    sim.line("turning at 10.00 rps");
    // All have handlers: the first ends the motion, and the others fall into the stop.
    let mut rain = Rain::on(&spin, &["INT", "HUP", "TERM", "USR1", "ALRM"]);
    sim.line("command 0.00 rps");
    assert!(rain.is_falling());
    let lines = spin.success();
    drop(rain);
    assert!(lines.last().unwrap().ends_with("stopped and confirmed"), "{lines:?}");
    let (events, summary) = decoded(&path);
    // Every READ for the node has its answer, and the simulation says so too.
    let count = |name: &str| {
        let is_of = |event: &&serde_json::Value| event["message"] == name && event["node"] == 1;
        events.iter().filter(is_of).count()
    };
    let (reads, answers) = (count("read_request"), count("velocity_response"));
    assert!(reads > 50 && reads == answers, "{reads} READ, {answers} answers");
    assert_eq!(summary["skipped"], 0);
    sim.signal("INT");
    let told = sim.success();
    let same = format!("{reads} READ, {} WRITE, {reads} answers", count("write"));
    assert!(told.last().unwrap().ends_with(&same), "{told:?}, not {same}");
}

#[test]
fn without_descriptors_a_subcommand_says_so_in_one_line_and_moves_nothing() {
    let (bus, port) = sim("ikeya --node 1:velocity");
    let (rover, robot) = sim("ucp");
    let path = fresh("none.pcapng");
    for args in [
        format!("scan -p {port}"),
        format!("spin -p {port} -n 1 --rps 2 -f 0.2 --record {path}"),
        format!("drive -p {robot} --speed 20 --turn 0 -f 0.2 --record {path}"),
        format!("record -p {robot} -P ucp -f 0.2 -o {path}"),
        format!("watch -p {robot} -P ucp --plain -f 0.2"),
        "sim ucp -f 0.2".to_owned(),
    ] {
        // One more than the three of every program: for the libraries, and then for the port. The
        // program that runs the tests may have left one open.
        let mut limited = behind("exec 3>&-; ulimit -n 4;", &args);
        let complaint = Process::spawn(&mut limited).unwrap().complaint(1);
        assert!(complaint.contains("Too many open files"), "{args}: {complaint}");
        assert!(complaint.starts_with("cannot "), "{args}: {complaint}");
    }
    assert!(commands(&bus).is_empty(), "{:?}", bus.lines());
    assert!(commands(&rover).is_empty(), "{:?}", rover.lines());
}

#[test]
fn a_tool_that_gets_no_more_descriptors_while_it_moves_still_stops() {
    let (sim, port) = sim("ikeya --node 1:velocity");
    let spin = Process::start(&format!("spin -p {port} -n 1 --rps 2 -f 600"));
    sim.line("command 2.00 rps");
    let limit = format!("--pid={}", spin.id());
    let status = Command::new("prlimit").args([&limit, "--nofile=1"]).status();
    if status.is_err() {
        eprintln!("skipped: there is no prlimit");
        return;
    }
    assert!(status.unwrap().success());
    spin.signal("INT");
    assert!(spin.success().last().unwrap().ends_with("stopped and confirmed"));
    assert!(commands(&sim).last().unwrap().ends_with("command 0.00 rps"));
}

#[test]
fn a_tool_that_was_started_without_terminal_input_and_output_turns_and_stops_its_motor() {
    let (sim, port) = sim("ikeya --node 1:velocity");
    let spin = format!("spin -p {port} -n 1 --rps 2 -f 1");
    let closed = behind("exec <&- >&- 2>&-;", &spin).status().unwrap();
    assert_eq!(closed.code(), Some(0));
    let commands = commands(&sim);
    let is_told = |rps: &str| commands.iter().any(|line| line.ends_with(rps));
    assert!(is_told("command 2.00 rps") && commands.last().unwrap().ends_with(" 0.00 rps"));
}
