//! What the columns of each table are: those of the table of fields of the library.

use axlewire::fields::{FIELDS, Field, Kind};

use crate::args::Protocol;

/// The protocols whose messages have tables.
const PROTOCOLS: [Protocol; 3] = [Protocol::Ucp, Protocol::Ikeya, Protocol::Ikeya3];

/// A message with the fields of all its layouts, or the gaps.
#[derive(Clone, Debug)]
pub(super) struct Described {
    /// `None` for gaps.
    pub(super) protocol: Option<Protocol>,
    /// Name of the message; `skipped` for gaps.
    pub(super) message: &'static str,
    /// In the order of a line; and the names that each can have.
    pub(super) fields: Vec<(Field, Vec<&'static str>)>,
}

/// All messages of all protocols, and the gaps.
pub(super) fn all() -> Vec<Described> {
    let mut all: Vec<Described> = Vec::new();
    for record in FIELDS.iter().filter(|record| matches!(record.event, "frame" | "skipped")) {
        let message = record.message;
        let protocol = PROTOCOLS.into_iter().find(|it| record.protocol == Some(it.name()));
        let known = all.iter_mut().find(|it| (it.protocol, it.message) == (protocol, message));
        let Some(known) = known else {
            let fields = record.fields().map(|field| (field, names(&field).to_vec())).collect();
            all.push(Described { protocol, message, fields });
            continue;
        };
        // The first layout has all fields of the others, which a test proves.
        for (field, known_names) in &mut known.fields {
            let Some(other) = record.fields().find(|other| other.name == field.name) else {
                field.is_optional = true;
                continue;
            };
            for name in names(&other) {
                if !known_names.contains(name) {
                    known_names.push(name);
                }
            }
            if other.kind == Kind::U32 {
                field.kind = Kind::U32;
            }
        }
    }
    all
}

fn names(field: &Field) -> &'static [&'static str] {
    match field.kind {
        Kind::Name(names) => names,
        _ => &[],
    }
}

/// A JSON Schema of the lines of one message, without references and with units: what viewers of
/// MCAP read.
#[cfg(feature = "mcap")]
pub(crate) fn json_schema(protocol: Option<Protocol>, message: &str) -> String {
    use axlewire::fields::Shape;
    use serde_json::{Map, Value, json};

    let mut all = all().into_iter();
    let its = all.find(|it| (it.protocol, it.message) == (protocol, message));
    let mut properties = Map::new();
    for (field, _) in its.map(|its| its.fields).unwrap_or_default() {
        let value = match field.kind {
            Kind::F32 => json!({"oneOf": [{"type": "number"}, {"enum": ["nan", "inf", "-inf"]}]}),
            Kind::Time => json!({"type": "number"}),
            Kind::Name(_) | Kind::Bytes => json!({"type": "string"}),
            _ => json!({"type": "integer"}),
        };
        let mut property = match field.shape {
            Shape::One => value,
            Shape::Array(len) => {
                json!({"type": "array", "items": value, "minItems": len, "maxItems": len})
            }
            Shape::Object(names) => {
                let all: Map<String, Value> =
                    names.iter().map(|name| ((*name).to_owned(), value.clone())).collect();
                json!({"type": "object", "properties": all})
            }
        };
        if let (Some(object), true) = (property.as_object_mut(), field.unit != "none") {
            object.insert("unit".to_owned(), field.unit.into());
            object.insert("description".to_owned(), format!("unit: {}", field.unit).into());
        }
        properties.insert(field.name.to_owned(), property);
    }
    let title = name(protocol, message);
    json!({"title": title, "type": "object", "properties": properties}).to_string()
}

/// The name of a table: protocol and message, or `skipped`.
pub(crate) fn name(protocol: Option<Protocol>, message: &str) -> String {
    match protocol {
        Some(protocol) => format!("{}.{message}", protocol.name()),
        None => message.to_owned(),
    }
}

#[cfg(test)]
mod tests;
