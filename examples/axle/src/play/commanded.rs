//! The commanded nodes of a bus: their modes are read first, and they are stopped at the end.

use axlewire::ikeya::{
    NodeId,
    master::{MasterConfig, NodeSet},
};

use super::{
    effect::Effect,
    player::Due,
    playing::{Plan, play, turned},
};
use crate::{
    bus::{self, Boards, Bus, Halt},
    failure::Failure,
    line::Line,
    listing::Modes,
    signals::Signals,
};

/// Sends the frames of a plan.
pub(super) fn run<B: Boards>(plan: Plan<'_>, signals: &Signals) -> Result<(), Failure> {
    let line = Line::open(plan.bus.line(), plan.protocol)?;
    let Some(commanded) = Commanded::<B>::prepare(&plan, &line, signals)? else {
        return signals.interrupted();
    };
    let (is_json, moves, modes) = (plan.is_json, !commanded.nodes.is_empty(), commanded.modes);
    play(plan, &line, modes, signals, moves, |seen| {
        let told = commanded.stop(seen)?.into_iter().map(|(node, status)| match is_json {
            true => format!("{{\"event\":\"stopped\",\"node\":{node}}}"),
            false => format!("node {node}: {status}, stopped and confirmed"),
        });
        Ok(told.collect())
    })
}

/// The nodes that a plan commands.
struct Commanded<B: Boards> {
    nodes: NodeSet,
    /// Their modes before the first frame.
    modes: Modes,
    /// Their master. The one that has read the modes also stops them: it can even stop a node
    /// whose answers are lost meanwhile.
    bus: Bus<B>,
    line: Line,
    config: MasterConfig,
}

impl<B: Boards> Commanded<B> {
    /// Reads the modes, and checks each command against that of its node; `None` if a signal came
    /// first.
    fn prepare(plan: &Plan<'_>, line: &Line, signals: &Signals) -> Result<Option<Self>, Failure> {
        let write = |due: &Due| match &due.effect {
            Effect::Write(write) => Some((write.clone(), due.meant)),
            _ => None,
        };
        let writes: Vec<_> = plan.frames.iter().filter_map(write).collect();
        let nodes: NodeSet = writes.iter().map(|(write, _)| write.node).collect();
        let mut config = bus::complete(plan.bus.config(), plan.bus.line(), line);
        config.nodes = nodes;
        let mut bus = Bus::new(line.clone(), config);
        let mut modes = Modes::default();
        if !nodes.is_empty() && !bus.discover(signals)? {
            return Ok(None);
        }
        for node in nodes.iter() {
            let Some(status) = bus.read(node, signals)? else {
                if signals.is_raised() {
                    return Ok(None);
                }
                let line =
                    format!("node {node} does not answer: without its mode, nothing is sent to it");
                return Err(Failure::Failed(line));
            };
            modes.learn(node, status.mode());
            for (write, meant) in writes.iter().filter(|(write, _)| write.node == node) {
                write.check(status, *meant, &plan.limits).map_err(Failure::Failed)?;
            }
        }
        Ok(Some(Self { nodes, modes, bus, line: line.clone(), config }))
    }

    /// Stops the nodes; `seen` are the modes in which they have answered last. Returns the status
    /// of each at rest.
    fn stop(mut self, seen: Modes) -> Result<Vec<(NodeId, String)>, Failure> {
        if self.nodes.is_empty() {
            return Ok(Vec::new());
        }
        // The master did not hear the answers in between.
        self.bus.refresh(self.nodes);
        // A stop in the wrong mode would send a motor to position 0. So a node that has changed its
        // mode, and has not told this master, is left to one that has to hear it first.
        let is_known = |node: &NodeId| seen.of(*node) == self.bus.master().mode(*node);
        let known: NodeSet = self.nodes.iter().filter(is_known).collect();
        let unknown: NodeSet = self.nodes.iter().filter(|node| !is_known(node)).collect();
        let mut config = self.config;
        config.nodes = unknown;
        let mut other = Bus::new(self.line.clone(), config);
        let (mut failure, mut complaints, mut stopped) = (None, Vec::new(), Vec::new());
        for (bus, nodes) in [(&mut self.bus, known), (&mut other, unknown)] {
            if nodes.is_empty() {
                continue;
            }
            failure = bus.stop(nodes).err().or(failure);
            complaints.extend(nodes.iter().filter_map(|node| complaint(bus, node)));
            for node in nodes.iter() {
                let (meant, now) = (self.modes.of(node), bus.master().mode(node));
                stopped.push((node, meant, now, bus.status(node).map(B::describe)));
            }
        }
        if !complaints.is_empty() {
            let complaint = complaints.join("; ");
            return Err(match failure {
                Some(failure) => failure.while_moving(&complaint),
                None => Failure::Failed(complaint),
            });
        }
        let told = stopped.into_iter().map(|(node, meant, now, status)| match (meant, now) {
            (Some(meant), Some(now)) if meant != now => Err(turned(node, now, meant)),
            _ => Ok((node, status.unwrap_or_default())),
        });
        told.collect()
    }
}

fn complaint<B: Boards>(bus: &Bus<B>, node: NodeId) -> Option<String> {
    match bus.halt(node) {
        // This master has not heard it, but the one before has.
        Halt::Silent => Some(format!(
            "node {node} was commanded and does not answer any more: it may be moving"
        )),
        _ => bus.complaint(node),
    }
}

#[cfg(all(test, unix))]
mod tests;
