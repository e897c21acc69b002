//! A year and a day of virtual time, under a schedule of faults: a master with eight slaves, and a
//! host with its robot. At every look the motion, the health and the counts are checked, and at the
//! end nothing has drifted.
//!
//! Some minutes run with the other tests. All of it, with a table:
//!
//! ```sh
//! cargo test --release --test soak -- --ignored --nocapture
//! ```
//!
//! `AXLEWIRE_SOAK_PART=0.1` runs a tenth of each.

#![cfg(all(feature = "sim", feature = "ikeya", feature = "ucp"))]

mod account;
mod bus;
mod bus_application;
mod bus_checks;
mod lane;
mod plan;
mod rover;
mod rover_checks;
mod schedule;
mod station;

use axlewire::{
    endpoint::Endpoint,
    ikeya::{
        Mode, NodeId, Position, Target,
        master::{Health, StopProgress},
    },
    sim::{Faults, Rng},
    time::{Duration, Instant},
};
use {
    account::Account,
    bus::{Bus, NODES, Order},
    lane::Lane,
    plan::{DAY, HOUR, Plan, SECOND},
    rover::Link,
    schedule::{End, Fault, Schedule},
    station::{Beats, Clock, Station},
};

fn part() -> f64 {
    std::env::var("AXLEWIRE_SOAK_PART").map_or(1.0, |text| text.parse().unwrap())
}

/// A year, each node read once a second.
fn year() -> Plan {
    Plan {
        name: "bus, once a second",
        seed: 1,
        length_us: (365.0 * DAY as f64 * part()) as u64,
        poll_us: SECOND,
        is_fastest: false,
        step_us: SECOND,
        orders_every: 30,
        fault_us: 2 * HOUR,
        unplugged_us: 6 * HOUR,
        resets_us: 5 * DAY,
        slower: 10,
    }
}

/// A day, as fast as the line allows.
fn day() -> Plan {
    Plan {
        name: "bus, as fast as it goes",
        seed: 2,
        length_us: (DAY as f64 * part()) as u64,
        poll_us: 10_000,
        is_fastest: true,
        step_us: 10_000,
        orders_every: 300,
        fault_us: 120 * SECOND,
        unplugged_us: 600 * SECOND,
        resets_us: DAY,
        slower: 1,
    }
}

/// Runs a bus.
fn run_bus(plan: Plan) {
    let begin = std::time::Instant::now();
    let mut bus = Bus::new(plan);
    bus.run();
    let account = &bus.account;
    account.print(&plan, "READ", begin.elapsed().as_secs_f64());
    assert_eq!(account.missed_periods, 0);
    let checks = &account.checks;
    assert!(checks.health > 0 && checks.paid > 0 && checks.sums > 0, "{checks:?}");
}

/// Runs a host with a robot.
fn run_link(plan: Plan) {
    let begin = std::time::Instant::now();
    let mut link = Link::new(plan);
    link.run();
    let account = &link.account;
    account.print(&plan, "report", begin.elapsed().as_secs_f64());
    assert_eq!(account.missed_periods, 0);
    let checks = &account.checks;
    assert!(checks.health > 0 && checks.paid > 0 && checks.watchdogs > 0, "{checks:?}");
}

#[test]
fn ten_minutes_of_a_bus_break_no_invariant() {
    run_bus(Plan {
        length_us: 600 * SECOND,
        fault_us: 20 * SECOND,
        unplugged_us: 60 * SECOND,
        resets_us: 200 * SECOND,
        ..year()
    });
}

#[test]
fn two_seconds_of_a_busy_bus_break_no_invariant() {
    run_bus(Plan { length_us: 2 * SECOND, fault_us: 200_000, unplugged_us: SECOND, ..day() });
}

#[test]
#[ignore = "takes many minutes: see the top of this file"]
fn a_year_of_a_bus_breaks_no_invariant() {
    run_bus(year());
}

#[test]
#[ignore = "takes many minutes: see the top of this file"]
fn a_day_of_a_busy_bus_breaks_no_invariant() {
    run_bus(day());
}

#[test]
fn twenty_minutes_of_a_slow_rover_break_no_invariant() {
    run_link(Plan {
        length_us: 1200 * SECOND,
        fault_us: 60 * SECOND,
        unplugged_us: 60 * SECOND,
        resets_us: 600 * SECOND,
        ..year()
    });
}

#[test]
fn a_minute_of_a_rover_breaks_no_invariant() {
    run_link(Plan {
        length_us: 60 * SECOND,
        step_us: 100_000,
        orders_every: 20,
        fault_us: 4 * SECOND,
        unplugged_us: 4 * SECOND,
        resets_us: 30 * SECOND,
        ..day()
    });
}

#[test]
#[ignore = "takes many minutes: see the top of this file"]
fn a_year_of_a_slow_rover_breaks_no_invariant() {
    run_link(Plan { name: "rover, all periods ten times as long", ..year() });
}

#[test]
#[ignore = "takes many minutes: see the top of this file"]
fn a_day_of_a_rover_breaks_no_invariant() {
    run_link(Plan { name: "rover, a report every 20 ms", step_us: 100_000, ..day() });
}
