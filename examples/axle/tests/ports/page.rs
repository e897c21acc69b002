//! The page of `watch`, `spin` and `drive`, on a terminal that the test holds.

use std::{
    fs,
    process::Command,
    sync::{
        Arc,
        atomic::{AtomicBool, AtomicUsize, Ordering},
    },
    thread,
    time::Duration,
};

use axlewire::ikeya::{NodeId, ReadRequest, Rps, VelocityResponse};

use super::{
    Process, TWO_NODES,
    played::{self, Node, PlayedLine, confirmable_stops},
    record::{fresh, with_little_disk},
    sim,
    support::{axle, stdout, terminal::Terminal},
    wait_until,
};

const SIZE: (u16, u16) = (100, 30);

/// A bus that talks by itself: node 1 turns, node 2 never answers.
fn talking_bus() -> PlayedLine<()> {
    let read = |node| ReadRequest::new(node).as_bytes().to_vec();
    let answer = VelocityResponse::new(NodeId::N1, Rps::new(2.5).unwrap());
    let round = [read(NodeId::N1), answer.as_bytes().to_vec(), read(NodeId::N2)].concat();
    PlayedLine::new((), move |_, _| round.clone())
}

fn watch(port: &str, protocol: &str, size: (u16, u16)) -> Terminal {
    Terminal::start(&format!("watch --port {port} --protocol {protocol}"), size)
}

#[test]
fn the_page_shows_a_rover_and_the_terminal_is_clean_after_q() {
    let (_sim, port) = sim("ucp");
    let mut watch = watch(&port, "ucp", SIZE);
    let row = watch.row("reports/s");
    assert!(row.contains("link     up") && row.contains("0 lost"), "{row}");
    watch.row("battery");
    assert!(watch.text().lines().next().unwrap().contains(&port));
    watch.press("q");
    let left = watch.end();
    assert_eq!(left.code, Some(0), "{left:?}");
    // What was heard is summed up behind the page.
    assert!(left.text.contains("   5  report") && left.text.contains("0 skipped"), "{left:?}");
}

#[test]
fn the_page_shows_a_bus_with_one_row_per_node() {
    let bus = talking_bus();
    let mut watch = watch(&bus.path, "ikeya", SIZE);
    let row = watch.row("2.50 rps");
    assert!(row.starts_with("1    velocity ok"), "{row}");
    watch.row("2             silent");
    watch.press("?");
    watch.row("a USB adapter adds up");
    watch.press("?");
    watch.press("f");
    watch.row("f log: gaps");
    watch.press("f");
    watch.row("f log: node 1");
    watch.press("fff");
    watch.row("f log: gaps");
    watch.press("q");
    assert_eq!(watch.end().code, Some(0));
}

#[test]
fn a_paused_picture_stands_still_while_counting_goes_on() {
    let (_sim, port) = sim("ucp");
    let mut watch = watch(&port, "ucp", SIZE);
    watch.row("reports/s");
    watch.press("p");
    watch.row("PAUSED");
    let frozen = watch.text();
    thread::sleep(Duration::from_millis(500));
    assert_eq!(watch.text(), frozen);
    watch.press("p");
    let frames = |text: &str| -> u32 {
        let row = text.lines().nth(1).unwrap();
        row.split(' ').next().unwrap().parse().unwrap()
    };
    watch.wait("more frames", || frames(&watch.text()) > frames(&frozen) + 10);
    watch.press("q");
    assert_eq!(watch.end().code, Some(0));
}

#[test]
fn spin_shows_three_motors_on_the_page() {
    let (sim, port) = sim("ikeya-3 --node 1:velocity");
    let spin = format!("spin -P ikeya-3 -p {port} -n 1 --rps 1 -2 3 -f 600 --page");
    let mut spin = Terminal::start(&spin, SIZE);
    sim.line("node 1: command 1.00 -2.00 3.00 rps");
    spin.row("1.00 -2.00 3.00 rps");
    spin.press(" ");
    let left = spin.end();
    assert_eq!(left.code, Some(0), "{left:?}");
    assert!(left.text.contains("stopped and confirmed"), "{left:?}");
    sim.line("node 1: at rest");
}

#[test]
fn the_title_says_what_runs_where_the_load_is_that_of_the_line_and_the_locale_decides_on_blocks() {
    let bus = talking_bus();
    let (_sim, port) = sim("ikeya --node 1:velocity");
    let watch = format!("watch --port {} --protocol ikeya", bus.path);
    let spin = format!("spin -p {port} -n 1 --rps 2.5 -f 600 --page");
    for (line, title) in [
        (&watch, format!("axle watch  {}  ikeya  500000 bit/s", bus.path)),
        (&spin, format!("axle spin  {port}  ikeya  500000 bit/s")),
    ] {
        for (locale, is_ascii) in [("C.UTF-8", false), ("C", true)] {
            let words: Vec<_> = line.split_whitespace().collect();
            let mut page = Terminal::spawn(axle(&words).env("LC_ALL", locale), SIZE);
            page.row("2.50 rps");
            // Until there is a trend, and a rate.
            wait_until("a trend", || {
                let row = page.row("2.50 rps");
                row.chars().any(|it| "▁▂▃▄▅▆▇█".contains(it)) || is_ascii
            });
            let load = |page: &Terminal| -> u64 {
                let totals = page.row("load ");
                let load = totals.split_once("load ").unwrap().1;
                load.split_once(" %").unwrap().0.parse().unwrap()
            };
            wait_until("a rate", || load(&page) > 0);
            assert!(load(&page) <= 150, "{}", page.text());
            let text = page.text();
            assert!(text.starts_with(&title), "{text}");
            assert_eq!(text.is_ascii(), is_ascii, "{text}");
            page.press("q");
            assert_eq!(page.end().code, Some(0));
        }
    }
}

#[test]
fn a_recording_of_a_page_that_fails_is_told() {
    let (_sim, port) = sim(TWO_NODES);
    let path = fresh("page.pcapng");
    let spin = format!("spin -p {port} -n 1 --rps 2 -f 1 --page --record {path}");
    let left = Terminal::spawn(&mut with_little_disk(&spin), SIZE).end();
    assert_eq!(left.code, Some(1), "{left:?}");
    assert!(left.text.contains("cannot write"), "{left:?}");
    assert!(left.text.contains("stopped and confirmed"), "{left:?}");
}

#[test]
fn a_recording_that_fails_decides_the_exit_code_of_a_watch_that_goes_on() {
    let (_sim, port) = sim("ucp");
    let path = fresh("watched.pcapng");
    let watch = format!("watch -p {port} -P ucp --record {path}");
    let mut watch = Terminal::spawn(&mut with_little_disk(&watch), (200, 30));
    watch.row("cannot write");
    watch.press("q");
    let left = watch.end();
    assert_eq!(left.code, Some(1), "{left:?}");
    assert!(left.text.contains("   5  report"), "{left:?}");
    assert!(left.text.contains(&format!("axle: cannot write {path:?}")), "{left:?}");
}

#[test]
fn a_recording_is_switched_with_a_key_and_holds_what_was_received() {
    let directory = std::path::PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join("recordings");
    let _ = fs::remove_dir_all(&directory);
    fs::create_dir(&directory).unwrap();
    let (_sim, port) = sim("ucp");
    let args = ["watch", "--port", &port, "--protocol", "ucp"];
    let mut watch = Terminal::spawn(axle(&args).current_dir(&directory), SIZE);
    watch.row("reports/s");
    watch.press("r");
    watch.row("REC axle-");
    thread::sleep(Duration::from_millis(500));
    watch.press("r");
    watch.row("recorded to");
    watch.press("q");
    assert_eq!(watch.end().code, Some(0));
    let files: Vec<_> = fs::read_dir(&directory).unwrap().map(|file| file.unwrap()).collect();
    let [file] = &files[..] else { panic!("{files:?}") };
    let path = file.path();
    let listing = stdout(axle(&["decode", path.to_str().unwrap()]).output().unwrap());
    assert!(listing.matches("  report").count() >= 10, "{listing}");

    // A file from the command line is never replaced.
    let path = path.to_str().unwrap();
    let args = format!("watch --port {port} --protocol ucp --record {path}");
    let left = Terminal::start(&args, (200, 10)).end();
    assert_eq!(left.code, Some(1));
    assert!(left.text.starts_with("axle: cannot create"), "{left:?}");
    assert!(left.text.trim_end().ends_with("choose another name"), "{left:?}");
}

#[test]
fn the_page_survives_every_size() {
    let bus = talking_bus();
    let mut watch = watch(&bus.path, "ikeya", (20, 5));
    watch.row("1 ok        2.50 rps");
    for size in [(1, 1), (0, 0), (3, 2), (400, 100), (0, 5), (5, 0)] {
        watch.resize(size);
        thread::sleep(Duration::from_millis(250));
    }
    watch.resize(SIZE);
    let row = watch.row("2.50 rps");
    assert!(row.starts_with("1    velocity ok"), "{row}");
    watch.press("q");
    assert_eq!(watch.end().code, Some(0));
}

#[test]
fn every_signal_that_can_be_caught_leaves_the_terminal_clean() {
    let (_sim, port) = sim("ucp");
    for signal in ["INT", "TERM", "HUP", "QUIT", "USR1", "ALRM", "ABRT"] {
        let watch = watch(&port, "ucp", SIZE);
        watch.row("reports/s");
        watch.signal(signal);
        let left = watch.end();
        assert_eq!(left.code, Some(0), "{signal}: {left:?}");
        assert!(left.text.contains("0 skipped"), "{signal}: {left:?}");
    }
}

#[test]
fn ctrl_z_gives_the_terminal_back_and_the_page_comes_again() {
    let (_sim, port) = sim("ucp");
    let mut watch = watch(&port, "ucp", SIZE);
    watch.row("reports/s");
    for _ in 0..2 {
        watch.signal("TSTP");
        watch.wait("suspended", || watch.state() == 'T' && !watch.has_page());
        watch.assert_clean();
        watch.signal("CONT");
        watch.wait("the page", || watch.has_page());
        watch.row("reports/s");
    }
    watch.press("q");
    assert_eq!(watch.end().code, Some(0));
}

#[test]
fn a_port_that_disappears_is_one_clear_line_on_a_clean_terminal() {
    let (sim, port) = sim("ucp");
    let watch = watch(&port, "ucp", (120, 30));
    watch.row("reports/s");
    sim.kill();
    let left = watch.end();
    assert_eq!(left.code, Some(1), "{left:?}");
    let complaints: Vec<_> = left.text.lines().filter(|line| line.starts_with("axle: ")).collect();
    let [complaint] = complaints[..] else { panic!("{left:?}") };
    assert!(complaint.starts_with(&format!("axle: port {port:?} failed: disc")), "{left:?}");
    assert!(left.text.contains("   5  report"), "what was heard is not lost: {left:?}");
}

#[test]
fn a_port_in_use_is_one_clear_line_without_a_page() {
    let (_sim, port) = sim("ucp");
    let first = watch(&port, "ucp", SIZE);
    first.row("reports/s");
    let left = watch(&port, "ucp", (200, 10)).end();
    assert_eq!(left.code, Some(1), "{left:?}");
    assert_eq!(left.text.trim_end().lines().count(), 1, "{left:?}");
    assert!(left.text.starts_with("axle: ") && left.text.contains(&port), "{left:?}");
}

#[test]
fn each_stop_key_stops_the_motor_and_the_last_line_is_behind_the_page() {
    for key in [" ", "s", "q", "\x1b"] {
        let line = played::bus(&[Node::velocity(1)], |_, _| {});
        let args = format!("spin --page --port {} --node 1 --rps 2 --for 600", line.path);
        let mut spin = Terminal::start(&args, SIZE);
        let row = spin.row("2.00 rps ");
        assert!(row.contains("velocity ok"), "{row}");
        let before = line.said().len();
        spin.press(key);
        let left = spin.end();
        assert_eq!(left.code, Some(0), "{key:?}: {left:?}");
        let last = left.text.trim_end().lines().last().unwrap().to_owned();
        assert!(last.ends_with("0.00 rps, stopped and confirmed"), "{key:?}: {left:?}");
        let said = line.said();
        assert!(confirmable_stops(&said[before..], 1) >= 2, "{key:?}");
        assert_eq!(line.lock().strays, 0);
    }
}

#[test]
fn a_stop_key_stops_a_rover() {
    let line = played::rover(None);
    let args = format!("drive --page --port {} --speed 50 --turn 20 --for 600", line.path);
    let mut drive = Terminal::start(&args, SIZE);
    drive.row("command  speed 50 %, turn 20 % right");
    drive.press("s");
    let left = drive.end();
    assert_eq!(left.code, Some(0), "{left:?}");
    assert!(left.text.trim_end().ends_with("stopped"), "{left:?}");
    assert_eq!(line.lock().commands.last(), Some(&(0, 0)));
}

#[test]
fn a_terminal_that_takes_nothing_does_not_delay_the_stop() {
    let (sim, port) = sim(TWO_NODES);
    let args = format!("spin --page --port {port} --node 1 --rps 2 --for 600");
    let mut spin = Terminal::start(&args, (200, 60));
    sim.line("node 1: turning at 2.00 rps");
    spin.row("MOVING");
    spin.stall(true);
    // Whole pictures fill whatever there is between the tool and the terminal.
    for at in 0..12 {
        spin.resize((200 + at % 2, 60));
        thread::sleep(Duration::from_millis(120));
    }
    let is_waiting = || sim.lines().iter().any(|line| line.contains("command 0.00 rps"));
    assert!(!is_waiting(), "it still turns: {:?}", sim.lines());
    spin.press("s");
    let start = std::time::Instant::now();
    wait_until("the stop", is_waiting);
    assert!(start.elapsed() < Duration::from_millis(400), "{:?}", start.elapsed());
    sim.line("node 1: at rest");
    spin.stall(false);
    let left = spin.end();
    // The last lines may be lost on such a terminal; then the exit code says so.
    assert!(left.code == Some(0) || left.text.contains("stalled"), "{left:?}");
}

#[test]
fn a_terminal_that_takes_nothing_costs_the_watch_no_byte() {
    /// More than any buffer in between holds.
    const TOTAL: usize = 100_000;
    let read = ReadRequest::new(NodeId::N1);
    let answer = VelocityResponse::new(NodeId::N1, Rps::new(2.5).unwrap());
    let round = [read.as_bytes().as_slice(), answer.as_bytes()].concat();
    let piece = round.repeat(20);
    let total = TOTAL.next_multiple_of(piece.len());
    let (is_due, sent) = (Arc::new(AtomicBool::new(false)), Arc::new(AtomicUsize::new(0)));
    let (due, count) = (Arc::clone(&is_due), Arc::clone(&sent));
    let bus = PlayedLine::new((), move |_, _| {
        if !due.load(Ordering::SeqCst) || count.load(Ordering::SeqCst) >= total {
            return Vec::new();
        }
        count.fetch_add(piece.len(), Ordering::SeqCst);
        piece.clone()
    });
    let path = std::path::PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join("stalled.pcapng");
    let _ = fs::remove_file(&path);
    let path = path.to_str().unwrap();
    let args = format!("watch --port {} -P ikeya --record {path}", bus.path);
    let mut watch = Terminal::start(&args, (200, 60));
    watch.row("REC ");
    watch.stall(true);
    is_due.store(true, Ordering::SeqCst);
    wait_until("all is sent", || {
        let at = sent.load(Ordering::SeqCst);
        watch.resize((200 + (at / 500 % 2) as u16, 60));
        at == total
    });
    thread::sleep(Duration::from_millis(200));
    watch.stall(false);
    watch.row(&format!("{total} bytes"));
    watch.press("q");
    assert_eq!(watch.end().code, Some(0));
    let recorded = stdout(axle(&["watch", path, "--json"]).output().unwrap());
    let recorded: serde_json::Value = serde_json::from_str(recorded.trim()).unwrap();
    assert_eq!((&recorded["received"], &recorded["skipped"]), (&total.into(), &0.into()));
}

#[test]
fn a_terminal_that_goes_away_stops_the_motor() {
    let (sim, port) = sim(TWO_NODES);
    let args = format!("spin --page --port {port} --node 1 --rps 2 --for 600");
    let mut spin = Terminal::start(&args, SIZE);
    sim.line("node 1: turning at 2.00 rps");
    spin.hang_up();
    sim.line("node 1: command 0.00 rps");
    sim.line("node 1: at rest");
    assert!(spin.code().is_some());
}

#[test]
fn a_terminal_without_keys_that_goes_away_stops_the_motor_too() {
    let (sim, port) = sim(TWO_NODES);
    let args = format!("spin --page --port {port} --node 1 --rps 2 --for 600");
    let args: Vec<_> = args.split(' ').collect();
    let spin = axle(&args);
    let mut shell = Command::new("sh");
    shell.args(["-c", "exec \"$0\" \"$@\" < /dev/null"]).arg(spin.get_program());
    let mut spin = Terminal::spawn(shell.args(spin.get_args()), SIZE);
    sim.line("node 1: turning at 2.00 rps");
    spin.hang_up();
    sim.line("node 1: command 0.00 rps");
    sim.line("node 1: at rest");
    assert_eq!(spin.code(), Some(1));
}

#[test]
fn a_port_that_disappears_while_a_motor_turns_is_told_behind_the_page() {
    let (sim, port) = sim(TWO_NODES);
    let args = format!("spin --page --port {port} --node 1 --rps 2 --for 600");
    let spin = Terminal::start(&args, (200, 30));
    sim.line("node 1: turning at 2.00 rps");
    spin.row("MOVING");
    sim.kill();
    let left = spin.end();
    assert_eq!(left.code, Some(1), "{left:?}");
    let line = left.text.trim_end();
    assert!(line.starts_with(&format!("axle: port {port:?} failed: disconnected")), "{line}");
    assert!(line.contains("has not confirmed it: it may be moving"), "{line}");
    assert_eq!(line.lines().count(), 1, "{line}");
}

#[test]
fn ctrl_z_stops_the_motor_leaves_the_page_and_only_then_suspends() {
    let line = played::bus(&[Node::velocity(1)], |_, _| {});
    let args = format!("spin --page --port {} --node 1 --rps 2 --for 600", line.path);
    let spin = Terminal::start(&args, SIZE);
    spin.row("2.00 rps ");
    // The motor coasts for a while.
    line.change(|node| node.follows = false);
    spin.signal("TSTP");
    spin.row("stopping ...");
    assert_ne!(spin.state(), 'T', "suspended with the motor turning");
    line.change(|node| node.rps = 0.0);
    spin.wait("suspended", || spin.state() == 'T' && !spin.has_page());
    spin.assert_clean();
    spin.signal("CONT");
    let left = spin.end();
    assert_eq!(left.code, Some(1), "{left:?}");
    assert!(left.text.contains("axle: suspended by Ctrl-Z"), "{left:?}");
}

#[test]
fn a_page_that_is_not_possible_is_a_usage_error_before_anything_moves() {
    let (sim, port) = sim(TWO_NODES);
    let spin = Process::start(&format!("spin --page --port {port} --node 1 --rps 2"));
    assert!(spin.complaint(2).starts_with("--page needs a terminal"));
    assert!(!sim.lines().iter().any(|line| line.contains("command")));
}

/// A shell's job control, on a terminal that is that of the session.
#[test]
fn in_the_background_there_are_lines_and_after_ctrl_z_and_bg_the_page_waits_for_fg() {
    let (_sim, port) = sim("ucp");
    let mut shell = Command::new("setsid");
    // It reads no files of the user, and says nothing of its own.
    shell.args(["--ctty", "--wait", "bash", "--norc", "--noprofile", "-i"]).env("PS1", "");
    if Command::new("setsid").arg("--version").output().is_err() {
        eprintln!("skipped: there is no setsid");
        return;
    }
    let mut shell = Terminal::spawn(&mut shell, SIZE);
    let tool = env!("CARGO_BIN_EXE_axle");
    shell.press(&format!("{tool} watch --port {port} -P ucp --for 1.5 & wait; echo ready\n"));
    shell.row("bytes received");
    shell.row("ready");
    assert!(!shell.text().contains("link     up"), "{}", shell.text());
    shell.press(&format!("clear; {tool} watch --port {port} -P ucp\n"));
    shell.row("reports/s");
    shell.press("\x1a");
    shell.wait("the shell", || !shell.has_page());
    shell.press("bg\n");
    thread::sleep(Duration::from_millis(500));
    assert!(!shell.has_page(), "it is in the background");
    shell.press("fg\n");
    shell.row("reports/s");
    // Ctrl-C as a key.
    shell.press("\x03");
    shell.row("bytes received");
    shell.press("exit 0\n");
    assert_eq!(shell.end().code, Some(0));
}
