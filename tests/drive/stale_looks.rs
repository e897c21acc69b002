//! What was decided after a look at the port, and what has arrived, or has passed, since.

use std::cell::Cell;

use axlewire::ucp::{Frame, host::StopProgress};

use crate::{
    motor_line::{ALL, Wire},
    rig::*,
};

/// The rover's wheels turn at this speed from now on, whatever it is told.
fn turn(world: &World, robot: &Running<Robot>, rpm: i16) {
    let telemetry = Telemetry { rpm: [rpm; 4], ..Telemetry::default() };
    robot.borrow_mut().role_mut().set_telemetry(&telemetry, world.now());
}

/// A rover that is seen to stand still.
fn standing() -> (World, Rover, Running<Robot>) {
    let (world, mut rover, robot) = rover(|config| config.rpm_average = Duration::ZERO);
    rover.run_for(ms(300), |_, _, _| ()).unwrap();
    assert_eq!(rover.role().stop_progress(), StopProgress::StandingStill);
    (world, rover, robot)
}

/// Ids and speeds of the frames that the port has taken from this byte on, each with its time.
fn taken(rover: &Rover, from: usize) -> Vec<(u64, u8, i16)> {
    let mut frames = vec![];
    for offer in rover.port().offers.iter().skip(from).filter(|offer| offer.taken > 0) {
        let frame = Frame::parse(&offer.bytes[..offer.taken]).expect("a frame at once");
        let speed = match frame.message() {
            axlewire::ucp::Message::MotorControl(command) => command.speed(),
            _ => 0,
        };
        frames.push((offer.at_us, frame.id(), speed));
    }
    frames
}

/// When the port has taken the last byte of each command `drive(40, 0)`.
fn moves(rover: &Rover) -> Vec<u64> {
    let offers = rover.port().offers.iter();
    let times: Vec<_> = offers.flat_map(|offer| vec![offer.at_us; offer.taken]).collect();
    let written = &rover.port().written;
    assert_eq!(written.len(), times.len());
    let command = MotorControl::new(40, 0).unwrap();
    let ends = times[23..].iter().zip(written.windows(24));
    ends.filter(|(_, frame)| *frame == command.frame(frame[5]).as_bytes())
        .map(|(&at_us, _)| at_us)
        .collect()
}

#[test]
fn a_command_does_not_leave_after_its_dead_man_wherever_its_thread_was_held_up() {
    for (is_async, hold_ms) in BOTH.into_iter().flat_map(|it| [600, 2000].map(|hold| (it, hold))) {
        for readings in 0..25 {
            let (world, mut rover, _robot) = standing();
            // Long enough after the last stop for the command to leave at once.
            world.pass(30_000);
            let (from, begin_us) = (rover.port().offers.len(), world.now_us());
            world.hold_up(readings, hold_ms * 1000);
            let _ = call!(is_async, rover, drive(40, 0));
            // When `drive` was called, for the role, is not known better than that.
            let called_us = if readings == 0 { world.now_us() } else { begin_us };
            for (at_us, _, speed) in taken(&rover, from) {
                assert!(
                    speed == 0 || at_us <= called_us + 500_000,
                    "reading {readings}, async {is_async}"
                );
            }
        }
    }
}

#[test]
fn a_repetition_does_not_leave_after_its_dead_man_however_short_the_hold_up() {
    for (is_async, readings) in BOTH.into_iter().flat_map(|it| (1..25).map(move |n| (it, n))) {
        let (world, mut rover, _robot) = standing();
        let mut called_us = 0;
        // The same command again feeds the dead-man: it fires 6 ms after a repetition is due.
        for _ in 0..2 {
            called_us = world.now_us();
            call!(is_async, rover, drive(40, 0)).unwrap();
            call!(is_async, rover, run_for(ms(6), |_, _, _| ())).unwrap();
        }
        call!(is_async, rover, run_for(ms(487), |_, _, _| ())).unwrap();
        let from = rover.port().offers.len();
        world.hold_up(readings, 8000);
        call!(is_async, rover, run_for(ms(20), |_, _, _| ())).unwrap();
        for (at_us, _, speed) in taken(&rover, from) {
            let is_late = at_us > called_us + 500_000;
            assert!(speed == 0 || !is_late, "reading {readings}, async {is_async}");
        }
    }
}

#[test]
fn a_write_that_waits_is_not_taken_after_the_span_of_its_call() {
    // Just before its end a repetition is due, which looks at the time, too.
    let span = Duration::from_micros(100_700);
    for late_us in (100_000..102_000).step_by(100) {
        let (world, mut rover, _robot) = standing();
        world.pass(30_000);
        let (from, begin_us) = (rover.port().offers.len(), world.now_us());
        rover.port_mut().writes.push_back(Step::Late(late_us));
        let _ = world.block_on(rover.asynch().drive_for(40, 0, span));
        for (at_us, _, speed) in taken(&rover, from) {
            assert!(speed == 0 || at_us <= begin_us + 100_700, "{late_us} us");
        }
    }
}

#[test]
fn the_rest_of_a_command_does_not_leave_after_its_dead_man_wherever_its_thread_was_held_up() {
    for (is_async, readings) in BOTH.into_iter().flat_map(|it| (0..25).map(move |n| (it, n))) {
        let (world, mut rover, _robot) = standing();
        world.pass(30_000);
        rover.port_mut().most = 12;
        let begin_us = world.now_us();
        world.hold_up(readings, 600_000);
        let _ = call!(is_async, rover, drive(40, 0));
        let is_late = moves(&rover).iter().any(|&at_us| at_us > begin_us + 500_000);
        assert!(!(is_late && readings > 0), "reading {readings}, async {is_async}");
    }
}

#[test]
fn a_link_is_not_lost_because_the_thread_of_its_host_was_held_up() {
    for (is_async, readings) in BOTH.into_iter().flat_map(|it| (0..25).map(move |n| (it, n))) {
        let (world, mut rover, _robot) = standing();
        world.hold_up(readings, 600_000);
        for _ in 0..10 {
            call!(is_async, rover, service()).unwrap();
        }
        assert_eq!(rover.role().statistics().links_lost, 0, "reading {readings}, async {is_async}");
    }
}

#[test]
fn a_link_is_not_lost_because_the_thread_of_its_host_was_held_up_twice() {
    let pairs = (0..14).flat_map(|first| (0..5).map(move |second| (first, second)));
    for (first, second) in pairs {
        let (world, mut rover, _robot) = rover(|config| config.link_timeout = ms(100));
        rover.run_for(ms(300), |_, _, _| ()).unwrap();
        world.hold_up(first, 12_000);
        world.hold_up(second, 150_000);
        for _ in 0..10 {
            rover.service().unwrap();
        }
        assert_eq!(rover.role().statistics().links_lost, 0, "readings {first} and {second}");
    }
}

#[test]
fn an_update_request_does_not_leave_past_reports_of_motion_wherever_its_thread_was_held_up() {
    // The second one is too short for a repetition of the stop to go before the request.
    for (is_async, hold_us) in BOTH.into_iter().flat_map(|it| [400_000, 60_000].map(|us| (it, us)))
    {
        for readings in 0..25 {
            let (world, mut rover, robot) = standing();
            let (from, now) = (rover.port().offers.len(), rover.now());
            rover.role_mut().start_firmware_update(39, now).unwrap();
            turn(&world, &robot, 60);
            world.hold_up(readings, hold_us);
            let _ = call!(is_async, rover, service());
            let held_us = now.as_micros() + hold_us;
            let is_late = |&(at, id, _): &(u64, u8, i16)| id == 9 && at >= held_us;
            let is_sent = taken(&rover, from).iter().any(is_late);
            assert!(!is_sent, "{hold_us} us, reading {readings}, async {is_async}");
        }
    }
}

#[test]
fn an_update_request_does_not_leave_past_reports_of_motion_if_its_thread_was_held_up_twice() {
    let pairs = (0..14).flat_map(|first| (0..5).map(move |second| (first, second)));
    for (is_async, (first, second)) in
        BOTH.into_iter().flat_map(|it| pairs.clone().map(move |n| (it, n)))
    {
        let (world, mut rover, robot) = standing();
        let (from, now) = (rover.port().offers.len(), rover.now());
        rover.role_mut().start_firmware_update(39, now).unwrap();
        turn(&world, &robot, 60);
        world.hold_up(first, 12_000);
        world.hold_up(second, 80_000);
        let _ = call!(is_async, rover, service());
        let held_us = now.as_micros() + 92_000;
        let is_late = |&(at, id, _): &(u64, u8, i16)| id == 9 && at >= held_us;
        let is_sent = taken(&rover, from).iter().any(is_late);
        assert!(!is_sent, "readings {first} and {second}, async {is_async}");
    }
}

#[test]
fn the_rest_of_a_command_does_not_leave_behind_a_pause_in_which_an_async_port_took_nothing() {
    for late_us in [3000, 5000, 30_000, 180_000] {
        let (world, mut rover, _robot) = standing();
        world.pass(30_000);
        let from = rover.port().offers.len();
        rover.port_mut().writes.extend([Step::Few(12), Step::Late(late_us)]);
        let _ = world.block_on(rover.asynch().drive(40, 0));
        rover.run_for(ms(100), |_, _, _| ()).unwrap();
        let times = rover.port().offers.iter().skip(from).filter(|offer| offer.taken > 0);
        let parts: Vec<_> = times.map(|offer| offer.taken).collect();
        let rest = if late_us == 3000 { 12 } else { 24 };
        assert_eq!(parts[..2], [12, rest], "{late_us} us: the whole command again");
    }
}

#[test]
fn behind_a_receiver_that_fails_no_robot_is_seen_to_stand_still() {
    for is_async in BOTH {
        let (world, mut rover, robot) = standing();
        rover.port_mut().is_deaf = true;
        turn(&world, &robot, 60);
        for _ in 0..20 {
            world.pass(20_000);
            assert!(call!(is_async, rover, service()).is_err());
            let now = rover.now();
            let asked = rover.role_mut().start_firmware_update(39, now);
            assert!(asked.is_err());
        }
        let waited = call!(is_async, rover, await_standstill(ms(50)));
        assert!(waited.is_err());
        // It has recovered.
        rover.port_mut().is_deaf = false;
        turn(&world, &robot, 0);
        assert_eq!(call!(is_async, rover, await_standstill(ms(1000))), Ok(()));
    }
}

#[test]
fn a_standstill_is_not_that_before_a_slow_flush() {
    for (is_async, flush) in [(false, Step::Blocks(900_000)), (true, Step::Late(900_000))] {
        let (world, mut rover, robot) = standing();
        rover.stop().unwrap();
        world.pass(10_000);
        rover.service().unwrap();
        // The first round of the wait reads four reports, and sends a repetition.
        world.pass(95_000);
        let turning = robot.clone();
        let clock = world.clone();
        let begin_us = world.now_us();
        world.add(move || {
            let (Ok(mut robot), now) = (turning.try_borrow_mut(), clock.now()) else { return };
            if clock.now_us() > begin_us + 20_000 {
                let telemetry = Telemetry { rpm: [60; 4], ..Telemetry::default() };
                robot.role_mut().set_telemetry(&telemetry, now);
            }
        });
        rover.port_mut().flushes.extend(vec![flush; 8]);
        let waited = call!(is_async, rover, await_standstill(ms(3000)));
        assert!(matches!(waited, Err(DriveError::NoStandstill(_))), "{waited:?}");
    }
}

#[test]
fn the_rest_of_a_set_point_does_not_leave_after_its_dead_man() {
    for is_async in BOTH {
        let mut config = MasterConfig::direct();
        (config.polling, config.nodes) = (Polling::Manual, NodeId::N2.into());
        (config.dead_man, config.baud, config.reply_timeout) = (Some(ms(100)), 9600, ms(20));
        let world = World::default();
        let (near, far) = Port::pair(&world, 1042);
        let slave = Slave::new(NodeId::N2, Mode::Velocity, SlaveConfig::at(9600), world.now());
        let _slave = run(slave, far);
        let mut bus = on(Master::new(config, world.now()), near);
        bus.discover().unwrap();
        let now = bus.now();
        bus.role_mut().set_velocity(NodeId::N2, rps(1.0), now).unwrap();
        world.pass(98_000);
        let from = bus.port().written.len();
        // A byte at a time, each of which takes a millisecond.
        bus.port_mut().writes.extend(vec![Step::Drains(1, 0); 40]);
        while world.now() < now + ms(130) {
            let _ = call!(is_async, bus, service());
            world.pass(100);
        }
        let set_point = WriteRequest::velocity(NodeId::N2, rps(1.0));
        let written = &bus.port().written[from..];
        assert!(written.starts_with(&set_point.as_bytes()[..1]), "it had begun");
        let is_whole = written.windows(8).any(|bytes| bytes == set_point.as_bytes());
        assert!(!is_whole, "async {is_async}");
    }
}

#[test]
fn an_answer_that_waits_for_its_port_is_not_sent_behind_what_was_said_meanwhile() {
    let (mut slave, mut far) = slave(SlaveConfig::direct());
    let world = slave.port().world.clone();
    slave.service().unwrap();
    let read = ReadRequest::new(NodeId::N2);
    embedded_io::Write::write(&mut far, read.as_bytes()).unwrap();
    world.step(100);
    slave.port_mut().writes.extend([Step::Late(1000), Step::Late(1000)]);
    {
        let mut service = std::pin::pin!(slave.asynch().service());
        assert!(poll(service.as_mut()).is_pending());
        let foreign = ReadRequest::new(NodeId::N5);
        embedded_io::Write::write(&mut far, foreign.as_bytes()).unwrap();
        // The executor is held up, but for less than ten milliseconds.
        world.step(9000);
        let _ = world.block_on(service);
    }
    let _ = world.block_on(slave.asynch().service());
    assert_eq!(slave.port().written, [] as [u8; 0]);
    assert_eq!(slave.role().statistics().overtaken, 1);
}

#[test]
fn the_rest_of_a_command_does_not_leave_after_the_span_of_its_call() {
    for (is_async, readings) in BOTH.into_iter().flat_map(|it| (1..25).map(move |n| (it, n))) {
        let (world, mut rover, _robot) = standing();
        world.pass(30_000);
        rover.port_mut().most = 12;
        let begin_us = world.now_us();
        world.hold_up(readings, 100_000);
        let _ = call!(is_async, rover, drive_for(40, 0, ms(30)));
        // A pause inside a frame may take 4 ms.
        let late = begin_us + 30_000 + 4_000;
        let is_late = moves(&rover).iter().any(|&at_us| at_us > late);
        assert!(!is_late, "reading {readings}, async {is_async}");
    }
}

#[test]
fn the_rest_of_an_answer_does_not_leave_after_a_pause_inside_it() {
    for readings in 0..40 {
        let (mut slave, mut far) = slave(SlaveConfig::direct());
        let world = slave.port().world.clone();
        slave.service().unwrap();
        let read = ReadRequest::new(NodeId::N2);
        embedded_io::Write::write(&mut far, read.as_bytes()).unwrap();
        world.step(100);
        slave.port_mut().most = 3;
        world.hold_up(readings, 1000);
        for _ in 0..3 {
            let _ = slave.service();
        }
        let offers = slave.port().offers.iter().filter(|offer| offer.taken > 0);
        let times: Vec<_> = offers.map(|offer| offer.at_us).collect();
        let pauses = times.windows(2).map(|pair| pair[1] - pair[0]);
        assert!(pauses.max().unwrap_or(0) < 1000, "reading {readings}: {times:?}");
    }
}

#[test]
fn an_answer_that_waits_for_its_port_is_taken_back_once_its_time_has_passed() {
    let (mut slave, mut far) = slave(SlaveConfig::direct());
    let world = slave.port().world.clone();
    slave.service().unwrap();
    embedded_io::Write::write(&mut far, ReadRequest::new(NodeId::N2).as_bytes()).unwrap();
    world.step(100);
    slave.port_mut().writes.extend(vec![Step::Late(2500); 4]);
    let _ = world.block_on(slave.asynch().next_command(ms(20)));
    assert_eq!(slave.port().written, [] as [u8; 0]);
    let counted = slave.role().statistics();
    assert_eq!((counted.replies, counted.expired, counted.overtaken), (0, 1, 0));
}

#[test]
fn a_set_point_that_waits_for_its_port_does_not_leave_behind_an_answer_in_the_other_mode() {
    let set_point = WriteRequest::velocity(NodeId::N1, rps(5.0));
    for late_us in [2000, 30_000, 900_000] {
        let (wire, mut bus) = Wire::one_motor(Mode::Velocity, |_| ());
        let waits = std::rc::Rc::new(Cell::new(false));
        let has_waited = waits.clone();
        wire.write_with(move |bytes| {
            let is_first = bytes == set_point.as_bytes() && !has_waited.replace(true);
            if is_first { Step::Late(late_us) } else { ALL }
        });
        let from = bus.port().written.len();
        {
            let mut aimed = std::pin::pin!(bus.asynch().set_velocity(NodeId::N1, rps(5.0)));
            while !waits.get() {
                assert!(poll(aimed.as_mut()).is_pending());
                wire.world.step(20);
            }
            // The switch of the node is moved, and its last answer is late.
            wire.motor().switch(Mode::Position, wire.world.now_us());
            wire.receive(PositionResponse::new(NodeId::N1, Position::new(3, 0)).as_bytes());
            let _ = wire.world.block_on(aimed);
        }
        let _ = wire.world.block_on(bus.asynch().run_for(ms(50), |_, _, _| ()));
        let written = &bus.port().written[from..];
        let has_left = written.windows(8).any(|bytes| bytes == set_point.as_bytes());
        assert!(!has_left, "{late_us} us");
    }
}

#[test]
fn an_answer_that_waits_for_its_port_is_taken_back_when_another_request_is_heard() {
    let mut config = SlaveConfig::direct();
    config.answer_within = ms(4);
    let (mut slave, mut far) = slave(config);
    let world = slave.port().world.clone();
    slave.service().unwrap();
    embedded_io::Write::write(&mut far, ReadRequest::new(NodeId::N2).as_bytes()).unwrap();
    world.step(100);
    slave.port_mut().writes.push_back(Step::Late(2000));
    {
        let mut service = std::pin::pin!(slave.asynch().service());
        assert!(poll(service.as_mut()).is_pending());
        embedded_io::Write::write(&mut far, ReadRequest::new(NodeId::N5).as_bytes()).unwrap();
        let _ = world.block_on(service);
    }
    let _ = world.block_on(slave.asynch().next_command(ms(20)));
    assert_eq!(slave.port().written, [] as [u8; 0]);
    assert_eq!(slave.role().statistics().overtaken, 1);
}

#[test]
fn a_set_point_does_not_leave_after_its_span_however_long_the_port_was_busy_behind_the_first() {
    for (is_async, busy_ms) in BOTH.into_iter().flat_map(|it| [40, 400, 900].map(|busy| (it, busy)))
    {
        let (wire, mut bus) = Wire::one_motor(Mode::Velocity, |_| ());
        let (first, set_point) = (Cell::new(true), WriteRequest::velocity(NodeId::N1, rps(5.0)));
        let from = bus.port().offers.len();
        // Busy with the READ behind the first WRITE.
        let mut follows = false;
        wire.write_with(move |bytes| {
            if follows && first.take() {
                return if is_async {
                    Step::Late(busy_ms * 1000)
                } else {
                    Step::Blocks(busy_ms * 1000)
                };
            }
            follows |= bytes == set_point.as_bytes();
            ALL
        });
        let begin_us = wire.world.now_us();
        let turned = call!(is_async, bus, drive_for(NodeId::N1, rps(5.0), ms(100)));
        // The stop of an async call may have had to wait for the port for too long.
        let owed = DriveError::StopsOwed(NodeId::N1.into());
        assert!(turned == Ok(()) || is_async && turned == Err(owed), "{busy_ms} ms: {turned:?}");
        call!(is_async, bus, stop(NodeId::N1)).unwrap();
        assert_eq!(wire.rps(), 0.0);
        let offers = bus.port().offers.iter().skip(from);
        let sent = offers.filter(|offer| offer.bytes == set_point.as_bytes() && offer.taken > 0);
        let times: Vec<_> = sent.map(|offer| offer.at_us - begin_us).collect();
        assert!(!times.is_empty() && times.iter().all(|&at| at <= 100_000), "{times:?}");
    }
}

#[test]
fn a_set_point_does_not_leave_after_its_span_wherever_its_thread_was_held_up() {
    // The first reading begins the span.
    for (is_async, readings) in BOTH.into_iter().flat_map(|it| (1..60).map(move |at| (it, at))) {
        let (wire, mut bus) = Wire::one_motor(Mode::Velocity, |_| ());
        let (from, begin_us) = (bus.port().offers.len(), wire.world.now_us());
        wire.world.hold_up(readings, 6_000_000);
        // Longer than a read may take.
        let _ = call!(is_async, bus, drive_for(NodeId::N1, rps(5.0), ms(5000)));
        call!(is_async, bus, stop(NodeId::N1)).unwrap();
        let set_point = WriteRequest::velocity(NodeId::N1, rps(5.0));
        let offers = bus.port().offers.iter().skip(from);
        let sent = offers.filter(|offer| offer.bytes == set_point.as_bytes() && offer.taken > 0);
        let late = sent.map(|offer| offer.at_us - begin_us).find(|&at| at > 5_000_000);
        assert_eq!(late, None, "{is_async} {readings}");
    }
}

#[test]
fn a_hold_that_waits_for_its_port_does_not_leave_when_its_measurement_is_old() {
    for late_us in [5000, 25_000, 60_000] {
        let (wire, mut bus) = Wire::one_motor(Mode::Position, |_| ());
        bus.set_position(NodeId::N1, Position::new(500, 0)).unwrap();
        bus.run_for(ms(100), |_, _, _| ()).unwrap();
        let (is_first, from) = (Cell::new(true), bus.port().offers.len());
        wire.write_with(move |bytes| match bytes[0] == 0xBB && is_first.take() {
            true => Step::Late(late_us),
            false => ALL,
        });
        let _ = wire.world.block_on(bus.asynch().stop(NodeId::N1));
        let (mut read_at, mut ages) = (0, vec![]);
        for offer in bus.port().offers.iter().skip(from).filter(|offer| offer.taken > 0) {
            match offer.bytes[0] {
                0xBB => ages.push(offer.at_us - read_at),
                _ if ages.is_empty() => read_at = offer.at_us,
                _ => {}
            }
        }
        assert!(ages[0] <= 21_000, "{late_us} us: {ages:?}");
    }
}
