//! Helpers of the scenarios: packets, and a decoder's output for them.

use axlewire::{ikeya, ucp::MotorControl};

/// What the tests of streams use of the library.
pub(crate) use axlewire::{
    ikeya::{NodeId, Position, Rps, three},
    stream::{Counters, Decoder, Event, Frames, Framing, Gap, Reason, Verdict},
    ucp::{Body, Ucp},
};

pub(crate) use crate::{checked_line::CheckedLine, hostile_streams, known_framings::Known};

/// An event with the frame's bytes in it.
#[derive(Debug, PartialEq)]
pub(crate) enum Seen {
    Frame(Vec<u8>),
    Gap(u64, Reason),
}

/// The output of a decoder with the smallest buffer for `chunks`, then for a quiet line.
pub(crate) fn seen<F: Known, const N: usize>(chunks: &[&[u8]], quiet: bool) -> (Vec<Seen>, usize) {
    let mut decoder = Decoder::<F, N>::new();
    let mut seen = Vec::new();
    let mut drain = |decoder: &mut Decoder<F, N>, mut chunk: &[u8]| {
        while let Some(event) = decoder.decode(&mut chunk) {
            seen.push(match event {
                Event::Frame(frame) => Seen::Frame(F::bytes(&frame).to_vec()),
                Event::Skipped(Gap { len, reason }) => Seen::Gap(len, reason),
            });
        }
    };
    for chunk in chunks {
        drain(&mut decoder, chunk);
    }
    if quiet {
        decoder.idle();
        drain(&mut decoder, &[]);
    }
    (seen, decoder.pending())
}

pub(crate) fn read() -> Vec<u8> {
    ikeya::ReadRequest::new(NodeId::N1).as_bytes().to_vec()
}

pub(crate) fn write() -> Vec<u8> {
    ikeya::WriteRequest::velocity(NodeId::N2, Rps::new(1.0).unwrap()).as_bytes().to_vec()
}

pub(crate) fn response() -> Vec<u8> {
    ikeya::VelocityResponse::new(NodeId::N2, Rps::new(1.0).unwrap()).as_bytes().to_vec()
}

pub(crate) fn motor() -> Vec<u8> {
    MotorControl::new(60, 20).unwrap().frame(7).as_bytes().to_vec()
}
