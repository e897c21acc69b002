//! Actions on a motor bus, in small steps or one exchange at a time.

use crate::names::*;

#[derive(Clone, Copy, Debug)]
pub(crate) enum Action {
    Call(Call),
    /// The next packet is handed out, with this fate.
    Send(Fate),
    /// The node that was asked answers.
    Answer(Answer),
    /// An answer that was too late arrives.
    LateAnswer,
    /// The mode switch is moved.
    Switch(NodeId),
    /// The node restarts.
    Reset(NodeId),
    /// The shaft is turned by hand or by a load, farther than a hold allows.
    Turn(NodeId),
    Wait(Wait),
    /// A set-point, followed by an answered exchange.
    Command(NodeId),
    /// Everything up to the end of the next window, in one action.
    Exchange(Exchange),
}

/// A call of the application.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Call {
    Set(NodeId),
    Stop(NodeId),
    StopAll,
    Release(NodeId),
    Confirm(NodeId),
    Read(NodeId),
    Discover,
    KeepAlive,
}

/// The fate of a packet.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub(crate) enum Fate {
    Arrives,
    /// Lost on the wire, undetected.
    Lost,
    /// The port takes it in parts, and a late answer arrives in between.
    Parts,
    /// The master does not want its rest any more.
    GivenUp,
    /// The port took no byte of it.
    Untouched,
    /// The port took a part of it.
    CutOff,
    /// The port took it and failed to flush, but it arrives.
    UnflushedArrives,
    /// The same, but it does not arrive.
    UnflushedLost,
}

/// The kind of answer. Silence is no answer at all.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub(crate) enum Answer {
    Right,
    Late,
    Damaged,
    /// Another node answers in its place.
    OfAnother,
    /// An older answer of the same node is complete 1 µs after the request was handed out, before
    /// the line could have carried it.
    Leftover,
}

#[derive(Clone, Copy, Debug)]
pub(crate) enum Wait {
    Short,
    Deadline,
    PastDeadline,
    Long,
}

/// The fate of an exchange and of the WRITEs before it.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Exchange {
    Right,
    Silent,
    Damaged,
    OfAnother,
    Late,
    /// A leftover answer, then the right one.
    Leftover,
    /// The WRITEs are lost, the READ is answered.
    WritesLost,
    /// The port does not take the first packet.
    Untouched,
    CutOff,
    Unflushed,
}

impl Exchange {
    pub(crate) const fn parts(self) -> (Fate, Option<Answer>) {
        match self {
            Self::Right => (Fate::Arrives, Some(Answer::Right)),
            Self::Silent => (Fate::Lost, None),
            Self::Damaged => (Fate::Arrives, Some(Answer::Damaged)),
            Self::OfAnother => (Fate::Arrives, Some(Answer::OfAnother)),
            Self::Late => (Fate::Arrives, Some(Answer::Late)),
            Self::Leftover => (Fate::Arrives, Some(Answer::Leftover)),
            Self::WritesLost => (Fate::Lost, Some(Answer::Right)),
            Self::Untouched => (Fate::Untouched, Some(Answer::Right)),
            Self::CutOff => (Fate::CutOff, Some(Answer::Right)),
            Self::Unflushed => (Fate::UnflushedLost, Some(Answer::Right)),
        }
    }
}

/// The actions of a world.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Menu {
    /// One exchange at a time, instead of small steps.
    pub(crate) is_coarse: bool,
    /// Only set-points, stops, and exchanges that are answered or not: a busy queue.
    pub(crate) is_queue: bool,
    /// The configuration polls continuously: a node in the cycle has a bounded wait.
    pub(crate) polls_fastest: bool,
}

impl Menu {
    pub(crate) const FINE: Self = Self { is_coarse: false, is_queue: false, polls_fastest: true };
    pub(crate) const COARSE: Self = Self { is_coarse: true, is_queue: false, polls_fastest: true };
    pub(crate) const QUEUE: Self = Self { is_queue: true, ..Self::COARSE };

    pub(crate) fn actions(self, nodes: usize, sends: bool, heard: bool, late: bool) -> Vec<Action> {
        let mut actions = Vec::with_capacity(40);
        if self.is_queue {
            for &node in &NodeId::ALL[..nodes] {
                actions.extend([Action::Command(node), Action::Call(Call::Stop(node))]);
            }
            actions.extend([Exchange::Right, Exchange::Silent].map(Action::Exchange));
            return actions;
        }
        Self::calls(nodes, &mut actions);
        for &node in &NodeId::ALL[..nodes] {
            actions.extend([Action::Switch(node), Action::Reset(node)]);
        }
        if self.is_coarse {
            use Exchange as E;
            actions.push(Action::Wait(Wait::Long));
            actions.extend(
                [E::Right, E::Silent, E::Damaged, E::OfAnother, E::Late, E::WritesLost]
                    .map(Action::Exchange),
            );
            actions
                .extend([E::Untouched, E::CutOff, E::Unflushed, E::Leftover].map(Action::Exchange));
            return actions;
        }
        actions.extend(
            [Wait::Short, Wait::Deadline, Wait::PastDeadline, Wait::Long].map(Action::Wait),
        );
        if sends {
            use Fate as F;
            actions.extend([F::Arrives, F::Lost, F::Untouched, F::CutOff].map(Action::Send));
            actions.extend([F::UnflushedArrives, F::UnflushedLost].map(Action::Send));
        } else {
            actions.push(Action::Send(Fate::Arrives)); // only time passes
        }
        if heard {
            use Answer as A;
            actions.extend([A::Right, A::Late, A::Damaged, A::OfAnother].map(Action::Answer));
            actions.push(Action::Answer(A::Leftover));
        }
        if late {
            actions.push(Action::LateAnswer);
            actions.extend(sends.then_some(Action::Send(Fate::Parts)));
        }
        actions
    }

    fn calls(nodes: usize, actions: &mut Vec<Action>) {
        for &node in &NodeId::ALL[..nodes] {
            actions.extend([Call::Set(node), Call::Stop(node)].map(Action::Call));
            let calls = [Call::Release(node), Call::Confirm(node), Call::Read(node)];
            actions.extend(calls.map(Action::Call));
        }
        actions.extend([Call::StopAll, Call::Discover, Call::KeepAlive].map(Action::Call));
    }
}
