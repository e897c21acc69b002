//! What the programs of this package share.
//!
//! * `board`: clocks, pins and the two USARTs, put together once at the start;
//! * `clock`: microseconds, and sleeping until something happens;
//! * `uart`: an interrupt-driven USART with a queue each way;
//! * `line`: a line of text without `core::fmt`;
//! * `stack`: how deep the stack has been;
//! * `motor`, `rover`, `lag`: models of what the programs drive;
//! * `work`: what `bench` measures.
//!
//! All but the last need feature `board`.

#![no_std]

#[cfg(feature = "board")]
pub mod board;
#[cfg(feature = "board")]
pub mod clock;
#[cfg(feature = "board")]
pub mod lag;
#[cfg(feature = "board")]
pub mod line;
#[cfg(feature = "board")]
pub mod motor;
#[cfg(feature = "board")]
pub mod rover;
#[cfg(feature = "board")]
pub mod stack;
#[cfg(feature = "board")]
pub mod uart;
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

/// What a program does about a panic: it stops.
///
/// With feature `no-panic` there is none: where one can be reached, the link fails for want of a
/// function `a_panic_can_be_reached`.
#[macro_export]
macro_rules! on_panic {
    () => {
        #[cfg(not(feature = "no-panic"))]
        use panic_halt as _;

        #[cfg(feature = "no-panic")]
        #[panic_handler]
        fn on_panic(_: &core::panic::PanicInfo) -> ! {
            unsafe extern "C" {
                safe fn a_panic_can_be_reached() -> !;
            }
            a_panic_can_be_reached()
        }
    };
}

/// The two interrupts of a program that uses [`board`].
///
/// A macro, because a handler that stands in a library is linked into every program of the package.
#[cfg(feature = "board")]
#[macro_export]
macro_rules! serve_usarts {
    () => {
        use stm32f4::stm32f405::interrupt;

        #[interrupt]
        fn USART1() {
            $crate::board::BUS.serve();
        }

        #[interrupt]
        fn USART2() {
            $crate::board::TEXT.serve();
        }
    };
}
