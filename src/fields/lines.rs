//! The lines that are not frames: gaps, and what the tool says about a whole capture.

use crate::{
    field::{Field, field},
    record::Record,
    stream::Reason,
};

const REASONS: &[&str] = &[
    Reason::Header.name(),
    Reason::Length.name(),
    Reason::Id.name(),
    Reason::Crc.name(),
    Reason::Idle.name(),
];

const PROTOCOLS: &[&str] = &["ucp", "ikeya", "ikeya-3"];

/// Fields, each as for `field`.
macro_rules! fields {
    ($({$($field:tt)+})+) => {
        &[&[$(field! { $($field)+ }),+]]
    };
}

const SKIPPED: &[&[Field]] = fields! {
    {
        /// Length of a run of bytes that belong to no frame.
        "length": u64, "byte" by "B4", within(1, u64::MAX)
    }
    {
        /// Why its first byte was skipped.
        "reason": &str, by "B4", named(REASONS)
    }
    {
        /// Bytes by reason, if there are several reasons; only in the tool's output.
        "reasons": u64, "byte" by "B4", within(1, u64::MAX), object(REASONS), optional(), of_tool()
    }
};

const GUESSED: &[&[Field]] = fields! {
    {
        /// The protocol with the most bytes in its frames.
        "protocol": &str, by "tool", named(PROTOCOLS)
    }
    {
        /// Bytes that were looked at, from the beginning.
        "received": u64, "byte" by "tool", within(1, u64::MAX)
    }
    {
        /// How many of them are in frames of each protocol.
        "framed": u64, "byte" by "tool", object(PROTOCOLS)
    }
};

const SUMMARY: &[&[Field]] = fields! {
    {
        /// Length of the input.
        "received": u64, "byte" by "B2"
    }
    {
        /// Bytes in frames.
        "framed": u64, "byte" by "B2"
    }
    {
        /// Bytes in gaps.
        "skipped": u64, "byte" by "B2"
    }
    {
        /// Bytes not yet decided; 0 at the end of an input.
        "pending": u64, "byte" by "B2"
    }
    {
        /// Number of frames.
        "frames": u64, "frame" by "B2"
    }
    {
        /// Bytes in gaps by reason, without those that do not occur.
        "skipped_by": u64, "byte" by "B4", within(1, u64::MAX), object(REASONS)
    }
    {
        /// Packets with a time before that of the packet in front of them; only if there are any.
        "times_back": u64, "packet" by "tool", within(1, u64::MAX), optional()
    }
};

pub(super) const RECORDS: &[Record] = &[
    Record::line("skipped", SKIPPED),
    Record::line("protocol", GUESSED),
    Record::line("summary", SUMMARY),
];
