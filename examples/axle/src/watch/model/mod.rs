//! What is known of a line from its traffic: nodes or a rover, a log, totals. Nothing here knows a
//! terminal or a clock: times come in as microseconds since the start. Its memory is constant.

mod bus;
mod log;
mod rover;
#[cfg(test)]
mod tests;
mod trend;

use axlewire::{
    ikeya::{self, Mode, NodeId, three},
    stream::{Counters, Gap},
    ucp,
};

use crate::{args::Protocol, listing::Shown};
pub(crate) use bus::{Bus, Health, Node, Values};
pub(crate) use log::{Entry, Kind, Log};
pub(crate) use rover::{Link, Rover};
pub(crate) use trend::{PER_SECOND, Rate, Trend};

/// The time over which a rate is measured.
const RATE_PERIOD: u64 = 1_000_000;

/// Everything that the page shows.
#[derive(Clone, Debug)]
pub(crate) struct Model {
    pub(crate) line: OfLine,
    pub(crate) log: Log,
    /// The account of all bytes.
    pub(crate) counters: Counters,
    pub(crate) frames: Rate,
    pub(crate) bytes: Rate,
    /// The latest time that it was told.
    pub(crate) now: u64,
    measured_at: u64,
    /// Counts what has changed, to see whether a new picture is due.
    pub(crate) revision: u64,
}

/// What is on the line.
#[derive(Clone, Debug)]
pub(crate) enum OfLine {
    Bus(Box<Bus>),
    Rover(Box<Rover>),
}

/// A frame that the model understands.
pub(crate) trait Heard: Shown {
    fn tell(&self, model: &mut Model, at: u64);
}

impl Model {
    pub(crate) fn new(protocol: Protocol) -> Self {
        let line = match protocol {
            Protocol::Ucp => OfLine::Rover(Box::default()),
            Protocol::Ikeya => OfLine::Bus(Box::default()),
            Protocol::Ikeya3 => OfLine::Bus(Box::new(Bus::of_three())),
        };
        Self {
            line,
            log: Log::default(),
            counters: Counters::default(),
            frames: Rate::default(),
            bytes: Rate::default(),
            now: 0,
            measured_at: 0,
            revision: 0,
        }
    }

    /// Takes in a frame whose last byte came at this time.
    pub(crate) fn frame(&mut self, frame: &impl Heard, at: u64) {
        self.revision += 1;
        frame.tell(self, at);
    }

    /// The node that bytes of this moment are near, on a bus.
    pub(crate) const fn near(&self) -> Option<NodeId> {
        match &self.line {
            OfLine::Bus(bus) => bus.near(),
            OfLine::Rover(_) => None,
        }
    }

    /// Takes in bytes that belong to no frame, near this node.
    pub(crate) fn gap(&mut self, gap: Gap, node: Option<NodeId>, at: u64) {
        self.revision += 1;
        if let (OfLine::Bus(bus), Some(node)) = (&mut self.line, node) {
            bus.damage(node, gap.len);
        }
        let bytes = if gap.len == 1 { "byte" } else { "bytes" };
        let near = node.map(|node| format!(" near node {node}")).unwrap_or_default();
        let (len, reason, meaning) = (gap.len, gap.reason, gap.reason.meaning());
        let text = format!("{len} {bytes} skipped{near}, {reason}: {meaning}");
        self.log.push(Entry { at, kind: Kind::Gap, node, text });
    }

    /// Takes in something that happened to the tool or the line.
    pub(crate) fn note(&mut self, text: String, at: u64) {
        self.revision += 1;
        self.log.push(Entry { at, kind: Kind::Event, node: None, text });
    }

    /// Takes in the account and the time: rates, trends and what is overdue follow from it. Call it
    /// several times a second.
    pub(crate) fn tick(&mut self, counters: Counters, now: u64) {
        self.now = self.now.max(now);
        self.counters = counters;
        (self.frames.count, self.bytes.count) = (counters.frames, counters.received);
        match &mut self.line {
            OfLine::Bus(bus) => bus.tick(now, &mut self.log),
            OfLine::Rover(rover) => rover.tick(now, &mut self.log),
        }
        let elapsed = now.saturating_sub(self.measured_at);
        if elapsed >= RATE_PERIOD {
            self.measured_at = now;
            self.revision += 1;
            let seconds = elapsed as f64 / 1e6;
            self.frames.measure(seconds);
            self.bytes.measure(seconds);
            match &mut self.line {
                OfLine::Bus(bus) => bus.measure(seconds),
                OfLine::Rover(rover) => rover.measure(seconds),
            }
        }
    }
}

impl Heard for &ucp::Frame {
    fn tell(&self, model: &mut Model, at: u64) {
        if let OfLine::Rover(rover) = &mut model.line {
            rover.frame(self, at, &mut model.log);
        }
    }
}

impl Heard for ikeya::Packet<'_> {
    fn tell(&self, model: &mut Model, at: u64) {
        use ikeya::{Request, Response};
        let OfLine::Bus(bus) = &mut model.line else { return };
        let log = &mut model.log;
        match self {
            Self::Request(Request::Read(read)) => bus.read(read.id(), at, log),
            Self::Request(Request::Write(write)) => {
                let as_rps = Values::new(&[write.as_velocity().into()]);
                let as_turns = Values::new(&[write.as_position().revolutions()]);
                bus.write(write.id(), as_rps, as_turns, at, log);
            }
            Self::Response(Response::Velocity(answer)) => {
                let values = Values::new(&[answer.rps().into()]);
                bus.answer(answer.id(), Mode::Velocity, values, at, log);
            }
            Self::Response(Response::Position(answer)) => {
                let values = Values::new(&[answer.position().revolutions()]);
                bus.answer(answer.id(), Mode::Position, values, at, log);
            }
        }
    }
}

impl Heard for three::Packet<'_> {
    fn tell(&self, model: &mut Model, at: u64) {
        use three::{Request, Response};
        let OfLine::Bus(bus) = &mut model.line else { return };
        let log = &mut model.log;
        match self {
            Self::Request(Request::Read(read)) => bus.read(read.id(), at, log),
            Self::Request(Request::Write(write)) => {
                let as_rps = Values::new(&write.as_velocity().map(f64::from));
                let as_turns = Values::new(&write.as_position().map(|at| at.revolutions()));
                bus.write(write.id(), as_rps, as_turns, at, log);
            }
            Self::Response(Response::Velocity(answer)) => {
                let values = Values::new(&answer.rps().map(f64::from));
                bus.answer(answer.id(), Mode::Velocity, values, at, log);
            }
            Self::Response(Response::Position(answer)) => {
                let values = Values::new(&answer.positions().map(|at| at.revolutions()));
                bus.answer(answer.id(), Mode::Position, values, at, log);
            }
        }
    }
}
