//! What the application and the line do in a session of a bus.

use arbitrary::Arbitrary;
use axlewire::{
    endpoint::Unsent,
    ikeya::{Master, Mode, NodeId, Position, master::NodeSet},
    stream::Echo,
};

use super::{
    super::{ears::Ears, oracle::Rules, way::Damage},
    Session, US, index,
};
use crate::{
    kit::Kit,
    rulings::{Aim, Node},
};

#[derive(Arbitrary, Clone, Copy, Debug)]
pub(super) enum Action {
    Wait {
        units: u16,
    },
    Discover,
    SetVelocity {
        node: u8,
        speed: u8,
    },
    SetPosition {
        node: u8,
        turns: u8,
    },
    Stop {
        node: u8,
    },
    StopAll,
    Release {
        node: u8,
    },
    Read {
        node: u8,
    },
    Confirm {
        node: u8,
    },
    KeepAlive,
    Damage {
        to_master: bool,
        damage: Damage,
    },
    Noise {
        to_master: bool,
        bytes: [u8; 3],
    },
    Plug {
        node: u8,
        is_in: bool,
    },
    ResetSlave {
        node: u8,
    },
    ResetMaster,
    Switch {
        node: u8,
    },
    /// The port fails with the next packet, after this many bytes.
    Fail {
        unsent: u8,
        cut: u8,
    },
    /// The master's driver is not called for a while.
    HoldUp {
        units: u16,
    },
}

impl<B: Kit> Session<B> {
    pub(super) fn perform(&mut self, action: Action) -> u8 {
        let now = self.now;
        self.fruitful += 1;
        let id = |node: u8| NodeId::ALL[usize::from(node % 8)];
        let tail = |node: u8| usize::from(node) % self.stations.len();
        match action {
            Action::Wait { units } => {
                let span = US(u32::from(units)).min(self.budget);
                self.budget = US(self.budget.as_micros() - span.as_micros());
                self.run_for(span);
                0
            }
            Action::Discover => {
                self.master.discover(now);
                1
            }
            Action::SetVelocity { node, speed } => {
                let id = self.stations[tail(node)].id;
                self.aim(id, Aim::Rps(1.0 + f32::from(speed)));
                2
            }
            Action::SetPosition { node, turns } => {
                let id = self.stations[tail(node)].id;
                self.aim(id, Aim::Place((5, 100 + i16::from(turns))));
                3
            }
            Action::Stop { node } => {
                self.stop(id(node).into());
                4
            }
            Action::StopAll => {
                self.stop_all();
                5
            }
            Action::Release { node } => {
                self.master.release(id(node));
                self.model[index(id(node))].release();
                6
            }
            Action::Read { node } => {
                // Refused while the node is not online.
                let _ = self.master.read(id(node), now);
                7
            }
            Action::Confirm { node } => {
                let _ = self.master.confirm(id(node), now);
                8
            }
            Action::KeepAlive => {
                self.alive(|it| it.master.keep_alive(now));
                9
            }
            Action::Damage { to_master, damage } => {
                let way = if to_master { &mut self.to_master } else { &mut self.to_slaves };
                way.damage(damage);
                10
            }
            Action::Noise { to_master, bytes } => {
                let way = if to_master { &mut self.to_master } else { &mut self.to_slaves };
                way.noise(&bytes, now);
                11
            }
            Action::Plug { node, is_in } => {
                let tail = tail(node);
                self.stations[tail].is_plugged = is_in;
                12
            }
            Action::ResetSlave { node } => {
                let tail = tail(node);
                self.stations[tail].reset(now);
                13
            }
            Action::ResetMaster => {
                self.reset_master();
                14
            }
            Action::Switch { node } => {
                let tail = tail(node);
                let slave = &mut self.stations[tail].slave;
                slave.set_mode(match slave.mode() {
                    Mode::Velocity => Mode::Position,
                    Mode::Position => Mode::Velocity,
                });
                15
            }
            Action::Fail { unsent, cut } => {
                let unsent =
                    [Unsent::Untouched, Unsent::CutOff, Unsent::Unflushed][usize::from(unsent % 3)];
                self.fail = Some((unsent, usize::from(cut)));
                16
            }
            Action::HoldUp { units } => {
                self.asleep_until = now + US(u32::from(units) * 4);
                17
            }
        }
    }

    pub(super) fn stop(&mut self, nodes: NodeSet) {
        let now = self.now;
        self.alive(|it| {
            for id in nodes.iter() {
                it.master.stop(id, now);
                it.model[index(id)].stop(now);
            }
        });
    }

    pub(super) fn stop_all(&mut self) {
        let now = self.now;
        self.alive(|it| {
            it.master.stop_all(now);
            for (node, id) in it.model.iter_mut().zip(NodeId::ALL) {
                if it.config.nodes.contains(id) || it.master.health(id).is_some() {
                    node.stop(now);
                }
            }
        });
    }

    /// A sign of life, which must not revive outdated orders.
    pub(super) fn alive(&mut self, call: impl FnOnce(&mut Self)) {
        let expired = self.dead_man.expire(&mut self.model, self.now);
        call(self);
        self.dead_man.alive_at = self.now;
        let owed = self.master.stops_owed();
        assert!(expired.iter().all(|id| owed.contains(id)), "an expired dead-man is ignored");
        self.follow();
    }

    /// Returns whether the master has accepted the set-point.
    pub(super) fn aim(&mut self, id: NodeId, aim: Aim) -> bool {
        let accepted = match aim {
            Aim::Rps(rps) => self.master.set_velocity(id, B::speed(rps), self.now),
            Aim::Place((count, rotation)) => {
                let place = B::place(Position::new(count, rotation));
                self.master.set_position(id, place, self.now)
            }
        };
        if accepted.is_ok() {
            self.alive(|it| {
                let judged = it.model[index(id)].accept(aim);
                assert!(judged.is_ok(), "{id}: {judged:?}");
            });
        }
        accepted.is_ok()
    }

    fn reset_master(&mut self) {
        self.master = Master::for_board(self.config, self.now);
        self.model = NodeId::ALL.map(|_| Node::default()).into();
        self.dead_man.alive_at = self.now;
        self.to_master.clear();
        self.to_slaves.clear();
        self.echo = self.echo.take().map(|_| Echo::new());
        self.unheard.clear();
        self.answers.clear();
        self.given = 0;
        let long = if B::ANSWERS_WRITE { 16 } else { 8 };
        self.ears = Ears::new(Rules::Ikeya { to_slave: false, to_master: true, long });
        self.master.discover(self.now);
    }

    /// The faults are over: nothing is damaged, everything is plugged in.
    pub(super) fn heal(&mut self) {
        self.to_master.heal();
        self.to_slaves.heal();
        self.fail = None;
        self.asleep_until = self.now;
        for station in &mut self.stations {
            station.is_plugged = true;
        }
    }

    /// The master's driver is not called any more.
    pub(super) fn kill_master(&mut self) {
        self.asleep_until = self.now + US(u32::MAX);
    }
}
