//! Captures: read as a whole, or batch by batch.

use std::{
    collections::BTreeMap,
    ffi::CString,
    io::{self, Cursor, Read},
    mem::take,
    ops::Range,
    path::PathBuf,
    sync::{
        Arc, Mutex, PoisonError,
        atomic::{AtomicBool, Ordering},
        mpsc::{Receiver, RecvTimeoutError, SyncSender, sync_channel},
    },
    thread::{self, JoinHandle},
    time::{Duration, Instant},
};

use arrow_array::{RecordBatch, RecordBatchReader};
use arrow_schema::{ArrowError, SchemaRef};
use axle::columns::{self, Batch, Error, Summary};
use pyo3::{
    exceptions::{PyOSError, PyTypeError, PyUserWarning, PyValueError},
    prelude::*,
    types::{PyBytes, PyCapsule, PyDict, PyList, PyString},
};

use crate::{
    bytes::Data,
    table::{Schemas, Table, Units, stream},
    worker::received,
};

/// How often a long call looks for Ctrl-C.
pub(crate) const SIGNALS_EVERY: Duration = Duration::from_millis(20);

/// Batches that a reader may be ahead.
const AHEAD: usize = 4;

/// Where a capture comes from.
enum Source {
    Paths(Vec<PathBuf>),
    Bytes(Vec<u8>),
    File(Py<PyAny>),
}

/// What was passed as a capture: a path, several, bytes, or a file that is open for reading.
impl Source {
    fn of(given: &Bound<'_, PyAny>) -> PyResult<Self> {
        if let Ok(bytes) = given.cast::<PyBytes>() {
            return Ok(Self::Bytes(bytes.as_bytes().to_vec()));
        }
        if let Ok(Data(bytes)) = given.extract() {
            return Ok(Self::Bytes(bytes));
        }
        if given.hasattr("read")? {
            return Ok(Self::File(given.clone().unbind()));
        }
        if given.is_instance_of::<PyString>() || given.hasattr("__fspath__")? {
            return Ok(Self::Paths(vec![given.extract()?]));
        }
        match given.extract::<Vec<PathBuf>>() {
            Ok(paths) => Ok(Self::Paths(paths)),
            Err(_) => Err(PyTypeError::new_err(
                "a capture is a path, a list of paths, bytes, or a file open for reading bytes",
            )),
        }
    }

    /// Whether reading it may wait for somebody, as for the other end of a pipe. A file of Python
    /// hears of signals itself.
    fn may_wait(&self) -> bool {
        match self {
            Self::Paths(paths) => !paths.iter().all(|path| path.is_file() || path.is_dir()),
            Self::Bytes(_) | Self::File(_) => false,
        }
    }

    /// What a file of Python raises goes to `raised`.
    fn open(self, protocol: Option<&str>, raised: Raised) -> Result<columns::Capture, Error> {
        match self {
            Self::Paths(paths) => columns::Capture::open(&paths, protocol),
            Self::Bytes(bytes) => columns::Capture::of(Box::new(Cursor::new(bytes)), protocol),
            Self::File(file) => {
                columns::Capture::of(Box::new(PythonFile { file, raised }), protocol)
            }
        }
    }
}

/// What a file of Python has raised.
type Raised = Arc<Mutex<Option<PyErr>>>;

/// A file of Python.
struct PythonFile {
    file: Py<PyAny>,
    raised: Raised,
}

impl Read for PythonFile {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        Python::attach(|py| {
            let mut read = || -> PyResult<usize> {
                let given = self.file.bind(py).call_method1("read", (buffer.len(),))?;
                let bytes = given.cast::<PyBytes>().map_err(|_| {
                    let line = "read() gave no bytes: open the file with mode \"rb\"";
                    PyOSError::new_err(line)
                })?;
                let bytes = bytes.as_bytes();
                let to = buffer
                    .get_mut(..bytes.len())
                    .ok_or_else(|| PyOSError::new_err("read() gave more bytes than asked for"))?;
                to.copy_from_slice(bytes);
                Ok(bytes.len())
            };
            read().map_err(|error| {
                let told = io::Error::other(error.to_string());
                *self.raised.lock().unwrap_or_else(PoisonError::into_inner) = Some(error);
                told
            })
        })
    }
}

/// Fails with what a file has raised.
fn check_raised(raised: &Raised) -> PyResult<()> {
    let mut raised = raised.lock().unwrap_or_else(PoisonError::into_inner);
    raised.take().map_or(Ok(()), Err)
}

/// The exception of Python for a failure.
fn raised(error: Error) -> PyErr {
    match &error {
        Error::Io(line, Some(number)) => PyOSError::new_err((*number, line.clone())),
        Error::Io(line, None) => PyOSError::new_err(line.clone()),
        _ => PyValueError::new_err(error.to_string()),
    }
}

/// A capture that was read: its tables, by message.
#[pyclass(frozen, module = "axlewire")]
pub(crate) struct Capture {
    tables: BTreeMap<String, Arc<Vec<RecordBatch>>>,
    /// For each batch, the numbers of its rows among all.
    numbers: BTreeMap<String, Vec<Vec<Range<u64>>>>,
    schemas: Schemas,
    summary: Summary,
    /// What it was read from: for its name, and for plots.
    source: Py<PyAny>,
    protocol: Option<String>,
}

/// Reads a capture as a whole: a path, several, a folder, bytes, or a file open for reading bytes.
///
/// It may be pcapng, pcap, or raw bytes, packed with gzip or not. `protocol` names that of raw
/// bytes: "ucp", "ikeya" or "ikeya-3"; without it, it is found out. With `units="si"` each measured
/// column has another one beside it, such as `rpm_0_si` in rad/s, as `f64`. Of a damaged capture it
/// reads what there is, and warns; without any frame, all tables are empty. Raises OSError if the
/// file cannot be read, and ValueError if it is no capture.
#[pyfunction]
#[pyo3(signature = (source: "Source", *, protocol=None, units=None))]
pub(crate) fn read(
    py: Python<'_>,
    source: &Bound<'_, PyAny>,
    protocol: Option<String>,
    units: Option<&str>,
) -> PyResult<Capture> {
    let (units, given, source) =
        (Units::named(units)?, source.clone().unbind(), Source::of(source)?);
    let raised = Raised::default();
    let read = if source.may_wait() {
        in_a_thread(py, source, protocol.clone(), units, &raised)?
    } else {
        let mut next_look = Instant::now();
        let go_on = || {
            if Instant::now() < next_look {
                return Ok(());
            }
            next_look = Instant::now() + SIGNALS_EVERY;
            Python::attach(|py| py.check_signals()).map_err(|signal| {
                *raised.lock().unwrap_or_else(PoisonError::into_inner) = Some(signal);
                Error::Stopped
            })
        };
        py.detach(|| whole(source, protocol.as_deref(), units, Arc::clone(&raised), go_on))
    };
    check_raised(&raised)?;
    let Whole { tables, numbers, schemas, summary } = read.map_err(self::raised)?;
    warn_of(py, &summary)?;
    Ok(Capture { tables, numbers, schemas, summary, source: given, protocol })
}

/// Reads in a thread, so that Ctrl-C ends the call although the reading waits.
fn in_a_thread(
    py: Python<'_>,
    source: Source,
    protocol: Option<String>,
    units: Units,
    raised: &Raised,
) -> PyResult<Result<Whole, Error>> {
    let (raised, is_over) = (Arc::clone(raised), Arc::new(AtomicBool::new(false)));
    let ends = Arc::clone(&is_over);
    let go_on = move || if ends.load(Ordering::Relaxed) { Err(Error::Stopped) } else { Ok(()) };
    let (tell, told) = sync_channel(1);
    thread::spawn(move || {
        drop(tell.send(whole(source, protocol.as_deref(), units, raised, go_on)));
    });
    let read = received(py, told).inspect_err(|_| is_over.store(true, Ordering::Relaxed))?;
    Ok(read.unwrap_or(Err(Error::Stopped)))
}

/// What was read.
struct Whole {
    tables: BTreeMap<String, Arc<Vec<RecordBatch>>>,
    numbers: BTreeMap<String, Vec<Vec<Range<u64>>>>,
    schemas: Schemas,
    summary: Summary,
}

/// Reads all of a capture.
fn whole(
    source: Source,
    protocol: Option<&str>,
    units: Units,
    raised: Raised,
    go_on: impl FnMut() -> Result<(), Error>,
) -> Result<Whole, Error> {
    let capture = source.open(protocol, raised)?;
    let schemas = Schemas::new(&capture.empty(), units);
    let mut tables = BTreeMap::<String, Vec<_>>::new();
    let mut numbers = BTreeMap::<String, Vec<_>>::new();
    let summary = capture.read(
        |mut batch| {
            let table = batch.table.clone();
            numbers.entry(table.clone()).or_default().push(take(&mut batch.numbers));
            tables.entry(table).or_default().push(schemas.batch(batch));
            Ok(())
        },
        go_on,
    )?;
    let tables = tables.into_iter().map(|(name, all)| (name, Arc::new(all))).collect();
    Ok(Whole { tables, numbers, schemas, summary })
}

#[pymethods]
impl Capture {
    /// The table of a message: `capture["report"]` or `capture["ucp.report"]`. Empty if no such
    /// message is in the capture.
    fn __getitem__(&self, message: &str) -> PyResult<Table> {
        let name = self.full_name(message)?;
        let batches = self.tables.get(&name).cloned().unwrap_or_default();
        Ok(self.schemas.table(&name, batches))
    }

    fn __contains__(&self, message: &str) -> bool {
        self.full_name(message).is_ok_and(|name| self.tables.contains_key(&name))
    }

    fn __len__(&self) -> usize {
        self.tables.len()
    }

    fn __iter__(&self, py: Python<'_>) -> PyResult<Py<PyAny>> {
        let names: Vec<_> = self.keys();
        Ok(names.into_pyobject(py)?.call_method0("__iter__")?.unbind())
    }

    /// The names of the tables that have rows.
    fn keys(&self) -> Vec<String> {
        self.tables.keys().cloned().collect()
    }

    /// The bytes that belong to no frame. `reason` tells why no frame starts at the first of them:
    /// `header` (not the begin of a frame), `length` (no frame is so long), `id` (no such node),
    /// `crc` (damaged, or not a frame) or `idle` (cut off). If there are several reasons,
    /// `reasons_header` and the others tell how many bytes each has.
    #[getter]
    fn gaps(&self) -> PyResult<Table> {
        self.__getitem__("skipped")
    }

    /// All frames in their order: place, protocol, message and bytes.
    #[getter]
    fn frames(&self) -> Table {
        crate::table::frames(&self.tables, &self.numbers)
    }

    /// The account of the bytes, as a dictionary.
    #[getter]
    fn summary<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let dict = account_of(py, &self.summary)?;
        let messages = PyDict::new(py);
        for (name, rows) in self.counts() {
            messages.set_item(name, rows)?;
        }
        dict.set_item("messages", messages)?;
        Ok(dict)
    }

    /// A picture, as `axle plot` draws it; a notebook shows it.
    #[pyo3(signature = () -> "Picture")]
    fn plot<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let module = py.import("axlewire._picture")?;
        module.getattr("plot")?.call1((&self.source, &self.protocol))
    }

    fn __repr__(&self, py: Python<'_>) -> PyResult<String> {
        let account = &self.summary.account;
        let tables: Vec<_> = self.counts().map(|(name, rows)| format!("{name}: {rows}")).collect();
        Ok(format!(
            "<axlewire.Capture {}: {} bytes, {} frames, {} bytes skipped ({})>",
            self.name(py)?,
            account.received,
            account.frames,
            account.skipped(),
            tables.join(", ")
        ))
    }

    /// For notebooks: the messages, and the bytes that belong to none.
    fn _repr_html_(&self, py: Python<'_>) -> PyResult<String> {
        let account = &self.summary.account;
        let rows: String = self
            .counts()
            .map(|(name, rows)| format!("<tr><td>{}</td><td>{rows}</td></tr>", escaped(name)))
            .collect();
        let cut = self.summary.cut.as_deref().map(|cut| format!("<p>{}</p>", escaped(cut)));
        Ok(format!(
            "<p><b>{}</b>: {} bytes, {} frames, {} bytes in {} gaps</p>{}<table><tr><th>message</th>\
             <th>rows</th></tr>{rows}</table>",
            escaped(&self.name(py)?),
            account.received,
            account.frames,
            account.skipped(),
            account.gaps,
            cut.unwrap_or_default(),
        ))
    }
}

/// Text of HTML.
fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;")
}

impl Capture {
    /// Paths as they are; of bytes, how many.
    fn name(&self, py: Python<'_>) -> PyResult<String> {
        let source = self.source.bind(py);
        let is_named = source.is_instance_of::<PyString>() || source.hasattr("__fspath__")?;
        Ok(match source.len() {
            Ok(len) if !is_named && !source.is_instance_of::<PyList>() => format!("of {len} bytes"),
            _ => source.repr()?.to_string(),
        })
    }

    fn counts(&self) -> impl Iterator<Item = (&String, usize)> {
        let rows = |all: &Arc<Vec<RecordBatch>>| all.iter().map(RecordBatch::num_rows).sum();
        self.tables.iter().map(move |(name, all)| (name, rows(all)))
    }

    fn full_name(&self, message: &str) -> PyResult<String> {
        let found = self.schemas.full_name(message, |name| self.tables.contains_key(name));
        found.ok_or_else(|| self.schemas.no_message(message))
    }
}

/// Reads a capture in another thread, batch by batch: memory does not grow with its length.
#[pyclass(frozen, module = "axlewire")]
pub(crate) struct Scan {
    reading: Mutex<Reading>,
    schemas: Schemas,
    message: Option<String>,
    raised: Raised,
    /// Once all was read.
    summary: Mutex<Option<Summary>>,
}

/// What the other thread gives; `None` once it has ended.
struct Reading {
    batches: Option<Receiver<Batch>>,
    reader: Option<JoinHandle<Result<Summary, Error>>>,
}

/// Reads a capture batch by batch, in a thread of its own: memory does not grow with its length.
///
/// Gives tables of up to 65,536 rows. With `message` they are of that message only, and the scan is
/// itself a stream of Arrow. The rest is as with `read`.
#[pyfunction]
#[pyo3(signature = (source: "Source", *, protocol=None, message=None, units=None))]
pub(crate) fn scan(
    py: Python<'_>,
    source: &Bound<'_, PyAny>,
    protocol: Option<String>,
    message: Option<&str>,
    units: Option<&str>,
) -> PyResult<Scan> {
    let (units, source) = (Units::named(units)?, Source::of(source)?);
    let (to, batches) = sync_channel(AHEAD);
    let (say, said) = sync_channel(1);
    let (named, raised) = (protocol.clone(), Raised::default());
    let theirs = Arc::clone(&raised);
    let reader = thread::spawn(move || run(source, protocol.as_deref(), theirs, &say, &to));
    let mut reading = Reading { batches: Some(batches), reader: Some(reader) };
    let Some(empty) = received(py, said)? else {
        let ended = py.detach(|| reading.end());
        check_raised(&raised)?;
        return Err(self::raised(ended.err().unwrap_or(Error::Stopped)));
    };
    let schemas = Schemas::new(&empty, units);
    let message = message.map(|message| schemas.only(message, named.as_deref())).transpose()?;
    let (reading, summary) = (Mutex::new(reading), Mutex::new(None));
    Ok(Scan { reading, schemas, message, raised, summary })
}

fn run(
    source: Source,
    protocol: Option<&str>,
    raised: Raised,
    say: &SyncSender<Vec<Batch>>,
    to: &SyncSender<Batch>,
) -> Result<Summary, Error> {
    let capture = source.open(protocol, raised)?;
    say.send(capture.empty()).map_err(|_| Error::Stopped)?;
    capture.read(|batch| to.send(batch).map_err(|_| Error::Stopped), || Ok(()))
}

/// What comes next of a capture that is being read.
enum Next {
    Batch(Batch),
    Waits,
    /// The first time with what was found, then without.
    End(Option<Summary>),
}

impl Reading {
    fn next(&mut self, within: Duration) -> Result<Next, Error> {
        let Some(batches) = &self.batches else { return Ok(Next::End(None)) };
        match batches.recv_timeout(within) {
            Ok(batch) => Ok(Next::Batch(batch)),
            Err(RecvTimeoutError::Timeout) => Ok(Next::Waits),
            Err(RecvTimeoutError::Disconnected) => self.end().map(Next::End),
        }
    }

    /// Waits for the end of the other thread, which has nothing to send to any more.
    fn end(&mut self) -> Result<Option<Summary>, Error> {
        self.batches = None;
        let Some(reader) = self.reader.take() else { return Ok(None) };
        let ended = reader.join();
        ended.map_err(|_| Error::Capture("the reader has ended".to_owned()))?.map(Some)
    }
}

impl Scan {
    /// All was read: what is missing is told, once.
    fn end(&self, py: Python<'_>, summary: Option<Summary>) -> PyResult<()> {
        let Some(summary) = summary else { return Ok(()) };
        let warned = warn_of(py, &summary);
        *self.summary.lock().unwrap_or_else(PoisonError::into_inner) = Some(summary);
        warned
    }

    /// Reads no more.
    fn give_up(&self) -> Result<Option<Summary>, Error> {
        self.reading.lock().map_err(|_| Error::Stopped)?.end()
    }

    /// The next batch of the message, or of any; `None` at the end.
    fn next_batch(&self, within: Duration) -> Result<Next, Error> {
        let mut reading = self.reading.lock().map_err(|_| Error::Stopped)?;
        match reading.next(within)? {
            Next::Batch(batch) if self.message.as_ref().is_some_and(|it| *it != batch.table) => {
                Ok(Next::Waits)
            }
            next => Ok(next),
        }
    }
}

#[pymethods]
impl Scan {
    fn __iter__(slf: PyRef<'_, Self>) -> PyRef<'_, Self> {
        slf
    }

    fn __next__(&self, py: Python<'_>) -> PyResult<Option<Table>> {
        loop {
            // A list of all, say, asks without a look at signals of its own.
            py.check_signals()?;
            let next = py.detach(|| self.next_batch(SIGNALS_EVERY));
            if let Err(error) = check_raised(&self.raised) {
                // Nothing follows, neither what was read before.
                drop(py.detach(|| self.give_up()));
                return Err(error);
            }
            match next.map_err(raised)? {
                Next::Batch(batch) => {
                    let name = batch.table.clone();
                    let batches = Arc::new(vec![self.schemas.batch(batch)]);
                    return Ok(Some(self.schemas.table(&name, batches)));
                }
                Next::Waits => {}
                Next::End(summary) => {
                    self.end(py, summary)?;
                    return Ok(None);
                }
            }
        }
    }

    /// For whatever takes a stream of Arrow: the rows of one message, in constant memory.
    #[pyo3(signature = (requested_schema=None))]
    fn __arrow_c_stream__<'py>(
        slf: &Bound<'py, Self>,
        requested_schema: Option<Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyCapsule>> {
        drop(requested_schema);
        let Some(message) = &slf.get().message else {
            let line = "a stream has rows of one kind: scan(..., message=\"report\")";
            return Err(PyValueError::new_err(line));
        };
        let schema = slf.get().schemas.schema(message);
        let batches = Batches { scan: slf.clone().unbind(), schema: Arc::clone(&schema) };
        stream(slf.py(), Box::new(batches))
    }

    /// The account of the bytes, as that of a capture; `None` before the end.
    #[getter]
    fn summary<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyDict>>> {
        let summary = self.summary.lock().unwrap_or_else(PoisonError::into_inner);
        summary.as_ref().map(|summary| account_of(py, summary)).transpose()
    }

    fn __repr__(&self) -> String {
        format!("<axlewire.Scan of {}>", self.message.as_deref().unwrap_or("all messages"))
    }
}

/// The batches of a scan, for a program that knows nothing of Python.
struct Batches {
    scan: Py<Scan>,
    schema: SchemaRef,
}

impl Iterator for Batches {
    type Item = Result<RecordBatch, ArrowError>;

    fn next(&mut self) -> Option<Self::Item> {
        let scan = self.scan.get();
        loop {
            match scan.next_batch(SIGNALS_EVERY) {
                Ok(Next::Batch(batch)) => return Some(Ok(scan.schemas.batch(batch))),
                Ok(Next::Waits) => {}
                Ok(Next::End(summary)) => {
                    // What a file has raised has ended the reading.
                    let ended = Python::try_attach(|py| {
                        check_raised(&scan.raised).and_then(|()| scan.end(py, summary))
                    });
                    let failed = ended.and_then(Result::err)?;
                    return Some(Err(ArrowError::ExternalError(failed.to_string().into())));
                }
                Err(error) => {
                    let line = error.to_string();
                    return Some(Err(ArrowError::ExternalError(line.into())));
                }
            }
        }
    }
}

impl RecordBatchReader for Batches {
    fn schema(&self) -> SchemaRef {
        Arc::clone(&self.schema)
    }
}

/// What was found, as a dictionary.
fn account_of<'py>(py: Python<'py>, summary: &Summary) -> PyResult<Bound<'py, PyDict>> {
    let (dict, account) = (PyDict::new(py), &summary.account);
    dict.set_item("received", account.received)?;
    dict.set_item("frames", account.frames)?;
    dict.set_item("framed", account.framed)?;
    dict.set_item("gaps", account.gaps)?;
    dict.set_item("skipped", account.skipped())?;
    dict.set_item("times_back", summary.times_back)?;
    dict.set_item("cut", summary.cut.clone())?;
    Ok(dict)
}

/// What a capture is told to have, or to lack, as warnings.
fn warn_of(py: Python<'_>, summary: &Summary) -> PyResult<()> {
    summary.notes.iter().chain(&summary.cut).try_for_each(|line| warn(py, line))
}

/// Something that is no error, as a warning.
pub(crate) fn warn(py: Python<'_>, cut: &str) -> PyResult<()> {
    let line = CString::new(cut.replace('\0', " ")).unwrap_or_default();
    PyErr::warn(py, &py.get_type::<PyUserWarning>(), &line, 1)
}
