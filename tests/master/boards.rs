//! Boards with three motors, which answer every request, and their master.

use axlewire::ikeya::three::{PositionResponse, VelocityResponse};

use crate::rig::*;

pub(crate) const T0: Instant = Instant::from_micros(5_000);

pub(crate) struct Boards {
    pub(crate) master: Master<ThreeMotors>,
    pub(crate) now: Instant,
    modes: [Mode; 8],
    pub(crate) speeds: [f32; 3],
    /// Position of each motor, counts, and how much further it is at each answer.
    pub(crate) counts: i32,
    pub(crate) moves: i32,
    /// Time from a request to its answer.
    pub(crate) answer_us: u32,
    /// This board has lost power.
    pub(crate) dead: Option<NodeId>,
    pub(crate) events: Vec<MasterEvent<ThreeMotors>>,
}

impl Boards {
    /// The master has discovered them.
    pub(crate) fn new(config: MasterConfig, modes: [Mode; 8], answer_us: u32) -> Self {
        let mut boards = Self {
            master: Master::for_board(config, T0),
            now: T0,
            modes,
            speeds: [0.0; 3],
            counts: turns(7).counts(),
            moves: 0,
            answer_us,
            dead: None,
            events: vec![],
        };
        boards.master.discover(T0);
        while boards.master.is_discovering() {
            boards.exchange();
        }
        boards.events.clear();
        boards
    }

    pub(crate) fn mode(&self, node: NodeId) -> Mode {
        self.modes[usize::from(node.get()) - 1]
    }

    /// The next packet, already answered; `None` if there is nothing to do.
    pub(crate) fn exchange(&mut self) -> Option<Vec<u8>> {
        self.exchange_during(|_| ())
    }

    /// The same, with these calls before every look at the master.
    pub(crate) fn exchange_during(&mut self, mut calls: impl FnMut(&mut Self)) -> Option<Vec<u8>> {
        loop {
            calls(self);
            if let Some(packet) = self.master.poll_transmit(self.now).map(<[u8]>::to_vec) {
                let node = NodeId::new(packet[1]).unwrap();
                match self.dead == Some(node) {
                    true => self.expire()?,
                    false => self.answer(node),
                }
                return Some(packet);
            }
            self.expire()?;
        }
    }

    fn expire(&mut self) -> Option<()> {
        let next = self.master.poll_timeout()?;
        assert!(next > self.now, "a busy loop at {next:?}");
        self.now = next;
        self.master.handle_timeout(next);
        Some(())
    }

    fn answer(&mut self, node: NodeId) {
        let answer = match self.mode(node) {
            Mode::Velocity => VelocityResponse::new(node, self.speeds.map(rps)).as_bytes().to_vec(),
            Mode::Position => {
                self.counts += self.moves;
                let place = Position::from_counts(self.counts).unwrap();
                PositionResponse::new(node, [place; 3]).as_bytes().to_vec()
            }
        };
        self.now += US(self.answer_us);
        self.master.handle_input(&answer, self.now);
        self.events.extend(core::iter::from_fn(|| self.master.poll_event()));
    }
}
