//! A line of text: words and integers, each preceded by a space.
//!
//! Avoids `core::fmt`, which would be the larger part of these programs.

use heapless::String;

/// Maximum length of a line, bytes, including its end. Shorter than the queue that it is sent
/// through.
const LEN: usize = 500;

/// A line being built. Words that do not fit are left out as a whole.
#[derive(Debug)]
pub struct TextLine(String<LEN>);

impl TextLine {
    /// A line that begins with this word.
    pub fn new(first: &str) -> Self {
        let mut line = Self(String::new());
        line.push(first);
        line
    }

    /// Adds a word.
    pub fn word(&mut self, word: &str) -> &mut Self {
        self.push(" ");
        self.push(word);
        self
    }

    /// Adds a name and a count.
    pub fn count(&mut self, name: &str, value: u32) -> &mut Self {
        self.word(name).digits("", value)
    }

    /// Adds a name and a number.
    pub fn number(&mut self, name: &str, value: i32) -> &mut Self {
        self.word(name).digits(if value < 0 { "-" } else { "" }, value.unsigned_abs())
    }

    /// Adds a name and a number in thousandths, saturating.
    pub fn thousandths(&mut self, name: &str, value: f32) -> &mut Self {
        // `as` truncates and saturates, so adding half away from zero rounds.
        self.number(name, (value * 1000.0 + if value < 0.0 { -0.5 } else { 0.5 }) as i32)
    }

    fn digits(&mut self, sign: &str, value: u32) -> &mut Self {
        let (mut digits, mut rest) = ([b'0'; 10], value);
        let mut used = 0;
        for digit in digits.iter_mut().rev() {
            *digit = b'0' + (rest % 10) as u8;
            (rest, used) = (rest / 10, used + 1);
            if rest == 0 {
                break;
            }
        }
        self.push(" ");
        self.push(sign);
        for &digit in digits.iter().skip(10 - used) {
            let _ = self.0.push(digit.into());
        }
        self
    }

    fn push(&mut self, text: &str) {
        // A full line stays as it is.
        let _ = self.0.push_str(text);
    }

    /// Ends the line and returns its bytes.
    pub fn end(&mut self) -> &[u8] {
        while self.0.push_str("\r\n").is_err() {
            self.0.pop();
        }
        self.0.as_bytes()
    }
}
