//! Frames of a stream.

use core::{fmt, marker::PhantomData};

use super::{Counters, Event, Framing, Front, Gap, Reason, ledger::Ledger, search};

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
#[derive(Clone)]
pub struct Decoder<F, const N: usize> {
    /// `buffer[at..end]` is held: received, and neither framed nor skipped yet.
    buffer: [u8; N],
    at: usize,
    end: usize,
    /// What stands at the front of the held bytes, where that is known.
    front: Option<Front>,
    /// Where a candidate is held: how many bytes, for which there is room, have to come before
    /// anything can be said; 0 where that is not known.
    missing: usize,
    line: Line,
    /// Where the held bytes ended when the line went quiet: what lies behind came later.
    quiet_end: usize,
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
            missing: 0,
            line: Line::Busy,
            quiet_end: 0,
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
        (self.end, self.missing) = (self.end + len, 0);
        self.receive(len);
    }

    /// The line went quiet: what is pending will not be completed (ruling B3).
    ///
    /// Concerns the bytes that the decoder has taken in; hand in what came before the silence first.
    /// Takes effect in the calls of [`decode`](Self::decode) that follow, which deliver whole
    /// frames still held, refuse the pending candidate, search on inside it and report the gap.
    /// What can still be the start of a frame at the very end remains pending: when nothing at all
    /// will follow, call it until [`pending`](Self::pending) is 0. Each call ends a gap, so a second
    /// one may then follow right behind the first.
    pub fn idle(&mut self) {
        (self.line, self.quiet_end, self.missing) = (Line::Quiet, self.end, 0);
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
        if before < self.missing {
            // Byte by byte from a port, this is what happens nearly every time.
            self.hold_on(input);
            self.receive(before);
            return None;
        }
        self.missing = 0;
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
        let (found, front) = search::<F>(input, &mut self.ledger);
        *input = found;
        match front {
            Front::Frame { len } => {
                if let Some(gap) = self.ledger.gap.take() {
                    return Some(Found::Gap(gap));
                }
                let (frame, rest) = found.split_at_checked(len)?;
                *input = rest;
                self.ledger.frame(len);
                Some(Found::Input(frame))
            }
            Front::Partial { need } => {
                self.hold_cut_off(input, need);
                None
            }
        }
    }

    /// Something is held, or the line went quiet: completes the candidate byte for byte.
    fn advance_held<'i>(&mut self, input: &mut &'i [u8]) -> Option<Found<'i>> {
        let start = *input;
        loop {
            let front = self.judge_held();
            let taken = start.len() - input.len();
            if taken > 0 && self.pending() <= taken {
                // All that is still held came from this input: read it there.
                *input = start.get(taken - self.pending()..)?;
                (self.at, self.end, self.front) = (0, 0, None);
                return self.advance_input(input);
            }
            match (front, self.line) {
                (Front::Frame { len }, _) => {
                    if let Some(gap) = self.ledger.gap.take() {
                        return Some(Found::Gap(gap));
                    }
                    let at = self.at;
                    self.consume(len);
                    self.ledger.frame(len);
                    return Some(Found::Held { at, len });
                }
                (Front::Partial { .. }, Line::Quiet) if self.at < self.quiet_end => {
                    self.line = Line::Settling;
                    self.ledger.skip(Reason::Idle, 1);
                    self.consume(1);
                }
                (Front::Partial { .. }, Line::Quiet | Line::Settling) => {
                    self.line = Line::Busy;
                    if let Some(gap) = self.ledger.gap.take() {
                        return Some(Found::Gap(gap));
                    }
                }
                (Front::Partial { .. }, Line::Busy) if self.pending() == 0 => {
                    return self.advance_input(input);
                }
                (Front::Partial { need }, Line::Busy) => {
                    if self.hold(input, need.saturating_sub(self.pending())) == 0 {
                        self.wait_for(need);
                        return None;
                    }
                }
            }
        }
    }

    /// Holds the candidate that the input cuts off. Out of line: it happens once per input.
    #[inline(never)]
    fn hold_cut_off(&mut self, input: &mut &[u8], need: usize) {
        (self.at, self.end) = (0, 0);
        self.hold(input, N);
        self.front = Some(Front::Partial { need });
        self.wait_for(need);
    }

    /// Nothing can be said before the held bytes are `need`; sees to it that there is room for them.
    #[inline]
    fn wait_for(&mut self, need: usize) {
        if self.at + need > N {
            self.compact();
        }
        self.missing = need.saturating_sub(self.pending());
    }

    /// Moves an input that completes nothing behind the held bytes.
    #[inline]
    fn hold_on(&mut self, input: &mut &[u8]) {
        let end = self.end + input.len();
        if let Some(room) = self.buffer.get_mut(self.end..end) {
            match (room, *input) {
                // A single byte is not worth a call to copy it.
                ([room], [byte]) => *room = *byte,
                (room, bytes) => room.copy_from_slice(bytes),
            }
        }
        self.missing -= input.len();
        self.end = end;
        *input = &[];
    }

    /// What stands at the front of the held bytes, refusals booked.
    #[inline]
    fn judge_held(&mut self) -> Front {
        // What came behind a silence does not complete what was pending before it.
        let end = if self.line == Line::Busy { self.end } else { self.quiet_end };
        match self.front {
            Some(front @ Front::Frame { .. }) => front,
            Some(front @ Front::Partial { need }) if end.saturating_sub(self.at) < need => front,
            _ => {
                let held = self.buffer.get(self.at..end).unwrap_or_default();
                let (found, front) = search::<F>(held, &mut self.ledger);
                self.at = end - found.len();
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
            self.quiet_end = self.quiet_end.saturating_sub(self.at);
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
