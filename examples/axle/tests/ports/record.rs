//! `axle record`: the traffic of a line, with times, in a file that is always complete.

use std::{
    fs,
    io::Read,
    path::PathBuf,
    process::{Command, Stdio},
    sync::atomic::{AtomicU32, Ordering},
};

use axlewire::ikeya::{NodeId, Rps, three};
use serde_json::Value;

use super::{Process, TWO_NODES, played::PlayedLine, sim, support::axle};

/// A file that does not exist yet, in the build directory.
pub(crate) fn fresh(name: &str) -> String {
    static COUNT: AtomicU32 = AtomicU32::new(0);
    let count = COUNT.fetch_add(1, Ordering::SeqCst);
    let name = format!("{}-{count}-{name}", std::process::id());
    let path = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(name);
    let _ = fs::remove_file(&path);
    path.to_str().unwrap().to_owned()
}

/// The events and the summary of a recording; fails unless it is complete.
pub(crate) fn decoded(path: &str) -> (Vec<Value>, Value) {
    let lines = Process::start(&format!("decode --json {path}")).success();
    let mut lines: Vec<Value> =
        lines.iter().map(|line| serde_json::from_str(line).unwrap()).collect();
    let summary = lines.pop().unwrap();
    (lines, summary)
}

/// Checks that each frame of a rover's line is a report, in order and with times.
fn assert_reports(events: &[Value]) {
    let t = |event: &Value| event["t"].as_f64().unwrap();
    assert!(events.is_sorted_by_key(t));
    let is_frame = |event: &&Value| event["event"] == "frame";
    let index = |event: &Value| event["index"].as_u64().unwrap();
    let frames: Vec<_> = events.iter().filter(is_frame).collect();
    assert!(frames.iter().all(|frame| frame["direction"] == "in"), "{events:?}");
    let reports: Vec<_> = frames.into_iter().filter(|frame| frame["message"] == "report").collect();
    assert!(reports.windows(2).all(|pair| (index(pair[0]) + 1) % 256 == index(pair[1])));
    assert!(reports.len() > 5, "{reports:?}");
}

#[test]
fn a_recording_has_every_frame_with_its_time() {
    let (_sim, port) = sim("ucp");
    let path = fresh("rover.pcapng");
    let told =
        Process::start(&format!("record --port {port} --protocol ucp --for 0.5 --output {path}"));
    let told = told.success();
    let (events, summary) = decoded(&path);
    assert_reports(&events);
    assert_eq!(told[0], format!("{:>10} bytes received", summary["received"].as_u64().unwrap()));
    // Each frame is a packet of its own, as Wireshark wants it.
    let file = fs::read(&path).unwrap();
    let (mut packets, mut at) = (0, 0);
    while let Some(block) = file.get(at..at + 8) {
        packets += u64::from(block[0] == 6);
        at += u32::from_le_bytes(block[4..].try_into().unwrap()) as usize;
    }
    assert_eq!(packets, summary["frames"].as_u64().unwrap());
}

#[test]
fn a_recording_has_the_speed_of_its_line() {
    let (_sim, port) = sim("ucp");
    for (args, expected) in [("", 115_200), (" --baud 57600", 57_600_u64)] {
        let path = fresh("speed.pcapng");
        Process::start(&format!("record -p {port} -P ucp -f 0.1 -o {path}{args}")).success();
        let file = fs::read(&path).unwrap();
        // Option 8 of the interface, eight bytes long.
        let option = [&[8, 0, 8, 0][..], &expected.to_le_bytes()].concat();
        assert!(file.windows(option.len()).any(|part| part == option), "{file:?}");
    }
}

#[test]
fn a_recording_that_a_signal_ends_is_complete() {
    let (_sim, port) = sim("ucp");
    for signal in ["INT", "TERM", "HUP"] {
        let path = fresh("signal.pcapng");
        let record = Process::start(&format!("record -p {port} -P ucp -o {path}"));
        super::wait_until("a kilobyte", || fs::metadata(&path).is_ok_and(|file| file.len() > 1000));
        record.signal(signal);
        record.success();
        assert_reports(&decoded(&path).0);
    }
}

#[test]
fn a_recording_in_several_files_loses_nothing_between_them() {
    let (_sim, port) = sim("ucp");
    let path = fresh("set.pcapng");
    let told =
        Process::start(&format!("record -p {port} -P ucp -o {path} --rotate 10kB -f 3")).success();
    let stem = path.strip_suffix(".pcapng").unwrap();
    let (folder, stem) = stem.rsplit_once('/').unwrap();
    let mut paths: Vec<_> = fs::read_dir(folder).unwrap().map(|it| it.unwrap().path()).collect();
    paths.retain(|path| path.file_name().unwrap().to_str().unwrap().starts_with(stem));
    paths.sort();
    let last = paths.last().unwrap();
    assert!(paths.len() > 1, "{paths:?}");
    let files = format!("{:>10} files, the last is {last:?}", paths.len());
    assert_eq!(told.last(), Some(&files));
    let events: Vec<_> = paths.iter().flat_map(|it| decoded(it.to_str().unwrap()).0).collect();
    assert_reports(&events);
    for no_name in ["-", "/dev/null", "target/"] {
        let to = format!("record -p {port} -P ucp -o {no_name} --rotate 10kB");
        let error = Process::start(&to).complaint(2);
        assert!(error.contains("is no name for them"), "{error}");
    }
}

#[test]
fn a_recording_of_an_unplugged_port_is_complete() {
    let (sim, port) = sim("ucp");
    let path = fresh("unplugged.pcapng");
    let record = Process::start(&format!("record -p {port} -P ucp -o {path}"));
    super::wait_until("a kilobyte", || fs::metadata(&path).is_ok_and(|file| file.len() > 1000));
    sim.kill();
    let error = record.complaint(1);
    assert!(error.starts_with(&format!("port {port:?} failed: disconnected")), "{error}");
    assert_reports(&decoded(&path).0);
}

/// The tool, for which the system refuses to let a file grow beyond 4 kB.
pub(super) fn with_little_disk(args: &str) -> Command {
    with_disk(4, args)
}

fn with_disk(kilobytes: u32, args: &str) -> Command {
    let args: Vec<_> = args.split(' ').collect();
    let axle = axle(&args);
    let mut limited = Command::new("bash");
    limited.args(["-c", &format!("ulimit -f {kilobytes}; exec \"$0\" \"$@\"")]);
    limited.arg(axle.get_program()).args(axle.get_args());
    limited
}

#[test]
fn what_was_recorded_before_the_disk_is_full_stays_readable() {
    let (_sim, port) = sim("ucp");
    let path = fresh("full.pcapng");
    let record = format!("record -p {port} -P ucp -o {path}");
    let mut limited = with_little_disk(&record);
    let ended = Process::spawn(&mut limited).unwrap().end();
    assert!(ended.stdout.iter().any(|line| line.contains(" bytes received")), "{ended:?}");
    let [error] = &ended.stderr[..] else { panic!("{ended:?}") };
    let error = error.strip_prefix("axle: ").unwrap();
    let says = format!("cannot write {path:?}: File too large (os error 27); the ");
    assert!(error.starts_with(&says) && error.ends_with("packets in it are complete"), "{error}");
    let (events, _) = decoded(&path);
    assert_reports(&events);
    let packets = events.len().to_string();
    assert!(error.contains(&format!("the {packets} packets")), "{error} {packets}");
}

#[test]
fn a_recording_that_fails_is_told_with_the_outcome_and_beside_another_failure() {
    let (_sim, port) = sim(TWO_NODES);
    let path = fresh("outcome.pcapng");
    let spin = format!("spin -p {port} -n 1 --rps 2 -f 1 -j --record {path}");
    let ended = Process::spawn(&mut with_little_disk(&spin)).unwrap().end();
    let outcome: Value = serde_json::from_str(ended.stdout.last().unwrap()).unwrap();
    assert_eq!(outcome["at_rest"], true);
    assert!(outcome["failure"].as_str().unwrap().starts_with("cannot write "), "{outcome}");
    let stop = format!("stop -p {port} -P ikeya -j --record /dev/full");
    let ended = Process::start(&stop).end();
    let outcome: Value = serde_json::from_str(ended.stdout.last().unwrap()).unwrap();
    assert_eq!((ended.code, &outcome["at_rest"]), (Some(1), &Value::Bool(true)));
    // The target is not reached in this time.
    let path = fresh("beside.pcapng");
    let spin = format!("spin -p {port} -n 3 --revolutions 1000 -f 1 --record {path}");
    let ended = Process::spawn(&mut with_little_disk(&spin)).unwrap().end();
    assert!(ended.stderr.iter().any(|line| line.contains("cannot write")), "{ended:?}");
    assert!(ended.stderr.iter().any(|line| line.contains("when the time was up")), "{ended:?}");
}

#[test]
fn a_recording_that_fails_decides_the_exit_code_of_each_subcommand() {
    let (_bus, bus) = sim("ikeya --node 1:velocity");
    let (_rover, rover) = sim("ucp");
    for args in [
        format!("scan -p {bus}"),
        format!("send -p {bus} -f 0.3 ikeya velocity 1 1"),
        format!("ping -p {rover} -c 3"),
        format!("lamp -p {rover} on"),
        format!("network -p {rover} connected"),
        format!("calibrate -p {rover} -k imu -f 0.1"),
        format!("drive -p {rover} --speed 10 --turn 0 -f 0.3"),
        format!("stop -p {rover} -P ucp"),
    ] {
        let path = fresh("little.pcapng");
        let mut limited = with_disk(1, &args.replacen(" -p", &format!(" --record {path} -p"), 1));
        let ended = Process::spawn(&mut limited).unwrap().end();
        assert_eq!((ended.code, ended.stderr.len()), (Some(1), 1), "{args}: {ended:?}");
        let says = format!("axle: cannot write {path:?}: File too large");
        assert!(ended.stderr[0].starts_with(&says), "{args}: {ended:?}");
        assert!(!ended.stdout.is_empty(), "{args}: what was done is told all the same");
    }
}

#[test]
fn a_recording_that_fails_does_not_end_a_watch() {
    let (_sim, port) = sim("ucp");
    let path = fresh("watch.pcapng");
    let watch = format!("watch -p {port} -P ucp --plain -f 1.5 --record {path}");
    let ended = Process::spawn(&mut with_little_disk(&watch)).unwrap().end();
    assert_eq!((ended.code, ended.stderr.len()), (Some(1), 1), "{ended:?}");
    assert!(ended.stdout.iter().any(|line| line.contains("  5  report")), "{ended:?}");
}

#[test]
fn a_signal_that_comes_twice_ends_a_recording_in_order() {
    let (_sim, port) = sim("ucp");
    for _ in 0..5 {
        let path = fresh("twice.pcapng");
        let record = Process::start(&format!("record -p {port} -P ucp -o {path}"));
        super::wait_until("a kilobyte", || fs::metadata(&path).is_ok_and(|file| file.len() > 1000));
        record.signal("TERM");
        record.signal("TERM");
        let ended = record.end();
        // It may have ended before the second one.
        assert_eq!((ended.code, ended.stdout.is_empty()), (Some(0), false), "{ended:?}");
    }
}

#[test]
fn a_file_that_is_there_is_not_overwritten_without_being_told() {
    let (_sim, port) = sim("ucp");
    let path = fresh("there.pcapng");
    // Longer than what is recorded over it.
    let before = "of use to somebody".repeat(5000);
    fs::write(&path, &before).unwrap();
    let record = format!("record -p {port} -P ucp --for 0.1 -o {path}");
    for tool in [
        record.clone(),
        format!("watch -p {port} -P ucp --plain --record {path}"),
        format!("drive -p {port} --speed 20 --turn 0 --record {path}"),
    ] {
        let error = Process::start(&tool).complaint(1);
        assert!(error.starts_with(&format!("cannot create {path:?}: File exists")), "{error}");
        assert_eq!(fs::read_to_string(&path).unwrap(), before);
    }
    Process::start(&format!("{record} --force")).success();
    decoded(&path);
}

#[test]
fn boards_with_three_motors_are_recorded_and_watched_as_such() {
    let answer = three::VelocityResponse::new(NodeId::N2, [Rps::ZERO; 3]);
    let line = PlayedLine::new((), move |_, _| answer.as_bytes().to_vec());
    let path = fresh("three.pcapng");
    let record = format!("record -p {} -P ikeya-3 -f 0.2 -o {path}", line.path);
    let told = Process::start(&record).success();
    assert_eq!(told.last().unwrap().trim(), "0 skipped", "{told:?}");
    let (events, summary) = decoded(&path);
    assert!(events.len() > 3 && summary["skipped"] == 0, "{summary}");
    assert!(events.iter().all(|event| event["rps"] == serde_json::json!([0.0, 0.0, 0.0])));
    let watch = format!("watch -p {} -P ikeya-3 -f 0.2 --json", line.path);
    let lines = Process::start(&watch).success();
    let summary: Value = serde_json::from_str(lines.last().unwrap()).unwrap();
    let message = &summary["messages"][0];
    assert_eq!((&message["node"], &message["last"]), (&2.into(), &"0.0 0.0 0.0 rps".into()));
    assert_eq!(summary["skipped"], 0);
}

#[test]
fn a_recording_can_be_piped() {
    let (_sim, port) = sim("ucp");
    let mut record = axle(&["record", "-p", &port, "-P", "ucp", "-f", "0.3", "-o", "-"])
        .stdout(Stdio::piped())
        .spawn()
        .unwrap();
    let decode = axle(&["decode", "--json"]).stdin(record.stdout.take().unwrap()).output().unwrap();
    assert!(record.wait().unwrap().success() && decode.status.success());
    let lines = String::from_utf8(decode.stdout).unwrap();
    let mut events: Vec<Value> =
        lines.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    events.pop();
    assert_reports(&events);
}

#[test]
fn two_tools_do_not_share_a_port() {
    let (_sim, port) = sim("ucp");
    let path = fresh("first.pcapng");
    let first = Process::start(&format!("record -p {port} -P ucp -o {path}"));
    super::wait_until("a kilobyte", || fs::metadata(&path).is_ok_and(|file| file.len() > 1000));
    let other = fresh("second.pcapng");
    for second in [
        format!("record -p {port} -P ucp -o {other}"),
        format!("watch -p {port} --protocol ucp"),
        format!("scan -p {port}"),
        format!("send -p {port} ucp ping"),
        format!("drive -p {port} --speed 1 --turn 0"),
        format!("stop -p {port} --protocol ucp"),
    ] {
        let error = Process::start(&second).complaint(1);
        assert_eq!(error, format!("cannot use port {port:?}: another program is using it"));
    }
    assert!(fs::metadata(&other).is_err(), "no empty file is left");
    first.signal("INT");
    first.success();
}

#[test]
fn every_subcommand_can_record_what_it_says_and_hears() {
    let (_sim, port) = sim(TWO_NODES);
    let path = fresh("spin.pcapng");
    Process::start(&format!("spin -p {port} --node 1 --rps 2 --for 1 --record {path}")).success();
    let (events, summary) = decoded(&path);
    assert_eq!(summary["skipped"], 0, "{summary}");
    let messages = |name: &str| -> Vec<&Value> {
        events.iter().filter(|event| event["message"] == name).collect()
    };
    assert!(messages("read_request").iter().all(|event| event["direction"] == "out"));
    let writes = messages("write");
    assert!(writes.iter().any(|event| event["rps"] == 2.0 && event["mode"] == "velocity"));
    assert_eq!(writes.last().unwrap()["rps"], 0.0);
    let answers = messages("velocity_response");
    assert!(answers.len() > 10 && answers.iter().all(|event| event["direction"] == "in"));
}

#[test]
fn a_recording_on_standard_output_is_there_at_once() {
    // One frame, and then silence; without a line break, on which pipes are often written.
    let ping = [0xFD, 0xFF, 0x04, 0x00, 0x01, 0x00, 0x01, 0x42];
    let line = PlayedLine::new(false, move |is_due, _| {
        let is_due = std::mem::replace(&mut *is_due.lock().unwrap(), false);
        if is_due { ping.to_vec() } else { Vec::new() }
    });
    let args = ["record", "--port", &line.path, "--protocol", "ucp", "--output", "-"];
    let mut record = axle(&args).stdout(Stdio::piped()).spawn().unwrap();
    let mut bytes = Vec::new();
    let mut output = record.stdout.take().unwrap();
    while !bytes.windows(ping.len()).any(|part| part == ping) {
        let mut byte = [0];
        output.read_exact(&mut byte).unwrap();
        bytes.extend(byte);
        if bytes.len() == 8 {
            // The tool has begun to record.
            *line.lock() = true;
        }
    }
    record.kill().unwrap();
    record.wait().unwrap();
}
