//! Decoders of every protocol, called in any order.

use axlewire::{
    ikeya::{self, three},
    stream::{Decoder, Event, Frames, Framing},
    ucp::Ucp,
};

use crate::{any, input, keep, room};

pub fn all() {
    both::<ikeya::ToSlave, 8>();
    both::<ikeya::ToMaster, 8>();
    both::<ikeya::BothDirections, 64>();
    both::<three::ToSlave, 16>();
    both::<three::ToMaster, 16>();
    both::<three::BothDirections, 64>();
    both::<Ucp, 64>();
    both::<Ucp<252>, 256>();
}

fn both<F: Framing, const N: usize>() {
    slice::<F>();
    stream::<F, N>();
}

#[inline(never)]
fn slice<F: Framing>() {
    let mut frames = any(Frames::<F>::new(input()));
    while any(true) {
        for frame in frames.by_ref() {
            keep(frame);
        }
        frames.idle();
        keep((frames.rest(), frames.counters()));
    }
}

#[inline(never)]
fn stream<F: Framing, const N: usize>() {
    let mut decoder = any(Decoder::<F, N>::new());
    let mut input = input();
    while any(true) {
        match any(0) {
            0 => keep(decoder.decode(&mut input).map(event::<F>)),
            1 => keep(decoder.push(any(0))),
            2 => keep(decoder.poll().map(event::<F>)),
            3 => fill(decoder.spare()),
            4 => decoder.commit(any(0)),
            5 => decoder.idle(),
            _ => keep((decoder.pending(), decoder.received())),
        }
    }
    let counters = decoder.counters();
    keep((counters.skipped(), counters));
}

fn event<F: Framing>(event: Event<F::Frame<'_>>) {
    match event {
        Event::Frame(frame) => keep(frame),
        Event::Skipped(gap) => keep((gap.reason.name(), gap.len)),
    }
}

/// Writes as a port does, up to any length.
fn fill(spare: &mut [u8]) {
    let mut buffer = [0; 300];
    for (slot, byte) in spare.iter_mut().zip(room(&mut buffer)) {
        *slot = any(*byte);
    }
}
