//! Any bytes at any time, and any calls: no role panics, spins, or breaks its contract.
//!
//! The data is a list of ops, each one byte followed by its arguments; see `op` of each role.

use arbitrary::{Result, Unstructured};
use axlewire::{
    endpoint::{Endpoint, Unsent},
    ikeya::{
        Board, Health, Master, MasterConfig, MasterEvent, Mode, NodeId, NodeSet, OneMotor, Polling,
        Position, PositionResponse, ReadRequest, Rps, Slave, SlaveConfig, Status, StopProgress,
        Target, ThreeMotors, VelocityResponse, WriteRequest, three,
    },
    stream::Encode,
    time::{Duration, Instant},
    ucp::{
        self, Body, Frame, Host, HostConfig, ImuBias, MagBias, MemoryStore, Message, MotorControl,
        Robot, RobotConfig,
    },
};

/// Polls a role as its contract requires, and checks the properties common to all roles. Returns
/// the packets that it has sent.
fn serve<R: Endpoint>(role: &mut R, now: Instant, mut told: impl FnMut(R::Event)) -> Vec<Vec<u8>> {
    if role.poll_timeout().is_some_and(|at| now >= at) {
        role.handle_timeout(now);
    }
    let mut events = 0;
    while let Some(event) = role.poll_event() {
        told(event);
        events += 1;
        assert!(events <= 64, "endless events");
    }
    let mut sent = Vec::new();
    while let Some(bytes) = role.poll_transmit(now) {
        assert!(!bytes.is_empty(), "an empty packet");
        sent.push(bytes.to_vec());
        assert!(sent.len() <= 64, "endless packets");
    }
    // Spurious calls are harmless.
    role.handle_input(&[], now);
    assert!(role.poll_transmit(now).is_none());
    let next = role.poll_timeout();
    assert!(next.is_none_or(|at| at > now), "a busy loop: {next:?} at {now:?}");
    sent
}

/// The time: starts anywhere, including just before it wraps, and then only advances.
struct Clock(Instant);

impl Clock {
    fn new(u: &mut Unstructured<'_>) -> Result<Self> {
        let begin = [0, u64::MAX - 5_000, u64::MAX / 2 - 5_000, 1 << 40];
        Ok(Self(Instant::from_micros(*u.choose(&begin)?)))
    }

    /// A short or a long time.
    fn pass(&mut self, u: &mut Unstructured<'_>) -> Result<Instant> {
        let (step, scale): (u8, u8) = u.arbitrary()?;
        self.0 += Duration::from_micros(u32::from(step) << (scale % 16));
        Ok(self.0)
    }
}

/// Up to 20 raw bytes.
fn raw<'a>(u: &mut Unstructured<'a>) -> Result<&'a [u8]> {
    let len = u.arbitrary_len::<u8>()?.min(20);
    u.bytes(len)
}

/// The master of a motor bus, with either kind of board.
pub fn ikeya_master(data: &[u8]) {
    let mut u = Unstructured::new(data);
    let turn = Rps::new(1.0).expect("finite");
    let place = Position::new(1, -1);
    let _ = match u.arbitrary() {
        Ok(true) => master::<ThreeMotors>(&mut u, [turn; 3], [place; 3], |id, mode| match mode {
            Mode::Velocity => three::VelocityResponse::new(id, [Rps::ZERO; 3]).as_bytes().to_vec(),
            Mode::Position => {
                three::PositionResponse::new(id, [Position::default(); 3]).as_bytes().to_vec()
            }
        }),
        _ => master::<OneMotor>(&mut u, turn, place, |id, mode| match mode {
            Mode::Velocity => VelocityResponse::new(id, Rps::ZERO).as_bytes().to_vec(),
            Mode::Position => PositionResponse::new(id, Position::default()).as_bytes().to_vec(),
        }),
    };
}

fn packet(frame: &impl Encode) -> Vec<u8> {
    let mut buffer = [0; 16];
    frame.encode(&mut buffer).expect("room").to_vec()
}

/// Commands of the application for each node.
struct Wishes<B: Board> {
    /// The latest order, unless it is a stop or was withdrawn.
    orders: [Option<Target<B>>; 8],
    /// Nodes whose stop was owed at the last check.
    owed: NodeSet,
}

impl<B: Board> Wishes<B> {
    fn order(&mut self, id: NodeId) -> &mut Option<Target<B>> {
        &mut self.orders[usize::from(id.get() - 1)]
    }

    /// Checks and adopts the master's own decisions: it never owes less than before unless a stop
    /// is paid, and a node that is owed a stop gets nothing else.
    fn follow(&mut self, master: &mut Master<B>, turn: B::Velocity, now: Instant) {
        let owed = master.stops_owed();
        for id in NodeId::ALL {
            let set_point = master.set_point(id);
            if owed.contains(id) {
                *self.order(id) = None;
                assert_eq!(set_point, None, "a set-point despite an owed stop");
                assert_eq!(master.stop_progress(id), StopProgress::Owed);
                assert!(
                    master.set_velocity(id, turn, now).is_err(),
                    "accepted despite an owed stop"
                );
            } else if self.owed.contains(id) && self.order(id).is_none() {
                let progress = master.stop_progress(id);
                let is_paid = matches!(progress, StopProgress::Paid | StopProgress::StandingStill);
                assert!(is_paid, "a forgotten stop: {progress:?}");
            }
            let is_online = matches!(master.health(id), Some(Health::Online | Health::Suspect(_)));
            assert!(is_online || set_point.is_none(), "a set-point for a node that is not online");
            if set_point.is_none() {
                *self.order(id) = None;
            }
        }
        self.owed = owed;
    }

    /// A WRITE is the latest order, in the mode of the node, or a stop: the nodes are at rest at 0.
    fn check(&mut self, sent: &[u8], master: &Master<B>, stop: &Stops) {
        let id = NodeId::new(sent[1]).expect("an id on the wire");
        let is_stop = [&stop.velocity, &stop.position]
            .into_iter()
            .any(|stop| stop[2..] == sent[2..sent.len() - 2]);
        if is_stop {
            return;
        }
        let order = self.order(id).expect("an order that was not given");
        let expected = match order {
            Target::Velocity(to) => packet(&B::write_velocity(id, to)),
            Target::Position(to) => packet(&B::write_position(id, to)),
        };
        assert_eq!(sent, expected, "not the latest order");
        assert_eq!(master.mode(id), Some(order.mode()), "wrong mode");
        assert!(B::ANSWERS_WRITE || !master.is_mode_in_doubt(id), "mode in doubt");
    }
}

/// The stop command for a node at rest at 0, without the CRC.
struct Stops {
    velocity: Vec<u8>,
    position: Vec<u8>,
}

fn master<B: Board>(
    u: &mut Unstructured<'_>,
    turn: B::Velocity,
    place: B::Position,
    answer: fn(NodeId, Mode) -> Vec<u8>,
) -> Result<()> {
    let mut config =
        if u.arbitrary()? { MasterConfig::direct() } else { MasterConfig::usb_adapter() };
    config.attempts = u.int_in_range(0..=5)?;
    config.removes_echo = u.arbitrary()?;
    config.recovery_share_pct = u.arbitrary()?;
    config.turnaround_gap = Duration::from_micros(*u.choose(&[0, 0, 35])?);
    let polling = [Polling::Fastest, Polling::Every(Duration::from_millis(5)), Polling::Manual];
    config.polling = *u.choose(&polling)?;
    config.accepts_early = u.arbitrary()?;
    config.stops_abnormal = u.arbitrary()?;
    config.hold_age = Duration::from_millis(*u.choose(&[0, 0, 2])?);
    config.dead_man = u.arbitrary::<bool>()?.then_some(Duration::from_millis(50));
    if u.arbitrary()? {
        config.nodes = [NodeId::N1, NodeId::N5].into_iter().collect();
    }
    let mut clock = Clock::new(u)?;
    let mut master = Master::<B>::new(config, clock.0);
    let mut wishes = Wishes { orders: [None; 8], owed: NodeSet::NONE };
    // The node that was read and may answer.
    let mut asked = None;
    while !u.is_empty() {
        let id = *u.choose(&NodeId::ALL)?;
        let now = clock.pass(u)?;
        let mut statuses = 0;
        match u.int_in_range(0..=14)? {
            0 => master.discover(now),
            1 => {
                if master.set_velocity(id, turn, now).is_ok() {
                    *wishes.order(id) = Some(Target::Velocity(turn));
                }
            }
            2 => {
                if master.set_position(id, place, now).is_ok() {
                    *wishes.order(id) = Some(Target::Position(place));
                }
            }
            3 => {
                master.stop(id, now);
                assert!(master.stops_owed().contains(id));
            }
            4 => {
                master.stop_all(now);
                assert_eq!(master.stops_owed().and(config.nodes), config.nodes);
            }
            5 => drop(master.confirm(id, now)),
            6 => {
                let owed = master.stops_owed();
                master.release(id);
                assert_eq!(master.stops_owed(), owed, "a release must not cancel a stop");
            }
            7 => drop(master.read(id, now)),
            8 => master.keep_alive(now),
            9 => {
                let all = [Unsent::Untouched, Unsent::CutOff, Unsent::Unflushed];
                master.handle_unsent(*u.choose(&all)?, now);
            }
            10 => master.handle_input(raw(u)?, now),
            11 => {
                let mode = if u.arbitrary()? { Mode::Velocity } else { Mode::Position };
                master.handle_input(&answer(id, mode), now);
                // Only the node that was read can have answered.
                statuses = u32::from(asked == Some(id));
            }
            _ => {
                if let Some(id) = asked {
                    let mode = if u.ratio(1, 8)? { Mode::Position } else { Mode::Velocity };
                    master.handle_input(&answer(id, master.mode(id).unwrap_or(mode)), now);
                    statuses = 1;
                }
            }
        }
        wishes.follow(&mut master, turn, now);
        let mut told = 0;
        let sent = serve(&mut master, now, |event| {
            told += u32::from(matches!(event, MasterEvent::Status { .. }));
        });
        wishes.follow(&mut master, turn, now);
        // Raw input may also contain a good answer if it is long enough.
        assert!(told <= statuses.max(1), "{told} answers to one request");
        for sent in sent {
            let id = NodeId::new(sent[1]).expect("an id on the wire");
            if sent[0] == 0xAA || B::ANSWERS_WRITE {
                asked = Some(id);
            }
            if sent[0] == 0xBB {
                let stops = Stops {
                    velocity: without_crc(packet(&B::write_velocity(id, B::ZERO))),
                    position: without_crc(answer(id, Mode::Position)),
                };
                wishes.check(&sent, &master, &stops);
            } else {
                assert_eq!(sent, ReadRequest::new(id).as_bytes());
            }
        }
        check_counts(&master);
    }
    Ok(())
}

fn without_crc(mut packet: Vec<u8>) -> Vec<u8> {
    packet.truncate(packet.len() - 2);
    packet
}

fn check_counts<B: Board>(master: &Master<B>) {
    for id in NodeId::ALL {
        let node = master.node_statistics(id);
        let closed = u64::from(node.replies) + u64::from(node.timeouts);
        let requests = u64::from(node.requests);
        assert!(closed <= requests, "an answer without a request: {node:?}");
        // An answer that puts the mode in doubt also closes its window.
        let open = requests - closed;
        let doubtful = u64::from(node.other_mode);
        assert!(open <= doubtful + 1, "an unfinished request: {node:?}");
        let mode = master.status(id).map(|(status, _): (Status<B>, _)| status.mode());
        assert_eq!(mode, master.mode(id));
    }
}

/// A slave of a motor bus, with either kind of board.
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
    config.two_wire = u.arbitrary()?;
    let mode = if u.arbitrary()? { Mode::Velocity } else { Mode::Position };
    let mut clock = Clock::new(u)?;
    let id = *u.choose(&NodeId::ALL)?;
    let mut slave = Slave::<B>::new(id, mode, config);
    while !u.is_empty() {
        let now = clock.pass(u)?;
        match u.int_in_range(0..=6)? {
            0 => slave.handle_input(raw(u)?, now),
            1 => slave.handle_input(&request(id, None), now),
            2 => slave.handle_input(&request(*u.choose(&NodeId::ALL)?, u.arbitrary().ok()), now),
            3 => slave.set_velocity(B::ZERO),
            4 => slave.handle_unsent(*u.choose(&[Unsent::Untouched, Unsent::CutOff])?, now),
            5 => {
                // The start of the next packet is enough.
                slave.handle_input(&request(id, None), now);
                slave.handle_input(&[0xAA], now);
                assert_eq!(slave.poll_transmit(now + config.turnaround_gap), None);
            }
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
            assert!(!low_ids_only || frame.id() < 5, "an id that makes builds hang (U14)");
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

/// A good frame of a host, possibly a careless one.
fn from_host(u: &mut Unstructured<'_>) -> Result<Vec<u8>> {
    let index = u.arbitrary()?;
    Ok(match u.int_in_range(0..=7)? {
        0 => ucp::Ping {}.frame(index).as_bytes().to_vec(),
        1 | 2 => {
            // Any sixteen bytes, including values out of range and versions that start an update.
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
