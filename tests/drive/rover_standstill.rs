//! A rover is seen to stand still after its stop, or the call says why not (U16).

use axlewire::ucp::{
    host::{COAST, CommandError, StopProgress},
    message::FirmwareReport,
};

use crate::rig::*;

/// A rover whose wheels turn on for this long after a stop, and that reports what it measures.
fn coasting(span: Duration) -> (World, Rover, Running<Robot>) {
    let (world, rover, robot) = rover(|config| config.rpm_average = Duration::ZERO);
    let (time, actor, mut still_at) = (world.clone(), robot.clone(), at_ms(0));
    world.add(move || {
        let (Ok(mut robot), now) = (actor.try_borrow_mut(), time.now()) else { return };
        if robot.role().command(now).speed() != 0 {
            still_at = now + span;
        }
        let rpm = if now < still_at { [-3; 4] } else { [2; 4] };
        robot.role_mut().set_telemetry(&Telemetry { rpm, ..Telemetry::default() }, now);
    });
    (world, rover, robot)
}

fn not_still(progress: StopProgress) -> Result<(), DriveError<Unplugged>> {
    Err(DriveError::NoStandstill(progress))
}

#[test]
fn a_drive_of_a_rover_that_coasts_for_1500_ms_ends_when_it_stands() {
    for is_async in BOTH {
        let (world, mut rover, _robot) = coasting(ms(1500));
        assert_eq!(call!(is_async, rover, drive_for(40, 0, ms(300))), Ok(()));
        // Three reports later.
        assert!((1840..1890).contains(&(world.now_us() / 1000)), "{:?}", world.now());
        assert_eq!(rover.role().stop_progress(), StopProgress::StandingStill);
    }
}

#[test]
fn a_drive_of_a_rover_that_never_stops_fails_after_3_s_and_repeats_the_stop_all_the_while() {
    for is_async in BOTH {
        let (world, mut rover, robot) = coasting(ms(1_000_000));
        let driven = call!(is_async, rover, drive_for(40, 0, ms(300)));
        assert_eq!(driven, not_still(StopProgress::StillMoving { rpm: [-3; 4] }));
        assert!(
            (0..10).contains(&(world.now() - (at_ms(300) + COAST)).as_micros().div_euclid(1000))
        );
        assert_eq!(robot.borrow().role().command(world.now()), MotorControl::STOP);
        let text = "the robot was not seen to stand still: it was told to stop, but its wheels \
                    turn, at -3, -3, -3 and -3 rpm";
        assert_eq!(driven.unwrap_err().to_string(), text);
    }
}

#[test]
fn a_rover_without_reports_is_no_success_at_the_deadline_and_one_that_is_not_heard_is_not_driven() {
    for (is_async, is_heard) in BOTH.into_iter().flat_map(|it| BOTH.map(|heard| (it, heard))) {
        // It hears everything, and at most answers pings.
        let (near, far) = Port::pair(&World::default(), BYTE_US);
        let _robot = is_heard.then(|| run(Robot::new(RobotConfig::default(), at_ms(0)), far));
        let mut rover = on(Host::new(HostConfig::default(), at_ms(0)), near);
        call!(is_async, rover, stop()).unwrap();
        let deadline = at_ms(400);
        let within = deadline - rover.now();
        let waited = call!(is_async, rover, await_standstill(within));
        assert_eq!((waited, rover.now()), (not_still(StopProgress::NoReports), deadline));
        let driven = call!(is_async, rover, drive_for(40, 0, ms(5000)));
        assert_eq!(driven, not_still(StopProgress::NoReports));
        assert_eq!(rover.now() < at_ms(540) + COAST, !is_heard);
        let unheard = Err(DriveError::Rover(CommandError::LinkDown));
        assert_eq!(rover.drive(40, 0), if is_heard { Ok(()) } else { unheard });
    }
}

#[test]
fn reports_that_arrive_while_a_stop_is_flushed_show_no_standstill_however_late_they_are_read() {
    let averages = [(ms(0), false), (ms(100), false), (ms(100), true)];
    for (is_async, (average, is_moved)) in BOTH.into_iter().flat_map(|it| averages.map(|a| (it, a)))
    {
        let (world, mut rover, robot) = rover(|config| config.rpm_average = average);
        let span = at_ms(200) - rover.now();
        rover.run_for(span, |_, _, _| ()).unwrap();
        robot.borrow().port().unplugged.set(true);
        rover.drive(40, 0).unwrap();
        let span = at_ms(240) - rover.now();
        rover.run_for(span, |_, _, _| ()).unwrap();
        let report = FirmwareReport::new(&Telemetry::default(), 38);
        (0..5).for_each(|index| rover.port().receive(report.frame(index).as_bytes()));
        rover.port_mut().flushes = [Step::Blocks(100_000)].into();
        call!(is_async, rover, stop()).unwrap();
        world.step(10_000 + u64::from(average.as_micros()));
        if is_moved {
            rover = in_another_driver(rover);
        }
        let waited = call!(is_async, rover, await_standstill(ms(300)));
        assert_eq!(waited, not_still(StopProgress::NoReports), "async {is_async}, {average:?}");
    }
}

#[test]
fn without_a_stop_the_wait_for_a_standstill_ends_at_once() {
    for is_async in BOTH {
        let (world, mut rover, _robot) = coasting(ms(0));
        rover.drive(1, 0).unwrap();
        let deadline = at_ms(5000);
        let within = deadline - rover.now();
        let waited = call!(is_async, rover, await_standstill(within));
        assert_eq!(waited, not_still(StopProgress::NotAsked));
        assert!(world.now() < at_ms(10));
    }
}

#[test]
fn the_wait_for_a_standstill_goes_through_errors_of_the_port_and_ends_with_the_last() {
    for (is_async, is_gone) in BOTH.into_iter().flat_map(|it| BOTH.map(|gone| (it, gone))) {
        let (world, mut rover, _robot) = coasting(ms(100));
        rover.drive(40, 0).unwrap();
        let span = at_ms(100) - rover.now();
        rover.run_for(span, |_, _, _| ()).unwrap();
        rover.stop().unwrap();
        rover.port_mut().reads.extend([Step::Error, Step::Error]);
        rover.port().unplugged.set(is_gone);
        let deadline = at_ms(1000);
        let within = deadline - rover.now();
        let waited = call!(is_async, rover, await_standstill(within));
        assert_eq!(waited, if is_gone { Err(GONE) } else { Ok(()) });
        assert_eq!(world.now() >= deadline, is_gone);
    }
}

#[test]
fn a_dropped_wait_for_a_standstill_goes_on_in_the_next() {
    let (world, mut rover, robot) = coasting(ms(150));
    assert!(
        world.poll_times(6000, rover.asynch().drive_for(40, 0, ms(100))).is_none(),
        "it coasts"
    );
    assert!(robot.borrow().role().command(world.now()).stands_still());
    let mut waits = 0;
    let within = at_ms(5000) - rover.now();
    while world.poll_times(50, rover.asynch().await_standstill(within)).is_none() {
        waits += 1;
    }
    assert!(waits > 3 && world.now() < at_ms(400), "{waits}, {:?}", world.now());
}

#[test]
fn after_a_failed_flush_a_stop_is_ok_once_two_whole_copies_are_flushed() {
    for is_async in BOTH {
        for failures in 1..4 {
            let mut rover = host();
            rover.drive(60, 0).unwrap();
            let before = rover.port().written.len();
            rover.port_mut().flushes.extend(vec![Step::Error; failures]);
            call!(is_async, rover, stop()).unwrap();
            let (port, stop) = (rover.port(), [0xFD, 0xFF, 20, 0, 2]);
            let stops = port.written[before..].windows(5).filter(|bytes| **bytes == stop);
            assert_eq!((stops.count(), port.flushed_bytes), (1 + 2 * failures, port.written.len()));
        }
    }
}
