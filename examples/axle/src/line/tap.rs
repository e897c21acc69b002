//! A port whose bytes are also told.

use std::{cell::RefCell, io, rc::Rc, time::Duration};

use embedded_io::{ErrorType, Read, ReadReady, Write};

use super::Wire;
use crate::pcapng::Direction;

/// A port whose bytes are also told, as soon as they have come or gone.
pub(super) struct Tap<F> {
    pub(super) wire: Rc<RefCell<dyn Wire>>,
    pub(super) tell: F,
}

impl<F: FnMut(Direction, &[u8])> Wire for Tap<F> {
    fn wait(&mut self, patience: Duration) -> io::Result<bool> {
        self.wire.borrow_mut().wait(patience)
    }
}

impl<F> ErrorType for Tap<F> {
    type Error = io::Error;
}

impl<F> ReadReady for Tap<F> {
    fn read_ready(&mut self) -> io::Result<bool> {
        self.wire.borrow_mut().read_ready()
    }
}

impl<F: FnMut(Direction, &[u8])> Read for Tap<F> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let count = self.wire.borrow_mut().read(buffer)?;
        (self.tell)(Direction::In, buffer.get(..count).unwrap_or_default());
        Ok(count)
    }
}

impl<F: FnMut(Direction, &[u8])> Write for Tap<F> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let count = self.wire.borrow_mut().write(bytes)?;
        (self.tell)(Direction::Out, bytes.get(..count).unwrap_or_default());
        Ok(count)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.wire.borrow_mut().flush()
    }
}
