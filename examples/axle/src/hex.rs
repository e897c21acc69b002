//! Hex text as bytes.

use std::io::{self, BufRead, ErrorKind, Read};

/// Reads hex text: two digits for each byte, with or without `0x`, with spaces, line ends, commas
/// or colons between the bytes or without.
pub(crate) struct Hex<R> {
    text: R,
    /// The first digit of a byte.
    digit: Option<u8>,
    line: u64,
}

impl<R: BufRead> Hex<R> {
    pub(crate) const fn new(text: R) -> Self {
        Self { text, digit: None, line: 1 }
    }

    /// Takes in one character; a byte, if it is complete.
    fn take(&mut self, character: u8) -> Result<Option<u8>, &'static str> {
        match (char::from(character).to_digit(16), self.digit) {
            (Some(digit), None) => self.digit = Some(digit as u8),
            (Some(digit), Some(first)) => {
                self.digit = None;
                return Ok(Some(first << 4 | digit as u8));
            }
            (None, Some(0)) if character == b'x' => self.digit = None,
            (None, Some(_)) => return Err("a byte has two digits"),
            (None, None) if is_between(character) => self.line += u64::from(character == b'\n'),
            (None, None) => return Err("there is something else than hexadecimal digits"),
        }
        Ok(None)
    }
}

impl<R: BufRead> Read for Hex<R> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        loop {
            let mut count = 0;
            let text = self.text.fill_buf()?;
            if text.is_empty() && self.digit.is_some() {
                return Err(self.odd("a byte has two digits"));
            }
            // No more than its digits give bytes.
            let len = text.len().min(buffer.len());
            let text: Vec<u8> = text.iter().copied().take(len).collect();
            let mut used = 0;
            for &character in &text {
                match self.take(character) {
                    Ok(Some(byte)) => {
                        buffer.iter_mut().skip(count).take(1).for_each(|slot| *slot = byte);
                        count += 1;
                    }
                    Ok(None) => {}
                    // The next call comes to it again.
                    Err(_) if count > 0 => break,
                    Err(why) => return Err(self.odd(why)),
                }
                used += 1;
            }
            self.text.consume(used);
            if count > 0 || len == 0 {
                return Ok(count);
            }
        }
    }
}

impl<R> Hex<R> {
    fn odd(&self, why: &str) -> io::Error {
        io::Error::new(ErrorKind::InvalidData, format!("line {} is not hex text: {why}", self.line))
    }
}

/// Whether this may be between the digits of two bytes.
const fn is_between(character: u8) -> bool {
    character.is_ascii_whitespace() || matches!(character, b',' | b':')
}

/// Whether bytes with this beginning are hex text; no frame of any protocol is.
pub(crate) fn is_hex(text: &[u8]) -> bool {
    text.iter().all(|&it| it.is_ascii_hexdigit() || is_between(it) || it == b'x')
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> Result<Vec<u8>, String> {
        let mut bytes = vec![];
        // Every border between two pieces.
        let pieces = io::BufReader::with_capacity(3, text.as_bytes());
        Hex::new(pieces).read_to_end(&mut bytes).map_err(|error| error.to_string())?;
        Ok(bytes)
    }

    #[test]
    fn two_digits_are_a_byte_however_they_are_separated() {
        for text in
            ["fd ff 28 00", "FDFF2800", "0xfd, 0xFF,0x28\n0x00\r\n", "fd:ff:28:00\n", "fdff 2800"]
        {
            assert_eq!(read(text).unwrap(), [0xFD, 0xFF, 0x28, 0], "{text}");
            assert!(is_hex(text.as_bytes()));
        }
        assert!(read("").unwrap().is_empty());
    }

    #[test]
    fn half_a_byte_and_other_text_name_their_line() {
        let half = "line 2 is not hex text: a byte has two digits";
        assert_eq!(read("fd\nf\n"), Err(half.to_owned()));
        assert_eq!(read("fd\nf"), Err(half.to_owned()));
        let other = "line 3 is not hex text: there is something else than hexadecimal digits";
        assert_eq!(read("fd\n\nrx: ff"), Err(other.to_owned()));
    }

    #[test]
    fn what_is_in_front_of_other_text_is_read() {
        let mut hex = Hex::new(&b"fd ff # end"[..]);
        let mut buffer = [0; 16];
        assert_eq!((hex.read(&mut buffer).unwrap(), buffer[..2].to_vec()), (2, vec![0xFD, 0xFF]));
        assert_eq!(hex.read(&mut buffer).unwrap_err().kind(), ErrorKind::InvalidData);
    }
}
