//! Every hazard of the safety page has a test, unless nothing can be done about it: every test that
//! it names exists, and is run.

#![cfg(not(target_os = "none"))]

use std::{collections::HashSet, fs, path::Path};

const PAGE: &str = include_str!("../src/safety.md");
const SECURITY: &str = include_str!("../SECURITY.md");

/// All functions below these folders that are tests, and are run.
fn tests_below(folders: &[&str]) -> HashSet<String> {
    let mut found = HashSet::new();
    for folder in folders {
        add_tests_below(&Path::new(env!("CARGO_MANIFEST_DIR")).join(folder), &mut found);
    }
    assert!(found.contains("every_hazard_has_tests_that_are_run"), "the search is blind");
    found
}

fn add_tests_below(folder: &Path, found: &mut HashSet<String>) {
    // A published crate does not include the tool and the firmware.
    let Ok(entries) = fs::read_dir(folder) else { return };
    for path in entries.map(|entry| entry.unwrap().path()) {
        if path.is_dir() && !path.ends_with("target") {
            add_tests_below(&path, found);
        } else if path.extension().is_some_and(|extension| extension == "rs") {
            let source = fs::read_to_string(&path).unwrap();
            let (mut is_test, mut is_ignored) = (false, false);
            for line in source.lines().map(str::trim) {
                if line.starts_with("#[") {
                    is_test |= line.starts_with("#[test]");
                    is_ignored |= line.starts_with("#[ignore") || line.contains(", ignore");
                } else if let Some(rest) = line.strip_prefix("fn ") {
                    // Inside `proptest!` the attribute is the same.
                    if is_test && !is_ignored {
                        found.extend(rest.split('(').next().map(str::to_owned));
                    }
                    (is_test, is_ignored) = (false, false);
                } else if !line.starts_with("//") {
                    (is_test, is_ignored) = (false, false);
                }
            }
        }
    }
}

/// The numbered items of the sections with this title: number and text, on one line.
fn items(title: &str) -> Vec<(usize, String)> {
    let sections = PAGE.split("\n# ").filter(|section| section.starts_with(title));
    let mut items: Vec<(usize, String)> = Vec::new();
    for line in sections.flat_map(str::lines) {
        let numbered = line.split_once(". ").and_then(|(number, text)| {
            Some((number.parse().ok()?, text.to_string())) // a line of a text does not begin so
        });
        if let Some(item) = numbered {
            items.push(item);
        } else if let (true, Some((_, text))) = (line.starts_with("   "), items.last_mut()) {
            *text += " ";
            *text += line.trim_start();
        }
    }
    items
}

#[test]
fn every_hazard_has_a_number_and_says_what_remains() {
    let hazards = items("Hazards");
    assert!(hazards.len() >= 25, "{} hazards", hazards.len());
    for (place, (number, text)) in hazards.iter().enumerate() {
        assert_eq!(*number, place + 1, "{text}");
        let (what, remains) = text.split_once(" *Remains:* ").expect(text);
        assert!(what.starts_with("**") && !remains.is_empty(), "{text}");
    }
}

#[test]
fn every_hazard_has_tests_that_are_run() {
    let (hazards, shown) = (items("Hazards"), items("Shown by"));
    assert_eq!(hazards.len(), shown.len());
    let tests = tests_below(&["tests", "src"]);
    for ((number, hazard), (shown_number, names)) in hazards.iter().zip(&shown) {
        assert_eq!(number, shown_number);
        let is_beyond_us = hazard.contains(" Nothing can be done");
        assert_eq!(is_beyond_us, names == "Nothing can be done.", "hazard {number}: {names}");
        for name in names.split(", ").filter(|_| !is_beyond_us) {
            let bare = name.strip_prefix('`').and_then(|name| name.strip_suffix('`'));
            assert!(bare.is_some_and(|bare| tests.contains(bare)), "no test is called {name}");
        }
    }
}

/// A constant of the library that need not be public, as its source has it; times in milliseconds.
#[cfg(all(feature = "ikeya", feature = "ucp"))]
fn constant(file: &str, name: &str) -> String {
    let source = fs::read_to_string(Path::new(env!("CARGO_MANIFEST_DIR")).join(file)).unwrap();
    let line = source.lines().find(|line| line.contains(&format!("const {name}: ")));
    let value = line.expect(name).rsplit(" = ").next().unwrap().trim_end_matches(';');
    let time = value.strip_prefix("Duration::from_millis(");
    time.map_or(value.to_owned(), |time| time.replace(')', " ms"))
}

#[cfg(all(feature = "ikeya", feature = "ucp"))]
#[test]
fn each_bound_on_the_page_is_the_one_in_the_code() {
    use axlewire::{
        endpoint::Endpoint,
        ikeya::{Mode, NodeId, Slave, slave::SlaveConfig},
        time::{Duration, Instant},
        ucp::{Host, Robot, host::HostConfig, robot::RobotConfig},
    };
    let ms = |it: Duration| format!("{} ms", it.as_micros() / 1000);
    let (now, host, robot) = (Instant::default(), HostConfig::direct(), RobotConfig::direct());
    let held_up = |within| {
        let mut config = SlaveConfig::direct();
        config.answer_within = Duration::from_millis(within);
        ms(Slave::new(NodeId::N1, Mode::Velocity, config, now).line_rules().held_up_after.unwrap())
    };
    let (robot_held_up, watchdog) =
        (ms(Robot::new(robot, now).line_rules().held_up_after.unwrap()), ms(robot.watchdog));
    let pause = Host::new(host, now).line_rules().frame_pause;
    let (dead_man, period) = (ms(host.dead_man), ms(host.command_period));
    assert_eq!(dead_man, ms(host.link_timeout), "the page has one figure for both");
    let (order, board) = ("src/ikeya/master/order.rs", "src/ikeya/board.rs");

    let is_read =
        |part: &&str| ["Safety", "What", "Hazards"].iter().any(|title| part.starts_with(title));
    let words = PAGE.split("\n# ").filter(is_read).flat_map(str::split_whitespace);
    let mut page = words.collect::<Vec<_>>().join(" ");
    let mut take = |bound: &str| {
        assert!(page.contains(bound), "the page does not say: {bound}");
        page = page.replace(bound, "");
    };
    for bound in [
        format!(
            "at least {} apart show less than {} rps, or three show positions, each within {} counts \
             of the one before, and none more than {} counts, 1/32 of a turn, away",
            constant(order, "STILL_TIME"),
            constant(board, "STILL_RPS"),
            constant(order, "STILL_COUNTS"),
            constant(order, "HOLD_COUNTS")
        ),
        format!("again if it could not be written within {}", constant(order, "HOLD_PATIENCE")),
        format!("no answer follows within {}, and", constant(order, "HOLD_PATIENCE")),
        format!("or {} more if", constant(order, "HOLD_PATIENCE")),
        format!("told less than {} rps looks still for good", constant(board, "STILL_RPS")),
        format!("all four wheels at {} rpm", constant("src/ucp/host/standstill.rs", "STILL_RPM")),
        format!("the last of them {} after that", ms(host.rpm_average)),
        format!("has one of {}", constant("src/drive/tty.rs", "WRITE_PATIENCE")),
        format!("does not take it within {}", constant("src/ucp/host/update.rs", "PATIENCE")),
        format!("held up for {} looks at the port", constant("src/drive/driver.rs", "HELD_UP")),
        format!("{dead_man} after the application's last call, or after the robot was last heard"),
        format!("From {dead_man} after the last call on, or after the last frame of the robot"),
        format!("that has fallen silent for another {dead_man}"),
        format!("A stop is repeated every {period}"),
        format!("repeated every {period} until the first call"),
        format!("The host repeats a stop every {period}"),
        format!("A robot of this crate stops {watchdog} after the last *valid* command. A"),
        format!("A robot of this crate stops {watchdog} after the last *valid* command (U10)"),
        format!("at least {} and at most {}, go unnoticed", held_up(0), held_up(1000)),
        format!("has paused for more than {}", ms(pause)),
        format!("not seen the port empty for {robot_held_up}"),
        format!("it drives for up to {robot_held_up} longer"),
    ] {
        take(&bound);
    }
    // Those that have a test of their own, and what vendors, motors and a search do.
    for fact in [
        "blind, at least every 50 ms",
        "tells of the watchdog at most 50 ms after it fires",
        "within 50 ms after its cable is back",
        "5 % up to 0.9 s for each lost node",
        "0.4 s for each such id of `nodes`, and 2 s at 0 %",
        "0.5 s behind an adapter",
        "vendor robot waits for 500 ms",
        "only 500 ms of silence",
        "vendor robot stops 500 ms",
        "turnaround gap of at most 1 ms",
        "or for longer than 0.2 ms and `reply_timeout`, 20 ms of it at most, takes",
        "until the second stop, some 1 ms later",
        "until the second stop, some 2 ms later",
        "the next one follows 100 ms later",
        "an async one for less than 2 ms at 500 kbit/s",
        "and within 2 ms at 500 kbit/s when another request is heard",
        "0 rps",
        "1 rps",
        "1 to 5 %",
        "8 % power",
        "averages of 1 s",
        "below 6 rpm",
    ] {
        take(fact);
    }
    let words: Vec<_> = page.split_whitespace().collect();
    for pair in words.windows(2) {
        let unit = pair[1].trim_end_matches([',', '.', ')', ';', ':']);
        let is_bound = ["ms", "s", "rps", "rpm", "counts", "%"].contains(&unit)
            && pair[0].trim_start_matches('(').parse::<f64>().is_ok();
        assert!(!is_bound, "nothing is compared with this bound: {}", pair.join(" "));
    }
}

#[test]
fn every_promise_of_the_threat_model_is_shown_by_something_that_exists() {
    // The tool's tests are not in the package.
    if !Path::new(env!("CARGO_MANIFEST_DIR")).join("examples/axle").exists() {
        return;
    }
    let tests = tests_below(&["tests", "src", "examples/axle"]);
    let (_, table) = SECURITY.split_once("\n|---|---|---|\n").expect("a table");
    for row in table.lines() {
        let cells: Vec<&str> = row.trim_matches('|').split('|').map(str::trim).collect();
        let [_, promise, shown] = cells[..] else { panic!("{row}") };
        assert_eq!(promise.contains("**no promise**"), shown.is_empty(), "{row}");
        let names = shown.split('`').skip(1).step_by(2);
        for name in names.filter(|name| !name.contains([' ', '/'])) {
            assert!(tests.contains(name), "no test is called {name}");
        }
    }
}
