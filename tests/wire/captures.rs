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
    let reasons = events.iter().zip(&lengths).map(|((_, event), &length)| match event {
        Event::Frame(_) => None,
        Event::Skipped(Gap { len, reason }) => {
            assert_eq!(*len, length as u64);
            Some(*reason)
        }
    });
    let reasons: Vec<_> = reasons.collect();
    events
        .iter()
        .zip(lengths)
        .zip(reasons)
        .map(|(((at, _), length), reason)| (*at, length, reason))
        .collect()
}

/// The gaps of a capture; everything else in it is frames.
fn gaps(spans: &[Span]) -> Vec<(usize, usize, Reason)> {
    spans.iter().filter_map(|&(at, length, reason)| Some((at, length, reason?))).collect()
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

#[test]
fn the_motor_bus_capture_has_eleven_frames_and_five_gaps() {
    let bytes = include_bytes!("../../examples/captures/ikeya.bin");
    let spans = spans::<BothDirections>(bytes);
    all_recorded("ikeya.jsonl", bytes, &spans);
    assert_eq!((bytes.len(), spans.len()), (90, 16));
    let expected = [
        (12, 1, Reason::Header),
        (29, 4, Reason::Id),
        (41, 8, Reason::Crc),
        (57, 5, Reason::Crc),
        (74, 4, Reason::Crc),
    ];
    assert_eq!(gaps(&spans), expected);
}

#[test]
fn the_rover_capture_has_fifteen_frames_and_five_gaps() {
    let bytes = include_bytes!("../../examples/captures/ucp.bin");
    let spans = spans::<Ucp>(bytes);
    all_recorded("ucp.jsonl", bytes, &spans);
    assert_eq!((bytes.len(), spans.len()), (405, 20));
    let expected = [
        (0, 3, Reason::Header),
        (99, 4, Reason::Crc),
        (147, 44, Reason::Crc),
        (259, 17, Reason::Crc),
        (396, 9, Reason::Idle),
    ];
    assert_eq!(gaps(&spans), expected);
}
