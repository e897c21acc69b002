//! One direction of a line in real time.

use alloc::vec::Vec;

use super::{
    arrivals::Arrivals,
    faults::{Faults, PairStatistics},
    rng::Rng,
};
use crate::time::Instant;

/// One direction of a line with [`Faults`], for a simulation that runs in real time: bytes and the
/// time go in, and each byte comes out when it is due.
///
/// [`Line`](super::Line) is for virtual time, and knows more: line speed, collisions and stubs.
/// Here bytes take no time unless the faults delay them, so [`PairStatistics::busy_us`] and
/// [`PairStatistics::collided`] stay 0. The same seed and the same bytes give the same faults.
///
/// ```
/// use axlewire::sim::{Faults, Wire};
/// use axlewire::time::{Duration, Instant};
///
/// let mut faults = Faults::CLEAN;
/// faults.delay = Duration::from_millis(3);
/// let mut wire = Wire::new(faults, 1);
///
/// wire.send(b"hello", Instant::from_millis(10));
/// assert_eq!(wire.next(), Some(Instant::from_millis(13)));
/// let mut buffer = [0; 16];
/// assert_eq!(wire.receive(&mut buffer, Instant::from_millis(12)), 0);
/// assert_eq!(wire.receive(&mut buffer, Instant::from_millis(13)), 5);
/// assert_eq!(&buffer[..5], b"hello");
/// ```
#[derive(Clone, Debug)]
pub struct Wire {
    faults: Faults,
    rng: Rng,
    arrivals: Arrivals,
    statistics: PairStatistics,
    /// The last transmission as its sender hears it.
    echo: Vec<u8>,
}

impl Wire {
    /// A wire with these faults. All randomness comes from `seed`: give the two directions of a
    /// line different ones.
    #[must_use]
    pub const fn new(faults: Faults, seed: u64) -> Self {
        Self {
            faults,
            rng: Rng::new(seed),
            arrivals: Arrivals::new(),
            statistics: PairStatistics::NONE,
            echo: Vec::new(),
        }
    }

    /// Faults of the wire. Change them at any time; bytes on their way are not affected.
    pub const fn faults_mut(&mut self) -> &mut Faults {
        &mut self.faults
    }

    /// Sends `bytes` as one transmission at `now`. Returns what the sender hears of it at once:
    /// with [`Faults::echo`] the bytes after the faults of the wire, otherwise nothing.
    pub fn send(&mut self, bytes: &[u8], now: Instant) -> &[u8] {
        let mut through = Vec::with_capacity(bytes.len());
        self.echo.clear();
        for (index, &byte) in bytes.iter().enumerate() {
            self.statistics.bytes += 1;
            through.clear();
            let (rng, statistics) = (&mut self.rng, &mut self.statistics);
            self.faults.pass(byte, index == 0, rng, statistics, &mut through);
            if self.faults.echo {
                self.echo.extend_from_slice(&through);
            }
            if self.faults.unplugged {
                continue;
            }
            for &byte in &through {
                let at = now + self.faults.hold_up(&mut self.rng);
                self.arrivals.add(byte, at);
            }
        }
        &self.echo
    }

    /// When the next byte is due at the receiver, possibly in the past; `None` if none is on its
    /// way.
    #[must_use]
    pub fn next(&self) -> Option<Instant> {
        self.arrivals.bytes.front().map(|(at, _)| *at)
    }

    /// Hands out the bytes that are due at `now`, in order, as many as fit into `buffer`; returns
    /// their number.
    pub fn receive(&mut self, buffer: &mut [u8], now: Instant) -> usize {
        let mut count = 0;
        for slot in buffer {
            let Some(&(at, byte)) = self.arrivals.bytes.front() else { break };
            if at > now {
                break;
            }
            self.arrivals.bytes.pop_front();
            *slot = byte;
            count += 1;
        }
        count
    }

    /// Statistics since the beginning.
    #[must_use]
    pub const fn statistics(&self) -> &PairStatistics {
        &self.statistics
    }
}
