//! The captures shown in the tour: their contents, and where every byte goes.

#![cfg(all(feature = "ikeya", feature = "ucp", feature = "alloc"))]

use axlewire::stream::decode_capture;

use crate::rig::*;

/// Offset, length, and the reason of a gap or `None` for a frame.
type Span = (usize, usize, Option<Reason>);

fn spans<F: Framing>(bytes: &[u8]) -> Vec<Span> {
    let (events, counters) = decode_capture::<F>(bytes);
    assert_eq!(counters.received, bytes.len() as u64);
    assert_eq!(counters.received, counters.framed + counters.skipped());
    let ends = events.iter().skip(1).map(|&(offset, _)| offset).chain([bytes.len()]);
    let lengths: Vec<usize> = events.iter().zip(ends).map(|((at, _), end)| end - at).collect();
    let span = |((at, event), length): (&(usize, _), usize)| match event {
        Event::Frame(_) => (*at, length, None),
        Event::Skipped(Gap { len, reason }) => {
            assert_eq!(*len, length as u64);
            (*at, length, Some(*reason))
        }
    };
    events.iter().zip(lengths).map(span).collect()
}

/// Every delivered frame is one of the recorded ones.
fn all_recorded(file: &str, bytes: &[u8], spans: &[Span]) {
    let path = format!("{}/tests/vectors/{file}", env!("CARGO_MANIFEST_DIR"));
    let vectors = std::fs::read_to_string(path).unwrap();
    for &(at, length, reason) in spans {
        let hex: String = bytes[at..at + length].iter().map(|byte| format!("{byte:02x}")).collect();
        let recorded = vectors.contains(&format!("\"hex\": \"{hex}\""));
        assert!(recorded || reason.is_some(), "{hex}");
    }
}

/// A capture of this length has so many frames and gaps; these are the gaps.
fn assert_capture<F: Framing>(
    file: &str,
    bytes: &[u8],
    counts: (usize, usize),
    expected: [(usize, usize, Reason); 5],
) {
    let spans = spans::<F>(bytes);
    all_recorded(file, bytes, &spans);
    assert_eq!((bytes.len(), spans.len()), counts);
    let gaps = spans.iter().filter_map(|&(at, length, reason)| Some((at, length, reason?)));
    assert_eq!(gaps.collect::<Vec<_>>(), expected);
}

#[test]
fn the_motor_bus_capture_has_eleven_frames_and_five_gaps() {
    use Reason::{Crc, Header, Id};
    let bytes = include_bytes!("../../examples/captures/ikeya.bin");
    let gaps = [(12, 1, Header), (29, 4, Id), (41, 8, Crc), (57, 5, Crc), (74, 4, Crc)];
    assert_capture::<BothDirections>("ikeya.jsonl", bytes, (90, 16), gaps);
}

#[test]
fn the_rover_capture_has_fifteen_frames_and_five_gaps() {
    use Reason::{Crc, Header, Idle};
    let bytes = include_bytes!("../../examples/captures/ucp.bin");
    let gaps = [(0, 3, Header), (99, 4, Crc), (147, 44, Crc), (259, 17, Crc), (396, 9, Idle)];
    assert_capture::<Ucp>("ucp.jsonl", bytes, (405, 20), gaps);
}
