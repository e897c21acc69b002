//! A master on a simulated bus: discovery, commands that move motors, how often each node is
//! visited, and nodes that are unplugged or left without commands.

use axlewire::{
    ikeya::{
        Master, Mode, NodeId, Position, Rps, Slave,
        board::ThreeMotors,
        master::{Health, MasterConfig, MasterEvent, Schedule},
        slave::SlaveConfig,
    },
    sim::MotorNode,
    time::wire_time,
};

use crate::talker::*;

const fn mode_of(node: NodeId) -> Mode {
    if node.get() % 2 == 1 { Mode::Velocity } else { Mode::Position }
}

/// A bus with these nodes, odd ones in velocity mode, answering after 50 µs.
fn bus(nodes: &[NodeId], config: MasterConfig) -> Line<Master, MotorNode> {
    let mut line = Line::new(config.baud, 1, Master::new(config, at(0)));
    for &node in nodes {
        let mut slave = SlaveConfig::direct();
        slave.idle = wire_time(5, config.baud);
        let slave = Slave::new(node, mode_of(node), slave, Instant::from_micros(0));
        let tail = line.add(MotorNode::from_parts(slave, Motor::new()));
        line.timing_mut(Who::Tail(tail)).latency = us(50);
    }
    line
}

fn discovered(line: &mut Line<Master, MotorNode>) -> (Vec<(NodeId, Mode)>, Option<u8>) {
    let now = line.now();
    line.head_mut().discover(now);
    while line.head().is_discovering() {
        assert!(line.step().unwrap().is_some());
    }
    line.run_for(us(0)).unwrap();
    let (mut found, mut online) = (Vec::new(), None);
    for (_, event) in line.take_head_events() {
        match event {
            MasterEvent::Discovered { node, mode } => found.push((node, mode)),
            MasterEvent::DiscoveryDone { online: count } => online = Some(count),
            _ => {}
        }
    }
    (found, online)
}

#[test]
fn a_master_discovers_none_one_and_eight_nodes() {
    for nodes in [&[][..], &[NodeId::N6], &NodeId::ALL] {
        let mut line = bus(nodes, MasterConfig::direct());
        let expected: Vec<_> = nodes.iter().map(|&node| (node, mode_of(node))).collect();
        assert_eq!(discovered(&mut line), (expected, Some(nodes.len() as u8)));
    }
}

#[test]
fn commands_move_the_motors_and_the_master_reads_how_they_move() {
    let mut line = bus(&[NodeId::N1, NodeId::N2], MasterConfig::direct());
    discovered(&mut line);
    let target = Position::from_revolutions(-1.25).unwrap();
    let now = line.now();
    line.head_mut().set_velocity(NodeId::N1, Rps::new(3.0).unwrap(), now).unwrap();
    line.head_mut().set_position(NodeId::N2, target, now).unwrap();
    line.run_for(Duration::from_millis(2000)).unwrap();
    assert!((line.tail(0).motor().velocity().get() - 3.0).abs() < 1e-3);
    assert_eq!(line.tail(1).motor().position(), target);
    assert_eq!(line.tails().len(), 2);
    assert_eq!(line.tails()[1].motor().position(), target);
    assert_eq!(line.head().health(NodeId::N2), Some(Health::Online));
    let (status, _) = line.head().status(NodeId::N2).unwrap();
    assert_eq!(status, axlewire::ikeya::Status::Position(target));
    assert_eq!(line.head().node_statistics(NodeId::N1).timeouts, 0);
}

/// Visits of each of eight nodes in `span`, with a WRITE and a READ each, and the share of it in
/// which the line was busy, percent.
fn visits(config: MasterConfig, span: Duration) -> (u32, u64) {
    let mut line = bus(&NodeId::ALL, config);
    discovered(&mut line);
    let now = line.now();
    for node in NodeId::ALL {
        match mode_of(node) {
            Mode::Velocity => line.head_mut().set_velocity(node, Rps::ZERO, now).unwrap(),
            Mode::Position => {
                line.head_mut().set_position(node, Position::new(1, 1), now).unwrap();
            }
        }
    }
    line.run_for(Duration::from_millis(100)).unwrap(); // the new set-points go first
    let busy = |line: &Line<_, _>| {
        let both = [Direction::ToTails, Direction::ToHead];
        both.map(|direction| line.statistics(direction).busy_us).iter().sum::<u64>()
    };
    let replies =
        |line: &Line<Master, _>| NodeId::ALL.map(|node| line.head().node_statistics(node).replies);
    let (writes, reads) = (line.head().statistics().writes, replies(&line));
    let talked = busy(&line);
    line.run_for(span).unwrap();
    let visits: Vec<u32> = replies(&line).iter().zip(reads).map(|(a, b)| a - b).collect();
    let fewest = *visits.iter().min().unwrap();
    assert!(visits.iter().max().unwrap() - fewest <= 1, "unfair: {visits:?}");
    // The first READ of the span may belong to a WRITE from before it.
    assert!(line.head().statistics().writes - writes + 1 >= 8 * fewest);
    (fewest, (busy(&line) - talked) * 100 / u64::from(span.as_micros()))
}

#[test]
fn eight_nodes_are_written_and_read_at_ninety_percent_of_what_the_line_allows() {
    const CYCLES: u32 = 100;
    for baud in [500_000, 57_600, 2_000_000] {
        let mut config = MasterConfig::direct();
        config.baud = baud;
        let mut plan = Schedule::new(8);
        plan.baud = baud;
        let span = plan.cycle_time().saturating_mul(CYCLES);
        let (visits, busy_pct) = visits(config, span);
        println!(
            "{baud} bit/s: computed {} cycles/s, {} % busy; measured {:.1} cycles/s, {busy_pct} % busy",
            plan.cycles_per_second(),
            plan.busy_pct(),
            f64::from(visits) * 1e6 / f64::from(span.as_micros()),
        );
        assert!(visits * 100 >= CYCLES * 90, "{visits} of {CYCLES}");
        assert!(visits <= CYCLES + 1, "{visits} visits are more than the line allows");
        assert!(busy_pct * 100 >= u64::from(plan.busy_pct()) * 90);
    }
}

#[test]
fn an_unplugged_node_is_abnormal_after_three_strikes_and_comes_back() {
    let mut line = bus(&[NodeId::N1, NodeId::N2], MasterConfig::direct());
    discovered(&mut line);
    line.stub_mut(Who::Tail(0)).unplugged = true;
    line.run_for(Duration::from_millis(20)).unwrap();
    assert_eq!(line.head().health(NodeId::N1), Some(Health::Abnormal));
    assert_eq!(line.head().health(NodeId::N2), Some(Health::Online));
    line.stub_mut(Who::Tail(0)).unplugged = false;
    line.run_for(Duration::from_millis(100)).unwrap();
    assert_eq!(line.head().health(NodeId::N1), Some(Health::Online));
}

#[test]
fn a_node_without_commands_stops_after_its_watchdog() {
    let mut config = SlaveConfig::direct();
    config.watchdog = Some(Duration::from_millis(100));
    let slave = Slave::new(NodeId::N1, Mode::Velocity, config, Instant::from_micros(0));
    let master = Master::new(MasterConfig::direct(), at(0));
    let mut line = Line::new(500_000, 0, master);
    line.add(MotorNode::from_parts(slave, Motor::new()));
    let now = line.now();
    line.head_mut().discover(now);
    line.run_for(Duration::from_millis(100)).unwrap();
    let now = line.now();
    line.head_mut().set_velocity(NodeId::N1, Rps::new(1.0).unwrap(), now).unwrap();
    line.run_for(Duration::from_millis(1000)).unwrap();
    assert!(line.tail(0).motor().velocity().get() > 0.99);
    line.head_mut().release(NodeId::N1);
    line.run_for(Duration::from_millis(1000)).unwrap();
    assert!(line.tail(0).motor().velocity().get() < 0.01);
}

#[test]
fn the_three_motors_of_a_board_turn_go_and_stop_independently() {
    let (config, nodes) = (MasterConfig::direct(), [NodeId::N1, NodeId::N2]);
    let master = Master::<ThreeMotors>::for_board(config, at(0));
    let mut line = Line::new(config.baud, 1, master);
    for node in nodes {
        line.add(MotorNode::three_motors(node, mode_of(node)));
    }
    line.head_mut().discover(at(0));
    line.run_for(Duration::from_millis(100)).unwrap();

    let speeds = [3.0, 0.0, -1.5].map(|rps| Rps::new(rps).unwrap());
    let targets = [-1.25, 0.0, 2.0].map(|way| Position::from_revolutions(way).unwrap());
    let now = line.now();
    line.head_mut().set_velocity(NodeId::N1, speeds, now).unwrap();
    line.head_mut().set_position(NodeId::N2, targets, now).unwrap();
    line.run_for(Duration::from_millis(2000)).unwrap();
    for (motor, target) in line.tail(0).motor().iter().zip(speeds) {
        assert!((motor.velocity().get() - target.get()).abs() < 1e-3, "{motor:?}");
    }
    assert_eq!(line.tail(1).motor().each_ref().map(Motor::position), targets);
    // The master waits for the answers to its WRITEs.
    assert!(nodes.iter().all(|node| line.head().node_statistics(*node).timeouts == 0));

    let now = line.now();
    line.head_mut().stop_all(now);
    line.run_for(Duration::from_millis(2000)).unwrap();
    assert!(line.tail(0).motor().iter().all(|motor| motor.velocity().get().abs() < 1e-3));
}

#[test]
fn the_motors_of_a_board_hold_where_they_are_until_the_first_command() {
    let mut node = MotorNode::three_motors(NodeId::N1, Mode::Position);
    let places = [-1.25, 0.0, 2.0].map(|way| Position::from_revolutions(way).unwrap());
    *node.motor_mut() = places.map(|place| Motor::new().at(place));
    node.handle_timeout(at(0));
    node.handle_timeout(at(1_000_000));
    assert_eq!(node.motor().each_ref().map(Motor::position), places);
    // What turns without a command is held from the next call on.
    node.motor_mut()[1].turn(Rps::new(1.0).unwrap());
    node.handle_timeout(at(2_000_000));
    node.handle_timeout(at(2_000_001));
    assert_eq!(node.motor()[1].velocity(), Rps::ZERO);
}
