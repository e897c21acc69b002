//! A line of text that is built in a buffer and written at once.

use core::fmt;

/// Bytes that are copied at once, whatever part of them counts: a copy of a fixed length is a few
/// instructions.
const CHUNK_LEN: usize = 16;

/// Bytes that are written at once. Nearly every line is shorter.
const CAPACITY: usize = 256;

/// Collects ASCII text in a buffer, and writes it when the line ends or the buffer is full.
pub(crate) struct Line<'a> {
    out: &'a mut dyn fmt::Write,
    buffer: [u8; CAPACITY + CHUNK_LEN],
    /// Bytes of `buffer` in use, at most `CAPACITY`.
    len: usize,
    result: fmt::Result,
}

impl<'a> Line<'a> {
    pub(crate) fn new(out: &'a mut dyn fmt::Write) -> Self {
        Self { out, buffer: [0; CAPACITY + CHUNK_LEN], len: 0, result: Ok(()) }
    }

    /// Writes what is left.
    ///
    /// # Errors
    ///
    /// The first error of the writer.
    pub(crate) fn end(mut self) -> fmt::Result {
        self.flush();
        self.result
    }

    /// Appends `text`, which must be ASCII and at most 256 bytes long.
    #[inline(always)]
    pub(crate) fn text(&mut self, text: &str) {
        self.reserve(text.len());
        let end = self.len + text.len();
        if let Some(to) = self.buffer.get_mut(self.len..end) {
            to.copy_from_slice(text.as_bytes());
            self.len = end;
        }
    }

    /// Appends the first `len` bytes of `chunk`, which must be ASCII.
    #[inline(always)]
    pub(super) fn chunk(&mut self, chunk: [u8; CHUNK_LEN], len: usize) {
        self.reserve(CHUNK_LEN);
        if let Some(to) = self.buffer.get_mut(self.len..).and_then(<[u8]>::first_chunk_mut) {
            *to = chunk;
            self.len += len.min(CHUNK_LEN);
        }
    }

    /// Appends an integer, right-aligned in `width` columns, at most 15.
    #[inline]
    pub(crate) fn integer(&mut self, value: i32, width: usize) {
        self.fixed::<0>(value < 0, value.unsigned_abs(), width);
    }

    /// Appends `magnitude` / 10^`DECIMALS`, right-aligned in `width` columns.
    ///
    /// The sign is a separate argument, because core prints it for a number that rounds to 0, too.
    /// A number that needs more than `width` columns takes them; none needs more than 12.
    pub(crate) fn fixed<const DECIMALS: usize>(
        &mut self,
        is_negative: bool,
        magnitude: u32,
        width: usize,
    ) {
        // The number ends in the middle, so that 16 bytes from any of its columns can be copied.
        let mut columns = [b' '; 2 * CHUNK_LEN];
        let mut used = 0;
        let mut put = |byte| {
            if let Some(column) = columns.get_mut((CHUNK_LEN - 1).wrapping_sub(used)) {
                *column = byte;
                used += 1;
            }
        };
        let mut rest = magnitude;
        for _ in 0..DECIMALS {
            put(b'0' + (rest % 10) as u8);
            rest /= 10;
        }
        if DECIMALS > 0 {
            put(b'.');
        }
        loop {
            put(b'0' + (rest % 10) as u8);
            rest /= 10;
            if rest == 0 {
                break;
            }
        }
        if is_negative {
            put(b'-');
        }
        let used = used.max(width).min(CHUNK_LEN);
        if let Some(chunk) = columns.get(CHUNK_LEN - used..).and_then(<[u8]>::first_chunk) {
            self.chunk(*chunk, used);
        }
    }

    /// Appends the shortest number that reads back as this value, as core prints it.
    #[cfg(feature = "ikeya")]
    pub(crate) fn float(&mut self, value: f32) {
        // A failure of the writer is in `result`.
        let _ = fmt::Write::write_fmt(self, format_args!("{value:?}"));
    }

    /// Appends the values that `print` appends for each of `values`, separated by spaces.
    #[inline(always)]
    pub(crate) fn spaced<T>(
        &mut self,
        values: impl IntoIterator<Item = T>,
        mut print: impl FnMut(&mut Self, T),
    ) {
        let mut before = "";
        for value in values {
            self.text(before);
            before = " ";
            print(self, value);
        }
    }

    /// Makes room for `len` bytes, at most `CAPACITY`.
    #[inline(always)]
    fn reserve(&mut self, len: usize) {
        if self.len + len > CAPACITY {
            self.flush();
        }
    }

    #[inline(never)]
    fn flush(&mut self) {
        let text = self.buffer.get(..self.len).unwrap_or_default();
        // Only ASCII was appended.
        let text = str::from_utf8(text).unwrap_or_default();
        self.result = self.result.and_then(|()| self.out.write_str(text));
        self.len = 0;
    }
}

/// For core, which writes a float in a few short pieces.
#[cfg(feature = "ikeya")]
impl fmt::Write for Line<'_> {
    fn write_str(&mut self, text: &str) -> fmt::Result {
        self.text(text);
        Ok(())
    }
}
