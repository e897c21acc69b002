//! `axle watch`: shows the traffic on a line, without sending anything.

use std::{
    net::UdpSocket,
    time::{Duration, Instant, SystemTime, UNIX_EPOCH},
};

use serde_json::Value;

use super::{
    Process,
    played::{PlayedLine, parrot},
    sim,
    support::{Capture, axle, decode, file, run, stdout, terminal::Terminal},
};

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
    let line = parrot(&[]);
    let mut watch = vec![];
    for protocol in ["ikeya", "ikeya-3"] {
        let process = Process::start(&format!("watch --port {} --protocol {protocol}", line.path));
        process.line("0 bytes");
        process.signal("INT");
        watch.extend(process.success());
    }
    assert!(watch.last().unwrap().starts_with("Nothing was heard"), "{watch:?}");
    assert!(line.lock().is_empty());

    let (sim, port) = sim("ucp --noise 0.01");
    let watch = Process::start(&format!("watch --port {port} --protocol ucp"));
    watch.line("crc ");
    sim.kill();
    let ended = watch.end();
    assert_eq!((ended.code, ended.stderr.len()), (Some(1), 1), "{ended:?}");
    assert!(ended.stderr[0].contains("disconnected"), "{ended:?}");
    let is_summed_up = ended.stdout.iter().any(|line| line.contains(" skipped: "));
    assert!(is_summed_up, "what was heard is not lost: {ended:?}");
}

#[test]
fn watch_prints_one_json_object_per_second_and_one_at_the_end() {
    let (_sim, port) = sim("ucp");
    let lines = Process::start(&format!("watch --port {port} -P ucp --json --for 2.5")).success();
    let records: Vec<Value> =
        lines.iter().map(|line| serde_json::from_str(line).unwrap()).collect();
    let events: Vec<_> = records.iter().map(|record| record["event"].clone()).collect();
    assert_eq!(events, ["second", "second", "summary"]);
    let [.., summary] = &records[..] else { panic!("{lines:?}") };
    let of_report = |message: &&Value| message["message"] == "report" && message["id"] == 5;
    let messages = summary["messages"].as_array().unwrap();
    let report = messages.iter().find(of_report).expect("reports");
    let sum: u64 = messages.iter().map(|message| message["count"].as_u64().unwrap()).sum();
    assert_eq!(summary["frames"], sum);
    assert_eq!(summary["skipped"], 0);
    assert!(report["last"].as_str().unwrap().contains("battery"), "{report}");
    let rate = report["per_second"].as_f64().unwrap();
    assert!((30.0..70.0).contains(&rate), "{rate}");
}

#[test]
fn the_beginning_of_a_frame_is_skipped_once_the_line_is_quiet() {
    // Once, when the tool listens.
    let (mut said, begin) = (false, Instant::now());
    let line = PlayedLine::new((), move |_, _| {
        let is_time = !said && begin.elapsed() >= Duration::from_millis(500);
        said |= is_time;
        // Of a packet of 8 bytes.
        if is_time { vec![0x55, 0x01, 0x00] } else { Vec::new() }
    });
    let watch = format!("watch -p {} -P ikeya --json -f 1", line.path);
    let lines = Process::start(&watch).success();
    let summary: Value = serde_json::from_str(lines.last().unwrap()).unwrap();
    let counts = ["received", "skipped", "pending"].map(|count| summary[count].as_u64());
    assert_eq!(counts, [Some(3), Some(3), Some(0)], "{summary}");
}

#[test]
fn watch_ends_after_a_time_or_a_number_of_frames() {
    let (_sim, port) = sim("ucp");
    let counted = Process::start(&format!("watch --port {port} -P ucp --count 10")).success();
    assert!(counted.last().unwrap().contains("0 skipped"), "{counted:?}");
    let timed = Process::start(&format!("watch --port {port} -P ucp --for 0.2")).success();
    assert!(timed.iter().any(|line| line.starts_with("   5  report")), "{timed:?}");
}

#[test]
fn watch_records_all_that_it_counts() {
    let (_sim, port) = sim("ucp --noise 0.001");
    let path = file("watched.pcapng", &[]);
    std::fs::remove_file(&path).unwrap();
    let path = path.to_str().unwrap();
    let args = format!("watch --port {port} -P ucp --json --for 1.5 --record {path}");
    let watched = Process::start(&args).success();
    let watched: Value = serde_json::from_str(watched.last().unwrap()).unwrap();
    let recorded = stdout(axle(&["watch", path, "--json"]).output().unwrap());
    let recorded: Value = serde_json::from_str(recorded.trim()).unwrap();
    assert!(watched["frames"].as_u64().unwrap() > 30, "{watched}");
    assert_eq!(
        (&recorded["frames"], &recorded["received"]),
        (&watched["frames"], &watched["received"],)
    );
}

#[test]
fn watch_sums_a_capture_up() {
    let capture = Capture::noisy(50_000, 7);
    let (_, listed) = decode(&["--protocol", "ucp"], &capture.bytes);
    let summed = stdout(run(&["watch", "-P", "ucp", "--json", "-"], &capture.bytes));
    let summed: Value = serde_json::from_str(&summed).unwrap();
    for field in ["received", "framed", "frames", "skipped", "skipped_by"] {
        assert_eq!(summed[field], listed[field], "{field}");
    }
    let table = stdout(run(&["watch", "--protocol", "ucp", "-"], &capture.bytes));
    assert!(table.starts_with("  id  message"), "{table}");
    assert!(table.contains("   1  ping") && table.contains("   2  motor_control"), "{table}");
}

#[test]
fn watch_refuses_a_command_line_without_a_source_or_a_protocol() {
    let complaint = |args: &[&str]| {
        let output = run(args, &[]);
        assert_eq!(output.status.code(), Some(2), "{output:?}");
        let text = String::from_utf8(output.stderr).unwrap();
        assert_eq!(text.lines().count(), 1, "{text}");
        text
    };
    assert!(complaint(&["watch"]).contains("--port"));
    assert!(complaint(&["watch", "--port", "x"]).contains("--protocol"));
    assert!(complaint(&["watch", "--port", "x", "-P", "ucp", "file"]).contains("cannot be used"));
    assert!(complaint(&["watch", "-"]).contains("--protocol is needed"));
    assert!(complaint(&["watch", "-", "-P", "ucp", "--record", "x"]).contains("--record"));
}

#[test]
fn plain_lines_and_json_are_lines_on_a_terminal_too() {
    let (_sim, port) = sim("ucp");
    for (option, expected) in [("--plain", "5  report"), ("--json", r#""event":"summary""#)] {
        let args = format!("watch --port {port} --protocol ucp {option} --for 0.3");
        let mut watch = Terminal::start(&args, (200, 40));
        assert_eq!(watch.code(), Some(0), "{option}");
        watch.row(expected);
        assert!(!watch.has_had_page(), "{option} shows the page");
    }
}

/// A line of JSON without its place: sender and recording begin at different moments.
fn contents(line: &str) -> Value {
    let mut line: Value = serde_json::from_str(line).unwrap();
    let fields = line.as_object_mut().unwrap();
    for place in ["offset", "t", "interface", "direction"] {
        fields.remove(place);
    }
    line
}

#[test]
fn watch_sends_what_decode_says_of_the_recording() {
    let socket = UdpSocket::bind("127.0.0.1:0").unwrap();
    socket.set_read_timeout(Some(Duration::from_millis(300))).unwrap();
    let to = socket.local_addr().unwrap();
    let path = std::env::temp_dir().join(format!("axle-udp-{}.pcapng", std::process::id()));
    let (_sim, port) = sim("ucp --noise 0.001");
    let from = SystemTime::now().duration_since(UNIX_EPOCH).unwrap().as_secs_f64();
    let args = format!("watch -p {port} -P ucp --plain --for 1 --udp {to} --record");
    let watch = Process::start(&format!("{args} {}", path.display()));
    let (mut sent, mut buffer) = (vec![], [0; 4096]);
    while let Ok(len) = socket.recv(&mut buffer) {
        sent.push(String::from_utf8(buffer[..len].to_vec()).unwrap());
    }
    watch.success();
    let listing = stdout(axle(&["decode", "--json", path.to_str().unwrap()]).output().unwrap());
    std::fs::remove_file(path).unwrap();
    let mut said: Vec<_> = listing.lines().map(contents).collect();
    assert_eq!(said.pop().unwrap()["event"], "summary");
    assert!(said.len() > 30, "{said:?}");
    let of_sent: Vec<_> = sent.iter().map(|line| contents(line)).collect();
    // A pause ends a gap when watched; a recording does not know how long it was.
    let frames = |of: &[Value]| -> Vec<Value> {
        of.iter().filter(|line| line["event"] == "frame").cloned().collect()
    };
    assert_eq!(frames(&of_sent), frames(&said));
    let skipped = |of: &[Value]| -> u64 {
        let gaps = of.iter().filter(|line| line["event"] == "skipped");
        gaps.map(|gap| gap["length"].as_u64().unwrap()).sum()
    };
    assert_eq!(skipped(&of_sent), skipped(&said));
    // One moment is taken for both.
    let times_of_frames = |of: &mut dyn Iterator<Item = &str>| -> Vec<f64> {
        let lines = of.map(|line| serde_json::from_str::<Value>(line).unwrap());
        let frames = lines.filter(|line| line["event"] == "frame");
        frames.map(|line| line["t"].as_f64().unwrap()).collect()
    };
    let of_datagrams = times_of_frames(&mut sent.iter().map(String::as_str));
    assert_eq!(of_datagrams, times_of_frames(&mut listing.lines()));
    let first: Value = serde_json::from_str(&sent[0]).unwrap();
    assert!(first["direction"] == "in" && first["interface"].is_null(), "{first}");
    let times = sent.iter().map(|line| {
        let line: Value = serde_json::from_str(line).unwrap();
        line["t"].as_f64().unwrap() - from
    });
    assert!(times.clone().is_sorted() && times.clone().all(|t| (0.0..20.0).contains(&t)));
}

#[test]
fn watch_goes_on_although_nobody_listens_to_its_datagrams() {
    let unheard = UdpSocket::bind("127.0.0.1:0").unwrap().local_addr().unwrap();
    let (_sim, port) = sim("ucp");
    let args = format!("watch -p {port} -P ucp --json --for 0.6 --udp {unheard}");
    let summary: Value =
        serde_json::from_str(Process::start(&args).success().last().unwrap()).unwrap();
    assert!(summary["frames"].as_u64().unwrap() > 10, "{summary}");
    let kept = UdpSocket::bind("127.0.0.1:0").unwrap();
    // And although nobody takes them.
    let args =
        format!("watch -p {port} -P ucp --json --for 0.6 --udp {}", kept.local_addr().unwrap());
    let summary: Value =
        serde_json::from_str(Process::start(&args).success().last().unwrap()).unwrap();
    assert!(summary["frames"].as_u64().unwrap() > 10, "{summary}");
}

#[test]
fn a_host_that_cannot_be_found_is_told_before_the_watch_begins() {
    let line = parrot(&[]);
    for host in ["host.invalid:9870", "127.0.0.1", "127.0.0.1:port"] {
        let args = ["watch", "-p", &line.path, "-P", "ucp", "--plain", "--udp", host];
        let output = run(&args, &[]);
        let said = String::from_utf8(output.stderr).unwrap();
        assert_eq!((output.status.code(), said.lines().count()), (Some(1), 1), "{said}");
        assert!(said.starts_with(&format!("axle: cannot send to {host:?}: ")), "{said}");
        assert!(output.stdout.is_empty());
    }
    let output = run(&["watch", "-", "-P", "ucp", "--udp", "127.0.0.1:9870"], &[]);
    assert_eq!(output.status.code(), Some(2));
}

#[test]
fn the_page_sends_datagrams_too() {
    let socket = UdpSocket::bind("127.0.0.1:0").unwrap();
    socket.set_read_timeout(Some(Duration::from_secs(10))).unwrap();
    let (_sim, port) = sim("ucp");
    let to = socket.local_addr().unwrap();
    let args = format!("watch --port {port} --protocol ucp --for 1 --udp {to}");
    let mut watch = Terminal::start(&args, (80, 24));
    let mut buffer = [0; 4096];
    for _ in 0..10 {
        let len = socket.recv(&mut buffer).unwrap();
        let line: Value = serde_json::from_slice(&buffer[..len]).unwrap();
        assert!(line["event"] == "frame" && line["t"].as_f64().unwrap() > 1e9, "{line}");
    }
    assert_eq!(watch.code(), Some(0));
    assert!(watch.has_had_page());
}
