//! The robot behind a driver: which command is in force.

use std::{pin::pin, task::Poll};

use embedded_io::Write;

use crate::{
    port::{Port, Step, World, poll},
    rig::On,
    rover_rig::*,
};

/// A robot whose application drives at 50 and was then held up for 400 ms, during which twenty
/// commands arrived, then this one.
fn held_up(last: i16) -> (World, On<Robot, Port, World>, Port) {
    let world = World::default();
    let (near, mut far) = Port::pair(&world, 87);
    let robot = Robot::new(RobotConfig::default(), world.now());
    let mut robot = On::new(robot, near, world.clone());
    far.write(&bytes(go(50))).unwrap();
    let within = ms(100) - robot.now();
    let command = robot.next_command(within).unwrap();
    assert_eq!(command.map(|command| command.speed()), Some(50));
    for speed in 60..80 {
        far.write(&bytes(go(speed))).unwrap();
        world.step(20_000);
    }
    far.write(&bytes(go(last))).unwrap();
    world.step(5000);
    (world, robot, far)
}

#[test]
fn the_command_that_is_handed_out_after_a_pause_is_the_one_in_force() {
    let (world, mut robot, _far) = held_up(33);
    let command =
        robot.next_command(Duration::from_millis(100)).unwrap().map(|command| command.speed());
    assert_eq!(robot.role().command(world.now()).speed(), 33);
    assert_eq!(command, Some(33), "a replaced command is handed out");
}

#[test]
fn a_stop_is_handed_out_however_many_commands_came_before_it() {
    for is_async in [false, true] {
        let (world, mut robot, mut far) = held_up(0);
        let mut speed = 50;
        for _ in 0..30 {
            far.write(&bytes(go(0))).unwrap();
            let deadline = world.now() + Duration::from_millis(100);
            let within = deadline - robot.now();
            let command = match is_async {
                true => world.block_on(robot.asynch().next_command(within)),
                false => robot.next_command(within),
            };
            speed = command.unwrap().map_or(speed, |command| command.speed());
        }
        assert_eq!(robot.role().command(world.now()).speed(), 0);
        assert_eq!(speed, 0, "the application keeps driving after a stop");
    }
}

/// When an application that waits for commands, for so long at a time, is told, in microseconds,
/// that its robot stands still, if the last command came at 0, and each write and flush of its
/// reports takes this long, for so many bytes at most.
fn told_to_stand_still(is_async: bool, write_us: u64, most: usize, call_ms: u32) -> u64 {
    let world = World::default();
    let (mut near, mut far) = Port::pair(&world, 87);
    *near.writer.borrow_mut() = Some(Box::new(move |_| Step::Late(write_us)));
    near.flushes.extend(vec![Step::Late(write_us); 1000]);
    near.most = most;
    let mut robot = Robot::new(RobotConfig::default(), world.now());
    robot.set_telemetry(&Telemetry::default(), world.now());
    let mut robot = On::new(robot, near, world.clone());
    far.write(&bytes(go(50))).unwrap();
    // A pong that waits behind a report, and is due all the time.
    far.write(&bytes(Ping {})).unwrap();
    let mut speed = 0;
    while speed != 0 || world.now_us() < 10_000 {
        let deadline = world.now() + Duration::from_millis(call_ms);
        let within = deadline - robot.now();
        let command = match is_async {
            true => world.block_on(robot.asynch().next_command(within)),
            false => robot.next_command(within),
        };
        speed = command.unwrap_or_default().map_or(speed, |command| command.speed());
        assert!(world.now_us() < 5_000_000 && (speed == 0 || speed == 50));
        world.step(100);
    }
    world.now_us()
}

#[test]
fn through_a_slow_port_an_application_hears_of_the_watchdog_in_time() {
    // The command has come after its 24 bytes.
    const DUE_US: u64 = 500_000 + 24 * 87;
    for (write_us, most, call_ms) in
        [1000, 5000, 6000, 9900, 12_000, 19_000, 100_000, 900_000].into_iter().flat_map(|it| {
            [(1, 20), (20, 20), (64, 0), (64, 20), (64, 10_000)].map(|(most, ms)| (it, most, ms))
        })
    {
        let told_us = told_to_stand_still(true, write_us, most, call_ms);
        let late_us = told_us.saturating_sub(DUE_US);
        assert!(late_us < 50_000, "async, {write_us} us, {most} bytes, {call_ms} ms: {late_us} us");
        // Nothing can be done while a write or a flush blocks, of this frame and of one that is
        // due.
        let told_us = told_to_stand_still(false, write_us, most, call_ms);
        let late_us = told_us.saturating_sub(DUE_US);
        assert!(late_us < 13_000 + 4 * write_us, "{write_us} us, {most} bytes: {late_us} us");
    }
}

#[test]
fn an_event_that_moves_the_robot_is_not_told_behind_its_watchdog() {
    for is_async in [false, true] {
        let world = World::default();
        let (mut near, mut far) = Port::pair(&world, 87);
        near.flushes.push_back(Step::Blocks(700_000));
        let mut robot = On::new(Robot::new(RobotConfig::default(), world.now()), near, world);
        let world = robot.port().world.clone();
        far.write(&bytes(go(50))).unwrap();
        far.write(&bytes(Ping {})).unwrap();
        world.step(10_000);
        let deadline = world.now();
        let within = deadline - robot.now();
        let told = match is_async {
            true => world.block_on(robot.asynch().next_event(within)),
            false => robot.next_event(within),
        };
        assert_eq!(told.unwrap(), Some(RobotEvent::Motor(go(0))), "async {is_async}");
        assert_eq!(robot.poll_event(), Some(RobotEvent::Watchdog));
    }
}

#[test]
fn commands_that_arrive_while_a_report_is_flushed_are_taken_whatever_parts_it_is_sent_in() {
    for (is_async, most) in [false, true].into_iter().flat_map(|it| [(it, 16), (it, 1000)]) {
        let world = World::default();
        let (mut near, mut far) = Port::pair(&world, 260);
        (near.most, near.drains) = (most, true);
        let mut config = RobotConfig::default();
        config.baud = 38_400;
        let mut robot = On::new(Robot::new(config, world.now()), near, world.clone());
        let now = world.now();
        robot.role_mut().set_telemetry(&Telemetry::default(), now);
        for turn in 0..100 {
            far.write(&bytes(go(turn))).unwrap();
            let end = world.now() + Duration::from_micros(25_100);
            let span = end - robot.now();
            let run = match is_async {
                true => world.block_on(robot.asynch().run_for(span, |_, _, _| ())),
                false => robot.run_for(span, |_, _, _| ()),
            };
            run.unwrap();
        }
        let commands = robot.role().statistics().commands;
        assert_eq!((commands, robot.role().counters().skipped()), (100, 0), "{is_async}, {most}");
    }
}

#[test]
fn an_application_whose_calls_are_all_dropped_hears_of_the_watchdog() {
    let world = World::default();
    let (mut near, mut far) = Port::pair(&world, 87);
    near.writes.extend(vec![Step::Stall; 1000]);
    let mut robot = Robot::new(RobotConfig::default(), world.now());
    robot.set_telemetry(&Telemetry::default(), world.now());
    let mut robot = On::new(robot, near, world.clone());
    far.write(&bytes(go(50))).unwrap();
    let mut told = vec![];
    while world.now_us() < 1_000_000 {
        {
            let mut call = pin!(robot.asynch().next_command(Duration::from_millis(1000)));
            if let Poll::Ready(command) = poll(call.as_mut()) {
                told.push((world.now_us(), command.unwrap().unwrap().speed()));
            }
        }
        world.step(10_000);
    }
    assert!(matches!(told[..], [(10_000, 50), (500_000..520_000, 0)]), "{told:?}");
}

#[test]
fn a_command_that_arrives_before_a_read_fails_is_told_through_a_slow_port_too() {
    for is_event in [false, true] {
        let world = World::default();
        let mut port = Port::new(&world, 87);
        port.writes.extend(vec![Step::Stall; 4]);
        let mut robot = Robot::new(RobotConfig::default(), world.now());
        robot.set_telemetry(&Telemetry::default(), world.now());
        let mut robot = On::new(robot, port, world.clone());
        assert!(poll(pin!(robot.asynch().next_command(Duration::ZERO))).is_pending());
        robot.port_mut().reads.extend([Step::Bytes(bytes(go(50))), Step::Error]);
        let deadline = world.now();
        if is_event {
            let within = deadline - robot.now();
            assert!(world.block_on(robot.asynch().next_event(within)).is_err());
            let within = deadline - robot.now();
            let event = world.block_on(robot.asynch().next_event(within));
            assert_eq!(event, Ok(Some(RobotEvent::Motor(go(50)))));
        } else {
            let within = deadline - robot.now();
            let command = world.block_on(robot.asynch().next_command(within));
            assert_eq!(command, Ok(Some(go(50))));
        }
    }
}
