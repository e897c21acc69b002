//! Motors of a bus as documented, for the scenarios in this folder.

use axlewire::{
    ikeya::{
        Decoder, Mode, NodeId, Position, PositionResponse, Request, Rps, ToSlave, VelocityResponse,
    },
    stream::Event,
};

/// Counts per turn.
pub(crate) const TURN: f64 = 8192.0;

/// Speed at which a position node moves to its target, rps.
const TOP_RPS: f64 = 20.0;

/// A motor with its node: it follows its last command indefinitely.
pub(crate) struct Motor {
    node: NodeId,
    mode: Mode,
    rps: f32,
    /// Current position, counts.
    counts: f64,
    /// Target of a position node, counts.
    goal: Option<i32>,
    /// Time up to which its motion has been simulated, microseconds.
    moved_us: u64,
    /// Silence after which it drops a partial packet, microseconds.
    pub(crate) idle_us: u64,
    heard_us: u64,
    decoder: Decoder<ToSlave>,
    pub(crate) reads: u32,
    /// The payload of every WRITE, with its time, microseconds.
    pub(crate) writes: Vec<(u64, [u8; 4])>,
}

impl Motor {
    pub(crate) fn new(node: NodeId, mode: Mode) -> Self {
        Self {
            node,
            mode,
            rps: 0.0,
            counts: 0.0,
            goal: None,
            moved_us: 0,
            idle_us: 100,
            heard_us: 0,
            decoder: Decoder::new(),
            reads: 0,
            writes: vec![],
        }
    }

    pub(crate) const fn rps(&self) -> f32 {
        self.rps
    }

    /// Current position, turns.
    pub(crate) fn turns(&self) -> f64 {
        self.counts / TURN
    }

    pub(crate) fn move_on(&mut self, now_us: u64) {
        let seconds = now_us.saturating_sub(self.moved_us) as f64 / 1e6;
        self.moved_us = self.moved_us.max(now_us);
        match (self.mode, self.goal) {
            (Mode::Velocity, _) => self.counts += f64::from(self.rps) * TURN * seconds,
            (Mode::Position, Some(goal)) => {
                let furthest = TOP_RPS * TURN * seconds;
                self.counts += (f64::from(goal) - self.counts).clamp(-furthest, furthest);
            }
            (Mode::Position, None) => {}
        }
    }

    /// Moves the switch: the motor rests until the next WRITE.
    pub(crate) fn switch(&mut self, mode: Mode, now_us: u64) {
        self.move_on(now_us);
        (self.mode, self.rps, self.goal) = (mode, 0.0, None);
    }

    /// Takes in a byte; returns its answer to a READ.
    pub(crate) fn hear(&mut self, byte: u8, now_us: u64) -> Option<Vec<u8>> {
        self.move_on(now_us);
        if now_us - self.heard_us > self.idle_us {
            self.give_up_start();
        }
        self.heard_us = now_us;
        let mut byte = &[byte][..];
        let mut answer = None;
        while let Some(event) = self.decoder.decode(&mut byte) {
            match event {
                Event::Frame(Request::Read(read)) if read.id() == self.node => {
                    self.reads += 1;
                    answer = Some(match self.mode {
                        Mode::Velocity => {
                            let now = Rps::new(self.rps).unwrap();
                            VelocityResponse::new(self.node, now).as_bytes().to_vec()
                        }
                        Mode::Position => {
                            let now = Position::from_counts(self.counts as i32).unwrap();
                            PositionResponse::new(self.node, now).as_bytes().to_vec()
                        }
                    });
                }
                Event::Frame(Request::Write(write)) if write.id() == self.node => {
                    self.writes.push((now_us, write.payload()));
                    match self.mode {
                        Mode::Velocity => self.rps = write.as_velocity(),
                        Mode::Position => self.goal = Some(write.as_position().counts()),
                    }
                }
                _ => {}
            }
        }
        answer
    }

    fn give_up_start(&mut self) {
        while self.decoder.pending() > 0 {
            self.decoder.idle();
            while self.decoder.decode(&mut &[][..]).is_some() {}
        }
    }
}
