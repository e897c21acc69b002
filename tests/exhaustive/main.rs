//! Proofs by trying everything, where everything is little enough.
//!
//! A small part of each runs with the other tests. All of it, with its figures:
//!
//! ```sh
//! cargo test --release --test exhaustive -- --ignored --nocapture
//! ```

#![cfg(all(feature = "ikeya", feature = "ucp", feature = "alloc"))]

/// Random damage: how often the CRC misses it.
mod chance;
/// Both forms of the CRC against a CRC computed bit by bit.
mod checksum;
#[path = "../harness/dice.rs"]
#[allow(dead_code, reason = "only bytes are random here")]
mod dice;
/// Errors of up to three bits, and bursts.
mod errors;
/// Damage that makes a frame look longer or shorter than it is.
mod lengths;
#[path = "../harness/oracle.rs"]
#[allow(dead_code, reason = "only its CRC matters here")]
mod oracle;
/// All payloads of a bus packet.
mod payloads;
/// All strings of four bytes.
mod reads;

use axlewire::{
    crc16,
    encode::Encode,
    ikeya::{
        NodeId, Position, PositionResponse, ReadRequest, Rps, VelocityResponse, WriteRequest, three,
    },
    stream::{Frames, Framing, Verdict},
    ucp::Ucp,
};
use dice::Dice;
use std::{
    ops::Range,
    sync::atomic::{AtomicU64, Ordering},
    thread,
};

/// Does `work` for all of `0..end` on all cores, piece by piece; the results are in no order.
fn on_all_cores<T: Send>(end: u64, work: impl Fn(Range<u64>) -> T + Sync) -> Vec<T> {
    let (piece, next) = (end.div_ceil(256).max(1), AtomicU64::new(0));
    let worker = || {
        let (_end, mut done) = (EndIfPanicking { next: &next, end }, Vec::new());
        loop {
            let start = next.fetch_add(piece, Ordering::Relaxed);
            if start >= end {
                return done;
            }
            done.push(work(start..end.min(start + piece)));
        }
    };
    thread::scope(|scope| {
        let cores = thread::available_parallelism().map_or(1, usize::from);
        let workers: Vec<_> = (0..cores).map(|_| scope.spawn(worker)).collect();
        workers.into_iter().flat_map(|worker| worker.join().unwrap()).collect()
    })
}

/// When one core has found a fault, the others need not go on.
struct EndIfPanicking<'a> {
    next: &'a AtomicU64,
    end: u64,
}

impl Drop for EndIfPanicking<'_> {
    fn drop(&mut self) {
        if thread::panicking() {
            self.next.store(self.end, Ordering::Relaxed);
        }
    }
}

#[test]
fn the_work_is_done_once_for_every_number() {
    for end in [0, 1, 255, 256, 257, 100_000] {
        let pieces = on_all_cores(end, |range| range.sum::<u64>());
        assert_eq!(pieces.iter().sum::<u64>(), (0..end).sum());
    }
}
