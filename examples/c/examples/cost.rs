//! What the border to C costs: `cargo run --release -p axlewire-c --example cost`.
//!
//! Decodes the same streams by the decoders of Rust and by the functions of the header, in turns,
//! and prints their speeds as a ratio; 1.00 is as fast. Both look at each frame, and must see the
//! same.

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
    print("bus, many", &bus, &in_rust, &|bytes| {
        let mut decoder = bus_decoder();
        many_in_c(&mut decoder, axle_ikeya_decoder_decode_many, bytes)
    });
    print("bus, bytes", &bus, &pushed_in_rust, &|bytes| {
        let mut decoder = bus_decoder();
        pushed_in_c(&mut decoder, axle_ikeya_decoder_push, axle_ikeya_decoder_poll, bytes)
    });
    print("rover, chunk", &rover, &|bytes| chunk(&mut ucp::Decoder::new(), bytes), &|bytes| {
        let mut decoder = rover_decoder();
        chunk_in_c(&mut decoder, axle_ucp_decoder_decode, bytes)
    });
    print("rover, many", &rover, &|bytes| chunk(&mut ucp::Decoder::new(), bytes), &|bytes| {
        let mut decoder = rover_decoder();
        many_in_c(&mut decoder, axle_ucp_decoder_decode_many, bytes)
    });
    print("rover, bytes", &rover, &|bytes| pushed(&mut ucp::Decoder::new(), bytes), &|bytes| {
        let mut decoder = rover_decoder();
        pushed_in_c(&mut decoder, axle_ucp_decoder_push, axle_ucp_decoder_poll, bytes)
    });
}

fn print(what: &str, bytes: &[u8], rust: Count<'_>, c: Count<'_>) {
    assert_eq!(rust(bytes), c(bytes), "both see the same frames");
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

/// What a reader of a capture does with a frame at least: see what it is, and how long.
trait Look {
    fn look(&self) -> u64;
}

impl Look for [u8] {
    fn look(&self) -> u64 {
        self.iter().take(4).map(|byte| u64::from(*byte)).sum::<u64>() + self.len() as u64
    }
}

impl Look for ikeya::Packet<'_> {
    fn look(&self) -> u64 {
        self.as_bytes().look()
    }
}

impl Look for &ucp::Frame {
    fn look(&self) -> u64 {
        self.as_bytes().look()
    }
}

impl Look for axle_stream_event {
    fn look(&self) -> u64 {
        if self.kind == AXLE_STREAM_FRAME {
            // SAFETY: so long is the frame that was just found.
            unsafe { std::slice::from_raw_parts(self.bytes, self.length) }.look()
        } else {
            0
        }
    }
}

fn look_at<F: Look>(event: &Event<F>) -> u64 {
    if let Event::Frame(frame) = event { frame.look() } else { 0 }
}

fn chunk<F: Framing, const N: usize>(decoder: &mut Decoder<F, N>, mut bytes: &[u8]) -> u64
where
    for<'a> F::Frame<'a>: Look,
{
    let mut seen = 0;
    while let Some(event) = decoder.decode(&mut bytes) {
        seen += look_at(&event);
    }
    seen
}

fn pushed<F: Framing, const N: usize>(decoder: &mut Decoder<F, N>, bytes: &[u8]) -> u64
where
    for<'a> F::Frame<'a>: Look,
{
    let mut seen = 0;
    for byte in bytes {
        // Where the decoder is, is looked up for each byte, as in an interrupt.
        let decoder = black_box(&mut *decoder);
        if decoder.push(*byte) {
            while let Some(event) = decoder.poll() {
                seen += look_at(&event);
            }
        }
    }
    seen
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
    let (mut data, mut length, mut event, mut seen) = (bytes.as_ptr(), bytes.len(), event(), 0);
    while decode(decoder, &mut data, &mut length, &mut event) == AXLE_OK {
        seen += event.look();
    }
    seen
}

type DecodeMany<M> = extern "C" fn(
    *mut M,
    *mut *const u8,
    *mut usize,
    *mut axle_stream_event,
    usize,
    *mut usize,
) -> i32;

fn many_in_c<M>(decoder: &mut M, decode: DecodeMany<M>, bytes: &[u8]) -> u64 {
    let (mut data, mut length, mut seen) = (bytes.as_ptr(), bytes.len(), 0);
    let (mut events, mut count) = ([event(); 64], 0);
    let at = events.as_mut_ptr();
    while decode(decoder, &mut data, &mut length, at, events.len(), &mut count) == AXLE_OK {
        for event in &events[..count] {
            seen += event.look();
        }
    }
    seen
}

fn pushed_in_c<M>(
    decoder: &mut M,
    push: extern "C" fn(*mut M, u8) -> i32,
    poll: extern "C" fn(*mut M, *mut axle_stream_event) -> i32,
    bytes: &[u8],
) -> u64 {
    let (mut event, mut seen) = (event(), 0);
    for byte in bytes {
        let decoder = black_box(&mut *decoder);
        if push(decoder, *byte) == AXLE_OK {
            while poll(decoder, &mut event) == AXLE_OK {
                seen += event.look();
            }
        }
    }
    seen
}
