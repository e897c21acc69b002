//! The guide: eleven short chapters, from the first motor to a protocol of your own.
//!
//! Read it in order, or jump to what you need. Every example runs: the Rust code as tests of this
//! crate, the commands by `tests/guide.py`, which compares what they print.
//!
//! 1. [Start on a PC](start_on_a_pc): turn a motor without hardware.
//! 2. [Start on a board](start_on_a_board): a motor node in twenty lines of firmware.
//! 3. [Ikeya in ten minutes](ikeya_in_ten_minutes): four packets, a master, a loose plug.
//! 4. [UCP in ten minutes](ucp_in_ten_minutes): frames, a host, a robot, two watchdogs.
//! 5. [Streams and resync](streams_and_resync): what a stray byte costs, and how to count it.
//! 6. [Timing](timing): how fast a bus can be, computed and then measured.
//! 7. [Staying safe](staying_safe): what a stop is worth, and how to test that it works.
//! 8. [Recording and looking](recording_and_looking): captures, and the tools that open them.
//! 9. [Your own framing](your_own_framing): the same resync for another protocol.
//! 10. [Adding a UCP message](adding_a_message): what you write, and what follows from it.
//! 11. [Moving from C](moving_from_c): their function, ours.
//!
//! The other pages are for looking things up: `porting` says what a board has to provide,
//! `on_a_pc` how serial ports and USB adapters behave, `safety` which hazards there are, `fields`
//! what each field means.

/// A chapter: a page without code. Its examples need the feature `sim`; its links do not.
macro_rules! chapters {
    ($($name:ident)*) => {$(
        #[cfg_attr(
            any(not(doctest), feature = "sim"),
            doc = include_str!(concat!(stringify!($name), ".md"))
        )]
        pub mod $name {}
    )*};
}

chapters! {
    start_on_a_pc
    start_on_a_board
    ikeya_in_ten_minutes
    ucp_in_ten_minutes
    streams_and_resync
    timing
    staying_safe
    recording_and_looking
    your_own_framing
    adding_a_message
    moving_from_c
}
