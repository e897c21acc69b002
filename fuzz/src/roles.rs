//! Any bytes at any time, and any calls: no role panics, spins, or forgets what it promised.
//!
//! The data is a list of ops, one byte each with its arguments behind it; see `op` of each role.

use arbitrary::{Result, Unstructured};
use axlewire::{
    endpoint::Endpoint,
    ikeya::{
        Board, Health, Master, MasterConfig, MasterEvent, Mode, NodeId, OneMotor, Polling,
        Position, PositionResponse, ReadRequest, Rps, Slave, SlaveConfig, Status, Target,
        ThreeMotors, VelocityResponse, WriteRequest, three,
    },
    time::{Duration, Instant},
    ucp::{
        self, Body, Frame, Host, HostConfig, ImuBias, MagBias, MemoryStore, Message, MotorControl,
        Robot, RobotConfig,
    },
};

/// Polls a role as its contract says, and checks what holds for every role. Returns the packets
/// that it has sent.
fn serve<R: Endpoint>(role: &mut R, now: Instant, mut told: impl FnMut(R::Event)) -> Vec<Vec<u8>> {
    if role.poll_timeout().is_some_and(|at| now >= at) {
        role.handle_timeout(now);
    }
    let mut events = 0;
    while let Some(event) = role.poll_event() {
        told(event);
        events += 1;
        assert!(events <= 64, "events without end");
    }
    let mut sent = Vec::new();
    while let Some(bytes) = role.poll_transmit(now) {
        assert!(!bytes.is_empty(), "a packet of no bytes");
        sent.push(bytes.to_vec());
        assert!(sent.len() <= 64, "packets without end");
    }
    // A call too many does nothing.
    role.handle_input(&[], now);
    assert!(role.poll_transmit(now).is_none());
    let next = role.poll_timeout();
    assert!(next.is_none_or(|at| at > now), "a busy loop: {next:?} at {now:?}");
    sent
}

/// The time: anywhere, also just before it wraps, and then forward only.
struct Clock(Instant);

impl Clock {
    fn new(u: &mut Unstructured<'_>) -> Result<Self> {
        let begin = [0, u64::MAX - 5_000, u64::MAX / 2 - 5_000, 1 << 40];
        Ok(Self(Instant::from_micros(*u.choose(&begin)?)))
    }

    /// A little time, or a lot.
    fn pass(&mut self, u: &mut Unstructured<'_>) -> Result<Instant> {
        let (step, scale): (u8, u8) = u.arbitrary()?;
        self.0 += Duration::from_micros(u32::from(step) << (scale % 16));
        Ok(self.0)
    }
}

/// Up to 20 bytes as they come.
fn raw<'a>(u: &mut Unstructured<'a>) -> Result<&'a [u8]> {
    let len = u.arbitrary_len::<u8>()?.min(20);
    u.bytes(len)
}

/// The master of a motor bus of either kind of boards.
pub fn ikeya_master(data: &[u8]) {
    let mut u = Unstructured::new(data);
    let _ = match u.arbitrary() {
        Ok(true) => master::<ThreeMotors>(&mut u, |id, mode| match mode {
            Mode::Velocity => three::VelocityResponse::new(id, [Rps::ZERO; 3]).as_bytes().to_vec(),
            Mode::Position => {
                three::PositionResponse::new(id, [Position::default(); 3]).as_bytes().to_vec()
            }
        }),
        _ => master::<OneMotor>(&mut u, |id, mode| match mode {
            Mode::Velocity => VelocityResponse::new(id, Rps::ZERO).as_bytes().to_vec(),
            Mode::Position => PositionResponse::new(id, Position::default()).as_bytes().to_vec(),
        }),
    };
}

fn master<B: Board>(u: &mut Unstructured<'_>, answer: fn(NodeId, Mode) -> Vec<u8>) -> Result<()> {
    let mut config =
        if u.arbitrary()? { MasterConfig::direct() } else { MasterConfig::usb_adapter() };
    config.attempts = u.int_in_range(0..=5)?;
    config.removes_echo = u.arbitrary()?;
    config.recovery_share_pct = u.arbitrary()?;
    config.turnaround_gap = Duration::from_micros(*u.choose(&[0, 0, 35])?);
    let polling = [Polling::Fastest, Polling::Every(Duration::from_millis(5)), Polling::Manual];
    config.polling = *u.choose(&polling)?;
    let mut clock = Clock::new(u)?;
    let mut master = Master::<B>::new(config);
    // The node that was asked and may answer; whether anything was ever stopped.
    let (mut asked, mut stopped) = (None, false);
    while !u.is_empty() {
        let id = *u.choose(&NodeId::ALL)?;
        let now = clock.pass(u)?;
        let mut statuses = 0;
        match u.int_in_range(0..=9)? {
            0 => master.discover(),
            1 => drop(master.set_velocity(id, B::ZERO)),
            2 => stopped |= master.stop(id).is_ok(),
            3 => {
                master.stop_all();
                stopped = true;
            }
            4 => drop(master.confirm(id)),
            5 => master.release(id),
            6 => drop(master.read(id)),
            7 => master.handle_input(raw(u)?, now),
            8 => {
                let mode = if u.arbitrary()? { Mode::Velocity } else { Mode::Position };
                master.handle_input(&answer(id, mode), now);
                // Only the node that was asked can have answered.
                statuses = u32::from(asked == Some(id));
            }
            _ => {
                if let Some(id) = asked {
                    master.handle_input(&answer(id, Mode::Velocity), now);
                    statuses = 1;
                }
            }
        }
        let mut told = 0;
        let sent = serve(&mut master, now, |event| {
            told += u32::from(matches!(event, MasterEvent::Status { .. }));
        });
        // Raw input may hold a good answer, too; it is as long as one then.
        assert!(told <= statuses.max(1), "{told} answers to one request");
        for packet in sent {
            let id = NodeId::new(packet[1]).expect("an id on the wire");
            if packet[0] == 0xAA || B::ANSWERS_WRITE {
                asked = Some(id);
            }
            assert!(packet[0] == 0xAA || packet[0] == 0xBB);
            let known = matches!(master.health(id), Some(Health::Online | Health::Suspect(_)));
            // Only a stop goes to a node that does not answer.
            assert!(
                packet[0] == 0xAA || known || stopped,
                "a command for a node that is not online"
            );
        }
        for id in NodeId::ALL {
            let node = master.node_statistics(id);
            let closed =
                u64::from(node.replies) + u64::from(node.timeouts) + u64::from(node.other_mode);
            let open = u64::from(node.requests) - closed;
            assert!(open <= 1, "every request ends in an answer or a counted failure: {node:?}");
            let mode = master.status(id).map(|(status, _): (Status<B>, _)| status.mode());
            assert_eq!(mode, master.mode(id));
        }
    }
    Ok(())
}

/// A slave of a motor bus of either kind of boards.
pub fn ikeya_slave(data: &[u8]) {
    let mut u = Unstructured::new(data);
    let _ = match u.arbitrary() {
        Ok(true) => slave::<ThreeMotors>(&mut u, |id, target| match target {
            None => ReadRequest::new(id).as_bytes().to_vec(),
            Some(rps) => three::WriteRequest::velocity(id, [rps; 3]).as_bytes().to_vec(),
        }),
        _ => slave::<OneMotor>(&mut u, |id, target| match target {
            None => ReadRequest::new(id).as_bytes().to_vec(),
            Some(rps) => WriteRequest::velocity(id, rps).as_bytes().to_vec(),
        }),
    };
}

fn slave<B: Board>(
    u: &mut Unstructured<'_>,
    request: fn(NodeId, Option<Rps>) -> Vec<u8>,
) -> Result<()> {
    let mut config = SlaveConfig::direct();
    config.watchdog = u.arbitrary::<bool>()?.then_some(Duration::from_millis(20));
    config.turnaround_gap = Duration::from_micros(*u.choose(&[0, 30])?);
    let mode = if u.arbitrary()? { Mode::Velocity } else { Mode::Position };
    let mut clock = Clock::new(u)?;
    let id = *u.choose(&NodeId::ALL)?;
    let mut slave = Slave::<B>::new(id, mode, config);
    while !u.is_empty() {
        let now = clock.pass(u)?;
        match u.int_in_range(0..=4)? {
            0 => slave.handle_input(raw(u)?, now),
            1 => slave.handle_input(&request(id, None), now),
            2 => slave.handle_input(&request(*u.choose(&NodeId::ALL)?, u.arbitrary().ok()), now),
            3 => slave.set_velocity(B::ZERO),
            _ => slave.set_mode(if u.arbitrary()? { Mode::Velocity } else { Mode::Position }),
        }
        let sent = serve(&mut slave, now, |_| {});
        assert!(sent.len() <= 1, "one answer to one request");
        for packet in sent {
            assert_eq!(packet[1], id.get());
            assert!(packet[0] == 0x55 || packet[0] == 0x56);
            let expected = if slave.mode() == Mode::Velocity { 0x55 } else { 0x56 };
            assert_eq!(packet[0], expected);
        }
        let counts = slave.statistics();
        let asked = counts.reads + if B::ANSWERS_WRITE { counts.writes } else { 0 };
        assert!(counts.replies + counts.overtaken <= asked, "{counts:?}");
        match slave.command() {
            None => {}
            Some(Target::Velocity(_)) => assert_eq!(slave.mode(), Mode::Velocity),
            Some(Target::Position(_)) => assert_eq!(slave.mode(), Mode::Position),
        }
    }
    Ok(())
}

/// The host of a rover.
pub fn ucp_host(data: &[u8]) {
    let _ = host(&mut Unstructured::new(data));
}

fn host(u: &mut Unstructured<'_>) -> Result<()> {
    let mut config = HostConfig::default();
    config.ping_period = u.arbitrary::<bool>()?.then_some(Duration::from_millis(200));
    config.attempts = u.int_in_range(0..=4)?;
    let mut clock = Clock::new(u)?;
    let mut host = Host::with_store(config, MemoryStore::default(), clock.0);
    // Speed and turn of the last command, and whether an update may be under way.
    let (mut wanted, mut updating) = (None, false);
    while !u.is_empty() {
        let now = clock.pass(u)?;
        match u.int_in_range(0..=10)? {
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
            _ => host.end_firmware_update(),
        }
        for packet in serve(&mut host, now, |_| {}) {
            let frame = Frame::parse(&packet).expect("a good frame");
            match frame.message() {
                Message::MotorControl(command) => {
                    assert!(!command.starts_update());
                    let motion = (command.speed(), command.angular());
                    assert!(
                        motion == (0, 0) || Some(motion) == wanted,
                        "{motion:?} was not asked for"
                    );
                }
                Message::OtaRequest(_) => assert!(updating, "an update that nobody started"),
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
    // What has been received, and when.
    let mut history: Vec<(Instant, u8)> = Vec::new();
    while !u.is_empty() {
        let now = clock.pass(u)?;
        let mut input = Vec::new();
        match u.int_in_range(0..=7)? {
            0 => input = raw(u)?.to_vec(),
            1 | 2 => input = from_host(u)?,
            3 => input = from_robot(u)?,
            4 => robot.set_telemetry(&u.arbitrary()?, now),
            5 => robot.calibration_result_imu(ImuBias::new(u.arbitrary()?, u.arbitrary()?), now),
            6 => robot.calibration_result_mag(MagBias::new(u.arbitrary()?), now),
            _ => drop(robot.answer_update(u.arbitrary()?, now)),
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

/// Has a whole motor command for this motion arrived in the last 500 ms?
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

/// A message that only a host may send, those of both directions left out.
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
        0 => ucp::Pong::new(u.arbitrary()?).frame(index).as_bytes().to_vec(),
        1 => ucp::FirmwareReport::new(&u.arbitrary()?, 38).frame(index).as_bytes().to_vec(),
        2 => ucp::BiasRequest {}.frame(index).as_bytes().to_vec(),
        3 => ImuBias::new(u.arbitrary()?, u.arbitrary()?).frame(index).as_bytes().to_vec(),
        4 => MagBias::new(u.arbitrary()?).frame(index).as_bytes().to_vec(),
        5 => {
            let ack = ucp::CalibrationStartAck::new(u.arbitrary()?, u.arbitrary()?);
            ack.frame(index).as_bytes().to_vec()
        }
        6 => {
            let ack = ucp::CalibrationEndAck::new(u.arbitrary()?, u.arbitrary()?);
            ack.frame(index).as_bytes().to_vec()
        }
        _ => ucp::OtaAck::new(u.arbitrary()?).frame(index).as_bytes().to_vec(),
    })
}

/// A good frame of a host, a careless one included.
fn from_host(u: &mut Unstructured<'_>) -> Result<Vec<u8>> {
    let index = u.arbitrary()?;
    Ok(match u.int_in_range(0..=7)? {
        0 => ucp::Ping {}.frame(index).as_bytes().to_vec(),
        1 | 2 => {
            // Any sixteen bytes: also out of range, also a version that starts an update.
            let body: [u8; 16] = u.arbitrary()?;
            let mut frame = vec![0xFD, 0xFF, 20, 0, 2, index];
            frame.extend(body);
            frame.extend(axlewire::crc16::compute(&frame).to_le_bytes());
            frame
        }
        3 => ucp::CalibrationStart::new(u.arbitrary()?).frame(index).as_bytes().to_vec(),
        4 => ucp::CalibrationEnd::new(u.arbitrary()?).frame(index).as_bytes().to_vec(),
        5 => ucp::ImuBiasAck::new(u.arbitrary()?).frame(index).as_bytes().to_vec(),
        6 => ucp::MagBiasAck::new(u.arbitrary()?).frame(index).as_bytes().to_vec(),
        _ => {
            ucp::OtaRequest::start_firmware_update(u.arbitrary()?).frame(index).as_bytes().to_vec()
        }
    })
}
