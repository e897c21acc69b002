//! One field: its name, its type, and what it means.

/// A field of a [`Record`](crate::fields::Record).
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
#[non_exhaustive]
pub struct Field {
    /// Its key.
    pub name: &'static str,
    /// Type of its values.
    pub kind: Kind,
    /// One value, an array or an object.
    pub shape: Shape,
    /// Smallest and largest value, where those of the type never occur. Equal for a constant.
    pub limits: Option<(u64, u64)>,
    /// Values that have a name, such as those of an error code. Others can occur.
    pub values: &'static [(u32, &'static str)],
    /// What 1 is, such as `1/min`; `none` for what is not measured.
    pub unit: &'static str,
    /// What it is, in a few words of English.
    pub meaning: &'static str,
    /// The rulings that decide it, such as `U5`, or `tool` for what `axle` adds; may be empty.
    pub source: &'static str,
    /// Whether a line of `axle decode --json` can lack it.
    pub is_optional: bool,
    /// Whether only `axle decode --json` has it, and `serde` has not.
    pub is_of_tool: bool,
}

/// Type of a value.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
#[expect(missing_docs, reason = "integers are named after their types")]
pub enum Kind {
    U8,
    I8,
    U16,
    I16,
    U32,
    I32,
    U64,
    /// A number; in JSON `nan`, `inf` and `-inf` are strings.
    F32,
    /// Seconds since 1970, with six decimals.
    Time,
    /// One of these names.
    Name(&'static [&'static str]),
    /// Bytes; in JSON lower-case hex digits.
    Bytes,
}

impl Kind {
    /// The type as one word: `u8`, `f32`, `time`, `name`, `bytes`.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::U8 => "u8",
            Self::I8 => "i8",
            Self::U16 => "u16",
            Self::I16 => "i16",
            Self::U32 => "u32",
            Self::I32 => "i32",
            Self::U64 => "u64",
            Self::F32 => "f32",
            Self::Time => "time",
            Self::Name(_) => "name",
            Self::Bytes => "bytes",
        }
    }
}

/// How many values a field has.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub enum Shape {
    /// One.
    One,
    /// An array of this length.
    Array(usize),
    /// An object with these keys. If its values are at least 1, those that would be 0 are left out.
    Object(&'static [&'static str]),
}

/// A type of Rust whose values are those of a field.
pub(crate) trait Typed {
    const KIND: Kind;
    const SHAPE: Shape = Shape::One;
    const VALUES: &'static [(u32, &'static str)] = &[];
}

macro_rules! typed {
    ($($integer:ty: $kind:ident;)+) => {$(
        impl Typed for $integer {
            const KIND: Kind = Kind::$kind;
        }
    )+};
}
typed! { u8: U8; i8: I8; u16: U16; i16: I16; u32: U32; i32: I32; u64: U64; f32: F32; }

impl<T: Typed, const N: usize> Typed for [T; N] {
    const KIND: Kind = T::KIND;
    const SHAPE: Shape = Shape::Array(N);
    const VALUES: &'static [(u32, &'static str)] = T::VALUES;
}

impl Typed for &[u8] {
    const KIND: Kind = Kind::Bytes;
}

/// A name; [`Field::named`] says which there are.
impl Typed for &str {
    const KIND: Kind = Kind::Name(&[]);
}

/// The time of a frame.
pub(super) struct Time;

impl Typed for Time {
    const KIND: Kind = Kind::Time;
}

impl Field {
    /// A field without a unit. `doc` is the text of its doc comment.
    pub(crate) const fn new<T: Typed>(
        name: &'static str,
        source: &'static str,
        doc: &'static str,
    ) -> Self {
        Self {
            name,
            kind: T::KIND,
            shape: T::SHAPE,
            limits: None,
            values: T::VALUES,
            unit: "none",
            meaning: without_period(doc.trim_ascii()),
            source,
            is_optional: false,
            is_of_tool: false,
        }
    }

    /// With values of this type; those with names keep them.
    pub(crate) const fn of<T: Typed>(self) -> Self {
        Self { kind: T::KIND, shape: T::SHAPE, ..self }
    }

    pub(crate) const fn unit(self, unit: &'static str) -> Self {
        Self { unit, ..self }
    }

    /// With these names as its values.
    pub(crate) const fn named(self, names: &'static [&'static str]) -> Self {
        Self { kind: Kind::Name(names), ..self }
    }

    /// As an object with these keys.
    pub(super) const fn object(self, names: &'static [&'static str]) -> Self {
        Self { shape: Shape::Object(names), ..self }
    }

    pub(crate) const fn within(self, least: u64, most: u64) -> Self {
        Self { limits: Some((least, most)), ..self }
    }

    pub(crate) const fn optional(self) -> Self {
        Self { is_optional: true, ..self }
    }

    pub(crate) const fn of_tool(self) -> Self {
        Self { is_of_tool: true, ..self }
    }
}

const fn without_period(text: &str) -> &str {
    match text.as_bytes() {
        [rest @ .., b'.'] => match str::from_utf8(rest) {
            Ok(text) => text,
            Err(_) => text,
        },
        _ => text,
    }
}

/// A field with its doc comment as its meaning: `"key": type, "unit" by "source"`; and what
/// else is to be said, such as `, optional()`.
macro_rules! field {
    (
        $(#[doc = $doc:literal])*
        $key:literal: $of:ty, $($unit:literal)? by $source:expr $(, $with:ident($($value:expr),*))*
    ) => {
        $crate::field::Field::new::<$of>($key, $source, concat!($($doc),*))
            $(.unit($unit))? $(.$with($($value),*))*
    };
}
pub(crate) use field;

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_field_has_what_is_said_of_it_and_the_rest_is_plain() {
        let plain = field! {
            /// What it is.
            "key": u8, by "I4"
        };
        assert_eq!((plain.name, plain.source, plain.meaning), ("key", "I4", "What it is"));
        assert_eq!((plain.kind, plain.shape, plain.limits), (Kind::U8, Shape::One, None));
        assert_eq!((plain.unit, plain.is_optional, plain.is_of_tool), ("none", false, false));
        let full = plain.of::<[i16; 3]>().unit("1/s").within(1, 8).optional().of_tool();
        assert_eq!(
            (full.kind, full.shape, full.limits),
            (Kind::I16, Shape::Array(3), Some((1, 8)))
        );
        assert_eq!((full.unit, full.is_optional, full.is_of_tool), ("1/s", true, true));
        let named = plain.named(&["on", "off"]).object(&["left"]);
        assert_eq!(
            (named.kind, named.shape),
            (Kind::Name(&["on", "off"]), Shape::Object(&["left"]))
        );
    }

    #[test]
    fn each_type_is_one_word() {
        let integers = [Kind::U8, Kind::I8, Kind::U16, Kind::I16, Kind::U32, Kind::I32, Kind::U64];
        let others = [Kind::F32, Kind::Time, Kind::Name(&[]), Kind::Bytes];
        assert_eq!(integers.map(Kind::name), ["u8", "i8", "u16", "i16", "u32", "i32", "u64"]);
        assert_eq!(others.map(Kind::name), ["f32", "time", "name", "bytes"]);
    }
}
