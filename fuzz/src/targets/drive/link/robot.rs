//! A robot: commands and reports through a port that fails.

use arbitrary::{Result, Unstructured};
use axlewire::{
    time::Instant,
    ucp::{
        Robot, Telemetry,
        robot::{ReportLayout, RobotConfig},
    },
};

use super::{
    super::{
        Tally,
        link_peer::{Link, frame},
        rig::{ENOUGH, How, Rig, Wired, call},
    },
    Do, MS, Setup, begin_us,
};

pub(super) fn robot<P: Wired>(
    u: &mut Unstructured<'_>,
    setup: &Setup,
    tally: &mut Tally,
) -> Result<()>
where
    <P as embedded_io::ErrorType>::Error: core::fmt::Debug,
{
    let mut config =
        if setup.is_direct { RobotConfig::direct() } else { RobotConfig::usb_adapter() };
    if setup.is_document {
        config.layout = ReportLayout::Document;
    }
    let peer = Link::default();
    let mut rig =
        Rig::<Robot, P>::new(begin_us(setup), 87, peer.peer(), |now| Robot::new(config, now));
    // When each motion arrived.
    let mut told: Vec<(Instant, (i16, i16))> = Vec::new();
    for _ in 0..40 {
        if u.is_empty() || rig.world.calls() > ENOUGH {
            break;
        }
        let (what, how): (Do, How) = (u.arbitrary()?, u.arbitrary()?);
        let before = rig.begin();
        match what {
            Do::Frame { speed, angular } | Do::Drive { speed, angular } => {
                let mut body = [0; 16];
                body[..2].copy_from_slice(&i16::from(speed).to_le_bytes());
                body[2..4].copy_from_slice(&i16::from(angular).to_le_bytes());
                rig.port().receive(&frame(2, &body));
                let motion =
                    (i16::from(speed).clamp(-100, 100), i16::from(angular).clamp(-100, 100));
                told.push((rig.last_arrival(), motion));
            }
            Do::Service => {
                let done = call!(rig, how, service());
                rig.end(&before, MS(0), done.as_ref());
            }
            Do::NextEvent { ms } | Do::Ping { ms } => {
                let done = call!(rig, how, next_event(MS(ms.into())));
                rig.end(&before, MS(ms.into()), done.as_ref());
            }
            Do::RunUntil { ms } | Do::NextReport { ms } => {
                let done = call!(rig, how, next_command(MS(ms.into())));
                rig.end(&before, MS(ms.into()), done.as_ref());
                if let Some(Ok(Some(command))) = done {
                    check_motion(&told, (command.speed(), command.angular()), rig.driver.now());
                }
            }
            Do::Calibrate { is_imu, is_end, .. } => {
                let id = if is_end { 4 } else { 3 };
                rig.port().receive(&frame(id, &[if is_imu { 2 } else { 1 }]));
            }
            Do::Bias { .. } => rig.port().receive(&frame(8, &[0; 19])),
            Do::Stop => {
                let now = rig.driver.now();
                rig.driver.role_mut().set_telemetry(&Telemetry::default(), now);
            }
            Do::Fault { call, fault } => rig.fault(call, fault),
            Do::Heal => rig.heal(),
            Do::Pass { units } => rig.world.step(u64::from(units) * 64),
            Do::Noise { bytes } => rig.port().receive(&bytes),
            Do::Discard => drop(rig.driver.discard()),
            Do::Mute { .. } | Do::DriveFor { .. } => rig.port().receive(&frame(1, &[])),
        }
        let now = rig.driver.now();
        let doing = rig.driver.role().command(now);
        check_motion(&told, (doing.speed(), doing.angular()), now);
        assert_eq!(rig.driver.role().counters().received, rig.port().given);
        for (_, frame) in peer.0.borrow_mut().heard.drain(..) {
            let is_report = frame[4] == 5;
            let len = if setup.is_document { 42 } else { 44 };
            assert!(!is_report || frame.len() == len, "a report in the other layout");
            assert!(frame[4] != 2, "a command from a robot");
        }
        tally.did(17);
    }
    tally.did(18);
    Ok(())
}

/// A motion was told within the watchdog's time; a pause of up to 20 ms goes unnoticed (U10).
fn check_motion(told: &[(Instant, (i16, i16))], motion: (i16, i16), now: Instant) {
    let limit = MS(500 + 20 + 5);
    let is_told = |(at, it): &(Instant, (i16, i16))| *it == motion && now - *at < limit;
    assert!(motion == (0, 0) || told.iter().rev().any(is_told), "{motion:?} is out of date");
}
