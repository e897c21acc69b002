//! What the programs do on a board that QEMU cannot show, on this machine: from the files of the
//! firmware that need no hardware.

use axlewire::{ikeya::BAUD, sim::Line, ucp::robot::RobotConfig};

use crate::{config::Configs, names::*, text_line::TextLine};

/// What an emulator may delay a byte by.
const LONG: Duration = Duration::from_millis(100);

#[test]
fn on_a_board_the_roles_keep_their_timeouts_and_a_master_ignores_early_answers() {
    let board = Configs::new(false);
    assert_eq!(board.master(), MasterConfig::direct());
    assert!(!board.master().accepts_early);
    assert_eq!(board.robot(), RobotConfig::direct());
    let mut slave = SlaveConfig::direct();
    slave.watchdog = Some(Duration::from_millis(500));
    slave.answer_within = slave.answer_within.max(slave.idle.saturating_mul(5));
    assert_eq!(board.slave(), slave);
    assert!(slave.idle < LONG && board.master().reply_timeout < LONG);
}

#[test]
fn in_an_emulator_the_roles_wait_100_ms_and_a_master_accepts_early_answers() {
    let emulator = Configs::new(true);
    let mut master = MasterConfig::direct();
    (master.reply_timeout, master.accepts_early) = (LONG, true);
    assert_eq!(emulator.master(), master);
    let mut robot = RobotConfig::direct();
    robot.idle_margin = LONG;
    assert_eq!(emulator.robot(), robot);
    let mut slave = SlaveConfig::direct();
    slave.watchdog = Some(Duration::from_millis(500));
    (slave.idle, slave.answer_within) = (LONG, LONG.saturating_mul(5));
    assert_eq!(emulator.slave(), slave);
}

/// A master whose events nobody takes.
struct Untaken(Master);

impl Endpoint for Untaken {
    type Event = MasterEvent;

    fn handle_input(&mut self, bytes: &[u8], arrived: impl Into<Arrival>) {
        let now = arrived.into().now();
        self.0.handle_input(bytes, now);
    }

    fn handle_timeout(&mut self, now: Instant) {
        self.0.handle_timeout(now);
    }

    fn poll_transmit(&mut self, now: Instant) -> Option<&[u8]> {
        self.0.poll_transmit(now)
    }

    fn poll_event(&mut self) -> Option<MasterEvent> {
        None
    }

    fn poll_timeout(&self) -> Option<Instant> {
        self.0.poll_timeout()
    }
}

#[test]
fn the_line_of_a_master_tells_its_requests_its_exchanges_and_the_events_that_it_lost() {
    let start = Instant::from_micros(0);
    let mut master = Master::new(MasterConfig::direct(), start);
    master.discover(start);
    let mut line = Line::new(BAUD, 1, Untaken(master));
    line.add(MotorNode::new(NodeId::N3, Mode::Velocity));
    line.run_for(Duration::from_millis(100)).unwrap();
    let now = line.now();
    line.head_mut().0.set_velocity(NodeId::N3, Rps::new(1.0).unwrap(), now).unwrap();
    line.run_for(Duration::from_millis(100)).unwrap();

    let master = &line.head().0;
    let (counts, lost) = (master.statistics(), master.lost_events());
    assert!(counts.reads > counts.writes && counts.writes > 0 && lost > 0, "{counts:?} {lost}");
    let mut told = TextLine::new("master");
    let wanted = format!(
        "master reads {} writes {} exchanges 77 lost_events {lost}\r\n",
        counts.reads, counts.writes
    );
    assert_eq!(std::str::from_utf8(told.master(master, 77).end()), Ok(wanted.as_str()));
}
