//! A line that is only listened to.

use axle::listen;
use wasm_bindgen::prelude::*;

use crate::thrown;

/// The frames and gaps of a line, and a recording of it. It never sends.
#[wasm_bindgen]
pub struct Listener {
    line: listen::Listener,
    /// Microseconds since 1970, when `performance.now()` was 0.
    epoch: f64,
}

#[wasm_bindgen]
impl Listener {
    /// Listens to a line of this protocol; `unix_ms` is the time of day at `now`.
    #[wasm_bindgen(constructor)]
    pub fn new(protocol: &str, baud: u32, unix_ms: f64, now: f64) -> Result<Self, JsError> {
        let line = listen::Listener::new(protocol, "serial port of a browser", baud);
        let line = line.ok_or_else(|| thrown(format!("there is no protocol {protocol:?}")))?;
        Ok(Self { line, epoch: (unix_ms - now) * 1e3 })
    }

    /// Takes in what was received.
    pub fn receive(&mut self, bytes: &[u8], now: f64) {
        self.line.receive(bytes, (self.epoch + now * 1e3) as u64);
    }

    /// The lines since the last call, as those of `axle decode --json`.
    pub fn lines(&mut self) -> String {
        String::from_utf8_lossy(&self.line.take_lines()).into_owned()
    }

    /// The account of the bytes so far: the last line of `axle decode --json`.
    pub fn summary(&self) -> String {
        String::from_utf8_lossy(&listen::summary(&self.line.account(), 0)).into_owned()
    }

    /// What is new in the recording: the next part of a pcapng file.
    pub fn recording(&mut self) -> Vec<u8> {
        self.line.take_recording()
    }
}
