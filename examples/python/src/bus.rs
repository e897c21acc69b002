//! A motor bus.

use std::{
    io,
    sync::{Arc, Weak},
    time::{Duration as Wait, Instant},
};

use axlewire::{
    drive::{self, DriveError, Operation},
    ikeya::{
        Mode, NodeId, Position, Rps,
        board::{Status, Target},
        master::{
            CommandError, Health, MasterConfig, MasterStatistics, NodeSet, Polling, StopProgress,
        },
    },
    time::Duration,
};
use pyo3::{
    exceptions::{PyFileNotFoundError, PyKeyError, PyOSError, PyPermissionError, PyValueError},
    prelude::*,
    types::{PyDict, PyList, PyType},
};

use crate::{
    capture::{SIGNALS_EVERY, warn},
    trouble::Trouble,
    worker::{Driven, Leave, Worker, remember, sleep_until},
};

/// A moment in which the line is served between two jobs.
const MOMENT: Duration = Duration::from_millis(5);

struct Driver {
    bus: drive::Bus,
    /// Nodes that had a set-point.
    moved: NodeSet,
    /// How often the dead-man had fired at the latest call.
    fired: u32,
}

type Failed = DriveError<io::Error>;

impl Driven for Driver {
    fn serve(&mut self) -> Result<(), Trouble> {
        Ok(self.bus.run_for(MOMENT, |_, _, _| {})?)
    }

    fn leave(&mut self) -> Result<(), Trouble> {
        // Of the ids that were never heard, nobody has moved one.
        let master = self.bus.role();
        let owed = master.stops_owed().iter().filter(|node| master.mode(*node).is_some());
        let nodes: NodeSet = self.moved.iter().chain(owed).collect();
        if nodes.is_empty() { Ok(()) } else { Ok(self.bus.stop(nodes)?) }
    }
}

impl Driver {
    /// Whether the nodes that were moved are still heard.
    fn hears_all(&self) -> Result<(), Trouble> {
        let master = self.bus.role();
        let owed = master.stops_owed();
        Trouble::not_heard(self.moved.iter().filter(|node| {
            owed.contains(*node) && matches!(master.health(*node), None | Some(Health::Abnormal))
        }))
        .map_or(Ok(()), Err)
    }

    /// Whether the dead-man has fired since the latest call.
    fn has_fired(&mut self) -> bool {
        let fired = self.bus.role().statistics().dead_man;
        std::mem::replace(&mut self.fired, fired) != fired
    }

    /// Remembers a node that a command may move, unless the command is refused.
    fn may_move(&mut self, id: NodeId, target: Target) -> Result<(), Failed> {
        self.bus.role().check(id, &target)?;
        self.moved = self.moved.iter().chain([id]).collect();
        Ok(())
    }
}

/// A span in seconds.
pub(crate) fn span(seconds: f64) -> PyResult<Duration> {
    let longest = f64::from(u32::MAX) / 1e6;
    if (0.0..=longest).contains(&seconds) {
        Ok(Duration::from_micros((seconds * 1e6) as u32))
    } else {
        Err(PyValueError::new_err(format!("{seconds} s is not a time from 0 to {longest:.0} s")))
    }
}

/// A span between these.
pub(crate) fn within(seconds: f64, least: f64, most: f64) -> PyResult<Duration> {
    if (least..=most).contains(&seconds) {
        return span(seconds);
    }
    Err(PyValueError::new_err(format!("{seconds} s is not from {least} to {most} s")))
}

fn id(node: i64) -> PyResult<NodeId> {
    let id = u8::try_from(node).ok().and_then(|it| NodeId::new(it).ok());
    id.ok_or_else(|| PyKeyError::new_err(format!("node id {node} is outside 1 to 8")))
}

/// A speed of a line, bit/s.
pub(crate) fn baud_rate(baud: u32) -> PyResult<u32> {
    let line = format!("{baud} bit/s is not from 1200 to 12000000");
    (1200..=12_000_000).contains(&baud).then_some(baud).ok_or_else(|| PyValueError::new_err(line))
}

/// A motor bus on a serial port (Ikeya MD, boards with one motor).
///
/// Its motors are stopped, and seen to stand still, when the `with` block is left, at the end of
/// the program, and when the object is collected. Between calls a thread of its own serves the
/// line. Call something at least every `dead_man_s`, or `wait`: else the motors are stopped,
/// because whoever is at the keyboard may have gone. Each node is read, and told its set-point
/// again, every `period_s`.
#[pyclass(frozen, weakref, module = "axlewire")]
pub(crate) struct Bus {
    worker: Arc<Worker<Driver>>,
    port: String,
}

#[pymethods]
impl Bus {
    #[new]
    #[pyo3(signature = (
        port: "str | os.PathLike[str]", *, nodes: "Iterable[int] | None" = None, baud=500_000, dead_man_s=Some(2.0), reply_timeout_s=None, period_s=0.02
    ))]
    fn new(
        py: Python<'_>,
        port: &Bound<'_, PyAny>,
        nodes: Option<Bound<'_, PyAny>>,
        baud: u32,
        dead_man_s: Option<f64>,
        reply_timeout_s: Option<f64>,
        period_s: f64,
    ) -> PyResult<Self> {
        let path: std::path::PathBuf = port.extract()?;
        py.import("axlewire._signals")?.call_method1("guard", (port,))?;
        let port = path.to_string_lossy().into_owned();
        let mut config = MasterConfig::usb_adapter();
        config.baud = baud_rate(baud)?;
        config.dead_man = dead_man_s.map(|it| within(it, 0.1, 3600.0)).transpose()?;
        config.polling = Polling::Every(span(period_s)?);
        if let Some(seconds) = reply_timeout_s {
            config.reply_timeout = within(seconds, 0.0005, 1.0)?;
        }
        if let Some(nodes) = nodes {
            let nodes = nodes.try_iter()?.map(|node| id(node?.extract()?));
            config.nodes = nodes.collect::<PyResult<Vec<_>>>()?.into_iter().collect();
        }
        let opened = py.detach(|| drive::Bus::open_with(&port, config));
        let bus = opened.map_err(|error| not_opened(&port, &error))?;
        let worker = Arc::new(Worker::new(Driver { bus, moved: NodeSet::default(), fired: 0 }));
        let weak: Weak<dyn Leave> = Arc::downgrade(&(Arc::clone(&worker) as Arc<dyn Leave>));
        remember(weak);
        Ok(Self { worker, port })
    }

    /// Asks all ids, and returns the nodes that answer with their modes.
    #[pyo3(signature = () -> "dict[int, str]")]
    fn discover<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        self.look(py, |driver| {
            let now = driver.bus.now();
            driver.bus.role_mut().discover(now);
        })?;
        // Each id is asked for so long at most; it ends by itself.
        let longest = Instant::now() + Wait::from_secs(3600);
        let found = self.worker.until(py, longest, |driver| {
            let master = driver.bus.role();
            let mode = |node: NodeId| Some((node, master.mode(node)?));
            let is_online = |node: &NodeId| master.health(*node) == Some(Health::Online);
            let all =
                || NodeId::ALL.into_iter().filter(is_online).filter_map(mode).collect::<Vec<_>>();
            (!master.is_discovering()).then(all)
        })?;
        let found = found.unwrap_or_default();
        let all = PyDict::new(py);
        for (node, mode) in found {
            all.set_item(node.get(), name(mode))?;
        }
        Ok(all)
    }

    /// A node by its id, 1 to 8.
    fn __getitem__(slf: &Bound<'_, Self>, node: i64) -> PyResult<Node> {
        Ok(Node { bus: slf.clone().unbind(), id: id(node)? })
    }

    /// The ids of the nodes that are online, as `online`.
    fn __iter__<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        Ok(PyList::new(py, self.online(py)?)?.try_iter()?.into_any())
    }

    /// Whether a node is online.
    fn __contains__(&self, py: Python<'_>, node: i64) -> PyResult<bool> {
        Ok(self.online(py)?.into_iter().any(|it| i64::from(it) == node))
    }

    /// The ids of the nodes that are online.
    #[getter]
    fn online(&self, py: Python<'_>) -> PyResult<Vec<u16>> {
        self.look(py, |driver| {
            let master = driver.bus.role();
            let is_online = |node: &NodeId| {
                matches!(master.health(*node), Some(Health::Online | Health::Suspect(_)))
            };
            NodeId::ALL.into_iter().filter(is_online).map(|it| it.get().into()).collect()
        })
    }

    /// Stops these nodes, or all that were heard, and returns when their motors are seen to stand
    /// still. Raises `StopsOwed` or `StillMoving` with the nodes whose motors may be moving.
    #[pyo3(signature = (*nodes: "int") -> "None")]
    fn stop(&self, py: Python<'_>, nodes: Vec<i64>) -> PyResult<()> {
        let nodes: PyResult<Vec<_>> = nodes.into_iter().map(id).collect();
        let nodes: NodeSet = nodes?.into_iter().collect();
        self.call(py, move |driver| {
            let master = driver.bus.role();
            // Whoever has moved it.
            let heard = NodeId::ALL.into_iter().filter(|node| master.mode(*node).is_some());
            let all: NodeSet = driver.moved.iter().chain(heard).collect();
            let nodes = if nodes.is_empty() { all } else { nodes };
            if nodes.is_empty() {
                return Err(Trouble::refused("no node was heard yet: `discover`, or `stop_all`"));
            }
            driver.bus.stop(nodes).map_err(Trouble::from)
        })
    }

    /// Stops every node that may be on this bus, heard or not. Those that were never heard cannot
    /// confirm it, so `StopsOwed` is raised for them: say with `Bus(..., nodes=[1, 2])` which ids
    /// there are. `stop()` stops those that were heard.
    fn stop_all(&self, py: Python<'_>) -> PyResult<()> {
        self.call(py, |driver| driver.bus.stop_all())
    }

    /// Waits, and tells the dead-man that somebody is there. Raises `PortLost` if the port fails,
    /// and `NotOnline` if a node that was moved is not heard any more.
    fn wait(&self, py: Python<'_>, seconds: f64) -> PyResult<()> {
        let end = Instant::now() + Wait::from_micros(span(seconds)?.as_micros().into());
        loop {
            self.call(py, |driver| driver.hears_all())?;
            self.worker.trouble().map_or(Ok(()), |trouble| Err(trouble.raised(py)))?;
            if Instant::now() >= end {
                return Ok(());
            }
            sleep_until(py, end.min(Instant::now() + SIGNALS_EVERY))?;
        }
    }

    /// Tells the dead-man that somebody is there.
    fn keep_alive(&self, py: Python<'_>) -> PyResult<()> {
        self.look(py, |_| ())
    }

    /// The counts so far, as a dictionary.
    #[getter]
    fn statistics<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let MasterStatistics { reads, writes, stale_bytes, dead_man, .. } =
            self.look(py, |driver| *driver.bus.role().statistics())?;
        let all = PyDict::new(py);
        all.set_item("reads", reads)?;
        all.set_item("writes", writes)?;
        all.set_item("stale_bytes", stale_bytes)?;
        all.set_item("dead_man", dead_man)?;
        Ok(all)
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
        format!("<axlewire.Bus on {}>", self.port)
    }
}

/// A call counts as a sign of life.
fn alive(driver: &mut Driver) {
    let now = driver.bus.now();
    driver.bus.role_mut().keep_alive(now);
}

/// The exception of a port that cannot be opened.
pub(crate) fn not_opened(port: &str, error: &io::Error) -> PyErr {
    let line = format!("cannot open {port:?}: {error}");
    match error.kind() {
        io::ErrorKind::NotFound => PyFileNotFoundError::new_err(line),
        io::ErrorKind::PermissionDenied => PyPermissionError::new_err(line),
        _ => PyOSError::new_err(line),
    }
}

/// Leaves a line: a wait that Ctrl-C ends, while the thread goes on stopping.
pub(crate) fn leave<D: Driven>(py: Python<'_>, worker: &Worker<D>) -> PyResult<()> {
    worker.dismiss();
    loop {
        match worker.left() {
            Some(left) => {
                worker.told();
                return left.map_err(|trouble| trouble.raised(py));
            }
            None => py.detach(|| std::thread::sleep(SIGNALS_EVERY / 4)),
        }
        py.check_signals()?;
    }
}

/// Leaves a line whose object is collected: there is nobody to raise to.
pub(crate) fn leave_collected<D: Driven>(worker: &Worker<D>) {
    worker.dismiss();
    let left = Python::try_attach(|py| {
        if let Err(trouble) = py.detach(|| worker.leave()) {
            trouble.raised(py).write_unraisable(py, None);
        }
    });
    if left.is_none() {
        let _ = worker.leave();
    }
}

impl Drop for Bus {
    fn drop(&mut self) {
        leave_collected(&*self.worker);
    }
}

impl Bus {
    fn call<T: Send + 'static, E: Into<Trouble>>(
        &self,
        py: Python<'_>,
        job: impl FnOnce(&mut Driver) -> Result<T, E> + Send + 'static,
    ) -> PyResult<T> {
        let (result, has_fired) = self.worker.call(py, move |driver| {
            let has_fired = driver.has_fired();
            alive(driver);
            (job(driver).map_err(Into::into), has_fired)
        })?;
        if has_fired {
            warn(py, "the dead-man has stopped the motors: nothing was called for `dead_man_s`")?;
        }
        result.map_err(|trouble| trouble.raised(py))
    }

    /// A call that cannot fail.
    fn look<T: Send + 'static>(
        &self,
        py: Python<'_>,
        job: impl FnOnce(&mut Driver) -> T + Send + 'static,
    ) -> PyResult<T> {
        self.call(py, move |driver| Ok::<_, Trouble>(job(driver)))
    }
}

const fn name(mode: Mode) -> &'static str {
    match mode {
        Mode::Velocity => "velocity",
        Mode::Position => "position",
    }
}

/// A node of a bus: `bus[1]`.
#[pyclass(frozen, module = "axlewire")]
pub(crate) struct Node {
    bus: Py<Bus>,
    id: NodeId,
}

impl Node {
    fn read(&self, py: Python<'_>) -> PyResult<Status> {
        let (id, bus) = (self.id, self.bus.get());
        let bound = bus.call(py, move |driver| {
            let now = driver.bus.now();
            let master = driver.bus.role_mut();
            master.read(id, now).map_err(|refused| Trouble::from(Failed::Bus(refused)))?;
            Ok::<_, Trouble>(master.read_bound().saturating_mul(4))
        })?;
        let end = Instant::now() + Wait::from_micros(bound.as_micros().into());
        let outcome = bus.worker.until(py, end, move |driver| {
            let master = driver.bus.role();
            let status = |()| master.status(id).map(|(status, _)| status);
            Some(master.read_outcome(id)?.map(status))
        })?;
        let failed = match outcome {
            Some(Ok(Some(status))) => return Ok(status),
            Some(Err(cause)) => Failed::ReadFailed { node: id, cause },
            Some(Ok(None)) | None => Failed::Timeout(Operation::Read { node: id }),
        };
        Err(Trouble::from(failed).raised(py))
    }
}

#[pymethods]
impl Node {
    /// Its id, 1 to 8.
    #[getter]
    fn id(&self) -> u8 {
        self.id.get()
    }

    /// Its speed, turns per second, measured now. Set it to turn the motor.
    #[getter]
    fn velocity(&self, py: Python<'_>) -> PyResult<f32> {
        match self.read(py)? {
            Status::Velocity(rps) => Ok(rps),
            Status::Position(_) => Err(wrong_mode(py, self.id, Mode::Position)),
        }
    }

    #[setter]
    fn set_velocity(&self, py: Python<'_>, rps: f32) -> PyResult<()> {
        let target = Rps::new(rps).map_err(|error| PyValueError::new_err(error.to_string()))?;
        let id = self.id;
        self.bus.get().call(py, move |driver| {
            driver.may_move(id, Target::Velocity(target))?;
            driver.bus.set_velocity(id, target)
        })
    }

    /// Its position, turns, measured now. Set it to move the motor there.
    #[getter]
    fn position(&self, py: Python<'_>) -> PyResult<f64> {
        match self.read(py)? {
            Status::Position(at) => {
                Ok(f64::from(at.counts()) / f64::from(Position::COUNTS_PER_REVOLUTION))
            }
            Status::Velocity(_) => Err(wrong_mode(py, self.id, Mode::Velocity)),
        }
    }

    #[setter]
    fn set_position(&self, py: Python<'_>, turns: f64) -> PyResult<()> {
        let counts = (turns * f64::from(Position::COUNTS_PER_REVOLUTION)).round();
        let in_range = (f64::from(i32::MIN)..=f64::from(i32::MAX)).contains(&counts);
        let target = if in_range { Position::from_counts(counts as i32).ok() } else { None };
        let target = target.ok_or_else(|| {
            PyValueError::new_err(format!("position {turns} is outside -32768 to 32767 turns"))
        })?;
        let id = self.id;
        self.bus.get().call(py, move |driver| {
            driver.may_move(id, Target::Position(target))?;
            driver.bus.set_position(id, target)
        })
    }

    /// `velocity` or `position`; `None` if it has never answered.
    #[getter]
    fn mode(&self, py: Python<'_>) -> PyResult<Option<&'static str>> {
        let id = self.id;
        self.bus.get().look(py, move |driver| driver.bus.role().mode(id).map(name))
    }

    /// `unknown`, `online`, `suspect` or `abnormal`.
    #[getter]
    fn health(&self, py: Python<'_>) -> PyResult<&'static str> {
        let id = self.id;
        let health = self.bus.get().look(py, move |driver| driver.bus.role().health(id))?;
        Ok(match health {
            None => "unknown",
            Some(Health::Online) => "online",
            Some(Health::Suspect(_)) => "suspect",
            Some(Health::Abnormal) => "abnormal",
        })
    }

    /// How far its latest stop is: `not_asked`, `owed`, `confirmed`, `standing_still` or
    /// `still_moving`.
    #[getter]
    fn stop_progress(&self, py: Python<'_>) -> PyResult<&'static str> {
        let id = self.id;
        let progress =
            self.bus.get().look(py, move |driver| driver.bus.role().stop_progress(id))?;
        Ok(match progress {
            StopProgress::NotAsked => "not_asked",
            StopProgress::Owed => "owed",
            StopProgress::Confirmed => "confirmed",
            StopProgress::StandingStill => "standing_still",
            StopProgress::StillMoving => "still_moving",
        })
    }

    /// Stops it, and returns when its motor is seen to stand still.
    fn stop(&self, py: Python<'_>) -> PyResult<()> {
        let id = self.id;
        self.bus.get().call(py, move |driver| driver.bus.stop(id))
    }

    fn __repr__(&self) -> String {
        format!("<axlewire.Node {} of {}>", self.id.get(), self.bus.get().port)
    }
}

fn wrong_mode(py: Python<'_>, node: NodeId, mode: Mode) -> PyErr {
    Trouble::from(Failed::Bus(CommandError::WrongMode { node, mode })).raised(py)
}
