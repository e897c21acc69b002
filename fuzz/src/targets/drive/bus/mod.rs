//! The drivers of a motor bus: a master with up to eight nodes, or a slave.

mod checks;
mod slave;

use arbitrary::{Arbitrary, Result, Unstructured};
use axlewire::{
    ikeya::{
        Master, NodeId, Position, Rps, WriteRequest,
        master::{MasterConfig, NodeSet, Polling},
    },
    time::Duration,
};

use super::{
    Tally,
    bus_peer::{Bus, Heard},
    fault::{Call, Fault},
    port::Port,
    rig::{ENOUGH, How, Pinned, Rig, Wired, call},
};

#[derive(Arbitrary, Debug)]
struct Setup {
    is_slave: bool,
    has_pin: bool,
    wraps: bool,
    is_there: u8,
    is_position: u8,
    polling: u8,
    dead_man: bool,
    knows_nodes: bool,
}

#[derive(Arbitrary, Clone, Copy, Debug)]
enum Do {
    Service,
    NextEvent { ms: u8 },
    RunUntil { ms: u8 },
    Discover,
    SetVelocity { node: NodeId, rps: i8 },
    SetPosition { node: NodeId, turns: i8 },
    DriveFor { node: NodeId, rps: i8, ms: u8 },
    Read { node: NodeId },
    Stop { node: NodeId },
    StopAll,
    Deafen { nodes: u8 },
    Discard,
    Fault { call: Call, fault: Fault },
    Heal,
    Pass { units: u16 },
    Noise { bytes: [u8; 3] },
    Switch { node: NodeId, is_there: bool, is_position: bool },
    Request { node: NodeId, rps: Option<i8> },
}

pub(crate) fn bus(data: &[u8], tally: &mut Tally) {
    let _ = play(&mut Unstructured::new(data), tally);
}

fn play(u: &mut Unstructured<'_>, tally: &mut Tally) -> Result<()> {
    let setup: Setup = u.arbitrary()?;
    match setup.has_pin {
        true => with_port::<Pinned>(u, &setup, tally),
        false => with_port::<Port>(u, &setup, tally),
    }
}

fn with_port<P: Wired>(u: &mut Unstructured<'_>, setup: &Setup, tally: &mut Tally) -> Result<()>
where
    <P as embedded_io::ErrorType>::Error: core::fmt::Debug,
{
    let begin_us = if setup.wraps { u64::MAX / 2 - 20_000 } else { 0 };
    let peer = Bus::default();
    peer.0.borrow_mut().is_there = bits(setup.is_there);
    for (index, is_position) in bits(setup.is_position).into_iter().enumerate() {
        peer.0.borrow_mut().switch(index, is_position);
    }
    if setup.is_slave {
        return slave::slave::<P>(u, begin_us, tally);
    }
    let mut config = MasterConfig::direct();
    config.polling = [Polling::Fastest, Polling::Every(Duration::from_millis(5)), Polling::Manual]
        [usize::from(setup.polling % 3)];
    config.coast = COAST;
    config.dead_man = setup.dead_man.then_some(Duration::from_millis(50));
    if setup.knows_nodes {
        let is_there = |id: &NodeId| setup.is_there >> (id.get() - 1) & 1 == 1;
        config.nodes = NodeId::ALL.into_iter().filter(is_there).collect();
    }
    let rig = Rig::new(begin_us, 20, peer.peer(), |now| Master::new(config, now));
    let mut life = BusLife::<P> {
        rig,
        peer,
        was_position: bits(setup.is_position),
        owed_from: [None; 8],
        coasting: NodeSet::NONE,
    };
    for _ in 0..40 {
        if u.is_empty() || life.rig.world.calls() > ENOUGH {
            break;
        }
        let (what, how) = (u.arbitrary()?, u.arbitrary()?);
        let kind = life.perform(what, how);
        tally.did(kind);
    }
    Ok(())
}

struct BusLife<P: Wired> {
    rig: Rig<Master, P>,
    peer: Bus,
    /// Nodes that were in position mode at any time: any WRITE may be a stop of theirs.
    was_position: [bool; 8],
    /// Length of each node's log when its stop became owed.
    owed_from: [Option<usize>; 8],
    /// Nodes whose stop was confirmed, but that were not still, after the last call.
    coasting: NodeSet,
}

/// Time in which a motor may come to rest.
const COAST: Duration = Duration::from_millis(50);

fn bits(bits: u8) -> [bool; 8] {
    core::array::from_fn(|node| bits >> node & 1 == 1)
}

const MS: fn(u32) -> Duration = Duration::from_millis;

fn index(node: NodeId) -> usize {
    usize::from(node.get() - 1)
}

fn rps(value: i8) -> Rps {
    Rps::new(f32::from(value) / 4.0).expect("finite")
}

impl<P: Wired> BusLife<P>
where
    <P as embedded_io::ErrorType>::Error: core::fmt::Debug,
{
    fn perform(&mut self, what: Do, how: How) -> u8 {
        let (before, logs) = (self.rig.begin(), self.logs());
        let bound = self.rig.driver.role().read_bound().saturating_mul(4);
        let stop_bound = self.rig.driver.role().stop_bound() + COAST;
        // Nothing is in the way of a stop: no fault is planned, and every id on the bus answers.
        let is_calm = self.rig.is_clean() && self.peer.0.borrow().is_there == [true; 8];
        let kind = match what {
            Do::Service => {
                let done = call!(self.rig, how, service());
                self.rig.end(&before, MS(0), done.as_ref());
                0
            }
            Do::NextEvent { ms } => {
                let within = MS(ms.into());
                let done = call!(self.rig, how, next_event(within));
                self.rig.end(&before, MS(ms.into()), done.as_ref());
                1
            }
            Do::RunUntil { ms } => {
                let span = MS(ms.into());
                let done = call!(self.rig, how, run_for(span, |_, _, _| ()));
                self.rig.end(&before, MS(ms.into()), done.as_ref());
                2
            }
            Do::Discover => {
                let done = call!(self.rig, how, discover());
                self.rig.end(&before, bound, done.as_ref());
                if let Some(Ok(found)) = done {
                    for (node, mode) in found {
                        let log = &self.peer.0.borrow().log[index(node)];
                        let has_answered = log.iter().any(|it| matches!(it, Heard::Answered(_)));
                        assert!(has_answered, "{node} {mode}");
                    }
                }
                3
            }
            Do::SetVelocity { node, rps: to } => {
                let done = call!(self.rig, how, set_velocity(node, rps(to)));
                self.rig.end(&before, bound, done.as_ref());
                self.check_set(done, WriteRequest::velocity(node, rps(to)).as_bytes(), &before);
                4
            }
            Do::SetPosition { node, turns } => {
                let to = Position::new(-5, turns.into());
                let done = call!(self.rig, how, set_position(node, to));
                self.rig.end(&before, bound, done.as_ref());
                self.check_set(done, WriteRequest::position(node, to).as_bytes(), &before);
                5
            }
            Do::DriveFor { node, rps: to, ms } => {
                let (to, span) = (rps(to), MS(u32::from(ms) / 4));
                let done = call!(self.rig, how, drive_for(node, to, span));
                self.rig.end(&before, bound + span + stop_bound, done.as_ref());
                if done.is_some_and(|done| done.is_ok()) {
                    self.follow(&logs);
                    self.check_obeyed(node);
                    assert!(!self.rig.driver.role().stops_owed().contains(node));
                    self.check_paid(node, logs[index(node)]);
                }
                6
            }
            Do::Read { node } => {
                let done = call!(self.rig, how, read(node));
                self.rig.end(&before, bound, done.as_ref());
                self.check_read(node, done, logs[index(node)]);
                7
            }
            Do::Stop { node } => {
                let done = call!(self.rig, how, stop(node));
                self.rig.end(&before, stop_bound, done.as_ref());
                self.check_stop(node.into(), done, &logs, is_calm);
                8
            }
            Do::StopAll => {
                let done = call!(self.rig, how, stop_all());
                self.rig.end(&before, stop_bound, done.as_ref());
                let nodes = self.rig.driver.role().config().nodes;
                self.check_stop(nodes, done, &logs, is_calm);
                9
            }
            Do::Deafen { nodes } => {
                self.peer.0.borrow_mut().is_deaf = bits(nodes);
                10
            }
            Do::Discard => {
                let rest = self.rig.driver.unsent().len();
                assert_eq!(self.rig.driver.discard(), rest);
                assert!(self.rig.driver.unsent().is_empty());
                11
            }
            Do::Fault { call, fault } => {
                self.rig.fault(call, fault);
                12
            }
            Do::Heal => {
                self.rig.heal();
                13
            }
            Do::Pass { units } => {
                self.rig.world.step(u64::from(units) * 16);
                14
            }
            Do::Noise { bytes } => {
                self.rig.port().receive(&bytes);
                15
            }
            Do::Switch { node, is_there, is_position } => {
                let mut nodes = self.peer.0.borrow_mut();
                nodes.is_there[index(node)] = is_there;
                nodes.switch(index(node), is_position);
                self.was_position[index(node)] |= is_position;
                16
            }
            Do::Request { node, .. } => {
                // A sign of life, or a new request of the application.
                let now = self.rig.driver.now();
                self.rig.driver.role_mut().keep_alive(now);
                self.rig.driver.role_mut().release(node);
                17
            }
        };
        self.follow(&logs);
        kind
    }
}
