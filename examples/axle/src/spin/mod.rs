//! `axle spin`: turns one motor, and stops it before the tool exits.

mod goal;
mod motion;

use axlewire::ikeya::{
    NodeId, Rps, Target,
    board::{OneMotor, ThreeMotors},
};

use crate::{
    args::{self, BusProtocol},
    boards::Boards,
    bus::{self, Bus},
    failure::Failure,
    help::MOTION_HELP,
    report::Form,
    signals::Signals,
    teller::{self, Teller},
    watch::moving::{About, PageArgs},
};
use goal::{Goal, GoalArgs};
use motion::{Event, Spin, data};

/// Turn one motor of a motor bus, or the three of a board, for a set time
///
/// Finds the node, reads it again, commands it and prints its measurements. At the end, on every
/// error and on every signal that can be caught (Ctrl-C, Ctrl-Z, Ctrl-\, a kill without -9; not
/// those of a crash, nor 32 and 33, which belong to the C library, nor SIGXFSZ, which only ends a
/// recording), the motor is stopped: a
/// velocity node gets 0 rps, a position node holds the position read at that moment. The tool
/// continues until the node has confirmed the stop twice and the motor is at rest, or else reports
/// what is known; a second Ctrl-C does not cut this short. After Ctrl-Z and fg nothing moves again,
/// and the exit code is 1.
///
/// The exit code is also 1 if the target is not reached when the time is up: the last speed must be
/// within 10 % or 0.1 rps of it, whichever is more, but not off by more than half of it or 0.05
/// rps, whichever is more; the last position must be within 8 counts. On a board with three motors
/// that holds for each.
#[derive(Debug, clap::Args)]
#[command(after_help = MOTION_HELP)]
pub(crate) struct Args {
    #[command(flatten)]
    bus: bus::MasterArgs,

    /// Boards on the bus; three-motor boards take three values for --rps and --revolutions
    #[arg(short = 'P', long, value_enum, default_value = "ikeya")]
    protocol: BusProtocol,

    /// The node, 1 to 8
    #[arg(short, long, value_name = "N", value_parser = args::node)]
    node: NodeId,

    #[command(flatten)]
    goal: GoalArgs,

    #[command(flatten)]
    page: PageArgs,

    /// Refuse an --rps faster than this, in either direction, to guard against typos
    #[arg(long, value_name = "X", default_value = "20", value_parser = args::max_rps)]
    max_rps: Rps,

    /// Duration, seconds
    #[arg(short = 'f', long = "for", value_name = "SECONDS", default_value = "3", value_parser = args::seconds)]
    micros: u64,

    /// Print one JSON object per line; if the motor was commanded, the last is the outcome
    #[arg(short, long)]
    json: bool,
}

/// Runs the subcommand.
pub(crate) fn run(args: &Args) -> Result<(), Failure> {
    let limit = args.max_rps.get();
    if let Some(rps) = args.goal.rps.iter().map(|rps| rps.get()).find(|rps| rps.abs() > limit) {
        return Err(Failure::Usage(format!(
            "--rps {rps} is faster than --max-rps {limit}: raise the limit if you mean it"
        )));
    }
    match args.protocol {
        BusProtocol::Ikeya => run_on::<OneMotor>(args),
        BusProtocol::Ikeya3 => run_on::<ThreeMotors>(args),
    }
}

fn run_on<B: Boards>(args: &Args) -> Result<(), Failure> {
    let goal = Goal::<B>::new(&args.goal).ok_or_else(|| {
        let (one, name) = (B::MOTORS == 1, B::PROTOCOL.name());
        let count = if one { "one value" } else { "three values" };
        Failure::Usage(format!("with --protocol {name}, --rps and --revolutions take {count}"))
    })?;
    let signals = Signals::listen_to_all()?;
    let form = Form::of(args.json);
    let result = match prepare(args, &goal, form, &signals) {
        Ok(Some((spin, target))) => spin.run(target, args.micros, &signals),
        Ok(None) => signals.interrupted(),
        Err(failure) => Err(failure),
    };
    // The port is closed here.
    signals.suspend_if_wanted(result)
}

/// What is ready to turn, and how; `None` if a signal came first.
type Ready<B> = Option<(Spin<B>, Target<B>)>;

/// Opens the port and chooses the target.
fn prepare<B: Boards>(
    args: &Args,
    goal: &Goal<B>,
    form: Form,
    signals: &Signals,
) -> Result<Ready<B>, Failure> {
    let port = args.bus.line();
    let wire = args.bus.open(B::PROTOCOL)?;
    let (protocol, baud) = (B::PROTOCOL, port.baud_for(B::PROTOCOL));
    let about = About { command: "spin", protocol, baud };
    let (page, wire) = args.page.open(wire, &about, signals)?;
    let config = bus::complete(args.bus.config(), port, &wire);
    let mut bus = Bus::new(wire, config);
    let node = args.node;
    // Print before anything moves: a terminal may suspend a background process that prints.
    let tell = |found| {
        let event = Event::Target { node, target: data(found) };
        let line = page.note(form.line(0, &event));
        line.map_or(Ok(()), |line| teller::print(&line).map_err(Failure::Write))
    };
    let Some(target) = aim(&mut bus, node, goal, tell, signals)? else { return Ok(None) };
    let start = bus.now();
    let (teller, left) = (Teller::new(), Ok(()));
    Ok(Some((Spin { bus, node, start, form, teller, page, left }, target)))
}

/// The target of a node that was found and then read again, and told in between; `None` if a signal
/// came first.
fn aim<B: Boards>(
    bus: &mut Bus<B>,
    node: NodeId,
    goal: &Goal<B>,
    tell: impl FnOnce(Target<B>) -> Result<(), Failure>,
    signals: &Signals,
) -> Result<Option<Target<B>>, Failure> {
    if !bus.discover(signals)? {
        return Ok(None);
    }
    tell(goal.target(node, bus, bus.status(node))?)?;
    // Discovery took a while, and so may the reader of that line: the mode may have changed.
    let status = bus.read(node, signals)?;
    if signals.is_raised() {
        return Ok(None);
    }
    if bus.master().is_mode_in_doubt(node) {
        return Err(Failure::Failed(format!("the mode of node {node} is in doubt")));
    }
    goal.target(node, bus, status).map(Some)
}

#[cfg(all(test, unix))]
mod tests;
