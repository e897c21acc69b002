//! Time: what saturates, what wraps, and where a line's time is rounded.

use axlewire::time::{Wrapping32, wire_time};

use crate::rig::*;

const US: fn(u32) -> Duration = Duration::from_micros;
const AT: fn(u64) -> Instant = Instant::from_micros;

#[test]
fn a_duration_stops_at_71_minutes() {
    let longest = US(u32::MAX);
    assert_eq!(Duration::default(), Duration::ZERO);
    assert_eq!(Duration::from_millis(4_294_967), US(4_294_967_000));
    for millis in [4_294_968, 5_000_000, u32::MAX] {
        assert_eq!(Duration::from_millis(millis), longest, "{millis} ms");
    }
    assert_eq!(US(u32::MAX - 1) + US(1), longest);
    assert_eq!(US(u32::MAX - 1) + US(2), longest);
    assert_eq!(longest.saturating_add(longest), longest);
    assert_eq!(US(1 << 31).saturating_mul(2), longest);
    assert_eq!(US(7).saturating_mul(3), US(21));
}

#[test]
fn the_time_between_two_instants_is_never_negative_and_at_most_71_minutes() {
    let hour = 3_600_000_000;
    assert_eq!(AT(hour + 5) - AT(5), US(3_600_000_000));
    assert_eq!(AT(u32::MAX.into()) - AT(0), US(u32::MAX));
    assert_eq!(AT(u64::from(u32::MAX) + 1) - AT(0), US(u32::MAX));
    assert_eq!(AT(2 * hour) - AT(0), US(u32::MAX));
    assert_eq!(AT(0) - AT(2 * hour), Duration::ZERO);
    assert_eq!(AT(7) - AT(7), Duration::ZERO);
}

#[test]
fn an_instant_wraps_and_the_later_one_stays_the_greater() {
    for start in [0, u64::MAX - 100, u64::MAX, u64::MAX / 2, 1 << 63] {
        let (start, span) = (AT(start), US(200));
        let end = start + span;
        assert_eq!(end.as_micros(), start.as_micros().wrapping_add(200));
        assert_eq!((end.max(start), start.min(end)), (end, start));
        assert!(end > start && start >= start.min(end));
        assert_eq!((end - start, start - end), (span, Duration::ZERO));
        let mut moved = start;
        moved += span;
        assert_eq!(moved, end);
    }
    assert_eq!(Instant::from_millis(5), AT(5000));
    // 2^64 ms are a whole number of wraps and some more.
    assert_eq!(Instant::from_millis(u64::MAX), AT(u64::MAX.wrapping_mul(1000)));
    assert_eq!(Instant::default(), AT(0));
}

#[test]
fn a_counter_of_32_bits_can_wrap_any_number_of_times() {
    let clock = Wrapping32::new();
    let mut last = AT(0);
    // Readings 50 minutes apart.
    for step in 0..10_u64 {
        let now = step * 3_000_000_000;
        let read = clock.at(now as u32);
        assert_eq!(read, AT(now));
        assert!(read >= last);
        last = read;
    }
    assert_eq!(clock.at(last.as_micros() as u32), last, "the same reading again");
    assert_eq!(Wrapping32::default().at(17), AT(17));
}

#[test]
fn ten_bit_times_per_byte_are_rounded_up() {
    let cases = [
        ((0, 115_200), 0),
        ((1, 115_200), 87),
        ((1, 1_000_000), 10),
        ((1, 3_000_000), 4),
        ((64, 500_000), 1280),
        // The longest frame that can be received, and the lengths around the one that 32 bits
        // hold.
        ((256, 115_200), 22_223),
        ((429, 115_200), 37_240),
        ((430, 115_200), 37_327),
        ((430, 10_000_000), 430),
        ((1_000_000, 500_000), 20_000_000),
        ((1, 1), 10_000_000),
    ];
    for ((bytes, baud), micros) in cases {
        assert_eq!(wire_time(bytes, baud), US(micros), "{bytes} bytes at {baud} bit/s");
    }
    for (bytes, baud) in [(0, 0), (1, 0), (usize::MAX, 1), (500, 1), (1 << 31, 115_200)] {
        assert_eq!(wire_time(bytes, baud), US(u32::MAX), "{bytes} bytes at {baud} bit/s");
    }
}
