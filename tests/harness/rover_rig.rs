//! Host and robot: frames made by hand, roles alone, and two roles on one line.
//!
//! The line is in memory, takes 10 bit times per byte and handles frames as the test requires.
//! After every step both roles are asked for their next deadline: it must be in the future, or a
//! driver would spin.

use std::collections::VecDeque;

pub(crate) use axlewire::{
    encode::Encode,
    endpoint::{Arrival, Endpoint, LineRules, Transmit, Unsent},
    time::{Duration, Instant, wire_time},
    ucp::{
        BAUD, Body, Frame, FrameOf, Host, Message, MotorControl, RawFrame, Robot, Telemetry,
        host::{
            BiasStore, CalibrationStep, CommandError, FailureCause, HostConfig, HostEvent,
            HostStatistics, Link, MemoryStore, NoStore, NotStored,
        },
        message::{
            BiasRequest, Biases, CalibrationEnd, CalibrationEndAck, CalibrationKind,
            CalibrationStart, CalibrationStartAck, ErrorCode, FirmwareReport, ImuBias, ImuBiasAck,
            MagBias, MagBiasAck, NetworkState, OtaAck, OtaRequest, OtaStatus, Ping, Pong,
            SetNetworkState,
        },
        robot::{ReportLayout, RobotConfig, RobotEvent, UpdateSource},
    },
};

pub(crate) const IMU: CalibrationKind = CalibrationKind::Imu;
pub(crate) const MAG: CalibrationKind = CalibrationKind::Magnetometer;

/// Every possible fate of a frame that did not reach the line.
pub(crate) const EVERY: [Unsent; 3] = [Unsent::Untouched, Unsent::CutOff, Unsent::Unflushed];

/// How many copies of a motor command follow a frame that had such a fate.
pub(crate) fn copies(unsent: Unsent) -> usize {
    if unsent == Unsent::Untouched { 1 } else { 2 }
}

pub(crate) fn ms(millis: u64) -> Instant {
    Instant::from_millis(millis)
}

pub(crate) fn us(micros: u64) -> Instant {
    Instant::from_micros(micros)
}

pub(crate) fn go(speed: i16) -> MotorControl {
    MotorControl::new(speed, 0).unwrap()
}

pub(crate) fn imu_bias() -> ImuBias {
    ImuBias::new([1, -2, 3], [-4, 5, -6])
}

pub(crate) fn mag_bias() -> MagBias {
    MagBias::new([7, -8, 9])
}

pub(crate) fn bytes<B: Body>(body: B) -> Vec<u8> {
    body.frame(0).as_bytes().to_vec()
}

pub(crate) fn report(index: u8) -> Vec<u8> {
    FirmwareReport::new(&Telemetry::default(), 38).frame(index).as_bytes().to_vec()
}

/// A motor command from a careless host: speed, angular, front lamp, version.
pub(crate) fn careless(speed: i16, angular: i16, front_led: i16, version: u16) -> Vec<u8> {
    let mut frame = vec![0xFD, 0xFF, 20, 0, 2, 0];
    let mut body = [0; 16];
    body[0..2].copy_from_slice(&speed.to_le_bytes());
    body[2..4].copy_from_slice(&angular.to_le_bytes());
    body[4..6].copy_from_slice(&front_led.to_le_bytes());
    body[8..10].copy_from_slice(&version.to_le_bytes());
    frame.extend(body);
    frame.extend(axlewire::crc16::compute(&frame).to_le_bytes());
    frame
}

/// Everything that a role sends now. A role that never stops would hang its driver.
pub(crate) fn sent<R: Endpoint>(role: &mut R, now: Instant) -> Vec<Vec<u8>> {
    let mut frames = Vec::new();
    while let Some(frame) = role.poll_transmit(now) {
        frames.push(frame.to_vec());
        assert!(frames.len() <= 16, "a role that never stops sending");
    }
    assert!(role.poll_timeout().is_none_or(|at| at > now), "a driver would spin");
    frames
}

pub(crate) fn events<R: Endpoint>(role: &mut R) -> Vec<R::Event> {
    std::iter::from_fn(|| role.poll_event()).collect()
}

/// Lets time pass up to `end`, deadline by deadline; returns the frames sent meanwhile, with times.
pub(crate) fn wait<R: Endpoint>(role: &mut R, end: Instant) -> Vec<(Instant, Vec<u8>)> {
    let mut frames = Vec::new();
    while let Some(at) = role.poll_timeout().filter(|&at| at <= end) {
        role.handle_timeout(at);
        frames.extend(sent(role, at).into_iter().map(|frame| (at, frame)));
        assert!(frames.len() < 100_000);
    }
    frames
}

pub(crate) fn message(frame: &[u8]) -> Message<'_> {
    Frame::parse(frame).unwrap().message()
}

pub(crate) fn ids(frames: &[Vec<u8>]) -> Vec<u8> {
    frames.iter().map(|frame| frame[4]).collect()
}

pub(crate) fn is_ping(frame: &[u8]) -> bool {
    matches!(message(frame), Message::Ping(_))
}

pub(crate) fn speed(frame: &[u8]) -> Option<i16> {
    match message(frame) {
        Message::MotorControl(command) => Some(command.speed()),
        _ => None,
    }
}

/// Times and speeds of the motor commands sent.
pub(crate) fn speeds(frames: &[(Instant, Vec<u8>)]) -> Vec<(u64, i16)> {
    let speeds = frames.iter().filter_map(|(at, frame)| Some((at.as_micros(), speed(frame)?)));
    speeds.collect()
}

pub(crate) fn quiet_config() -> HostConfig {
    let mut config = HostConfig::default();
    config.ping_period = None;
    config.sends_first_stop = false;
    config
}

/// Settings of a host without pings whose robot need not be heard.
pub(crate) fn unheard_config(sends_first_stop: bool) -> HostConfig {
    let mut config = quiet_config();
    config.sends_first_stop = sends_first_stop;
    config.link_timeout = Duration::from_millis(3_600_000);
    config
}

fn unheard_host(sends_first_stop: bool) -> Host {
    Host::new(unheard_config(sends_first_stop), ms(0))
}

/// The same, which begins as hosts do.
pub(crate) fn fresh_host() -> Host {
    unheard_host(true)
}

/// A host that has sent its first frame.
pub(crate) fn begun() -> Host {
    let mut host = fresh_host();
    wait(&mut host, ms(0));
    host
}

/// The host, told to drive at this speed at this time, milliseconds.
pub(crate) fn driven(mut host: Host, speed: i16, at: u64) -> Host {
    host.drive(go(speed), ms(at)).unwrap();
    host
}

/// A robot is told to begin a calibration.
pub(crate) fn begins(kind: CalibrationKind) -> RobotEvent {
    RobotEvent::CalibrationStart { kind, repeated: false }
}

/// The same without the first stop, so that a test sees only what it requests.
pub(crate) fn quiet_host() -> Host {
    unheard_host(false)
}

/// A robot that requests nothing.
pub(crate) fn quiet_robot() -> Robot {
    quiet_robot_at(ms(0))
}

/// Both calibrations have a result.
pub(crate) fn both_results(robot: &mut Robot, at: u64) {
    robot.calibration_result_imu(imu_bias(), ms(at));
    robot.calibration_result_mag(mag_bias(), ms(at));
}

pub(crate) fn quiet_robot_at(now: Instant) -> Robot {
    let mut config = RobotConfig::default();
    config.bias_request_period = None;
    Robot::new(config, now)
}

/// Each act of a fresh role adds one to each of these counts, and changes no other.
macro_rules! assert_counted {
    ($new:expr; $($name:literal: $($count:ident),* => |$role:ident| $act:block)+) => {$({
        let mut role = $new;
        let mut expected = *role.statistics();
        let $role = &mut role;
        $act
        $(expected.$count += 1;)*
        assert_eq!(*role.statistics(), expected, $name);
    })+};
}
pub(crate) use assert_counted;

/// A store that refuses some results: by how many of their kind came before.
pub(crate) struct Picky {
    pub(crate) kept: MemoryStore,
    /// Results so far, of the IMU and of the magnetometer.
    pub(crate) asked: [u32; 2],
    pub(crate) refuses: fn(u32) -> bool,
}

impl Picky {
    pub(crate) fn new(refuses: fn(u32) -> bool) -> Self {
        Self { kept: MemoryStore::default(), asked: [0; 2], refuses }
    }

    fn takes(&mut self, which: usize) -> Result<(), NotStored> {
        self.asked[which] += 1;
        if (self.refuses)(self.asked[which] - 1) { Err(NotStored) } else { Ok(()) }
    }
}

impl BiasStore for Picky {
    fn load(&mut self) -> (Option<ImuBias>, Option<MagBias>) {
        self.kept.load()
    }
    fn store_imu(&mut self, bias: ImuBias) -> Result<(), NotStored> {
        self.takes(0)?;
        self.kept.store_imu(bias)
    }
    fn store_mag(&mut self, bias: MagBias) -> Result<(), NotStored> {
        self.takes(1)?;
        self.kept.store_mag(bias)
    }
}

/// One direction of the line.
pub(crate) struct Wire {
    free: Instant,
    frames: VecDeque<(Instant, Vec<u8>)>,
}

impl Wire {
    pub(crate) fn new(now: Instant) -> Self {
        Self { free: now, frames: VecDeque::new() }
    }

    pub(crate) fn send(&mut self, bytes: Vec<u8>, now: Instant) {
        self.free = now.max(self.free) + wire_time(bytes.len(), BAUD);
        self.frames.push_back((self.free, bytes));
    }

    pub(crate) fn next(&self) -> Option<Instant> {
        self.frames.front().map(|(at, _)| *at)
    }

    pub(crate) fn arrived(&mut self, now: Instant) -> Option<Vec<u8>> {
        self.next().filter(|&at| at <= now)?;
        self.frames.pop_front().map(|(_, bytes)| bytes)
    }
}

#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub(crate) enum To {
    Robot,
    Host,
}

pub(crate) type Fault = Box<dyn FnMut(To, &[u8]) -> Vec<u8>>;

/// A host, a robot and the line between them.
pub(crate) struct Rig<S: BiasStore = MemoryStore> {
    pub(crate) host: Host<S>,
    pub(crate) robot: Robot,
    pub(crate) now: Instant,
    pub(crate) to_robot: Wire,
    pub(crate) to_host: Wire,
    /// The fate of a frame on the line.
    pub(crate) fault: Fault,
    pub(crate) host_events: Vec<(Instant, HostEvent)>,
    pub(crate) robot_events: Vec<(Instant, RobotEvent)>,
    /// The motions of the robot: every change of its command.
    pub(crate) motion: Vec<(Instant, i16)>,
}

impl Rig {
    pub(crate) fn new(now: Instant) -> Self {
        let host = Host::with_store(HostConfig::default(), MemoryStore::default(), now);
        Self::of(host, Robot::new(RobotConfig::default(), now), now)
    }
}

impl<S: BiasStore> Rig<S> {
    pub(crate) fn of(host: Host<S>, robot: Robot, now: Instant) -> Self {
        Self {
            host,
            robot,
            now,
            to_robot: Wire::new(now),
            to_host: Wire::new(now),
            fault: Box::new(|_, frame| frame.to_vec()),
            host_events: Vec::new(),
            robot_events: Vec::new(),
            motion: Vec::new(),
        }
    }

    /// Unplugs the line permanently, or plugs it in again.
    pub(crate) fn unplug(&mut self, unplugged: bool) {
        self.fault = Box::new(move |_, frame| if unplugged { Vec::new() } else { frame.to_vec() });
    }

    pub(crate) fn run_for(&mut self, millis: u32) {
        self.run_until(self.now + Duration::from_millis(millis));
    }

    pub(crate) fn run_until(&mut self, end: Instant) {
        self.step();
        while let Some(at) = self.next().filter(|&at| at <= end) {
            self.now = at;
            self.step();
        }
        self.now = end;
        self.step();
    }

    pub(crate) fn next(&self) -> Option<Instant> {
        let roles = [self.host.poll_timeout(), self.robot.poll_timeout()];
        roles.into_iter().chain([self.to_robot.next(), self.to_host.next()]).flatten().min()
    }

    /// One iteration of both drivers' loops.
    pub(crate) fn step(&mut self) {
        let now = self.now;
        while let Some(bytes) = self.to_robot.arrived(now) {
            self.robot.handle_input(&bytes, now);
        }
        while let Some(bytes) = self.to_host.arrived(now) {
            self.host.handle_input(&bytes, now);
        }
        self.host.handle_timeout(now);
        self.robot.handle_timeout(now);
        self.host_events.extend(events(&mut self.host).into_iter().map(|event| (now, event)));
        self.robot_events.extend(events(&mut self.robot).into_iter().map(|event| (now, event)));
        for frame in sent(&mut self.host, now) {
            harmless(&frame);
            self.to_robot.send((self.fault)(To::Robot, &frame), now);
        }
        for frame in sent(&mut self.robot, now) {
            self.to_host.send((self.fault)(To::Host, &frame), now);
        }
        let speed = self.robot.command(now).speed();
        if self.motion.last().map_or(0, |(_, speed)| *speed) != speed {
            self.motion.push((now, speed));
        }
    }

    pub(crate) fn host_has_seen(&self, event: &HostEvent) -> usize {
        self.host_events.iter().filter(|(_, seen)| seen == event).count()
    }

    pub(crate) fn robot_has_seen(&self, event: &RobotEvent) -> usize {
        self.robot_events.iter().filter(|(_, seen)| seen == event).count()
    }
}

/// No frame of a host hangs, corrupts or updates a shipped robot (U7, U13).
pub(crate) fn harmless(frame: &[u8]) {
    assert!(frame.len() <= 64);
    match message(frame) {
        Message::MotorControl(command) => {
            assert_eq!((command.version(), command.back_led()), (0, 0));
            assert_eq!((command.reserve1(), command.reserve2()), (0, 0));
            assert!(command.speed().abs() <= 100 && command.angular().abs() <= 100);
        }
        Message::Ping(_)
        | Message::CalibrationStart(_)
        | Message::CalibrationEnd(_)
        | Message::ImuBiasAck(_)
        | Message::MagBiasAck(_)
        | Message::Biases(_)
        | Message::OtaRequest(_)
        | Message::SetNetworkState(_) => {}
        other => panic!("a host sent {other:?}"),
    }
}
