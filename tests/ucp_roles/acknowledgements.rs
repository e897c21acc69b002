//! Everything that a role acknowledges is available to its application, however full the queues are
//! (U15).

use crate::rig::*;

fn report(index: u8) -> Vec<u8> {
    FirmwareReport::new(&Telemetry::default(), 38).frame(index).as_bytes().to_vec()
}

/// The answers to a host's results in `frames`.
fn acks(frames: &[Vec<u8>]) -> usize {
    frames.iter().filter(|frame| matches!(frame[4], 6 | 7)).count()
}

#[test]
fn a_result_without_a_store_is_acknowledged_only_when_its_event_has_room() {
    let mut host = quiet_host();
    sent(&mut host, ms(0));
    // Results that are never taken, each a different one, while there is room.
    let result = |value: i16| ImuBias::new([value; 3], [0; 3]);
    let mut acknowledged = Vec::new();
    for value in 0..40 {
        host.handle_input(&bytes(result(value)), ms(1));
        if acks(&sent(&mut host, ms(1))) == 1 {
            acknowledged.push(HostEvent::ImuBias(result(value)));
        }
    }
    assert!((8..20).contains(&acknowledged.len()), "{}", acknowledged.len());
    let told: Vec<_> =
        events(&mut host).into_iter().filter(|e| matches!(e, HostEvent::ImuBias(_))).collect();
    assert_eq!(told, acknowledged);
    // The robot sends the last one again, and now there is room.
    host.handle_input(&bytes(result(39)), ms(1000));
    assert_eq!(acks(&sent(&mut host, ms(1000))), 1);
    assert_eq!(events(&mut host), [HostEvent::ImuBias(result(39))]);
}

/// Keeps one result of each kind and refuses the next.
#[derive(Default)]
struct Once(MemoryStore);

impl BiasStore for Once {
    fn load(&mut self) -> (Option<ImuBias>, Option<MagBias>) {
        self.0.load()
    }
    fn store_imu(&mut self, bias: ImuBias) -> Result<(), NotStored> {
        if self.0.imu.is_some() { Err(NotStored) } else { self.0.store_imu(bias) }
    }
    fn store_mag(&mut self, bias: MagBias) -> Result<(), NotStored> {
        if self.0.mag.is_some() { Err(NotStored) } else { self.0.store_mag(bias) }
    }
}

#[test]
fn a_result_that_is_refused_withdraws_the_acknowledgement_of_the_one_before() {
    let results = [
        [bytes(imu_bias()), bytes(ImuBias::new([100; 3], [200; 3]))],
        [bytes(mag_bias()), bytes(MagBias::new([100; 3]))],
    ];
    for [first, second] in results {
        // Both have arrived before the first could be acknowledged.
        let mut host = Host::with_store(quiet_config(), Once::default(), ms(0));
        host.handle_input(&[&first[..], &second].concat(), ms(1));
        assert_eq!(sent(&mut host, ms(1)), [] as [Vec<u8>; 0]);
        assert_eq!(host.statistics().results_not_stored, 1);
        // The robot resends the stored result: that one is acknowledged.
        host.handle_input(&first, ms(2));
        assert_eq!(acks(&sent(&mut host, ms(2))), 1);

        // The acknowledgement did not leave.
        for is_told_before in [true, false] {
            let mut host = Host::with_store(quiet_config(), Once::default(), ms(0));
            host.handle_input(&first, ms(1));
            assert!(host.poll_transmit(ms(1)).is_some());
            if is_told_before {
                host.handle_unsent(Unsent::Untouched, ms(2));
            }
            host.handle_input(&second, ms(3));
            if !is_told_before {
                host.handle_unsent(Unsent::Untouched, ms(4));
            }
            assert_eq!(sent(&mut host, ms(4)), [] as [Vec<u8>; 0], "{is_told_before}");
            // The indices of those that do leave have no gap.
            host.handle_input(&first, ms(5));
            assert_eq!(sent(&mut host, ms(5))[0][5], 0);
        }
    }
}

#[test]
fn a_result_without_room_withdraws_the_acknowledgement_of_the_one_before() {
    let mut host = quiet_host();
    let result = |value: i16| bytes(ImuBias::new([value; 3], [0; 3]));
    for value in 0..40 {
        host.handle_input(&result(value), ms(1));
    }
    assert!(host.statistics().results_without_room > 0);
    assert_eq!(sent(&mut host, ms(1)), [] as [Vec<u8>; 0]);
    host.poll_event();
    host.handle_input(&result(40), ms(2));
    host.handle_input(&result(41), ms(2));
    assert_eq!(sent(&mut host, ms(2)), [] as [Vec<u8>; 0]);
}

#[test]
fn reports_and_pongs_never_take_the_room_of_rare_events() {
    let mut host = Host::new(HostConfig::default(), ms(0));
    for turn in 0..100 {
        host.handle_timeout(ms(turn * 20));
        sent(&mut host, ms(turn * 20));
        host.handle_input(&bytes(Pong::new(ErrorCode::Fine)), ms(turn * 20));
        host.handle_input(&report(turn as u8), ms(turn * 20));
    }
    assert_eq!(host.last_report().unwrap().index, 99);
    host.handle_input(&bytes(imu_bias()), ms(2000));
    host.handle_input(&bytes(mag_bias()), ms(2000));
    host.start_calibration(IMU, ms(2000)).unwrap();
    sent(&mut host, ms(2000));
    host.handle_input(&bytes(CalibrationStartAck::new(IMU, ErrorCode::Fine)), ms(2001));
    let seen = events(&mut host);
    assert!(seen.contains(&HostEvent::ImuBias(imu_bias())));
    assert!(seen.contains(&HostEvent::MagBias(mag_bias())));
    assert!(seen.contains(&HostEvent::CalibrationStarted(IMU)));
}

#[test]
fn motor_events_never_take_the_room_of_rare_events() {
    let mut robot = Robot::new(RobotConfig::default(), ms(0));
    for turn in 0..50 {
        robot.handle_input(&bytes(go(turn)), ms(turn as u64));
    }
    robot.handle_input(&bytes(CalibrationStart::new(IMU)), ms(60));
    robot.handle_input(&bytes(CalibrationEnd::new(IMU)), ms(60));
    let biases = Biases::new(imu_bias(), mag_bias());
    robot.handle_input(&bytes(biases), ms(60));
    let seen = events(&mut robot);
    assert_eq!(seen.last(), Some(&RobotEvent::Biases(biases)));
    assert!(seen.contains(&RobotEvent::CalibrationEnd(IMU)));
}

#[test]
fn the_newest_motor_event_is_the_latest_command_however_full_the_queue_is() {
    let mut robot = quiet_robot();
    for turn in 1..=50 {
        robot.handle_input(&bytes(go(turn)), ms(turn as u64));
    }
    robot.handle_input(&bytes(MotorControl::STOP), ms(51));
    assert_eq!(events(&mut robot).last(), Some(&RobotEvent::Motor(MotorControl::STOP)));
}

#[test]
fn biases_end_their_request_only_if_their_event_has_room() {
    let mut robot = Robot::new(RobotConfig::default(), ms(0));
    sent(&mut robot, ms(0));
    // Other requests of the host, until the queue is full.
    for version in 40..60 {
        let request = OtaRequest::start_firmware_update(version);
        robot.handle_input(&bytes(request), ms(1));
    }
    let biases = bytes(Biases::new(imu_bias(), mag_bias()));
    robot.handle_input(&biases, ms(2));
    let asked = wait(&mut robot, ms(1500));
    assert_eq!(asked.iter().filter(|(_, frame)| frame[4] == 8).count(), 1, "it requests again");
    assert_eq!(events(&mut robot).len(), 16);
    robot.handle_input(&biases, ms(1600));
    assert_eq!(events(&mut robot), [RobotEvent::Biases(Biases::new(imu_bias(), mag_bias()))]);
    assert_eq!(wait(&mut robot, ms(5000)), [], "and then no longer");
}

#[test]
fn a_calibration_request_is_acknowledged_only_when_its_event_has_room() {
    let mut robot = quiet_robot();
    for version in 40..60 {
        let request = OtaRequest::start_firmware_update(version);
        robot.handle_input(&bytes(request), ms(1));
    }
    let start = bytes(CalibrationStart::new(IMU));
    let end = bytes(CalibrationEnd::new(IMU));
    robot.handle_input(&start, ms(2));
    assert_eq!((sent(&mut robot, ms(2)), robot.calibrating()), (vec![], None));
    events(&mut robot);
    robot.handle_input(&start, ms(3));
    assert_eq!((sent(&mut robot, ms(3)).len(), robot.calibrating()), (1, Some(IMU)));
    for version in 40..60 {
        let request = OtaRequest::start_firmware_update(version);
        robot.handle_input(&bytes(request), ms(4));
    }
    robot.handle_input(&end, ms(5));
    assert_eq!((sent(&mut robot, ms(5)), robot.calibrating()), (vec![], Some(IMU)));
    events(&mut robot);
    robot.handle_input(&end, ms(6));
    assert_eq!((sent(&mut robot, ms(6)).len(), robot.calibrating()), (1, None));
    assert_eq!(events(&mut robot), [RobotEvent::CalibrationEnd(IMU)]);
}

#[test]
fn biases_are_read_from_the_store_when_they_are_sent() {
    let store = MemoryStore { imu: Some(imu_bias()), mag: Some(mag_bias()) };
    let mut host = Host::with_store(quiet_config(), store, ms(0));
    sent(&mut host, ms(0));
    let newer = ImuBias::new([100; 3], [200; 3]);
    let chunk = [bytes(BiasRequest {}), bytes(newer)].concat();
    host.handle_input(&chunk, ms(1));
    let frames = sent(&mut host, ms(1));
    let biases = frames.iter().find_map(|frame| match message(frame) {
        Message::Biases(biases) => Some(*biases),
        _ => None,
    });
    assert_eq!(biases, Some(Biases::new(newer, mag_bias())));
}

#[test]
fn a_calibration_ends_when_its_result_is_acknowledged_and_the_next_start_is_reported() {
    for kind in [IMU, MAG] {
        let mut robot = quiet_robot();
        robot.handle_input(&bytes(CalibrationStart::new(kind)), ms(1));
        robot.calibration_result_imu(imu_bias(), ms(2));
        robot.calibration_result_mag(mag_bias(), ms(2));
        sent(&mut robot, ms(2));
        // Of the other kind: it ends nothing.
        let acks =
            [bytes(ImuBiasAck::new(ErrorCode::Fine)), bytes(MagBiasAck::new(ErrorCode::Fine))];
        let (own, other) = if kind == IMU { (0, 1) } else { (1, 0) };
        robot.handle_input(&acks[other], ms(3));
        assert_eq!(robot.calibrating(), Some(kind));
        robot.handle_input(&acks[own], ms(4));
        assert_eq!(robot.calibrating(), None);
        events(&mut robot);
        robot.handle_input(&bytes(CalibrationStart::new(kind)), ms(3_600_000));
        assert_eq!(events(&mut robot), [begins(kind)]);
    }
}

#[test]
fn a_store_that_keeps_results_acknowledges_them_however_full_the_queue_is() {
    let keeps = |store: &mut dyn BiasStore| BiasStore::keeps(&store);
    let mut store = MemoryStore::default();
    assert!(store.keeps() && keeps(&mut store));
    assert!(!NoStore.keeps() && !keeps(&mut NoStore));
    let mut host = Host::with_store(quiet_config(), store, ms(0));
    for value in 0..40 {
        let bias = ImuBias::new([value; 3], [0; 3]);
        host.handle_input(&bytes(bias), ms(1));
        assert_eq!(acks(&sent(&mut host, ms(1))), 1);
        assert_eq!(host.store().imu, Some(bias));
    }
    assert!(host.lost_events() > 0 && host.statistics().results_without_room == 0);
}

#[test]
fn a_result_without_room_is_counted_as_such_and_not_as_a_lost_event() {
    let mut host = quiet_host();
    for value in 0..40 {
        host.handle_input(&bytes(MagBias::new([value; 3])), ms(1));
    }
    let told = events(&mut host).len() as u32 - 1; // the link is up
    assert_eq!((host.statistics().results_without_room, host.lost_events()), (40 - told, 0));
}

#[test]
fn the_end_of_a_calibration_request_waits_for_room() {
    let mut host = quiet_host();
    for value in 0..40 {
        host.handle_input(&bytes(ImuBias::new([value; 3], [0; 3])), ms(1));
    }
    host.start_calibration(MAG, ms(2)).unwrap();
    sent(&mut host, ms(2));
    host.handle_input(&bytes(CalibrationStartAck::new(MAG, ErrorCode::Fine)), ms(3));
    assert_eq!(host.start_calibration(IMU, ms(3)), Err(CommandError::Calibrating));
    assert_eq!(host.start_firmware_update(50, ms(3)), Err(CommandError::Calibrating));
    assert_eq!(wait(&mut host, ms(2000)), [], "it is not repeated");
    let seen = events(&mut host);
    assert_eq!(seen.len(), 17);
    assert_eq!(seen.last(), Some(&HostEvent::CalibrationStarted(MAG)));
    host.start_calibration(IMU, ms(2001)).unwrap();
}

#[test]
fn a_repeated_start_is_reported_with_a_flag() {
    let mut robot = quiet_robot();
    let start = bytes(CalibrationStart::new(IMU));
    robot.handle_input(&start, ms(1));
    assert_eq!(events(&mut robot), [begins(IMU)]);
    robot.handle_input(&start, ms(2));
    robot.handle_input(&start, ms(3));
    let repeated = RobotEvent::CalibrationStart { kind: IMU, repeated: true };
    assert_eq!(events(&mut robot), [repeated], "once while it waits");
    assert_eq!(sent(&mut robot, ms(3)).len(), 1);
    assert_eq!(robot.statistics().calibration_repeats, 2);
    // Another kind is another calibration.
    robot.handle_input(&bytes(CalibrationStart::new(MAG)), ms(4));
    assert_eq!((events(&mut robot), robot.calibrating()), (vec![begins(MAG)], Some(MAG)));
}

#[test]
fn a_calibration_can_be_aborted_by_the_robot() {
    let mut robot = quiet_robot();
    assert_eq!(robot.abort_calibration(), None);
    robot.handle_input(&bytes(CalibrationStart::new(IMU)), ms(1));
    sent(&mut robot, ms(1));
    events(&mut robot);
    assert_eq!((robot.abort_calibration(), robot.calibrating()), (Some(IMU), None));
    // The host's end is acknowledged without effect; its next start is reported.
    robot.handle_input(&bytes(CalibrationEnd::new(IMU)), ms(2));
    assert_eq!((sent(&mut robot, ms(2)).len(), events(&mut robot)), (1, vec![]));
    robot.handle_input(&bytes(CalibrationStart::new(IMU)), ms(3));
    assert_eq!(events(&mut robot), [begins(IMU)]);
}

#[test]
fn the_acknowledgement_of_an_older_result_ends_no_new_calibration() {
    let mut robot = quiet_robot();
    robot.calibration_result_imu(imu_bias(), ms(0));
    sent(&mut robot, ms(0));
    robot.handle_input(&bytes(CalibrationStart::new(IMU)), ms(1));
    robot.handle_input(&bytes(ImuBiasAck::new(ErrorCode::Fine)), ms(2));
    assert_eq!(robot.calibrating(), Some(IMU));
    robot.handle_input(&bytes(CalibrationEnd::new(IMU)), ms(3));
    let told = [begins(IMU), RobotEvent::ImuBiasTaken, RobotEvent::CalibrationEnd(IMU)];
    assert_eq!(events(&mut robot), told);
}

#[test]
fn an_acknowledgement_is_not_for_a_result_that_has_not_been_sent() {
    let mut robot = quiet_robot();
    robot.calibration_result_imu(imu_bias(), ms(0));
    robot.calibration_result_mag(mag_bias(), ms(0));
    robot.handle_input(&bytes(ImuBiasAck::new(ErrorCode::Fine)), ms(1));
    robot.handle_input(&bytes(MagBiasAck::new(ErrorCode::Fine)), ms(1));
    assert_eq!((events(&mut robot), robot.statistics().acks_refused), (vec![], 2));
    assert_eq!(sent(&mut robot, ms(1)).len(), 2);
}

#[test]
fn the_latest_command_and_network_state_have_getters_and_are_the_newest_of_their_events() {
    let mut robot = quiet_robot();
    assert_eq!(robot.network_state(), None);
    for turn in 1..=30_u32 {
        robot.handle_input(&bytes(go(turn as i16)), ms(turn.into()));
        let state = SetNetworkState::new(NetworkState::from(turn)).unwrap();
        robot.handle_input(&bytes(state), ms(turn.into()));
    }
    assert_eq!(robot.network_state(), Some(NetworkState::Other(30)));
    robot.handle_timeout(ms(600));
    let seen = events(&mut robot);
    assert!(seen.len() <= 9 && robot.lost_events() == 61 - seen.len() as u32);
    let newest = |is: fn(&RobotEvent) -> bool| *seen.iter().rfind(|event| is(event)).unwrap();
    let motion = newest(|event| matches!(event, RobotEvent::Motor(_) | RobotEvent::Watchdog));
    assert_eq!(motion, RobotEvent::Watchdog);
    let network = newest(|event| matches!(event, RobotEvent::NetworkState(_)));
    assert_eq!(network, RobotEvent::NetworkState(NetworkState::Other(30)));
}

#[test]
fn cloned_roles_behave_alike() {
    let mut rig = Rig::new(ms(0));
    rig.robot.set_telemetry(&Telemetry::default(), ms(0));
    rig.host.drive(go(10), ms(0)).unwrap();
    rig.run_for(333);
    let (mut host, mut robot) = (rig.host.clone(), rig.robot.clone());
    assert_eq!(wait(&mut host, ms(2000)), wait(&mut rig.host, ms(2000)));
    assert_eq!(wait(&mut robot, ms(2000)), wait(&mut rig.robot, ms(2000)));
    assert_eq!(format!("{host:?} {robot:?}"), format!("{:?} {:?}", rig.host, rig.robot));
}
