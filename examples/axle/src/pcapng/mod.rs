//! Captures with times: the part of pcapng that a serial line needs, and classic pcap to read.
//!
//! A file is a sequence of blocks: a section header, then one description per interface, then the
//! packets. What `axle record` writes: one section, one interface with the name of the port, the
//! protocol as its description, the baud rate as its speed and microseconds as its unit of time;
//! one packet per frame, and one or more per run of bytes between frames.
//!
//! Read and written by hand. `pcap-parser` 0.17 reads no binary unit of time, takes a big-endian
//! offset for a little-endian one, reads options behind their end mark, has no packets of the
//! obsolete block, drops what is left of a packet that the file cuts off, and fails when a signal
//! interrupts a read; another crate takes every unit for nanoseconds. To write files, one pulls in
//! a second `syn`, the other `futures`. Format: draft-ietf-opsawg-pcapng.

#[cfg(not(target_family = "wasm"))]
mod background;
mod classic;
mod format;
#[cfg(not(target_family = "wasm"))]
mod keeper;
mod read;
#[cfg(not(target_family = "wasm"))]
mod recording;
mod write;

#[cfg(not(target_family = "wasm"))]
pub(crate) use background::Background;
pub(crate) use classic::is_capture;
pub(crate) use format::{Direction, link_type, protocol_of};
pub(crate) use read::{LATEST_US, Packet, Reader};
#[cfg(not(target_family = "wasm"))]
pub(crate) use recording::{MOST_IN_MEMORY, Recording, Rotation, Stamp};
pub(crate) use write::Writer;

#[cfg(test)]
mod tests;
