//! The module behind the Python package `axlewire`.

mod capture;
mod table;

use pyo3::prelude::*;

/// CRC-16 of both protocols (ruling B1).
#[pyfunction]
fn crc16(data: &[u8]) -> u16 {
    axlewire::crc16::compute(data)
}

#[pymodule]
fn _axlewire(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add("__version__", env!("CARGO_PKG_VERSION"))?;
    module.add_function(wrap_pyfunction!(crc16, module)?)?;
    module.add_function(wrap_pyfunction!(capture::read, module)?)?;
    module.add_function(wrap_pyfunction!(capture::scan, module)?)?;
    module.add_class::<capture::Capture>()?;
    module.add_class::<capture::Scan>()?;
    module.add_class::<table::Table>()?;
    Ok(())
}
