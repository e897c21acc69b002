//! What the machine did to us: time in which a thread of ours could have run and did not, as the
//! scheduler counts it, and the lateness of a thread that only naps and passes single bytes through
//! a pseudo-terminal of its own, which threads of the kernel carry.

use std::{
    fmt, fs,
    io::{Read, Write},
    sync::{
        Arc,
        atomic::{AtomicU64, Ordering},
    },
    thread,
    time::{Duration, Instant},
};

use serialport::{SerialPort as _, TTYPort};

/// Lateness of a nap that is no stall.
const USUAL: Duration = Duration::from_millis(2);

/// The thread that only naps.
#[derive(Clone)]
pub(crate) struct Control {
    late_us: Arc<AtomicU64>,
    worst_us: Arc<AtomicU64>,
}

impl Control {
    pub(crate) fn start() -> Self {
        let control = Self { late_us: Arc::default(), worst_us: Arc::default() };
        let it = control.clone();
        thread::spawn(move || {
            const NAP: Duration = Duration::from_millis(1);
            let (mut near, mut far) = TTYPort::pair().unwrap();
            far.set_timeout(Duration::from_secs(60)).unwrap();
            loop {
                let begin = Instant::now();
                thread::sleep(NAP);
                near.write_all(&[0x55]).unwrap();
                far.read_exact(&mut [0]).unwrap();
                let late = begin.elapsed().saturating_sub(NAP);
                if late > USUAL {
                    it.late_us.fetch_add(late.as_micros() as u64, Ordering::Relaxed);
                    it.worst_us.fetch_max(late.as_micros() as u64, Ordering::Relaxed);
                }
            }
        });
        control
    }

    /// The largest lateness so far.
    pub(crate) fn worst(&self) -> Duration {
        Duration::from_micros(self.worst_us.load(Ordering::Relaxed))
    }

    /// Total lateness so far.
    fn late(&self) -> Duration {
        Duration::from_micros(self.late_us.load(Ordering::Relaxed))
    }
}

impl fmt::Display for Control {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (worst, late) = (self.worst(), self.late().as_secs_f64());
        write!(f, "a thread that only naps was late by up to {worst:.1?}, {late:.1} s in all")
    }
}

/// Gaps between good answers, and how much of each the machine explains.
pub(crate) struct Gaps {
    control: Control,
    /// The other process.
    id: u32,
    last: Instant,
    /// When the machine was last asked, and its answer.
    asked: (Instant, Duration),
    /// The longest gap, and the longest part of one that the machine does not explain.
    pub(crate) longest: Duration,
    pub(crate) longest_own: Duration,
    /// Total time of gaps that the machine explains.
    pub(crate) explained: Duration,
}

impl Gaps {
    /// Shorter gaps are not looked into.
    const SHORT: Duration = Duration::from_millis(25);

    /// To be made in the thread that hears the answers.
    pub(crate) fn new(control: Control, id: u32) -> Self {
        let now = Instant::now();
        let zero = Duration::ZERO;
        let mut gaps = Self {
            control,
            id,
            last: now,
            asked: (now, zero),
            longest: zero,
            longest_own: zero,
            explained: zero,
        };
        gaps.asked = (now, gaps.waited());
        gaps
    }

    /// Time for which this thread, the other process and the control thread have been kept waiting.
    fn waited(&self) -> Duration {
        let other = format!("/proc/{}/schedstat", self.id);
        let of = |path: &str| {
            let text = fs::read_to_string(path).unwrap_or_default();
            let nanos = text.split(' ').nth(1).and_then(|nanos| nanos.parse().ok());
            Duration::from_nanos(nanos.unwrap_or_default())
        };
        of("/proc/thread-self/schedstat") + of(&other) + self.control.late()
    }

    /// Whether no gap is longer than `limit`, apart from what the machine explains. Bytes that the
    /// kernel carries late are not counted anywhere, so that the worst of the control counts too.
    pub(crate) fn are_within(&self, limit: Duration) -> bool {
        self.longest_own <= limit + self.control.worst()
    }

    /// Notes a good answer.
    pub(crate) fn heard(&mut self, now: Instant) {
        let gap = now - self.last;
        self.last = now;
        self.longest = self.longest.max(gap);
        let is_long = gap > Self::SHORT;
        if is_long || now - self.asked.0 > Duration::from_millis(100) {
            let waited = self.waited();
            let machine = waited.saturating_sub(self.asked.1);
            self.asked = (now, waited);
            if is_long {
                self.longest_own = self.longest_own.max(gap.saturating_sub(machine));
                self.explained += machine.min(gap);
            }
        }
        if !is_long {
            self.longest_own = self.longest_own.max(gap);
        }
    }
}
