//! Maximum speed of a bus, computed before it is wired.

use crate::ikeya::{
    board::{Board, OneMotor},
    units::BAUD,
    wire::ReadRequest,
};
use crate::{
    stream::Framing,
    time::{Duration, wire_time},
};

/// The plan of a cycle: each node gets a WRITE, if it is commanded, and a READ, which it answers.
///
/// ```
/// use axlewire::ikeya::master::Schedule;
///
/// let plan = Schedule::new(8);
/// assert_eq!(plan.exchange_time().as_micros(), 160 + 80 + 50 + 160);
/// assert_eq!(plan.cycle_time().as_micros(), 3600);
/// assert_eq!(plan.cycles_per_second(), 277);
/// ```
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub struct Schedule {
    /// Number of nodes on the bus.
    pub nodes: u8,
    /// Whether the nodes get a WRITE in each cycle, or are only read.
    pub writes: bool,
    /// Speed of the line, bit/s.
    pub baud: u32,
    /// Time from the end of a request to the start of its answer.
    pub response_time: Duration,
    /// Silence after each packet of the master and after each answer.
    pub turnaround_gap: Duration,
}

impl Schedule {
    /// A plan for nodes that are commanded and read at 500 kbit/s and answer after 50 µs (ruling
    /// I9).
    #[must_use]
    pub const fn new(nodes: u8) -> Self {
        Self {
            nodes,
            writes: true,
            baud: BAUD,
            response_time: Duration::from_micros(50),
            turnaround_gap: Duration::ZERO,
        }
    }

    /// Time that one node takes in a cycle.
    #[must_use]
    pub fn exchange_time(&self) -> Duration {
        self.exchange_time_of::<OneMotor>()
    }

    /// Time that one node of this kind of board takes in a cycle.
    #[must_use]
    pub fn exchange_time_of<B: Board>(&self) -> Duration {
        let packet = wire_time(<B::ToMaster as Framing>::MAX_LEN, self.baud);
        let read = wire_time(ReadRequest::LEN, self.baud);
        let asked = match (self.writes, B::ANSWERS_WRITE) {
            (true, true) => packet,
            (true, false) => packet + self.turnaround_gap + read,
            (false, _) => read,
        };
        asked + self.response_time + packet + self.turnaround_gap
    }

    /// Time of a whole cycle: from one turn of a node to its next.
    #[must_use]
    pub fn cycle_time(&self) -> Duration {
        self.exchange_time().saturating_mul(self.nodes.into())
    }

    /// Number of visits to each node per second, rounded down; 0 without nodes.
    #[must_use]
    pub fn cycles_per_second(&self) -> u32 {
        1_000_000_u32.checked_div(self.cycle_time().as_micros()).unwrap_or(0)
    }

    /// Share of the time in which the line is in use, percent, rounded down.
    #[must_use]
    pub fn busy_pct(&self) -> u32 {
        let silent = self.response_time
            + self.turnaround_gap.saturating_mul(if self.writes { 2 } else { 1 });
        let all = self.exchange_time().as_micros();
        let talking = u64::from(all.saturating_sub(silent.as_micros()));
        (talking * 100).checked_div(all.into()).unwrap_or(0) as u32
    }
}
