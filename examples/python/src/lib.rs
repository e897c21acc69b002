//! The module behind the Python package `axlewire`.

mod bus;
mod bytes;
mod capture;
mod rover;
mod table;
mod trouble;
mod worker;

use pyo3::prelude::*;

/// CRC-16 of both protocols (ruling B1).
#[pyfunction]
fn crc16(data: &[u8]) -> u16 {
    axlewire::crc16::compute(data)
}

/// Stops whatever still moves, on all lines. Called at the end of the program.
#[pyfunction]
fn _leave_all(py: Python<'_>) {
    for trouble in py.detach(worker::leave_all) {
        trouble.raised(py).write_unraisable(py, None);
    }
}

#[pymodule]
fn _axlewire(module: &Bound<'_, PyModule>) -> PyResult<()> {
    let py = module.py();
    module.add("__version__", env!("CARGO_PKG_VERSION"))?;
    module.add_function(wrap_pyfunction!(crc16, module)?)?;
    module.add_function(wrap_pyfunction!(_leave_all, module)?)?;
    module.add_function(wrap_pyfunction!(capture::read, module)?)?;
    module.add_function(wrap_pyfunction!(capture::scan, module)?)?;
    module.add_class::<capture::Capture>()?;
    module.add_class::<capture::Scan>()?;
    module.add_class::<table::Table>()?;
    module.add_class::<bus::Bus>()?;
    module.add_class::<bus::Node>()?;
    module.add_class::<rover::Rover>()?;
    module.add_class::<rover::Reports>()?;
    module.add_class::<rover::Report>()?;
    module.add("Error", py.get_type::<trouble::Error>())?;
    module.add("StopsOwed", py.get_type::<trouble::StopsOwed>())?;
    module.add("StillMoving", py.get_type::<trouble::StillMoving>())?;
    module.add("NotOnline", py.get_type::<trouble::NotOnline>())?;
    module.add("Refused", py.get_type::<trouble::Refused>())?;
    module.add("NoAnswer", py.get_type::<trouble::NoAnswer>())?;
    module.add("PortLost", py.get_type::<trouble::PortLost>())?;
    Ok(())
}
