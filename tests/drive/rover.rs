//! High-level calls on a rover link: what pings, commands, stops and calibrations return, and when.

use std::{cell::RefCell, mem::ManuallyDrop, rc::Rc};

use axlewire::{
    stream::Frames,
    ucp::{
        Telemetry, Ucp,
        host::{CalibrationStep, FailureCause, HostEvent, Link},
        message::{FirmwareReport, NetworkState},
    },
};

use crate::rig::*;

/// Calls the host this many times, this many microseconds apart.
fn run(world: &World, rover: &mut Rover, times: u32, pause_us: u64) {
    for _ in 0..times {
        rover.service().unwrap();
        world.step(pause_us);
    }
}

/// The rover as it is.
fn story() -> (World, Rover, Running<Robot>) {
    rover(|_| ())
}

fn after(world: &World, millis: u32) -> Instant {
    world.now() + ms(millis)
}

#[test]
fn a_ping_comes_back_with_its_round_trip() {
    for is_async in BOTH {
        let (_, mut rover, _) = story();
        let trip = call!(is_async, rover, ping(ms(700)));
        // 8 bytes there, 9 back, and up to one report before the pong.
        let micros = u64::from(trip.unwrap().as_micros());
        assert!((17 * BYTE_US..70 * BYTE_US).contains(&micros), "{micros}");
        assert_eq!(rover.role().link(), Link::Up);
        // Events unrelated to the ping have been kept.
        assert_eq!(rover.poll_event(), Some(HostEvent::LinkUp));
    }
}

#[test]
fn an_earlier_pong_is_not_the_answer_to_a_ping() {
    for is_async in BOTH {
        let (world, mut rover, robot) = story();
        run(&world, &mut rover, 500, 20);
        assert_eq!(rover.role().statistics().round_trip.count(), 1);
        robot.borrow().port().unplugged.set(true);
        let pong = call!(is_async, rover, ping(ms(700)));
        assert_eq!(pong, Err(DriveError::Timeout(Operation::Ping)));
    }
}

#[test]
fn a_ping_whose_port_fails_at_once_leaves_the_events_that_wait() {
    for is_async in BOTH {
        let (world, mut rover, _) = story();
        run(&world, &mut rover, 500, 20);
        rover.port_mut().reads.push_back(Step::Error);
        let pong = call!(is_async, rover, ping(ms(700)));
        assert!(matches!(pong, Err(DriveError::Port(_))), "{pong:?}");
        let told: Vec<_> = events(&mut rover);
        assert!(told.iter().any(|event| matches!(event, HostEvent::Pong { .. })), "{told:?}");
    }
}

#[test]
fn a_robot_that_never_answers_is_a_timeout_and_a_lost_link() {
    for is_async in BOTH {
        let (world, mut rover, robot) = story();
        robot.borrow_mut().port().unplugged.set(true);
        let deadline = after(&world, 700);
        let within = deadline - rover.now();
        let error = call!(is_async, rover, ping(within)).unwrap_err();
        assert_eq!(error, DriveError::Timeout(Operation::Ping));
        assert_eq!(error.to_string(), "the robot did not answer a ping in time");
        assert_eq!(world.now(), deadline);
        assert_eq!(rover.poll_event(), Some(HostEvent::LinkDown));
    }
}

#[test]
fn driving_reaches_the_robot_and_a_stop_is_on_the_line_when_it_returns() {
    for is_async in BOTH {
        let (world, mut rover, robot) = story();
        let commanded = || robot.borrow().role().command(world.now());
        call!(is_async, rover, drive(60, -20)).unwrap();
        // The host's first frame, which is zero, and the command: 48 bytes.
        world.pass(8000);
        assert_eq!((commanded().speed(), commanded().angular()), (60, -20));
        // Without calling the driver again.
        call!(is_async, rover, stop()).unwrap();
        world.pass(4000);
        assert_eq!((commanded().speed(), commanded().angular()), (0, 0));
    }
}

#[test]
fn driving_does_not_change_the_lamp() {
    let (world, mut rover, _) = story();
    let lit = MotorControl::new(10, 0).unwrap().with_front_led(true);
    rover.role_mut().drive(lit, world.now()).unwrap();
    rover.drive(20, 0).unwrap();
    assert_eq!(
        rover.role().command(),
        Some(MotorControl::new(20, 0).unwrap().with_front_led(true))
    );
    // Nor does a stop in between.
    rover.stop().unwrap();
    rover.drive(30, 0).unwrap();
    let lit = MotorControl::new(30, 0).unwrap().with_front_led(true);
    assert_eq!(rover.role().command(), Some(lit));
}

#[test]
fn a_command_taken_leaves_the_other_events_of_a_robot() {
    let (world, mut rover, robot) = story();
    let state = NetworkState::from(2);
    rover.role_mut().set_network_state(state, world.now()).unwrap();
    rover.drive(10, 0).unwrap();
    assert_eq!(rover.run_for(ms(100), |_, _, _| ()), Ok(()));
    let mut robot = robot.borrow_mut();
    assert_eq!(robot.next_command(Duration::ZERO), Ok(MotorControl::new(10, 0).ok()));
    let events: Vec<_> = events(&mut robot);
    assert!(events.contains(&RobotEvent::NetworkState(state)), "{events:?}");
}

#[test]
fn a_command_out_of_range_is_refused_and_the_previous_one_stays() {
    let (_, mut rover, _) = story();
    rover.drive(20, 0).unwrap();
    let error = rover.drive(101, 0).unwrap_err();
    assert!(matches!(error, DriveError::Value(_)), "{error:?}");
    assert_eq!(error.to_string(), "101 is outside -100..=100");
    assert_eq!(rover.role().command(), Some(MotorControl::new(20, 0).unwrap()));
}

#[test]
fn reports_come_one_by_one_and_in_time() {
    for is_async in BOTH {
        let (world, mut rover, robot) = story();
        for index in 0..10 {
            let report = call!(is_async, rover, next_report(ms(25)));
            let report = report.unwrap().unwrap();
            assert_eq!((report.index, report.lost, report.telemetry.battery_pct), (index, 0, 87));
        }
        robot.borrow_mut().port().unplugged.set(true);
        let deadline = after(&world, 25);
        let within = deadline - rover.now();
        let none = call!(is_async, rover, next_report(within));
        assert_eq!((none, world.now()), (Ok(None), deadline));
    }
}

#[test]
fn a_calibration_is_begun_and_ended_when_the_calls_return() {
    for is_async in BOTH {
        let (world, mut rover, robot) = story();
        let kind = CalibrationKind::Magnetometer;
        let deadline = after(&world, 1000);
        let within = deadline - rover.now();
        call!(is_async, rover, start_calibration(kind, within)).unwrap();
        assert_eq!(robot.borrow().role().calibrating(), Some(kind));
        let within = deadline - rover.now();
        call!(is_async, rover, end_calibration(kind, within)).unwrap();
        assert_eq!(robot.borrow().role().calibrating(), None);
    }
}

#[test]
fn an_outcome_that_came_after_its_call_is_not_an_event_during_the_next() {
    for is_async in BOTH {
        let (world, mut rover, robot) = story();
        let kind = CalibrationKind::Imu;
        let start = |rover: &mut Rover, millis| {
            let deadline = after(&world, millis);
            let within = deadline - rover.now();
            call!(is_async, *rover, start_calibration(kind, within))
        };
        let timeout = Err(DriveError::Timeout(Operation::Calibration));
        assert_eq!(start(&mut rover, 1), timeout);
        run(&world, &mut rover, 100, 200);
        assert_eq!(rover.role().calibration_outcome(), Some(Ok(())));
        robot.borrow().port().unplugged.set(true);
        assert_eq!(start(&mut rover, 1), timeout);
        let told: Vec<_> = events(&mut rover);
        let is_outcome = |event: &HostEvent| matches!(event, HostEvent::CalibrationStarted(_));
        assert!(!told.iter().any(is_outcome), "{told:?}");
    }
}

#[test]
fn a_calibration_without_an_answer_fails_with_the_error_of_its_role() {
    for is_async in BOTH {
        let (world, mut rover, robot) = story();
        robot.borrow_mut().port().unplugged.set(true);
        let kind = CalibrationKind::Imu;
        let bound = world.now() + HostConfig::default().calibration_bound();
        let deadline = bound + ms(100);
        let within = deadline - rover.now();
        let error = call!(is_async, rover, start_calibration(kind, within)).unwrap_err();
        let DriveError::Calibration(failure) = error else { panic!("{error:?}") };
        assert_eq!((failure.step, failure.cause), (CalibrationStep::Start, FailureCause::NoAnswer));
        assert_eq!(error.to_string(), "calibration of Imu did not start: no answer to 3 requests");
        assert!(world.now() < deadline);
        // An earlier deadline takes precedence.
        let deadline = after(&world, 50);
        let within = deadline - rover.now();
        let error = call!(is_async, rover, end_calibration(kind, within)).unwrap_err();
        assert_eq!((error, world.now()), (DriveError::Timeout(Operation::Calibration), deadline));
    }
}

#[test]
fn a_robots_next_command_is_the_next_change_and_the_watchdogs_stop_is_one() {
    for is_async in BOTH {
        let world = World::default();
        let (near, far) = Port::pair(&world, BYTE_US);
        let mut config = HostConfig::default();
        config.sends_first_stop = false;
        let mut host = Host::new(config, world.now());
        let command = MotorControl::new(30, 5).unwrap();
        host.drive(command, world.now()).unwrap();
        let mut host = on(host, near);
        host.service().unwrap();
        let robot = Robot::new(RobotConfig::default(), world.now());
        let mut robot = on(robot, far);
        let mut next = |end| {
            let within = end - robot.now();
            call!(is_async, robot, next_command(within))
        };
        assert_eq!(next(at_ms(100)), Ok(Some(command)));
        assert_eq!(next(at_ms(100)), Ok(None));
        assert_eq!(world.now(), at_ms(100));
        assert_eq!(next(at_ms(1000)), Ok(Some(MotorControl::STOP)));
        assert!(world.now() < at_ms(510));
        assert_eq!(robot.poll_event(), None::<RobotEvent>);
    }
}

#[test]
fn a_dropped_ping_made_again_is_answered_and_cuts_no_frame() {
    dropped_at_any_await(100, |polls| {
        let (world, mut rover, robot) = story();
        (rover.port_mut().most, rover.port_mut().stutters) = (1, true);
        rover.role_mut().drive(MotorControl::new(10, 0).unwrap(), world.now()).unwrap();
        let deadline = after(&world, 2000);
        let within = deadline - rover.now();
        let done = world.poll_times(polls, rover.asynch().ping(within)).is_some();
        let within = deadline - rover.now();
        world.block_on(rover.asynch().ping(within)).unwrap();
        assert_eq!(robot.borrow().role().counters().skipped(), 0, "dropped after {polls} polls");
        assert_eq!(rover.role().counters().skipped(), 0, "dropped after {polls} polls");
        assert_eq!(rover.role().statistics().reports_lost, 0);
        done
    });
}

#[test]
fn a_stop_goes_through_errors_of_the_port_and_is_on_the_line_when_it_returns() {
    for is_async in BOTH {
        let (world, mut rover, robot) = story();
        rover.drive(60, 0).unwrap();
        rover.port().unplugged.set(true);
        let (plug, time) = (rover.port().unplugged.clone(), world.clone());
        world.add(move || plug.set(time.now() < at_ms(70)));
        call!(is_async, rover, stop()).unwrap();
        assert!(world.now() < at_ms(80), "{:?}", world.now());
        // Without calling the driver again.
        world.pass(10_000);
        assert_eq!(robot.borrow().role().command(world.now()).speed(), 0);
    }
}

#[test]
fn driving_for_a_while_keeps_the_command_alive_and_ends_with_a_stop() {
    for is_async in BOTH {
        let (world, mut rover, robot) = story();
        let (speeds, time) = (Rc::new(RefCell::new(vec![])), world.clone());
        let (seen, actor) = (speeds.clone(), robot.clone());
        world.add(move || {
            if let Ok(robot) = actor.try_borrow() {
                seen.borrow_mut().push((time.now(), robot.role().command(time.now()).speed()));
            }
        });
        let span = ms(1200);
        call!(is_async, rover, drive_for(40, 0, span)).unwrap();
        assert!((2300..2390).contains(&(world.now().as_micros() / 1000)));
        world.pass(10_000);
        assert_eq!(robot.borrow().role().command(world.now()).speed(), 0);
        let is_driven =
            |at: &Instant| (at.as_micros() / 1000).clamp(20, 1200) == at.as_micros() / 1000;
        let speeds = speeds.borrow();
        assert!(speeds.iter().filter(|(at, _)| is_driven(at)).all(|(_, speed)| *speed == 40));
    }
}

#[test]
fn a_drive_that_is_dropped_leaves_a_stop_that_the_next_call_sends() {
    for polls in [1, 50, 5000] {
        let (world, mut rover, robot) = story();
        let span = ms(60_000);
        let done = world.poll_times(polls, rover.asynch().drive_for(40, 0, span));
        assert!(done.is_none(), "not dropped");
        assert_eq!(rover.role().command().map(|command| command.speed()), Some(0));
        rover.service().unwrap();
        world.pass(10_000);
        rover.service().unwrap();
        world.pass(10_000);
        assert_eq!(robot.borrow().role().command(world.now()).speed(), 0, "{polls} polls");
    }
}

#[test]
fn a_stop_behind_a_cut_off_frame_goes_twice_although_the_port_refused_one_of_the_two() {
    let port = Port::writing([Step::Few(1), Step::Error, Step::Error]);
    let world = port.world.clone();
    let mut driver = on(Host::new(HostConfig::default(), world.now()), port);
    assert!(driver.service().is_err(), "one byte of the first stop leaves");
    world.step(6_000);
    assert!(driver.service().is_err(), "it is dropped, and no byte of the next leaves");
    driver.stop().unwrap();
    let is_stop = |bytes: &&[u8]| bytes[..5] == [0xFD, 0xFF, 0x14, 0, 2];
    assert_eq!(driver.port().written.windows(24).filter(is_stop).count(), 2);
}

#[test]
fn calls_take_only_frequent_events_and_those_that_they_return() {
    for is_async in BOTH {
        let (world, mut rover, _) = story();
        let kind = CalibrationKind::Imu;
        for _ in 0..10 {
            call!(is_async, rover, ping(ms(700))).unwrap();
        }
        let deadline = after(&world, 700);
        let within = deadline - rover.now();
        call!(is_async, rover, start_calibration(kind, within)).unwrap();
        let within = deadline - rover.now();
        call!(is_async, rover, end_calibration(kind, within)).unwrap();
        call!(is_async, rover, stop()).unwrap();
        let kept = events(&mut rover);
        assert!(kept.contains(&HostEvent::LinkUp), "{kept:?}");
        let is_out = |event: &HostEvent| {
            matches!(
                event,
                HostEvent::Report(_)
                    | HostEvent::Pong { .. }
                    | HostEvent::CalibrationStarted(_)
                    | HostEvent::CalibrationEnded(_)
            )
        };
        assert!(!kept.iter().any(is_out), "{kept:?}");
        assert_eq!(rover.role().lost_events(), 0);
    }
}

#[test]
fn driving_for_a_while_keeps_the_command_alive_whatever_the_dead_man_is() {
    for timeout_ms in [2, 30, 100, 150] {
        for is_async in BOTH {
            let (_, mut rover, _robot) = rover(|config| config.dead_man = ms(timeout_ms));
            call!(is_async, rover, drive_for(40, 0, ms(600))).unwrap();
            assert_eq!(rover.role().statistics().dead_man, 0, "{timeout_ms} ms");
        }
    }
}

#[test]
fn a_call_that_was_leaked_does_not_keep_later_rounds_from_sending() {
    let mut rover = host();
    let world = rover.port().world.clone();
    world.block_on(rover.asynch().service()).unwrap();
    let mut call = ManuallyDrop::new(Box::pin(rover.asynch().drive_for(60, 0, ms(500))));
    assert_eq!(world.poll_times(3, call.as_mut()), None);
    let before = rover.port().written.len();
    for _ in 0..30 {
        world.step(100_000);
        rover.port_mut().writes.push_back(Step::Late(1_500));
        world.block_on(rover.asynch().service()).unwrap();
    }
    assert!(rover.port().written.len() > before + 20 * 24, "the command is repeated, as a stop");
    assert_eq!(rover.role().command().map(|command| command.speed()), Some(0));
}

#[test]
fn an_update_request_that_waits_for_a_slow_port_does_not_leave_once_a_wheel_turns() {
    let mut rover = host();
    let world = rover.port().world.clone();
    let report = |rpm| {
        let telemetry = Telemetry { rpm: [rpm; 4], ..Telemetry::default() };
        FirmwareReport::new(&telemetry, 38).frame(0).as_bytes().to_vec()
    };
    rover.service().unwrap();
    for _ in 0..15 {
        world.step(100_000);
        rover.port().receive(&report(0));
        world.step(10_000);
        rover.service().unwrap();
    }
    let now = rover.now();
    rover.role_mut().start_firmware_update(50, now).unwrap();
    let before = rover.port().written.len();
    rover.port_mut().writes.extend([Step::Few(24), Step::Few(24)]);
    rover.port_mut().writes.extend(vec![Step::Late(400_000); 40]);
    rover.port().receive(&report(50)); // while the request waits
    for _ in 0..40 {
        let _ = world.block_on(rover.asynch().service());
    }
    let sent = rover.port().written[before..].to_vec();
    assert!(sent.len() >= 48, "two stops");
    assert!(Frames::<Ucp>::new(&sent).all(|frame| frame.id() != 9));
}
