//! Lines played by the test itself, to record every byte and to answer in ways that no simulation
//! does.

use std::{
    io::{Read, Write},
    sync::{
        Arc, Mutex, MutexGuard,
        atomic::{AtomicBool, Ordering},
    },
    thread::{self, JoinHandle},
    time::{Duration, Instant},
};

use axlewire::{
    endpoint::Endpoint,
    ikeya::{
        self, Mode, NodeId, Position, PositionResponse, Request, Rps, ToSlave, VelocityResponse,
    },
    stream::Event,
    time,
    ucp::{self, Message, Robot, Telemetry, robot::RobotConfig},
};
use serialport::{SerialPort, TTYPort};

use super::{Process, wait_until};

/// Longest wait for bytes; reports are due every 20 ms.
const TICK: Duration = Duration::from_millis(5);

/// A pseudo-terminal with a thread that plays the devices on it.
pub(crate) struct PlayedLine<T> {
    pub(crate) path: String,
    shared: Arc<Mutex<T>>,
    done: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
    _held: TTYPort,
}

impl<T: Send + 'static> PlayedLine<T> {
    /// `play` gets the received bytes, possibly none, and returns the answer.
    pub(crate) fn new(
        shared: T,
        mut play: impl FnMut(&Mutex<T>, &[u8]) -> Vec<u8> + Send + 'static,
    ) -> Self {
        let (mut ours, held) = TTYPort::pair().unwrap();
        let shared = Arc::new(Mutex::new(shared));
        let done = Arc::new(AtomicBool::new(false));
        let (theirs, is_done) = (Arc::clone(&shared), Arc::clone(&done));
        ours.set_timeout(TICK).unwrap();
        let thread = thread::spawn(move || {
            let mut buffer = [0; 256];
            while !is_done.load(Ordering::SeqCst) {
                let len = ours.read(&mut buffer).unwrap_or(0);
                let answer = play(&theirs, &buffer[..len]);
                let _ = ours.write_all(&answer);
            }
        });
        Self { path: held.name().unwrap(), shared, done, thread: Some(thread), _held: held }
    }

    pub(crate) fn lock(&self) -> MutexGuard<'_, T> {
        self.shared.lock().unwrap()
    }
}

impl<T> Drop for PlayedLine<T> {
    fn drop(&mut self) {
        self.done.store(true, Ordering::SeqCst);
        let _ = self.thread.take().unwrap().join();
    }
}

/// A line that gives the same answer to all input; it holds all received bytes.
pub(crate) fn parrot(answer: &'static [u8]) -> PlayedLine<Vec<u8>> {
    PlayedLine::new(Vec::new(), |heard, bytes| {
        heard.lock().unwrap().extend(bytes);
        if bytes.is_empty() { Vec::new() } else { answer.to_vec() }
    })
}

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

/// A bus with played nodes; `on_request` is called before a node reacts.
pub(crate) fn bus(
    nodes: &[Node],
    mut on_request: impl FnMut(Said, &mut BusState) + Send + 'static,
) -> PlayedLine<BusState> {
    let mut decoder = ikeya::Decoder::<ToSlave>::new();
    let state = BusState { nodes: nodes.to_vec(), ..BusState::default() };
    PlayedLine::new(state, move |shared, mut bytes| {
        let mut answers = Vec::new();
        while let Some(event) = decoder.decode(&mut bytes) {
            let mut bus = shared.lock().unwrap();
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
            bus.said.push((said, Instant::now()));
            on_request(said, &mut bus);
            for node in &mut bus.nodes {
                match (said, node.mode) {
                    (Said::Write(id, rps, _), Mode::Velocity) if id == node.id && node.follows => {
                        node.rps = rps;
                    }
                    (Said::Write(id, _, to), Mode::Position) if id == node.id && node.follows => {
                        node.counts = to;
                    }
                    (Said::Read(id), _) if id == node.id && !node.is_dumb => {
                        thread::sleep(node.delay);
                        answers.extend(node.answer());
                    }
                    _ => {}
                }
            }
        }
        answers
    })
}

impl PlayedLine<BusState> {
    /// All requests so far.
    pub(crate) fn said(&self) -> Vec<Said> {
        self.lock().said.iter().map(|(said, _)| *said).collect()
    }

    /// Waits for a request.
    pub(crate) fn wait_for(&self, what: Said) {
        wait_until(&format!("{what:?}"), || self.said().contains(&what));
    }

    /// Changes the first node.
    pub(crate) fn change(&self, change: impl FnOnce(&mut Node)) {
        change(&mut self.lock().nodes[0]);
    }
}

/// Starts `spin` on node 1 with 2 rps, and waits until the node has received the command. On a very
/// busy machine the tool may find no node within its 60 ms, and is started again.
pub(crate) fn spin(line: &PlayedLine<BusState>, seconds: f32) -> Process {
    for _ in 0..5 {
        let args = format!("spin --port {} --node 1 --rps 2 --for {seconds}", line.path);
        let spin = Process::start(&args);
        let is_told = || speeds(&line.said()).contains(&2.0);
        wait_until("2 rps", || is_told() || spin.state() == 'Z');
        if is_told() {
            return spin;
        }
    }
    panic!("spin never sends a command");
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
    /// Number of bytes outside frames.
    pub(crate) strays: u64,
    pub(crate) bytes: usize,
    /// Wheel speeds regardless of commands; `None` to follow commands.
    pub(crate) wheels: Option<[i16; 4]>,
    pub(crate) is_dumb: bool,
}

/// A played rover, built on the robot role.
pub(crate) fn rover(wheels: Option<[i16; 4]>) -> PlayedLine<RoverState> {
    let start = Instant::now();
    let now = move || time::Instant::from_micros(start.elapsed().as_micros() as u64);
    let mut robot = Robot::new(RobotConfig::default(), now());
    let mut decoder = ucp::Decoder::new();
    let state = RoverState { wheels, ..RoverState::default() };
    PlayedLine::new(state, move |shared, bytes| {
        let mut rover = shared.lock().unwrap();
        rover.bytes += bytes.len();
        let mut rest = bytes;
        while let Some(event) = decoder.decode(&mut rest) {
            match event {
                Event::Skipped(gap) => rover.strays += gap.len,
                Event::Frame(frame) => {
                    if let Message::MotorControl(command) = frame.message() {
                        rover.commands.push((command.speed(), command.angular()));
                    }
                }
            }
        }
        let now = now();
        robot.handle_input(bytes, now);
        robot.handle_timeout(now);
        while robot.poll_event().is_some() {}
        let command = robot.command(now);
        let (speed, turn) = (command.speed(), command.angular());
        let told = [speed + turn, speed - turn, speed + turn, speed - turn];
        let rpm = rover.wheels.unwrap_or(told);
        robot.set_telemetry(&Telemetry { rpm, ..Telemetry::default() }, now);
        let mut answers = Vec::new();
        while let Some(frame) = robot.poll_transmit(now) {
            answers.extend(frame);
        }
        if rover.is_dumb { Vec::new() } else { answers }
    })
}
