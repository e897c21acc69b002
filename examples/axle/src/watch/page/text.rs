//! Texts in a limited width: shorter ones, never a part of a number.

use ratatui_core::{buffer::Buffer, layout::Rect, style::Style};

use crate::watch::model::Values;

/// Writes a text where there is room for it.
pub(super) fn put(buffer: &mut Buffer, area: Rect, x: u16, y: u16, text: &str, style: Style) {
    if !area.contains((x, y).into()) {
        return;
    }
    let room = area.right().saturating_sub(x);
    buffer.set_stringn(x, y, text, room.into(), style);
}

/// The first text that fits, or the last one, cut.
pub(super) fn fitting(texts: &[String], width: u16) -> String {
    let fits = |text: &&String| text.chars().count() <= width.into();
    let found = texts.iter().find(fits).or(texts.last());
    found.map(|text| cut(text, width)).unwrap_or_default()
}

/// As much as fits; what is cut off shows as a tilde. Not for numbers.
pub(super) fn cut(text: &str, width: u16) -> String {
    let width = usize::from(width);
    if text.chars().count() <= width {
        return text.to_owned();
    }
    let kept: String = text.chars().take(width.saturating_sub(1)).collect();
    if width == 0 { kept } else { kept + "~" }
}

/// Values with their unit, with as many digits as there is room for, up to `digits`.
pub(super) fn values(values: &Values, unit: &str, digits: usize, width: u16) -> String {
    let short = unit.chars().take(1).collect::<String>();
    for precision in (0..=digits).rev() {
        let numbers: Vec<_> = values.all().iter().map(|value| number(*value, precision)).collect();
        let numbers = numbers.join(" ");
        for text in [format!("{numbers} {unit}"), format!("{numbers} {short}"), numbers.clone()] {
            // A short unit is better than a coarse number.
            if text.len() <= width.into() {
                return text;
            }
        }
    }
    cut("wide", width)
}

/// A number; a huge one, which only a damaged node can send, in powers of ten.
fn number(value: f64, precision: usize) -> String {
    if value.abs() >= 1e7 { format!("{value:.1e}") } else { format!("{value:.precision$}") }
}

/// Microseconds as milliseconds.
pub(super) fn millis(micros: u64) -> String {
    let millis = micros as f64 / 1e3;
    if millis < 100.0 { format!("{millis:.1} ms") } else { format!("{millis:.0} ms") }
}

const BLOCKS: [char; 8] = ['▁', '▂', '▃', '▄', '▅', '▆', '▇', '█'];
const ASCII: [char; 8] = ['_', '.', '-', '~', '=', '*', '%', '#'];

/// One column per value, as high as the value within those shown.
pub(super) fn sparkline(values: impl Iterator<Item = f32> + Clone, is_ascii: bool) -> String {
    let known = values.clone().filter(|value| value.is_finite());
    let (low, high) =
        known.fold((f32::MAX, f32::MIN), |(low, high), value| (low.min(value), high.max(value)));
    // The noise of a steady value is not a change.
    let span = (f64::from(high) - f64::from(low)).max(f64::from(high).abs() * 0.02).max(0.02);
    let levels = if is_ascii { ASCII } else { BLOCKS };
    let column = |value: f32| {
        if !value.is_finite() {
            return ' ';
        }
        let level = (f64::from(value) - f64::from(low)) / span * levels.len() as f64;
        levels.get((level as usize).min(levels.len() - 1)).copied().unwrap_or(' ')
    };
    values.map(column).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_value_loses_digits_where_there_is_no_room_but_never_its_front() {
        let of = |value: f64, width| values(&Values::new(&[value]), "turns", 4, width);
        assert_eq!(of(-12.34567, 20), "-12.3457 turns");
        assert_eq!(of(-12.34567, 13), "-12.3457 t");
        assert_eq!(of(-12.34567, 8), "-12.3457");
        assert_eq!(of(-12.34567, 7), "-12.346");
        assert_eq!(of(-12.34567, 3), "-12");
        assert_eq!(of(-12.34567, 2), "w~");
        assert_eq!(of(1e30, 9), "1.0e30 t");
        let three = Values::new(&[1.0, -2.5, 3.25]);
        assert_eq!(values(&three, "rps", 2, 30), "1.00 -2.50 3.25 rps");
        assert_eq!(values(&three, "rps", 2, 10), "1 -2 3 rps");
    }

    #[test]
    fn texts_are_cut_with_a_mark() {
        assert_eq!(cut("abc", 3), "abc");
        assert_eq!(cut("abcd", 3), "ab~");
        assert_eq!(cut("abcd", 0), "");
        let texts = ["long text".to_owned(), "text".to_owned()];
        assert_eq!(fitting(&texts, 9), "long text");
        assert_eq!(fitting(&texts, 8), "text");
        assert_eq!(fitting(&texts, 2), "t~");
        assert_eq!(fitting(&[], 2), "");
    }

    #[test]
    fn a_sparkline_shows_changes_and_neither_noise_nor_missing_values() {
        let of = |values: &[f32]| sparkline(values.iter().copied(), false);
        assert_eq!(of(&[0.0, 1.0, 2.0]), "▁▅█");
        assert_eq!(of(&[-1.0, f32::NAN, 1.0]), "▁ █");
        assert_eq!(of(&[5.0, 5.01, 5.0]), "▁▁▁");
        assert_eq!(of(&[f32::NAN, f32::INFINITY]), "  ");
        assert_eq!(of(&[f32::MIN, f32::MAX]), "▁█");
        assert_eq!(sparkline([0.0, 9.0].into_iter(), true), "_#");
    }
}
