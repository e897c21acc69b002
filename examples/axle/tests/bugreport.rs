//! `axle bugreport` without a line: what is in the file, and what is not.

mod support;

use std::{fs, path::PathBuf, process::Output};

use serde_json::Value;
use support::{axle, decode, file, pcapng::PcapNg, run, stdout};

/// A path in the build directory at which there is no file.
fn fresh(name: &str) -> String {
    let path = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(name);
    let _ = fs::remove_file(&path);
    path.to_str().unwrap().to_owned()
}

/// Standard error of a run with this exit code.
fn told(output: Output, code: i32) -> String {
    let stderr = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(code), "{stderr}");
    stderr
}

/// Writes a bug report to a file of this name; returns its path and its text.
fn report(name: &str, args: &[&str]) -> (String, String) {
    let path = fresh(name);
    let args = [&["bugreport", "--yes", "-o", &path], args].concat();
    let shown = told(run(&args, &[]), 0);
    let text = stdout(run(&["bugreport", "--show", &path], &[]));
    assert!(shown.starts_with(&text), "the text was shown before: {shown}");
    (path, text)
}

/// The rows of a file from this time on: what they are, and not what is known from rows before.
fn rows(path: &str, from: f64) -> Vec<[Value; 6]> {
    let (mut rows, _) = decode(&[path], &[]);
    rows.retain(|row| row["t"].as_f64().unwrap() >= from);
    let keys = ["t", "interface", "direction", "length", "message", "bytes"];
    rows.iter().map(|row| keys.map(|key| row[key].clone())).collect()
}

#[test]
fn without_a_line_the_report_has_the_tool_the_system_and_the_ports() {
    let (path, text) = report("report.pcapng.gz", &[]);
    let version = env!("CARGO_PKG_VERSION");
    let (os, arch) = (std::env::consts::OS, std::env::consts::ARCH);
    let begins = format!("axle {version} for {os} on {arch}, 20");
    assert!(text.starts_with(&begins) && text.contains("dashboard o"), "{text}");
    let ports = stdout(run(&["ports"], &[])).lines().count() - 1;
    let (_, listed) = text.split_once("\nSerial ports, without serial numbers:\n").unwrap();
    assert_eq!(listed.lines().count(), ports);
    let summary = stdout(run(&["decode", &path], &[]));
    assert_eq!(summary, "The input is empty: 0 bytes received, 0 frames.\n");
    assert!(fs::read(&path).unwrap().starts_with(&[0x1F, 0x8B]), "it is packed");
}

#[test]
fn the_end_of_a_capture_decodes_to_the_same_rows_and_the_statistics_are_of_all_of_it() {
    for name in ["drive", "motors"] {
        let capture = format!("{}/../captures/{name}.pcapng", env!("CARGO_MANIFEST_DIR"));
        let all = rows(&capture, 0.0);
        let end = all.last().unwrap()[0].as_f64().unwrap();
        for seconds in ["1.5", "60"] {
            let args = ["--capture", &capture, "--for", seconds];
            let (path, text) = report(&format!("{name}-{seconds}.pcapng.gz"), &args);
            let summary = stdout(run(&["decode", "--summary", &capture], &[]));
            assert!(text.contains(summary.lines().next().unwrap()), "{text}");
            let expected = rows(&capture, end - seconds.parse::<f64>().unwrap());
            let found = rows(&path, 0.0);
            assert!(found == expected && found.len() > 100, "{name} {seconds}: {}", found.len());
            assert_eq!(found.len() == all.len(), seconds == "60");
        }
    }
}

#[test]
fn the_lines_of_a_capture_stay_apart_and_keep_their_speed_but_not_their_names() {
    let mut capture = PcapNg::new(147, &[(1_000_000, 0, &[0xAA])]);
    for name in ["/dev/\x1b[2Jjane", "/home/jane/bus-A5XK\x07", "tcp:jane.example:1"] {
        capture.named(150, name);
    }
    // Two lines, each with half a frame, of which one begins before the last minute.
    let read = [0xAA, 0x01, 0xBE, 0xD0];
    capture.packet(2, (70_000_000, 1, &[0xFD, 0xFF]));
    capture.packet(0, (100_000_000, 2, &read));
    capture.packet(3, (u64::MAX, 1, &[1]));
    capture.packet(2, (101_000_000, 1, &[2]));
    let source = file("lines.pcapng", &capture.0);
    let (path, text) = report("lines.pcapng.gz", &["--capture", source.to_str().unwrap()]);
    assert!(text.contains("1 packet has an impossible time"), "{text}");
    assert!(text.contains("\nOf its last 60 s: 8 bytes in 4 packets\n"), "{text}");
    let output = run(&["decode", "--json", &path], &[]);
    let (events, summary) = support::events(&String::from_utf8(output.stdout).unwrap());
    assert_eq!((&summary["frames"], &summary["received"]), (&1.into(), &8.into()));
    let lines: Vec<_> = events.iter().map(|event| event["interface"].as_u64().unwrap()).collect();
    assert!(events.len() == 3 && (0..3).all(|line| lines.contains(&line)), "{events:?}");
    // The input is read as a capture, and written as one with the plain names.
    let unpacked = unpacked(&path);
    let has = |text: &str| unpacked.windows(text.len()).any(|part| part == text.as_bytes());
    assert!(has("bus") && has("tty0") && has("tcp") && !has("jane") && !has("A5XK"));
    assert!(!unpacked.contains(&0x1B) && !unpacked.contains(&0x07));
}

#[test]
fn what_came_before_the_clock_was_set_back_is_not_the_end_of_a_capture() {
    let mut capture = PcapNg::new(147, &[(1_000_000_000, 0, &[0xAA])]);
    capture.packet(0, (2_000_000_000, 0, &[0xAA, 0xAA]));
    capture.packet(0, (500_000_000, 0, &[0xAA; 4]));
    capture.packet(0, (510_000_000, 0, &[0xAA; 4]));
    let source = file("back.pcapng", &capture.0);
    let (_, text) = report("back.pcapng.gz", &["--capture", source.to_str().unwrap()]);
    assert!(text.contains("1 times the clock went backwards"), "{text}");
    assert!(text.contains("\nOf its last 60 s: 8 bytes in 2 packets\n"), "{text}");
}

/// The capture in a packed file.
fn unpacked(path: &str) -> Vec<u8> {
    let mut bytes = Vec::new();
    let file = fs::File::open(path).unwrap();
    std::io::Read::read_to_end(&mut flate2::read::GzDecoder::new(file), &mut bytes).unwrap();
    bytes
}

#[test]
fn a_damaged_capture_gives_what_can_be_read_and_its_problem() {
    let mut capture = PcapNg::new(147, &[(1_000_000, 1, &[0xAA, 0x01, 0xBE, 0xD0])]);
    capture.0.extend([6, 0, 0, 0, 7, 0, 0, 0]);
    let source = file("jane.pcapng", &capture.0);
    let (path, text) = report("damaged.pcapng.gz", &["--capture", source.to_str().unwrap()]);
    assert!(text.contains("\nIt cannot be read to its end: invalid pcapng block at byte "));
    assert!(!text.contains("jane"), "{text}");
    assert_eq!(rows(&path, 0.0).len(), 1);
}

#[test]
fn the_report_does_not_say_whose_machine_it_is() {
    let home = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join("janehome");
    fs::create_dir_all(&home).unwrap();
    let capture = home.join("janefile.pcapng");
    fs::copy(concat!(env!("CARGO_MANIFEST_DIR"), "/../captures/motors.pcapng"), &capture).unwrap();
    let path = fresh("whose.pcapng.gz");
    let args = ["bugreport", "--yes", "-o", &path, "--capture", capture.to_str().unwrap()];
    let mut tool = axle(&args);
    for name in ["HOME", "USER", "LOGNAME", "USERNAME", "HOSTNAME", "SOME_TOKEN"] {
        tool.env(name, home.join(format!("jane{name}")));
    }
    told(tool.current_dir(&home).output().unwrap(), 0);
    let unpacked = unpacked(&path);
    let has = |text: &str| unpacked.windows(text.len()).any(|part| part == text.as_bytes());
    assert!(has("Serial ports") && !has("jane") && !has(env!("CARGO_TARGET_TMPDIR")));
    let host = fs::read_to_string("/proc/sys/kernel/hostname").unwrap_or_default();
    // A name such as "linux" would be in it anyway.
    assert!(host.trim().len() < 8 || !has(host.trim()), "{host}");
}

#[test]
fn without_a_terminal_and_without_yes_nothing_is_written() {
    let path = fresh("refused.pcapng.gz");
    let line = told(run(&["bugreport", "-o", &path], b"y\n"), 2);
    assert!(line.starts_with("axle: there is no terminal to ask on: with --yes"), "{line}");
    assert!(!fs::exists(&path).unwrap());
}

#[test]
fn a_file_that_is_there_is_not_replaced() {
    let path = file("there.gz", b"of use to somebody");
    let args = ["bugreport", "--yes", "-o", path.to_str().unwrap()];
    let line = told(run(&args, &[]), 1);
    assert!(line.starts_with(&format!("axle: cannot create {path:?}")), "{line}");
    assert_eq!(fs::read(&path).unwrap(), b"of use to somebody");
    let to_a_pipe = told(run(&["bugreport", "--yes", "-o", "-"], &[]), 2);
    assert!(to_a_pipe.contains("name a file"), "{to_a_pipe}");
}

#[test]
fn what_cannot_be_written_is_told_in_front_of_the_listening() {
    let folder = fresh("no_such_folder");
    // The port is not there either: it would be told first, if it were opened first.
    for (path, says) in
        [(format!("{folder}/x.pcapng.gz"), "cannot create"), (fresh("x.txt"), "it is packed")]
    {
        let args = ["bugreport", "-p", "/no/port", "-P", "ucp", "--yes", "-o", &path];
        let output = run(&args, &[]);
        let line = String::from_utf8(output.stderr).unwrap();
        assert!(!output.status.success() && line.contains(says), "{line}");
    }
}

#[cfg(unix)]
#[test]
fn a_link_that_leads_nowhere_is_a_file_that_is_there() {
    let path = fresh("link.pcapng.gz");
    std::os::unix::fs::symlink("/no/such/file", &path).unwrap();
    let line =
        told(run(&["bugreport", "-p", "/no/port", "-P", "ucp", "--yes", "-o", &path], &[]), 1);
    assert!(line.starts_with(&format!("axle: cannot create {path:?}")), "{line}");
}

#[test]
fn what_has_no_times_is_refused_and_so_is_what_is_no_file() {
    let raw = concat!(env!("CARGO_MANIFEST_DIR"), "/../captures/ucp.bin");
    for (capture, code, says) in
        [(raw, 2, "raw bytes have no times"), (env!("CARGO_MANIFEST_DIR"), 1, "is not a file")]
    {
        let path = fresh("no-times.gz");
        let args = ["bugreport", "--yes", "-o", &path, "--capture", capture];
        let line = told(run(&args, &[]), code);
        assert!(line.starts_with("axle: ") && line.contains(says), "{line}");
        assert!(!fs::exists(&path).unwrap());
    }
}

#[test]
fn the_text_of_a_hostile_file_is_shown_without_control_sequences() {
    let mut capture = PcapNg(Vec::new());
    let text = b"one\n\x1b[2J\xFFtwo\r";
    let header = [&0x1A2B_3C4D_u32.to_le_bytes()[..], &[1, 0, 0, 0], &[0xFF; 8]].concat();
    let option = [&[1, 0, text.len() as u8, 0][..], text, &[0; 3]].concat();
    capture.block(0x0A0D_0D0A, &[header, option].concat());
    let path = file("hostile.pcapng", &capture.0);
    let shown = stdout(run(&["bugreport", "--show", path.to_str().unwrap()], &[]));
    assert_eq!(shown, "one\n\u{FFFD}[2J\u{FFFD}two\u{FFFD}");
    for (bytes, says) in [(&PcapNg::new(147, &[]).0[..], "has no text"), (&[0; 8], "invalid")] {
        let path = file("textless.pcapng", bytes);
        let line = told(run(&["bugreport", "--show", path.to_str().unwrap()], &[]), 1);
        assert!(line.contains(says), "{line}");
    }
}
