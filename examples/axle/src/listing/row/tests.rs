//! Columns, to the letter.

use axlewire::{
    ikeya::{BothDirections, NodeId, ReadRequest, WriteRequest},
    stream::{Frames, Reason},
};

use super::{super::Style, *};
use crate::pcapng::Direction;

/// The lines of a READ, a WRITE and a gap at these times.
fn listing(time: TimeColumn, times: [Option<u64>; 3]) -> String {
    let style = Style::text("node", time);
    let (mut out, mut clock, modes) = (Out::default(), LineClock::default(), Modes::default());
    style.titles(&mut out);
    let rps = axlewire::ikeya::Rps::new(2.0).unwrap();
    let (read, write) = (ReadRequest::new(NodeId::N1), WriteRequest::velocity(NodeId::N2, rps));
    let bytes = [&read.as_bytes()[..], write.as_bytes()].concat();
    let directions = [Some(Direction::Out), Some(Direction::In), None];
    let at = |index: usize, offset| Place {
        offset,
        micros: times[index],
        direction: directions[index],
        interface: None,
    };
    let mut offset = 0;
    for (index, frame) in Frames::<BothDirections>::new(&bytes).enumerate() {
        style.frame(&mut out, &mut clock, at(index, offset), &frame, &modes);
        offset += frame.as_bytes().len() as u64;
    }
    let gap = SkippedBytes { length: 7, reason: Reason::Crc, account: Counters::default() };
    style.gap(&mut out, &mut clock, at(2, 12), &gap);
    String::from_utf8(out.0).unwrap()
}

#[test]
fn without_times_a_line_begins_with_its_offset() {
    let lines = listing(TimeColumn::None, [None; 3]);
    assert_eq!(
        lines.lines().collect::<Vec<_>>(),
        [
            "    offset  bytes  message                 node  contents",
            "         0      4  read_request               1",
            "         4      8  write                      2  2.0 rps or 16384.0000 turns (rotation 16384, count 0)",
            "        12      7  (skipped)                     crc: damaged, or not a frame",
        ]
    );
}

#[test]
fn a_relative_time_is_that_since_the_first_line_even_if_it_is_earlier() {
    let lines = listing(
        TimeColumn::Relative,
        [Some(5_000_000), Some(3_765_433), Some(1_128_456_790_000_001)],
    );
    assert_eq!(
        lines.lines().collect::<Vec<_>>(),
        [
            "          time  dir      offset  bytes  message                 node  contents",
            "      0.000000  out           0      4  read_request               1",
            "     -1.234567  in            4      8  write                      2  2.0 rps or 16384.0000 turns (rotation 16384, count 0)",
            "1128456785.000001               12      7  (skipped)                     crc: damaged, or not a frame",
        ]
    );
}

#[test]
fn a_delta_is_that_since_the_line_before_and_a_line_without_time_leaves_it_out() {
    let lines = listing(TimeColumn::Delta, [Some(5_000_000), None, Some(6_000_123)]);
    assert_eq!(
        lines.lines().collect::<Vec<_>>(),
        [
            "          time  dir      offset  bytes  message                 node  contents",
            "      0.000000  out           0      4  read_request               1",
            "                in            4      8  write                      2  2.0 rps or 16384.0000 turns (rotation 16384, count 0)",
            "      1.000123               12      7  (skipped)                     crc: damaged, or not a frame",
        ]
    );
}

#[test]
fn an_absolute_time_is_a_date_up_to_the_year_9999() {
    let last = YEAR_10000 - 1;
    let lines =
        listing(TimeColumn::Absolute, [Some(1_700_000_000_123_456), Some(last), Some(last + 1)]);
    assert_eq!(
        lines.lines().collect::<Vec<_>>(),
        [
            "                       time  dir      offset  bytes  message                 node  contents",
            "2023-11-14T22:13:20.123456Z  out           0      4  read_request               1",
            "9999-12-31T23:59:59.999999Z  in            4      8  write                      2  2.0 rps or 16384.0000 turns (rotation 16384, count 0)",
            "             253402300800 s               12      7  (skipped)                     crc: damaged, or not a frame",
        ]
    );
}

#[test]
fn what_is_pending_has_a_line_of_its_own_if_there_is_any() {
    let mut account = Counters::default();
    (account.received, account.framed, account.frames, account.crc) = (17, 8, 1, 4);
    let printed = |account: &Counters| {
        let mut out = Vec::new();
        print_summary(&mut out, account, false).unwrap();
        String::from_utf8(out).unwrap()
    };
    let lines = [
        "        17 bytes received",
        "         8 in 1 frame",
        "         4 skipped: 4 crc",
        "         5 pending",
        "",
    ];
    assert_eq!(printed(&account), lines.join("\n"));
    account.received = 12;
    assert!(!printed(&account).contains("pending"));
}
