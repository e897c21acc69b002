//! Bytes as hex digits.

#[cfg(feature = "ucp")]
use super::line::Line;

/// Bytes that become one chunk of digits.
const GROUP_LEN: usize = 8;

/// Bytes as lower-case hex digits.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Hex<'a>(pub(crate) &'a [u8]);

#[cfg(feature = "ucp")]
impl Hex<'_> {
    /// Appends the digits to `line`.
    pub(crate) fn print(self, line: &mut Line<'_>) {
        for bytes in self.0.chunks(GROUP_LEN) {
            line.chunk(digits(bytes), 2 * bytes.len());
        }
    }
}

/// As one string, made in a buffer: a serializer takes a string faster than digit by digit.
#[cfg(feature = "serde")]
impl serde::Serialize for Hex<'_> {
    fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        // Most frames fit into the first, and clearing the second takes time.
        match self.0.len() {
            ..=64 => serialize_in(&mut [0; 128], self.0, serializer),
            // The longest frame that can be decoded has 256 bytes (ruling U2).
            _ => serialize_in(&mut [0; 512], self.0, serializer),
        }
    }
}

/// Serializes the digits of `bytes`; `buffer` has room for them.
#[cfg(feature = "serde")]
fn serialize_in<S: serde::Serializer>(
    buffer: &mut [u8],
    bytes: &[u8],
    serializer: S,
) -> Result<S::Ok, S::Error> {
    let Some(buffer) = buffer.get_mut(..2 * bytes.len()) else {
        return Err(serde::ser::Error::custom("more bytes than a frame can have"));
    };
    for (to, bytes) in buffer.chunks_mut(2 * GROUP_LEN).zip(bytes.chunks(GROUP_LEN)) {
        for (to, digit) in to.iter_mut().zip(digits(bytes)) {
            *to = digit;
        }
    }
    serializer.serialize_str(str::from_utf8(buffer).unwrap_or_default())
}

/// The digits of up to eight bytes, followed by zeros.
///
/// Without a branch: letters are further from `0` by a constant, and adding 6 to a number carries into
/// the next bit from ten on.
#[inline(always)]
fn digits(bytes: &[u8]) -> [u8; 2 * GROUP_LEN] {
    let mut digits = [0; 2 * GROUP_LEN];
    for (pair, byte) in digits.chunks_exact_mut(2).zip(bytes) {
        for (to, number) in pair.iter_mut().zip([byte >> 4, byte & 0xF]) {
            *to = number + b'0' + (b'a' - b'9' - 1) * ((number + 6) >> 4);
        }
    }
    digits
}
