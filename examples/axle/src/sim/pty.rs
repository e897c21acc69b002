//! A pseudo-terminal in place of a line: the program that opens its path is at the other end.

use std::io::{self, Write};

use axlewire::{
    sim::Rng,
    time::{Duration, Instant},
};
use serialport::{ClearBuffer, SerialPort, TTYPort};

use super::Faults;
use crate::{
    failure::Failure,
    port::{NotSent, Port, Transport},
};

/// Number of bytes that may wait for a reader. On a wire, unread bytes are lost; here they would
/// wait forever and block the sender.
const UNREAD_LIMIT: u32 = 2048;

/// Silence after which the program that had the path open may be gone.
const GONE: Duration = Duration::from_millis(1000);

/// Our end of a pseudo-terminal, with noise.
pub(super) struct Pty {
    port: Port,
    /// The other end, held open so that the terminal does not hang up when a program closes it.
    held: TTYPort,
    heard_at: Instant,
    buffer: Vec<u8>,
    noise: f64,
    /// Separate random numbers for each direction, so that the timing of one does not affect the
    /// other.
    incoming: Rng,
    outgoing: Rng,
}

impl Pty {
    /// Opens a pseudo-terminal and prints its path.
    pub(super) fn open(faults: Faults) -> Result<Self, Failure> {
        let pty = Self::pair(faults)?;
        let mut out = io::stdout().lock();
        writeln!(out, "pty: {}", pty.port.path())
            .and_then(|()| out.flush())
            .map_err(Failure::Write)?;
        Ok(pty)
    }

    fn pair(faults: Faults) -> Result<Self, Failure> {
        let failed =
            |cause: String| Failure::Failed(format!("cannot open a pseudo-terminal: {cause}"));
        let (ours, held) = TTYPort::pair().map_err(|error| failed(error.description))?;
        let path = held.name().ok_or_else(|| failed("it has no name".to_owned()))?;
        let port = Port::new(path, Box::new(ours));
        Ok(Self {
            heard_at: port.now(),
            port,
            held,
            buffer: Vec::new(),
            noise: faults.noise,
            incoming: Rng::new(faults.seed),
            outgoing: Rng::new(!faults.seed),
        })
    }
}

impl Transport for Pty {
    fn now(&self) -> Instant {
        self.port.now()
    }

    fn send(&mut self, bytes: &[u8]) -> Result<(), NotSent> {
        if self.held.bytes_to_read().is_ok_and(|unread| unread > UNREAD_LIMIT) {
            drop(self.held.clear(ClearBuffer::Input));
        }
        self.buffer.clear();
        self.buffer.extend_from_slice(bytes);
        disturb(&mut self.buffer, self.noise, &mut self.outgoing);
        self.port.send(&self.buffer)
    }

    fn receive(&mut self, until: Instant) -> Result<&[u8], Failure> {
        let now = self.port.now();
        if now >= self.heard_at + GONE {
            self.heard_at = now;
            // A killed program has not released its exclusive use, so no other program could open
            // the path. Closing any handle releases it.
            drop(self.held.try_clone_native());
        }
        let bytes = self.port.fill(until)?;
        if !bytes.is_empty() {
            self.heard_at = now;
        }
        disturb(bytes, self.noise, &mut self.incoming);
        Ok(bytes)
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

    use super::{Faults, Pty, Rng, Transport, disturb};

    #[test]
    fn what_nobody_reads_is_gone_and_blocks_nobody() {
        let mut pty = Pty::pair(Faults { noise: 0.0, seed: 1 }).unwrap();
        // Many times the capacity of a pseudo-terminal. A busy kernel now and then moves the bytes
        // too late to be seen and cleared; without the clearing, hardly any would be sent.
        let unsent = (0..1000).filter(|_| {
            thread::sleep(Duration::from_micros(100));
            pty.send(&[0x55; 500]).is_err()
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
