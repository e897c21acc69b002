//! A driver in a thread of its own, which serves its line without a pause.
//!
//! Python's calls are jobs for that thread. So set-points and stops are repeated, and reports read,
//! whatever Python does meanwhile; and every wait can be left by Ctrl-C.

use std::{
    sync::{
        Arc, Mutex, PoisonError, Weak,
        mpsc::{Receiver, RecvTimeoutError, Sender, TryRecvError, channel, sync_channel},
    },
    thread::{self, JoinHandle},
    time::Duration,
};

use pyo3::prelude::*;

use crate::{
    capture::SIGNALS_EVERY,
    trouble::{Trouble, closed},
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

/// The thread of a driver.
pub(crate) struct Worker<D> {
    /// `None` once it is to leave.
    jobs: Mutex<Option<Sender<Job<D>>>>,
    thread: Mutex<Option<JoinHandle<Result<(), Trouble>>>>,
    /// Why the line could not be served the last time.
    trouble: Arc<Mutex<Option<Trouble>>>,
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
        Self { jobs: Mutex::new(Some(to)), thread: Mutex::new(Some(thread)), trouble }
    }

    /// Has a job done, and waits for its result.
    pub(crate) fn call<T: Send + 'static>(
        &self,
        py: Python<'_>,
        job: impl FnOnce(&mut D) -> T + Send + 'static,
    ) -> PyResult<T> {
        let (tell, mut told) = sync_channel(1);
        self.post(move |driver| drop(tell.send(job(driver))))?;
        loop {
            let (again, result) = py.detach(move || {
                let result = told.recv_timeout(SIGNALS_EVERY);
                (told, result)
            });
            told = again;
            match result {
                Ok(result) => return Ok(result),
                Err(RecvTimeoutError::Timeout) => py.check_signals()?,
                Err(RecvTimeoutError::Disconnected) => return Err(closed()),
            }
        }
    }

    /// Has a job done, and does not wait.
    pub(crate) fn post(&self, job: impl FnOnce(&mut D) + Send + 'static) -> PyResult<()> {
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
        *self.jobs.lock().unwrap_or_else(PoisonError::into_inner) = None;
    }

    /// Whether the thread has left; then, once, how.
    pub(crate) fn left(&self) -> Option<Result<(), Trouble>> {
        let mut thread = self.thread.lock().unwrap_or_else(PoisonError::into_inner);
        match &*thread {
            None => Some(Ok(())),
            Some(running) if !running.is_finished() => None,
            Some(_) => thread.take().map(ended),
        }
    }
}

impl<D: Driven> Leave for Worker<D> {
    fn leave(&self) -> Result<(), Trouble> {
        self.dismiss();
        let thread = self.thread.lock().unwrap_or_else(PoisonError::into_inner).take();
        thread.map_or(Ok(()), ended)
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
