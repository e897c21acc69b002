//! The frames and gaps of a whole capture, close together in memory: some 32 bytes for each, and
//! those of the frame. They are decoded again when somebody looks at them.

use axlewire::ikeya::Mode;

use crate::{
    args::Protocol,
    listing::{Modes, Place, Shown, SkippedBytes},
    pcapng::Direction,
};

/// Rows and bytes are in blocks: a growing `Vec` would need its memory twice.
const ROWS: usize = 1 << 16;
const BYTES: usize = 1 << 20;

/// Messages, by protocol and name; a gap has no protocol.
pub(crate) type Kind = (Option<Protocol>, &'static str);

/// All rows of a capture.
#[derive(Debug, Default)]
pub(crate) struct Kept {
    rows: Vec<Vec<Row>>,
    bytes: Vec<Vec<u8>>,
    gaps: Vec<SkippedBytes>,
    /// Those that occur.
    kinds: Vec<Kind>,
    /// The kind of the last row: the next is often of the same.
    last: usize,
    /// There was no memory for a row.
    pub(crate) is_full: bool,
}

/// A frame or a gap.
#[derive(Clone, Copy, Debug)]
struct Row {
    offset: u64,
    /// `u64::MAX` without a time.
    micros: u64,
    /// Where its bytes start: block and place; or which gap it is.
    start: (u16, u32),
    /// `u32::MAX` without an interface.
    interface: u32,
    len: u16,
    kind: u8,
    direction: Option<Direction>,
    mode: Option<Mode>,
}

/// What a row is.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Is<'a> {
    /// A frame, and the mode of the node that it commands.
    Frame(Protocol, &'a [u8], Option<Mode>),
    Gap(SkippedBytes),
}

impl Kept {
    /// Adds a frame. `modes` are those of the nodes in front of it.
    pub(crate) fn frame<S: Shown>(&mut self, at: Place, frame: &S, modes: &Modes) {
        let mode = frame.commands().and_then(|node| modes.of(node));
        let kind = (Some(S::PROTOCOL), frame.name());
        let added = self.keep(frame.bytes()).and_then(|start| {
            let len = frame.bytes().len().try_into().ok()?;
            self.push(at, kind, start, len, mode)
        });
        self.is_full |= added.is_none();
    }

    /// Adds a gap.
    pub(crate) fn gap(&mut self, at: Place, gap: &SkippedBytes) {
        let added = self.gaps.len().try_into().ok().and_then(|start| {
            self.gaps.try_reserve(1).ok()?;
            self.gaps.push(*gap);
            self.push(at, (None, "skipped"), (0, start), 0, None)
        });
        self.is_full |= added.is_none();
    }

    /// How many rows there are.
    pub(crate) fn len(&self) -> usize {
        self.rows.last().map_or(0, |last| (self.rows.len() - 1) * ROWS + last.len())
    }

    pub(crate) fn kinds(&self) -> &[Kind] {
        &self.kinds
    }

    /// The kind of a row: its number among all.
    pub(crate) fn kind(&self, row: usize) -> Option<usize> {
        self.row(row).map(|row| row.kind.into())
    }

    /// A row, and where it was.
    pub(crate) fn get(&self, row: usize) -> Option<(Place, Is<'_>)> {
        let row = self.row(row)?;
        let at = Place {
            offset: row.offset,
            micros: (row.micros != u64::MAX).then_some(row.micros),
            direction: row.direction,
            interface: (row.interface != u32::MAX).then_some(row.interface as usize),
        };
        let (block, start) = (usize::from(row.start.0), row.start.1 as usize);
        let (protocol, _) = self.kinds.get(usize::from(row.kind))?;
        let is = match protocol {
            None => Is::Gap(*self.gaps.get(start)?),
            Some(protocol) => {
                let bytes = self.bytes.get(block)?.get(start..start + usize::from(row.len))?;
                Is::Frame(*protocol, bytes, row.mode)
            }
        };
        Some((at, is))
    }

    fn row(&self, row: usize) -> Option<&Row> {
        self.rows.get(row / ROWS)?.get(row % ROWS)
    }

    /// Keeps the bytes of a frame, and returns where.
    fn keep(&mut self, frame: &[u8]) -> Option<(u16, u32)> {
        let has_room = |block: &Vec<u8>| block.len() + frame.len() <= BYTES;
        if !self.bytes.last().is_some_and(has_room) {
            add_block(&mut self.bytes, BYTES)?;
        }
        let number = (self.bytes.len() - 1).try_into().ok()?;
        let block = self.bytes.last_mut()?;
        let start = block.len().try_into().ok()?;
        block.extend_from_slice(frame);
        Some((number, start))
    }

    fn push(
        &mut self,
        at: Place,
        kind: Kind,
        start: (u16, u32),
        len: u16,
        mode: Option<Mode>,
    ) -> Option<()> {
        if self.kinds.get(self.last) != Some(&kind) {
            self.last = self.kinds.iter().position(|it| *it == kind).unwrap_or(self.kinds.len());
            if self.last == self.kinds.len() {
                self.kinds.push(kind);
            }
        }
        if self.rows.last().is_none_or(|block| block.len() == ROWS) {
            add_block(&mut self.rows, ROWS)?;
        }
        let row = Row {
            offset: at.offset,
            micros: at.micros.unwrap_or(u64::MAX),
            start,
            interface: at.interface.and_then(|it| it.try_into().ok()).unwrap_or(u32::MAX),
            len,
            kind: self.last.try_into().ok()?,
            direction: at.direction,
            mode,
        };
        self.rows.last_mut()?.push(row);
        Some(())
    }
}

/// Adds a block, unless there is no memory for it.
fn add_block<T>(blocks: &mut Vec<Vec<T>>, len: usize) -> Option<()> {
    let mut block = Vec::new();
    block.try_reserve_exact(len).ok()?;
    blocks.try_reserve(1).ok()?;
    blocks.push(block);
    Some(())
}
