//! Requests in the received bytes, on four wires or on two (I14).

use super::PACKET_LEN;
use crate::{
    ikeya::{Board, Heard},
    stream::{Counters, Decoder, Event},
};

/// Finds requests, and where they end.
#[derive(Clone, Debug)]
pub(super) struct Inbox<B: Board> {
    decoder: AnyDecoder<B>,
}

#[derive(Clone, Debug)]
enum AnyDecoder<B: Board> {
    /// Only the master is heard.
    FourWire(Decoder<B::ToSlave, PACKET_LEN>),
    /// The other slaves are heard as well.
    TwoWire(Decoder<B::Either, PACKET_LEN>),
}

/// A packet, and whether it ends with the last byte received.
pub(super) enum Found<B: Board> {
    Request { request: Heard<B>, is_last: bool },
    Answer,
}

impl<B: Board> Inbox<B> {
    pub(super) const fn new(two_wire: bool) -> Self {
        let decoder = if two_wire {
            AnyDecoder::TwoWire(Decoder::new())
        } else {
            AnyDecoder::FourWire(Decoder::new())
        };
        Self { decoder }
    }

    /// The next whole packet in the input.
    pub(super) fn next(&mut self, bytes: &mut &[u8]) -> Option<Found<B>> {
        loop {
            let found = match &mut self.decoder {
                AnyDecoder::FourWire(decoder) => match decoder.decode_buffered(bytes)? {
                    Event::Frame(frame) => Ok(Some(B::request(frame))),
                    Event::Skipped(_) => Err(()),
                },
                AnyDecoder::TwoWire(decoder) => match decoder.decode_buffered(bytes)? {
                    Event::Frame(frame) => Ok(B::packet(frame)),
                    Event::Skipped(_) => Err(()),
                },
            };
            match found {
                // Only what has been received in front of a packet is reported before it, so what is
                // pending came behind it.
                Ok(Some(request)) => {
                    let is_last = bytes.is_empty() && self.pending() == 0;
                    return Some(Found::Request { request, is_last });
                }
                Ok(None) => return Some(Found::Answer),
                Err(()) => {}
            }
        }
    }

    /// Received bytes that no packet or gap has been made of yet.
    pub(super) const fn pending(&self) -> usize {
        match &self.decoder {
            AnyDecoder::FourWire(decoder) => decoder.pending(),
            AnyDecoder::TwoWire(decoder) => decoder.pending(),
        }
    }

    /// The line has gone quiet.
    pub(super) fn idle(&mut self) {
        match &mut self.decoder {
            AnyDecoder::FourWire(decoder) => decoder.idle(),
            AnyDecoder::TwoWire(decoder) => decoder.idle(),
        }
    }

    pub(super) const fn counters(&self) -> Counters {
        match &self.decoder {
            AnyDecoder::FourWire(decoder) => decoder.counters(),
            AnyDecoder::TwoWire(decoder) => decoder.counters(),
        }
    }
}
