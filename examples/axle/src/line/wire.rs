//! A port of any kind.

use std::{io, time::Duration};

use axlewire::drive::{SerialPort, WithoutEcho};
use embedded_io::{ErrorType, Read, ReadReady, Write};

use super::Line;

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

impl Wire for WithoutEcho<Line> {
    /// Ends early if only an echo has come.
    fn wait(&mut self, patience: Duration) -> io::Result<bool> {
        if self.read_ready()? {
            return Ok(true);
        }
        self.port_mut().wire.borrow_mut().wait(patience)?;
        self.read_ready()
    }
}
