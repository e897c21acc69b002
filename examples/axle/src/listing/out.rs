//! Text that is collected before it is written.

use std::fmt;

/// Lines that are collected before they are written.
#[derive(Debug, Default)]
pub(crate) struct Out(pub(crate) Vec<u8>);

impl Out {
    pub(crate) fn text(&mut self, text: &str) {
        self.0.extend_from_slice(text.as_bytes());
    }

    pub(crate) fn number(&mut self, number: u64) {
        self.text(itoa::Buffer::new().format(number));
    }

    /// A number, right-aligned.
    pub(crate) fn padded(&mut self, number: u64, width: usize) {
        let mut buffer = itoa::Buffer::new();
        let digits = buffer.format(number);
        self.pad(width.saturating_sub(digits.len()));
        self.text(digits);
    }

    pub(crate) fn pad(&mut self, count: usize) {
        self.0.resize(self.0.len() + count, b' ');
    }
}

impl fmt::Write for Out {
    fn write_str(&mut self, text: &str) -> fmt::Result {
        self.text(text);
        Ok(())
    }
}
