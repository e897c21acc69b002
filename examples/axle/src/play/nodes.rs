//! The commanded nodes of a bus, and the master that commands them.

use std::collections::VecDeque;

use axlewire::{
    ikeya::{
        NodeId, Target,
        master::{NodeSet, Polling},
    },
    time::{Duration, Instant},
};

use super::{
    effect::Effect,
    plan::{Due, Plan},
    playing::{Given, Voice},
};
use crate::{
    bus::{self, Boards, Bus},
    failure::Failure,
    line::Line,
    listing::Modes,
    signals::Signals,
};

/// Period at which the master reads each node, besides the READs of the plan, and repeats its
/// latest command: a node that turns or falls silent gets no more.
const WATCH_PERIOD: Duration = Duration::from_millis(100);

/// The nodes that a plan commands, and their master. Without any, the master is silent, and what
/// the plan has leaves as it is.
pub(super) struct Nodes<B: Boards> {
    bus: Bus<B>,
    nodes: NodeSet,
    /// Their modes before the first command.
    modes: Modes,
    /// What the commands of the plan are in these modes, in their order.
    targets: VecDeque<Target<B>>,
    /// The latest command of each node.
    given: Vec<(NodeId, Target<B>)>,
    /// The node that was asked last, and how many requests it had been sent before.
    asked: Option<(NodeId, u32)>,
    reads_back: bool,
    is_json: bool,
}

impl<B: Boards> Voice for Nodes<B> {
    /// Reads the modes, and checks each command against that of its node.
    fn prepare(plan: &Plan<'_>, line: Line, signals: &Signals) -> Result<Option<Self>, Failure> {
        let node = |due: &Due| match &due.effect {
            Effect::Write(write) => Some((write.node, true)),
            Effect::Ask(node) => Some((*node, false)),
            _ => None,
        };
        let named: Vec<_> = plan.frames.iter().filter_map(node).collect();
        let nodes: NodeSet =
            named.iter().filter_map(|(node, is_write)| is_write.then_some(*node)).collect();
        let mut config = bus::complete(plan.bus.config(), plan.bus.line(), &line);
        config.nodes = named.into_iter().map(|(node, _)| node).collect();
        config.polling = Polling::Every(WATCH_PERIOD);
        let mut bus = Bus::new(line, config);
        if !nodes.is_empty() && !bus.discover(signals)? {
            return Ok(None);
        }
        let mut modes = Modes::default();
        for node in nodes.iter() {
            let Some(status) = bus.read(node, signals)? else {
                if signals.is_raised() {
                    return Ok(None);
                }
                let hint = bus.hint(node);
                let line = format!(
                    "node {node} does not answer{hint}: without its mode, nothing is sent to it"
                );
                return Err(Failure::Failed(line));
            };
            modes.learn(node, status.mode());
        }
        let mut targets = VecDeque::new();
        for due in &plan.frames {
            if let Effect::Write(write) = &due.effect
                && let Some(status) = bus.status(write.node)
            {
                let target = write.target(status, due.meant, &plan.limits);
                targets.push_back(target.map_err(Failure::Failed)?);
            }
        }
        let Plan { reads_back, is_json, .. } = *plan;
        Ok(Some(Self {
            bus,
            nodes,
            modes,
            targets,
            given: Vec::new(),
            asked: None,
            reads_back,
            is_json,
        }))
    }

    fn modes(&self) -> Modes {
        self.modes
    }

    fn now(&mut self) -> Instant {
        self.bus.now()
    }

    /// Whether the latest commands have left, and the latest READ: none replaces one that waits.
    fn is_free(&self) -> bool {
        let master = self.bus.master();
        self.given.iter().all(|(node, _)| master.is_set_point_sent(*node))
            && self.asked.is_none_or(|(node, before)| {
                self.requests(node) != before || master.read_outcome(node).is_some()
            })
    }

    fn give(&mut self, due: &Due, now: Instant) -> Result<Given, Failure> {
        self.asked = None;
        match &due.effect {
            _ if self.nodes.is_empty() => self.bus.interject(&due.bytes).map(Given::whole),
            Effect::Write(write) => {
                let Some(target) = self.targets.pop_front() else { return Ok(Given::Lost) };
                self.bus.command(write.node, target, now)?;
                self.given.retain(|(node, _)| *node != write.node);
                self.given.push((write.node, target));
                if self.reads_back {
                    // The command is what counts.
                    let _ = self.bus.master_mut().read(write.node, now);
                }
                Ok(Given::Taken)
            }
            Effect::Ask(node) => {
                let asked = (*node, self.requests(*node));
                if self.bus.master_mut().read(*node, now).is_err() {
                    // The master looks for a node that does not answer on its own.
                    return Ok(Given::LeftOut);
                }
                self.asked = Some(asked);
                Ok(Given::Taken)
            }
            _ => Ok(Given::Lost),
        }
    }

    fn check(&self) -> Result<(), Failure> {
        self.given.iter().try_for_each(|(node, target)| self.bus.check_follows(*node, *target))
    }

    fn round(&mut self, until: Instant) -> Result<(), Failure> {
        let now = self.bus.now();
        self.bus.master_mut().keep_alive(now);
        self.bus.round(until)
    }

    fn stop(mut self) -> Result<Vec<String>, Failure> {
        if !self.nodes.is_empty() {
            self.bus.halt_all(self.nodes)?;
        }
        let told = self.nodes.iter().map(|node| {
            let status = self.bus.status(node);
            let modes = status.map(|status| status.mode()).zip(self.modes.of(node));
            match modes.filter(|(mode, meant)| mode != meant) {
                Some((mode, meant)) => Err(Failure::Failed(format!(
                    "node {node} has changed to {mode} mode: it may have taken commands for \
                     {meant} mode"
                ))),
                None if self.is_json => Ok(format!("{{\"event\":\"stopped\",\"node\":{node}}}")),
                None => {
                    let status = status.map(B::describe).unwrap_or_default();
                    Ok(format!("node {node}: {status}, stopped and confirmed"))
                }
            }
        });
        told.collect()
    }
}

impl<B: Boards> Nodes<B> {
    /// How many requests a node has been sent.
    fn requests(&self, node: NodeId) -> u32 {
        self.bus.master().node_statistics(node).requests
    }
}
