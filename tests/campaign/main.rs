//! A stop at a random moment on a line with every fault at once: how long and how far each motor
//! still moves, compared with the bounds on the safety page; when a stop reaches a node whose cable
//! is back; and whether a motor that is seen to be still is told to be.
//!
//! Twenty episodes of each kind run with the other tests. To run all 50,000 of each kind and print
//! the table:
//!
//! ```sh
//! cargo test --release --test campaign -- --ignored --nocapture
//! ```

#![cfg(all(feature = "sim", feature = "ikeya", feature = "ucp"))]

/// An episode on a bus.
mod bus;
/// The results of all episodes.
mod results;
/// An episode with a rover.
mod rover;

use axlewire::{
    endpoint::Endpoint,
    sim::{Direction, Faults, Line, Rng, Who},
    time::{Duration, Instant},
};
use results::{Cable, Run, Table};

/// Seeds of the quick run.
const QUICK: std::ops::Range<u64> = 0..20;

/// Every fault at once, each of random strength.
fn faults(rng: &mut Rng, longest_delay_us: u64) -> Faults {
    let mut faults = Faults::noise(part(rng) * 1e-3);
    faults.lost = part(rng) * 2e-4;
    faults.duplicated = part(rng) * 2e-4;
    faults.inserted = part(rng) * 2e-4;
    faults.stray = rng.chance(0.5).then(|| rng.byte());
    faults.delay = Duration::from_micros(rng.below(longest_delay_us) as u32);
    faults.jitter = Duration::from_micros(rng.below(longest_delay_us) as u32);
    faults
}

/// A number from 0 to 1.
fn part(rng: &mut Rng) -> f64 {
    rng.below(1_000_001) as f64 / 1e6
}

/// A time from `from` to `to` milliseconds.
fn millis(rng: &mut Rng, from: u64, to: u64) -> Duration {
    Duration::from_micros((1000 * from + rng.below(1000 * (to - from) + 1)) as u32)
}

/// All episodes with these seeds, on two threads.
fn run(seeds: std::ops::Range<u64>, episode: fn(u64) -> Vec<Run>) -> Table {
    let middle = seeds.start + (seeds.end - seeds.start) / 2;
    let halves = [seeds.start..middle, middle..seeds.end];
    let halves = halves.map(|half| std::thread::spawn(move || half.flat_map(episode).collect()));
    let runs: Vec<Vec<Run>> = halves.into_iter().map(|half| half.join().unwrap()).collect();
    Table::new(runs.concat())
}

fn check(seeds: std::ops::Range<u64>, episode: fn(u64) -> Vec<Run>) {
    let table = run(seeds, episode);
    println!("{table}");
    table.check();
}

#[test]
fn every_motor_of_a_bus_stops_within_its_bound() {
    check(QUICK, bus::episode);
}

#[test]
fn every_rover_stops_within_its_bound() {
    check(QUICK, rover::episode);
}

#[test]
#[ignore = "takes minutes: see the top of this file"]
fn every_motor_of_a_bus_stops_within_its_bound_50_000_times() {
    check(0..50_000, bus::episode);
}

#[test]
#[ignore = "takes minutes: see the top of this file"]
fn every_rover_stops_within_its_bound_50_000_times() {
    check(0..50_000, rover::episode);
}
