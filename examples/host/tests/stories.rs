//! The captures with a story: they are what `stories` writes, and `axle decode` finds in them what
//! happened.
#![cfg(all(unix, feature = "sim"))]

mod support;

use std::{collections::BTreeMap, fs, path::Path, process::Command};

use serde_json::Value;

const CAPTURES: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../captures");

/// What `axle decode --json` says of a capture.
struct Decoded {
    /// Frames and gaps, in the order of their times.
    lines: Vec<Line>,
    summary: Value,
}

/// A frame or a gap.
struct Line {
    /// Seconds since the beginning of the story.
    at: f64,
    value: Value,
}

impl Line {
    fn text(&self, field: &str) -> &str {
        self.value[field].as_str().unwrap_or_default()
    }

    /// The number in this field; NaN if there is none.
    fn number(&self, field: &str) -> f64 {
        self.value[field].as_f64().unwrap_or(f64::NAN)
    }

    fn is(&self, message: &str) -> bool {
        self.value["message"] == message
    }
}

fn decode(name: &str) -> Decoded {
    let path = format!("{CAPTURES}/{name}.pcapng");
    let output = support::axle(&["decode", "--json", &path]).output().unwrap();
    assert_eq!((output.status.code(), &*output.stderr), (Some(0), &b""[..]));
    let text = String::from_utf8(output.stdout).unwrap();
    let mut lines: Vec<Line> = Vec::new();
    let mut summary = Value::Null;
    for line in text.lines() {
        let value: Value = serde_json::from_str(line).unwrap();
        match value["t"].as_f64() {
            // The stories begin on 1 January 2026 at 8:00 UTC.
            Some(seconds) => lines.push(Line { at: seconds - 1_767_254_400.0, value }),
            None => summary = value,
        }
    }
    lines.sort_by(|one, other| one.at.total_cmp(&other.at));
    Decoded { lines, summary }
}

impl Decoded {
    /// Number of frames of each kind: direction, message, count.
    fn kinds(&self) -> Vec<(&str, &str, usize)> {
        let mut kinds = BTreeMap::new();
        for line in self.lines.iter().filter(|line| line.value["event"] == "frame") {
            *kinds.entry((line.text("direction"), line.text("message"))).or_insert(0) += 1;
        }
        kinds.into_iter().map(|((direction, message), count)| (direction, message, count)).collect()
    }

    /// Time, direction and reason of each gap.
    fn gaps(&self) -> Vec<(f64, &str, &str)> {
        let gaps = self.lines.iter().filter(|line| line.value["event"] == "skipped");
        gaps.map(|line| (line.at, line.text("direction"), line.text("reason"))).collect()
    }

    /// The frames of these messages, between these times.
    fn frames(&self, messages: &[&str], from: f64, to: f64) -> Vec<&Line> {
        let is_one = |line: &&Line| messages.iter().any(|message| line.is(message));
        self.lines.iter().filter(|line| (from..to).contains(&line.at)).filter(is_one).collect()
    }

    /// The frames of these messages of a node, between these times.
    fn of_node(&self, node: u64, messages: &[&str], from: f64, to: f64) -> Vec<&Line> {
        let frames = self.frames(messages, from, to).into_iter();
        frames.filter(|line| line.value["node"] == node).collect()
    }
}

const ANSWERS: [&str; 2] = ["velocity_response", "position_response"];
const EVER: f64 = f64::INFINITY;

// The models call `exp`, whose last bit is a matter of the system.
#[cfg(target_os = "linux")]
#[test]
fn the_captures_are_what_the_program_writes_byte_for_byte() {
    let folder = std::env::temp_dir().join(format!("stories-{}", std::process::id()));
    fs::create_dir_all(&folder).unwrap();
    let run = Command::new(env!("CARGO_BIN_EXE_stories")).arg(&folder).output().unwrap();
    assert!(run.status.success(), "{run:?}");
    let mut names: Vec<_> =
        fs::read_dir(&folder).unwrap().map(|entry| entry.unwrap().file_name()).collect();
    names.sort();
    assert_eq!(names, ["drive.pcapng", "motors.pcapng"]);
    for name in names {
        let written = fs::read(folder.join(&name)).unwrap();
        let kept = fs::read(Path::new(CAPTURES).join(&name)).unwrap();
        assert!(kept.len() < 150_000, "{name:?} has {} bytes", kept.len());
        // Not assert_eq, which would print them all.
        assert!(
            written == kept,
            "{name:?}: cargo run -p host-examples --features sim --bin \
            stories -- examples/captures"
        );
    }
    fs::remove_dir_all(folder).unwrap();
}

#[test]
fn a_folder_that_is_missing_or_not_given_is_one_line_and_leaves_no_file() {
    let missing = std::env::temp_dir().join(format!("no-stories-{}", std::process::id()));
    let run = Command::new(env!("CARGO_BIN_EXE_stories")).arg(&missing).output().unwrap();
    let told = String::from_utf8(run.stderr).unwrap();
    assert_eq!((run.status.code(), told.lines().count()), (Some(1), 1), "{told}");
    assert!(told.contains("cannot write") && told.contains("motors.pcapng"), "{told}");
    assert!(!missing.exists());
    let run = Command::new(env!("CARGO_BIN_EXE_stories")).output().unwrap();
    assert_eq!(run.status.code(), Some(1));
    assert_eq!(String::from_utf8(run.stderr).unwrap(), "Error: \"which folder?\"\n");
}

#[test]
fn every_byte_of_the_motors_is_in_a_frame_or_in_a_gap_with_its_reason() {
    let motors = decode("motors");
    let expected = [
        ("in", "position_response", 362),
        ("in", "velocity_response", 512),
        ("out", "read_request", 994),
        ("out", "write", 950),
    ];
    assert_eq!(motors.kinds(), expected);
    let summary = &motors.summary;
    assert_eq!((&summary["frames"], &summary["pending"]), (&2818.into(), &0.into()));
    let skipped = serde_json::json!({"header": 255, "id": 8, "crc": 29});
    assert_eq!((&summary["skipped"], &summary["skipped_by"]), (&292.into(), &skipped));
    assert!(motors.lines.is_sorted_by(|one, other| one.at <= other.at));
    let end = motors.lines.last().unwrap().at;
    assert!((10.2..10.3).contains(&end), "{end}");
}

#[test]
fn node_3_falls_silent_still_turns_when_it_is_back_and_is_stopped_before_it_is_driven_again() {
    let motors = decode("motors");
    let answers = |from, to| motors.of_node(3, &ANSWERS, from, to);
    assert_eq!(answers(2.0, 3.2).len(), 0);
    // It is asked all the time, the others answer.
    assert!(motors.of_node(3, &["read_request"], 2.0, 3.2).len() > 10);
    for other in [1, 2, 4, 5, 6, 7, 8] {
        assert!(motors.of_node(other, &ANSWERS, 2.0, 3.2).len() >= 9, "node {other}");
    }
    let back = answers(3.2, 4.0);
    assert!((back[0].number("rps") - 1.5).abs() < 0.01, "{}", back[0].value);
    assert!(back.last().unwrap().number("rps") < 0.2);
    let writes = motors.of_node(3, &["write"], 2.2, 4.0);
    assert!(!writes.is_empty() && writes.iter().all(|write| write.number("rps") == 0.0));
    assert_eq!(motors.of_node(3, &["write"], 4.0, 4.1)[0].number("rps"), 1.5);
    assert!(answers(4.2, 4.4)[0].number("rps") > 1.0);
}

#[test]
fn noise_damages_answers_for_six_tenths_of_a_second_and_a_board_with_a_wrong_id_speaks_once() {
    let motors = decode("motors");
    let gaps = motors.gaps();
    assert!(gaps.iter().all(|(_, direction, _)| *direction == "in"), "{gaps:?}");
    let (noise, others): (Vec<_>, Vec<_>) =
        gaps.iter().partition(|(at, ..)| (4.4..5.05).contains(at));
    let with = |wanted: &str| noise.iter().filter(|(_, _, reason)| *reason == wanted).count();
    assert_eq!((noise.len(), with("crc"), with("header")), (25, 20, 5));
    let [(at, _, reason)] = others[..] else { panic!("{others:?}") };
    assert!((6.2..6.21).contains(&at) && reason == "id", "{others:?}");
}

#[test]
fn node_6_answers_late_once_and_all_other_answers_are_on_time() {
    let motors = decode("motors");
    let mut asked = BTreeMap::new();
    let mut late = Vec::new();
    for line in &motors.lines {
        let node = line.value["node"].as_u64();
        if line.is("read_request") {
            asked.insert(node, line.at);
        } else if ANSWERS.iter().any(|answer| line.is(answer)) {
            // Without the 160 us of the answer itself.
            let response_us = (line.at - asked[&node]) * 1e6 - 160.0;
            match response_us {
                0.0..100.0 => {}
                _ => late.push((node, line.at, response_us)),
            }
        }
    }
    let [(Some(6), at, response_us)] = late[..] else { panic!("{late:?}") };
    assert!((5.6..5.75).contains(&at) && (500.0..1000.0).contains(&response_us), "{late:?}");
}

#[test]
fn the_driver_of_node_4_reports_no_number_for_a_second_while_it_has_a_fault() {
    let motors = decode("motors");
    let mut faults = motors.frames(&["velocity_response"], 0.0, EVER);
    faults.retain(|line| line.text("rps") == "nan");
    assert_eq!(faults.len(), motors.of_node(4, &ANSWERS, 7.0, 8.0).len());
    assert!(faults.len() >= 7, "{}", faults.len());
    assert!(faults.iter().all(|line| line.value["node"] == 4 && (7.0..8.0).contains(&line.at)));
    let next = motors.of_node(4, &ANSWERS, 8.0, EVER)[0].number("rps");
    assert!(next < 1.5, "it has coasted: {next}");
}

#[test]
fn at_the_end_every_motor_is_told_twice_to_stop_and_does() {
    let motors = decode("motors");
    for node in 1..=4 {
        let writes = motors.of_node(node, &["write"], 9.0, EVER);
        assert!(writes.len() >= 2 && writes.iter().all(|it| it.number("rps") == 0.0), "{node}");
        let last = motors.of_node(node, &ANSWERS, 9.0, EVER).pop().unwrap().number("rps");
        assert!(last.abs() < 0.05, "node {node}: {last} rps");
    }
    for node in 5..=8 {
        let writes = motors.of_node(node, &["write"], 9.0, EVER);
        let counts = |it: &Line| it.number("rotation") * 8192.0 + it.number("count");
        let held: Vec<f64> = writes.iter().map(|it| counts(it)).collect();
        assert!(held.len() >= 2 && held.iter().all(|it| *it == held[0]), "node {node}: {held:?}");
        let last = motors.of_node(node, &ANSWERS, 9.0, EVER).pop().unwrap();
        assert_eq!(counts(last), held[0], "node {node}");
    }
}

#[test]
fn every_byte_of_the_drive_is_in_a_frame_or_in_a_gap_with_its_reason() {
    let drive = decode("drive");
    let expected = [
        ("in", "bias_request", 1),
        ("in", "pong", 85),
        ("in", "report", 849),
        ("out", "biases", 1),
        ("out", "motor_control", 221),
        ("out", "network_state", 3),
        ("out", "ping", 87),
    ];
    assert_eq!(drive.kinds(), expected);
    let summary = &drive.summary;
    assert_eq!((&summary["frames"], &summary["pending"]), (&1247.into(), &0.into()));
    let skipped = serde_json::json!({"header": 343, "crc": 7});
    assert_eq!((&summary["skipped"], &summary["skipped_by"]), (&350.into(), &skipped));
    let end = drive.lines.last().unwrap().at;
    assert!((17.9..18.0).contains(&end), "{end}");
}

#[test]
fn the_plug_damages_bytes_around_a_silence_of_most_of_a_second() {
    let drive = decode("drive");
    let reasons: Vec<_> = drive.gaps().iter().map(|(_, way, reason)| (*way, *reason)).collect();
    assert_eq!(reasons, [("in", "crc"); 5]);
    let received: Vec<_> =
        drive.lines.iter().filter(|line| line.text("direction") == "in").collect();
    let is_long = |pair: &&[&Line]| pair[1].at - pair[0].at > 0.1;
    let silences: Vec<_> = received.windows(2).filter(is_long).collect();
    let [&[before, after]] = silences[..] else { panic!("{} silences", silences.len()) };
    assert!((8.6..8.7).contains(&before.at) && (9.55..9.6).contains(&after.at));
    // Those that were lost are missing in the counter.
    let reports = drive.frames(&["report"], 0.0, EVER);
    let step = |pair: &[&Line]| (pair[1].number("index") - pair[0].number("index")) as i64 as u8;
    let lost: u32 = reports.windows(2).map(|pair| u32::from(step(pair)) - 1).sum();
    assert_eq!(lost, 51);
}

#[test]
fn the_robot_stops_by_itself_and_the_host_resumes_when_the_link_has_lasted() {
    let drive = decode("drive");
    let wheels = |from, to| -> Vec<i64> {
        let reports = drive.frames(&["report"], from, to);
        reports.iter().map(|report| report.value["rpm"][0].as_i64().unwrap()).collect()
    };
    let speeds = |from, to| -> Vec<f64> {
        let commands = drive.frames(&["motor_control"], from, to);
        commands.iter().map(|command| command.number("speed")).collect()
    };
    assert!(wheels(8.4, 8.65).iter().all(|rpm| *rpm > 80));
    // It hears nothing, while the host goes on until the link is down, half a second later.
    assert!(speeds(8.65, 9.16).iter().all(|speed| *speed == 70.0));
    assert!(speeds(9.16, 10.3).iter().all(|speed| *speed == 0.0));
    let back = wheels(9.55, 10.3);
    assert!(back.len() > 30 && back.iter().all(|rpm| *rpm < 6), "{back:?}");
    assert_eq!(back.last(), Some(&0));
    assert_eq!(speeds(10.3, 10.5), [70.0, 70.0]);
    assert!(wheels(11.0, 12.0).iter().all(|rpm| *rpm > 80));
}

#[test]
fn the_drive_has_turns_a_lamp_a_network_and_a_battery_that_sinks() {
    let drive = decode("drive");
    let reports = drive.frames(&["report"], 0.0, EVER);
    let (first, last) = (reports[0], reports[reports.len() - 1]);
    let ends = |field| (first.number(field), last.number(field));
    assert_eq!((ends("battery_pct"), ends("voltage_dv")), ((60.0, 59.0), (114.0, 113.0)));
    assert!(last.value["rpm"] == serde_json::json!([0, 0, 0, 0]));
    let headings: Vec<_> = reports.iter().map(|report| report.number("heading")).collect();
    let quarters: Vec<_> =
        (0..4).filter(|it| headings.iter().any(|at| (*at as i32) / 90 == *it)).collect();
    assert_eq!(quarters, [0, 1, 2, 3]);
    let turns = |report: &&&Line| report.value["gyro"][2].as_i64().unwrap();
    assert!(reports.iter().map(|it| turns(&it)).max().unwrap() > 0);
    assert!(reports.iter().map(|it| turns(&it)).min().unwrap() < 0);
    let lamps: Vec<_> = drive
        .frames(&["motor_control"], 0.0, EVER)
        .iter()
        .map(|command| command.number("front_led"))
        .collect();
    assert!(lamps.contains(&0.0) && lamps.contains(&100.0));
    let states: Vec<_> = drive
        .frames(&["network_state"], 0.0, EVER)
        .iter()
        .map(|state| state.number("state"))
        .collect();
    assert_eq!(states, [2.0, 3.0, 3.0]); // told again when the link is back
}
