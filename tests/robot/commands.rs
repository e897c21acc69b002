//! The robot obeys valid commands, and stops without them (U10, U13).

use crate::rig::*;

#[test]
fn no_valid_motor_frame_for_500_ms_means_standing_still() {
    let mut robot = quiet_robot();
    let command = MotorControl::new(60, -20).unwrap().with_front_led(true);
    robot.handle_input(&bytes(command), ms(100));
    assert_eq!(events(&mut robot), [RobotEvent::Motor(command)]);
    // Neither noise nor a damaged command nor a ping is a command.
    let mut damaged = bytes(command);
    damaged[9] ^= 0x10;
    for at in [200, 300, 400, 500] {
        robot.handle_input(&[0xFD; 30], ms(at));
        robot.handle_input(&damaged, ms(at));
        robot.handle_input(&bytes(Ping {}), ms(at));
        sent(&mut robot, ms(at));
    }
    wait(&mut robot, us(599_999));
    assert_eq!((robot.command(us(599_999)), events(&mut robot)), (command, vec![]));
    wait(&mut robot, ms(600));
    let still = MotorControl::STOP.with_front_led(true);
    assert_eq!(robot.command(ms(600)), still);
    assert_eq!(events(&mut robot), [RobotEvent::Watchdog]);
    wait(&mut robot, ms(5000));
    assert_eq!(events(&mut robot), [], "reported once");
    robot.handle_input(&bytes(command), ms(6000));
    assert_eq!(events(&mut robot), [RobotEvent::Motor(command)], "the next one is obeyed");
}

#[test]
fn a_robot_whose_driver_is_late_still_stands_still() {
    let mut robot = quiet_robot();
    robot.handle_input(&bytes(go(60)), ms(0));
    assert_eq!(robot.command(ms(500)).speed(), 0, "without handle_timeout");
    // The next command arrives before the timeout has been handled.
    robot.handle_input(&bytes(go(60)), ms(700));
    // The first command is over before the application was told of it.
    let told = [RobotEvent::Motor(go(0)), RobotEvent::Watchdog, RobotEvent::Motor(go(60))];
    assert_eq!(events(&mut robot), told);
}

#[test]
fn empty_input_lets_the_watchdog_fire() {
    let mut robot = quiet_robot();
    robot.handle_input(&bytes(go(60)), ms(0));
    robot.handle_input(&[], ms(499));
    assert_eq!(robot.statistics().watchdog, 0);
    robot.handle_input(&[], ms(500));
    assert_eq!(events(&mut robot), [RobotEvent::Motor(go(0)), RobotEvent::Watchdog]);
}

#[test]
fn the_first_command_is_an_event_even_if_it_changes_nothing() {
    let mut robot = quiet_robot();
    robot.handle_input(&bytes(MotorControl::STOP), ms(0));
    robot.handle_input(&bytes(MotorControl::STOP), ms(100));
    assert_eq!(events(&mut robot), [RobotEvent::Motor(MotorControl::STOP)]);
}

#[test]
fn a_repeated_command_is_not_an_event() {
    let mut robot = quiet_robot();
    for at in (0..2000).step_by(100) {
        robot.handle_timeout(ms(at));
        robot.handle_input(&bytes(go(60)), ms(at));
    }
    assert_eq!(events(&mut robot), [RobotEvent::Motor(go(60))]);
    assert_eq!(robot.statistics().commands, 20);
}

#[test]
fn out_of_range_values_are_clamped_like_in_the_vendor_firmware() {
    let mut robot = quiet_robot();
    robot.handle_input(&careless(i16::MIN, 360, 0x0101, 0), ms(0));
    let command = robot.command(ms(0));
    assert_eq!((command.speed(), command.angular()), (-100, 100));
    assert_eq!(command.front_led(), 100, "any low byte but 00 and FF is on");
    robot.handle_input(&careless(1, 2, -1, 0), ms(1));
    assert_eq!(robot.command(ms(1)), MotorControl::new(1, 2).unwrap());
    robot.handle_input(&careless(100, -100, 0, 0), ms(2));
    assert_eq!((robot.statistics().commands, robot.statistics().commands_clamped), (3, 1));
    // Each of them, also if it repeats the last one.
    for at in [3, 4] {
        robot.handle_input(&careless(0, 360, 0, 0), ms(at));
    }
    assert_eq!((robot.statistics().commands, robot.statistics().commands_clamped), (5, 3));
}

#[test]
fn an_update_by_a_motor_command_that_has_no_room_is_counted_and_one_that_has_is_not() {
    let mut robot = quiet_robot();
    robot.handle_input(&careless(0, 0, 0, 39), ms(0));
    assert_eq!((robot.statistics().without_room, robot.statistics().commands_refused), (0, 1));
    // Other events that are never taken, until there is no room.
    for version in 0..40 {
        robot.handle_input(&bytes(OtaRequest::start_firmware_update(version)), ms(1));
    }
    let before = robot.statistics().without_room;
    robot.handle_input(&careless(0, 0, 0, 40), ms(2));
    assert_eq!(robot.statistics().without_room, before + 1);
}

#[test]
fn the_command_of_a_robot_whose_driver_is_late_has_ended_when_it_is_taken() {
    let mut robot = quiet_robot();
    robot.handle_input(&bytes(go(50).with_front_led(true)), ms(0));
    assert_eq!(robot.take_command(us(499_999)), Some(go(50).with_front_led(true)));
    assert_eq!(robot.take_command(us(499_999)), None, "taken");
    // Nobody has called `handle_timeout`.
    assert_eq!(robot.take_command(ms(500)), Some(MotorControl::STOP.with_front_led(true)));
    assert_eq!(robot.take_command(ms(500)), None);
    assert_eq!((robot.statistics().watchdog, robot.command(ms(0)).speed()), (1, 0));
    // Also of a robot that stands still: its stop by the watchdog is a change.
    robot.handle_input(&bytes(go(0)), ms(600));
    assert_eq!(robot.take_command(ms(600)), Some(go(0)));
    assert_eq!(robot.take_command(ms(1100)), Some(MotorControl::STOP));
    assert_eq!(robot.statistics().watchdog, 2, "each time");
}

#[test]
fn a_command_that_comes_at_the_end_of_the_last_one_does_not_hide_the_watchdog() {
    let mut robot = quiet_robot();
    robot.handle_input(&bytes(go(50)), ms(0));
    assert_eq!(robot.poll_event(), Some(RobotEvent::Motor(go(50))));
    robot.handle_input(&bytes(go(40)), ms(500));
    assert_eq!(robot.poll_event(), Some(RobotEvent::Watchdog));
    assert_eq!(robot.poll_event(), Some(RobotEvent::Motor(go(40))));
    // One that came in time has no watchdog before it, also if it is taken in late.
    robot.handle_input(&bytes(go(30)), Arrival::Between { since: ms(990), now: ms(1010) });
    assert_eq!(robot.poll_event(), Some(RobotEvent::Motor(go(30))));
    assert_eq!(robot.statistics().watchdog, 1);
}

#[test]
fn a_command_that_waited_too_long_for_the_driver_moves_nothing() {
    for (waited_us, is_too_old) in [(499_999, false), (500_000, true), (900_000, true)] {
        let mut robot = quiet_robot();
        let now = us(waited_us);
        robot.handle_input(
            &bytes(go(50).with_front_led(true)),
            Arrival::Between { since: ms(0), now },
        );
        let expected = if is_too_old { MotorControl::STOP } else { go(50) }.with_front_led(true);
        assert_eq!(robot.command(now), expected);
        assert_eq!(events(&mut robot), [RobotEvent::Motor(expected)], "{waited_us} us");
        assert_eq!((robot.statistics().commands, robot.statistics().watchdog), (1, 0));
        assert_eq!(robot.poll_timeout(), Some(ms(500)));
        assert_eq!(robot.take_command(now), Some(expected));
    }
}

#[test]
fn an_update_never_starts_by_itself() {
    let mut robot = quiet_robot();
    robot.handle_input(&bytes(go(10)), ms(0));
    robot.handle_input(&careless(90, 0, 0, 39), ms(10));
    assert_eq!(robot.command(ms(10)).speed(), 10, "its speed is ignored");
    assert_eq!(robot.command(ms(500)).speed(), 0, "and it does not feed the watchdog");
    assert!(!robot.answer_update(OtaStatus::Accepted, ms(10)), "nothing to answer");
    robot.handle_input(&bytes(OtaRequest::start_firmware_update(41)), ms(20));
    let by_motor = RobotEvent::UpdateRequested { version: 39, by: UpdateSource::MotorCommand };
    let by_request = RobotEvent::UpdateRequested { version: 41, by: UpdateSource::Request };
    assert_eq!(events(&mut robot)[1..], [by_motor, by_request]);
    assert_eq!(sent(&mut robot, ms(20)), [] as [Vec<u8>; 0], "the application decides");
    assert!(robot.answer_update(OtaStatus::Forbidden, ms(30)));
    assert_eq!(sent(&mut robot, ms(30)), [bytes(OtaAck::new(OtaStatus::Forbidden))]);
    assert!(!robot.answer_update(OtaStatus::Forbidden, ms(30)), "once");
}

#[test]
fn a_command_that_a_false_header_held_back_is_as_old_as_its_bytes() {
    let mut robot = Robot::new(RobotConfig::default(), ms(0));
    // The start of a 64-byte frame that never comes, a command after it, and a late driver.
    let held = [&[0xFD, 0xFF, 60, 0][..], go(60).frame(0).as_bytes()].concat();
    robot.handle_input(&held, ms(10));
    assert_eq!(robot.command(ms(11)).speed(), 0, "not visible yet");
    robot.handle_input(&[0; 36], ms(400));
    assert_eq!(robot.command(ms(400)).speed(), 60, "it holds for 500 ms ...");
    assert_eq!(robot.command(ms(510)).speed(), 0, "... from when it had arrived");

    let mut robot = Robot::new(RobotConfig::default(), ms(0));
    robot.handle_input(&held, ms(10));
    robot.handle_input(&[0; 36], ms(2000));
    assert_eq!(robot.command(ms(2000)).speed(), 0, "it is no longer wanted");
}

#[test]
fn a_command_that_false_headers_held_back_is_obeyed_however_small_the_chunks() {
    for chunk in [1, 2, 4, 16, 64] {
        let mut robot = Robot::new(RobotConfig::default(), ms(0));
        let (mut at, mut looks, mut obeyed) = (ms(1), 0, 0);
        while at < ms(3000) {
            let noise = [&[0xFD, 0xFF, 60, 0, 2, 0][..], &[7; 26]].concat();
            let command = go(60).frame(0).as_bytes().to_vec();
            for bytes in [noise.repeat(6), command, noise].concat().chunks(chunk) {
                at += Duration::from_micros(87 * chunk as u32);
                robot.handle_input(bytes, at);
                robot.handle_timeout(at);
                looks += 1;
                obeyed += u32::from(robot.command(at).speed() == 60);
            }
        }
        assert!(obeyed * 100 > looks * 95, "{chunk}: {obeyed} of {looks}");
    }
}
