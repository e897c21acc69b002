//! Memory, descriptors and threads of processes over time.

use std::{
    fs,
    sync::{
        Arc,
        atomic::{AtomicU32, Ordering},
    },
    thread,
    time::{Duration, Instant},
};

/// What a process may grow by once it is warm: the size of a page table or of an arena, not of a
/// leak. A leak of one byte per exchange would be some megabytes in an hour.
const GROWTH_KB: u64 = 512;

pub(crate) struct Processes(Vec<Watched>);

struct Watched {
    name: &'static str,
    /// Changes when it is started again.
    current: Arc<AtomicU32>,
    id: u32,
    /// When it was warm, the most since then, and the last.
    warm: Option<Size>,
    most: Size,
    last: Size,
}

#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Size {
    rss_kb: u64,
    descriptors: usize,
    threads: u64,
}

impl Size {
    /// `None` once the process has ended.
    fn of(id: u32) -> Option<Self> {
        let status = fs::read_to_string(format!("/proc/{id}/status")).ok()?;
        let number = |name: &str| -> Option<u64> {
            let line = status.lines().find_map(|line| line.strip_prefix(name))?;
            line.split_whitespace().next()?.parse().ok()
        };
        let descriptors = fs::read_dir(format!("/proc/{id}/fd")).ok()?.count();
        Some(Self { rss_kb: number("VmRSS:")?, descriptors, threads: number("Threads:")? })
    }
}

impl Processes {
    pub(crate) const fn new() -> Self {
        Self(Vec::new())
    }

    pub(crate) fn add(&mut self, name: &'static str, id: u32) {
        self.add_current(name, Arc::new(id.into()));
    }

    /// Adds a process that may be replaced by another.
    pub(crate) fn add_current(&mut self, name: &'static str, current: Arc<AtomicU32>) {
        let (id, none) = (current.load(Ordering::SeqCst), Size::default());
        self.0.push(Watched { name, current, id, warm: None, most: none, last: none });
    }

    /// Looks at all of them for almost this long; the first tenth warms them up.
    pub(crate) fn sample_for(&mut self, length: Duration) {
        let start = Instant::now();
        let pause = (length / 60).clamp(Duration::from_millis(200), Duration::from_secs(20));
        while start.elapsed() < length.mul_f64(0.97) {
            thread::sleep(pause);
            for process in &mut self.0 {
                let id = process.current.load(Ordering::SeqCst);
                if id != process.id {
                    (process.id, process.warm, process.most) = (id, None, Size::default());
                    // It has to become warm first.
                    continue;
                }
                let Some(size) = Size::of(process.id) else { continue };
                if start.elapsed() < length / 10 {
                    continue;
                }
                process.warm.get_or_insert(size);
                process.last = size;
                process.most.rss_kb = process.most.rss_kb.max(size.rss_kb);
                process.most.descriptors = process.most.descriptors.max(size.descriptors);
                process.most.threads = process.most.threads.max(size.threads);
            }
        }
    }

    /// Prints the figures, and complains of a leak.
    pub(crate) fn report(&self, complaints: &mut Vec<String>) {
        println!("process          | RSS warm, most, last, kB | descriptors | threads");
        for Watched { name, warm, most, last, .. } in &self.0 {
            let Some(warm) = *warm else {
                complaints.push(format!("{name} ended before it was warm"));
                continue;
            };
            println!(
                "{name:<16} | {:>8} {:>7} {:>7} | {:>3} to {:>3}  | {:>2} to {:>2}",
                warm.rss_kb,
                most.rss_kb,
                last.rss_kb,
                warm.descriptors,
                most.descriptors,
                warm.threads,
                most.threads
            );
            if most.rss_kb > warm.rss_kb + GROWTH_KB {
                complaints.push(format!("{name} grows: {warm:?}, then {most:?}"));
            }
            if last.descriptors > warm.descriptors || last.threads > warm.threads {
                complaints.push(format!("{name} keeps descriptors or threads: {warm:?}, {last:?}"));
            }
        }
    }
}
