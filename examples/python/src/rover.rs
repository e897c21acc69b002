//! A rover.

use std::{
    collections::VecDeque,
    fmt::Display,
    io,
    sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError, Weak},
    thread,
    time::{Duration as Wait, Instant},
};

use axlewire::{
    drive::{self, DriveError, Operation},
    encode::Encode,
    time::Duration,
    ucp::{
        Body, Frame, MAX_LEN, MotorControl,
        host::{COAST, HostConfig, HostEvent, Link, ReceivedReport, StopProgress},
        message::{DocumentReport, FirmwareReport},
    },
};
use pyo3::{
    exceptions::{PyAttributeError, PyValueError},
    prelude::*,
    types::PyType,
};
use serde_json::Value;

use crate::{
    bus::{baud_rate, leave, leave_collected, not_opened, span, within as between},
    bytes::{python, values},
    capture::SIGNALS_EVERY,
    trouble::Trouble,
    worker::{Driven, Leave, NAP, Worker, remember, sleep_until},
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
    waiting: Mutex<Waiting>,
    changed: Condvar,
}

#[derive(Default)]
struct Waiting {
    reports: VecDeque<ReceivedReport>,
    /// How many were dropped because too many waited.
    dropped: u64,
    /// The line is closed.
    is_over: bool,
    /// Why the line cannot be served at present.
    trouble: Option<Trouble>,
}

/// What comes next.
enum Next {
    Report(ReceivedReport),
    Nothing,
    End,
    Lost(Trouble),
}

impl Queue {
    fn lock(&self) -> MutexGuard<'_, Waiting> {
        self.waiting.lock().unwrap_or_else(PoisonError::into_inner)
    }

    fn push(&self, report: ReceivedReport) {
        let mut waiting = self.lock();
        if waiting.reports.len() == LAG {
            waiting.reports.pop_front();
            waiting.dropped += 1;
        }
        waiting.reports.push_back(report);
        self.changed.notify_all();
    }

    fn set_trouble(&self, trouble: Option<&Trouble>) {
        self.lock().trouble = trouble.cloned();
        self.changed.notify_all();
    }

    fn end(&self) {
        self.lock().is_over = true;
        self.changed.notify_all();
    }

    fn next(&self, within: Wait) -> Next {
        let is_idle =
            |it: &mut Waiting| it.reports.is_empty() && !it.is_over && it.trouble.is_none();
        let waited = self.changed.wait_timeout_while(self.lock(), within, is_idle);
        let (mut waiting, _) = waited.unwrap_or_else(PoisonError::into_inner);
        match (waiting.reports.pop_front(), waiting.is_over, &waiting.trouble) {
            (Some(report), ..) => Next::Report(report),
            (None, true, _) => Next::End,
            (None, false, Some(trouble)) => Next::Lost(trouble.clone()),
            (None, false, None) => Next::Nothing,
        }
    }
}

struct Driver {
    rover: drive::Rover,
    has_moved: bool,
    /// Counts the commands and stops of the application: a later one takes over.
    orders: u64,
    queues: Vec<Weak<Queue>>,
}

type Failed = DriveError<io::Error>;

impl Driven for Driver {
    fn serve(&mut self) -> Result<(), Trouble> {
        self.queues.retain(|queue| queue.strong_count() > 0);
        let queues: Vec<_> = self.queues.iter().filter_map(Weak::upgrade).collect();
        let served = self.rover.run_for(MOMENT, |_, event, _| {
            if let HostEvent::Report(report) = event {
                queues.iter().for_each(|queue| queue.push(report));
            }
        });
        let served = served.map_err(Trouble::from);
        queues.iter().for_each(|queue| queue.set_trouble(served.as_ref().err()));
        served
    }

    fn leave(&mut self) -> Result<(), Trouble> {
        let left = if self.has_moved { self.stand() } else { Ok(()) };
        self.queues.iter().filter_map(Weak::upgrade).for_each(|queue| queue.end());
        left
    }
}

/// The calls of the driver do not hand on the reports that come meanwhile; these do.
impl Driver {
    fn command(&mut self, command: MotorControl) -> Result<(), Trouble> {
        let now = self.rover.now();
        let role = self.rover.role_mut();
        let has_lamp = role.command().is_some_and(|latest| latest.front_led() != 0);
        let accepted = role.drive(command.with_front_led(has_lamp), now);
        accepted.map_err(|refused| Trouble::from(Failed::Rover(refused)))?;
        self.has_moved = true;
        Ok(())
    }

    /// Gives a new command; returns its number.
    fn order(&mut self, command: MotorControl) -> Result<u64, Trouble> {
        self.command(command)?;
        self.orders += 1;
        Ok(self.orders)
    }

    /// Gives a command again, unless another one or a stop has taken over.
    fn repeat(&mut self, command: MotorControl, order: u64) -> Result<(), Trouble> {
        if self.orders == order {
            self.command(command)
        } else {
            Err(Trouble::refused("another call has stopped or driven the rover meanwhile"))
        }
    }

    fn begin_stop(&mut self) {
        self.orders += 1;
        let now = self.rover.now();
        self.rover.role_mut().stop(now);
    }

    /// Stops, and waits until the rover is seen to stand still.
    fn stand(&mut self) -> Result<(), Trouble> {
        self.begin_stop();
        let end = self.rover.now() + COAST;
        loop {
            let served = self.serve();
            match self.rover.role().stop_progress() {
                StopProgress::StandingStill => return Ok(()),
                progress if self.rover.now() >= end => {
                    served?;
                    return Err(Failed::NoStandstill(progress).into());
                }
                _ if served.is_err() => thread::sleep(NAP),
                _ => {}
            }
        }
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
        py.import("axlewire._signals")?.call_method1("guard", (port,))?;
        let port = path.to_string_lossy().into_owned();
        let mut config = HostConfig::usb_adapter();
        (config.baud, config.dead_man) = (baud_rate(baud)?, between(dead_man_s, 0.3, 60.0)?);
        config.low_ids_only = low_ids_only;
        let opened = py.detach(|| drive::Rover::open_with(&port, config));
        let rover = opened.map_err(|error| not_opened(&port, &error))?;
        let worker = Arc::new(Worker::new(Driver {
            rover,
            has_moved: false,
            orders: 0,
            queues: Vec::new(),
        }));
        let weak: Weak<dyn Leave> = Arc::downgrade(&(Arc::clone(&worker) as Arc<dyn Leave>));
        remember(weak);
        Ok(Self { worker, port })
    }

    /// Drives: percent of the speed ahead, and percent of turn, positive as a steering wheel that
    /// is turned to the right. With `seconds` it then stops, and returns when the rover is seen
    /// to stand still, which takes another second or so; else it returns at once.
    #[pyo3(signature = (speed=0, angular=0, *, seconds=None))]
    fn drive(
        &self,
        py: Python<'_>,
        speed: i64,
        angular: i64,
        seconds: Option<f64>,
    ) -> PyResult<()> {
        let seconds = seconds.map(span).transpose()?;
        let percent = |it: i64| {
            let line = format!("{it} percent is not from -100 to 100");
            i16::try_from(it).map_err(|_| PyValueError::new_err(line))
        };
        let command = MotorControl::new(percent(speed)?, percent(angular)?)
            .map_err(|error| PyValueError::new_err(error.to_string()))?;
        let order = self.call(py, move |driver| driver.order(command))?;
        let Some(seconds) = seconds else { return Ok(()) };
        let end = Instant::now() + Wait::from_micros(seconds.as_micros().into());
        let driven = loop {
            if Instant::now() >= end {
                break Ok(());
            }
            let waited = sleep_until(py, end.min(Instant::now() + REPEAT));
            if let Err(error) = waited.and_then(|()| self.repeat(py, command, order)) {
                break Err(error);
            }
        };
        // At once, whatever was raised; the wait may be left by Ctrl-C. A later order is not
        // touched.
        let posted = self.worker.post(move |driver| {
            if driver.orders == order {
                driver.begin_stop();
            }
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
        self.call(py, |driver| {
            driver.rover.role_mut().take_round_trip();
            Ok(())
        })?;
        let end = Instant::now() + Wait::from_micros(within.as_micros().into());
        let trip = self.worker.until(py, end, |it| it.rover.role_mut().take_round_trip())?;
        let trip =
            trip.ok_or_else(|| Trouble::from(Failed::Timeout(Operation::Ping)).raised(py))?;
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
    fn reports(slf: &Bound<'_, Self>) -> PyResult<Reports> {
        let queue = Arc::new(Queue::default());
        let weak = Arc::downgrade(&queue);
        slf.get().worker.call(slf.py(), move |driver| driver.queues.push(weak))?;
        Ok(Reports { queue, rover: slf.clone().unbind() })
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
        job: impl FnOnce(&mut Driver) -> Result<T, Trouble> + Send + 'static,
    ) -> PyResult<T> {
        self.worker.call(py, job)?.map_err(|trouble| trouble.raised(py))
    }

    /// Gives a command again, as long as the port works.
    fn repeat(&self, py: Python<'_>, command: MotorControl, order: u64) -> PyResult<()> {
        self.worker.trouble().map_or(Ok(()), |trouble| Err(trouble.raised(py)))?;
        self.call(py, move |driver| driver.repeat(command, order))
    }
}

impl Drop for Rover {
    fn drop(&mut self) {
        leave_collected(&*self.worker);
    }
}

/// The reports of a rover, as they come. They end with the line.
#[pyclass(frozen, module = "axlewire")]
pub(crate) struct Reports {
    queue: Arc<Queue>,
    /// Kept, so that the line is not left while somebody listens.
    rover: Py<Rover>,
}

#[pymethods]
impl Reports {
    fn __iter__(slf: PyRef<'_, Self>) -> PyRef<'_, Self> {
        slf
    }

    fn __next__(&self, py: Python<'_>) -> PyResult<Option<Report>> {
        loop {
            match py.detach(|| self.queue.next(SIGNALS_EVERY)) {
                Next::Report(report) => return Ok(Some(report.into())),
                Next::End => return Ok(None),
                Next::Lost(trouble) => return Err(trouble.raised(py)),
                Next::Nothing => py.check_signals()?,
            }
        }
    }

    /// The next report; `None` if none comes within this time, or no more come.
    #[pyo3(signature = (within_s))]
    fn next(&self, py: Python<'_>, within_s: f64) -> PyResult<Option<Report>> {
        let end = Instant::now() + Wait::from_micros(span(within_s)?.as_micros().into());
        loop {
            let left = end.saturating_duration_since(Instant::now());
            match py.detach(|| self.queue.next(left.min(SIGNALS_EVERY))) {
                Next::Report(report) => return Ok(Some(report.into())),
                Next::End => return Ok(None),
                Next::Lost(trouble) => return Err(trouble.raised(py)),
                Next::Nothing if left.is_zero() => return Ok(None),
                Next::Nothing => py.check_signals()?,
            }
        }
    }

    /// Reports that were dropped because nobody took them for more than a minute.
    #[getter]
    fn dropped(&self) -> u64 {
        self.queue.lock().dropped
    }

    /// Whether the line is closed. Reports may still wait.
    #[getter]
    fn is_over(&self) -> bool {
        self.queue.lock().is_over
    }

    fn __aiter__(slf: PyRef<'_, Self>) -> PyRef<'_, Self> {
        slf
    }

    fn __anext__<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyAny>> {
        let module = slf.py().import("axlewire._asynchronous")?;
        module.getattr("next_report")?.call1((slf,))
    }

    fn __repr__(&self) -> String {
        format!("<axlewire.Reports of {}>", self.rover.get().port)
    }
}

/// A report of a rover, as it was received: `battery_pct`, `rpm` (four), `acc`, `gyro`, `mag`
/// (three each), `heading`, `power_w`, `voltage_dv`, `current_ca`, `version`. A capture has arrays
/// as columns `rpm_0` to `rpm_3`, which tell units and meaning.
#[pyclass(frozen, module = "axlewire")]
pub(crate) struct Report(ReceivedReport);

impl From<ReceivedReport> for Report {
    fn from(report: ReceivedReport) -> Self {
        Self(report)
    }
}

impl Report {
    /// The fields of its frame.
    fn value(&self) -> PyResult<Value> {
        let ReceivedReport { telemetry, version, index, .. } = &self.0;
        let mut memory = [0; MAX_LEN];
        let frame = match version {
            Some(version) => {
                FirmwareReport::new(telemetry, *version).frame(*index).encode(&mut memory)
            }
            None => DocumentReport::new(telemetry).frame(*index).encode(&mut memory),
        };
        let wrong = |error: &dyn Display| PyValueError::new_err(error.to_string());
        let frame = frame.map_err(|error| wrong(&error))?;
        let frame = Frame::parse(frame).map_err(|error| wrong(&error))?;
        values(&frame).map_err(|error| wrong(&error))
    }
}

#[pymethods]
impl Report {
    /// Number of reports missing between the previous one and this one.
    #[getter]
    fn lost(&self) -> u8 {
        self.0.lost
    }

    /// All fields with their values.
    #[getter]
    fn fields<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        python(py, &self.value()?)
    }

    fn __getattr__<'py>(&self, py: Python<'py>, name: &str) -> PyResult<Bound<'py, PyAny>> {
        match self.value()?.get(name) {
            Some(value) => python(py, value),
            None => Err(PyAttributeError::new_err(format!("a report has no {name}"))),
        }
    }

    fn __repr__(&self) -> PyResult<String> {
        Ok(format!("<axlewire.Report {}>", crate::bytes::told(&self.value()?)))
    }
}
