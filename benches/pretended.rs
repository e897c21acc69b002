//! Times that contenders pretend to take in a test, and what each figure must then be.
//!
//! Real times never fail a test, so nothing would notice a ratio that is upside down, or of the
//! wrong two contenders. With these times every figure is known. The names are read anew here: a
//! figure `X_over_Y` is the time of Y over the time of X, and more is better.

use axlewire_contenders::{Protocol, Tally, UCP};

/// Decoders that each give another answer.
pub(crate) const PROTOCOL: Protocol = Protocol {
    c_table: |_| Tally { frames: 1, sum: 1 },
    frames: |_| Tally { frames: 1, sum: 2 },
    each: |_| Tally { frames: 1, sum: 3 },
    decoder: |_, len| Tally { frames: 1, sum: if len == 4096 { 5 } else { 0 } },
    pushed: |_| Tally { frames: 1, sum: 6 },
    ..UCP
};

/// Times of the kinds of contenders, seconds. No two have the same ratio.
const SECONDS: [(&str, f64); 17] = [
    ("C", 71.0),
    ("Frames", 31.0),
    ("each", 19.0),
    ("Decoder by 4096", 37.0),
    ("Decoder, pushed", 53.0),
    ("a cap", 61.0),
    ("axlewire", 2.0),
    ("crc_table1", 13.0),
    ("crc_table16", 7.0),
    ("crc16", 17.0),
    ("crcxx_lut256x8", 5.0),
    ("rscrypto", 23.0),
    ("mavlink", 113.0),
    ("ublox", 73.0),
    ("modbus-core, responses", 97.0),
    ("modbus-core, requests", 89.0),
    ("rmodbus", 101.0),
];

/// The time of a contender: that of its kind, times that of its stream.
pub(crate) fn seconds(contender: &str) -> f64 {
    let (kind, stream) = contender.split_once(" on ").unwrap_or((contender, ""));
    of(kind) * by_stream(kind, stream)
}

fn of(kind: &str) -> f64 {
    let known = SECONDS.iter().find(|(name, _)| *name == kind);
    known.unwrap_or_else(|| panic!("no time is known for {kind:?}")).1
}

/// C needs longer for some streams, which makes the worst hostile pattern known; and everything
/// takes longer on damaged streams.
fn by_stream(kind: &str, stream: &str) -> f64 {
    match (kind, stream) {
        // These two are left out of the worst.
        ("C", "UCP FD FF 3C 00 repeated") => 0.125,
        ("C", "Ikeya noise" | "UCP noise") => 0.25,
        ("C", "UCP FD FF 28 00 repeated") => 0.5,
        ("Frames", damaged) if damaged.contains("BER") => 1.25,
        _ => 1.0,
    }
}

/// What a figure of streams of `len` bytes and of `crc_calls` CRCs must be. `None` if it has
/// nothing to do with time.
pub(crate) fn figure(name: &str, len: usize, crc_calls: u64) -> Option<f64> {
    let mb = len as f64 / 1e6;
    if name.starts_with("recovered_") {
        return None;
    }
    if name.starts_with("mb_per_s_candidates_of_") {
        return Some(mb / of("a cap"));
    }
    if let Some(which) = name.strip_prefix("mb_per_s_") {
        return Some(mb / of(decoder(which)));
    }
    if name.starts_with("ns_crc") {
        return Some(1e9 * of("axlewire") / crc_calls as f64);
    }
    if name.starts_with("speed_") {
        return Some(1.0 / by_stream("Frames", "BER"));
    }
    let (ours, other) = name.split_once("_over_").unwrap_or_else(|| panic!("what is {name}?"));
    if ours.starts_with("crc") {
        let time = match other {
            "c_table" | "c_two_tables" => of("C"),
            "best_crate" => 5.0,
            crate_name => of(crate_name),
        };
        return Some(time / of("axlewire"));
    }
    let peer = match (ours, other) {
        ("ucp44", "mavlink" | "ublox") | ("ikeya8", "rmodbus") => Some(other),
        ("ucp44", "modbus_core") => Some("modbus-core, responses"),
        ("ikeya8", "modbus_core") => Some("modbus-core, requests"),
        _ => None,
    };
    if let Some(peer) = peer {
        return Some(of(peer) / of("each"));
    }
    let ours_time = of(decoder(ours));
    let pattern = match ours {
        _ if ours.contains("noise") => 0.25,
        "hostile_worst" | "hostile_ucp_fd_ff_28_00_repeated" => 0.5,
        "hostile_ucp_fd_ff_3c_00_repeated" => 0.125,
        _ => 1.0,
    };
    match other {
        "frames" => Some(of("Frames") / ours_time),
        "c" => Some(of("C") * pattern / ours_time),
        _ => panic!("what is {name}?"),
    }
}

/// The contender whose name a figure ends with; `Frames` if none is named.
fn decoder(name: &str) -> &'static str {
    match name.rsplit('_').next() {
        Some("c") => "C",
        Some("each") => "each",
        Some("decoder4096") => "Decoder by 4096",
        Some("decoder1") => "Decoder, pushed",
        _ => "Frames",
    }
}
