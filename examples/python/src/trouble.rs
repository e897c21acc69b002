//! What can go wrong on a line, and its exceptions.

use std::fmt::Display;

use axlewire::{
    drive::DriveError,
    ikeya::{
        NodeId,
        master::{CommandError, NodeSet},
    },
    ucp::host::CommandError as Refusal,
};
use pyo3::{create_exception, exceptions::PyException, prelude::*};

create_exception!(axlewire, Error, PyException, "Something went wrong on a line.");
create_exception!(
    axlewire,
    StopsOwed,
    Error,
    "The stops of these nodes are not confirmed: their motors may be running."
);
create_exception!(
    axlewire,
    StillMoving,
    Error,
    "Told to stop, but not seen to stand still: it may be moving."
);
create_exception!(axlewire, NotOnline, Error, "The node or the robot is not heard.");
create_exception!(axlewire, Refused, Error, "The command is refused, and nothing was sent.");
create_exception!(axlewire, NoAnswer, Error, "Nothing was answered in time.");
create_exception!(axlewire, PortLost, Error, "The port has failed or is closed.");

/// The exception's text, and its nodes, are those of the Rust library, with what to do here.
const TO_DISCOVER: &str = ": `discover` asks for it";

/// A failure, in the thread of a driver.
#[derive(Clone, Debug)]
pub(crate) struct Trouble {
    kind: Kind,
    text: String,
    nodes: Vec<u8>,
}

#[derive(Clone, Copy, Debug)]
enum Kind {
    StopsOwed,
    StillMoving,
    NotOnline,
    Refused,
    NoAnswer,
    PortLost,
    Other,
}

impl Trouble {
    /// A command that is not carried out, and why.
    pub(crate) fn refused(text: &str) -> Self {
        Self { kind: Kind::Refused, text: text.to_owned(), nodes: Vec::new() }
    }

    /// These nodes are not heard any more.
    pub(crate) fn not_heard(nodes: impl Iterator<Item = NodeId>) -> Option<Self> {
        let nodes: Vec<_> = nodes.map(NodeId::get).collect();
        let named: Vec<_> = nodes.iter().map(u8::to_string).collect();
        let text = format!("not heard any more: node {}; it may be moving", named.join(", "));
        (!nodes.is_empty()).then_some(Self { kind: Kind::NotOnline, text, nodes })
    }

    /// The thread has ended by a bug: what it has moved may be moving.
    pub(crate) fn bug() -> Self {
        let text = "the package has a bug and gave up: what was moved may be moving".to_owned();
        Self { kind: Kind::StillMoving, text, nodes: Vec::new() }
    }

    /// As an exception with the text and the nodes.
    pub(crate) fn raised(self, py: Python<'_>) -> PyErr {
        let text = self.text;
        let error = match self.kind {
            Kind::StopsOwed => StopsOwed::new_err(text),
            Kind::StillMoving => StillMoving::new_err(text),
            Kind::NotOnline => NotOnline::new_err(text),
            Kind::Refused => Refused::new_err(text),
            Kind::NoAnswer => NoAnswer::new_err(text),
            Kind::PortLost => PortLost::new_err(text),
            Kind::Other => Error::new_err(text),
        };
        // As numbers: a `Vec<u8>` would become bytes.
        let nodes: Vec<u16> = self.nodes.into_iter().map(u16::from).collect();
        let told = error.value(py).setattr("nodes", nodes);
        told.err().unwrap_or(error)
    }
}

/// The exception of a line that was left.
pub(crate) fn closed() -> PyErr {
    PortLost::new_err("the line is closed")
}

/// The exception of a line that another process has.
pub(crate) fn elsewhere() -> PyErr {
    PortLost::new_err("the line belongs to the process that opened it")
}

fn ids(nodes: NodeSet) -> Vec<u8> {
    nodes.iter().map(|node| node.get()).collect()
}

impl<E: Display> From<DriveError<E>> for Trouble {
    fn from(error: DriveError<E>) -> Self {
        let mut text = error.to_string();
        let (kind, nodes) = match error {
            DriveError::StopsOwed(nodes) => (Kind::StopsOwed, ids(nodes)),
            DriveError::StillMoving(nodes) => (Kind::StillMoving, ids(nodes)),
            DriveError::NoStandstill(_) => (Kind::StillMoving, Vec::new()),
            DriveError::Bus(CommandError::NotOnline { node }) => {
                text.push_str(TO_DISCOVER);
                (Kind::NotOnline, vec![node.get()])
            }
            DriveError::Bus(
                CommandError::WrongMode { node, .. }
                | CommandError::ModeInDoubt { node }
                | CommandError::StopOwed { node }
                | CommandError::NoSetPoint { node },
            ) => (Kind::Refused, vec![node.get()]),
            DriveError::Rover(Refusal::LinkDown) => (Kind::NotOnline, Vec::new()),
            DriveError::Bus(_) | DriveError::Rover(_) | DriveError::Value(_) => {
                (Kind::Refused, Vec::new())
            }
            DriveError::ReadFailed { node, .. } => (Kind::NoAnswer, vec![node.get()]),
            DriveError::Timeout(_) | DriveError::Calibration(_) => (Kind::NoAnswer, Vec::new()),
            DriveError::Port(_)
            | DriveError::Closed
            | DriveError::WriteZero
            | DriveError::Stalled => (Kind::PortLost, Vec::new()),
            _ => (Kind::Other, Vec::new()),
        };
        Self { kind, text, nodes }
    }
}
