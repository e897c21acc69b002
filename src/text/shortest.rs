//! The shortest decimal number that reads back as the same `f32`, as core's `{:?}` prints it.
//!
//! The method is Raffaello Giulietti's Schubfach: of the decimal numbers between the two halfway
//! points around a float, take the one with the fewest digits, the nearest if there are several.
//! The float and each halfway point take one product of 64 and 32 bits. A test compares all 2^32
//! floats with core.

use super::line::Line;

/// Prints an `f32` in the shortest form that reads back as the same value.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Shortest(pub(crate) f32);

/// Explicit bits of the significand.
const SIGNIFICAND_BITS: u32 = f32::MANTISSA_DIGITS - 1;

/// Exponent of the last bit of the significand in the smallest normal number.
const MIN_EXPONENT: i32 = f32::MIN_EXP - f32::MANTISSA_DIGITS as i32;

impl Shortest {
    /// Appends the text: with a decimal point, or with an exponent below 0.0001 and from 1e16 on.
    pub(crate) fn print(self, line: &mut Line<'_>) {
        let Self(value) = self;
        if value.is_nan() {
            return line.text("NaN");
        }
        if value.is_sign_negative() {
            line.text("-");
        }
        if value.is_infinite() {
            return line.text("inf");
        }
        if value == 0.0 {
            return line.text("0.0");
        }
        let Decimal { digits, exponent } = Decimal::shortest(value.abs());
        let count = digits.checked_ilog10().map_or(1, |log| log as i32 + 1);
        // Position of the point behind the first digit.
        let point = count + exponent;
        match point {
            -3..=0 => {
                line.text("0.");
                line.text(zeros(-point));
                line.fixed::<0>(false, digits, 0);
            }
            1..=16 if exponent >= 0 => {
                line.fixed::<0>(false, digits, 0);
                line.text(zeros(exponent));
                line.text(".0");
            }
            1..=16 => with_point(line, digits, -exponent),
            _ => {
                with_point(line, digits, count - 1);
                line.text("e");
                line.integer(point - 1, 0);
            }
        }
    }
}

/// Appends `digits` with a point in front of the last `decimals`, at most 8.
fn with_point(line: &mut Line<'_>, digits: u32, decimals: i32) {
    match decimals {
        0 => line.fixed::<0>(false, digits, 0),
        1 => line.fixed::<1>(false, digits, 0),
        2 => line.fixed::<2>(false, digits, 0),
        3 => line.fixed::<3>(false, digits, 0),
        4 => line.fixed::<4>(false, digits, 0),
        5 => line.fixed::<5>(false, digits, 0),
        6 => line.fixed::<6>(false, digits, 0),
        7 => line.fixed::<7>(false, digits, 0),
        _ => line.fixed::<8>(false, digits, 0),
    }
}

/// This number of zeros, at most 16.
fn zeros(count: i32) -> &'static str {
    usize::try_from(count).ok().and_then(|count| "0000000000000000".get(..count)).unwrap_or("")
}

/// A decimal number: `digits` · 10^`exponent`, without zeros at the end of `digits`.
struct Decimal {
    digits: u32,
    exponent: i32,
}

impl Decimal {
    /// The shortest decimal number for `value`, which is finite and positive.
    fn shortest(value: f32) -> Self {
        let fraction = value.to_bits() & ((1 << SIGNIFICAND_BITS) - 1);
        let biased = (value.to_bits() >> SIGNIFICAND_BITS) as i32;
        // The value is `significand` · 2^`exponent`.
        let (significand, exponent) = match biased {
            0 => (fraction, MIN_EXPONENT),
            _ => (fraction | 1 << SIGNIFICAND_BITS, MIN_EXPONENT - 1 + biased),
        };
        // Numbers with few digits are mostly integers, whose digits are there already.
        if (-(SIGNIFICAND_BITS as i32)..=0).contains(&exponent)
            && significand.trailing_zeros() as i32 >= -exponent
        {
            return Self { digits: significand >> -exponent, exponent: 0 }.without_zeros();
        }
        // Below a power of two the floats are twice as dense, so that halfway point is nearer.
        let is_power = fraction == 0 && biased > 1;
        let below = 4 * significand - 2 + u32::from(is_power);
        let above = 4 * significand + 2;

        // The largest power of ten not above the distance of the two halfway points.
        let power = (exponent * 1_262_611 - if is_power { 524_031 } else { 0 }) >> 22;
        let shift = exponent + log2_of_power(-power) + 1;
        let factor = power_of_ten(-power);
        let scaled = |quarters: u32| product(factor, quarters << shift);
        let (below, at, above) = (scaled(below), scaled(4 * significand), scaled(above));

        // A halfway point reads back as the float with the even significand.
        let is_odd = significand & 1;
        let is_inside = |quarters: u32| below + is_odd <= quarters && quarters + is_odd <= above;
        let floor = at / 4;
        let short = floor / 10;
        match (is_inside(40 * short), is_inside(40 * short + 40)) {
            (true, false) if floor >= 10 => Self { digits: short, exponent: power + 1 },
            (false, true) if floor >= 10 => Self { digits: short + 1, exponent: power + 1 },
            _ => {
                let round_up = match (is_inside(4 * floor), is_inside(4 * floor + 4)) {
                    (true, false) => false,
                    (false, true) => true,
                    // To the nearest; from the middle up, as core does.
                    _ => at >= 4 * floor + 2,
                };
                Self { digits: floor + u32::from(round_up), exponent: power }
            }
        }
        .without_zeros()
    }

    fn without_zeros(mut self) -> Self {
        while self.digits != 0 && self.digits.is_multiple_of(10) {
            self.digits /= 10;
            self.exponent += 1;
        }
        self
    }
}

/// `factor` · `quarters` / 2^64, rounded to odd: the last bit is set if anything was cut off, so
/// that comparing the result is as good as comparing the whole product.
#[inline(always)]
fn product(factor: u64, quarters: u32) -> u32 {
    let product = u128::from(factor) * u128::from(quarters);
    // The factor is rounded up, which changes the lower 32 bits at most.
    let is_inexact = (product >> 32) as u32 > 1;
    (product >> 64) as u32 | u32::from(is_inexact)
}

/// floor(log2(10^`power`)).
const fn log2_of_power(power: i32) -> i32 {
    (power * 1_741_647) >> 19
}

/// Powers of ten that an `f32` needs.
const MIN_POWER: i32 = -31;
const MAX_POWER: i32 = 45;

/// The leading 64 bits of each power, rounded up.
const POWERS: [u64; (MAX_POWER - MIN_POWER + 1) as usize] = {
    let mut powers = [0; (MAX_POWER - MIN_POWER + 1) as usize];
    let mut power = MIN_POWER;
    while power <= MAX_POWER {
        powers[(power - MIN_POWER) as usize] = leading_bits(power);
        power += 1;
    }
    powers
};

fn power_of_ten(power: i32) -> u64 {
    usize::try_from(power - MIN_POWER).ok().and_then(|at| POWERS.get(at).copied()).unwrap_or(0)
}

/// The leading 64 bits of 10^`power`, rounded up; those of 5^`power` are the same.
const fn leading_bits(power: i32) -> u64 {
    let of_five = 5u128.pow(power.unsigned_abs());
    if power >= 0 {
        let bits = 128 - of_five.leading_zeros();
        if bits <= 64 {
            return (of_five << (64 - bits)) as u64;
        }
        let cut = bits - 64;
        // It is odd, so what is cut off is never 0.
        return (of_five >> cut) as u64 + 1;
    }
    // Long division of a power of two, until the quotient has 64 bits.
    let (mut quotient, mut rest) = (0u64, 1u128);
    while quotient >> 63 == 0 {
        rest *= 2;
        quotient = quotient * 2 + (rest >= of_five) as u64;
        if rest >= of_five {
            rest -= of_five;
        }
    }
    // The division by an odd number never ends.
    quotient + 1
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A product: what is above 128 bits, and the rest.
    fn product(value: u64, factor: u128) -> (u128, u128) {
        let value = u128::from(value);
        let (low, high) = (value * (factor & u128::from(u64::MAX)), value * (factor >> 64));
        let (rest, carries) = low.overflowing_add(high << 64);
        ((high >> 64) + u128::from(carries), rest)
    }

    #[test]
    fn each_power_has_its_leading_bits_rounded_up() {
        for power in MIN_POWER..=MAX_POWER {
            let (found, of_five) = (power_of_ten(power), 5u128.pow(power.unsigned_abs()));
            let bits = 128 - of_five.leading_zeros();
            assert!(found >= 1 << 63, "{power}: {found:#X}");
            if power >= 0 {
                let right = match bits.checked_sub(64) {
                    Some(cut) => of_five.div_ceil(1 << cut),
                    None => of_five << (64 - bits),
                };
                assert_eq!(u128::from(found), right, "{power}");
                continue;
            }
            // found / 2^(63 + bits) is not below 1 / 5^-power, and the number before it is.
            let one = match (63 + bits).checked_sub(128) {
                Some(above) => (1u128 << above, 0),
                None => (0, 1u128 << (63 + bits)),
            };
            assert!(product(found, of_five) >= one, "{power}: {found:#X}");
            assert!(product(found - 1, of_five) < one, "{power}: {found:#X}");
        }
    }
}
