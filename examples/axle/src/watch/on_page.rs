//! The page of `axle watch`.

use std::io;

use axlewire::{drive::Clock, stream::Framing, time::Instant};

use super::{
    args::Watched,
    dashboard::Dashboard,
    feed::{Feed, Source},
    model::{Heard, Model},
    page::View,
    recorder::Recorder,
    screen::{self, Sink},
    udp::Udp,
};
use crate::{
    failure::Failure,
    line::{Line, PATIENCE},
    listing::Table,
    pcapng::Stamp,
    signals::{self, Signals},
};

/// Room for bytes that arrive while a slow terminal delays us.
const BUFFER_LEN: usize = 16 * 1024;

pub(super) fn watch<F>(watched: &Watched<'_>) -> Result<(), Failure>
where
    F: Framing,
    for<'a> F::Frame<'a>: Heard,
{
    // All of them: none may end the tool with the page still on the terminal.
    let signals = Signals::listen_to_all()?;
    let mut line = Line::connect(watched.port, watched.baud)?;
    let udp = Udp::new(watched)?;
    let recorder = Recorder::<F>::new(watched)?;
    let mut clock = line.clock();
    let start = clock.now();
    let table = Table::new(watched.protocol, start);
    let feed = Feed::new(Model::new(watched.protocol), Some(table));
    let view = View {
        title: title("watch", line.path(), watched.protocol.name(), watched.baud),
        baud: watched.baud,
        is_ascii: screen::is_ascii(),
        ..View::default()
    };
    let dashboard = Dashboard::open(feed, view, Sink::default())?;
    let stamp = Stamp::new();
    let mut watch = Watch { watched, dashboard, recorder, udp, stamp, start, failed: None };
    watch.show_recording();
    let broken = watch.run(&mut line, &mut clock, &signals);

    let recorded = watch.recorder.finish();
    let sent = watch.udp.finish();
    let feed = watch.dashboard.leave();
    let counters = feed.counters();
    let mut out = io::stdout().lock();
    if let Some(mut table) = feed.into_table() {
        table.finish(&mut out, &counters, clock.now()).map_err(Failure::Write)?;
    }
    broken?;
    watch.failed.map_or(recorded, Err).and(sent)
}

/// Suspends the tool until the terminal listens to it again: not yet after `bg`. Returns `false` if
/// it is to end instead.
fn suspend(signals: &Signals) -> bool {
    loop {
        signals::suspend();
        if signals.is_end() || screen::is_in_front() {
            // A signal in between came from a thread that touched the terminal in the background.
            signals.take_suspension();
            return !signals.is_end();
        }
    }
}

/// The title of a page.
pub(super) fn title(command: &str, path: &str, protocol: &str, baud: u32) -> String {
    format!("axle {command}  {path}  {protocol}  {baud} bit/s")
}

struct Watch<'a, F> {
    watched: &'a Watched<'a>,
    dashboard: Dashboard<F>,
    recorder: Recorder<F>,
    udp: Udp,
    /// A recording and a datagram have the same time.
    stamp: Stamp,
    start: Instant,
    /// Why a recording has failed.
    failed: Option<Failure>,
}

impl<F> Watch<'_, F>
where
    F: Framing,
    for<'a> F::Frame<'a>: Heard,
{
    /// Watches until a key, a signal, a limit or a failure ends it.
    fn run(
        &mut self,
        line: &mut Line,
        clock: &mut impl Clock,
        signals: &Signals,
    ) -> Result<(), Failure> {
        let mut buffer = vec![0; BUFFER_LEN];
        loop {
            if signals.take_suspension() {
                self.dashboard.away(|| suspend(signals))?;
            }
            let frames = self.dashboard.feed.counters().frames;
            if signals.is_end() || self.watched.is_over(self.start, clock.now(), frames) {
                return Ok(());
            }
            let received = line.receive(&mut buffer, PATIENCE)?;
            let now = clock.now().as_micros();
            let micros = self.stamp.micros();
            self.udp.take(received, micros);
            self.dashboard.feed.take(Source::Received, received, now);
            if let Err(failure) = self.recorder.take(received, micros) {
                self.give_up_recording(failure, now);
            }
            while let Some(key) = self.dashboard.key() {
                match key {
                    b'q' => return Ok(()),
                    b'r' => self.switch_recording(now),
                    _ => {}
                }
            }
            self.dashboard.tick(now)?;
        }
    }

    /// Starts or ends a recording.
    fn switch_recording(&mut self, now: u64) {
        let before = self.recorder.path().map(|path| format!("recorded to {path:?}"));
        let switched = match before {
            Some(_) => self.recorder.finish(),
            None => self.recorder.start(),
        };
        if let Err(failure) = switched {
            return self.give_up_recording(failure, now);
        }
        let note = match (before, self.recorder.path()) {
            (Some(before), _) => before,
            (None, Some(path)) => format!("recording to {path:?}"),
            (None, None) => return,
        };
        self.dashboard.feed.model.note(note, now);
        self.show_recording();
    }

    /// A recording that fails does not end the watch; it decides the exit code.
    fn give_up_recording(&mut self, failure: Failure, now: u64) {
        self.recorder.drop_it();
        self.dashboard.feed.model.note(failure.to_string(), now);
        self.failed = Some(failure);
        self.show_recording();
    }

    fn show_recording(&mut self) {
        let file = self.recorder.path().map(|path| path.display().to_string());
        self.dashboard.view.recording = file;
        self.dashboard.renew();
    }
}
