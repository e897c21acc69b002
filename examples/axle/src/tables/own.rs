//! Tables of messages that the schema does not have: somebody has added one to the library. Its
//! columns are those of its first line.

use std::borrow::Cow;

use serde_json::Value;

use super::{
    IN_THE_NAME, PLACE, Table, Type,
    column::Column,
    described::{Described, Field, Kind, Pairs, unit},
    row::Unfit,
};
use crate::args::Protocol;

/// Nobody has said what 1 is.
const NO_UNIT: &str = "unknown";

/// A line of `decode --json`: names and values, in their order.
pub(super) struct Line(Vec<(String, Value)>);

impl Line {
    pub(super) fn read(line: &[u8]) -> Option<Self> {
        let Pairs(pairs) = serde_json::from_slice(line).ok()?;
        Some(Self(pairs))
    }

    /// Whether a value is a text in JSON, too.
    #[cfg(feature = "mcap")]
    pub(super) fn has_text(&self, name: &str) -> bool {
        self.get(name).is_some_and(Value::is_string)
    }

    fn get(&self, name: &str) -> Option<&Value> {
        self.0.iter().find(|(known, _)| *known == name).map(|(_, value)| value)
    }
}

/// What the columns of this line are. What all lines of the protocol have is as the schema says.
pub(super) fn describe(
    all: &[Described],
    protocol: Option<Protocol>,
    message: &'static str,
    line: &Line,
) -> Option<Described> {
    let of_protocol = || all.iter().filter(|it| it.protocol == protocol);
    let is_of_all = |field: &&Field| unit(&field.name, protocol, "").is_some();
    let known = |name: &str| {
        let mut fields = of_protocol().flat_map(|it| &it.fields).filter(is_of_all);
        fields.find(|field| field.name == name)
    };
    let is_in_front = |name: &str| name == "event" || PLACE.contains(&name);
    let mut fields: Vec<_> =
        of_protocol().next()?.fields.iter().filter(|it| is_in_front(&it.name)).cloned().collect();
    for (name, value) in line.0.iter().filter(|(name, _)| !is_in_front(name)) {
        fields.push(match known(name) {
            Some(field) => field.clone(),
            None => Field {
                name: Cow::Owned(name.clone()),
                kind: kind(value),
                is_optional: true,
                unit: NO_UNIT,
            },
        });
    }
    Some(Described { protocol, message, fields })
}

fn kind(value: &Value) -> Kind {
    match value {
        Value::Array(items) => match common(items.iter()) {
            Some(of) => Kind::Array(of, items.len()),
            None => Kind::One(Type::Text),
        },
        Value::Object(items) => match common(items.values()) {
            Some(of) => Kind::Object(of, items.keys().cloned().map(Cow::Owned).collect()),
            None => Kind::One(Type::Text),
        },
        one => Kind::One(single(one).unwrap_or(Type::Text)),
    }
}

/// The type of all these values, if they have one.
fn common<'a>(mut values: impl Iterator<Item = &'a Value>) -> Option<Type> {
    let first = single(values.next()?)?;
    values.try_fold(first, |known, value| match (known, single(value)?) {
        (known, other) if known == other => Some(known),
        (Type::I64 | Type::F64, Type::I64 | Type::F64) => Some(Type::F64),
        _ => None,
    })
}

fn single(value: &Value) -> Option<Type> {
    Some(match value {
        Value::Bool(_) => Type::Bool,
        Value::Number(number) if number.is_i64() => Type::I64,
        Value::Number(number) if number.is_u64() => Type::U64,
        Value::Number(_) => Type::F64,
        Value::String(text) if ["nan", "inf", "-inf"].contains(&&**text) => Type::F64,
        Value::String(_) => Type::Text,
        Value::Null | Value::Array(_) | Value::Object(_) => return None,
    })
}

impl Table {
    /// Adds the fields of a line behind its place, which are the columns from `from` on.
    pub(super) fn line(&mut self, from: usize, line: &Line) -> Result<(), Unfit> {
        let is_column = |name: &str| !IN_THE_NAME.contains(&name) && !PLACE.contains(&name);
        let is_known = |name: &str| self.own.iter().any(|(field, _)| field.name == name);
        if line.0.iter().any(|(name, _)| is_column(name) && !is_known(name)) {
            return Err(Unfit);
        }
        for (field, first) in &self.own {
            let columns = self.columns.get_mut(from + first..).ok_or(Unfit)?;
            let value = line.get(&field.name).unwrap_or(&Value::Null);
            put(columns, &field.kind, value)?;
        }
        Ok(())
    }
}

fn put(columns: &mut [Column], kind: &Kind, value: &Value) -> Result<(), Unfit> {
    let null = &Value::Null;
    let (len, values): (_, Vec<_>) = match (kind, value) {
        (Kind::One(_), value) => (1, vec![value]),
        (Kind::Array(_, len), Value::Null) => (*len, vec![null; *len]),
        (Kind::Array(_, len), Value::Array(items)) if items.len() <= *len => {
            (*len, items.iter().chain(core::iter::repeat(null)).take(*len).collect())
        }
        (Kind::Object(_, names), Value::Null) => (names.len(), vec![null; names.len()]),
        (Kind::Object(_, names), Value::Object(items)) => {
            if items.keys().any(|name| !names.contains(&Cow::Borrowed(&**name))) {
                return Err(Unfit);
            }
            (names.len(), names.iter().map(|name| items.get(&**name).unwrap_or(null)).collect())
        }
        _ => return Err(Unfit),
    };
    let columns = columns.get_mut(..len).ok_or(Unfit)?;
    columns.iter_mut().zip(values).try_for_each(|(column, value)| column.json(value))
}
