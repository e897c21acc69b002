//! Bytes as hex digits.

#[cfg(feature = "ucp")]
use super::line::Line;

/// Bytes whose digits are computed at once.
const GROUP_LEN: usize = 8;

/// Bytes as lower-case hex digits.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Hex<'a>(pub(crate) &'a [u8]);

#[cfg(feature = "ucp")]
impl Hex<'_> {
    /// Appends the digits to `line`.
    pub(crate) fn print(self, line: &mut Line<'_>) {
        self.groups(|digits, len| line.chunk(digits, len));
    }
}

impl Hex<'_> {
    /// Calls `print` with digits and their number: all 16, except for the last bytes.
    #[inline(always)]
    fn groups(self, mut print: impl FnMut([u8; 2 * GROUP_LEN], usize)) {
        let mut rest = self.0;
        while let Some((group, behind)) = rest.split_first_chunk() {
            print(digits(*group), 2 * GROUP_LEN);
            rest = behind;
        }
        if !rest.is_empty() {
            let mut last = [0; GROUP_LEN];
            for (to, from) in last.iter_mut().zip(rest) {
                *to = *from;
            }
            print(digits(last), 2 * rest.len());
        }
    }
}

/// As one string, made in a buffer: a serializer takes it faster than digit by digit.
#[cfg(feature = "serde")]
impl serde::Serialize for Hex<'_> {
    fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        // Most frames fit into the first; clearing the second takes as long as filling it.
        match self.0.len() {
            ..=64 => self.serialize_in(&mut [0; 128], serializer),
            // The longest frame that can be decoded has 256 bytes (ruling U2).
            _ => self.serialize_in(&mut [0; 512], serializer),
        }
    }
}

#[cfg(feature = "serde")]
impl Hex<'_> {
    fn serialize_in<S: serde::Serializer>(
        self,
        buffer: &mut [u8],
        serializer: S,
    ) -> Result<S::Ok, S::Error> {
        let mut groups = buffer.chunks_exact_mut(2 * GROUP_LEN);
        self.groups(|digits, _| {
            if let Some(to) = groups.next() {
                to.copy_from_slice(&digits);
            }
        });
        let Some(digits) = buffer.get(..2 * self.0.len()) else {
            return Err(serde::ser::Error::custom("more bytes than a frame can have"));
        };
        serializer.serialize_str(str::from_utf8(digits).unwrap_or_default())
    }
}

/// The digits of eight bytes, in one number instead of a loop.
#[inline(always)]
const fn digits(bytes: [u8; GROUP_LEN]) -> [u8; 2 * GROUP_LEN] {
    const fn repeated(byte: u8) -> u128 {
        u128::from_le_bytes([byte; 16])
    }
    // Spreads the bytes until each is the lower half of 16 bits.
    let spread = u64::from_le_bytes(bytes) as u128;
    let spread = (spread | spread << 32) & 0x0000_0000_FFFF_FFFF_0000_0000_FFFF_FFFF;
    let spread = (spread | spread << 16) & 0x0000_FFFF_0000_FFFF_0000_FFFF_0000_FFFF;
    let spread = (spread | spread << 8) & 0x00FF_00FF_00FF_00FF_00FF_00FF_00FF_00FF;
    // The digit for the upper four bits comes first.
    let numbers = (spread >> 4 | spread << 8) & repeated(0x0F);
    // From ten on, adding 6 carries into bit 4, and the letters are further from `0` than digits.
    let letters = (numbers + repeated(6)) >> 4 & repeated(1);
    let digits = numbers + repeated(b'0') + letters * (b'a' - b'9' - 1) as u128;
    digits.to_le_bytes()
}
