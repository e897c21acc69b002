//! Values of one column.

use core::fmt;

use axlewire::fields::{Field, Kind};
use serde::ser;

/// A frame does not fit the columns: its fields are not those of the table of fields.
#[derive(Clone, Copy, Debug)]
pub(super) struct Unfit;

impl fmt::Display for Unfit {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a field is not in the table of fields")
    }
}

impl std::error::Error for Unfit {}

impl ser::Error for Unfit {
    fn custom<T: fmt::Display>(_: T) -> Self {
        Self
    }
}

/// A column: its values, where there are any.
#[derive(Debug, PartialEq)]
pub struct Column {
    /// That of the field, with the number or the name of a part of it.
    pub name: String,
    /// The type of its values.
    pub kind: Kind,
    /// The names that occur in a column of names.
    pub names: Vec<&'static str>,
    /// What 1 is; `none` for what is not measured.
    pub unit: &'static str,
    /// What it is, in a few words.
    pub meaning: &'static str,
    /// The rulings that decide it; may be empty.
    pub source: &'static str,
    /// Those of the rows that have one.
    pub values: Values,
    /// Which rows have a value; `None` if all must.
    pub present: Option<Vec<bool>>,
}

/// The values of the rows that have one.
#[derive(Debug, PartialEq)]
#[expect(missing_docs, reason = "integers are named after their types")]
pub enum Values {
    U8(Vec<u8>),
    U16(Vec<u16>),
    I16(Vec<i16>),
    /// Other integers of up to 32 bits; a `u32` as the `i32` of the same bits.
    Small(Vec<i32>),
    /// `u64` and times.
    Large(Vec<u64>),
    /// Measured speeds.
    Float(Vec<f32>),
    /// Places in the list of names.
    Name(Vec<u8>),
    /// The end of each run of bytes, and all runs in one.
    Bytes(Vec<u32>, Vec<u8>),
}

/// Does the same with the vector of whatever values there are: for runs of bytes, that of their
/// ends.
macro_rules! each {
    ($of:expr, $values:ident => $done:expr) => {
        match $of {
            Values::U8($values) | Values::Name($values) => $done,
            Values::U16($values) => $done,
            Values::I16($values) => $done,
            Values::Small($values) => $done,
            Values::Large($values) => $done,
            Values::Float($values) => $done,
            Values::Bytes($values, _) => $done,
        }
    };
}

/// A type whose values a column holds as they are.
pub(super) trait Held: Sized {
    fn of(values: &mut Values) -> Option<&mut Vec<Self>>;
}

macro_rules! held {
    ($($of:ty: $($variant:ident)|+;)+) => {$(
        impl Held for $of {
            fn of(values: &mut Values) -> Option<&mut Vec<Self>> {
                match values {
                    $(Values::$variant(values))|+ => Some(values),
                    _ => None,
                }
            }
        }
    )+};
}
held! { u8: U8 | Name; u16: U16; i16: I16; i32: Small; f32: Float; }

/// One value.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Cell<'a> {
    Integer(i64),
    Unsigned(u64),
    Float(f32),
    /// Microseconds since 1970.
    Time(u64),
    Name(&'a str),
    /// Hex digits in JSON.
    Bytes(&'a [u8]),
}

impl Column {
    pub(super) fn new(name: String, field: &Field, names: Vec<&'static str>) -> Self {
        let values = match field.kind {
            Kind::U8 => Values::U8(Vec::new()),
            Kind::U16 => Values::U16(Vec::new()),
            Kind::I16 => Values::I16(Vec::new()),
            Kind::I8 | Kind::U32 | Kind::I32 => Values::Small(Vec::new()),
            Kind::U64 | Kind::Time => Values::Large(Vec::new()),
            Kind::F32 => Values::Float(Vec::new()),
            Kind::Name(_) => Values::Name(Vec::new()),
            Kind::Bytes => Values::Bytes(Vec::new(), Vec::new()),
        };
        let present = field.is_optional.then(Vec::new);
        let &Field { kind, unit, meaning, source, .. } = field;
        Self { name, kind, names, unit, meaning, source, values, present }
    }

    /// The column with its rows, which are no longer here.
    pub(crate) fn take(&mut self) -> Self {
        let Self { name, kind, names, unit, meaning, source, values, present } = self;
        Self {
            name: name.clone(),
            kind: *kind,
            names: names.clone(),
            unit,
            meaning,
            source,
            values: values.take(),
            present: present.as_mut().map(std::mem::take),
        }
    }

    /// The rows as numbers for a plot; NaN for what is absent, or is no number. Times are in
    /// microseconds.
    #[must_use]
    pub fn numbers(&self) -> Vec<f64> {
        let number = |cell| match cell {
            Some(Cell::Integer(value)) => value as f64,
            Some(Cell::Unsigned(value) | Cell::Time(value)) => value as f64,
            Some(Cell::Float(value)) => value.into(),
            Some(Cell::Name(_) | Cell::Bytes(_)) | None => f64::NAN,
        };
        self.cells().map(number).collect()
    }

    /// The values of the rows in their order.
    pub(crate) fn cells(&self) -> impl Iterator<Item = Option<Cell<'_>>> {
        let (mut row, mut next) = (0, 0);
        let rows = self.present.as_ref().map_or_else(|| self.values.len(), Vec::len);
        core::iter::from_fn(move || {
            if row == rows {
                return None;
            }
            let is_there = self.present.as_ref().is_none_or(|it| it.get(row) == Some(&true));
            row += 1;
            next += usize::from(is_there);
            Some(is_there.then(|| self.cell(next - 1)).flatten())
        })
    }

    /// One of the values.
    fn cell(&self, at: usize) -> Option<Cell<'_>> {
        Some(match (&self.values, &self.kind) {
            (Values::U8(values), _) => Cell::Integer((*values.get(at)?).into()),
            (Values::U16(values), _) => Cell::Integer((*values.get(at)?).into()),
            (Values::I16(values), _) => Cell::Integer((*values.get(at)?).into()),
            (Values::Small(values), Kind::U32) => Cell::Integer((*values.get(at)? as u32).into()),
            (Values::Small(values), _) => Cell::Integer((*values.get(at)?).into()),
            (Values::Large(values), Kind::Time) => Cell::Time(*values.get(at)?),
            (Values::Large(values), _) => Cell::Unsigned(*values.get(at)?),
            (Values::Float(values), _) => Cell::Float(*values.get(at)?),
            (Values::Name(values), _) => Cell::Name(self.names.get(usize::from(*values.get(at)?))?),
            (Values::Bytes(ends, bytes), _) => {
                let begin = at.checked_sub(1).and_then(|before| ends.get(before)).unwrap_or(&0);
                Cell::Bytes(bytes.get(*begin as usize..*ends.get(at)? as usize)?)
            }
        })
    }

    pub(super) fn clear(&mut self) {
        self.present.as_mut().map(Vec::clear).unwrap_or_default();
        each!(&mut self.values, values => values.clear());
        if let Values::Bytes(_, bytes) = &mut self.values {
            bytes.clear();
        }
    }

    /// Takes back what a row that did not fit has left: there are to be this many rows.
    pub(super) fn take_back(&mut self, rows: usize) {
        let has_value = match &mut self.present {
            Some(present) if present.len() > rows => present.pop() == Some(true),
            Some(_) => false,
            None => self.values.len() > rows,
        };
        if has_value {
            each!(&mut self.values, values => drop(values.pop()));
        }
        if let Values::Bytes(ends, bytes) = &mut self.values {
            // Half of one, too.
            bytes.truncate(ends.last().copied().unwrap_or_default() as usize);
        }
    }

    #[inline]
    fn is_present(&mut self) {
        if let Some(present) = &mut self.present {
            present.push(true);
        }
    }

    /// A row without a value.
    pub(super) fn absent(&mut self) -> Result<(), Unfit> {
        self.present.as_mut().ok_or(Unfit)?.push(false);
        Ok(())
    }

    #[inline]
    pub(super) fn integer(&mut self, value: i64) -> Result<(), Unfit> {
        match &mut self.values {
            // All of these take values of their types only: the table of fields says so.
            Values::U8(values) => values.push(value as u8),
            Values::U16(values) => values.push(value as u16),
            Values::I16(values) => values.push(value as i16),
            Values::Small(values) => values.push(value as i32),
            Values::Large(values) => values.push(value as u64),
            _ => return Err(Unfit),
        }
        self.is_present();
        Ok(())
    }

    #[inline]
    pub(super) fn unsigned(&mut self, value: u64) -> Result<(), Unfit> {
        match &mut self.values {
            Values::U8(values) => values.push(u8::try_from(value).map_err(|_| Unfit)?),
            Values::Small(values) => values.push(u32::try_from(value).map_err(|_| Unfit)? as i32),
            Values::Large(values) => values.push(value),
            _ => return Err(Unfit),
        }
        self.is_present();
        Ok(())
    }

    /// A value for each of some rows.
    pub(super) fn extend<T: Held>(
        &mut self,
        all: impl ExactSizeIterator<Item = T>,
    ) -> Result<(), Unfit> {
        if let Some(present) = &mut self.present {
            present.resize(present.len() + all.len(), true);
        }
        T::of(&mut self.values).ok_or(Unfit)?.extend(all);
        Ok(())
    }

    /// The same name for this many rows.
    pub(super) fn names(&mut self, name: &str, rows: usize) -> Result<(), Unfit> {
        let place = self.names.iter().position(|it| *it == name).ok_or(Unfit)?;
        self.extend(core::iter::repeat_n(place as u8, rows))
    }

    #[inline]
    pub(super) fn float(&mut self, value: f32) -> Result<(), Unfit> {
        let Values::Float(values) = &mut self.values else { return Err(Unfit) };
        values.push(value);
        self.is_present();
        Ok(())
    }

    #[inline]
    pub(super) fn bytes(&mut self, value: &[u8]) -> Result<(), Unfit> {
        let Values::Bytes(ends, bytes) = &mut self.values else { return Err(Unfit) };
        bytes.extend_from_slice(value);
        ends.push(u32::try_from(bytes.len()).map_err(|_| Unfit)?);
        self.is_present();
        Ok(())
    }

    /// A name, hex digits, or a speed that JSON has no number for.
    #[inline]
    pub(super) fn text(&mut self, value: &str) -> Result<(), Unfit> {
        match &mut self.values {
            Values::Bytes(ends, bytes) => {
                for pair in value.as_bytes().chunks(2) {
                    let [high, low] = pair else { return Err(Unfit) };
                    bytes.push(digit(*high)? << 4 | digit(*low)?);
                }
                ends.push(u32::try_from(bytes.len()).map_err(|_| Unfit)?);
            }
            Values::Name(values) => {
                let place = self.names.iter().position(|name| *name == value).ok_or(Unfit)?;
                values.push(place as u8);
            }
            Values::Float(values) => values.push(match value {
                "nan" => f32::NAN,
                "inf" => f32::INFINITY,
                "-inf" => f32::NEG_INFINITY,
                _ => return Err(Unfit),
            }),
            _ => return Err(Unfit),
        }
        self.is_present();
        Ok(())
    }
}

impl Values {
    /// Moves them out. There is room for as many again: the next batch is often as long.
    fn take(&mut self) -> Self {
        let empty = match self {
            Self::U8(values) => Self::U8(Vec::with_capacity(values.len())),
            Self::U16(values) => Self::U16(Vec::with_capacity(values.len())),
            Self::I16(values) => Self::I16(Vec::with_capacity(values.len())),
            Self::Small(values) => Self::Small(Vec::with_capacity(values.len())),
            Self::Large(values) => Self::Large(Vec::with_capacity(values.len())),
            Self::Float(values) => Self::Float(Vec::with_capacity(values.len())),
            Self::Name(values) => Self::Name(Vec::with_capacity(values.len())),
            Self::Bytes(ends, bytes) => {
                Self::Bytes(Vec::with_capacity(ends.len()), Vec::with_capacity(bytes.len()))
            }
        };
        std::mem::replace(self, empty)
    }

    pub(crate) fn len(&self) -> usize {
        each!(self, values => values.len())
    }
}

/// The value of a lower-case hex digit.
#[inline]
const fn digit(digit: u8) -> Result<u8, Unfit> {
    match digit {
        b'0'..=b'9' => Ok(digit - b'0'),
        b'a'..=b'f' => Ok(digit - b'a' + 10),
        _ => Err(Unfit),
    }
}
