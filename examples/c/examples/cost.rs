//! What the border to C costs: `cargo run --release -p axlewire-c --example cost`.
//!
//! Decodes the same streams by the decoders of Rust and by the functions of the header, in turns,
//! and prints their speeds as a ratio; 1.00 is as fast. Both must find the same frames.

use std::{hint::black_box, time::Instant};

use axlewire::{
    ikeya::{self, NodeId, ReadRequest, Rps, VelocityResponse},
    stream::{Decoder, Event, Framing},
    ucp::{self, Body, message::FirmwareReport},
};
use axlewire_c::*;

/// Rounds of each way, of which the fastest counts.
const ROUNDS: usize = 15;

type Count<'a> = &'a dyn Fn(&[u8]) -> u64;

fn main() {
    let bus: Vec<u8> = (0..60_000)
        .flat_map(|at| {
            let node = NodeId::ALL[at % 8];
            let answer = VelocityResponse::new(node, Rps::new(at as f32).unwrap_or(Rps::ZERO));
            [&ReadRequest::new(node).as_bytes()[..], answer.as_bytes()].concat()
        })
        .collect();
    let rover: Vec<u8> = (0..16_000)
        .flat_map(|at| {
            let report = FirmwareReport::new(&ucp::Telemetry::default(), 38);
            report.frame(at as u8).as_bytes().to_vec()
        })
        .collect();
    let in_rust = |bytes: &[u8]| chunk(&mut ikeya::Decoder::<ikeya::BothDirections>::new(), bytes);
    let pushed_in_rust =
        |bytes: &[u8]| pushed(&mut ikeya::Decoder::<ikeya::BothDirections>::new(), bytes);
    print("bus, chunk", &bus, &in_rust, &|bytes| {
        let mut decoder = bus_decoder();
        chunk_in_c(&mut decoder, axle_ikeya_decoder_decode, bytes)
    });
    print("bus, bytes", &bus, &pushed_in_rust, &|bytes| {
        let mut decoder = bus_decoder();
        pushed_in_c(&mut decoder, axle_ikeya_decoder_push, axle_ikeya_decoder_poll, bytes)
    });
    print("rover, chunk", &rover, &|bytes| chunk(&mut ucp::Decoder::new(), bytes), &|bytes| {
        let mut decoder = rover_decoder();
        chunk_in_c(&mut decoder, axle_ucp_decoder_decode, bytes)
    });
    print("rover, bytes", &rover, &|bytes| pushed(&mut ucp::Decoder::new(), bytes), &|bytes| {
        let mut decoder = rover_decoder();
        pushed_in_c(&mut decoder, axle_ucp_decoder_push, axle_ucp_decoder_poll, bytes)
    });
}

fn print(what: &str, bytes: &[u8], rust: Count<'_>, c: Count<'_>) {
    assert_eq!(rust(bytes), c(bytes), "both find the same frames");
    let time = |count: Count<'_>| {
        let begin = Instant::now();
        black_box(count(black_box(bytes)));
        begin.elapsed().as_secs_f64()
    };
    let (mut best_rust, mut best_c) = (f64::MAX, f64::MAX);
    for _ in 0..ROUNDS {
        best_rust = best_rust.min(time(rust));
        best_c = best_c.min(time(c));
    }
    println!("{what:<13} {:.2} of the speed of Rust", best_rust / best_c);
}

fn chunk<F: Framing, const N: usize>(decoder: &mut Decoder<F, N>, mut bytes: &[u8]) -> u64 {
    let mut frames = 0;
    while let Some(event) = decoder.decode(&mut bytes) {
        frames += u64::from(matches!(event, Event::Frame(_)));
    }
    frames
}

fn pushed<F: Framing, const N: usize>(decoder: &mut Decoder<F, N>, bytes: &[u8]) -> u64 {
    let mut frames = 0;
    for byte in bytes {
        if decoder.push(*byte) {
            while let Some(event) = decoder.poll() {
                frames += u64::from(matches!(event, Event::Frame(_)));
            }
        }
    }
    frames
}

fn bus_decoder() -> axle_ikeya_decoder {
    // SAFETY: numbers alone.
    let mut decoder = unsafe { std::mem::zeroed() };
    let size = AXLE_IKEYA_DECODER_SIZE;
    assert_eq!(axle_ikeya_decoder_init(&mut decoder, size, AXLE_IKEYA_BOTH_DIRECTIONS), AXLE_OK);
    decoder
}

fn rover_decoder() -> axle_ucp_decoder {
    // SAFETY: numbers alone.
    let mut decoder = unsafe { std::mem::zeroed() };
    assert_eq!(axle_ucp_decoder_init(&mut decoder, AXLE_UCP_DECODER_SIZE), AXLE_OK);
    decoder
}

fn event() -> axle_stream_event {
    // SAFETY: numbers, and a pointer that may be null.
    unsafe { std::mem::zeroed() }
}

fn chunk_in_c<M>(
    decoder: &mut M,
    decode: extern "C" fn(*mut M, *mut *const u8, *mut usize, *mut axle_stream_event) -> i32,
    bytes: &[u8],
) -> u64 {
    let (mut data, mut length, mut event, mut frames) = (bytes.as_ptr(), bytes.len(), event(), 0);
    while decode(decoder, &mut data, &mut length, &mut event) == AXLE_OK {
        frames += u64::from(event.kind == AXLE_STREAM_FRAME);
    }
    frames
}

fn pushed_in_c<M>(
    decoder: &mut M,
    push: extern "C" fn(*mut M, u8) -> i32,
    poll: extern "C" fn(*mut M, *mut axle_stream_event) -> i32,
    bytes: &[u8],
) -> u64 {
    let (mut event, mut frames) = (event(), 0);
    for byte in bytes {
        if push(decoder, *byte) == AXLE_OK {
            while poll(decoder, &mut event) == AXLE_OK {
                frames += u64::from(event.kind == AXLE_STREAM_FRAME);
            }
        }
    }
    frames
}
