//! `axle sim`, and the help of all subcommands.

use super::{Process, TWO_NODES, sim};

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
fn a_simulation_goes_on_for_the_time_that_was_asked_for() {
    for what in ["sim ikeya --node 1:velocity", "sim ucp"] {
        let lines = Process::start(&format!("{what} --for 0.4")).success();
        let seconds = lines.last().unwrap().trim().split(' ').next().unwrap();
        assert!((0.4..5.0).contains(&seconds.parse::<f64>().unwrap()), "{lines:?}");
    }
}

#[test]
fn a_simulated_rover_tells_once_that_it_moves_and_once_that_it_is_at_rest() {
    let (sim, port) = sim("ucp");
    Process::start(&format!("drive -p {port} --speed 40 --turn 0 -f 0.5")).success();
    sim.signal("INT");
    let lines = sim.success();
    let told = |what: &str| lines.iter().filter(|line| line.contains(what)).count();
    assert_eq!((told("  moving"), told("  at rest after")), (1, 1), "{lines:?}");
}

#[test]
fn a_link_in_a_folder_that_does_not_exist_is_told() {
    let line = Process::start("sim ucp --link /no/such/folder/rover").complaint(1);
    let expected = "cannot create the link \"/no/such/folder/rover\": no such directory";
    assert_eq!(line, expected);
}

#[test]
fn help_tells_of_units_signs_and_exit_codes() {
    let cases = [
        ("--help", "Commands:"),
        ("scan --help", "--reply-timeout"),
        ("spin --help", "revolutions per second"),
        ("spin --help", "[default: 20]"),
        ("drive --help", "positive is to the right"),
        ("drive --help", "in reverse, with a speed below -5, it swings left"),
        ("stop --help", "What is sent on the wire"),
        ("stop --help", "at 500000 bit/s"),
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

#[test]
fn help_tells_what_a_kill_leaves_behind() {
    for subcommand in ["spin", "drive", "stop", "watch"] {
        let help = Process::start(&format!("{subcommand} --help")).success().join("\n");
        let words: Vec<_> = help.split_whitespace().collect();
        let help = words.join(" ");
        for expected in [
            "kill -9, a SIGSTOP or a power cut",
            "keeps turning indefinitely, unless its slaves have watchdogs",
            "a vendor robot stops 500 ms after the last byte on its line; any byte counts, \
             including noise and bytes from other programs",
        ] {
            assert!(help.contains(expected), "{subcommand}: {expected} is not in {help}");
        }
        assert!(!help.contains("stops by itself"), "{subcommand}: {help}");
    }
}
