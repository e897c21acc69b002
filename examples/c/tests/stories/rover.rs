//! Stories of a rover and its host.

use axlewire::encode::Encode;
use axlewire::{
    endpoint::{Arrival, Endpoint, LineRules, Transmit, Unsent},
    sim::{Direction, Faults, Input, Line, Rover, Who},
    time::{Duration, Instant},
    ucp::{
        Body, MotorControl, RawFrame, Robot,
        host::{HostConfig, HostEvent, Link, StopProgress},
        message::{CalibrationKind, ErrorCode, ImuBias, MagBias, NetworkState, OtaStatus, Pong},
        robot::{ReportLayout, RobotConfig, RobotEvent, UpdateSource},
    },
};
use axlewire_c::*;

use crate::{
    rover_roles::{MyHost, command_error, host_config, motor, report, robot_config, telemetry},
    twin::{Port, Twin, same, value},
};

/// A robot in C and in Rust that drives a rover.
struct Node {
    robot: Twin<Robot>,
    rover: Rover,
    now: Instant,
}

impl Node {
    fn run(&mut self, now: Instant) {
        self.rover.command(&self.robot.rust().command(now));
        let dt = now - self.now;
        self.now = now;
        self.rover.step(dt);
        let measured = self.rover.telemetry();
        let in_c = telemetry(&measured);
        assert_eq!(axle_ucp_robot_set_telemetry(self.robot.c(), &in_c, now.as_micros()), AXLE_OK);
        self.robot.rust_mut().set_telemetry(&measured, now);
    }
}

impl Endpoint for Node {
    type Event = RobotEvent;

    fn handle_input(&mut self, bytes: &[u8], arrived: impl Into<Arrival>) {
        let arrived = arrived.into();
        self.run(arrived.now());
        self.robot.handle_input(bytes, arrived);
    }
    fn handle_timeout(&mut self, now: Instant) {
        self.run(now);
        self.robot.handle_timeout(now);
    }
    fn poll_transmit(&mut self, now: Instant) -> Option<&[u8]> {
        self.run(now);
        self.robot.poll_transmit(now)
    }
    fn handle_transmit(&mut self, outcome: impl Into<Transmit>, now: Instant) {
        self.robot.tell(outcome.into(), now);
    }
    fn is_outdated(&self) -> bool {
        self.robot.is_outdated()
    }
    fn line_rules(&self) -> LineRules {
        self.robot.line_rules()
    }
    fn poll_event(&mut self) -> Option<RobotEvent> {
        self.robot.poll_event()
    }
    fn poll_timeout(&self) -> Option<Instant> {
        self.robot.poll_timeout()
    }
}

struct Rig {
    line: Line<Twin<MyHost>, Node>,
    events: Vec<HostEvent>,
    told: Vec<RobotEvent>,
}

const MAG: CalibrationKind = CalibrationKind::Magnetometer;
const IMU: CalibrationKind = CalibrationKind::Imu;

impl Rig {
    fn with(host: impl FnOnce(&mut HostConfig), robot: impl FnOnce(&mut RobotConfig)) -> Self {
        let start = Instant::from_micros(0);
        let (mut config, mut tail) = (HostConfig::direct(), RobotConfig::direct());
        host(&mut config);
        robot(&mut tail);
        let mut line = Line::new(115_200, 11, Twin::host(config, start));
        let robot = Twin::robot(tail, start);
        line.add(Node { robot, rover: Rover::new(), now: start });
        line.record();
        Self { line, events: Vec::new(), told: Vec::new() }
    }

    fn new() -> Self {
        Self::with(|_| {}, |_| {})
    }

    /// The link is up.
    fn up() -> Self {
        let mut link = Self::new();
        link.run(200);
        link.has(&HostEvent::LinkUp);
        link
    }

    fn run(&mut self, millis: u32) {
        self.line.run_for(Duration::from_millis(millis)).unwrap();
        self.events.extend(self.line.take_head_events().into_iter().map(|(_, event)| event));
        self.told.extend(self.line.take_tail_events().into_iter().map(|(_, _, event)| event));
    }

    #[track_caller]
    fn has(&self, event: &HostEvent) {
        assert!(self.events.contains(event), "no {event:?} in {:?}", self.events);
    }

    #[track_caller]
    fn robot_has(&self, event: &RobotEvent) {
        assert!(self.told.contains(event), "no {event:?} in {:?}", self.told);
    }

    /// A command in C and in Rust.
    #[track_caller]
    fn host(
        &mut self,
        c: impl FnOnce(*mut axle_ucp_host, u64) -> axle_result,
        rust: impl FnOnce(&mut MyHost, Instant) -> axle_result,
    ) -> axle_result {
        let now = self.line.now();
        self.line.head_mut().both(|it| c(it, now.as_micros()), |it| rust(it, now))
    }

    #[track_caller]
    fn robot(
        &mut self,
        c: impl FnOnce(*mut axle_ucp_robot, u64) -> axle_result,
        rust: impl FnOnce(&mut Robot, Instant) -> axle_result,
    ) -> axle_result {
        let now = self.line.now();
        self.line.tail_mut(0).robot.both(|it| c(it, now.as_micros()), |it| rust(it, now))
    }

    #[track_caller]
    fn drive(&mut self, speed: i16, turn: i16) -> axle_result {
        self.host(
            |it, now| axle_ucp_host_set_speed(it, speed, turn, now),
            |it, now| match MotorControl::new(speed, turn) {
                Ok(command) => command_error(it.drive(command, now)),
                Err(_) => AXLE_ERROR_PERCENT,
            },
        )
    }

    /// Drives, with a call each 100 ms.
    fn drive_for(&mut self, speed: i16, millis: u32) {
        for _ in 0..millis / 100 {
            assert_eq!(self.drive(speed, 10), AXLE_OK);
            self.run(100);
        }
    }

    #[track_caller]
    fn stop(&mut self) {
        self.host(
            |it, now| axle_ucp_host_stop(it, now),
            |it, now| {
                it.stop(now);
                0
            },
        );
    }

    #[track_caller]
    fn calibrate(&mut self, kind: CalibrationKind) -> axle_result {
        self.host(
            |it, now| axle_ucp_host_start_calibration(it, kind.into(), now),
            |it, now| command_error(it.start_calibration(kind, now)),
        )
    }

    #[track_caller]
    fn end_calibration(&mut self, kind: CalibrationKind) -> axle_result {
        self.host(
            |it, now| axle_ucp_host_end_calibration(it, kind.into(), now),
            |it, now| command_error(it.end_calibration(kind, now)),
        )
    }

    #[track_caller]
    fn network(&mut self, state: u32) -> axle_result {
        self.host(
            |it, now| axle_ucp_host_set_network_state(it, state, now),
            |it, now| command_error(it.set_network_state(NetworkState::from(state), now)),
        )
    }

    #[track_caller]
    fn update(&mut self, version: i16) -> axle_result {
        self.host(
            |it, now| axle_ucp_host_start_firmware_update(it, version, now),
            |it, now| command_error(it.start_firmware_update(version, now)),
        )
    }

    fn answer_update(&mut self, status: OtaStatus) -> axle_result {
        self.robot(
            |it, now| axle_ucp_robot_answer_update(it, status.into(), now),
            |it, now| if it.answer_update(status, now) { AXLE_OK } else { AXLE_NONE },
        )
    }

    fn give_biases(&mut self) {
        let (acc, gyro, mag) = ([1, -2, 3], [-4, 5, -6], [7, -8, 9]);
        self.host(
            |it, _| axle_ucp_host_set_imu_bias(it, axle_ucp_imu_bias { acc, gyro }),
            |it, _| {
                it.store_mut().imu = Some(ImuBias::new(acc, gyro));
                0
            },
        );
        self.host(
            |it, _| axle_ucp_host_set_mag_bias(it, axle_ucp_mag_bias { mag }),
            |it, _| {
                it.store_mut().mag = Some(MagBias::new(mag));
                0
            },
        );
    }

    fn rust(&self) -> &MyHost {
        self.line.head().rust()
    }

    fn speed(&self) -> i16 {
        self.line.tail(0).rover.telemetry().rpm[0]
    }

    fn stands_still(&self) -> bool {
        self.rust().stop_progress() == StopProgress::StandingStill && self.speed().abs() <= 2
    }
}

#[test]
fn a_host_hears_its_robot_and_its_reports() {
    let link = Rig::up();
    assert!(link.events.iter().any(|event| matches!(event, HostEvent::Report(_))));
    assert!(link.events.iter().any(|event| matches!(event, HostEvent::Pong { .. })));
}

#[test]
fn a_rover_drives_as_it_is_told() {
    let mut link = Rig::up();
    link.drive_for(60, 2000);
    assert!(link.speed() > 40, "{}", link.speed());
    link.robot_has(&RobotEvent::Motor(MotorControl::new(60, 10).unwrap()));
}

#[test]
fn a_stop_is_repeated_until_the_rover_stands_still() {
    let mut link = Rig::up();
    link.drive_for(60, 1000);
    link.stop();
    link.run(4000);
    assert!(link.stands_still());
}

#[test]
fn a_silent_application_is_a_dead_man() {
    let mut link = Rig::up();
    link.drive_for(60, 1000);
    link.run(4000);
    link.has(&HostEvent::DeadMan);
    assert!(link.stands_still());
}

#[test]
fn the_watchdog_of_a_robot_fires_when_the_cable_to_it_is_lost() {
    let mut link = Rig::up();
    link.drive_for(60, 1000);
    link.line.pair_mut(Direction::ToTails).unplugged = true;
    link.run(3000);
    link.robot_has(&RobotEvent::Watchdog);
    assert!(link.speed().abs() <= 2);
}

#[test]
fn a_robot_that_is_no_longer_heard_is_not_driven() {
    let mut link = Rig::up();
    link.drive_for(60, 1000);
    link.line.pair_mut(Direction::ToHead).unplugged = true;
    link.run(600);
    link.has(&HostEvent::LinkDown);
    assert_eq!(link.drive(60, 0), AXLE_ERROR_LINK_DOWN);
    assert_eq!(link.rust().link(), Link::Down);
    link.line.pair_mut(Direction::ToHead).unplugged = false;
    link.run(200);
    assert_eq!(link.drive(60, 0), AXLE_OK);
    link.run(1000);
}

#[test]
fn a_cable_that_is_pulled_stops_the_rover_and_a_stop_follows_when_it_is_back() {
    let mut link = Rig::up();
    link.drive_for(60, 1000);
    link.line.stub_mut(Who::Tail(0)).unplugged = true;
    link.run(1000);
    link.stop();
    link.line.stub_mut(Who::Tail(0)).unplugged = false;
    link.run(4000);
    link.has(&HostEvent::LinkDown);
    assert!(link.stands_still());
}

#[test]
fn a_stop_gets_through_noise() {
    let mut link = Rig::up();
    for direction in [Direction::ToTails, Direction::ToHead] {
        *link.line.pair_mut(direction) = Faults::noise(1e-3);
    }
    link.drive_for(60, 2000);
    link.stop();
    link.run(5000);
    assert!(link.stands_still());
    assert!(link.line.statistics(Direction::ToHead).bit_errors > 20);
}

#[test]
fn bytes_are_lost_doubled_and_made_up() {
    let mut link = Rig::up();
    for direction in [Direction::ToTails, Direction::ToHead] {
        let faults = link.line.pair_mut(direction);
        (faults.lost, faults.duplicated, faults.inserted) = (0.005, 0.005, 0.005);
        (faults.stray, faults.jitter) = (Some(0xFD), Duration::from_micros(300));
    }
    for _ in 0..50 {
        let _ = link.drive(40, -20);
        link.run(100);
    }
    assert!(link.rust().statistics().reports > 50);
}

#[test]
fn the_inertial_sensors_are_calibrated() {
    let mut link = Rig::up();
    assert_eq!(link.calibrate(IMU), AXLE_OK);
    assert_eq!(link.calibrate(IMU), AXLE_ERROR_CALIBRATING);
    link.run(100);
    link.has(&HostEvent::CalibrationStarted(IMU));
    link.robot_has(&RobotEvent::CalibrationStart { kind: IMU, repeated: false });
    assert_eq!(link.end_calibration(IMU), AXLE_OK);
    link.run(100);
    link.has(&HostEvent::CalibrationEnded(IMU));
    let (acc, gyro) = ([1, -2, 3], [40, -50, 60]);
    link.robot(
        |it, now| axle_ucp_robot_calibration_result_imu(it, axle_ucp_imu_bias { acc, gyro }, now),
        |it, now| {
            it.calibration_result_imu(ImuBias::new(acc, gyro), now);
            0
        },
    );
    link.run(1500);
    link.has(&HostEvent::ImuBias(ImuBias::new(acc, gyro)));
    link.robot_has(&RobotEvent::ImuBiasTaken);
}

#[test]
fn the_magnetometer_is_calibrated_although_its_result_is_lost_at_first() {
    let mut link = Rig::up();
    assert_eq!(link.calibrate(MAG), AXLE_OK);
    link.run(100);
    assert_eq!(link.end_calibration(MAG), AXLE_OK);
    link.run(100);
    link.line.pair_mut(Direction::ToHead).unplugged = true;
    let mag = [100, -200, 300];
    link.robot(
        |it, now| axle_ucp_robot_calibration_result_mag(it, axle_ucp_mag_bias { mag }, now),
        |it, now| {
            it.calibration_result_mag(MagBias::new(mag), now);
            0
        },
    );
    link.run(700);
    link.line.pair_mut(Direction::ToHead).unplugged = false;
    link.run(1500);
    link.has(&HostEvent::MagBias(MagBias::new(mag)));
    link.robot_has(&RobotEvent::MagBiasTaken);
}

#[test]
fn a_calibration_without_an_answer_has_failed() {
    let mut link = Rig::up();
    link.line.pair_mut(Direction::ToTails).unplugged = true;
    assert_eq!(link.calibrate(MAG), AXLE_OK);
    link.run(1500);
    let failed = |event: &_| matches!(event, HostEvent::CalibrationFailed(_));
    assert!(link.events.iter().any(failed));
}

#[test]
fn an_unknown_calibration_is_refused_and_one_can_be_given_up() {
    let mut link = Rig::up();
    assert_eq!(link.calibrate(CalibrationKind::from(9)), AXLE_ERROR_CALIBRATION_KIND);
    assert_eq!(link.calibrate(MAG), AXLE_OK);
    link.run(100);
    link.robot(
        |it, _| {
            let mut kind = 0;
            let result = axle_ucp_robot_abort_calibration(it, &mut kind);
            assert_eq!((result, kind), (AXLE_OK, AXLE_UCP_CALIBRATION_MAGNETOMETER));
            axle_ucp_robot_abort_calibration(it, &mut kind)
        },
        |it, _| {
            assert_eq!(it.abort_calibration(), Some(MAG));
            AXLE_NONE
        },
    );
    assert_eq!(link.end_calibration(MAG), AXLE_OK);
    link.run(500);
    assert_eq!(link.line.tail(0).robot.rust().statistics().calibration_refused, 1);
}

#[test]
fn a_robot_that_boots_gets_the_biases_that_are_kept() {
    let mut link = Rig::new();
    link.give_biases();
    link.run(1500);
    link.has(&HostEvent::BiasesSent);
    assert!(link.told.iter().any(|event| matches!(event, RobotEvent::Biases(_))));
}

#[test]
fn a_robot_that_boots_is_told_nothing_without_biases() {
    let mut link = Rig::new();
    link.run(2500);
    link.has(&HostEvent::BiasesMissing { imu: true, mag: true });
}

#[test]
fn a_host_of_low_ids_sends_no_other() {
    let mut link = Rig::with(|config| config.low_ids_only = true, |_| {});
    link.give_biases();
    link.run(1500);
    link.has(&HostEvent::BiasesNotAnswered);
    assert_eq!(link.network(1), AXLE_ERROR_LOW_IDS_ONLY);
    assert_eq!(link.update(40), AXLE_ERROR_LOW_IDS_ONLY);
}

#[test]
fn the_state_of_the_network_arrives_and_a_wide_one_is_refused() {
    let mut link = Rig::up();
    assert_eq!(link.network(3), AXLE_OK);
    link.run(100);
    assert_eq!(link.network(77), AXLE_OK);
    link.run(100);
    assert_eq!(link.network(256), AXLE_ERROR_NETWORK_STATE);
    link.robot_has(&RobotEvent::NetworkState(NetworkState::Connected));
    link.robot_has(&RobotEvent::NetworkState(NetworkState::from(77)));
}

#[test]
fn firmware_is_updated_only_at_a_standstill() {
    let mut link = Rig::up();
    link.drive_for(60, 1000);
    assert_eq!(link.update(40), AXLE_ERROR_MOVING);
    link.stop();
    link.run(4000);
    assert_eq!(link.update(40), AXLE_OK);
    link.run(100);
    let by = UpdateSource::Request;
    link.robot_has(&RobotEvent::UpdateRequested { version: 40, by });
    assert_eq!(link.drive(10, 0), AXLE_ERROR_UPDATING);
    assert_eq!(link.answer_update(OtaStatus::Accepted), AXLE_OK);
    assert_eq!(link.answer_update(OtaStatus::Accepted), AXLE_NONE);
    link.run(100);
    link.has(&HostEvent::UpdateAnswered(OtaStatus::Accepted));
}

#[test]
fn a_refused_update_ends_and_the_rover_drives_again() {
    let mut link = Rig::up();
    link.stop();
    link.run(4000);
    assert_eq!(link.update(41), AXLE_OK);
    link.run(100);
    assert_eq!(link.answer_update(OtaStatus::Forbidden), AXLE_OK);
    link.run(100);
    link.has(&HostEvent::UpdateAnswered(OtaStatus::Forbidden));
    link.host(
        |it, now| axle_ucp_host_end_firmware_update(it, now),
        |it, now| {
            it.end_firmware_update(now);
            0
        },
    );
    link.run(200);
    link.drive_for(50, 1000);
    assert!(link.speed() > 20);
}

#[test]
fn a_motor_command_with_a_version_asks_for_an_update_and_moves_nothing() {
    let mut link = Rig::up();
    let mut frame = MotorControl::new(50, 0).unwrap().frame(0).as_bytes().to_vec();
    frame[14] = 39;
    let end = frame.len() - 2;
    let crc = axlewire::crc16::compute(&frame[..end]).to_le_bytes();
    frame[end..].copy_from_slice(&crc);
    link.line.inject(Who::Head, &frame);
    link.run(200);
    let by = UpdateSource::MotorCommand;
    link.robot_has(&RobotEvent::UpdateRequested { version: 39, by });
    assert_eq!(link.line.tail(0).robot.rust().statistics().commands_refused, 1);
}

#[test]
fn an_unknown_frame_is_told_with_its_body() {
    let mut link = Rig::up();
    let mut buffer = [0; 64];
    for length in [0, 1, 33, 56] {
        let body: Vec<u8> = (0..length).collect();
        let frame = RawFrame { id: 0x42, index: 9, body: &body };
        let bytes = frame.encode(&mut buffer).unwrap();
        link.line.inject(Who::Tail(0), bytes);
        link.run(50);
    }
    let unknown = |event: &&_| matches!(event, HostEvent::Unknown(_));
    assert_eq!(link.events.iter().filter(unknown).count(), 4);
}

#[test]
fn reports_in_the_layout_of_the_document_have_no_version() {
    let mut link = Rig::with(|_| {}, |config| config.layout = ReportLayout::Document);
    link.run(300);
    let last = link.rust().last_report().copied().unwrap();
    assert_eq!((last.version, report(last).version), (None, -1));
}

#[test]
fn a_report_and_a_command_are_taken_once() {
    let mut link = Rig::up();
    link.drive_for(30, 300);
    for again in [false, true] {
        let head = link.line.head_mut();
        let in_c = value(|to| axle_ucp_host_take_report(head.c(), to));
        let taken = head.rust_mut().take_report();
        assert_eq!(taken.is_none(), again);
        same(in_c, taken.map(report));
        let in_c = value(|to| axle_ucp_host_get_report(head.c(), to));
        same(in_c, head.rust_mut().last_report().copied().map(report));
        let in_c = value(|to| axle_ucp_host_take_round_trip(head.c(), to));
        same(in_c, head.rust_mut().take_round_trip().map(|span| span.as_micros()));
        let now = link.line.now();
        let robot = &mut link.line.tail_mut(0).robot;
        let in_c = value(|to| axle_ucp_robot_take_command(robot.c(), now.as_micros(), to));
        let taken = robot.rust_mut().take_command(now);
        assert_eq!(taken.is_none(), again);
        same(in_c, taken.map(motor));
    }
}

#[test]
fn speeds_out_of_range_are_refused_and_the_lamp_is_passed_on() {
    let mut link = Rig::up();
    for (speed, turn) in [(101, 0), (-101, 0), (0, 101), (0, i16::MIN)] {
        assert_eq!(link.drive(speed, turn), AXLE_ERROR_PERCENT);
    }
    let command = axle_ucp_motor { speed_pct: -20, turn_pct: 5, lamp: 7 };
    link.host(
        |it, now| axle_ucp_host_drive(it, command, now),
        |it, now| {
            let command = MotorControl::new(-20, 5).unwrap().with_front_led(true);
            command_error(it.drive(command, now))
        },
    );
    link.run(100);
    let lit = MotorControl::new(-20, 5).unwrap().with_front_led(true);
    link.robot_has(&RobotEvent::Motor(lit));
}

#[test]
fn frames_in_the_wrong_direction_are_counted_and_ignored() {
    let mut link = Rig::up();
    let frame = MotorControl::new(50, 0).unwrap().frame(0);
    link.line.inject(Who::Tail(0), frame.as_bytes());
    let pong = Pong::new(ErrorCode::Fine).frame(0);
    link.line.inject(Who::Head, pong.as_bytes());
    link.run(100);
    assert_eq!(link.rust().statistics().misdirected, 1);
    assert_eq!(link.line.tail(0).robot.rust().statistics().misdirected, 1);
}

#[test]
fn a_host_that_only_listens_sends_nothing() {
    let listens = |config: &mut HostConfig| {
        (config.sends_first_stop, config.ping_period) = (false, None);
    };
    let mut link = Rig::with(listens, |config| config.bias_request_period = None);
    link.run(1000);
    assert!(link.line.trace().iter().all(|byte| byte.who == Who::Tail(0)));
}

#[test]
fn frames_that_do_not_leave_are_due_again() {
    for unsent in [Unsent::Untouched, Unsent::CutOff, Unsent::Unflushed] {
        let mut link = Rig::up();
        link.drive_for(60, 500);
        link.line.head_mut().port = Port::Fails(20, unsent);
        link.line.tail_mut(0).robot.port = Port::Fails(10, unsent);
        link.stop();
        link.run(5000);
        assert_eq!(link.line.head().failed, 20);
        assert!(link.stands_still());
    }
}

#[test]
fn an_update_whose_request_does_not_leave_is_given_up() {
    let mut link = Rig::up();
    link.stop();
    link.run(4000);
    link.line.head_mut().port = Port::Fails(30, Unsent::CutOff);
    assert_eq!(link.update(40), AXLE_OK);
    link.run(500);
    link.has(&HostEvent::UpdateNotSent);
}

#[test]
fn a_port_that_holds_frames_back_tells_when_they_have_left() {
    let mut link = Rig::new();
    link.line.head_mut().port = Port::Holds;
    link.line.tail_mut(0).robot.port = Port::Holds;
    link.run(300);
    link.drive_for(60, 1000);
    link.stop();
    link.run(4000);
    assert!(link.stands_still());
}

#[test]
fn a_usb_adapter_delays_what_is_heard() {
    let mut link = Rig::with(
        |config| *config = HostConfig::usb_adapter(),
        |config| *config = RobotConfig::usb_adapter(),
    );
    link.line.timing_mut(Who::Head).input = Input::usb_adapter();
    link.run(500);
    link.drive_for(60, 1000);
    link.stop();
    link.run(4000);
    assert!(link.stands_still());
}

#[test]
fn old_bytes_are_no_fresh_commands() {
    let mut link = Rig::up();
    let now = link.line.now();
    let (since, later) = (now, now + Duration::from_secs(2));
    let frame = MotorControl::new(50, 0).unwrap().frame(0);
    let robot = &mut link.line.tail_mut(0).robot;
    robot.handle_input(frame.as_bytes(), Arrival::Between { since, now: later });
    robot.check();
    assert_eq!(robot.rust().command(later).speed(), 0);
    let head = link.line.head_mut();
    head.handle_input(&[], Arrival::Between { since, now: later });
    head.check();
}

#[test]
fn settings_are_those_of_the_crate_in_both_directions() {
    let mut host = host_config(&HostConfig::direct());
    host.baud = 1;
    assert_eq!(axle_ucp_host_config_usb_adapter(&mut host), AXLE_OK);
    same(host, host_config(&HostConfig::usb_adapter()));
    assert_eq!(axle_ucp_host_config_direct(&mut host), AXLE_OK);
    same(host, host_config(&HostConfig::direct()));

    let mut robot = robot_config(&RobotConfig::direct());
    robot.baud = 1;
    assert_eq!(axle_ucp_robot_config_usb_adapter(&mut robot), AXLE_OK);
    same(robot, robot_config(&RobotConfig::usb_adapter()));
    assert_eq!(axle_ucp_robot_config_direct(&mut robot), AXLE_OK);
    same(robot, robot_config(&RobotConfig::direct()));
}
