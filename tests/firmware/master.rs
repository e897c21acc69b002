//! The firmware master against slaves on this machine, and against the firmware slave.

use std::{collections::HashSet, io, os::unix::net::UnixStream, thread};

use axlewire::{
    ikeya::{Slave, ToSlave},
    sim::Motor,
};

use crate::{driver_enable_pin, names::*};

/// Two nodes that receive everything. One of them can be muted and deafened.
pub(crate) struct Nodes {
    pub(crate) nodes: [MotorNode; 2],
    is_mute: bool,
    /// Where the position node reported itself.
    pub(crate) told: HashSet<i32>,
}

impl Nodes {
    pub(crate) fn new() -> Self {
        // As on a USB adapter: bytes arrive when this machine gets to them.
        let node = |id, mode| {
            let slave = Slave::new(id, mode, SlaveConfig::usb_adapter(), Instant::from_micros(0));
            MotorNode::from_parts(slave, Motor::new())
        };
        let nodes = [node(NodeId::N2, Mode::Velocity), node(NodeId::N5, Mode::Position)];
        Self { nodes, is_mute: false, told: HashSet::new() }
    }

    fn alive(&mut self) -> &mut [MotorNode] {
        &mut self.nodes[usize::from(self.is_mute)..]
    }

    fn command(&self, index: usize) -> Option<Target> {
        self.nodes[index].slave().command(Instant::from_micros(0))
    }
}

impl Endpoint for Nodes {
    type Event = SlaveEvent;

    fn handle_input(&mut self, bytes: &[u8], arrived: impl Into<Arrival>) {
        let now = arrived.into().now();
        self.alive().iter_mut().for_each(|node| node.handle_input(bytes, now));
    }

    fn handle_timeout(&mut self, now: Instant) {
        self.alive().iter_mut().for_each(|node| node.handle_timeout(now));
    }

    fn poll_transmit(&mut self, now: Instant) -> Option<&[u8]> {
        let alive = &mut self.nodes[usize::from(self.is_mute)..];
        let answer = alive.iter_mut().find_map(|node| node.poll_transmit(now))?;
        if let Some(Response::Position(at)) = Frames::<ToMaster>::new(answer).next() {
            self.told.insert(at.position().counts());
        }
        Some(answer)
    }

    fn poll_event(&mut self) -> Option<SlaveEvent> {
        self.nodes.iter_mut().find_map(MotorNode::poll_event)
    }

    fn poll_timeout(&self) -> Option<Instant> {
        let alive = &self.nodes[usize::from(self.is_mute)..];
        alive.iter().filter_map(MotorNode::poll_timeout).min()
    }
}

/// Runs the nodes until the board has written these lines in this order.
fn written(board: &Board, bus: &mut Driver<Nodes, Wire, WireClock>, wanted: &[&str]) {
    let end = std::time::Instant::now() + PATIENCE;
    while !board.has_written(wanted) {
        bus.run_for(Duration::from_millis(20), |_, _, _| {}).unwrap();
        assert!(
            std::time::Instant::now() < end,
            "timed out waiting for {wanted:?}: {:#?}",
            board.lines()
        );
    }
}

#[test]
fn the_board_commands_each_node_in_its_mode_and_stops_one_that_comes_back_before_it_moves_again() {
    let Some(mut board) = Board::start_logged(Program::Master) else { return };
    let wire = Wire::new(board.bus());
    let clock = wire.clock();
    let mut bus = Driver::new(Nodes::new(), wire, clock);
    let found = [
        "event discovered node 2 velocity",
        "event discovered node 5 position",
        "event discovery done online 2",
    ];
    written(&board, &mut bus, &found);
    // Per node: half a revolution per second times the id; a move of as many revolutions as the
    // id.
    let (turn, go) = (Rps::new(1.0).unwrap(), Position::from_revolutions(5.0).unwrap());
    let wanted = [Some(Target::Velocity(turn)), Some(Target::Position(go))];
    let end = std::time::Instant::now() + PATIENCE;
    while [0, 1].map(|index| bus.role().command(index)) != wanted {
        bus.run_for(Duration::from_millis(20), |_, _, _| {}).unwrap();
        assert!(std::time::Instant::now() < end, "not commanded: {:#?}", board.lines());
    }

    bus.role_mut().is_mute = true;
    written(&board, &mut bus, &["event health node 2 abnormal"]);
    let answers_when_lost = bus.role().nodes[0].slave().statistics().replies;
    bus.role_mut().is_mute = false;
    // What node 2 receives from now on, and its number of answers by then.
    let mut heard: Vec<(Target, u32)> = Vec::new();
    let end = std::time::Instant::now() + PATIENCE;
    while heard.last().is_none_or(|&(target, _)| target != Target::Velocity(turn)) {
        bus.run_for(Duration::from_millis(20), |nodes, event, _| {
            if let SlaveEvent::Command(target @ Target::Velocity(_)) = event {
                heard.push((target, nodes.nodes[0].slave().statistics().replies));
            }
        })
        .unwrap();
        assert!(std::time::Instant::now() < end, "not commanded again: {:#?}", board.lines());
    }
    // It is stopped first: two stops, each followed by an answer, and then its command.
    let commanded = heard.iter().position(|&(target, _)| target == Target::Velocity(turn)).unwrap();
    let (stops, [(_, answers), ..]) = heard.split_at(commanded) else { unreachable!() };
    assert!(stops.len() >= 2, "{heard:?}");
    assert!(stops.iter().all(|&(target, _)| target == Target::Velocity(Rps::ZERO)), "{heard:?}");
    assert!(*answers >= answers_when_lost + 2, "{answers_when_lost} {heard:?}");
    let told = [
        "event health node 2 abnormal",
        "event health node 2 online",
        "event stopped node 2 twice",
    ];
    written(&board, &mut bus, &told);
    assert_eq!(bus.role().command(0), wanted[0]);
    board.report_when("told", |_| true).assert_nothing_lost();
    // The master's driver is on only while it sends.
    let bursts = driver_enable_pin::bursts(&board.accesses());
    assert!(bursts.len() > 20, "{}", bursts.len());
    for burst in bursts {
        let mut requests = Frames::<ToSlave>::new(&burst);
        assert!(requests.by_ref().count() > 0, "{burst:02X?}");
        assert_eq!((requests.counters().skipped(), requests.rest().len()), (0, 0), "{burst:02X?}");
    }
}

/// Passes bytes between the two boards until either has ended.
fn relay(mut from: UnixStream, mut to: UnixStream) {
    thread::spawn(move || io::copy(&mut from, &mut to));
}

#[test]
fn two_boards_on_one_line_turn_a_motor() {
    let Some(mut slave) = Board::start(Program::Slave) else { return };
    let Some(mut master) = Board::start(Program::Master) else { return };
    let (one, other) = (slave.bus(), master.bus());
    relay(one.try_clone().unwrap(), other.try_clone().unwrap());
    relay(other, one);

    let turning = slave.report_when("turning", |report| {
        report.get("target_mrps") == Some(500) && report.at("mrps") == 500
    });
    turning.assert_nothing_lost();
    assert_eq!(turning.at("skipped"), 0, "{turning:?}");
    let told = master.report_when("reading that", |report| report.get("mrps") == Some(500));
    assert_eq!((told.at("node"), told.at("lost_events")), (1, 0));
    assert!(told.at("exchanges") > 0, "{told:?}");
    told.assert_nothing_lost();
    assert!(
        master.has_written(&["event discovered node 1 velocity", "event discovery done online 1"])
    );
}
