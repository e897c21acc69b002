//! Output records; the field names are those of the JSON.

pub(crate) mod ikeya;
pub(crate) mod ucp;

use core::fmt;

use axlewire::stream::{Counters, Reason};
use serde::{Serialize, Serializer};

/// One line of output.
#[derive(Debug, Serialize)]
#[serde(tag = "event", rename_all = "lowercase")]
pub(crate) enum Record<'a> {
    /// A complete frame with a correct CRC.
    Frame {
        offset: u64,
        #[serde(flatten)]
        frame: Frame<'a>,
    },
    /// A run of bytes that belong to no frame.
    Skipped { offset: u64, length: u64, reason: Reason },
    /// Byte counts.
    Summary(Summary),
}

/// A frame of either protocol.
#[derive(Debug, Serialize)]
#[serde(untagged)]
pub(crate) enum Frame<'a> {
    Ikeya(ikeya::Frame<'a>),
    Ucp(ucp::Frame<'a>),
}

impl Frame<'_> {
    /// Length on the wire, bytes.
    pub(crate) const fn length(&self) -> usize {
        match self {
            Self::Ikeya(frame) => frame.length,
            Self::Ucp(frame) => frame.length,
        }
    }
}

/// The last record of a listing.
#[derive(Debug, Serialize)]
pub(crate) struct Summary {
    pub(crate) received: u64,
    pub(crate) framed: u64,
    pub(crate) skipped: u64,
    pub(crate) pending: usize,
    pub(crate) frames: u64,
    /// Skipped bytes by reason, for the human-readable listing.
    #[serde(skip)]
    pub(crate) counters: Counters,
}

impl Summary {
    pub(crate) const fn new(counters: &Counters, pending: usize) -> Self {
        Self {
            received: counters.received,
            framed: counters.framed,
            skipped: counters.skipped(),
            pending,
            frames: counters.frames,
            counters: *counters,
        }
    }
}

/// Bytes as lower-case hex digits.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Hex<'a>(pub(crate) &'a [u8]);

impl fmt::Display for Hex<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.iter().try_for_each(|byte| write!(f, "{byte:02x}"))
    }
}

impl Serialize for Hex<'_> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
}
