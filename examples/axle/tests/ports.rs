//! Two processes on a pseudo-terminal: one plays what hangs on the line, the other is used as a
//! newcomer would use it. Each test starts its own pair and ends both by their ids.
#![cfg(unix)]

mod support;

use std::{
    fs::{self, Permissions},
    io::{Read, Write},
    os::unix::{fs::MetadataExt, fs::PermissionsExt, process::CommandExt},
    sync::{
        Arc,
        atomic::{AtomicBool, Ordering},
    },
    thread::{self, JoinHandle},
    time::Duration,
};

use axlewire::{
    stream::Event,
    ucp::{self, Body, Message, Ping},
};
use serde_json::{Value, json};
use serialport::{SerialPort, TTYPort};
use support::{axle, process::Process};

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

/// A line that the test plays itself: everything that is sent on it, answered by `answer`.
struct Played {
    path: String,
    done: Arc<AtomicBool>,
    thread: JoinHandle<Vec<u8>>,
    _held: TTYPort,
}

impl Played {
    fn new(mut answer: impl FnMut() -> Vec<u8> + Send + 'static) -> Self {
        let (mut ours, held) = TTYPort::pair().unwrap();
        let done = Arc::new(AtomicBool::new(false));
        let is_done = Arc::clone(&done);
        ours.set_timeout(Duration::from_millis(20)).unwrap();
        let thread = thread::spawn(move || {
            let (mut heard, mut buffer) = (vec![], [0; 256]);
            while !is_done.load(Ordering::SeqCst) {
                if let Ok(len) = ours.read(&mut buffer) {
                    heard.extend(&buffer[..len]);
                    let _ = ours.write_all(&answer());
                }
            }
            heard
        });
        Self { path: held.name().unwrap(), done, thread, _held: held }
    }

    /// All that was heard.
    fn finish(self) -> Vec<u8> {
        self.done.store(true, Ordering::SeqCst);
        self.thread.join().unwrap()
    }
}

// scan

#[test]
fn scan_finds_the_nodes_with_their_modes() {
    let (_sim, port) = sim(TWO_NODES);
    let table = Process::start(&format!("scan --port {port}")).success();
    let rows: Vec<Vec<_>> = table.iter().map(|line| line.split_whitespace().collect()).collect();
    assert_eq!(rows[1], ["1", "velocity", "0000", "0010", "0.00", "rps"]);
    assert_eq!(rows[2], ["3", "position", "0101", "0111", "0.0000", "turns"]);
    assert_eq!((&*table[3], table.len()), ("2 nodes answer.", 4));

    let records = Process::start(&format!("scan --json --port {port}")).success();
    let records: Vec<Value> =
        records.iter().map(|line| serde_json::from_str(line).unwrap()).collect();
    let expected = [
        json!({"event": "node", "node": 1, "mode": "velocity", "rps": 0.0,
               "dip": {"value_plus_one": "0000", "value": "0010"}}),
        json!({"event": "node", "node": 3, "mode": "position", "count": 0, "rotation": 0,
               "dip": {"value_plus_one": "0101", "value": "0111"}}),
        json!({"event": "summary", "nodes": 2, "damaged": 0}),
    ];
    assert_eq!(records, expected);
}

#[test]
fn scan_finds_all_nodes_of_a_noisy_bus_every_time() {
    let nodes: String = (1..=8).map(|node| format!(" --node {node}:velocity")).collect();
    let (_sim, port) = sim(&format!("ikeya --noise 1e-4 --seed 7{nodes}"));
    for _ in 0..5 {
        let table = Process::start(&format!("scan --port {port}")).success();
        assert_eq!(table.last().unwrap(), "8 nodes answer.");
        // Node 8 has no switch under the reading that begins with 1 = 001.
        assert!(table[8].contains("1110") && table[8].contains("none"), "{table:?}");
    }
}

#[test]
fn a_bus_without_nodes_is_no_failure() {
    let line = Played::new(Vec::new);
    let lines = Process::start(&format!("scan --port {}", line.path)).success();
    assert_eq!(lines.len(), 1);
    assert!(lines[0].starts_with("No node answers on"), "{lines:?}");
    let heard = line.finish();
    assert_eq!(heard.len(), 24 * 4, "each id is asked three times");
    assert!(heard.chunks(4).all(|packet| packet[0] == 0xAA), "and nothing else is sent");
}

#[test]
fn a_node_that_answers_with_garbage_for_ever_is_named_and_does_not_hold_anybody_up() {
    let garbage = || vec![0x55, 0x01, 0x55, 0xAA, 0x00, 0xFF, 0x56, 0x03, 0x42, 0x55];
    let line = Played::new(garbage);
    let scan = Process::start(&format!("scan --port {}", line.path)).success();
    assert_eq!(scan.iter().filter(|line| line.contains("only damaged answers")).count(), 8);
    assert!(scan.last().unwrap().starts_with("No node answers on"), "{scan:?}");

    let spin = Process::start(&format!("spin --port {} --node 1 --rps 1", line.path));
    assert_eq!(spin.complaint(1), "node 1 does not answer; nodes that do: none");
    let heard = line.finish();
    assert!(!heard.contains(&0xBB), "nobody was commanded");
}

// spin

#[test]
fn spin_turns_the_motor_and_stops_it_at_the_end() {
    let (sim, port) = sim(TWO_NODES);
    let lines =
        Process::start(&format!("spin --port {port} --node 1 --rps -2.5 --for 1")).success();
    assert!(lines[0].contains("node 1: to turn at -2.50 rps"), "{lines:?}");
    let (stopped, measured) = lines[1..].split_last().unwrap();
    let measured = values(measured, "rps");
    assert!(!measured.is_empty() && measured.is_sorted_by(|a, b| a >= b), "{measured:?}");
    assert!(*measured.last().unwrap() < -2.0, "{measured:?}");
    assert!(stopped.ends_with("stopped and confirmed"), "{stopped}");

    sim.line("node 1: command -2.50 rps");
    sim.line("node 1: command 0.00 rps");
    sim.line("node 1: stands still");
    assert!(!sim.lines().iter().any(|line| line.contains("node 3")), "only node 1 was commanded");
}

#[test]
fn a_position_node_goes_on_from_where_it_stands() {
    let (sim, port) = sim(TWO_NODES);
    for expected in ["-0.7500", "-1.5000"] {
        let spin = format!("spin --port {port} --node 3 --revolutions -0.75 --for 1");
        let lines = Process::start(&spin).success();
        assert!(lines[0].contains(&format!("to go to {expected} turns")), "{lines:?}");
        assert!(lines.last().unwrap().contains(expected), "{lines:?}");
        sim.line(&format!("node 3: stands still at {expected} turns"));
    }
}

#[test]
fn a_position_node_under_way_is_stopped_where_it_is() {
    let (sim, port) = sim(TWO_NODES);
    let spin = format!("spin --port {port} --node 3 --revolutions 1000 --for 0.3");
    let lines = Process::start(&spin).success();
    sim.line("node 3: stands still");
    let commands: Vec<_> =
        sim.lines().into_iter().filter(|line| line.contains("command")).collect();
    let [goal, hold] = values(&commands, "turns")[..] else { panic!("{commands:?}") };
    assert_eq!(goal, 1000.0);
    assert!(hold > 0.0 && hold < 900.0, "neither on to the goal nor back to 0: {hold}");
    assert_eq!(values(&lines[lines.len() - 1..], "turns"), [hold]);
}

#[test]
fn ctrl_c_and_the_polite_kill_stop_the_motor_first() {
    let (sim, port) = sim("ikeya --node 1:velocity --noise 1e-4");
    for (signal, rps) in [("INT", "3.00"), ("TERM", "4.00"), ("HUP", "5.00")] {
        let spin = Process::start(&format!("spin --port {port} --node 1 --rps {rps} --for 600"));
        sim.line(&format!("node 1: command {rps} rps"));
        spin.signal(signal);
        let lines = spin.success();
        assert!(lines.last().unwrap().ends_with("stopped and confirmed"), "{lines:?}");
        let commands: Vec<_> =
            sim.lines().into_iter().filter(|line| line.contains("command")).collect();
        assert!(commands.last().unwrap().contains("0.00 rps"), "{commands:?}");
    }
}

#[test]
fn a_reader_that_goes_away_stops_the_motor_too() {
    let (sim, port) = sim(TWO_NODES);
    let args = format!("spin --port {port} --node 1 --rps 3 --for 600");
    let args: Vec<_> = args.split(' ').collect();
    let mut spin = axle(&args).stdout(std::process::Stdio::piped()).spawn().unwrap();
    let mut first = [0; 8];
    spin.stdout.take().unwrap().read_exact(&mut first).unwrap();
    sim.line("node 1: command 0.00 rps");
    assert_eq!(spin.wait().unwrap().code(), Some(0));
}

#[test]
fn a_port_that_vanishes_is_reported_with_what_it_means() {
    let (sim, port) = sim(TWO_NODES);
    let spin = Process::start(&format!("spin --port {port} --node 1 --rps 2 --for 600"));
    spin.line("to turn at");
    sim.kill();
    let line = spin.complaint(1);
    assert!(line.starts_with(&format!("port {port:?} has failed: it has vanished")), "{line}");
    assert!(line.ends_with("node 1 cannot be told to stop any more"), "{line}");
}

#[test]
fn a_node_that_falls_silent_is_reported_and_told_to_stop_all_the_same() {
    let (sim, port) = sim(TWO_NODES);
    let spin = Process::start(&format!("spin --port {port} --node 1 --rps 2 --for 600"));
    spin.line("to turn at");
    sim.line("node 1: command 2.00 rps");
    sim.signal("STOP");
    let line = spin.complaint(1);
    assert_eq!(
        line,
        "node 1 does not answer any more (nothing is heard): a stop was sent 5 times, unconfirmed"
    );
    // It was not deaf, only dumb.
    sim.signal("CONT");
    sim.line("node 1: command 0.00 rps");
}

#[test]
fn a_command_for_the_wrong_mode_or_an_unknown_node_moves_nothing() {
    let (sim, port) = sim(TWO_NODES);
    let cases = [
        ("--node 3 --rps 1", "node 3 is in position mode: use --revolutions"),
        ("--node 1 --revolutions 1", "node 1 is in velocity mode: use --rps"),
        ("--node 5 --rps 1", "node 5 does not answer; nodes that do: 1 (velocity), 3 (position)"),
    ];
    for (args, expected) in cases {
        let spin = Process::start(&format!("spin --port {port} {args}"));
        assert_eq!(spin.complaint(1), expected);
    }
    sim.signal("INT");
    let lines = sim.success();
    assert!(!lines.iter().any(|line| line.contains("command")), "{lines:?}");
    assert!(lines[1..].iter().all(|line| line.contains(" 0 WRITE")), "{lines:?}");
}

#[test]
fn the_watchdog_of_a_simulated_node_stops_it_when_its_master_dies() {
    let (sim, port) = sim("ikeya --node 1:velocity --watchdog 0.5");
    let spin = Process::start(&format!("spin --port {port} --node 1 --rps 2 --for 600"));
    sim.line("node 1: command 2.00 rps");
    spin.kill();
    sim.line("node 1: watchdog");
    sim.line("node 1: stands still");
    // What a killed program leaves behind does not keep the next one out.
    let again = Process::start(&format!("scan --port {port}")).success();
    assert_eq!(again.last().unwrap(), "1 node answers.");
}

// drive

#[test]
fn drive_moves_the_rover_and_stops_it_at_the_end() {
    let (sim, port) = sim("ucp --noise 1e-5");
    let lines =
        Process::start(&format!("drive --port {port} --speed 50 --turn 20 --for 1")).success();
    assert!(lines[0].ends_with("to drive: speed 50 %, turn 20 % right"), "{lines:?}");
    let (stopped, driving) = lines[1..].split_last().unwrap();
    let last = driving.last().unwrap();
    let rpm: Vec<i32> =
        last.split_whitespace().skip(3).take(4).map(|word| word.parse().unwrap()).collect();
    assert!(rpm[0] > rpm[1] && rpm[1] > 0, "to the right, the left wheels are faster: {last}");
    assert!(stopped.contains("rpm    0    0    0    0") && stopped.ends_with("stopped"));

    sim.line("command: speed 50 %, turn 20 % right");
    sim.line("command: speed 0 %, turn 0 %");
    sim.line("stands still after");
}

#[test]
fn ctrl_c_stops_the_rover_first() {
    let (sim, port) = sim("ucp");
    let drive = Process::start(&format!("drive --port {port} --speed -30 --turn -10 --for 600"));
    sim.line("command: speed -30 %, turn 10 % left");
    sim.line("moves");
    drive.signal("INT");
    assert!(drive.success().last().unwrap().ends_with("stopped"));
    let lines = sim.lines_up_to("stands still");
    assert!(lines.iter().any(|line| line.contains("command: speed 0 %")), "by command: {lines:?}");
    assert!(!lines.iter().any(|line| line.contains("watchdog")), "not by itself: {lines:?}");
}

#[test]
fn a_rover_whose_host_dies_stops_by_its_watchdog() {
    let (sim, port) = sim("ucp");
    let drive = Process::start(&format!("drive --port {port} --speed 60 --turn 0 --for 600"));
    sim.line("moves");
    drive.kill();
    sim.line("watchdog");
    sim.line("stands still");
}

#[test]
fn a_rover_that_vanishes_is_reported_with_what_it_means() {
    let (sim, port) = sim("ucp");
    let drive = Process::start(&format!("drive --port {port} --speed 60 --turn 0 --for 600"));
    sim.line("command: speed 60 %");
    sim.kill();
    let line = drive.complaint(1);
    assert!(line.starts_with(&format!("port {port:?} has failed: it has vanished")), "{line}");
    assert!(line.contains("cannot be told to stop any more"), "{line}");
}

#[test]
fn a_rover_that_falls_silent_is_told_to_stop_all_the_same() {
    let (sim, port) = sim("ucp");
    let drive = Process::start(&format!("drive --port {port} --speed 60 --turn 0 --for 600"));
    sim.line("moves");
    sim.signal("STOP");
    let line = drive.complaint(1);
    assert!(line.ends_with("to stop, and is not heard any more"), "{line}");
    sim.signal("CONT");
    sim.line("stands still");
}

#[test]
fn a_robot_that_never_answers_is_never_told_to_move() {
    let line = Played::new(Vec::new);
    let drive = Process::start(&format!("drive --port {} --speed 60 --turn 0", line.path));
    let complaint = drive.complaint(1);
    assert!(complaint.starts_with("no robot answers on"), "{complaint}");
    assert!(complaint.ends_with("nothing in 2 s"), "{complaint}");

    let (heard, mut pings) = (line.finish(), 0);
    let (mut decoder, mut bytes) = (ucp::Decoder::new(), &heard[..]);
    while let Some(event) = decoder.decode(&mut bytes) {
        let Event::Frame(frame) = event else { panic!("{event:?}") };
        assert!(matches!(frame.message(), Message::Ping(_)), "{frame:?}");
        pings += 1;
    }
    assert!(pings > 0);
}

#[test]
fn a_robot_that_talks_garbage_is_no_robot() {
    let line = Played::new(|| vec![0xFD, 0xFF, 0x28, 0x00, 0x05, 0x00, 0xFD]);
    let drive = Process::start(&format!("drive --port {} --speed 60 --turn 0", line.path));
    let complaint = drive.complaint(1);
    assert!(complaint.contains("bytes that are no message"), "{complaint}");
    line.finish();
}

#[test]
fn a_host_that_floods_is_still_served_afterwards() {
    let (sim, port) = sim("ucp");
    let mut flood = vec![0x5A; 60];
    flood.extend(Ping {}.frame(0).as_bytes());
    let mut host =
        serialport::new(&port, ucp::BAUD).timeout(Duration::from_secs(10)).open().unwrap();
    for _ in 0..2000 {
        host.write_all(&flood).unwrap();
    }
    drop(host);
    Process::start(&format!("drive --port {port} --speed 10 --turn 0 --for 0.2")).success();
    sim.line("command: speed 10 %");
    sim.signal("TERM");
    let lines = sim.success();
    let served: Vec<_> = lines.last().unwrap().split_whitespace().collect();
    let pings: u32 =
        served[served.iter().position(|word| *word == "pings,").unwrap() - 1].parse().unwrap();
    assert!(pings >= 2000, "none was lost: {pings}");
}

// watch

#[test]
fn watch_counts_the_messages_of_a_rover() {
    let (sim, port) = sim("ucp");
    let watch = Process::start(&format!("watch --port {port} --protocol ucp"));
    let line = watch.line("id 5 report");
    assert!(line.contains("skipped 0") || line.contains(", 0 skipped"), "{line}");
    watch.signal("INT");
    let lines = watch.success();
    let row = lines.iter().find(|line| line.starts_with("   5  report")).expect("the last table");
    assert!(row.contains("battery  99 %") || row.contains("battery 100 %"), "{row}");
    assert!(lines.last().unwrap().contains("0 skipped"), "{lines:?}");
    drop(sim);
}

#[test]
fn watch_sends_nothing_and_names_the_noise() {
    let line = Played::new(Vec::new);
    let mut watch = vec![];
    for protocol in ["ikeya", "ikeya-3"] {
        let process = Process::start(&format!("watch --port {} --protocol {protocol}", line.path));
        process.line("0 bytes");
        process.signal("INT");
        watch.extend(process.success());
    }
    assert!(watch.last().unwrap().starts_with("Nothing was heard"), "{watch:?}");
    assert!(line.finish().is_empty());

    let (sim, port) = sim("ucp --noise 0.01");
    let watch = Process::start(&format!("watch --port {port} --protocol ucp"));
    watch.line("crc ");
    sim.kill();
    let ended = watch.end();
    assert_eq!((ended.code, ended.stderr.len()), (Some(1), 1), "{ended:?}");
    assert!(ended.stderr[0].contains("it has vanished"), "{ended:?}");
    let is_summed_up = ended.stdout.iter().any(|line| line.contains(" skipped: "));
    assert!(is_summed_up, "what was heard is not lost: {ended:?}");
}

// Bad input

#[test]
fn a_wrong_value_is_explained_in_one_line_before_any_port_is_touched() {
    let cases = [
        ("spin --port /none --node 1 --rps NaN", "NaN is not a finite number"),
        ("spin --port /none --node 1 --rps inf", "inf is not a finite number"),
        ("spin --port /none --node 1 --rps 1e39", "inf is not a finite number"),
        ("spin --port /none --node 1 --rps fast", "it is no number"),
        ("spin --port /none --node 1 --revolutions nan", "NaN is not a finite number"),
        ("spin --port /none --node 1 --revolutions 32769", "outside -268443647..=268435455"),
        ("spin --port /none --node 0 --rps 1", "node id 0 is outside 1..=8"),
        ("spin --port /none --node 9 --rps 1", "node id 9 is outside 1..=8"),
        ("spin --port /none --node 1", "--rps <X>|--revolutions <X>"),
        ("spin --port /none --node 1 --rps 1 --revolutions 1", "cannot be used with"),
        ("spin --port /none --node 1 --rps 1 --for -1", "-1"),
        ("spin --port /none --node 1 --rps 1 --for NaN", "NaN s is not within 0..=86400 s"),
        ("spin --node 1 --rps 1", "--port <PATH>"),
        ("drive --port /none --speed 101 --turn 0", "101 is not in -100..=100"),
        ("drive --port /none --speed 0 --turn -101", "-101 is not in -100..=100"),
        ("drive --port /none --speed 0", "--turn <T>"),
        ("watch --port /none --protocol can", "[possible values: ucp, ikeya, ikeya-3]"),
        ("watch --port /none", "--protocol <PROTOCOL>"),
        ("scan --port /none --baud 0", "0 is not in 1..=4294967295"),
        ("scan --port /none --baud quick", "'quick'"),
        ("sim", "requires a subcommand"),
        ("sim ikeya", "--node <N:MODE>"),
        ("sim ikeya --node 1", "N:MODE, as in 1:velocity"),
        ("sim ikeya --node 1:torque", "a mode is velocity or position"),
        ("sim ikeya --node 9:velocity", "node id 9 is outside 1..=8"),
        ("sim ikeya --node 2:velocity --node 2:position", "node 2 is given twice"),
        ("sim ucp --noise 2", "2 is not within 0..=1"),
        ("sim ucp --noise NaN", "NaN is not within 0..=1"),
    ];
    for (args, expected) in cases {
        let line = Process::start(args).complaint(2);
        assert!(line.contains(expected), "{args:?} gives {line:?}");
        assert!(!line.starts_with("error") && !line.contains("Usage"), "{line:?}");
    }
}

const USERS: [&str; 4] =
    ["scan", "spin --node 1 --rps 1", "drive --speed 1 --turn 1", "watch --protocol ucp"];

#[test]
fn a_path_that_is_no_port_is_named() {
    let file = support::file("no_port", b"");
    let cases = [
        ("/no/such/port", "there is no such path"),
        (env!("CARGO_TARGET_TMPDIR"), "it is no serial port"),
        (file.to_str().unwrap(), "it is no serial port"),
        ("/dev/null", "it is no serial port"),
    ];
    for (path, cause) in cases {
        for user in USERS {
            let line = Process::start(&format!("{user} --port {path}")).complaint(1);
            assert_eq!(line, format!("cannot use port {path:?}: {cause}"));
        }
    }
}

#[test]
fn a_port_that_may_not_be_opened_is_named() {
    let (_sim, port) = sim(TWO_NODES);
    fs::set_permissions(&port, Permissions::from_mode(0o000)).unwrap();
    for user in USERS {
        let args = format!("{user} --port {port}");
        let args: Vec<_> = args.split(' ').collect();
        let mut command = axle(&args);
        if fs::metadata("/proc/self").is_ok_and(|process| process.uid() == 0) {
            // Root may open everything; nobody may not.
            command.uid(65_534);
        }
        let Ok(process) = Process::spawn(&mut command) else {
            eprintln!("skipped: another user cannot start the tool from here");
            return;
        };
        let line = process.complaint(1);
        assert!(
            line.starts_with(&format!("cannot use port {port:?}: permission denied")),
            "{line}"
        );
    }
}

#[test]
fn a_port_that_another_program_uses_is_left_to_it() {
    let (sim, port) = sim("ucp");
    let watch = Process::start(&format!("watch --port {port} --protocol ucp"));
    watch.line("report");
    for user in USERS {
        let line = Process::start(&format!("{user} --port {port}")).complaint(1);
        assert_eq!(line, format!("cannot use port {port:?}: another program is using it"));
    }
    assert!(!sim.lines().iter().any(|line| line.contains("command")));
}

// sim

#[test]
fn a_simulation_ends_well_when_it_is_asked_to() {
    for what in [TWO_NODES, "ucp"] {
        for signal in ["INT", "TERM"] {
            let (sim, _) = sim(what);
            sim.signal(signal);
            sim.success();
        }
    }
}

#[test]
fn help_tells_of_units_signs_and_exit_codes() {
    let cases = [
        ("--help", "Commands:"),
        ("scan --help", "--direct"),
        ("spin --help", "revolutions per second"),
        ("drive --help", "positive is to the right"),
        ("watch --help", "without sending anything"),
        ("sim --help", "pty: PATH"),
        ("sim ikeya --help", "N:MODE"),
        ("sim ucp --help", "--noise"),
    ];
    for (args, expected) in cases {
        let help = Process::start(args).success().join("\n");
        assert!(help.contains(expected), "{args}: {help}");
        assert!(help.contains("1  the input, the output or the port failed"), "{args}: {help}");
    }
}
