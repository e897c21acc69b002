//! A driver in a thread of its own, which serves its line without a pause.
//!
//! Python's calls are jobs for that thread. So set-points and stops are repeated, and reports read,
//! whatever Python does meanwhile; and every wait can be left by Ctrl-C.

use std::{
    process,
    sync::{
        Arc, Mutex, PoisonError, Weak,
        atomic::{AtomicBool, Ordering},
        mpsc::{Receiver, RecvTimeoutError, Sender, TryRecvError, channel, sync_channel},
    },
    thread::{self, JoinHandle},
    time::{Duration, Instant},
};

use pyo3::prelude::*;

use crate::{
    capture::SIGNALS_EVERY,
    trouble::{Trouble, closed, elsewhere},
};

/// A driver that a thread can serve.
pub(crate) trait Driven: Send + 'static {
    /// Serves the line for a moment, some milliseconds.
    fn serve(&mut self) -> Result<(), Trouble>;

    /// Stops what it has moved, and waits until that is seen to stand still.
    fn leave(&mut self) -> Result<(), Trouble>;
}

type Job<D> = Box<dyn FnOnce(&mut D) + Send>;

/// Time until a port that has failed is asked again.
pub(crate) const NAP: Duration = Duration::from_millis(20);

/// Time between two looks at what a thread does.
const LOOK_EVERY: Duration = Duration::from_millis(4);

/// Waits for what another thread sends; `None` if it has ended without. Ctrl-C ends the wait.
pub(crate) fn received<T: Send>(py: Python<'_>, from: Receiver<T>) -> PyResult<Option<T>> {
    let mut from = from;
    loop {
        let (again, result) = py.detach(move || {
            let result = from.recv_timeout(SIGNALS_EVERY);
            (from, result)
        });
        from = again;
        match result {
            Ok(sent) => return Ok(Some(sent)),
            Err(RecvTimeoutError::Timeout) => py.check_signals()?,
            Err(RecvTimeoutError::Disconnected) => return Ok(None),
        }
    }
}

/// Sleeps. Ctrl-C ends it.
pub(crate) fn sleep_until(py: Python<'_>, end: Instant) -> PyResult<()> {
    loop {
        let left = end.saturating_duration_since(Instant::now());
        if left.is_zero() {
            return Ok(());
        }
        py.detach(|| thread::sleep(left.min(SIGNALS_EVERY)));
        py.check_signals()?;
    }
}

/// The thread of a driver.
pub(crate) struct Worker<D> {
    /// `None` once it is to leave.
    jobs: Mutex<Option<Sender<Job<D>>>>,
    thread: Mutex<Thread>,
    /// Somebody was told how it has left.
    is_told: AtomicBool,
    /// The process that has the thread; one that was forked from it has none.
    process: u32,
    /// Why the line could not be served the last time.
    trouble: Arc<Mutex<Option<Trouble>>>,
}

enum Thread {
    Runs(JoinHandle<Result<(), Trouble>>),
    /// How it has left.
    Left(Result<(), Trouble>),
}

/// Something that is to be left before the program ends.
pub(crate) trait Leave: Send + Sync {
    fn leave(&self) -> Result<(), Trouble>;
}

static OPEN: Mutex<Vec<Weak<dyn Leave>>> = Mutex::new(Vec::new());

/// Remembers a line until the end of the program.
pub(crate) fn remember(line: Weak<dyn Leave>) {
    let mut open = OPEN.lock().unwrap_or_else(PoisonError::into_inner);
    open.retain(|line| line.strong_count() > 0);
    open.push(line);
}

/// Stops whatever still moves, on all lines.
pub(crate) fn leave_all() -> Vec<Trouble> {
    let open = std::mem::take(&mut *OPEN.lock().unwrap_or_else(PoisonError::into_inner));
    let lines: Vec<_> = open.iter().filter_map(Weak::upgrade).collect();
    // Side by side: one line that fails does not keep the others waiting.
    let leaving: Vec<_> =
        lines.into_iter().map(|line| thread::spawn(move || line.leave())).collect();
    leaving.into_iter().filter_map(|it| it.join().ok()?.err()).collect()
}

impl<D: Driven> Worker<D> {
    pub(crate) fn new(driver: D) -> Self {
        let (to, jobs) = channel();
        let trouble = Arc::new(Mutex::new(None));
        let told = Arc::clone(&trouble);
        let thread = thread::spawn(move || run(driver, &jobs, &told));
        let (jobs, thread) = (Mutex::new(Some(to)), Mutex::new(Thread::Runs(thread)));
        let is_told = AtomicBool::new(false);
        Self { jobs, thread, is_told, process: process::id(), trouble }
    }

    /// Has a job done, and waits for its result. If the wait is left by Ctrl-C, a job that has not
    /// begun is not done.
    pub(crate) fn call<T: Send + 'static>(
        &self,
        py: Python<'_>,
        job: impl FnOnce(&mut D) -> T + Send + 'static,
    ) -> PyResult<T> {
        let (tell, told) = sync_channel(1);
        let is_taken = Arc::new(AtomicBool::new(false));
        let takes = Arc::clone(&is_taken);
        self.post(move |driver| {
            if !takes.swap(true, Ordering::SeqCst) {
                drop(tell.send(job(driver)));
            }
        })?;
        let result = received(py, told).inspect_err(|_| is_taken.store(true, Ordering::SeqCst))?;
        result.ok_or_else(closed)
    }

    /// Has something looked at again and again, until there is a result or this time is over.
    pub(crate) fn until<T: Send + 'static>(
        &self,
        py: Python<'_>,
        end: Instant,
        look: impl FnMut(&mut D) -> Option<T> + Send + Clone + 'static,
    ) -> PyResult<Option<T>> {
        loop {
            let is_last = Instant::now() >= end;
            let mut look = look.clone();
            let found = self.call(py, move |driver| look(driver))?;
            if found.is_some() || is_last {
                return Ok(found);
            }
            self.trouble().map_or(Ok(()), |trouble| Err(trouble.raised(py)))?;
            sleep_until(py, Instant::now() + LOOK_EVERY)?;
        }
    }

    /// Has a job done, and does not wait.
    pub(crate) fn post(&self, job: impl FnOnce(&mut D) + Send + 'static) -> PyResult<()> {
        if self.is_elsewhere() {
            return Err(elsewhere());
        }
        let jobs = self.jobs.lock().unwrap_or_else(PoisonError::into_inner);
        let sent = jobs.as_ref().is_some_and(|jobs| jobs.send(Box::new(job)).is_ok());
        if sent { Ok(()) } else { Err(closed()) }
    }

    /// Why the line cannot be served at present, if so.
    pub(crate) fn trouble(&self) -> Option<Trouble> {
        self.trouble.lock().unwrap_or_else(PoisonError::into_inner).clone()
    }

    /// Tells the thread to leave, without waiting.
    pub(crate) fn dismiss(&self) {
        if self.is_elsewhere() {
            return;
        }
        *self.jobs.lock().unwrap_or_else(PoisonError::into_inner) = None;
    }

    /// Whether the thread has left, and how.
    pub(crate) fn left(&self) -> Option<Result<(), Trouble>> {
        if self.is_elsewhere() {
            return Some(Ok(()));
        }
        let mut thread = self.thread.lock().unwrap_or_else(PoisonError::into_inner);
        if matches!(&*thread, Thread::Runs(running) if !running.is_finished()) {
            return None;
        }
        let result = match std::mem::replace(&mut *thread, Thread::Left(Ok(()))) {
            Thread::Runs(running) => ended(running),
            Thread::Left(result) => result,
        };
        *thread = Thread::Left(result.clone());
        Some(result)
    }

    /// The exception that tells has been raised.
    pub(crate) fn told(&self) {
        self.is_told.store(true, Ordering::SeqCst);
    }

    fn is_elsewhere(&self) -> bool {
        self.process != process::id()
    }
}

impl<D: Driven> Leave for Worker<D> {
    fn leave(&self) -> Result<(), Trouble> {
        if self.is_elsewhere() {
            return Ok(());
        }
        self.dismiss();
        loop {
            match self.left() {
                // Once is enough.
                Some(_) if self.is_told.load(Ordering::SeqCst) => return Ok(()),
                Some(left) => return left,
                None => thread::sleep(LOOK_EVERY),
            }
        }
    }
}

fn ended(thread: JoinHandle<Result<(), Trouble>>) -> Result<(), Trouble> {
    thread.join().unwrap_or_else(|_| Err(Trouble::bug()))
}

fn run<D: Driven>(
    mut driver: D,
    jobs: &Receiver<Job<D>>,
    told: &Mutex<Option<Trouble>>,
) -> Result<(), Trouble> {
    loop {
        match jobs.try_recv() {
            Ok(job) => job(&mut driver),
            Err(TryRecvError::Empty) => {
                let trouble = driver.serve().err();
                if trouble.is_some() {
                    thread::sleep(NAP);
                }
                *told.lock().unwrap_or_else(PoisonError::into_inner) = trouble;
            }
            Err(TryRecvError::Disconnected) => return driver.leave(),
        }
    }
}
