//! Speed of printing: frames as text for people, over the same frames as JSON; one line per figure,
//! `name value goal`, higher is better.
//!
//! `cargo bench -p axlewire-benches --bench printing` takes a few seconds once it is built. It
//! fails if an output has the wrong length, never because a figure is low.

use std::{env, fmt::Display, io::Write};

use axlewire::{
    ikeya,
    stream::{Frames, Framing},
    ucp,
};
use axlewire_benches::{
    Tally,
    race::{Contender, race},
    streams::{self, Stream},
};
use serde::Serialize;

fn main() {
    // As with criterion: `cargo bench` passes `--bench`; without it, the run should be short.
    let given = |wanted: &str| env::args().any(|argument| argument == wanted);
    let (len, rounds) =
        if given("--bench") && !given("--test") { (4 << 20, 9) } else { (64 << 10, 1) };

    let mixed = streams::requests_and_responses(len);
    let reports = streams::reports(len);
    measure::<ikeya::BothDirections>("ikeya8", &streams::responses(len), rounds);
    measure::<ikeya::BothDirections>("ikeya_mixed", &mixed, rounds);
    measure::<ikeya::BothDirections>("ikeya_mixed_1e-3", &mixed.with_bit_errors(1000), rounds);
    measure::<ucp::Ucp>("ucp44", &reports, rounds);
    measure::<ucp::Ucp>("ucp44_1e-3", &reports.with_bit_errors(1000), rounds);
}

/// Prints every frame of a stream both ways.
fn measure<F>(name: &str, Stream { bytes, .. }: &Stream, rounds: usize)
where
    F: Framing,
    for<'a> F::Frame<'a>: Display + Serialize,
{
    let text = printed::<F>(bytes, |out, frame| write!(out, "{frame}").expect("memory is enough"));
    let json = printed::<F>(bytes, |out, frame| {
        serde_json::to_writer(out, frame).expect("memory is enough");
    });
    // The same through other functions, frame by frame.
    let lengths = |print: fn(&F::Frame<'_>) -> usize| -> Tally {
        let lengths: Vec<usize> = Frames::<F>::new(bytes).map(|frame| print(&frame)).collect();
        Tally { frames: lengths.len() as u64, sum: lengths.iter().sum::<usize>() as u64 }
    };
    let (texts, jsons) = (
        lengths(|frame| frame.to_string().len()),
        lengths(|frame| serde_json::to_string(frame).expect("is data").len()),
    );
    let [text_time, json_time] =
        race(rounds, [Contender::new("text", texts, text), Contender::new("JSON", jsons, json)]);

    println!("text_over_json_{name} {:.3} 1", json_time / text_time);
    for (kind, seconds) in [("text", text_time), ("json", json_time)] {
        println!("mb_per_s_{kind}_{name} {:.0} -", bytes.len() as f64 / seconds / 1e6);
        println!("ns_per_frame_{kind}_{name} {:.0} -", 1e9 * seconds / texts.frames as f64);
    }
}

/// Prints every frame into one buffer, which is emptied as if it were written somewhere.
fn printed<F: Framing>(
    bytes: &[u8],
    print: impl Fn(&mut Vec<u8>, &F::Frame<'_>),
) -> impl Fn() -> Tally {
    move || {
        let mut tally = Tally::default();
        let mut out = Vec::with_capacity(80 << 10);
        for frame in Frames::<F>::new(bytes) {
            print(&mut out, &frame);
            tally.frames += 1;
            if out.len() > 64 << 10 {
                tally.sum += out.len() as u64;
                out.clear();
            }
        }
        tally.sum += out.len() as u64;
        tally
    }
}
