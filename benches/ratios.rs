//! Speed of axlewire relative to C and to other crates: one line per figure, `name value goal`;
//! higher is better.
//!
//! `cargo bench --bench ratios` takes less than 50 seconds once it is built. Contenders take turns,
//! and a value is the ratio of their medians, so other load on the machine affects both sides
//! alike. It fails if an answer is wrong, and with `-- --goals` if a figure is below its goal.
//!
//! With `-- --test` the contenders pretend to take known times (`pretended.rs`), and every figure
//! must be the one of these times.

use std::{env, hint::black_box, process::ExitCode};

use axlewire::{crc16, ucp::Ucp};
use axlewire_contenders::{
    Protocol, Tally, figures, ours, peers,
    peers::Peer,
    race::{Contender, Stopwatch, race},
    reference,
    streams::{self, Rng, Stream},
};
use crc::{CRC_16_MODBUS, Crc, Table};

mod pretended;

/// Amount of work; small for a test run.
struct Effort {
    /// Length of clean streams, bytes: larger than any cache.
    clean_len: usize,
    /// Length of streams for other crates, bytes.
    peers_len: usize,
    /// Length of streams with bit errors, bytes: generating the errors is slow.
    damaged_len: usize,
    /// Length of hostile streams, bytes: the oracle takes seconds per MiB of the worst.
    hostile_len: usize,
    /// Number of CRCs per timing.
    crc_calls: u64,
    /// Number of timings per stream decoder.
    rounds: usize,
    /// Number of timings per CRC.
    crc_rounds: usize,
    stopwatch: Stopwatch,
}

const FULL: Effort = Effort {
    clean_len: 64 << 20,
    peers_len: 32 << 20,
    damaged_len: 16 << 20,
    hostile_len: 8 << 20,
    crc_calls: 10_000,
    rounds: 7,
    crc_rounds: 101,
    stopwatch: Stopwatch::Real,
};

const TINY: Effort = Effort {
    clean_len: 64 << 10,
    peers_len: 64 << 10,
    damaged_len: 64 << 10,
    hostile_len: 64 << 10,
    crc_calls: 10,
    rounds: 1,
    crc_rounds: 1,
    stopwatch: Stopwatch::Pretended(pretended::seconds),
};

fn main() -> ExitCode {
    // As with criterion: `cargo bench` passes `--bench`; without it, the run should be short.
    let given = |wanted: &str| env::args().any(|argument| argument == wanted);
    let effort = if given("--bench") && !given("--test") { FULL } else { TINY };

    // Real decoders all give the same answer, so that two that are mixed up do not show. These do.
    let answers = [1, 2, 3, 5, 6].map(|sum| Tally { frames: 1, sum });
    let rehearsal = Stopwatch::Pretended(pretended::seconds);
    let _ = race(rehearsal, 1, contenders(pretended::PROTOCOL, answers, &[]));

    let clean = STREAMS.map(|(_, make)| StreamTimes::measure(make, &effort));
    let crc_6 = CrcTimes::measure(6, &effort);
    let crc_42 = CrcTimes::measure(42, &effort);
    let hostile = hostile(&effort);
    let peers = PeerTimes::measure(&effort);

    let of = |name: &str| hostile.iter().find(|pattern| pattern.name == name).expect("is listed");
    let worst = |over_c: fn(&Pattern) -> f64| {
        hostile
            .iter()
            .filter(|pattern| {
                !pattern.name.ends_with("noise") && pattern.name != LONGEST_CANDIDATES
            })
            .map(over_c)
            .fold(f64::INFINITY, f64::min)
    };

    let [ikeya8, mixed, ucp44] = &clean;
    let print = |name: &str, value, goal: f64| effort.print(name, value, goal);
    print("ikeya8_frames_over_c", ikeya8.c / ikeya8.frames, 4.2);
    print("ikeya8_each_over_c", ikeya8.c / ikeya8.each, 9.5);
    print("ikeya_mixed_over_c", mixed.c / mixed.frames, 4.2);
    print("ikeya_mixed_each_over_c", mixed.c / mixed.each, 4.2);
    print("ucp44_frames_over_c", ucp44.c / ucp44.frames, 8.5);
    print("ucp44_each_over_c", ucp44.c / ucp44.each, 12.5);
    print("ikeya8_decoder4096_over_frames", ikeya8.frames / ikeya8.decoder_4096, 0.85);
    print("ucp44_decoder4096_over_frames", ucp44.frames / ucp44.decoder_4096, 0.85);
    print("ikeya8_decoder1_over_c", ikeya8.c / ikeya8.decoder_1, 1.0);
    print("ucp44_decoder1_over_c", ucp44.c / ucp44.decoder_1, 1.0);
    print("crc42_over_c_table", crc_42.c / crc_42.ours, 6.5);
    print("crc6_over_best_crate", crc_6.best_crate() / crc_6.ours, 1.0);
    print("crc42_over_best_crate", crc_42.best_crate() / crc_42.ours, 1.0);
    print("noise_ikeya_over_c", of("Ikeya noise").over_c, 1.0);
    print("noise_ucp_over_c", of("UCP noise").over_c, 1.0);
    print("hostile_worst_over_c", worst(|pattern| pattern.over_c), 0.45);
    print("ucp44_over_mavlink", peers.mavlink / peers.ucp_44, 8.0);
    print("ucp44_over_modbus_core", peers.modbus_core_43 / peers.ucp_44, 6.5);
    print("ucp44_over_ublox", peers.ublox / peers.ucp_44, 1.8);
    print("ikeya8_over_modbus_core", peers.modbus_core_8 / peers.ikeya_8, 3.5);
    print("ikeya8_over_rmodbus", peers.rmodbus / peers.ikeya_8, 12.0);

    // Components of the figures above, and further figures.
    for ((name, _), times) in STREAMS.iter().zip(&clean) {
        times.print_throughput(name, &effort);
    }
    crc_6.print_crates(&effort);
    crc_42.print_crates(&effort);
    for pattern in &hostile {
        let name = pattern.name.to_lowercase().replace(' ', "_");
        effort.print(&format!("hostile_{name}_over_c"), pattern.over_c, None);
    }
    caps(&effort);
    for (name, make) in STREAMS {
        with_bit_errors(name, &make(effort.damaged_len), &effort);
    }
    figures::outcome()
}

/// Makes a stream of this many bytes.
type Make = fn(usize) -> Stream;

/// Ordinary traffic.
const STREAMS: [(&str, Make); 3] = [
    ("ikeya8", streams::responses),
    ("ikeya_mixed", streams::requests_and_responses),
    ("ucp44", streams::reports),
];

impl Effort {
    /// Prints one line.
    fn print(&self, name: &str, value: f64, goal: impl Into<Option<f64>>) {
        self.print_rounded(name, value, 3, goal);
    }

    fn print_rounded(&self, name: &str, value: f64, digits: usize, goal: impl Into<Option<f64>>) {
        figures::print(name, value, digits, goal.into());
        if let Stopwatch::Pretended(_) = self.stopwatch
            && let Some(due) = pretended::figure(name, self.clean_len, self.crc_calls)
        {
            // A stream is longer than asked for by less than a round of frames.
            assert!((value / due - 1.0).abs() < 0.01, "{name} is {value}, and should be {due}");
        }
    }
}

/// Times for one clean stream, seconds.
struct StreamTimes {
    /// Length of the stream, bytes.
    len: usize,
    c: f64,
    frames: f64,
    each: f64,
    decoder_4096: f64,
    decoder_1: f64,
}

/// All decoders of a protocol, each with its required answer.
fn contenders<'a>(
    protocol: Protocol,
    [c, frames, each, by_4096, pushed]: [Tally; 5],
    bytes: &'a [u8],
) -> [Contender<'a>; 5] {
    [
        Contender::new("C", c, move || (protocol.c_table)(bytes)),
        Contender::new("Frames", frames, move || (protocol.frames)(bytes)),
        Contender::new("each", each, move || (protocol.each)(bytes)),
        Contender::new("Decoder by 4096", by_4096, move || (protocol.decoder)(bytes, 4096)),
        Contender::new("Decoder, pushed", pushed, move || (protocol.pushed)(bytes)),
    ]
}

impl StreamTimes {
    fn measure(make: Make, effort: &Effort) -> Self {
        let Stream { name, protocol, bytes, intact, .. } = make(effort.clean_len);
        let bytes = &bytes[..];
        let all = (protocol.oracle)(bytes);
        assert_eq!(all.frames, intact.len() as u64, "{name}: the oracle");
        let [c, frames, each, decoder_4096, decoder_1] =
            race(effort.stopwatch, effort.rounds, contenders(protocol, [all; 5], bytes));
        Self { len: bytes.len(), c, frames, each, decoder_4096, decoder_1 }
    }

    /// Prints the figures that depend most on the machine.
    fn print_throughput(&self, stream: &str, effort: &Effort) {
        for (decoder, seconds) in [
            ("c", self.c),
            ("frames", self.frames),
            ("each", self.each),
            ("decoder4096", self.decoder_4096),
            ("decoder1", self.decoder_1),
        ] {
            let mb_per_s = self.len as f64 / seconds / 1e6;
            effort.print_rounded(&format!("mb_per_s_{stream}_{decoder}"), mb_per_s, 0, None);
        }
    }
}

/// Bit errors: share of intact frames recovered, and speed relative to the undamaged stream.
fn with_bit_errors(name: &str, clean: &Stream, effort: &Effort) {
    let protocol = clean.protocol;
    let sent = (protocol.oracle)(&clean.bytes);
    for (one_in, rate, goal) in
        [(100_000, "1e-5", None), (10_000, "1e-4", Some(0.85)), (1000, "1e-3", Some(0.5))]
    {
        let damaged = clean.with_bit_errors(one_in);
        let intact = &damaged.intact;
        let ends = (protocol.frame_ends)(&damaged.bytes);
        let found = intact.iter().filter(|end| ends.binary_search(end).is_ok()).count();
        assert_eq!(found, intact.len(), "{}: intact frames were lost", damaged.name);

        // C reports the number of frames found, not where. Damaged frames are accepted so rarely
        // that this is the number recovered.
        let by_c = (protocol.c_table)(&damaged.bytes).frames;
        let percent = |found: f64| 100.0 * found / intact.len() as f64;
        let recovered = format!("recovered_{name}_{rate}");
        let (ours, theirs) = (percent(found as f64), percent(by_c as f64));
        effort.print_rounded(&format!("{recovered}_axlewire_percent"), ours, 4, 100.0);
        effort.print_rounded(&format!("{recovered}_c_percent"), theirs, 4, None);
        assert!((50.0..=100.0).contains(&theirs) && ours == 100.0, "{recovered}: {ours}, {theirs}");

        let expected = (protocol.oracle)(&damaged.bytes);
        let times = race(
            effort.stopwatch,
            effort.rounds,
            [
                on("Frames", &clean.name, sent, protocol.frames, &clean.bytes),
                on("Frames", &damaged.name, expected, protocol.frames, &damaged.bytes),
            ],
        );
        let [clean_time, damaged_time] = times;
        let speed = format!("speed_{name}_{rate}_over_clean");
        effort.print(&speed, clean_time / damaged_time, goal);
    }
}

/// A hostile stream, and how fast axlewire rejects it.
struct Pattern {
    name: String,
    over_c: f64,
}

/// Its candidates have 64 bytes, the cap. The goal applies to at most 44.
const LONGEST_CANDIDATES: &str = "UCP FD FF 3C 00 repeated";

fn hostile(effort: &Effort) -> Vec<Pattern> {
    let measure = |Stream { name, protocol, bytes, .. }: Stream| {
        let expected = (protocol.oracle)(&bytes);
        assert!(expected.frames > 0, "{name}: even the last frames are missing");
        // C loses frames behind false headers, the same ones with either CRC.
        let by_c = (protocol.c_bitwise)(&bytes);
        let [c, frames] = race(
            effort.stopwatch,
            effort.rounds,
            [
                on("C", &name, by_c, protocol.c_table, &bytes),
                on("Frames", &name, expected, protocol.frames, &bytes),
            ],
        );
        Pattern { name, over_c: c / frames }
    };
    streams::hostile(effort.hostile_len).into_iter().map(measure).collect()
}

type Decode = fn(&[u8]) -> Tally;

/// A decoder on a stream with this name.
fn on<'a>(
    kind: &str,
    stream: &str,
    expected: Tally,
    decode: Decode,
    bytes: &'a [u8],
) -> Contender<'a> {
    Contender::new(&format!("{kind} on {stream}"), expected, move || decode(bytes))
}

/// Caps of the length field, each with its `Frames`.
const CAPS: [(u8, Decode); 5] = [
    (24, ours::frames::<Ucp<24>>),
    (40, ours::frames::<Ucp<40>>),
    (60, ours::frames::<Ucp<60>>),
    (124, ours::frames::<Ucp<124>>),
    (252, ours::frames::<Ucp<252>>),
];

/// Worst-case cost of a cap: every fourth byte begins a candidate of the maximum length, and each
/// must be checked to its end.
fn caps(effort: &Effort) {
    for (cap, decode) in CAPS {
        let mut bytes = [0xFD, 0xFF, cap, 0].repeat(effort.hostile_len / 4);
        // The last frame is the longest that is allowed, so that a decoder that finds nothing, or
        // has another cap, is wrong. One behind it is too long.
        for len in [cap, cap + 1] {
            let mut frame = vec![0xFD, 0xFF, len, 0];
            frame.resize(usize::from(len) + 2, 1);
            frame.extend(reference::crc_bitwise(&frame).to_le_bytes());
            bytes.extend(frame);
        }
        let expected = Tally { frames: 1, sum: 1 + 0x0101_0101 };
        let [seconds] =
            race(effort.stopwatch, effort.rounds, [on("a cap", "", expected, decode, &bytes)]);
        let mb_per_s = bytes.len() as f64 / seconds / 1e6;
        let name = format!("mb_per_s_candidates_of_{}", u32::from(cap) + 4);
        effort.print_rounded(&name, mb_per_s, 0, None);
    }
}

type Compute = fn(&[u8]) -> u16;

/// The variants of each crate that were fastest at one of our lengths.
const CRATES: [(&str, Compute); 5] = [
    ("crc_table1", |bytes| {
        const CRC: Crc<u16, Table<1>> = Crc::<u16, Table<1>>::new(&CRC_16_MODBUS);
        CRC.checksum(bytes)
    }),
    ("crc_table16", |bytes| {
        const CRC: Crc<u16, Table<16>> = Crc::<u16, Table<16>>::new(&CRC_16_MODBUS);
        CRC.checksum(bytes)
    }),
    ("crc16", crc16_crate::State::<crc16_crate::MODBUS>::calculate),
    ("crcxx_lut256x8", |bytes| {
        use crcxx::crc16::{Crc, LookupTable256xN, catalog::CRC_16_MODBUS};
        const CRC: Crc<LookupTable256xN<8>> = Crc::<LookupTable256xN<8>>::new(&CRC_16_MODBUS);
        CRC.compute(bytes)
    }),
    ("rscrypto", |bytes| {
        use rscrypto::{Checksum, checksum::Crc16Ibm};
        // It has no preset for 0xFFFF as the initial value; this makes one.
        let mut crc = Crc16Ibm::resume(0xFFFF);
        crc.update(bytes);
        crc.finalize()
    }),
];

/// Times for CRCs of one length, seconds.
struct CrcTimes {
    len: usize,
    calls: u64,
    ours: f64,
    c: f64,
    crates: [f64; CRATES.len()],
}

impl CrcTimes {
    /// All are called through a pointer, as C must be, at the same cost for each.
    fn measure(len: usize, effort: &Effort) -> Self {
        let mut rng = Rng::new(len as u64);
        let bytes: Vec<u8> = (0..len).map(|_| rng.byte()).collect();
        let right = reference::crc_bitwise(&bytes);
        let frames = effort.crc_calls;
        let expected = Tally { frames, sum: frames * u64::from(right) };
        let contender = |name: &str, compute: Compute| {
            let bytes = &bytes[..];
            Contender::new(&format!("{name} on {len} bytes"), expected, move || {
                let mut sum = 0;
                for _ in 0..frames {
                    // Hiding the pointer each time loads it into the register of the last result.
                    // Otherwise, code that sets only the low half of that register would wait for
                    // the result and look three times slower than it is.
                    let compute = black_box(compute);
                    sum += u64::from(compute(black_box(bytes)));
                }
                Tally { frames, sum }
            })
        };
        let [ours, c, crates @ ..] = race(
            effort.stopwatch,
            effort.crc_rounds,
            [
                contender("axlewire", crc16::compute),
                contender("C", reference::crc_table),
                contender(CRATES[0].0, CRATES[0].1),
                contender(CRATES[1].0, CRATES[1].1),
                contender(CRATES[2].0, CRATES[2].1),
                contender(CRATES[3].0, CRATES[3].1),
                contender(CRATES[4].0, CRATES[4].1),
            ],
        );
        Self { len, calls: frames, ours, c, crates }
    }

    fn best_crate(&self) -> f64 {
        self.crates.into_iter().fold(f64::INFINITY, f64::min)
    }

    fn print_crates(&self, effort: &Effort) {
        let Self { len, calls, ours, c, crates } = self;
        effort.print_rounded(&format!("ns_crc{len}"), 1e9 * ours / *calls as f64, 2, None);
        effort.print(&format!("crc{len}_over_c_two_tables"), c / ours, None);
        for ((name, _), time) in CRATES.iter().zip(crates) {
            effort.print(&format!("crc{len}_over_{name}"), time / ours, None);
        }
    }
}

/// Times for one frame, seconds.
struct PeerTimes {
    ucp_44: f64,
    mavlink: f64,
    ublox: f64,
    modbus_core_43: f64,
    ikeya_8: f64,
    modbus_core_8: f64,
    rmodbus: f64,
}

impl PeerTimes {
    fn measure(effort: &Effort) -> Self {
        let reports = streams::reports(effort.peers_len);
        let responses = streams::responses(effort.peers_len);
        let all_of = |Stream { name, protocol, bytes, intact, .. }: &Stream| {
            let expected = (protocol.oracle)(bytes);
            assert_eq!(expected.frames, intact.len() as u64, "{name}");
            expected
        };

        let count = effort.peers_len / 44;
        let short_count = effort.peers_len / 8;
        let frames_of = |peer: &Peer| (peer.frames)(effort.peers_len / peer.frame_len);
        let [mavlink, ublox] = [&peers::MAVLINK, &peers::UBLOX].map(frames_of);
        let modbus = (peers::MODBUS_CORE_RESPONSES.frames)(count);
        let requests = frames_of(&peers::RMODBUS_REQUESTS);
        let [ucp_time, mavlink_time, ublox_time, modbus_core_time] = race(
            effort.stopwatch,
            effort.rounds,
            [
                on("each", "", all_of(&reports), reports.protocol.each, &reports.bytes),
                peer(&peers::MAVLINK, count, &mavlink),
                peer(&peers::UBLOX, count, &ublox),
                peer(&peers::MODBUS_CORE_RESPONSES, count, &modbus),
            ],
        );
        let [ikeya_time, modbus_core_8_time, rmodbus_time] = race(
            effort.stopwatch,
            effort.rounds,
            [
                on("each", "", all_of(&responses), responses.protocol.each, &responses.bytes),
                peer(&peers::MODBUS_CORE_REQUESTS, short_count, &requests),
                peer(&peers::RMODBUS_REQUESTS, short_count, &requests),
            ],
        );

        let (count, short_count) = (count as f64, short_count as f64);
        Self {
            // 2 % of these frames are shorter, so 44 bytes take longer than an average frame.
            ucp_44: ucp_time / (reports.bytes.len() as f64 / 44.0),
            mavlink: mavlink_time / count,
            ublox: ublox_time / count,
            modbus_core_43: modbus_core_time / count,
            ikeya_8: ikeya_time / (responses.bytes.len() as f64 / 8.0),
            modbus_core_8: modbus_core_8_time / short_count,
            rmodbus: rmodbus_time / short_count,
        }
    }
}

/// A peer must find all of its frames, with their contents.
fn peer<'a>(peer: &Peer, count: usize, frames: &'a [u8]) -> Contender<'a> {
    let expected = peer.contents(frames);
    assert_eq!(expected.frames, count as u64, "{}", peer.name);
    on(peer.name, "", expected, peer.read, frames)
}
