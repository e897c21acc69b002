//! What all drivers have in common: their ports, the account of a call, and its bounds.

use std::rc::Rc;

use arbitrary::Arbitrary;
use axlewire::{
    drive::{DriveError, Driver, Rs485, asynch},
    endpoint::Endpoint,
    time::{Duration, Instant},
};

use super::{
    fault::{Call, Fault, Pin},
    port::{Offer, Peer, Port, World},
};

/// Calls of the port after which a life ends: a fuzzer learns more from many short ones.
pub(super) const ENOUGH: u64 = 10_000;

/// How a call is made: async, and dropped after some polls.
#[derive(Arbitrary, Clone, Copy, Debug)]
pub(super) struct How {
    pub(super) is_async: bool,
    polls: Option<u8>,
}

impl How {
    pub(super) fn polls(self) -> Option<usize> {
        // A future that was never polled has done nothing, and is no call.
        self.polls.map(|polls| usize::from(1 + polls % 32))
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

    fn plug(port: Port, pin: &Pin) -> Self;
    fn port(&mut self) -> &mut Port;
}

impl Wired for Port {
    const HAS_PIN: bool = false;

    fn plug(port: Port, _: &Pin) -> Self {
        port
    }

    fn port(&mut self) -> &mut Port {
        self
    }
}

/// A port with a pin.
pub(super) type Pinned = Rs485<Port, Pin, World>;

impl Wired for Pinned {
    const HAS_PIN: bool = true;

    fn plug(port: Port, pin: &Pin) -> Self {
        let [before, after] = [30, 10].map(Duration::from_micros);
        let delay = port.world.clone();
        Self::with_delays(port, pin.clone(), delay, before, after).expect("a pin that works")
    }

    fn port(&mut self) -> &mut Port {
        self.port_mut()
    }
}

/// The state of the port when a call begins.
pub(super) struct Before {
    /// The driver-enable pin.
    was_on: bool,
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
    pub(super) world: World,
    pub(super) driver: asynch::Driver<R, P, World>,
    pin: Pin,
    /// The frame that has been begun and not ended.
    open: Vec<u8>,
}

impl<R: Endpoint, P: Wired> Rig<R, P> {
    pub(super) fn new(
        begin_us: u64,
        byte_us: u64,
        peer: Option<Peer>,
        role: impl FnOnce(Instant) -> R,
    ) -> Self {
        let world = World::starting_at(begin_us);
        let port = Port { drains: true, peer, ..Port::new(&world, byte_us) };
        let pin = Pin { world: world.clone(), state: Rc::default() };
        let driver = asynch::Driver::with(role, P::plug(port, &pin), world.clone());
        Self { world, driver, pin, open: Vec::new() }
    }

    pub(super) fn port(&mut self) -> &mut Port {
        self.driver.port_mut().port()
    }

    /// The driver, with blocking calls.
    pub(super) fn blocking(&mut self) -> &mut Driver<R, P, World> {
        &mut self.driver
    }

    pub(super) fn fault(&mut self, call: Call, fault: Fault) {
        match call {
            Call::Read => self.port().reads.push_back(fault.step()),
            Call::Write => self.port().writes.push_back(fault.step()),
            Call::Flush => self.port().flushes.push_back(fault.step()),
            Call::Pin => self.pin.state.borrow_mut().1.push_back(fault == Fault::Error),
        }
    }

    pub(super) fn heal(&mut self) {
        let port = self.port();
        for steps in [&mut port.reads, &mut port.writes, &mut port.flushes] {
            steps.clear();
        }
        self.pin.state.borrow_mut().1.clear();
    }

    /// When the last of the bytes under way arrives.
    pub(super) fn last_arrival(&mut self) -> Instant {
        let under_way_us = self.port().last_arrival_us().saturating_sub(self.world.now_us());
        self.driver.now() + Duration::from_micros(under_way_us as u32)
    }

    /// Number of faults that are still to come.
    fn faults(&mut self) -> usize {
        let pin = self.pin.state.borrow().1.len();
        let port = self.port();
        let busy = usize::from(port.busy_until_us.is_some());
        port.reads.len() + port.writes.len() + port.flushes.len() + busy + pin
    }

    pub(super) fn begin(&mut self) -> Before {
        let (world, faults, was_on) =
            (self.world.clone(), self.faults(), self.pin.state.borrow().0);
        let port = self.port();
        Before {
            was_on,
            now_us: world.now_us(),
            taken: port.written.len(),
            offers: port.offers.len(),
            calls: world.calls(),
            given: port.given,
            flushes: port.flush_calls,
            idles: world.naps(),
            stalled_us: port.stalled_us,
            backlog_us: port
                .free_us
                .max(port.busy_until_us.unwrap_or(0))
                .saturating_sub(world.now_us()),
            faults,
        }
    }

    /// Whether no fault is planned, so that nothing excuses a failure.
    pub(super) fn is_clean(&mut self) -> bool {
        self.faults() == 0
    }

    /// Bounds of any call: of its work, and of its time, which is given without stalls and without
    /// the bytes that earlier calls gave to the port.
    pub(super) fn end<T, E: core::fmt::Debug>(
        &mut self,
        before: &Before,
        longest: Duration,
        result: Option<&Result<T, DriveError<E>>>,
    ) {
        let (world, faults, is_on) =
            (self.world.clone(), self.faults() as u64, self.pin.state.borrow().0);
        let port = self.port();
        let offers = (port.offers.len() - before.offers) as u64;
        let faults = (before.faults as u64).saturating_sub(faults);
        let (idles, flushes) = (world.naps() - before.idles, port.flush_calls - before.flushes);
        let (elapsed, given) = (world.now_us() - before.now_us, port.given - before.given);
        let moved = given + offers + flushes + idles + faults;
        let calls = world.calls() - before.calls;
        // A round for each of up to 16 events that wait, even if nothing moves. An async write that
        // waits is dropped and repeated each millisecond, behind a look for received bytes.
        let most = 200 + 30 * moved + elapsed / 250;
        assert!(calls <= most, "{calls} calls of the port to move {moved} in {elapsed} us");
        // A driver that spins takes a step of a microsecond each time.
        let most = 200 + elapsed / 10 + 4 * given + 4 * offers + 4 * faults;
        assert!(idles <= most, "{idles} naps in {elapsed} us: it spins");
        let stalled = port.stalled_us - before.stalled_us;
        // A frame on the line, and a second for a port that an async call gives up.
        let slack = 20_000 + 1_100_000 * faults.min(20);
        let limit = u64::from(longest.as_micros()) + before.backlog_us + stalled + slack;
        assert!(elapsed <= limit, "it took {elapsed} us instead of {limit}");
        if let Some(Ok(_)) = result {
            // A slave and a robot leave a port that is slow to the next call, and tell a command
            // before they wait for one that a dropped call has left.
            let leaves =
                self.driver.role().line_rules().held_up_after.is_some_and(|it| it > Duration::ZERO);
            let is_slow = leaves && (faults > 0 || before.was_on);
            assert!(!P::HAS_PIN || !is_on || is_slow, "the driver-enable pin stays on");
        }
        self.check_offers(before);
    }

    /// A write offers a whole frame, or exactly the rest of the one that has begun.
    fn check_offers(&mut self, before: &Before) {
        let port = self.driver.port_mut().port();
        for Offer { bytes, taken, .. } in &port.offers[before.offers..] {
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
    ($rig:expr, $how:expr, $name:ident($($argument:expr),*)) => {
        match $how.is_async {
            true => $rig.world.run($how.polls(), $rig.driver.$name($($argument),*)),
            false => Some($rig.blocking().$name($($argument),*)),
        }
    };
}
pub(super) use call;
