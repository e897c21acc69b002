//! A line that is listened to, for programs that are no command line.
//!
//! Made for the page of `examples/web`. It changes with the tool, without notice.

use axlewire::stream::Counters;

use crate::{
    args::Protocol,
    decode::{self, Sheet, Stream, shares},
    listing::{self, Style},
    pcapng::{Direction, Writer},
};

/// The frames and gaps of a line, as they come; and a recording of it.
#[allow(missing_debug_implementations, reason = "it has a stream")]
pub struct Listener {
    stream: Box<dyn Stream>,
    sheet: Sheet,
    writer: Writer,
}

impl Listener {
    /// Listens to a line of this protocol: `ucp`, `ikeya` or `ikeya-3`; `None` for another name.
    /// `port` and `baud` are for the recording.
    #[must_use]
    pub fn new(protocol: &str, port: &str, baud: u32) -> Option<Self> {
        let protocol = Protocol::named(protocol)?;
        Some(Self {
            stream: decode::stream_of(protocol, Direction::In),
            sheet: Sheet::new(Some(Style::Json)),
            writer: Writer::new(protocol, port, baud),
        })
    }

    /// Takes in bytes that had been received at this time, microseconds since 1970.
    pub fn receive(&mut self, bytes: &[u8], micros: u64) {
        if !bytes.is_empty() {
            self.stream.feed(bytes, Some(micros), &mut self.sheet);
            self.writer.packet(micros, Some(Direction::In), bytes);
        }
    }

    /// The lines since the last call, as those of `axle decode --json` of the recording.
    pub fn take_lines(&mut self) -> Vec<u8> {
        std::mem::take(&mut self.sheet.out.0)
    }

    /// What is new in the recording: append it to a pcapng file.
    pub fn take_recording(&mut self) -> Vec<u8> {
        std::mem::take(&mut self.writer.blocks)
    }

    /// The account of the bytes so far.
    #[must_use]
    pub fn account(&self) -> Counters {
        self.stream.counters()
    }
}

/// The last line of `axle decode --json`.
#[must_use]
pub fn summary(account: &Counters, times_back: u64) -> Vec<u8> {
    let mut out = listing::Out::default();
    listing::json_summary(&mut out, account, times_back);
    out.0
}

/// How many of these bytes belong to frames of each protocol, and how many frames: the most first.
#[must_use]
pub fn guess(bytes: &[u8]) -> [(&'static str, u64, u64); 3] {
    shares(bytes).map(|share| (share.protocol.name(), share.framed, share.frames))
}
