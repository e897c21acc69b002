//! The decoders of axlewire behind the signature shared by all decoders here.

use axlewire::{
    ikeya::{Packet, Request, Response},
    stream::{Decoder, Event, Frames, Framing},
    ucp,
};

use crate::Tally;

/// A frame that can be added to a [`Tally`].
pub trait Sample {
    /// Reads id and payload as a user of the frame would, and adds them.
    fn add_to(&self, tally: &mut Tally);
}

impl Sample for Packet<'_> {
    #[inline]
    fn add_to(&self, tally: &mut Tally) {
        match self {
            Packet::Request(Request::Read(read)) => tally.add(read.id().get(), None),
            Packet::Request(Request::Write(write)) => {
                tally.add(write.id().get(), Some(write.payload()));
            }
            Packet::Response(Response::Velocity(velocity)) => {
                tally.add(velocity.id().get(), Some(velocity.rps().to_le_bytes()));
            }
            Packet::Response(Response::Position(response)) => {
                let ([a, b], [c, d]) = (
                    response.position().count().to_le_bytes(),
                    response.position().rotation().to_le_bytes(),
                );
                tally.add(response.id().get(), Some([a, b, c, d]));
            }
        }
    }
}

impl Sample for &ucp::Frame {
    #[inline]
    fn add_to(&self, tally: &mut Tally) {
        tally.add(self.id(), self.body().first_chunk::<4>().copied());
    }
}

/// Decodes a complete slice in a loop.
pub fn frames<F>(bytes: &[u8]) -> Tally
where
    F: Framing,
    for<'a> F::Frame<'a>: Sample,
{
    whole::<F>(bytes, |frames, tally| {
        for frame in frames {
            frame.add_to(tally);
        }
    })
}

/// The same with `Frames::each`.
pub fn each<F>(bytes: &[u8]) -> Tally
where
    F: Framing,
    for<'a> F::Frame<'a>: Sample,
{
    whole::<F>(bytes, |frames, tally| frames.each(|frame| frame.add_to(tally)))
}

/// Takes all frames, including those inside candidates truncated by the end.
#[inline(always)]
fn whole<F: Framing>(bytes: &[u8], take: impl Fn(&mut Frames<'_, F>, &mut Tally)) -> Tally {
    let mut tally = Tally::default();
    let mut frames = Frames::<F>::new(bytes);
    loop {
        take(&mut frames, &mut tally);
        if frames.rest().is_empty() {
            return tally;
        }
        frames.idle();
    }
}

/// Decodes a stream that arrives in pieces of `chunk` bytes and then ends.
pub fn decoder<F, const N: usize>(bytes: &[u8], chunk: usize) -> Tally
where
    F: Framing,
    for<'a> F::Frame<'a>: Sample,
{
    let mut tally = Tally::default();
    let mut decoder = Decoder::<F, N>::new();
    for mut piece in bytes.chunks(chunk) {
        while let Some(event) = decoder.decode(&mut piece) {
            if let Event::Frame(frame) = event {
                frame.add_to(&mut tally);
            }
        }
    }
    finish(decoder, &mut tally);
    tally
}

/// Decodes a stream that arrives byte by byte and then ends.
pub fn pushed<F, const N: usize>(bytes: &[u8]) -> Tally
where
    F: Framing,
    for<'a> F::Frame<'a>: Sample,
{
    let mut tally = Tally::default();
    let mut decoder = Decoder::<F, N>::new();
    for &byte in bytes {
        if decoder.push(byte) {
            drain(&mut decoder, &mut tally);
        }
    }
    finish(decoder, &mut tally);
    tally
}

/// Searches the bytes still held, as after silence on the line.
fn finish<F, const N: usize>(mut decoder: Decoder<F, N>, tally: &mut Tally)
where
    F: Framing,
    for<'a> F::Frame<'a>: Sample,
{
    while decoder.pending() > 0 {
        decoder.idle();
        drain(&mut decoder, tally);
    }
}

/// Takes all pending events. Inlined, like a loop in user code.
#[inline(always)]
fn drain<F, const N: usize>(decoder: &mut Decoder<F, N>, tally: &mut Tally)
where
    F: Framing,
    for<'a> F::Frame<'a>: Sample,
{
    while let Some(event) = decoder.poll() {
        if let Event::Frame(frame) = event {
            frame.add_to(tally);
        }
    }
}

/// End offsets of the frames that [`frames`] finds.
pub fn frame_ends<F: Framing>(bytes: &[u8]) -> Vec<usize> {
    let mut ends = Vec::new();
    let mut frames = Frames::<F>::new(bytes);
    loop {
        while frames.next().is_some() {
            ends.push(bytes.len() - frames.rest().len());
        }
        if frames.rest().is_empty() {
            return ends;
        }
        frames.idle();
    }
}

/// Like [`frames`] for UCP, but unpacks every report into native numbers.
#[must_use]
pub fn reports(bytes: &[u8]) -> Tally {
    let mut tally = Tally::default();
    for frame in Frames::<ucp::Ucp>::new(bytes) {
        match frame.message() {
            ucp::Message::Report(report) => {
                let telemetry = std::hint::black_box(report.telemetry());
                let ([a, b], [c, d]) =
                    (telemetry.battery_pct.to_le_bytes(), telemetry.rpm[0].to_le_bytes());
                tally.add(frame.id(), Some([a, b, c, d]));
            }
            _ => frame.add_to(&mut tally),
        }
    }
    tally
}
