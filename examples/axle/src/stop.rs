//! `axle stop`: whatever answers on a line is stopped.

use axlewire::ikeya::{
    NodeId,
    board::{OneMotor, ThreeMotors},
    master::{MasterConfig, NodeSet},
};

use crate::{
    MOTION_HELP,
    args::{self, Protocol},
    bus::{Boards, Bus, Halt},
    failure::Failure,
    rover::Rover,
    signals::Signals,
    teller,
};

/// Stop what answers on a line, and wait until it stands still
///
/// A motor bus: all ids are read, those that answer are stopped (a velocity node gets 0 rps, a
/// position node holds the position that is then read), and the stop is repeated until each has
/// confirmed it twice and was measured standing still. Silent ids are listed and are no failure, as
/// long as one node answers. A rover: zero motor commands are sent every 100 ms until its reports say
/// that all wheels stand still.
///
/// The exit code is 0 only if something has answered and all of it stands still. The tool ends by
/// itself within some 10 seconds; Ctrl-C, Ctrl-Z and Ctrl-\ do not end it earlier.
///
/// What is sent on the wire: with --protocol ikeya or ikeya-3 READ packets for ids 1 to 8, or for
/// --node alone, and WRITE packets for those that answer; with --protocol ucp zero motor commands and
/// pings. Without --protocol first the READ packets of one-motor boards, for a second, at 500000
/// bit/s; if nothing answers, then zero motor commands and pings at 115200 bit/s. Any byte keeps a
/// vendor robot going for 500 ms, so for a rover --protocol ucp is faster by that second.
#[derive(Debug, clap::Args)]
#[command(after_help = MOTION_HELP)]
pub(crate) struct Args {
    #[command(flatten)]
    line: args::Line,

    /// What is spoken on the line; without it, ikeya is tried and then ucp
    #[arg(long, value_enum)]
    protocol: Option<Protocol>,

    /// Stop this node of a motor bus alone, 1 to 8; it has to answer
    #[arg(long, value_name = "N", value_parser = args::node)]
    node: Option<NodeId>,
}

/// Runs the subcommand.
pub(crate) fn run(args: &Args) -> Result<(), Failure> {
    if args.node.is_some() && args.protocol == Some(Protocol::Ucp) {
        let line = "--node is for ikeya and ikeya-3: a rover has no nodes";
        return Err(Failure::Usage(line.to_owned()));
    }
    // A stop is not interrupted. It ends by itself.
    let _signals = Signals::listen_to_all()?;
    match args.protocol {
        Some(Protocol::Ikeya) => stop_bus::<OneMotor>(args)?.judge(),
        Some(Protocol::Ikeya3) => stop_bus::<ThreeMotors>(args)?.judge(),
        Some(Protocol::Ucp) => stop_rover(&args.line),
        None => stop_whatever(args),
    }
}

/// A bus if a node answers, otherwise a rover.
fn stop_whatever(args: &Args) -> Result<(), Failure> {
    let bus = stop_bus::<OneMotor>(args)?;
    if bus.answered > 0 || args.node.is_some() {
        return bus.judge();
    }
    stop_rover(&args.line).map_err(|failure| match failure {
        Failure::Undone(line) => Failure::Undone(format!("{}; {line}", bus.nothing())),
        other => other,
    })
}

/// What has become of a bus.
struct Stopped {
    path: String,
    answered: usize,
    /// Ids that gave only damaged answers.
    damaged: usize,
    /// What is wrong with each node that is not known to stand still.
    complaints: Vec<String>,
    /// What is wrong with the port.
    failure: Option<Failure>,
}

impl Stopped {
    /// Good if something has answered and all of it stands still.
    fn judge(self) -> Result<(), Failure> {
        let complaint = match (self.complaints.is_empty(), self.answered) {
            (false, _) => self.complaints.join("; "),
            (true, 0) => self.nothing(),
            (true, _) => return self.failure.map_or(Ok(()), Err),
        };
        Err(match self.failure {
            Some(failure) => failure.while_moving(&complaint),
            None => Failure::Undone(complaint),
        })
    }

    fn nothing(&self) -> String {
        let heard = if self.damaged > 0 { " undamaged" } else { "" };
        format!("no node answers on {:?}{heard}", self.path)
    }
}

fn stop_bus<B: Boards>(args: &Args) -> Result<Stopped, Failure> {
    let mut config = MasterConfig::usb_adapter();
    config.nodes = args.node.map_or(NodeSet::ALL, NodeSet::from);
    let nodes = config.nodes;
    let mut bus = Bus::<B>::open_with(&args.line, config)?;
    let failure = bus.stop(nodes).err();
    let mut silent = Vec::new();
    let mut stopped = Stopped {
        path: bus.port.path().to_owned(),
        answered: bus.nodes().count(),
        damaged: nodes.iter().filter(|&node| bus.is_damaged(node)).count(),
        complaints: Vec::new(),
        failure,
    };
    for node in nodes.iter() {
        let status = bus.status(node).map(B::describe).unwrap_or_default();
        match bus.halt(node) {
            Halt::Still => {
                let line = format!("node {node}: {status}, stopped and confirmed");
                // Where nobody reads that, it stands still all the same.
                drop(teller::print(&line));
            }
            Halt::Silent if args.node.is_none() => silent.push(node.to_string()),
            _ => stopped.complaints.extend(bus.complaint(node)),
        }
    }
    if stopped.answered > 0 && !silent.is_empty() {
        drop(teller::print(&format!("silent: {}", silent.join(", "))));
    }
    Ok(stopped)
}

fn stop_rover(line: &args::Line) -> Result<(), Failure> {
    let mut rover = Rover::open(line)?;
    // The host's first frames tell the robot to stand still, heard or not.
    rover.find(|| false)?;
    rover.stop()?;
    if let Some(report) = rover.describe() {
        drop(teller::print(&format!("robot: {report}, stopped")));
    }
    Ok(())
}
