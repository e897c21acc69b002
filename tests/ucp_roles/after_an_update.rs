//! What was asked for during an update, and the indices of a robot's frames.

use crate::rig::*;

#[test]
fn whatever_was_asked_for_during_an_update_is_due_when_it_ends() {
    type Ask = fn(&mut Host<MemoryStore>);
    let asks: [(u8, Ask); 4] = [
        (6, |host| host.handle_input(&bytes(imu_bias()), ms(5))),
        (7, |host| host.handle_input(&bytes(mag_bias()), ms(5))),
        (8, |host| host.handle_input(&bytes(BiasRequest {}), ms(5))),
        (10, |host| host.set_network_state(NetworkState::Connected, ms(5)).unwrap()),
    ];
    for (id, ask) in asks {
        let store = MemoryStore { imu: Some(imu_bias()), mag: Some(mag_bias()) };
        let mut config = quiet_config();
        config.ping_period = Some(Duration::from_millis(2));
        let mut host = Host::with_store(config, store, ms(0));
        sent(&mut host, ms(0));
        host.start_firmware_update(50, ms(1)).unwrap();
        assert_eq!(sent(&mut host, ms(1)).last().unwrap()[4], 9);
        ask(&mut host);
        assert_eq!(sent(&mut host, ms(7)), [] as [Vec<u8>; 0], "the line is silent");
        host.end_firmware_update(ms(9));
        assert_eq!(host.poll_timeout(), Some(ms(9)), "id {id}");
        assert!(sent(&mut host, ms(9)).iter().any(|frame| frame[4] == id));
    }
}

#[test]
fn only_the_reports_of_a_robot_are_counted() {
    let mut robot = Robot::new(RobotConfig::default(), ms(0));
    robot.set_telemetry(&Telemetry::default(), ms(0));
    wait(&mut robot, ms(100));
    let at = ms(1000);
    for request in [
        bytes(Ping {}),
        bytes(CalibrationStart::new(IMU)),
        bytes(CalibrationEnd::new(IMU)),
        bytes(OtaRequest::start_firmware_update(50)),
    ] {
        robot.handle_input(&request, at);
    }
    robot.answer_update(OtaStatus::Failed, at);
    robot.calibration_result_imu(imu_bias(), at);
    robot.calibration_result_mag(mag_bias(), at);
    let frames = sent(&mut robot, at);
    let found: Vec<_> = frames.iter().map(|frame| (frame[4], frame[5])).collect();
    assert_eq!(found, [(3, 0), (4, 0), (9, 0), (1, 0), (6, 0), (7, 0), (8, 0), (5, 6)]);
    // And none of the answers reports damage.
    for (id, body) in [(3, &[2, 0][..]), (4, &[2, 0]), (1, &[0])] {
        let frame = frames.iter().find(|frame| frame[4] == id).unwrap();
        assert_eq!(Frame::parse(frame).unwrap().body(), body);
    }
}
