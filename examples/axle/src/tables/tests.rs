use std::path::Path;

use serde::{Serialize, ser::SerializeMap};
use serde_json::{Map, Value, json};

use super::*;
use crate::{
    decode::{self, Sheet},
    input::Input,
    listing::Style,
};

/// All rows as lines of `decode --json`, by their numbers.
#[derive(Default)]
struct Lines(std::collections::BTreeMap<u64, Value>);

impl Sink for Lines {
    fn rows(&mut self, table: &Table) -> Result<(), Failure> {
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
            Some(Cell::Double(value)) if value.is_finite() => json!(value),
            Some(Cell::Double(value)) => json!(value.to_string().to_lowercase()),
            Some(Cell::Flag(value)) => json!(value),
            Some(Cell::Text(value)) => json!(value),
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
    let mut input = Input::open(Some(path)).unwrap();
    let chosen = decode::choose(&mut input, named).unwrap();
    let mut rows = Lines::default();
    decode::walk_into(&mut input, &chosen, &mut rows, || Ok(())).unwrap();

    let mut input = Input::open(Some(path)).unwrap();
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

/// A message that somebody has added to the library, with these fields.
#[derive(Clone, Copy)]
pub(crate) struct Added<'a>(pub(crate) &'static str, pub(crate) &'a Value);

/// As the library does it, in its order.
impl Serialize for Added<'_> {
    fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut map = serializer.serialize_map(None)?;
        map.serialize_entry("length", &9_u8)?;
        map.serialize_entry("protocol", "ucp")?;
        map.serialize_entry("message", self.0)?;
        map.serialize_entry("id", &0x42_u8)?;
        map.serialize_entry("index", &7_u8)?;
        for (name, value) in self.1.as_object().unwrap() {
            map.serialize_entry(name, value)?;
        }
        map.serialize_entry("bytes", "fdff05004207aabbcc")?;
        map.end()
    }
}

impl Shown for Added<'_> {
    const PROTOCOL: Protocol = Protocol::Ucp;

    fn name(&self) -> &'static str {
        self.0
    }

    fn bytes(&self) -> &[u8] {
        &[0xFD, 0xFF, 5, 0, 0x42, 7, 0xAA, 0xBB, 0xCC]
    }

    fn number(&self) -> u8 {
        7
    }

    fn contents(&self, _: &mut Out, _: &Modes) {}
}

/// One of each kind of value.
pub(crate) fn lamp() -> Value {
    json!({
        "colour": 1, "cold": -3, "watts": 0.1, "is_on": true, "name": "a, \"b\"", "t_c": [25, -3],
        "huge": u64::MAX, "mixed": [1, "x"], "by": {"left": 1, "right": 2.5}, "none": null,
    })
}

/// Tables with these messages.
pub(crate) fn tables_of(messages: &[Added<'_>]) -> Tables {
    let mut tables = Tables::new(true).unwrap();
    for (at, message) in messages.iter().enumerate() {
        let place = Place { offset: 9 * at as u64, micros: Some(5), ..Place::default() };
        tables.frame(place, message, &Modes::default());
    }
    tables
}

/// Names, types, and rows of all tables with rows, in the form of CSV.
#[derive(Default)]
struct Told(Vec<String>);

impl Sink for Told {
    fn rows(&mut self, table: &Table) -> Result<(), Failure> {
        let place = PLACE.len();
        let columns = table.columns.iter().skip(place);
        let columns: Vec<_> = columns
            .map(|it| {
                format!("{}:{}:{} {:?}", it.name, it.unit, it.kind.name(), {
                    it.cells().collect::<Vec<_>>()
                })
            })
            .collect();
        assert!(table.columns.iter().all(|it| it.cells().count() == table.numbers.len()));
        self.0.push(format!("{} {:?}", table.name, table.numbers));
        self.0.extend(columns);
        Ok(())
    }
}

fn told(messages: &[Added<'_>]) -> Vec<String> {
    let mut told = Told::default();
    let mut tables = tables_of(messages);
    tables.give_full(&mut told).unwrap();
    tables.give_rest(&mut told).unwrap();
    told.0
}

#[test]
fn a_message_that_the_schema_has_not_has_the_columns_of_its_first_line() {
    let told = told(&[Added("set_lamp", &lamp()), Added("set_lamp", &json!({"colour": 2}))]);
    assert_eq!(told[0], "ucp.set_lamp [0, 1]");
    for line in [
        "length:byte:u8 [Some(Integer(9)), Some(Integer(9))]",
        "id:none:u8 [Some(Integer(66)), Some(Integer(66))]",
        "index:frame:u8 [Some(Integer(7)), Some(Integer(7))]",
        "colour:unknown:i64 [Some(Integer(1)), Some(Integer(2))]",
        "cold:unknown:i64 [Some(Integer(-3)), None]",
        "watts:unknown:f64 [Some(Double(0.1)), None]",
        "is_on:unknown:bool [Some(Flag(true)), None]",
        r#"name:unknown:text [Some(Text("a, \"b\"")), None]"#,
        "t_c_0:unknown:i64 [Some(Integer(25)), None]",
        "t_c_1:unknown:i64 [Some(Integer(-3)), None]",
        "huge:unknown:u64 [Some(Unsigned(18446744073709551615)), None]",
        r#"mixed:unknown:text [Some(Text("[1,\"x\"]")), None]"#,
        "by_left:unknown:f64 [Some(Double(1.0)), None]",
        "by_right:unknown:f64 [Some(Double(2.5)), None]",
        "none:unknown:text [None, None]",
    ] {
        assert!(told.iter().any(|found| found == line), "{line} is not in {told:#?}");
    }
    assert!(told.last().unwrap().starts_with("bytes:none:bytes [Some(Bytes([253, 255, 5, 0, "));
}

#[test]
fn a_line_that_does_not_fit_goes_to_another_table_and_leaves_nothing_in_the_first() {
    let (pong, more, text) = (json!({"err": 1}), json!({"err": 0, "why": 2}), json!({"x": "y"}));
    let (short, long) = (json!({"x": [1]}), json!({"x": [1, 2]}));
    let told = told(&[
        Added("pong", &pong),
        Added("pong", &more),
        Added("pong", &pong),
        Added("pong", &more),
        Added("new", &short),
        Added("new", &long),
        Added("new", &text),
        Added("new", &short),
    ]);
    let tables: Vec<_> = told.iter().filter(|it| !it.contains(':')).collect();
    let expected = [
        "ucp.pong [0, 2]",
        "ucp.pong-2 [1, 3]",
        "ucp.new [4, 7]",
        "ucp.new-2 [5]",
        "ucp.new-3 [6]",
    ];
    assert_eq!(tables, expected);
    assert!(told.contains(&"err:none:u8 [Some(Integer(1)), Some(Integer(1))]".to_owned()));
    assert!(told.contains(&"why:unknown:i64 [Some(Integer(2)), Some(Integer(2))]".to_owned()));
    assert!(told.contains(&"x_1:unknown:i64 [Some(Integer(2))]".to_owned()));
}
