//! A motor bus: set-points and measured values, response times, errors.

use std::collections::BTreeMap;

use axlewire::ikeya::Position;

use super::{
    columns::Columns,
    errors::Errors,
    line::{Line, Mode, Numbers},
    picture::{Look, Panel, Series, Size, colour},
};

/// Counts of a turn (ruling I5).
const COUNTS: f64 = Position::COUNTS_PER_REVOLUTION as f64;

/// READs in a row without an answer that make a node silent (ruling I7): its curve ends.
const STRIKES: u32 = 3;

/// Number of a node and of a motor on its board.
type Motor = (u8, usize);

/// The curves of a bus.
#[derive(Debug, Default)]
pub(super) struct Bus {
    /// Whether boards have three motors and answer WRITEs as well (ruling I10).
    is_of_three: bool,
    velocity: Curves,
    position: Curves,
    /// Milliseconds per node.
    response: BTreeMap<u8, Columns>,
    errors: Errors,
    nodes: BTreeMap<u8, Node>,
    /// The node whose answer is due, and since when.
    asked: Option<(u8, u64)>,
    /// Whether there was one.
    has_requests: bool,
    /// Commands whose meaning is not known: in front of the first answer of their node (ruling
    /// I3).
    ambiguous: u64,
}

/// Set-points and measured values.
#[derive(Debug, Default)]
struct Curves {
    set_point: BTreeMap<Motor, Columns>,
    measured: BTreeMap<Motor, Columns>,
}

#[derive(Debug, Default)]
struct Node {
    mode: Option<Mode>,
    /// READs without an answer in a row.
    missing: u32,
}

impl Bus {
    pub(super) fn new(is_of_three: bool) -> Self {
        Self { is_of_three, ..Self::default() }
    }

    /// Takes in a line; `has_times` says whether the places are times.
    pub(super) fn take(&mut self, line: &Line<'_>, x: u64, has_times: bool) {
        let Some(node) = line.node else { return self.errors.gap(line, x) };
        if (line.mode == Some(Mode::Velocity) || line.message == "velocity_response")
            && line.rps.all().iter().any(|rps| !rps.is_finite())
        {
            self.errors.nan(node, x);
        }
        let as_turns = |count, rotation: f64| rotation + count / COUNTS;
        match line.message {
            "read_request" => self.ask(node, x),
            "write" => {
                self.miss();
                if self.is_of_three {
                    (self.asked, self.has_requests) = (Some((node, x)), true);
                }
                match line.mode {
                    Some(Mode::Velocity) => put(&mut self.velocity.set_point, node, x, &line.rps),
                    Some(Mode::Position) => {
                        let turns = line.count.with(&line.rotation, as_turns);
                        put(&mut self.position.set_point, node, x, &turns);
                    }
                    None => self.ambiguous += 1,
                }
            }
            "velocity_response" => {
                self.answer(node, Mode::Velocity, x, has_times);
                put(&mut self.velocity.measured, node, x, &line.rps);
            }
            "position_response" => {
                self.answer(node, Mode::Position, x, has_times);
                let turns = line.count.with(&line.rotation, as_turns);
                put(&mut self.position.measured, node, x, &turns);
            }
            _ => {}
        }
    }

    fn ask(&mut self, node: u8, x: u64) {
        self.miss();
        self.asked = Some((node, x));
        self.has_requests = true;
    }

    /// Books a poll whose answer has not come before the next request.
    fn miss(&mut self) {
        let Some((node, since)) = self.asked.take() else { return };
        self.errors.silent(node, since);
        let known = self.nodes.entry(node).or_default();
        known.missing = known.missing.saturating_add(1);
        if known.missing == STRIKES {
            self.velocity.measured_of(node).for_each(Columns::cut);
            self.position.measured_of(node).for_each(Columns::cut);
        }
    }

    fn answer(&mut self, node: u8, mode: Mode, x: u64, has_times: bool) {
        let known = self.nodes.entry(node).or_default();
        match self.asked {
            Some((asked, since)) if asked == node => {
                self.asked = None;
                if has_times {
                    let millis = x.saturating_sub(since) as f64 / 1e3;
                    self.response.entry(node).or_default().push(x, millis);
                }
            }
            // Behind the next request (ruling I7).
            _ if known.missing > 0 => self.errors.late(node, x),
            Some(_) => self.errors.stray(node, x),
            // A second answer to one request.
            None if self.has_requests => self.errors.stray(node, x),
            // The requests are not in the capture.
            None => {}
        }
        known.missing = 0;
        if known.mode.replace(mode).is_some_and(|before| before != mode) {
            // The change ends the set-point (ruling I11).
            for curves in [&mut self.velocity, &mut self.position] {
                curves.end_set_point(node, x);
            }
        }
    }

    /// The panels that have something to show.
    pub(super) fn panels(self) -> Vec<Panel> {
        let is_of_three = self.is_of_three;
        let panel = |title, unit, curves: Curves| Panel {
            title,
            unit,
            size: Size::Tall,
            least: None,
            series: curves.series(is_of_three),
            hint: match is_of_three {
                true => "wide and pale: set-point; a colour for the three motors of a node",
                false => "wide and pale: set-point",
            },
        };
        let response = self.response.into_iter().map(|(node, columns)| Series {
            name: format!("node {node}"),
            look: Look::Dots,
            colour: colour(node),
            is_named: true,
            columns,
        });
        let response = Panel {
            title: "Response time",
            unit: "ms",
            size: Size::Low,
            least: Some((0.0, 0.0)),
            series: response.collect(),
            hint: "from a request to its answer, as the recording program got them",
        };
        let velocity = panel("Velocity", "1/s", self.velocity);
        let position = panel("Position", "turns", self.position);
        let mut panels = vec![velocity, position, response, self.errors.panel()];
        panels.retain(|panel| !panel.series.is_empty());
        panels
    }

    /// What a reader has to know besides.
    pub(super) fn notes(&self) -> Vec<String> {
        let commands = if self.ambiguous == 1 { "command" } else { "commands" };
        let line = format!(
            "{} {commands} before the first answer of the node: not drawn, the mode was not known",
            self.ambiguous
        );
        if self.ambiguous == 0 { vec![] } else { vec![line] }
    }
}

/// Takes in the values of the motors of a node.
fn put(curves: &mut BTreeMap<Motor, Columns>, node: u8, x: u64, values: &Numbers) {
    for (motor, value) in values.all().iter().enumerate() {
        curves.entry((node, motor)).or_default().push(x, *value);
    }
}

impl Curves {
    fn measured_of(&mut self, node: u8) -> impl Iterator<Item = &mut Columns> {
        self.measured.range_mut((node, 0)..=(node, usize::MAX)).map(|(_, columns)| columns)
    }

    /// The set-point of a node holds until here.
    fn end_set_point(&mut self, node: u8, x: u64) {
        let of_node = self.set_point.range_mut((node, 0)..=(node, usize::MAX));
        for (_, columns) in of_node {
            columns.end(x);
        }
        self.measured_of(node).for_each(Columns::cut);
    }

    fn series(self, is_of_three: bool) -> Vec<Series> {
        let series = |((node, motor), columns), look, what| Series {
            name: match is_of_three {
                true => format!("node {node}, motor {}{what}", motor + 1),
                false => format!("node {node}{what}"),
            },
            look,
            colour: colour(node),
            is_named: look == Look::Line && motor == 0,
            columns,
        };
        let held = self.set_point.into_iter().map(|it| series(it, Look::Held, ", set-point"));
        let lines = self.measured.into_iter().map(|it| series(it, Look::Line, ""));
        held.chain(lines).collect()
    }
}
