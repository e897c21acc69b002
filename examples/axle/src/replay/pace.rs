//! When each frame of a capture is due: its distance from the frame before, not from the first one,
//! because the clock of a capture may have been set meanwhile.

use std::time::Duration;

use humantime::format_duration;

/// The times of a capture, as times of a replay.
#[derive(Debug)]
pub(super) struct Pace {
    speed: f64,
    /// Longest pause between two frames, microseconds of the capture.
    longest_us: u64,
    last: Option<u64>,
    /// Microseconds of the capture since its first frame.
    after_us: u64,
    back: Jumps,
    shortened: Jumps,
}

/// Steps of the clock that are not those of the line.
#[derive(Debug, Default)]
struct Jumps {
    count: u64,
    most_us: u64,
}

impl Jumps {
    fn note(&mut self, us: u64) {
        self.count += 1;
        self.most_us = self.most_us.max(us);
    }
}

impl Pace {
    pub(super) fn new(speed: f64, longest_us: u64) -> Self {
        let (back, shortened) = (Jumps::default(), Jumps::default());
        Self { speed, longest_us, last: None, after_us: 0, back, shortened }
    }

    /// When a frame with this time is due, microseconds after the first one. Frames come in the
    /// order of the capture.
    pub(super) fn due_us(&mut self, micros: u64) -> u64 {
        let last = self.last.replace(micros).unwrap_or(micros);
        let step = match micros.checked_sub(last) {
            Some(step) if step > self.longest_us => {
                self.shortened.note(step);
                self.longest_us
            }
            Some(step) => step,
            None => {
                self.back.note(last - micros);
                0
            }
        };
        self.after_us = self.after_us.saturating_add(step);
        (self.after_us as f64 / self.speed) as u64
    }

    /// What is not as in the capture.
    pub(super) fn notes(&self) -> Vec<String> {
        let mut notes = Vec::new();
        let Jumps { count, most_us } = self.back;
        if count > 0 {
            let (times, most) = (if count == 1 { "time" } else { "times" }, span(most_us));
            notes.push(format!(
                "the clock of the capture goes back {count} {times}, by up to {most}: the frame \
                 behind that is sent at once"
            ));
        }
        let Jumps { count, most_us } = self.shortened;
        if count > 0 {
            let (pauses, most) = (if count == 1 { "pause" } else { "pauses" }, span(most_us));
            let longest = span(self.longest_us);
            notes.push(format!(
                "{count} {pauses} of up to {most} shortened to {longest}, see --longest-pause"
            ));
        }
        notes
    }
}

/// In words, without what nobody reads.
fn span(us: u64) -> String {
    let whole = Duration::from_micros(us);
    let rough = match us {
        0..10_000_000 => Duration::from_millis(us.div_ceil(1000)),
        _ => Duration::from_secs(whole.as_secs()),
    };
    format_duration(rough).to_string()
}
