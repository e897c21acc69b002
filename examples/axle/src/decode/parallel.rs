//! Decoding a file with several threads; the output is the same byte for byte.
//!
//! The file is read in parts that end where decoding can begin anew
//! ([`split_point`](stream::split_point)). Each worker lists one part at a time, and the lines are
//! written in the order of the parts. What a part needs from earlier ones, the modes of the
//! nodes, is found in a quick first pass and handed on before a line is written.

use std::{
    collections::BTreeMap,
    sync::{
        Mutex,
        mpsc::{self, Receiver, Sender, SyncSender},
    },
    thread,
};

use axlewire::stream::{self, Counters, Frames, Framing};

use super::stream::{Sheet, Stream, StreamOf};
use crate::{
    failure::Failure,
    input::Input,
    listing::{Modes, Shown, Style},
};

/// Bytes of one part per thread.
const LISTED: usize = 192 * 1024;

/// The lines are up to this many times as long as the bytes.
const GROWTH: usize = 40;

/// A stretch without a split point becomes a part of at most this length; then the rest of the
/// file is decoded by one thread.
const LONGEST_PART: usize = 96 * 1024;

/// How far before the end of the buffer the search for a split point starts.
const NEAR_END: usize = 1024;

/// A part of the file.
struct Part {
    number: usize,
    offset: u64,
    bytes: Vec<u8>,
    /// Room for its lines.
    lines: Vec<u8>,
    /// The modes before this part, and where to send those after it.
    modes: Receiver<Modes>,
    next: SyncSender<Modes>,
}

/// Lines and account of a part.
struct Listed {
    number: usize,
    lines: Vec<u8>,
    account: Counters,
    /// Its bytes, for the next part.
    buffer: Vec<u8>,
}

/// What is left for one thread: bytes without a split point, and what is
/// known before them.
pub(super) struct Rest {
    pub(super) offset: u64,
    pub(super) bytes: Vec<u8>,
    pub(super) modes: Modes,
    pub(super) account: Counters,
    /// The failure of the input, after all this.
    pub(super) failure: Option<Failure>,
}

/// Lists the input with `jobs` threads, and passes the lines of each part to `write`. Returns what
/// is left for one thread: at least the bytes after the last split point.
pub(super) fn list<F>(
    input: &mut Input,
    style: Style,
    jobs: usize,
    mut write: impl FnMut(&[u8]) -> Result<(), Failure>,
) -> Result<Rest, Failure>
where
    F: Framing,
    for<'a> F::Frame<'a>: Shown,
{
    let part_len = LISTED / jobs;
    let (parts, queue) = mpsc::channel::<Part>();
    let (done, results) = mpsc::channel();
    let queue = Mutex::new(queue);
    thread::scope(|scope| {
        for _ in 0..jobs {
            let (queue, done) = (&queue, done.clone());
            scope.spawn(move || work::<F>(queue, &done, style));
        }
        drop(done);
        let (first, modes) = mpsc::sync_channel(1);
        // The channel has room.
        let _ = first.send(Modes::default());
        let mut reading =
            Reading { input, rest: Vec::new(), offset: 0, is_over: false, failure: None, modes };
        let mut writing = Writing::default();
        let (mut sent, mut written, mut under_way) = (0, 0, 0);
        loop {
            // One part more than threads, so that none waits for the reader; fewer if
            // they are long, because their lines are held in memory.
            while sent <= written + jobs && under_way <= LISTED && !reading.is_over {
                let room = writing.spare.pop().unwrap_or_default();
                match reading.next_part::<F>(part_len, room, sent) {
                    Ok(Some(part)) => {
                        sent += 1;
                        under_way += part.bytes.len();
                        // The workers live as long as this end of the queue.
                        let _ = parts.send(part);
                    }
                    Ok(None) => {}
                    Err(failure) => {
                        reading.is_over = true;
                        reading.failure = Some(failure);
                    }
                }
            }
            if written == sent {
                break;
            }
            // The workers live as long as the queue.
            let Ok(listed) = results.recv() else { break };
            writing.waiting.insert(listed.number, listed);
            while let Some(listed) = writing.waiting.remove(&written) {
                written += 1;
                under_way -= listed.buffer.len();
                writing.account += listed.account;
                if let Err(failure) = write(&listed.lines) {
                    // The reader of the output is gone: stop.
                    drop(parts);
                    return Err(failure);
                }
                let (mut buffer, mut lines) = (listed.buffer, listed.lines);
                buffer.clear();
                lines.clear();
                // Room for a long part is not kept.
                buffer.shrink_to(2 * part_len);
                lines.shrink_to(2 * GROWTH * part_len);
                writing.spare.push((buffer, lines));
            }
        }
        drop(parts);
        let modes = reading.modes.recv().unwrap_or_default();
        Ok(Rest {
            offset: reading.offset,
            bytes: reading.rest,
            modes,
            account: writing.account,
            failure: reading.failure,
        })
    })
}

/// What has been listed.
#[derive(Default)]
struct Writing {
    /// Finished parts that wait for an earlier one.
    waiting: BTreeMap<usize, Listed>,
    account: Counters,
    /// Buffers for bytes and lines, reused: the system would zero new ones.
    spare: Vec<(Vec<u8>, Vec<u8>)>,
}

/// The input, cut into parts.
struct Reading<'a> {
    input: &'a mut Input,
    /// Bytes read behind the last part.
    rest: Vec<u8>,
    /// Their offset.
    offset: u64,
    is_over: bool,
    failure: Option<Failure>,
    /// The modes after the last part.
    modes: Receiver<Modes>,
}

impl Reading<'_> {
    /// The next part; `None` when the input has ended, or has no split point for too long.
    fn next_part<F: Framing>(
        &mut self,
        part_len: usize,
        (mut bytes, lines): (Vec<u8>, Vec<u8>),
        number: usize,
    ) -> Result<Option<Part>, Failure> {
        let mut len = part_len;
        let end = loop {
            if !self.is_over {
                self.is_over = self.input.fill(&mut self.rest, len)?;
            }
            // Little is left after the split point, because it has to be copied.
            let near = |back: usize| {
                stream::split_point::<F>(&self.rest, self.rest.len().saturating_sub(back))
            };
            match near(NEAR_END).or_else(|| near(part_len / 2)) {
                Some(end) => break end,
                None if self.is_over => return Ok(None),
                None if self.rest.len() >= LONGEST_PART => {
                    self.is_over = true;
                    return Ok(None);
                }
                None => len = self.rest.len() + part_len / 2,
            }
        };
        bytes.extend_from_slice(self.rest.get(end..).unwrap_or_default());
        self.rest.truncate(end);
        core::mem::swap(&mut bytes, &mut self.rest);
        let (next, modes) = mpsc::sync_channel(1);
        let modes = core::mem::replace(&mut self.modes, modes);
        let offset = self.offset;
        self.offset += end as u64;
        Ok(Some(Part { number, offset, bytes, lines, modes, next }))
    }
}

/// Lists parts until there are no more.
fn work<F>(queue: &Mutex<Receiver<Part>>, done: &Sender<Listed>, style: Style)
where
    F: Framing,
    for<'a> F::Frame<'a>: Shown,
{
    loop {
        let next = match queue.lock() {
            Ok(queue) => queue.recv(),
            Err(_) => return,
        };
        let Ok(part) = next else { return };
        if done.send(lines::<F>(part, style)).is_err() {
            return;
        }
    }
}

fn lines<F>(part: Part, style: Style) -> Listed
where
    F: Framing,
    for<'a> F::Frame<'a>: Shown,
{
    let mut learned = Modes::default();
    Frames::<F>::new(&part.bytes).each(|frame| frame.teach(&mut learned));
    let mut sheet = Sheet::new(Some(style));
    sheet.out.0 = part.lines;
    sheet.modes = part.modes.recv().unwrap_or_default();
    let mut after = sheet.modes;
    after.update(&learned);
    // The next part, or the reading thread, waits for them.
    let _ = part.next.send(after);
    let mut stream = StreamOf::<F>::new(part.offset);
    stream.feed(&part.bytes, None, &mut sheet);
    let account = stream.counters();
    Listed { number: part.number, lines: sheet.out.0, account, buffer: part.bytes }
}
