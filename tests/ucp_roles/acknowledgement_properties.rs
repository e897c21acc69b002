//! Nothing that was acknowledged is lost, whatever is in the queues (U15).
//!
//! The oracle looks at a copy of the role: what an application would find if it took all events
//! now.

use proptest::{collection::vec, prelude::*};

use crate::rig::*;

/// A single event for a host.
#[derive(Clone, Copy, Debug)]
enum ToHost {
    Imu(i16),
    Mag(i16),
    Ask,
    Report,
    Pong,
    Refused,
    Calibrate(bool),
    Ack(bool),
    Take(usize),
    Sleep(u32),
}

fn to_host() -> impl Strategy<Value = ToHost> {
    prop_oneof![
        3 => (0..20_i16).prop_map(ToHost::Imu),
        3 => (0..20_i16).prop_map(ToHost::Mag),
        1 => Just(ToHost::Ask),
        3 => Just(ToHost::Report),
        1 => Just(ToHost::Pong),
        1 => Just(ToHost::Refused),
        2 => any::<bool>().prop_map(ToHost::Calibrate),
        2 => any::<bool>().prop_map(ToHost::Ack),
        2 => (0..18_usize).prop_map(ToHost::Take),
        2 => (0..600_000_u32).prop_map(ToHost::Sleep),
    ]
}

fn is_end(event: &HostEvent) -> bool {
    matches!(
        event,
        HostEvent::CalibrationStarted(_)
            | HostEvent::CalibrationEnded(_)
            | HostEvent::CalibrationFailed(_)
    )
}

/// A single event for a robot.
#[derive(Clone, Copy, Debug)]
enum ToRobot {
    Start(bool),
    End(bool),
    Biases(i16),
    Result(bool, i16),
    ResultAck(bool),
    Motor(i16),
    Network(u8),
    Update(i16),
    Abort,
    Take(usize),
    Sleep(u32),
}

fn to_robot() -> impl Strategy<Value = ToRobot> {
    prop_oneof![
        2 => any::<bool>().prop_map(ToRobot::Start),
        2 => any::<bool>().prop_map(ToRobot::End),
        2 => (0..5_i16).prop_map(ToRobot::Biases),
        2 => (any::<bool>(), 0..5_i16).prop_map(|(imu, value)| ToRobot::Result(imu, value)),
        2 => any::<bool>().prop_map(ToRobot::ResultAck),
        3 => (-100..=100_i16).prop_map(ToRobot::Motor),
        2 => (0..5_u8).prop_map(ToRobot::Network),
        3 => (0..100_i16).prop_map(ToRobot::Update),
        1 => Just(ToRobot::Abort),
        2 => (0..18_usize).prop_map(ToRobot::Take),
        1 => (0..600_000_u32).prop_map(ToRobot::Sleep),
    ]
}

fn kind(is_imu: bool) -> CalibrationKind {
    if is_imu { IMU } else { MAG }
}

/// What an application would find now.
fn waiting<R: Endpoint + Clone>(role: &R) -> Vec<R::Event> {
    events(&mut role.clone())
}

/// Whether the bias request is still repeated.
fn asks(robot: &Robot) -> bool {
    let mut robot = robot.clone();
    let end = robot.poll_timeout().unwrap_or(ms(0)) + Duration::from_millis(2000);
    wait(&mut robot, end).iter().any(|(_, frame)| frame[4] == 8)
}

fn newest_calibration(robot: &Robot) -> Option<RobotEvent> {
    let is = |event: &RobotEvent| {
        matches!(event, RobotEvent::CalibrationStart { .. } | RobotEvent::CalibrationEnd(_))
    };
    waiting(robot).into_iter().rfind(is)
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 300, ..ProptestConfig::default() })]

    #[test]
    fn a_host_without_a_store_loses_no_result_that_it_acknowledges(
        calls in vec(to_host(), 1..120),
    ) {
        let mut now = ms(0);
        let mut host = fresh_host();
        sent(&mut host, now);
        let (mut told, mut asked) = (Vec::new(), 0);
        for call in calls {
            match call {
                ToHost::Imu(value) => {
                    let bias = ImuBias::new([value; 3], [value; 3]);
                    host.handle_input(&bytes(bias), now);
                    let acks = sent(&mut host, now).iter().filter(|it| it[4] == 6).count();
                    let event = HostEvent::ImuBias(bias);
                    let found = told.contains(&event) || waiting(&host).contains(&event);
                    prop_assert!(acks == 0 || found, "{bias:?}");
                }
                ToHost::Mag(value) => {
                    let bias = MagBias::new([value; 3]);
                    host.handle_input(&bytes(bias), now);
                    let acks = sent(&mut host, now).iter().filter(|it| it[4] == 7).count();
                    let event = HostEvent::MagBias(bias);
                    let found = told.contains(&event) || waiting(&host).contains(&event);
                    prop_assert!(acks == 0 || found, "{bias:?}");
                }
                ToHost::Ask => host.handle_input(&bytes(BiasRequest {}), now),
                ToHost::Report => {
                    let report = FirmwareReport::new(&Telemetry::default(), 38);
                    host.handle_input(&bytes(report), now);
                }
                ToHost::Pong => host.handle_input(&bytes(Pong::new(ErrorCode::Fine)), now),
                ToHost::Refused => {
                    host.handle_input(&bytes(OtaAck::new(OtaStatus::Forbidden)), now);
                }
                ToHost::Calibrate(is_imu) => {
                    asked += usize::from(host.start_calibration(kind(is_imu), now).is_ok());
                }
                ToHost::Ack(is_imu) => {
                    let ack = CalibrationStartAck::new(kind(is_imu), ErrorCode::Fine);
                    host.handle_input(&bytes(ack), now);
                }
                ToHost::Take(count) => {
                    told.extend(std::iter::from_fn(|| host.poll_event()).take(count));
                }
                ToHost::Sleep(micros) => {
                    let end = now + Duration::from_micros(micros);
                    wait(&mut host, end);
                    now = end;
                }
            }
            host.handle_timeout(now);
            sent(&mut host, now);
        }
        // Every calibration request ends, and its end is reported.
        wait(&mut host, now + HostConfig::default().calibration_bound());
        told.extend(events(&mut host));
        prop_assert_eq!(told.iter().filter(|event| is_end(event)).count(), asked);
    }

    #[test]
    fn a_robot_loses_nothing_that_it_acknowledges_or_stops_requesting(
        calls in vec(to_robot(), 1..120),
    ) {
        let mut now = ms(0);
        let mut robot = Robot::new(RobotConfig::default(), now);
        sent(&mut robot, now);
        for call in calls {
            match call {
                ToRobot::Start(is_imu) => {
                    let kind = kind(is_imu);
                    robot.handle_input(&bytes(CalibrationStart::new(kind)), now);
                    let acks = sent(&mut robot, now).iter().filter(|it| it[4] == 3).count();
                    let told = matches!(
                        newest_calibration(&robot),
                        Some(RobotEvent::CalibrationStart { kind: told, .. }) if told == kind
                    );
                    prop_assert_eq!(acks == 1, told && robot.calibrating() == Some(kind));
                }
                ToRobot::End(is_imu) => {
                    let kind = kind(is_imu);
                    let is_running = robot.calibrating() == Some(kind);
                    robot.handle_input(&bytes(CalibrationEnd::new(kind)), now);
                    let acks = sent(&mut robot, now).iter().filter(|it| it[4] == 4).count();
                    let told = newest_calibration(&robot) == Some(RobotEvent::CalibrationEnd(kind));
                    prop_assert!(!is_running || (acks == 1) == told);
                    prop_assert!(!is_running || (acks == 1) == robot.calibrating().is_none());
                }
                ToRobot::Biases(value) => {
                    let imu = ImuBias::new([value; 3], [0; 3]);
                    let biases = Biases::new(imu, mag_bias());
                    let asked = asks(&robot);
                    robot.handle_input(&bytes(biases), now);
                    let told = waiting(&robot).contains(&RobotEvent::Biases(biases));
                    prop_assert!(!asked || asks(&robot) != told);
                }
                ToRobot::Result(true, value) => {
                    robot.calibration_result_imu(ImuBias::new([value; 3], [0; 3]), now);
                }
                ToRobot::Result(false, value) => {
                    robot.calibration_result_mag(MagBias::new([value; 3]), now);
                }
                ToRobot::ResultAck(is_imu) => {
                    let count = |robot: &Robot, event| {
                        waiting(robot).into_iter().filter(|it| *it == event).count()
                    };
                    let repeats = |robot: &Robot, id| {
                        let mut robot = robot.clone();
                        let frames = wait(&mut robot, now + Duration::from_millis(2000));
                        frames.iter().any(|(_, frame)| frame[4] == id)
                    };
                    let fine = ErrorCode::Fine;
                    let (id, event, ack) = match is_imu {
                        true => (6, RobotEvent::ImuBiasTaken, bytes(ImuBiasAck::new(fine))),
                        false => (7, RobotEvent::MagBiasTaken, bytes(MagBiasAck::new(fine))),
                    };
                    let (before, repeated) = (count(&robot, event), repeats(&robot, id));
                    robot.handle_input(&ack, now);
                    let told = count(&robot, event) > before;
                    prop_assert_eq!(repeated && !repeats(&robot, id), told);
                }
                ToRobot::Motor(speed) => {
                    robot.handle_input(&bytes(go(speed)), now);
                    let is = |event: &RobotEvent| {
                        matches!(event, RobotEvent::Motor(_) | RobotEvent::Watchdog)
                    };
                    if let Some(event) = waiting(&robot).into_iter().rfind(is) {
                        prop_assert_eq!(event, RobotEvent::Motor(go(speed)));
                    }
                }
                ToRobot::Network(state) => {
                    let state = NetworkState::from(u32::from(state));
                    robot.handle_input(&bytes(SetNetworkState::new(state).unwrap()), now);
                    prop_assert_eq!(robot.network_state(), Some(state));
                }
                ToRobot::Update(version) => {
                    let request = OtaRequest::start_firmware_update(version);
                    let by = UpdateSource::Request;
                    let event = RobotEvent::UpdateRequested { version, by };
                    // Answered earlier, so that only this request can be answered now.
                    robot.answer_update(OtaStatus::Forbidden, now);
                    robot.handle_input(&bytes(request), now);
                    let told = waiting(&robot).contains(&event);
                    prop_assert!(told || !robot.clone().answer_update(OtaStatus::Forbidden, now));
                }
                ToRobot::Abort => drop(robot.abort_calibration()),
                ToRobot::Take(count) => drop(events_up_to(&mut robot, count)),
                ToRobot::Sleep(micros) => {
                    let end = now + Duration::from_micros(micros);
                    wait(&mut robot, end);
                    now = end;
                }
            }
            robot.handle_timeout(now);
            sent(&mut robot, now);
        }
    }
}

fn events_up_to(robot: &mut Robot, count: usize) -> Vec<RobotEvent> {
    std::iter::from_fn(|| robot.poll_event()).take(count).collect()
}
