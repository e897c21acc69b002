//! `decode.schema.json` describes what `axle decode --json` prints, and the page `fields` explains
//! each of its fields.

mod support;

use std::collections::{BTreeMap, BTreeSet};

use axlewire::crc16;
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

/// Fields of the lines in the schema: (field, the message or event that has it).
fn fields_of_schema() -> BTreeSet<(String, String)> {
    let schema = schema();
    let name = |kind: &Value| {
        let tag = if kind["properties"]["event"]["const"] == "frame" { "message" } else { "event" };
        kind["properties"][tag]["const"].as_str().unwrap().to_owned()
    };
    kinds()
        .iter()
        .map(|kind| &schema.definitions()[kind])
        .flat_map(|kind| {
            let fields = kind["properties"].as_object().unwrap().keys();
            fields.map(move |field| (field.clone(), name(kind)))
        })
        .collect()
}

/// Fields of the page: the first two columns of its tables.
fn fields_of_page() -> BTreeSet<(String, String)> {
    let fields = fields_of_schema();
    let with = |field: &str| -> BTreeSet<String> {
        fields.iter().filter(|(name, _)| name == field).map(|(_, kind)| kind.clone()).collect()
    };
    // Groups of the second column, by a field that only they have.
    let groups = BTreeMap::from([
        ("every line", with("event")),
        ("every frame", with("bytes")),
        ("UCP", with("index")),
        ("Ikeya", with("node")),
    ]);
    let page = include_str!("../../../src/fields.md");
    let mut found = BTreeSet::new();
    for row in page.lines().filter(|line| line.starts_with("| `")) {
        let columns: Vec<_> = row.split('|').map(str::trim).collect();
        assert_eq!(columns.len(), 8, "{row}");
        assert!(columns[3..7].iter().all(|column| !column.is_empty()), "{row}");
        let quoted = |column: &str| -> Vec<String> {
            column.split(", ").map(|name| name.trim_matches('`').to_owned()).collect()
        };
        let mut kinds = BTreeSet::new();
        for kind in quoted(columns[2]) {
            match groups.get(&*kind) {
                Some(group) => kinds.extend(group.iter().cloned()),
                None => drop(kinds.insert(kind)),
            }
        }
        for field in quoted(columns[1]) {
            for kind in &kinds {
                assert!(found.insert((field.clone(), kind.clone())), "twice: {field} of {kind}");
            }
        }
    }
    found
}

#[test]
fn the_page_of_fields_has_each_field_of_the_schema_and_no_other() {
    let (schema, page) = (fields_of_schema(), fields_of_page());
    let missing: Vec<_> = schema.difference(&page).collect();
    assert!(missing.is_empty(), "not on the page: {missing:?}");
    let extra: Vec<_> = page.difference(&schema).collect();
    assert!(extra.is_empty(), "not in the schema: {extra:?}");
}
