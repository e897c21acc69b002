//! The page while something moves. It only observes: the line's bytes are handed to a thread
//! without ever waiting for it, and the keys that stop raise the same flag as Ctrl-C.

use std::{
    io,
    sync::{
        Arc,
        atomic::{AtomicBool, AtomicU64, Ordering},
        mpsc::{self, Receiver, RecvTimeoutError, SyncSender, TrySendError},
    },
    thread,
    time::{Duration, Instant},
};

use axlewire::stream::Framing;

use super::{
    dashboard::Dashboard,
    feed::{Feed, Source},
    model::{Heard, Model},
    on_page::title,
    page::{Role, View},
    screen::{self, Sink},
};
use crate::{args::Protocol, failure::Failure, line::Line, pcapng::Direction, signals::Signals};

/// Number of updates that may wait for the page: more than a second of a full bus.
const QUEUE: usize = 16 * 1024;

/// Longest wait of the page for updates, so that keys and the terminal's size are noticed.
const PATIENCE: Duration = Duration::from_millis(50);

/// Time allowed for the page to end, longer than for its terminal.
const FAREWELL: Duration = Duration::from_secs(1);

/// An update for the page, and its time, microseconds.
struct News(u64, What);

enum What {
    Bytes(Source, Box<[u8]>),
    /// A line for the log.
    Note(String),
    /// What moves was told to stop.
    Stopping,
}

/// The page, until it is left or dropped.
pub(crate) struct Live {
    tell: Tell,
    is_over: Arc<AtomicBool>,
    /// Result of the page's thread.
    end: Receiver<Result<(), Failure>>,
    is_left: bool,
}

impl Live {
    /// Shows the page of this command, for the line from [`tap`](Self::tap).
    pub(crate) fn open<F>(
        command: &str,
        path: &str,
        protocol: Protocol,
        baud: u32,
        signals: &Signals,
    ) -> Result<Self, Failure>
    where
        F: Framing,
        for<'a> F::Frame<'a>: Heard,
    {
        if !screen::is_possible() {
            let line = "--page needs a terminal as standard output, in the foreground";
            return Err(Failure::Usage(line.to_owned()));
        }
        let view = View {
            title: title(command, path, protocol.name(), baud),
            baud,
            is_ascii: screen::is_ascii(),
            role: Role::Moving,
            ..View::default()
        };
        let (news, queue) = mpsc::sync_channel(QUEUE);
        let (ended, end) = mpsc::channel();
        let (opened, is_open) = mpsc::channel();
        let is_over = Arc::new(AtomicBool::new(false));
        let tell = Tell { news, lost: Arc::default(), start: Instant::now() };
        let looker = Looker {
            queue,
            lost: Arc::clone(&tell.lost),
            is_over: Arc::clone(&is_over),
            start: tell.start,
        };
        let stop = StopAtTheEnd(signals.end_flag());
        thread::spawn(move || {
            let feed = Feed::<F>::new(Model::new(protocol), None);
            let sink = Sink { stop: Some(Arc::clone(&stop.0)) };
            let shown = Dashboard::open(feed, view, sink).and_then(|dashboard| {
                // Fails only if the `Live` is gone.
                let _ = opened.send(());
                looker.look_on(dashboard)
            });
            drop(stop);
            let _ = ended.send(shown);
        });
        let live = Self { tell, is_over, end, is_left: false };
        match is_open.recv() {
            Ok(()) => Ok(live),
            // Its thread has ended, so there is a result.
            Err(_) => Err(live.end.recv().ok().and_then(Result::err).unwrap_or_else(given_up)),
        }
    }

    /// The same line; the page is told of its bytes.
    pub(crate) fn tap(&self, line: Line) -> Line {
        self.tell.clone().tap(line)
    }

    /// Adds a line to the log of the page.
    pub(crate) fn note(&self, text: String) {
        self.tell.tell(What::Note(text));
    }

    /// Shows that what moves was told to stop.
    pub(crate) fn stopping(&self) {
        self.tell.tell(What::Stopping);
    }

    /// Leaves the page, so that lines can be printed again. Fails if the terminal has failed.
    pub(crate) fn leave(&mut self) -> Result<(), Failure> {
        if core::mem::replace(&mut self.is_left, true) {
            return Ok(());
        }
        self.is_over.store(true, Ordering::SeqCst);
        match self.end.recv_timeout(FAREWELL) {
            Ok(shown) => shown,
            Err(RecvTimeoutError::Disconnected) => Err(given_up()),
            Err(RecvTimeoutError::Timeout) => {
                let error = io::Error::new(io::ErrorKind::TimedOut, "the terminal has stalled");
                Err(Failure::Write(error))
            }
        }
    }
}

#[cfg(test)]
impl Live {
    /// A page that has given up.
    pub(crate) fn that_gave_up() -> Self {
        let (tell, _) = Tell::to_memory();
        Self { tell, is_over: Arc::default(), end: mpsc::channel().1, is_left: false }
    }
}

impl Drop for Live {
    fn drop(&mut self) {
        // Another failure is reported already.
        drop(self.leave());
    }
}

fn given_up() -> Failure {
    Failure::Failed("the tool has a bug: its page gave up".to_owned())
}

/// Without the page there is no view of what moves and no key to stop it, so its end stops that.
struct StopAtTheEnd(Arc<AtomicBool>);

impl Drop for StopAtTheEnd {
    fn drop(&mut self) {
        self.0.store(true, Ordering::SeqCst);
    }
}

/// Hands updates to the page.
#[derive(Clone)]
struct Tell {
    news: SyncSender<News>,
    /// Number of bytes lost because the page was too slow.
    lost: Arc<AtomicU64>,
    start: Instant,
}

impl Tell {
    /// Never waits.
    fn tell(&self, what: What) {
        let at = self.start.elapsed().as_micros() as u64;
        if let Err(TrySendError::Full(News(_, What::Bytes(_, bytes)))) =
            self.news.try_send(News(at, what))
        {
            self.lost.fetch_add(bytes.len() as u64, Ordering::Relaxed);
        }
    }

    /// The same line, whose bytes are told.
    fn tap(self, line: Line) -> Line {
        line.tapped(move |direction, bytes| match direction {
            Direction::In => self.tell(What::Bytes(Source::Received, bytes.into())),
            Direction::Out => self.tell(What::Bytes(Source::Sent, bytes.into())),
        })
    }
}

/// The thread of the page.
struct Looker {
    queue: Receiver<News>,
    lost: Arc<AtomicU64>,
    is_over: Arc<AtomicBool>,
    start: Instant,
}

impl Looker {
    fn look_on<F>(&self, mut dashboard: Dashboard<F>) -> Result<(), Failure>
    where
        F: Framing,
        for<'a> F::Frame<'a>: Heard,
    {
        while !self.is_over.load(Ordering::SeqCst) {
            let first = self.queue.recv_timeout(PATIENCE).ok();
            for News(at, what) in first.into_iter().chain(self.queue.try_iter().take(QUEUE)) {
                match what {
                    What::Bytes(source, bytes) => dashboard.feed.take(source, &bytes, at),
                    What::Note(text) => dashboard.feed.model.note(text, at),
                    What::Stopping => {
                        dashboard.view.role = Role::Stopping;
                        dashboard.renew();
                    }
                }
            }
            let now = self.start.elapsed().as_micros() as u64;
            let lost = self.lost.swap(0, Ordering::Relaxed);
            if lost > 0 {
                let text = format!("the page was too slow for {lost} bytes");
                dashboard.feed.model.note(text, now);
            }
            // The keys that stop have done so already.
            while dashboard.key().is_some() {}
            dashboard.tick(now)?;
        }
        dashboard.leave();
        Ok(())
    }
}

#[cfg(test)]
mod tests;
