//! Decoding of byte streams by axlewire, C and other crates, in bytes and frames per second.
//!
//! The streams have 4 MiB: more than the second-level cache of current machines, less than most
//! third-level caches. Every iteration checks its result against the slow oracle: axlewire must
//! match it exactly; C must match it on clean streams, and itself on all others.

use std::hint::black_box;

use axlewire_contenders::{
    Tally, ours,
    peers::{self, Peer},
    streams::{self, Stream},
};
use criterion::{BenchmarkGroup, Criterion, Throughput, measurement::WallTime};

mod measure;
use measure::{criterion, measure};

const LEN: usize = 4 << 20;

fn main() {
    let mut criterion = criterion();
    for stream in streams::clean(LEN) {
        sent(&mut criterion, &stream);
        sent(&mut criterion, &stream.with_bit_errors(10_000));
        sent(&mut criterion, &stream.with_bit_errors(1000));
    }
    for stream in streams::hostile(LEN) {
        hostile(&mut criterion, &stream);
    }
    frames_of_44_bytes(&mut criterion);
    frames_of_8_bytes(&mut criterion);
    criterion.final_summary();
}

/// A stream with frames: however it is chunked, every intact frame is found.
fn sent(criterion: &mut Criterion, stream: &Stream) {
    let Stream { name, protocol, bytes, sent, intact } = stream;
    let found = (protocol.frame_ends)(bytes);
    assert!(intact.iter().all(|end| found.binary_search(end).is_ok()), "{name}: frames were lost");

    let expected = (protocol.oracle)(bytes);
    let mut group = criterion.benchmark_group(name);
    bench(&mut group, "axlewire Frames", bytes, expected, protocol.frames);
    bench(&mut group, "axlewire Frames::each", bytes, expected, protocol.each);
    for chunk in [4096, 512, 64, 7, 1] {
        let decode = |bytes: &[u8]| (protocol.decoder)(bytes, chunk);
        bench(&mut group, &format!("axlewire Decoder by {chunk}"), bytes, expected, decode);
    }
    bench(&mut group, "axlewire Decoder, pushed", bytes, expected, protocol.pushed);
    bench_c(&mut group, stream, intact.len() == *sent);
}

/// A stream with frames only at its end, and by chance.
fn hostile(criterion: &mut Criterion, stream: &Stream) {
    let Stream { name, protocol, bytes, .. } = stream;
    let expected = (protocol.oracle)(bytes);
    let mut group = criterion.benchmark_group(name);
    bench(&mut group, "axlewire Frames", bytes, expected, protocol.frames);
    bench(&mut group, "axlewire Frames::each", bytes, expected, protocol.each);
    let decode = |bytes: &[u8]| (protocol.decoder)(bytes, 4096);
    bench(&mut group, "axlewire Decoder by 4096", bytes, expected, decode);
    bench_c(&mut group, stream, false);
}

/// C must find all frames of a clean stream; in others it loses frames, the same ones as with a
/// bitwise CRC.
fn bench_c(group: &mut Group<'_>, stream: &Stream, is_clean: bool) {
    let Stream { name, protocol, bytes, .. } = stream;
    let all = (protocol.oracle)(bytes);
    let expected = (protocol.c_bitwise)(bytes);
    if is_clean {
        assert_eq!(expected, all, "{name}: C");
    }
    bench(group, "C two tables", bytes, expected, protocol.c_table);
}

/// UCP reports against frames of other protocols, equally long or one byte shorter.
fn frames_of_44_bytes(criterion: &mut Criterion) {
    let ours = streams::reports(LEN);
    let expected = (ours.protocol.oracle)(&ours.bytes);
    let mut group = criterion.benchmark_group("peers, 44 bytes");
    bench(&mut group, "axlewire Frames", &ours.bytes, expected, ours.protocol.frames);
    bench(&mut group, "axlewire Frames, unpacked", &ours.bytes, expected, ours::reports);
    for peer in [peers::MAVLINK, peers::UBLOX, peers::MODBUS_CORE_RESPONSES] {
        bench_peer(&mut group, &peer);
    }
}

/// Ikeya responses against Modbus requests.
fn frames_of_8_bytes(criterion: &mut Criterion) {
    let ours = streams::responses(LEN);
    let expected = (ours.protocol.oracle)(&ours.bytes);
    let mut group = criterion.benchmark_group("peers, 8 bytes");
    bench(&mut group, "axlewire Frames", &ours.bytes, expected, ours.protocol.frames);
    bench(&mut group, "axlewire Frames::each", &ours.bytes, expected, ours.protocol.each);
    for peer in [peers::MODBUS_CORE_REQUESTS, peers::RMODBUS_REQUESTS] {
        bench_peer(&mut group, &peer);
    }
}

/// A peer must find all frames with their contents.
fn bench_peer(group: &mut Group<'_>, peer: &Peer) {
    let count = LEN / peer.frame_len;
    let frames = (peer.frames)(count);
    let expected = peer.contents(&frames);
    assert_eq!(expected.frames, count as u64, "{}", peer.name);
    bench(group, peer.name, &frames, expected, peer.read);
}

type Group<'a> = BenchmarkGroup<'a, WallTime>;

/// Measures one decoder, in bytes and frames, and checks its result every time.
fn bench(
    group: &mut Group<'_>,
    name: &str,
    bytes: &[u8],
    expected: Tally,
    decode: impl Fn(&[u8]) -> Tally,
) {
    group.throughput(Throughput::ElementsAndBytes {
        elements: expected.frames,
        bytes: bytes.len() as u64,
    });
    assert_ne!(expected, Tally::default(), "{name}: nothing is asked");
    measure(group, name, expected, || decode(black_box(bytes)));
}
