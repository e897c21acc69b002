//! Any bytes at any time, and any calls: no role panics, spins or breaks its contract.
//!
//! The data is a list of ops, one byte each, followed by its arguments; see the `match` in each
//! role's loop.

use arbitrary::{Result, Unstructured};
use axlewire::{
    endpoint::{Endpoint, Unsent},
    stream::Counters,
    time::{Duration, Instant},
};

mod host;
mod master;
mod robot;
mod slave;
mod ucp_frames;

use super::{Tally, oracle};

pub(super) use host::ucp_host;
pub(super) use master::ikeya_master;
pub(super) use robot::ucp_robot;
pub(super) use slave::ikeya_slave;

/// Polls a role as its contract requires, and checks the properties common to all roles. Returns
/// the packets that it has sent.
fn serve<R: Endpoint>(role: &mut R, now: Instant, mut told: impl FnMut(R::Event)) -> Vec<Vec<u8>> {
    if role.poll_timeout().is_some_and(|at| now >= at) {
        role.handle_timeout(now);
    }
    let mut events = 0;
    while let Some(event) = role.poll_event() {
        told(event);
        events += 1;
        assert!(events <= 64, "endless events");
    }
    let mut sent = Vec::new();
    while let Some(bytes) = role.poll_transmit(now) {
        assert!(!bytes.is_empty(), "an empty packet");
        sent.push(bytes.to_vec());
        assert!(sent.len() <= 64, "endless packets");
    }
    // Spurious calls are harmless.
    role.handle_input(&[], now);
    assert!(role.poll_transmit(now).is_none());
    let next = role.poll_timeout();
    assert!(next.is_none_or(|at| at > now), "a busy loop: {next:?} at {now:?}");
    sent
}

/// Every byte handed in is in a frame, in a gap, or in the one candidate that may still come.
fn check_account(counters: Counters, given: u64, longest: u64) {
    assert_eq!(counters.received, given);
    let booked = counters.framed + counters.skipped();
    assert!((booked..booked + longest).contains(&given), "{given} bytes: {counters:?}");
}

fn unsent(u: &mut Unstructured<'_>) -> Result<Unsent> {
    Ok(*u.choose(&[Unsent::Untouched, Unsent::CutOff, Unsent::Unflushed])?)
}

/// The time: starts anywhere, including just before it wraps, and then only moves forward.
struct Clock(Instant);

impl Clock {
    fn new(u: &mut Unstructured<'_>) -> Result<Self> {
        let begin = [0, u64::MAX - 5_000, u64::MAX / 2 - 5_000, 1 << 40];
        Ok(Self(Instant::from_micros(*u.choose(&begin)?)))
    }

    /// A short or a long time.
    fn pass(&mut self, u: &mut Unstructured<'_>) -> Result<Instant> {
        let (step, scale): (u8, u8) = u.arbitrary()?;
        self.0 += Duration::from_micros(u32::from(step) << (scale % 16));
        Ok(self.0)
    }
}

/// Up to 20 raw bytes.
fn raw<'a>(u: &mut Unstructured<'a>) -> Result<&'a [u8]> {
    let len = u.arbitrary_len::<u8>()?.min(20);
    u.bytes(len)
}
