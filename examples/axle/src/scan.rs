//! `axle scan`: lists the nodes of a motor bus.

mod measure;

use std::io::{self, Write};

use anstyle::{AnsiColor, Effects, Style};
use axlewire::ikeya::{
    Mode, NodeId,
    board::{OneMotor, ThreeMotors},
    master::NodeSet,
    slave::{DipSwitch, IdReading},
};
use serde::Serialize;

use crate::{
    args::BusProtocol,
    boards::{Boards, Data},
    bus::{self, Bus, Patience},
    failure::Failure,
    help::EXIT_CODES,
    signals::Signals,
};
use measure::Times;

/// List the nodes of a motor bus
///
/// Asks ids 1 to 8 for their status, silent ones three times; nothing moves. A node's DIP switch is
/// shown in both readings, because the protocol document has two: compare one board with both
/// columns to see which one its manufacturer uses. Finding no node is not a failure.
#[derive(Debug, clap::Args)]
#[command(after_help = EXIT_CODES)]
pub(crate) struct Args {
    #[command(flatten)]
    bus: bus::MasterArgs,

    /// Boards on the bus
    #[arg(short = 'P', long, value_enum, default_value = "ikeya")]
    protocol: BusProtocol,

    /// Then read each node 100 times, for 15 seconds at the most, and print how long the answers
    /// take and the --reply-timeout that the line needs
    #[arg(long, conflicts_with = "reply_timeout")]
    measure: bool,

    /// Print one JSON object per line
    #[arg(short, long)]
    json: bool,
}

const TITLE: Style = Style::new().effects(Effects::BOLD);
const WARNING: Style = AnsiColor::Yellow.on_default();

/// One line of output.
#[derive(Debug, Serialize)]
#[serde(tag = "event", rename_all = "lowercase")]
enum Record {
    /// A node that has answered.
    Node {
        node: NodeId,
        mode: Mode,
        #[serde(flatten)]
        status: Data,
        dip: Dip,
    },
    /// An id that gave only damaged answers.
    Damaged {
        node: NodeId,
    },
    Times(Times),
    /// Totals.
    Summary {
        nodes: usize,
        damaged: usize,
        /// What the line needs for `--reply-timeout`, if that was measured.
        #[serde(skip_serializing_if = "Option::is_none")]
        reply_timeout: Option<String>,
    },
}

/// The four digits of a node's DIP switch under both readings (ruling I2).
#[derive(Debug, Serialize)]
struct Dip {
    value_plus_one: Option<String>,
    value: Option<String>,
}

impl Dip {
    fn of(node: NodeId, mode: Mode) -> Self {
        let digits = |reading| {
            let is_it = |dip: &DipSwitch| dip.mode() == mode && dip.node_id(reading) == Ok(node);
            let dip = (0..16).filter_map(|bits| DipSwitch::from_bits(bits).ok()).find(is_it)?;
            Some(format!("{:04b}", dip.bits()))
        };
        Self { value_plus_one: digits(IdReading::ValuePlusOne), value: digits(IdReading::Value) }
    }
}

/// Runs the subcommand.
pub(crate) fn run(args: &Args) -> Result<(), Failure> {
    match args.protocol {
        BusProtocol::Ikeya => scan::<OneMotor>(args),
        BusProtocol::Ikeya3 => scan::<ThreeMotors>(args),
    }
}

fn scan<B: Boards>(args: &Args) -> Result<(), Failure> {
    let signals = Signals::listen()?;
    let mut bus = Bus::<B>::open(&args.bus)?;
    discover(&mut bus, &signals)?;
    if bus.nodes().next().is_none() {
        bus.listen(&signals)?;
    }
    let (mut needs, mut times) = (None, Vec::new());
    let (known, too_short) = (bus.those_heard().len(), bus.master().config().reply_timeout);
    if args.bus.may_wait_longer() && bus.could_wait_longer() {
        bus.begin_patiently(NodeSet::ALL, 2);
        discover(&mut bus, &signals)?;
        needs = bus.needed_patience().filter(|it| it.config().reply_timeout > too_short);
    }
    // If none is left, the summary tells why.
    let found = match still_there(&bus) {
        0 => 0,
        still => known.max(still),
    };
    if args.measure && found > 0 {
        times = measure::measure(&mut bus, &signals)?;
        needs = measure::proposal(&times);
    }
    match args.json {
        true => print_json(&bus, needs, times, &mut io::stdout().lock()),
        false => print_table(&bus, found, needs, &times, &mut anstream::stdout().lock()),
    }
    .map_err(Failure::Write)?;
    bus.check_recording()?;
    match found - still_there(&bus).min(found) {
        0 => Ok(()),
        1 => Err(Failure::Failed("1 node fell silent".to_owned())),
        silent => Err(Failure::Failed(format!("{silent} nodes fell silent"))),
    }
}

/// Number of nodes that have answered and still do.
fn still_there<B: Boards>(bus: &Bus<B>) -> usize {
    bus.nodes().filter(|(node, ..)| bus.is_online(*node)).count()
}

fn discover<B: Boards>(bus: &mut Bus<B>, signals: &Signals) -> Result<(), Failure> {
    match bus.discover(signals)? {
        true => Ok(()),
        false => Err(Failure::Failed("interrupted before all ids were asked".to_owned())),
    }
}

/// Ids that have given only damaged answers.
fn damaged<B: Boards>(bus: &Bus<B>) -> Vec<NodeId> {
    NodeId::ALL.into_iter().filter(|&node| bus.is_damaged(node)).collect()
}

fn print_json<B: Boards>(
    bus: &Bus<B>,
    needs: Option<Patience>,
    times: Vec<Times>,
    out: &mut dyn Write,
) -> io::Result<()> {
    let nodes = bus.nodes().map(|(node, mode, status)| {
        let dip = Dip::of(node, mode);
        Record::Node { node, mode, status: B::data(status), dip }
    });
    let damaged = damaged(bus);
    let summary = Record::Summary {
        nodes: bus.nodes().count(),
        damaged: damaged.len(),
        reply_timeout: needs.map(|needs| needs.to_string()),
    };
    let damaged = damaged.into_iter().map(|node| Record::Damaged { node });
    let times = times.into_iter().map(Record::Times);
    for record in nodes.chain(damaged).chain(times).chain([summary]) {
        serde_json::to_writer(&mut *out, &record)?;
        writeln!(out)?;
    }
    out.flush()
}

fn print_table<B: Boards>(
    bus: &Bus<B>,
    found: usize,
    needs: Option<Patience>,
    times: &[Times],
    out: &mut dyn Write,
) -> io::Result<()> {
    let count = bus.nodes().count();
    if count > 0 {
        writeln!(
            out,
            "{TITLE}node  mode      DIP, id = value + 1  DIP, id = value  status{TITLE:#}"
        )?;
    }
    for (node, mode, status) in bus.nodes() {
        let Dip { value_plus_one, value } = Dip::of(node, mode);
        let [first, second] = [value_plus_one, value].map(|it| it.unwrap_or("none".to_owned()));
        writeln!(out, "{node:>4}  {mode:<8}  {first:<19}  {second:<15}  {}", B::describe(status))?;
    }
    let damaged = damaged(bus);
    for node in &damaged {
        writeln!(
            out,
            "{WARNING}id {node}: only damaged answers{WARNING:#}: noise, two boards with this id, an \
             adapter that hears itself (--echo), another --protocol, or a wrong --baud"
        )?;
    }
    if !times.is_empty() {
        writeln!(out, "{TITLE}{}{TITLE:#}", measure::TITLES)?;
        times.iter().try_for_each(|times| writeln!(out, "{times}"))?;
    }
    match needs {
        None => {}
        Some(needs) if times.is_empty() => writeln!(
            out,
            "{WARNING}answers come late{WARNING:#}: use --reply-timeout {needs} on this line"
        )?,
        Some(needs) => writeln!(out, "use --reply-timeout {needs} on this line")?,
    }
    let (path, baud) = (bus.path(), bus.baud);
    let are =
        |kind: fn(&Bus<B>, NodeId) -> u32| NodeId::ALL.into_iter().any(|id| kind(bus, id) > 0);
    match (count, damaged.is_empty()) {
        _ if still_there(bus) < found => {
            writeln!(out, "{} of {found} nodes still answer.", still_there(bus))
        }
        (0, _) if are(Bus::late) => writeln!(
            out,
            "No node answers in time on {path:?}, but later: use a longer --reply-timeout."
        ),
        (0, _) if are(Bus::early) => writeln!(
            out,
            "Nodes answer on {path:?} sooner than {baud} bit/s allows: use --instant if it has no line speed."
        ),
        (0, true) => writeln!(
            out,
            "No node answers on {path:?} at {baud} bit/s: check power, wires A and B, --protocol and --baud."
        ),
        (0, false) => {
            writeln!(out, "No node answers on {path:?} at {baud} bit/s: all answers are damaged.")
        }
        (1, _) => writeln!(out, "1 node answers."),
        (count, _) => writeln!(out, "{count} nodes answer."),
    }?;
    out.flush()
}
