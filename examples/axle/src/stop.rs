//! `axle stop`: stops whatever answers on a line.

use std::{cell::Cell, fmt, rc::Rc};

use axlewire::{
    ikeya::{
        self, NodeId,
        board::{OneMotor, ThreeMotors},
        master::NodeSet,
        three,
    },
    stream::Event as Found,
};
use serde::Serialize;

use crate::{
    args::{self, PortArgs, Protocol},
    boards::{Boards, Data},
    bus::{self, Bus, Halt},
    failure::Failure,
    help::MOTION_HELP,
    line::{Line, SharedRecording},
    pcapng::Direction,
    report::{Form, Outcome},
    rover::Rover,
    signals::Signals,
    teller,
};

/// Stop whatever answers on a line, and wait until it is at rest
///
/// Motor bus: reads all ids, stops those that answer (a velocity node gets 0 rps, a position node
/// holds the position read at that moment), and repeats the stop until each has confirmed it twice
/// and was measured at rest. Ids that do not answer within a second are listed and are not a
/// failure, as long as one node answers: stop a motor whose plug is loose with --node. Rover: sends
/// zero motor commands every 100 ms until the reports show that all wheels have stopped; a robot
/// without reports may be moving, and is a failure.
///
/// Without --reply-timeout, a line on which answers come late is read once more with half a second
/// for each; with it, an answer that comes later is a failure.
///
/// The exit code is 0 only if something has answered and all of it is at rest. The tool finishes
/// within about 10 seconds, and within 90 on a line on which answers come late; Ctrl-C, Ctrl-Z and
/// Ctrl-\ do not cut it short.
///
/// What is sent on the wire: with --protocol ikeya or ikeya-3, READ packets for ids 1 to 8, or for
/// --node only, and WRITE packets for those that answer; with --protocol ucp, zero motor commands
/// and pings. Without --protocol, first the READ packets of one-motor boards, for one second, at
/// 500000 bit/s; if boards with three motors answer, these are stopped; if nothing answers, then
/// zero motor commands and pings at 115200 bit/s. Any byte keeps a vendor robot going for 500 ms,
/// so for a rover --protocol ucp is faster by that second.
#[derive(Debug, clap::Args)]
#[command(after_help = MOTION_HELP)]
pub(crate) struct Args {
    #[command(flatten)]
    bus: bus::MasterArgs,

    /// Protocol of the line; by default ikeya is tried first, then ucp
    #[arg(short = 'P', long, value_enum)]
    protocol: Option<Protocol>,

    /// Stop only this node of a motor bus, 1 to 8; it must answer
    #[arg(short, long, value_name = "N", value_parser = args::node)]
    node: Option<NodeId>,

    /// Print one JSON object per line; the last is the outcome
    #[arg(short, long)]
    json: bool,
}

/// One line of output.
#[derive(Debug, Serialize)]
#[serde(tag = "event", rename_all = "snake_case")]
enum Event {
    /// A node, or the robot, was stopped and measured at rest.
    Stopped {
        #[serde(skip_serializing_if = "Option::is_none")]
        node: Option<NodeId>,
        #[serde(flatten)]
        status: Option<Data>,
        #[serde(skip)]
        text: String,
    },
    /// Ids that have never answered.
    Silent { nodes: Vec<NodeId> },
}

impl fmt::Display for Event {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Stopped { node: Some(node), text, .. } => {
                write!(f, "node {node}: {text}, stopped and confirmed")
            }
            Self::Stopped { node: None, text, .. } => write!(f, "robot: {text}, stopped"),
            Self::Silent { nodes } => {
                let nodes: Vec<_> = nodes.iter().map(ToString::to_string).collect();
                write!(f, "silent, not stopped: {}", nodes.join(", "))
            }
        }
    }
}

/// If the output fails, what moved has stopped all the same.
fn tell(args: &Args, event: &Event) {
    drop(teller::print(&Form::of(args.json).plain(event)));
}

/// Runs the subcommand.
pub(crate) fn run(args: &Args) -> Result<(), Failure> {
    if args.node.is_some() && args.protocol == Some(Protocol::Ucp) {
        let line = "--node is for ikeya and ikeya-3: a rover has no nodes";
        return Err(Failure::Usage(line.to_owned()));
    }
    // Signals do not interrupt a stop, which is bounded.
    let _signals = Signals::listen_to_all()?;
    let mut lines = Lines { args: args.bus.line(), recording: None, failure: None };
    let stopped = match args.protocol {
        Some(Protocol::Ikeya) => stop_bus::<OneMotor>(args, &mut lines).and_then(Stopped::judge),
        Some(Protocol::Ikeya3) => {
            stop_bus::<ThreeMotors>(args, &mut lines).and_then(Stopped::judge)
        }
        Some(Protocol::Ucp) => stop_rover(args, &mut lines),
        None => stop_whatever(args, &mut lines),
    };
    let at_rest = stopped.is_ok();
    let kept = lines.finish();
    if let (Err(_), Err(failure)) = (&stopped, &kept) {
        let _ = failure.report();
    }
    let result = stopped.and(kept);
    Outcome::of(&result, at_rest).print(Form::of(args.json));
    result
}

/// The port, opened for one protocol after the other, with one recording. A recording that fails
/// does not keep anything from being stopped; the failure is reported at the end.
struct Lines<'a> {
    args: &'a PortArgs,
    recording: Option<SharedRecording>,
    failure: Option<Failure>,
}

impl Lines<'_> {
    fn open(&mut self, protocol: Protocol) -> Result<Line, Failure> {
        let line = Line::unrecorded(self.args, protocol)?;
        match &self.recording {
            Some(recording) => {
                let (port, baud) = (&self.args.port, self.args.baud_for(protocol));
                recording.borrow_mut().change_line(protocol, port, baud);
            }
            None => match Line::recording(self.args, protocol) {
                Ok(recording) => self.recording = recording,
                Err(failure) => self.failure = Some(failure),
            },
        }
        Ok(line.recorded(self.recording.as_ref()))
    }

    /// Ends the recording; fails if it is incomplete.
    fn finish(self) -> Result<(), Failure> {
        let kept = self.recording.map_or(Ok(()), |recording| recording.borrow_mut().check());
        kept.and(self.failure.map_or(Ok(()), Err))
    }
}

/// Stops a bus if a node answers, with boards of either kind, otherwise a rover.
fn stop_whatever(args: &Args, lines: &mut Lines<'_>) -> Result<(), Failure> {
    let mut bus = stop_bus::<OneMotor>(args, lines)?;
    if bus.heard == 0 && bus.others {
        bus = stop_bus::<ThreeMotors>(args, lines)?;
    }
    if bus.heard > 0 || args.node.is_some() {
        return bus.judge();
    }
    stop_rover(args, lines).map_err(|failure| match failure {
        Failure::Failed(line) => Failure::Failed(format!("{}; {line}", bus.complaint())),
        other => other,
    })
}

/// Outcome for a bus.
#[derive(Default)]
struct Stopped {
    path: String,
    /// Number of nodes that have answered.
    answered: usize,
    /// Number of those, and of nodes that have answered out of time.
    heard: usize,
    /// Ids that have not, if all ids were to be stopped.
    silent: Vec<NodeId>,
    /// Number of ids that gave only damaged answers.
    damaged: usize,
    /// One message for each node that is not known to be at rest.
    complaints: Vec<String>,
    /// Whether boards of the other kind have answered.
    others: bool,
    /// What else was heard.
    hint: &'static str,
    /// Failure of the port.
    failure: Option<Failure>,
}

impl Stopped {
    /// Tells what has become of the nodes, some of which are known to have answered.
    fn judge_each<B: Boards>(&mut self, args: &Args, bus: &Bus<B>, known: NodeSet) {
        for node in bus.master().config().nodes.iter() {
            self.answered += usize::from(bus.status(node).is_some());
            let is_heard = known.contains(node) || bus.those_heard().contains(node);
            self.heard += usize::from(is_heard);
            self.damaged += usize::from(bus.is_damaged(node));
            match bus.halt(node) {
                Halt::Still => {
                    let status = bus.status(node).map(B::data);
                    let text = status.map(|it| it.to_string()).unwrap_or_default();
                    tell(args, &Event::Stopped { node: Some(node), status, text });
                }
                Halt::Silent if known.contains(node) => self.complaints.push(format!(
                    "node {node} has answered, but not when it was asked: its motor may be moving"
                )),
                Halt::Silent if args.node.is_none() => self.silent.push(node),
                _ => self.complaints.extend(bus.complaint(node)),
            }
        }
    }

    /// `Ok` if something has answered and all of it is at rest.
    fn judge(self) -> Result<(), Failure> {
        if self.complaints.is_empty() && self.answered > 0 {
            return self.failure.map_or(Ok(()), Err);
        }
        let complaint = self.complaint();
        Err(match self.failure {
            Some(failure) => failure.while_moving(&complaint),
            None => Failure::Failed(complaint),
        })
    }

    /// What is not at rest, or that nothing was heard.
    fn complaint(&self) -> String {
        let hint = self.hint;
        if !self.complaints.is_empty() {
            return format!("{}{hint}", self.complaints.join("; "));
        }
        let heard = if self.damaged > 0 { " (damaged bytes received)" } else { "" };
        format!("no node answers on {:?}{heard}{hint}", self.path)
    }
}

/// READs of an id on a slow line until it counts as silent.
const PATIENT_ATTEMPTS: u8 = 3;

/// What is heard on a line, whenever it comes.
#[derive(Clone, Copy, Default)]
struct Heard {
    /// The ids of whole answers.
    nodes: NodeSet,
    /// Whether boards of the other kind answer.
    others: bool,
    /// Whether there are whole requests.
    requests: bool,
}

impl Heard {
    /// What these bytes mean that are no answers, for the end of a complaint.
    const fn hint(self, protocol: Protocol) -> &'static str {
        match (self.others, self.requests, protocol) {
            (true, _, Protocol::Ikeya3) => "; boards with one motor answer: use --protocol ikeya",
            (true, _, _) => "; boards with three motors answer: use --protocol ikeya-3",
            (_, true, _) => {
                "; requests are heard: use --echo if the adapter hears itself, and stop any other \
                 program on this line"
            }
            _ => "",
        }
    }
}

/// Tells of each whole frame in a stream.
type Tell = Box<dyn FnMut(&[u8], &mut Heard)>;

macro_rules! tell {
    ($decoder:ty, |$heard:ident, $frame:ident| $told:expr) => {{
        let mut decoder = <$decoder>::new();
        Box::new(move |mut bytes: &[u8], $heard: &mut Heard| {
            while let Some(event) = decoder.decode(&mut bytes) {
                if let Found::Frame($frame) = event {
                    $told;
                }
            }
        })
    }};
}

/// Whatever is heard on this line.
fn heard_on(line: Line, protocol: Protocol) -> (Rc<Cell<Heard>>, Line) {
    type One = ikeya::Decoder<ikeya::ToMaster>;
    type Three = three::Decoder<three::ToMaster>;
    let [own, other]: [Tell; 2] = match protocol {
        Protocol::Ikeya3 => [
            tell!(Three, |heard, answer| heard.nodes.insert(answer.id())),
            tell!(One, |heard, _answer| heard.others = true),
        ],
        _ => [
            tell!(One, |heard, answer| heard.nodes.insert(answer.id())),
            tell!(Three, |heard, _answer| heard.others = true),
        ],
    };
    let requests: Tell =
        tell!(ikeya::Decoder<ikeya::ToSlave>, |heard, _request| heard.requests = true);
    let mut all = [own, other, requests];
    let heard = Rc::new(Cell::new(Heard::default()));
    let tapped = Rc::clone(&heard);
    let line = line.tapped(move |direction, bytes| {
        if direction == Direction::In {
            let mut now = tapped.get();
            all.iter_mut().for_each(|tell| tell(bytes, &mut now));
            tapped.set(now);
        }
    });
    (heard, line)
}

fn stop_bus<B: Boards>(args: &Args, lines: &mut Lines<'_>) -> Result<Stopped, Failure> {
    let mut config = args.bus.config();
    config.nodes = args.node.map_or(NodeSet::ALL, NodeSet::from);
    let nodes = config.nodes;
    let line = args.bus.without_echo(lines.open(B::PROTOCOL)?);
    let (heard, line) = heard_on(line, B::PROTOCOL);
    let config = bus::complete(config, args.bus.line(), &line);
    let mut bus = Bus::<B>::new(line, config);
    let is_patient = !args.bus.may_wait_longer();
    let failure = if is_patient { bus.stop(nodes) } else { bus.stop_in_time(nodes) }.err();
    let too_short = bus.master().config().reply_timeout;
    let mut stopped = Stopped { path: bus.path().to_owned(), failure, ..Stopped::default() };
    let mut needs = None;
    if !is_patient && bus.could_wait_longer() {
        let damaged = bus.may_be_there();
        // What comes now is too late for an answer, but tells which ids are there.
        stopped.failure = bus.leave_alone().err();
        bus.begin_now(nodes, PATIENT_ATTEMPTS);
        // First those whose motors are known to be there.
        let known = heard.get().nodes | damaged;
        let first = nodes.iter().filter(|node| known.contains(*node)).collect();
        stopped.failure = bus.stop_all_but_first(first).err().or(stopped.failure);
        needs = bus.needed_patience().filter(|it| it.config().reply_timeout > too_short);
    }
    let heard = heard.get();
    stopped.judge_each(args, &bus, heard.nodes);
    (stopped.others, stopped.hint) = (heard.others, heard.hint(B::PROTOCOL));
    if heard.others && stopped.answered > 0 && stopped.complaints.is_empty() {
        stopped.complaints.push("the motors of other boards may be moving".to_owned());
    }
    if let Some(patience) = needs.filter(|_| stopped.complaints.is_empty()) {
        eprintln!("axle: answers come late: others need --reply-timeout {patience} on this line");
    }
    if stopped.answered > 0 && !stopped.silent.is_empty() {
        tell(args, &Event::Silent { nodes: stopped.silent.clone() });
    }
    Ok(stopped)
}

fn stop_rover(args: &Args, lines: &mut Lines<'_>) -> Result<(), Failure> {
    let line = lines.open(Protocol::Ucp)?;
    let mut rover = Rover::on(line, args.bus.line());
    // The host's first frames are stops, whether or not the robot is heard.
    rover.find(|| false)?;
    rover.stop()?;
    if let Some(text) = rover.describe() {
        tell(args, &Event::Stopped { node: None, status: None, text });
    }
    Ok(())
}

#[cfg(all(test, unix))]
mod tests;
