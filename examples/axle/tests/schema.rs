//! `decode.schema.json` describes what `axle decode --json` prints. It is made of the table of
//! fields of the library.

mod support;

use axlewire::{
    crc16,
    fields::{FIELDS, Field, Kind, Shape},
};
use serde_json::{Map, Value, json};
use support::{bytes, decode, pcapng::PcapNg, schema::Schema};

const SCHEMA: &str = include_str!("../decode.schema.json");

fn schema() -> Schema {
    Schema::new(SCHEMA).unwrap()
}

/// Definitions of lines; the others are types of fields.
fn kinds() -> Vec<String> {
    let schema: Value = serde_json::from_str(SCHEMA).unwrap();
    let references = schema["oneOf"].as_array().unwrap().iter();
    references.map(|it| it["$ref"].as_str().unwrap()["#/$defs/".len()..].to_owned()).collect()
}

/// The lines for the captures, for every frame in the vectors, and for what is in neither.
fn lines() -> Vec<Value> {
    let root = concat!(env!("CARGO_MANIFEST_DIR"), "/../..");
    let capture = |name| std::fs::read(format!("{root}/examples/captures/{name}.bin")).unwrap();
    let vectors = |name: &str, protocol: &str| -> Vec<u8> {
        let text = std::fs::read_to_string(format!("{root}/tests/vectors/{name}.jsonl")).unwrap();
        let vectors = text.lines().map(|line| serde_json::from_str::<Value>(line).unwrap());
        // Noise behind each, so that no damaged one takes the next with it.
        let of_one = |vector: Value| [bytes(vector["hex"].as_str().unwrap()), vec![0; 64]].concat();
        vectors.filter(|vector| vector["protocol"] == protocol).flat_map(of_one).collect()
    };
    let inputs = [
        ("ucp", capture("ucp")),
        ("ikeya", capture("ikeya")),
        ("ikeya", vectors("ikeya", "ikeya-md")),
        ("ikeya-3", vectors("ikeya", "ikeya-md-3motor")),
        ("ucp", vectors("ucp", "ucp")),
        // Every reason, alone and together; two gaps printed as one.
        ("ucp", bytes("0001 fdff040001000142 fdff3d00 fdff3c00 fdff3c00")),
        ("ikeya", bytes("aa09bf16 aa01bed0 aa01bed1 55")),
        ("ikeya-3", bytes("bb030000803f000000400000404082f8")),
        ("ikeya", Vec::new()),
    ];
    let mut lines = Vec::new();
    for (protocol, input) in inputs {
        let (events, summary) = decode(&["--protocol", protocol], &input);
        lines.extend(events);
        lines.push(summary);
    }
    // A capture with times, of a node whose mode is known, and a clock that goes backwards.
    let answer = bytes("5501cdcccc3d5b9c");
    let write = bytes("bb0100000000053c");
    let write = [&write[..6], &crc16::compute(&write[..6]).to_le_bytes()].concat();
    let packets = [(9, 1, &answer[..]), (8, 2, &write[..]), (8, 1, &[1, 2][..])];
    let (events, summary) = decode(&[], &PcapNg::new(147, &packets).0);
    lines.extend(events);
    lines.push(summary);
    let (events, _) = decode(&["--protocol", "auto"], &capture("ucp"));
    lines.extend(events);
    lines
}

/// Fields that a line need not have.
const OPTIONAL: [&str; 6] = ["reasons", "t", "interface", "direction", "mode", "times_back"];

#[test]
fn every_line_of_the_captures_and_the_vectors_fits_the_schema() {
    let (schema, lines) = (schema(), lines());
    // Ten of the 177 vectors are refused; the captures have 26 frames.
    let frames = lines.iter().filter(|line| line["event"] == "frame").count();
    assert!(frames >= 177 - 10 + 26, "only {frames} frames");
    for line in &lines {
        schema.check(line).unwrap_or_else(|error| panic!("{line}: {error}"));
    }
    for kind in kinds() {
        assert!(lines.iter().any(|line| schema.fits(&kind, line)), "no {kind} among the lines");
    }
    for field in OPTIONAL {
        assert!(lines.iter().any(|line| line.get(field).is_some()), "no line has {field}");
    }
}

#[test]
fn planted_faults_do_not_fit_the_schema() {
    let (schema, lines) = (schema(), lines());
    let mut planted = 0;
    let mut plant = |line: &Value, change: &dyn Fn(&mut Value)| {
        let mut line = line.clone();
        change(&mut line);
        assert!(schema.check(&line).is_err(), "not found: {line}");
        planted += 1;
    };
    for kind in kinds() {
        let line = lines.iter().find(|line| schema.fits(&kind, line)).unwrap();
        plant(line, &|line| line["extra"] = 0.into());
        for (name, value) in line.as_object().unwrap() {
            if !OPTIONAL.contains(&&**name) {
                plant(line, &|line| drop(line.as_object_mut().unwrap().remove(name)));
            }
            for wrong in [json!(null), json!(true), json!({}), json!([]), json!("x")] {
                // A summary without gaps has no reasons.
                if (&**name, &wrong) != ("skipped_by", &json!({})) {
                    plant(line, &|line| line[name] = wrong.clone());
                }
            }
            if value.is_u64() || value.is_i64() {
                plant(line, &|line| line[name] = (-40_000).into());
                if name != "rps" {
                    plant(line, &|line| line[name] = 0.5.into());
                }
            }
            if let Some(array) = value.as_array() {
                let mut longer = array.clone();
                longer.push(json!(0));
                plant(line, &|line| line[name] = longer.clone().into());
                plant(line, &|line| line[name] = array[1..].to_vec().into());
            }
        }
    }
    assert!(planted > 1000, "only {planted} faults");
}

#[test]
fn the_checker_refuses_keywords_that_it_does_not_know() {
    let with = |keyword: &str| format!(r#"{{"items": {{"{keyword}": 1}}}}"#);
    assert!(Schema::new(&with("minimum")).is_ok());
    for keyword in ["multipleOf", "anyOf", "patternProperties", "minimun"] {
        assert!(Schema::new(&with(keyword)).is_err(), "{keyword}");
    }
    assert!(Schema::new(r##"{"$ref": "#/$defs/nothing"}"##).is_err());
}

/// The schema of a value of this field.
fn property(field: &Field) -> Value {
    let (least, most): (i64, i64) = match field.kind {
        Kind::U8 => (0, u8::MAX.into()),
        Kind::U16 => (0, u16::MAX.into()),
        Kind::I8 => (i8::MIN.into(), i8::MAX.into()),
        Kind::I16 => (i16::MIN.into(), i16::MAX.into()),
        Kind::I32 => (i32::MIN.into(), i32::MAX.into()),
        _ => (0, u32::MAX.into()),
    };
    let one = match (field.kind, field.limits) {
        (Kind::Name([name]), _) => json!({"const": name}),
        (Kind::Name(names), _) => json!({"enum": names}),
        (Kind::F32, _) => json!({"oneOf": [{"type": "number"}, {"enum": ["nan", "inf", "-inf"]}]}),
        (Kind::Time, _) => json!({"type": "number", "minimum": 0}),
        (Kind::Bytes, _) => json!({"type": "string", "pattern": "^([0-9a-f]{2})*$"}),
        (_, Some((least, most))) if least == most => json!({"const": least}),
        (Kind::U64, limits) => json!({"type": "integer", "minimum": limits.map_or(0, |it| it.0)}),
        (_, Some((least, most))) => json!({"type": "integer", "minimum": least, "maximum": most}),
        _ => json!({"type": "integer", "minimum": least, "maximum": most}),
    };
    match field.shape {
        Shape::One => one,
        Shape::Array(len) => {
            json!({"type": "array", "items": one, "minItems": len, "maxItems": len})
        }
        Shape::Object(keys) => {
            let values: Map<_, _> = keys.iter().map(|key| ((*key).into(), one.clone())).collect();
            let mut object =
                json!({"type": "object", "properties": values, "additionalProperties": false});
            if field.limits.is_none() {
                object["required"] = json!(keys);
            }
            if field.is_optional {
                // With one reason, that says all.
                object["minProperties"] = 2.into();
            }
            object
        }
    }
}

/// The schema of all lines.
fn made() -> String {
    let (mut kinds, mut definitions) = (Vec::new(), Vec::new());
    for record in FIELDS {
        let name = match (record.protocol, record.length) {
            (Some(protocol), Some((least, most))) if least == most => {
                format!("{protocol}.{}.{least}", record.message)
            }
            (Some(protocol), _) => format!("{protocol}.{}", record.message),
            _ => record.message.to_owned(),
        };
        let required = record.fields().filter(|field| !field.is_optional).map(|field| field.name);
        let required = json!(required.collect::<Vec<_>>());
        // In the order of the line, which a map of JSON does not keep.
        let property = |field: Field| format!(r#""{}": {}"#, field.name, property(&field));
        let properties: Vec<_> = record.fields().map(property).collect();
        kinds.push(format!(r##"    {{"$ref": "#/$defs/{name}"}}"##));
        definitions.push(format!(
            r#"    "{name}": {{
      "type": "object", "additionalProperties": false,
      "required": {required},
      "properties": {{{}}}
    }}"#,
            properties.join(", ")
        ));
    }
    format!(
        r#"{{
  "$schema": "https://json-schema.org/draft/2020-12/schema",
  "title": "A line of axle decode --json",
  "description": "The page `fields` of the library has the meaning and the unit of each field.",
  "oneOf": [
{}
  ],
  "$defs": {{
{}
  }}
}}
"#,
        kinds.join(",\n"),
        definitions.join(",\n")
    )
}

/// With `AXLEWIRE_WRITE=1`, this writes the schema.
#[test]
fn the_schema_has_the_fields_of_the_table() {
    if std::env::var_os("AXLEWIRE_WRITE").is_some() {
        let path = concat!(env!("CARGO_MANIFEST_DIR"), "/decode.schema.json");
        std::fs::write(path, made()).unwrap();
    } else {
        assert!(made() == SCHEMA, "run this test with AXLEWIRE_WRITE=1: it writes the schema");
    }
}
