//! The driver itself: a role, a port and a clock, and the steps of one round.

use super::{
    clock::{Clock, SteadyTime},
    error::DriveError,
    looks::{Looks, long_before},
    sending::{FRAME_LEN, Sending},
};
use crate::{
    endpoint::{Endpoint, Transmit, Unsent},
    time::{Duration, Instant, earliest, reached},
};

/// Bytes read at once, at most.
pub(super) const CHUNK_LEN: usize = 64;

/// Reads in a row, at most: 4096 bytes, or fewer from a port that returns fewer at once. A line is
/// slower than that; a runaway port is not.
pub(super) const READS: usize = 64;

/// Frames sent in one round, at most: a role flooded with requests could go on forever.
pub(super) const FRAMES: usize = 8;

/// What a call needs from its port before it looks at the role.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
#[cfg_attr(
    not(any(feature = "ikeya", feature = "ucp")),
    allow(dead_code, reason = "only the calls of a role need more than a whole port")
)]
pub(super) enum Needs {
    /// A round without a failure.
    WholePort,
    /// The same, and no round once the deadline has passed: a command that ends then would be
    /// repeated.
    WholePortInTime,
    /// The half that works may be enough: a command was received, or a stop has left.
    HalfPort,
}

impl Needs {
    pub(super) fn is_half(self) -> bool {
        self == Self::HalfPort
    }

    /// When a call ends without another round.
    pub(super) fn ends_at(self, deadline: Instant) -> Option<Instant> {
        (self == Self::WholePortInTime).then_some(deadline)
    }
}

/// Pause before a port is asked again, after an error or in the middle of a frame.
pub(super) const ERROR_NAP: Duration = Duration::from_millis(1);

/// Longest time for which an async port may take no byte, or stay unflushed.
pub(super) const STALL: Duration = Duration::from_secs(1);

/// Time after which a receiver that keeps failing counts as one that has received nothing.
const RECOVERY: Duration = Duration::from_millis(20);

/// Longest time between two steps of a driver that was not held up; less for a slave or a robot.
const HELD_UP: Duration = Duration::from_millis(10);

/// Looks at the port in a row because of hold-ups, at most.
const LOOKS: u8 = 3;

/// What a round does next.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub(super) enum Next {
    /// Nothing is due.
    End,
    /// Bytes are to be sent, or to be flushed.
    Send,
    /// The port is to be looked at again: the driver was held up since.
    Look,
}

/// A role with its port and its clock.
///
/// ```
/// # #[cfg(feature = "ikeya")] {
/// use axlewire::drive::{Clock, DriveError, Driver};
/// use axlewire::{ikeya::{NodeId, Rps, master::MasterConfig}, time::Duration};
/// use embedded_io::{Read, ReadReady, Write};
///
/// fn turn<P, C: Clock>(port: P, clock: C) -> Result<(), DriveError<P::Error>>
/// where
///     P: Read + ReadReady + Write,
/// {
///     let mut bus = Driver::master(MasterConfig::direct(), port, clock);
///     println!("{} nodes", bus.discover()?.len());
///     bus.set_velocity(NodeId::N2, Rps::new(1.5)?)?;
///     bus.run_for(Duration::from_secs(2), |_master, event, _now| println!("{event:?}"))?;
///     bus.stop(NodeId::N2) // `Ok` only once the motor is seen to be still
/// }
/// # }
/// ```
///
/// No call of it loses received bytes, sends an old command late, or waits longer than it says, and
/// after any error the next call continues; see the [module](super).
#[derive(Clone, Debug)]
pub struct Driver<R, P, C> {
    pub(super) role: R,
    pub(super) port: P,
    pub(super) clock: C,
    pub(super) time: SteadyTime,
    pub(super) looks: Looks,
    /// When the role last decided that what is to be sent may go.
    decided_at: Instant,
    /// When the call that is running ends, if its command must not be sent after that.
    pub(super) ends_at: Option<Instant>,
    pub(super) sending: Sending,
}

/// How often the port of a role that acts on commands must be read, see
/// [`LineRules::held_up_after`](crate::endpoint::LineRules::held_up_after).
pub(super) fn look_period<R: Endpoint>(role: &R) -> Option<Duration> {
    Some(Duration::from_micros(commands_wait(role)?.as_micros() / 2))
}

/// How long a command may wait in the port of a role that acts on commands; `None` for others.
fn commands_wait<R: Endpoint>(role: &R) -> Option<Duration> {
    role.line_rules().held_up_after.filter(|&limit| limit != Duration::ZERO)
}

impl<R: Endpoint, P, C: Clock> Driver<R, P, C> {
    /// Combines a role, a port and a clock. The role must have been made with a time of the same
    /// clock; [`with`](Self::with) ensures that. It must be new or come from
    /// [`into_parts`](Self::into_parts): a copy of a role that has sent a stop through another port
    /// takes it for sent through this one.
    ///
    /// A master takes nothing that is in the port already for an answer, and a host no report for
    /// one from after a stop.
    pub fn new(role: R, port: P, clock: C) -> Self {
        let latest = clock.now();
        Self::starting_at(latest, role, port, clock)
    }

    /// The same, with a role made here, at the time of this clock.
    pub fn with(role: impl FnOnce(Instant) -> R, port: P, clock: C) -> Self {
        let latest = clock.now();
        Self::starting_at(latest, role(latest), port, clock)
    }

    fn starting_at(latest: Instant, role: R, port: P, clock: C) -> Self {
        // A master or a host may have talked through this port before.
        let empty_at = match look_period(&role) {
            Some(_) => latest,
            None => long_before(latest),
        };
        Self {
            role,
            port,
            clock,
            time: SteadyTime::new(latest),
            looks: Looks::new(latest, empty_at),
            decided_at: latest,
            ends_at: None,
            sending: Sending::new(latest),
        }
    }

    /// The time given to the role. If the clock goes backwards, the role's time continues from
    /// where it was: one wrong reading must not stop it.
    pub fn now(&self) -> Instant {
        self.time.read(&self.clock)
    }

    /// The latest time given to the role.
    pub(super) fn latest(&self) -> Instant {
        self.time.latest()
    }

    /// The role.
    #[must_use]
    pub const fn role(&self) -> &R {
        &self.role
    }

    /// The role, to give it commands. To put another one in its place, call
    /// [`discard`](Self::discard) first: the rest of a frame would still be sent.
    pub const fn role_mut(&mut self) -> &mut R {
        &mut self.role
    }

    /// The port.
    #[must_use]
    pub const fn port(&self) -> &P {
        &self.port
    }

    /// The port, to change its settings. The role misses bytes that you read from it, and bytes
    /// that you write may land inside a frame.
    pub const fn port_mut(&mut self) -> &mut P {
        &mut self.port
    }

    /// Role, port and clock. Unsent and unflushed bytes are discarded, see
    /// [`discard`](Self::discard).
    ///
    /// To reopen a port, replace it by [`port_mut`](Self::port_mut) and call `discard`: another
    /// driver does not know whether the clock has stepped back. If it has, a role that is given to
    /// another driver waits for as long as the step was.
    #[must_use]
    pub fn into_parts(mut self) -> (R, P, C) {
        self.discard();
        // Nobody flushes it any more: the role must not wait for that.
        let now = self.now();
        self.role.handle_transmit(Transmit::Flushed, now);
        (self.role, self.port, self.clock)
    }

    /// The next event in the queue, without using the port.
    pub fn poll_event(&mut self) -> Option<R::Event> {
        self.tell_time();
        self.role.poll_event()
    }

    /// A slave's command must not be told after its watchdog, however long the port took.
    pub(super) fn tell_time(&mut self) {
        let now = self.now();
        self.role.handle_input(&[], now);
    }

    /// When the next round must run at the latest, if no bytes arrive: at once, or a millisecond
    /// later, if the port has not taken or flushed a frame yet.
    ///
    /// Never `None` for a slave or a robot, even an idle one: bytes found after a longer time may
    /// be old, and do not count as new
    /// ([`LineRules::held_up_after`](crate::endpoint::LineRules::held_up_after)).
    #[must_use]
    pub fn poll_timeout(&self) -> Option<Instant> {
        let look_at = look_period(&self.role).map(|period| self.looks.latest + period);
        let retry_at = self.is_pending().then(|| self.latest() + ERROR_NAP);
        earliest(&[self.role.poll_timeout(), look_at, retry_at])
    }

    /// The bytes of a frame that the port has not taken yet.
    #[must_use]
    pub fn unsent(&self) -> &[u8] {
        self.sending.rest()
    }

    /// Discards unsent or unflushed bytes, for a port that comes back after a while, or another
    /// one; returns the number of unsent bytes. The role counts them as not sent. The other end may
    /// have received the beginning of the frame. Received bytes that are in the port count as old.
    pub fn discard(&mut self) -> usize {
        let discarded = self.sending.rest().len();
        self.sending.end_waits();
        let now = self.now();
        self.give_up(now);
        // What has left before may have left through another port: a stop is due again (U16).
        self.sending.flush_failed();
        self.tell_unsent(Some(Unsent::Unflushed), now);
        self.sending.ask_flush();
        self.looks.forget(now);
        discarded
    }

    /// Lets the role decide again about a frame that did not leave.
    pub(super) fn reclaim(&mut self, now: Instant) {
        let unsent = self.sending.reclaim(now, self.silence());
        self.tell_unsent(unsent, now);
    }

    /// Longest silence inside a frame. The other end measures from byte to byte, which includes the
    /// time of the byte after the silence.
    pub(super) fn silence(&self) -> Duration {
        let rules = self.role.line_rules();
        let (pause, byte) = (rules.frame_pause, rules.wire_time(1));
        Duration::from_micros(pause.as_micros().saturating_sub(byte.as_micros()))
    }

    pub(super) fn tell_unsent(&mut self, unsent: Option<Unsent>, now: Instant) {
        if let Some(unsent) = unsent {
            self.role.handle_transmit(unsent, now);
        }
    }

    /// Hands in the bytes of a read.
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
        let arrived = self.looks.arrived(now, self.role.line_rules().held_up_after);
        self.role.handle_input(bytes, arrived);
        Ok(())
    }

    /// Time after which a round sends nothing more: through a slow port the application of a slave
    /// or a robot would hear of its watchdog too late.
    pub(super) fn round_time(&self) -> Option<Duration> {
        look_period(&self.role).map(|period| period.max(self.frame_time()))
    }

    /// Whether that has passed since a round began; a second for a master or a host.
    pub(super) fn is_held_up(&mut self, begin: Instant) -> bool {
        self.now() - begin >= self.round_time().unwrap_or(STALL)
    }

    /// Whether the call that is running has ended.
    pub(super) fn is_over(&mut self) -> bool {
        // Reading the time is what costs most in a round.
        self.ends_at.is_some_and(|at| self.now() >= at)
    }

    /// Time within which a healthy port takes or flushes a frame.
    pub(super) fn frame_time(&self) -> Duration {
        self.port_time(FRAME_LEN)
    }

    /// The same for this many bytes.
    pub(super) fn port_time(&self, bytes: usize) -> Duration {
        self.role.line_rules().wire_time(bytes).saturating_mul(2) + Duration::from_millis(1)
    }

    /// Whether the port of a slave or a robot may hold more, because its receiver has failed, or
    /// because there is too much for one look: its line is not idle then, and an answer may be
    /// overtaken.
    fn may_hold_more(&mut self) -> bool {
        let Some(since) = self.looks.unsure_since else { return false };
        look_period(&self.role).is_some() && self.now() - since < RECOVERY
    }

    /// Lets time pass, but only until the port was seen empty: whatever has arrived since is still
    /// in it.
    pub(super) fn expire(&mut self) {
        let mut now = self.looks.empty_at;
        if let Some(since) = self.looks.unsure_since {
            now = self.latest();
            if self.role.line_rules().held_up_after.is_some() {
                self.doubt(now);
                if now - since < RECOVERY {
                    // The rest of a frame may wait in a port whose receiver fails.
                    return;
                }
            }
        }
        if reached(self.role.poll_timeout(), now) {
            self.role.handle_timeout(now);
        }
    }

    /// Tells the role that bytes may wait in the port, from any time since it was seen empty.
    fn doubt(&mut self, now: Instant) {
        self.role.handle_input(&[], self.looks.since_empty(now));
    }

    /// Longest time between two steps that is no hold-up.
    pub(super) fn patience_between_steps(&self) -> Duration {
        commands_wait(&self.role).map_or(HELD_UP, |limit| limit.min(HELD_UP))
    }

    /// Whether there is something to send. The rest of a frame goes before the next one, unless it
    /// is outdated. `again` counts how often the port has just been looked at again because of a
    /// hold-up: in the end what is due is sent, however often the driver is held up.
    pub(super) fn load<E>(&mut self, again: u8) -> Result<Next, DriveError<E>> {
        let now = self.now();
        if !self.sending.rest().is_empty() {
            // The receiver may have taken long since the round began.
            self.reclaim(now);
        }
        if now - self.looks.latest > self.patience_between_steps() {
            if again < LOOKS {
                return Ok(Next::Look);
            }
            // Held up once more: what has arrived since the look is not known.
            self.doubt(now);
        }
        if self.sending.is_in_doubt() {
            // Its flush goes first: it was dropped, or the rest of the frame was given up.
            return Ok(Next::Send);
        }
        if self.sending.rest().is_empty() {
            if self.may_hold_more() {
                return Ok(Next::End);
            }
            // A command that has ended while the driver was held up is not repeated.
            if reached(self.ends_at, now) {
                return Ok(Next::End);
            }
            self.decided_at = now;
            let Some(frame) = self.role.poll_transmit(now) else {
                self.sending.end_write_wait();
                return Ok(Next::End);
            };
            self.sending.load(frame)?;
            self.looks.note_frame();
        }
        Ok(Next::Send)
    }

    pub(super) fn give_up(&mut self, now: Instant) {
        let given_up = self.sending.give_up();
        self.tell_unsent(given_up, now);
    }

    /// Notes that the port is about to be asked to take the unsent bytes. `false` if they have been
    /// given up: the call or their command has ended, an answer had to wait, or their frame has
    /// paused for too long.
    ///
    /// All of it is decided by one reading of the clock, the last before the port is asked.
    pub(super) fn before_write(&mut self) -> bool {
        let now = self.now();
        let is_late = look_period(&self.role).is_some()
            && now - self.decided_at > self.patience_between_steps();
        if is_late || self.sending.is_in_parts() || reached(self.ends_at, now) {
            self.reclaim(now);
        }
        if self.sending.rest().is_empty() {
            return false;
        }
        let is_held_up = now - self.looks.latest > self.patience_between_steps();
        let arrived = if is_held_up { self.looks.since_empty(now) } else { now.into() };
        self.role.handle_input(&[], arrived);
        self.decided_at = now;
        if self.role.is_outdated() {
            self.give_up(now);
            return false;
        }
        self.sending.begin_write(now);
        true
    }

    /// Handles the result of a write: the port took bytes, or failed.
    pub(super) fn after_write<E>(
        &mut self,
        written: Result<usize, E>,
    ) -> Result<(), DriveError<E>> {
        let now = self.now();
        let failure = match written {
            Ok(0) => DriveError::WriteZero,
            Ok(count) => {
                let (time, silence) = (self.role.line_rules().wire_time(count), self.silence());
                let is_whole = count >= self.sending.rest().len();
                let unsent = self.sending.sent(count, time, now, silence);
                if is_whole {
                    self.role.handle_transmit(Transmit::Taken, now);
                }
                self.tell_unsent(unsent, now);
                return Ok(());
            }
            Err(error) => DriveError::Port(error),
        };
        self.reclaim(now);
        Err(failure)
    }

    pub(super) fn after_flush<E>(&mut self, flushed: Result<(), E>) -> Result<(), DriveError<E>> {
        if let Err(error) = flushed {
            self.unflushed();
            return Err(DriveError::Port(error));
        }
        let now = self.now();
        let unsent = self.sending.flushed(now, self.silence());
        self.tell_unsent(unsent, now);
        self.role.handle_transmit(Transmit::Flushed, now);
        Ok(())
    }

    /// Notes that bytes sent since the last flush may not have left; their frame has no rest then.
    pub(super) fn unflushed(&mut self) {
        let now = self.now();
        self.give_up(now);
        let unsent = self.sending.flush_failed();
        self.tell_unsent(unsent, now);
    }

    /// Whether everything that the role handed out has left the port.
    #[cfg(any(feature = "ikeya", feature = "ucp", feature = "embedded-io-async"))]
    pub(super) fn is_sent(&self) -> bool {
        self.sending.rest().is_empty() && !self.sending.needs_flush()
    }

    /// Whether the port is to be asked again for what it has not done yet.
    pub(super) fn is_pending(&self) -> bool {
        self.sending.is_pending() || self.sending.is_flush_due()
    }

    /// The same moment on the user's clock.
    pub(super) fn on_clock(&self, at: Instant) -> Instant {
        self.time.on_clock(at)
    }

    /// When to look at the role again, `deadline` at the latest.
    pub(super) fn wake_at(&self, deadline: Instant) -> Instant {
        self.poll_timeout().map_or(deadline, |at| at.min(deadline))
    }
}
