//! A motor on a pseudo-terminal: a thread answers as a slave does, at once, however late the thread
//! runs. So the only limit is the master's.

use std::{
    io::{Read, Write},
    sync::{
        Arc, Mutex,
        atomic::{AtomicBool, Ordering},
    },
    thread::{self, JoinHandle},
    time::{Duration, Instant},
};

use axlewire::{
    endpoint::Endpoint,
    ikeya::{
        Mode, NodeId, Slave, Target,
        master::{MasterConfig, NodeSet},
        slave::{SlaveConfig, SlaveEvent},
    },
    time,
};
use serialport::{SerialPort, TTYPort};

/// Longer than any pause of a busy machine.
pub(crate) const PATIENCE: Duration = Duration::from_secs(20);

/// Node 1 as the only one, with all the time that it may need on a busy machine.
pub(crate) fn patient() -> MasterConfig {
    let mut config = MasterConfig::usb_adapter();
    config.nodes = NodeSet::from(NodeId::N1);
    config.reply_timeout = time::Duration::from_millis(4000);
    config.accepts_early = true;
    config
}

/// The other end of a line, with node 1 on it.
pub(crate) struct Motor {
    pub(crate) path: String,
    speeds: Arc<Mutex<Vec<f32>>>,
    is_over: Arc<AtomicBool>,
    thread: Option<JoinHandle<()>>,
    _held: TTYPort,
}

impl Motor {
    pub(crate) fn new() -> Self {
        let (mut line, held) = TTYPort::pair().unwrap();
        line.set_timeout(Duration::from_millis(5)).unwrap();
        let (speeds, is_over) = (Arc::new(Mutex::new(vec![])), Arc::new(AtomicBool::new(false)));
        let (told, ends) = (Arc::clone(&speeds), Arc::clone(&is_over));
        let thread = thread::spawn(move || {
            let start = Instant::now();
            let now = || time::Instant::from_micros(start.elapsed().as_micros() as u64);
            let mut slave: Slave =
                Slave::new(NodeId::N1, Mode::Velocity, SlaveConfig::usb_adapter(), now());
            let mut buffer = [0; 256];
            while !ends.load(Ordering::Relaxed) {
                let count = line.read(&mut buffer).unwrap_or(0);
                let now = now();
                slave.handle_input(&buffer[..count], now);
                while let Some(answer) = slave.poll_transmit(now) {
                    line.write_all(answer).unwrap();
                }
                while let Some(event) = slave.poll_event() {
                    if let SlaveEvent::Command(Target::Velocity(rps)) = event {
                        told.lock().unwrap().push(rps.get());
                    }
                }
            }
        });
        let path = held.name().unwrap();
        Self { path, speeds, is_over, thread: Some(thread), _held: held }
    }

    /// The commanded speeds, each one once.
    pub(crate) fn speeds(&self) -> Vec<f32> {
        let mut speeds = self.speeds.lock().unwrap().clone();
        speeds.dedup();
        speeds
    }
}

impl Drop for Motor {
    fn drop(&mut self) {
        self.is_over.store(true, Ordering::Relaxed);
        let _ = self.thread.take().unwrap().join();
    }
}

/// What `work` returns, which must be before the end of all patience: a call that never returns
/// fails its test and does not hang it.
pub(crate) fn in_time<T: Send + 'static>(work: impl FnOnce() -> T + Send + 'static) -> T {
    let (done, result) = std::sync::mpsc::channel();
    thread::spawn(move || drop(done.send(work())));
    result.recv_timeout(PATIENCE).expect("it returns")
}

/// Waits until a condition holds.
pub(crate) fn wait_until(is_so: impl Fn() -> bool) {
    let start = Instant::now();
    while !is_so() {
        assert!(start.elapsed() < PATIENCE, "it does not happen");
        thread::sleep(Duration::from_millis(1));
    }
}
