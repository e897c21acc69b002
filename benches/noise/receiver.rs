//! The receivers that are compared: the ways to decode with the library, and a plain one.

use axlewire::{
    ikeya::{self, three},
    stream::{Decoder, Event, Frames},
    ucp::{self, Ucp},
};

use super::{
    known_framings::Known,
    noisy_line::Place,
    oracle::{self, Rules},
    traffic::Traffic,
};

/// A way to find the frames of a stream.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub(super) enum Receiver {
    /// The iterator over a slice.
    Frames,
    /// Its method for all frames at once.
    Each,
    /// The decoder of streams, given so many bytes at a time.
    Decoder(usize),
    /// The same, given byte by byte as from an interrupt.
    Pushed,
    /// Not of the library: the usual receiver of firmware.
    Plain,
}

impl Receiver {
    pub(super) const ALL: [Self; 8] = [
        Self::Frames,
        Self::Each,
        Self::Decoder(1),
        Self::Decoder(7),
        Self::Decoder(64),
        Self::Decoder(4096),
        Self::Pushed,
        Self::Plain,
    ];

    /// The title of its column.
    pub(super) fn title(self) -> String {
        match self {
            Self::Frames => "Frames".to_owned(),
            Self::Each => "each".to_owned(),
            Self::Decoder(chunk) => format!("by {chunk}"),
            Self::Pushed => "pushed".to_owned(),
            Self::Plain => "plain".to_owned(),
        }
    }

    /// Whether it is a decoder of the library.
    pub(super) fn is_ours(self) -> bool {
        self != Self::Plain
    }

    /// The frames of a stream, in the order in which they are delivered. The line is quiet behind
    /// the last byte.
    pub(super) fn receive(self, traffic: Traffic, bytes: &[u8]) -> Vec<Place> {
        match traffic {
            Traffic::Ucp | Traffic::UcpToRobot => {
                self.decode::<Ucp, { ucp::MAX_LEN }>(traffic, bytes)
            }
            Traffic::Ikeya => self.decode::<ikeya::ToMaster, { ikeya::MAX_LEN }>(traffic, bytes),
            Traffic::IkeyaRequests => {
                self.decode::<ikeya::ToSlave, { ikeya::MAX_LEN }>(traffic, bytes)
            }
            Traffic::Ikeya3 => self.decode::<three::ToMaster, { three::MAX_LEN }>(traffic, bytes),
        }
    }

    fn decode<F: Known, const N: usize>(self, traffic: Traffic, bytes: &[u8]) -> Vec<Place> {
        let mut found = Found { bytes, at: 0, places: Vec::new() };
        match self {
            Self::Frames => iterate::<F>(&mut found),
            Self::Each => take_each::<F>(&mut found),
            Self::Decoder(chunk) => decode_chunks::<F, N>(chunk, &mut found),
            Self::Pushed => push::<F, N>(&mut found),
            Self::Plain => receive_plainly(traffic.rules(), &mut found),
        }
        found.places
    }
}

/// What was delivered.
struct Found<'i> {
    bytes: &'i [u8],
    /// End of the last frame or gap of a decoder.
    at: usize,
    places: Vec<Place>,
}

/// The place of a frame whose bytes are not those of the stream.
const NOWHERE: usize = usize::MAX;

impl Found<'_> {
    /// A frame borrowed from the stream, at its address.
    fn borrowed(&mut self, frame: &[u8]) {
        let at = frame.as_ptr().addr().wrapping_sub(self.bytes.as_ptr().addr());
        self.add(at, frame);
    }

    /// A frame or gap of a decoder: the next bytes of the stream.
    fn next<F: Known>(&mut self, event: Event<F::Frame<'_>>) {
        match event {
            Event::Skipped(gap) => self.at += gap.len as usize,
            Event::Frame(frame) => {
                self.add(self.at, F::bytes(&frame));
                self.at += F::bytes(&frame).len();
            }
        }
    }

    fn add(&mut self, at: usize, frame: &[u8]) {
        let is_there = self.bytes.get(at..).is_some_and(|bytes| bytes.starts_with(frame));
        self.places.push((if is_there { at } else { NOWHERE }, frame.len()));
    }
}

fn iterate<F: Known>(found: &mut Found) {
    let mut frames = Frames::<F>::new(found.bytes);
    loop {
        for frame in frames.by_ref() {
            found.borrowed(F::bytes(&frame));
        }
        if frames.rest().is_empty() {
            return;
        }
        frames.idle();
    }
}

fn take_each<F: Known>(found: &mut Found) {
    let mut frames = Frames::<F>::new(found.bytes);
    loop {
        frames.each(|frame| found.borrowed(F::bytes(&frame)));
        if frames.rest().is_empty() {
            return;
        }
        frames.idle();
    }
}

fn decode_chunks<F: Known, const N: usize>(chunk: usize, found: &mut Found) {
    let mut decoder = Decoder::<F, N>::new();
    for mut input in found.bytes.chunks(chunk) {
        while let Some(event) = decoder.decode(&mut input) {
            found.next::<F>(event);
        }
    }
    quiet(&mut decoder, found);
}

fn push<F: Known, const N: usize>(found: &mut Found) {
    let mut decoder = Decoder::<F, N>::new();
    for &byte in found.bytes {
        if decoder.push(byte) {
            while let Some(event) = decoder.poll() {
                found.next::<F>(event);
            }
        }
    }
    quiet(&mut decoder, found);
}

/// The line goes quiet, and remains so.
fn quiet<F: Known, const N: usize>(decoder: &mut Decoder<F, N>, found: &mut Found) {
    while decoder.pending() > 0 {
        decoder.idle();
        while let Some(event) = decoder.poll() {
            found.next::<F>(event);
        }
    }
}

/// A state machine for one byte at a time, as firmware often has it: it waits for a header,
/// collects as many bytes as the header announces and checks them. It drops a bad frame whole, and
/// likewise the start of an impossible one, and waits for the next header.
fn receive_plainly(rules: Rules, found: &mut Found) {
    let (mut frame, mut announced, bytes) = (Vec::new(), None, found.bytes);
    for (at, &byte) in bytes.iter().enumerate() {
        frame.push(byte);
        if announced.is_none() {
            match oracle::promised_len(rules, &frame) {
                Ok(len) => announced = len,
                Err(_) => frame.clear(),
            }
        }
        if announced != Some(frame.len()) {
            continue;
        }
        let (body, crc) = frame.split_at(frame.len() - 2);
        let is_node = matches!(rules, Rules::Ucp { .. }) || (1..=8).contains(&body[1]);
        if oracle::crc(body).to_le_bytes() == crc && is_node {
            found.add(at + 1 - frame.len(), &frame);
        }
        frame.clear();
        announced = None;
    }
}
