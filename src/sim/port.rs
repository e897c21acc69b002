//! One end of the line: the loop around an endpoint, with its queues.

use alloc::{collections::VecDeque, vec::Vec};

use super::{arrivals::Arrivals, faults::Faults};
use crate::{
    endpoint::Endpoint,
    time::{Duration, Instant, wire_time},
};

/// Consecutive rounds in which an endpoint asks to be called again at once and does nothing, before
/// this counts as a busy loop.
const PATIENCE: u32 = 3;

/// Most frames, and most events, of an endpoint in one round.
const ROUND_LIMIT: usize = 10_000;

/// Most rounds of an endpoint at one instant.
const ROUNDS_AT_ONCE: u32 = 10_000;

/// How the loop around an endpoint runs. By default without delay and byte by byte.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
#[non_exhaustive]
pub struct Timing {
    /// Delay of the loop: it sees received bytes and deadlines this much later.
    pub latency: Duration,
    /// How received bytes are grouped.
    pub input: Input,
}

/// A loop that is never late.
impl Default for Timing {
    fn default() -> Self {
        Self { latency: Duration::ZERO, input: Input::Bytes }
    }
}

/// How received bytes are grouped into pieces of input.
///
/// ```
/// use axlewire::{sim::Input, time::Duration};
/// let dma = Input::AfterPause { pause: Duration::from_micros(20), at_most: 64 };
/// assert_ne!(dma, Input::usb_adapter());
/// ```
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub enum Input {
    /// Each byte by itself, as with an interrupt per byte.
    Bytes,
    /// A piece ends when nothing has arrived for `pause` or `at_most` bytes are there: DMA with the
    /// idle interrupt of a UART.
    AfterPause {
        /// Silence that ends a piece.
        pause: Duration,
        /// Bytes that end a piece.
        at_most: usize,
    },
    /// A piece ends `wait` after its first byte or when `at_most` bytes are there: a USB adapter
    /// with its latency timer.
    AfterFirst {
        /// Time from the first byte of a piece to its end.
        wait: Duration,
        /// Bytes that end a piece.
        at_most: usize,
    },
}

impl Input {
    /// A USB adapter with the default latency timer: 16 ms, or 62 bytes.
    #[must_use]
    pub const fn usb_adapter() -> Self {
        Self::AfterFirst { wait: Duration::from_millis(16), at_most: 62 }
    }
}

/// How an endpoint breaks the contract.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub(super) enum Trouble {
    BusyLoop,
    Endless,
}

/// A byte on its way along the pair.
#[derive(Clone, Copy, Debug)]
pub(super) struct WireByte {
    pub(super) start: Instant,
    pub(super) end: Instant,
    pub(super) byte: u8,
    /// Whether this is the first byte of its transmission.
    pub(super) is_first: bool,
    /// Whether another sender was talking at the same time.
    pub(super) is_collided: bool,
}

/// Bytes without a gap between them. Their ends are counted from the first start, so that rounding
/// errors do not add up.
#[derive(Clone, Copy, Debug)]
struct Run {
    start: Instant,
    bytes: usize,
}

/// The earlier of two times that may never come.
pub(super) fn earlier(a: Option<Instant>, b: Option<Instant>) -> Option<Instant> {
    match (a, b) {
        (Some(a), Some(b)) => Some(a.min(b)),
        (a, b) => a.or(b),
    }
}

/// One end of the line, without its endpoint.
#[derive(Debug)]
pub(super) struct Port {
    pub(super) timing: Timing,
    pub(super) stub: Faults,
    pub(super) polls: u64,
    /// Bytes sent, but not yet at the end of the wire.
    pub(super) sending: VecDeque<WireByte>,
    run: Option<Run>,
    pub(super) arrivals: Arrivals,
    /// The endpoint's last `poll_timeout`.
    deadline: Option<Instant>,
    /// When the application may have given a command.
    touched: Option<Instant>,
    fruitless: u32,
    /// Time of the last round, and number of rounds at that time.
    rounds: (Option<Instant>, u32),
}

impl Port {
    pub(super) fn new(now: Instant) -> Self {
        Self {
            timing: Timing::default(),
            stub: Faults::CLEAN,
            polls: 0,
            sending: VecDeque::new(),
            run: None,
            arrivals: Arrivals::new(),
            deadline: None,
            touched: Some(now),
            fruitless: 0,
            rounds: (None, 0),
        }
    }

    /// Notes that the application had access to the endpoint.
    pub(super) fn touch(&mut self, now: Instant) {
        self.touched.get_or_insert(now);
    }

    /// Puts bytes onto the wire after those already on it, not before `from`; returns the number of
    /// older bytes in `sending`.
    pub(super) fn send(&mut self, bytes: &[u8], from: Instant, baud: u32) -> usize {
        let older = self.sending.len();
        for (index, &byte) in bytes.iter().enumerate() {
            let end_of = |run: &Run| run.start + wire_time(run.bytes, baud);
            let mut run = match self.run {
                Some(run) if end_of(&run) > from => run,
                _ => Run { start: from, bytes: 0 },
            };
            let start = end_of(&run);
            run.bytes += 1;
            let end = end_of(&run);
            // This many bytes take exactly 10 s, so there is no rounding error, and no run gets too
            // long.
            if run.bytes == baud as usize {
                run = Run { start: end, bytes: 0 };
            }
            self.run = Some(run);
            let is_first = index == 0;
            self.sending.push_back(WireByte { start, end, byte, is_first, is_collided: false });
        }
        older
    }

    /// When the next byte on the wire is complete.
    pub(super) fn sent_at(&self) -> Option<Instant> {
        self.sending.front().map(|byte| byte.end)
    }

    /// When the loop runs next.
    pub(super) fn wakes_at(&self) -> Option<Instant> {
        let piece = self.next_piece().map(|(at, _)| at);
        let trigger = earlier(piece, earlier(self.deadline, self.touched));
        trigger.map(|at| at + self.timing.latency)
    }

    /// The next piece of input: when it is complete, and its number of bytes.
    fn next_piece(&self) -> Option<(Instant, usize)> {
        let first = self.arrivals.bytes.front()?.0;
        let arrived_by =
            |limit: Instant| self.arrivals.bytes.partition_point(|(at, _)| *at <= limit);
        let arrival = |index: usize| self.arrivals.bytes.get(index).map(|(at, _)| *at);
        match self.timing.input {
            Input::Bytes => Some((first, 1)),
            Input::AfterFirst { wait, at_most } => match arrival(at_most.max(1) - 1) {
                Some(full) if full <= first + wait => Some((full, at_most.max(1))),
                _ => Some((first + wait, arrived_by(first + wait))),
            },
            Input::AfterPause { pause, at_most } => {
                let mut last = (first, 1);
                while last.1 < at_most.max(1) {
                    match arrival(last.1) {
                        Some(at) if at <= last.0 + pause => last = (at, last.1 + 1),
                        _ => return Some((last.0 + pause, last.1)),
                    }
                }
                Some(last)
            }
        }
    }

    /// Runs one round of the loop that [`Endpoint`] describes. Appends the frames to send to
    /// `sent`.
    pub(super) fn run<E: Endpoint>(
        &mut self,
        endpoint: &mut E,
        now: Instant,
        sent: &mut Vec<Vec<u8>>,
        mut tell: impl FnMut(E::Event),
    ) -> Result<(), Trouble> {
        self.polls += 1;
        let latency = self.timing.latency;
        let is_seen = |at: &Instant| now >= *at + latency;
        let mut is_fruitful = self.touched.take_if(|at| is_seen(at)).is_some();
        while let Some((_, len)) = self.next_piece().filter(|(at, _)| is_seen(at)) {
            let piece: Vec<u8> = self.arrivals.bytes.drain(..len).map(|(_, byte)| byte).collect();
            endpoint.handle_input(&piece, now);
            is_fruitful = true;
        }
        if endpoint.poll_timeout().is_some_and(|at| is_seen(&at)) {
            endpoint.handle_timeout(now);
        }
        for count in 0.. {
            let Some(event) = endpoint.poll_event() else { break };
            tell(event);
            is_fruitful = true;
            if count == ROUND_LIMIT {
                return Err(Trouble::Endless);
            }
        }
        for count in 0.. {
            let Some(bytes) = endpoint.poll_transmit(now) else { break };
            sent.push(bytes.to_vec());
            is_fruitful = true;
            if count == ROUND_LIMIT {
                return Err(Trouble::Endless);
            }
        }
        self.deadline = endpoint.poll_timeout();
        self.judge(is_fruitful, now)
    }

    /// Checks that the endpoint lets time pass.
    fn judge(&mut self, is_fruitful: bool, now: Instant) -> Result<(), Trouble> {
        let wants_more = self.deadline.is_some_and(|at| at <= now);
        self.fruitless = if wants_more && !is_fruitful { self.fruitless + 1 } else { 0 };
        self.rounds = match self.rounds {
            (Some(at), count) if at == now && wants_more => (Some(now), count + 1),
            _ => (Some(now), 1),
        };
        match (self.fruitless, self.rounds.1) {
            (PATIENCE.., _) => Err(Trouble::BusyLoop),
            (_, ROUNDS_AT_ONCE..) => Err(Trouble::Endless),
            _ => Ok(()),
        }
    }
}
