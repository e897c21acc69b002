//! A master and two slaves, each behind a driver, on one line: the bus of the scenarios.

use std::{cell::RefCell, rc::Rc};

use axlewire::{
    drive::Driver,
    ikeya::{
        Master, Mode, NodeId, Position, Rps, Slave,
        master::{MasterConfig, Polling},
        slave::SlaveConfig,
    },
    time::Instant,
};

use crate::virtual_time::{End, VirtualClock, World};

pub(crate) type Bus = Driver<Master, End, VirtualClock>;
pub(crate) type Node = Rc<RefCell<Driver<Slave, End, VirtualClock>>>;

/// Node 2 is in velocity mode, node 5 in position mode. They run whenever virtual time advances.
pub(crate) struct Story {
    pub(crate) world: World,
    pub(crate) bus: Bus,
    pub(crate) two: Node,
    pub(crate) five: Node,
}

impl Story {
    pub(crate) fn new(config: MasterConfig) -> Self {
        let world = World::default();
        let mut master = End::new(&world, 20);
        let mut node = |id, mode| {
            let mut end = End::new(&world, 20);
            end.outboxes.push(master.inbox.clone());
            master.outboxes.push(end.inbox.clone());
            let slave = Slave::new(id, mode, SlaveConfig::direct(), Instant::from_micros(0));
            Rc::new(RefCell::new(Driver::new(slave, end, VirtualClock(world.clone()))))
        };
        let (two, five) = (node(NodeId::N2, Mode::Velocity), node(NodeId::N5, Mode::Position));
        two.borrow_mut().role_mut().set_velocity(rps(0.5));
        five.borrow_mut().role_mut().set_position(Position::new(7, 1));
        for slave in [two.clone(), five.clone()] {
            world.add(move || {
                let mut slave = slave.borrow_mut();
                if !slave.port().unplugged.get() {
                    slave.service().unwrap();
                } else {
                    slave.port_mut().inbox.borrow_mut().clear();
                }
            });
        }
        let bus = Driver::with(|now| Master::new(config, now), master, VirtualClock(world.clone()));
        Self { world, bus, two, five }
    }

    pub(crate) fn discovered(mut self) -> Self {
        assert_eq!(self.bus.discover().unwrap(), FOUND);
        self
    }

    /// Reads a node once more.
    pub(crate) fn ask(&mut self, node: NodeId) {
        let now = self.bus.now();
        self.bus.role_mut().read(node, now).unwrap();
    }

    /// Lets time pass without calling the master's driver.
    pub(crate) fn pass(&self, micros: u64) {
        (0..micros.div_ceil(20)).for_each(|_| self.world.step(20));
    }
}

pub(crate) const FOUND: [(NodeId, Mode); 2] =
    [(NodeId::N2, Mode::Velocity), (NodeId::N5, Mode::Position)];

pub(crate) fn rps(value: f32) -> Rps {
    Rps::new(value).unwrap()
}

/// Settings of a bus that has no other nodes.
pub(crate) fn only_two_and_five() -> MasterConfig {
    let mut config = MasterConfig::direct();
    config.nodes = [NodeId::N2, NodeId::N5].into_iter().collect();
    config
}

pub(crate) fn manual() -> MasterConfig {
    let mut config = MasterConfig::direct();
    (config.polling, config.attempts) = (Polling::Manual, 1);
    config
}
