//! A motor bus on a port, with its master; shared by `scan`, `spin` and `stop`.

mod patience;

use std::time::Duration as Span;

use axlewire::{
    drive::DriveError,
    ikeya::{
        Master, Mode, NodeId, Status, Target,
        board::OneMotor,
        master::{Cause, Health, MasterConfig, MasterEvent, NodeSet, Polling, StopProgress},
    },
    time::{Duration, Instant},
};

use crate::{
    args::{self, Protocol},
    clock,
    failure::Failure,
    line::{FAILURE_PAUSE, Line},
    session::Session,
    signals::{ABSENCE, DEAD_MAN, Signals},
};

pub(crate) use crate::boards::Boards;
pub(crate) use patience::Patience;

/// Period at which each node is read and its set-point repeated: short enough for every motor, and
/// a USB adapter keeps up with three nodes.
const PERIOD: Duration = Duration::from_millis(20);

/// Longest interval between two rounds on the bus.
const LOOK_PERIOD: Duration = Duration::from_millis(50);

/// Time for which stops that are not confirmed are waited for, at least. The library's own bound is
/// a tenth of a second on a direct line, for a program that goes on; here nobody repeats the stop
/// after it.
const STOP_PATIENCE: Span = Span::from_millis(2000);

/// Time for which an id that never answers is asked before a stop counts it as silent.
const SILENCE: Span = Span::from_millis(1000);

/// Outcome of a stop for one node.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub(crate) enum Halt {
    /// The stop is confirmed, and the motor was measured at rest (ruling I12).
    Still,
    /// The stop is confirmed, but the motor still moves, or is not where it is to hold.
    Moving,
    /// The stop is confirmed, and nothing was heard since that shows whether the motor moves.
    Unseen,
    /// The stop is not confirmed.
    Owed,
    /// The stop is not confirmed, because the mode of the node is in doubt (ruling I11).
    Doubtful,
    /// The id has only ever given damaged answers.
    Damaged,
    /// The id has only ever given answers that were too late or too early.
    Untimely,
    /// The id has never answered.
    Silent,
}

/// The arguments of a master.
#[derive(Debug, clap::Args)]
pub(crate) struct MasterArgs {
    #[command(flatten)]
    line: args::PortArgs,

    /// How long to wait for an answer: direct (500 us, as the protocol specifies, for a UART built
    /// into this machine), usb (20 ms, for an adapter), network (0.1 s), or seconds; by default
    /// network behind tcp:, otherwise usb. axle scan --measure finds out what a line needs
    #[arg(long, value_name = "TIME")]
    reply_timeout: Option<Patience>,

    /// Silence between two packets, seconds, at most 0.02, for transceivers that need it
    #[arg(long, value_name = "SECONDS", value_parser = args::gap)]
    gap: Option<Duration>,

    /// How long a motor may turn on after its stop is confirmed, seconds; by default 2
    #[arg(long, value_name = "SECONDS", value_parser = args::coast)]
    coast: Option<Duration>,

    /// The adapter hears what it sends, as on two wires with the receiver always on: take these
    /// echoes out
    #[arg(long)]
    echo: bool,
}

/// What is tried if answers come late.
const SLOW_TIMEOUT: Duration = Duration::from_millis(500);

/// A port and the master on it.
pub(crate) struct Bus<B: Boards = OneMotor> {
    session: Session<Master<B>>,
    pub(crate) baud: u32,
    /// The master's dead-man has stopped the nodes.
    pub(crate) has_dead_man_fired: bool,
}

impl MasterArgs {
    #[cfg(test)]
    pub(crate) const fn new(line: args::PortArgs, reply_timeout: Option<Patience>) -> Self {
        Self { line, reply_timeout, gap: None, coast: None, echo: false }
    }

    pub(crate) const fn line(&self) -> &args::PortArgs {
        &self.line
    }

    /// Settings of a master for this adapter.
    pub(crate) fn config(&self) -> MasterConfig {
        let is_network = self.line.port.starts_with("tcp:");
        let usual = if is_network { Patience::Network } else { Patience::Usb };
        let mut config = self.reply_timeout.unwrap_or(usual).config();
        config.turnaround_gap = self.gap.unwrap_or(config.turnaround_gap);
        config.coast = self.coast.unwrap_or(config.coast);
        config
    }

    /// Whether a longer time may be tried for answers that come too late.
    pub(crate) const fn may_wait_longer(&self) -> bool {
        self.reply_timeout.is_none()
    }

    /// Opens the port, for a bus of this protocol.
    pub(crate) fn open(&self, protocol: Protocol) -> Result<Line, Failure> {
        Line::open(&self.line, protocol).map(|line| self.without_echo(line))
    }

    /// This line, without its echo if it has one.
    pub(crate) fn without_echo(&self, line: Line) -> Line {
        if self.echo { line.without_echo() } else { line }
    }
}

/// Completes the settings of a master for this line.
pub(crate) fn complete(config: MasterConfig, args: &args::PortArgs, line: &Line) -> MasterConfig {
    let mut config = config;
    config.baud = args.baud_for(Protocol::Ikeya);
    config.polling = Polling::Every(PERIOD);
    config.accepts_early = line.is_instant();
    config.dead_man = Some(ABSENCE);
    config
}

impl<B: Boards> Bus<B> {
    pub(crate) fn open(args: &MasterArgs) -> Result<Self, Failure> {
        let line = args.open(B::PROTOCOL)?;
        let config = complete(args.config(), &args.line, &line);
        Ok(Self::new(line, config))
    }

    /// Asks all ids for their status; `false` if a signal came first.
    pub(crate) fn discover(&mut self, signals: &Signals) -> Result<bool, Failure> {
        let now = self.now();
        self.master_mut().discover(now);
        while self.master().is_discovering() && !signals.is_raised() {
            self.look()?;
        }
        Ok(!signals.is_raised())
    }

    /// Listens for a second, or until an answer comes that is too late: for a line on which nothing
    /// was heard so far.
    pub(crate) fn listen(&mut self, signals: &Signals) -> Result<(), Failure> {
        let end = self.now() + SLOW_TIMEOUT + SLOW_TIMEOUT;
        let is_late = |bus: &Self| NodeId::ALL.into_iter().any(|node| bus.late(node) > 0);
        while self.now() < end && !is_late(self) && !signals.is_raised() {
            self.look()?;
        }
        Ok(())
    }

    /// Whether the answers of an id come too late, and could be waited for longer: all of them, or
    /// so many that it counts as offline, although one was in time by chance.
    pub(crate) fn could_wait_longer(&self) -> bool {
        let config = self.master().config();
        let is_late = |node| self.late(node) > 0 && !self.is_online(node);
        config.reply_timeout < SLOW_TIMEOUT && config.nodes.iter().any(is_late)
    }

    /// The same, once each id has been asked, and two answers were late: one alone may be a hiccup.
    fn must_wait_longer(&self) -> bool {
        let nodes = || self.master().config().nodes.iter();
        let late: u32 = nodes().map(|node| self.late(node)).sum();
        self.could_wait_longer() && late > 1 && !nodes().any(|node| self.is_unasked(node, 1))
    }

    /// Ids that have answered, in time or not.
    pub(crate) fn those_heard(&self) -> NodeSet {
        let nodes = self.master().config().nodes.iter();
        nodes.filter(|&node| self.status(node).is_some() || self.is_untimely(node)).collect()
    }

    /// Ids that may have answered, also with damaged bytes: part of a late answer may count as a
    /// damaged one of another id. On a slow line, others may be there all the same.
    pub(crate) fn may_be_there(&self) -> NodeSet {
        let heard = self.those_heard();
        let is_there = |node: &NodeId| heard.contains(*node) || self.is_damaged(*node);
        self.master().config().nodes.iter().filter(is_there).collect()
    }

    /// Begins anew with half a second for answers, for these nodes, each read this often at most.
    ///
    /// The line is left alone before: an old answer must not count as a new one.
    pub(crate) fn begin_patiently(&mut self, nodes: NodeSet, attempts: u8) {
        clock::sleep(span(SLOW_TIMEOUT));
        self.begin_now(nodes, attempts);
    }

    /// Leaves the line alone for half a second, and then takes in what has come meanwhile.
    pub(crate) fn leave_alone(&mut self) -> Result<(), Failure> {
        self.begin_patiently(NodeSet::NONE, u8::MAX);
        self.look()
    }

    /// The same as [`begin_patiently`](Self::begin_patiently), for a line that was left alone.
    pub(crate) fn begin_now(&mut self, nodes: NodeSet, attempts: u8) {
        let mut config = *self.master().config();
        (config.nodes, config.attempts) = (nodes, config.attempts.min(attempts));
        config = patience::with_reply_timeout(config, SLOW_TIMEOUT);
        self.session.begin_anew(|now| Master::for_board(config, now));
    }

    /// What this line needs for `--reply-timeout`, by the answers so far.
    pub(crate) fn needed_patience(&self) -> Option<Patience> {
        let longest = NodeId::ALL
            .into_iter()
            .filter_map(|node| self.master().node_statistics(node).latency.max());
        Some(Patience::for_slowest(longest.max()?))
    }

    /// Time from the latest READ of a node that was answered to its answer.
    pub(crate) fn last_latency(&self, node: NodeId) -> Option<Duration> {
        self.master().node_statistics(node).latency.last()
    }

    /// Number of answers of a node that were too late.
    pub(crate) fn late(&self, node: NodeId) -> u32 {
        self.master().node_statistics(node).late
    }

    /// Number of answers of a node that were too early for the speed of the line.
    pub(crate) fn early(&self, node: NodeId) -> u32 {
        self.master().node_statistics(node).early
    }

    /// What to do about a node that does not answer in time, for the end of a message.
    pub(crate) fn hint(&self, node: NodeId) -> &'static str {
        match self.is_untimely(node) && self.late(node) > 0 {
            true => {
                " in time, but later: axle scan --measure finds the --reply-timeout that this line needs"
            }
            false => "",
        }
    }

    /// Reads a node now, so that no decision uses an old mode or position. `None` if it does not
    /// answer, or a signal came first.
    pub(crate) fn read(
        &mut self,
        node: NodeId,
        signals: &Signals,
    ) -> Result<Option<Status<B>>, Failure> {
        let start = self.now();
        let end = start + self.master().stop_bound();
        if self.master_mut().read(node, start).is_err() {
            return Ok(None);
        }
        while !signals.is_raised() && self.is_online(node) && self.now() < end {
            self.look()?;
            if let Some(status) = self.fresh(node, start) {
                return Ok(Some(status));
            }
        }
        Ok(None)
    }

    /// The status of a node, if it was measured after `since` and its mode is certain.
    fn fresh(&self, node: NodeId, since: Instant) -> Option<Status<B>> {
        let (status, at) = self.master().status(node)?;
        (at > since && !self.master().is_mode_in_doubt(node)).then_some(status)
    }

    pub(crate) fn new(line: Line, config: MasterConfig) -> Self {
        let session = Session::new(line, |now| Master::for_board(config, now));
        Self { session, baud: config.baud, has_dead_man_fired: false }
    }

    pub(crate) fn now(&mut self) -> Instant {
        self.session.now()
    }

    pub(crate) fn path(&self) -> &str {
        self.session.path()
    }

    /// Ends the recording, if there is one, for use while nothing moves; fails if it is incomplete.
    pub(crate) fn check_recording(&self) -> Result<(), Failure> {
        self.session.check_recording()
    }

    pub(crate) const fn master(&self) -> &Master<B> {
        self.session.role()
    }

    pub(crate) const fn master_mut(&mut self) -> &mut Master<B> {
        self.session.role_mut()
    }

    /// Runs until something happens, at most until `until`. Callers query the master for what has
    /// happened; only the dead-man's event would be lost on them.
    pub(crate) fn round(&mut self, until: Instant) -> Result<(), Failure> {
        let (mut next, result) = match self.session.round(until) {
            Ok(event) => (event, Ok(())),
            Err(failure) => (self.session.poll_event(), Err(failure)),
        };
        while let Some(event) = next {
            self.has_dead_man_fired |= event == MasterEvent::DeadMan;
            next = self.session.poll_event();
        }
        result
    }

    fn look(&mut self) -> Result<(), Failure> {
        let until = self.now() + LOOK_PERIOD;
        self.round(until)
    }

    /// Last measurement of a node.
    pub(crate) fn status(&self, node: NodeId) -> Option<Status<B>> {
        self.master().status(node).map(|(status, _)| status)
    }

    /// The nodes that have answered so far, each with its mode and status.
    pub(crate) fn nodes(&self) -> impl Iterator<Item = (NodeId, Mode, Status<B>)> {
        NodeId::ALL.into_iter().filter_map(|node| {
            let status = self.status(node)?;
            Some((node, status.mode(), status))
        })
    }

    /// Whether an id has given only damaged answers.
    pub(crate) fn is_damaged(&self, node: NodeId) -> bool {
        self.status(node).is_none() && self.master().node_statistics(node).crc_errors > 0
    }

    /// Whether an id has given whole answers, but none in its window.
    fn is_untimely(&self, node: NodeId) -> bool {
        self.status(node).is_none() && (self.late(node) > 0 || self.early(node) > 0)
    }

    pub(crate) fn is_online(&self, node: NodeId) -> bool {
        matches!(self.master().health(node), Some(Health::Online | Health::Suspect(_)))
    }

    /// Sends a packet that is not the master's; `false` if it did not leave whole.
    pub(crate) fn interject(&mut self, packet: &[u8]) -> Result<bool, Failure> {
        self.session.interject(packet)
    }

    /// Commands a node, unless the master refuses it.
    pub(crate) fn command(
        &mut self,
        node: NodeId,
        target: Target<B>,
        now: Instant,
    ) -> Result<(), Failure> {
        match target {
            Target::Velocity(velocity) => self.master_mut().set_velocity(node, velocity, now),
            Target::Position(position) => self.master_mut().set_position(node, position, now),
        }
        .map_err(|error| Failure::Failed(error.to_string()))
    }

    /// Fails if a node no longer follows this command.
    pub(crate) fn check_follows(&self, node: NodeId, target: Target<B>) -> Result<(), Failure> {
        let refuse = |line: String| Err(Failure::Failed(line));
        match self.master().mode(node) {
            _ if !self.is_online(node) => refuse(format!("node {node} no longer answers")),
            Some(mode) if mode != target.mode() => {
                refuse(format!("node {node} has changed to {mode} mode"))
            }
            _ if self.master().is_mode_in_doubt(node) => {
                let other = match target.mode() {
                    Mode::Velocity => Mode::Position,
                    Mode::Position => Mode::Velocity,
                };
                refuse(format!("node {node} has answered in {other} mode"))
            }
            _ if self.has_dead_man_fired => refuse(DEAD_MAN.to_owned()),
            _ if self.master().set_point(node) != Some(target) => {
                refuse(format!("node {node} has lost its command"))
            }
            _ => Ok(()),
        }
    }

    /// Stops these nodes; fails if one of them is not at rest then.
    pub(crate) fn halt_all(&mut self, nodes: NodeSet) -> Result<(), Failure> {
        let failure = self.stop(nodes).err();
        let complaints: Vec<_> = nodes.iter().filter_map(|node| self.complaint(node)).collect();
        let complaint = complaints.join("; ");
        match failure {
            _ if complaint.is_empty() => Ok(()),
            Some(failure) => Err(failure.while_moving(&complaint)),
            None => Err(Failure::Failed(complaint)),
        }
    }

    /// Stops these nodes as the library does, and waits until those that have answered are still.
    /// The library cannot know which ids exist, waits for all of its time for those that never
    /// answer, and takes a suspension of the tool for time in which a node was silent or moved.
    ///
    /// If they are not all still, a failure of the port is returned. The wait is bounded, and no
    /// signal ends it early.
    pub(crate) fn stop(&mut self, nodes: NodeSet) -> Result<(), Failure> {
        self.stop_while(nodes, |_| true)
    }

    /// The same, but if two answers come too late, and could be waited for, gives up as soon as
    /// each id has been asked: from then on, an answer may be that to an older READ.
    pub(crate) fn stop_in_time(&mut self, nodes: NodeSet) -> Result<(), Failure> {
        self.stop_while(nodes, |bus| !bus.must_wait_longer())
    }

    fn stop_while(
        &mut self,
        nodes: NodeSet,
        goes_on: impl Fn(&Self) -> bool,
    ) -> Result<(), Failure> {
        let begin = self.session.awake();
        self.tell_to_stop(nodes);
        self.await_answers(nodes, self.master().config().attempts, &goes_on);
        if goes_on(self) { self.confirm_stops(nodes, begin) } else { Ok(()) }
    }

    /// The same of all nodes of the master. These are asked once, and told to stop, before the
    /// others; whatever becomes of them then, the others do not wait for it.
    pub(crate) fn stop_all_but_first(&mut self, first: NodeSet) -> Result<(), Failure> {
        let (config, begin) = (*self.master().config(), self.session.awake());
        self.tell_to_stop(first);
        self.await_answers(first, 1, |_| true);
        self.tell_to_stop(config.nodes.iter().filter(|node| !first.contains(*node)).collect());
        self.await_answers(config.nodes, config.attempts, |_| true);
        self.confirm_stops(config.nodes, begin)
    }

    fn tell_to_stop(&mut self, nodes: NodeSet) {
        let now = self.now();
        nodes.iter().for_each(|node| self.master_mut().stop(node, now));
    }

    /// Waits until each of these nodes has answered, or was asked this often and counts as silent.
    fn await_answers(&mut self, nodes: NodeSet, attempts: u8, goes_on: impl Fn(&Self) -> bool) {
        let begin = self.session.awake();
        let time = |bus: &Self| bus.session.awake() - begin;
        // Until each id has been asked as often as it is to be, if the port works.
        let window = span(self.master().config().reply_timeout);
        let asking = STOP_PATIENCE.max(window * (2 * u32::from(attempts) * nodes.len() as u32 + 1));
        let silence = if attempts > 1 { SILENCE } else { Span::ZERO };
        while self.heard(nodes) != nodes
            && time(self) < asking
            && (time(self) < silence || nodes.iter().any(|node| self.is_unasked(node, attempts)))
        {
            if !goes_on(self) {
                return;
            }
            if self.look().is_err() {
                clock::sleep(FAILURE_PAUSE);
            }
        }
        // The latest READ has its time, too.
        let (answered, end) = (self.heard(nodes), time(self) + window);
        while answered != nodes && self.heard(nodes) == answered && time(self) < end {
            if self.look().is_err() {
                clock::sleep(FAILURE_PAUSE);
            }
        }
    }

    /// Waits until those of these nodes that have answered are still.
    fn confirm_stops(&mut self, nodes: NodeSet, begin: Span) -> Result<(), Failure> {
        let (patience, coast) = (self.stop_patience(), span(self.master().config().coast));
        loop {
            let heard = self.heard(nodes);
            let time = |bus: &Self| bus.session.awake() - begin;
            let is_over = match self.session.stop(heard) {
                // A node that was silent may have answered meanwhile.
                Ok(()) => self.heard(nodes) == heard,
                Err(DriveError::StillMoving(_)) => time(self) >= coast,
                Err(_) => time(self) >= patience,
            };
            if is_over {
                let are_still = nodes.iter().all(|node| self.halt(node) == Halt::Still);
                return if are_still { Ok(()) } else { self.look() };
            }
        }
    }

    /// Time within which nodes that answer confirm a stop.
    fn stop_patience(&self) -> Span {
        span(self.master().stop_bound()).max(STOP_PATIENCE)
    }

    /// Those of these nodes that have ever answered.
    fn heard(&self, nodes: NodeSet) -> NodeSet {
        nodes.iter().filter(|&node| self.status(node).is_some()).collect()
    }

    /// Whether an id has never answered, but was asked less often than this.
    fn is_unasked(&self, node: NodeId, attempts: u8) -> bool {
        let requests = self.master().node_statistics(node).requests;
        self.status(node).is_none() && requests < attempts.into()
    }

    /// Outcome so far for a node that was told to stop.
    pub(crate) fn halt(&self, node: NodeId) -> Halt {
        match self.master().stop_progress(node) {
            StopProgress::StandingStill => Halt::Still,
            StopProgress::StillMoving => Halt::Moving,
            StopProgress::Confirmed => Halt::Unseen,
            _ if self.is_damaged(node) => Halt::Damaged,
            _ if self.is_untimely(node) => Halt::Untimely,
            _ if self.status(node).is_none() => Halt::Silent,
            _ if self.master().is_mode_in_doubt(node) => Halt::Doubtful,
            _ => Halt::Owed,
        }
    }

    /// The same as a message; `None` if the motor is at rest.
    pub(crate) fn complaint(&self, node: NodeId) -> Option<String> {
        Some(match self.halt(node) {
            Halt::Still => return None,
            Halt::Moving => {
                let seconds = span(self.master().config().coast).as_secs_f64();
                let now = self.status(node).map(B::describe).unwrap_or_default();
                format!(
                    "node {node} confirmed the stop, but is still moving after {seconds} s: {now}"
                )
            }
            Halt::Unseen => {
                format!(
                    "node {node} confirmed the stop, but was not seen to be still: it may be moving"
                )
            }
            Halt::Owed => {
                let is_late = self.late(node) > 0;
                let heard = heard(self.is_online(node), is_late, self.master().last_failure(node));
                format!(
                    "node {node} was told to stop and has not confirmed it{heard}: it may be moving"
                )
            }
            Halt::Doubtful => format!(
                "the mode of node {node} is in doubt, so it cannot be stopped: it may be moving"
            ),
            Halt::Damaged => {
                format!("id {node} gives only damaged answers: its motor may be moving")
            }
            Halt::Untimely if self.late(node) > 0 => format!(
                "id {node} gives only answers that are too late: its motor may be moving; use a \
                 longer --reply-timeout"
            ),
            Halt::Untimely => format!(
                "id {node} gives only answers that are too early: its motor may be moving; use \
                 --instant if the port has no line speed"
            ),
            Halt::Silent => format!("node {node} does not answer"),
        })
    }
}

fn span(duration: Duration) -> Span {
    Span::from_micros(duration.as_micros().into())
}

/// What was heard of a node that has not confirmed its stop.
const fn heard(is_online: bool, is_late: bool, failure: Option<Cause>) -> &'static str {
    match failure {
        _ if is_online => "",
        _ if is_late => " (its answers come too late)",
        Some(Cause::Damaged) => " (damaged bytes received)",
        Some(Cause::Unexpected) => " (other answers received)",
        _ => " (nothing received)",
    }
}

#[cfg(all(test, unix))]
mod tests;
