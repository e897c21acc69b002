//! What the columns of each table are: read from the JSON Schema of `axle decode --json` and from
//! the page of its fields, so that there is no second list of them.

use std::{borrow::Cow, fmt, marker::PhantomData};

use serde::{
    Deserialize, Deserializer,
    de::{MapAccess, Visitor},
};

use crate::args::Protocol;

/// The JSON Schema of the lines of `axle decode --json`.
pub(crate) const SCHEMA: &str = include_str!("../../decode.schema.json");

/// The page with the unit of each field.
const PAGE: &str = include_str!("../../../../src/fields.md");

/// The protocols whose messages have tables.
const PROTOCOLS: [Protocol; 3] = [Protocol::Ucp, Protocol::Ikeya, Protocol::Ikeya3];

/// Type of the values in a column.
#[derive(Clone, Debug, Eq, PartialEq)]
pub(crate) enum Type {
    U8,
    I16,
    U16,
    U32,
    U64,
    /// Integers of a message that the schema has not; so are the next three.
    I64,
    F64,
    Bool,
    Text,
    /// NaN and infinities, which are strings in JSON, are values here.
    F32,
    /// Microseconds since 1970; seconds in JSON.
    Time,
    /// One of these.
    Name(Vec<&'static str>),
    /// Hex digits in JSON.
    Bytes,
}

/// A field of a message, as in a line of `decode --json`.
#[derive(Clone, Debug)]
pub(super) struct Field {
    pub(super) name: Cow<'static, str>,
    pub(super) kind: Kind,
    /// Whether a line may be without it.
    pub(super) is_optional: bool,
    pub(super) unit: &'static str,
}

/// One value, an array of them, or an object of them by name.
#[derive(Clone, Debug)]
pub(super) enum Kind {
    One(Type),
    Array(Type, usize),
    Object(Type, Vec<Cow<'static, str>>),
}

/// A message, or the gaps.
#[derive(Clone, Debug)]
pub(super) struct Described {
    /// `None` for gaps.
    pub(super) protocol: Option<Protocol>,
    /// Name of the message; `skipped` for gaps.
    pub(super) message: &'static str,
    /// In the order of a line.
    pub(super) fields: Vec<Field>,
}

impl Type {
    /// Its name in the list of columns.
    pub(crate) const fn name(&self) -> &'static str {
        match self {
            Self::U8 => "u8",
            Self::I16 => "i16",
            Self::U16 => "u16",
            Self::U32 => "u32",
            Self::U64 => "u64",
            Self::I64 => "i64",
            Self::F64 => "f64",
            Self::Bool => "bool",
            Self::Text => "text",
            Self::F32 => "f32",
            Self::Time => "time",
            Self::Name(_) => "name",
            Self::Bytes => "bytes",
        }
    }
}

/// A JSON Schema of the lines of one message, without references and with units: what viewers of
/// MCAP read. `line` is the first of them: what the schema of `decode --json` has not, it has.
#[cfg(feature = "mcap")]
pub(crate) fn json_schema(
    protocol: Option<Protocol>,
    message: &'static str,
    line: &[u8],
) -> Option<String> {
    use serde_json::{Map, Value, json};

    let whole: Value = serde_json::from_str(SCHEMA).ok()?;
    // A number, or one of the names of what is none.
    let speed = whole.get("$defs")?.get("rps")?;
    let value = |of: &Type| match of {
        Type::F32 | Type::F64 => speed.clone(),
        Type::Time => json!({"type": "number"}),
        Type::Name(_) | Type::Bytes | Type::Text => json!({"type": "string"}),
        Type::Bool => json!({"type": "boolean"}),
        _ => json!({"type": "integer"}),
    };
    let all = all()?;
    let known = all.iter().find(|it| (it.protocol, it.message) == (protocol, message));
    let line = super::own::Line::read(line)?;
    let of_line = super::own::describe(&all, protocol, message, &line)?;
    let mut fields = known.map_or_else(Vec::new, |known| known.fields.clone());
    for field in of_line.fields {
        if fields.iter().all(|known| known.name != field.name) {
            fields.push(field);
        }
    }
    let mut properties = Map::new();
    for field in &fields {
        let mut property = match &field.kind {
            // In a table it is the text of something else, and that has no type.
            Kind::One(Type::Text) if !line.has_text(&field.name) => json!({}),
            Kind::One(of) => value(of),
            Kind::Array(of, len) => {
                json!({"type": "array", "items": value(of), "minItems": len, "maxItems": len})
            }
            Kind::Object(of, names) => {
                let all: Map<String, Value> =
                    names.iter().map(|name| (name.to_string(), value(of))).collect();
                json!({"type": "object", "properties": all})
            }
        };
        if let (Some(object), true) = (property.as_object_mut(), field.unit != "none") {
            object.insert("unit".to_owned(), field.unit.into());
            object.insert("description".to_owned(), format!("unit: {}", field.unit).into());
        }
        properties.insert(field.name.to_string(), property);
    }
    let title = super::name(protocol, message);
    let schema = json!({"title": title, "type": "object", "properties": properties});
    serde_json::to_string(&schema).ok()
}

/// All messages of all protocols, and the gaps. `None` if the schema is not what it should be,
/// which the tests exclude.
pub(super) fn all() -> Option<Vec<Described>> {
    let schema: Schema<'static> = serde_json::from_str(SCHEMA).ok()?;
    let mut all: Vec<Described> = Vec::new();
    for kind in &schema.one_of {
        let shape = schema.definition(kind.reference?)?;
        let properties = &shape.properties.as_ref()?.0;
        let property = |name: &str| properties.iter().find(|(known, _)| *known == name);
        let name = |name: &str| property(name).and_then(|(_, shape)| shape.constant_name());
        match name("event")? {
            "frame" => {
                let (_, protocols) = property("protocol")?;
                for protocol in PROTOCOLS {
                    if protocols.allows(protocol.name()) {
                        schema.merge(&mut all, Some(protocol), name("message")?, shape)?;
                    }
                }
            }
            "skipped" => schema.merge(&mut all, None, "skipped", shape)?,
            _ => {}
        }
    }
    Some(all)
}

/// The part of JSON Schema that the file uses for fields.
#[derive(Debug, Deserialize)]
struct Schema<'a> {
    #[serde(borrow, rename = "oneOf")]
    one_of: Vec<Shape<'a>>,
    #[serde(borrow, rename = "$defs")]
    definitions: Pairs<&'a str, Shape<'a>>,
}

/// A type, a field or a line.
#[derive(Debug, Default, Deserialize)]
#[serde(default)]
struct Shape<'a> {
    #[serde(borrow, rename = "$ref")]
    reference: Option<&'a str>,
    #[serde(borrow, rename = "const")]
    constant: Option<Constant<'a>>,
    #[serde(borrow, rename = "enum")]
    names: Option<Vec<&'a str>>,
    minimum: Option<i64>,
    maximum: Option<i64>,
    #[serde(borrow)]
    items: Option<Box<Shape<'a>>>,
    #[serde(rename = "minItems")]
    len: Option<usize>,
    #[serde(borrow)]
    properties: Option<Pairs<&'a str, Shape<'a>>>,
    #[serde(borrow)]
    required: Vec<&'a str>,
}

#[derive(Debug, Deserialize)]
#[serde(untagged)]
enum Constant<'a> {
    Number(i64),
    #[serde(borrow)]
    Name(&'a str),
}

/// An object in the order of the text.
#[derive(Debug)]
pub(super) struct Pairs<K, V>(pub(super) Vec<(K, V)>);

impl<'de, K: Deserialize<'de>, V: Deserialize<'de>> Deserialize<'de> for Pairs<K, V> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct InOrder<K, V>(PhantomData<(K, V)>);

        impl<'de, K: Deserialize<'de>, V: Deserialize<'de>> Visitor<'de> for InOrder<K, V> {
            type Value = Pairs<K, V>;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("an object")
            }

            fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Self::Value, A::Error> {
                let mut pairs = Vec::new();
                while let Some(pair) = map.next_entry()? {
                    pairs.push(pair);
                }
                Ok(Pairs(pairs))
            }
        }

        deserializer.deserialize_map(InOrder(PhantomData))
    }
}

impl Shape<'static> {
    fn constant_name(&self) -> Option<&'static str> {
        match self.constant {
            Some(Constant::Name(name)) => Some(name),
            _ => None,
        }
    }

    /// Whether this name is one that the field may have.
    fn allows(&self, name: &str) -> bool {
        let names = self.names.as_deref().unwrap_or_default();
        self.constant_name() == Some(name) || names.contains(&name)
    }
}

impl Schema<'static> {
    /// The definition that a reference means.
    fn definition(&self, reference: &str) -> Option<&Shape<'static>> {
        let name = reference.strip_prefix("#/$defs/")?;
        self.definitions.0.iter().find(|(known, _)| *known == name).map(|(_, shape)| shape)
    }

    /// Adds a kind of line to the table of its message: a message of two layouts has one table.
    fn merge(
        &self,
        all: &mut Vec<Described>,
        protocol: Option<Protocol>,
        message: &'static str,
        shape: &Shape<'static>,
    ) -> Option<()> {
        let mut fields = Vec::new();
        for (name, property) in &shape.properties.as_ref()?.0 {
            let kind = self.kind(property)?;
            let is_optional = !shape.required.contains(name);
            let unit = unit(name, protocol, message)?;
            fields.push(Field { name: Cow::Borrowed(*name), kind, is_optional, unit });
        }
        let known = all.iter_mut().find(|it| it.protocol == protocol && it.message == message);
        let Some(known) = known else {
            all.push(Described { protocol, message, fields });
            return Some(());
        };
        for field in &mut known.fields {
            match fields.iter().find(|other| other.name == field.name) {
                Some(other) => field.widen(other)?,
                None => field.is_optional = true,
            }
        }
        // The first layout has all fields of the others, in their order.
        let has = |field: &Field| known.fields.iter().any(|known| known.name == field.name);
        fields.iter().all(has).then_some(())
    }

    fn kind(&self, shape: &Shape<'static>) -> Option<Kind> {
        let shape = match shape.reference {
            Some("#/$defs/time") => return Some(Kind::One(Type::Time)),
            Some("#/$defs/rps") => return Some(Kind::One(Type::F32)),
            Some("#/$defs/hex") => return Some(Kind::One(Type::Bytes)),
            Some(reference) => self.definition(reference)?,
            None => shape,
        };
        let one = |shape: &Shape<'static>| match self.kind(shape)? {
            Kind::One(of) => Some(of),
            _ => None,
        };
        if let Some(items) = &shape.items {
            return Some(Kind::Array(one(items)?, shape.len?));
        }
        if let Some(Pairs(properties)) = &shape.properties {
            let (_, first) = properties.first()?;
            let names = properties.iter().map(|(name, _)| Cow::Borrowed(*name)).collect();
            return Some(Kind::Object(one(first)?, names));
        }
        let of = match &shape.constant {
            Some(Constant::Name(name)) => Type::Name(vec![name]),
            Some(Constant::Number(number)) => integer(*number, Some(*number)),
            None => match &shape.names {
                Some(names) => Type::Name(names.clone()),
                None => integer(shape.minimum?, shape.maximum),
            },
        };
        Some(Kind::One(of))
    }
}

impl Field {
    /// Takes in the values that the field has in another layout.
    fn widen(&mut self, other: &Self) -> Option<()> {
        self.is_optional |= other.is_optional;
        if let (Kind::One(of), Kind::One(others)) = (&mut self.kind, &other.kind) {
            match (&mut *of, others) {
                (Type::Name(names), Type::Name(others)) => {
                    let new: Vec<_> =
                        others.iter().filter(|name| !names.contains(name)).copied().collect();
                    names.extend(new);
                }
                (Type::U8, Type::U32) => *of = Type::U32,
                (of, others) if of == others => {}
                _ => return None,
            }
        }
        Some(())
    }
}

/// The narrowest type for this range.
fn integer(minimum: i64, maximum: Option<i64>) -> Type {
    match (minimum, maximum) {
        (0.., Some(..=0xFF)) => Type::U8,
        (0.., Some(..=0xFFFF)) => Type::U16,
        (0.., Some(..=0xFFFF_FFFF)) => Type::U32,
        (0.., _) => Type::U64,
        _ => Type::I16,
    }
}

/// The unit of a field, from the page.
pub(super) fn unit(field: &str, protocol: Option<Protocol>, message: &str) -> Option<&'static str> {
    let group = match protocol {
        Some(Protocol::Ucp) => "UCP",
        Some(Protocol::Ikeya | Protocol::Ikeya3) => "Ikeya",
        None => "skipped",
    };
    PAGE.lines().find_map(|row| {
        let mut cells = row.split('|').map(str::trim).skip(1);
        let (name, place, _, unit) = (cells.next()?, cells.next()?, cells.next()?, cells.next()?);
        let mut places = place.split(", ").map(|place| place.trim_matches('`'));
        let is_here = places.any(|place| {
            place == message
                || place == group
                || place == "every line"
                || (place == "every frame" && protocol.is_some())
        });
        (name.trim_matches('`') == field && is_here).then_some(unit)
    })
}

#[cfg(test)]
mod tests;
