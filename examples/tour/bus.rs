//! Part three: a master and eight simulated motors on a noisy line, one of them with a loose plug.

use std::error::Error;

use axlewire::{
    ikeya::{
        Master, Mode, NodeId, Position, Rps, Slave, Status,
        master::{Health, MasterConfig, MasterEvent, Schedule},
        slave::SlaveConfig,
    },
    sim::{Direction, Faults, Line, Motor, MotorNode, Who},
    time::{Duration, Instant},
};

use crate::title;

type Bus = Line<Master, MotorNode>;

/// Bit error rate.
const BIT_ERRORS: f64 = 1e-4;

pub(crate) fn run() -> Result<(), Box<dyn Error>> {
    title("Ikeya MD: eight motors, a noisy line, a loose plug (two seconds in virtual time)");
    let mut bus: Bus =
        Line::new(500_000, 2026, Master::new(MasterConfig::direct(), Instant::from_micros(0)));
    for node in NodeId::ALL {
        let mode = if node <= NodeId::N4 { Mode::Velocity } else { Mode::Position };
        let mut config = SlaveConfig::direct();
        config.watchdog = Some(Duration::from_millis(100));
        let slave = Slave::new(node, mode, config, Instant::from_micros(0));
        let tail = bus.add(MotorNode::from_parts(slave, Motor::new()));
        // Firmware delay between a request and the start of its answer.
        bus.timing_mut(Who::Tail(tail)).latency = Duration::from_micros(50);
    }
    *bus.pair_mut(Direction::ToTails) = Faults::noise(BIT_ERRORS);
    *bus.pair_mut(Direction::ToHead) = Faults::noise(BIT_ERRORS);

    let now = bus.now();
    bus.head_mut().discover(now);
    let loose = Who::Tail(2);
    // Time of the commands and number of answers before them.
    let (mut commanded, mut abnormal) = (None, None);
    for tenth in 0..20 {
        bus.stub_mut(loose).unplugged = (8..12).contains(&tenth);
        bus.run_for(Duration::from_millis(100))?;
        for (at, event) in bus.take_head_events() {
            tell(at, event, &mut abnormal);
        }
        if commanded.is_none() && !bus.head().is_discovering() {
            commanded = Some((bus.now(), answers(&bus)));
            let now = bus.now();
            command(bus.head_mut(), now)?;
        }
    }
    table(&bus);
    if let Some((begin, before)) = commanded {
        rates(&bus, begin, before);
    }
    Ok(())
}

/// Commands every node.
fn command(master: &mut Master, now: Instant) -> Result<(), Box<dyn Error>> {
    for node in NodeId::ALL {
        match master.mode(node) {
            Some(Mode::Velocity) => master.set_velocity(node, Rps::from_rpm(60.0)?, now)?,
            Some(Mode::Position) => {
                master.set_position(node, Position::from_revolutions(1.25)?, now)?;
            }
            None => println!("node {node} was not found"),
        }
    }
    println!("    0.100 s  commands: 60 rpm, or 1.25 turns");
    Ok(())
}

/// Prints an event if it matters; remembers the abnormal node.
fn tell(at: Instant, event: MasterEvent, abnormal: &mut Option<NodeId>) {
    let seconds = at.as_micros() as f64 / 1e6;
    match event {
        MasterEvent::Discovered { node, mode } => {
            println!("{seconds:9.3} s  node {node} found, {mode} mode");
        }
        MasterEvent::DiscoveryDone { online } => {
            println!("{seconds:9.3} s  discovery done: {online} nodes");
        }
        MasterEvent::Health { node, health: Health::Abnormal } => {
            *abnormal = Some(node);
            println!("{seconds:9.3} s  node {node} is abnormal: three strikes");
        }
        MasterEvent::Health { node, health: Health::Online } if *abnormal == Some(node) => {
            *abnormal = None;
            println!("{seconds:9.3} s  node {node} is answering again");
        }
        MasterEvent::Stopped { node } => {
            println!("{seconds:9.3} s  node {node} has confirmed its stop twice");
        }
        MasterEvent::StandingStill { node } => {
            println!("{seconds:9.3} s  node {node} is at rest");
        }
        MasterEvent::ModeChanged { node, mode } => {
            println!("{seconds:9.3} s  node {node} is now in {mode} mode");
        }
        // A status after every exchange, and occasional strikes: the table sums them up.
        _ => {}
    }
}

fn table(bus: &Bus) {
    println!("\nnode  mode      health    measured      answers  timeouts  damaged  response, us");
    for (node, tail) in NodeId::ALL.into_iter().zip(bus.tails()) {
        let counts = bus.head().node_statistics(node);
        let measured = match bus.head().status(node) {
            Some((Status::Velocity(rps), _)) => format!("{rps:.3} rps"),
            Some((Status::Position(at), _)) => format!("{:.3} turns", at.revolutions()),
            None => "nothing".into(),
        };
        println!(
            "{node:>4}  {:<8}  {:<8}  {measured:<12}  {:>7}  {:>8}  {:>7}  {} to {}",
            tail.slave().mode(),
            match bus.head().health(node) {
                Some(Health::Online) => "online",
                Some(Health::Suspect(_)) => "suspect",
                Some(Health::Abnormal) | None => "abnormal",
            },
            counts.replies,
            counts.timeouts,
            counts.crc_errors,
            counts.latency.min().map_or(0, Duration::as_micros),
            counts.latency.max().map_or(0, Duration::as_micros),
        );
    }
}

fn answers(bus: &Bus) -> u32 {
    NodeId::ALL.iter().map(|&node| bus.head().node_statistics(node).replies).sum()
}

fn rates(bus: &Bus, begin: Instant, before: u32) {
    let plan = Schedule::new(8);
    let seconds = f64::from((bus.now() - begin).as_micros()) / 1e6;
    let errors = [Direction::ToTails, Direction::ToHead].map(|way| bus.statistics(way).bit_errors);
    println!(
        "\n{:.0} answers per second; a clean line with eight commanded nodes, each answering after \
         {} us,\nallows {}. {} bits were wrong. Node 3 was stopped by its own watchdog. It was \
         lost while under\ncommand, so the master stopped it when it came back: it stays at rest \
         until the next command.",
        f64::from(answers(bus) - before) / seconds,
        plan.response_time.as_micros(),
        plan.cycles_per_second() * 8,
        errors[0] + errors[1],
    );
}
