//! The wire between a role on this machine and a board: a port, a clock, noise, and a loose plug.
//!
//! A socket in real time; nothing is scripted.

use std::{
    collections::VecDeque,
    io::{self, Read as _, Write as _},
    net::Shutdown,
    os::unix::net::UnixStream,
    sync::{
        Arc, Condvar, Mutex,
        atomic::{AtomicBool, Ordering::Relaxed},
    },
    thread,
    time::{Duration, Instant as Clock},
};

use axlewire::drive;

use crate::names::*;

/// Disturbs the bytes of one direction: flips a bit in about one byte in 60, and inserts a stray
/// byte before about one in 100, half of the time one that begins a packet.
#[derive(Debug)]
pub(crate) struct Noise {
    rng: Rng,
    headers: &'static [u8],
}

impl Noise {
    /// Stray bytes include the headers of a motor bus.
    pub(crate) const fn ikeya(seed: u64) -> Self {
        Self { rng: Rng::new(seed), headers: &[0xAA, 0xBB, 0x55, 0x56] }
    }

    /// Stray bytes include the header of a rover link.
    pub(crate) const fn ucp(seed: u64) -> Self {
        Self { rng: Rng::new(seed), headers: &[0xFD, 0xFF] }
    }

    /// The same for the other direction.
    const fn fork(&mut self) -> Self {
        Self { rng: Rng::new(self.rng.next_u64()), headers: self.headers }
    }

    fn disturb(&mut self, bytes: &[u8]) -> Vec<u8> {
        let mut disturbed = Vec::with_capacity(bytes.len() + 8);
        for &byte in bytes {
            if self.rng.below(100) == 0 {
                let choice = self.rng.below(2 * self.headers.len() as u64) as usize;
                disturbed.push(self.headers.get(choice).copied().unwrap_or(self.rng.byte()));
            }
            let is_turned = self.rng.below(60) == 0;
            disturbed.push(byte ^ (u8::from(is_turned) << self.rng.below(8)));
        }
        disturbed
    }
}

/// Received bytes, and the task waiting for them.
#[derive(Debug, Default)]
struct Inbox {
    bytes: Mutex<VecDeque<u8>>,
    arrived: Condvar,
}

/// One end of the wire: a port with the traits of `embedded-io`.
#[derive(Debug)]
pub(crate) struct Wire {
    stream: Option<UnixStream>,
    inbox: Arc<Inbox>,
    noise: Option<Noise>,
    is_noisy: Arc<AtomicBool>,
    /// A packet that gets a wrong bit on its way, so many times from now on.
    pub(crate) damaged: (Vec<u8>, u32),
}

impl Wire {
    /// A wire to a board.
    pub(crate) fn new(stream: UnixStream) -> Self {
        Self::disturbed(stream, None)
    }

    /// A wire with noise in both directions.
    pub(crate) fn noisy(stream: UnixStream, noise: Noise) -> Self {
        let mut wire = Self::disturbed(stream, Some(noise));
        wire.disturb();
        wire
    }

    /// A wire with noise, if any, from [`disturb`](Self::disturb) on.
    pub(crate) fn disturbed(stream: UnixStream, noise: Option<Noise>) -> Self {
        let (inbox, is_noisy) = (Arc::default(), Arc::default());
        let mut wire = Self { stream: None, inbox, noise, is_noisy, damaged: (vec![], 0) };
        wire.plug(stream);
        wire
    }

    /// Enables the noise.
    pub(crate) fn disturb(&mut self) {
        self.is_noisy.store(true, Relaxed);
    }

    /// Plugs it in again.
    pub(crate) fn plug(&mut self, stream: UnixStream) {
        let (mut reader, inbox) = (stream.try_clone().unwrap(), self.inbox.clone());
        let (mut noise, is_noisy) = (self.noise.as_mut().map(Noise::fork), self.is_noisy.clone());
        self.stream = Some(stream);
        thread::spawn(move || {
            let mut chunk = [0; 1024];
            while let Ok(count @ 1..) = reader.read(&mut chunk) {
                let heard = &chunk[..count];
                match &mut noise {
                    Some(noise) if is_noisy.load(Relaxed) => {
                        inbox.bytes.lock().unwrap().extend(noise.disturb(heard));
                    }
                    _ => inbox.bytes.lock().unwrap().extend(heard),
                }
                inbox.arrived.notify_all();
            }
        });
    }

    /// Unplugs it: sent bytes are discarded, and nothing arrives.
    pub(crate) fn unplug(&mut self) {
        if let Some(stream) = self.stream.take() {
            stream.shutdown(Shutdown::Both).unwrap();
        }
    }

    /// A clock that sleeps until bytes arrive.
    pub(crate) fn clock(&self) -> WireClock {
        WireClock { zero: Clock::now(), inbox: self.inbox.clone() }
    }

    /// Sends bytes.
    pub(crate) fn send(&mut self, bytes: &[u8]) {
        let Some(stream) = &mut self.stream else { return };
        match &mut self.noise {
            Some(noise) if self.is_noisy.load(Relaxed) => {
                stream.write_all(&noise.disturb(bytes)).unwrap();
            }
            _ if self.damaged.1 > 0 && self.damaged.0 == bytes => {
                self.damaged.1 -= 1;
                let (first, rest) = bytes.split_first().unwrap();
                stream.write_all(&[&[first ^ 1], rest].concat()).unwrap();
            }
            _ => stream.write_all(bytes).unwrap(),
        }
    }

    /// The next byte; `None` when none comes within `patience`.
    pub(crate) fn receive(&self, patience: Duration) -> Option<u8> {
        let bytes = self.inbox.bytes.lock().unwrap();
        let wait = self.inbox.arrived.wait_timeout_while(bytes, patience, |bytes| bytes.is_empty());
        wait.unwrap().0.pop_front()
    }
}

impl embedded_io::ErrorType for Wire {
    type Error = io::Error;
}

impl embedded_io::ReadReady for Wire {
    fn read_ready(&mut self) -> io::Result<bool> {
        Ok(!self.inbox.bytes.lock().unwrap().is_empty())
    }
}

impl embedded_io::Read for Wire {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        io::Read::read(&mut *self.inbox.bytes.lock().unwrap(), buffer)
    }
}

impl embedded_io::Write for Wire {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.send(bytes);
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

/// The time of this machine.
#[derive(Debug)]
pub(crate) struct WireClock {
    zero: Clock,
    inbox: Arc<Inbox>,
}

impl drive::Clock for WireClock {
    fn now(&self) -> Instant {
        Instant::from_micros(self.zero.elapsed().as_micros() as u64)
    }

    fn idle_until(&mut self, until: Instant) {
        let wait = Duration::from_micros((until - self.now()).as_micros().into());
        let bytes = self.inbox.bytes.lock().unwrap();
        let _woken = self.inbox.arrived.wait_timeout_while(bytes, wait, |bytes| bytes.is_empty());
    }
}
