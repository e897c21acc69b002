//! Finds frames in a byte stream and accounts for every byte.
//!
//! A [`Framing`] knows how one protocol's frames look; [`Frames`] walks a slice that is already in
//! memory, [`Decoder`] a stream that arrives in pieces. Both ask the same function what stands at
//! the front of the bytes, so they cannot disagree.
//!
//! # What holds
//!
//! * **Resync (B2).** A candidate that fails costs exactly one byte and the search goes on inside
//!   it, so a lying length or a false header swallows nothing. Every frame that arrives whole is
//!   delivered unless it overlaps one accepted before it. The price: a whole frame inside the
//!   payload of a *damaged* one is delivered too.
//! * **Account (B2).** `received == framed + skipped + pending`, at any time.
//! * **Bounded stall (B3).** A false header holds good frames back by at most
//!   [`Framing::MAX_LEN`] bytes, and [`Decoder::idle`] ends it when the line goes quiet.
//! * **Reasons (B4).** A gap is one [`Event::Skipped`] with the [`Reason`] of its first byte, and
//!   every skipped byte is counted under its own reason in [`Counters`].
//! * **Chunks do not matter.** Any cutting of the same bytes gives the same events.
//! * **Bounded work.** A byte is looked at once for each candidate it may belong to, at most
//!   `MAX_LEN` times. Nothing allocates, nothing panics.

use core::{fmt, marker::PhantomData};

use crate::error::EncodeError;

/// A whole frame that can be sent: it knows its bytes, CRC included.
pub trait Encode {
    /// Length of the frame, bytes.
    fn encoded_len(&self) -> usize;

    /// Writes the frame to the front of `buffer` and returns just those bytes.
    ///
    /// # Errors
    ///
    /// [`EncodeError::BufferTooSmall`] when it does not fit, and what the type itself refuses;
    /// `buffer` is then as it was.
    fn encode<'b>(&self, buffer: &'b mut [u8]) -> Result<&'b [u8], EncodeError>;
}

/// Copies a frame that lies ready to the front of `buffer`.
pub(crate) fn encode_bytes<'b>(
    frame: &[u8],
    buffer: &'b mut [u8],
) -> Result<&'b [u8], EncodeError> {
    let available = buffer.len();
    let target = buffer
        .get_mut(..frame.len())
        .ok_or(EncodeError::BufferTooSmall { needed: frame.len(), available })?;
    target.copy_from_slice(frame);
    Ok(target)
}

/// What stands at the front of a slice.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub enum Verdict {
    /// A whole frame of so many bytes, its CRC right.
    Frame {
        /// Length of the frame, bytes.
        len: usize,
    },
    /// The start of what may be a frame: judging again is useless before so many bytes are there.
    Partial {
        /// Bytes needed, counted from the front; more than the slice has.
        need: usize,
    },
    /// No frame starts at any of so many bytes.
    Reject {
        /// Why not.
        reason: Reason,
        /// How many bytes to skip, at least 1.
        len: usize,
    },
}

/// One protocol's rule for finding frames.
pub trait Framing {
    /// The typed view of a frame, borrowed from the bytes it arrived in.
    type Frame<'a>;

    /// Longest frame, bytes. Given this many, `judge` never answers [`Verdict::Partial`].
    const MAX_LEN: usize;

    /// Judges the front of `bytes` and nothing else. An empty slice is `Partial`.
    ///
    /// More bytes behind the same ones may turn `Partial` into anything, but change neither
    /// `Frame` nor `Reject`, other than that a `Reject` may cover more bytes.
    fn judge(bytes: &[u8]) -> Verdict;

    /// The view of one whole frame, exactly the bytes that `judge` called a frame.
    ///
    /// `None` when they are something else, which never follows a [`Verdict::Frame`].
    fn view(frame: &[u8]) -> Option<Self::Frame<'_>>;
}

/// Why bytes were skipped (ruling B4).
#[derive(Clone, Copy, Debug, Eq, Hash, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[cfg_attr(feature = "serde", serde(rename_all = "lowercase"))]
#[non_exhaustive]
pub enum Reason {
    /// No frame starts with this byte.
    Header,
    /// The length field has a value that no frame has.
    Length,
    /// A whole packet with a good CRC for a node that cannot exist (ruling I1).
    Id,
    /// The CRC does not belong to the bytes in front of it.
    Crc,
    /// The line went quiet in the middle of the candidate (ruling B3).
    Idle,
}

impl Reason {
    /// The reason in one lower-case word: `header`, `length`, `id`, `crc` or `idle`.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Header => "header",
            Self::Length => "length",
            Self::Id => "id",
            Self::Crc => "crc",
            Self::Idle => "idle",
        }
    }
}

impl fmt::Display for Reason {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name())
    }
}

/// A run of bytes that belong to no frame.
#[derive(Clone, Copy, Debug, Eq, Hash, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Gap {
    /// Length, bytes; at least 1.
    pub len: u64,
    /// Why its first byte was skipped.
    pub reason: Reason,
}

/// What a stream brings: frames, and the gaps between them.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Event<T> {
    /// A whole frame, its CRC right.
    Frame(T),
    /// A gap, reported when it has ended: by a frame, or by a quiet line.
    Skipped(Gap),
}

/// Where every byte went. All counts wrap at 2^64, which no line reaches.
#[derive(Clone, Copy, Debug, Default, Eq, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
#[non_exhaustive]
pub struct Counters {
    /// Bytes taken in.
    pub received: u64,
    /// Bytes that belong to delivered frames.
    pub framed: u64,
    /// Frames delivered.
    pub frames: u64,
    /// Gaps begun.
    pub gaps: u64,
    /// Bytes that start no frame.
    pub header: u64,
    /// Candidates with an impossible length, one byte each.
    pub length: u64,
    /// Bytes of whole packets for nodes that cannot exist.
    pub id: u64,
    /// Candidates with a wrong CRC, one byte each.
    pub crc: u64,
    /// Candidates cut off by a quiet line, one byte each.
    pub idle: u64,
}

impl Counters {
    /// Bytes that belong to no frame, for whatever reason.
    #[must_use]
    pub const fn skipped(&self) -> u64 {
        self.header
            .wrapping_add(self.length)
            .wrapping_add(self.id)
            .wrapping_add(self.crc)
            .wrapping_add(self.idle)
    }

    /// Bytes skipped for this reason.
    #[must_use]
    pub const fn skipped_for(&self, reason: Reason) -> u64 {
        match reason {
            Reason::Header => self.header,
            Reason::Length => self.length,
            Reason::Id => self.id,
            Reason::Crc => self.crc,
            Reason::Idle => self.idle,
        }
    }

    fn skipped_for_mut(&mut self, reason: Reason) -> &mut u64 {
        match reason {
            Reason::Header => &mut self.header,
            Reason::Length => &mut self.length,
            Reason::Id => &mut self.id,
            Reason::Crc => &mut self.crc,
            Reason::Idle => &mut self.idle,
        }
    }
}

/// The counters and the gap that is open; the one place where bytes are booked.
#[derive(Clone, Debug)]
struct Ledger {
    counters: Counters,
    gap: Option<Gap>,
}

impl Ledger {
    const fn new() -> Self {
        let counters = Counters {
            received: 0,
            framed: 0,
            frames: 0,
            gaps: 0,
            header: 0,
            length: 0,
            id: 0,
            crc: 0,
            idle: 0,
        };
        Self { counters, gap: None }
    }

    #[inline]
    fn skip(&mut self, reason: Reason, len: usize) {
        let len = len as u64;
        let count = self.counters.skipped_for_mut(reason);
        *count = count.wrapping_add(len);
        match &mut self.gap {
            Some(gap) => gap.len = gap.len.wrapping_add(len),
            None => {
                self.gap = Some(Gap { len, reason });
                self.counters.gaps = self.counters.gaps.wrapping_add(1);
            }
        }
    }

    #[inline]
    fn frame(&mut self, len: usize) {
        self.counters.framed = self.counters.framed.wrapping_add(len as u64);
        self.counters.frames = self.counters.frames.wrapping_add(1);
    }
}

/// A verdict that is no refusal: what the search stops at.
#[derive(Clone, Copy, Debug)]
enum Front {
    Frame { len: usize },
    Partial { need: usize },
}

/// Books refusals from the front of `bytes` until something else stands there; says how many bytes
/// that took and what it is.
#[inline]
fn search<F: Framing>(bytes: &[u8], ledger: &mut Ledger) -> (usize, Front) {
    let mut at = 0;
    loop {
        let rest = bytes.get(at..).unwrap_or_default();
        match F::judge(rest) {
            Verdict::Frame { len } => return (at, Front::Frame { len }),
            Verdict::Partial { need } => return (at, Front::Partial { need }),
            Verdict::Reject { reason, len } => {
                let len = len.max(1);
                ledger.skip(reason, len);
                at += len;
            }
        }
    }
}

/// Frames of a slice that is already in memory, borrowed from it.
///
/// The iterator stops where the slice ends, or where a candidate begins that the slice cuts off:
/// [`rest`](Self::rest) is then that tail, to be kept until more has arrived. When nothing more
/// will come, [`idle`](Self::idle) lets the search go on inside it.
///
/// ```
/// use axlewire::{ikeya, stream::Frames};
///
/// // A stray byte, node 2 at 1.0 rps, and the start of another response.
/// let bytes = [0x00, 0x55, 0x02, 0x00, 0x00, 0x80, 0x3F, 0x54, 0x0E, 0x55, 0x03];
/// let mut frames = Frames::<ikeya::ToMaster>::new(&bytes);
/// let Some(ikeya::Response::Velocity(response)) = frames.next() else { panic!() };
/// assert_eq!((response.id(), response.rps()), (ikeya::NodeId::N2, 1.0));
/// assert!(frames.next().is_none());
/// assert_eq!(frames.rest(), [0x55, 0x03]);
/// assert_eq!(frames.counters().header, 1);
/// ```
#[derive(Clone, Debug)]
pub struct Frames<'a, F> {
    rest: &'a [u8],
    ledger: Ledger,
    framing: PhantomData<fn() -> F>,
}

impl<'a, F: Framing> Frames<'a, F> {
    /// Frames of `bytes`, from the first byte on.
    #[must_use]
    pub fn new(bytes: &'a [u8]) -> Self {
        let mut ledger = Ledger::new();
        ledger.counters.received = bytes.len() as u64;
        Self { rest: bytes, ledger, framing: PhantomData }
    }

    /// What has not been judged yet; once the iterator has ended, the candidate that the slice
    /// cuts off, shorter than [`Framing::MAX_LEN`].
    #[must_use]
    pub fn rest(&self) -> &'a [u8] {
        self.rest
    }

    /// Nothing follows the slice: refuses the candidate that it cuts off, if there is one, so that
    /// the search can go on inside it (ruling B3).
    ///
    /// Call it once the iterator has ended, as often as [`rest`](Self::rest) is not empty.
    pub fn idle(&mut self) {
        if let (Verdict::Partial { .. }, [_, rest @ ..]) = (F::judge(self.rest), self.rest) {
            self.ledger.skip(Reason::Idle, 1);
            self.rest = rest;
        }
    }

    /// Where every byte went so far.
    #[must_use]
    pub fn counters(&self) -> &Counters {
        &self.ledger.counters
    }
}

impl<'a, F: Framing> Iterator for Frames<'a, F> {
    type Item = F::Frame<'a>;

    #[inline]
    fn next(&mut self) -> Option<F::Frame<'a>> {
        let (skipped, front) = search::<F>(self.rest, &mut self.ledger);
        self.rest = self.rest.get(skipped..)?;
        let Front::Frame { len } = front else { return None };
        let (frame, rest) = self.rest.split_at_checked(len)?;
        self.rest = rest;
        self.ledger.gap = None;
        self.ledger.frame(len);
        F::view(frame)
    }
}

/// Frames of a stream that arrives in pieces of any size.
///
/// `N` is the size of its buffer, bytes, at least [`Framing::MAX_LEN`]: that is checked when it is
/// compiled. A frame lying whole in the input is borrowed from the input; only one that is split
/// over two inputs goes through the buffer.
///
/// Feed it in one of two ways, or both in turn:
///
/// * [`decode`](Self::decode) takes a slice and advances it;
/// * a port or a DMA channel writes into [`spare`](Self::spare), [`commit`](Self::commit) says how
///   much, and `decode` with an empty slice reads it out.
///
/// ```
/// use axlewire::{stream::Event, ucp};
///
/// let mut decoder = ucp::Decoder::new();
/// // Ping, then pong, cut in an awkward place.
/// let pieces: [&[u8]; 2] = [
///     &[0xFD, 0xFF, 0x04, 0x00, 0x01, 0x00, 0x01, 0x42, 0xFD],
///     &[0xFF, 0x05, 0x00, 0x01, 0x00, 0x00, 0xBE, 0x00],
/// ];
/// let mut frames = 0;
/// for mut piece in pieces {
///     while let Some(event) = decoder.decode(&mut piece) {
///         frames += usize::from(matches!(event, Event::Frame(_)));
///     }
/// }
/// assert_eq!((frames, decoder.pending()), (2, 0));
/// ```
#[derive(Clone)]
pub struct Decoder<F, const N: usize> {
    /// `buffer[at..end]` is held: received, and neither framed nor skipped yet.
    buffer: [u8; N],
    at: usize,
    end: usize,
    /// What stands at the front of the held bytes, where that is known.
    front: Option<Front>,
    line: Line,
    ledger: Ledger,
    framing: PhantomData<fn() -> F>,
}

/// What `idle` has asked for.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
enum Line {
    /// Nothing.
    Busy,
    /// To refuse the candidate that is pending, if the held bytes end in one.
    Quiet,
    /// To report the gap as soon as the search comes to an end.
    Settling,
}

/// An event that has been booked but borrows nothing from the decoder yet: where its bytes are.
pub(crate) enum Found<'i> {
    Gap(Gap),
    Held { at: usize, len: usize },
    Input(&'i [u8]),
}

impl<F: Framing, const N: usize> Decoder<F, N> {
    /// An empty decoder.
    #[must_use]
    pub const fn new() -> Self {
        const { assert!(N >= F::MAX_LEN, "the buffer is shorter than the longest frame") }
        Self {
            buffer: [0; N],
            at: 0,
            end: 0,
            front: None,
            line: Line::Busy,
            ledger: Ledger::new(),
            framing: PhantomData,
        }
    }

    /// The next event in what is held and then in `input`, which is advanced by what was used.
    ///
    /// `None` means that `input` is used up and all that can be said has been said; stopping
    /// before that loses nothing, as long as the next call gets what is left of `input`.
    #[inline]
    pub fn decode<'a, 'i: 'a>(&'a mut self, input: &mut &'i [u8]) -> Option<Event<F::Frame<'a>>> {
        let found = self.advance(input)?;
        self.event(found)
    }

    /// Room behind the held bytes for a port to write into.
    ///
    /// At least one byte long once [`decode`](Self::decode) has answered `None`; before that it
    /// may be empty.
    #[must_use]
    pub fn spare(&mut self) -> &mut [u8] {
        self.compact();
        self.buffer.get_mut(self.end..).unwrap_or_default()
    }

    /// The first `len` bytes of [`spare`](Self::spare) have been written.
    ///
    /// No more than `spare` has are taken.
    pub fn commit(&mut self, len: usize) {
        let len = len.min(N - self.end);
        self.end += len;
        self.receive(len);
    }

    /// The line went quiet: what is pending will not be completed (ruling B3).
    ///
    /// Takes effect in the calls of [`decode`](Self::decode) that follow, which deliver whole
    /// frames still held, refuse the pending candidate, search on inside it and report the gap.
    /// What can still be the start of a frame at the very end remains pending.
    pub fn idle(&mut self) {
        self.line = Line::Quiet;
    }

    /// Bytes received and neither framed nor skipped yet.
    #[must_use]
    pub const fn pending(&self) -> usize {
        self.end - self.at
    }

    /// Where every byte went so far.
    #[must_use]
    pub const fn counters(&self) -> &Counters {
        &self.ledger.counters
    }

    /// Finds and books the next event. The answer borrows nothing from `self`, so that a caller
    /// can go on reading from its port where there is none.
    #[inline]
    pub(crate) fn advance<'i>(&mut self, input: &mut &'i [u8]) -> Option<Found<'i>> {
        let before = input.len();
        let found = if self.pending() == 0 && self.line == Line::Busy {
            self.advance_input(input)
        } else {
            self.advance_held(input)
        };
        self.receive(before - input.len());
        found
    }

    /// Makes an event of what `advance` has found.
    #[inline]
    pub(crate) fn event<'a, 'i: 'a>(&'a self, found: Found<'i>) -> Option<Event<F::Frame<'a>>> {
        match found {
            Found::Gap(gap) => Some(Event::Skipped(gap)),
            Found::Held { at, len } => {
                F::view(self.buffer.get(at..)?.get(..len)?).map(Event::Frame)
            }
            Found::Input(frame) => F::view(frame).map(Event::Frame),
        }
    }

    /// Nothing is held: reads `input` where it lies, and holds the candidate that it cuts off.
    #[inline]
    fn advance_input<'i>(&mut self, input: &mut &'i [u8]) -> Option<Found<'i>> {
        let (skipped, front) = search::<F>(input, &mut self.ledger);
        *input = input.get(skipped..)?;
        match front {
            Front::Frame { len } => {
                if let Some(gap) = self.ledger.gap.take() {
                    return Some(Found::Gap(gap));
                }
                let (frame, rest) = input.split_at_checked(len)?;
                *input = rest;
                self.ledger.frame(len);
                Some(Found::Input(frame))
            }
            Front::Partial { .. } => {
                (self.at, self.end) = (0, 0);
                self.hold(input, N);
                self.front = Some(front);
                None
            }
        }
    }

    /// Something is held, or the line went quiet: completes the candidate byte for byte.
    fn advance_held<'i>(&mut self, input: &mut &'i [u8]) -> Option<Found<'i>> {
        let start = *input;
        loop {
            match self.judge_held() {
                Front::Frame { len } => {
                    if let Some(gap) = self.ledger.gap.take() {
                        return Some(Found::Gap(gap));
                    }
                    let at = self.at;
                    self.consume(len);
                    self.ledger.frame(len);
                    return Some(Found::Held { at, len });
                }
                Front::Partial { need } => {
                    match self.line {
                        Line::Quiet if self.pending() > 0 => {
                            self.line = Line::Settling;
                            self.ledger.skip(Reason::Idle, 1);
                            self.consume(1);
                            continue;
                        }
                        Line::Quiet | Line::Settling => {
                            self.line = Line::Busy;
                            if let Some(gap) = self.ledger.gap.take() {
                                return Some(Found::Gap(gap));
                            }
                        }
                        Line::Busy => {}
                    }
                    let taken = start.len() - input.len();
                    if self.pending() <= taken {
                        // All that is still held came from this input: read it there.
                        *input = start.get(taken - self.pending()..)?;
                        (self.at, self.end, self.front) = (0, 0, None);
                        return self.advance_input(input);
                    }
                    let missing = need.saturating_sub(self.pending());
                    if self.hold(input, missing) == 0 {
                        return None;
                    }
                }
            }
        }
    }

    /// What stands at the front of the held bytes, refusals booked.
    #[inline]
    fn judge_held(&mut self) -> Front {
        match self.front {
            Some(front @ Front::Frame { .. }) => front,
            Some(front @ Front::Partial { need }) if self.pending() < need => front,
            _ => {
                let held = self.buffer.get(self.at..self.end).unwrap_or_default();
                let (skipped, front) = search::<F>(held, &mut self.ledger);
                self.at += skipped;
                self.front = Some(front);
                front
            }
        }
    }

    /// Moves up to `most` bytes from the input behind the held ones; says how many.
    #[inline]
    fn hold(&mut self, input: &mut &[u8], most: usize) -> usize {
        if self.end + most > N {
            self.compact();
        }
        let count = most.min(input.len()).min(N - self.end);
        if let (Some((taken, rest)), Some(room)) =
            (input.split_at_checked(count), self.buffer.get_mut(self.end..self.end + count))
        {
            room.copy_from_slice(taken);
            *input = rest;
            self.end += count;
        }
        count
    }

    /// The first `len` held bytes have been booked.
    fn consume(&mut self, len: usize) {
        self.at += len;
        self.front = None;
    }

    /// Moves the held bytes to the front of the buffer.
    fn compact(&mut self) {
        if self.at > 0 {
            self.buffer.copy_within(self.at..self.end, 0);
            (self.at, self.end) = (0, self.end - self.at);
        }
    }

    fn receive(&mut self, len: usize) {
        let received = &mut self.ledger.counters.received;
        *received = received.wrapping_add(len as u64);
    }
}

impl<F: Framing, const N: usize> Default for Decoder<F, N> {
    fn default() -> Self {
        Self::new()
    }
}

impl<F, const N: usize> fmt::Debug for Decoder<F, N> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Decoder")
            .field("held", &self.buffer.get(self.at..self.end).unwrap_or_default())
            .field("line", &self.line)
            .field("ledger", &self.ledger)
            .finish_non_exhaustive()
    }
}
