//! A slave: commands and answers through a port that fails.

use arbitrary::{Result, Unstructured};
use axlewire::{
    ikeya::{
        Mode, NodeId, Position, ReadRequest, Slave, Target, WriteRequest,
        slave::{SlaveConfig, SlaveEvent},
    },
    time::{Duration, Instant},
};

use super::{
    super::{
        Tally,
        rig::{ENOUGH, How, Rig, Wired, call},
    },
    Do, MS, rps,
};

pub(super) fn slave<P: Wired>(
    u: &mut Unstructured<'_>,
    begin_us: u64,
    tally: &mut Tally,
) -> Result<()>
where
    <P as embedded_io::ErrorType>::Error: core::fmt::Debug,
{
    let mut config = SlaveConfig::direct();
    config.watchdog = Some(Duration::from_millis(50));
    let mode = if u.arbitrary()? { Mode::Velocity } else { Mode::Position };
    let role = |now| -> Slave { Slave::new(NodeId::N1, mode, config, now) };
    let mut rig = Rig::<Slave, P>::new(begin_us, 20, None, role);
    // When each WRITE arrived.
    let mut written: Vec<(Instant, WriteRequest)> = Vec::new();
    for _ in 0..40 {
        if u.is_empty() || rig.world.calls() > ENOUGH {
            break;
        }
        let (what, how): (Do, How) = (u.arbitrary()?, u.arbitrary()?);
        let before = rig.begin();
        match what {
            Do::Request { node, rps: None } => {
                rig.port().receive(ReadRequest::new(node).as_bytes())
            }
            Do::Request { node, rps: Some(to) } => {
                let write = WriteRequest::velocity(node, rps(to));
                rig.port().receive(write.as_bytes());
                let at = rig.last_arrival();
                written.extend((node == NodeId::N1).then_some((at, write)));
            }
            Do::Service => {
                let done = call!(rig, how, service());
                rig.end(&before, MS(0), done.as_ref());
            }
            Do::NextEvent { ms } | Do::RunUntil { ms } => {
                let done = call!(rig, how, next_command(MS(ms.into())));
                rig.end(&before, MS(ms.into()), done.as_ref());
                if let Some(Ok(Some(SlaveEvent::Command(target)))) = done {
                    assert!(written.iter().any(|(_, write)| means(write, target)), "{target:?}");
                }
            }
            Do::SetVelocity { rps: to, .. } => rig.driver.role_mut().set_velocity(rps(to)),
            Do::SetPosition { turns, .. } => {
                rig.driver.role_mut().set_position(Position::new(1, turns.into()));
            }
            Do::Fault { call, fault } => rig.fault(call, fault),
            Do::Heal => rig.heal(),
            Do::Pass { units } => rig.world.step(u64::from(units) * 16),
            Do::Noise { bytes } => rig.port().receive(&bytes[..1]),
            _ => continue,
        }
        let now = rig.driver.now();
        if let Some(target) = rig.driver.role().command(now) {
            // A pause of up to 4 ms goes unnoticed.
            let limit = Duration::from_millis(50 + 4 + 2);
            let is_recent =
                |(at, write): &&(Instant, WriteRequest)| now - *at <= limit && means(write, target);
            assert!(written.iter().rev().any(|it| is_recent(&it)), "{target:?} is out of date");
        }
        let counters = rig.driver.role().counters();
        assert_eq!(counters.received, rig.port().given);
        tally.did(18);
    }
    tally.did(19);
    Ok(())
}

fn means(write: &WriteRequest, target: Target) -> bool {
    match target {
        Target::Velocity(rps) => write.as_velocity().to_bits() == rps.get().to_bits(),
        Target::Position(at) => write.as_position() == at,
    }
}
