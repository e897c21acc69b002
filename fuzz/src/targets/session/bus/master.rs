//! The master of a session, as its driver serves it, against the model.

use axlewire::{
    endpoint::{Endpoint, Unsent},
    ikeya::{
        Mode, NodeId,
        master::{Health, MasterEvent, StopProgress},
    },
    stream::Echo,
};

use super::{super::ears::Found, Session, index};
use crate::{
    kit::{Kit, Sent},
    rulings::{Node, Seen},
};

impl<B: Kit> Session<B> {
    pub(super) fn serve_master(&mut self) {
        while let Some(piece) = self.to_master.arrived(self.now) {
            self.fruitful += 1;
            for found in self.ears.take(&piece.bytes) {
                match found {
                    Found::Sent(number) => self.unheard.push(self.answers[number as usize]),
                    Found::Phantom => return self.is_over = true,
                }
            }
            let bytes: Vec<u8> = piece.bytes.iter().map(|carried| carried.byte).collect();
            self.hear(&bytes);
            if self.is_over {
                return;
            }
        }
        self.check_account();
        if self.master.poll_timeout().is_some_and(|at| self.now >= at) {
            self.master.handle_timeout(self.now);
            self.follow();
        }
        while let Some(event) = self.master.poll_event() {
            self.fruitful += 1;
            if let MasterEvent::Status { node, .. } = event {
                assert!(self.stations.iter().any(|it| it.id == node), "an answer of nobody");
            }
        }
        let is_port_fine = self.send();
        let rest = self.master.poll_timeout();
        // What a port did not take may be due again at once.
        let is_idle = rest.is_none_or(|at| at > self.now);
        assert!(is_idle || !is_port_fine, "a busy loop of the master");
        let is_owed = !self.master.stops_owed().is_empty();
        assert!(!is_owed || rest.is_some(), "no deadline while stops are owed");
    }

    /// Hands bytes to the master; it takes only answers that were sent.
    fn hear(&mut self, bytes: &[u8]) {
        self.given += bytes.len() as u64;
        let bytes = match &mut self.echo {
            Some(echo) => echo.strip(bytes),
            None => bytes,
        };
        let is_still = |it: &Self, id| it.master.stop_progress(id) == StopProgress::StandingStill;
        let were_still = NodeId::ALL.map(|id| is_still(self, id));
        let before = self.master.counters().frames;
        self.master.handle_input(bytes, self.now);
        let counters = self.master.counters();
        let taken = (counters.frames - before) as usize;
        assert!(taken <= self.unheard.len(), "a frame that was never sent");
        if taken > 0 && taken < self.unheard.len() {
            // Which of them is not known.
            return self.is_over = true;
        }
        if taken > 0 {
            for (reply, number) in self.unheard.drain(..) {
                self.model[index(reply.node)].hear(reply.mode, reply.place, number, self.now);
            }
        }
        if counters.framed + counters.skipped() == counters.received {
            self.unheard.clear();
        }
        self.follow();
        for station in &self.stations {
            let is_news = is_still(self, station.id) && !were_still[index(station.id)];
            let is_turning = station.slave.mode() == Mode::Velocity;
            let is_stopped = station.is_stopped(None, self.now);
            assert!(!is_news || !is_turning || is_stopped, "still, but it obeys a set-point");
        }
    }

    pub(super) fn follow(&mut self) {
        let (owed, coasting) = (self.master.stops_owed(), self.master.coasting());
        for (node, id) in self.model.iter_mut().zip(NodeId::ALL) {
            let seen = Seen {
                mode: self.master.mode(id),
                is_owed: owed.contains(id),
                is_coasting: coasting.contains(id),
                is_in_doubt: self.master.is_mode_in_doubt(id),
                is_abnormal: self.master.health(id) == Some(Health::Abnormal),
            };
            let judged = node.follow(seen, self.now);
            assert!(judged.is_ok(), "{id}: {judged:?}");
        }
    }

    /// Sends what is due; returns whether the port took it.
    fn send(&mut self) -> bool {
        for count in 0.. {
            assert!(count < 20, "it never stops sending");
            let packet = self.master.poll_transmit(self.now).map(<[u8]>::to_vec);
            self.follow();
            let Some(packet) = packet else { return true };
            self.fruitful += 1;
            // Bytes from before a request are dropped.
            self.unheard.clear();
            if !self.send_packet(packet) {
                return false;
            }
        }
        true
    }

    /// Returns whether the port took it.
    fn send_packet(&mut self, packet: Vec<u8>) -> bool {
        let sent = Sent::read::<B>(&packet);
        self.dead_man.expire(&mut self.model, self.now);
        let node = &mut self.model[index(sent.node)];
        if let Some(write) = &sent.write {
            let judged = node.judge(write, B::ANSWERS_WRITE, self.now);
            assert!(judged.is_ok(), "{}: {judged:?} for {packet:02x?}", sent.node);
        }
        let (number, fail) = (self.frames.len() as u64, self.fail.take());
        self.frames.push(packet.clone());
        match fail {
            Some((Unsent::Untouched, _)) => {
                self.master.handle_transmit(Unsent::Untouched, self.now);
                return false;
            }
            Some((Unsent::CutOff, cut)) => {
                let cut = 1 + cut % (packet.len() - 1);
                self.to_slaves.send(&packet[..cut], number, self.now);
                self.echo(&packet[..cut]);
                self.echo.iter_mut().for_each(Echo::forget);
                self.master.handle_transmit(Unsent::CutOff, self.now);
                return false;
            }
            _ => {}
        }
        if let Some(write) = &sent.write {
            node.sent(write, number);
        }
        self.to_slaves.send(&packet, number, self.now);
        self.echo(&packet);
        if fail.is_some() {
            self.master.handle_transmit(Unsent::Unflushed, self.now);
            self.model.iter_mut().for_each(Node::unflushed);
            return false;
        }
        true
    }

    /// An adapter may hear its own bytes.
    fn echo(&mut self, bytes: &[u8]) {
        if let Some(echo) = &mut self.echo {
            echo.sent(bytes);
            self.to_master.noise(bytes, self.now);
        }
    }

    fn check_account(&self) {
        let (counters, echo) = (self.master.counters(), self.echo.as_ref().map_or(0, Echo::bytes));
        assert_eq!(counters.received + u64::from(echo), self.given);
        let open = counters.received - counters.framed - counters.skipped();
        assert!(open < 16, "{open} bytes are nowhere");
    }
}
