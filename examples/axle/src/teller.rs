//! Output lines while something moves, printed by a separate thread: a stalled reader, such as a
//! terminal after Ctrl-S, must not keep a stop from being sent.

use std::{
    io::{self, Write},
    sync::mpsc::{self, Receiver, RecvTimeoutError, SyncSender, TrySendError},
    thread,
    time::Duration,
};

use crate::failure::Failure;

/// Number of lines that may wait for the reader: half a minute of output. Further lines are lost.
const QUEUE: usize = 128;

/// Time allowed for the reader to take the last lines when the tool exits.
const FAREWELL: Duration = Duration::from_millis(500);

/// Prints lines without ever waiting for the reader.
pub(crate) struct Teller {
    lines: SyncSender<String>,
    /// Result of the printing thread; `Ok` when no more lines can come.
    end: Receiver<io::Result<()>>,
    has_lost_lines: bool,
}

impl Teller {
    pub(crate) fn new() -> Self {
        let (lines, queue) = mpsc::sync_channel::<String>(QUEUE);
        let (ended, end) = mpsc::channel();
        thread::spawn(move || {
            let print = |line: String| print(&line);
            // Fails only if the `Teller` is gone.
            let _ = ended.send(queue.iter().try_for_each(print));
        });
        Self { lines, end, has_lost_lines: false }
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

    /// Waits briefly for the last lines to be read.
    pub(crate) fn finish(self) -> Result<(), Failure> {
        let Self { lines, end, has_lost_lines } = self;
        drop(lines);
        match end.recv_timeout(FAREWELL) {
            Ok(Ok(())) if !has_lost_lines => Ok(()),
            Ok(Err(error)) => Err(Failure::Write(error)),
            // `say` has already reported the error.
            Err(RecvTimeoutError::Disconnected) => Ok(()),
            Ok(Ok(())) | Err(RecvTimeoutError::Timeout) => {
                let error = io::Error::new(io::ErrorKind::TimedOut, "the reader has stalled");
                Err(Failure::Write(error))
            }
        }
    }
}

/// Prints a line at once, however long the reader takes; for use while nothing moves.
pub(crate) fn print(line: &str) -> io::Result<()> {
    let mut out = io::stdout().lock();
    writeln!(out, "{line}").and_then(|()| out.flush())
}
