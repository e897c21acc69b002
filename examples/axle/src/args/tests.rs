//! What the command line accepts, and what is taken where it says nothing.

use super::*;

#[test]
fn a_limit_is_a_number_above_0() {
    for text in ["0", "-1", "nan", "x", ""] {
        assert!(max_rps(text).is_err() && max_turns(text).is_err(), "{text}");
    }
    assert_eq!(max_rps("0.5").unwrap().get(), 0.5);
    assert_eq!(max_turns("0.5"), Ok(0.5));
    assert!(max_rps("inf").is_err());
}

#[test]
fn seconds_are_taken_as_microseconds_up_to_a_day() {
    assert_eq!(seconds("0"), Ok(0));
    assert_eq!(seconds("0.02"), Ok(20_000));
    assert_eq!(seconds("3"), Ok(3_000_000));
    assert_eq!(seconds("86400"), Ok(86_400_000_000));
    for text in ["86400.1", "-0.1", "nan", "inf", "3s", ""] {
        assert!(seconds(text).is_err(), "{text}");
    }
}

#[test]
fn rates_nodes_and_bytes_have_their_ranges() {
    assert_eq!((rate("0"), rate("0.5"), rate("1")), (Ok(0.0), Ok(0.5), Ok(1.0)));
    assert!(rate("1.1").is_err() && rate("-0.1").is_err() && rate("nan").is_err());
    assert_eq!((node("1"), node("8")), (Ok(NodeId::N1), Ok(NodeId::N8)));
    assert!(node("0").is_err() && node("9").is_err() && node("256").is_err());
    assert_eq!((hex_byte("ff"), hex_byte("0x0a")), (Ok(0xFF), Ok(0x0A)));
    assert!(hex_byte("f").is_err() && hex_byte("+f").is_err() && hex_byte("100").is_err());
    assert_eq!(revolutions("-1.5").unwrap().counts(), -12_288);
}

#[test]
fn the_speed_of_a_line_is_that_of_its_protocol_unless_another_is_given() {
    for (protocol, baud) in
        [(Protocol::Ucp, 115_200), (Protocol::Ikeya, 500_000), (Protocol::Ikeya3, 500_000)]
    {
        assert_eq!(PortArgs::new(None).baud_for(protocol), baud);
        assert_eq!(PortArgs::new(Some(57_600)).baud_for(protocol), 57_600);
    }
}

#[test]
fn a_command_line_that_would_do_harm_is_refused() {
    let parsed = |words: &str| {
        let words = ["axle"].into_iter().chain(words.split(' '));
        crate::command::description().try_get_matches_from(words).map_err(|error| error.to_string())
    };
    for (words, says) in [
        ("scan -p x -b 9599", "9599 is not in 9600"),
        ("spin -p x -n 1 --rps 1 --record -", "standard output carries the lines"),
        ("spin -p x -n 1 --rps 1 --max-rps 0", "a limit must be above 0"),
        ("spin -p x -n 1 --rps 1 --revolutions 1", "cannot be used with"),
        ("spin -p x -n 9 --rps 1", "1..=8"),
        ("spin -p x --rps 1", "--node"),
        ("drive -p x --speed 101 --turn 0", "101 is not in -100..=100"),
        ("drive -p x --speed 0 --turn 101", "101 is not in -100..=100"),
        ("drive -p x", "--speed"),
        ("record -p x -P ucp -o a --rotate 9kB", "at least 10kB or 1s"),
        ("drive -p x --speed 0 --turn 0 --page --json", "cannot be used with"),
        ("send -p x ucp motor -101 0", "-101 is not in -100..=100"),
        ("send -p x -c 0 ucp ping", "0 is not in 1"),
        ("send -p x -c 100001 ucp ping", "100001 is not in 1"),
        ("send -p x --max-turns 0 ikeya position 1 1", "a limit must be above 0"),
        ("replay -p x --speed 0 file", "not within 0.001..=1000"),
        ("ping -p x --every 0.009", "not within 0.01..=60"),
        ("ping -p x -c 0", "0 is not in 1"),
        ("watch -p x -P ucp -c 0", "0 is not in 1"),
    ] {
        let error = parsed(words).unwrap_err();
        assert!(error.contains(says), "{words}: {error}");
    }
    for words in [
        "drive -p x --speed -100 --turn 100",
        "drive -p x --turn 5",
        "scan -p x -b 9600 --record a",
    ] {
        assert!(parsed(words).is_ok(), "{words}");
    }
}

/// Every option with a default, as `subcommand option default`.
fn defaults(command: &clap::Command, path: &str, found: &mut Vec<String>) {
    for arg in command.get_arguments() {
        let values: Vec<_> =
            arg.get_default_values().iter().map(|it| it.to_string_lossy()).collect();
        if arg.get_action().takes_values() && !values.is_empty() {
            found.push(format!("{path}{} {}", arg.get_long().unwrap_or("-"), values.join(" ")));
        }
    }
    for inner in command.get_subcommands() {
        defaults(inner, &format!("{path}{} ", inner.get_name()), found);
    }
}

#[test]
fn every_default_is_as_it_is_written_here() {
    let mut found = Vec::new();
    defaults(&crate::command::description(), "", &mut found);
    let motion = found.iter().filter(|line| {
        ["spin", "drive", "send", "replay", "ping", "decode", "scan"]
            .iter()
            .any(|name| line.starts_with(name))
    });
    let expected = [
        "decode protocol auto",
        "decode time relative",
        "scan protocol ikeya",
        "spin protocol ikeya",
        "spin max-rps 20",
        "spin for 3",
        "drive speed 0",
        "drive turn 0",
        "drive for 3",
        "ping every 0.2",
        "replay as commander",
        "replay speed 1",
        "replay longest-pause 10",
        "replay every 0.02",
        "replay max-rps 20",
        "replay max-turns 100",
        "send count 1",
        "send every 0.1",
        "send for 0.5",
        "send as commander",
        "send max-rps 20",
        "send max-turns 100",
    ];
    assert_eq!(motion.collect::<Vec<_>>(), expected);
}

#[test]
fn a_gap_is_short_and_a_time_to_coast_is_not_endless() {
    let micros = |time: Duration| time.as_micros();
    assert_eq!([gap("0"), gap("0.02")].map(|it| it.map(micros)), [Ok(0), Ok(20_000)]);
    assert_eq!(coast("60").map(micros), Ok(60_000_000));
    for text in ["0.03", "1", "-1", "1e12"] {
        assert_eq!(gap(text).unwrap_err(), "it is not within 0..=0.02 seconds");
    }
    for text in ["61", "-1", "1e12", "NaN"] {
        assert_eq!(coast(text).unwrap_err(), "it is not within 0..=60 seconds");
    }
}
