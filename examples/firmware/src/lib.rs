//! Code shared by the programs of this package.
//!
//! * `board`: clocks, pins and the two USARTs, set up once at the start;
//! * `clock`: microseconds, and sleeping until an event;
//! * `config`: how the roles are configured, on a board and in QEMU;
//! * `uart`: an interrupt-driven USART with one queue per direction;
//! * `text_line`: a line of text without `core::fmt`;
//! * `report`: what such a line tells of a role;
//! * `stack`: deepest use of the stack;
//! * `motor`, `rover`, `lag`: models of the driven hardware;
//! * `work`: the code that `bench` measures.
//!
//! All but the last need feature `board`.

#![no_std]

#[cfg(feature = "board")]
pub mod board;
#[cfg(feature = "board")]
pub mod clock;
#[cfg(feature = "board")]
pub mod config;
#[cfg(feature = "board")]
pub mod lag;
#[cfg(feature = "board")]
pub mod motor;
#[cfg(feature = "board")]
pub mod report;
#[cfg(feature = "board")]
pub mod rover;
#[cfg(feature = "board")]
pub mod stack;
#[cfg(feature = "board")]
pub mod text_line;
#[cfg(feature = "board")]
pub mod uart;
pub mod work;

/// A program built only for its size: it runs `$work`, a `fn(&[u8]) -> u32`, on bytes unknown to
/// the compiler.
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

/// Panic handler: halts the program.
///
/// With feature `no-panic` there is no handler: if a panic is reachable, the link fails because the
/// function `a_panic_can_be_reached` is missing.
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
/// A macro, because a handler defined in a library is linked into every program of the package.
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
