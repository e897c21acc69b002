//! The events of one stream of bytes, as lines.

use std::{
    collections::{BTreeSet, VecDeque},
    rc::Rc,
};

use axlewire::{
    ikeya::NodeId,
    stream::{Counters, Decoder, Event, Framing},
};

use crate::{
    args::Protocol,
    kept::Kept,
    listing::{LineClock, Modes, Out, Place, Shown, SkippedBytes, Style, Table},
    pcapng::Direction,
    tables::Tables,
};

/// Length of the longest frame of any protocol.
pub(crate) const BUFFER_LEN: usize = axlewire::ucp::MAX_LEN;

/// Where the frames go: the lines of a listing, with what they need to know of the lines
/// before; a table of counts; the frames themselves.
pub(crate) struct Sheet {
    /// `None` if no lines are wanted.
    pub(crate) style: Option<Style>,
    pub(crate) out: Out,
    clock: LineClock,
    /// What each line is about, if that is wanted.
    pub(crate) marks: Option<Vec<Mark>>,
    /// Modes of the nodes on the line whose bytes are fed.
    pub(crate) modes: Modes,
    /// The frames themselves, if they are wanted, and the nodes that changed their modes
    /// meanwhile.
    pub(crate) taken: Option<(Vec<Taken>, BTreeSet<NodeId>)>,
    /// Their counts, if they are wanted.
    pub(crate) table: Option<Table>,
    /// Frames and gaps as rows of typed columns, if they are wanted.
    pub(crate) tables: Option<Tables>,
    /// All of them close together, if they are wanted.
    pub(crate) kept: Option<Kept>,
    /// How many more frames are wanted, if not all.
    pub(crate) wanted: Option<u64>,
}

/// What a line of a sheet is about.
#[derive(Clone, Copy, Debug)]
#[cfg_attr(not(feature = "mcap"), expect(dead_code, reason = "only MCAP has topics"))]
pub(crate) struct Mark {
    /// Where the line ends in [`Sheet::out`].
    pub(crate) end: usize,
    pub(crate) at: Place,
    /// `None` for a gap.
    pub(crate) protocol: Option<Protocol>,
    /// Name of the message; `skipped` for a gap.
    pub(crate) message: &'static str,
}

/// A frame of a capture.
#[derive(Clone, Debug)]
pub(crate) struct Taken {
    pub(crate) micros: Option<u64>,
    /// As seen by the program that has recorded it.
    pub(crate) direction: Option<Direction>,
    pub(crate) bytes: Box<[u8]>,
    /// The node whose mode says how to read it, if there is one.
    pub(crate) commands: Option<NodeId>,
}

impl Sheet {
    pub(crate) fn new(style: Option<Style>) -> Self {
        Self {
            style,
            out: Out::default(),
            clock: LineClock::default(),
            marks: None,
            modes: Modes::default(),
            taken: None,
            table: None,
            tables: None,
            kept: None,
            wanted: None,
        }
    }

    /// What follows is of the line with this name.
    pub(super) fn turn_to(&mut self, line: &Rc<str>) {
        if let Some(tables) = &mut self.tables {
            tables.turn_to(line);
        }
    }

    /// Whether no more frames are wanted.
    pub(crate) fn is_full(&self) -> bool {
        self.wanted == Some(0)
    }

    /// Whether only the account of the bytes is wanted.
    const fn is_blank(&self) -> bool {
        self.style.is_none()
            && self.taken.is_none()
            && self.table.is_none()
            && self.tables.is_none()
            && self.kept.is_none()
            && self.wanted.is_none()
    }

    /// Takes in a gap.
    pub(crate) fn gap(&mut self, at: Place, gap: &SkippedBytes) {
        if let Some(kept) = &mut self.kept {
            kept.gap(at, gap);
        }
        if let Some(tables) = &mut self.tables {
            tables.gap(at, gap);
        }
        if let Some(style) = self.style {
            style.gap(&mut self.out, &mut self.clock, at, gap);
        }
        if let Some(marks) = &mut self.marks {
            let end = self.out.0.len();
            marks.push(Mark { end, at, protocol: None, message: "skipped" });
        }
    }

    fn take<S: Shown>(&mut self, at: Place, frame: &S) {
        if let Some(kept) = &mut self.kept {
            kept.frame(at, frame, &self.modes);
        }
        if let Some(style) = self.style {
            style.frame(&mut self.out, &mut self.clock, at, frame, &self.modes);
        }
        if let Some(marks) = &mut self.marks {
            let (end, protocol, message) = (self.out.0.len(), Some(S::PROTOCOL), frame.name());
            marks.push(Mark { end, at, protocol, message });
        }
        if let Some(table) = &mut self.table {
            table.count_in(frame, &self.modes);
        }
        if let Some(tables) = &mut self.tables {
            tables.frame(at, frame, &self.modes);
        }
        let before = self.modes;
        frame.teach(&mut self.modes);
        if let Some((taken, turned)) = &mut self.taken {
            let (micros, bytes) = (at.micros, frame.bytes().into());
            let (direction, commands) = (at.direction, frame.commands());
            taken.push(Taken { micros, direction, bytes, commands });
            turned.extend(before.conflict(&self.modes));
        }
        if let Some(wanted) = &mut self.wanted {
            *wanted -= 1;
        }
    }
}

/// The bytes of one interface in one direction.
pub(crate) trait Stream {
    /// Lists the events in `bytes`, all of which had been received at this time.
    fn feed(&mut self, bytes: &[u8], micros: Option<u64>, sheet: &mut Sheet);

    /// Lists what is left: nothing will follow.
    fn finish(&mut self, sheet: &mut Sheet);

    fn counters(&self) -> Counters;
}

/// A stream of frames that this framing finds.
pub(crate) struct StreamOf<F> {
    decoder: Decoder<F, BUFFER_LEN>,
    /// Offset of its first byte.
    first: u64,
    /// Place of the next event; only its offset changes.
    place: Place,
    /// The last gap, held back: at the end of the input a second gap may follow directly, and the
    /// two are printed as one.
    gap: Option<(Place, SkippedBytes)>,
    /// The account at the end of the gap before.
    booked: Counters,
    /// End and time of the chunks that the next events may end in.
    chunks: VecDeque<(u64, u64)>,
}

impl<F> StreamOf<F>
where
    F: Framing,
    for<'a> F::Frame<'a>: Shown,
{
    /// A stream whose first byte has this offset.
    pub(super) fn new(offset: u64) -> Self {
        Self::at(Place { offset, ..Place::default() })
    }

    /// A stream whose first byte is at this place; its time does not matter.
    pub(super) fn at(place: Place) -> Self {
        let (decoder, booked) = (Decoder::new(), Counters::default());
        Self { decoder, first: place.offset, place, gap: None, booked, chunks: VecDeque::new() }
    }

    fn drain(&mut self, bytes: &mut &[u8], sheet: &mut Sheet) {
        while !sheet.is_full() {
            let Some(event) = self.decoder.decode(bytes) else { break };
            match event {
                Event::Skipped(gap) => {
                    let at = place_of(&mut self.place, &mut self.chunks, gap.len);
                    let account = self.decoder.counters();
                    let skipped = SkippedBytes {
                        length: gap.len,
                        reason: gap.reason,
                        account: skipped_since(&self.booked, &account),
                    };
                    self.booked = account;
                    match &mut self.gap {
                        Some((held_at, held)) => {
                            held_at.micros = at.micros;
                            held.length += skipped.length;
                            held.account += skipped.account;
                        }
                        None => self.gap = Some((at, skipped)),
                    }
                }
                Event::Frame(frame) => {
                    if let Some((at, gap)) = self.gap.take() {
                        sheet.gap(at, &gap);
                    }
                    let length = frame.bytes().len() as u64;
                    let at = place_of(&mut self.place, &mut self.chunks, length);
                    if !sheet.is_blank() {
                        sheet.take(at, &frame);
                    }
                }
            }
        }
    }
}

impl<F> Stream for StreamOf<F>
where
    F: Framing,
    for<'a> F::Frame<'a>: Shown,
{
    fn feed(&mut self, bytes: &[u8], micros: Option<u64>, sheet: &mut Sheet) {
        if let Some(micros) = micros {
            let end = self.first + self.decoder.received() + bytes.len() as u64;
            self.chunks.push_back((end, micros));
        }
        self.drain(&mut &*bytes, sheet);
        // The next event ends with the last decided byte at the earliest. A gap may be endless, so
        // what is before is not kept.
        let decided = self.first + self.decoder.received() - self.decoder.pending() as u64;
        forget_before(&mut self.chunks, decided);
    }

    fn finish(&mut self, sheet: &mut Sheet) {
        if sheet.is_full() {
            // What is pending might be one frame more.
            return;
        }
        // Each call rejects a truncated frame and continues the search inside it, so that a frame
        // behind a false header is still found (ruling B3).
        loop {
            self.decoder.idle();
            self.drain(&mut &[][..], sheet);
            if self.decoder.pending() == 0 {
                break;
            }
        }
        if let Some((at, gap)) = self.gap.take() {
            sheet.gap(at, &gap);
        }
    }

    fn counters(&self) -> Counters {
        self.decoder.counters()
    }
}

/// The place of the next event, with the time of its last byte; moves on behind it.
fn place_of(next: &mut Place, chunks: &mut VecDeque<(u64, u64)>, length: u64) -> Place {
    let mut place = *next;
    next.offset += length;
    forget_before(chunks, next.offset);
    place.micros = chunks.front().map(|&(_, micros)| micros);
    place
}

/// Drops the chunks in which no later event can end: the next ends at this offset or after it.
fn forget_before(chunks: &mut VecDeque<(u64, u64)>, offset: u64) {
    while chunks.front().is_some_and(|&(end, _)| end < offset) {
        chunks.pop_front();
    }
}

/// The account of the bytes skipped in between.
fn skipped_since(before: &Counters, now: &Counters) -> Counters {
    let mut since = Counters::default();
    since.header = now.header - before.header;
    since.length = now.length - before.length;
    since.id = now.id - before.id;
    since.crc = now.crc - before.crc;
    since.idle = now.idle - before.idle;
    since
}
