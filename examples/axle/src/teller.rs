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

use crate::{failure::Failure, freely::freely};

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
    /// Longest pause of the reader in taking the last lines.
    farewell: Duration,
    /// Why a line could not be written, once it is known.
    failure: Option<io::Error>,
}

impl Teller {
    pub(crate) fn new() -> Self {
        Self::to(|line| write_line(&line))
    }

    fn to(mut print: impl FnMut(String) -> io::Result<()> + Send + 'static) -> Self {
        let (lines, queue) = mpsc::sync_channel::<String>(QUEUE);
        let (ended, end) = mpsc::channel();
        let printed = Arc::new(AtomicU64::new(0));
        let count = Arc::clone(&printed);
        thread::spawn(move || {
            let print = |line: String| {
                count.fetch_add(1, Ordering::Relaxed);
                print(line)
            };
            // Fails only if the `Teller` is gone.
            let _ = ended.send(queue.iter().try_for_each(print));
        });
        Self { lines, printed, end, has_lost_lines: false, farewell: FAREWELL, failure: None }
    }

    /// One whose lines go to memory.
    #[cfg(all(test, unix))]
    pub(crate) fn to_memory() -> (Self, Arc<std::sync::Mutex<Vec<String>>>) {
        let told = Arc::<std::sync::Mutex<Vec<String>>>::default();
        let lines = Arc::clone(&told);
        let print = move |line| {
            lines.lock().map_err(|_| io::ErrorKind::Other)?.push(line);
            Ok(())
        };
        // However busy the machine is.
        (Self { farewell: Duration::from_secs(600), ..Self::to(print) }, told)
    }

    /// One whose output is full.
    #[cfg(test)]
    pub(crate) fn that_fails() -> Self {
        Self::to(|_| Err(io::ErrorKind::StorageFull.into()))
    }

    /// Queues a line for the reader.
    ///
    /// Fails if an earlier line could not be written.
    pub(crate) fn say(&mut self, line: String) -> Result<(), Failure> {
        match self.lines.try_send(line) {
            Ok(()) => {}
            Err(TrySendError::Full(_)) => self.has_lost_lines = true,
            Err(TrySendError::Disconnected(_)) => {
                let failure = self.failure.get_or_insert_with(|| {
                    let error = self.end.try_recv().ok().and_then(Result::err);
                    error.unwrap_or(io::ErrorKind::BrokenPipe.into())
                });
                // Some callers ignore this error, so it is returned again at the end.
                return Err(Failure::Write(match failure.raw_os_error() {
                    Some(code) => io::Error::from_raw_os_error(code),
                    None => failure.kind().into(),
                }));
            }
        }
        Ok(())
    }

    /// Waits for the last lines to be read, as long as the reader goes on. Fails if any line could
    /// not be written.
    pub(crate) fn finish(self) -> Result<(), Failure> {
        let Self { lines, printed, end, has_lost_lines, farewell, failure } = self;
        if let Some(error) = failure {
            return Err(Failure::Write(error));
        }
        drop(lines);
        let mut before = printed.load(Ordering::Relaxed);
        let error = loop {
            let stalled = || io::Error::new(io::ErrorKind::TimedOut, "the reader has stalled");
            match end.recv_timeout(farewell) {
                Ok(Ok(())) if !has_lost_lines => return Ok(()),
                // The printing thread is gone without a result: it has panicked.
                Err(RecvTimeoutError::Disconnected) => break io::ErrorKind::Other.into(),
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
    freely(|| write_line(line))
}

fn write_line(line: &str) -> io::Result<()> {
    let mut out = io::stdout().lock();
    writeln!(out, "{line}").and_then(|()| out.flush())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn line() -> String {
        "line".to_owned()
    }

    /// The result, and whether it came at once.
    fn finished(teller: Teller) -> Result<(), String> {
        teller.finish().map_err(|failure| failure.to_string())
    }

    #[test]
    fn a_line_that_cannot_be_written_is_told_at_the_end_and_to_those_who_go_on() {
        let mut teller = Teller::that_fails();
        teller.say(line()).unwrap();
        assert!(finished(teller).unwrap_err().starts_with("cannot write the output: "));
        let mut teller = Teller::that_fails();
        let told = (0..1_000_000).find_map(|_| {
            thread::yield_now();
            teller.say(line()).err()
        });
        let told = told.expect("the failure is known once the thread has run");
        assert!(told.to_string().starts_with("cannot write the output: "));
        let again = finished(teller).unwrap_err();
        assert!(
            again.starts_with("cannot write the output: "),
            "nobody may have listened: {again}"
        );
    }

    #[test]
    #[ignore = "real time"]
    fn a_reader_that_is_slow_is_waited_for_and_one_that_has_stalled_is_not() {
        let mut slow = Teller::to(|_| {
            thread::sleep(FAREWELL / 2);
            Ok(())
        });
        (0..3).for_each(|_| slow.say(line()).unwrap());
        assert_eq!(finished(slow), Ok(()));
        let (go_on, wait) = mpsc::channel::<()>();
        let mut stalled = Teller::to(move |_| {
            let _ = wait.recv();
            Ok(())
        });
        stalled.say(line()).unwrap();
        let says = "cannot write the output: the reader has stalled";
        assert_eq!(finished(stalled).unwrap_err(), says);
        drop(go_on);
    }

    #[test]
    fn lines_for_which_there_was_no_room_are_told_at_the_end() {
        let (go_on, wait) = mpsc::channel::<()>();
        let mut teller = Teller::to(move |_| {
            let _ = wait.recv();
            Ok(())
        });
        // One more may be on its way to the reader.
        (0..QUEUE + 2).for_each(|_| teller.say(line()).unwrap());
        drop(go_on);
        let says = "cannot write the output: the reader has stalled";
        assert_eq!(finished(teller).unwrap_err(), says);
    }

    #[test]
    #[ignore = "real time"]
    fn ten_thousand_lines_wait_for_a_reader_that_stalls_for_a_while() {
        let (go_on, wait) = mpsc::channel::<()>();
        let mut teller = Teller::to(move |_| {
            let _ = wait.recv();
            Ok(())
        });
        (0..10_000).for_each(|_| teller.say(line()).unwrap());
        drop(go_on);
        assert_eq!(finished(teller), Ok(()));
    }
}
