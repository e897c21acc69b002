//! Invalid input gives one clear line and an exit code.

use std::{
    fs::{self, Permissions},
    os::unix::{
        fs::{MetadataExt, PermissionsExt},
        process::CommandExt,
    },
};

use super::{
    Process, TWO_NODES, sim,
    support::{self, axle},
};

#[test]
fn a_wrong_value_is_explained_in_one_line_before_any_port_is_touched() {
    let cases = [
        ("spin --port /none --node 1 --rps NaN", "NaN is not a finite number"),
        ("spin --port /none --node 1 --rps inf", "inf is not a finite number"),
        ("spin --port /none --node 1 --rps 1e39", "inf is not a finite number"),
        ("spin --port /none --node 1 --rps fast", "not a number"),
        ("spin --port /none --node 1 --revolutions nan", "NaN is not a finite number"),
        ("spin --port /none --node 1 --revolutions 32769", "outside -268443647..=268435455"),
        ("spin --port /none --node 0 --rps 1", "node id 0 is outside 1..=8"),
        ("spin --port /none --node 9 --rps 1", "node id 9 is outside 1..=8"),
        ("spin --port /none --node 1", "--rps <X>...|--revolutions <X>..."),
        ("spin --port /none --node 1 --rps 1 --revolutions 1", "cannot be used with"),
        ("spin --port /none --node 1 --rps 1 --for -1", "it is not within 0..=86400 seconds"),
        ("spin --port /none --node 1 --rps 1 --for 1e300", "it is not within 0..=86400 seconds"),
        ("spin --port /none --node -1 --rps 1", "a node id is a number within 1..=8"),
        ("spin --port /none --node 1 --rps 1 --for NaN", "it is not within 0..=86400 seconds"),
        ("spin --node 1 --rps 1", "--port <PATH>"),
        ("drive --port /none --speed 101 --turn 0", "101 is not in -100..=100"),
        ("drive --port /none --speed 0 --turn -101", "-101 is not in -100..=100"),
        ("drive --port /none", "--speed <S>"),
        ("stop --port /none --gap 1", "it is not within 0..=0.02 seconds"),
        ("stop", "--port <PATH>"),
        ("stop --port /none --node 9", "node id 9 is outside 1..=8"),
        ("stop --port /none --protocol can", "[possible values: ucp, ikeya, ikeya-3]"),
        ("stop --port /none --protocol ucp --node 1", "a rover has no nodes"),
        ("spin --port /none --node 1 --rps 200", "--rps 200 is faster than --max-rps 20"),
        ("watch --port /none --protocol can", "[possible values: ucp, ikeya, ikeya-3]"),
        ("watch --port /none", "--protocol <PROTOCOL>"),
        ("scan --port /none --baud 0", "0 is not in 9600..=4294967295"),
        ("scan --port /none --baud 9599", "9599 is not in 9600..=4294967295"),
        ("scan --port /none --baud quick", "'quick'"),
        ("scan --port /none -P ucp", "[possible values: ikeya, ikeya-3]"),
        ("ping --port /none --count 0", "0 is not in 1..=4294967295"),
        ("ping --port /none --every 0", "it is not within 0.01..=60 seconds"),
        ("ping --port /none --every 61", "it is not within 0.01..=60 seconds"),
        ("lamp --port /none", "<STATE>"),
        ("lamp --port /none dim", "[possible values: on, off]"),
        ("network --port /none good", "[possible values: unknown, sim-absent,"),
        ("ping --port /none --record -", "standard output carries the lines of this subcommand"),
        ("calibrate --port /none", "--kind <KIND>"),
        ("calibrate --port /none --kind gps", "[possible values: magnetometer, imu]"),
        ("completions csh", "[possible values: bash,"),
        ("man", "<DIR>"),
        ("sim", "requires a subcommand"),
        ("sim ikeya", "--node <N:MODE>"),
        ("sim ikeya --node 1", "N:MODE, as in 1:velocity"),
        ("sim ikeya --node 1:torque", "the mode must be velocity or position"),
        ("sim ikeya --node 9:velocity", "node id 9 is outside 1..=8"),
        ("sim ikeya --node 2:velocity --node 2:position", "node 2 is given twice"),
        ("sim ikeya --node 2:velocity --dead 3", "--dead 3: there is no such --node"),
        ("sim ucp --noise 2", "it is not within 0..=1"),
        ("sim ucp --noise NaN", "it is not within 0..=1"),
        ("sim ucp --lost -1", "it is not within 0..=1"),
        ("sim ucp --stray 100", "expected two hex digits, such as ff"),
        ("sim ucp --stray +f", "expected two hex digits, such as ff"),
        ("sim ucp --unplug 3", "expected AT:FOR in seconds, as in 2:0.5"),
        ("sim ucp --unplug 3:x", "not a number"),
        ("dcode", "unrecognized subcommand 'dcode'; did you mean 'decode'?"),
        ("scan --prot /none", "unexpected argument '--prot' found; did you mean '--port'?"),
        ("decode -P ikey", "did you mean 'ikeya'?"),
    ];
    for (args, expected) in cases {
        let line = Process::start(args).complaint(2);
        assert!(line.contains(expected), "{args:?} gives {line:?}");
        assert!(!line.starts_with("error") && !line.contains("Usage"), "{line:?}");
    }
}

const USERS: [&str; 16] = [
    "scan --port",
    "spin --node 1 --rps 1 --port",
    "drive --speed 1 --turn 1 --port",
    "watch --protocol ucp --port",
    "stop --port",
    "stop --protocol ikeya --node 1 --port",
    "stop --protocol ikeya-3 --port",
    "stop --protocol ucp --port",
    "record --protocol ucp --output /dev/full --force --port",
    "ping --port",
    "calibrate --kind imu --port",
    "lamp on --port",
    "network connected --port",
    // The port comes first.
    "send --port PORT ikeya read 1",
    "send --port PORT ucp ping",
    "send --port PORT ikeya-3 velocity 1 0 0 0",
];

/// A subcommand with this port.
fn on_port(user: &str, path: &str) -> String {
    match user.contains("PORT") {
        true => user.replace("PORT", path),
        false => format!("{user} {path}"),
    }
}

#[test]
fn a_path_that_is_no_port_is_named() {
    let file = support::file("no_port", b"");
    let cases = [
        ("/no/such/port", "no such path"),
        (env!("CARGO_TARGET_TMPDIR"), "not a serial port"),
        (file.to_str().unwrap(), "not a serial port"),
        ("/dev/null", "not a serial port"),
    ];
    for (path, cause) in cases {
        for user in USERS {
            let line = Process::start(&on_port(user, path)).complaint(1);
            assert_eq!(line, format!("cannot use port {path:?}: {cause}"));
        }
    }
}

#[test]
fn a_port_that_may_not_be_opened_is_named() {
    let (_sim, port) = sim(TWO_NODES);
    fs::set_permissions(&port, Permissions::from_mode(0o000)).unwrap();
    for user in USERS {
        let args = on_port(user, &port);
        let args: Vec<_> = args.split(' ').collect();
        let mut command = axle(&args);
        if fs::metadata("/proc/self").is_ok_and(|process| process.uid() == 0) {
            // Root can open everything; user `nobody` cannot.
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
        let line = Process::start(&on_port(user, &port)).complaint(1);
        assert_eq!(line, format!("cannot use port {port:?}: another program is using it"));
    }
    assert!(!sim.lines().iter().any(|line| line.contains("command")));
}
