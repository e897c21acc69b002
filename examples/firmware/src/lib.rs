//! What the programs of this package share.

#![no_std]

pub mod work;

/// A program of which only the size matters: it does `$work`, a `fn(&[u8]) -> u32`, to bytes that
/// the compiler does not know.
#[macro_export]
macro_rules! size_program {
    ($work:expr) => {
        use panic_halt as _;

        static INPUT: [u8; 64] = [0; 64];

        #[cortex_m_rt::entry]
        fn main() -> ! {
            loop {
                let bytes = core::hint::black_box(&INPUT[..]);
                core::hint::black_box(($work)(bytes));
            }
        }
    };
}
