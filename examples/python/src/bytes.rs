//! Frames: decoded from bytes.

use std::hash::{DefaultHasher, Hash, Hasher};

use axlewire::{
    ikeya::{self, three},
    stream::{self, Counters, Event, Framing},
    ucp,
};
use pyo3::{
    Borrowed,
    buffer::PyBuffer,
    exceptions::{PyAttributeError, PyValueError},
    prelude::*,
    types::{PyBytes, PyDict, PyList},
};
use serde::Serialize;
use serde_json::Value;

/// Whatever holds bytes: `bytes`, `bytearray`, `memoryview` and others.
pub(crate) struct Data(pub(crate) Vec<u8>);

impl<'py> FromPyObject<'_, 'py> for Data {
    type Error = PyErr;

    fn extract(object: Borrowed<'_, 'py, PyAny>) -> PyResult<Self> {
        Ok(Self(PyBuffer::<u8>::get(&object)?.to_vec(object.py())?))
    }
}

/// The values of a frame as JSON has them: 0.1, and not 0.10000000149011612, for an `f32`.
pub(crate) fn values(frame: &impl Serialize) -> serde_json::Result<Value> {
    serde_json::from_str(&serde_json::to_string(frame)?)
}

/// A value of JSON in Python.
pub(crate) fn python<'py>(py: Python<'py>, value: &Value) -> PyResult<Bound<'py, PyAny>> {
    Ok(match value {
        Value::Null => py.None().into_bound(py),
        Value::Bool(it) => it.into_pyobject(py)?.to_owned().into_any(),
        Value::String(it) => it.into_pyobject(py)?.into_any(),
        Value::Number(it) => match (it.as_i64(), it.as_u64()) {
            (Some(it), _) => it.into_pyobject(py)?.into_any(),
            (_, Some(it)) => it.into_pyobject(py)?.into_any(),
            _ => it.as_f64().into_pyobject(py)?.into_any(),
        },
        Value::Array(all) => {
            let all: PyResult<Vec<_>> = all.iter().map(|it| python(py, it)).collect();
            PyList::new(py, all?)?.into_any()
        }
        Value::Object(all) => {
            let dict = PyDict::new(py);
            for (name, value) in all {
                dict.set_item(name, python(py, value)?)?;
            }
            dict.into_any()
        }
    })
}

/// The fields of a frame in one line, without those that are told elsewhere.
pub(crate) fn told(fields: &Value) -> String {
    let fields = fields.as_object().into_iter().flatten();
    let told =
        fields.filter(|(name, _)| !["protocol", "message", "bytes"].contains(&name.as_str()));
    told.map(|(name, value)| format!("{name}={value}")).collect::<Vec<_>>().join(" ")
}

/// A frame: what it is, and the values in it.
#[pyclass(frozen, module = "axlewire", name = "Frame")]
pub(crate) struct Framed {
    protocol: &'static str,
    bytes: Vec<u8>,
    fields: Value,
}

impl Framed {
    fn field(&self, name: &str) -> Option<&Value> {
        self.fields.as_object().and_then(|all| all.get(name))
    }
}

#[pymethods]
impl Framed {
    #[classattr]
    #[expect(non_upper_case_globals, reason = "Python's name")]
    const __match_args__: (&'static str, &'static str) = ("message", "raw");

    /// `ucp`, `ikeya` or `ikeya-3`.
    #[getter]
    const fn protocol(&self) -> &'static str {
        self.protocol
    }

    /// The name of the message, such as `report`.
    #[getter]
    fn message(&self) -> &str {
        self.field("message").and_then(Value::as_str).unwrap_or_default()
    }

    /// The whole frame, with its CRC.
    #[getter]
    fn raw<'py>(&self, py: Python<'py>) -> Bound<'py, PyBytes> {
        PyBytes::new(py, &self.bytes)
    }

    /// All values, as `axle decode --json` names them; bytes as hex digits.
    #[getter]
    fn fields<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        python(py, &self.fields)
    }

    fn __getattr__<'py>(&self, py: Python<'py>, name: &str) -> PyResult<Bound<'py, PyAny>> {
        match self.field(name) {
            Some(value) => python(py, value),
            None => Err(PyAttributeError::new_err(format!("{} has no {name}", self.message()))),
        }
    }

    fn __eq__(&self, other: &Self) -> bool {
        (self.protocol, &self.bytes) == (other.protocol, &other.bytes)
    }

    fn __hash__(&self) -> u64 {
        let mut hasher = DefaultHasher::new();
        self.bytes.hash(&mut hasher);
        hasher.finish()
    }

    fn __repr__(&self) -> String {
        format!("<axlewire.Frame {}.{} {}>", self.protocol, self.message(), told(&self.fields))
    }
}

/// Bytes that belong to no frame.
#[pyclass(frozen, get_all, eq, module = "axlewire")]
#[derive(Eq, Hash, PartialEq)]
pub(crate) struct Gap {
    /// How many.
    length: u64,
    /// Why no frame starts at the first: `header`, `length`, `id`, `crc` or `idle`.
    reason: &'static str,
}

#[pymethods]
impl Gap {
    #[classattr]
    #[expect(non_upper_case_globals, reason = "Python's name")]
    const __match_args__: (&'static str, &'static str) = ("length", "reason");

    fn __hash__(&self) -> u64 {
        let mut hasher = DefaultHasher::new();
        self.hash(&mut hasher);
        hasher.finish()
    }

    fn __repr__(&self) -> String {
        format!("<axlewire.Gap of {} bytes: {}>", self.length, self.reason)
    }
}

/// A decoder of any framing.
trait Decodes: Send {
    fn feed(&mut self, py: Python<'_>, bytes: &[u8], to: &mut Vec<Py<PyAny>>) -> PyResult<()>;
    fn idle(&mut self);
    fn pending(&self) -> usize;
    fn counters(&self) -> Counters;
}

/// What all frames have.
trait Shown: Serialize {
    fn whole(&self) -> &[u8];
}

impl Shown for &ucp::Frame {
    fn whole(&self) -> &[u8] {
        self.as_bytes()
    }
}

impl Shown for ikeya::Packet<'_> {
    fn whole(&self) -> &[u8] {
        self.as_bytes()
    }
}

impl Shown for three::Packet<'_> {
    fn whole(&self) -> &[u8] {
        self.as_bytes()
    }
}

struct Of<F: Framing> {
    protocol: &'static str,
    decoder: stream::Decoder<F, { ucp::MAX_LEN }>,
}

impl<F> Decodes for Of<F>
where
    F: Framing + Send,
    for<'a> F::Frame<'a>: Shown,
{
    fn feed(&mut self, py: Python<'_>, bytes: &[u8], to: &mut Vec<Py<PyAny>>) -> PyResult<()> {
        let mut bytes = bytes;
        while let Some(event) = self.decoder.decode(&mut bytes) {
            to.push(match event {
                Event::Frame(frame) => {
                    let fields =
                        values(&frame).map_err(|error| PyValueError::new_err(error.to_string()))?;
                    let (protocol, bytes) = (self.protocol, frame.whole().to_vec());
                    Py::new(py, Framed { protocol, bytes, fields })?.into_any()
                }
                Event::Skipped(gap) => {
                    Py::new(py, Gap { length: gap.len, reason: gap.reason.name() })?.into_any()
                }
            });
        }
        Ok(())
    }

    fn idle(&mut self) {
        self.decoder.idle();
    }

    fn pending(&self) -> usize {
        self.decoder.pending()
    }

    fn counters(&self) -> Counters {
        self.decoder.counters()
    }
}

/// Finds the frames in a stream of bytes, whatever is between them.
///
/// Every byte is in exactly one frame or gap: no stray byte costs a frame that is whole.
#[pyclass(module = "axlewire")]
pub(crate) struct Decoder {
    protocol: &'static str,
    decoder: Box<dyn Decodes + Sync>,
}

#[pymethods]
impl Decoder {
    /// For `ucp`, `ikeya` or `ikeya-3`; packets of both directions.
    #[new]
    fn new(protocol: &str) -> PyResult<Self> {
        fn of<F: Framing>(protocol: &'static str) -> Of<F> {
            Of { protocol, decoder: stream::Decoder::new() }
        }
        let (protocol, decoder): (_, Box<dyn Decodes + Sync>) = match protocol {
            "ucp" => ("ucp", Box::new(of::<ucp::Ucp>("ucp"))),
            "ikeya" => ("ikeya", Box::new(of::<ikeya::BothDirections>("ikeya"))),
            "ikeya-3" => ("ikeya-3", Box::new(of::<three::BothDirections>("ikeya-3"))),
            other => {
                let line = format!("protocol {other:?} is none of 'ucp', 'ikeya', 'ikeya-3'");
                return Err(PyValueError::new_err(line));
            }
        };
        Ok(Self { protocol, decoder })
    }

    /// Takes in bytes, in pieces of any length; returns the frames and gaps that are decided now.
    #[pyo3(signature = (data: "Buffer") -> "list[Frame | Gap]")]
    fn feed(&mut self, py: Python<'_>, data: Data) -> PyResult<Vec<Py<PyAny>>> {
        let mut events = Vec::new();
        self.decoder.feed(py, &data.0, &mut events)?;
        Ok(events)
    }

    /// The line is quiet, or the stream has ended: what is pending is no frame any more. Returns
    /// what is decided now.
    #[pyo3(signature = () -> "list[Frame | Gap]")]
    fn idle(&mut self, py: Python<'_>) -> PyResult<Vec<Py<PyAny>>> {
        let mut events = Vec::new();
        loop {
            self.decoder.idle();
            self.decoder.feed(py, &[], &mut events)?;
            if self.decoder.pending() == 0 {
                return Ok(events);
            }
        }
    }

    /// Bytes that may be the begin of a frame.
    #[getter]
    fn pending(&self) -> usize {
        self.decoder.pending()
    }

    /// The account so far: each byte is in a frame, in a gap, or pending.
    #[getter]
    fn counters<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let (dict, of) = (PyDict::new(py), self.decoder.counters());
        dict.set_item("received", of.received)?;
        dict.set_item("frames", of.frames)?;
        dict.set_item("framed", of.framed)?;
        dict.set_item("gaps", of.gaps)?;
        dict.set_item("skipped", of.skipped())?;
        Ok(dict)
    }

    fn __repr__(&self) -> String {
        format!("<axlewire.Decoder of {}>", self.protocol)
    }
}
