//! Settings: the two presets of each role, and the shortest times.

use crate::rig::*;

#[test]
fn the_presets_of_a_role_differ_in_the_pause_that_cuts_off_a_frame_and_in_nothing_else() {
    let margin = Duration::from_millis;
    let (direct, adapter) = (HostConfig::direct(), HostConfig::usb_adapter());
    assert_eq!(HostConfig::default(), adapter);
    assert_eq!((direct.idle_margin, adapter.idle_margin), (margin(1), margin(20)));
    let mut other = direct;
    other.idle_margin = adapter.idle_margin;
    assert_eq!(other, adapter);

    let (direct, adapter) = (RobotConfig::direct(), RobotConfig::usb_adapter());
    assert_eq!(RobotConfig::default(), direct);
    assert_eq!((direct.idle_margin, adapter.idle_margin), (margin(5), margin(20)));
    let mut other = adapter;
    other.idle_margin = direct.idle_margin;
    assert_eq!(other, direct);
}

#[test]
fn a_pause_between_commands_is_short_enough_for_a_stop_to_leave_in_time() {
    let mut config = HostConfig::default();
    config.command_gap = Duration::from_secs(1);
    assert_eq!(Host::new(config, ms(0)).config().command_gap, Duration::from_millis(50));
}

/// The settings that a role really uses.
#[test]
fn every_period_and_timeout_below_a_millisecond_counts_as_one() {
    let (least, below) = (Duration::from_millis(1), Duration::from_micros(999));
    for short in [Duration::ZERO, below] {
        let mut config = HostConfig::default();
        (config.command_period, config.command_gap) = (short, short);
        (config.dead_man, config.ping_period, config.ping_timeout) = (short, Some(short), short);
        (config.link_timeout, config.ack_timeout) = (short, short);
        let host = Host::new(config, ms(0));
        let used = host.config();
        assert_eq!((used.command_period, used.command_gap), (least, least));
        assert_eq!((used.dead_man, used.link_timeout, used.ack_timeout), (least, least, least));
        assert_eq!((used.ping_period, used.ping_timeout), (Some(least), least));

        let mut config = RobotConfig::default();
        (config.watchdog, config.report_period) = (short, short);
        (config.result_period, config.bias_request_period) = (short, Some(short));
        let robot = Robot::new(config, ms(0));
        let used = robot.config();
        assert_eq!((used.watchdog, used.report_period), (least, least));
        assert_eq!((used.result_period, used.bias_request_period), (least, Some(least)));
    }
    let mut config = HostConfig::default();
    (config.ping_period, config.idle_margin) = (None, below);
    assert_eq!(*Host::new(config, ms(0)).config(), config, "and nothing else is changed");
    let mut config = RobotConfig::default();
    (config.bias_request_period, config.idle_margin) = (None, below);
    assert_eq!(*Robot::new(config, ms(0)).config(), config);
}

#[test]
fn a_pause_of_two_bytes_and_the_margin_but_at_least_a_millisecond_cuts_off_a_frame() {
    // Two bytes at 115,200 bit/s take 174 us.
    for (margin_us, pause) in [(0, 1000), (825, 1000), (827, 1001), (1000, 1174), (20_000, 20_174)]
    {
        let (mut host, mut robot) = (quiet_config(), RobotConfig::default());
        host.idle_margin = Duration::from_micros(margin_us);
        (robot.idle_margin, robot.bias_request_period) = (host.idle_margin, None);
        let (mut host, mut robot) = (Host::new(host, ms(0)), Robot::new(robot, ms(0)));
        host.handle_input(&[0xFD, 0xFF], ms(5));
        robot.handle_input(&[0xFD, 0xFF], ms(5));
        let cut_off = us(5000 + pause);
        assert_eq!((host.poll_timeout(), robot.poll_timeout()), (Some(cut_off), Some(cut_off)));
        for at in [us(cut_off.as_micros() - 1), cut_off] {
            host.handle_timeout(at);
            robot.handle_timeout(at);
            let idle = u64::from(at == cut_off);
            assert_eq!((host.counters().idle, robot.counters().idle), (idle, idle));
        }
    }
}

#[test]
fn a_robot_is_held_up_after_20_ms_and_a_host_at_once() {
    assert_eq!(quiet_robot().line_rules().held_up_after, Some(Duration::from_millis(20)));
    assert_eq!(quiet_host().line_rules().held_up_after, Some(Duration::ZERO));
}

#[test]
fn each_time_of_a_host_has_a_setting_of_its_own() {
    let after = Duration::from_millis;
    let mut config = HostConfig::default();
    (config.command_period, config.command_gap) = (after(110), after(30));
    (config.dead_man, config.link_timeout) = (after(400), after(700));
    (config.ping_period, config.ping_timeout) = (Some(after(170)), after(300));
    (config.ack_timeout, config.attempts) = (after(150), 2);
    let mut host = Host::new(config, ms(0));
    host.handle_input(&bytes(BiasRequest {}), ms(0));
    host.drive(go(5), ms(0)).unwrap();
    host.start_calibration(IMU, ms(0)).unwrap();
    let mut told = vec![];
    let mut frames = vec![];
    for at in 0..1000 {
        frames.extend(wait(&mut host, ms(at)));
        told.extend(events(&mut host).into_iter().map(|event| (at, event)));
    }
    let times = |is_it: fn(&[u8]) -> bool| {
        let found = frames.iter().filter(|(_, frame)| is_it(frame));
        found.map(|(at, _)| at.as_micros() / 1000).collect::<Vec<_>>()
    };
    // The stop of the dead-man begins a new series.
    assert_eq!(times(|it| it[4] == 2), [0, 0, 110, 220, 330, 400, 510, 620, 730, 840, 950]);
    assert_eq!(times(is_ping), [0, 300, 600, 900], "no pong: the timeout is longer");
    assert_eq!(times(|it| it[4] == 3), [0, 150]);
    let at = |wanted: fn(&HostEvent) -> bool| {
        told.iter().filter(|(_, event)| wanted(event)).map(|(at, _)| *at).collect::<Vec<_>>()
    };
    assert_eq!(at(|it| *it == HostEvent::DeadMan), [400]);
    assert_eq!(at(|it| *it == HostEvent::LinkDown), [700]);
    // Twice the 9 bytes of the request and 150 ms.
    assert_eq!(at(|it| matches!(it, HostEvent::CalibrationFailed(_))), [302]);

    // Pongs are answered at once: the period counts. Different commands keep the gap.
    let mut host = Host::new(config, ms(0));
    let mut pings = vec![];
    for at in 0..400 {
        for (at, _) in wait(&mut host, ms(at)).iter().filter(|(_, frame)| is_ping(frame)) {
            pings.push(at.as_micros() / 1000);
            host.handle_input(&bytes(Pong::new(ErrorCode::Fine)), *at);
        }
    }
    assert_eq!(pings, [0, 170, 340]);
    host.drive(go(1), ms(1000)).unwrap();
    sent(&mut host, ms(1000));
    host.drive(go(2), ms(1001)).unwrap();
    assert_eq!(speeds(&wait(&mut host, ms(1039))), [(1_030_000, 2)]);
}

#[test]
fn a_host_with_zero_periods_pings_and_requests_once_a_millisecond() {
    let mut config = quiet_config();
    (config.ping_period, config.ack_timeout) = (Some(Duration::ZERO), Duration::ZERO);
    let mut host = Host::new(config, ms(0));
    assert!(is_ping(&sent(&mut host, ms(0))[0]));
    host.handle_input(&bytes(Pong::new(ErrorCode::Fine)), ms(0));
    assert_eq!(sent(&mut host, ms(0)), [[0; 0]; 0]);
    let next = wait(&mut host, ms(1));
    assert_eq!(next.iter().map(|it| it.0).collect::<Vec<_>>(), [ms(1)]);

    config.ping_period = None;
    for attempts in [0, 1, 3] {
        config.attempts = attempts;
        let mut host = Host::new(config, ms(0));
        host.start_calibration(IMU, ms(0)).unwrap();
        let asked = sent(&mut host, ms(0)).len() + wait(&mut host, ms(100)).len();
        assert_eq!(asked, usize::from(attempts.max(1)));
        let bound = config.calibration_bound().as_micros();
        // Its 9 bytes, and a millisecond for the answer.
        assert_eq!(bound, (9 * 10_000_000 / BAUD + 1 + 1000) * u32::from(attempts.max(1)));
    }
}

/// The frame of a start request, from which the bound is computed.
#[test]
fn the_calibration_bound_is_that_of_the_frames_that_are_sent() {
    assert_eq!(FrameOf::<CalibrationStart>::LEN, FrameOf::<CalibrationEnd>::LEN);
    let mut config = HostConfig::default();
    config.attempts = 5;
    config.ack_timeout = Duration::from_millis(50);
    let one = wire_time(FrameOf::<CalibrationStart>::LEN, BAUD) + Duration::from_millis(50);
    assert_eq!(config.calibration_bound(), one.saturating_mul(5));
}
