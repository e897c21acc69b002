//! Has a reachable panic, in `planted`, which `no_panic.sh --self-test` must find. It is never run.

#![no_std]
#![no_main]

use core::hint::black_box;

axlewire_firmware::on_panic!();

#[cortex_m_rt::entry]
fn main() -> ! {
    planted(black_box(&[]));
    loop {
        cortex_m::asm::wfi();
    }
}

/// Takes an index that may be out of bounds.
#[inline(never)]
fn planted(bytes: &[u8]) {
    black_box(bytes[black_box(0)]);
}
