//! A decoder on a line that keeps the whole history, so that the oracle can be asked.
//!
//! Every call checks the accounting; [`CheckedLine::finish`] checks the rest.

use axlewire::stream::{self, Counters, Decoder, Frames, decode_capture};

use super::{
    known_framings::Known,
    oracle::{self, Event, Reason},
};

/// A single action of a decoder's user.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Op {
    /// Passes this many bytes as a slice and takes all events.
    Slice(usize),
    /// Passes this many bytes as a slice, takes this many events and stops.
    Stop { len: usize, events: usize },
    /// Writes up to this many bytes into the decoder's own buffer, and takes no event.
    Commit(usize),
    /// Takes all remaining events, then pushes this many bytes and takes the events of each.
    Push(usize),
    /// Takes all remaining events.
    Drain,
    /// Reports a quiet line, drained or not.
    Idle,
}

/// A decoder and the history of its line.
pub(crate) struct CheckedLine<F, const N: usize> {
    decoder: Decoder<F, N>,
    history: Vec<u8>,
    idles: Vec<usize>,
    events: Vec<Event>,
    /// `idle` has been called, and its events have not all been taken.
    quiet: bool,
    /// `push` has been called, which may leave noise unjudged until more follows.
    pushed: bool,
    /// How much of the stream `decode` has seen, consumed or not.
    shown: usize,
    /// Where the latest chunk of input began, and how many calls it has had.
    chunk: (usize, usize),
    calls: u64,
}

impl<F: Known, const N: usize> CheckedLine<F, N> {
    pub(crate) fn new() -> Self {
        let (history, idles, events) = (Vec::new(), Vec::new(), Vec::new());
        Self {
            decoder: Decoder::new(),
            history,
            idles,
            events,
            quiet: false,
            pushed: false,
            shown: 0,
            chunk: (0, 0),
            calls: 0,
        }
    }

    /// Runs `ops` repeatedly until `stream` is used up or they have had a fair chance, passes the
    /// rest, and asks the oracle about all of it. Returns the number of calls of `decode`.
    pub(crate) fn play(mut self, stream: &[u8], ops: &[Op]) -> u64 {
        let mut rest = stream;
        for &op in ops.iter().cycle().take(ops.len().max(4 * stream.len())) {
            rest = self.perform(op, rest);
            if rest.is_empty() {
                break;
            }
        }
        self.slice(rest);
        self.finish();
        self.calls
    }

    /// Runs `op` with bytes from the front of `stream`; returns the remaining bytes.
    fn perform<'s>(&mut self, op: Op, stream: &'s [u8]) -> &'s [u8] {
        match op {
            Op::Slice(len) => {
                let (piece, rest) = stream.split_at(len.min(stream.len()));
                self.slice(piece);
                rest
            }
            Op::Stop { len, events } => {
                let mut piece = &stream[..len.min(stream.len())];
                let given = piece.len();
                self.chunk = (self.history.len(), 0);
                // The remaining bytes come again in another op, from another place in memory.
                for _ in 0..events {
                    if !self.step(&mut piece) {
                        break;
                    }
                }
                &stream[given - piece.len()..]
            }
            Op::Commit(len) => {
                let taken = self.commit(&stream[..len.min(stream.len())]);
                &stream[taken..]
            }
            Op::Push(len) => {
                let (bytes, rest) = stream.split_at(len.min(stream.len()));
                self.slice(&[]);
                bytes.iter().for_each(|&byte| self.push(byte));
                rest
            }
            Op::Drain => {
                self.slice(&[]);
                stream
            }
            Op::Idle => {
                self.idle();
                stream
            }
        }
    }

    /// Passes `input` from a buffer of its own and takes all events.
    pub(crate) fn slice(&mut self, input: &[u8]) {
        let copy = input.to_vec();
        let mut input = copy.as_slice();
        self.chunk = (self.history.len(), 0);
        while self.step(&mut input) {}
    }

    /// Takes one event; `false` if there is none.
    fn step(&mut self, input: &mut &[u8]) -> bool {
        let given = *input;
        self.calls += 1;
        self.chunk.1 += 1;
        let nothing_held = self.decoder.pending() == 0;
        // With no new bytes, `poll` is the same.
        let polled = input.is_empty() && self.calls.is_multiple_of(2);
        let found = match if polled { self.decoder.poll() } else { self.decoder.decode(input) } {
            None => None,
            Some(stream::Event::Skipped(gap)) => Some((Err(gap.reason), gap.len as usize)),
            Some(stream::Event::Frame(frame)) => {
                let bytes = F::bytes(&frame);
                let borrowed = given.as_ptr_range().contains(&bytes.as_ptr());
                Some((Ok((bytes.to_vec(), borrowed)), bytes.len()))
            }
        };
        let (taken, left) = given.split_at(given.len() - input.len());
        assert!(left == *input, "the input was not advanced but replaced");
        self.history.extend_from_slice(taken);
        self.shown = self.shown.max(self.history.len() + left.len());
        self.check_account();

        let Some((what, len)) = found else {
            assert!(input.is_empty(), "no event, yet {} bytes are left", input.len());
            assert!(self.decoder.pending() < F::MAX_LEN, "a whole candidate is held (B3)");
            self.quiet = false;
            return false;
        };
        // A gap ends, and so does a frame, where the accounted bytes end.
        let counters = self.decoder.counters();
        let offset = (counters.framed + counters.skipped()) as usize - len;
        self.events.push(match what {
            Err(reason) => Event::Skipped { offset, len, reason: oracle_reason(reason) },
            Ok((bytes, borrowed)) => {
                // Only the rest of a split candidate goes through the buffer, and a call completes
                // at most one.
                let (start, calls) = self.chunk;
                let split = !nothing_held && offset < start + calls * F::MAX_LEN;
                assert!(borrowed || split, "a frame lying whole in the input was copied");
                assert_eq!(bytes, self.history[offset..offset + len], "wrong bytes in the frame");
                Event::Frame { offset, len }
            }
        });
        true
    }

    /// Writes as much of `bytes` into the decoder as it has room for; returns how much.
    pub(crate) fn commit(&mut self, bytes: &[u8]) -> usize {
        let room = N - self.decoder.pending();
        let spare = self.decoder.spare();
        assert_eq!(spare.len(), room, "a port does not get all the room there is");
        let len = bytes.len().min(spare.len());
        spare[..len].copy_from_slice(&bytes[..len]);
        self.decoder.commit(len);
        self.history.extend_from_slice(&bytes[..len]);
        self.check_account();
        len
    }

    /// Passes in one byte as an interrupt does, and takes events only when there may be some.
    pub(crate) fn push(&mut self, byte: u8) {
        let worth_a_look = self.decoder.push(byte);
        self.history.push(byte);
        self.check_account();
        self.pushed = true;
        if worth_a_look {
            self.slice(&[]);
        } else {
            assert!(self.decoder.poll().is_none(), "an event that push did not announce");
        }
    }

    /// The line goes quiet, unless it already has and the decoder is about to report it, or bytes
    /// that the decoder has seen have not been passed again.
    pub(crate) fn idle(&mut self) {
        if !self.quiet && self.history.len() >= self.shown {
            self.decoder.idle();
            self.idles.push(self.history.len());
            self.quiet = true;
            self.check_account();
        }
    }

    /// Everything so far matches the oracle.
    pub(crate) fn finish(&mut self) {
        self.slice(&[]);
        if self.pushed {
            self.idle();
            self.slice(&[]);
        }
        let told = oracle::answer(F::RULES, &self.history, &self.idles);
        assert_eq!(self.events, told.events, "history {:02x?}", self.history);
        assert_eq!(self.decoder.pending(), told.pending);
        check_counters(&self.decoder.counters(), &told, self.history.len());
    }

    pub(crate) fn decoder(&self) -> &Decoder<F, N> {
        &self.decoder
    }

    pub(crate) fn events(&self) -> &[Event] {
        &self.events
    }

    /// B2: every byte is in exactly one place, after every call.
    fn check_account(&self) {
        let (counters, pending) = (self.decoder.counters(), self.decoder.pending() as u64);
        assert_eq!(counters.received, counters.framed + counters.skipped() + pending);
        assert_eq!(counters.received, self.history.len() as u64);
    }
}

/// An event of a capture in the oracle's format.
pub(crate) fn located<F: Known>((offset, event): stream::Located<F::Frame<'_>>) -> Event {
    match event {
        stream::Event::Frame(frame) => Event::Frame { offset, len: F::bytes(&frame).len() },
        stream::Event::Skipped(gap) => {
            let (len, reason) = (gap.len as usize, oracle_reason(gap.reason));
            Event::Skipped { offset, len, reason }
        }
    }
}

/// The slice iterator gives the oracle's frames, borrowed, and leaves the same rest.
pub(crate) fn check_slice<F: Known>(stream: &[u8]) {
    let told = oracle::answer(F::RULES, stream, &[]);
    let mut frames = Frames::<F>::new(stream);
    let mut found = Vec::new();
    while let Some(frame) = frames.next() {
        found.push(place_in(stream, F::bytes(&frame)));
        let counters = frames.counters();
        let booked = counters.framed + counters.skipped() + frames.rest().len() as u64;
        assert_eq!(counters.received, booked);
    }
    assert_eq!(found, told.frames());
    assert_eq!(frames.rest(), &stream[stream.len() - told.pending..]);
    check_counters(&frames.counters(), &told, stream.len());
    check_each::<F>(stream, &told);
}

/// `each` gives the same frames, whatever was taken one by one before.
fn check_each<F: Known>(stream: &[u8], told: &oracle::Answer) {
    let place = |frame| place_in(stream, F::bytes(&frame));
    for before in [0, 1, told.frames().len() / 3] {
        let mut frames = Frames::<F>::new(stream);
        let mut found: Vec<_> = frames.by_ref().take(before).map(place).collect();
        frames.each(|frame| found.push(place(frame)));
        assert_eq!(found, told.frames());
        assert_eq!(frames.rest(), &stream[stream.len() - told.pending..]);
        check_counters(&frames.counters(), told, stream.len());
    }
    let folded = Frames::<F>::new(stream).fold(Vec::new(), |mut found, frame| {
        found.push(place(frame));
        found
    });
    assert_eq!(folded, told.frames());
}

/// With `idle` called while there is a rest, the slice iterator gives all frames, and a capture all
/// events: its end is one silence, so gaps do not end before the next frame.
pub(crate) fn check_finished_slice<F: Known>(stream: &[u8]) {
    let mut frames = Frames::<F>::new(stream);
    let (mut found, mut idles) = (Vec::new(), Vec::new());
    loop {
        frames.each(|frame| found.push(place_in(stream, F::bytes(&frame))));
        if frames.rest().is_empty() {
            break;
        }
        frames.idle();
        idles.push(stream.len());
    }
    let mut told = oracle::answer(F::RULES, stream, &[&idles[..], &[stream.len()]].concat());
    told.join_gaps();
    assert_eq!((found, told.pending), (told.frames(), 0));
    check_counters(&frames.counters(), &told, stream.len());

    let (events, counters) = decode_capture::<F>(stream);
    let events: Vec<_> = events.into_iter().map(|event| located::<F>(event)).collect();
    assert_eq!(events, told.events);
    check_counters(&counters, &told, stream.len());
}

pub(crate) fn place_in(stream: &[u8], frame: &[u8]) -> (usize, usize) {
    assert!(stream.as_ptr_range().contains(&frame.as_ptr()), "the frame is not borrowed");
    (frame.as_ptr().addr() - stream.as_ptr().addr(), frame.len())
}

/// The counters match the oracle's answer and the sums of its events.
pub(crate) fn check_counters(counters: &Counters, told: &oracle::Answer, received: usize) {
    let (mut frames, mut framed, mut skipped) = (0, 0, told.open);
    for event in &told.events {
        match event {
            Event::Frame { len, .. } => (frames, framed) = (frames + 1, framed + len),
            Event::Skipped { len, .. } => skipped += len,
        }
    }
    assert_eq!(counters.received, received as u64, "received");
    assert_eq!(counters.frames, frames as u64, "frames");
    assert_eq!(counters.framed, framed as u64, "framed");
    assert_eq!(counters.skipped(), skipped as u64, "skipped");
    assert_eq!(counters.gaps, told.gaps as u64, "gaps");
    let by_reason = [counters.header, counters.length, counters.id, counters.crc, counters.idle];
    assert_eq!(by_reason.map(|count| count as usize), told.skipped, "skipped by reason");
}

fn oracle_reason(reason: stream::Reason) -> Reason {
    match reason {
        stream::Reason::Header => Reason::Header,
        stream::Reason::Length => Reason::Length,
        stream::Reason::Id => Reason::Id,
        stream::Reason::Crc => Reason::Crc,
        stream::Reason::Idle => Reason::Idle,
        other => panic!("the oracle knows no reason {other}"),
    }
}
