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
    undisturbed,
};

#[test]
fn a_wrong_value_is_explained_in_one_line_before_any_port_is_touched() {
    undisturbed(|| {
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
            ("spin --port /none --node 1 --rps 1 --for -1", "-1"),
            ("spin --port /none --node 1 --rps 1 --for NaN", "NaN s is not within 0..=86400 s"),
            ("spin --node 1 --rps 1", "--port <PATH>"),
            ("drive --port /none --speed 101 --turn 0", "101 is not in -100..=100"),
            ("drive --port /none --speed 0 --turn -101", "-101 is not in -100..=100"),
            ("drive --port /none --speed 0", "--turn <T>"),
            ("stop", "--port <PATH>"),
            ("stop --port /none --node 9", "node id 9 is outside 1..=8"),
            ("stop --port /none --protocol can", "[possible values: ucp, ikeya, ikeya-3]"),
            ("stop --port /none --protocol ucp --node 1", "a rover has no nodes"),
            ("spin --port /none --node 1 --rps 200", "--rps 200 is faster than --max-rps 20"),
            ("watch --port /none --protocol can", "[possible values: ucp, ikeya, ikeya-3]"),
            ("watch --port /none", "--protocol <PROTOCOL>"),
            ("scan --port /none --baud 0", "0 is not in 1..=4294967295"),
            ("scan --port /none --baud quick", "'quick'"),
            ("sim", "requires a subcommand"),
            ("sim ikeya", "--node <N:MODE>"),
            ("sim ikeya --node 1", "N:MODE, as in 1:velocity"),
            ("sim ikeya --node 1:torque", "the mode must be velocity or position"),
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
    });
}

const USERS: [&str; 8] = [
    "scan",
    "spin --node 1 --rps 1",
    "drive --speed 1 --turn 1",
    "watch --protocol ucp",
    "stop",
    "stop --protocol ikeya --node 1",
    "stop --protocol ikeya-3",
    "stop --protocol ucp",
];

#[test]
fn a_path_that_is_no_port_is_named() {
    undisturbed(|| {
        let file = support::file("no_port", b"");
        let cases = [
            ("/no/such/port", "no such path"),
            (env!("CARGO_TARGET_TMPDIR"), "not a serial port"),
            (file.to_str().unwrap(), "not a serial port"),
            ("/dev/null", "not a serial port"),
        ];
        for (path, cause) in cases {
            for user in USERS {
                let line = Process::start(&format!("{user} --port {path}")).complaint(1);
                assert_eq!(line, format!("cannot use port {path:?}: {cause}"));
            }
        }
    });
}

#[test]
fn a_port_that_may_not_be_opened_is_named() {
    undisturbed(|| {
        let (_sim, port) = sim(TWO_NODES);
        fs::set_permissions(&port, Permissions::from_mode(0o000)).unwrap();
        for user in USERS {
            let args = format!("{user} --port {port}");
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
    });
}

#[test]
fn a_port_that_another_program_uses_is_left_to_it() {
    undisturbed(|| {
        let (sim, port) = sim("ucp");
        let watch = Process::start(&format!("watch --port {port} --protocol ucp"));
        watch.line("report");
        for user in USERS {
            let line = Process::start(&format!("{user} --port {port}")).complaint(1);
            assert_eq!(line, format!("cannot use port {port:?}: another program is using it"));
        }
        assert!(!sim.lines().iter().any(|line| line.contains("command")));
    });
}
