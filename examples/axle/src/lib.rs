//! `axle`: the host tool for Ikeya MD and UCP lines.
//!
//! Results go to standard output. Every failure gives one line on standard error and an exit code
//! that distinguishes usage errors from other failures.
//!
//! In a browser, where there is no system, it only reads captures.
#![cfg_attr(
    target_family = "wasm",
    allow(dead_code, unused_imports, unused_variables, reason = "the commands are not there")
)]

mod args;
#[cfg(not(target_family = "wasm"))]
mod beside;
#[cfg(not(target_family = "wasm"))]
mod boards;
#[cfg(not(target_family = "wasm"))]
mod bugreport;
#[cfg(not(target_family = "wasm"))]
mod bus;
#[cfg(not(target_family = "wasm"))]
mod calibrate;
mod captures;
mod clock;
pub mod columns;
#[cfg(not(target_family = "wasm"))]
mod command;
mod decode;
#[cfg(not(target_family = "wasm"))]
mod drive;
#[cfg(not(target_family = "wasm"))]
mod export;
#[cfg(not(target_family = "wasm"))]
mod extcap;
mod failure;
#[cfg(all(test, unix))]
mod flaky;
mod freely;
mod help;
mod hex;
mod input;
mod kept;
#[cfg(not(target_family = "wasm"))]
mod lamp;
#[cfg(not(target_family = "wasm"))]
mod line;
pub mod listen;
mod listing;
#[cfg(not(target_family = "wasm"))]
mod manual;
#[cfg(not(target_family = "wasm"))]
mod network;
#[cfg(not(any(unix, target_family = "wasm")))]
mod no_sim;
mod pcapng;
#[cfg(not(target_family = "wasm"))]
mod ping;
#[cfg(not(target_family = "wasm"))]
mod play;
#[cfg(all(test, unix))]
mod played;
#[cfg(not(target_family = "wasm"))]
mod plot;
#[cfg(not(target_family = "wasm"))]
mod ports;
#[cfg(not(target_family = "wasm"))]
mod record;
#[cfg(not(target_family = "wasm"))]
mod replay;
#[cfg(not(target_family = "wasm"))]
mod report;
#[cfg(not(target_family = "wasm"))]
mod rover;
pub mod rows;
#[cfg(not(target_family = "wasm"))]
mod scan;
#[cfg(not(target_family = "wasm"))]
mod send;
#[cfg(not(target_family = "wasm"))]
mod session;
#[cfg(not(target_family = "wasm"))]
mod signals;
#[cfg(unix)]
mod sim;
#[cfg(not(target_family = "wasm"))]
mod spin;
#[cfg(not(target_family = "wasm"))]
mod stop;
mod tables;
#[cfg(not(target_family = "wasm"))]
mod teller;
#[cfg(not(target_family = "wasm"))]
mod watch;

#[cfg(not(target_family = "wasm"))]
pub use command::run_with;
