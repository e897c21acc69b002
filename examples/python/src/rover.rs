//! A rover.

use std::{
    collections::VecDeque,
    io,
    sync::{Arc, Condvar, Mutex, PoisonError, Weak},
    time::{Duration as Wait, Instant},
};

use axlewire::{
    drive::{self, DriveError},
    time::Duration,
    ucp::host::{COAST, HostConfig, HostEvent, Link, ReceivedReport},
};
use pyo3::{
    exceptions::{PyAttributeError, PyOSError, PyValueError},
    prelude::*,
    types::{PyDict, PyType},
};

use crate::{
    bus::{leave, leave_collected, span},
    capture::SIGNALS_EVERY,
    trouble::Trouble,
    worker::{Driven, Leave, Worker, remember},
};

/// A moment in which the line is served between two jobs.
const MOMENT: Duration = Duration::from_millis(5);

/// How often a command is given again, so that the dead-man knows that somebody is there.
const REPEAT: Wait = Wait::from_millis(100);

/// Reports that an iterator may lag behind.
const LAG: usize = 4096;

/// Reports for one iterator.
#[derive(Default)]
struct Queue {
    /// Those that wait, how many were dropped because there were too many, and whether no more
    /// come.
    reports: Mutex<(VecDeque<ReceivedReport>, u64, bool)>,
    changed: Condvar,
}

impl Queue {
    fn push(&self, report: ReceivedReport) {
        let mut reports = self.reports.lock().unwrap_or_else(PoisonError::into_inner);
        if reports.0.len() == LAG {
            reports.0.pop_front();
            reports.1 += 1;
        }
        reports.0.push_back(report);
        self.changed.notify_all();
    }

    fn end(&self) {
        self.reports.lock().unwrap_or_else(PoisonError::into_inner).2 = true;
        self.changed.notify_all();
    }
}

struct Driver {
    rover: drive::Rover,
    has_moved: bool,
    queues: Vec<Weak<Queue>>,
}

type Failed = DriveError<io::Error>;

impl Driven for Driver {
    fn serve(&mut self) -> Result<(), Trouble> {
        let queues = &mut self.queues;
        let tell = |event| {
            if let HostEvent::Report(report) = event {
                queues.retain(|queue| queue.strong_count() > 0);
                queues.iter().filter_map(Weak::upgrade).for_each(|queue| queue.push(report));
            }
        };
        let mut tell = tell;
        Ok(self.rover.run_for(MOMENT, |_, event, _| tell(event))?)
    }

    fn leave(&mut self) -> Result<(), Trouble> {
        let left = if self.has_moved { self.stand() } else { Ok(()) };
        self.queues.iter().filter_map(Weak::upgrade).for_each(|queue| queue.end());
        Ok(left?)
    }
}

impl Driver {
    fn stand(&mut self) -> Result<(), Failed> {
        // If it has not left by then, it is repeated; only what is seen counts.
        let _ = self.rover.stop();
        self.rover.await_standstill(COAST)
    }
}

/// A rover on a serial port (UCP).
///
/// It is stopped, and seen to stand still, when the `with` block is left, at the end of the
/// program, and when the object is collected. A command without `seconds` ends by itself after half
/// a second if no other follows: whoever is at the keyboard may have gone.
#[pyclass(frozen, weakref, module = "axlewire")]
pub(crate) struct Rover {
    worker: Arc<Worker<Driver>>,
    port: String,
}

#[pymethods]
impl Rover {
    #[new]
    #[pyo3(signature = (port: "str | os.PathLike[str]", *, baud=115_200, dead_man_s=0.5, low_ids_only=false))]
    fn new(
        py: Python<'_>,
        port: &Bound<'_, PyAny>,
        baud: u32,
        dead_man_s: f64,
        low_ids_only: bool,
    ) -> PyResult<Self> {
        let path: std::path::PathBuf = port.extract()?;
        let port = path.to_string_lossy().into_owned();
        let mut config = HostConfig::usb_adapter();
        (config.baud, config.dead_man) = (baud, span(dead_man_s)?);
        config.low_ids_only = low_ids_only;
        let opened = py.detach(|| drive::Rover::open_with(&port, config));
        let rover =
            opened.map_err(|error| PyOSError::new_err(format!("cannot open {port:?}: {error}")))?;
        let worker = Arc::new(Worker::new(Driver { rover, has_moved: false, queues: Vec::new() }));
        let weak: Weak<dyn Leave> = Arc::downgrade(&(Arc::clone(&worker) as Arc<dyn Leave>));
        remember(weak);
        Ok(Self { worker, port })
    }

    /// Drives: percent of the speed ahead, and percent of turn, positive as a steering wheel that
    /// is turned to the right. With `seconds` it then stops, and returns when the rover is seen
    /// to stand still; else it returns at once.
    #[pyo3(signature = (speed=0, angular=0, *, seconds=None))]
    fn drive(
        &self,
        py: Python<'_>,
        speed: i16,
        angular: i16,
        seconds: Option<f64>,
    ) -> PyResult<()> {
        let seconds = seconds.map(span).transpose()?;
        let command = move |driver: &mut Driver| {
            driver.has_moved = true;
            driver.rover.drive(speed, angular)
        };
        self.call(py, command)?;
        let Some(seconds) = seconds else { return Ok(()) };
        let end = Instant::now() + Wait::from_micros(seconds.as_micros().into());
        let driven = loop {
            let left = end.saturating_duration_since(Instant::now());
            if left.is_zero() {
                break Ok(());
            }
            let waited = self.sleep(py, left.min(REPEAT));
            if let Err(error) = waited.and_then(|()| self.call(py, command)) {
                break Err(error);
            }
        };
        // At once, whatever was raised; the wait may be left by Ctrl-C.
        let posted = self.worker.post(|driver| {
            let now = driver.rover.now();
            driver.rover.role_mut().stop(now);
        });
        driven.and(posted)?;
        self.stop(py)
    }

    /// Stops, and returns when the rover is seen to stand still. Raises `StillMoving` if it is not.
    fn stop(&self, py: Python<'_>) -> PyResult<()> {
        self.call(py, Driver::stand)
    }

    /// Waits for the answer to a ping, and returns the round trip, seconds.
    #[pyo3(signature = (within_s=1.0))]
    fn ping(&self, py: Python<'_>, within_s: f64) -> PyResult<f64> {
        let within = span(within_s)?;
        let trip = self.call(py, move |driver| driver.rover.ping(within))?;
        Ok(f64::from(trip.as_micros()) / 1e6)
    }

    /// The latest report; `None` before the first.
    #[getter]
    fn report(&self, py: Python<'_>) -> PyResult<Option<Report>> {
        let report = self.worker.call(py, |driver| driver.rover.role().last_report().copied())?;
        Ok(report.map(Report::from))
    }

    /// Whether the robot is heard: `waiting`, `up` or `down`.
    #[getter]
    fn link(&self, py: Python<'_>) -> PyResult<&'static str> {
        let link = self.worker.call(py, |driver| driver.rover.role().link())?;
        Ok(match link {
            Link::Waiting => "waiting",
            Link::Up => "up",
            Link::Down => "down",
        })
    }

    /// The reports from now on, one after another: `for report in rover.reports()` in a thread, or
    /// `async for`.
    fn reports(&self, py: Python<'_>) -> PyResult<Reports> {
        let queue = Arc::new(Queue::default());
        let weak = Arc::downgrade(&queue);
        self.worker.call(py, move |driver| driver.queues.push(weak))?;
        Ok(Reports { queue })
    }

    /// Stops what was moved, waits until it is seen to stand still, and closes the port.
    fn close(&self, py: Python<'_>) -> PyResult<()> {
        leave(py, &*self.worker)
    }

    fn __enter__(slf: Py<Self>) -> Py<Self> {
        slf
    }

    #[pyo3(signature = (kind, value, trace))]
    fn __exit__(
        &self,
        py: Python<'_>,
        kind: Option<Bound<'_, PyType>>,
        value: Option<Bound<'_, PyAny>>,
        trace: Option<Bound<'_, PyAny>>,
    ) -> PyResult<bool> {
        drop((kind, value, trace));
        self.close(py)?;
        Ok(false)
    }

    fn __repr__(&self) -> String {
        format!("<axlewire.Rover on {}>", self.port)
    }
}

impl Rover {
    fn call<T: Send + 'static>(
        &self,
        py: Python<'_>,
        job: impl FnOnce(&mut Driver) -> Result<T, Failed> + Send + 'static,
    ) -> PyResult<T> {
        let result = self.worker.call(py, move |driver| job(driver).map_err(Trouble::from))?;
        result.map_err(|trouble| trouble.raised(py))
    }

    fn sleep(&self, py: Python<'_>, span: Wait) -> PyResult<()> {
        let end = Instant::now() + span;
        loop {
            let left = end.saturating_duration_since(Instant::now());
            if left.is_zero() {
                return Ok(());
            }
            py.detach(|| std::thread::sleep(left.min(SIGNALS_EVERY)));
            py.check_signals()?;
        }
    }
}

impl Drop for Rover {
    fn drop(&mut self) {
        leave_collected(&*self.worker);
    }
}

/// The reports of a rover.
#[pyclass(frozen, module = "axlewire")]
pub(crate) struct Reports {
    queue: Arc<Queue>,
}

#[pymethods]
impl Reports {
    fn __iter__(slf: PyRef<'_, Self>) -> PyRef<'_, Self> {
        slf
    }

    fn __next__(&self, py: Python<'_>) -> PyResult<Option<Report>> {
        loop {
            let next = py.detach(|| self.wait(SIGNALS_EVERY));
            match next {
                (Some(report), _) => return Ok(Some(report.into())),
                (None, true) => return Ok(None),
                (None, false) => py.check_signals()?,
            }
        }
    }

    /// The next report; `None` if none comes within this time, or no more come.
    #[pyo3(signature = (within_s))]
    fn next(&self, py: Python<'_>, within_s: f64) -> PyResult<Option<Report>> {
        let end = Instant::now() + Wait::from_micros(span(within_s)?.as_micros().into());
        loop {
            let left = end.saturating_duration_since(Instant::now());
            match py.detach(|| self.wait(left.min(SIGNALS_EVERY))) {
                (Some(report), _) => return Ok(Some(report.into())),
                (None, is_over) if is_over || left.is_zero() => return Ok(None),
                (None, _) => py.check_signals()?,
            }
        }
    }

    /// Reports that were dropped because nobody took them for more than a minute.
    #[getter]
    fn dropped(&self) -> u64 {
        self.queue.reports.lock().unwrap_or_else(PoisonError::into_inner).1
    }

    fn __aiter__(slf: PyRef<'_, Self>) -> PyRef<'_, Self> {
        slf
    }

    /// Waits in a thread of the running event loop, for a moment at a time, so that a task can be
    /// cancelled.
    fn __anext__<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        let module = slf.py().import("axlewire._asynchronous")?;
        module.getattr("next_report")?.call1((slf,))
    }

    #[getter]
    fn is_over(&self) -> bool {
        self.queue.reports.lock().unwrap_or_else(PoisonError::into_inner).2
    }
}

impl Reports {
    /// The next report, and whether no more come.
    fn wait(&self, within: Wait) -> (Option<ReceivedReport>, bool) {
        let reports = self.queue.reports.lock().unwrap_or_else(PoisonError::into_inner);
        let waited =
            self.queue.changed.wait_timeout_while(reports, within, |it| it.0.is_empty() && !it.2);
        let (mut reports, _) = waited.unwrap_or_else(PoisonError::into_inner);
        (reports.0.pop_front(), reports.2)
    }
}

/// A report of a rover, as it was received: the fields of `capture["report"]`.
#[pyclass(frozen, module = "axlewire")]
pub(crate) struct Report(ReceivedReport);

impl From<ReceivedReport> for Report {
    fn from(report: ReceivedReport) -> Self {
        Self(report)
    }
}

#[pymethods]
impl Report {
    /// Counter of the robot.
    #[getter]
    fn index(&self) -> u8 {
        self.0.index
    }

    /// Number of reports missing between the previous one and this one.
    #[getter]
    fn lost(&self) -> u8 {
        self.0.lost
    }

    /// Version of the robot's firmware; `None` if the layout has none.
    #[getter]
    fn version(&self) -> Option<u16> {
        self.0.version
    }

    /// All fields with their values.
    #[pyo3(signature = () -> "dict[str, int | list[int]]")]
    fn fields<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let all = PyDict::new(py);
        let value = serde_json::to_value(self.0.telemetry)
            .map_err(|error| PyValueError::new_err(error.to_string()))?;
        for (name, value) in value.as_object().into_iter().flatten() {
            all.set_item(name, crate::bytes::python(py, value)?)?;
        }
        Ok(all)
    }

    fn __getattr__<'py>(&self, py: Python<'py>, name: &str) -> PyResult<Bound<'py, PyAny>> {
        let fields = self.fields(py)?;
        fields.get_item(name)?.ok_or_else(|| {
            PyAttributeError::new_err(format!("a report has no {name}; it has {}", fields.keys()))
        })
    }

    fn __repr__(&self, py: Python<'_>) -> PyResult<String> {
        Ok(format!("<axlewire.Report {} of {}>", self.0.index, self.fields(py)?))
    }
}
