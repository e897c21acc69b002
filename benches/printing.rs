//! Speed of printing: frames as text for people, over the same frames as JSON; one line per figure,
//! `name value goal`, higher is better.
//!
//! `cargo bench --bench printing` takes a few seconds once it is built. It fails if an output is
//! wrong, and with `-- --goals` if a figure is below its goal. With `-- --test` the contenders
//! pretend to take known times, and every figure must be the one of these times.

use std::{env, fmt::Display, io::Write, process::ExitCode};

use axlewire::{
    ikeya,
    stream::{Frames, Framing},
    ucp,
};
use axlewire_contenders::{
    Tally, figures,
    race::{Contender, Stopwatch, race},
    streams::{self, Stream},
};
use serde::Serialize;

/// Times that contenders pretend to take in a test, seconds.
const TEXT: f64 = 3.0;
const JSON: f64 = 12.0;

/// How a stream is measured.
#[derive(Clone, Copy)]
struct Effort {
    len: usize,
    rounds: usize,
    stopwatch: Stopwatch,
}

fn main() -> ExitCode {
    // As with criterion: `cargo bench` passes `--bench`; without it, the run should be short.
    let given = |wanted: &str| env::args().any(|argument| argument == wanted);
    let effort = if given("--bench") && !given("--test") {
        Effort { len: 4 << 20, rounds: 9, stopwatch: Stopwatch::Real }
    } else {
        let stopwatch = Stopwatch::Pretended(|name| if name == "text" { TEXT } else { JSON });
        Effort { len: 64 << 10, rounds: 1, stopwatch }
    };

    let mixed = streams::requests_and_responses(effort.len);
    let reports = streams::reports(effort.len);
    measure::<ikeya::BothDirections>("ikeya8", &streams::responses(effort.len), effort);
    measure::<ikeya::BothDirections>("ikeya_mixed", &mixed, effort);
    measure::<ikeya::BothDirections>("ikeya_mixed_1e-3", &mixed.with_bit_errors(1000), effort);
    measure::<ucp::Ucp>("ucp44", &reports, effort);
    measure::<ucp::Ucp>("ucp44_1e-3", &reports.with_bit_errors(1000), effort);
    figures::outcome()
}

/// Prints every frame of a stream both ways.
fn measure<F>(name: &str, stream: &Stream, Effort { rounds, stopwatch, .. }: Effort)
where
    F: Framing,
    for<'a> F::Frame<'a>: Display + Serialize,
{
    let bytes = &stream.bytes[..];
    let text = |out: &mut Vec<u8>, frame: &F::Frame<'_>| {
        write!(out, "{frame}").expect("memory is enough");
    };
    let json = |out: &mut Vec<u8>, frame: &F::Frame<'_>| {
        serde_json::to_writer(out, frame).expect("memory is enough");
    };
    // The same through other functions, frame by frame.
    let texts = tally_of::<F>(bytes, text, |frame| frame.to_string());
    let jsons = tally_of::<F>(bytes, json, |frame| serde_json::to_string(frame).expect("is data"));
    assert!(texts.frames >= stream.intact.len() as u64 && texts.frames == jsons.frames, "{name}");
    let [text_time, json_time] = race(
        stopwatch,
        rounds,
        [
            Contender::new("text", texts, printed::<F>(bytes, text)),
            Contender::new("JSON", jsons, printed::<F>(bytes, json)),
        ],
    );

    let figure = |figure: &str, value: f64, digits: usize, goal: Option<f64>, due: f64| {
        figures::print(&format!("{figure}_{name}"), value, digits, goal);
        if let Stopwatch::Pretended(_) = stopwatch {
            assert!((value / due - 1.0).abs() < 1e-9, "{figure} is {value}, and should be {due}");
        }
    };
    let (mb, ns) = (bytes.len() as f64 / 1e6, 1e9 / texts.frames as f64);
    figure("text_over_json", json_time / text_time, 3, Some(1.0), 4.0);
    figure("mb_per_s_text", mb / text_time, 0, None, mb / TEXT);
    figure("ns_per_frame_text", ns * text_time, 0, None, ns * TEXT);
    figure("mb_per_s_json", mb / json_time, 0, None, mb / JSON);
    figure("ns_per_frame_json", ns * json_time, 0, None, ns * JSON);
}

/// Number of frames and length of what is printed of them. Each is printed once in both ways, which
/// must agree.
fn tally_of<F: Framing>(
    bytes: &[u8],
    print: impl Fn(&mut Vec<u8>, &F::Frame<'_>),
    print_again: impl Fn(&F::Frame<'_>) -> String,
) -> Tally {
    let mut tally = Tally::default();
    let mut out = Vec::new();
    for frame in Frames::<F>::new(bytes) {
        out.clear();
        print(&mut out, &frame);
        let again = print_again(&frame);
        assert!(again.len() > 10 && out == again.as_bytes(), "{again:?}");
        tally.frames += 1;
        tally.sum += again.len() as u64;
    }
    tally
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
