//! Intact frames that get through on 50 noisy lines, by each way to decode and by a plain receiver.
//!
//!     cargo bench --bench noise                     # all lines, as a table
//!     cargo bench --bench noise -- ikeya/headers    # those whose name contains this
//!     cargo bench --bench noise -- --svg            # the plain receiver as a bar chart
//!
//! The lines flip bits (`bits`), lose and insert bytes (`slips`), put random bytes between frames
//! (`bursts`), or bytes that look like headers (`headers`), and end frames early (`cuts`). They are
//! the same on every run. The plain receiver is the usual one of firmware: it collects the frame
//! that a header announces, and drops it whole if it is bad.
//!
//! A frame is intact if it arrives whole, and no byte of it belongs to something valid before it. A
//! phantom was delivered but did not arrive. Noise makes valid frames by chance, about once in
//! 65536 tries: these are unavoidable, and an oracle that shares no code with the library counts
//! them.
//!
//! The exit status is 1 if a decoder of the library loses an intact frame, or delivers a phantom
//! that is not unavoidable.

// The lines and the oracle of the library's tests.
#[path = "../tests/harness/dice.rs"]
#[allow(dead_code, reason = "the tests of the library use all of it")]
mod dice;
#[path = "../tests/harness/known_framings.rs"]
#[allow(dead_code, reason = "only the bytes of frames matter here")]
mod known_framings;
#[path = "../tests/harness/noisy_line.rs"]
#[allow(dead_code, reason = "the tests of the library use all of it")]
mod noisy_line;
#[path = "../tests/harness/oracle.rs"]
#[allow(dead_code, reason = "the tests of the library use all of it")]
mod oracle;
#[path = "noise/picture.rs"]
mod picture;
#[path = "noise/receiver.rs"]
mod receiver;
#[path = "../tests/harness/traffic.rs"]
mod traffic;

use std::{env, process::ExitCode};

use noisy_line::{Noise, Tally, transmit};
use receiver::Receiver;
use traffic::Traffic;

/// What the receivers make of one line.
type Row = [Tally; Receiver::ALL.len()];

fn main() -> ExitCode {
    // As with criterion: `cargo bench` passes `--bench`; without it, the run should be short.
    let given = |wanted: &str| env::args().any(|argument| argument == wanted);
    let frames = if given("--bench") && !given("--test") { 10_000 } else { 200 };
    let part = env::args().skip(1).find(|argument| !argument.starts_with('-')).unwrap_or_default();

    let lines: Vec<(Traffic, Noise, String)> = Traffic::ALL
        .into_iter()
        .flat_map(|traffic| Noise::ALL.map(|noise| (traffic, noise, name(traffic, noise))))
        .filter(|(.., name)| name.contains(&part))
        .collect();
    let rows: Vec<Row> = lines
        .iter()
        .map(|&(traffic, noise, _)| {
            let arrival = transmit(traffic, noise, frames, 1);
            Receiver::ALL.map(|it| arrival.tally(&it.receive(traffic, &arrival.bytes)))
        })
        .collect();

    if given("--svg") {
        let plain = |row: &Row| row[Receiver::ALL.len() - 1];
        print!("{}", picture::of(&rows.iter().map(plain).collect::<Vec<_>>()));
    } else {
        print_titles();
        for ((.., name), row) in lines.iter().zip(&rows) {
            print_row(name, row);
        }
        if rows.len() > 1 {
            print_row("all", &sum(&rows));
        }
    }

    let mut is_perfect = !rows.is_empty();
    for ((.., name), row) in lines.iter().zip(&rows) {
        for (receiver, tally) in Receiver::ALL.iter().zip(row) {
            if receiver.is_ours() && !tally.is_perfect() {
                eprintln!("{name}: {} lost or invented frames: {tally:?}", receiver.title());
                is_perfect = false;
            }
        }
    }
    if is_perfect { ExitCode::SUCCESS } else { ExitCode::FAILURE }
}

fn name(traffic: Traffic, noise: Noise) -> String {
    format!("{}/{}", traffic.name(), noise.name())
}

fn sum(rows: &[Row]) -> Row {
    let mut totals = Row::default();
    for row in rows {
        for (total, tally) in totals.iter_mut().zip(row) {
            total.intact += tally.intact;
            total.delivered += tally.delivered;
            total.phantoms += tally.phantoms;
            total.unavoidable += tally.unavoidable;
        }
    }
    totals
}

/// Widths of the columns for names of lines, for counts, and for those of accidents.
const NAME: usize = 22;
const COUNT: usize = 8;
const ACCIDENTS: usize = 13;

/// Width of a receiver's column.
fn width(receiver: Receiver) -> usize {
    receiver.title().len().max("99.99".len()) + 2
}

fn print_titles() {
    let shares: usize = Receiver::ALL.into_iter().map(width).sum();
    let start = NAME + COUNT;
    println!("{:start$}  {:shares$}phantoms", "", "% of the intact frames delivered");
    print!("{:NAME$}{:>COUNT$}", "line", "intact");
    for receiver in Receiver::ALL {
        print!("{:>1$}", receiver.title(), width(receiver));
    }
    println!("{:>COUNT$}{:>COUNT$}{:>ACCIDENTS$}", "ours", "plain", "unavoidable");
}

fn print_row(name: &str, row: &Row) {
    // The same for all receivers.
    let Tally { intact, unavoidable, .. } = row[0];
    print!("{name:NAME$}{intact:>COUNT$}");
    for (receiver, tally) in Receiver::ALL.into_iter().zip(row) {
        print!("{:>1$}", share(tally), width(receiver));
    }
    let most = |is_ours| {
        let these = Receiver::ALL.iter().zip(row).filter(|(it, _)| it.is_ours() == is_ours);
        these.map(|(_, tally)| tally.phantoms).max().unwrap_or(0)
    };
    println!("{:>COUNT$}{:>COUNT$}{unavoidable:>ACCIDENTS$}", most(true), most(false));
}

/// Percent of the intact frames. 100 means all of them: never rounded up.
fn share(tally: &Tally) -> String {
    if tally.delivered >= tally.intact {
        return "100".to_owned();
    }
    let hundredths = tally.delivered * 10_000 / tally.intact;
    format!("{}.{:02}", hundredths / 100, hundredths % 100)
}
