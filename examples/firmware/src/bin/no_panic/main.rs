//! Calls everything in the crate with values that the compiler knows nothing about, and links only if
//! no panic can be reached: see `on_panic!` and `no_panic.sh`. It is never run.
//!
//! Objects are opaque as well, not only arguments: what is proved holds in any state, even in one
//! that cannot come about. Left out are `Debug` and `Display`, whose panics are those of `core::fmt`,
//! and the async calls.

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
    // The self test of the check: an index that may be out of bounds.
    #[cfg(feature = "planted-panic")]
    keep(input()[any(0)]);

    values::all();
    streams::all();
    roles::all();
    drivers::all();
    loop {
        cortex_m::asm::wfi();
    }
}

/// A value of this type: the compiler has to expect any.
fn any<T>(value: T) -> T {
    black_box(value)
}

/// Makes the compiler compute a value.
fn keep<T>(value: T) {
    black_box(value);
}

/// Bytes, any, and any number of them.
fn input() -> &'static [u8] {
    any(&[])
}

/// Room for any number of bytes, none included.
fn room(buffer: &mut [u8; 300]) -> &mut [u8] {
    buffer.get_mut(..any(0)).unwrap_or_default()
}

/// A time, before or after any other.
fn now() -> Instant {
    Instant::from_micros(any(0))
}

fn duration() -> Duration {
    Duration::from_micros(any(0))
}
