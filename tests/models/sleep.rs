//! Deadlines that are not too late.

use crate::names::*;

/// A driver that sleeps until the role's deadline misses nothing: just before it, or for ten
/// minutes if there is none, the role has nothing to send.
pub(crate) fn check_sleep<R: Endpoint + Clone>(role: &R, now: Instant) -> Result<(), String> {
    let last = match role.poll_timeout() {
        Some(at) if at <= now => return Err("a deadline in the past".into()),
        Some(at) => Instant::from_micros(at.as_micros().wrapping_sub(1)),
        None => now + Duration::from_millis(600_000),
    };
    let mut asleep = role.clone();
    asleep.handle_timeout(last);
    match asleep.poll_transmit(last) {
        Some(bytes) => Err(format!("{bytes:02x?} could be sent before {:?}", role.poll_timeout())),
        None => Ok(()),
    }
}
