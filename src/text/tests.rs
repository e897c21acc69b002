//! Every writer against core's `format!`.

use std::{format, string::String};

use super::*;

fn line(print: impl FnOnce(&mut Line<'_>)) -> String {
    let mut text = String::new();
    let mut line = Line::new(&mut text);
    print(&mut line);
    line.end().unwrap();
    text
}

#[cfg(feature = "ikeya")]
fn assert_same_float(bits: u32) {
    let value = f32::from_bits(bits);
    assert_eq!(line(|line| Shortest(value).print(line)), format!("{value:?}"), "{bits:#010x}");
}

#[cfg(feature = "ikeya")]
#[test]
fn a_float_has_the_text_that_core_gives_it() {
    // Every exponent with the edges of the significand, powers of ten, and a step that is coprime to
    // 2^32.
    for exponent in 0..=0x1FF {
        for fraction in [0, 1, 2, 3, 0x3F_FFFF, 0x40_0000, 0x7F_FFFD, 0x7F_FFFE, 0x7F_FFFF] {
            assert_same_float(exponent << 23 | fraction);
        }
    }
    for power in -45..=38 {
        let value: f32 = format!("1e{power}").parse().unwrap();
        for bits in value.to_bits().saturating_sub(3)..value.to_bits() + 3 {
            assert_same_float(bits);
        }
    }
    for step in 0..200_000u32 {
        assert_same_float(step.wrapping_mul(2_654_435_761));
    }
}

#[cfg(feature = "ikeya")]
#[test]
#[ignore = "all 2^32 floats: minutes with optimisation, hours without"]
fn every_float_has_the_text_that_core_gives_it() {
    (0..=u32::MAX).for_each(assert_same_float);
}
