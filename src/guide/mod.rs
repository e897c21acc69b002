//! The guide: from the first motor to a protocol of your own, in nine pages.
//!
//! Every example is run: the Rust code as tests of this crate, the `console` blocks by the tests of
//! the tool, which compare what is printed.
//!
//! 1. [Start on a PC](start_on_a_pc): the tool, a program, ports, permissions, latency.
//! 2. [Start on a board](start_on_a_board): a page of firmware, interrupts, DMA, RS485.
//! 3. [Ikeya](ikeya): four packets, a master, a loose plug.
//! 4. [UCP](ucp): frames, a host, a robot, two watchdogs, adding a message.
//! 5. [Streams and resync](streams): what a stray byte costs; the same for another protocol.
//! 6. [Timing](timing): how fast a bus can be, computed and then measured.
//! 7. [Recording and looking](recording): captures, and the tools that open them.
//! 8. [Diagnosis](diagnosis): which counter or error says what about cable, other end and program.
//! 9. [Safety](crate::safety): which hazards there are, and what is left to you.
//!
//! The page `fields` says what each field of the JSON means.

/// A page without code. Its examples need these features; its links do not.
macro_rules! pages {
    ($($name:ident: $feature:literal)*) => {$(
        #[cfg_attr(
            any(not(doctest), all(feature = "sim", feature = $feature)),
            doc = include_str!(concat!(stringify!($name), ".md"))
        )]
        pub mod $name {}
    )*};
}

pages! {
    start_on_a_pc: "serialport"
    start_on_a_board: "sim"
    ikeya: "sim"
    ucp: "sim"
    streams: "sim"
    timing: "sim"
    recording: "sim"
    diagnosis: "sim"
}
