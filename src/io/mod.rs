//! Frames in and out of a port, over the traits of `embedded-io` and `embedded-io-async`.
//!
//! [`FrameReader`] and [`FrameWriter`] are thin: they move bytes between a port and the decoder or
//! a small buffer, and add no rules. Received bytes stay in the reader through read errors, end of
//! file and cancelled futures; unsent bytes stay in the writer.
//!
//! These have blocking calls; their namesakes in [`asynch`] have the same calls for async code
//! (feature `embedded-io-async`).
//!
//! ```
//! # #[cfg(feature = "ucp")] {
//! use axlewire::{io::{FrameReader, FrameWriter}, stream::Event, ucp::{message::Ping, Body, Ucp}};
//!
//! let mut line = [0; 16];
//! let mut writer = FrameWriter::<_, 64>::new(&mut line[..]);
//! writer.write(&Ping {}.frame(7))?;
//!
//! let mut reader = FrameReader::<_, Ucp, 64>::new(&line[..]);
//! let Some(Event::Frame(frame)) = reader.read_event()? else { panic!() };
//! assert_eq!((frame.id(), frame.index()), (1, 7));
//! # }
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

#[cfg(feature = "embedded-io-async")]
pub mod asynch;
mod calls;
mod error;
mod reader;
mod writer;

pub use error::WriteError;
pub use reader::FrameReader;
pub use writer::FrameWriter;
