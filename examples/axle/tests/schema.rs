//! `decode.schema.json` describes what `axle decode --json` prints. It is made of the table of fields
//! of the library.

mod support;

use std::{collections::BTreeMap, fmt::Display};

use axlewire::{
    crc16,
    fields::{FIELDS, Field, Kind, Shape},
};
use serde_json::{Value, json};
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

/// JSON whose keys keep their order.
enum Json {
    /// A number, or a string with its quotes.
    One(String),
    Array(Vec<Json>),
    Object(Vec<(String, Json)>),
}

impl Json {
    fn text(text: impl Display) -> Self {
        Self::One(format!("\"{text}\""))
    }

    fn number(number: impl Display) -> Self {
        Self::One(number.to_string())
    }

    fn texts(texts: &[&str]) -> Self {
        Self::Array(texts.iter().map(Self::text).collect())
    }

    fn object<const N: usize>(entries: [(&str, Self); N]) -> Self {
        Self::Object(entries.map(|(key, value)| (key.to_owned(), value)).into())
    }

    fn reference(name: &str) -> Self {
        Self::object([("$ref", Self::text(format!("#/$defs/{name}")))])
    }

    /// On one line.
    fn flat(&self) -> String {
        let entry = |(key, value): &(String, Self)| format!("\"{key}\": {}", value.flat());
        let list = |all: Vec<String>| all.join(", ");
        match self {
            Self::One(text) => text.clone(),
            Self::Array(all) => format!("[{}]", list(all.iter().map(Self::flat).collect())),
            Self::Object(all) => format!("{{{}}}", list(all.iter().map(entry).collect())),
        }
    }

    /// On lines of at most 100 columns; `used` are in front of it on the first.
    fn lines(&self, indent: usize, used: usize) -> String {
        let (flat, inner) = (self.flat(), " ".repeat(indent + 2));
        if used + flat.len() < 100 {
            return flat;
        }
        let (open, body, close) = match self {
            Self::One(_) => return flat,
            Self::Object(all) => {
                let entry = |(key, value): &(String, Self)| {
                    let key = format!("{inner}\"{key}\": ");
                    format!("{key}{}", value.lines(indent + 2, key.chars().count()))
                };
                ('{', all.iter().map(entry).collect::<Vec<_>>().join(",\n"), '}')
            }
            Self::Array(all) => {
                let (mut body, mut line) = (String::new(), inner.clone());
                for (at, one) in all.iter().map(Self::flat).enumerate() {
                    if at > 0 && line.len() + 1 + one.len() >= 100 {
                        body += &format!("{},\n", line.trim_end().trim_end_matches(','));
                        line.clone_from(&inner);
                    }
                    line += &format!("{one}, ");
                }
                ('[', body + line.trim_end().trim_end_matches(','), ']')
            }
        };
        format!("{open}\n{body}\n{}{close}", " ".repeat(indent))
    }
}

/// The schema of a value of this field; adds the definition that it refers to.
fn property(field: &Field, types: &mut BTreeMap<String, Json>) -> Json {
    let mut defined = |name: &str, schema: Json| {
        types.insert(name.to_owned(), schema);
        Json::reference(name)
    };
    let is = |kind: &str| ("type", Json::text(kind));
    let from = |least: i64| ("minimum", Json::number(least));
    let to = |most: u64| ("maximum", Json::number(most));
    let name = field.kind.name();
    let mut integer =
        |least, most| defined(name, Json::object([is("integer"), from(least), to(most)]));
    let one = match (field.kind, field.limits) {
        (Kind::Name([name]), _) => Json::object([("const", Json::text(name))]),
        (Kind::Name(names), _) => Json::object([("enum", Json::texts(names))]),
        (_, Some((least, most))) if least == most => Json::object([("const", Json::number(least))]),
        (_, Some((least, u64::MAX))) => Json::object([is("integer"), from(least as i64)]),
        (_, Some((least, most))) => Json::object([is("integer"), from(least as i64), to(most)]),
        (Kind::U8, _) => integer(0, u8::MAX.into()),
        (Kind::U16, _) => integer(0, u16::MAX.into()),
        (Kind::U32, _) => integer(0, u32::MAX.into()),
        (Kind::I8, _) => integer(i8::MIN.into(), i8::MAX as u64),
        (Kind::I16, _) => integer(i16::MIN.into(), i16::MAX as u64),
        (Kind::I32, _) => integer(i32::MIN.into(), i32::MAX as u64),
        (Kind::U64, _) => defined(name, Json::object([is("integer"), from(0)])),
        (Kind::Time, _) => defined(name, Json::object([is("number"), from(0)])),
        (Kind::F32, _) => {
            let names = Json::object([("enum", Json::texts(&["nan", "inf", "-inf"]))]);
            let either = Json::Array(vec![Json::object([is("number")]), names]);
            defined(name, Json::object([("oneOf", either)]))
        }
        (Kind::Bytes, _) => {
            let digits = ("pattern", Json::text("^([0-9a-f]{2})*$"));
            defined(name, Json::object([is("string"), digits]))
        }
    };
    match field.shape {
        Shape::One => one,
        Shape::Array(len) => {
            let size = |key| (key, Json::number(len));
            let array = [is("array"), ("items", one), size("minItems"), size("maxItems")];
            defined(&format!("{name}_x{len}"), Json::object(array))
        }
        Shape::Object(keys) => {
            let one = one.flat();
            let values = keys.iter().map(|key| ((*key).to_owned(), Json::One(one.clone())));
            let mut object = vec![is("object"), ("properties", Json::Object(values.collect()))];
            // Each count of at least 1 is left out if there is none.
            if field.limits.is_none() {
                object.push(("required", Json::texts(keys)));
            }
            object.push(("additionalProperties", Json::One("false".to_owned())));
            // It is there only if it has several.
            if field.is_optional {
                object.push(("minProperties", Json::number(2)));
            }
            Json::Object(object.into_iter().map(|(key, value)| (key.to_owned(), value)).collect())
        }
    }
}

/// The schema of all lines.
fn made() -> String {
    let (mut kinds, mut lines, mut types) = (Vec::new(), Vec::new(), BTreeMap::new());
    for record in FIELDS {
        let mut name = record.message.to_owned();
        if let (Some(protocol), Some((least, most))) = (record.protocol, record.length) {
            let len = if least == most { format!(".{least}") } else { String::new() };
            name = format!("{protocol}.{name}{len}");
        }
        let fields = || record.fields();
        let properties = fields().map(|it| (it.name.to_owned(), property(&it, &mut types)));
        let properties = Json::Object(properties.collect());
        let required: Vec<_> = fields().filter(|it| !it.is_optional).map(|it| it.name).collect();
        let line = Json::object([
            ("type", Json::text("object")),
            ("properties", properties),
            ("required", Json::texts(&required)),
            ("additionalProperties", Json::One("false".to_owned())),
        ]);
        kinds.push(Json::reference(&name));
        lines.push((name, line));
    }
    lines.extend(types);
    let page = "The page `fields` of the library has the meaning and the unit of each field.";
    let schema = Json::object([
        ("$schema", Json::text("https://json-schema.org/draft/2020-12/schema")),
        ("title", Json::text("A line of axle decode --json")),
        ("description", Json::text(page)),
        ("oneOf", Json::Array(kinds)),
        ("$defs", Json::Object(lines)),
    ]);
    schema.lines(0, 0) + "\n"
}

/// With `AXLEWIRE_WRITE=1`, this writes the schema.
#[test]
fn the_schema_has_the_fields_of_the_table() {
    let made = made();
    if std::env::var_os("AXLEWIRE_WRITE").is_some() {
        let path = concat!(env!("CARGO_MANIFEST_DIR"), "/decode.schema.json");
        std::fs::write(path, made).unwrap();
    } else {
        assert!(made == SCHEMA, "run this test with AXLEWIRE_WRITE=1: it writes the schema");
    }
}
