//! A pseudo-terminal in place of a line: the program that opens its path is at the other end.

use std::{
    io::{self, Write as _},
    time::{Duration, Instant as Clock},
};

use axlewire::{drive, sim::Rng};
use embedded_io::{ErrorType, Read, ReadReady, Write};
use serialport::{ClearBuffer, SerialPort, TTYPort};

use super::Faults;
use crate::{
    failure::Failure,
    line::{Line, Wire},
};

/// Number of bytes that may wait for a reader. On a wire, unread bytes are lost; here they would
/// wait forever and block the sender.
const UNREAD_LIMIT: u32 = 2048;

/// Silence after which the program that had the path open may be gone.
const GONE: Duration = Duration::from_millis(1000);

/// Our end of a pseudo-terminal, with noise.
pub(super) struct Pty {
    port: drive::SerialPort,
    /// The other end, held open so that the terminal does not hang up when a program closes it.
    held: TTYPort,
    heard_at: Clock,
    noise: f64,
    /// Separate random numbers for each direction, so that the timing of one does not affect the
    /// other.
    incoming: Rng,
    outgoing: Rng,
}

impl Pty {
    /// Opens a pseudo-terminal and prints its path.
    pub(super) fn open(faults: Faults) -> Result<Line, Failure> {
        let (pty, path) = Self::pair(faults)?;
        let mut out = io::stdout().lock();
        writeln!(out, "pty: {path}").and_then(|()| out.flush()).map_err(Failure::Write)?;
        Ok(Line::new(&path, pty, true))
    }

    fn pair(faults: Faults) -> Result<(Self, String), Failure> {
        let failed =
            |cause: String| Failure::Failed(format!("cannot open a pseudo-terminal: {cause}"));
        let (ours, held) = TTYPort::pair().map_err(|error| failed(error.description))?;
        let path = held.name().ok_or_else(|| failed("it has no name".to_owned()))?;
        let ours: Box<dyn SerialPort> = Box::new(ours);
        let pty = Self {
            heard_at: Clock::now(),
            port: ours.into(),
            held,
            noise: faults.noise,
            incoming: Rng::new(faults.seed),
            outgoing: Rng::new(!faults.seed),
        };
        Ok((pty, path))
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
        self.port.wait(patience)
    }
}

impl ErrorType for Pty {
    type Error = io::Error;
}

impl ReadReady for Pty {
    fn read_ready(&mut self) -> io::Result<bool> {
        self.port.read_ready()
    }
}

impl Read for Pty {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let count = self.port.read(buffer)?;
        self.heard_at = Clock::now();
        disturb(buffer.get_mut(..count).unwrap_or_default(), self.noise, &mut self.incoming);
        Ok(count)
    }
}

impl Write for Pty {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        if self.held.bytes_to_read().is_ok_and(|unread| unread > UNREAD_LIMIT) {
            drop(self.held.clear(ClearBuffer::Input));
        }
        let mut bytes = bytes.to_vec();
        disturb(&mut bytes, self.noise, &mut self.outgoing);
        self.port.write(&bytes)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.port.flush()
    }
}

/// Flips bits at this rate.
fn disturb(bytes: &mut [u8], rate: f64, rng: &mut Rng) {
    if rate > 0.0 {
        for byte in bytes {
            for bit in 0..8 {
                *byte ^= u8::from(rng.chance(rate)) << bit;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use std::{thread, time::Duration};

    use embedded_io::Write;

    use super::{Faults, Pty, Rng, disturb};

    #[test]
    fn what_nobody_reads_is_gone_and_blocks_nobody() {
        let (mut pty, _) = Pty::pair(Faults { noise: 0.0, seed: 1 }).unwrap();
        // Many times the capacity of a pseudo-terminal. A busy kernel now and then moves the bytes
        // too late to be seen and cleared; without the clearing, hardly any would be sent.
        let unsent = (0..1000).filter(|_| {
            thread::sleep(Duration::from_micros(100));
            pty.write(&[0x55; 500]).is_err()
        });
        let unsent = unsent.count();
        assert!(unsent < 100, "{unsent}");
    }

    #[test]
    fn noise_has_the_rate_that_was_asked_for_and_repeats_itself() {
        let noise = |seed| {
            let mut bytes = vec![0; 100_000];
            disturb(&mut bytes, 1e-2, &mut Rng::new(seed));
            bytes
        };
        let wrong_bits: u32 = noise(1).iter().map(|byte| byte.count_ones()).sum();
        assert!((7_500..8_500).contains(&wrong_bits), "{wrong_bits} of 800,000");
        assert_eq!(noise(1), noise(1));
        assert_ne!(noise(1), noise(2));
    }
}
