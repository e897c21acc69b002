//! A simulated line with motors or a rover on it, in real time.

use axlewire::{
    endpoint::Endpoint,
    ikeya::{Mode, NodeId, Slave, slave::SlaveConfig},
    sim::{Faults, Motor, MotorNode, RoverNode, Wire},
    time::{Duration, Instant},
    ucp::robot::RobotConfig,
};
use serde_json::json;
use wasm_bindgen::prelude::*;

use crate::{session::instant, thrown};

/// Time that bytes take to the other end.
const DELAY: Duration = Duration::from_millis(1);

/// Time of a motor to reach 63 % of a new speed: slow enough to watch.
const TIME_CONSTANT: Duration = Duration::from_millis(250);

/// What is on the line.
enum Device {
    /// And whether each is unplugged.
    Bus(Vec<(MotorNode, bool)>),
    Rover(Box<RoverNode>),
}

/// A line. Unlike a real one, it has no speed: bytes arrive a millisecond later.
#[wasm_bindgen]
pub struct Simulator {
    device: Device,
    there: Wire,
    back: Wire,
    is_unplugged: bool,
}

#[wasm_bindgen]
impl Simulator {
    /// Motors: "1:velocity 2:position" and so on. They keep their last command without a watchdog,
    /// as the protocol says.
    pub fn bus(nodes: &str, seed: u32, now: f64) -> Result<Self, JsError> {
        let node = |text: &str| {
            let (id, mode) = text.split_once(':')?;
            let id = NodeId::new(id.parse().ok()?).ok()?;
            let mode = match mode {
                "velocity" => Mode::Velocity,
                "position" => Mode::Position,
                _ => return None,
            };
            let slave = Slave::new(id, mode, SlaveConfig::usb_adapter(), instant(now));
            let motor = Motor::new().with_time_constant(TIME_CONSTANT);
            Some((MotorNode::from_parts(slave, motor), false))
        };
        let nodes: Option<Vec<_>> = nodes.split_whitespace().map(node).collect();
        let nodes = nodes.ok_or_else(|| thrown("expected nodes as 1:velocity"))?;
        Ok(Self::new(Device::Bus(nodes), seed))
    }

    /// A rover.
    pub fn rover(seed: u32, now: f64) -> Self {
        let rover = RoverNode::new(RobotConfig::default(), instant(now));
        Self::new(Device::Rover(Box::new(rover)), seed)
    }

    fn new(device: Device, seed: u32) -> Self {
        let wire = |seed: u32| {
            let mut faults = Faults::CLEAN;
            faults.delay = DELAY;
            Wire::new(faults, seed.into())
        };
        Self { device, there: wire(seed), back: wire(!seed), is_unplugged: false }
    }

    /// Bytes from the page.
    pub fn write(&mut self, bytes: &[u8], now: f64) {
        if !self.is_unplugged {
            self.there.send(bytes, instant(now));
        }
    }

    /// Bytes to the page. Call it every few milliseconds.
    pub fn read(&mut self, now: f64) -> Vec<u8> {
        let now = instant(now);
        let mut buffer = [0; 4096];
        let len = self.there.receive(&mut buffer, now);
        let bytes = buffer.get(..len).unwrap_or_default();
        match &mut self.device {
            Device::Bus(nodes) => {
                for (node, is_unplugged) in nodes {
                    let heard = if *is_unplugged { &[] } else { bytes };
                    turn(node, heard, now, |frame| {
                        if !*is_unplugged {
                            self.back.send(frame, now);
                        }
                    });
                }
            }
            Device::Rover(rover) => turn(&mut **rover, bytes, now, |frame| {
                self.back.send(frame, now);
            }),
        }
        let len = self.back.receive(&mut buffer, now);
        let bytes = buffer.get(..len).unwrap_or_default();
        if self.is_unplugged { Vec::new() } else { bytes.to_vec() }
    }

    /// Wrong bits, of all: 0 to 0.01.
    pub fn noise(&mut self, bit_errors: f64) {
        let rate = bit_errors.clamp(0.0, 0.01);
        self.there.faults_mut().bit_errors = rate;
        self.back.faults_mut().bit_errors = rate;
    }

    /// Pulls the plug of a node, or puts it back; 0 is that of the whole line.
    pub fn unplug(&mut self, node: u8, is_unplugged: bool) {
        if node == 0 {
            self.is_unplugged = is_unplugged;
        }
        if let Device::Bus(nodes) = &mut self.device {
            let its = nodes.iter_mut().filter(|(it, _)| it.slave().node().get() == node);
            its.for_each(|(_, unplugged)| *unplugged = is_unplugged);
        }
    }

    /// What the motors do, whatever is heard of it.
    pub fn state(&self) -> String {
        match &self.device {
            Device::Bus(nodes) => {
                let node = |(node, is_unplugged): &(MotorNode, bool)| {
                    json!({
                        "id": node.slave().node().get(),
                        "rps": node.motor().velocity().get(),
                        "turns": node.motor().position().revolutions(),
                        "unplugged": is_unplugged,
                    })
                };
                json!({ "nodes": nodes.iter().map(node).collect::<Vec<_>>() })
            }
            Device::Rover(node) => {
                let rover = node.rover();
                json!({ "rover": {
                    "rpm": rover.telemetry().rpm,
                    "heading": rover.heading_deg(),
                    "distance_m": rover.distance_m(),
                }})
            }
        }
        .to_string()
    }
}

/// Lets an endpoint do what is due.
fn turn<E: Endpoint>(it: &mut E, heard: &[u8], now: Instant, mut send: impl FnMut(&[u8])) {
    it.handle_input(heard, now);
    if it.poll_timeout().is_some_and(|at| at <= now) {
        it.handle_timeout(now);
    }
    while it.poll_event().is_some() {}
    while let Some(frame) = it.poll_transmit(now) {
        send(frame);
    }
}
