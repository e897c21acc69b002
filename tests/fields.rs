//! The table of fields has what `serde` gives, and the page `fields` shows the table.
#![cfg(all(feature = "ikeya", feature = "serde", feature = "ucp"))]

use std::{collections::BTreeSet, env, fs};

use axlewire::{
    crc16,
    fields::{FIELDS, Field, Kind, Record, Shape},
    ikeya::{BothDirections, three},
    stream::{Frames, Gap, Reason},
    ucp::Ucp,
};
use serde_json::{Value, from_str, to_string};

/// What `serde` gives for a frame of this record, or for a gap.
fn data(record: &Record) -> String {
    let Some((len, _)) = record.length else {
        return to_string(&Gap { len: 3, reason: Reason::Crc }).unwrap();
    };
    let mut bytes = match (record.message, record.id) {
        ("read_request", _) => vec![0xAA, 1],
        ("write", _) => vec![0xBB, 1],
        ("velocity_response", _) => vec![0x55, 1],
        ("position_response", _) => vec![0x56, 1],
        (_, id) => vec![0xFD, 0xFF, len as u8 - 4, 0, id.unwrap_or(0)],
    };
    bytes.resize(len - 2, 0);
    bytes.extend(crc16::compute(&bytes).to_le_bytes());
    match record.protocol.unwrap() {
        "ucp" => to_string(Frames::<Ucp>::new(&bytes).next().unwrap()),
        "ikeya" => to_string(&Frames::<BothDirections>::new(&bytes).next().unwrap()),
        _ => to_string(&Frames::<three::BothDirections>::new(&bytes).next().unwrap()),
    }
    .unwrap()
}

/// The keys of an object, in their order. Its texts have no colons.
fn keys(object: &str) -> Vec<&str> {
    let mut pieces: Vec<_> = object.split("\":").collect();
    pieces.pop();
    pieces.into_iter().map(|piece| piece.rsplit('"').next().unwrap()).collect()
}

/// Smallest and largest value of an integer.
fn range(field: &Field) -> (i128, i128) {
    let of_kind = match field.kind {
        Kind::U8 => (0, u8::MAX.into()),
        Kind::I8 => (i8::MIN.into(), i8::MAX.into()),
        Kind::U16 => (0, u16::MAX.into()),
        Kind::I16 => (i16::MIN.into(), i16::MAX.into()),
        Kind::U32 => (0, u32::MAX.into()),
        Kind::I32 => (i32::MIN.into(), i32::MAX.into()),
        _ => (0, u64::MAX.into()),
    };
    field.limits.map_or(of_kind, |(least, most)| (least.into(), most.into()))
}

fn fits(field: &Field, value: &Value) -> bool {
    if let Shape::Array(len) = field.shape {
        let mut one = *field;
        one.shape = Shape::One;
        return value
            .as_array()
            .is_some_and(|all| all.len() == len && all.iter().all(|it| fits(&one, it)));
    }
    match field.kind {
        Kind::F32 => value.is_number(),
        Kind::Bytes => value.as_str().is_some_and(|digits| digits.len().is_multiple_of(2)),
        Kind::Name(names) => value.as_str().is_some_and(|name| names.contains(&name)),
        _ => {
            let (least, most) = range(field);
            value.as_i64().is_some_and(|it| (least..=most).contains(&it.into()))
        }
    }
}

#[test]
fn every_frame_and_every_gap_has_the_fields_of_the_table_in_its_order() {
    let records = FIELDS.iter().filter(|it| ["frame", "skipped"].contains(&it.event));
    for record in records.clone() {
        let of_serde = || record.fields().filter(|field| !field.is_of_tool);
        let data = data(record);
        let names: Vec<_> = of_serde().map(|field| field.name).collect();
        assert_eq!(keys(&data), names, "{record:?}");
        let data: Value = from_str(&data).unwrap();
        for field in of_serde() {
            assert!(fits(&field, &data[field.name]), "{data}: {field:?}");
        }
    }
    // 20 frames of UCP, four packets for each kind of board, and the gap.
    assert_eq!(records.count(), 20 + 2 * 4 + 1);
}

#[test]
fn every_field_says_what_it_means() {
    for record in FIELDS {
        let mut names = BTreeSet::new();
        for field in record.fields() {
            assert!(names.insert(field.name), "twice in {}: {}", record.message, field.name);
            for text in [field.name, field.unit, field.meaning] {
                assert!(!text.is_empty() && !text.contains(['|', '\n']), "{field:?}");
            }
        }
    }
}

/// A row of the page: the same field of several records.
struct Row {
    field: Field,
    of: Vec<&'static Record>,
    types: Vec<String>,
    limits: Vec<(i128, i128)>,
}

/// All rows, in the order of the table.
fn rows() -> Vec<Row> {
    let mut rows: Vec<Row> = Vec::new();
    for record in FIELDS {
        for field in record.fields() {
            let is_same = |it: &Field| {
                let [it, field] = [it, &field].map(|it| (it.name, it.unit, it.meaning, it.source));
                it == field
            };
            let known = rows.iter().position(|row| is_same(&row.field));
            let at = known.unwrap_or_else(|| {
                rows.push(Row { field, of: vec![], types: vec![], limits: vec![] });
                rows.len() - 1
            });
            let (row, new) = (&mut rows[at], types(&field));
            row.types
                .extend(new.into_iter().filter(|it| !row.types.contains(it)).collect::<Vec<_>>());
            row.of.push(record);
            row.limits.push(range(&field));
        }
    }
    rows
}

/// What its values are: names, or a type.
fn types(field: &Field) -> Vec<String> {
    let one = match field.kind {
        Kind::Name(names) => return names.iter().map(|name| format!("`{name}`")).collect(),
        Kind::Time => "number with 6 decimals".to_owned(),
        Kind::Bytes => "hex digits".to_owned(),
        kind => format!("`{}`", kind.name()),
    };
    vec![match field.shape {
        Shape::Array(len) => format!("{one} × {len}"),
        Shape::Object(_) => format!("object of {one}"),
        _ => one,
    }]
}

impl Row {
    /// The heading on the page under which it is.
    fn heading(&self) -> &'static str {
        let has = |event| self.of.iter().any(|record| record.event == event);
        let is_of = |of: &str| {
            self.of.iter().all(|record| record.protocol.is_some_and(|it| it.starts_with(of)))
        };
        match () {
            () if has("frame") && has("skipped") => "# Every line",
            () if is_of("ucp") => "# UCP",
            () if is_of("ikeya") => "# Ikeya",
            () if has("frame") => "# Every frame",
            () if has("skipped") => "# Gaps",
            () if has("summary") => "# Summary",
            () => "# Protocol",
        }
    }

    fn cells(&self) -> [String; 6] {
        let Field { name, unit, meaning, source, .. } = self.field;
        let source = if source.is_empty() { "none" } else { source };
        [
            format!("`{name}`"),
            self.places(),
            self.type_of(),
            unit.into(),
            meaning.into(),
            source.into(),
        ]
    }

    /// The messages that have it, or what they have in common.
    fn places(&self) -> String {
        let is_all = |of: &dyn Fn(&Record) -> bool| {
            FIELDS.iter().filter(|it| of(it)).count() == self.of.len()
        };
        let is_in =
            |of: &str| is_all(&|record| record.protocol.is_some_and(|it| it.starts_with(of)));
        match self.heading() {
            _ if is_all(&|_| true) => "every line".into(),
            "# Every line" => "every frame, `skipped`".into(),
            "# Every frame" => "every frame".into(),
            "# UCP" if is_in("ucp") => "UCP".into(),
            "# Ikeya" if is_in("ikeya") => "Ikeya".into(),
            _ => {
                let mut names: Vec<_> =
                    self.of.iter().map(|it| format!("`{}`", it.message)).collect();
                let mut known = BTreeSet::new();
                names.retain(|name| known.insert(name.clone()));
                names.join(", ")
            }
        }
    }

    /// The type, with the limits that are narrower and the values that have a name.
    fn type_of(&self) -> String {
        let joined = |all: &[String]| match all.split_last() {
            Some((last, rest)) if !rest.is_empty() => format!("{} or {last}", rest.join(", ")),
            _ => all.concat(),
        };
        let of = joined(&self.types);
        let least = self.limits.iter().map(|limits| limits.0).min().unwrap();
        let most = self.limits.iter().map(|limits| limits.1).max().unwrap();
        let values = self.field.values.iter().map(|(value, name)| format!("{value} {name}"));
        let constants: BTreeSet<_> = self.limits.iter().map(|limits| limits.0).collect();
        let is_constant = self.limits.iter().all(|limits| limits.0 == limits.1);
        let mut whole = self.field;
        whole.limits = None;
        match self.field.kind {
            _ if self.field.name == "message" => "a name".into(),
            _ if !self.field.values.is_empty() => {
                format!("{of}: {}", values.collect::<Vec<_>>().join(", "))
            }
            Kind::Name(_) => of,
            _ if range(&whole) == (least, most) || self.field.limits.is_none() => of,
            _ if is_constant => joined(&constants.iter().map(i128::to_string).collect::<Vec<_>>()),
            _ if most == u64::MAX.into() => format!("{of}; at least {least}"),
            _ => format!("{of}; {least} to {most}"),
        }
    }
}

/// With `AXLEWIRE_WRITE=1`, this writes the tables of the page.
#[test]
fn the_page_of_fields_shows_the_table() {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/src/fields.md");
    let (rows, page) = (rows(), fs::read_to_string(path).unwrap());
    let (mut made, mut heading, mut shown) = (String::new(), "", 0);
    for line in page.lines() {
        if line.starts_with("# ") {
            heading = line;
        }
        if line.starts_with("| `") {
            continue;
        }
        made += &format!("{line}\n");
        if line.starts_with("|---") {
            for row in rows.iter().filter(|row| row.heading() == heading) {
                made += &format!("| {} |\n", row.cells().join(" | "));
                shown += 1;
            }
        }
    }
    assert_eq!(shown, rows.len(), "each row has its heading on the page");
    if env::var_os("AXLEWIRE_WRITE").is_some() {
        fs::write(path, &made).unwrap();
    } else {
        assert!(made == page, "run this test with AXLEWIRE_WRITE=1: it writes src/fields.md");
    }
}
