//! Processor cost of an exchange: a WRITE and a READ with its answer, master and slave together,
//! without a port.

use axlewire::{
    endpoint::Endpoint,
    ikeya::{
        Master, Mode, NodeId, Rps, Slave,
        master::{MasterConfig, MasterEvent},
        slave::SlaveConfig,
    },
    time::{Duration, Instant},
};
use criterion::Throughput;

mod measure;
use measure::{criterion, measure};

const EXCHANGES: u32 = 1000;

/// A bus with one node, and its time.
struct Bus {
    master: Master,
    slave: Slave,
    now: Instant,
}

impl Bus {
    fn new() -> Self {
        let mut bus = Self {
            master: Master::new(MasterConfig::direct(), Instant::from_micros(0)),
            slave: Slave::new(
                NodeId::N1,
                Mode::Velocity,
                SlaveConfig::direct(),
                Instant::from_micros(0),
            ),
            now: Instant::from_micros(0),
        };
        bus.master.discover(bus.now);
        while bus.master.is_discovering() {
            bus.step();
        }
        let target = Rps::new(1.0).expect("finite");
        bus.master.set_velocity(NodeId::N1, target, bus.now).expect("node 1 is online");
        bus
    }

    /// Transfers what is sent, or advances time; returns the number of statuses reported.
    fn step(&mut self) -> u32 {
        while let Some(bytes) = self.master.poll_transmit(self.now) {
            self.slave.handle_input(bytes, self.now);
        }
        if let Some(answer) = self.slave.poll_transmit(self.now) {
            self.now += Duration::from_micros(450);
            self.master.handle_input(answer, self.now);
        } else if let Some(next) = self.master.poll_timeout() {
            self.now = next;
            self.master.handle_timeout(next);
        }
        let mut told = 0;
        while let Some(event) = self.master.poll_event() {
            told += u32::from(matches!(event, MasterEvent::Status { .. }));
        }
        while self.slave.poll_event().is_some() {}
        told
    }

    /// Runs a thousand exchanges, each with WRITE, READ and answer; returns how many WRITEs and
    /// answers the slave counted.
    fn exchanges(&mut self) -> [u32; 2] {
        let before = self.counted();
        let mut told = 0;
        while told < EXCHANGES {
            told += self.step();
        }
        let after = self.counted();
        [after[0] - before[0], after[1] - before[1]]
    }

    /// WRITEs and answers of the slave.
    fn counted(&self) -> [u32; 2] {
        [self.slave.statistics().writes, self.slave.statistics().replies]
    }
}

fn main() {
    let mut criterion = criterion();
    let mut group = criterion.benchmark_group("Ikeya roles");
    group.throughput(Throughput::Elements(EXCHANGES.into()));
    let mut bus = Bus::new();
    let before = bus.counted();
    let name = "WRITE, READ and answer, both ends";
    let runs = measure(&mut group, name, [EXCHANGES; 2], || bus.exchanges());
    let after = bus.counted();
    let counted = [after[0].wrapping_sub(before[0]), after[1].wrapping_sub(before[1])];
    assert_eq!(counted, [runs.wrapping_mul(EXCHANGES); 2], "exchanges that were not made");
    group.finish();
    criterion.final_summary();
}
