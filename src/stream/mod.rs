//! Finds frames in a byte stream and accounts for every byte.
//!
//! A [`Framing`] defines what the frames of a protocol look like. [`Frames`] walks a slice that is
//! already in memory, as an iterator, or faster with [`each`](Frames::each). [`Decoder`] walks a
//! stream that arrives in pieces. Both use the same function to judge the front of the bytes, so
//! they cannot disagree.
//!
//! # Guarantees
//!
//! * **Resync (B2).** A candidate that fails costs exactly one byte, and the search goes on inside
//!   it, so a wrong length or a false header byte swallows nothing. Every frame that arrives whole
//!   is delivered, unless it overlaps one accepted before it. The price: a whole frame inside the
//!   payload of a *damaged* one is delivered, too.
//! * **Account (B2).** `received == framed + skipped + pending`, at any time.
//! * **Bounded stall (B3).** A false header byte delays good frames by at most [`Framing::MAX_LEN`]
//!   bytes, and [`Decoder::idle`] ends the delay when the line goes quiet.
//! * **Reasons (B4).** A gap is one [`Event::Skipped`] with the [`Reason`] of its first byte, and
//!   every skipped byte is counted under its own reason in [`Counters`].
//! * **Chunks do not matter.** The same bytes give the same events, however they are cut. Whole
//!   captures can be decoded in parallel: [`parts`].
//! * **Bounded work.** A byte is examined once for each candidate that it may belong to, at most
//!   `MAX_LEN` times; batches on a host add a bounded factor. Nothing allocates, nothing panics.

mod batch;
#[cfg(any(feature = "ikeya", feature = "ucp"))]
mod buffered;
#[cfg(feature = "alloc")]
mod capture;
mod decoder;
mod echo;
mod event;
mod fill;
mod frames;
mod framing;
mod ledger;
mod search;
mod split;

#[cfg(any(feature = "ikeya", feature = "ucp"))]
#[doc(hidden)]
pub use batch::Rejected;
#[cfg(all(test, feature = "std", any(feature = "ikeya", feature = "ucp")))]
pub(crate) use batch::tests::check_batches;
#[cfg(feature = "alloc")]
pub use capture::{Located, decode_capture};
pub use decoder::Decoder;
#[cfg(feature = "ucp")]
pub(crate) use decoder::Held;
pub use echo::Echo;
pub use event::Event;
pub use frames::Frames;
pub use framing::{Framing, Verdict};
pub use ledger::{Counters, Gap, Reason};
pub use split::{Parts, parts, split_point};
