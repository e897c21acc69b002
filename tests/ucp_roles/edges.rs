//! Edges: what holds for both kinds of results, each time it happens, and to the microsecond.

use crate::rig::*;

#[test]
fn a_result_of_either_kind_without_room_withdraws_the_acknowledgement_of_the_one_before() {
    type Result = fn(i16) -> Vec<u8>;
    let imu: Result = |value| bytes(ImuBias::new([value; 3], [0; 3]));
    let mag: Result = |value| bytes(MagBias::new([value; 3]));
    for (this, other) in [(imu, mag), (mag, imu)] {
        let mut host = quiet_host();
        // The link and 14 results: one place is left.
        for value in 0..14 {
            host.handle_input(&other(value), ms(1));
        }
        sent(&mut host, ms(1));
        host.handle_input(&this(1), ms(2));
        host.handle_input(&this(2), ms(2));
        assert_eq!(host.statistics().results_without_room, 1);
        assert_eq!(sent(&mut host, ms(2)), [] as [Vec<u8>; 0]);
        // Once there is room, the repetition is kept and acknowledged.
        host.poll_event();
        host.handle_input(&this(2), ms(3));
        assert_eq!(sent(&mut host, ms(3)).len(), 1);
    }
}

#[test]
fn an_acknowledgement_is_awaited_from_the_end_of_the_request_on_the_wire_to_the_microsecond() {
    // 9 bytes at 115,200 bit/s, then 200 ms.
    let wait_us = 782 + 200_000;
    for step in [CalibrationStep::Start, CalibrationStep::End] {
        let mut host = quiet_host();
        match step {
            CalibrationStep::Start => host.start_calibration(IMU, ms(3)).unwrap(),
            CalibrationStep::End => host.end_calibration(IMU, ms(3)).unwrap(),
        }
        let begin = ms(10);
        assert_eq!(sent(&mut host, begin).len(), 1);
        for attempt in 1..=3 {
            let end = begin + Duration::from_micros(wait_us * attempt);
            let just_before = us(end.as_micros() - 1);
            host.handle_timeout(just_before);
            assert_eq!(sent(&mut host, just_before), [] as [Vec<u8>; 0]);
            host.handle_timeout(end);
            assert_eq!(sent(&mut host, end).len(), usize::from(attempt < 3));
        }
        let failure = host.calibration_outcome().unwrap().unwrap_err();
        assert_eq!((failure.step, failure.attempts, failure.kind), (step, 3, IMU));
        assert_eq!(host.config().calibration_bound().as_micros(), 3 * wait_us);
    }
}

#[test]
fn each_boot_of_a_robot_is_reported_once_however_often_its_biases_are_sent() {
    let store = MemoryStore { imu: Some(imu_bias()), mag: Some(mag_bias()) };
    let mut host = Host::with_store(quiet_config(), store, ms(0));
    for boot in 1..4_u32 {
        let at = ms(u64::from(boot) * 100);
        host.handle_input(&bytes(BiasRequest {}), at);
        events(&mut host);
        assert_eq!(host.poll_transmit(at).unwrap()[4], 8);
        host.handle_unsent(Unsent::Untouched, at);
        assert_eq!(host.poll_transmit(at).unwrap()[4], 8);
        assert_eq!(events(&mut host), [HostEvent::BiasesSent]);
        assert_eq!((host.statistics().biases, host.statistics().bias_requests), (boot, boot));
    }
}

#[test]
fn a_round_trip_and_a_report_can_be_taken_once_each() {
    let mut config = quiet_config();
    config.ping_period = Some(Duration::from_millis(200));
    let mut host = Host::new(config, ms(0));
    assert_eq!((host.take_round_trip(), host.take_report()), (None, None));
    sent(&mut host, ms(0));
    host.handle_input(&bytes(Pong::new(ErrorCode::Fine)), ms(7));
    assert_eq!(host.take_round_trip(), Some(Duration::from_millis(7)));
    assert_eq!(host.take_round_trip(), None);
    let report = FirmwareReport::new(&Telemetry { battery_pct: 55, ..Telemetry::default() }, 40);
    host.handle_input(report.frame(3).as_bytes(), ms(8));
    let taken = host.take_report().unwrap();
    assert_eq!((taken.telemetry.battery_pct, taken.version), (55, Some(40)));
    assert_eq!((taken.index, taken.lost, host.take_report()), (3, 0, None));
    assert_eq!(host.last_report(), Some(&taken), "it is still the latest");
    // Each report is new: after a gap, and repeated.
    for (index, lost) in [(9, 5), (9, 0), (8, 254)] {
        host.handle_input(report.frame(index).as_bytes(), ms(9));
        let taken = host.take_report().unwrap();
        assert_eq!((taken.index, taken.lost), (index, lost));
    }
}

#[test]
fn the_first_of_two_copies_that_the_port_did_not_touch_goes_twice_again() {
    for unsent in EVERY {
        let mut host = begun();
        host.drive(go(40), ms(30)).unwrap();
        sent(&mut host, ms(30));
        host.stop(ms(31));
        host.handle_unsent(Unsent::CutOff, ms(32));
        assert_eq!(speed(host.poll_transmit(ms(32)).unwrap()), Some(0));
        assert!(!host.is_stop_sent(), "one of two");
        host.handle_unsent(unsent, ms(33));
        let frames = sent(&mut host, ms(33));
        assert_eq!(frames.iter().filter_map(|it| speed(it)).collect::<Vec<_>>(), [0, 0]);
        assert!(host.is_stop_sent());
    }
}

#[test]
fn a_network_state_that_is_refused_changes_nothing() {
    let mut host = begun();
    host.set_network_state(NetworkState::Connected, ms(1)).unwrap();
    assert_eq!(sent(&mut host, ms(1)).len(), 1);
    assert!(host.set_network_state(NetworkState::Other(256), ms(2)).is_err());
    // Sent again when the robot boots: the one before.
    host.handle_input(&bytes(BiasRequest {}), ms(3));
    let frames = sent(&mut host, ms(3));
    let Message::SetNetworkState(told) = message(&frames[0]) else { panic!("{frames:?}") };
    assert_eq!(told.state(), NetworkState::Connected);
    // The same state again is not sent.
    host.set_network_state(NetworkState::Connected, ms(4)).unwrap();
    assert_eq!(sent(&mut host, ms(4)), [] as [Vec<u8>; 0]);
}

#[test]
fn the_command_period_and_the_gap_are_kept_to_the_microsecond_from_when_a_command_was_sent() {
    let mut host = begun();
    let at = ms(50);
    host.drive(go(1), ms(45)).unwrap();
    assert_eq!(sent(&mut host, at).len(), 1);
    // Given 3 ms later, and due 20 ms after the one before was handed out.
    host.drive(go(2), at + Duration::from_millis(3)).unwrap();
    let due = at + Duration::from_millis(20);
    assert_eq!(host.poll_timeout(), Some(due));
    assert_eq!(sent(&mut host, us(due.as_micros() - 1)), [] as [Vec<u8>; 0]);
    assert_eq!(speed(&sent(&mut host, due)[0]), Some(2));
    assert_eq!(host.poll_timeout(), Some(due + Duration::from_millis(100)));
    // A driver that is late shifts the next repetition.
    let late = due + Duration::from_millis(130);
    assert_eq!(speed(&sent(&mut host, late)[0]), Some(2));
    assert_eq!(host.poll_timeout(), Some(late + Duration::from_millis(100)));
}

#[test]
fn everything_that_is_due_goes_in_the_stated_order_and_is_in_the_deadline() {
    type Act = fn(&mut Host<MemoryStore>);
    let acts: [(u8, Act); 7] = [
        (2, |host| host.drive(go(9), ms(7)).unwrap()),
        (6, |host| host.handle_input(&bytes(imu_bias()), ms(7))),
        (7, |host| host.handle_input(&bytes(mag_bias()), ms(7))),
        (8, |host| host.handle_input(&bytes(BiasRequest {}), ms(7))),
        (3, |host| host.start_calibration(MAG, ms(7)).unwrap()),
        (4, |host| host.end_calibration(MAG, ms(7)).unwrap()),
        (10, |host| host.set_network_state(NetworkState::Ota, ms(7)).unwrap()),
    ];
    let fresh = |ping_period| {
        let mut config = quiet_config();
        config.ping_period = ping_period;
        let store = MemoryStore { imu: Some(imu_bias()), mag: Some(mag_bias()) };
        Host::with_store(config, store, ms(0))
    };
    let ids = |host: &mut Host<MemoryStore>| {
        sent(host, ms(7)).iter().map(|frame| frame[4]).collect::<Vec<_>>()
    };
    for (id, act) in acts {
        let mut host = fresh(None);
        act(&mut host);
        assert_eq!(host.poll_timeout(), Some(ms(7)), "id {id}");
        assert_eq!(ids(&mut host), [id]);
    }
    // All at once, asked for in another order.
    let mut host = fresh(Some(Duration::from_millis(200)));
    acts.iter().rev().filter(|(id, _)| *id != 4).for_each(|(_, act)| act(&mut host));
    assert_eq!(ids(&mut host), [2, 6, 7, 8, 3, 10, 1]);
}

#[test]
fn everything_that_a_robot_has_to_send_goes_in_order_and_is_in_its_deadline() {
    type Act = fn(&mut Robot);
    let acts: [(u8, Act); 7] = [
        (3, |robot| robot.handle_input(&bytes(CalibrationStart::new(IMU)), ms(7))),
        (4, |robot| robot.handle_input(&bytes(CalibrationEnd::new(IMU)), ms(7))),
        (9, |robot| {
            robot.handle_input(&bytes(OtaRequest::start_firmware_update(9)), ms(7));
            assert!(robot.answer_update(OtaStatus::Accepted, ms(7)));
        }),
        (1, |robot| robot.handle_input(&bytes(Ping {}), ms(7))),
        (6, |robot| robot.calibration_result_imu(imu_bias(), ms(7))),
        (7, |robot| robot.calibration_result_mag(mag_bias(), ms(7))),
        (5, |robot| robot.set_telemetry(&Telemetry::default(), ms(7))),
    ];
    let ids =
        |robot: &mut Robot| sent(robot, ms(7)).iter().map(|frame| frame[4]).collect::<Vec<_>>();
    for (id, act) in acts {
        let mut robot = quiet_robot();
        act(&mut robot);
        assert_eq!(robot.poll_timeout(), Some(ms(7)), "id {id}");
        assert_eq!(ids(&mut robot), [id]);
    }
    let mut robot = Robot::new(RobotConfig::default(), ms(7));
    assert_eq!(robot.poll_timeout(), Some(ms(7)), "its biases");
    acts.iter().rev().for_each(|(_, act)| act(&mut robot));
    assert_eq!(ids(&mut robot), [3, 4, 9, 1, 6, 7, 8, 5]);
}

#[test]
fn a_repeated_request_that_did_not_leave_is_no_repetition() {
    for unsent in [Unsent::Untouched, Unsent::CutOff] {
        let mut host = quiet_host();
        host.start_calibration(IMU, ms(0)).unwrap();
        sent(&mut host, ms(0));
        host.handle_timeout(ms(300));
        assert_eq!(host.poll_transmit(ms(300)).unwrap()[4], 3);
        assert_eq!(host.statistics().calibration_retries, 1);
        host.handle_unsent(unsent, ms(300));
        assert_eq!(host.statistics().calibration_retries, 0);
        sent(&mut host, ms(301));
        assert_eq!(host.statistics().calibration_retries, 1);
    }
}

#[test]
fn a_command_that_waited_too_long_for_the_driver_moves_nothing() {
    for (waited_us, is_too_old) in [(499_999, false), (500_000, true), (900_000, true)] {
        let mut robot = quiet_robot();
        let now = us(waited_us);
        robot.handle_old_input(&bytes(go(50).with_front_led(true)), ms(0), now);
        let expected = if is_too_old { MotorControl::STOP } else { go(50) }.with_front_led(true);
        assert_eq!(robot.command(now), expected);
        assert_eq!(events(&mut robot), [RobotEvent::Motor(expected)], "{waited_us} us");
        assert_eq!((robot.statistics().commands, robot.statistics().watchdog), (1, 0));
        assert_eq!(robot.poll_timeout(), Some(ms(500)));
        assert_eq!(robot.take_command(now), Some(expected));
    }
}

#[test]
fn a_stop_of_any_origin_ends_speed_and_turn_and_keeps_the_lamp() {
    for (speed, angular) in [(50, 0), (0, 50), (-50, -30), (3, -100)] {
        for lamp in [true, false] {
            let command = MotorControl::new(speed, angular).unwrap().with_front_led(lamp);
            let still = MotorControl::STOP.with_front_led(lamp);
            // By the application, and by the dead-man.
            for is_asked in [true, false] {
                let mut host = begun();
                host.drive(command, ms(0)).unwrap();
                wait(&mut host, ms(400));
                if is_asked {
                    host.stop(ms(500));
                }
                let told = wait(&mut host, ms(500)).pop().unwrap().1;
                assert_eq!(told[6..22], bytes(still)[6..22]);
                assert_eq!(host.command(), Some(still));
            }
            // By the watchdog of the robot.
            let mut robot = quiet_robot();
            robot.handle_input(&bytes(command), ms(0));
            assert_eq!(robot.command(us(499_999)), command);
            assert_eq!(robot.command(ms(500)), still);
            robot.handle_timeout(ms(500));
            assert_eq!(robot.command(ms(0)), still);
            // The first frame of a host that drives at once.
            let mut host = fresh_host();
            host.drive(command, ms(0)).unwrap();
            assert_eq!(sent(&mut host, ms(0))[0], bytes(still));
        }
    }
}
