//! The master of a motor bus: finds the nodes, gives each its own command, prints events.
//!
//! A velocity node turns at half a revolution per second times its id; a position node moves by its
//! id in revolutions from where it was found. A node that comes back is commanded again. Text port:
//! one line for each event except measurements, and one line per second and per received byte.

#![no_std]
#![no_main]

use axlewire::{
    drive::{Clock as _, Driver, Rs485},
    ikeya::{
        self, Master, Mode, NodeId, Position, Rps, Status,
        master::{Cause, CommandError, Health, MasterEvent, NodeSet, Polling},
    },
    time::{Duration, Instant},
};
use axlewire_firmware::{
    board::Board, clock::milliseconds, on_panic, serve_usarts, text_line::TextLine,
};

on_panic!();
serve_usarts!();

/// Period at which each node is read and its set-point repeated.
const CYCLE: Duration = Duration::from_millis(10);

/// Interval between lines of counts, and between a discovery without nodes and the next one.
const REPORT: Duration = Duration::from_secs(1);

#[cortex_m_rt::entry]
fn main() -> ! {
    if let Some(board) = Board::take(ikeya::BAUD) {
        run(board);
    }
    loop {
        cortex_m::asm::wfi();
    }
}

fn run(mut board: Board) {
    let mut config = board.configs.master();
    config.polling = Polling::Every(CYCLE);
    let Ok(port) = Rs485::new(board.bus, board.driver_enable);
    let mut report_at = board.clock.now();
    let mut driver = Driver::master(config, port, board.clock);
    let (mut program, mut exchanges) = (Program::default(), 0u32);
    let now = driver.now();
    driver.role_mut().discover(now);
    loop {
        // Neither the port nor the pin can fail.
        if let Ok(Some(event)) = driver.next_event(report_at - driver.now()) {
            if let MasterEvent::Status { .. } = event {
                exchanges = exchanges.wrapping_add(1);
            }
            let now = driver.now();
            program.react(driver.role_mut(), event, now);
            let mut line = TextLine::new("event");
            if describe(&mut line, event) {
                board.text.try_send(line.end());
            }
        }
        let asked = board.text.poll_byte().is_some();
        let now = driver.now();
        if asked || now >= report_at {
            let master = driver.role_mut();
            let mut line = TextLine::new("master");
            report(&mut line, master, exchanges);
            line.count("stack", board.stack.used()).count("ms", milliseconds(now));
            board.text.try_send(line.end());
            if !asked {
                report_at = now + REPORT;
                if !master.is_discovering()
                    && NodeId::ALL.iter().all(|&id| master.mode(id).is_none())
                {
                    master.discover(now);
                }
            }
        }
    }
}

/// State of the example program.
#[derive(Default)]
struct Program {
    /// Nodes whose command the master has dropped: a board that returns after an unknown time must
    /// not move by itself, and is stopped first.
    dropped: NodeSet,
}

impl Program {
    /// Commands a node when it is found, or when it is back from abnormal and stopped.
    fn react(&mut self, master: &mut Master, event: MasterEvent, now: Instant) {
        let (node, is_new) = match event {
            MasterEvent::Discovered { node, .. } | MasterEvent::ModeChanged { node, .. } => {
                (node, true)
            }
            MasterEvent::Health { node, health: Health::Abnormal } => {
                self.dropped.insert(node);
                return;
            }
            MasterEvent::Stopped { node } => (node, self.dropped.contains(node)),
            _ => return,
        };
        if is_new {
            self.dropped.remove(node);
            // Refused only if the node is gone again; it will be commanded when it returns.
            let _ = command(master, node, now);
        }
    }
}

fn command(master: &mut Master, node: NodeId, now: Instant) -> Result<(), CommandError> {
    let id = node.get();
    match (master.mode(node), master.status(node)) {
        (Some(Mode::Velocity), _) => {
            let half_turns = Rps::new(f32::from(id) * 0.5).unwrap_or(Rps::ZERO);
            master.set_velocity(node, half_turns, now)
        }
        (Some(Mode::Position), Some((Status::Position(at), _))) => {
            let way = i32::from(id) * Position::COUNTS_PER_REVOLUTION;
            let goal = Position::from_counts(at.counts().saturating_add(way)).unwrap_or(at);
            master.set_position(node, goal, now)
        }
        _ => Ok(()),
    }
}

/// Describes an event; `false` for measurements, which come a hundred times a second.
fn describe(line: &mut TextLine, event: MasterEvent) -> bool {
    let (what, node, how) = match event {
        MasterEvent::Discovered { node, mode } => ("discovered", node, name_of(mode)),
        MasterEvent::Health { node, health } => {
            let health = match health {
                Health::Online => "online",
                Health::Suspect(_) => "suspect",
                Health::Abnormal => "abnormal",
            };
            ("health", node, health)
        }
        MasterEvent::ModeChanged { node, mode } => ("mode", node, name_of(mode)),
        MasterEvent::Stopped { node } => ("stopped", node, "twice"),
        MasterEvent::StopBlocked { node } => ("blocked", node, "stop"),
        MasterEvent::ReadFailed { node, cause } => {
            let cause = match cause {
                Cause::Silent => "silent",
                Cause::Damaged => "damaged",
                Cause::Unexpected => "unexpected",
                _ => "unknown",
            };
            ("failed", node, cause)
        }
        MasterEvent::DiscoveryDone { online } => {
            line.word("discovery done").count("online", online.into());
            return true;
        }
        _ => return false,
    };
    line.word(what).count("node", node.get().into()).word(how);
    true
}

const fn name_of(mode: Mode) -> &'static str {
    match mode {
        Mode::Velocity => "velocity",
        Mode::Position => "position",
    }
}

/// Measurements of every node, and the counts.
fn report(line: &mut TextLine, master: &Master, exchanges: u32) {
    line.master(master, exchanges).bus_losses();
    for node in NodeId::ALL {
        if let Some((status, _)) = master.status(node) {
            line.count("node", node.get().into());
            match status {
                Status::Velocity(rps) => line.thousandths("mrps", rps),
                Status::Position(at) => line.number("counts", at.counts()),
            };
        }
    }
}
