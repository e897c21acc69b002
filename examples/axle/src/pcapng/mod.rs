//! Captures with times: the part of pcapng that a serial line needs.
//!
//! A file is a sequence of blocks: a section header, then one description per interface, then the
//! packets. What `axle record` writes: one section, one interface with the name of the port, the
//! protocol as its description, the baud rate as its speed and microseconds as its unit of time;
//! one packet per frame, and one or more per run of bytes between frames.
//!
//! Written by hand: of two crates for pcapng, one takes every unit of time for nanoseconds, the
//! other reads no binary units and no big-endian offsets, and to write files one pulls in a second
//! `syn`, the other `futures`. Format: draft-ietf-opsawg-pcapng.

mod background;
mod format;
mod read;
mod recording;
mod write;

pub(crate) use background::Background;
pub(crate) use format::{Direction, MAGIC, link_type, protocol_of};
pub(crate) use read::{Packet, Reader};
pub(crate) use recording::{Recording, Stamp};
pub(crate) use write::Writer;

#[cfg(test)]
mod tests;
