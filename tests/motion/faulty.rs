//! A port of which one half fails while the other works.

use crate::{port::Unplugged, virtual_time::End};

/// An end of a line of which either half can fail while the other works.
pub(crate) struct Faulty {
    end: End,
    /// Every read fails.
    pub(crate) is_deaf: bool,
    /// Every read fails once something has been written.
    pub(crate) is_deafened: bool,
    /// Every write fails.
    pub(crate) is_mute: bool,
    pub(crate) written: Vec<u8>,
}

impl Faulty {
    pub(crate) fn new(end: End) -> Self {
        Self { end, is_deaf: false, is_deafened: false, is_mute: false, written: vec![] }
    }

    fn is_writable(&self) -> Result<(), Unplugged> {
        if self.is_mute { Err(Unplugged) } else { Ok(()) }
    }

    fn wrote(&mut self, bytes: &[u8]) {
        self.written.extend(bytes);
        self.is_deaf |= self.is_deafened;
    }
}

impl embedded_io::ErrorType for Faulty {
    type Error = Unplugged;
}

impl embedded_io::ReadReady for Faulty {
    fn read_ready(&mut self) -> Result<bool, Unplugged> {
        if self.is_deaf { Ok(true) } else { self.end.read_ready() }
    }
}

impl embedded_io::Read for Faulty {
    fn read(&mut self, buffer: &mut [u8]) -> Result<usize, Unplugged> {
        if self.is_deaf { Err(Unplugged) } else { embedded_io::Read::read(&mut self.end, buffer) }
    }
}

impl embedded_io::Write for Faulty {
    fn write(&mut self, buffer: &[u8]) -> Result<usize, Unplugged> {
        self.is_writable()?;
        let count = embedded_io::Write::write(&mut self.end, buffer)?;
        self.wrote(&buffer[..count]);
        Ok(count)
    }

    fn flush(&mut self) -> Result<(), Unplugged> {
        embedded_io::Write::flush(&mut self.end)
    }
}

impl embedded_io_async::Read for Faulty {
    async fn read(&mut self, buffer: &mut [u8]) -> Result<usize, Unplugged> {
        if self.is_deaf {
            return Err(Unplugged);
        }
        embedded_io_async::Read::read(&mut self.end, buffer).await
    }
}

impl embedded_io_async::Write for Faulty {
    async fn write(&mut self, buffer: &[u8]) -> Result<usize, Unplugged> {
        self.is_writable()?;
        let count = embedded_io_async::Write::write(&mut self.end, buffer).await?;
        self.wrote(&buffer[..count]);
        Ok(count)
    }

    async fn flush(&mut self) -> Result<(), Unplugged> {
        embedded_io_async::Write::flush(&mut self.end).await
    }
}
