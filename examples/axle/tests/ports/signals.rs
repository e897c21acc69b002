//! Signals: motors are stopped before the tool exits or is suspended.

use std::{
    cell::RefCell,
    io::Write,
    process::Command,
    sync::{Arc, Mutex},
    thread,
    time::{Duration, Instant},
};

use super::{
    Process,
    played::{self, Node, Said, confirmable_stops, speeds},
    sim,
    support::axle,
    values, wait_until,
};

const SUSPENDED: &str =
    "suspended by Ctrl-Z: everything that moved was told to stop first and stays stopped";

/// Longer than the pause that leads to a stop.
const LONG: Duration = Duration::from_millis(900);

/// Checks that a node got only stops after the first stop. Before it come the commands sent until
/// the signal arrived: on a busy machine, some of the set-points repeated every 20 ms.
fn assert_stopped_for_good(said: &[Said]) {
    let speeds = speeds(said);
    let first = speeds.iter().position(|&rps| rps == 0.0).expect("a stop");
    assert!(first <= 25, "kept turning: {speeds:?}");
    assert!(speeds[first..].iter().all(|&rps| rps == 0.0), "turned again: {speeds:?}");
}

#[test]
fn a_reader_that_does_not_read_keeps_nobody_from_ending_the_tool_while_nothing_moves() {
    let (_sim, port) = sim("ikeya --node 1:velocity");
    let (_rover, robot) = sim("ucp");
    for (args, signals) in [
        // The first line comes before anything moves.
        (format!("spin -p {port} -n 1 --rps 2 -f 600"), 1),
        (format!("stop -p {port} -P ikeya"), 1),
        (format!("watch -p {robot} -P ucp --json"), 2),
        // Its error.
        (format!("send -p {port} ikeya velocity 2 1"), 1),
    ] {
        let (_reader, mut writer) = std::io::pipe().unwrap();
        let args: Vec<_> = args.split(' ').collect();
        // The pipe is full from the beginning.
        writer.write_all(&[b' '; 65536]).unwrap();
        let errors = writer.try_clone().unwrap();
        let tool = axle(&args).stdout(writer).stderr(errors).spawn().unwrap();
        // Long enough to stop what moves.
        thread::sleep(Duration::from_millis(1500));
        for _ in 0..signals {
            let kill = format!("kill -TERM {}", tool.id());
            assert!(Command::new("sh").args(["-c", &kill]).status().unwrap().success());
            thread::sleep(Duration::from_millis(1200));
        }
        let tool = RefCell::new(tool);
        wait_until("the end", || tool.borrow_mut().try_wait().unwrap().is_some());
    }
}

#[test]
fn every_signal_that_can_be_caught_stops_the_motor_first() {
    let (sim, port) = sim("ikeya --node 1:velocity --noise 1e-4");
    let signals = [
        ("INT", "3.00"),
        ("TERM", "4.00"),
        ("HUP", "5.00"),
        ("QUIT", "6.00"),
        ("USR1", "7.00"),
        ("ALRM", "8.00"),
        // Supervisor watchdogs, a failing power supply, real-time signals.
        ("ABRT", "9.00"),
        ("PWR", "10.00"),
        ("IO", "11.00"),
        ("34", "12.00"),
        ("64", "13.00"),
    ];
    for (signal, rps) in signals {
        let spin = Process::start(&format!("spin --port {port} --node 1 --rps {rps} --for 600"));
        sim.line(&format!("node 1: command {rps} rps"));
        spin.signal(signal);
        let lines = spin.success();
        assert!(lines.last().unwrap().ends_with("stopped and confirmed"), "{signal}: {lines:?}");
        let commands: Vec<_> =
            sim.lines().into_iter().filter(|line| line.contains("command")).collect();
        assert!(commands.last().unwrap().contains("0.00 rps"), "{signal}: {commands:?}");
    }
}

/// A process group without a terminal ignores the signals of one, so what they do is not seen in
/// every place where tests run; that they are caught is.
#[test]
fn what_moves_something_catches_every_signal_that_can_be_caught() {
    let (bus, rover) = (played::bus(&[Node::velocity(1)], |_, _| {}), played::rover(None));
    for args in [
        format!("spin -p {} -n 1 --rps 1 -f 600", bus.path),
        format!("send -p {} -f 600 ikeya velocity 1 1", bus.path),
        format!("drive -p {} --speed 10 --turn 0 -f 600", rover.path),
        format!("stop -p {} -P ikeya -n 8", bus.path),
    ] {
        let before = bus.said().len() + rover.lock().bytes;
        let tool = Process::start(&args);
        wait_until("the first byte", || bus.said().len() + rover.lock().bytes > before);
        let caught = tool.caught_signals();
        // Hangup, interrupt, quit, abort, user 1 and 2, alarm, terminated, stop, background
        // input and output, and the first and the last of the real-time signals.
        for signal in [1, 2, 3, 6, 10, 12, 14, 15, 20, 21, 22, 34, 64] {
            assert!(caught & 1 << (signal - 1) != 0, "{args}: {signal} of {caught:x}");
        }
        tool.signal("INT");
        tool.end();
    }
}

#[test]
fn a_signal_of_the_terminal_suspends_no_tool_before_the_motor_is_stopped() {
    for signal in ["TTIN", "TTOU"] {
        let line = played::bus(&[Node::velocity(1)], |_, _| {});
        let spin = played::spin(&line, 600.0);
        spin.signal(signal);
        wait_until("suspended", || spin.state() == 'T');
        assert_eq!(line.lock().nodes[0].rps, 0.0, "{signal}");
        spin.signal("CONT");
        assert_eq!(spin.complaint(1), SUSPENDED);
    }
}

#[test]
fn every_signal_that_can_be_caught_stops_the_rover_first() {
    for signal in ["INT", "TERM", "HUP", "QUIT"] {
        let line = played::rover(None);
        let drive =
            Process::start(&format!("drive --port {} --speed -30 --turn -10 --for 600", line.path));
        wait_until("the drive", || line.lock().commands.contains(&(-30, -10)));
        drive.signal(signal);
        assert!(drive.success().last().unwrap().ends_with("stopped"));
        let commands = line.lock().commands.clone();
        let stops = commands.iter().rev().take_while(|command| **command == (0, 0)).count();
        assert!(stops >= 3, "{signal}: a stop may be lost, so it is repeated: {commands:?}");
        assert_eq!(line.lock().strays, 0);
    }
}

#[test]
fn after_the_signal_only_stops_are_sent_each_followed_by_a_read() {
    let line = played::bus(&[Node::velocity(1)], |_, _| {});
    let spin = played::spin(&line, 600.0);
    let before = line.said().len();
    spin.signal("INT");
    spin.success();
    let said = line.said();
    assert_stopped_for_good(&said[before..]);
    assert!(confirmable_stops(&said, 1) >= 2, "{:?}", speeds(&said[before..]));
    assert_eq!(line.lock().strays, 0);
}

#[test]
fn a_second_ctrl_c_does_not_abandon_the_stop() {
    let line = played::bus(&[Node::velocity(1)], |_, _| {});
    let spin = played::spin(&line, 600.0);
    // The motor coasts down slowly.
    line.change(|node| (node.rps, node.follows) = (2.0, false));
    for _ in 0..4 {
        spin.signal("INT");
        thread::sleep(Duration::from_millis(200));
    }
    line.change(|node| node.rps = 0.0);
    let lines = spin.success();
    assert_eq!(values(&lines[lines.len() - 1..], "rps"), [0.0], "{lines:?}");
    assert!(lines.last().unwrap().ends_with("stopped and confirmed"), "{lines:?}");
}

#[test]
fn ctrl_z_stops_the_motor_before_the_tool_is_suspended_and_nothing_moves_after_it() {
    let line = played::bus(&[Node::velocity(1)], |_, _| {});
    let spin = played::spin(&line, 600.0);
    // The motor coasts for a while, and the tool waits for it.
    line.change(|node| node.follows = false);
    spin.signal("TSTP");
    let before = line.said().len();
    thread::sleep(Duration::from_millis(300));
    assert_ne!(spin.state(), 'T', "suspended with the motor turning");
    line.change(|node| node.rps = 0.0);
    wait_until("suspended", || spin.state() == 'T');

    let said = line.said();
    assert_stopped_for_good(&said[before..]);
    assert!(confirmable_stops(&said, 1) >= 2, "{:?}", speeds(&said[before..]));
    // Other programs can use the line meanwhile.
    let scan = Process::start(&format!("scan --port {}", line.path)).success();
    assert_eq!(scan.last().unwrap(), "1 node answers.");

    let said = line.said().len();
    spin.signal("CONT");
    assert_eq!(spin.complaint(1), SUSPENDED);
    assert_eq!(line.said().len(), said, "nothing is sent afterwards");
}

#[test]
fn ctrl_z_stops_the_rover_before_the_tool_is_suspended_and_nothing_moves_after_it() {
    let line = played::rover(None);
    let drive = Process::start(&format!("drive --port {} --speed 0 --turn 40", line.path));
    wait_until("the drive", || line.lock().commands.contains(&(0, 40)));
    // The rover coasts for a while, turning on the spot.
    line.lock().wheels = Some([20, -20, 20, -20]);
    drive.signal("TSTP");
    thread::sleep(Duration::from_millis(600));
    assert_ne!(drive.state(), 'T', "suspended with the wheels turning");
    line.lock().wheels = None;
    wait_until("suspended", || drive.state() == 'T');
    assert_eq!(line.lock().commands.last(), Some(&(0, 0)));

    let bytes = line.lock().bytes;
    drive.signal("CONT");
    assert_eq!(drive.complaint(1), SUSPENDED);
    assert_eq!(line.lock().bytes, bytes, "nothing is sent afterwards");
}

#[test]
fn ctrl_z_complains_first_where_the_stop_is_not_confirmed() {
    let line = played::bus(&[Node::velocity(1)], |_, _| {});
    let spin = played::spin(&line, 600.0);
    line.change(|node| node.is_dumb = true);
    spin.signal("TSTP");
    wait_until("suspended", || spin.state() == 'T');
    wait_until("the complaint", || !spin.complaints().is_empty());
    let complaints = spin.complaints();
    assert_eq!(complaints.len(), 1, "{complaints:?}");
    assert!(complaints[0].contains("node 1 was told to stop and has not confirmed it"));
    spin.signal("CONT");
    let ended = spin.end();
    assert_eq!((ended.code, ended.stderr.len()), (Some(1), 2), "{ended:?}");
    assert_eq!(ended.stderr[1], format!("axle: {SUSPENDED}"));
}

#[test]
fn ctrl_z_before_anything_moves_suspends_at_once() {
    let line = played::bus(&[], |_, _| {});
    let spin = Process::start(&format!("spin --port {} --node 1 --rps 2", line.path));
    line.wait_for(Said::Read(1));
    spin.signal("TSTP");
    wait_until("suspended", || spin.state() == 'T');
    assert!(spin.complaints().is_empty());
    spin.signal("CONT");
    assert_eq!(spin.complaint(1), SUSPENDED);
    assert!(speeds(&line.said()).is_empty(), "no node was commanded");
}

/// The tool itself detects its absence, before a dead-man does.
fn says_for_how_long(complaint: &str) -> bool {
    let time = complaint.strip_prefix("the tool did not run for ");
    time.is_some_and(|time| time.starts_with(|first: char| first.is_ascii_digit()))
}

#[test]
fn after_a_stop_signal_that_cannot_be_caught_the_motor_is_stopped_and_not_turned_on() {
    let line = played::bus(&[Node::velocity(1)], |_, _| {});
    let spin = played::spin(&line, 600.0);
    spin.signal("STOP");
    wait_until("suspended", || spin.state() == 'T');
    thread::sleep(LONG);
    let before = line.said().len();
    spin.signal("CONT");
    let complaint = spin.complaint(1);
    assert!(says_for_how_long(&complaint), "{complaint}");
    assert!(complaint.ends_with("(suspended?); it was stopped and is at rest"), "{complaint}");
    let said = line.said();
    assert_stopped_for_good(&said[before..]);
    assert_eq!(
        speeds(&said[before..])[0],
        0.0,
        "no further command: {:?}",
        speeds(&said[before..])
    );
    assert!(confirmable_stops(&said[before..], 1) >= 2, "{:?}", speeds(&said[before..]));
}

#[test]
fn after_a_stop_signal_that_cannot_be_caught_the_rover_is_stopped_and_not_driven_on() {
    let line = played::rover(None);
    let drive =
        Process::start(&format!("drive --port {} --speed 50 --turn 0 --for 600", line.path));
    wait_until("the drive", || line.lock().commands.contains(&(50, 0)));
    drive.signal("STOP");
    wait_until("suspended", || drive.state() == 'T');
    thread::sleep(LONG);
    let before = line.lock().commands.len();
    drive.signal("CONT");
    let complaint = drive.complaint(1);
    assert!(says_for_how_long(&complaint), "{complaint}");
    assert!(complaint.ends_with("(suspended?); it was stopped and is at rest"), "{complaint}");
    let commands = line.lock().commands[before..].to_vec();
    assert!(commands.len() >= 3, "{commands:?}");
    assert!(commands.iter().all(|command| *command == (0, 0)), "kept driving: {commands:?}");
}

#[test]
fn a_position_node_holds_what_was_read_after_the_signal() {
    let holds = Arc::new(Mutex::new(Vec::new()));
    let seen = Arc::clone(&holds);
    // Moving: 100 counts further with each answer, until told to hold.
    let line = played::bus(&[Node { follows: false, ..Node::position(1, 0) }], move |said, bus| {
        let node = &mut bus.nodes[0];
        match said {
            Said::Read(1) if seen.lock().unwrap().is_empty() => node.counts += 100,
            // The goal is 100 turns away.
            Said::Write(1, _, to) if to < 50 * 8192 => seen.lock().unwrap().push((to, node.counts)),
            _ => {}
        }
    });
    let args = format!("spin --port {} --node 1 --revolutions 100 --for 600", line.path);
    let spin = Process::start(&args);
    wait_until("the command", || line.said().iter().any(|said| matches!(said, Said::Write(..))));
    spin.signal("INT");
    let lines = spin.success();
    assert!(lines.last().unwrap().ends_with("stopped and confirmed"), "{lines:?}");
    let holds = holds.lock().unwrap();
    let (held, measured) = holds[0];
    assert_eq!(held, measured, "holds the position of the last answer");
    assert!(holds.len() >= 2 && holds.iter().all(|hold| *hold == holds[0]), "{holds:?}");
}

#[test]
fn a_stop_that_is_itself_suspended_has_all_of_its_time_afterwards() {
    let bus = played::bus(&[Node::velocity(1)], |_, _| {});
    let rover = played::rover(None);
    let spin = played::spin(&bus, 600.0);
    let drive =
        Process::start(&format!("drive --port {} --speed 50 --turn 0 --for 600", rover.path));
    wait_until("the drive", || rover.lock().commands.contains(&(50, 0)));
    // Both coast for a while.
    bus.change(|node| node.follows = false);
    rover.lock().wheels = Some([9; 4]);
    for tool in [&spin, &drive] {
        tool.signal("INT");
    }
    thread::sleep(Duration::from_millis(300));
    for tool in [&spin, &drive] {
        tool.signal("STOP");
    }
    thread::sleep(Duration::from_millis(3500));
    for tool in [&spin, &drive] {
        tool.signal("CONT");
    }
    thread::sleep(Duration::from_millis(700));
    bus.change(|node| node.rps = 0.0);
    rover.lock().wheels = None;
    assert!(spin.success().last().unwrap().ends_with("stopped and confirmed"));
    assert!(drive.success().last().unwrap().ends_with("stopped"));
}

#[test]
fn a_signal_ends_a_search_at_once_and_says_what_was_not_done() {
    let moved = "interrupted before anything moved";
    for (args, says) in [
        ("drive --speed 20 --turn 0", moved),
        ("send ucp motor 20 0", moved),
        ("lamp on", "interrupted"),
        ("network connected", "interrupted before the state was sent"),
        ("calibrate -k imu", "interrupted before the calibration began"),
        ("scan", "interrupted before all ids were asked"),
        ("spin -n 1 --rps 1", moved),
    ] {
        let line = played::parrot(&[]);
        let (name, rest) = args.split_once(' ').unwrap_or((args, ""));
        let tool = Process::start(&format!("{name} -p {} {rest}", line.path));
        wait_until("the first byte", || !line.lock().is_empty());
        let begin = Instant::now();
        tool.signal("INT");
        assert_eq!(tool.complaint(1), says, "{args}");
        assert!(begin.elapsed() < Duration::from_secs(1), "{args}: {:?}", begin.elapsed());
    }
}

#[test]
fn what_send_has_moved_is_stopped_before_ctrl_z_suspends_it_and_a_second_ctrl_c_ends_nothing() {
    let line = played::bus(&[Node::velocity(1)], |_, _| {});
    for signal in ["TSTP", "INT"] {
        let args = format!("send -p {} -f 600 ikeya velocity 1 2", line.path);
        let send = Process::start(&args);
        wait_until("2 rps", || line.lock().nodes[0].rps == 2.0);
        // It coasts for a while.
        line.change(|node| node.follows = false);
        send.signal(signal);
        thread::sleep(Duration::from_millis(1300));
        if signal == "INT" {
            send.signal(signal);
            thread::sleep(Duration::from_millis(200));
        }
        assert_eq!(send.lines().iter().filter(|line| line.contains("stopped")).count(), 0);
        assert!(!['T', 'Z'].contains(&send.state()), "with the motor turning");
        line.change(|node| (node.follows, node.rps) = (true, 0.0));
        if signal == "TSTP" {
            wait_until("suspended", || send.state() == 'T');
            send.signal("CONT");
            assert_eq!(send.complaint(1), SUSPENDED);
        } else {
            assert!(send.success().last().unwrap().ends_with("stopped and confirmed"));
        }
    }
}
