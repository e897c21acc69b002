//! A picture as bytes for a terminal.

use std::fmt::Write;

use ratatui_core::{
    buffer::Buffer,
    style::{Color, Modifier, Style},
};

/// The page of its own that full-screen programs use, without a cursor.
pub(super) const ENTER: &str = "\x1b[?1049h\x1b[?25l\x1b[0m\x1b[2J";

/// The terminal as it was.
pub(super) const LEAVE: &str = "\x1b[0m\x1b[?25h\x1b[?1049l";

/// What turns the picture `before` into `after`; a picture of another size is drawn as a whole.
pub(super) fn change(before: &Buffer, after: &Buffer) -> String {
    let mut text = String::new();
    let empty = Buffer::empty(*after.area());
    let before = if before.area() == after.area() {
        before
    } else {
        text.push_str("\x1b[0m\x1b[2J");
        &empty
    };
    let (mut next, mut style) = (None, Style::new());
    for (x, y, cell) in before.diff(after) {
        // Writing to a string does not fail.
        if next != Some((x, y)) {
            let _ = write!(text, "\x1b[{};{}H", y + 1, x + 1);
        }
        if cell.style() != style {
            style = cell.style();
            text.push_str("\x1b[0");
            for (modifier, code) in MODIFIERS {
                if style.add_modifier.contains(modifier) {
                    text.push_str(code);
                }
            }
            let _ = write!(text, ";{}m", colour(style.fg));
        }
        text.push_str(cell.symbol());
        next = Some((x + 1, y));
    }
    text
}

const MODIFIERS: [(Modifier, &str); 2] = [(Modifier::BOLD, ";1"), (Modifier::REVERSED, ";7")];

/// The codes of the colours that the page uses: the user's own ones of these names.
const fn colour(colour: Option<Color>) -> u8 {
    match colour {
        Some(Color::Red) => 31,
        Some(Color::Green) => 32,
        Some(Color::Yellow) => 33,
        Some(Color::DarkGray) => 90,
        _ => 39,
    }
}

#[cfg(test)]
mod tests {
    use ratatui_core::layout::Rect;

    use super::*;

    #[test]
    fn only_what_has_changed_is_written() {
        let area = Rect::new(0, 0, 10, 2);
        let mut before = Buffer::empty(area);
        before.set_string(0, 0, "value 1.0", Style::new());
        let mut after = before.clone();
        assert_eq!(change(&before, &after), "");
        after.set_string(6, 0, "2", Style::new().fg(Color::Red));
        after.set_string(0, 1, "b", Style::new().add_modifier(Modifier::BOLD));
        // Cells that were never styled have the default colours, written out.
        assert_eq!(change(&before, &after), "\x1b[1;7H\x1b[0;31m2\x1b[2;1H\x1b[0;1;39mb");
    }

    #[test]
    fn another_size_begins_with_an_empty_screen() {
        let before = Buffer::empty(Rect::new(0, 0, 3, 1));
        let after = Buffer::with_lines(["ab"]);
        assert_eq!(change(&before, &after), "\x1b[0m\x1b[2J\x1b[1;1H\x1b[0;39mab");
        assert_eq!(change(&after, &Buffer::empty(Rect::ZERO)), "\x1b[0m\x1b[2J");
    }
}
