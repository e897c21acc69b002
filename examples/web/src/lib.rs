//! axlewire in a page: captures, roles on a line, and a simulated line.
//!
//! Times are milliseconds of `performance.now()`, which never goes backwards. What fails throws an
//! `Error` with a sentence for people.

pub mod bus;
pub mod capture;
pub mod listener;
pub mod rover;
mod session;
pub mod simulator;

use wasm_bindgen::JsError;

/// An error of the page.
fn thrown(error: impl ToString) -> JsError {
    JsError::new(&error.to_string())
}
