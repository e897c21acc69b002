//! Every writer against core's `format!`.

use alloc::{format, string::String, vec::Vec};

use proptest::prelude::*;

use super::*;

fn line(print: impl FnOnce(&mut Line<'_>)) -> String {
    let mut text = String::new();
    let mut line = Line::new(&mut text);
    print(&mut line);
    line.end().unwrap();
    text
}

#[test]
fn numbers_have_the_text_that_core_gives_them() {
    proptest!(|(value in any::<i16>(), magnitude: u32, shift in 0..32u32, width in 0..13usize)| {
        prop_assert_eq!(
            line(|line| line.integer(value.into(), width)),
            format!("{value:>width$}")
        );
        let magnitude = magnitude >> shift;
        for is_negative in [false, true] {
            let sign = if is_negative { "-" } else { "" };
            let (whole, tenths) = (magnitude / 10, magnitude % 10);
            prop_assert_eq!(
                line(|line| line.fixed::<1>(is_negative, magnitude, width)),
                format!("{:>width$}", format!("{sign}{whole}.{tenths}"))
            );
            let (whole, rest) = (magnitude / 10_000, magnitude % 10_000);
            prop_assert_eq!(
                line(|line| line.fixed::<4>(is_negative, magnitude, width)),
                format!("{:>width$}", format!("{sign}{whole}.{rest:04}"))
            );
        }
    });
}

#[test]
fn the_longest_number_is_not_cut() {
    assert_eq!(line(|line| line.fixed::<0>(true, u32::MAX, 0)), "-4294967295");
    assert_eq!(line(|line| line.fixed::<9>(true, u32::MAX, 15)), "   -4.294967295");
}

#[test]
fn a_line_of_any_length_arrives_whole_and_in_order() {
    proptest!(|(parts in prop::collection::vec((0..3, 0..300usize), 0..40))| {
        let mut expected = String::new();
        let found = line(|line| {
            for (kind, number) in parts {
                match kind {
                    0 => {
                        line.integer(number as i32, 4);
                        expected += &format!("{number:>4}");
                    }
                    1 => {
                        let text = &"abcdefghijklmnopqrstuvwxyz0123456789"[..number % 37];
                        line.text(text);
                        expected += text;
                    }
                    _ => {
                        line.spaced([number as i32; 3], |line, value| line.integer(value, 0));
                        expected += &format!("{number} {number} {number}");
                    }
                }
            }
        });
        prop_assert_eq!(found, expected);
    });
}

#[test]
fn an_error_of_the_writer_is_returned() {
    struct Full;
    impl core::fmt::Write for Full {
        fn write_str(&mut self, _: &str) -> core::fmt::Result {
            Err(core::fmt::Error)
        }
    }
    let mut full = Full;
    let mut line = Line::new(&mut full);
    line.text("x");
    assert_eq!(line.end(), Err(core::fmt::Error));
}

#[cfg(any(feature = "serde", feature = "ucp"))]
#[test]
fn hex_digits_are_those_of_core() {
    proptest!(|(bytes: Vec<u8>, long in prop::collection::vec(any::<u8>(), 256))| {
        for bytes in [&bytes[..], &long, &long[..64], &long[..65], &long[..8]] {
            let expected: String = bytes.iter().map(|byte| format!("{byte:02x}")).collect();
            #[cfg(feature = "ucp")]
            prop_assert_eq!(&line(|line| Hex(bytes).print(line)), &expected);
            #[cfg(feature = "serde")]
            prop_assert_eq!(serde_json::to_string(&Hex(bytes))?, format!("{expected:?}"));
        }
    });
}

#[cfg(feature = "serde")]
#[test]
fn more_bytes_than_a_frame_can_have_are_an_error() {
    assert!(serde_json::to_string(&Hex(&[0; 257])).is_err());
}
