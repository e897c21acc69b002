//! `axle noise`: the shape and the meaning of its figures.

mod support;

use std::collections::BTreeMap;

use serde_json::Value;
use support::{run, stdout};

/// The objects of a run on all streams, with few frames.
fn records(args: &[&str]) -> Vec<Value> {
    let args = [&["noise", "--json", "--frames", "200"], args].concat();
    stdout(run(&args, b"")).lines().map(|line| serde_json::from_str(line).unwrap()).collect()
}

fn count(record: &Value, field: &str) -> u64 {
    record[field].as_u64().unwrap()
}

fn is_plain(record: &Value) -> bool {
    record["decoder"].as_str().unwrap().starts_with("plain")
}

#[test]
fn there_is_an_object_for_each_stream_and_decoder_with_its_fields_in_order() {
    let listing = stdout(run(&["noise", "--json", "--frames", "50"], b""));
    let mut streams = BTreeMap::<String, Vec<String>>::new();
    for line in listing.lines() {
        let record: Value = serde_json::from_str(line).unwrap();
        let text = |field: &str| record[field].as_str().unwrap().to_owned();
        let number = |field| count(&record, field);
        let written = format!(
            r#"{{"stream":"{}","decoder":"{}","frames":{},"intact":{},"delivered":{},"phantoms":{},"unavoidable":{}}}"#,
            text("stream"),
            text("decoder"),
            number("frames"),
            number("intact"),
            number("delivered"),
            number("phantoms"),
            number("unavoidable"),
        );
        assert_eq!(line, written);
        streams.entry(text("stream")).or_default().push(text("decoder"));
    }
    assert_eq!(streams.len(), 50);
    for decoders in streams.values() {
        let expected = [
            "frames",
            "each-simd",
            "each-portable",
            "decoder-1",
            "decoder-7",
            "decoder-64",
            "decoder-4096",
            "decoder-pushed",
            "plain",
        ];
        assert_eq!(decoders, &expected);
    }
}

#[test]
fn the_library_delivers_every_intact_frame_and_the_plain_receiver_does_not() {
    let records = records(&[]);
    let (mut intact, mut plain) = (0, 0);
    for record in &records {
        let [sent, whole, delivered] =
            ["frames", "intact", "delivered"].map(|field| count(record, field));
        assert!(sent == 200 && whole <= sent && whole > 100 && delivered <= whole, "{record}");
        if is_plain(record) {
            intact += whole;
            plain += delivered;
        } else {
            assert_eq!(delivered, whole, "{record}");
            assert!(count(record, "phantoms") <= count(record, "unavoidable"), "{record}");
        }
        if record["stream"].as_str().unwrap().ends_with("/clean") {
            assert_eq!((whole, delivered), (200, 200), "{record}");
        }
    }
    assert!(plain < intact * 98 / 100, "{plain} of {intact}");
    // All decoders of a stream were given the same.
    for decoders in records.chunks(9) {
        let same = |field: &str| decoders.iter().all(|record| record[field] == decoders[0][field]);
        assert!(same("stream") && same("intact") && same("unavoidable"));
    }
}

#[test]
fn the_same_seed_gives_the_same_figures_and_another_one_others() {
    let args = ["--stream", "bits-1e-3"];
    let first = records(&args);
    assert_eq!(records(&args), first);
    assert_eq!(records(&["--stream", "bits-1e-3", "--seed", "1"]), first, "the default");
    assert_ne!(records(&["--stream", "bits-1e-3", "--seed", "2"]), first);
    // What is left out changes nothing.
    let of_ucp = |record: &Value| record["stream"] == "ucp/bits-1e-3";
    let alone = records(&["--stream", "ucp/bits-1e-3"]);
    assert_eq!(alone, first.into_iter().filter(of_ucp).collect::<Vec<_>>());
}

#[test]
fn a_protocol_and_a_name_choose_the_streams() {
    let names = |args: &[&str]| -> Vec<String> {
        let records = records(args);
        let plain = records.iter().filter(|record| is_plain(record));
        plain.map(|record| record["stream"].as_str().unwrap().to_owned()).collect()
    };
    assert_eq!(names(&["-P", "ucp"]).len(), 20);
    assert_eq!(names(&["-P", "ikeya"]).len(), 20);
    assert_eq!(names(&["-P", "ikeya-3", "--stream", "cuts"]), ["ikeya-3/cuts"]);
    let output = run(&["noise", "--stream", "none-such"], b"");
    assert_eq!((output.status.code(), &*output.stdout), (Some(2), &b""[..]));
}

#[test]
fn the_table_has_a_row_per_stream_and_one_for_all() {
    let table = stdout(run(&["noise", "--frames", "300", "-P", "ikeya"], b""));
    let lines: Vec<_> = table.lines().collect();
    assert_eq!(lines.len(), 2 + 20 + 1);
    let (titles, rows) = (lines[1], &lines[2..]);
    assert!(rows.iter().all(|row| row.len() == titles.len()), "{table}");
    let columns = |row: &str| row.split_whitespace().map(str::to_owned).collect::<Vec<_>>();
    let all = columns(rows[20]);
    assert_eq!((&*all[0], all.len()), ("all", 2 + 9 + 3));
    assert!(all[2..10].iter().all(|share| share == "100"), "{table}");
    assert!(all[10].parse::<f64>().unwrap() < 99.0, "{table}");
    let sum: u64 = rows[..20].iter().map(|row| columns(row)[1].parse::<u64>().unwrap()).sum();
    assert_eq!(all[1], sum.to_string());
}
