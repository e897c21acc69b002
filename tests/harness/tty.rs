//! A terminal of the `serialport` crate whose calls are scripted: signals, speeds and bytes that do
//! not leave, which no pseudo-terminal has. Unlike the port of `port.rs` it is below
//! `drive::SerialPort`, which is under test here.

use std::{
    collections::VecDeque,
    io::{self, ErrorKind, Read, Write},
    sync::{Arc, Mutex},
    time::Duration,
};

use axlewire::drive::SerialPort;
use serialport::{ClearBuffer, DataBits, FlowControl, Parity, Result, StopBits};

/// A result for each call; after that, reads and writes time out and nothing is queued.
#[derive(Default)]
pub(crate) struct Script {
    pub(crate) baud: u32,
    pub(crate) reads: VecDeque<io::Result<Vec<u8>>>,
    pub(crate) writes: VecDeque<io::Result<usize>>,
    /// Bytes that are still to be sent, as told call by call; the last one stays.
    pub(crate) queued: Vec<u32>,
    pub(crate) flushes: Arc<Mutex<u32>>,
    /// Whether every other call is interrupted.
    pub(crate) signals_forever: bool,
}

impl Script {
    /// How calls end that have no result of their own.
    fn end(&self) -> ErrorKind {
        if self.signals_forever { ErrorKind::Interrupted } else { ErrorKind::TimedOut }
    }

    pub(crate) fn port(self) -> SerialPort {
        SerialPort::from(Box::new(Scripted(Mutex::new(self))) as Box<dyn serialport::SerialPort>)
    }
}

struct Scripted(Mutex<Script>);

impl Read for Scripted {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let mut script = self.0.lock().unwrap();
        let end = script.end();
        let bytes = script.reads.pop_front().unwrap_or_else(|| Err(end.into()))?;
        buffer[..bytes.len()].copy_from_slice(&bytes);
        Ok(bytes.len())
    }
}

impl Write for Scripted {
    fn write(&mut self, _: &[u8]) -> io::Result<usize> {
        let mut script = self.0.lock().unwrap();
        let end = script.end();
        script.writes.pop_front().unwrap_or_else(|| Err(end.into()))
    }

    fn flush(&mut self) -> io::Result<()> {
        *self.0.lock().unwrap().flushes.lock().unwrap() += 1;
        Ok(())
    }
}

impl serialport::SerialPort for Scripted {
    fn name(&self) -> Option<String> {
        Some("/dev/ttyUSB0".to_owned())
    }

    fn baud_rate(&self) -> Result<u32> {
        Ok(self.0.lock().unwrap().baud)
    }

    fn bytes_to_write(&self) -> Result<u32> {
        let queued = &mut self.0.lock().unwrap().queued;
        Ok(if queued.len() > 1 { queued.remove(0) } else { queued.first().copied().unwrap_or(0) })
    }

    fn timeout(&self) -> Duration {
        Duration::ZERO
    }

    fn set_timeout(&mut self, _: Duration) -> Result<()> {
        Ok(())
    }

    fn bytes_to_read(&self) -> Result<u32> {
        unreachable!("it may be zero for ever")
    }

    // Nothing below is used.
    fn data_bits(&self) -> Result<DataBits> {
        unreachable!()
    }
    fn flow_control(&self) -> Result<FlowControl> {
        unreachable!()
    }
    fn parity(&self) -> Result<Parity> {
        unreachable!()
    }
    fn stop_bits(&self) -> Result<StopBits> {
        unreachable!()
    }
    fn set_baud_rate(&mut self, _: u32) -> Result<()> {
        unreachable!()
    }
    fn set_data_bits(&mut self, _: DataBits) -> Result<()> {
        unreachable!()
    }
    fn set_flow_control(&mut self, _: FlowControl) -> Result<()> {
        unreachable!()
    }
    fn set_parity(&mut self, _: Parity) -> Result<()> {
        unreachable!()
    }
    fn set_stop_bits(&mut self, _: StopBits) -> Result<()> {
        unreachable!()
    }
    fn write_request_to_send(&mut self, _: bool) -> Result<()> {
        unreachable!()
    }
    fn write_data_terminal_ready(&mut self, _: bool) -> Result<()> {
        unreachable!()
    }
    fn read_clear_to_send(&mut self) -> Result<bool> {
        unreachable!()
    }
    fn read_data_set_ready(&mut self) -> Result<bool> {
        unreachable!()
    }
    fn read_ring_indicator(&mut self) -> Result<bool> {
        unreachable!()
    }
    fn read_carrier_detect(&mut self) -> Result<bool> {
        unreachable!()
    }
    fn clear(&self, _: ClearBuffer) -> Result<()> {
        unreachable!()
    }
    fn try_clone(&self) -> Result<Box<dyn serialport::SerialPort>> {
        unreachable!()
    }
    fn set_break(&self) -> Result<()> {
        unreachable!()
    }
    fn clear_break(&self) -> Result<()> {
        unreachable!()
    }
}

pub(crate) fn fails<T>(kind: ErrorKind) -> io::Result<T> {
    Err(kind.into())
}
