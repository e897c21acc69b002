//! Runs the fuzz targets on stable: over their seeds, whole, cut and damaged. A body that does
//! nothing, or leaves out a kind of operation, fails as well.
#![cfg(all(feature = "ikeya", feature = "ucp", feature = "sim", feature = "arbitrary"))]
#![cfg(feature = "embedded-io-async")]

#[path = "models/kit.rs"]
#[allow(dead_code, reason = "the models use more of it")]
mod kit;
#[path = "harness/rulings.rs"]
#[allow(dead_code, reason = "the tests use more of it")]
mod rulings;
#[path = "../fuzz/src/targets/mod.rs"]
mod targets;

use std::{
    collections::BTreeSet,
    fs,
    path::{Path, PathBuf},
};

use targets::{Tally, Target};

/// Most seeds of a target, and their bytes: they are checked in.
const MOST_SEEDS: usize = 300;
const MOST_BYTES: usize = 150_000;

fn folder(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("fuzz").join(name)
}

/// The names of what is in a folder of `fuzz`, without their endings.
fn names(folder: &Path) -> BTreeSet<String> {
    let files = fs::read_dir(folder).unwrap_or_else(|error| panic!("{folder:?}: {error}"));
    let stem = |path: PathBuf| path.file_stem().unwrap().to_str().unwrap().to_owned();
    files.map(|file| stem(file.unwrap().path())).collect()
}

fn seeds(target: &Target) -> Vec<Vec<u8>> {
    let folder = folder("seeds").join(target.name);
    let files = fs::read_dir(&folder).unwrap_or_else(|error| panic!("{folder:?}: {error}"));
    let mut paths: Vec<_> = files.map(|file| file.unwrap().path()).collect();
    paths.sort();
    paths.into_iter().map(|path| fs::read(path).unwrap()).collect()
}

/// Runs a target over its seeds, whole, cut and damaged.
fn run(name: &str) {
    let target = targets::ALL.iter().find(|target| target.name == name).unwrap();
    let seeds = seeds(target);
    assert!(seeds.len() >= 10, "{} seeds of {name}", seeds.len());
    let mut tally = Tally::default();
    for seed in &seeds {
        (target.body)(seed, &mut tally);
    }
    let least = seeds.len() as u64 / 4;
    assert!(tally.ops >= least, "{name} is hollow: {} operations, not {least}", tally.ops);
    let kinds = tally.kinds.count_ones();
    assert!(
        kinds >= target.kinds,
        "{name} did {kinds} of {} kinds: {:b}",
        target.kinds,
        tally.kinds
    );
    println!("{name}: {} seeds, {} operations of {kinds} kinds", seeds.len(), tally.ops);

    let mut dice = Dice(0x5EED);
    for seed in &seeds {
        for _ in 0..target.copies {
            let mut damaged = seed.clone();
            for _ in 0..=dice.below(3) {
                dice.damage(&mut damaged);
            }
            damaged.truncate(dice.below(4 * damaged.len() + 1));
            (target.body)(&damaged, &mut tally);
        }
    }
}

/// The same numbers on every run: xorshift64.
struct Dice(u64);

impl Dice {
    fn below(&mut self, end: usize) -> usize {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        (self.0 >> 16) as usize % end
    }

    fn damage(&mut self, bytes: &mut Vec<u8>) {
        let at = self.below(bytes.len() + 1);
        match (self.below(4), bytes.get_mut(at)) {
            (0, Some(byte)) => *byte ^= 1 << self.below(8),
            (1, Some(byte)) => *byte = self.below(256) as u8,
            (2, Some(_)) => drop(bytes.remove(at)),
            _ => bytes.insert(at, self.below(256) as u8),
        }
    }
}

macro_rules! over_the_seeds {
    ($($sentence:ident: $target:literal;)+) => {
        $(
            #[test]
            fn $sentence() {
                run($target);
            }
        )+

        const TESTED: &[&str] = &[$($target),+];
    };
}

over_the_seeds! {
    ikeya_streams_give_what_the_oracle_says: "ikeya_stream";
    ucp_streams_give_what_the_oracle_says: "ucp_stream";
    captures_give_the_same_in_lanes_in_parts_and_one_by_one: "captures";
    any_bytes_have_the_same_crc_in_both_forms_as_bit_by_bit: "crc16";
    values_survive_the_wire: "roundtrip";
    numbers_print_as_core_prints_them: "text";
    times_and_schedules_are_those_of_wide_arithmetic: "times";
    a_master_survives_any_calls_bytes_and_times: "ikeya_master";
    a_slave_survives_any_calls_bytes_and_times: "ikeya_slave";
    a_host_survives_any_calls_bytes_and_times: "ucp_host";
    a_robot_survives_any_calls_bytes_and_times: "ucp_robot";
    readers_and_writers_lose_nothing_whatever_their_port_does: "frame_io";
    the_drivers_of_a_bus_say_ok_only_when_it_is_true: "drive_bus";
    the_drivers_of_a_link_say_ok_only_when_it_is_true: "drive_link";
    the_simulator_conserves_bytes_and_finds_broken_contracts: "sim_line";
    every_session_ends_with_its_stops_confirmed_and_its_motors_obedient: "session";
}

#[test]
fn every_target_has_a_binary_seeds_and_a_test() {
    let known: BTreeSet<String> = targets::ALL.iter().map(|it| it.name.to_owned()).collect();
    assert_eq!(known, TESTED.iter().map(|name| (*name).to_owned()).collect());
    // That of the C functions is not run here: this package does not have them.
    let others = |folder: &Path| -> BTreeSet<_> {
        names(folder).into_iter().filter(|name| name != "c_functions").collect()
    };
    assert_eq!(known, others(&folder("fuzz_targets")));
    assert_eq!(known, others(&folder("seeds")));
    let manifest = fs::read_to_string(folder("Cargo.toml")).unwrap();
    let binaries = manifest.lines().filter_map(|line| line.strip_prefix("path = \"fuzz_targets/"));
    let binaries: BTreeSet<_> =
        binaries.map(|it| it.trim_end_matches(".rs\"").to_owned()).collect();
    assert_eq!(known, binaries.into_iter().filter(|name| name != "c_functions").collect());
}

#[test]
fn the_seeds_are_few_and_small() {
    for target in targets::ALL {
        let seeds = seeds(target);
        let bytes: usize = seeds.iter().map(Vec::len).sum();
        assert!(seeds.len() <= MOST_SEEDS, "{} seeds of {}", seeds.len(), target.name);
        assert!(bytes <= MOST_BYTES, "{bytes} bytes of seeds of {}", target.name);
    }
}
