//! A noisy line: what is sent, what noise makes of it, and how much of it is left to be found.
//!
//! The bench `noise` and the test `noise` use the same lines.

use std::collections::HashSet;

use super::{
    dice::Dice,
    oracle::{self, Rules},
    traffic::Traffic,
};

/// Offset and length of a frame, in the bytes that arrive.
pub(crate) type Place = (usize, usize);

/// The faults of a line.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub(crate) enum Noise {
    None,
    /// Flips one bit in this many.
    BitErrors(usize),
    /// Inserts or deletes a byte at one in this many.
    Slips(usize),
    /// Sends 1 to 64 random bytes before one frame in this many.
    Bursts(usize),
    /// Sends 1 to 16 bytes that look like headers before one frame in this many.
    HeaderBursts(usize),
    /// Truncates one frame in this many.
    Truncation(usize),
}

impl Noise {
    pub(crate) const ALL: [Self; 10] = [
        Self::None,
        Self::BitErrors(100_000),
        Self::BitErrors(10_000),
        Self::BitErrors(1_000),
        Self::Slips(10_000),
        Self::Slips(1_000),
        Self::Bursts(10),
        Self::Bursts(1),
        Self::HeaderBursts(2),
        Self::Truncation(20),
    ];

    pub(crate) fn name(self) -> String {
        // The rates are powers of ten.
        let one_in = |rate: usize| format!("1e-{}", rate.ilog10());
        match self {
            Self::None => "clean".to_owned(),
            Self::BitErrors(rate) => format!("bits-{}", one_in(rate)),
            Self::Slips(rate) => format!("slips-{}", one_in(rate)),
            Self::Bursts(1) => "bursts-all".to_owned(),
            Self::Bursts(_) => "bursts".to_owned(),
            Self::HeaderBursts(_) => "headers".to_owned(),
            Self::Truncation(_) => "cuts".to_owned(),
        }
    }
}

/// What arrives at the end of a line.
#[derive(Clone, Debug)]
pub(crate) struct Arrival {
    pub(crate) bytes: Vec<u8>,
    /// Frames that a receiver finds by the rulings, as the oracle applies them: in order, a byte
    /// in one frame at most.
    pub(crate) valid: Vec<Place>,
    /// Frames that arrive whole: all bytes of one sent, in one piece, where it was sent. Damage
    /// that happens to change nothing counts for nothing.
    whole: HashSet<Place>,
    /// Those that are also valid. The others share bytes with something valid before them.
    intact: HashSet<Place>,
    /// Valid frames that did not arrive whole.
    accidents: HashSet<Place>,
}

/// Sends so many frames over a noisy line. The same seed gives the same bytes.
pub(crate) fn transmit(traffic: Traffic, noise: Noise, frames: usize, seed: u64) -> Arrival {
    let name = format!("{}/{}", traffic.name(), noise.name());
    let mut dice =
        name.bytes().fold(Dice(seed), |mut dice, byte| Dice(dice.next() ^ u64::from(byte)));
    let (mut bytes, mut spans) = (Vec::new(), Vec::new());
    for index in 0..frames {
        let frame = traffic.frame(&mut dice, index as u8);
        burst(traffic, noise, &mut dice, &mut bytes);
        let start = bytes.len();
        send(&frame, noise, &mut dice, &mut bytes);
        spans.push((start, bytes.len(), frame));
    }
    let whole = spans.iter().filter_map(|(start, end, frame)| {
        // A byte may be inserted in front, or the one in front may take the place of a lost one.
        let last = (*start).max(end.saturating_sub(frame.len()));
        let at = (start.saturating_sub(1)..=last).find(|&at| bytes[at..].starts_with(frame))?;
        Some((at, frame.len()))
    });
    let whole = whole.collect();
    // The line goes quiet at the end, until nothing is left that could be the start of a frame.
    let (rules, silence) = (traffic.rules(), vec![bytes.len(); 256]);
    let valid = oracle::answer(rules, &bytes, &silence).frames();
    Arrival::new(rules, bytes, valid, whole)
}

fn burst(traffic: Traffic, noise: Noise, dice: &mut Dice, bytes: &mut Vec<u8>) {
    match noise {
        Noise::Bursts(rate) if dice.one_in(rate) => {
            let len = 1 + dice.below(64);
            bytes.extend((0..len).map(|_| dice.below(256) as u8));
        }
        Noise::HeaderBursts(rate) if dice.one_in(rate) => {
            let (len, headers) = (1 + dice.below(16), traffic.header_bytes());
            bytes.extend((0..len).map(|_| headers[dice.below(headers.len())]));
        }
        _ => {}
    }
}

fn send(frame: &[u8], noise: Noise, dice: &mut Dice, bytes: &mut Vec<u8>) {
    let end = match noise {
        Noise::Truncation(rate) if dice.one_in(rate) => dice.below(frame.len()),
        _ => frame.len(),
    };
    for &byte in &frame[..end] {
        match noise {
            Noise::BitErrors(rate) => {
                let flips = (0..8).filter(|_| dice.one_in(rate)).map(|bit| 1_u8 << bit);
                bytes.push(flips.fold(byte, |byte, flip| byte ^ flip));
            }
            Noise::Slips(rate) if dice.one_in(rate) => {
                if dice.one_in(2) {
                    bytes.extend([dice.below(256) as u8, byte]);
                }
            }
            _ => bytes.push(byte),
        }
    }
}

/// What a receiver has made of an arrival.
#[derive(Clone, Copy, Debug, Default, Eq, PartialEq)]
pub(crate) struct Tally {
    /// Frames that arrive whole, and whose bytes belong to nothing valid before them. Where two
    /// frames share bytes, as when one has lost its last byte and the same first byte of the next
    /// completes it, only the first can be delivered (ruling B2): the second counts for nobody. So
    /// does a frame inside a packet that noise has made, with a good CRC and the id of no node:
    /// such packets are skipped as a whole (ruling I1).
    pub(crate) intact: usize,
    /// Those delivered.
    pub(crate) delivered: usize,
    /// Deliveries of anything that did not arrive whole, and second deliveries.
    pub(crate) phantoms: usize,
    /// Byte strings that were not sent, or not there, but are valid frames by the oracle: the
    /// noise has made them so, and no receiver can tell.
    pub(crate) unavoidable: usize,
    /// Phantoms that are none of these.
    pub(crate) invented: usize,
}

impl Tally {
    /// Whether every intact frame was delivered, and nothing that the noise has not made valid.
    pub(crate) const fn is_perfect(&self) -> bool {
        self.delivered == self.intact && self.invented == 0
    }
}

impl Arrival {
    /// # Panics
    ///
    /// If a frame that arrives whole is not valid, and shares no byte with anything valid before
    /// it: then the oracle, which defines what is valid, has lost it.
    pub(crate) fn new(
        rules: Rules,
        bytes: Vec<u8>,
        valid: Vec<Place>,
        whole: HashSet<Place>,
    ) -> Self {
        let places: HashSet<Place> = valid.iter().copied().collect();
        for &(start, _) in whole.difference(&places) {
            let before = valid.partition_point(|&(at, _)| at < start).checked_sub(1);
            let end = before.map_or(0, |before| valid[before].0 + valid[before].1);
            let is_covered = end > start || is_in_a_foreign_packet(rules, &bytes, start);
            assert!(is_covered, "the oracle has lost the frame at {start}");
        }
        let intact = whole.intersection(&places).copied().collect();
        let accidents = places.difference(&whole).copied().collect();
        Self { bytes, valid, whole, intact, accidents }
    }

    /// Number of frames that arrive whole, but share bytes with something valid before them.
    pub(crate) fn contested(&self) -> usize {
        self.whole.len() - self.intact.len()
    }

    /// Counts what a receiver has delivered.
    pub(crate) fn tally(&self, delivered: &[Place]) -> Tally {
        let (intact, unavoidable) = (self.intact.len(), self.accidents.len());
        let mut tally = Tally { intact, unavoidable, ..Tally::default() };
        let mut seen = HashSet::new();
        for place in delivered {
            if !seen.insert(place) {
                tally.phantoms += 1;
                tally.invented += 1;
            } else if self.intact.contains(place) {
                tally.delivered += 1;
            } else if !self.whole.contains(place) {
                tally.phantoms += 1;
                tally.invented += usize::from(!self.accidents.contains(place));
            }
        }
        tally
    }
}

/// Whether a packet with a good CRC and the id of no node reaches beyond `start`: it is skipped as
/// a whole (ruling I1).
fn is_in_a_foreign_packet(rules: Rules, bytes: &[u8], start: usize) -> bool {
    matches!(rules, Rules::Ikeya { .. })
        && (start.saturating_sub(15)..start).any(|at| {
            let bytes = &bytes[at..];
            let len = oracle::promised_len(rules, bytes).ok().flatten().unwrap_or(0);
            let packet = bytes.get(..len).unwrap_or_default();
            let Some((body, crc)) = packet.split_last_chunk::<2>() else { return false };
            at + len > start
                && oracle::crc(body).to_le_bytes() == *crc
                && !(1..=8).contains(&packet[1])
        })
}
