//! What all drivers have in common: their ports, the account of a call, and its bounds.

use arbitrary::Arbitrary;
use axlewire::{
    drive::{DriveError, Driver, Rs485},
    endpoint::Endpoint,
    time::{Duration, Instant},
};

use super::port::{Call, Fault, Peer, Port};

/// Calls of the port after which a life ends: a fuzzer learns more from many short ones.
pub(super) const ENOUGH: u64 = 10_000;

/// How a call is made: async, and dropped after some polls.
#[derive(Arbitrary, Clone, Copy, Debug)]
pub(super) struct How {
    pub(super) is_async: bool,
    polls: Option<u8>,
}

impl How {
    pub(super) fn polls(self) -> Option<u8> {
        // A future that was never polled has done nothing, and is no call.
        self.polls.map(|polls| 1 + polls % 32)
    }
}

/// A port with or without a driver-enable pin.
pub(super) trait Wired:
    embedded_io::Read
    + embedded_io::ReadReady
    + embedded_io::Write
    + embedded_io_async::Read
    + embedded_io_async::Write
{
    const HAS_PIN: bool;

    fn plug(port: &Port) -> Self;
}

impl Wired for Port {
    const HAS_PIN: bool = false;

    fn plug(port: &Port) -> Self {
        port.clone()
    }
}

impl Wired for Rs485<Port, Port, Port> {
    const HAS_PIN: bool = true;

    fn plug(port: &Port) -> Self {
        let [before, after] = [30, 10].map(Duration::from_micros);
        Self::with_delays(port.clone(), port.clone(), port.clone(), before, after)
            .expect("a pin that works")
    }
}

/// The state of the port when a call begins.
pub(super) struct Before {
    pub(super) now_us: u64,
    pub(super) taken: usize,
    pub(super) offers: usize,
    calls: u64,
    given: u64,
    flushes: u64,
    idles: u64,
    stalled_us: u64,
    /// Time until the bytes that the port holds are out: the first flush waits for them.
    backlog_us: u64,
    faults: usize,
}

pub(super) struct Rig<R, P> {
    pub(super) port: Port,
    pub(super) driver: Driver<R, P, Port>,
    /// The frame that has been begun and not ended.
    open: Vec<u8>,
}

impl<R: Endpoint, P: Wired> Rig<R, P> {
    pub(super) fn new(
        begin_us: u64,
        byte_us: u64,
        peer: impl Peer + 'static,
        role: impl FnOnce(Instant) -> R,
    ) -> Self {
        let port = Port::new(begin_us, byte_us, peer);
        let driver = Driver::with(role, P::plug(&port), port.clone());
        Self { port, driver, open: Vec::new() }
    }

    pub(super) fn fault(&self, call: Call, fault: Fault) {
        self.port.fault(call, fault);
    }

    /// When the last of the bytes under way arrives.
    pub(super) fn last_arrival(&mut self) -> Instant {
        self.driver.now() + Duration::from_micros(self.port.under_way_us() as u32)
    }

    pub(super) fn begin(&self) -> Before {
        let world = self.port.world();
        Before {
            now_us: world.now_us,
            taken: world.taken.len(),
            offers: world.offers.len(),
            calls: world.calls,
            given: world.given,
            flushes: world.flushes,
            idles: world.idles,
            stalled_us: world.stalled_us,
            backlog_us: world.backlog_us(),
            faults: world.faults(),
        }
    }

    /// Whether no fault is planned, so that nothing excuses a failure.
    pub(super) fn is_clean(&self) -> bool {
        self.port.world().faults() == 0
    }

    /// Bounds of any call: of its work, and of its time, which is given without stalls and without
    /// the bytes that earlier calls gave to the port.
    pub(super) fn end<T, E: core::fmt::Debug>(
        &mut self,
        before: &Before,
        longest: Duration,
        result: Option<&Result<T, DriveError<E>>>,
    ) {
        {
            let world = self.port.world();
            let offers = (world.offers.len() - before.offers) as u64;
            let faults = before.faults.saturating_sub(world.faults()) as u64;
            let (idles, flushes) = (world.idles - before.idles, world.flushes - before.flushes);
            let elapsed = world.now_us - before.now_us;
            let moved = world.given - before.given + offers + flushes + idles + faults;
            let calls = world.calls - before.calls;
            // A round for each of up to 16 events that wait, even if nothing moves.
            assert!(calls <= 200 + 30 * moved, "{calls} calls of the port to move {moved}");
            // A driver that spins takes a step of a microsecond each time.
            let most =
                200 + elapsed / 10 + 4 * (world.given - before.given) + 4 * offers + 4 * faults;
            assert!(idles <= most, "{idles} naps in {elapsed} us: it spins");
            let stalled = world.stalled_us - before.stalled_us;
            // A frame on the line, and a second for a port that an async call gives up.
            let slack = 20_000 + 1_100_000 * faults.min(20);
            let limit = u64::from(longest.as_micros()) + before.backlog_us + stalled + slack;
            assert!(elapsed <= limit, "it took {elapsed} us instead of {limit}");
            if let Some(Ok(_)) = result {
                assert!(!P::HAS_PIN || !world.pin, "the driver-enable pin stays on");
            }
        }
        self.check_offers(before);
    }

    /// A write offers a whole frame, or exactly the rest of the one that has begun.
    fn check_offers(&mut self, before: &Before) {
        let world = self.port.world();
        for (bytes, taken) in &world.offers[before.offers..] {
            let is_rest = !self.open.is_empty() && *bytes == self.open;
            assert!(is_rest || is_frame(bytes), "offered {bytes:02x?}, rest {:02x?}", self.open);
            self.open = bytes[*taken..].to_vec();
        }
        assert!(self.driver.unsent().is_empty() || self.driver.unsent().len() < 64);
    }
}

/// A frame of either protocol, by its length and checksum.
fn is_frame(bytes: &[u8]) -> bool {
    let len = match bytes {
        [0xAA, ..] => 4,
        [0xBB | 0x55 | 0x56, ..] if bytes.len() == 16 => 16,
        [0xBB | 0x55 | 0x56, ..] => 8,
        [0xFD, 0xFF, len, 0, ..] => usize::from(*len) + 4,
        _ => return false,
    };
    let (body, crc) = bytes.split_at(bytes.len().saturating_sub(2));
    bytes.len() == len && super::oracle::crc(body).to_le_bytes() == crc
}

/// The blocking or the async form of a call; `None` if it was dropped.
macro_rules! call {
    ($rig:expr, $how:expr, $name:ident, $name_async:ident ($($argument:expr),*)) => {
        match $how.is_async {
            true => {
                let port = $rig.port.clone();
                port.block_on($how.polls(), $rig.driver.$name_async($($argument),*))
            }
            false => Some($rig.driver.$name($($argument),*)),
        }
    };
}
pub(super) use call;
