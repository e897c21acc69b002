//! Plays the frames of a plan at their times, and stops what they have moved.

use axlewire::{
    ikeya::{self, three},
    time::{Duration, Instant, wire_time},
};

use super::{
    effect::Effect,
    lister::Lister,
    plan::{Due, Plan},
    summary::Summary,
};
use crate::{
    args::Protocol,
    failure::{Failure, guarded},
    line::Line,
    listing::Modes,
    signals::{Attendance, Signals},
    teller::Teller,
};

/// Who speaks on the line: decides whether what is due may leave, and when.
pub(super) trait Voice: Sized {
    /// Prepares for a plan; `None` if a signal came first. Nothing moves yet.
    fn prepare(plan: &Plan<'_>, line: Line, signals: &Signals) -> Result<Option<Self>, Failure>;

    /// The modes of the nodes, as far as they are known.
    fn modes(&self) -> Modes {
        Modes::default()
    }

    fn now(&mut self) -> Instant;

    /// Whether all that it has taken has left, so that it can take another frame.
    fn is_free(&self) -> bool;

    /// Takes a frame that is due; fails if it may not be sent.
    fn give(&mut self, due: &Due, now: Instant) -> Result<Given, Failure>;

    /// Fails if something does not follow its command any more.
    fn check(&self) -> Result<(), Failure> {
        Ok(())
    }

    /// Runs until then, or until something happens.
    fn round(&mut self, until: Instant) -> Result<(), Failure>;

    /// Stops what was commanded, and says so.
    fn stop(self) -> Result<Vec<String>, Failure>;
}

/// What has become of a frame.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub(super) enum Given {
    /// It has left.
    Sent,
    /// It leaves as soon as the voice is free.
    Taken,
    /// It did not leave whole.
    Lost,
    /// It is not sent: the node that it asks does not answer.
    LeftOut,
}

impl Given {
    /// Of a frame that has left whole, or not.
    pub(super) const fn whole(is_whole: bool) -> Self {
        if is_whole { Self::Sent } else { Self::Lost }
    }
}

/// Time after which a frame that was taken and has not left is lost.
const PATIENCE: Duration = Duration::from_secs(2);

/// Interval in which a frame that is due waits until it is taken, and then until it has left.
const WAIT_PERIOD: Duration = Duration::from_micros(200);

/// Pause between a frame and its answer (ruling I9 asks for 50 us at least).
const TURNAROUND: Duration = Duration::from_micros(200);

/// Sends the frames, then stops what they have moved, whatever happened.
pub(super) fn play<V: Voice>(
    plan: Plan<'_>,
    line: Line,
    teller: Teller,
    signals: &Signals,
) -> Result<(), Failure> {
    let (lister, line) = Lister::tap(&plan, line);
    let Some(voice) = V::prepare(&plan, line.clone(), signals)? else {
        return signals.interrupted();
    };
    lister.begin(voice.modes());
    let moves = plan.frames.iter().any(|due| due.effect.moves());
    let sum = plan.summary.unwrap_or_default();
    let mut playing = Playing { voice, lister, teller, sum, taken: None, plan };
    let played = guarded(|| playing.until_over(signals));
    let Playing { voice, lister, mut teller, mut sum, plan, taken } = playing;
    sum.left = plan.frames.len();
    sum.lost += usize::from(taken.is_some());
    if let Some(lines) = lister.end() {
        let _ = teller.say(lines);
    }
    // In any case, stop first and report errors afterwards.
    let stopped = voice.stop();
    for line in stopped.iter().flatten() {
        // If the output fails, what moved has stopped all the same.
        let _ = teller.say(line.clone());
    }
    if plan.summary.is_some() {
        let _ = teller.say(sum.line(plan.side, plan.is_json));
    }
    let told = teller.finish();
    stopped?;
    let besides = if moves { "what was commanded is stopped and at rest" } else { "nothing moves" };
    played.map_err(|failure| failure.and(besides))?;
    for (count, what) in [(sum.lost, "did not leave whole"), (sum.left, "not sent: interrupted")] {
        if count > 0 {
            let frames = if count == 1 { "frame" } else { "frames" };
            return Err(Failure::Failed(format!("{count} {frames} {what}; {besides}")));
        }
    }
    told.and_then(|()| line.check_recording())
}

struct Playing<'a, V> {
    voice: V,
    lister: Lister,
    teller: Teller,
    /// What has become of the frames. Those that did not leave whole are not sent again: they
    /// would come late.
    sum: Summary,
    /// The frame that was taken last, until it has left: when it was due, and taken.
    taken: Option<(Due, Instant, Instant)>,
    /// With the frames that are left.
    plan: Plan<'a>,
}

impl<V: Voice> Playing<'_, V> {
    /// Sends each frame at its time, until the time to listen is over, a signal comes, or the voice
    /// refuses one.
    fn until_over(&mut self, signals: &Signals) -> Result<(), Failure> {
        let begin = self.voice.now();
        let mut start = begin;
        // What is said first of all, such as a stop, is not of the plan.
        while !self.voice.is_free() && start - begin < PATIENCE && !signals.is_raised() {
            self.voice.round(start + WAIT_PERIOD)?;
            start = self.voice.now();
        }
        let mut attendance = Attendance::new(start);
        let (mut end, mut free_at) = (after(start, self.plan.linger_us), start);
        // When the line would be free if each frame had left at its time.
        let mut free_in_time = start;
        while !signals.is_raised() {
            let now = self.voice.now();
            // First: what was due during an absence is out of date.
            attendance.check(now)?;
            self.voice.check()?;
            if let Some((due, at, _)) = self.taken.take_if(|_| self.voice.is_free()) {
                (end, free_at) = self.has_left(&due, at, now);
            }
            if self.taken.as_ref().is_some_and(|(.., at)| now - *at >= PATIENCE) {
                break;
            }
            let at = match self.plan.frames.front() {
                None if now >= end && self.taken.is_none() => break,
                None => end,
                Some(due) => free_at.max(after(start, due.after_us)),
            };
            let mut until = at;
            if now >= at || self.taken.is_some() {
                until = now + WAIT_PERIOD;
            }
            if now >= at
                && self.taken.is_none()
                && self.voice.is_free()
                && let Some(due) = self.plan.frames.pop_front()
            {
                let at = free_in_time.max(after(start, due.after_us));
                let given = self.voice.give(&due, now)?;
                if given != Given::LeftOut {
                    free_in_time = at + self.line_time(&due);
                }
                match given {
                    Given::Sent => (end, free_at) = self.has_left(&due, at, now),
                    Given::Taken => self.taken = Some((due, at, now)),
                    Given::Lost => self.sum.lost += 1,
                    Given::LeftOut => self.sum.left_out += 1,
                }
                until = now;
            }
            self.voice.round(until)?;
            if let Some(lines) = self.lister.lines() {
                self.teller.say(lines)?;
            }
        }
        Ok(())
    }

    /// Counts a frame that was due then; when the time to listen is over, and when the line is
    /// free.
    fn has_left(&mut self, due: &Due, at: Instant, now: Instant) -> (Instant, Instant) {
        self.sum.count_sent(now - at);
        (after(now, self.plan.linger_us), now + self.line_time(due))
    }

    /// How long the line is in use for a frame and its answer. A master knows that on its own.
    fn line_time(&self, due: &Due) -> Duration {
        let answer = match (self.plan.protocol, &due.effect) {
            (Protocol::Ikeya, Effect::Ask(_)) => size_of::<ikeya::VelocityResponse>(),
            (_, Effect::Ask(_)) => size_of::<three::VelocityResponse>(),
            _ => 0,
        };
        let turnaround = if answer > 0 { TURNAROUND } else { Duration::ZERO };
        let baud = self.plan.bus.line().baud_for(self.plan.protocol);
        wire_time(due.bytes.len() + answer, baud) + turnaround
    }
}

fn after(start: Instant, micros: u64) -> Instant {
    Instant::from_micros(start.as_micros() + micros)
}
