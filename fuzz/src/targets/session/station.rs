//! A slave on the line: it obeys what it has heard, for as long as its watchdog allows, and answers
//! once for each request, with a position that no other answer has.

use axlewire::{
    endpoint::Endpoint,
    ikeya::{
        Mode, NodeId, Position, Slave, Target,
        slave::{SlaveConfig, SlaveEvent},
    },
    time::{Duration, Instant},
};

use super::{
    ears::{Ears, Found},
    oracle::Rules,
    way::Piece,
};
use crate::kit::{Kit, Reply, Sent};

pub(super) struct Station<B: Kit> {
    pub(super) id: NodeId,
    pub(super) slave: Slave<B>,
    pub(super) is_plugged: bool,
    config: SlaveConfig,
    ears: Ears,
    given: u64,
    /// The WRITEs heard, and when.
    written: Vec<(Instant, Vec<u8>)>,
    /// The latest request, which an answer is for.
    pub(super) asked: u64,
    requests: u32,
    answers: u32,
    place: Position,
    /// It was turning when it last heard something.
    is_moving: bool,
}

impl<B: Kit> Station<B> {
    pub(super) fn new(id: NodeId, mode: Mode, config: SlaveConfig, now: Instant) -> Self {
        let long = if B::ANSWERS_WRITE { 16 } else { 8 };
        Self {
            id,
            slave: Slave::for_board(id, mode, config, now),
            is_plugged: true,
            config,
            ears: Ears::new(Rules::Ikeya { to_slave: true, to_master: false, long }),
            given: 0,
            written: Vec::new(),
            asked: 0,
            requests: 0,
            answers: 0,
            place: Position::default(),
            is_moving: false,
        }
    }

    /// The same node after a loss of power.
    pub(super) fn reset(&mut self, now: Instant) {
        *self = Self {
            is_plugged: self.is_plugged,
            ..Self::new(self.id, self.slave.mode(), self.config, now)
        };
    }

    /// Hears a piece of the line, in which `frames` were sent; `false` after a phantom.
    pub(super) fn hear(
        &mut self,
        piece: &Piece,
        frames: &[Vec<u8>],
        place: Position,
        now: Instant,
    ) -> bool {
        self.place = place;
        self.is_moving = !self.is_stopped(None, now);
        self.slave.set_velocity(B::speed(3.0 * f32::from(self.is_moving)));
        self.slave.set_position(B::place(place));
        for found in self.ears.take(&piece.bytes) {
            let Found::Sent(number) = found else { return false };
            let frame = &frames[number as usize];
            let sent = Sent::read::<B>(frame);
            if sent.node == self.id {
                self.written.extend(sent.write.map(|_| (now, frame.clone())));
                if sent.is_exchange::<B>() {
                    (self.asked, self.requests) = (number, self.requests + 1);
                }
            }
        }
        let bytes: Vec<u8> = piece.bytes.iter().map(|carried| carried.byte).collect();
        self.given += bytes.len() as u64;
        self.slave.handle_input(&bytes, now);
        self.check(now);
        true
    }

    /// Serves the slave; returns its answer.
    pub(super) fn serve(&mut self, now: Instant) -> Option<(Vec<u8>, Reply)> {
        if self.slave.poll_timeout().is_some_and(|at| now >= at) {
            self.slave.handle_timeout(now);
        }
        while let Some(event) = self.slave.poll_event() {
            if let SlaveEvent::Command(target) = event {
                let write = B::write(self.id, target);
                assert!(self.written.iter().any(|(_, it)| *it == write), "{target:?} unheard");
            }
        }
        let answer = self.slave.poll_transmit(now).map(<[u8]>::to_vec);
        assert!(self.slave.poll_transmit(now).is_none(), "two answers");
        assert!(self.slave.poll_timeout().is_none_or(|at| at > now), "a busy loop of a slave");
        self.check(now);
        let answer = answer?;
        self.answers += 1;
        assert!(self.answers <= self.requests, "an answer without a request");
        let place = (self.place.count(), self.place.rotation());
        let (mode, is_moving) = (self.slave.mode(), self.is_moving);
        let reply = Reply { node: self.id, mode, place, is_moving };
        assert_eq!(answer, reply.bytes::<B>(), "not what was measured");
        Some((answer, reply))
    }

    /// It obeys only what it has heard, and no longer than its watchdog allows. A false header may
    /// hold a command back for as many pauses as a packet has bytes.
    pub(super) fn check(&self, now: Instant) {
        let counters = self.slave.counters();
        assert_eq!(counters.received, self.given);
        assert!(counters.received - counters.framed - counters.skipped() < 16);
        let Some(target) = self.slave.command(now) else { return };
        assert_eq!(target.mode(), self.slave.mode());
        let limit = self.config.watchdog.map_or(Duration::from_micros(u32::MAX), |watchdog| {
            watchdog + self.config.idle.saturating_mul(16)
        });
        let write = B::write(self.id, target);
        let is_recent = |(at, it): &(Instant, Vec<u8>)| now - *at < limit && *it == write;
        assert!(self.written.iter().rev().any(is_recent), "{target:?} is out of date");
    }

    /// Whether it stands still by its orders, as far as `held` says where.
    pub(super) fn is_stopped(&self, held: Option<Target<B>>, now: Instant) -> bool {
        match self.slave.command(now) {
            None => true,
            Some(Target::Velocity(speed)) => speed == B::speed(0.0),
            Some(place) => Some(place) == held,
        }
    }
}
