//! The echo of a line that hears itself.

use heapless::Deque;

/// Longest echo in flight, in bytes: a set-point and a stop for each of eight nodes on a motor bus,
/// none of them answered, and the READ after them.
const LEN: usize = 8 * (8 + 8) + 4;

/// Takes the echo of own bytes out of what is received.
///
/// On a two-wire line whose receiver stays on while sending, all that is sent comes back in front
/// of the answers. For a port of a `drive::Driver` there is `drive::WithoutEcho`; if you drive a
/// role by hand, tell the echo what left, and hand in what it returns:
///
/// ```
/// use axlewire::stream::Echo;
///
/// let mut echo = Echo::new();
/// echo.sent(b"ask");
/// assert_eq!(echo.strip(b"as"), b"");
/// assert_eq!(echo.strip(b"kanswer"), b"answer");
/// assert_eq!((echo.bytes(), echo.errors()), (3, 0));
/// ```
///
/// An echo that differs from what was sent is one [error](Self::errors): the bytes from there on
/// are returned, and those of the next frame are removed again. The same holds for a line without
/// an echo. Up to 132 bytes may be under way; with more, an echo is removed from the latest call of
/// [`sent`](Self::sent) on.
#[derive(Clone, Debug, Default)]
pub struct Echo {
    expected: Deque<u8, LEN>,
    bytes: u32,
    errors: u32,
}

impl Echo {
    /// Expects nothing yet.
    #[must_use]
    pub const fn new() -> Self {
        Self { expected: Deque::new(), bytes: 0, errors: 0 }
    }

    /// Expects the echo of these bytes, behind those under way. Call it with all that has left, in
    /// order, before [`strip`](Self::strip) is given its echo.
    pub fn sent(&mut self, bytes: &[u8]) {
        if bytes.len() > LEN - self.expected.len() {
            // On a line without an echo the record must not stay full.
            self.expected.clear();
        }
        for &byte in bytes {
            let _ = self.expected.push_back(byte);
        }
    }

    /// Expects nothing any more: it is unknown how much of what was sent has left.
    pub fn forget(&mut self) {
        self.expected.clear();
    }

    /// What is left of received bytes without the echo in front of them.
    #[must_use]
    pub fn strip<'a>(&mut self, received: &'a [u8]) -> &'a [u8] {
        let under_way = self.expected.len();
        let same =
            self.expected.iter().zip(received).take_while(|(sent, heard)| sent == heard).count();
        for _ in 0..same {
            self.expected.pop_front();
        }
        if same < under_way.min(received.len()) {
            self.errors = self.errors.saturating_add(1);
            self.expected.clear();
        }
        self.bytes = self.bytes.saturating_add(same as u32);
        received.get(same..).unwrap_or_default()
    }

    /// Number of own bytes removed; stops at 2^32 - 1.
    #[must_use]
    pub const fn bytes(&self) -> u32 {
        self.bytes
    }

    /// Number of times the echo differed from what had been sent; stops at 2^32 - 1.
    #[must_use]
    pub const fn errors(&self) -> u32 {
        self.errors
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_longest_echo_is_removed_and_a_longer_one_from_its_last_frame_on() {
        let mut echo = Echo::new();
        let frame: [u8; LEN / 4] = core::array::from_fn(|at| at as u8);
        (0..4).for_each(|_| echo.sent(&frame));
        (0..4).for_each(|_| assert!(echo.strip(&frame).is_empty()));
        assert_eq!((echo.bytes(), echo.errors()), (LEN as u32, 0));
        (0..5).for_each(|_| echo.sent(&frame));
        assert!(echo.strip(&frame).is_empty());
        assert_eq!(echo.strip(&frame), frame, "nothing is expected behind it");
        assert_eq!(echo.errors(), 0);
        echo.sent(&[7; LEN + 1]);
        assert_eq!(echo.strip(&[7; LEN + 1]), [7], "longer than the record");
    }

    #[test]
    fn a_wrong_echo_is_one_error_and_the_next_one_is_removed_again() {
        for wrong in [b"axkanswer".as_slice(), b"answer", b"x"] {
            let mut echo = Echo::new();
            echo.sent(b"ask");
            let same = wrong.iter().zip(b"ask").take_while(|(a, b)| a == b).count();
            assert_eq!(echo.strip(wrong), &wrong[same..]);
            echo.sent(b"more");
            assert_eq!(echo.strip(b"mor"), b"");
            assert_eq!(echo.strip(b"e!"), b"!");
            assert_eq!((echo.bytes(), echo.errors()), (same as u32 + 4, 1));
        }
    }

    #[test]
    fn what_is_forgotten_is_not_removed() {
        let mut echo = Echo::new();
        echo.sent(b"ask");
        echo.forget();
        assert_eq!(echo.strip(b"ask"), b"ask");
        assert_eq!((echo.bytes(), echo.errors()), (0, 0));
    }
}
