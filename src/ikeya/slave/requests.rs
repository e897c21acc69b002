//! Finds requests in the received bytes, on four wires or on two (I14).

use crate::{
    ikeya::board::{Board, Heard, PACKET_LEN},
    inbox::{AfterIdle, Inbox},
    stream::{Counters, Decoder, Event},
    time::{Duration, Instant},
};

/// Finds requests and their ends.
#[derive(Clone, Debug)]
pub(super) struct Requests<B: Board> {
    inbox: Inbox,
    decoder: AnyDecoder<B>,
}

#[derive(Clone, Debug)]
enum AnyDecoder<B: Board> {
    /// Hears only the master.
    FourWire(Decoder<B::ToSlave, PACKET_LEN>),
    /// Hears the other slaves as well.
    TwoWire(Decoder<B::BothDirections, PACKET_LEN>),
}

/// A packet, and whether it ends with the last byte received.
pub(super) enum Found<B: Board> {
    Request { request: Heard<B>, is_last: bool },
    Answer,
}

impl<B: Board> Requests<B> {
    pub(super) const fn new(is_two_wire: bool, idle: Duration, now: Instant) -> Self {
        let decoder = if is_two_wire {
            AnyDecoder::TwoWire(Decoder::new())
        } else {
            AnyDecoder::FourWire(Decoder::new())
        };
        Self { inbox: Inbox::new(idle, AfterIdle::WaitAgain, now), decoder }
    }

    /// See [`Inbox::receive`].
    pub(super) const fn receive(&mut self, at: Instant, now: Instant) {
        self.inbox.receive(at, now);
    }

    /// See [`Inbox::settle`].
    pub(super) fn settle(&mut self, now: Instant) -> bool {
        let is_idle = self.inbox.settle(self.pending(), now);
        if is_idle {
            match &mut self.decoder {
                AnyDecoder::FourWire(decoder) => decoder.idle(),
                AnyDecoder::TwoWire(decoder) => decoder.idle(),
            }
        }
        is_idle
    }

    /// The next complete packet in the input.
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
                // Only bytes received before a packet are reported before it, so any pending bytes
                // came after it.
                Ok(Some(request)) => {
                    let is_last = bytes.is_empty() && self.pending() == 0;
                    return Some(Found::Request { request, is_last });
                }
                Ok(None) => return Some(Found::Answer),
                Err(()) => {}
            }
        }
    }

    /// Earliest time at which the newest byte may have arrived.
    pub(super) const fn last(&self) -> Instant {
        self.inbox.last()
    }

    /// Time at which a pending incomplete packet is given up.
    pub(super) fn deadline(&self) -> Option<Instant> {
        self.inbox.deadline(self.pending())
    }

    pub(super) const fn counters(&self) -> Counters {
        match &self.decoder {
            AnyDecoder::FourWire(decoder) => decoder.counters(),
            AnyDecoder::TwoWire(decoder) => decoder.counters(),
        }
    }

    const fn pending(&self) -> usize {
        match &self.decoder {
            AnyDecoder::FourWire(decoder) => decoder.pending(),
            AnyDecoder::TwoWire(decoder) => decoder.pending(),
        }
    }
}
