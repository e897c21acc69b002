//! One line per second, for pipes and plain terminals.

use std::{io, time::Duration as Span};

use axlewire::{
    drive::Clock,
    stream::{Decoder, Framing},
    time::Duration,
};

use super::{args::Watched, recorder::Recorder, udp::Udp};
use crate::{
    decode::BUFFER_LEN,
    failure::Failure,
    line::{Line, PATIENCE, QUIET},
    listing::{Shown, Table},
    pcapng::Stamp,
    signals::Signals,
};

/// Interval at which a line is printed.
const PRINT_PERIOD: Duration = Duration::from_secs(1);

pub(super) fn watch<F>(watched: &Watched<'_>) -> Result<(), Failure>
where
    F: Framing,
    for<'a> F::Frame<'a>: Shown,
{
    let signals = Signals::listen()?;
    let mut line = Line::connect(watched.port, watched.baud)?;
    let mut udp = Udp::new(watched)?;
    let mut recorder = Recorder::<F>::new(watched)?;
    // A recording and a datagram have the same time.
    let stamp = Stamp::new();
    let clock = line.clock();
    let mut buffer = [0; 4096];
    let mut out = io::stdout().lock();
    let mut decoder = Decoder::<F, BUFFER_LEN>::new();
    let start = clock.now();
    let mut table = Table::new(watched.protocol, start);
    let (mut print_at, mut heard_at) = (start + PRINT_PERIOD, start);

    let mut lost = Ok(());
    let broken = loop {
        let frames = decoder.counters().frames;
        if signals.is_raised() || watched.is_over(start, clock.now(), frames) {
            break Ok(());
        }
        let to_print = Span::from_micros((print_at - clock.now()).as_micros().into());
        let received = match line.receive(&mut buffer, to_print.min(PATIENCE)) {
            Ok(received) => received,
            Err(failure) => break Err(failure),
        };
        let now = clock.now();
        if !received.is_empty() {
            heard_at = now;
        } else if now >= heard_at + QUIET && decoder.pending() > 0 {
            decoder.idle();
        }
        // A recording that fails does not end the watch; it decides the exit code.
        let micros = stamp.micros();
        if let Err(failure) = recorder.take(received, micros) {
            recorder.drop_it();
            lost = Err(failure);
        }
        udp.take(received, micros);
        table.take(&mut decoder, received);
        if now >= print_at {
            print_at = now + PRINT_PERIOD;
            table.measure(now);
            let counters = decoder.counters();
            let printed = match watched.args.json {
                true => table.print_json(&mut out, "second", &counters, now),
                false => table.print_line(&mut out, &counters, now),
            };
            printed.map_err(Failure::Write)?;
        }
    };
    let recorded = recorder.finish();
    let sent = udp.finish();
    let (counters, now) = (decoder.counters(), clock.now());
    let told = if watched.args.json {
        table.measure_all(now);
        table.print_json(&mut out, "summary", &counters, now)
    } else {
        table.finish(&mut out, &counters, now)
    };
    told.map_err(Failure::Write)?;
    broken?;
    lost.and(recorded).and(sent)
}
