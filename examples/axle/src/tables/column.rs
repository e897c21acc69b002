//! Values of one column.

use serde_json::Value;

use super::{Type, row::Unfit};

/// A column: its values, where there are any.
#[derive(Debug)]
pub(crate) struct Column {
    pub(crate) name: String,
    pub(crate) kind: Type,
    /// What 1 is; `none` for what is not measured.
    pub(crate) unit: &'static str,
    pub(crate) values: Values,
    /// Which rows have a value; `None` if all must.
    pub(crate) present: Option<Vec<bool>>,
}

/// The values of the rows that have one.
#[derive(Debug)]
pub(crate) enum Values {
    /// Integers of up to 32 bits; a `u32` as the `i32` of the same bits.
    Small(Vec<i32>),
    /// `u64` and times.
    Large(Vec<u64>),
    Float(Vec<f32>),
    /// Places in the list of names.
    Name(Vec<u8>),
    /// The end of each run of bytes, and all runs in one; texts too.
    Bytes(Vec<u32>, Vec<u8>),
    Double(Vec<f64>),
    Flag(Vec<bool>),
}

/// One value.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Cell<'a> {
    Integer(i64),
    Unsigned(u64),
    Float(f32),
    Double(f64),
    Flag(bool),
    Text(&'a str),
    /// Microseconds since 1970.
    Time(u64),
    Name(&'a str),
    /// Hex digits in JSON.
    Bytes(&'a [u8]),
}

impl Column {
    pub(super) fn new(name: String, kind: Type, unit: &'static str, is_optional: bool) -> Self {
        let values = match kind {
            Type::U8 | Type::I16 | Type::U16 | Type::U32 => Values::Small(Vec::new()),
            Type::I64 | Type::U64 | Type::Time => Values::Large(Vec::new()),
            Type::F32 => Values::Float(Vec::new()),
            Type::F64 => Values::Double(Vec::new()),
            Type::Bool => Values::Flag(Vec::new()),
            Type::Name(_) => Values::Name(Vec::new()),
            Type::Bytes | Type::Text => Values::Bytes(Vec::new(), Vec::new()),
        };
        let present = is_optional.then(Vec::new);
        Self { name, kind, unit, values, present }
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
            (Values::Small(values), Type::U32) => Cell::Integer((*values.get(at)? as u32).into()),
            (Values::Small(values), _) => Cell::Integer((*values.get(at)?).into()),
            (Values::Large(values), Type::Time) => Cell::Time(*values.get(at)?),
            (Values::Large(values), Type::I64) => Cell::Integer(*values.get(at)? as i64),
            (Values::Large(values), _) => Cell::Unsigned(*values.get(at)?),
            (Values::Float(values), _) => Cell::Float(*values.get(at)?),
            (Values::Double(values), _) => Cell::Double(*values.get(at)?),
            (Values::Flag(values), _) => Cell::Flag(*values.get(at)?),
            (Values::Name(values), Type::Name(names)) => {
                Cell::Name(names.get(usize::from(*values.get(at)?))?)
            }
            (Values::Name(_), _) => return None,
            (Values::Bytes(ends, bytes), kind) => {
                let begin = at.checked_sub(1).and_then(|before| ends.get(before)).unwrap_or(&0);
                let bytes = bytes.get(*begin as usize..*ends.get(at)? as usize)?;
                match kind {
                    Type::Text => Cell::Text(str::from_utf8(bytes).ok()?),
                    _ => Cell::Bytes(bytes),
                }
            }
        })
    }

    pub(super) fn clear(&mut self) {
        self.present.as_mut().map(Vec::clear).unwrap_or_default();
        match &mut self.values {
            Values::Small(values) => values.clear(),
            Values::Large(values) => values.clear(),
            Values::Float(values) => values.clear(),
            Values::Name(values) => values.clear(),
            Values::Bytes(ends, bytes) => {
                ends.clear();
                bytes.clear();
            }
            Values::Double(values) => values.clear(),
            Values::Flag(values) => values.clear(),
        }
    }

    /// Takes back what a row that did not fit has left: there are to be this many rows.
    pub(super) fn take_back(&mut self, rows: usize) {
        let has_value = match &mut self.present {
            Some(present) if present.len() > rows => present.pop() == Some(true),
            Some(_) => false,
            None => self.values.len() > rows,
        };
        match &mut self.values {
            Values::Small(values) if has_value => drop(values.pop()),
            Values::Large(values) if has_value => drop(values.pop()),
            Values::Float(values) if has_value => drop(values.pop()),
            Values::Name(values) if has_value => drop(values.pop()),
            Values::Double(values) if has_value => drop(values.pop()),
            Values::Flag(values) if has_value => drop(values.pop()),
            Values::Bytes(ends, bytes) => {
                if has_value {
                    ends.pop();
                }
                // Half of one, too.
                bytes.truncate(ends.last().copied().unwrap_or_default() as usize);
            }
            _ => {}
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
            // All types of this width take their values only: the schema says so, and a test does.
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
            Values::Small(values) => values.push(u32::try_from(value).map_err(|_| Unfit)? as i32),
            Values::Large(values) => values.push(value),
            _ => return Err(Unfit),
        }
        self.is_present();
        Ok(())
    }

    #[inline]
    pub(super) fn float(&mut self, value: f32) -> Result<(), Unfit> {
        let Values::Float(values) = &mut self.values else { return Err(Unfit) };
        values.push(value);
        self.is_present();
        Ok(())
    }

    /// A value of a line of JSON, for a table that is of the lines themselves.
    pub(super) fn json(&mut self, value: &Value) -> Result<(), Unfit> {
        match (&mut self.values, &self.kind, value) {
            (_, _, Value::Null) => return self.absent(),
            (Values::Bytes(ends, bytes), Type::Text, _) => {
                match value {
                    Value::String(text) => bytes.extend_from_slice(text.as_bytes()),
                    other => bytes.extend_from_slice(other.to_string().as_bytes()),
                }
                ends.push(u32::try_from(bytes.len()).map_err(|_| Unfit)?);
            }
            (_, _, Value::String(text)) => return self.text(text),
            (Values::Flag(values), _, Value::Bool(value)) => values.push(*value),
            (Values::Double(values), _, Value::Number(value)) => {
                values.push(value.as_f64().ok_or(Unfit)?);
            }
            (Values::Large(values), Type::I64, Value::Number(value)) => {
                values.push(value.as_i64().ok_or(Unfit)? as u64);
            }
            (Values::Large(_) | Values::Small(_), _, Value::Number(value)) => {
                return self.unsigned(value.as_u64().ok_or(Unfit)?);
            }
            _ => return Err(Unfit),
        }
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
        match (&mut self.values, &self.kind) {
            (Values::Bytes(ends, bytes), Type::Bytes) => {
                for pair in value.as_bytes().chunks(2) {
                    let [high, low] = pair else { return Err(Unfit) };
                    bytes.push(digit(*high)? << 4 | digit(*low)?);
                }
                ends.push(u32::try_from(bytes.len()).map_err(|_| Unfit)?);
            }
            (Values::Name(values), Type::Name(names)) => {
                let place = names.iter().position(|name| *name == value).ok_or(Unfit)?;
                values.push(place as u8);
            }
            (Values::Float(values), _) => values.push(match value {
                "nan" => f32::NAN,
                "inf" => f32::INFINITY,
                "-inf" => f32::NEG_INFINITY,
                _ => return Err(Unfit),
            }),
            (Values::Double(values), _) => values.push(match value {
                "nan" => f64::NAN,
                "inf" => f64::INFINITY,
                "-inf" => f64::NEG_INFINITY,
                _ => return Err(Unfit),
            }),
            _ => return Err(Unfit),
        }
        self.is_present();
        Ok(())
    }
}

impl Values {
    pub(crate) fn len(&self) -> usize {
        match self {
            Self::Small(values) => values.len(),
            Self::Large(values) => values.len(),
            Self::Float(values) => values.len(),
            Self::Name(values) => values.len(),
            Self::Bytes(ends, _) => ends.len(),
            Self::Double(values) => values.len(),
            Self::Flag(values) => values.len(),
        }
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
