//! The driver itself: a role, a port and a clock, and what one round does.

use super::{clock::Clock, error::DriveError, sending::Sending};
use crate::{
    endpoint::{Endpoint, Unsent},
    time::{Duration, Instant, earliest, reached},
};

/// Bytes read at once at the most.
pub(super) const CHUNK_LEN: usize = 64;

/// Reads in one go at the most: 4096 bytes. A line is slower than that, a runaway port is not.
pub(super) const READS: usize = 64;

/// Frames sent in one round at the most: a role that is flooded with requests could go on for ever.
pub(super) const FRAMES: usize = 8;

/// What a call needs of its port before it looks at the role.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub(super) enum Needs {
    /// A round without a failure.
    WholePort,
    /// The half that works may be enough: a command was received, a stop has left.
    #[cfg(any(feature = "ikeya", feature = "ucp"))]
    HalfPort,
}

/// A role with its port and its clock; see the [module](super) for what it does.
#[derive(Clone, Debug)]
pub struct Driver<R, P, C> {
    pub(super) role: R,
    pub(super) port: P,
    pub(super) clock: C,
    /// The latest time that the role has been told.
    pub(super) latest: Instant,
    /// What the role's time is ahead of the clock, microseconds: by as much as that ever went back.
    pub(super) ahead_us: u64,
    /// When the port was last looked at for received bytes.
    pub(super) looked_at: Instant,
    /// When it was last seen empty: all that is received has arrived since.
    pub(super) empty_at: Instant,
    pub(super) sending: Sending,
}

impl<R: Endpoint, P, C: Clock> Driver<R, P, C> {
    /// Pause after an error of the port in a call that goes on all the same.
    #[cfg(any(feature = "ikeya", feature = "ucp"))]
    pub(super) const ERROR_NAP: Duration = Duration::from_millis(1);

    /// Puts a role, a port and a clock together. The role must have been made with a time of the
    /// same clock; [`with`](Self::with) sees to that.
    pub fn new(role: R, port: P, mut clock: C) -> Self {
        let latest = clock.now();
        Self {
            role,
            port,
            clock,
            latest,
            ahead_us: 0,
            looked_at: latest,
            empty_at: latest,
            sending: Sending::new(),
        }
    }

    /// The same with a role that is made here, at the time of this clock.
    pub fn with(role: impl FnOnce(Instant) -> R, port: P, mut clock: C) -> Self {
        let latest = clock.now();
        Self::new(role(latest), port, clock)
    }

    /// The time, as the role is told it. When the clock goes backwards, the role's time goes on from
    /// where it was: one wrong reading must not stop it.
    pub fn now(&mut self) -> Instant {
        let reading = self.clock.now().as_micros();
        let now = Instant::from_micros(reading.wrapping_add(self.ahead_us));
        if now < self.latest {
            self.ahead_us = self.latest.as_micros().wrapping_sub(reading);
        } else {
            self.latest = now;
        }
        self.latest
    }

    /// The role.
    #[must_use]
    pub const fn role(&self) -> &R {
        &self.role
    }

    /// The role, to command it.
    pub const fn role_mut(&mut self) -> &mut R {
        &mut self.role
    }

    /// The port.
    #[must_use]
    pub const fn port(&self) -> &P {
        &self.port
    }

    /// The port, to change its settings. Bytes read from it here are lost to the role, bytes written
    /// may land inside a frame.
    pub const fn port_mut(&mut self) -> &mut P {
        &mut self.port
    }

    /// Role, port and clock; what is unsent is given up.
    #[must_use]
    pub fn into_parts(self) -> (R, P, C) {
        (self.role, self.port, self.clock)
    }

    /// The next event that is there already, without touching the port.
    pub fn poll_event(&mut self) -> Option<R::Event> {
        self.role.poll_event()
    }

    /// When the next round has to be made at the latest, if no bytes come in.
    ///
    /// Never `None` for a slave or a robot, even while it has nothing to do: bytes that are found
    /// after a longer time may be old, and are not obeyed or answered like new ones
    /// ([`Endpoint::held_up_after`]).
    #[must_use]
    pub fn poll_timeout(&self) -> Option<Instant> {
        let look_at = self
            .role
            .held_up_after()
            .map(|limit| self.looked_at + Duration::from_micros(limit.as_micros() / 2));
        earliest(&[self.role.poll_timeout(), look_at])
    }

    /// Bytes of a frame that the port has not taken yet.
    #[must_use]
    pub fn unsent(&self) -> &[u8] {
        self.sending.rest()
    }

    /// Gives up what is unsent or not flushed, when a port has come back after a while; returns the
    /// number of bytes given up. The role counts it as not sent. The other end may have heard the
    /// beginning of the frame.
    pub fn discard(&mut self) -> usize {
        let discarded = self.sending.rest().len();
        let given_up = self.sending.give_up();
        self.tell_unsent(given_up);
        self.unflushed();
        discarded
    }

    /// Lets the role decide anew about a frame that did not leave.
    pub(super) fn reclaim(&mut self) {
        let now = self.now();
        let unsent = self.sending.reclaim(now, self.silence());
        self.tell_unsent(unsent);
    }

    /// Longest silence inside a frame. The other end measures from byte to byte, and the first one
    /// behind the silence takes its time.
    pub(super) fn silence(&self) -> Duration {
        let (pause, byte) = (self.role.frame_pause(), self.role.wire_time(1));
        Duration::from_micros(pause.as_micros().saturating_sub(byte.as_micros()))
    }

    pub(super) fn tell_unsent(&mut self, unsent: Option<Unsent>) {
        let now = self.now();
        if let Some(unsent) = unsent {
            self.role.handle_unsent(unsent, now);
        }
    }

    /// Hands in what a read has given. Unless the port was seen empty a short while ago, the driver
    /// was held up, in a call of the port, by its caller or by another task, and the bytes may have
    /// arrived at any time since then.
    pub(super) fn receive_chunk<E>(
        &mut self,
        chunk: &[u8],
        count: usize,
    ) -> Result<(), DriveError<E>> {
        if count == 0 {
            return Err(DriveError::Closed);
        }
        let now = self.now();
        let bytes = chunk.get(..count).unwrap_or(chunk);
        match self.role.held_up_after() {
            Some(limit) if now - self.empty_at > limit => {
                self.role.handle_old_input(bytes, self.empty_at, now);
            }
            _ => self.role.handle_input(bytes, now),
        }
        Ok(())
    }

    /// The port is looked at for received bytes now, or a little later.
    pub(super) fn look(&mut self) {
        self.looked_at = self.latest;
    }

    /// The port was empty at `latest` or a little later. A short read does not show that: a
    /// ring buffer gives only what lies in front of its end.
    pub(super) fn saw_empty(&mut self) {
        self.empty_at = self.latest;
    }

    /// Lets time pass.
    pub(super) fn expire(&mut self) {
        let now = self.now();
        if reached(self.role.poll_timeout(), now) {
            self.role.handle_timeout(now);
        }
    }

    /// Is there something to send? The rest of a frame goes before the next one, unless it is
    /// outdated.
    pub(super) fn load<E>(&mut self) -> Result<bool, DriveError<E>> {
        let now = self.now();
        if !self.sending.rest().is_empty() && self.role.is_outdated() {
            let given_up = self.sending.give_up();
            self.tell_unsent(given_up);
        }
        if self.sending.rest().is_empty() {
            let Some(frame) = self.role.poll_transmit(now) else { return Ok(false) };
            self.sending.load(frame)?;
        }
        Ok(true)
    }

    /// The port is about to be asked to take what is unsent.
    pub(super) fn before_write(&mut self) {
        let now = self.now();
        self.sending.begin_write(now);
    }

    /// What a write has done: the port has taken bytes, or it has failed.
    pub(super) fn after_write<E>(
        &mut self,
        written: Result<usize, E>,
    ) -> Result<(), DriveError<E>> {
        let now = self.now();
        let failure = match written {
            Ok(0) => DriveError::WriteZero,
            Ok(count) => {
                let (time, silence) = (self.role.wire_time(count), self.silence());
                let unsent = self.sending.sent(count, time, now, silence);
                self.tell_unsent(unsent);
                return Ok(());
            }
            Err(error) => DriveError::Port(error),
        };
        self.reclaim();
        Err(failure)
    }

    pub(super) fn after_flush<E>(&mut self, flushed: Result<(), E>) -> Result<(), DriveError<E>> {
        if let Err(error) = flushed {
            self.unflushed();
            return Err(DriveError::Port(error));
        }
        let now = self.now();
        let unsent = self.sending.flushed(now, self.silence());
        self.tell_unsent(unsent);
        Ok(())
    }

    /// What was sent since the last flush may not have left.
    pub(super) fn unflushed(&mut self) {
        if self.sending.is_in_doubt() {
            let given_up = self.sending.give_up();
            self.tell_unsent(given_up);
        }
        let unsent = self.sending.flush_failed();
        self.tell_unsent(unsent);
    }

    /// Has the port let go of everything that the role has handed out?
    #[cfg(any(feature = "ikeya", feature = "ucp"))]
    pub(super) fn is_sent(&self) -> bool {
        self.sending.rest().is_empty() && !self.sending.needs_flush()
    }

    /// The same moment on the clock of the user.
    #[cfg(feature = "embedded-io")]
    pub(super) fn on_clock(&self, at: Instant) -> Instant {
        Instant::from_micros(at.as_micros().wrapping_sub(self.ahead_us))
    }

    /// When to look at the role again, until `deadline`.
    pub(super) fn wake_at(&self, deadline: Instant) -> Instant {
        self.poll_timeout().map_or(deadline, |at| at.min(deadline))
    }
}
