//! A role on an open line, run by the library's driver.

use std::{
    cell::Cell,
    io,
    rc::Rc,
    time::{Duration as Span, Instant as Clock},
};

use axlewire::{
    drive::{DriveError, Driver},
    endpoint::{Endpoint, Unsent},
    ikeya::{Master, board::Board, master::NodeSet},
    time::{Duration, Instant},
};
use embedded_io::Write;

use crate::{
    clock,
    failure::Failure,
    line::{Line, LineClock},
};

/// Longest wait for bytes, so that signals are noticed in time: well under the dead-man timeouts.
const PATIENCE: Duration = Duration::from_millis(50);

/// Time after which a port that accepts no byte has failed. Until then it may recover.
const STUCK: Span = Span::from_secs(1);

/// A role on an open line.
pub(crate) struct Session<R> {
    driver: Driver<R, Line, LineClock>,
    awake: Rc<Cell<Span>>,
    /// Time since which the port has accepted no byte, if it is stuck.
    stuck_since: Option<Clock>,
}

impl<R: Endpoint> Session<R> {
    pub(crate) fn new(line: Line, role: impl FnOnce(Instant) -> R) -> Self {
        let clock = line.clock();
        let awake = clock.awake();
        Self { driver: Driver::with(role, line, clock), awake, stuck_since: None }
    }

    /// Continues with another role, which takes nothing that was received before for an answer.
    pub(crate) fn begin_anew(&mut self, role: impl FnOnce(Instant) -> R) {
        let now = self.now();
        *self.driver.role_mut() = role(now);
        self.driver.discard();
    }

    /// The time for which the tool has been running since then, without suspensions.
    pub(crate) fn awake(&self) -> Span {
        self.awake.get()
    }

    /// The time since the line was opened.
    pub(crate) fn now(&mut self) -> Instant {
        self.driver.now()
    }

    pub(crate) fn path(&self) -> &str {
        self.driver.port().path()
    }

    /// Ends the recording, if there is one, for use while nothing moves; fails if it is incomplete.
    pub(crate) fn check_recording(&self) -> Result<(), Failure> {
        self.driver.port().check_recording()
    }

    pub(crate) const fn role(&self) -> &R {
        self.driver.role()
    }

    pub(crate) const fn role_mut(&mut self) -> &mut R {
        self.driver.role_mut()
    }

    /// Runs the role until it has an event, which is returned, or until `until` or the next moment
    /// to look for signals.
    ///
    /// Events from before a failure stay in the role's queue. The caller goes on with the next
    /// round, if it has to stop something.
    pub(crate) fn round(&mut self, until: Instant) -> Result<Option<R::Event>, Failure> {
        let until = until.min(self.now() + PATIENCE);
        match self.driver.next_event(until - self.driver.now()) {
            Ok(event) => {
                self.stuck_since = None;
                Ok(event)
            }
            Err(error) => self.judge(error).map_or(Ok(None), Err),
        }
    }

    /// Whether the port has all of the role's latest frame.
    pub(crate) fn is_clear(&self) -> bool {
        self.driver.unsent().is_empty()
    }

    /// Sends a frame that is not the role's, between two of its own; `false` if it did not leave
    /// whole.
    pub(crate) fn interject(&mut self, frame: &[u8]) -> Result<bool, Failure> {
        if !self.is_clear() {
            return Ok(false);
        }
        let (now, port) = (self.now(), self.driver.port_mut());
        match port.write_all(frame).and_then(|()| port.flush()) {
            Ok(()) => Ok(true),
            Err(error) => {
                // The other end may take the role's next frame for the rest of this one.
                self.role_mut().handle_transmit(Unsent::CutOff, now);
                self.judge(DriveError::Port(error)).map_or(Ok(false), Err)
            }
        }
    }

    /// The next event in the queue.
    pub(crate) fn poll_event(&mut self) -> Option<R::Event> {
        self.driver.poll_event()
    }

    /// The failure for an error of the driver, unless the port may still recover.
    fn judge(&mut self, error: DriveError<io::Error>) -> Option<Failure> {
        let cause = match error {
            DriveError::Port(error) if error.kind() == io::ErrorKind::TimedOut => {
                let since = *self.stuck_since.get_or_insert_with(clock::now);
                if clock::since(since) < STUCK {
                    return None;
                }
                "it accepts no more bytes".to_owned()
            }
            DriveError::Port(error) => error.to_string(),
            other => other.to_string(),
        };
        Some(Failure::lost(self.path(), &cause))
    }
}

impl<B: Board> Session<Master<B>> {
    /// Stops these nodes and waits until they are still, through failures of the port, as
    /// [`Driver::stop`] does.
    pub(crate) fn stop(&mut self, nodes: NodeSet) -> Result<(), DriveError<io::Error>> {
        let begin = clock::now();
        let stopped = self.driver.stop(nodes);
        if stopped.is_err() {
            // If it is stuck now, it may have been all the time.
            self.stuck_since.get_or_insert(begin);
        }
        stopped
    }
}

#[cfg(test)]
mod tests {
    use axlewire::{
        ikeya::{Master, master::MasterConfig},
        ucp::{Host, host::HostConfig},
    };
    use embedded_io::{ErrorType, Read, ReadReady, Write};

    use super::*;
    use crate::line::Wire;

    /// A port whose system takes no byte, as behind a stuck adapter, except at the times of `open`,
    /// milliseconds.
    struct Stuck {
        start: Clock,
        open: core::ops::Range<u128>,
    }

    impl ErrorType for Stuck {
        type Error = io::Error;
    }

    impl Wire for Stuck {
        fn wait(&mut self, patience: Span) -> io::Result<bool> {
            clock::sleep(patience);
            Ok(false)
        }
    }

    impl ReadReady for Stuck {
        fn read_ready(&mut self) -> io::Result<bool> {
            Ok(false)
        }
    }

    impl Read for Stuck {
        fn read(&mut self, _: &mut [u8]) -> io::Result<usize> {
            Ok(0)
        }
    }

    impl Write for Stuck {
        fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
            match self.open.contains(&clock::since(self.start).as_millis()) {
                true => Ok(bytes.len()),
                false => {
                    clock::sleep(Span::from_millis(20));
                    Err(io::ErrorKind::TimedOut.into())
                }
            }
        }

        fn flush(&mut self) -> io::Result<()> {
            Ok(())
        }
    }

    fn stuck(open: core::ops::Range<u128>) -> (Session<Master>, Clock) {
        clock::play();
        let start = clock::now();
        let line = Line::new("stuck", Stuck { start, open }, true);
        let mut session = Session::new(line, |now| Master::new(MasterConfig::usb_adapter(), now));
        let now = session.now();
        session.role_mut().discover(now);
        (session, start)
    }

    #[test]
    fn a_port_that_takes_something_in_between_has_a_second_again() {
        let (mut session, start) = stuck(700..800);
        while clock::since(start) < 3 * STUCK / 2 {
            let until = session.now() + PATIENCE;
            session.round(until).unwrap();
        }
    }

    #[test]
    fn a_frame_between_those_of_a_role_is_lost_if_it_does_not_leave_and_the_role_knows() {
        clock::play();
        let line = Line::new("stuck", Stuck { start: clock::now(), open: 0..100 }, true);
        let mut session = Session::new(line, |now| Host::new(HostConfig::default(), now));
        let now = session.now();
        session.round(now).unwrap();
        assert!(session.interject(&[1]).unwrap() && session.role().is_stop_sent());
        clock::sleep(Span::from_millis(150));
        assert!(!session.interject(&[1]).unwrap() && !session.role().is_stop_sent());
        clock::sleep(STUCK);
        assert!(session.interject(&[1]).is_err());
    }

    #[test]
    fn a_port_that_takes_nothing_for_a_second_has_failed_and_not_before() {
        let (mut session, start) = stuck(0..0);
        let failure = loop {
            let until = session.now() + PATIENCE;
            if let Err(failure) = session.round(until) {
                break failure;
            }
            assert!(clock::since(start) < 2 * STUCK, "it never fails");
        };
        assert_eq!(failure.to_string(), "port \"stuck\" failed: it accepts no more bytes");
        assert!(clock::since(start) >= STUCK, "{:?}", clock::since(start));
    }
}
