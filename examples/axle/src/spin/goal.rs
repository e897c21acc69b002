//! The goal of a motor, and the target that it is for its node.

use axlewire::ikeya::{NodeId, Position, Rps, Status, Target};

use crate::{
    args,
    bus::{Boards, Bus},
    failure::Failure,
};

#[derive(Debug, clap::Args)]
#[group(required = true, multiple = false)]
pub(super) struct GoalArgs {
    /// For a velocity node: turn at this speed, revolutions per second
    #[arg(long, value_name = "X", num_args = 1..=3, allow_negative_numbers = true, value_parser = args::rps)]
    pub(super) rps: Vec<Rps>,

    /// For a position node: move by this many revolutions from where it is
    #[arg(long, value_name = "X", num_args = 1..=3, allow_negative_numbers = true, value_parser = args::revolutions)]
    revolutions: Vec<Position>,
}

/// The requested goal.
#[derive(Clone, Debug)]
pub(super) enum Goal<B: Boards> {
    Speed(B::Velocity),
    /// A distance from the current position.
    Way(Vec<Position>),
}

impl<B: Boards> Goal<B> {
    /// The goal, if it has a value for each motor.
    pub(super) fn new(args: &GoalArgs) -> Option<Self> {
        match &args.revolutions[..] {
            [] => B::velocity(&args.rps).map(Self::Speed),
            way if way.len() == B::MOTORS => Some(Self::Way(way.to_vec())),
            _ => None,
        }
    }

    /// The target for this node, if it answers and is in the right mode.
    pub(super) fn target(
        &self,
        node: NodeId,
        bus: &Bus<B>,
        status: Option<Status<B>>,
    ) -> Result<Target<B>, Failure> {
        let refuse = |line: String| Err(Failure::Failed(line));
        match (self, status) {
            (Self::Speed(speed), Some(Status::Velocity(_))) => Ok(Target::Velocity(*speed)),
            (Self::Way(way), Some(status @ Status::Position(_))) => {
                let starts = B::positions(status).unwrap_or_default();
                let mut goals = Vec::new();
                for (at, way) in starts.iter().zip(way) {
                    let goal = at.counts().checked_add(way.counts()).map(Position::from_counts);
                    let Some(Ok(goal)) = goal else {
                        return refuse(format!(
                            "node {node} is at {:.4} turns: {:.4} turns more exceed the range of \
                             a position",
                            at.revolutions(),
                            way.revolutions(),
                        ));
                    };
                    goals.push(goal);
                }
                match B::position(&goals) {
                    Some(goal) => Ok(Target::Position(goal)),
                    None => refuse(format!("node {node} has another number of motors")),
                }
            }
            (Self::Way(_), Some(Status::Velocity(_))) => {
                refuse(format!("node {node} is in velocity mode: use --rps"))
            }
            (Self::Speed(_), Some(Status::Position(_))) => {
                refuse(format!("node {node} is in position mode: use --revolutions"))
            }
            (_, None) => {
                let found: Vec<_> = bus
                    .nodes()
                    .filter(|(other, ..)| *other != node)
                    .map(|(node, mode, _)| format!("{node} ({mode})"))
                    .collect();
                let found = if found.is_empty() { "none".to_owned() } else { found.join(", ") };
                let hint = bus.hint(node);
                refuse(format!("node {node} does not answer{hint}; nodes that do: {found}"))
            }
        }
    }
}
