//! A strict checker for the part of JSON Schema that `decode.schema.json` uses.
//!
//! Not a crate: those that know all of JSON Schema take longer to build than the tool.

use serde_json::{Map, Value};

/// A schema, all of whose keywords this checker knows.
pub(crate) struct Schema(Value);

/// Checks an instance against one keyword: its value, the instance, the schema for references.
type Keyword = fn(&Value, &Value, &Schema) -> Result<(), String>;

impl Schema {
    /// Fails for an unknown keyword, wherever it is.
    pub(crate) fn new(text: &str) -> Result<Self, String> {
        let schema = Self(serde_json::from_str(text).map_err(|error| error.to_string())?);
        schema.known(&schema.0)?;
        Ok(schema)
    }

    /// Checks one instance against the whole schema.
    pub(crate) fn check(&self, instance: &Value) -> Result<(), String> {
        self.check_against(&self.0, instance)
    }

    /// The definitions, by name.
    pub(crate) fn definitions(&self) -> &Map<String, Value> {
        self.0["$defs"].as_object().unwrap()
    }

    /// Whether `instance` fits this definition.
    pub(crate) fn fits(&self, definition: &str, instance: &Value) -> bool {
        self.check_against(&self.definitions()[definition], instance).is_ok()
    }

    fn known(&self, schema: &Value) -> Result<(), String> {
        for (keyword, value) in schema.as_object().ok_or("a schema is an object")? {
            match &**keyword {
                "$schema" | "title" | "description" => {}
                "$defs" | "properties" => {
                    value.as_object().unwrap().values().try_for_each(|inner| self.known(inner))?;
                }
                "oneOf" => value.as_array().unwrap().iter().try_for_each(|it| self.known(it))?,
                "items" => self.known(value)?,
                "$ref" => drop(self.referred(value)?),
                _ => drop(keyword_named(keyword)?),
            }
        }
        Ok(())
    }

    fn referred(&self, reference: &Value) -> Result<&Value, String> {
        let name = reference.as_str().and_then(|path| path.strip_prefix("#/$defs/"));
        name.and_then(|name| self.0["$defs"].get(name)).ok_or(format!("no {reference}"))
    }

    fn check_against(&self, schema: &Value, instance: &Value) -> Result<(), String> {
        for (keyword, value) in schema.as_object().unwrap() {
            match &**keyword {
                "$schema" | "title" | "description" | "$defs" => {}
                // Closes `properties`, so it is checked with it.
                "additionalProperties" => only_properties(schema, instance)?,
                _ => keyword_named(keyword)?(value, instance, self)?,
            }
        }
        Ok(())
    }
}

fn keyword_named(name: &str) -> Result<Keyword, String> {
    Ok(match name {
        "$ref" => |value, instance, schema| schema.check_against(schema.referred(value)?, instance),
        "oneOf" => one_of,
        "type" => |value, instance, _| expect(has_type(value, instance), value, instance),
        "const" => |value, instance, _| expect(instance == value, value, instance),
        "enum" => |value, instance, _| {
            expect(value.as_array().unwrap().contains(instance), value, instance)
        },
        "properties" => |value, instance, schema| {
            let Some(members) = instance.as_object() else { return Ok(()) };
            let known = members.iter().filter_map(|(name, it)| Some((name, value.get(name)?, it)));
            known.into_iter().try_for_each(|(name, property, it)| {
                schema.check_against(property, it).map_err(|error| format!("{name}: {error}"))
            })
        },
        "required" => |value, instance, _| {
            let mut names = value.as_array().unwrap().iter().map(|name| name.as_str().unwrap());
            let missing = names.find(|name| instance.get(name).is_none());
            missing.map_or(Ok(()), |name| Err(format!("no {name} in {instance}")))
        },
        "additionalProperties" => |_, _, _| Ok(()),
        "items" => |value, instance, schema| {
            let items = instance.as_array().into_iter().flatten();
            items.into_iter().try_for_each(|item| schema.check_against(value, item))
        },
        "minItems" => |value, instance, _| {
            let len = instance.as_array().map(Vec::len);
            expect(len.is_none_or(|len| len as u64 >= value.as_u64().unwrap()), value, instance)
        },
        "maxItems" => |value, instance, _| {
            let len = instance.as_array().map(Vec::len);
            expect(len.is_none_or(|len| len as u64 <= value.as_u64().unwrap()), value, instance)
        },
        "minProperties" => |value, instance, _| {
            let len = instance.as_object().map(Map::len);
            expect(len.is_none_or(|len| len as u64 >= value.as_u64().unwrap()), value, instance)
        },
        // Numbers here are below 2^53, so that `f64` holds them exactly.
        "minimum" => |value, instance, _| {
            let number = instance.as_f64();
            expect(number.is_none_or(|it| it >= value.as_f64().unwrap()), value, instance)
        },
        "maximum" => |value, instance, _| {
            let number = instance.as_f64();
            expect(number.is_none_or(|it| it <= value.as_f64().unwrap()), value, instance)
        },
        "pattern" => |value, instance, _| {
            assert_eq!(value, "^([0-9a-f]{2})*$", "the only pattern that is known");
            let is_hex = |text: &str| {
                let is_digit = |byte: u8| matches!(byte, b'0'..=b'9' | b'a'..=b'f');
                text.len().is_multiple_of(2) && text.bytes().all(is_digit)
            };
            expect(instance.as_str().is_none_or(is_hex), value, instance)
        },
        _ => return Err(format!("unknown keyword {name}")),
    })
}

fn expect(holds: bool, wanted: &Value, found: &Value) -> Result<(), String> {
    if holds { Ok(()) } else { Err(format!("{found} instead of {wanted}")) }
}

fn has_type(name: &Value, instance: &Value) -> bool {
    match name.as_str().unwrap() {
        "object" => instance.is_object(),
        "array" => instance.is_array(),
        "string" => instance.is_string(),
        "number" => instance.is_number(),
        "integer" => instance.is_i64() || instance.is_u64(),
        other => panic!("unknown type {other}"),
    }
}

fn one_of(value: &Value, instance: &Value, schema: &Schema) -> Result<(), String> {
    let errors: Vec<_> = value
        .as_array()
        .unwrap()
        .iter()
        .filter_map(|one| schema.check_against(one, instance).err())
        .collect();
    match value.as_array().unwrap().len() - errors.len() {
        1 => Ok(()),
        0 => Err(format!("{instance} fits none: {errors:?}")),
        several => Err(format!("{instance} fits {several}")),
    }
}

fn only_properties(schema: &Value, instance: &Value) -> Result<(), String> {
    assert_eq!(schema["additionalProperties"], false, "the only value that is known");
    let mut names = instance.as_object().into_iter().flatten().map(|(name, _)| name);
    let extra = names.find(|name| schema["properties"].get(name).is_none());
    extra.map_or(Ok(()), |name| Err(format!("{name} is not a property")))
}
