//! A slave, node 1, and everything that can be received on its line.

use axlewire::ikeya::{
    Slave,
    slave::{SlaveConfig, SlaveEvent},
};

use super::{fingerprint::COUNTERS, names::*};

/// READ 1.
const READ: [u8; 4] = [0xAA, 0x01, 0xBE, 0xD0];
/// READ 2.
const FOREIGN_READ: [u8; 4] = [0xAA, 0x02, 0xFE, 0xD1];
/// The beginning of an answer and of a WRITE of node 2, whose payload looks like READ 1.
const ANSWER_FRONT: [u8; 6] = [0x56, 0x02, 0xAA, 0x01, 0xBE, 0xD0];
const WRITE_FRONT: [u8; 6] = [0xBB, 0x02, 0xAA, 0x01, 0xBE, 0xD0];

#[derive(Clone, Copy, Debug, PartialEq)]
enum Hear {
    Read,
    FirstHalfOfRead,
    SecondHalfOfRead,
    /// A READ followed by one more byte, in one piece.
    ReadAndByte,
    DamagedRead,
    Write,
    /// Like a WRITE, but the value is not a number.
    Nan,
    ForeignRead,
    AnswerFront,
    WriteFront,
    Byte,
}

#[derive(Clone, Copy, Debug)]
enum Act {
    Hear(Hear),
    /// The driver runs, and sends what is due, if possible.
    Poll(Option<Unsent>),
    Wait(u32),
    SetMode,
}

/// Wait times: short, past `idle`, up to the end of `answer_within` and past it, past the watchdog.
const WAITS: [u32; 5] = [40, 110, 500, 501, 30_000];

const WATCHDOG: Duration = Duration::from_millis(20);

#[derive(Clone)]
struct SlaveLine<B: Kit> {
    slave: Slave<B>,
    now: Instant,
    config: SlaveConfig,
    mode: Mode,
    /// The last bytes received.
    tail: Vec<u8>,
    heard_at: Instant,
    /// The last bytes received are the first part of another node's packet.
    is_inside: bool,
    /// They were a complete request, with nothing open before it, and may be answered once.
    is_clean: bool,
    is_answered: bool,
    /// The last packet received is a WRITE to a board that answers it.
    is_answered_write: bool,
    command: Option<u8>,
    last_command: u8,
    commanded_at: Instant,
    /// A WRITE that may still be found after damaged bytes.
    is_open: bool,
}

impl<B: Kit> SlaveLine<B> {
    fn new(mode: Mode, two_wire: bool) -> Self {
        let mut config = SlaveConfig::direct();
        (config.two_wire, config.watchdog) = (two_wire, Some(WATCHDOG));
        let now = Instant::from_micros(1_000_000);
        let mut slave = Slave::for_board(NodeId::N1, mode, config, Instant::from_micros(0));
        slave.set_position(B::place(Position::new(1, 1)));
        Self {
            slave,
            now,
            config,
            mode,
            tail: Vec::new(),
            heard_at: now,
            is_inside: false,
            is_clean: false,
            is_answered: false,
            is_answered_write: false,
            command: None,
            last_command: 2,
            commanded_at: now,
            is_open: false,
        }
    }

    fn target(&self, number: u8) -> Target<B> {
        match self.mode {
            Mode::Velocity => Target::Velocity(B::speed(f32::from(number))),
            Mode::Position => Target::Position(B::place(Position::new(0, number.into()))),
        }
    }

    fn write(&self, number: u8) -> Vec<u8> {
        B::write(NodeId::N1, self.target(number))
    }

    /// A position whose bytes are not a number, in every group of four.
    fn nan() -> Vec<u8> {
        B::write(NodeId::N1, Target::Position(B::place(Position::new(0x7FC0, 0x7FC0))))
    }

    fn is_in_step(&self) -> bool {
        let counters = self.slave.counters();
        counters.received == counters.framed + counters.skipped()
    }

    fn hear(&mut self, hear: Hear) {
        let in_step = self.is_in_step();
        let number = 3 - self.last_command;
        let bytes = match hear {
            Hear::Read => READ.to_vec(),
            Hear::FirstHalfOfRead => READ[..2].to_vec(),
            Hear::SecondHalfOfRead => READ[2..].to_vec(),
            Hear::ReadAndByte => [&READ[..], &[0x00]].concat(),
            Hear::DamagedRead => vec![0xAA, 0x01, 0xBF, 0xD0],
            Hear::Write => self.write(number),
            Hear::Nan => Self::nan(),
            Hear::ForeignRead => FOREIGN_READ.to_vec(),
            Hear::AnswerFront => ANSWER_FRONT.to_vec(),
            Hear::WriteFront => WRITE_FRONT.to_vec(),
            Hear::Byte => vec![0x00],
        };
        self.slave.handle_input(&bytes, self.now);
        self.tail.extend_from_slice(&bytes);
        self.tail.drain(..self.tail.len().saturating_sub(16));
        (self.heard_at, self.is_answered) = (self.now, false);
        self.is_inside = in_step
            && (hear == Hear::WriteFront || hear == Hear::AnswerFront && self.config.two_wire);
        let is_request = match hear {
            Hear::Write | Hear::Nan => B::ANSWERS_WRITE,
            other => other == Hear::Read,
        };
        self.is_clean = in_step && is_request;
        self.is_answered_write = is_request && hear != Hear::Read;
        let is_position = hear == Hear::Nan && self.mode == Mode::Position;
        if hear == Hear::Write || is_position {
            if hear == Hear::Write {
                self.last_command = number;
            }
            if in_step {
                self.command = Some(if is_position { 0 } else { number });
                self.commanded_at = self.now;
            } else {
                self.is_open = true;
            }
        }
    }

    /// The slave's last command, as a number; 0 for the position in [`Hear::Nan`].
    fn found(&self) -> Option<u8> {
        let number = |target| {
            if target == self.target(1) { 1 } else { u8::from(target == self.target(2)) * 2 }
        };
        self.slave.command(self.now).map(number)
    }

    fn poll(&mut self, unsent: Option<Unsent>) -> Checked {
        let was = self.slave.command(self.now);
        self.slave.handle_timeout(self.now);
        let is_expired = self.command.is_some() && self.now >= self.commanded_at + WATCHDOG;
        let is_told = self.slave.poll_event() == Some(SlaveEvent::Watchdog);
        if self.is_open {
            // Found after damage, or not: the slave's own view counts.
            (self.command, self.is_open) = (self.found(), !self.is_in_step());
            if self.slave.command(self.now) != was {
                self.commanded_at = self.now;
            }
        } else if is_expired {
            self.command = None;
            broken_if!(!is_told, "the watchdog did not fire");
        } else if is_told {
            return Err("the watchdog fired too early".into());
        }
        let until = self.heard_at + self.config.turnaround_gap + self.config.answer_within;
        let is_last = self.tail.ends_with(&READ) || self.is_answered_write;
        let is_due = self.is_clean && !self.is_answered && self.now <= until;
        let Some(_) = self.slave.poll_transmit(self.now) else {
            broken_if!(is_due, "a READ was not answered");
            return check_sleep(&self.slave, self.now);
        };
        broken_if!(!is_last, "an answer, but the last packet received is not a request for it");
        broken_if!(self.is_inside, "an answer to what is inside another node's packet");
        broken_if!(self.is_answered || self.now > until, "a second answer, or a late one");
        if let Some(unsent) = unsent {
            self.slave.handle_transmit(unsent, self.now);
        }
        self.is_answered = unsent != Some(Unsent::Untouched);
        Ok(())
    }

    fn check_command(&self) -> Checked {
        let command = self.command.filter(|_| self.now < self.commanded_at + WATCHDOG);
        match self.found() {
            found if self.is_open || found == command => Ok(()),
            found => Err(format!("the command is {found:?} instead of {command:?}")),
        }
    }
}

impl<B: Kit> World for SlaveLine<B> {
    type Action = Act;

    fn actions(&self) -> Vec<Act> {
        use Hear as H;
        let mut actions: Vec<_> = WAITS.into_iter().map(Act::Wait).collect();
        actions.extend([H::Read, H::FirstHalfOfRead, H::SecondHalfOfRead].map(Act::Hear));
        actions.extend([H::ReadAndByte, H::DamagedRead, H::Write, H::Nan].map(Act::Hear));
        actions.extend([H::ForeignRead, H::AnswerFront, H::WriteFront, H::Byte].map(Act::Hear));
        actions.extend([None, Some(Unsent::Untouched), Some(Unsent::CutOff)].map(Act::Poll));
        actions.push(Act::SetMode);
        actions
    }

    fn step(&mut self, act: Act) -> Checked {
        match act {
            Act::Hear(hear) => self.hear(hear),
            Act::Poll(unsent) => self.poll(unsent)?,
            Act::Wait(micros) => {
                self.now += Duration::from_micros(micros);
                // After a silence the slave searches its buffer again.
                self.is_inside &= self.now < self.heard_at + self.config.idle;
            }
            Act::SetMode => {
                self.mode = match self.mode {
                    Mode::Velocity => Mode::Position,
                    Mode::Position => Mode::Velocity,
                };
                self.slave.set_mode(self.mode);
                self.slave.set_velocity(B::speed(0.0));
                self.slave.set_position(B::place(Position::new(1, 1)));
                self.command = None;
            }
        }
        self.check_command()
    }

    fn fingerprint(&self) -> u64 {
        let state = (self.mode, &self.tail, self.heard_at, self.is_inside, self.is_clean);
        let orders = (
            self.is_answered,
            self.is_answered_write,
            self.command,
            self.last_command,
            self.is_open,
        );
        let commanded_at = self.command.map(|_| self.commanded_at);
        let all = (&self.slave, state, orders, commanded_at);
        Merge { now: self.now, skipped: COUNTERS }.fingerprint(&all)
    }
}

/// On four wires and on two, in both modes.
pub(crate) fn lines<B: Kit>(run: &mut Run) {
    run.world("four wires, velocity", Depth(3, 4), SlaveLine::<B>::new(Mode::Velocity, false));
    run.world("two wires, velocity", Depth(3, 4), SlaveLine::<B>::new(Mode::Velocity, true));
    run.world("two wires, position", Depth(3, 4), SlaveLine::<B>::new(Mode::Position, true));
}
