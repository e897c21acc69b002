//! The drivers of a rover's link: a host with its robot, or a robot.

mod robot;

use arbitrary::{Arbitrary, Result, Unstructured};
use axlewire::{
    time::Duration,
    ucp::{
        Host,
        host::{COAST, HostConfig, MemoryStore},
        message::CalibrationKind,
    },
};

use super::{
    Tally,
    fault::{Call, Fault},
    link_peer::{Link, frame, motion},
    port::Port,
    rig::{ENOUGH, How, Pinned, Rig, Wired, call},
};

#[derive(Arbitrary, Debug)]
struct Setup {
    is_robot: bool,
    has_pin: bool,
    wraps: bool,
    is_document: bool,
    is_direct: bool,
}

#[derive(Arbitrary, Clone, Copy, Debug)]
enum Do {
    Service,
    NextEvent {
        ms: u8,
    },
    RunUntil {
        ms: u8,
    },
    Drive {
        speed: i8,
        angular: i8,
    },
    DriveFor {
        speed: i8,
        ms: u16,
    },
    Stop,
    Ping {
        ms: u8,
    },
    NextReport {
        ms: u8,
    },
    Calibrate {
        is_imu: bool,
        is_end: bool,
        ms: u16,
    },
    Discard,
    Fault {
        call: Call,
        fault: Fault,
    },
    Heal,
    Pass {
        units: u16,
    },
    Noise {
        bytes: [u8; 3],
    },
    Mute {
        is_mute: bool,
    },
    /// A motor command arrives at a robot, a report at a host.
    Frame {
        speed: i8,
        angular: i8,
    },
    Bias {
        is_imu: bool,
    },
}

pub(crate) fn link(data: &[u8], tally: &mut Tally) {
    let _ = play(&mut Unstructured::new(data), tally);
}

fn play(u: &mut Unstructured<'_>, tally: &mut Tally) -> Result<()> {
    let setup: Setup = u.arbitrary()?;
    match (setup.has_pin, setup.is_robot) {
        (true, false) => host::<Pinned>(u, &setup, tally),
        (false, false) => host::<Port>(u, &setup, tally),
        (true, true) => robot::robot::<Pinned>(u, &setup, tally),
        (false, true) => robot::robot::<Port>(u, &setup, tally),
    }
}

const MS: fn(u32) -> Duration = Duration::from_millis;

fn begin_us(setup: &Setup) -> u64 {
    if setup.wraps { u64::MAX / 2 - 200_000 } else { 0 }
}

fn host<P: Wired>(u: &mut Unstructured<'_>, setup: &Setup, tally: &mut Tally) -> Result<()>
where
    <P as embedded_io::ErrorType>::Error: core::fmt::Debug,
{
    let config = if setup.is_direct { HostConfig::direct() } else { HostConfig::usb_adapter() };
    let peer = Link::default();
    let role = |now| Host::with_store(config, MemoryStore::default(), now);
    let rig = Rig::new(begin_us(setup), 87, peer.peer(), role);
    let mut life = HostLife::<P> { rig, peer, asked: vec![(0, 0)] };
    for _ in 0..40 {
        if u.is_empty() || life.rig.world.calls() > ENOUGH {
            break;
        }
        let (what, how) = (u.arbitrary()?, u.arbitrary()?);
        let kind = life.perform(what, how);
        life.check_motions();
        tally.did(kind);
    }
    Ok(())
}

struct HostLife<P: Wired> {
    rig: Rig<Host<MemoryStore>, P>,
    peer: Link,
    /// Motions that the application has asked for since the last stop.
    asked: Vec<(i16, i16)>,
}

impl<P: Wired> HostLife<P>
where
    <P as embedded_io::ErrorType>::Error: core::fmt::Debug,
{
    fn perform(&mut self, what: Do, how: How) -> u8 {
        let (before, is_clean) = (self.rig.begin(), self.rig.is_clean());
        match what {
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
            Do::Drive { speed, angular } => {
                self.asked.push((speed.into(), angular.into()));
                let done = call!(self.rig, how, drive(speed.into(), angular.into()));
                self.rig.end(&before, MS(0), done.as_ref());
                if speed.unsigned_abs() > 100 || angular.unsigned_abs() > 100 {
                    assert!(!matches!(done, Some(Ok(()))), "out of range (U7)");
                }
                3
            }
            Do::DriveFor { speed, ms } => {
                let span = MS(u32::from(ms) % 1500);
                self.asked.push((speed.into(), 3));
                let done = call!(self.rig, how, drive_for(speed.into(), 3, span));
                self.rig.end(&before, span + MS(200) + COAST, done.as_ref());
                if matches!(done, Some(Ok(()))) {
                    self.check_stopped();
                }
                4
            }
            Do::Stop => {
                let done = call!(self.rig, how, stop());
                self.rig.end(&before, MS(100), done.as_ref());
                match done {
                    Some(Ok(())) => self.check_stopped(),
                    Some(Err(error)) => assert!(!is_clean, "{error:?} from a port that works"),
                    None => {}
                }
                self.asked = vec![(0, 0)];
                5
            }
            Do::Ping { ms } => {
                let within = MS(ms.into());
                let done = call!(self.rig, how, ping(within));
                self.rig.end(&before, MS(ms.into()), done.as_ref());
                6
            }
            Do::NextReport { ms } => {
                let within = MS(ms.into());
                let done = call!(self.rig, how, next_report(within));
                self.rig.end(&before, MS(ms.into()), done.as_ref());
                7
            }
            Do::Calibrate { is_imu, is_end, ms } => {
                let kind =
                    if is_imu { CalibrationKind::Imu } else { CalibrationKind::Magnetometer };
                let ms = u32::from(ms) % 1000;
                let within = MS(ms);
                let done = match is_end {
                    true => call!(self.rig, how, end_calibration(kind, within)),
                    false => call!(self.rig, how, start_calibration(kind, within)),
                };
                self.rig.end(&before, MS(ms), done.as_ref());
                if matches!(done, Some(Ok(()))) {
                    let id = if is_end { 4 } else { 3 };
                    let code = if is_imu { 2 } else { 1 };
                    let heard = &self.peer.0.borrow().heard;
                    let is_asked = heard.iter().any(|(_, it)| it[4] == id && it[6] == code);
                    assert!(is_asked, "a calibration that nobody was asked for");
                }
                8
            }
            Do::Discard => {
                let rest = self.rig.driver.unsent().len();
                assert_eq!(self.rig.driver.discard(), rest);
                9
            }
            Do::Fault { call, fault } => {
                self.rig.fault(call, fault);
                10
            }
            Do::Heal => {
                self.rig.heal();
                11
            }
            Do::Pass { units } => {
                self.rig.world.step(u64::from(units) * 64);
                12
            }
            Do::Noise { bytes } => {
                self.rig.port().receive(&bytes);
                13
            }
            Do::Mute { is_mute } => {
                self.peer.0.borrow_mut().is_mute = is_mute;
                14
            }
            Do::Frame { speed, .. } => {
                self.rig.port().receive(&frame(5, &[speed as u8; 36]));
                15
            }
            Do::Bias { is_imu } => {
                let result = if is_imu { frame(6, &[1; 12]) } else { frame(7, &[2; 6]) };
                self.rig.port().receive(&result);
                16
            }
        }
    }

    /// `Ok` means that the last motor frame on the line is a stop, and flushed (U16).
    fn check_stopped(&mut self) {
        let port = self.rig.port();
        let last = port.written.windows(24).rev().find_map(|window| {
            let is_good = super::oracle::crc(&window[..22]).to_le_bytes() == window[22..];
            motion(window).filter(|_| window[..4] == [0xFD, 0xFF, 20, 0] && is_good)
        });
        assert_eq!(last, Some((0, 0)), "Ok, but the stop has not left");
        assert_eq!(port.flushed_bytes, port.written.len(), "Ok, but not flushed");
    }

    /// What the robot hears was asked for since the last stop, or is a stop.
    fn check_motions(&mut self) {
        let mut far = self.peer.0.borrow_mut();
        for (_, frame) in far.heard.drain(..) {
            let Some(told) = motion(&frame) else { continue };
            assert!(told == (0, 0) || self.asked.contains(&told), "{told:?} was not asked for");
            // One byte of a command must never be another's (U7).
            assert_eq!(frame[12..22], [0; 10], "more than a motion");
        }
    }
}
