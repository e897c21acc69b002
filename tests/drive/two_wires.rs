//! A line that hears itself: its echo is taken out, and nothing else.

use axlewire::drive::WithoutEcho;
use embedded_io::{Read, ReadReady, Write};

use crate::rig::*;

/// A bus of node 2 whose adapter hears what it sends.
fn two_wires(change: impl FnOnce(&mut Port)) -> (World, On<Master, WithoutEcho<Port>, World>) {
    let world = World::default();
    let mut near = Port::new(&world, 20);
    near.outboxes.push(near.inbox.clone());
    let mut far = Port::new(&world, 20);
    far.join(&mut near);
    change(&mut near);
    let slave = Slave::new(NodeId::N2, Mode::Velocity, SlaveConfig::direct(), at_ms(0));
    let slave = run(slave, far);
    let clock = world.clone();
    world.add(move || {
        if let Ok(mut slave) = slave.try_borrow_mut() {
            if let Some(Target::Velocity(rps)) = slave.role().command(clock.now()) {
                slave.role_mut().set_velocity(rps);
            }
        }
    });
    let master = Master::new(only_two_and_five(), world.now());
    (world.clone(), On::new(master, WithoutEcho::new(near), world))
}

/// Finds node 2, turns it and stops it.
fn turn_and_stop(
    world: &World,
    bus: &mut On<Master, WithoutEcho<Port>, World>,
    is_async: bool,
) -> Result<(), DriveError<Unplugged>> {
    let (two, speed) = (NodeId::N2, rps(1.0));
    if is_async {
        return world.block_on(async {
            assert_eq!(bus.asynch().discover().await?, [(two, Mode::Velocity)]);
            bus.asynch().drive_for(two, speed, ms(50)).await
        });
    }
    assert_eq!(bus.discover()?, [(two, Mode::Velocity)]);
    bus.drive_for(two, speed, ms(50))
}

#[test]
fn on_two_wires_a_node_is_found_turned_and_stopped_with_a_port_of_any_kind() {
    for is_async in BOTH {
        for most in [1, 3, 5, 64] {
            let (world, mut bus) = two_wires(|port| (port.most, port.drains) = (most, true));
            turn_and_stop(&world, &mut bus, is_async).unwrap();
            let statistics = *bus.role().statistics();
            let sent = 4 * statistics.reads + 8 * statistics.writes;
            let echo = bus.port().echo();
            // The last ones are still under way.
            assert!(statistics.writes > 10 && sent - echo.bytes() <= 12, "{most}: {echo:?}");
            assert_eq!((echo.errors(), statistics.stale_bytes), (0, 0), "{most}");
        }
    }
}

#[test]
fn a_line_without_an_echo_works_and_its_missing_echo_is_counted() {
    for is_async in BOTH {
        let (world, mut bus) = two_wires(|port| drop(port.outboxes.remove(0)));
        turn_and_stop(&world, &mut bus, is_async).unwrap();
        let echo = bus.port().echo();
        assert!(echo.errors() > 10 && echo.bytes() == 0, "{echo:?}");
    }
}

#[test]
fn without_the_removal_nodes_are_found_but_silent_ids_look_damaged() {
    let (world, bus) = two_wires(|_| ());
    let (role, port, _) = bus.into_parts();
    let mut plain = On::new(role, port.into_inner(), world);
    let (_, mut bus) = two_wires(|_| ());
    assert_eq!(plain.discover().unwrap(), [(NodeId::N2, Mode::Velocity)]);
    assert_eq!(bus.discover().unwrap(), [(NodeId::N2, Mode::Velocity)]);
    let damaged = |role: &Master| role.node_statistics(NodeId::N5).crc_errors;
    assert!(damaged(plain.role()) > 0 && damaged(bus.role()) == 0);
}

#[test]
fn after_a_failure_of_the_port_the_next_echo_is_removed_again() {
    for is_async in BOTH {
        for is_of_flush in BOTH {
            let (world, mut bus) = two_wires(|_| ());
            turn_and_stop(&world, &mut bus, is_async).unwrap();
            let port = bus.port_mut().port_mut();
            if is_of_flush { &mut port.flushes } else { &mut port.writes }.push_back(Step::Error);
            assert_eq!(turn_and_stop(&world, &mut bus, is_async), Err(GONE));
            world.pass(1000);
            turn_and_stop(&world, &mut bus, is_async).unwrap();
            let before = bus.port().echo().clone();
            turn_and_stop(&world, &mut bus, is_async).unwrap();
            let echo = bus.port().echo();
            assert!(echo.errors() <= 1 && echo.errors() == before.errors(), "{echo:?}");
            assert!(echo.bytes() > before.bytes() + 50, "{echo:?}");
        }
    }
}

/// What one read gives.
fn read(port: &mut WithoutEcho<Port>, is_async: bool, most: usize) -> Result<Vec<u8>, Unplugged> {
    let (mut buffer, world) = ([0; 64], port.port_mut().world.clone());
    let buffer = &mut buffer[..most];
    let count = match is_async {
        true => world.block_on(embedded_io_async::Read::read(port, buffer)),
        false => Read::read(port, buffer),
    }?;
    Ok(buffer[..count].to_vec())
}

fn write(port: &mut WithoutEcho<Port>, is_async: bool, bytes: &[u8]) -> Result<usize, Unplugged> {
    let world = port.port_mut().world.clone();
    match is_async {
        true => world.block_on(embedded_io_async::Write::write(port, bytes)),
        false => Write::write(port, bytes),
    }
}

#[test]
fn a_port_that_has_only_an_echo_is_not_ready_and_what_comes_behind_it_is_kept() {
    for is_async in BOTH {
        let script = [b"ask".as_slice(), b"ag", b"ainanswer"];
        let steps = script.map(|bytes| Step::Bytes(bytes.to_vec()));
        let mut port = WithoutEcho::new(Port::reading(steps));
        assert_eq!(write(&mut port, is_async, b"askagain"), Ok(8));
        assert_eq!(port.read_ready(), Ok(true));
        assert_eq!(port.read_ready(), Ok(true));
        assert_eq!(read(&mut port, is_async, 2), Ok(b"an".to_vec()));
        assert_eq!(read(&mut port, is_async, 64), Ok(b"swer".to_vec()));
        assert_eq!(port.read_ready(), Ok(false));
        assert_eq!((port.echo().bytes(), port.echo().errors()), (8, 0));
    }
}

#[test]
fn a_read_waits_for_bytes_of_others_and_the_end_and_errors_of_the_port_pass_through() {
    for is_async in BOTH {
        let bytes = |bytes: &[u8]| Step::Bytes(bytes.to_vec());
        let steps = [bytes(b"as"), bytes(b"k"), bytes(b"!"), Step::Error, Step::Zero, Step::Zero];
        let mut port = WithoutEcho::new(Port::file(steps));
        assert_eq!(write(&mut port, is_async, b"ask"), Ok(3));
        assert_eq!(read(&mut port, is_async, 64), Ok(b"!".to_vec()));
        assert_eq!(read(&mut port, is_async, 64), Err(Unplugged));
        assert_eq!(port.read_ready(), Ok(true), "the end can be read");
        assert_eq!(read(&mut port, is_async, 64), Ok(vec![]));
        port.port_mut().is_deaf = true;
        assert_eq!(port.read_ready(), Err(Unplugged));
    }
}

#[test]
fn only_what_the_port_has_taken_is_expected_and_nothing_after_a_failure() {
    for is_async in BOTH {
        let writes = [Step::Few(2), Step::Error, Step::Few(1)];
        let mut port = WithoutEcho::new(Port::writing(writes));
        assert_eq!(write(&mut port, is_async, b"ask"), Ok(2));
        port.port_mut().reads.push_back(Step::Bytes(b"ask".to_vec()));
        assert_eq!(read(&mut port, is_async, 64), Ok(b"k".to_vec()), "not its own");
        assert_eq!(write(&mut port, is_async, b"k"), Err(Unplugged));
        assert_eq!(write(&mut port, is_async, b"x"), Ok(1));
        port.port_mut().flushes.push_back(Step::Error);
        let world = port.port_mut().world.clone();
        let flushed = match is_async {
            true => world.block_on(embedded_io_async::Write::flush(&mut port)),
            false => Write::flush(&mut port),
        };
        assert_eq!(flushed, Err(Unplugged));
        port.port_mut().reads.push_back(Step::Bytes(b"x".to_vec()));
        assert_eq!(read(&mut port, is_async, 64), Ok(b"x".to_vec()));
        assert_eq!((port.echo().bytes(), port.echo().errors()), (2, 0));
    }
}

#[test]
fn a_write_of_no_bytes_reaches_the_pin_and_gives_up_the_echo() {
    let (pinned, log, _pin) = undelayed(Port::default());
    let mut port = WithoutEcho::new(pinned);
    assert_eq!(Write::write(&mut port, b"1").unwrap(), 1);
    assert_eq!(Write::write(&mut port, b"").unwrap(), 0);
    assert_eq!(drain(&log), "off on write off");
    port.port_mut().port_mut().reads.push_back(Step::Bytes(b"1".to_vec()));
    assert_eq!(Read::read(&mut port, &mut [0; 4]).unwrap(), 1);
}
