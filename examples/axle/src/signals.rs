//! Signals as flags, looked at between two rounds: what moves is stopped first.

use std::{
    io,
    sync::{
        Arc,
        atomic::{AtomicBool, Ordering},
    },
};

use axlewire::time::{Duration, Instant};
use signal_hook::{
    consts::{SIGINT, SIGTERM},
    flag,
};

use crate::failure::Failure;

/// Ctrl-C, the polite kill and the terminal that is closed end every subcommand.
#[cfg(unix)]
const ENDS: &[i32] = &[SIGINT, SIGTERM, signal_hook::consts::SIGHUP];
#[cfg(not(unix))]
const ENDS: &[i32] = &[SIGINT, SIGTERM];

/// Ctrl-Z, and what the terminal sends to a program in the background.
#[cfg(unix)]
const SUSPENSIONS: &[i32] =
    &[signal_hook::consts::SIGTSTP, signal_hook::consts::SIGTTIN, signal_hook::consts::SIGTTOU];

/// Signals that neither end nor suspend a program that does not listen to them; those that cannot be
/// caught; and faults of the program itself, behind which it cannot go on.
#[cfg(unix)]
const LEFT_ALONE: &[i32] = {
    use signal_hook::consts::*;
    &[
        SIGCHLD, SIGCONT, SIGURG, SIGWINCH, SIGPIPE, SIGKILL, SIGSTOP, SIGILL, SIGFPE, SIGSEGV,
        SIGBUS,
    ]
};

/// The largest number of a signal, real-time signals included.
#[cfg(unix)]
const LAST_SIGNAL: i32 = 64;

/// The signals so far. They stay: a second Ctrl-C is no other wish than the first.
#[derive(Debug, Default)]
pub(crate) struct Signals {
    end: Arc<AtomicBool>,
    suspend: Arc<AtomicBool>,
}

impl Signals {
    /// For a subcommand that moves nothing: Ctrl-C and its like become a flag.
    pub(crate) fn listen() -> Result<Self, Failure> {
        let signals = Self::default();
        listen_to(ENDS, &signals.end)?;
        Ok(signals)
    }

    /// For a subcommand that moves something: no signal that can be caught ends or suspends the
    /// tool before the motors are stopped.
    pub(crate) fn listen_to_all() -> Result<Self, Failure> {
        let signals = Self::listen()?;
        #[cfg(unix)]
        {
            listen_to(SUSPENSIONS, &signals.suspend)?;
            // What a supervisor, a script or a limit sends: it would end the tool at once, with the
            // motors running.
            let is_other = |signal: &i32| {
                [ENDS, SUSPENSIONS, LEFT_ALONE].iter().all(|known| !known.contains(signal))
            };
            for signal in (1..=LAST_SIGNAL).filter(is_other) {
                // A system refuses numbers that it does not have or keeps for itself.
                let _ = flag::register(signal, Arc::clone(&signals.end));
            }
        }
        Ok(signals)
    }

    /// Has any signal come?
    pub(crate) fn is_raised(&self) -> bool {
        self.end.load(Ordering::SeqCst) || self.suspend.load(Ordering::SeqCst)
    }

    /// A signal has come before anything moved. Ctrl-Z has a line of its own, in
    /// [`suspend_if_wanted`](Self::suspend_if_wanted).
    pub(crate) fn interrupted(&self) -> Result<(), Failure> {
        if self.suspend.load(Ordering::SeqCst) {
            return Ok(());
        }
        Err(Failure::Undone("interrupted before anything moved".to_owned()))
    }

    /// The result of a subcommand, if Ctrl-Z was not pressed. Otherwise tells it, suspends the
    /// process so that a shell sees it, and fails when the process goes on.
    ///
    /// Call it when everything is stopped and the port is closed, so that another program can use
    /// the line meanwhile. What was known of the line before is out of date afterwards, so nothing
    /// is sent any more.
    pub(crate) fn suspend_if_wanted(&self, result: Result<(), Failure>) -> Result<(), Failure> {
        if !self.suspend.load(Ordering::SeqCst) {
            return result;
        }
        if let Err(failure) = result {
            let _ = failure.report();
        }
        // SIGSTOP cannot fail for the process itself.
        #[cfg(unix)]
        let _ = signal_hook::low_level::raise(signal_hook::consts::SIGSTOP);
        let line = "suspended by Ctrl-Z: what moved was told to stop first, and is not moved again";
        Err(Failure::Undone(line.to_owned()))
    }
}

fn listen_to(signals: &[i32], flag: &Arc<AtomicBool>) -> Result<(), Failure> {
    let register = |&signal: &i32| flag::register(signal, Arc::clone(flag)).map(drop);
    signals
        .iter()
        .try_for_each(register)
        .map_err(|error: io::Error| Failure::Undone(format!("cannot listen for signals: {error}")))
}

/// Time of which the tool was awake, for deadlines: a stop that was begun is given all of its time
/// after a SIGCONT.
#[derive(Debug)]
pub(crate) struct Awake {
    time: Duration,
    seen_at: Instant,
}

impl Awake {
    pub(crate) const fn new(now: Instant) -> Self {
        Self { time: Duration::ZERO, seen_at: now }
    }

    /// The time so far. To be called in every round.
    pub(crate) fn time(&mut self, now: Instant) -> Duration {
        self.time = self.time + (now - self.seen_at).min(ABSENCE);
        self.seen_at = now;
        self.time
    }
}

/// Longest pause between two rounds of a tool that is awake. The dead-man of both masters is as
/// long.
pub(crate) const ABSENCE: Duration = Duration::from_millis(500);

/// The same in words, where a dead-man notices it first.
pub(crate) const DEAD_MAN: &str = "the tool did not run for a while (suspended?)";

/// Notices that the tool was not there: suspended by a SIGSTOP, which cannot be caught, or starved.
#[derive(Debug)]
pub(crate) struct Attendance {
    seen_at: Instant,
}

impl Attendance {
    pub(crate) const fn new(now: Instant) -> Self {
        Self { seen_at: now }
    }

    /// To be called in every round. After an absence what moves is to be stopped, not driven on.
    pub(crate) fn check(&mut self, now: Instant) -> Result<(), Failure> {
        let away = now - self.seen_at;
        self.seen_at = now;
        if away < ABSENCE {
            return Ok(());
        }
        let seconds = f64::from(away.as_micros()) / 1e6;
        Err(Failure::Undone(format!("the tool did not run for {seconds:.1} s (suspended?)")))
    }
}
