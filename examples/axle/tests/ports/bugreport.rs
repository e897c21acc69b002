//! `axle bugreport` with a line, and on a terminal.

use std::{
    fs,
    os::unix::fs::symlink,
    time::{Duration, Instant},
};

use super::{
    Process,
    played::PlayedLine,
    record::{decoded, fresh},
    sim,
    support::{run, stdout, terminal::Terminal},
};

const SIZE: (u16, u16) = (200, 40);

/// The text in a report.
fn text(path: &str) -> String {
    stdout(run(&["bugreport", "--show", path], &[]))
}

#[test]
fn a_report_has_what_was_heard_and_nothing_was_sent() {
    let read = [0xAA, 0x01, 0xBE, 0xD0];
    let line = PlayedLine::new(Vec::<u8>::new(), move |heard, bytes| {
        heard.lock().unwrap().extend(bytes);
        read.to_vec()
    });
    // The name of the port is not to be trusted either.
    let port = fresh("link").replace("link", "\x1b[2Jjane");
    let _ = fs::remove_file(&port);
    symlink(&line.path, &port).unwrap();
    let path = fresh("heard.pcapng.gz");
    let args = format!("bugreport --yes -p {port} -P ikeya -b 57600 -f 0.3 -o {path}");
    let ended = Process::start(&args).end();
    assert_eq!(ended.code, Some(0), "{ended:?}");
    assert!(line.lock().is_empty(), "nothing was sent");
    let (events, summary) = decoded(&path);
    assert!(events.len() > 3 && events.iter().all(|event| event["message"] == "read_request"));
    let text = text(&path);
    let received = format!("{:>10} bytes received\n", summary["received"].as_u64().unwrap());
    assert!(text.contains(&received) && text.contains(", ikeya, 57600 bit/s, heard for 0.3 s:"));
    assert!(!text.contains("jane") && !text.contains('\x1b'), "{text}");
    let shown = ended.stderr.join("\n");
    assert!(shown.contains(&text) && !shown.contains('\x1b'), "{shown}");
}

#[test]
fn ctrl_c_ends_the_listening_early_and_the_report_goes_on() {
    let (_sim, port) = sim("ucp");
    let path = fresh("early.pcapng.gz");
    let report = Process::start(&format!("bugreport --yes -p {port} -P ucp -f 600 -o {path}"));
    super::wait_until("listening", || !report.complaints().is_empty());
    std::thread::sleep(Duration::from_millis(500));
    let begin = Instant::now();
    report.signal("INT");
    let ended = report.end();
    assert!(ended.code == Some(0) && begin.elapsed() < Duration::from_secs(30), "{ended:?}");
    assert!(decoded(&path).0.len() > 5);
}

#[test]
fn a_port_that_fails_is_in_the_report_with_what_came_before() {
    let (sim, port) = sim("ucp");
    let path = fresh("failed.pcapng.gz");
    let report = Process::start(&format!("bugreport --yes -p {port} -P ucp -f 600 -o {path}"));
    super::wait_until("listening", || !report.complaints().is_empty());
    std::thread::sleep(Duration::from_millis(500));
    sim.kill();
    let ended = report.end();
    assert_eq!(ended.code, Some(1), "{ended:?}");
    assert!(text(&path).contains("\nThe port failed: disconnected"), "{}", text(&path));
    assert!(decoded(&path).0.len() > 5);
}

#[test]
fn on_a_terminal_only_a_yes_writes_the_file_and_the_text_is_the_one_that_was_shown() {
    let (_sim, port) = sim("ucp");
    for (answer, is_written) in [("y\n", true), ("Yes\n", true), ("\n", false), ("n\n", false)] {
        let path = fresh("asked.pcapng.gz");
        let args = format!("bugreport -p {port} -P ucp -f 0.3 -o {path}");
        let mut report = Terminal::start(&args, SIZE);
        report.row("? [y/N]");
        assert!(!fs::exists(&path).unwrap(), "it has asked only");
        report.press(answer);
        let left = report.end();
        assert_eq!(
            (left.code, fs::exists(&path).unwrap()),
            (Some(i32::from(!is_written)), is_written)
        );
        assert!(is_written != left.text.contains("axle: nothing was written"), "{left:?}");
        if is_written {
            let rows: Vec<_> = left.text.lines().map(str::trim_end).collect();
            assert!(text(&path).lines().all(|line| rows.contains(&line.trim_end())), "{left:?}");
        }
    }
}

#[test]
fn a_signal_instead_of_an_answer_ends_the_tool_and_nothing_is_written() {
    let (_sim, port) = sim("ucp");
    for args in ["", &format!("-p {port} -P ucp -f 0.1")] {
        let path = fresh("unanswered.pcapng.gz");
        let mut report = Terminal::start(&format!("bugreport -o {path} {args}"), SIZE);
        report.row("? [y/N]");
        report.signal("INT");
        assert_eq!(report.code(), None, "the signal ended it");
        assert!(!fs::exists(&path).unwrap());
    }
}
