//! Values in a body: their bytes on the wire, and their text.

use crate::text::Line;

/// A value of a field.
pub(super) trait Value: Copy {
    /// Its bytes on the wire, with alignment 1.
    type Wire: Copy;

    /// Whether the text is words, which need no name in front of them.
    const IS_WORDS: bool = false;

    fn from_wire(bytes: Self::Wire) -> Self;

    fn to_wire(self) -> Self::Wire;

    /// Appends the text without name and unit.
    fn print(self, line: &mut Line<'_>);
}

/// A body that prints its values.
pub(super) trait Print {
    /// Appends the values on one line, with `before` in front of them. A body without values
    /// appends nothing.
    fn print(&self, line: &mut Line<'_>, before: &'static str);
}

/// Appends values, separated by commas.
pub(super) struct List<'l, 'out> {
    line: &'l mut Line<'out>,
    before: &'static str,
}

impl<'l, 'out> List<'l, 'out> {
    /// Begins a list, with `before` in front of its first value.
    pub(super) const fn new(line: &'l mut Line<'out>, before: &'static str) -> Self {
        Self { line, before }
    }

    /// Appends a value: `heading 90 deg`. `name` and `unit`, which may be empty, must be ASCII.
    pub(super) fn value<V: Value>(self, name: &str, value: V, unit: &str) -> Self {
        self.line.text(self.before);
        if !V::IS_WORDS {
            self.line.text(name);
            self.line.text(" ");
        }
        value.print(self.line);
        if !unit.is_empty() {
            self.line.text(" ");
            self.line.text(unit);
        }
        Self { before: ", ", ..self }
    }
}

/// Integers of one byte are their own bytes.
macro_rules! one_byte {
    ($($integer:ty),+) => {$(
        impl Value for $integer {
            type Wire = Self;

            fn from_wire(byte: Self) -> Self {
                byte
            }

            fn to_wire(self) -> Self {
                self
            }

            fn print(self, line: &mut Line<'_>) {
                line.integer(self.into(), 0);
            }
        }
    )+};
}
one_byte! { u8, i8 }

/// Longer integers are little-endian (ruling B5).
macro_rules! little_endian {
    ($($integer:ty: $value:ident, $line:ident => $print:expr;)+) => {$(
        impl Value for $integer {
            type Wire = [u8; size_of::<Self>()];

            fn from_wire(bytes: Self::Wire) -> Self {
                Self::from_le_bytes(bytes)
            }

            fn to_wire(self) -> Self::Wire {
                self.to_le_bytes()
            }

            fn print(self, $line: &mut Line<'_>) {
                let $value = self;
                $print;
            }
        }
    )+};
}
little_endian! {
    u16: value, line => line.integer(value.into(), 0);
    i16: value, line => line.integer(value.into(), 0);
    u32: value, line => line.fixed::<0>(false, value, 0);
    i32: value, line => line.integer(value, 0);
}

impl<V: Value, const N: usize> Value for [V; N] {
    type Wire = [V::Wire; N];

    fn from_wire(bytes: Self::Wire) -> Self {
        bytes.map(V::from_wire)
    }

    fn to_wire(self) -> Self::Wire {
        self.map(V::to_wire)
    }

    fn print(self, line: &mut Line<'_>) {
        line.spaced(self, |line, value| value.print(line));
    }
}
