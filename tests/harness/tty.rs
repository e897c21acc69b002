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
    /// Longest time for the next call.
    pub(crate) timeout: Duration,
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

/// Methods that no test reaches.
macro_rules! unused {
    ($($name:ident($($arguments:tt)*) -> $output:ty;)+) => {
        $(fn $name($($arguments)*) -> Result<$output> {
            unreachable!()
        })+
    };
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
        self.0.lock().unwrap().timeout
    }

    fn set_timeout(&mut self, timeout: Duration) -> Result<()> {
        self.0.lock().unwrap().timeout = timeout;
        Ok(())
    }

    fn bytes_to_read(&self) -> Result<u32> {
        unreachable!("it may be zero for ever")
    }

    unused! {
        data_bits(&self) -> DataBits;
        flow_control(&self) -> FlowControl;
        parity(&self) -> Parity;
        stop_bits(&self) -> StopBits;
        set_baud_rate(&mut self, _: u32) -> ();
        set_data_bits(&mut self, _: DataBits) -> ();
        set_flow_control(&mut self, _: FlowControl) -> ();
        set_parity(&mut self, _: Parity) -> ();
        set_stop_bits(&mut self, _: StopBits) -> ();
        write_request_to_send(&mut self, _: bool) -> ();
        write_data_terminal_ready(&mut self, _: bool) -> ();
        read_clear_to_send(&mut self) -> bool;
        read_data_set_ready(&mut self) -> bool;
        read_ring_indicator(&mut self) -> bool;
        read_carrier_detect(&mut self) -> bool;
        clear(&self, _: ClearBuffer) -> ();
        try_clone(&self) -> Box<dyn serialport::SerialPort>;
        set_break(&self) -> ();
        clear_break(&self) -> ();
    }
}

pub(crate) fn fails<T>(kind: ErrorKind) -> io::Result<T> {
    Err(kind.into())
}
