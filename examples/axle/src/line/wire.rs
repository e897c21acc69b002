//! A port of any kind.

use std::{io, time::Duration};

use axlewire::drive::SerialPort;
use embedded_io::{ErrorType, Read, ReadReady, Write};

/// A port of any kind.
pub(crate) trait Wire: Read + ReadReady + Write + ErrorType<Error = io::Error> {
    /// Waits for bytes, at most for `patience`; returns whether there are some.
    fn wait(&mut self, patience: Duration) -> io::Result<bool>;
}

impl Wire for SerialPort {
    fn wait(&mut self, patience: Duration) -> io::Result<bool> {
        SerialPort::wait(self, patience)
    }
}
