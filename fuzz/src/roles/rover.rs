//! A host and a robot under any calls, bytes and times: neither sends a motion that was not
//! requested, and the robot does not move without a command.

use arbitrary::{Result, Unstructured};
use axlewire::{
    endpoint::{Endpoint, Unsent},
    time::{Duration, Instant},
    ucp::{
        self, Body, Frame, Host, Message, MotorControl, Robot,
        host::{HostConfig, MemoryStore},
        message::{ImuBias, MagBias},
        robot::RobotConfig,
    },
};

use super::{Clock, raw, serve};

/// The host of a rover.
pub fn ucp_host(data: &[u8]) {
    let _ = host(&mut Unstructured::new(data));
}

fn host(u: &mut Unstructured<'_>) -> Result<()> {
    let mut config = HostConfig::default();
    config.ping_period = u.arbitrary::<bool>()?.then_some(Duration::from_millis(200));
    config.attempts = u.int_in_range(0..=4)?;
    config.low_ids_only = u.arbitrary()?;
    let low_ids_only = config.low_ids_only;
    let mut clock = Clock::new(u)?;
    let mut host = Host::with_store(config, MemoryStore::default(), clock.0);
    // Speed and turn of the last command, and whether an update may be in progress.
    let (mut wanted, mut updating) = (None, false);
    let mut is_first = true;
    while !u.is_empty() {
        let now = clock.pass(u)?;
        match u.int_in_range(0..=11)? {
            0 => host.handle_input(raw(u)?, now),
            1 => host.handle_input(&from_robot(u)?, now),
            2 => host.handle_input(&from_robot(u)?, now),
            3 => {
                if let Ok(command) = MotorControl::new(u.arbitrary()?, u.arbitrary()?) {
                    if host.drive(command, now).is_ok() {
                        wanted = Some((command.speed(), command.angular()));
                    }
                }
            }
            4 => {
                let command = MotorControl::new(u.int_in_range(-100..=100)?, 5).expect("legal");
                if host.drive(command, now).is_ok() {
                    wanted = Some((command.speed(), 5));
                }
            }
            5 => host.stop(now),
            6 => drop(host.set_network_state(u.arbitrary()?, now)),
            7 => drop(host.start_calibration(u.arbitrary()?, now)),
            8 => drop(host.end_calibration(u.arbitrary()?, now)),
            9 => updating |= host.start_firmware_update(u.arbitrary()?, now).is_ok(),
            10 => host.end_firmware_update(now),
            _ => host.handle_unsent(unsent(u)?, now),
        }
        for packet in serve(&mut host, now, |_| {}) {
            let frame = Frame::parse(&packet).expect("a good frame");
            assert!(!low_ids_only || frame.id() < 5, "an id that hangs some builds (U14)");
            if core::mem::take(&mut is_first) {
                assert_eq!(packet[4..10], [2, 0, 0, 0, 0, 0], "the first frame (U16)");
            }
            match frame.message() {
                Message::MotorControl(command) => {
                    assert!(MotorControl::try_from(*command).is_ok());
                    let motion = (command.speed(), command.angular());
                    assert!(
                        motion == (0, 0) || Some(motion) == wanted,
                        "{motion:?} was not commanded"
                    );
                }
                Message::OtaRequest(_) => assert!(updating, "an update that was not started"),
                message => assert!(is_to_robot(&message), "{message:?} from a host (U13)"),
            }
        }
    }
    Ok(())
}

/// The robot of a rover.
pub fn ucp_robot(data: &[u8]) {
    let _ = robot(&mut Unstructured::new(data));
}

fn robot(u: &mut Unstructured<'_>) -> Result<()> {
    let mut clock = Clock::new(u)?;
    let mut robot = Robot::new(RobotConfig::default(), clock.0);
    // Received bytes with their times.
    let mut history: Vec<(Instant, u8)> = Vec::new();
    while !u.is_empty() {
        let now = clock.pass(u)?;
        let mut input = Vec::new();
        match u.int_in_range(0..=9)? {
            0 => input = raw(u)?.to_vec(),
            1 | 2 => input = from_host(u)?,
            3 => input = from_robot(u)?,
            4 => robot.set_telemetry(&u.arbitrary()?, now),
            5 => robot.calibration_result_imu(ImuBias::new(u.arbitrary()?, u.arbitrary()?), now),
            6 => robot.calibration_result_mag(MagBias::new(u.arbitrary()?), now),
            7 => drop(robot.answer_update(u.arbitrary()?, now)),
            8 => drop(robot.abort_calibration()),
            _ => robot.handle_unsent(unsent(u)?, now),
        }
        history.extend(input.iter().map(|&byte| (now, byte)));
        robot.handle_input(&input, now);
        for packet in serve(&mut robot, now, |_| {}) {
            let frame = Frame::parse(&packet).expect("a good frame");
            let message = frame.message();
            assert!(!is_to_robot(&message) || matches!(message, Message::Biases(_)), "{message:?}");
        }
        let doing = robot.command(now);
        let motion = (doing.speed(), doing.angular());
        assert!(
            motion == (0, 0) || was_commanded(&history, motion, now),
            "{motion:?} at {now:?} without a command in the last 500 ms"
        );
    }
    Ok(())
}

fn unsent(u: &mut Unstructured<'_>) -> Result<Unsent> {
    Ok(*u.choose(&[Unsent::Untouched, Unsent::CutOff, Unsent::Unflushed])?)
}

/// Whether a complete motor command for this motion has arrived in the last 500 ms.
fn was_commanded(history: &[(Instant, u8)], motion: (i16, i16), now: Instant) -> bool {
    let recent = |window: &&[(Instant, u8)]| now - window[23].0 < Duration::from_millis(500);
    history.windows(24).filter(recent).any(|window| {
        let bytes: Vec<u8> = window.iter().map(|&(_, byte)| byte).collect();
        let Ok(Message::MotorControl(command)) = Frame::parse(&bytes).map(Frame::message) else {
            return false;
        };
        (command.speed().clamp(-100, 100), command.angular().clamp(-100, 100)) == motion
    })
}

/// Whether only a host may send this message; excludes those of both directions.
fn is_to_robot(message: &Message<'_>) -> bool {
    matches!(
        message,
        Message::Ping(_)
            | Message::MotorControl(_)
            | Message::CalibrationStart(_)
            | Message::CalibrationEnd(_)
            | Message::ImuBiasAck(_)
            | Message::MagBiasAck(_)
            | Message::Biases(_)
            | Message::OtaRequest(_)
            | Message::SetNetworkState(_)
    )
}

/// A good frame of a robot.
fn from_robot(u: &mut Unstructured<'_>) -> Result<Vec<u8>> {
    let index = u.arbitrary()?;
    Ok(match u.int_in_range(0..=7)? {
        0 => ucp::message::Pong::new(u.arbitrary()?).frame(index).as_bytes().to_vec(),
        1 => {
            ucp::message::FirmwareReport::new(&u.arbitrary()?, 38).frame(index).as_bytes().to_vec()
        }
        2 => ucp::message::BiasRequest {}.frame(index).as_bytes().to_vec(),
        3 => ImuBias::new(u.arbitrary()?, u.arbitrary()?).frame(index).as_bytes().to_vec(),
        4 => MagBias::new(u.arbitrary()?).frame(index).as_bytes().to_vec(),
        5 => {
            let ack = ucp::message::CalibrationStartAck::new(u.arbitrary()?, u.arbitrary()?);
            ack.frame(index).as_bytes().to_vec()
        }
        6 => {
            let ack = ucp::message::CalibrationEndAck::new(u.arbitrary()?, u.arbitrary()?);
            ack.frame(index).as_bytes().to_vec()
        }
        _ => ucp::message::OtaAck::new(u.arbitrary()?).frame(index).as_bytes().to_vec(),
    })
}

/// A good frame of a host, possibly a careless one.
fn from_host(u: &mut Unstructured<'_>) -> Result<Vec<u8>> {
    let index = u.arbitrary()?;
    Ok(match u.int_in_range(0..=7)? {
        0 => ucp::message::Ping {}.frame(index).as_bytes().to_vec(),
        1 | 2 => {
            // Any sixteen bytes, including values out of range and versions that start an update.
            let body: [u8; 16] = u.arbitrary()?;
            let mut frame = vec![0xFD, 0xFF, 20, 0, 2, index];
            frame.extend(body);
            frame.extend(axlewire::crc16::compute(&frame).to_le_bytes());
            frame
        }
        3 => ucp::message::CalibrationStart::new(u.arbitrary()?).frame(index).as_bytes().to_vec(),
        4 => ucp::message::CalibrationEnd::new(u.arbitrary()?).frame(index).as_bytes().to_vec(),
        5 => ucp::message::ImuBiasAck::new(u.arbitrary()?).frame(index).as_bytes().to_vec(),
        6 => ucp::message::MagBiasAck::new(u.arbitrary()?).frame(index).as_bytes().to_vec(),
        _ => ucp::message::OtaRequest::start_firmware_update(u.arbitrary()?)
            .frame(index)
            .as_bytes()
            .to_vec(),
    })
}
