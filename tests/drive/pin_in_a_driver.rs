//! Driver enable under a driver: whatever fails, stalls or is dropped, the pin is switched off.

use crate::{pin::serve, rig::*};

#[test]
fn a_driver_switches_the_pin_once_per_round_and_releases_it_when_its_port_fails() {
    for is_async in BOTH {
        let (port, log, _) = undelayed(Port::writing([Step::Few(2)]));
        drain(&log);
        let role = Recorder::sending(&[b"12", b"34"]);
        let mut driver = On::new(role, port, World::default());
        assert_eq!(serve(&mut driver, is_async), Ok(()));
        assert_eq!(drain(&log), "on write write flush off");
        driver.role_mut().frames.push_back(b"56".into());
        let steps = [Step::Few(1), Step::Error];
        driver.port_mut().port_mut().writes.extend(steps);
        let failed = DriveError::Port(Rs485Error::Port(Unplugged));
        assert_eq!(serve(&mut driver, is_async), Err(failed));
        assert_eq!(drain(&log), "on write write flush off flush");
        assert_eq!(serve(&mut driver, is_async), Ok(()));
        assert_eq!(drain(&log), "on write flush off");
    }
}

#[test]
fn the_pin_is_off_after_every_call_whatever_fails() {
    let one = || Step::Few(1);
    let reads = [vec![], vec![Step::Error], vec![Step::Zero], vec![bytes(1), Step::Error]];
    let writes = [
        vec![],
        vec![Step::Error],
        vec![Step::Zero],
        vec![one(), Step::Error],
        vec![one(), Step::Error, Step::Error],
        vec![one(), Step::Zero, one(), Step::Error],
    ];
    let flushes = [vec![], vec![Step::Error], vec![Step::Error, Step::Error]];
    for (read, write) in reads.iter().flat_map(|read| writes.iter().map(move |it| (read, it))) {
        for (flush, is_async) in flushes.iter().flat_map(|it| [(it, false), (it, true)]) {
            let script = Port {
                reads: read.clone().into(),
                writes: write.clone().into(),
                flushes: flush.clone().into(),
                ..Port::default()
            };
            let (port, log, _) = undelayed(script);
            let role = Recorder::sending(&[b"12", b"34"]);
            let mut driver = On::new(role, port, World::default());
            for call in 0..5 {
                let _ = serve(&mut driver, is_async);
                let story = (read, write, flush, call);
                assert!(!is_on(&log) && !driver.port_mut().is_on(), "{story:?}");
            }
        }
    }
}

#[test]
fn a_pin_that_failed_to_go_off_goes_off_with_the_next_call_whatever_else_fails() {
    let one = || Step::Few(1);
    for write in [vec![], vec![Step::Error], vec![one(), Step::Error, Step::Error]] {
        for (calls, failures) in (0..4).flat_map(|calls| [(calls, 1), (calls, 2)]) {
            for is_async in BOTH {
                let world = World::default();
                let (port, log, pin) = undelayed(Port::writing(write.clone()));
                let role = Recorder::sending(&[b"12", b"34"]);
                let mut driver = On::new(role, port, world.clone());
                for call in 0..8 {
                    if call == calls {
                        pin.failures.set(failures);
                    }
                    let _ = serve(&mut driver, is_async);
                    // The rest of the frame may be dropped meanwhile.
                    world.step(25_000);
                }
                assert_eq!(pin.failures.get() % failures, 0, "not retried");
                assert!(!is_on(&log) && !driver.port_mut().is_on(), "{write:?} {calls}");
            }
        }
    }
}

#[test]
fn a_pin_left_on_by_a_dropped_call_goes_off_with_the_next_one() {
    let one = || Step::Few(1);
    for (writes, flushes) in [
        (vec![Step::Stall], vec![]),
        (vec![one(), Step::Stall], vec![]),
        (vec![], vec![Step::Stall]),
        // The rest of a frame that has been flushed in between.
        (vec![one(), Step::Error, Step::Stall], vec![]),
    ] {
        for late_us in [0, 25_000] {
            let world = World::default();
            let script = Port {
                writes: writes.clone().into(),
                flushes: flushes.clone().into(),
                ..Port::default()
            };
            let (port, log, _) = undelayed(script);
            let role = Recorder::sending(&[b"12"]);
            let mut driver = On::new(role, port, world.clone());
            let is_dropped = |driver: &mut On<_, _, _>| {
                let mut call = std::pin::pin!(driver.asynch().service());
                poll(call.as_mut()).is_pending() && poll(call.as_mut()).is_pending()
            };
            while !is_dropped(&mut driver) {}
            world.step(late_us);
            assert_eq!(ready(driver.asynch().service()), Ok(()));
            assert!(!is_on(&log), "{writes:?} {late_us}");
        }
    }
}

#[test]
fn a_port_that_stalls_for_a_second_does_not_leave_the_driver_enable_pin_on() {
    let one = || Step::Few(1);
    let stall = || Step::Late(10_000_000);
    for (writes, flushes) in [
        (vec![stall()], vec![]),
        // The rest of the first frame pauses for too long, the next one stalls.
        (vec![one(), stall()], vec![]),
        (vec![], vec![stall()]),
        (vec![], vec![stall(), stall()]),
    ] {
        let world = World::default();
        let (count, story) = (writes.len().max(flushes.len()), format!("{writes:?} {flushes:?}"));
        let script = Port { writes: writes.into(), flushes: flushes.into(), ..Port::default() };
        let (port, log, _) = undelayed(script);
        let role = Recorder::sending(&[b"12", b"34", b"56"]);
        let mut driver = On::new(role, port, world.clone());
        let mut stalls = 0;
        for _ in 0..count + 1 {
            let mut call = std::pin::pin!(driver.asynch().service());
            if poll(call.as_mut()).is_pending() {
                assert!(is_on(&log) || stalls > 0, "{story}");
                assert_eq!(world.block_on(call), Err(DriveError::Stalled), "{story}");
                stalls += 1;
            }
            assert!(!is_on(&log), "{story}");
        }
        assert!(stalls > 0 && !driver.port_mut().is_on(), "{story}");
    }
}

#[test]
fn a_slave_whose_call_ends_while_its_answer_leaves_returns_with_its_pin_off() {
    let world = World::default();
    let (near, mut far) = Port::pair(&world, 20);
    let (port, _log, _pin) = undelayed(Port { drains: true, ..near });
    let role = Slave::new(NodeId::N2, Mode::Velocity, SlaveConfig::direct(), world.now());
    let mut slave = On::new(role, port, world.clone());
    embedded_io::Write::write(&mut far, ReadRequest::new(NodeId::N2).as_bytes()).unwrap();
    // The request takes 80 us, the answer 160 us.
    assert_eq!(
        world.block_on(slave.asynch().next_command(Duration::from_micros(180))).unwrap(),
        None
    );
    assert!(!slave.port_mut().is_on());
    assert_eq!(slave.port_mut().port_mut().written.len(), 8);
    assert!(world.now() >= at_ms(0) + Duration::from_micros(240));
}

#[test]
fn a_pin_that_was_left_on_goes_off_in_the_first_round_of_another_driver() {
    let world = World::default();
    let (near, mut far) = Port::pair(&world, 20);
    let (mut near, log, _) = undelayed(near);
    near.port_mut().flushes.push_back(Step::Stall);
    let role = Slave::new(NodeId::N2, Mode::Velocity, SlaveConfig::direct(), world.now());
    let mut slave: On<Slave, _, _> = On::new(role, near, world.clone());
    embedded_io::Write::write_all(&mut far, ReadRequest::new(NodeId::N2).as_bytes()).unwrap();
    world.step(100);
    // A call that is dropped while the answer leaves.
    assert_eq!(world.poll_times(1, slave.asynch().service()), None);
    assert!(is_on(&log));
    let (role, port, clock) = slave.into_parts();
    let mut slave = On::new(role, port, clock);
    world.step(10_000);
    world.block_on(slave.asynch().service()).unwrap();
    assert!(!is_on(&log), "the pair is jammed for all nodes");
}
