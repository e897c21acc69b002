//! The nodes of a motor bus, as far as the traffic tells.

use axlewire::ikeya::{Mode, NodeId};

use super::{Log, Rate, Trend};

/// Time without traffic after which a node or a READ counts as past.
const PAST: u64 = 1_000_000;

/// Number of consecutive READs without an answer that make a node silent (ruling I7).
const STRIKES: u32 = 3;

/// The values of one motor or of three: rps or turns.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Values {
    numbers: [f64; 3],
    count: usize,
}

impl Values {
    pub(crate) fn new(values: &[f64]) -> Self {
        let mut numbers = [0.0; 3];
        numbers.iter_mut().zip(values).for_each(|(slot, value)| *slot = *value);
        Self { numbers, count: values.len() }
    }

    pub(crate) fn all(&self) -> &[f64] {
        self.numbers.get(..self.count).unwrap_or(&self.numbers)
    }
}

/// What is known of a node.
#[derive(Clone, Debug, Default)]
pub(crate) struct Node {
    /// The mode of its last answer.
    pub(crate) mode: Option<Mode>,
    /// The values of its last answer, and when that came.
    pub(crate) values: Option<(Values, u64)>,
    /// The last WRITE to it, read as speeds and as positions: its bytes do not say which (ruling
    /// I3).
    pub(crate) command: Option<(Values, Values)>,
    /// All packets of and for the node.
    pub(crate) packets: Rate,
    pub(crate) reads: u64,
    pub(crate) answers: u64,
    /// READs without an answer before the next request, all of them and the latest in a row.
    pub(crate) missing: u64,
    in_a_row: u32,
    /// Time from the last answered READ to its answer, microseconds: both as heard here.
    pub(crate) latency: Option<u64>,
    /// Skipped bytes after a request to this node, or after its own packets.
    pub(crate) damaged: u64,
    pub(crate) trend: Trend,
    heard_at: u64,
}

/// State of a node.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub(crate) enum Health {
    /// It answers.
    Fine,
    /// The last READs, fewer than three, were not answered.
    Missing(u32),
    /// Three READs in a row were not answered.
    Silent,
    /// No traffic from it or to it for a second.
    Quiet,
    /// Commands to it are heard, but neither READs nor answers.
    Commanded,
}

impl Node {
    pub(crate) fn health(&self, now: u64) -> Health {
        match self.in_a_row {
            _ if now.saturating_sub(self.heard_at) > PAST => Health::Quiet,
            0 if self.answers == 0 && self.reads == 0 => Health::Commanded,
            0 => Health::Fine,
            strikes if strikes < STRIKES => Health::Missing(strikes),
            _ => Health::Silent,
        }
    }

    /// The last commanded values, if they can be read.
    pub(crate) fn commanded(&self) -> Option<Values> {
        let (as_rps, as_turns) = self.command?;
        match self.mode? {
            Mode::Velocity => Some(as_rps),
            Mode::Position => Some(as_turns),
        }
    }
}

/// A motor bus.
#[derive(Clone, Debug, Default)]
pub(crate) struct Bus {
    nodes: [Option<Node>; NodeId::ALL.len()],
    /// Whether the boards have three motors and answer WRITEs as well (ruling I10).
    is_of_three: bool,
    /// The node whose answer is due, and since when.
    asked: Option<(NodeId, u64)>,
    /// The node of the last packet.
    last: Option<NodeId>,
}

impl Bus {
    pub(crate) fn of_three() -> Self {
        Self { is_of_three: true, ..Self::default() }
    }

    pub(crate) const fn is_of_three(&self) -> bool {
        self.is_of_three
    }

    /// The nodes with any traffic from or to them.
    pub(crate) fn nodes(&self) -> impl Iterator<Item = (NodeId, &Node)> {
        NodeId::ALL.into_iter().zip(&self.nodes).filter_map(|(id, node)| Some((id, node.as_ref()?)))
    }

    fn node(&mut self, id: NodeId) -> Option<&mut Node> {
        let slot = self.nodes.get_mut(usize::from(id.get()) - 1)?;
        Some(slot.get_or_insert_with(Node::default))
    }

    /// A packet of or for this node.
    fn packet(&mut self, id: NodeId, at: u64) -> Option<&mut Node> {
        self.last = Some(id);
        let node = self.node(id)?;
        node.packets.count += 1;
        node.heard_at = at;
        Some(node)
    }

    pub(super) fn read(&mut self, id: NodeId, at: u64, log: &mut Log) {
        self.miss(at, log);
        self.asked = Some((id, at));
        if let Some(node) = self.packet(id, at) {
            node.reads += 1;
        }
    }

    pub(super) fn write(
        &mut self,
        id: NodeId,
        as_rps: Values,
        as_turns: Values,
        at: u64,
        log: &mut Log,
    ) {
        self.miss(at, log);
        self.asked = self.is_of_three.then_some((id, at));
        if let Some(node) = self.packet(id, at) {
            node.command = Some((as_rps, as_turns));
        }
    }

    pub(super) fn answer(
        &mut self,
        id: NodeId,
        mode: Mode,
        values: Values,
        at: u64,
        log: &mut Log,
    ) {
        let asked = self.asked;
        let Some(node) = self.packet(id, at) else { return };
        match asked {
            Some((asked, since)) if asked == id => {
                node.latency = Some(at.saturating_sub(since));
            }
            Some((asked, _)) => {
                log.event(at, id, format!("node {id} answered when node {asked} was asked"));
            }
            None => {}
        }
        match node.mode.replace(mode) {
            None => log.event(at, id, format!("node {id} answers, in {mode} mode")),
            Some(before) if before != mode => {
                log.event(at, id, format!("node {id} has changed from {before} to {mode} mode"));
                // The change ends the set-point (ruling I11).
                node.command = None;
            }
            Some(_) if node.in_a_row >= STRIKES => {
                let missing = node.in_a_row;
                log.event(at, id, format!("node {id} answers again, {missing} were missing"));
            }
            Some(_) => {}
        }
        node.in_a_row = 0;
        node.answers += 1;
        node.values = Some((values, at));
        self.asked = self.asked.filter(|(asked, _)| *asked != id);
    }

    /// Counts a READ that was not answered.
    fn miss(&mut self, at: u64, log: &mut Log) {
        let Some((id, _)) = self.asked.take() else { return };
        let Some(node) = self.node(id) else { return };
        node.missing += 1;
        node.in_a_row = node.in_a_row.saturating_add(1);
        if node.in_a_row == STRIKES && node.answers > 0 {
            log.event(at, id, format!("node {id} no longer answers: {STRIKES} are missing"));
        }
    }

    /// The node whose answer is due, or that of the last packet.
    pub(super) const fn near(&self) -> Option<NodeId> {
        match self.asked {
            Some((id, _)) => Some(id),
            None => self.last,
        }
    }

    /// Counts skipped bytes on the node that they are near.
    pub(super) fn damage(&mut self, id: NodeId, bytes: u64) {
        if let Some(node) = self.node(id) {
            node.damaged += bytes;
        }
    }

    pub(super) fn tick(&mut self, now: u64, log: &mut Log) {
        if self.asked.is_some_and(|(_, since)| now.saturating_sub(since) > PAST) {
            self.miss(now, log);
        }
        for node in self.nodes.iter_mut().flatten() {
            let fresh = node.values.filter(|(_, at)| now.saturating_sub(*at) <= PAST);
            node.trend.tick(fresh.and_then(|(values, _)| values.all().first().copied()), now);
        }
    }

    pub(super) fn measure(&mut self, seconds: f64) {
        self.nodes.iter_mut().flatten().for_each(|node| node.packets.measure(seconds));
    }
}
