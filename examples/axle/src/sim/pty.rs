//! A pseudo-terminal in place of a line: the program that opens its path is at the other end.

use std::{
    io,
    time::{Duration, Instant as Clock},
};

use axlewire::{drive, sim, time::Instant};
use embedded_io::{ErrorType, Read, ReadReady, Write};
use serialport::{ClearBuffer, SerialPort, TTYPort};

use super::faults::FaultArgs;
use crate::{failure::Failure, line::Wire};

/// Number of bytes that may wait for a reader. On a wire, unread bytes are lost; here they would
/// wait forever and block the sender.
const UNREAD_LIMIT: u32 = 2048;

/// Silence after which the program that had the path open may be gone.
const GONE: Duration = Duration::from_secs(1);

/// Longest wait in one call.
const LOOK: Duration = Duration::from_millis(5);

/// Our end of a pseudo-terminal, behind wires with faults.
pub(super) struct Pty {
    port: drive::SerialPort,
    /// The other end, held open so that the terminal does not hang up when a program closes it.
    held: TTYPort,
    start: Clock,
    heard_at: Clock,
    faults: FaultArgs,
    /// From the program at the other end, and to it.
    incoming: sim::Wire,
    outgoing: sim::Wire,
}

impl Pty {
    /// Opens a pseudo-terminal; returns its path, too.
    pub(super) fn open(faults: &FaultArgs) -> Result<(Self, String), Failure> {
        let failed =
            |cause: String| Failure::Failed(format!("cannot open a pseudo-terminal: {cause}"));
        let (ours, held) = TTYPort::pair().map_err(|error| failed(error.description))?;
        let path = held.name().ok_or_else(|| failed("it has no name".to_owned()))?;
        let ours: Box<dyn SerialPort> = Box::new(ours);
        let (incoming, outgoing) = faults.wires();
        let now = Clock::now();
        let faults = faults.clone();
        let pty =
            Self { port: ours.into(), held, start: now, heard_at: now, faults, incoming, outgoing };
        Ok((pty, path))
    }

    fn now(&self) -> Instant {
        Instant::from_micros(self.start.elapsed().as_micros() as u64)
    }

    /// Moves due bytes from the port to the wire and from the wire to the port; returns
    /// whether there are bytes for the simulation.
    fn carry(&mut self) -> io::Result<bool> {
        let now = self.now();
        let is_unplugged = self.faults.is_unplugged(now);
        for wire in [&mut self.incoming, &mut self.outgoing] {
            wire.faults_mut().unplugged = is_unplugged;
        }
        self.deliver(now)?;
        while self.port.read_ready()? {
            let mut buffer = [0; 256];
            let count = self.port.read(&mut buffer)?;
            self.heard_at = Clock::now();
            let echo = self.incoming.send(buffer.get(..count).unwrap_or_default(), now).to_vec();
            self.put(&echo)?;
        }
        Ok(self.incoming.next().is_some_and(|at| at <= now))
    }

    /// Gives the program at the other end what is due.
    fn deliver(&mut self, now: Instant) -> io::Result<()> {
        let mut buffer = [0; 256];
        loop {
            match self.outgoing.receive(&mut buffer, now) {
                0 => return Ok(()),
                count => self.put(buffer.get(..count).unwrap_or_default())?,
            }
        }
    }

    /// Writes all bytes to the port. Those for which it has no room are lost, as on a wire.
    fn put(&mut self, mut bytes: &[u8]) -> io::Result<()> {
        if self.held.bytes_to_read().is_ok_and(|unread| unread > UNREAD_LIMIT) {
            drop(self.held.clear(ClearBuffer::Input));
        }
        while !bytes.is_empty() {
            match self.port.write(bytes) {
                Ok(count) => bytes = bytes.get(count..).unwrap_or_default(),
                Err(error) if error.kind() == io::ErrorKind::TimedOut => return Ok(()),
                Err(error) => return Err(error),
            }
        }
        Ok(())
    }

    /// Time until the next byte is due in either direction, at most `limit`.
    fn until_due(&self, limit: Duration) -> Duration {
        let now = self.now();
        let due = [self.incoming.next(), self.outgoing.next()].into_iter().flatten().min();
        let left = due.map(|at| Duration::from_micros((at - now).as_micros().into()));
        left.map_or(limit, |left| left.min(limit))
    }
}

impl Wire for Pty {
    fn wait(&mut self, patience: Duration) -> io::Result<bool> {
        if self.heard_at.elapsed() >= GONE {
            self.heard_at = Clock::now();
            // A killed program has not released its exclusive use, so no other program could open
            // the path. Closing any handle releases it.
            drop(self.held.try_clone_native());
        }
        let begin = Clock::now();
        loop {
            if self.carry()? {
                return Ok(true);
            }
            let left = patience.saturating_sub(begin.elapsed());
            if left.is_zero() {
                return Ok(false);
            }
            self.port.wait(self.until_due(left))?;
        }
    }
}

impl ErrorType for Pty {
    type Error = io::Error;
}

impl ReadReady for Pty {
    fn read_ready(&mut self) -> io::Result<bool> {
        self.carry()
    }
}

impl Read for Pty {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        if buffer.is_empty() {
            return Ok(0);
        }
        while !self.wait(LOOK)? {}
        let now = self.now();
        Ok(self.incoming.receive(buffer, now))
    }
}

impl Write for Pty {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let now = self.now();
        self.outgoing.send(bytes, now);
        self.deliver(now)?;
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        self.port.flush()
    }
}

#[cfg(test)]
mod tests {
    use std::{thread, time::Duration};

    use embedded_io::Write;

    use super::{FaultArgs, Pty};

    #[test]
    #[ignore = "real time"]
    fn what_nobody_reads_is_gone_and_blocks_nobody() {
        let (mut pty, _) = Pty::open(&FaultArgs::default()).unwrap();
        // Many times the capacity of a pseudo-terminal. A write that waits for room takes 20 ms; a
        // busy kernel now and then moves the bytes too late to be seen and cleared; without the
        // clearing, hardly any would be taken at once.
        let blocked = (0..1000).filter(|_| {
            thread::sleep(Duration::from_micros(100));
            let begin = pty.now();
            pty.write(&[0x55; 500]).unwrap();
            (pty.now() - begin).as_micros() >= 20_000
        });
        let blocked = blocked.count();
        assert!(blocked < 100, "{blocked}");
    }
}
