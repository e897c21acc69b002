//! Output lines while something moves, printed by a separate thread: a stalled reader, such as a
//! terminal after Ctrl-S, must not keep a stop from being sent.

use std::{
    io::{self, Write},
    sync::{
        Arc,
        atomic::{AtomicU64, Ordering},
        mpsc::{self, Receiver, RecvTimeoutError, SyncSender, TrySendError},
    },
    thread,
    time::Duration,
};

use crate::{failure::Failure, signals};

/// Number of pieces of output that may wait for the reader: seconds of a full bus. Further ones are
/// lost.
const QUEUE: usize = 16 * 1024;

/// Longest pause of the reader in taking the last lines, when the tool exits.
const FAREWELL: Duration = Duration::from_millis(500);

/// Prints lines without ever waiting for the reader.
pub(crate) struct Teller {
    lines: SyncSender<String>,
    /// Number of lines printed.
    printed: Arc<AtomicU64>,
    /// Result of the printing thread; `Ok` when no more lines can come.
    end: Receiver<io::Result<()>>,
    has_lost_lines: bool,
}

impl Teller {
    pub(crate) fn new() -> Self {
        let (lines, queue) = mpsc::sync_channel::<String>(QUEUE);
        let (ended, end) = mpsc::channel();
        let printed = Arc::new(AtomicU64::new(0));
        let count = Arc::clone(&printed);
        thread::spawn(move || {
            let print = |line: String| {
                count.fetch_add(1, Ordering::Relaxed);
                write_line(&line)
            };
            // Fails only if the `Teller` is gone.
            let _ = ended.send(queue.iter().try_for_each(print));
        });
        Self { lines, printed, end, has_lost_lines: false }
    }

    /// Queues a line for the reader.
    ///
    /// Fails if an earlier line could not be written.
    pub(crate) fn say(&mut self, line: String) -> Result<(), Failure> {
        match self.lines.try_send(line) {
            Ok(()) => {}
            Err(TrySendError::Full(_)) => self.has_lost_lines = true,
            Err(TrySendError::Disconnected(_)) => {
                let error = self.end.try_recv().ok().and_then(Result::err);
                return Err(Failure::Write(error.unwrap_or(io::ErrorKind::BrokenPipe.into())));
            }
        }
        Ok(())
    }

    /// Waits for the last lines to be read, as long as the reader goes on.
    pub(crate) fn finish(self) -> Result<(), Failure> {
        let Self { lines, printed, end, has_lost_lines } = self;
        drop(lines);
        let mut before = printed.load(Ordering::Relaxed);
        let error = loop {
            let stalled = || io::Error::new(io::ErrorKind::TimedOut, "the reader has stalled");
            match end.recv_timeout(FAREWELL) {
                Ok(Ok(())) if !has_lost_lines => return Ok(()),
                // `say` has already reported the error.
                Err(RecvTimeoutError::Disconnected) => return Ok(()),
                Ok(Err(error)) => break error,
                Ok(Ok(())) => break stalled(),
                Err(RecvTimeoutError::Timeout) => {
                    let now = printed.load(Ordering::Relaxed);
                    if core::mem::replace(&mut before, now) == now {
                        break stalled();
                    }
                }
            }
        };
        Err(Failure::Write(error))
    }
}

/// Prints a line at once, however long the reader takes; for use while nothing moves.
pub(crate) fn print(line: &str) -> io::Result<()> {
    signals::freely(|| write_line(line))
}

fn write_line(line: &str) -> io::Result<()> {
    let mut out = io::stdout().lock();
    writeln!(out, "{line}").and_then(|()| out.flush())
}
