//! Calls everything in the crate with values unknown to the compiler, and links only if no panic is
//! reachable: see `on_panic!` and `no_panic.sh`. It is never run.
//!
//! Objects are opaque too, not only arguments: the proof holds in any state, even an impossible
//! one. `Debug` and `Display`, whose panics are those of `core::fmt`, and the async calls are left
//! out.

#![no_std]
#![no_main]

mod drivers;
mod roles;
mod streams;
mod values;

use core::hint::black_box;

use axlewire::time::{Duration, Instant};

axlewire_firmware::on_panic!();

#[cortex_m_rt::entry]
fn main() -> ! {
    values::all();
    streams::all();
    roles::all();
    drivers::all();
    loop {
        cortex_m::asm::wfi();
    }
}

/// A value of this type that the compiler cannot predict.
fn any<T>(value: T) -> T {
    black_box(value)
}

/// Makes the compiler compute a value.
fn keep<T>(value: T) {
    black_box(value);
}

/// Any number of arbitrary bytes.
fn input() -> &'static [u8] {
    any(&[])
}

/// Room for any number of bytes, including zero.
fn room(buffer: &mut [u8; 300]) -> &mut [u8] {
    buffer.get_mut(..any(0)).unwrap_or_default()
}

/// An arbitrary time, before or after any other.
fn now() -> Instant {
    Instant::from_micros(any(0))
}

fn duration() -> Duration {
    Duration::from_micros(any(0))
}
