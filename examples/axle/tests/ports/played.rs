//! Lines played by the test itself, to record every byte and to answer in ways that no simulation
//! does.

use std::{
    io::{Read, Write},
    sync::{
        Arc, Mutex, MutexGuard,
        atomic::{AtomicBool, Ordering},
    },
    thread::{self, JoinHandle},
    time::Duration,
};

use serialport::{SerialPort, TTYPort};

pub(crate) use super::support::devices::{BusState, Node, Said, confirmable_stops, speeds};
use super::{
    Process,
    support::devices::{BusEar, PlayedRover, RoverState},
    wait_until,
};

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

/// A bus with played nodes; `on_request` is called before a node reacts.
pub(crate) fn bus(
    nodes: &[Node],
    mut on_request: impl FnMut(Said, &mut BusState) + Send + 'static,
) -> PlayedLine<BusState> {
    let mut ear = BusEar::default();
    let state = BusState { nodes: nodes.to_vec(), ..BusState::default() };
    PlayedLine::new(state, move |shared, bytes| {
        ear.hear(&mut shared.lock().unwrap(), bytes, &mut on_request)
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

/// A played rover, built on the robot role.
pub(crate) fn rover(wheels: Option<[i16; 4]>) -> PlayedLine<RoverState> {
    let mut rover = PlayedRover::default();
    let state = RoverState { wheels, ..RoverState::default() };
    PlayedLine::new(state, move |shared, bytes| rover.hear(&mut shared.lock().unwrap(), bytes))
}
