//! The table, the line and the JSON object of the same traffic.

use axlewire::{
    ikeya::{BothDirections, NodeId, ReadRequest, Rps, VelocityResponse},
    ucp::{Body, MotorControl, Ucp},
};
use serde_json::{Value, json};

use super::*;

fn at(millis: u64) -> Instant {
    Instant::from_micros(7_000_000 + 1000 * millis)
}

/// READs of node 2, damaged and answered, from 7 s on; and their decoder.
fn bus(reads: usize) -> (Table, Decoder<BothDirections, 64>) {
    let mut table = Table::new(Protocol::Ikeya, at(0));
    let mut decoder = Decoder::default();
    let read = ReadRequest::new(NodeId::N2);
    let answer = VelocityResponse::new(NodeId::N2, Rps::new(1.5).unwrap());
    let damaged = [0xAA, 2, 0, 0];
    let bytes = [&read.as_bytes().repeat(reads), &damaged[..], answer.as_bytes()].concat();
    table.take(&mut decoder, &bytes);
    (table, decoder)
}

fn text(print: impl FnOnce(&mut Vec<u8>) -> io::Result<()>) -> String {
    let mut out = Vec::new();
    print(&mut out).unwrap();
    String::from_utf8(out).unwrap()
}

#[test]
fn rates_are_measured_once_a_second_over_the_time_since() {
    let (mut table, mut decoder) = bus(10);
    let line = |table: &Table, decoder: &Decoder<_, 64>, millis| {
        text(|out| table.print_line(out, &decoder.counters(), at(millis)))
    };
    table.measure(at(999));
    let account = "52 bytes, 11 frames, 4 skipped header 3 crc 1";
    let rest = "; node 2 read_request 0.0/s; node 2 velocity_response 0.0/s\n";
    assert_eq!(line(&table, &decoder, 999), format!("    0 s  {account}{rest}"));
    table.measure(at(1000));
    let rest = "; node 2 read_request 10.0/s; node 2 velocity_response 1.0/s\n";
    assert_eq!(line(&table, &decoder, 1500), format!("    1 s  {account}{rest}"));
    table.take(&mut decoder, &ReadRequest::new(NodeId::N2).as_bytes().repeat(6));
    table.measure(at(1999));
    assert!(line(&table, &decoder, 1999).contains("read_request 10.0/s"));
    table.measure(at(2500));
    assert!(
        line(&table, &decoder, 2500)
            .ends_with("read_request 4.0/s; node 2 velocity_response 0.0/s\n")
    );
}

#[test]
fn at_the_end_the_rates_are_those_of_the_whole_run() {
    let (mut table, decoder) = bus(10);
    table.measure(at(1000));
    let told = text(|out| table.finish(out, &decoder.counters(), at(4000)));
    let lines: Vec<_> = told.lines().map(str::trim_end).collect();
    assert_eq!(
        lines,
        [
            "node  message                    count     per s  last",
            "   2  read_request                  10       2.5",
            "   2  velocity_response              1       0.2  1.5 rps",
            "",
            "        52 bytes received",
            "        48 in 11 frames",
            "         4 skipped: 3 header, 1 crc",
        ]
    );
}

#[test]
fn nothing_heard_is_said_with_the_time() {
    let mut table = Table::new(Protocol::Ucp, at(0));
    let told = text(|out| table.finish(out, &Counters::default(), at(2600)));
    assert_eq!(told, "Nothing was heard in 3 s.\n");
    table.measure_all(at(0));
}

#[test]
fn a_record_has_what_was_skipped_by_reason_and_the_node_or_the_id() {
    let (mut table, decoder) = bus(2);
    let record = |table: &Table, counters: &Counters, millis| -> Value {
        let line = text(|out| table.print_json(out, "stats", counters, at(millis)));
        serde_json::from_str(&line).unwrap()
    };
    table.measure_all(at(0));
    assert_eq!(record(&table, &decoder.counters(), 0)["messages"][0]["per_second"], 0.0);
    table.measure_all(at(500));
    let told = record(&table, &decoder.counters(), 500);
    let messages = json!([
        {"node": 2, "message": "read_request", "count": 2, "per_second": 4.0, "last": ""},
        {"node": 2, "message": "velocity_response", "count": 1, "per_second": 2.0,
         "last": "1.5 rps"},
    ]);
    let expected = json!({
        "event": "stats", "t": 0.5, "received": 20, "framed": 16, "skipped": 4, "pending": 0,
        "frames": 3, "skipped_by": {"header": 3, "crc": 1}, "messages": messages,
    });
    assert_eq!(told, expected);
    let mut table = Table::new(Protocol::Ucp, at(0));
    let mut decoder = Decoder::<Ucp, 128>::default();
    let frame = MotorControl::STOP.frame(0);
    table.take(&mut decoder, &[frame.as_bytes(), &frame.as_bytes()[..3]].concat());
    let told = record(&table, &decoder.counters(), 500);
    let last = "speed    0 %  angular    0 %  front led off";
    let message =
        json!({"id": 2, "message": "motor_control", "count": 1, "per_second": 0.0, "last": last});
    assert_eq!(told["messages"], json!([message]));
    assert_eq!((&told["pending"], &told["skipped_by"]), (&json!(3), &json!({})));
}
