//! Values in a body: their bytes on the wire, and their text.

use crate::{field::Field, text::Line};

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

/// The fields of a body, in parts.
pub(super) type Layout = &'static [&'static [Field]];

/// A body that says what its fields are.
pub(super) trait Described {
    /// Its layouts, each of another length.
    const LAYOUTS: &'static [Layout];
}

impl<B: Described> Described for &B {
    const LAYOUTS: &'static [Layout] = B::LAYOUTS;
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

#[cfg(all(test, feature = "std"))]
mod tests {
    use alloc::string::String;
    use core::fmt::Debug;

    use super::{List, Value};
    use crate::{text::Line, ucp::codes::ErrorCode};

    /// Asserts the bytes of a value, back and forth, and its text behind the name `n`.
    fn is<V: Value + Debug + PartialEq>(value: V, wire: V::Wire, text: &str)
    where
        V::Wire: Debug + PartialEq,
    {
        assert_eq!((value.to_wire(), V::from_wire(wire)), (wire, value));
        let mut out = String::new();
        let mut line = Line::new(&mut out);
        List::new(&mut line, ": ").value("n", value, "");
        line.end().unwrap();
        assert_eq!(out, text);
    }

    #[test]
    fn values_are_little_endian_and_have_a_name_in_front_unless_they_are_words() {
        is(200_u8, 200, ": n 200");
        is(-1_i8, -1, ": n -1");
        is(0xABCD_u16, [0xCD, 0xAB], ": n 43981");
        is(-2_i16, [0xFE, 0xFF], ": n -2");
        is(u32::MAX - 1, [0xFE, 0xFF, 0xFF, 0xFF], ": n 4294967294");
        is(i32::MIN, [0, 0, 0, 0x80], ": n -2147483648");
        is([1_u16, 2, 3], [[1, 0], [2, 0], [3, 0]], ": n 1 2 3");
        is(ErrorCode::Damaged, 1, ": damaged");
        is(ErrorCode::Other(9), 9, ": err 9");
    }

    #[test]
    fn a_list_has_commas_between_its_values_and_units_behind_them() {
        let mut out = String::new();
        let mut line = Line::new(&mut out);
        let list = List::new(&mut line, "");
        list.value("level", 7_u8, "%").value("err", ErrorCode::Fine, "").value("t", -3_i8, "ms");
        line.end().unwrap();
        assert_eq!(out, "level 7 %, fine, t -3 ms");
    }
}
