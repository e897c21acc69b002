//! Host and robot: one story per sentence of rulings U9 to U13, in virtual time.
//!
//! The two talk over a line in memory that takes 10 bit times per byte and does what a test wants
//! with the frames. After every step the rig asks both roles for their next deadline: it must lie
//! ahead, or a driver would spin.
#![cfg(feature = "ucp")]

use std::collections::{HashSet, VecDeque};

use axlewire::{
    endpoint::Endpoint,
    stream::Encode,
    time::{Duration, Instant, wire_time},
    ucp::{
        BAUD, BiasRequest, BiasStore, Biases, Body, CalibrationEnd, CalibrationEndAck,
        CalibrationKind, CalibrationStart, CalibrationStartAck, CalibrationStep, CommandError,
        ErrorCode, FailureCause, FirmwareReport, Frame, FrameOf, Host, HostConfig, HostEvent,
        HostStatistics, ImuBias, ImuBiasAck, Link, MagBias, MagBiasAck, MemoryStore, Message,
        MotorControl, NetworkState, NoStore, NotStored, OtaAck, OtaRequest, OtaStatus, Ping, Pong,
        RawFrame, ReportLayout, Robot, RobotConfig, RobotEvent, SetNetworkState, Telemetry,
        UpdateSource,
    },
};
use crc::{CRC_16_MODBUS, Crc};
use proptest::{collection::vec, prelude::*, sample::Index};

const IMU: CalibrationKind = CalibrationKind::Imu;
const MAG: CalibrationKind = CalibrationKind::Magnetometer;

fn ms(millis: u64) -> Instant {
    Instant::from_millis(millis)
}

fn us(micros: u64) -> Instant {
    Instant::from_micros(micros)
}

fn go(speed: i16) -> MotorControl {
    MotorControl::new(speed, 0).unwrap()
}

fn imu_bias() -> ImuBias {
    ImuBias::new([1, -2, 3], [-4, 5, -6])
}

fn mag_bias() -> MagBias {
    MagBias::new([7, -8, 9])
}

fn bytes<B: Body>(body: B) -> Vec<u8> {
    body.frame(0).as_bytes().to_vec()
}

/// A motor command as a careless host makes it: speed, angular, front lamp, version.
fn careless(speed: i16, angular: i16, front_led: i16, version: u16) -> MotorControl {
    let mut body = [0; 16];
    body[0..2].copy_from_slice(&speed.to_le_bytes());
    body[2..4].copy_from_slice(&angular.to_le_bytes());
    body[4..6].copy_from_slice(&front_led.to_le_bytes());
    body[8..10].copy_from_slice(&version.to_le_bytes());
    zerocopy::transmute!(body)
}

/// Everything that a role wants to send now. A role that never ends would hang its driver.
fn sent<R: Endpoint>(role: &mut R, now: Instant) -> Vec<Vec<u8>> {
    let mut frames = Vec::new();
    while let Some(frame) = role.poll_transmit(now) {
        frames.push(frame.to_vec());
        assert!(frames.len() <= 16, "a role that never stops sending");
    }
    assert!(role.poll_timeout().is_none_or(|at| at > now), "a driver would spin");
    frames
}

fn events<R: Endpoint>(role: &mut R) -> Vec<R::Event> {
    std::iter::from_fn(|| role.poll_event()).collect()
}

/// Lets time pass up to `end`, deadline by deadline; what is sent meanwhile, and when.
fn wait<R: Endpoint>(role: &mut R, end: Instant) -> Vec<(Instant, Vec<u8>)> {
    let mut frames = Vec::new();
    while let Some(at) = role.poll_timeout().filter(|&at| at <= end) {
        role.handle_timeout(at);
        frames.extend(sent(role, at).into_iter().map(|frame| (at, frame)));
        assert!(frames.len() < 100_000);
    }
    frames
}

fn message(frame: &[u8]) -> Message<'_> {
    Frame::parse(frame).unwrap().message()
}

fn is_ping(frame: &[u8]) -> bool {
    matches!(message(frame), Message::Ping(_))
}

fn speed(frame: &[u8]) -> Option<i16> {
    match message(frame) {
        Message::MotorControl(command) => Some(command.speed()),
        _ => None,
    }
}

/// When motor commands went out, and with which speed.
fn speeds(frames: &[(Instant, Vec<u8>)]) -> Vec<(u64, i16)> {
    let speeds = frames.iter().filter_map(|(at, frame)| Some((at.as_micros(), speed(frame)?)));
    speeds.collect()
}

fn quiet_config() -> HostConfig {
    let mut config = HostConfig::default();
    config.ping_period = None;
    config
}

/// A host without pings, so that a test sees only what it asks for.
fn quiet_host() -> Host {
    Host::new(quiet_config(), ms(0))
}

/// A robot that asks for nothing.
fn quiet_robot() -> Robot {
    quiet_robot_at(ms(0))
}

fn quiet_robot_at(now: Instant) -> Robot {
    let mut config = RobotConfig::default();
    config.bias_request_period = None;
    Robot::new(config, now)
}

/// One direction of the line.
struct Wire {
    free: Instant,
    frames: VecDeque<(Instant, Vec<u8>)>,
}

impl Wire {
    fn new(now: Instant) -> Self {
        Self { free: now, frames: VecDeque::new() }
    }

    fn send(&mut self, bytes: Vec<u8>, now: Instant) {
        self.free = now.max(self.free) + wire_time(bytes.len(), BAUD);
        self.frames.push_back((self.free, bytes));
    }

    fn next(&self) -> Option<Instant> {
        self.frames.front().map(|(at, _)| *at)
    }

    fn arrived(&mut self, now: Instant) -> Option<Vec<u8>> {
        self.next().filter(|&at| at <= now)?;
        self.frames.pop_front().map(|(_, bytes)| bytes)
    }
}

#[derive(Clone, Copy, Debug, Eq, PartialEq)]
enum To {
    Robot,
    Host,
}

type Fault = Box<dyn FnMut(To, &[u8]) -> Vec<u8>>;

/// A host, a robot and the line between them.
struct Rig<S: BiasStore = MemoryStore> {
    host: Host<S>,
    robot: Robot,
    now: Instant,
    to_robot: Wire,
    to_host: Wire,
    /// What becomes of a frame on the line.
    fault: Fault,
    host_events: Vec<(Instant, HostEvent)>,
    robot_events: Vec<(Instant, RobotEvent)>,
    /// What the robot's motors did: every change of its command.
    motion: Vec<(Instant, i16)>,
}

impl Rig {
    fn new(now: Instant) -> Self {
        let host = Host::with_store(HostConfig::default(), MemoryStore::default(), now);
        Self::of(host, Robot::new(RobotConfig::default(), now), now)
    }
}

impl<S: BiasStore> Rig<S> {
    fn of(host: Host<S>, robot: Robot, now: Instant) -> Self {
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

    /// Unplugs the line for ever, or plugs it in again.
    fn unplug(&mut self, unplugged: bool) {
        self.fault = Box::new(move |_, frame| if unplugged { Vec::new() } else { frame.to_vec() });
    }

    fn run_for(&mut self, millis: u32) {
        self.run_until(self.now + Duration::from_millis(millis));
    }

    fn run_until(&mut self, end: Instant) {
        self.step();
        while let Some(at) = self.next().filter(|&at| at <= end) {
            self.now = at;
            self.step();
        }
        self.now = end;
        self.step();
    }

    fn next(&self) -> Option<Instant> {
        let roles = [self.host.poll_timeout(), self.robot.poll_timeout()];
        roles.into_iter().chain([self.to_robot.next(), self.to_host.next()]).flatten().min()
    }

    /// One turn of both drivers' loops.
    fn step(&mut self) {
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

    fn host_has_seen(&self, event: &HostEvent) -> usize {
        self.host_events.iter().filter(|(_, seen)| seen == event).count()
    }

    fn robot_has_seen(&self, event: &RobotEvent) -> usize {
        self.robot_events.iter().filter(|(_, seen)| seen == event).count()
    }
}

/// No frame of a host hangs, corrupts or updates a shipped robot (U7, U13).
fn harmless(frame: &[u8]) {
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

// --- Motor commands and the dead-man (U10) ---

#[test]
fn nothing_but_pings_is_sent_before_the_first_command() {
    let mut host = Host::new(HostConfig::default(), ms(0));
    let mut frames = sent(&mut host, ms(0));
    frames.extend(wait(&mut host, ms(10_000)).into_iter().map(|(_, frame)| frame));
    assert!(frames.len() > 10);
    assert!(frames.iter().all(|frame| is_ping(frame)));
}

#[test]
fn the_latest_motor_command_is_repeated_every_100_ms() {
    let mut host = quiet_host();
    host.drive(go(40), ms(0)).unwrap();
    assert_eq!(sent(&mut host, ms(0)).len(), 1);
    let frames = wait(&mut host, ms(450));
    let at = |millis: u64| (millis * 1000, 40);
    assert_eq!(speeds(&frames), [at(100), at(200), at(300), at(400)]);
    assert_eq!(host.statistics().commands, 5);
}

#[test]
fn a_command_called_a_thousand_times_a_second_is_sent_every_100_ms() {
    let mut host = quiet_host();
    let mut count = 0;
    for now in 0..1000 {
        host.handle_timeout(ms(now));
        host.drive(go(40), ms(now)).unwrap();
        count += sent(&mut host, ms(now)).len();
    }
    assert_eq!(count, 10);
}

#[test]
fn commands_that_differ_leave_room_on_the_line_and_the_latest_wins() {
    let mut host = quiet_host();
    let mut frames = Vec::new();
    for now in 0..100 {
        host.drive(go(now as i16), ms(now)).unwrap();
        frames.extend(sent(&mut host, ms(now)).into_iter().map(|frame| (ms(now), frame)));
    }
    frames.extend(wait(&mut host, ms(120)));
    let at = |millis: u64, speed: i16| (millis * 1000, speed);
    let expected = [at(0, 0), at(20, 20), at(40, 40), at(60, 60), at(80, 80), at(100, 99)];
    assert_eq!(speeds(&frames), expected);
}

#[test]
fn a_stop_goes_out_at_once_and_before_everything_else() {
    let mut host = Host::new(HostConfig::default(), ms(0));
    host.drive(go(40).with_front_led(true), ms(0)).unwrap();
    sent(&mut host, ms(0));
    // All that could be in its way: an acknowledgement, a calibration, the lamp, a ping.
    let at = ms(250);
    host.handle_input(&bytes(imu_bias()), at);
    host.start_calibration(IMU, at).unwrap();
    host.set_network_state(NetworkState::Connected, at).unwrap();
    host.drive(go(50), at).unwrap();
    assert_eq!(speed(host.poll_transmit(at).unwrap()), Some(50));
    host.stop(at);
    let frames = sent(&mut host, at);
    assert_eq!(speed(&frames[0]), Some(0));
    assert!(frames.len() >= 4, "the others follow");
}

#[test]
fn a_stop_leaves_the_lamp_as_it_was() {
    let mut host = quiet_host();
    host.drive(go(40).with_front_led(true), ms(0)).unwrap();
    host.stop(ms(1));
    let frames = sent(&mut host, ms(1));
    assert_eq!(frames.len(), 1, "the latest wins");
    assert_eq!(frames[0], MotorControl::STOP.with_front_led(true).frame(0).as_bytes());
}

#[test]
fn stop_called_without_end_does_not_flood_the_line() {
    let mut host = quiet_host();
    let mut count = 0;
    for now in 0..1000 {
        host.handle_timeout(ms(now));
        host.stop(ms(now));
        count += sent(&mut host, ms(now)).len();
    }
    assert_eq!(count, 10);
}

#[test]
fn the_host_sends_zero_when_the_application_has_been_silent_for_500_ms() {
    let mut host = quiet_host();
    host.drive(go(40).with_front_led(true), ms(0)).unwrap();
    sent(&mut host, ms(0));
    let before = wait(&mut host, us(499_999));
    assert!(speeds(&before).iter().all(|(_, speed)| *speed == 40));
    assert_eq!(host.statistics().dead_man, 0);

    let after = wait(&mut host, ms(1000));
    assert_eq!(after[0].0, ms(500));
    assert!(speeds(&after).iter().all(|(_, speed)| *speed == 0));
    assert_eq!(after.len(), 6, "it is sent on, every 100 ms");
    let Message::MotorControl(command) = message(&after[5].1) else { panic!() };
    assert_eq!(command.front_led(), 100, "the lamp stays");
    let dead_men = events(&mut host).into_iter().filter(|event| *event == HostEvent::DeadMan);
    assert_eq!((dead_men.count(), host.statistics().dead_man), (1, 1), "once");

    host.drive(go(30), ms(1010)).unwrap();
    assert_eq!(wait(&mut host, ms(1030)).len(), 1, "and the next call drives again");
    assert_eq!(host.command().unwrap().speed(), 30);
}

#[test]
fn the_dead_man_does_not_wait_for_the_next_repetition() {
    let mut host = quiet_host();
    host.drive(go(40), ms(0)).unwrap();
    sent(&mut host, ms(0));
    host.drive(go(40), ms(30)).unwrap();
    let frames = speeds(&wait(&mut host, ms(560)));
    assert_eq!(frames[4..], [(500_000, 40), (530_000, 0)]);
}

#[test]
fn an_application_that_has_stopped_may_be_silent() {
    let mut host = quiet_host();
    host.drive(go(40), ms(0)).unwrap();
    host.stop(ms(10));
    sent(&mut host, ms(10));
    let frames = wait(&mut host, ms(2000));
    assert!(frames.len() >= 19 && speeds(&frames).iter().all(|(_, speed)| *speed == 0));
    assert!(!events(&mut host).contains(&HostEvent::DeadMan));
}

#[test]
fn a_late_driver_does_not_revive_a_command_that_is_too_old() {
    let mut host = quiet_host();
    host.drive(go(40), ms(0)).unwrap();
    // Nobody called handle_timeout in between.
    assert_eq!(host.poll_transmit(ms(700)).and_then(speed), Some(0));
    assert_eq!(events(&mut host), [HostEvent::DeadMan]);
}

#[test]
fn a_command_that_would_start_an_update_is_refused() {
    let mut host = quiet_host();
    host.drive(go(10), ms(0)).unwrap();
    let refused = host.drive(careless(20, 0, 0, 39), ms(1));
    assert_eq!(refused, Err(CommandError::StartsUpdate { version: 39 }));
    assert!(matches!(host.drive(careless(101, 0, 0, 0), ms(1)), Err(CommandError::Value(_))));
    assert!(matches!(host.drive(careless(0, -101, 0, 0), ms(1)), Err(CommandError::Value(_))));
    assert_eq!(host.command().unwrap().speed(), 10, "the command before goes on");
}

#[test]
fn of_a_copied_command_only_speed_turn_and_lamp_are_sent() {
    let mut host = quiet_host();
    host.drive(careless(20, -30, 100, 38), ms(0)).unwrap();
    let plain = MotorControl::new(20, -30).unwrap().with_front_led(true);
    assert_eq!(sent(&mut host, ms(0)), [plain.frame(0).as_bytes()]);
}

#[test]
fn the_index_counts_every_frame_of_the_host_and_wraps() {
    let mut host = quiet_host();
    for count in 0..600_u64 {
        host.handle_timeout(ms(count * 100));
        host.stop(ms(count * 100));
        let frames = sent(&mut host, ms(count * 100));
        let indices: Vec<_> = frames.iter().map(|f| Frame::parse(f).unwrap().index()).collect();
        assert_eq!(indices, [count as u8]);
    }
}

// --- Link, pings, reports ---

#[test]
fn the_link_goes_up_with_the_first_valid_frame() {
    let mut rig = Rig::new(ms(0));
    assert_eq!(rig.host.link(), Link::Waiting);
    rig.run_for(10);
    assert_eq!(rig.host.link(), Link::Up);
    assert_eq!(rig.host_events[0].1, HostEvent::LinkUp);
}

#[test]
fn the_link_is_lost_after_500_ms_without_a_valid_frame_and_not_earlier() {
    let mut host = quiet_host();
    host.handle_input(&bytes(Pong::new(ErrorCode::Fine)), ms(100));
    assert_eq!(events(&mut host), [HostEvent::LinkUp]);
    // Noise is no frame.
    host.handle_input(&[0x55; 40], ms(400));
    host.handle_timeout(us(599_999));
    assert_eq!((host.link(), events(&mut host)), (Link::Up, vec![]));
    assert_eq!(host.poll_timeout(), Some(ms(600)));
    host.handle_timeout(ms(600));
    assert_eq!((host.link(), events(&mut host)), (Link::Down, vec![HostEvent::LinkDown]));
    wait(&mut host, ms(5000));
    assert_eq!(events(&mut host), [], "said once");
    host.handle_input(&bytes(BiasRequest {}), ms(6000));
    assert_eq!(events(&mut host)[0], HostEvent::LinkUp);
}

#[test]
fn a_robot_that_never_answers_is_reported_after_500_ms() {
    let mut host = Host::new(HostConfig::default(), ms(0));
    sent(&mut host, ms(0));
    wait(&mut host, us(499_999));
    assert_eq!(events(&mut host), []);
    let pings = wait(&mut host, ms(60_000));
    assert_eq!(events(&mut host), [HostEvent::LinkDown]);
    assert_eq!(pings.len(), 120, "one ping per ping timeout, no flood");
    assert_eq!(host.statistics().pings_lost, 120);
}

#[test]
fn an_echoing_line_is_no_robot() {
    let mut host = Host::new(HostConfig::default(), ms(0));
    for now in (0..2000).step_by(10) {
        host.handle_timeout(ms(now));
        host.drive(go(10), ms(now)).unwrap();
        for frame in sent(&mut host, ms(now)) {
            host.handle_input(&frame, ms(now));
        }
    }
    assert_eq!(host.link(), Link::Down);
    assert_eq!(events(&mut host), [HostEvent::LinkDown]);
    assert_eq!(u64::from(host.statistics().misdirected), host.counters().frames);
}

#[test]
fn a_pong_tells_the_round_trip_time() {
    let mut host = Host::new(HostConfig::default(), ms(0));
    for (turn, micros) in [(0, 3000), (1, 1000), (2, 2000)] {
        let at = ms(turn * 200);
        host.handle_timeout(at);
        assert!(is_ping(&sent(&mut host, at)[0]));
        let back = at + Duration::from_micros(micros);
        host.handle_input(&bytes(Pong::new(ErrorCode::Fine)), back);
        let round_trip = Duration::from_micros(micros);
        assert!(events(&mut host).contains(&HostEvent::Pong { round_trip, err: ErrorCode::Fine }));
    }
    let trip = host.statistics().round_trip;
    let micros = |span: Option<Duration>| span.unwrap().as_micros();
    assert_eq!((trip.count(), micros(trip.min()), micros(trip.max())), (3, 1000, 3000));
    assert_eq!(micros(trip.mean()), 2000);
    assert_eq!(HostStatistics::default().round_trip.mean(), None);
}

#[test]
fn a_pong_that_says_damaged_reaches_the_application() {
    let mut host = Host::new(HostConfig::default(), ms(0));
    sent(&mut host, ms(0));
    host.handle_input(&bytes(Pong::new(ErrorCode::Damaged)), ms(2));
    let round_trip = Duration::from_millis(2);
    let pong = HostEvent::Pong { round_trip, err: ErrorCode::Damaged };
    assert!(events(&mut host).contains(&pong));
    assert_eq!(host.statistics().pings_damaged, 1);
}

#[test]
fn a_late_pong_answers_no_ping() {
    let mut host = Host::new(HostConfig::default(), ms(0));
    sent(&mut host, ms(0));
    host.handle_timeout(ms(500));
    assert_eq!(host.statistics().pings_lost, 1);
    host.handle_input(&bytes(Pong::new(ErrorCode::Fine)), ms(500));
    assert_eq!(host.statistics().pongs_unasked, 1);
    assert_eq!(host.statistics().round_trip.count(), 0);
}

#[test]
fn missing_reports_are_counted_by_their_index() {
    let mut host = quiet_host();
    let report = |host: &mut Host, index, at| {
        let body = FirmwareReport::new(&Telemetry::default(), 38);
        host.handle_input(body.frame(index).as_bytes(), ms(at));
        let HostEvent::Report(report) = events(host).pop().unwrap() else { panic!() };
        assert_eq!((report.index, report.version), (index, Some(38)));
        report.lost
    };
    assert_eq!(report(&mut host, 250, 0), 0, "nothing to count from");
    assert_eq!(report(&mut host, 251, 20), 0);
    assert_eq!(report(&mut host, 255, 100), 3);
    assert_eq!(report(&mut host, 0, 120), 0, "it wraps");
    assert_eq!(report(&mut host, 2, 160), 1);
    assert_eq!(report(&mut host, 2, 180), 0, "repeated");
    assert_eq!((host.statistics().reports_lost, host.statistics().reports_repeated), (4, 1));
    assert_eq!(report(&mut host, 0, 200), 253, "a restart in disguise");
    // A restart that the robot announces, or that takes the link down, costs nothing.
    report(&mut host, 100, 220);
    host.handle_input(&bytes(BiasRequest {}), ms(230));
    events(&mut host);
    assert_eq!(report(&mut host, 0, 240), 0);
    host.handle_timeout(ms(740));
    assert_eq!(report(&mut host, 77, 800), 0);
    assert_eq!(host.statistics().reports, 10);
    assert_eq!(host.last_report().unwrap().index, 77);
}

#[test]
fn a_false_header_holds_a_report_back_no_longer_than_the_quiet_margin() {
    let mut host = quiet_host();
    // It promises 60 bytes, and the report has 44.
    let mut line = vec![0xFD, 0xFF, 60, 0, 5];
    line.extend(bytes(FirmwareReport::new(&Telemetry::default(), 38)));
    host.handle_input(&line, ms(10));
    assert_eq!(host.counters().frames, 0);
    let quiet = ms(30) + wire_time(2, BAUD);
    assert_eq!(host.poll_timeout(), Some(quiet));
    host.handle_timeout(quiet);
    assert_eq!((host.counters().frames, host.statistics().reports), (1, 1));
    assert_eq!(host.poll_timeout(), Some(ms(510)), "the link counts from its arrival");
}

#[test]
fn a_frame_in_two_pieces_is_whole() {
    let mut robot = quiet_robot();
    let command = bytes(go(60));
    robot.handle_input(&command[..7], ms(0));
    robot.handle_timeout(ms(4)); // within the margin
    robot.handle_input(&command[7..], ms(4));
    assert_eq!(robot.command(ms(4)).speed(), 60);
}

#[test]
fn unknown_frames_pass_through_raw() {
    let mut host = quiet_host();
    let mut buffer = [0; 64];
    let longest = [0xA5; 56];
    for raw in [
        RawFrame { id: 0x20, index: 9, body: &[1, 2, 3] },
        RawFrame { id: 0xFF, index: 0, body: &longest },
    ] {
        host.handle_input(raw.encode(&mut buffer).unwrap(), ms(1));
        let Some(HostEvent::Unknown(frame)) = events(&mut host).pop() else { panic!() };
        assert_eq!(frame.as_raw(), raw);
    }
    assert_eq!(host.statistics().unknown, 2);
}

#[test]
fn the_network_state_is_sent_on_change_and_when_the_robot_may_have_forgotten_it() {
    let mut host = quiet_host();
    let state = |host: &mut Host, now| {
        let frames = sent(host, now);
        assert!(frames.len() <= 1);
        frames.first().map(|frame| match message(frame) {
            Message::SetNetworkState(body) => body.state(),
            other => panic!("{other:?}"),
        })
    };
    assert_eq!(state(&mut host, ms(0)), None);
    host.set_network_state(NetworkState::Connected, ms(1)).unwrap();
    assert_eq!(state(&mut host, ms(1)), Some(NetworkState::Connected));
    host.set_network_state(NetworkState::Connected, ms(2)).unwrap();
    assert_eq!(state(&mut host, ms(2)), None, "no change");
    host.set_network_state(NetworkState::Disconnected, ms(3)).unwrap();
    assert_eq!(state(&mut host, ms(3)), Some(NetworkState::Disconnected));
    // The link comes up, goes down and comes up again.
    for at in [10, 1000] {
        host.handle_input(&bytes(Pong::new(ErrorCode::Fine)), ms(at));
        assert_eq!(state(&mut host, ms(at)), Some(NetworkState::Disconnected));
        host.handle_timeout(ms(at + 500));
    }
    // The robot has booted.
    host.handle_input(&bytes(Pong::new(ErrorCode::Fine)), ms(2000));
    state(&mut host, ms(2000));
    host.handle_input(&bytes(BiasRequest {}), ms(2100));
    assert_eq!(state(&mut host, ms(2100)), Some(NetworkState::Disconnected));
    let refused = host.set_network_state(NetworkState::Other(256), ms(2200));
    assert_eq!(refused, Err(CommandError::NetworkState { state: 256 }));
}

// --- Calibration (U11) ---

#[test]
fn a_calibration_ends_with_biases_in_the_store() {
    let mut rig = Rig::new(ms(0));
    rig.run_for(100);
    rig.host.start_calibration(IMU, rig.now).unwrap();
    assert_eq!(rig.host.start_calibration(MAG, rig.now), Err(CommandError::Calibrating));
    rig.run_for(100);
    assert_eq!(rig.robot_has_seen(&RobotEvent::CalibrationStart(IMU)), 1);
    assert_eq!(rig.host_has_seen(&HostEvent::CalibrationStarted(IMU)), 1);
    rig.host.end_calibration(IMU, rig.now).unwrap();
    rig.run_for(100);
    assert_eq!(rig.robot_has_seen(&RobotEvent::CalibrationEnd(IMU)), 1);
    assert_eq!(rig.host_has_seen(&HostEvent::CalibrationEnded(IMU)), 1);
    rig.robot.calibration_result_imu(imu_bias(), rig.now);
    rig.run_for(3000);
    assert_eq!(rig.host_has_seen(&HostEvent::ImuBias(imu_bias())), 1);
    assert_eq!(rig.robot_has_seen(&RobotEvent::ImuBiasTaken), 1);
    assert_eq!(rig.host.store().imu, Some(imu_bias()));
    assert_eq!(rig.robot.statistics().results, 1, "acknowledged at once, not repeated");
    assert_eq!(rig.host.statistics().calibration_retries, 0);
}

#[test]
fn calibration_requests_are_acknowledged_at_once() {
    let mut robot = quiet_robot();
    robot.handle_input(&bytes(CalibrationStart::new(MAG)), ms(1));
    let ack = CalibrationStartAck::new(MAG, ErrorCode::Fine);
    assert_eq!(sent(&mut robot, ms(1)), [bytes(ack)]);
    robot.handle_input(&bytes(CalibrationEnd::new(MAG)), ms(2));
    let ack = CalibrationEndAck::new(MAG, ErrorCode::Fine);
    assert_eq!(sent(&mut robot, ms(2)), [bytes(ack)]);
    let both = [RobotEvent::CalibrationStart(MAG), RobotEvent::CalibrationEnd(MAG)];
    assert_eq!(events(&mut robot), both);
}

#[test]
fn a_calibration_request_that_comes_again_is_acknowledged_and_no_event() {
    let mut robot = quiet_robot();
    for (at, request) in [
        (1, bytes(CalibrationStart::new(MAG))),
        (2, bytes(CalibrationStart::new(MAG))),
        (3, bytes(CalibrationEnd::new(MAG))),
        (4, bytes(CalibrationEnd::new(MAG))),
        (5, bytes(CalibrationStart::new(CalibrationKind::Other(0)))),
    ] {
        robot.handle_input(&request, ms(at));
        assert_eq!(sent(&mut robot, ms(at)).len(), 1);
    }
    assert_eq!(events(&mut robot).len(), 2);
    assert_eq!(
        (robot.statistics().calibration_repeats, robot.statistics().calibration_refused),
        (1, 2)
    );
    assert_eq!(robot.calibrating(), None);
}

#[test]
fn a_lost_acknowledgement_is_asked_for_again() {
    let mut rig = Rig::new(ms(0));
    let mut lost = 0;
    rig.fault = Box::new(move |_, frame| {
        let is_ack = matches!(message(frame), Message::CalibrationStartAck(_));
        if is_ack && lost < 2 {
            lost += 1;
            return Vec::new();
        }
        frame.to_vec()
    });
    rig.host.start_calibration(MAG, rig.now).unwrap();
    rig.run_for(1000);
    assert_eq!(rig.host_has_seen(&HostEvent::CalibrationStarted(MAG)), 1);
    assert_eq!(rig.robot_has_seen(&RobotEvent::CalibrationStart(MAG)), 1);
    assert_eq!(rig.host.statistics().calibration_retries, 2);
}

#[test]
fn a_calibration_request_that_nobody_answers_fails_within_its_bound() {
    let mut host = quiet_host();
    host.start_calibration(IMU, ms(0)).unwrap();
    sent(&mut host, ms(0));
    let bound = HostConfig::default().calibration_bound();
    assert_eq!(bound.as_micros(), 3 * (200_000 + 782));
    let retries = wait(&mut host, ms(0) + bound);
    assert_eq!(retries.len(), 2);
    let event = events(&mut host).pop().unwrap();
    let HostEvent::CalibrationFailed(failure) = event else { panic!("{event:?}") };
    assert_eq!((failure.step, failure.kind), (CalibrationStep::Start, IMU));
    assert_eq!((failure.cause, failure.attempts), (FailureCause::NoAnswer, 3));
    assert_eq!(host.statistics().calibration_failures, 1);
    host.start_calibration(IMU, ms(5000)).unwrap();
}

#[test]
fn a_calibration_request_that_arrives_damaged_is_sent_again_at_once_and_fails_in_the_end() {
    let mut host = quiet_host();
    host.end_calibration(IMU, ms(0)).unwrap();
    for at in [0, 1, 2] {
        assert_eq!(sent(&mut host, ms(at)).len(), 1);
        // Shipped robots tell an old kind here.
        let ack = CalibrationEndAck::new(MAG, ErrorCode::Damaged);
        host.handle_input(&bytes(ack), ms(at + 1));
    }
    let Some(HostEvent::CalibrationFailed(failure)) = events(&mut host).pop() else { panic!() };
    assert_eq!(failure.cause, FailureCause::Refused(ErrorCode::Damaged));
    assert_eq!(failure.step, CalibrationStep::End);
    assert_eq!(sent(&mut host, ms(3)), [] as [Vec<u8>; 0]);
}

#[test]
fn the_cause_of_a_failure_is_that_of_the_last_attempt() {
    let mut host = quiet_host();
    host.start_calibration(IMU, ms(0)).unwrap();
    sent(&mut host, ms(0));
    let ack = CalibrationStartAck::new(IMU, ErrorCode::Damaged);
    host.handle_input(&bytes(ack), ms(1));
    assert_eq!(wait(&mut host, ms(1000)).len(), 2);
    let failure = events(&mut host).into_iter().find_map(|event| match event {
        HostEvent::CalibrationFailed(failure) => Some(failure),
        _ => None,
    });
    assert_eq!(failure.unwrap().cause, FailureCause::NoAnswer);
}

#[test]
fn an_end_is_acknowledged_with_whatever_kind_shipped_robots_tell() {
    let mut host = quiet_host();
    host.end_calibration(IMU, ms(0)).unwrap();
    sent(&mut host, ms(0));
    let ack = CalibrationEndAck::new(CalibrationKind::Other(0), ErrorCode::Fine);
    host.handle_input(&bytes(ack), ms(1));
    assert_eq!(events(&mut host).pop(), Some(HostEvent::CalibrationEnded(IMU)));
}

#[test]
fn acknowledgements_that_nobody_waits_for_are_counted() {
    let mut host = quiet_host();
    let ack = bytes(CalibrationStartAck::new(IMU, ErrorCode::Fine));
    host.handle_input(&ack, ms(0)); // nothing was asked
    host.start_calibration(MAG, ms(1)).unwrap();
    let early = bytes(CalibrationStartAck::new(MAG, ErrorCode::Fine));
    host.handle_input(&early, ms(1)); // not sent yet
    sent(&mut host, ms(1));
    host.handle_input(&ack, ms(2)); // another kind
    host.handle_input(&bytes(CalibrationEndAck::new(MAG, ErrorCode::Fine)), ms(3));
    assert_eq!(host.statistics().acks_unasked, 4);
    assert_eq!(events(&mut host), [HostEvent::LinkUp]);
    let unknown = host.start_calibration(CalibrationKind::Other(7), ms(4));
    assert_eq!(unknown, Err(CommandError::Calibrating));
}

#[test]
fn a_calibration_that_no_robot_knows_is_refused() {
    let mut host = quiet_host();
    let refused = host.start_calibration(CalibrationKind::Other(7), ms(0));
    assert_eq!(refused, Err(CommandError::CalibrationKind { kind: 7 }));
    assert_eq!(sent(&mut host, ms(0)), [] as [Vec<u8>; 0]);
}

#[test]
fn results_are_repeated_every_1000_ms_until_acknowledged() {
    let mut robot = quiet_robot();
    robot.calibration_result_imu(imu_bias(), ms(0));
    robot.calibration_result_mag(mag_bias(), ms(300));
    assert_eq!(sent(&mut robot, ms(300)), [bytes(imu_bias()), bytes(mag_bias())]);
    let times: Vec<_> = wait(&mut robot, ms(3400)).iter().map(|(at, _)| at.as_micros()).collect();
    assert_eq!(times, [1_300_000, 1_300_000, 2_300_000, 2_300_000, 3_300_000, 3_300_000]);
    // One that says damaged does not end it.
    robot.handle_input(&bytes(ImuBiasAck::new(ErrorCode::Damaged)), ms(3500));
    robot.handle_input(&bytes(MagBiasAck::new(ErrorCode::Damaged)), ms(3500));
    assert_eq!(events(&mut robot), []);
    robot.handle_input(&bytes(MagBiasAck::new(ErrorCode::Fine)), ms(3500));
    assert_eq!(events(&mut robot), [RobotEvent::MagBiasTaken]);
    assert_eq!(wait(&mut robot, ms(5000)).len(), 1);
    robot.handle_input(&bytes(ImuBiasAck::new(ErrorCode::Fine)), ms(5000));
    assert_eq!(events(&mut robot), [RobotEvent::ImuBiasTaken]);
    assert_eq!(robot.poll_timeout(), None, "nothing is left to do");
    assert_eq!(robot.statistics().acks_refused, 2);
}

#[test]
fn a_repeated_result_is_acknowledged_again_and_stored_once() {
    struct Counting(MemoryStore, u32);
    impl BiasStore for Counting {
        fn load(&mut self) -> (Option<ImuBias>, Option<MagBias>) {
            self.0.load()
        }
        fn store_imu(&mut self, bias: ImuBias) -> Result<(), NotStored> {
            self.1 += 1;
            self.0.store_imu(bias)
        }
        fn store_mag(&mut self, bias: MagBias) -> Result<(), NotStored> {
            self.1 += 1;
            self.0.store_mag(bias)
        }
    }
    let mut store = Counting(MemoryStore::default(), 0);
    let mut host = Host::with_store(quiet_config(), &mut store, ms(0));
    for at in [0, 1000, 2000] {
        host.handle_input(&bytes(mag_bias()), ms(at));
        host.handle_timeout(ms(at));
        let acks = sent(&mut host, ms(at));
        assert!(matches!(message(&acks[0]), Message::MagBiasAck(_)));
        wait(&mut host, ms(at + 999));
    }
    assert_eq!(host.statistics().results_repeated, 2);
    // The same result of a new calibration is a new one.
    host.start_calibration(MAG, ms(3000)).unwrap();
    host.handle_input(&bytes(mag_bias()), ms(3001));
    assert_eq!(host.statistics().results_repeated, 2);
    wait(&mut host, ms(4000));
    host.handle_input(&bytes(imu_bias()), ms(4000));
    host.start_calibration(IMU, ms(4001)).unwrap();
    host.handle_input(&bytes(imu_bias()), ms(4002));
    assert_eq!(host.statistics().results_repeated, 2);
    assert_eq!(store.1, 4);
}

#[test]
fn a_result_that_is_not_stored_is_not_acknowledged() {
    struct Full;
    impl BiasStore for Full {
        fn load(&mut self) -> (Option<ImuBias>, Option<MagBias>) {
            (None, None)
        }
        fn store_imu(&mut self, _: ImuBias) -> Result<(), NotStored> {
            Err(NotStored)
        }
        fn store_mag(&mut self, _: MagBias) -> Result<(), NotStored> {
            Err(NotStored)
        }
    }
    let mut host = Host::with_store(quiet_config(), Full, ms(0));
    host.handle_input(&bytes(imu_bias()), ms(1));
    host.handle_input(&bytes(mag_bias()), ms(2));
    assert_eq!(sent(&mut host, ms(2)), [] as [Vec<u8>; 0]);
    let seen = events(&mut host);
    assert_eq!(seen[1..], [HostEvent::BiasNotStored(IMU), HostEvent::BiasNotStored(MAG)]);
    assert_eq!(host.statistics().results_not_stored, 2);
}

#[test]
fn biases_are_asked_for_every_1000_ms_from_boot_until_answered() {
    let mut robot = Robot::new(RobotConfig::default(), ms(0));
    assert_eq!(sent(&mut robot, ms(0)), [bytes(BiasRequest {})]);
    let times: Vec<_> = wait(&mut robot, ms(3500)).iter().map(|(at, _)| at.as_micros()).collect();
    assert_eq!(times, [1_000_000, 2_000_000, 3_000_000]);
    let biases = Biases::new(imu_bias(), mag_bias());
    robot.handle_input(&bytes(biases), ms(3600));
    assert_eq!(events(&mut robot), [RobotEvent::Biases(biases)]);
    assert_eq!(robot.poll_timeout(), None);
    assert_eq!(sent(&mut quiet_robot(), ms(0)), [] as [Vec<u8>; 0], "can be switched off");
}

#[test]
fn the_robots_boot_request_is_answered_only_if_all_biases_are_stored() {
    let mut rig = Rig::new(ms(0));
    rig.host.store().imu = Some(imu_bias());
    rig.run_for(2500);
    let missing = HostEvent::BiasesMissing { imu: false, mag: true };
    assert_eq!(rig.host_has_seen(&missing), 3);
    assert_eq!(rig.robot_events, []);
    rig.host.store().mag = Some(mag_bias());
    rig.run_for(5000);
    assert_eq!(rig.robot_has_seen(&RobotEvent::Biases(Biases::new(imu_bias(), mag_bias()))), 1);
    assert_eq!(rig.host_has_seen(&HostEvent::BiasesSent), 1);
    assert_eq!(rig.robot.statistics().bias_requests, 4);
}

#[test]
fn a_host_without_a_store_passes_results_on_as_events() {
    let mut rig = Rig::of(Host::new(HostConfig::default(), ms(0)), quiet_robot(), ms(0));
    rig.robot.calibration_result_mag(mag_bias(), rig.now);
    rig.run_for(2000);
    assert_eq!(rig.host_has_seen(&HostEvent::MagBias(mag_bias())), 1);
    assert_eq!(rig.robot_has_seen(&RobotEvent::MagBiasTaken), 1);
    assert_eq!(*rig.host.store(), NoStore);
}

// --- Firmware update (U7, U13) ---

#[test]
fn a_firmware_update_is_asked_for_once_and_followed_by_silence() {
    let mut host = Host::new(HostConfig::default(), ms(0));
    host.start_calibration(IMU, ms(0)).unwrap();
    assert_eq!(host.start_firmware_update(40, ms(0)), Err(CommandError::Calibrating));
    sent(&mut host, ms(0));
    host.handle_input(&bytes(CalibrationStartAck::new(IMU, ErrorCode::Fine)), ms(10));
    host.drive(go(10), ms(50)).unwrap();
    sent(&mut host, ms(50));
    assert_eq!(host.start_firmware_update(40, ms(100)), Err(CommandError::Moving));
    host.stop(ms(110));
    host.start_firmware_update(40, ms(110)).unwrap();
    assert_eq!(host.drive(go(10), ms(110)), Err(CommandError::Updating));
    assert_eq!(host.start_calibration(IMU, ms(110)), Err(CommandError::Updating));
    let frames = sent(&mut host, ms(110));
    assert_eq!(speed(&frames[0]), Some(0));
    assert!(matches!(message(&frames[1]), Message::OtaRequest(request) if request.version() == 40));
    assert_eq!(frames.len(), 2);
    // Whatever comes in meanwhile, nothing goes out.
    host.handle_input(&bytes(imu_bias()), ms(120));
    host.handle_input(&bytes(OtaAck::new(OtaStatus::Accepted)), ms(130));
    assert_eq!(wait(&mut host, ms(60_000)), []);
    assert!(events(&mut host).contains(&HostEvent::UpdateAnswered(OtaStatus::Accepted)));
    host.end_firmware_update();
    host.handle_timeout(ms(60_000));
    assert!(sent(&mut host, ms(60_000)).iter().any(|frame| is_ping(frame)));
}

#[test]
fn a_refused_update_and_a_stop_end_the_silence() {
    let mut host = quiet_host();
    host.start_firmware_update(40, ms(0)).unwrap();
    assert_eq!(sent(&mut host, ms(0)).len(), 1);
    host.handle_input(&bytes(OtaAck::new(OtaStatus::Forbidden)), ms(10));
    host.drive(go(10), ms(20)).unwrap();
    assert_eq!(sent(&mut host, ms(20)).len(), 1);
    host.stop(ms(30));
    host.start_firmware_update(40, ms(30)).unwrap();
    sent(&mut host, ms(30));
    host.stop(ms(60));
    assert_eq!(speeds(&wait(&mut host, ms(60))), [(60_000, 0)]);
}

#[test]
fn an_update_never_starts_by_itself() {
    let mut robot = quiet_robot();
    robot.handle_input(&bytes(go(10)), ms(0));
    robot.handle_input(&bytes(careless(90, 0, 0, 39)), ms(10));
    assert_eq!(robot.command(ms(10)).speed(), 10, "its speed is not taken");
    assert_eq!(robot.command(ms(500)).speed(), 0, "and it does not feed the watchdog");
    assert!(!robot.answer_update(OtaStatus::Accepted, ms(10)), "nothing to answer");
    robot.handle_input(&bytes(OtaRequest::start_firmware_update(41)), ms(20));
    let by_motor = RobotEvent::UpdateRequested { version: 39, by: UpdateSource::MotorCommand };
    let by_request = RobotEvent::UpdateRequested { version: 41, by: UpdateSource::Request };
    assert_eq!(events(&mut robot)[1..], [by_motor, by_request]);
    assert_eq!(sent(&mut robot, ms(20)), [] as [Vec<u8>; 0], "the application decides");
    assert!(robot.answer_update(OtaStatus::Forbidden, ms(30)));
    assert_eq!(sent(&mut robot, ms(30)), [bytes(OtaAck::new(OtaStatus::Forbidden))]);
    assert!(!robot.answer_update(OtaStatus::Forbidden, ms(30)), "once");
}

#[test]
fn a_command_that_a_false_header_held_back_is_as_old_as_its_bytes() {
    let mut robot = Robot::new(RobotConfig::default(), ms(0));
    // A start of 64 bytes that never comes, a command behind it, and a driver that is late.
    let held = [&[0xFD, 0xFF, 60, 0][..], go(60).frame(0).as_bytes()].concat();
    robot.handle_input(&held, ms(10));
    assert_eq!(robot.command(ms(11)).speed(), 0, "not yet to be seen");
    robot.handle_input(&[0; 36], ms(400));
    assert_eq!(robot.command(ms(400)).speed(), 60, "it holds for 500 ms ...");
    assert_eq!(robot.command(ms(510)).speed(), 0, "... from when it had arrived");

    let mut robot = Robot::new(RobotConfig::default(), ms(0));
    robot.handle_input(&held, ms(10));
    robot.handle_input(&[0; 36], ms(2000));
    assert_eq!(robot.command(ms(2000)).speed(), 0, "nobody wants it any more");
}

// --- The robot (U9, U10, U12, U13) ---

#[test]
fn a_ping_is_answered_at_once_with_0() {
    let mut robot = quiet_robot();
    robot.handle_input(&bytes(Ping {}), ms(1));
    assert_eq!(robot.poll_timeout(), Some(ms(1)));
    assert_eq!(sent(&mut robot, ms(1)), [bytes(Pong::new(ErrorCode::Fine))]);
    assert_eq!(robot.poll_timeout(), None);
}

#[test]
fn a_damaged_ping_is_not_answered() {
    let mut robot = quiet_robot();
    let mut ping = bytes(Ping {});
    ping[7] ^= 1;
    robot.handle_input(&ping, ms(1));
    assert!(robot.statistics().pings == 0 && robot.counters().crc > 0);
    assert_eq!(wait(&mut robot, ms(1000)), []);
}

#[test]
fn no_valid_motor_frame_for_500_ms_means_standing_still() {
    let mut robot = quiet_robot();
    let command = MotorControl::new(60, -20).unwrap().with_front_led(true);
    robot.handle_input(&bytes(command), ms(100));
    assert_eq!(events(&mut robot), [RobotEvent::Motor(command)]);
    // Neither noise nor a damaged command nor a ping is a command.
    let mut damaged = bytes(command);
    damaged[9] ^= 0x10;
    for at in [200, 300, 400, 500] {
        robot.handle_input(&[0xFD; 30], ms(at));
        robot.handle_input(&damaged, ms(at));
        robot.handle_input(&bytes(Ping {}), ms(at));
        sent(&mut robot, ms(at));
    }
    wait(&mut robot, us(599_999));
    assert_eq!((robot.command(us(599_999)), events(&mut robot)), (command, vec![]));
    wait(&mut robot, ms(600));
    let still = MotorControl::STOP.with_front_led(true);
    assert_eq!(robot.command(ms(600)), still);
    assert_eq!(events(&mut robot), [RobotEvent::WatchdogStop]);
    wait(&mut robot, ms(5000));
    assert_eq!(events(&mut robot), [], "said once");
    robot.handle_input(&bytes(command), ms(6000));
    assert_eq!(events(&mut robot), [RobotEvent::Motor(command)], "the next one is obeyed");
}

#[test]
fn a_robot_whose_driver_is_late_still_stands_still() {
    let mut robot = quiet_robot();
    robot.handle_input(&bytes(go(60)), ms(0));
    assert_eq!(robot.command(ms(500)).speed(), 0, "without handle_timeout");
    // The next command comes before anyone has handled the timeout.
    robot.handle_input(&bytes(go(60)), ms(700));
    let go = RobotEvent::Motor(go(60));
    assert_eq!(events(&mut robot), [go, RobotEvent::WatchdogStop, go]);
}

#[test]
fn the_first_command_is_an_event_even_if_it_changes_nothing() {
    let mut robot = quiet_robot();
    robot.handle_input(&bytes(MotorControl::STOP), ms(0));
    robot.handle_input(&bytes(MotorControl::STOP), ms(100));
    assert_eq!(events(&mut robot), [RobotEvent::Motor(MotorControl::STOP)]);
}

#[test]
fn a_repeated_command_is_no_event() {
    let mut robot = quiet_robot();
    for at in (0..2000).step_by(100) {
        robot.handle_timeout(ms(at));
        robot.handle_input(&bytes(go(60)), ms(at));
    }
    assert_eq!(events(&mut robot), [RobotEvent::Motor(go(60))]);
    assert_eq!(robot.statistics().commands, 20);
}

#[test]
fn out_of_range_is_cut_as_the_vendor_firmware_does() {
    let mut robot = quiet_robot();
    robot.handle_input(&bytes(careless(i16::MIN, 360, 0x0101, 0)), ms(0));
    let command = robot.command(ms(0));
    assert_eq!((command.speed(), command.angular()), (-100, 100));
    assert_eq!(command.front_led(), 100, "any low byte but 00 and FF is on");
    robot.handle_input(&bytes(careless(1, 2, -1, 0)), ms(1));
    assert_eq!(robot.command(ms(1)), MotorControl::new(1, 2).unwrap());
    assert_eq!((robot.statistics().commands, robot.statistics().commands_clamped), (2, 1));
}

#[test]
fn reports_come_every_20_ms_without_drift() {
    let mut robot = quiet_robot();
    assert_eq!(robot.poll_timeout(), None, "nothing is reported unmeasured");
    robot.set_telemetry(&Telemetry::default(), ms(7));
    let mut count = 0;
    while let Some(at) = robot.poll_timeout().filter(|&at| at < ms(10_007)) {
        assert_eq!(at, ms(7 + 20 * count));
        // A driver that is always a little late.
        let now = at + Duration::from_micros(1 + (count * 977 % 19_000) as u32);
        robot.handle_timeout(now);
        let battery_pct = 80 + (count % 20) as u16;
        robot.set_telemetry(&Telemetry { battery_pct, ..Telemetry::default() }, now);
        let frames = sent(&mut robot, now);
        let frame = Frame::parse(&frames[0]).unwrap();
        assert_eq!((frames.len(), frame.index()), (1, count as u8));
        let Message::Report(report) = frame.message() else { panic!() };
        assert_eq!((report.telemetry().battery_pct, report.version()), (battery_pct, Some(38)));
        count += 1;
    }
    assert_eq!(count, 500);
    assert_eq!(robot.statistics().reports_skipped, 0);
}

#[test]
fn a_robot_that_was_held_up_skips_the_reports_it_missed() {
    let mut robot = quiet_robot();
    robot.set_telemetry(&Telemetry::default(), ms(0));
    assert_eq!(sent(&mut robot, ms(0)).len(), 1);
    assert_eq!(sent(&mut robot, ms(1005)).len(), 1, "no burst");
    assert_eq!(robot.poll_timeout(), Some(ms(1020)), "in step");
    assert_eq!((robot.statistics().reports, robot.statistics().reports_skipped), (2, 49));
    // Longer than a Duration can tell.
    assert_eq!(sent(&mut robot, ms(20_000_000)).len(), 1);
    assert_eq!(robot.poll_timeout(), Some(ms(20_000_020)));
    assert!(robot.statistics().reports_skipped > 200_000);
}

#[test]
fn a_robot_can_report_as_the_document_does() {
    let mut config = RobotConfig::default();
    config.layout = ReportLayout::Document;
    let mut rig = Rig::of(quiet_host(), Robot::new(config, ms(0)), ms(0));
    let telemetry = Telemetry { heading_deg: 123, ..Telemetry::default() };
    rig.robot.set_telemetry(&telemetry, ms(0));
    rig.run_for(100);
    let report = rig.host.last_report().unwrap();
    assert_eq!((report.telemetry, report.version), (telemetry, None));
}

#[test]
fn a_network_state_of_one_byte_or_four_is_an_event() {
    let mut robot = quiet_robot();
    robot.handle_input(&bytes(SetNetworkState::new(NetworkState::Connected).unwrap()), ms(0));
    let crc = axlewire::crc16::compute(&[0xFD, 0xFF, 8, 0, 0x0A, 0, 2, 0, 0, 0]).to_le_bytes();
    robot.handle_input(&[0xFD, 0xFF, 8, 0, 0x0A, 0, 2, 0, 0, 0, crc[0], crc[1]], ms(1));
    let states = [NetworkState::Connected, NetworkState::Disconnected];
    assert_eq!(events(&mut robot), states.map(RobotEvent::NetworkState));
}

#[test]
fn frames_of_a_robot_do_not_disturb_a_robot() {
    let mut robot = quiet_robot();
    robot.handle_input(&bytes(go(60)), ms(0));
    events(&mut robot);
    for frame in [
        bytes(FirmwareReport::new(&Telemetry::default(), 38)),
        bytes(Pong::new(ErrorCode::Fine)),
        bytes(imu_bias()),
        bytes(BiasRequest {}),
        bytes(CalibrationStartAck::new(IMU, ErrorCode::Fine)),
    ] {
        robot.handle_input(&frame, ms(1));
    }
    assert_eq!((robot.statistics().misdirected, events(&mut robot)), (5, vec![]));
    assert_eq!(sent(&mut robot, ms(1)), [] as [Vec<u8>; 0]);
    robot.handle_input(&bytes(Ping {}), ms(2));
    assert_eq!(sent(&mut robot, ms(2)).len(), 1, "and it is as lively as before");
    // Unknown ids and bodies of no message: counted as well.
    let mut buffer = [0; 64];
    let raw = RawFrame { id: 0x77, index: 0, body: &[1] };
    robot.handle_input(raw.encode(&mut buffer).unwrap(), ms(3));
    assert_eq!((robot.statistics().unknown, events(&mut robot)), (1, vec![]));
}

// --- Both ---

#[test]
fn a_host_that_floods_gets_one_answer_of_each_sort_at_a_time() {
    let mut robot = quiet_robot();
    let mut flood = Vec::new();
    for _ in 0..1000 {
        flood.extend(bytes(Ping {}));
        flood.extend(bytes(CalibrationStart::new(IMU)));
        flood.extend(bytes(OtaRequest::start_firmware_update(99)));
    }
    robot.handle_input(&flood, ms(0));
    assert_eq!(sent(&mut robot, ms(0)).len(), 2);
    assert_eq!((robot.statistics().pings, robot.statistics().pongs), (1000, 1));
    assert_eq!(events(&mut robot).len(), 16);
    assert_eq!(robot.lost_events(), 1001 - 16);
}

#[test]
fn a_queue_that_fills_keeps_the_oldest_and_counts_the_rest() {
    let mut robot = quiet_robot();
    for at in 0..=50_u64 {
        robot.handle_input(&bytes(go(at as i16 + 1)), ms(at));
    }
    assert_eq!(robot.command(ms(50)).speed(), 51, "the motors do not depend on it");
    let seen = events(&mut robot);
    assert_eq!(seen[0], RobotEvent::Motor(go(1)));
    assert_eq!((seen.len() as u32) + robot.lost_events(), 51);

    let mut host = quiet_host();
    for index in 0..50 {
        let report = FirmwareReport::new(&Telemetry::default(), 38).frame(index);
        host.handle_input(report.as_bytes(), ms(index.into()));
    }
    assert_eq!(host.last_report().unwrap().index, 49, "the latest is kept apart");
    let seen = events(&mut host);
    assert_eq!(seen[0], HostEvent::LinkUp);
    assert_eq!((seen.len() as u32) + host.lost_events(), 51);
}

#[test]
fn garbage_for_ever_is_reported_as_a_lost_link() {
    let mut host = Host::new(HostConfig::default(), ms(0));
    let mut seed = 1_u32;
    for at in 0..5000 {
        seed = seed.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        let noise = [(seed >> 24) as u8, 0xFD, 0xFF, (seed >> 16) as u8, 0, (seed >> 8) as u8];
        host.handle_timeout(ms(at));
        host.handle_input(&noise, ms(at));
        sent(&mut host, ms(at));
    }
    assert_eq!(events(&mut host), [HostEvent::LinkDown]);
    let line = host.counters();
    assert_eq!((line.received, line.frames), (30_000, 0));
    assert!(line.received - line.skipped() < 64);
}

#[test]
fn unplugging_stops_the_robot_and_is_reported_and_plugging_in_goes_on() {
    let mut rig = Rig::new(ms(0));
    rig.robot.set_telemetry(&Telemetry::default(), rig.now);
    rig.host.set_network_state(NetworkState::Connected, rig.now).unwrap();
    let drive_for = |rig: &mut Rig, millis: u32| {
        for _ in 0..millis / 50 {
            rig.host.drive(go(70), rig.now).unwrap();
            rig.run_for(50);
        }
    };
    drive_for(&mut rig, 1000);
    assert_eq!(rig.motion.last().unwrap().1, 70);
    let unplugged = rig.now;
    rig.unplug(true);
    drive_for(&mut rig, 1000);
    let (stopped, speed) = *rig.motion.last().unwrap();
    assert_eq!(speed, 0);
    assert!(stopped <= unplugged + Duration::from_millis(510), "frames were still on the line");
    assert_eq!(rig.host.link(), Link::Down);
    assert_eq!(rig.robot_has_seen(&RobotEvent::WatchdogStop), 1);
    rig.unplug(false);
    drive_for(&mut rig, 200);
    assert_eq!((rig.motion.last().unwrap().1, rig.host.link()), (70, Link::Up));
    assert_eq!(rig.robot_has_seen(&RobotEvent::NetworkState(NetworkState::Connected)), 3);
    assert_eq!(rig.host.statistics().links_lost, 1);
}

#[test]
fn a_session_goes_the_same_way_over_the_wrap_of_time() {
    let session = |start: Instant| {
        let mut rig = Rig::new(start);
        rig.robot.set_telemetry(&Telemetry::default(), start);
        for turn in 0..20 {
            if turn < 5 {
                rig.host.drive(go(turn), rig.now).unwrap();
            }
            if turn == 6 {
                rig.host.start_calibration(IMU, rig.now).unwrap();
                rig.robot.calibration_result_mag(mag_bias(), rig.now);
            }
            rig.unplug(turn > 10 && turn < 15);
            rig.run_for(100);
        }
        let since = |at: Instant| at.as_micros().wrapping_sub(start.as_micros());
        let host: Vec<_> = rig.host_events.into_iter().map(|(at, e)| (since(at), e)).collect();
        let robot: Vec<_> = rig.robot_events.into_iter().map(|(at, e)| (since(at), e)).collect();
        assert!(host.len() > 50 && robot.len() > 5);
        (host, robot, *rig.host.statistics(), *rig.robot.statistics())
    };
    let reference = session(ms(0));
    for before in [0, 1, 499_999, 500_000, 1_000_000, 1_999_999] {
        assert_eq!(session(us(u64::MAX - before)), reference);
    }
}

#[test]
fn a_call_too_many_does_nothing() {
    let mut host = Host::with_store(HostConfig::default(), MemoryStore::default(), ms(0));
    let mut robot = Robot::new(RobotConfig::default(), ms(0));
    host.drive(go(10), ms(0)).unwrap();
    robot.set_telemetry(&Telemetry::default(), ms(0));
    sent(&mut host, ms(0));
    sent(&mut robot, ms(0));
    let (before_host, before_robot) = (format!("{host:?}"), format!("{robot:?}"));
    for at in [1, 5, 19] {
        host.handle_input(&[], ms(at));
        host.handle_timeout(ms(at));
        robot.handle_input(&[], ms(at));
        robot.handle_timeout(ms(at));
        assert_eq!((host.poll_transmit(ms(at)), robot.poll_transmit(ms(at))), (None, None));
        assert_eq!((host.poll_event(), robot.poll_event()), (None, None));
    }
    assert_eq!(format!("{host:?}"), before_host);
    assert_eq!(format!("{robot:?}"), before_robot);
}

#[test]
fn periods_of_nothing_do_not_make_a_driver_spin() {
    let mut config = HostConfig::default();
    config.command_period = Duration::ZERO;
    config.command_gap = Duration::ZERO;
    config.command_timeout = Duration::ZERO;
    config.ping_period = Some(Duration::ZERO);
    config.ping_timeout = Duration::ZERO;
    config.link_timeout = Duration::ZERO;
    config.ack_timeout = Duration::ZERO;
    config.attempts = 0;
    config.quiet_margin = Duration::ZERO;
    let mut robot_config = RobotConfig::default();
    robot_config.command_timeout = Duration::ZERO;
    robot_config.report_period = Duration::ZERO;
    robot_config.result_period = Duration::ZERO;
    robot_config.bias_request_period = Some(Duration::ZERO);
    robot_config.quiet_margin = Duration::ZERO;
    for baud in [0, 1, BAUD, u32::MAX] {
        (config.baud, robot_config.baud) = (baud, baud);
        let mut host = Host::new(config, ms(0));
        let mut robot = Robot::new(robot_config, ms(0));
        host.drive(go(1), ms(0)).unwrap();
        host.start_calibration(IMU, ms(0)).unwrap();
        robot.set_telemetry(&Telemetry::default(), ms(0));
        robot.calibration_result_imu(imu_bias(), ms(0));
        sent(&mut host, ms(0));
        sent(&mut robot, ms(0));
        // Two sorts of frames, at most one of each in a millisecond.
        assert!(wait(&mut host, ms(100)).len() <= 250);
        assert!(wait(&mut robot, ms(100)).len() <= 310);
    }
}

#[test]
fn the_roles_fit_into_small_memories() {
    let (host, robot) = (size_of::<Host>(), size_of::<Robot>());
    let (host_event, robot_event) = (size_of::<HostEvent>(), size_of::<RobotEvent>());
    println!("Host {host} bytes, Robot {robot} bytes");
    println!("HostEvent {host_event} bytes, RobotEvent {robot_event} bytes");
    assert!(host <= 2048, "{host}");
    assert!(robot <= 1280, "{robot}");
    assert!(host_event <= 64, "{host_event}");
    assert!(robot_event <= 24, "{robot_event}");
}

/// The frame of a start request, on which the computed bound rests.
#[test]
fn the_calibration_bound_is_that_of_the_frames_that_are_sent() {
    assert_eq!(FrameOf::<CalibrationStart>::LEN, FrameOf::<CalibrationEnd>::LEN);
    let mut config = HostConfig::default();
    config.attempts = 5;
    config.ack_timeout = Duration::from_millis(50);
    let one = wire_time(FrameOf::<CalibrationStart>::LEN, BAUD) + Duration::from_millis(50);
    assert_eq!(config.calibration_bound(), one.saturating_mul(5));
}

// --- Properties ---

/// One thing that may happen to a role.
#[derive(Clone, Debug)]
enum Call {
    /// Time passes, microseconds, without a look at the deadline.
    Sleep(u32),
    /// A driver does its work up to then, microseconds.
    Drive(u32),
    Noise(Vec<u8>),
    /// A good frame: which, and with what in it.
    Frame(Index, u8),
    /// The same, cut off.
    Cut(Index, usize),
    Timeout,
    Transmit,
    Events,
    Command(u8, i16),
}

fn call() -> impl Strategy<Value = Call> {
    prop_oneof![
        (0..2_000_000_u32).prop_map(Call::Sleep),
        (0..2_000_000_u32).prop_map(Call::Drive),
        vec(prop_oneof![any::<u8>(), Just(0xFD), Just(0xFF), Just(4)], 0..100)
            .prop_map(Call::Noise),
        (any::<Index>(), any::<u8>()).prop_map(|(which, salt)| Call::Frame(which, salt)),
        (any::<Index>(), 0..44_usize).prop_map(|(which, len)| Call::Cut(which, len)),
        Just(Call::Timeout),
        Just(Call::Transmit),
        Just(Call::Events),
        (any::<u8>(), any::<i16>()).prop_map(|(which, value)| Call::Command(which, value)),
    ]
}

/// A frame of any message, both directions.
fn any_frame(which: &Index, salt: u8) -> Vec<u8> {
    let err = ErrorCode::from(salt % 3);
    let kind = CalibrationKind::from(salt % 4);
    let value = i16::from(salt) * 3 - 300;
    let mut buffer = [0; 64];
    let raw = RawFrame { id: 0x20, index: salt, body: &[salt; 56][..usize::from(salt % 57)] };
    let frames = [
        bytes(Ping {}),
        bytes(Pong::new(err)),
        bytes(careless(value, -value, value, if salt == 7 { 39 } else { 0 })),
        bytes(CalibrationStart::new(kind)),
        bytes(CalibrationStartAck::new(kind, err)),
        bytes(CalibrationEnd::new(kind)),
        bytes(CalibrationEndAck::new(kind, err)),
        FirmwareReport::new(&Telemetry::default(), 38).frame(salt).as_bytes().to_vec(),
        bytes(ImuBias::new([value; 3], [0; 3])),
        bytes(ImuBiasAck::new(err)),
        bytes(MagBias::new([value; 3])),
        bytes(MagBiasAck::new(err)),
        bytes(BiasRequest {}),
        bytes(Biases::new(imu_bias(), mag_bias())),
        bytes(OtaRequest::start_firmware_update(value)),
        bytes(OtaAck::new(OtaStatus::from(salt % 4))),
        bytes(SetNetworkState::new(NetworkState::from(u32::from(salt))).unwrap()),
        raw.encode(&mut buffer).unwrap().to_vec(),
    ];
    which.get(&frames).clone()
}

/// Does what a call says; `command` is what it means to this role.
fn perform<R: Endpoint>(
    role: &mut R,
    call: &Call,
    now: &mut Instant,
    command: impl Fn(&mut R, u8, i16, Instant),
) {
    match call {
        Call::Sleep(micros) => *now += Duration::from_micros(*micros),
        Call::Drive(micros) => {
            role.handle_timeout(*now);
            sent(role, *now);
            let end = *now + Duration::from_micros(*micros);
            let frames = wait(role, end);
            // Motor commands, pings, reports, results, requests: nothing is sent for its own sake.
            let most = 30 + *micros / 5_000;
            assert!(frames.len() <= most as usize, "{} frames in {micros} us", frames.len());
            *now = end;
        }
        Call::Noise(noise) => role.handle_input(noise, *now),
        Call::Frame(which, salt) => role.handle_input(&any_frame(which, *salt), *now),
        Call::Cut(which, len) => {
            let frame = any_frame(which, 0);
            role.handle_input(&frame[..(*len).min(frame.len())], *now);
        }
        Call::Timeout => role.handle_timeout(*now),
        Call::Transmit => {
            let _ = role.poll_transmit(*now);
        }
        Call::Events => assert!(events(role).len() <= 16, "events are bounded"),
        Call::Command(which, value) => command(role, *which, *value, *now),
    }
    // A deadline that has been handled lies behind no role.
    role.handle_timeout(*now);
    sent(role, *now);
}

fn start() -> impl Strategy<Value = u64> {
    prop_oneof![Just(0), any::<u64>(), (0..20_000_000_u64).prop_map(|before| u64::MAX - before)]
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 500, ..ProptestConfig::default() })]

    #[test]
    fn a_host_survives_any_calls_bytes_and_times(
        calls in vec(call(), 0..60),
        start in start(),
    ) {
        let mut now = us(start);
        let mut host = Host::with_store(HostConfig::default(), MemoryStore::default(), now);
        for call in &calls {
            perform(&mut host, call, &mut now, |host, which, value, now| {
                let kind = CalibrationKind::from((value & 3) as u8);
                // Whether it is refused does not matter here.
                let _ = match which % 8 {
                    0 => host.drive(careless(value % 128, 0, value, 0), now),
                    1 => host.drive(careless(0, 0, 0, value.cast_unsigned()), now),
                    2 => host.start_calibration(kind, now),
                    3 => host.end_calibration(kind, now),
                    4 => host.set_network_state(NetworkState::from(value as u32), now),
                    5 => host.start_firmware_update(value, now),
                    6 => { host.end_firmware_update(); Ok(()) }
                    _ => { host.stop(now); Ok(()) }
                };
            });
            let line = host.counters();
            prop_assert!(line.received - line.framed - line.skipped() < 64);
        }
    }

    #[test]
    fn a_robot_survives_any_calls_bytes_and_times(
        calls in vec(call(), 0..60),
        start in start(),
    ) {
        let mut now = us(start);
        let mut robot = Robot::new(RobotConfig::default(), now);
        for call in &calls {
            perform(&mut robot, call, &mut now, |robot, which, value, now| {
                match which % 4 {
                    0 => robot.set_telemetry(&Telemetry::default(), now),
                    1 => robot.calibration_result_imu(ImuBias::new([value; 3], [0; 3]), now),
                    2 => robot.calibration_result_mag(MagBias::new([value; 3]), now),
                    _ => { robot.answer_update(OtaStatus::Accepted, now); }
                }
            });
            let command = robot.command(now);
            prop_assert!(command.speed().abs() <= 100 && command.angular().abs() <= 100);
            prop_assert!(matches!(command.front_led(), 0 | 100));
            prop_assert_eq!(command.version(), 0);
        }
    }
}

/// What a bad line does to a frame: each byte may be lost, damaged or doubled.
#[derive(Clone, Copy, Debug)]
struct BadLine {
    seed: u64,
    /// Bytes out of 1000 that suffer.
    per_mille: u64,
}

impl BadLine {
    fn into_fault(self) -> Fault {
        let mut state = self.seed | 1;
        let mut dice = move || {
            state ^= state << 13;
            state ^= state >> 7;
            state ^= state << 17;
            state >> 11
        };
        Box::new(move |_, frame| {
            let mut out = Vec::new();
            for &byte in frame {
                match (dice() % 1000 < self.per_mille, dice() % 3) {
                    (false, _) => out.push(byte),
                    (true, 0) => {}
                    (true, 1) => out.push(byte ^ (1 << (dice() % 8))),
                    (true, _) => out.extend([byte, byte]),
                }
            }
            if holds_another(&out, frame) { frame.to_vec() } else { out }
        })
    }
}

/// Has a bad line made another good frame of it? The CRC lets one damaged frame in 65,536 through, which
/// no role can see.
fn holds_another(bytes: &[u8], frame: &[u8]) -> bool {
    let crc = Crc::<u16>::new(&CRC_16_MODBUS);
    (0..bytes.len()).any(|at| {
        let rest = &bytes[at..];
        let Some(&[0xFD, 0xFF, low, high]) = rest.first_chunk() else { return false };
        let found =
            rest.get(..usize::from(u16::from_le_bytes([low, high])) + 4).unwrap_or_default();
        found != frame
            && found
                .split_last_chunk::<2>()
                .is_some_and(|(body, end)| crc.checksum(body).to_le_bytes() == *end)
    })
}

#[test]
fn a_line_whose_damage_the_crc_cannot_see_is_told_from_others() {
    let command = |crc: [u8; 2]| {
        let mut frame = [0_u8; 24];
        frame[..8].copy_from_slice(&[0xFD, 0xFF, 0x14, 0, 2, 0x18, 0xCE, 0xFF]);
        frame[22..].copy_from_slice(&crc);
        frame
    };
    let frame = command([0xD0, 0x05]);
    assert!(Frame::parse(&frame).is_ok());
    assert!(!holds_another(&frame, &frame));
    // The index twice: what follows moves on by one place, and the CRC is right again.
    let mut doubled = frame.to_vec();
    doubled.insert(5, 0x18);
    assert!(Frame::parse(&doubled[..24]).is_ok());
    assert!(holds_another(&doubled, &frame));
    assert!(!holds_another(&command([0xD0, 0x04]), &frame));
}

/// What the application does next, and for how long, milliseconds.
#[derive(Clone, Copy, Debug)]
enum Act {
    Drive(i16, u32),
    Stop(u32),
    Silence(u32),
    Calibrate(bool, bool, u32),
    Unplug(u32),
}

fn act() -> impl Strategy<Value = Act> {
    prop_oneof![
        4 => (-100..=100_i16, 1..300_u32).prop_map(|(speed, millis)| Act::Drive(speed, millis)),
        1 => (1..300_u32).prop_map(Act::Stop),
        1 => (1..1500_u32).prop_map(Act::Silence),
        2 => (any::<bool>(), any::<bool>(), 1..300_u32)
            .prop_map(|(start, imu, millis)| Act::Calibrate(start, imu, millis)),
        1 => (1..1500_u32).prop_map(Act::Unplug),
    ]
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 150, ..ProptestConfig::default() })]

    #[test]
    fn over_a_bad_line_nothing_is_done_that_was_not_asked_for_and_nothing_hangs(
        acts in vec(act(), 1..25),
        seed in any::<u64>(),
        per_mille in 0..200_u64,
        start in start(),
    ) {
        let begin = us(start);
        let mut rig = Rig::new(begin);
        let line = BadLine { seed, per_mille };
        rig.fault = line.into_fault();
        rig.robot.set_telemetry(&Telemetry::default(), begin);
        let mut asked = HashSet::from([0]);
        let mut requests = Vec::new();
        for act in acts {
            match act {
                Act::Drive(speed, millis) => {
                    rig.host.drive(go(speed), rig.now).unwrap();
                    asked.insert(speed);
                    rig.run_for(millis);
                }
                Act::Stop(millis) => {
                    rig.host.stop(rig.now);
                    rig.run_for(millis);
                }
                Act::Silence(millis) => rig.run_for(millis),
                Act::Calibrate(start, imu, millis) => {
                    let kind = if imu { IMU } else { MAG };
                    let taken = match start {
                        true => rig.host.start_calibration(kind, rig.now),
                        false => rig.host.end_calibration(kind, rig.now),
                    };
                    if taken.is_ok() {
                        requests.push(rig.now);
                    }
                    rig.run_for(millis);
                }
                Act::Unplug(millis) => {
                    rig.unplug(true);
                    rig.run_for(millis);
                    rig.fault = line.into_fault();
                }
            }
        }
        // The application falls silent: dead-man, one frame on the line, and the robot stands.
        rig.run_for(500 + 3);
        if per_mille == 0 {
            prop_assert_eq!(rig.robot.command(rig.now).speed(), 0);
        }
        rig.run_for(500 + 3);
        prop_assert_eq!(rig.robot.command(rig.now).speed(), 0);
        // No speed that nobody asked for.
        for (at, speed) in &rig.motion {
            prop_assert!(asked.contains(speed), "{} at {:?}", speed, at);
        }
        // Every calibration request has come to an end, in order, within its bound.
        let bound = HostConfig::default().calibration_bound();
        let ends: Vec<_> = rig.host_events.iter().filter(|(_, event)| matches!(
            event,
            HostEvent::CalibrationStarted(_)
                | HostEvent::CalibrationEnded(_)
                | HostEvent::CalibrationFailed(_)
        )).collect();
        prop_assert_eq!(ends.len(), requests.len());
        for ((end, _), request) in ends.iter().zip(&requests) {
            prop_assert!(*end >= *request && *end <= *request + bound);
        }
        let failed = ends.iter().filter(|(_, e)| matches!(e, HostEvent::CalibrationFailed(_)));
        prop_assert_eq!(failed.count(), rig.host.statistics().calibration_failures as usize);
        // The events of a rig are taken out at every step.
        prop_assert_eq!((rig.host.lost_events(), rig.robot.lost_events()), (0, 0));
    }

    #[test]
    fn the_robot_stops_within_500_ms_of_the_last_valid_command(
        pauses in vec(0..900_u32, 1..40),
        noise in vec(any::<u8>(), 0..64),
        start in start(),
    ) {
        let mut now = us(start);
        let mut robot = quiet_robot_at(now);
        for (turn, pause) in pauses.into_iter().enumerate() {
            if turn % 3 == 0 {
                robot.handle_input(&noise, now);
                // A pause ends whatever the noise has begun.
                now += Duration::from_millis(20);
                robot.handle_timeout(now);
                events(&mut robot);
            }
            robot.handle_input(&bytes(go(50)), now);
            let last = now;
            let end = now + Duration::from_millis(pause);
            while let Some(at) = robot.poll_timeout().filter(|&at| at <= end) {
                robot.handle_timeout(at);
                sent(&mut robot, at);
            }
            now = end;
            let moves = now < last + Duration::from_millis(500);
            prop_assert_eq!(robot.command(now).speed(), if moves { 50 } else { 0 });
            let stops = events(&mut robot).into_iter().filter(|e| *e == RobotEvent::WatchdogStop);
            prop_assert_eq!(stops.count(), usize::from(!moves));
        }
    }
}
