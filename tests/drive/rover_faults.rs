//! A rover's link: stops cut by a port, failing receivers and transmitters, robots held up.

use axlewire::ucp::{FrameOf, Telemetry, message::FirmwareReport};
use embedded_io::{Read, ReadReady, Write};

use crate::{motor_line::Wire, rig::*};

/// A host that has driven, and a moment later.
fn host() -> (Wire, On<Host>) {
    let wire = Wire::link();
    let mut host = wire.driver(|now| Host::new(HostConfig::default(), now));
    host.service().unwrap();
    wire.world.step(30_000);
    host.drive(60, 0).unwrap();
    wire.world.step(30_000);
    (wire, host)
}

fn robot() -> (Wire, On<Robot>) {
    let wire = Wire::link();
    let mut robot = wire.driver(|now| Robot::new(RobotConfig::default(), now));
    robot.service().unwrap();
    (wire, robot)
}

fn drive() -> Vec<u8> {
    MotorControl::new(60, 0).unwrap().frame(0).as_bytes().to_vec()
}

/// How long after the last byte sent a robot that receives all of it still drives.
fn robot_drives_on(wire: &Wire) -> Duration {
    let sent = &wire.sent();
    let mut robot = Robot::new(RobotConfig::default(), Instant::from_micros(0));
    let (mut bytes, mut drove) = (sent.iter().peekable(), Instant::from_micros(0));
    let last = sent.last().unwrap().0;
    for now_us in (0..last + 2_000_000).step_by(50) {
        let now = Instant::from_micros(now_us);
        while let Some(&(at, byte)) = bytes.next_if(|&&(at, _)| at <= now_us) {
            robot.handle_input(&[byte], Instant::from_micros(at));
        }
        if robot.poll_timeout().is_some_and(|due| now >= due) {
            robot.handle_timeout(now);
        }
        if robot.command(now).speed() != 0 {
            drove = now;
        }
    }
    assert!(drove > Instant::from_micros(0), "it never drove");
    drove - Instant::from_micros(last)
}

#[test]
fn a_cut_off_command_is_not_completed_by_the_call_that_stops() {
    for is_async in [false, true] {
        let (wire, mut host) = host();
        wire.write_only(10);
        assert!(host.drive(99, 0).is_err());
        let cut = wire.sent().len();
        wire.write_all();
        call!(is_async, host, stop()).unwrap();
        let sent: Vec<u8> = wire.sent()[cut..].iter().map(|&(_, byte)| byte).collect();
        let stop = FrameOf::<MotorControl>::LEN;
        assert_eq!(sent.len(), 2 * stop, "the rest of the command was sent, or only one stop");
        for frame in sent.chunks(stop) {
            assert_eq!(frame[..5], [0xFD, 0xFF, 20, 0, 2]);
            assert_eq!(frame[6..10], [0; 4]);
        }
    }
}

#[test]
fn a_stop_of_which_a_part_has_left_is_sent_twice_through_a_reopened_port() {
    for is_async in [false, true] {
        let (wire, mut host) = host();
        let now = host.now();
        host.role_mut().stop(now);
        wire.write_only(10);
        assert!(host.service().is_err());
        let cut = wire.sent().len();
        wire.write_all();
        let mut host = in_another_driver(host);
        call!(is_async, host, stop()).unwrap();
        let sent: Vec<u8> = wire.sent()[cut..].iter().map(|&(_, byte)| byte).collect();
        let stop = FrameOf::<MotorControl>::LEN;
        assert_eq!(sent.len(), 2 * stop);
        assert!(sent.chunks(stop).all(|frame| frame[6..10] == [0; 4]));
    }
}

#[test]
fn a_stop_whose_first_part_was_flushed_alone_is_sent_twice_more_unless_its_rest_leaves_in_time() {
    for (flush_us, is_late) in [(1000, false), (4500, true), (100_000, true)] {
        for is_async in [false, true] {
            let (wire, mut host) = host();
            let now = host.now();
            host.role_mut().stop(now);
            let before = wire.sent().len();
            wire.write_as([Step::Few(10), Step::Error]);
            assert!(host.service().is_err());
            wire.world.step(3000);
            host.port_mut().flushes = [Step::Blocks(flush_us)].into();
            call!(is_async, host, stop()).unwrap();
            // The call adds a stop of its own.
            let copies = if is_late { 3 } else { 2 };
            assert_eq!(
                wire.sent().len() - before,
                copies * FrameOf::<MotorControl>::LEN,
                "{flush_us} us"
            );
        }
    }
}

#[test]
fn a_stop_is_sent_again_once_its_port_was_replaced() {
    for (is_async, is_moved) in BOTH.into_iter().flat_map(|it| BOTH.map(|moved| (it, moved))) {
        let (wire, mut host) = host();
        call!(is_async, host, stop()).unwrap();
        let before = wire.sent().len();
        if is_moved {
            host = in_another_driver(host);
        } else {
            host.discard();
        }
        call!(is_async, host, stop()).unwrap();
        assert_eq!(wire.sent().len() - before, 2 * FrameOf::<MotorControl>::LEN);
    }
}

#[test]
fn behind_a_failed_flush_no_rest_of_a_stop_is_sent() {
    for is_async in [false, true] {
        let (wire, mut host) = host();
        let now = host.now();
        host.role_mut().stop(now);
        let cut = wire.sent().len() + 10;
        wire.write_as([Step::Few(10), Step::Error]);
        host.port_mut().flushes = [Step::Error].into();
        assert!(host.service().is_err());
        call!(is_async, host, stop()).unwrap();
        let sent: Vec<u8> = wire.sent()[cut..].iter().map(|&(_, byte)| byte).collect();
        let copies = sent.chunks(FrameOf::<MotorControl>::LEN);
        assert_eq!(copies.map(|it| it.starts_with(&[0xFD, 0xFF])).collect::<Vec<_>>(), [true; 2]);
    }
}

#[test]
fn a_stop_that_a_port_cut_in_two_is_sent_again() {
    let fails_10_ms = [Step::Few(10)].into_iter().chain(vec![Step::Error; 10]);
    let pauses = [
        fails_10_ms.collect(),
        vec![Step::Few(10), Step::Blocks(50_000)],
        vec![Step::Drains(10, 30_000)],
        vec![Step::Drains(10, 200_000)],
        vec![Step::Few(10), Step::Lags(30_000, 7), Step::Blocks(30_000)],
    ];
    for steps in pauses {
        for is_async in [false, true] {
            let (wire, mut host) = host();
            wire.write_as(steps.iter().cloned());
            let stopped = call!(is_async, host, stop());
            let drives_on = robot_drives_on(&wire);
            let is_true = stopped.is_err() || drives_on <= Duration::from_millis(1);
            assert!(is_true, "{steps:?}: {stopped:?}, but it keeps driving for {drives_on:?}");
        }
    }
}

#[test]
fn a_stop_through_a_port_whose_receiver_fails_is_sent_and_returns_ok() {
    for is_async in [false, true] {
        let (wire, mut host) = host();
        (host.port_mut().is_deaf, host.port_mut().is_blind) = (true, true);
        let begin_us = wire.world.now_us();
        let stopped = call!(is_async, host, stop());
        assert_eq!(stopped, Ok(()), "it was written and flushed");
        assert!(wire.world.now_us() - begin_us < 10_000, "not immediate");
        assert!(robot_drives_on(&wire) <= Duration::from_millis(1));
    }
}

#[test]
fn a_robot_whose_transmitter_fails_still_hears_its_stop() {
    for is_async in [false, true] {
        let (wire, mut robot) = robot();
        let (mut speeds, mut errors) = (vec![], 0);
        for millis in 0..1000 {
            if millis % 100 == 0 {
                let stop = MotorControl::STOP.frame(1).as_bytes().to_vec();
                wire.receive(&if millis < 500 { drive() } else { stop });
            }
            if millis == 300 {
                wire.write_only(0);
            }
            if millis % 20 == 0 {
                let now = robot.now();
                robot.role_mut().set_telemetry(&Telemetry::default(), now);
            }
            let command = call!(is_async, robot, next_command(Duration::from_millis(1)));
            match command {
                Ok(Some(command)) => speeds.push(command.speed()),
                Ok(None) => {}
                Err(error) => {
                    assert_eq!(error, DriveError::Port(Unplugged));
                    errors += 1;
                    wire.world.step(1000);
                }
            }
        }
        assert!(errors > 0, "the transmitter never failed");
        assert_eq!(speeds, [60, 0], "the application is not told of the stop");
    }
}

#[test]
fn bytes_from_before_a_hold_up_do_not_drive_a_robot() {
    for is_async in [false, true] {
        let (wire, mut robot) = robot();
        wire.receive(&drive());
        wire.world.step(10_000_000);
        let command = call!(is_async, robot, next_command(Duration::from_millis(1)));
        let speed = command.unwrap().map_or(0, |command| command.speed());
        assert_eq!(speed, 0, "it drives on a ten-second-old command");
    }
}

#[test]
fn a_command_that_is_too_old_when_it_is_read_is_not_told_as_one_that_moves() {
    for is_async in [false, true] {
        let (wire, mut robot) = robot();
        let by = robot.now() + Duration::from_millis(5);
        let span = by - robot.now();
        robot.run_for(span, |_, _, _| ()).unwrap();
        wire.receive(&drive());
        wire.world.step(2_000_000);
        let by = robot.now() + Duration::from_millis(5);
        let speed = |_: &mut Robot, event, _| {
            if let RobotEvent::Motor(command) = event {
                assert_eq!((command.speed(), command.angular()), (0, 0));
            }
        };
        let span = by - robot.now();
        call!(is_async, robot, run_for(span, speed)).unwrap();
        assert_eq!(robot.role().statistics().commands, 1, "it was valid");
        assert_eq!(robot.role().statistics().watchdog, 1);
    }
}

/// The next command of a robot that is called continuously, for 5 ms.
fn next(robot: &mut On<Robot>, is_async: bool) {
    call!(is_async, *robot, next_command(Duration::from_millis(5))).unwrap();
}

/// A robot that reports every 20 ms and has been called for a while.
fn reporting(is_async: bool) -> (Wire, On<Robot>) {
    let (wire, mut robot) = robot();
    let now = robot.now();
    robot.role_mut().set_telemetry(&Telemetry::default(), now);
    (0..21).for_each(|_| next(&mut robot, is_async));
    (wire, robot)
}

/// How long after a moment the robot still drives at most, with continuous calls, microseconds.
fn drives_until(robot: &mut On<Robot>, is_async: bool, from_us: u64) -> u64 {
    let mut drove_us = 0;
    for _ in 0..200 {
        next(robot, is_async);
        let now = robot.now();
        if !robot.role().command(now).stands_still() {
            drove_us = now.as_micros() - from_us;
        }
    }
    drove_us
}

#[test]
fn a_command_that_arrives_while_a_write_stalls_is_as_old_as_the_stall() {
    for (is_async, stall_us) in [(false, 3_000_000), (true, 3_000_000), (true, 900_000)] {
        let (wire, mut robot) = reporting(is_async);
        let sent = wire.sent().len();
        let begin_us = wire.world.now_us();
        wire.write_as([Step::Blocks(stall_us)]);
        // The next report is due within 20 ms.
        wire.receive_in(25_000, &drive());
        let drove_us = drives_until(&mut robot, is_async, begin_us);
        assert!(wire.sent().len() > sent, "no report was sent");
        assert!(wire.world.now_us() > begin_us + stall_us, "the write did not stall");
        assert!(drove_us <= 525_000, "async {is_async}: until {drove_us} us after the command");
    }
}

#[test]
fn commands_that_wait_while_the_executor_is_held_are_all_as_old_as_the_hold_up() {
    for count in 1..=4 {
        let (wire, mut robot) = reporting(true);
        let begin_us = wire.world.now_us();
        let bytes = drive().repeat(count);
        wire.block_on_held(
            robot.asynch().next_command(Duration::from_millis(100)),
            &bytes,
            3_000_000,
        )
        .unwrap();
        let drove_us = drives_until(&mut robot, true, begin_us);
        assert!(drove_us <= 500_000, "{count} commands: until {drove_us} us after they arrived");
    }
}

#[test]
fn more_commands_than_a_round_takes_in_are_all_as_old_as_the_hold_up() {
    for (is_async, count) in [(false, 171), (false, 400), (true, 200), (true, 3000)] {
        let (wire, mut robot) = reporting(is_async);
        let begin_us = wire.world.now_us();
        wire.receive(&drive().repeat(count));
        wire.world.step(10_000_000);
        let drove_us = drives_until(&mut robot, is_async, begin_us);
        assert!(drove_us <= 500_000, "{count} commands: until {drove_us} us after they arrived");
    }
}

/// A robot that neither reports nor requests biases.
fn silent() -> (Wire, On<Robot>) {
    let wire = Wire::link();
    let mut config = RobotConfig::default();
    config.bias_request_period = None;
    let mut robot = wire.driver(|now| Robot::new(config, now));
    robot.service().unwrap();
    (wire, robot)
}

#[test]
fn a_robot_without_reports_that_was_held_up_does_not_drive_on_old_commands() {
    for is_async in [false, true] {
        let (wire, mut robot) = silent();
        let begin_us = wire.world.now_us();
        wire.receive(&drive());
        wire.world.step(10_000_000);
        let drove_us = drives_until(&mut robot, is_async, begin_us);
        assert_eq!(drove_us, 0, "async {is_async}: it drives on a ten-second-old command");
    }
}

#[test]
fn a_robot_without_reports_drives_for_500_ms_on_a_command_after_a_long_silence() {
    for is_async in [false, true] {
        let (wire, mut robot) = silent();
        let begin_us = wire.world.now_us();
        wire.receive_in(3_000_000, &drive());
        let command = call!(is_async, robot, next_command(Duration::from_millis(10_000)));
        assert_eq!(command.unwrap().map(|command| command.speed()), Some(60));
        let drove_us = drives_until(&mut robot, is_async, begin_us + 3_000_000);
        assert!((485_000..=500_000).contains(&drove_us), "async {is_async}: {drove_us} us");
    }
}

#[test]
fn a_stop_that_a_held_up_robot_finds_half_arrived_is_not_lost() {
    let (wire, mut robot) = silent();
    wire.receive(&drive());
    robot.service().unwrap();
    let stop = MotorControl::STOP.frame(1).as_bytes().to_vec();
    wire.world.step(30_000);
    wire.receive(&stop[..10]);
    robot.service().unwrap();
    wire.receive(&stop[10..]);
    robot.service().unwrap();
    let now = robot.now();
    assert!(robot.role().command(now).stands_still(), "the delay cut a stop in two");
}

#[test]
fn one_wrong_reading_of_the_clock_does_not_end_the_watchdog_of_a_robot() {
    let (wire, mut robot) = robot();
    wire.world.glitch(0, 1 << 32);
    robot.service().unwrap();
    wire.receive(&drive());
    robot.service().unwrap();
    let now = robot.now();
    assert_eq!(robot.role().command(now).speed(), 60);
    wire.world.step(60_000_000);
    robot.service().unwrap();
    let now = robot.now();
    assert_eq!(
        robot.role().command(now).speed(),
        0,
        "still driving a minute after the last command"
    );
}

#[test]
fn a_stop_leaves_on_a_slow_link_through_a_port_that_takes_a_few_bytes_at_a_time() {
    for count in [4, 8, 12, 24] {
        let wire = Wire::new(1042, None);
        let mut config = HostConfig::default();
        config.baud = 9600;
        let mut host = wire.driver(|now| Host::new(config, now));
        host.drive(60, 0).unwrap();
        wire.write_with(move |_| Step::Drains(count, 0));
        assert_eq!(host.stop(), Ok(()), "{count} bytes at a time");
        let sent: Vec<u8> = wire.sent().iter().map(|&(_, byte)| byte).collect();
        let last = sent.len() - 24;
        let stop = MotorControl::STOP.frame(sent[last + 5]);
        assert_eq!(sent[last..], *stop.as_bytes());
    }
}

#[test]
fn a_frame_whose_rest_waits_behind_a_failing_receiver_is_not_given_up() {
    for errors in [1, 5, 15] {
        for is_async in BOTH {
            let frame = FirmwareReport::new(&Telemetry::default(), 38).frame(0);
            let (front, rest) = frame.as_bytes().split_at(20);
            let mut port = Port::new(&World::default(), BYTE_US);
            port.reads.push_back(Step::Bytes(front.into()));
            port.reads.extend(vec![Step::Error; errors]);
            port.reads.push_back(Step::Bytes(rest.into()));
            let mut host = on(Host::new(HostConfig::direct(), at_ms(0)), port);
            for _ in 0..errors + 2 {
                let _ = call!(is_async, host, service());
                host.port().world.step(1_000);
            }
            assert_eq!(host.role().statistics().reports, 1, "{errors} errors, async {is_async}");
        }
    }
}

/// A port that says what it held when it was asked, 1.5 ms later.
struct LateAnswers(Port);

impl embedded_io::ErrorType for LateAnswers {
    type Error = Unplugged;
}

impl ReadReady for LateAnswers {
    fn read_ready(&mut self) -> Result<bool, Unplugged> {
        let is_ready = self.0.read_ready();
        self.0.world.step(1_500);
        is_ready
    }
}

impl Read for LateAnswers {
    fn read(&mut self, buffer: &mut [u8]) -> Result<usize, Unplugged> {
        Read::read(&mut self.0, buffer)
    }
}

impl Write for LateAnswers {
    fn write(&mut self, bytes: &[u8]) -> Result<usize, Unplugged> {
        Write::write(&mut self.0, bytes)
    }

    fn flush(&mut self) -> Result<(), Unplugged> {
        Write::flush(&mut self.0)
    }
}

#[test]
fn a_host_that_is_held_up_behind_a_look_gives_up_no_frame_whose_rest_waits_in_the_port() {
    let world = World::default();
    let (near, mut far) = Port::pair(&world, BYTE_US);
    let mut host = Driver::host(HostConfig::direct(), LateAnswers(near), world.clone());
    for index in 0..50 {
        let report = FirmwareReport::new(&Telemetry::default(), 38).frame(index);
        Write::write_all(&mut far, report.as_bytes()).unwrap();
        host.run_for(ms(20), |_, _, _| ()).unwrap();
    }
    assert_eq!(host.role().statistics().reports, 50);
}
