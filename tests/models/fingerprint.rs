//! The fingerprint of a role: equal for states that differ only in absolute time and in counters.
//!
//! It is built from the role's `{:?}`: every `Instant` becomes its distance to now, and fields that
//! cannot affect the future are left out. So no private field has to be exposed.

use crate::names::*;
use std::fmt::{Debug, Write};

/// Older times are equivalent. No role looks back further than this, microseconds: the longest
/// limit in these models is the 20 ms between two positions that show a standstill. The roles of
/// UCP keep the ends of their waits, which are in the future.
const LONG_AGO: i64 = -100_000;

/// Times before which something must not happen. Once they have passed, their value is irrelevant.
const EARLIEST: [&str; 5] = ["guarded_until", "line_free", "next_at", "read_due", "guard_until"];

/// How states of one kind of world are distinguished.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Merge {
    pub(crate) now: Instant,
    /// Fields that are left out.
    pub(crate) skipped: &'static [&'static str],
}

/// Counters, settings that never change, data already handed out, and what an account notes for a
/// check of its own; and the last answer, which is left out if no stop may hold its position.
pub(crate) const COUNTERS_AND_STATUS: &[&str] = &[
    "config",
    "last_failure",
    "ledger",
    "lost",
    "packet",
    "has_answered",
    "has_failed",
    "places_heard",
    "places_heard_at",
    "places_shown",
    "sent",
    "statistics",
    "status",
];

pub(crate) const COUNTERS: &[&str] = match COUNTERS_AND_STATUS {
    [counters @ .., _] => counters,
    [] => &[],
};

impl Merge {
    pub(crate) fn fingerprint(self, state: &impl Debug) -> u64 {
        let mut text = String::with_capacity(16_384);
        write!(text, "{state:?}").expect("a String takes everything");
        let mut reader = Reader {
            now: self.now,
            skipped: self.skipped.iter().map(|name| hash(name.as_bytes())).collect(),
            earliest: EARLIEST.map(|name| hash(name.as_bytes())),
            hash: 0,
            is_earliest: false,
            is_instant: false,
            is_count: false,
            counts: Vec::new(),
        };
        reader.read(text.as_bytes());
        reader.hash
    }
}

fn mixed(hash: u64, value: u64) -> u64 {
    let hash = (hash.rotate_left(5) ^ value).wrapping_mul(0x9E37_79B9_7F4A_7C15);
    hash ^ hash >> 29
}

fn hash(word: &[u8]) -> u64 {
    word.iter().fold(0, |hash, &byte| with_byte(hash, byte))
}

/// Five more bits: digits differ in four, letters in five.
const fn with_byte(hash: u64, byte: u8) -> u64 {
    hash.rotate_left(5) ^ byte as u64
}

/// Reads a `{:?}` word by word and hashes it.
struct Reader {
    now: Instant,
    /// Hashes of the names.
    skipped: Vec<u64>,
    earliest: [u64; 5],
    hash: u64,
    /// The current word belongs to a field of [`EARLIEST`].
    is_earliest: bool,
    /// It belongs to an `Instant`.
    is_instant: bool,
    /// It is the count of a position. Only which ones are equal matters: they are numbered.
    is_count: bool,
    counts: Vec<u64>,
}

impl Reader {
    // Plain loops: in an unoptimized test build, anything else would dominate the run time.
    fn read(&mut self, text: &[u8]) {
        // Depth of open brackets, and of those around the field that is left out.
        let (mut depth, mut skipped_at) = (0_u32, None);
        let (mut word, mut start, mut at) = (0, 0, 0);
        while at < text.len() {
            let byte = text[at];
            at += 1;
            if IS_OF_WORD[byte as usize] {
                word = with_byte(word, byte);
                continue;
            }
            if start + 1 < at {
                if skipped_at.is_none() && self.is_skipped(word, &text[start..at - 1], byte) {
                    skipped_at = Some(depth);
                }
                word = 0;
            }
            start = at;
            if byte == b' ' {
                continue;
            }
            let is_closed = matches!(byte, b'}' | b']' | b')');
            if skipped_at == Some(depth) && (is_closed || byte == b',') {
                skipped_at = None;
            }
            match byte {
                b'{' | b'[' | b'(' => depth += 1,
                _ if is_closed => depth -= 1,
                _ => continue,
            }
            if skipped_at.is_none() {
                self.hash = mixed(self.hash, u64::from(byte));
            }
        }
    }

    /// Takes in a word; returns whether it names a field that is left out.
    fn is_skipped(&mut self, hash: u64, word: &[u8], delimiter: u8) -> bool {
        if delimiter == b':' {
            if word != b"micros" {
                self.is_earliest = self.earliest.contains(&hash);
            }
            self.is_count = word == b"count";
            return self.skipped.contains(&hash);
        }
        if self.is_instant {
            self.is_instant = false;
            let mut micros = 0_u64;
            for &digit in word {
                micros = micros * 10 + u64::from(digit - b'0');
            }
            let distance = micros.wrapping_sub(self.now.as_micros()) as i64;
            let distance = distance.max(if self.is_earliest { 0 } else { LONG_AGO });
            self.hash = mixed(self.hash, distance as u64);
        } else if hash == INSTANT {
            self.is_instant = true;
        } else if std::mem::take(&mut self.is_count) {
            let known = self.counts.iter().position(|&count| count == hash);
            let number = known.unwrap_or(self.counts.len());
            self.counts.extend(known.is_none().then_some(hash));
            self.hash = mixed(self.hash, number as u64);
        } else {
            self.hash = mixed(self.hash, hash);
        }
        false
    }
}

const INSTANT: u64 = {
    let (name, mut hash, mut at) = (b"Instant", 0, 0);
    while at < name.len() {
        hash = with_byte(hash, name[at]);
        at += 1;
    }
    hash
};

const IS_OF_WORD: [bool; 256] = {
    let (mut table, mut byte) = ([false; 256], 0_usize);
    while byte < 256 {
        let is_mark = matches!(byte as u8, b'_' | b'.' | b'-');
        table[byte] = (byte as u8).is_ascii_alphanumeric() || is_mark;
        byte += 1;
    }
    table
};
