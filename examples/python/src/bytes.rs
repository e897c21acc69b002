//! Frames: decoded from bytes, and built.


use pyo3::{prelude::*, types::PyList};
use serde_json::Value;

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
            let dict = pyo3::types::PyDict::new(py);
            for (name, value) in all {
                dict.set_item(name, python(py, value)?)?;
            }
            dict.into_any()
        }
    })
}
