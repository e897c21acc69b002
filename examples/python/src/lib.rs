//! The module behind the Python package `axlewire`.

mod builders;
mod bus;
mod bytes;
mod capture;
mod rover;
mod table;
mod trouble;
mod worker;

use std::{ffi::OsString, process::ExitCode};

use pyo3::prelude::*;

#[cfg(feature = "mimalloc")]
#[global_allocator]
static ALLOCATOR: mimalloc::MiMalloc = mimalloc::MiMalloc;

/// CRC-16 of both protocols (ruling B1).
#[pyfunction]
#[pyo3(signature = (data: "Buffer"))]
fn crc16(data: bytes::Data) -> u16 {
    axlewire::crc16::compute(&data.0)
}

/// Runs the tool `axle` with these arguments, and returns its exit code.
#[pyfunction]
fn _tool(py: Python<'_>, args: Vec<OsString>) -> u8 {
    let code = py.detach(|| axle::run_with(args));
    // What `ExitCode` is cannot be asked.
    match (code == ExitCode::SUCCESS, code == ExitCode::from(2)) {
        (true, _) => 0,
        (_, true) => 2,
        _ => 1,
    }
}

/// Stops whatever still moves, on all lines. Called at the end of the program.
#[pyfunction]
fn _leave_all(py: Python<'_>) {
    for trouble in py.detach(worker::leave_all) {
        trouble.raised(py).write_unraisable(py, None);
    }
}

#[pymodule]
mod _axlewire {
    #[pymodule_export]
    use crate::{
        _leave_all, _tool,
        builders::{
            ikeya_position, ikeya_read, ikeya_velocity, ikeya_write_position, ikeya_write_velocity,
            ucp_bias_request, ucp_biases, ucp_calibration_end, ucp_calibration_end_ack,
            ucp_calibration_start, ucp_calibration_start_ack, ucp_document_report, ucp_imu_bias,
            ucp_imu_bias_ack, ucp_mag_bias, ucp_mag_bias_ack, ucp_motor_control, ucp_network_state,
            ucp_ota_ack, ucp_ota_request, ucp_ping, ucp_pong, ucp_report, ucp_unknown,
        },
        bus::{Bus, Node},
        bytes::{Decoder, Framed, Gap},
        capture::{Capture, Scan, read, scan},
        crc16,
        rover::{Report, Reports, Rover},
        table::Table,
        trouble::{Error, NoAnswer, NotOnline, PortLost, Refused, StillMoving, StopsOwed},
    };

    #[pymodule_export]
    #[expect(non_upper_case_globals, reason = "Python's name")]
    const __version__: &str = env!("CARGO_PKG_VERSION");
}
