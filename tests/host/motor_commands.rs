//! Motor commands are repeated, a stop goes first, and the dead-man ends commands that are not
//! renewed (U10).

use crate::rig::*;

#[test]
fn the_latest_motor_command_is_repeated_every_100_ms() {
    let mut host = driven(quiet_host(), 40, 0);
    assert_eq!(sent(&mut host, ms(0)).len(), 1);
    let frames = wait(&mut host, ms(450));
    let at = |millis: u64| (millis * 1000, 40);
    assert_eq!(speeds(&frames), [at(100), at(200), at(300), at(400)]);
    assert_eq!(host.statistics().commands, 5);
}

#[test]
fn called_a_thousand_times_a_second_a_command_is_sent_every_100_ms_and_a_stop_every_20() {
    type Call = fn(&mut Host, Instant);
    let calls: [(Call, usize); 2] =
        [(|host, now| host.drive(go(40), now).unwrap(), 10), (|host, now| host.stop(now), 50)];
    for (call, expected) in calls {
        let mut host = quiet_host();
        let mut count = 0;
        for now in 0..1000 {
            host.handle_timeout(ms(now));
            call(&mut host, ms(now));
            count += sent(&mut host, ms(now)).len();
        }
        assert_eq!(count, expected);
    }
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
    // Everything that could delay it: an acknowledgement, a calibration, the lamp, a ping.
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
    assert_eq!(after.len(), 6, "it is still sent every 100 ms");
    let Message::MotorControl(command) = message(&after[5].1) else { panic!() };
    assert_eq!(command.front_led(), 100, "the lamp stays");
    let dead_men = events(&mut host).into_iter().filter(|event| *event == HostEvent::DeadMan);
    assert_eq!((dead_men.count(), host.statistics().dead_man), (1, 1), "once");

    host.drive(go(30), ms(1010)).unwrap();
    assert_eq!(wait(&mut host, ms(1030)).len(), 1, "and the next call drives again");
    assert_eq!(host.command().unwrap().speed(), 30);
    wait(&mut host, ms(2000));
    assert_eq!(host.statistics().dead_man, 2, "each time");
}

#[test]
fn the_dead_man_does_not_wait_for_the_next_repetition() {
    let mut host = driven(quiet_host(), 40, 0);
    sent(&mut host, ms(0));
    host.drive(go(40), ms(30)).unwrap();
    let frames = speeds(&wait(&mut host, ms(560)));
    assert_eq!(frames[4..], [(500_000, 40), (530_000, 0)]);
}

#[test]
fn an_application_that_has_stopped_may_be_silent() {
    let mut host = driven(quiet_host(), 40, 0);
    host.stop(ms(10));
    sent(&mut host, ms(10));
    let frames = wait(&mut host, ms(2000));
    assert!(frames.len() >= 19 && speeds(&frames).iter().all(|(_, speed)| *speed == 0));
    assert!(!events(&mut host).contains(&HostEvent::DeadMan));
}

#[test]
fn a_late_driver_does_not_revive_a_command_that_is_too_old() {
    let mut host = driven(quiet_host(), 40, 0);
    // handle_timeout was not called in between.
    assert_eq!(host.poll_transmit(ms(700)).and_then(speed), Some(0));
    assert_eq!(events(&mut host), [HostEvent::DeadMan]);
}

#[test]
fn a_received_command_is_driven_with_speed_turn_and_lamp_only() {
    let frame = careless(20, -30, 0x0101, 38);
    let Message::MotorControl(received) = message(&frame) else { panic!() };
    let command = MotorControl::try_from(*received).unwrap();
    let mut host = quiet_host();
    host.drive(command, ms(0)).unwrap();
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

#[test]
fn the_first_frame_of_a_host_is_a_zero_motor_command_before_any_ping_or_answer() {
    let mut host = Host::with_store(HostConfig::default(), MemoryStore::default(), ms(0));
    assert_eq!(host.poll_timeout(), Some(ms(0)), "due at once");
    // Everything that could delay it: an acknowledgement, biases, a calibration, the lamp, a ping.
    *host.store_mut() = MemoryStore { imu: Some(imu_bias()), mag: Some(mag_bias()) };
    host.handle_input(&bytes(imu_bias()), ms(1));
    host.handle_input(&bytes(BiasRequest {}), ms(1));
    host.start_calibration(IMU, ms(1)).unwrap();
    host.set_network_state(NetworkState::Connected, ms(1)).unwrap();
    let frames = sent(&mut host, ms(1));
    assert_eq!(frames[0], MotorControl::STOP.frame(0).as_bytes());
    assert_eq!(frames.len(), 6, "the others follow");
}

#[test]
fn the_zero_command_is_repeated_every_100_ms_until_the_first_call() {
    let mut host = fresh_host();
    let at = |millis: u64| (millis * 1000, 0);
    assert_eq!(speeds(&wait(&mut host, ms(350))), [at(0), at(100), at(200), at(300)]);
}

/// Any byte feeds the vendor's watchdog: the robot keeps driving through the pings of a restarted
/// host. It receives a stop, even if the first frame is damaged.
#[test]
fn a_robot_that_drives_on_while_any_byte_arrives_is_stopped_by_a_host_that_was_restarted() {
    let begin = ms(300);
    let mut host = Host::new(HostConfig::default(), begin);
    let (mut driving, mut last_byte, mut is_first) = (70, ms(290), true);
    for at in (300..3000).map(ms) {
        host.handle_timeout(at);
        for frame in sent(&mut host, at) {
            last_byte = at;
            match message(&frame) {
                Message::MotorControl(_) if core::mem::take(&mut is_first) => {}
                Message::MotorControl(command) => driving = command.speed(),
                // Shipped robots answer.
                _ => host.handle_input(&bytes(Pong::new(ErrorCode::Fine)), at),
            }
        }
        if at - last_byte >= Duration::from_millis(500) {
            driving = 0;
        }
        assert!(driving == 0 || at < begin + Duration::from_millis(100), "driving at {at:?}");
    }
}

#[test]
fn a_host_that_only_listens_sends_no_motor_command_before_the_first_call() {
    let mut config = HostConfig::default();
    config.sends_first_stop = false;
    let mut host = Host::new(config, ms(0));
    let mut frames = sent(&mut host, ms(0));
    frames.extend(wait(&mut host, ms(10_000)).into_iter().map(|(_, frame)| frame));
    assert!(frames.len() > 10);
    assert!(frames.iter().all(|frame| is_ping(frame)));
    assert_eq!((host.command(), host.is_stop_sent()), (None, false));
    host.stop(ms(10_000));
    assert_eq!(speeds(&wait(&mut host, ms(10_000))), [(10_000_000, 0)]);
}

#[test]
fn turning_on_the_spot_is_moving() {
    for angular in [-100, -1, 1, 100] {
        let spin = MotorControl::new(0, angular).unwrap();
        assert!(!spin.stands_still());
        let mut host = fresh_host();
        sent(&mut host, ms(0));
        host.drive(spin, ms(30)).unwrap();
        assert!(!host.is_stop_sent());
        sent(&mut host, ms(30));
        assert!(!host.is_stop_sent());
        assert_eq!(host.start_firmware_update(40, ms(30)), Err(CommandError::Moving));
        // The dead-man also ends it, and a stop does not wait for the pause between commands.
        let still = |frame: &[u8]| match message(frame) {
            Message::MotorControl(command) => (command.speed(), command.angular()) == (0, 0),
            _ => false,
        };
        let mut forgotten = host.clone();
        let frames = wait(&mut forgotten, ms(530));
        assert!(still(&frames.last().unwrap().1) && frames.last().unwrap().0 == ms(530));
        assert_eq!(forgotten.statistics().dead_man, 1);
        host.stop(ms(31));
        assert!(still(host.poll_transmit(ms(31)).unwrap()));
        // So does a robot's watchdog.
        let mut robot = quiet_robot();
        robot.handle_input(&bytes(spin), ms(0));
        assert_eq!(robot.command(us(499_999)).angular(), angular);
        assert_eq!(robot.command(ms(500)).angular(), 0);
    }
}

#[test]
fn a_stop_is_sent_once_it_has_been_handed_out() {
    let mut host = fresh_host();
    assert!(!host.is_stop_sent(), "the first frame is still due");
    sent(&mut host, ms(0));
    assert!(host.is_stop_sent());
    host.drive(go(40), ms(50)).unwrap();
    assert!(!host.is_stop_sent());
    sent(&mut host, ms(50));
    host.stop(ms(51));
    assert!(!host.is_stop_sent(), "requested");
    sent(&mut host, ms(51));
    assert!(host.is_stop_sent());
    wait(&mut host, ms(5000));
    host.stop(ms(5000));
    assert!(!host.is_stop_sent(), "a new stop is sent as well");
    // The dead-man's stop also counts.
    host.drive(go(40), ms(6000)).unwrap();
    wait(&mut host, us(6_499_999));
    assert!(!host.is_stop_sent());
    wait(&mut host, ms(6500));
    assert!(host.is_stop_sent());
}

#[test]
fn the_times_of_ruling_u10_are_the_defaults() {
    let host = HostConfig::default();
    let millis = |duration: Duration| duration.as_micros() / 1000;
    assert_eq!((host.baud, host.attempts), (115_200, 3));
    assert_eq!((millis(host.command_period), millis(host.command_gap)), (100, 20));
    assert_eq!((millis(host.dead_man), millis(host.link_timeout)), (500, 500));
    assert_eq!((host.ping_period.map(millis), millis(host.ping_timeout)), (Some(200), 500));
    assert_eq!((millis(host.ack_timeout), millis(host.idle_margin)), (200, 20));
    assert!(host.sends_first_stop && !host.low_ids_only);
    let robot = RobotConfig::default();
    assert_eq!((millis(robot.watchdog), millis(robot.report_period)), (500, 20));
    assert_eq!((millis(robot.result_period), millis(robot.idle_margin)), (1000, 5));
    assert_eq!((robot.bias_request_period.map(millis), robot.baud), (Some(1000), 115_200));
    assert_eq!(robot.layout, ReportLayout::Firmware { version: 38 });
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

#[test]
fn only_a_command_that_moves_the_robot_can_be_outdated_and_only_by_another() {
    let mut host = begun();
    assert!(!host.is_outdated());
    host.drive(go(50), ms(100)).unwrap();
    assert_eq!(speed(host.poll_transmit(ms(100)).unwrap()), Some(50));
    assert!(!host.is_outdated());
    host.drive(go(50), ms(101)).unwrap();
    assert!(!host.is_outdated(), "the same again");
    host.drive(go(51), ms(102)).unwrap();
    assert!(host.is_outdated());
    host.stop(ms(103));
    assert!(host.is_outdated());
    // A stop is right whatever comes after it.
    assert_eq!(speed(host.poll_transmit(ms(103)).unwrap()), Some(0));
    host.drive(go(50), ms(104)).unwrap();
    assert!(!host.is_outdated());
    // Nothing else moves.
    host.set_network_state(NetworkState::Connected, ms(104)).unwrap();
    assert_eq!(host.poll_transmit(ms(104)).unwrap()[4], 10);
    host.stop(ms(105));
    assert!(!host.is_outdated());
}

#[test]
fn a_command_that_the_dead_man_has_ended_is_outdated() {
    let mut host = driven(begun(), 50, 0);
    wait(&mut host, ms(499));
    assert!(!host.is_outdated());
    host.handle_timeout(ms(500));
    assert!(host.is_outdated());
}
