//! `axle ping`: measures round trips to a rover.

use std::fmt;

use axlewire::{
    time::{Duration, Instant},
    ucp::{
        host::{HostConfig, HostEvent},
        message::ErrorCode,
    },
};
use serde::Serialize;

use crate::{
    args,
    failure::Failure,
    help::EXIT_CODES,
    report::Form,
    rover::{CALL_PERIOD, Rover},
    signals::Signals,
    teller,
};

/// Measure round trips to a rover
///
/// Sends a ping every --every seconds, prints the round trip of each pong, and at the end the
/// shortest, the mean and the longest, and how many pings were lost. A ping that is not answered
/// within 0.5 s counts as lost, and the next one waits until then. A pong does not say which ping
/// it answers: one that comes even later is taken for that of the next ping. The times include
/// those of the bytes on the line and of the adapter.
///
/// The first frame is a stop, and stops are repeated every 0.1 s (ruling U16): a rover that is
/// driven by another program stops, and its lamp goes off. Nothing moves because of this
/// subcommand.
///
/// The exit code is 1 if no ping was answered.
#[derive(Debug, clap::Args)]
#[command(after_help = EXIT_CODES)]
pub(crate) struct Args {
    #[command(flatten)]
    line: args::PortArgs,

    /// End when this many pings were answered or lost; by default 10, unless --for is given
    #[arg(short, long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    count: Option<u32>,

    /// End after this time, seconds
    #[arg(short = 'f', long = "for", value_name = "SECONDS", value_parser = args::seconds)]
    micros: Option<u64>,

    /// Interval between two pings, seconds, 0.01 to 60
    #[arg(long, value_name = "SECONDS", default_value = "0.2", value_parser = interval)]
    every: Duration,

    /// Print one JSON object per line
    #[arg(short, long)]
    json: bool,
}

/// Number of pings without --count and --for.
const DEFAULT_COUNT: u32 = 10;

fn interval(text: &str) -> Result<Duration, String> {
    args::time_within(text, 0.01, 60.0)
}

/// What is measured.
#[derive(Debug, Serialize)]
#[serde(tag = "event", rename_all = "snake_case")]
enum Event {
    Pong {
        round_trip_us: u32,
        /// Whether the ping arrived damaged (ruling U12).
        damaged: bool,
    },
    Lost,
    Summary {
        pings: u32,
        pongs: u32,
        lost: u32,
        #[serde(skip_serializing_if = "Option::is_none")]
        min_us: Option<u32>,
        #[serde(skip_serializing_if = "Option::is_none")]
        mean_us: Option<u32>,
        #[serde(skip_serializing_if = "Option::is_none")]
        max_us: Option<u32>,
    },
}

impl fmt::Display for Event {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let millis = |micros: u32| f64::from(micros) / 1e3;
        match *self {
            Self::Pong { round_trip_us, damaged } => {
                write!(f, "pong after {:.2} ms", millis(round_trip_us))?;
                f.write_str(if damaged { "; the ping arrived damaged" } else { "" })
            }
            Self::Lost => f.write_str("no pong"),
            Self::Summary { pings, pongs, lost, min_us, mean_us, max_us } => {
                write!(f, "{pings} pings, {pongs} pongs, {lost} lost")?;
                let (Some(min), Some(mean), Some(max)) = (min_us, mean_us, max_us) else {
                    return Ok(());
                };
                let [min, mean, max] = [min, mean, max].map(millis);
                write!(f, "; round trip: min {min:.2}, mean {mean:.2}, max {max:.2} ms")
            }
        }
    }
}

/// Runs the subcommand.
pub(crate) fn run(args: &Args) -> Result<(), Failure> {
    let signals = Signals::listen()?;
    let mut config = HostConfig::default();
    config.ping_period = Some(args.every);
    let mut rover = Rover::open_with(&args.line, config)?;
    let (form, start) = (Form::of(args.json), rover.now());
    let end = args.micros.map(|micros| Instant::from_micros(start.as_micros() + micros));
    let count = args.count.or(args.micros.is_none().then_some(DEFAULT_COUNT));
    let mut lost = 0;
    let broken = loop {
        let now = rover.now();
        let seen = rover.host().statistics();
        let settled = seen.round_trip.count().saturating_add(seen.pings_lost);
        let is_over =
            count.is_some_and(|count| settled >= count) || end.is_some_and(|end| now >= end);
        if is_over || signals.is_raised() {
            break Ok(());
        }
        let until = end.map_or(now + CALL_PERIOD, |end| end.min(now + CALL_PERIOD));
        let mut pongs = Vec::new();
        let result = rover.round_with(until, |event| {
            if let HostEvent::Pong { round_trip, err } = event {
                let damaged = *err != ErrorCode::Fine;
                pongs.push(Event::Pong { round_trip_us: round_trip.as_micros(), damaged });
            }
        });
        let lost_by_now = rover.host().statistics().pings_lost;
        // A round is shorter than the time after which a ping is lost: the loss came first.
        let events = (lost..lost_by_now).map(|_| Event::Lost).chain(pongs);
        lost = lost_by_now;
        let micros = rover.now().as_micros().saturating_sub(start.as_micros());
        for event in events {
            teller::print(&form.line(micros, &event)).map_err(Failure::Write)?;
        }
        if let Err(failure) = result {
            break Err(failure);
        }
    };
    let seen = *rover.host().statistics();
    let times = &seen.round_trip;
    let [min_us, mean_us, max_us] =
        [times.min(), times.mean(), times.max()].map(|time| time.map(Duration::as_micros));
    // A ping that is still under way at the end is neither answered nor lost.
    let (pongs, lost) = (times.count(), seen.pings_lost);
    let pings = pongs.saturating_add(lost);
    let summary = Event::Summary { pings, pongs, lost, min_us, mean_us, max_us };
    teller::print(&form.plain(&summary)).map_err(Failure::Write)?;
    broken?;
    rover.check_recording()?;
    if pongs == 0 && lost > 0 {
        return Err(Failure::Failed(format!("no robot answers on {:?}", args.line.port)));
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_are_told_in_milliseconds() {
        let pong = |damaged| Event::Pong { round_trip_us: 12_345, damaged }.to_string();
        assert_eq!(pong(false), "pong after 12.35 ms");
        assert_eq!(pong(true), "pong after 12.35 ms; the ping arrived damaged");
        let summary = |min_us, mean_us, max_us| {
            Event::Summary { pings: 5, pongs: 3, lost: 2, min_us, mean_us, max_us }.to_string()
        };
        let counts = "5 pings, 3 pongs, 2 lost";
        assert_eq!(summary(None, None, None), counts);
        let times = "; round trip: min 0.50, mean 2.00, max 10.25 ms";
        assert_eq!(summary(Some(500), Some(2000), Some(10_250)), format!("{counts}{times}"));
    }
}
