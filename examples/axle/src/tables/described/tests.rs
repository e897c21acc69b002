use axlewire::fields::Shape;

use super::*;

fn described(protocol: Option<Protocol>, message: &str) -> Described {
    let all = all();
    all.into_iter().find(|it| it.protocol == protocol && it.message == message).unwrap()
}

type Told = (Kind, Shape, Vec<&'static str>, bool, &'static str);

fn field(of: &Described, name: &str) -> Told {
    let (field, names) = of.fields.iter().find(|(field, _)| field.name == name).unwrap();
    let kind = if names.is_empty() { field.kind } else { Kind::Name(&[]) };
    (kind, field.shape, names.clone(), field.is_optional, field.unit)
}

#[test]
fn every_line_of_the_schema_that_is_a_frame_or_a_gap_has_a_table() {
    let all = all();
    let of = |protocol| all.iter().filter(|it| it.protocol == Some(protocol)).count();
    // 17 names for ten ids, and `unknown`; READ, WRITE and two responses.
    assert_eq!(PROTOCOLS.map(of), [18, 4, 4]);
    assert_eq!(all.iter().filter(|it| it.protocol.is_none()).count(), 1);
    assert_eq!(all.len(), 18 + 4 + 4 + 1);
    // Each layout fits the table of its message.
    for record in FIELDS.iter().filter(|it| ["frame", "skipped"].contains(&it.event)) {
        let is_its = |it: &&Described| {
            it.message == record.message && it.protocol.map(Protocol::name) == record.protocol
        };
        let mut known = all.iter().find(is_its).unwrap().fields.iter();
        for field in record.fields() {
            assert!(known.any(|(known, _)| known.name == field.name), "{field:?}");
        }
    }
}

#[test]
fn types_and_units_are_those_of_the_schema_and_the_page() {
    let one = |kind, is_optional, unit| (kind, Shape::One, vec![], is_optional, unit);
    let names = |names: &[&'static str], is_optional| {
        (Kind::Name(&[]), Shape::One, names.to_vec(), is_optional, "none")
    };
    let report = described(Some(Protocol::Ucp), "report");
    assert_eq!(field(&report, "offset"), one(Kind::U64, false, "byte"));
    assert_eq!(field(&report, "t"), one(Kind::Time, true, "s"));
    assert_eq!(field(&report, "direction"), names(&["in", "out"], true));
    assert_eq!(field(&report, "length"), one(Kind::U8, false, "byte"));
    assert_eq!(field(&report, "rpm"), (Kind::I16, Shape::Array(4), vec![], false, "1/min"));
    assert_eq!(field(&report, "layout"), names(&["firmware", "document"], false));
    // One of the two layouts has none.
    assert_eq!(field(&report, "version"), one(Kind::U16, true, "none"));
    assert_eq!(field(&report, "current_ca"), one(Kind::U16, false, "0.01 A"));
    let state = described(Some(Protocol::Ucp), "network_state");
    assert_eq!(field(&state, "state"), one(Kind::U32, false, "none"));
    let write = described(Some(Protocol::Ikeya3), "write");
    assert_eq!(field(&write, "rps"), (Kind::F32, Shape::Array(3), vec![], false, "1/s"));
    let gap = described(None, "skipped");
    assert_eq!(field(&gap, "length"), one(Kind::U64, false, "byte"));
    let of_reasons = Shape::Object(&["header", "length", "id", "crc", "idle"]);
    assert_eq!(field(&gap, "reasons"), (Kind::U64, of_reasons, vec![], true, "byte"));
}
