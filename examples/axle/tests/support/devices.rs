//! Devices that a test plays, which answer in ways that no simulation does, and all that they hear.

use std::time::{Duration, Instant};

use axlewire::{
    endpoint::Endpoint,
    ikeya::{
        self, Mode, NodeId, Position, PositionResponse, Request, Rps, ToSlave, VelocityResponse,
    },
    stream::Event,
    time,
    ucp::{self, Message, Robot, Telemetry, robot::RobotConfig},
};

use super::clock;

/// A request from the tool.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Said {
    Read(u8),
    /// As a speed and as a position, because the bytes do not distinguish them.
    Write(u8, f32, i32),
}

/// A played node.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Node {
    pub(crate) id: u8,
    pub(crate) mode: Mode,
    pub(crate) rps: f32,
    pub(crate) counts: i32,
    /// Whether it obeys commands.
    pub(crate) follows: bool,
    pub(crate) is_dumb: bool,
    /// Response time.
    pub(crate) delay: Duration,
}

impl Node {
    pub(crate) fn velocity(id: u8) -> Self {
        let mode = Mode::Velocity;
        let delay = Duration::ZERO;
        Self { id, mode, rps: 0.0, counts: 0, follows: true, is_dumb: false, delay }
    }

    pub(crate) fn position(id: u8, counts: i32) -> Self {
        Self { mode: Mode::Position, counts, ..Self::velocity(id) }
    }

    fn answer(&self) -> Vec<u8> {
        let id = NodeId::new(self.id).unwrap();
        match self.mode {
            Mode::Velocity => {
                VelocityResponse::new(id, Rps::new(self.rps).unwrap()).as_bytes().to_vec()
            }
            Mode::Position => {
                let position = Position::from_counts(self.counts).unwrap();
                PositionResponse::new(id, position).as_bytes().to_vec()
            }
        }
    }
}

/// Traffic on a bus, and the state of its nodes.
#[derive(Debug, Default)]
pub(crate) struct BusState {
    pub(crate) nodes: Vec<Node>,
    pub(crate) said: Vec<(Said, Instant)>,
    /// Number of bytes outside requests.
    pub(crate) strays: u64,
}

/// Finds the requests in what a bus hears.
#[derive(Default)]
pub(crate) struct BusEar(ikeya::Decoder<ToSlave>);

impl BusEar {
    /// Lets the nodes hear these bytes; returns their answers. `on_request` is called before a node
    /// reacts.
    pub(crate) fn hear(
        &mut self,
        bus: &mut BusState,
        mut bytes: &[u8],
        mut on_request: impl FnMut(Said, &mut BusState),
    ) -> Vec<u8> {
        let mut answers = Vec::new();
        while let Some(event) = self.0.decode(&mut bytes) {
            let said = match event {
                Event::Skipped(gap) => {
                    bus.strays += gap.len;
                    continue;
                }
                Event::Frame(Request::Read(read)) => Said::Read(read.id().get()),
                Event::Frame(Request::Write(write)) => {
                    Said::Write(write.id().get(), write.as_velocity(), write.as_position().counts())
                }
            };
            bus.said.push((said, clock::now()));
            on_request(said, bus);
            for node in &mut bus.nodes {
                match (said, node.mode) {
                    (Said::Write(id, rps, _), Mode::Velocity) if id == node.id && node.follows => {
                        node.rps = rps;
                    }
                    (Said::Write(id, _, to), Mode::Position) if id == node.id && node.follows => {
                        node.counts = to;
                    }
                    (Said::Read(id), _) if id == node.id && !node.is_dumb => {
                        clock::sleep(node.delay);
                        answers.extend(node.answer());
                    }
                    _ => {}
                }
            }
        }
        answers
    }
}

/// The speeds commanded to a node.
pub(crate) fn speeds(said: &[Said]) -> Vec<f32> {
    let speed = |said: &Said| match said {
        Said::Write(_, rps, _) => Some(*rps),
        Said::Read(_) => None,
    };
    said.iter().filter_map(speed).collect()
}

/// Number of stops sent to a velocity node and followed by a READ of it.
pub(crate) fn confirmable_stops(said: &[Said], id: u8) -> usize {
    let is_of = |said: &&Said| matches!(said, Said::Read(it) | Said::Write(it, ..) if *it == id);
    let said: Vec<_> = said.iter().filter(is_of).collect();
    let is_stop = |said: &Said| matches!(said, Said::Write(_, 0.0, _));
    said.windows(2).filter(|pair| is_stop(pair[0]) && *pair[1] == Said::Read(id)).count()
}

/// Traffic received by a played rover, and its state.
#[derive(Debug, Default)]
pub(crate) struct RoverState {
    /// Speed and turn of each motor command.
    pub(crate) commands: Vec<(i16, i16)>,
    /// Front lamp of each motor command.
    pub(crate) lamps: Vec<i16>,
    pub(crate) pings: u32,
    /// Number of bytes outside frames.
    pub(crate) strays: u64,
    pub(crate) bytes: usize,
    /// Wheel speeds regardless of commands; `None` to follow commands.
    pub(crate) wheels: Option<[i16; 4]>,
    pub(crate) is_dumb: bool,
}

/// A rover, built on the robot role.
pub(crate) struct PlayedRover {
    start: Instant,
    robot: Robot,
    decoder: ucp::Decoder,
}

impl Default for PlayedRover {
    fn default() -> Self {
        let robot = Robot::new(RobotConfig::default(), time::Instant::from_micros(0));
        Self { start: clock::now(), robot, decoder: ucp::Decoder::new() }
    }
}

impl PlayedRover {
    /// Lets the rover hear these bytes, possibly none; returns what it says.
    pub(crate) fn hear(&mut self, rover: &mut RoverState, bytes: &[u8]) -> Vec<u8> {
        rover.bytes += bytes.len();
        let mut rest = bytes;
        while let Some(event) = self.decoder.decode(&mut rest) {
            match event {
                Event::Skipped(gap) => rover.strays += gap.len,
                Event::Frame(frame) => match frame.message() {
                    Message::MotorControl(command) => {
                        rover.commands.push((command.speed(), command.angular()));
                        rover.lamps.push(command.front_led());
                    }
                    Message::Ping(_) => rover.pings += 1,
                    _ => {}
                },
            }
        }
        let now = time::Instant::from_micros(clock::since(self.start).as_micros() as u64);
        let robot = &mut self.robot;
        robot.handle_input(bytes, now);
        robot.handle_timeout(now);
        while robot.poll_event().is_some() {}
        let command = robot.command(now);
        let (speed, turn) = (command.speed(), command.angular());
        let told = [speed + turn, speed - turn, speed + turn, speed - turn];
        let rpm = rover.wheels.unwrap_or(told);
        let telemetry = Telemetry {
            battery_pct: 87,
            rpm,
            heading_deg: 90,
            voltage_dv: 243,
            current_ca: 156,
            ..Telemetry::default()
        };
        robot.set_telemetry(&telemetry, now);
        let mut answers = Vec::new();
        while let Some(frame) = robot.poll_transmit(now) {
            answers.extend(frame);
        }
        if rover.is_dumb { Vec::new() } else { answers }
    }
}
