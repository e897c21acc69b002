//! The measured code. Each function reads part of every frame, so that no work is optimized away.

use axlewire::{
    endpoint::Endpoint,
    ikeya::{Response, ToMaster},
    stream::{Decoder, Event, Frames, Framing},
    time::Instant,
    ucp::{Frame, Ucp},
};

/// Adds up the answers in a slice.
pub fn ikeya_slice(bytes: &[u8]) -> u32 {
    Frames::<ToMaster>::new(bytes).map(read_response).fold(0, u32::wrapping_add)
}

/// Adds up the UCP frames in a slice.
pub fn ucp_slice(bytes: &[u8]) -> u32 {
    Frames::<Ucp>::new(bytes).map(read_frame).fold(0, u32::wrapping_add)
}

/// Hands one byte to a decoder of the bus, as a receive interrupt does.
pub fn ikeya_byte(decoder: &mut Decoder<ToMaster, 8>, byte: u8) -> u32 {
    if decoder.push(byte) { read_all(decoder, read_response) } else { 0 }
}

/// Hands one byte to a UCP decoder, as a receive interrupt does.
pub fn ucp_byte(decoder: &mut Decoder<Ucp, 64>, byte: u8) -> u32 {
    if decoder.push(byte) { read_all(decoder, read_frame) } else { 0 }
}

/// Main loop part; separate, so that it does not use up the interrupt's registers.
#[inline(never)]
fn read_all<F: Framing, const N: usize>(
    decoder: &mut Decoder<F, N>,
    read: impl Fn(F::Frame<'_>) -> u32,
) -> u32 {
    let mut sum = 0;
    while let Some(event) = decoder.poll() {
        if let Event::Frame(frame) = event {
            sum += read(frame);
        }
    }
    sum
}

/// Drives a role as its loop does, for the size of all code that it needs.
pub fn drive<E: Endpoint>(role: &mut E, bytes: &[u8], now: Instant) -> u32 {
    role.handle_input(bytes, now);
    role.handle_timeout(now);
    while let Some(event) = role.poll_event() {
        core::hint::black_box(&event);
    }
    while let Some(frame) = role.poll_transmit(now) {
        core::hint::black_box(frame);
    }
    role.poll_timeout().map_or(0, |at| at.as_micros() as u32)
}

/// The id and one word of payload.
#[inline]
fn read_response(response: Response<'_>) -> u32 {
    let (id, bits) = match response {
        Response::Velocity(velocity) => (velocity.id(), velocity.rps().to_bits()),
        Response::Position(position) => (position.id(), u32::from(position.as_bytes()[2])),
    };
    bits.wrapping_add(id as u32)
}

/// The id and one byte of the body.
#[inline]
fn read_frame(frame: &Frame) -> u32 {
    u32::from(frame.id()) + frame.body().first().map_or(0, |&byte| byte.into())
}
