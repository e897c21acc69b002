//! Lines of output while something moves, from a thread of their own: a reader that does not read,
//! such as a terminal after Ctrl-S, must not keep a stop from being sent.

use std::{
    io::{self, Write},
    sync::mpsc::{self, Receiver, RecvTimeoutError, SyncSender, TrySendError},
    thread,
    time::Duration,
};

use crate::failure::Failure;

/// Lines that wait for the reader: half a minute of them. Those that find no room are lost.
const QUEUE: usize = 128;

/// Time that the reader has for the last lines when the tool ends.
const FAREWELL: Duration = Duration::from_millis(500);

/// Prints lines without ever waiting for their reader.
pub(crate) struct Teller {
    lines: SyncSender<String>,
    /// Why the printing has ended. It ends well when no more lines can come.
    end: Receiver<io::Result<()>>,
    has_lost_lines: bool,
}

impl Teller {
    pub(crate) fn new() -> Self {
        let (lines, queue) = mpsc::sync_channel::<String>(QUEUE);
        let (ended, end) = mpsc::channel();
        thread::spawn(move || {
            let print = |line: String| print(&line);
            // Whoever started this has gone if nobody takes it.
            let _ = ended.send(queue.iter().try_for_each(print));
        });
        Self { lines, end, has_lost_lines: false }
    }

    /// Prints a line when the reader takes it.
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

    /// Waits a moment for the last lines to be read.
    pub(crate) fn finish(self) -> Result<(), Failure> {
        let Self { lines, end, has_lost_lines } = self;
        drop(lines);
        match end.recv_timeout(FAREWELL) {
            Ok(Ok(())) if !has_lost_lines => Ok(()),
            Ok(Err(error)) => Err(Failure::Write(error)),
            // An error that `say` has reported already.
            Err(RecvTimeoutError::Disconnected) => Ok(()),
            Ok(Ok(())) | Err(RecvTimeoutError::Timeout) => {
                let error = io::Error::new(io::ErrorKind::TimedOut, "its reader does not read");
                Err(Failure::Write(error))
            }
        }
    }
}

/// Prints a line at once, however long its reader takes: for when nothing moves.
pub(crate) fn print(line: &str) -> io::Result<()> {
    let mut out = io::stdout().lock();
    writeln!(out, "{line}").and_then(|()| out.flush())
}
