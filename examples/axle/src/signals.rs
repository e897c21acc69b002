//! Signals as flags, checked between rounds, so that motors are stopped first.

#[cfg(windows)]
mod console;

use std::{
    io,
    sync::{
        Arc,
        atomic::{AtomicBool, Ordering},
    },
};
#[cfg(unix)]
use std::{io::Read, os::unix::net::UnixStream, thread};

use axlewire::time::{Duration, Instant};
#[cfg(unix)]
use signal_hook::{
    consts::{SIGHUP, SIGINT, SIGQUIT, SIGTERM, SIGXFSZ},
    flag,
    low_level::pipe,
};

use crate::failure::Failure;
#[cfg(unix)]
use crate::freely::free;

/// Ctrl-C, Ctrl-\, SIGTERM and a closed terminal end every subcommand.
#[cfg(unix)]
const ENDS: &[i32] = &[SIGINT, SIGTERM, SIGHUP, SIGQUIT];

/// Ctrl-Z, and the signals that a terminal sends to a background process.
#[cfg(unix)]
const SUSPENSIONS: &[i32] =
    &[signal_hook::consts::SIGTSTP, signal_hook::consts::SIGTTIN, signal_hook::consts::SIGTTOU];

/// Signals that neither end nor suspend a process by default; SIGXFSZ, for which every subcommand
/// has its own use; those that cannot be caught; and faults of the program itself, after which it
/// cannot continue.
#[cfg(unix)]
const LEFT_ALONE: &[i32] = {
    use signal_hook::consts::*;
    &[
        SIGCHLD, SIGCONT, SIGURG, SIGWINCH, SIGPIPE, SIGXFSZ, SIGKILL, SIGSTOP, SIGILL, SIGFPE,
        SIGSEGV, SIGBUS,
    ]
};

/// The largest signal number, including real-time signals.
#[cfg(unix)]
const LAST_SIGNAL: i32 = 64;

/// The signals received so far. Flags are never cleared: a second Ctrl-C adds nothing to the first.
#[derive(Debug)]
pub(crate) struct Signals {
    end: Arc<AtomicBool>,
    suspend: Arc<AtomicBool>,
    #[cfg(windows)]
    console: std::cell::RefCell<console::Console>,
}

/// The signals that end a subcommand, for another thread.
#[derive(Debug)]
pub(crate) struct Watcher(Arc<AtomicBool>);

impl Watcher {
    pub(crate) fn is_raised(&self) -> bool {
        self.0.load(Ordering::SeqCst)
    }
}

impl Signals {
    /// For a subcommand that moves nothing: Ctrl-C and similar signals set a flag. If the tool has
    /// not ended a second later, because it waits for a reader of its output, the next one ends it
    /// at once.
    pub(crate) fn listen() -> Result<Self, Failure> {
        let signals = Self::listen_gently()?;
        #[cfg(unix)]
        free_later().map_err(deaf)?;
        Ok(signals)
    }

    /// For a subcommand that must finish something: a second signal does not cut that
    /// short.
    pub(crate) fn listen_gently() -> Result<Self, Failure> {
        let signals = Self {
            end: Arc::default(),
            suspend: Arc::default(),
            #[cfg(windows)]
            console: console::Console::listen().map_err(deaf)?.into(),
        };
        #[cfg(unix)]
        for &signal in ENDS {
            // In this order, so that no signal releases itself.
            flag::register_conditional_default(signal, Arc::clone(free())).map_err(deaf)?;
            flag::register(signal, Arc::clone(&signals.end)).map_err(deaf)?;
        }
        // A file that may not grow is then an error of the write, and not the end of the tool.
        #[cfg(unix)]
        listen_to(&[SIGXFSZ], &Arc::default())?;
        Ok(signals)
    }

    /// For a subcommand that moves something: no signal that can be caught ends or suspends the
    /// tool before the motors are stopped.
    pub(crate) fn listen_to_all() -> Result<Self, Failure> {
        let signals = Self::listen_gently()?;
        #[cfg(unix)]
        {
            listen_to(SUSPENSIONS, &signals.suspend)?;
            // Signals from a supervisor, a script or a resource limit would end the tool at once,
            // with the motors running.
            let is_other = |signal: &i32| {
                [ENDS, SUSPENSIONS, LEFT_ALONE].iter().all(|known| !known.contains(signal))
            };
            for signal in (1..=LAST_SIGNAL).filter(is_other) {
                // A system refuses numbers that it lacks or reserves.
                let _ = flag::register(signal, Arc::clone(&signals.end));
            }
        }
        Ok(signals)
    }

    /// The same for another thread. On Windows it learns what this one has seen.
    pub(crate) fn watcher(&self) -> Watcher {
        Watcher(Arc::clone(&self.end))
    }

    /// Whether any signal has come.
    pub(crate) fn is_raised(&self) -> bool {
        #[cfg(windows)]
        if self.console.borrow_mut().has_told() {
            self.end.store(true, Ordering::SeqCst);
        }
        self.end.load(Ordering::SeqCst) || self.suspend.load(Ordering::SeqCst)
    }

    /// The result after a signal that came before anything moved. Ctrl-Z has its own message, in
    /// [`suspend_if_wanted`](Self::suspend_if_wanted).
    pub(crate) fn interrupted(&self) -> Result<(), Failure> {
        if self.suspend.load(Ordering::SeqCst) {
            return Ok(());
        }
        Err(Failure::Failed("interrupted before anything moved".to_owned()))
    }

    /// Returns `result` if Ctrl-Z was not pressed. Otherwise prints its failure, suspends the
    /// process so that the shell notices, and fails once the process resumes.
    ///
    /// Call it after everything is stopped and the port is closed, so that another program can use
    /// the line meanwhile. The known state of the line is outdated afterwards, so nothing more is
    /// sent.
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
        let line =
            "suspended by Ctrl-Z: everything that moved was told to stop first and stays stopped";
        Err(Failure::Failed(line.to_owned()))
    }
}

#[cfg(all(unix, feature = "dashboard"))]
impl Signals {
    /// Whether Ctrl-Z was pressed. It counts once: for a subcommand that moves nothing, which goes
    /// on after it.
    pub(crate) fn take_suspension(&self) -> bool {
        self.suspend.swap(false, Ordering::SeqCst)
    }

    /// Whether a signal to end has come.
    pub(crate) fn is_end(&self) -> bool {
        self.end.load(Ordering::SeqCst)
    }

    /// A flag for keys that end the tool as Ctrl-C does.
    pub(crate) fn end_flag(&self) -> Arc<AtomicBool> {
        Arc::clone(&self.end)
    }
}

#[cfg(all(test, unix))]
impl Signals {
    /// Signals that only [`raise`](Self::raise) raises.
    pub(crate) fn none() -> Self {
        Self { end: Arc::default(), suspend: Arc::default() }
    }

    /// Does what Ctrl-C does.
    pub(crate) fn raise(&self) {
        self.end.store(true, Ordering::SeqCst);
    }

    /// Does what Ctrl-Z does.
    pub(crate) fn raise_suspension(&self) {
        self.suspend.store(true, Ordering::SeqCst);
    }
}

/// Suspends the process so that the shell notices; returns when it goes on.
#[cfg(all(unix, feature = "dashboard"))]
pub(crate) fn suspend() {
    // SIGSTOP cannot fail for the process itself.
    let _ = signal_hook::low_level::raise(signal_hook::consts::SIGSTOP);
}

/// Time for an orderly end. Some programs send a signal twice, such as `timeout`, to a process and
/// to its group.
#[cfg(unix)]
const GRACE: std::time::Duration = std::time::Duration::from_secs(1);

/// Lets signals end the tool at once, some time after the first.
#[cfg(unix)]
fn free_later() -> io::Result<()> {
    let (mut first, signalled) = UnixStream::pair()?;
    for &signal in ENDS {
        pipe::register(signal, signalled.try_clone()?)?;
    }
    thread::spawn(move || {
        if first.read_exact(&mut [0]).is_ok() {
            thread::sleep(GRACE);
            free().store(true, Ordering::SeqCst);
        }
    });
    Ok(())
}

#[cfg(unix)]
fn listen_to(signals: &[i32], flag: &Arc<AtomicBool>) -> Result<(), Failure> {
    let register = |&signal: &i32| flag::register(signal, Arc::clone(flag)).map(drop);
    signals.iter().try_for_each(register).map_err(deaf)
}

fn deaf(error: io::Error) -> Failure {
    Failure::Failed(format!("cannot listen for signals: {error}"))
}

/// Longest pause between two rounds of a running tool. The dead-man timeouts of the master and the
/// host are equal to it.
pub(crate) const ABSENCE: Duration = Duration::from_millis(500);

/// Message for an absence that a dead-man detects first.
pub(crate) const DEAD_MAN: &str = "the tool did not run for a while (suspended?)";

/// Detects that the tool was not running: suspended by a SIGSTOP, which cannot be caught, or
/// starved of CPU time.
#[derive(Debug)]
pub(crate) struct Attendance {
    seen_at: Instant,
}

impl Attendance {
    pub(crate) const fn new(now: Instant) -> Self {
        Self { seen_at: now }
    }

    /// Call it in every round. After an absence, stop what is moving instead of driving it on.
    pub(crate) fn check(&mut self, now: Instant) -> Result<(), Failure> {
        let away = now - self.seen_at;
        self.seen_at = now;
        if away < ABSENCE {
            return Ok(());
        }
        let seconds = f64::from(away.as_micros()) / 1e6;
        Err(Failure::Failed(format!("the tool did not run for {seconds:.1} s (suspended?)")))
    }
}

#[cfg(all(test, unix))]
mod tests {
    use super::*;

    #[test]
    fn ctrl_c_and_ctrl_z_are_both_noticed_and_only_ctrl_c_is_a_failure_at_once() {
        let signals = Signals::none();
        assert!(!signals.is_raised());
        signals.raise();
        assert!(signals.is_raised());
        let failure = signals.interrupted().unwrap_err();
        assert_eq!(failure.to_string(), "interrupted before anything moved");
        let signals = Signals::none();
        signals.raise_suspension();
        assert!(signals.is_raised());
        signals.interrupted().unwrap();
    }

    #[test]
    fn an_absence_of_half_a_second_is_noticed_once() {
        let at = |millis: u64| Instant::from_micros(millis * 1000);
        let mut attendance = Attendance::new(at(1000));
        attendance.check(at(1499)).unwrap();
        attendance.check(at(1998)).unwrap();
        let failure = attendance.check(at(2498)).unwrap_err();
        assert_eq!(failure.to_string(), "the tool did not run for 0.5 s (suspended?)");
        attendance.check(at(2600)).unwrap();
    }
}
