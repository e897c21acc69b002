//! The decoder of a stream.

use core::{cell::Cell, fmt, marker::PhantomData};

use super::{
    event::Event,
    fill::Fill,
    framing::{Framing, Verdict},
    ledger::{Counters, Gap, Ledger},
    search::{Front, judge, search},
};
use crate::machine::IS_HOST;

/// Finds the frames of a stream that arrives in pieces of any size.
///
/// `N` is the size of the buffer, bytes: at least [`Framing::MAX_LEN`] and, except on 64-bit
/// machines, at most 32,766, checked at compile time. A frame that is whole in the input is
/// borrowed from the input; only a frame split over two inputs goes through the buffer.
///
/// There are three ways to feed it, which you can mix:
///
/// * [`decode`](Self::decode) takes a slice and advances it;
/// * a port or a DMA channel writes into [`spare`](Self::spare), [`commit`](Self::commit) tells how
///   many bytes it wrote, and [`poll`](Self::poll) returns the events;
/// * a receive interrupt [`push`](Self::push)es single bytes, and `poll` returns the events.
///
/// ```
/// # #[cfg(feature = "ucp")] {
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
/// # }
/// ```
///
/// A buffer too short for the longest frame does not compile:
///
/// ```compile_fail,E0080
/// let decoder = axlewire::stream::Decoder::<axlewire::ikeya::ToSlave, 7>::new();
/// ```
// The buffer comes first: storing a pushed byte then needs no addition.
#[repr(C)]
pub struct Decoder<F, const N: usize> {
    /// `buffer[at..end]` is held: received, but neither framed nor skipped yet.
    buffer: [u8; N],
    /// `end`, and when to look at the held bytes. While it is too early, they decide nothing, and
    /// there is room for more. The decoder waits for more only while the line is busy and the held
    /// bytes begin at the front.
    pub(super) fill: Fill,
    at: usize,
    line: LineState,
    /// End of the held bytes when the line went quiet: bytes beyond it came later.
    quiet_end: usize,
    ledger: Ledger,
    framing: PhantomData<fn() -> F>,
}

/// What a call of `idle` has left to do.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
enum LineState {
    /// Nothing.
    Busy,
    /// Refuse the pending candidate, if the held bytes end in one.
    Quiet,
    /// Report the gap when the search ends.
    Settling,
}

/// An event that has been booked: where its bytes are. Borrows nothing from the decoder.
pub(crate) enum Found<'i> {
    Held(Held),
    Input(&'i [u8]),
}

/// An event in the held bytes.
pub(crate) enum Held {
    Gap(Gap),
    Frame { at: usize, len: usize },
}

impl<F: Framing, const N: usize> Decoder<F, N> {
    /// Nothing is held, and the line is busy.
    pub(super) const EMPTY: Fill = Fill::until(F::MIN_LEN, 0);

    /// An empty decoder.
    #[must_use]
    pub const fn new() -> Self {
        const { assert!(N >= F::MAX_LEN, "the buffer is shorter than the longest frame") }
        const { assert!(N <= Fill::MAX, "the buffer is longer than a decoder supports") }
        Self {
            buffer: [0; N],
            fill: Self::EMPTY,
            at: 0,
            line: LineState::Busy,
            quiet_end: 0,
            ledger: Ledger::new(),
            framing: PhantomData,
        }
    }

    /// Returns the next event in the held bytes and then in `input`, and advances `input` past the
    /// bytes used.
    ///
    /// `None` means that `input` is used up and there is no further event. You may stop earlier
    /// without loss, as long as the next call gets the rest of `input`.
    #[inline]
    pub fn decode<'a, 'i: 'a>(&'a mut self, input: &mut &'i [u8]) -> Option<Event<F::Frame<'a>>> {
        let found = self.advance(input)?;
        self.event(found)
    }

    /// Returns the next event in the held bytes: [`decode`](Self::decode) without new input.
    #[inline]
    pub fn poll(&mut self) -> Option<Event<F::Frame<'_>>> {
        // Usually the held bytes are exactly one frame: no need to go through `Held`.
        if self.fill.is_just(F::MIN_LEN..=N) {
            let end = self.fill.end();
            match judge::<F>(self.buffer.get(..end)?) {
                Verdict::Frame { len } if len == end && !self.ledger.has_gap() => {
                    let frame = F::view(self.buffer.get(..len)?)?;
                    self.ledger.frame(len);
                    self.fill = Self::EMPTY;
                    return Some(Event::Frame(frame));
                }
                Verdict::Partial { need } => {
                    self.wake_at(need);
                    return None;
                }
                _ => {}
            }
        }
        if self.fill.is_early() {
            return None;
        }
        let held = self.judge_held(0)?;
        self.held_event(held)
    }

    /// Free space after the held bytes, for a port to write into.
    ///
    /// At least one byte once [`decode`](Self::decode) or [`poll`](Self::poll) has returned `None`;
    /// may be empty before.
    #[must_use]
    pub fn spare(&mut self) -> &mut [u8] {
        self.compact();
        self.buffer.get_mut(self.fill.end()..).unwrap_or_default()
    }

    /// Takes in the first `len` bytes of [`spare`](Self::spare), which have been written.
    ///
    /// A larger `len` is cut to the length of `spare`.
    pub fn commit(&mut self, len: usize) {
        if self.pending() == 0 {
            self.wake_now();
        }
        self.fill = self.fill.plus(len.min(N - self.fill.end()));
    }

    /// Takes in one byte, as from a receive interrupt. Returns whether [`poll`](Self::poll) may
    /// have an event now; if so, call it until it returns `None`.
    ///
    /// The cheapest way to feed single bytes: until a frame can be complete, they are only stored.
    /// Frames are found as early as with [`decode`](Self::decode), but bytes that start no frame
    /// may stay [`pending`](Self::pending) until there are [`Framing::MIN_LEN`] of them.
    ///
    /// There is always room after `poll` has returned `None`. If you keep pushing without polling
    /// after a `true`, the buffer fills; bytes are then refused, and `push` keeps returning `true`.
    ///
    /// ```
    /// # #[cfg(feature = "ikeya")] {
    /// use axlewire::{ikeya, stream::{Decoder, Event}};
    ///
    /// let mut decoder = Decoder::<ikeya::ToSlave, 8>::new();
    /// let mut frames = 0;
    /// for byte in [0xAA, 0x01, 0xBE, 0xD0] {
    ///     if decoder.push(byte) {
    ///         while let Some(event) = decoder.poll() {
    ///             frames += usize::from(matches!(event, Event::Frame(_)));
    ///         }
    ///     }
    /// }
    /// assert_eq!(frames, 1);
    /// # }
    /// ```
    #[inline]
    pub fn push(&mut self, byte: u8) -> bool {
        let (at, fill) = (self.fill.end(), self.fill.plus(1));
        if fill.is_early() {
            // There is room. Where a mask shows that to the compiler, it is cheaper than a
            // comparison.
            let at = if N.is_power_of_two() { at % N } else { at };
            if let Some(room) = self.buffer.get_mut(at) {
                *room = byte;
                self.fill = fill;
            }
            return false;
        }
        if let Some(room) = self.buffer.get_mut(at) {
            *room = byte;
            self.fill = fill;
        }
        true
    }

    /// Tells the decoder that the line went quiet: the pending bytes will not be completed (ruling
    /// B3).
    ///
    /// Applies to the bytes taken in so far; hand in everything from before the silence first.
    /// Takes effect in the following calls of [`decode`](Self::decode) or [`poll`](Self::poll).
    /// They deliver whole frames still held, refuse the pending candidate, search on inside it and
    /// report the gap. A possible start of a frame at the very end remains pending: if nothing will
    /// follow at all, call `idle` until [`pending`](Self::pending) is 0. Each call ends a gap, so
    /// two gaps may be adjacent.
    pub fn idle(&mut self) {
        (self.line, self.quiet_end) = (LineState::Quiet, self.fill.end());
        self.wake_now();
    }

    /// Number of bytes received but neither framed nor skipped yet.
    #[must_use]
    pub const fn pending(&self) -> usize {
        self.fill.end() - self.at
    }

    /// The account of every byte so far.
    #[must_use]
    pub const fn counters(&self) -> Counters {
        self.ledger.counters(self.pending())
    }

    /// Number of bytes taken in: [`Counters::received`] alone.
    #[must_use]
    pub const fn received(&self) -> u64 {
        self.ledger.received(self.pending())
    }

    /// Finds and books the next event. The result does not borrow from `self`, so without an event
    /// the caller can go on reading from its port.
    #[inline]
    pub(crate) fn advance<'i>(&mut self, input: &mut &'i [u8]) -> Option<Found<'i>> {
        if self.fill != Self::EMPTY {
            if input.len() < self.fill.missing() {
                self.hold(input, input.len());
                return None;
            }
            if let Some(held) = self.complete(input) {
                return Some(Found::Held(held));
            }
            if self.fill != Self::EMPTY {
                return None;
            }
        }
        self.advance_input(input)
    }

    /// Finds and books the next event in the held bytes.
    #[inline]
    pub(crate) fn advance_held(&mut self) -> Option<Held> {
        if self.fill.is_early() { None } else { self.judge_held(0) }
    }

    /// Makes an event from a result of `advance`.
    #[inline]
    pub(crate) fn event<'a, 'i: 'a>(&'a self, found: Found<'i>) -> Option<Event<F::Frame<'a>>> {
        match found {
            Found::Held(held) => self.held_event(held),
            Found::Input(frame) => F::view(frame).map(Event::Frame),
        }
    }

    /// Makes an event from a result of `advance_held`.
    #[inline]
    pub(crate) fn held_event(&self, held: Held) -> Option<Event<F::Frame<'_>>> {
        match held {
            Held::Gap(gap) => Some(Event::Skipped(gap)),
            Held::Frame { at, len } => {
                F::view(self.buffer.get(at..)?.get(..len)?).map(Event::Frame)
            }
        }
    }

    /// Reads `input` in place, while nothing is held, and holds the candidate that its end cuts
    /// off.
    ///
    /// Inlined on a host; a single copy on a microcontroller.
    #[inline(always)]
    fn advance_input<'i>(&mut self, input: &mut &'i [u8]) -> Option<Found<'i>> {
        if IS_HOST { self.read_input(input) } else { self.read_input_apart(input) }
    }

    #[inline(never)]
    fn read_input_apart<'i>(&mut self, input: &mut &'i [u8]) -> Option<Found<'i>> {
        self.read_input(input)
    }

    #[inline(always)]
    fn read_input<'i>(&mut self, input: &mut &'i [u8]) -> Option<Found<'i>> {
        if input.is_empty() {
            return None;
        }
        let (found, front) = search::<F>(input, &mut self.ledger, Ledger::refuse_apart);
        match front {
            Front::Frame { len } => {
                if let Some(gap) = self.ledger.take_gap() {
                    *input = found;
                    return Some(Found::Held(Held::Gap(gap)));
                }
                // Fails only if the framing breaks its contract; `input` then stays as it is,
                // because anything else would cost every frame 4 % of its time.
                let (frame, rest) = found.split_at_checked(len)?;
                *input = rest;
                self.ledger.frame(len);
                Some(Found::Input(frame))
            }
            Front::Partial { need } => {
                *input = found;
                if !found.is_empty() {
                    self.hold(input, found.len());
                    self.wake_at(need);
                }
                None
            }
        }
    }

    /// Completes the held candidate from `input`, or handles a quiet line. Afterwards there is an
    /// event, or more input is needed, or nothing is held any more.
    #[inline(never)]
    fn complete(&mut self, input: &mut &[u8]) -> Option<Held> {
        let start = *input;
        loop {
            if self.fill.is_early() {
                self.hold(input, self.fill.missing());
            }
            if self.fill.is_early() {
                return None;
            }
            let taken = start.len() - input.len();
            if let Some(held) = self.judge_held(taken) {
                return Some(held);
            }
            if self.pending() <= taken {
                // All bytes still held came from this input: read them there.
                *input = start.get(taken - self.pending()..)?;
                self.clear();
                return None;
            }
        }
    }

    /// Finds and books the next event in the held bytes, once there are enough of them. If only the
    /// last `taken` bytes are left, finds none in them.
    #[inline(never)]
    pub(super) fn judge_held(&mut self, taken: usize) -> Option<Held> {
        loop {
            // Bytes from after a silence do not complete a candidate from before it.
            let end = if self.line == LineState::Busy { self.fill.end() } else { self.quiet_end };
            let held = self.buffer.get(self.at..end)?;
            match (judge::<F>(held), self.line) {
                (Verdict::Reject { reason, more }, _) => {
                    let len = held.len().min(more.saturating_add(1));
                    self.ledger.refuse_apart(reason, len);
                    self.ledger.skip(len);
                    self.at += len;
                    if taken > 0 && self.pending() <= taken {
                        return None;
                    }
                }
                (Verdict::Frame { len }, line) => {
                    // No shorter if the framing keeps its contract.
                    let (at, len) = (self.at, held.len().min(len));
                    self.wake_now();
                    if let Some(gap) = self.ledger.take_gap() {
                        return Some(Held::Gap(gap));
                    }
                    self.ledger.frame(len);
                    self.at = at + len;
                    if self.at == self.fill.end() && line == LineState::Busy {
                        self.clear();
                    }
                    return Some(Held::Frame { at, len });
                }
                (Verdict::Partial { need }, LineState::Busy) => {
                    self.wait_for(need);
                    return None;
                }
                (Verdict::Partial { .. }, LineState::Quiet) if self.at < end => {
                    self.line = LineState::Settling;
                    self.ledger.refuse_idle();
                    self.at += 1;
                }
                (Verdict::Partial { .. }, LineState::Quiet | LineState::Settling) => {
                    self.line = LineState::Busy;
                    if self.at == self.fill.end() {
                        self.clear();
                    }
                    if let Some(gap) = self.ledger.take_gap() {
                        return Some(Held::Gap(gap));
                    }
                }
            }
        }
    }

    /// Waits until `need` bytes are held, and makes room for them.
    #[inline]
    fn wait_for(&mut self, need: usize) {
        if self.at == self.fill.end() {
            return self.clear();
        }
        self.compact();
        self.wake_at(need);
    }

    /// Waits until `need` bytes are held; they begin at the front.
    #[inline]
    fn wake_at(&mut self, need: usize) {
        self.fill = Fill::until(need.min(N), self.fill.end());
    }

    /// Looks at the held bytes at the next opportunity, however few they are.
    #[inline]
    pub(super) fn wake_now(&mut self) {
        self.fill = Fill::now(self.fill.end());
    }

    /// Moves up to `most` bytes from the input to the end of the held ones.
    #[inline]
    pub(super) fn hold(&mut self, input: &mut &[u8], most: usize) {
        let count = most.min(input.len());
        let end = self.fill.end();
        if let (Some((taken, rest)), Some(room)) =
            (input.split_at_checked(count), self.buffer.get_mut(end..end + count))
        {
            match (room, taken) {
                // For a single byte, a copy call is not worth it.
                ([room], [byte]) => *room = *byte,
                (room, taken) => room.copy_from_slice(taken),
            }
            *input = rest;
            self.fill = self.fill.plus(count);
        }
    }

    /// Empties the buffer.
    fn clear(&mut self) {
        (self.at, self.fill) = (0, Self::EMPTY);
    }

    /// Moves the held bytes to the front of the buffer.
    fn compact(&mut self) {
        let (at, end) = (self.at, self.fill.end());
        if at > 0 {
            // Not `copy_within`: the compiler does not see that it cannot panic here.
            let cells = Cell::from_mut(self.buffer.as_mut_slice()).as_slice_of_cells();
            for (to, from) in cells.iter().zip(cells.get(at..end).unwrap_or_default()) {
                to.set(from.get());
            }
            self.quiet_end = self.quiet_end.saturating_sub(at);
            (self.at, self.fill) = (0, Fill::now(end - at));
        }
    }
}

// By hand: a derive would require `F: Clone`.
impl<F, const N: usize> Clone for Decoder<F, N> {
    fn clone(&self) -> Self {
        Self { ledger: self.ledger.clone(), ..*self }
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
            .field("held", &self.buffer.get(self.at..self.fill.end()).unwrap_or_default())
            .field("line", &self.line)
            .field("ledger", &self.ledger)
            .finish_non_exhaustive()
    }
}
