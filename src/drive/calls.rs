//! The calls that every role has, written once for both worlds.

use super::{
    clock::Clock,
    driver::{Driver, Needs},
    error::DriveError,
};
use crate::{
    endpoint::Endpoint,
    time::{Duration, Instant},
};

macro_rules! calls {
    ($Driver:ident, [$($Port:tt)+], [$($Clock:tt)+], [$($async:tt)?], [$($await:tt)*]) => {
impl<R: Endpoint, P: $($Port)+, C: $($Clock)+> $Driver<R, P, C> {
    /// Returns the next event; waits for it for this long, then returns `None`. Runs at least one
    /// round, even with [`Duration::ZERO`].
    ///
    /// # Errors
    ///
    /// Same as [`service`](Self::service). Events from before the failure are not lost.
    pub $($async)? fn next_event(
        &mut self,
        within: Duration,
    ) -> Result<Option<R::Event>, DriveError<P::Error>> {
        self.until(self.now() + within, Driver::poll_event)$($await)*
    }

    /// Runs for `span`, and passes every event to `on_event`, with the role, to give it commands,
    /// and the time. A command that is given at the end, a stop too, leaves with the next call.
    ///
    /// # Errors
    ///
    /// Same as [`service`](Self::service).
    pub $($async)? fn run_for(
        &mut self,
        span: Duration,
        mut on_event: impl FnMut(&mut R, R::Event, Instant),
    ) -> Result<(), DriveError<P::Error>> {
        let deadline = self.now() + span;
        while let Some(event) = self.until(deadline, Driver::poll_event)$($await)*? {
            let now = self.now();
            on_event(&mut self.role, event, now);
            if now >= deadline {
                break;
            }
        }
        Ok(())
    }

    /// Runs until `done` returns a value; `None` at `deadline`. A failing port ends it.
    pub(super) $($async)? fn until<T>(
        &mut self,
        deadline: Instant,
        done: impl FnMut(&mut Driver<R, P, C>) -> Option<T>,
    ) -> Result<Option<T>, DriveError<P::Error>> {
        self.until_with(deadline, Needs::WholePort, done)$($await)*
    }
}
};
}

in_both_worlds!(calls);
