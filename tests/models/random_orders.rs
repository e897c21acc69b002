//! The orders that the application of a random master gives.

use axlewire::ikeya::{NodeId, Position};

use super::{Episode, index};
use crate::{kit::Kit, rulings::Aim};

impl<B: Kit> Episode<B> {
    /// The application occasionally gives an order.
    pub(super) fn order(&mut self) -> Result<(), String> {
        if self.is_well || !self.rng.chance(0.12) {
            return Ok(());
        }
        let (node, now) = (self.any_node(), self.now);
        let id = NodeId::ALL[node];
        let choice = self.rng.below(15);
        self.tell(|| format!("order {choice} of {id}"));
        match choice {
            0 | 1 => self.alive(|it| {
                it.master.stop(id, now);
                it.nodes[node].stop(now);
                Ok(())
            }),
            2 => self.alive(|it| {
                it.master.stop_all(now);
                it.nodes.iter_mut().for_each(|node| node.stop(now));
                Ok(())
            }),
            3 => self.alive(|it| {
                it.master.keep_alive(now);
                Ok(())
            }),
            4..=8 => {
                let rps = 1.0 + self.rng.below(1000) as f32;
                self.aim(id, Aim::Rps(rps))
            }
            9 | 10 => {
                let rotation = 100 + self.rng.below(1000) as i16;
                self.aim(id, Aim::Place((5, rotation)))
            }
            11 => {
                self.master.release(id);
                self.nodes[node].release();
                Ok(())
            }
            12 => {
                let _ = self.master.confirm(id, now);
                Ok(())
            }
            13 => {
                let _ = self.master.read(id, now);
                Ok(())
            }
            _ => {
                self.master.discover(now);
                Ok(())
            }
        }?;
        self.follow()
    }

    /// A sign of life, which must not revive outdated orders.
    fn alive(&mut self, call: impl FnOnce(&mut Self) -> Result<(), String>) -> Result<(), String> {
        let expired = self.dead_man.expire(&mut self.nodes, self.now);
        call(self)?;
        self.dead_man.alive_at = self.now;
        let owed = self.master.stops_owed();
        match expired.iter().all(|id| owed.contains(id)) {
            true => Ok(()),
            false => Err(format!("an expired dead-man is ignored: {expired:?}, owed {owed:?}")),
        }
    }

    fn aim(&mut self, id: NodeId, aim: Aim) -> Result<(), String> {
        let accepted = match aim {
            Aim::Rps(rps) => self.master.set_velocity(id, B::speed(rps), self.now),
            Aim::Place((count, rotation)) => {
                let place = B::place(Position::new(count, rotation));
                self.master.set_position(id, place, self.now)
            }
        };
        match accepted {
            Ok(()) => self.alive(|it| it.nodes[index(id)].accept(aim)),
            Err(_) => Ok(()),
        }
    }
}
