//! What the frames of all protocols have in common when they are printed.

use std::fmt::Write;

use axlewire::{
    ikeya::{self, Mode, NodeId, Position, three},
    ucp::{
        self, Message,
        message::{FirmwareReport, RawMotorControl, Report},
    },
};
use serde::Serialize;

use super::Out;
use crate::args::Protocol;

/// The modes of the nodes of a bus, as far as their answers have told them: the bytes of a WRITE do
/// not say whether they are a speed or a position (ruling I3).
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Modes([Option<Mode>; NodeId::ALL.len()]);

impl Modes {
    pub(crate) fn of(&self, node: NodeId) -> Option<Mode> {
        self.0.get(usize::from(node.get()) - 1).copied().flatten()
    }

    pub(crate) fn learn(&mut self, node: NodeId, mode: Mode) {
        if let Some(known) = self.0.get_mut(usize::from(node.get()) - 1) {
            *known = Some(mode);
        }
    }

    /// A node that has another mode in `others`.
    pub(crate) fn conflict(&self, others: &Self) -> Option<NodeId> {
        NodeId::ALL.into_iter().find(|&node| {
            let modes = self.of(node).zip(others.of(node));
            modes.is_some_and(|(mode, other)| mode != other)
        })
    }

    /// Takes over what is known later.
    pub(crate) fn update(&mut self, later: &Self) {
        for (known, later) in self.0.iter_mut().zip(later.0) {
            *known = later.or(*known);
        }
    }
}

/// A frame of a message that most captures are made of: its number, and what is in it.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Hot<'a> {
    Report(u8, &'a FirmwareReport),
    Control(u8, &'a RawMotorControl),
    Velocity(u8, f32),
    Position(u8, Position),
}

/// A frame of any protocol.
pub(crate) trait Shown: Serialize + Copy {
    const PROTOCOL: Protocol;

    fn name(&self) -> &'static str;

    fn bytes(&self) -> &[u8];

    /// The node, or the index of the sender.
    fn number(&self) -> u8;

    /// The number that, with the name, identifies messages of one kind: node or id.
    fn key(&self) -> u8 {
        self.number()
    }

    /// The frame as one of those that come often, if it is one.
    fn hot(&self) -> Option<Hot<'_>> {
        None
    }

    /// Contents as text, with units.
    fn contents(&self, out: &mut Out, modes: &Modes);

    /// The node that this frame commands, if its bytes do not tell a speed from a position.
    fn commands(&self) -> Option<NodeId> {
        None
    }

    /// Learns the mode of the node that answers.
    fn teach(&self, _modes: &mut Modes) {}
}

impl Shown for &ucp::Frame {
    const PROTOCOL: Protocol = Protocol::Ucp;

    fn name(&self) -> &'static str {
        self.message().name()
    }

    fn bytes(&self) -> &[u8] {
        self.as_bytes()
    }

    fn number(&self) -> u8 {
        self.index()
    }

    fn key(&self) -> u8 {
        self.id()
    }

    fn hot(&self) -> Option<Hot<'_>> {
        match self.message() {
            Message::Report(Report::Firmware(report)) => Some(Hot::Report(self.index(), report)),
            Message::MotorControl(control) => Some(Hot::Control(self.index(), control)),
            _ => None,
        }
    }

    fn contents(&self, out: &mut Out, _: &Modes) {
        // The output never fails.
        let _ = write!(out, "{}", self.message().contents());
    }
}

/// Packets of one kind of board: those of a direction, and of both.
macro_rules! shown {
    ($of:path, $protocol:expr, $hot:expr) => {
        const _: () = {
            use $of as of;

            fn teach(response: &of::Response<'_>, modes: &mut Modes) {
                let mode = match response {
                    of::Response::Velocity(_) => Mode::Velocity,
                    of::Response::Position(_) => Mode::Position,
                };
                modes.learn(response.id(), mode);
            }

            fn commands(request: &of::Request<'_>) -> Option<NodeId> {
                match request {
                    of::Request::Read(_) => None,
                    of::Request::Write(write) => Some(write.id()),
                }
            }

            impl Shown for of::Request<'_> {
                shown!(@ common $protocol);

                fn commands(&self) -> Option<NodeId> {
                    commands(self)
                }
            }

            impl Shown for of::Response<'_> {
                shown!(@ common $protocol);

                fn hot(&self) -> Option<Hot<'_>> {
                    $hot(self)
                }

                fn teach(&self, modes: &mut Modes) {
                    teach(self, modes);
                }
            }

            impl Shown for of::Packet<'_> {
                shown!(@ common $protocol);

                fn hot(&self) -> Option<Hot<'_>> {
                    match self {
                        Self::Request(_) => None,
                        Self::Response(response) => $hot(response),
                    }
                }

                fn commands(&self) -> Option<NodeId> {
                    match self {
                        Self::Request(request) => commands(request),
                        Self::Response(_) => None,
                    }
                }

                fn teach(&self, modes: &mut Modes) {
                    if let Self::Response(response) = self {
                        teach(response, modes);
                    }
                }
            }
        };
    };
    (@ common $protocol:expr) => {
        const PROTOCOL: Protocol = $protocol;

        fn name(&self) -> &'static str {
            self.name()
        }

        fn bytes(&self) -> &[u8] {
            self.as_bytes()
        }

        fn number(&self) -> u8 {
            self.id().get()
        }

        fn contents(&self, out: &mut Out, modes: &Modes) {
            // The output never fails.
            let _ = write!(out, "{}", self.contents().in_mode(modes.of(self.id())));
        }
    };
}

shown!(ikeya, Protocol::Ikeya, |response: &ikeya::Response<'_>| {
    let node = response.id().get();
    Some(match response {
        ikeya::Response::Velocity(answer) => Hot::Velocity(node, answer.rps()),
        ikeya::Response::Position(answer) => Hot::Position(node, answer.position()),
    })
});
shown!(three, Protocol::Ikeya3, |_: &three::Response<'_>| None);
