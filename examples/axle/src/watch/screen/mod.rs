//! The terminal: a page of its own, without echo, and the way back from it in any case.
//!
//! Nothing waits for the terminal. A thread writes the newest picture, and a stalled one, such as
//! an ssh without a network, keeps only that thread waiting; pictures that are out of date by then
//! are never written.

mod ansi;
mod keys;
mod panics;
#[cfg(test)]
mod tests;

use std::{
    fs::File,
    io::{self, IsTerminal, Write},
    os::fd::AsFd,
    sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError},
    thread,
    time::{Duration, Instant},
};

use ratatui_core::{buffer::Buffer, layout::Rect};
use rustix::{
    process::getpgrp,
    termios::{self, InputModes, LocalModes, OptionalActions, SpecialCodeIndex, Termios},
};

use crate::failure::Failure;
pub(crate) use keys::{Keys, Sink};

/// Time allowed for the terminal to take the last bytes when the page is left.
const FAREWELL: Duration = Duration::from_millis(500);

/// The largest page, in columns and rows: a terminal can claim any size.
const MAX_SIZE: u16 = 500;

/// The page on the terminal, until it is dropped.
pub(crate) struct Screen {
    desk: Arc<Desk>,
    /// Settings of the terminal from before, if keys are read from it.
    before: Option<Termios>,
    is_left: bool,
}

/// State shared with the thread.
#[derive(Default)]
struct Desk {
    work: Mutex<Work>,
    /// Something on the desk has changed.
    changed: Condvar,
}

#[derive(Default)]
struct Work {
    picture: Option<Buffer>,
    /// The page is to be left.
    is_over: bool,
    /// The thread has ended: with this error, or with the page left.
    outcome: Option<io::Result<()>>,
}

impl Desk {
    fn lock(&self) -> MutexGuard<'_, Work> {
        self.work.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

/// Whether standard output is a terminal that can show a page.
pub(crate) fn is_possible() -> bool {
    let is_dumb = std::env::var_os("TERM").is_none_or(|term| term.is_empty() || term == "dumb");
    io::stdout().is_terminal() && !is_dumb && is_in_front()
}

/// Whether the terminal listens to this process. One in the background must not touch it: each try
/// would only be another signal.
pub(crate) fn is_in_front() -> bool {
    match termios::tcgetpgrp(io::stdout()) {
        Ok(group) => group == getpgrp(),
        // It is not the terminal of this session, so it does not matter.
        Err(_) => true,
    }
}

/// Whether the terminal is likely to show only ASCII.
pub(crate) fn is_ascii() -> bool {
    let variables = ["LC_ALL", "LC_CTYPE", "LANG"];
    let set =
        variables.iter().find_map(|name| std::env::var(name).ok().filter(|it| !it.is_empty()));
    set.is_some_and(|locale| {
        let locale = locale.to_lowercase();
        !locale.contains("utf-8") && !locale.contains("utf8")
    })
}

/// Size of the terminal; `None` if it has none to tell.
pub(crate) fn size() -> Option<Rect> {
    let size = termios::tcgetwinsize(io::stdout()).ok()?;
    Some(Rect::new(0, 0, size.ws_col.min(MAX_SIZE), size.ws_row.min(MAX_SIZE)))
}

impl Screen {
    /// Turns the terminal over to the page.
    pub(crate) fn enter() -> Result<Self, Failure> {
        panics::hold();
        let before = match io::stdin().is_terminal() {
            true => Some(without_echo().map_err(|error| {
                panics::release();
                Failure::Write(error.into())
            })?),
            false => None,
        };
        let desk = Arc::new(Desk::default());
        let of_thread = Arc::clone(&desk);
        thread::spawn(move || {
            let outcome = write(&of_thread);
            of_thread.lock().outcome = Some(outcome);
            of_thread.changed.notify_all();
        });
        Ok(Self { desk, before, is_left: false })
    }

    /// Replaces the picture.
    ///
    /// Fails if the terminal has failed.
    pub(crate) fn show(&self, picture: Buffer) -> Result<(), Failure> {
        let mut work = self.desk.lock();
        if let Some(Err(error)) = &work.outcome {
            let error = io::Error::new(error.kind(), error.to_string());
            return Err(Failure::Write(error));
        }
        work.picture = Some(picture);
        self.desk.changed.notify_all();
        Ok(())
    }

    /// Whether keys come from this terminal.
    pub(crate) const fn has_keys(&self) -> bool {
        self.before.is_some()
    }

    /// Gives the terminal back, as it was. Waits for it only briefly.
    pub(crate) fn leave(&mut self) {
        if core::mem::replace(&mut self.is_left, true) {
            return;
        }
        let end = Instant::now() + FAREWELL;
        let mut work = self.desk.lock();
        work.is_over = true;
        self.desk.changed.notify_all();
        while work.outcome.is_none() {
            let left = end.saturating_duration_since(Instant::now());
            if left.is_zero() {
                break;
            }
            let waited = self.desk.changed.wait_timeout(work, left);
            work = waited.unwrap_or_else(PoisonError::into_inner).0;
        }
        drop(work);
        if let Some(before) = &self.before
            && is_in_front()
        {
            // A terminal that has gone away needs nothing.
            let _ = termios::tcsetattr(io::stdin(), OptionalActions::Now, before);
        }
        panics::release();
    }
}

impl Drop for Screen {
    fn drop(&mut self) {
        self.leave();
    }
}

/// Lets keys through one by one, without echo and without Ctrl-S, which would stall the page. The
/// keys for signals stay what they are. Returns the settings of before.
fn without_echo() -> rustix::io::Result<Termios> {
    let before = termios::tcgetattr(io::stdin())?;
    let mut settings = before.clone();
    settings.local_modes -= LocalModes::ICANON | LocalModes::ECHO | LocalModes::IEXTEN;
    settings.input_modes -= InputModes::IXON;
    settings.special_codes[SpecialCodeIndex::VMIN] = 1;
    settings.special_codes[SpecialCodeIndex::VTIME] = 0;
    termios::tcsetattr(io::stdin(), OptionalActions::Now, &settings)?;
    Ok(before)
}

/// Writes the newest picture, again and again, and the way back at the end.
fn write(desk: &Desk) -> io::Result<()> {
    // Not through `io::stdout()`: whoever else prints would wait for its lock.
    let mut out = File::from(io::stdout().as_fd().try_clone_to_owned()?);
    let mut send = |text: &str| out.write_all(text.as_bytes()).and_then(|()| out.flush());
    send(ansi::ENTER)?;
    let mut shown = Buffer::empty(Rect::ZERO);
    loop {
        let mut work = desk.lock();
        while work.picture.is_none() && !work.is_over {
            work = desk.changed.wait(work).unwrap_or_else(PoisonError::into_inner);
        }
        if work.is_over {
            break;
        }
        let picture = work.picture.take();
        drop(work);
        if let Some(picture) = picture {
            send(&ansi::change(&shown, &picture))?;
            shown = picture;
        }
    }
    send(ansi::LEAVE)
}
