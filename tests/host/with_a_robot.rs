//! A host and a robot on one line: floods, full queues, unplugging, time that wraps, deadlines and
//! memory.

use crate::rig::*;

#[test]
fn a_queue_that_fills_keeps_the_oldest_and_counts_the_rest() {
    let mut robot = quiet_robot();
    for at in 0..=50_u64 {
        robot.handle_input(&bytes(go(at as i16 + 1)), ms(at));
    }
    assert_eq!(robot.command(ms(50)).speed(), 51, "the motors do not depend on the queue");
    let seen = events(&mut robot);
    assert_eq!(seen[0], RobotEvent::Motor(go(1)));
    assert_eq!((seen.len() as u32) + robot.lost_events(), 51);

    let mut host = quiet_host();
    for index in 0..50 {
        let report = FirmwareReport::new(&Telemetry::default(), 38).frame(index);
        host.handle_input(report.as_bytes(), ms(index.into()));
    }
    assert_eq!(host.last_report().unwrap().index, 49, "the latest is kept separately");
    let seen = events(&mut host);
    assert_eq!(seen[0], HostEvent::LinkUp);
    assert_eq!((seen.len() as u32) + host.lost_events(), 51);
}

#[test]
fn endless_garbage_is_reported_as_a_lost_link() {
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
fn unplugging_stops_the_robot_and_is_reported_and_replugging_resumes() {
    let mut rig = Rig::new(ms(0));
    rig.robot.set_telemetry(&Telemetry::default(), rig.now);
    rig.host.set_network_state(NetworkState::Connected, rig.now).unwrap();
    let drive_for = |rig: &mut Rig, millis: u32| {
        for _ in 0..millis / 50 {
            let is_refused = rig.host.drive(go(70), rig.now) == Err(CommandError::LinkDown);
            assert_eq!(is_refused, rig.host.link() == Link::Down);
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
    assert_eq!(rig.robot_has_seen(&RobotEvent::Watchdog), 1);
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
fn spurious_calls_do_nothing() {
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
fn zero_periods_do_not_make_a_driver_spin() {
    let mut config = HostConfig::default();
    config.command_period = Duration::ZERO;
    config.command_gap = Duration::ZERO;
    config.dead_man = Duration::ZERO;
    config.ping_period = Some(Duration::ZERO);
    config.ping_timeout = Duration::ZERO;
    config.link_timeout = Duration::ZERO;
    config.ack_timeout = Duration::ZERO;
    config.attempts = 0;
    config.idle_margin = Duration::ZERO;
    let mut robot_config = RobotConfig::default();
    robot_config.watchdog = Duration::ZERO;
    robot_config.report_period = Duration::ZERO;
    robot_config.result_period = Duration::ZERO;
    robot_config.bias_request_period = Some(Duration::ZERO);
    robot_config.idle_margin = Duration::ZERO;
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
        // Two kinds of frames, at most one of each per millisecond.
        assert!(wait(&mut host, ms(100)).len() <= 250);
        assert!(wait(&mut robot, ms(100)).len() <= 310);
    }
}

#[test]
fn both_roles_say_how_long_a_frame_may_pause_and_takes_on_the_line() {
    fn answers(role: &impl Endpoint) -> (Duration, Duration) {
        (role.line_rules().frame_pause, role.line_rules().wire_time(64))
    }
    let expected = (Duration::from_millis(4), Duration::from_micros(5556));
    assert_eq!(answers(&quiet_host()), expected);
    assert_eq!(answers(&quiet_robot()), expected);
}

#[test]
fn the_roles_fit_into_small_memories() {
    let (host, robot) = (size_of::<Host>(), size_of::<Robot>());
    let (host_event, robot_event) = (size_of::<HostEvent>(), size_of::<RobotEvent>());
    println!("Host {host} bytes, Robot {robot} bytes");
    println!("HostEvent {host_event} bytes, RobotEvent {robot_event} bytes");
    if cfg!(target_arch = "x86_64") {
        let document = include_str!("../../BENCHMARKS.md");
        for size in [format!("`Host` {host} bytes"), format!("`Robot` {robot} bytes")] {
            assert!(document.contains(&size), "BENCHMARKS.md does not say {size}");
        }
    }
    assert!(host <= 2048, "{host}");
    assert!(robot <= 1280, "{robot}");
    assert!(host_event <= 64, "{host_event}");
    assert!(robot_event <= 24, "{robot_event}");
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
