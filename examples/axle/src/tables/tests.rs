use std::path::Path;

use serde_json::{Map, Value, json};

use super::*;
use crate::{
    decode::{self, Sheet},
    input::{Form, Input},
    listing::Style,
};

/// All rows as lines of `decode --json`, by their numbers.
#[derive(Default)]
struct Lines(BTreeMap<u64, Value>);

impl Sink for Lines {
    fn rows(&mut self, table: &mut Table) -> Result<(), Failure> {
        for (row, number) in table.numbers.iter().enumerate() {
            assert!(self.0.insert(*number, line(table, row)).is_none());
        }
        Ok(())
    }
}

/// A row as a line. Arrays and objects are columns with the names of their fields in front.
fn line(table: &Table, row: usize) -> Value {
    let mut line = Map::new();
    line.insert("event".into(), if table.protocol.is_some() { "frame" } else { "skipped" }.into());
    if let Some(protocol) = table.protocol {
        line.insert("protocol".into(), protocol.name().into());
        line.insert("message".into(), table.message.into());
    }
    for column in &table.columns {
        assert_eq!(column.cells().count(), table.numbers.len(), "{}", column.name);
        let value = match column.cells().nth(row).unwrap() {
            None => continue,
            Some(Cell::Integer(value)) => json!(value),
            Some(Cell::Unsigned(value)) => json!(value),
            // As its shortest digits, which a wider number would not have.
            Some(Cell::Float(value)) if value.is_finite() => {
                serde_json::from_str(&serde_json::to_string(&value).unwrap()).unwrap()
            }
            Some(Cell::Float(value)) => json!(value.to_string().to_lowercase()),
            Some(Cell::Time(value)) => json!(value as f64 / 1e6),
            Some(Cell::Name(value)) => json!(value),
            Some(Cell::Bytes(value)) => {
                json!(value.iter().map(|byte| format!("{byte:02x}")).collect::<String>())
            }
        };
        match column.name.split_once("reasons_") {
            Some((_, name)) => line.entry("reasons").or_insert(json!({}))[name] = value,
            None => match column.name.rsplit_once('_') {
                Some((array, at)) if at.parse::<u8>().is_ok() => {
                    let values = line.entry(array).or_insert(json!([]));
                    values.as_array_mut().unwrap().push(value);
                }
                _ => drop(line.insert(column.name.clone(), value)),
            },
        }
    }
    line.into()
}

/// The rows of a capture, and the lines of its listing.
fn both(path: &Path, named: Option<Protocol>) -> (Vec<Value>, Vec<Value>) {
    let mut input = Input::open_one(Some(path), Form::default()).unwrap();
    let chosen = decode::choose(&mut input, named).unwrap();
    let mut rows = Lines::default();
    decode::walk_into(&mut input, &chosen, &mut rows, || Ok(())).unwrap();

    let mut input = Input::open_one(Some(path), Form::default()).unwrap();
    let chosen = decode::choose(&mut input, named).unwrap();
    let mut sheet = Sheet::new(Some(Style::Json));
    chosen.walk(&mut input, &mut sheet, |_, _| Ok(())).unwrap();
    let lines = String::from_utf8(sheet.out.0).unwrap();
    let lines = lines.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    (rows.0.into_values().collect(), lines)
}

#[test]
fn the_rows_of_every_capture_and_vector_are_the_lines_of_its_listing() {
    let root = concat!(env!("CARGO_MANIFEST_DIR"), "/../..");
    let mut inputs = Vec::new();
    for name in ["ucp", "ikeya"] {
        inputs.push((std::fs::read(format!("{root}/examples/captures/{name}.bin")).unwrap(), None));
        let text = std::fs::read_to_string(format!("{root}/tests/vectors/{name}.jsonl")).unwrap();
        let vectors: Vec<Value> =
            text.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
        for (of, protocol) in [
            ("ucp", Protocol::Ucp),
            ("ikeya-md", Protocol::Ikeya),
            ("ikeya-md-3motor", Protocol::Ikeya3),
        ] {
            let mut bytes = Vec::new();
            for vector in vectors.iter().filter(|vector| vector["protocol"] == of) {
                let digits = vector["hex"].as_str().unwrap().as_bytes();
                let hex =
                    |pair: &[u8]| u8::from_str_radix(str::from_utf8(pair).unwrap(), 16).unwrap();
                bytes.extend(digits.chunks(2).map(hex));
                // Noise behind each, so that no damaged one takes the next with it.
                bytes.extend([0; 64]);
            }
            if !bytes.is_empty() {
                inputs.push((bytes, Some(protocol)));
            }
        }
    }
    assert_eq!(inputs.len(), 5);
    let mut count = 0;
    for (at, (bytes, protocol)) in inputs.into_iter().enumerate() {
        let path = std::env::temp_dir().join(format!("axle-{}-tables-{at}", std::process::id()));
        std::fs::write(&path, bytes).unwrap();
        let (rows, lines) = both(&path, protocol);
        std::fs::remove_file(path).unwrap();
        assert_eq!(rows.len(), lines.len());
        for (row, line) in rows.iter().zip(&lines) {
            assert_eq!(row, line);
        }
        count += rows.len();
    }
    assert!(count > 300, "{count}");
}
