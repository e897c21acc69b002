//! Runs the fuzz targets on stable: over their seeds, every truncation of a seed, and a few hundred
//! damaged copies of it.
#![cfg(all(feature = "ikeya", feature = "ucp"))]

#[path = "../fuzz/src/bodies.rs"]
#[expect(unreachable_pub, reason = "the fuzz crate exports them")]
mod bodies;

#[path = "../fuzz/src/roles.rs"]
#[expect(unreachable_pub, reason = "the fuzz crate exports them")]
mod roles;

use std::{fs, path::Path};

/// Runs `body` over the seeds of `target`, whole, cut and damaged.
fn run(target: &str, body: fn(&[u8])) {
    let seeds = seeds(target);
    assert!(seeds.len() >= 30, "{} seeds of {target}", seeds.len());
    let mut dice = Dice(0x5EED);
    for seed in &seeds {
        body(seed);
        for len in 0..seed.len() {
            body(&seed[..len]);
        }
        for _ in 0..200 {
            let mut damaged = seed.clone();
            for _ in 0..=dice.below(3) {
                dice.damage(&mut damaged);
            }
            body(&damaged);
        }
        // The tail of one seed after the head of another.
        let other = &seeds[dice.below(seeds.len())];
        let (head, tail) = (dice.below(seed.len() + 1), dice.below(other.len() + 1));
        body(&[&seed[..head], &other[tail..]].concat());
    }
}

fn seeds(target: &str) -> Vec<Vec<u8>> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("fuzz/seeds").join(target);
    let files = fs::read_dir(&folder).unwrap_or_else(|error| panic!("{folder:?}: {error}"));
    let mut paths: Vec<_> = files.map(|file| file.unwrap().path()).collect();
    paths.sort();
    paths.into_iter().map(|path| fs::read(path).unwrap()).collect()
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

#[test]
fn ikeya_streams_give_what_the_oracle_says() {
    run("ikeya_stream", bodies::ikeya_stream);
}

#[test]
fn ucp_streams_give_what_the_oracle_says() {
    run("ucp_stream", bodies::ucp_stream);
}

/// Roles have no seeds: random scripts are as good.
fn play(body: fn(&[u8])) {
    let mut dice = Dice(0x5EED);
    for len in 0..600 {
        for _ in 0..5 {
            body(&(0..len).map(|_| dice.below(256) as u8).collect::<Vec<_>>());
        }
    }
}

#[test]
fn any_bytes_have_the_same_crc_as_bit_by_bit() {
    play(bodies::crc16);
}

#[test]
fn a_master_survives_any_calls_bytes_and_times() {
    play(roles::ikeya_master);
}

#[test]
fn a_slave_survives_any_calls_bytes_and_times() {
    play(roles::ikeya_slave);
}

#[test]
fn a_host_survives_any_calls_bytes_and_times() {
    play(roles::ucp_host);
}

#[test]
fn a_robot_survives_any_calls_bytes_and_times() {
    play(roles::ucp_robot);
}

#[test]
fn values_survive_the_wire() {
    run("roundtrip", bodies::roundtrip);
}
