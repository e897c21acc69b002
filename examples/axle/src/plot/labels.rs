//! The numbers beside an axis: each is right, unlike its neighbours, and as short as that allows.

/// Below that, and from that on, numbers have exponents, where this makes them shorter.
const SMALL: f64 = 1e-3;
const LARGE: f64 = 1e6;

/// More decimals than a step has that a double can tell from its neighbours.
const MOST: i32 = 20;

/// How the numbers of an axis are written.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Labels {
    /// All ticks are multiples of ten to the power of minus this.
    decimals: i32,
    has_exponent: bool,
    /// What is nearer to 0 than this is 0.
    zero: f64,
}

impl Labels {
    /// For an axis with these ticks.
    pub(super) fn of(ticks: &[f64]) -> Self {
        let most = ticks.iter().map(|tick| tick.abs()).fold(0.0, f64::max);
        let steps = ticks.iter().zip(ticks.iter().skip(1)).map(|(one, next)| (next - one).abs());
        let step = steps.filter(|step| *step > 0.0).fold(f64::INFINITY, f64::min);
        let step = if step.is_finite() { step } else { most };
        if step <= 0.0 {
            return Self { decimals: 0, has_exponent: false, zero: 0.0 };
        }
        let first = -power_of(step);
        let is_enough = |decimals: &i32| {
            let times = 10_f64.powi(*decimals);
            let is_whole =
                |tick: &f64| (tick * times - (tick * times).round()).abs() < 0.01 * step * times;
            ticks.iter().all(is_whole)
        };
        let decimals = (first..first + MOST).find(is_enough).unwrap_or(first + 1);
        let plain = Self { decimals, has_exponent: false, zero: step / 100.0 };
        let short = Self { has_exponent: true, ..plain };
        let width = |labels: &Self| {
            ticks.iter().map(|tick| labels.text(*tick).chars().count()).max().unwrap_or_default()
        };
        let is_usual = (SMALL..LARGE).contains(&most);
        if is_usual || width(&plain) <= width(&short) { plain } else { short }
    }

    /// The number of a tick.
    pub(super) fn text(&self, tick: f64) -> String {
        if tick.abs() <= self.zero {
            return "0".to_owned();
        }
        let decimals = |count: i32| usize::try_from(count).unwrap_or_default();
        let text = if self.has_exponent {
            let text = format!("{:.*e}", decimals(self.decimals + power_of(tick.abs())), tick);
            let (number, power) = text.split_once('e').unwrap_or((&text, "0"));
            format!("{}e{power}", without_zeros(number))
        } else {
            without_zeros(&format!("{tick:.*}", decimals(self.decimals))).to_owned()
        };
        text.replace('-', "\u{2212}")
    }
}

/// The power of ten that is not above this number.
fn power_of(number: f64) -> i32 {
    (number.log10() + 1e-9).floor() as i32
}

/// Without the zeros that end a fraction.
fn without_zeros(number: &str) -> &str {
    match number.contains('.') {
        true => number.trim_end_matches('0').trim_end_matches('.'),
        false => number,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn texts(ticks: &[f64]) -> Vec<String> {
        let labels = Labels::of(ticks);
        ticks.iter().map(|tick| labels.text(*tick).replace('\u{2212}', "-")).collect()
    }

    #[test]
    fn the_numbers_of_an_axis_are_short() {
        assert_eq!(texts(&[-5.0, 0.0, 5.0]), ["-5", "0", "5"]);
        assert_eq!(texts(&[-0.25, -1e-17, 0.25, 0.5]), ["-0.25", "0", "0.25", "0.5"]);
        assert_eq!(texts(&[0.0, 1500.0, 3000.0]), ["0", "1500", "3000"]);
        assert_eq!(texts(&[0.1, 0.2, 0.300_000_000_000_000_04]), ["0.1", "0.2", "0.3"]);
        assert_eq!(texts(&[]), [""; 0]);
        assert_eq!(texts(&[0.0]), ["0"]);
        assert_eq!(texts(&[12.5]), ["12.5"]);
    }

    #[test]
    fn large_and_small_numbers_have_exponents_where_that_is_shorter() {
        assert_eq!(texts(&[-2e38, 0.0, 2e38]), ["-2e38", "0", "2e38"]);
        assert_eq!(texts(&[0.0, 5e-7, 1e-6, 1.5e-6]), ["0", "5e-7", "1e-6", "1.5e-6"]);
        assert_eq!(texts(&[0.0, 1e-7, 2e-7]), ["0", "1e-7", "2e-7"]);
        assert_eq!(texts(&[0.0, 500_000.0, 1e6]), ["0", "5e5", "1e6"]);
        assert_eq!(texts(&[1_234_567.0, 1_234_568.0]), ["1234567", "1234568"]);
        assert_eq!(texts(&[9.99e8, 1e9, 1.001e9]), ["9.99e8", "1e9", "1.001e9"]);
        assert_eq!(texts(&[0.001, 0.0015]), ["0.001", "0.0015"]);
    }

    #[test]
    fn no_two_numbers_of_an_axis_are_alike_and_each_is_its_tick() {
        for power in -40..38 {
            for steps in [1.0, 2.0, 5.0] {
                for first in [-7.0, 0.0, 12_345.0] {
                    let step = steps * 10_f64.powi(power);
                    let ticks: Vec<f64> =
                        (0..12).map(|tick| (first + f64::from(tick)) * step).collect();
                    let texts = texts(&ticks);
                    for (text, tick) in texts.iter().zip(&ticks) {
                        let read: f64 = text.parse().unwrap();
                        assert!((read - tick).abs() < step / 1e3, "{texts:?} is not {ticks:?}");
                    }
                }
            }
        }
    }
}
