use std::collections::VecDeque;

use super::*;

#[test]
fn a_speed_that_a_uart_would_not_read_is_another_speed() {
    assert!(is_close(500_000, 500_000) && is_close(115_200, 115_384));
    assert!(!is_close(500_000, 9600) && !is_close(500_000, 460_800) && !is_close(1, 0));
}

#[test]
fn only_pseudo_terminals_have_no_line_speed() {
    assert!(is_pseudo_terminal("/dev/pts/0"));
    for path in ["/dev/ttyUSB0", "/dev/ttyS0", "/dev/ttyAMA0", "/dev/serial/by-id/usb-1", "x"] {
        assert!(!is_pseudo_terminal(path), "{path}");
    }
}

/// A role with frames to send that logs its calls.
#[derive(Default)]
struct Role {
    frames: VecDeque<&'static [u8]>,
    log: Vec<String>,
}

impl Endpoint for Role {
    type Event = ();

    fn handle_input(&mut self, bytes: &[u8], _: Instant) {
        if !bytes.is_empty() {
            self.log.push(format!("in {bytes:?}"));
        }
    }

    fn handle_timeout(&mut self, _: Instant) {}

    fn poll_transmit(&mut self, _: Instant) -> Option<&[u8]> {
        let frame = self.frames.pop_front()?;
        self.log.push(format!("out {frame:?}"));
        Some(frame)
    }

    fn handle_unsent(&mut self, unsent: Unsent, _: Instant) {
        self.log.push(format!("{unsent:?}"));
    }

    fn poll_event(&mut self) -> Option<()> {
        None
    }

    fn poll_timeout(&self) -> Option<Instant> {
        None
    }
}

/// A scripted line, with the result of each call.
#[derive(Default)]
struct Scripted {
    received: VecDeque<Result<Vec<u8>, Failure>>,
    refused: VecDeque<NotSent>,
    last: Vec<u8>,
}

impl Transport for Scripted {
    fn now(&self) -> Instant {
        Instant::from_micros(0)
    }

    fn send(&mut self, _: &[u8]) -> Result<(), NotSent> {
        self.refused.pop_front().map_or(Ok(()), Err)
    }

    fn receive(&mut self, _: Instant) -> Result<&[u8], Failure> {
        self.last = self.received.pop_front().unwrap_or(Ok(Vec::new()))?;
        Ok(&self.last)
    }
}

const NOW: Instant = Instant::from_micros(0);

fn vanished() -> Failure {
    Failure::Failed("vanished".to_owned())
}

#[test]
fn bytes_that_have_been_received_go_in_before_the_next_frame_goes_out() {
    let mut role = Role { frames: [&[1][..], &[2]].into(), ..Role::default() };
    let received = [Ok(vec![10]), Ok(vec![11]), Ok(vec![12])].into();
    let mut line = Scripted { received, ..Scripted::default() };
    line.round(&mut role, NOW).unwrap();
    assert_eq!(role.log, ["in [10]", "out [1]", "in [11]", "out [2]", "in [12]"]);
}

#[test]
fn a_receiver_that_fails_does_not_keep_a_stop_from_being_sent() {
    let mut role = Role { frames: [&[1][..], &[2]].into(), ..Role::default() };
    let received = [Err(vanished()), Err(vanished())].into();
    let mut line = Scripted { received, ..Scripted::default() };
    line.round(&mut role, NOW).unwrap_err();
    assert_eq!(role.log, ["out [1]", "out [2]"]);
}

#[test]
fn a_frame_that_did_not_leave_whole_goes_back_to_its_role_before_anything_else() {
    for (unsent, name) in [(Unsent::Untouched, "Untouched"), (Unsent::CutOff, "CutOff")] {
        for failure in [None, Some(vanished())] {
            let mut role = Role { frames: [&[1][..], &[2]].into(), ..Role::default() };
            let is_failure = failure.is_some();
            let refused = [NotSent { unsent, failure }].into();
            let mut line = Scripted { refused, ..Scripted::default() };
            assert_eq!(line.round(&mut role, NOW).is_err(), is_failure);
            assert_eq!(role.log, ["out [1]", name]);
        }
    }
}

#[test]
fn a_role_that_never_stops_sending_ends_no_round_late() {
    let mut role = Role { frames: vec![&[1][..]; 100].into(), ..Role::default() };
    Scripted::default().round(&mut role, NOW).unwrap();
    assert_eq!(role.log.len(), FRAMES);
}

/// A port with a scripted result for each write, and the bytes it has accepted.
struct Takes(VecDeque<io::Result<usize>>, Vec<u8>);

impl Write for Takes {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let taken = self.0.pop_front().unwrap_or(Ok(bytes.len()))?;
        self.1.extend(&bytes[..taken]);
        Ok(taken)
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

#[test]
fn a_write_says_how_much_has_left() {
    let error = |kind: ErrorKind| Err(kind.into());
    let cases = [
        (vec![error(ErrorKind::TimedOut)], Unsent::Untouched),
        (vec![error(ErrorKind::BrokenPipe)], Unsent::Untouched),
        (vec![error(ErrorKind::Interrupted), error(ErrorKind::TimedOut)], Unsent::Untouched),
        (vec![Ok(0)], Unsent::Untouched),
        (vec![Ok(1), error(ErrorKind::TimedOut)], Unsent::CutOff),
        (vec![Ok(2), error(ErrorKind::Interrupted), Ok(0)], Unsent::CutOff),
    ];
    for (script, expected) in cases {
        let mut port = Takes(script.into(), Vec::new());
        assert_eq!(write_all(&mut port, &[1, 2, 3]).unwrap_err().0, expected);
    }
    let script = vec![Ok(1), error(ErrorKind::Interrupted), Ok(1)];
    let mut port = Takes(script.into(), Vec::new());
    write_all(&mut port, &[1, 2, 3]).unwrap();
    assert_eq!(port.1, [1, 2, 3]);
}
