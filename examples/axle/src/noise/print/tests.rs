//! The table, to the letter.

use super::*;

const RECEIVERS: [Receiver; 5] = [
    Receiver::Frames,
    Receiver::Decoder(64),
    Receiver::Decoder(4096),
    Receiver::Pushed,
    Receiver::Plain,
];

/// What the receivers have made of a stream: the plain one half of it.
fn rows(stream: &str) -> Vec<Row<'_>> {
    let tally = |delivered, phantoms| Tally {
        intact: 2000,
        delivered,
        phantoms,
        unavoidable: 3,
        invented: 0,
    };
    let row = |receiver, tally| Row { stream, receiver, frames: 2100, tally };
    let tallies = [tally(2000, 3), tally(2000, 1), tally(1999, 2), tally(2000, 0), tally(1001, 40)];
    RECEIVERS.into_iter().zip(tallies).map(|(receiver, tally)| row(receiver, tally)).collect()
}

fn printed(is_json: bool, streams: &[&str]) -> Vec<String> {
    let (mut table, mut out) = (Table::new(is_json, &RECEIVERS), Vec::new());
    table.titles(&mut out).unwrap();
    for stream in streams {
        table.stream(&mut out, &rows(stream)).unwrap();
    }
    table.totals(&mut out).unwrap();
    String::from_utf8(out).unwrap().lines().map(str::to_owned).collect()
}

#[test]
fn a_share_is_rounded_down_and_the_accidents_are_the_most_of_ours_and_of_the_plain_one() {
    let expected = [
        "                                % of the intact frames delivered       phantoms",
        "stream                  intact  Frames  by 64  by 4096  pushed  plain    ours   plain  unavoidable",
        "bits                      2000     100    100    99.95     100  50.05       3      40            3",
        "bursts                    2000     100    100    99.95     100  50.05       3      40            3",
        "all                       4000     100    100    99.95     100  50.05       6      80            6",
    ];
    assert_eq!(printed(false, &["bits", "bursts"]), expected);
}

#[test]
fn one_stream_needs_no_sum() {
    assert_eq!(printed(false, &["bits"]).len(), 3);
}

#[test]
fn an_object_has_the_figures_of_one_receiver() {
    let lines = printed(true, &["bits", "bursts"]);
    assert_eq!(lines.len(), 10);
    let expected = concat!(
        r#"{"stream":"bursts","decoder":"plain","frames":2100,"intact":2000,"delivered":1001,"#,
        r#""phantoms":40,"unavoidable":3}"#
    );
    assert_eq!(lines[9], expected);
}
