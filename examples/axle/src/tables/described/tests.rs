use super::*;

fn described(protocol: Option<Protocol>, message: &str) -> Described {
    let all = all().unwrap();
    all.into_iter().find(|it| it.protocol == protocol && it.message == message).unwrap()
}

fn field(of: &Described, name: &str) -> (Kind, bool, &'static str) {
    let field = of.fields.iter().find(|field| field.name == name).unwrap();
    (field.kind.clone(), field.is_optional, field.unit)
}

#[test]
fn every_line_of_the_schema_that_is_a_frame_or_a_gap_has_a_table() {
    let all = all().unwrap();
    let of = |protocol| all.iter().filter(|it| it.protocol == Some(protocol)).count();
    // 17 names for ten ids, and `unknown`; READ, WRITE and two responses.
    assert_eq!(PROTOCOLS.map(of), [18, 4, 4]);
    assert_eq!(all.iter().filter(|it| it.protocol.is_none()).count(), 1);
    assert_eq!(all.len(), 18 + 4 + 4 + 1);
}

#[test]
fn types_and_units_are_those_of_the_schema_and_the_page() {
    let report = described(Some(Protocol::Ucp), "report");
    let told = |name| format!("{:?}", field(&report, name));
    assert_eq!(told("offset"), r#"(One(U64), false, "byte")"#);
    assert_eq!(told("t"), r#"(One(Time), true, "s")"#);
    assert_eq!(told("direction"), r#"(One(Name(["in", "out"])), true, "none")"#);
    assert_eq!(told("length"), r#"(One(U8), false, "byte")"#);
    assert_eq!(told("rpm"), r#"(Array(I16, 4), false, "1/min")"#);
    assert_eq!(told("layout"), r#"(One(Name(["firmware", "document"])), false, "none")"#);
    // One of the two layouts has none.
    assert_eq!(told("version"), r#"(One(U16), true, "none")"#);
    assert_eq!(told("current_ca"), r#"(One(U16), false, "0.01 A")"#);
    let state = described(Some(Protocol::Ucp), "network_state");
    assert_eq!(format!("{:?}", field(&state, "state").0), "One(U32)");
    let write = described(Some(Protocol::Ikeya3), "write");
    assert_eq!(format!("{:?}", field(&write, "rps")), r#"(Array(F32, 3), false, "1/s")"#);
    let gap = described(None, "skipped");
    assert_eq!(format!("{:?}", field(&gap, "length")), r#"(One(U64), false, "byte")"#);
    let reasons = r#"(Object(U64, ["header", "length", "id", "crc", "idle"]), true, "byte")"#;
    assert_eq!(format!("{:?}", field(&gap, "reasons")), reasons);
}
