//! The application of a master: its orders, and what it makes of the events.

use axlewire::ikeya::{Rps, master::MasterEvent};

use super::*;

impl Bus {
    /// Now and then another order. Nodes that a new master has not found are looked for again: it
    /// searches only for those that have answered once.
    pub(crate) fn command(&mut self) {
        let now = self.line.now();
        let is_unknown = |node: &NodeId| self.master().mode(*node).is_none();
        if NodeId::ALL.iter().any(is_unknown) && !self.master().is_discovering() {
            self.line.head_mut().role.discover(now);
        }
        if self.rng.below(self.plan.orders_every) != 0 {
            return;
        }
        let index = self.rng.below(NODES as u64) as usize;
        let node = NodeId::ALL[index];
        let Some(mode) = self.master().mode(node) else { return };
        let elapsed = self.line.elapsed();
        let part = self.rng.below(2001) as f32 / 1000.0 - 1.0;
        let target = match mode {
            Mode::Velocity => Target::Velocity(Rps::new(10.0 * part).unwrap()),
            Mode::Position => {
                Target::Position(Position::from_revolutions(f64::from(part) * 50.0).unwrap())
            }
        };
        let stops = self.rng.below(4) == 0;
        let (head, mut accepted) = (&mut self.line.head_mut().role, true);
        if stops {
            head.stop(node, now);
        } else {
            accepted = match target {
                Target::Velocity(rps) => head.set_velocity(node, rps, now).is_ok(),
                Target::Position(at) => head.set_position(node, at, now).is_ok(),
            };
        }
        if accepted {
            self.orders[index] = if stops { Order::Stop } else { Order::Move(target) };
            self.ordered_us[index] = elapsed;
            if let (false, Target::Velocity(rps)) = (stops, target) {
                self.given[index].insert(rps.get().to_bits());
            }
            self.account.orders[usize::from(stops)] += 1;
        } else {
            self.account.refused += 1;
        }
    }

    /// What the application makes of the events: a node that was lost stays stopped.
    pub(crate) fn react(&mut self) {
        let elapsed = self.line.elapsed();
        for (at, event) in self.line.take_head_events() {
            match event {
                MasterEvent::Status { .. } => self.account.answers += 1,
                MasterEvent::ReadFailed { .. } => self.account.failed_reads += 1,
                MasterEvent::Stopped { .. } => self.account.stopped += 1,
                MasterEvent::StandingStill { .. } => self.account.stood_still += 1,
                MasterEvent::Health { node, health } => {
                    let index = usize::from(node.get() - 1);
                    if health == Health::Abnormal {
                        self.account.lost_nodes += 1;
                        // A node that was under an order is owed a stop.
                        if self.orders[index] != Order::None {
                            self.orders[index] = Order::Stop;
                        }
                        self.ordered_us[index] = elapsed;
                    }
                    if health == Health::Online && self.schedule.is_quiet() {
                        self.account.recover(self.line.since_start(at), self.quiet_us);
                    }
                }
                _ => {}
            }
        }
    }
}
