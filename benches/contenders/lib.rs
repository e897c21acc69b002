//! Code shared by the benchmarks: byte streams to decode, the decoders of axlewire, C and other
//! crates behind one signature, and a slow oracle for the contents of a stream.
//!
//! `cargo bench` measures; with `-- --test` it runs each benchmark once, which checks all answers.

pub mod figures;
pub mod oracle;
pub mod ours;
pub mod peers;
pub mod race;
pub mod reference;
pub mod streams;

use axlewire::{ikeya, ucp};

/// The result of a decoder, for comparing decoders of the same bytes.
#[derive(Clone, Copy, Debug, Default, Eq, PartialEq)]
#[repr(C)]
pub struct Tally {
    /// Number of frames.
    pub frames: u64,
    /// Sum over their contents, so that no decoder can skip handing them out: the id of every
    /// frame, and its first four payload bytes as a number if it has as many.
    pub sum: u64,
}

impl Tally {
    // The C reference also adds inline.
    #[inline]
    fn add(&mut self, id: u8, payload: Option<[u8; 4]>) {
        let number = payload.map_or(0, u32::from_le_bytes);
        self.frames += 1;
        self.sum = self.sum.wrapping_add(id.into()).wrapping_add(number.into());
    }
}

/// One protocol with all of its decoders.
#[derive(Clone, Copy, Debug)]
pub struct Protocol {
    /// Name for reports.
    pub name: &'static str,
    /// `axlewire::stream::Frames` over the whole slice, in a loop.
    pub frames: fn(&[u8]) -> Tally,
    /// `axlewire::stream::Frames::each`.
    pub each: fn(&[u8]) -> Tally,
    /// `axlewire::stream::Decoder`, fed with chunks of this many bytes.
    pub decoder: fn(&[u8], usize) -> Tally,
    /// The same, with each byte pushed as by a receive interrupt.
    pub pushed: fn(&[u8]) -> Tally,
    /// The C receiver with the two-table CRC.
    pub c_table: fn(&[u8]) -> Tally,
    /// The C receiver with the bitwise CRC.
    pub c_bitwise: fn(&[u8]) -> Tally,
    /// The true contents of the bytes.
    pub oracle: fn(&[u8]) -> Tally,
    /// End offsets of the frames that axlewire finds.
    pub frame_ends: fn(&[u8]) -> Vec<usize>,
    /// A frame to end a stream with.
    pub last_frame: fn() -> Vec<u8>,
}

/// Ikeya MD, both directions on one line.
pub const IKEYA: Protocol = Protocol {
    name: "Ikeya",
    frames: ours::frames::<ikeya::BothDirections>,
    each: ours::each::<ikeya::BothDirections>,
    decoder: ours::decoder::<ikeya::BothDirections, { ikeya::MAX_LEN }>,
    pushed: ours::pushed::<ikeya::BothDirections, { ikeya::MAX_LEN }>,
    c_table: reference::ikeya_table,
    c_bitwise: reference::ikeya_bitwise,
    oracle: oracle::ikeya,
    frame_ends: ours::frame_ends::<ikeya::BothDirections>,
    last_frame: streams::last_ikeya_frame,
};

/// UCP with the default cap of 64-byte frames.
pub const UCP: Protocol = Protocol {
    name: "UCP",
    frames: ours::frames::<ucp::Ucp>,
    each: ours::each::<ucp::Ucp>,
    decoder: ours::decoder::<ucp::Ucp, { ucp::MAX_LEN }>,
    pushed: ours::pushed::<ucp::Ucp, { ucp::MAX_LEN }>,
    c_table: reference::ucp_table,
    c_bitwise: reference::ucp_bitwise,
    oracle: oracle::ucp,
    frame_ends: ours::frame_ends::<ucp::Ucp>,
    last_frame: streams::last_ucp_frame,
};
