//! Real-time tests on a machine that has other work to do.

use std::{
    panic::{AssertUnwindSafe, catch_unwind, resume_unwind},
    sync::{
        Arc, Mutex, PoisonError,
        atomic::{AtomicBool, Ordering},
    },
    thread::{self, JoinHandle},
    time::{Duration, Instant},
};

/// A line waits 20 ms for an answer. A machine that keeps a thread from running for half of that
/// may have lost one.
const STALL: Duration = Duration::from_millis(10);

/// Share of the time with more runnable threads than processors, percent: a test and its own
/// processes cause less than this.
const CROWD_PCT: u32 = 20;

/// Share of processor time taken by other guests of the same host, percent. The machine, or part of
/// it, is halted meanwhile; our threads may not notice.
const STOLEN_PCT: u64 = 1;

/// Number of attempts for a test that fails on a busy machine, unless `AXLEWIRE_ATTEMPTS` has one.
const ATTEMPTS: u32 = 8;

/// Runs one test at a time. A failure counts unless the machine was busy meanwhile; then the test
/// is run again, since the machine may have caused the failure. The last attempt always counts.
pub(crate) fn undisturbed(test: impl Fn()) {
    static TURN: Mutex<()> = Mutex::new(());
    let _turn = TURN.lock().unwrap_or_else(PoisonError::into_inner);
    let attempts = std::env::var("AXLEWIRE_ATTEMPTS").ok().and_then(|number| number.parse().ok());
    repeat(attempts.unwrap_or(ATTEMPTS), || {
        let watch = Watch::start();
        let outcome = catch_unwind(AssertUnwindSafe(&test));
        (outcome, watch.end())
    });
}

/// Runs the attempts: each returns its outcome, and how busy the machine was.
fn repeat(attempts: u32, mut attempt: impl FnMut() -> (thread::Result<()>, Busy)) {
    for number in 1.. {
        match attempt() {
            (Ok(()), _) => return,
            (Err(_), busy) if busy.is_too_much() && number < attempts => {
                eprintln!("attempt {number} failed on a busy machine, {busy:?}: retrying");
            }
            (Err(panic), _) => resume_unwind(panic),
        }
    }
}

/// How busy the machine was.
#[derive(Clone, Copy, Debug, Default)]
struct Busy {
    /// The longest time for which a runnable thread did not run.
    stall: Duration,
    samples: u32,
    /// Samples with more runnable threads than processors.
    crowds: u32,
    /// Total processor time and the stolen part of it, in system ticks.
    ticks: u64,
    stolen: u64,
}

impl Busy {
    fn is_too_much(self) -> bool {
        self.stall >= STALL
            || self.crowds * 100 >= self.samples.max(1) * CROWD_PCT
            || self.stolen * 100 > self.ticks * STOLEN_PCT
    }
}

struct Watch {
    is_over: Arc<AtomicBool>,
    watcher: JoinHandle<Busy>,
}

impl Watch {
    fn start() -> Self {
        const NAP: Duration = Duration::from_millis(2);
        let is_over = Arc::new(AtomicBool::new(false));
        let ends = Arc::clone(&is_over);
        let processors = thread::available_parallelism().map_or(1, usize::from);
        let watcher = thread::spawn(move || {
            let mut busy = Busy::default();
            let before = processor_time();
            while !ends.load(Ordering::Relaxed) {
                let start = Instant::now();
                thread::sleep(NAP);
                busy.stall = busy.stall.max(start.elapsed().saturating_sub(NAP));
                busy.samples += 1;
                busy.crowds += u32::from(running().is_some_and(|count| count > processors));
            }
            if let (Some(before), Some(after)) = (before, processor_time()) {
                (busy.ticks, busy.stolen) = (after.0 - before.0, after.1 - before.1);
            }
            busy
        });
        Self { is_over, watcher }
    }

    fn end(self) -> Busy {
        self.is_over.store(true, Ordering::Relaxed);
        self.watcher.join().unwrap()
    }
}

/// Runnable threads of the whole system; only available on Linux.
fn running() -> Option<usize> {
    let load = std::fs::read_to_string("/proc/loadavg").ok()?;
    load.split(' ').nth(3)?.split('/').next()?.parse().ok()
}

/// Total and stolen processor ticks since boot; only available on Linux.
fn processor_time() -> Option<(u64, u64)> {
    let all = std::fs::read_to_string("/proc/stat").ok()?;
    let ticks = all.lines().next()?.strip_prefix("cpu ")?.split_whitespace();
    // User, nice, system, idle, iowait, two kinds of interrupts, steal; the rest is already
    // included.
    let ticks: Vec<u64> = ticks.take(8).map_while(|ticks| ticks.parse().ok()).collect();
    Some((ticks.iter().sum(), *ticks.get(7)?))
}

#[test]
fn a_failure_counts_at_once_unless_the_machine_was_busy_and_then_on_the_last_attempt() {
    let quiet =
        Busy { stall: STALL / 2, samples: 100, crowds: CROWD_PCT - 1, ticks: 1000, stolen: 10 };
    let stalled = Busy { stall: STALL, ..quiet };
    let crowded = Busy { crowds: CROWD_PCT, ..quiet };
    let robbed = Busy { stolen: 11, ..quiet };
    for (busy, expected) in
        [(quiet, 1), (stalled, ATTEMPTS), (crowded, ATTEMPTS), (robbed, ATTEMPTS)]
    {
        let mut attempts = 0;
        let failed = catch_unwind(AssertUnwindSafe(|| {
            repeat(ATTEMPTS, || {
                attempts += 1;
                (Err(Box::new("a defect")), busy)
            });
        }));
        assert_eq!((failed.is_err(), attempts), (true, expected), "{busy:?}");
    }
}

#[test]
fn a_success_ends_the_attempts() {
    let mut attempts = 0;
    repeat(ATTEMPTS, || {
        attempts += 1;
        let busy = Busy { stall: STALL, ..Busy::default() };
        (if attempts < 3 { Err(Box::new("the machine's")) } else { Ok(()) }, busy)
    });
    assert_eq!(attempts, 3);
}
