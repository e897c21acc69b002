//! High-level calls on a motor bus: what discovery, set-points, reads and stops return, and when.

use crate::rig::*;

#[test]
fn discovery_finds_all_nodes_within_its_bound() {
    for is_async in BOTH {
        let mut story = Story::new(MasterConfig::direct());
        let bound = story.bus.role().read_bound();
        let found = call!(is_async, story.bus, discover());
        assert_eq!(found.unwrap(), FOUND);
        assert!(story.world.now() < at_ms(0) + bound);
    }
}

#[test]
fn an_empty_bus_is_discovered_as_empty() {
    for is_async in BOTH {
        let mut bus: Bus = on(Master::new(MasterConfig::direct(), at_ms(0)), Port::default());
        assert!(call!(is_async, bus, discover()).unwrap().is_empty());
    }
}

#[test]
fn a_discovery_does_not_list_a_node_that_has_gone() {
    for is_async in BOTH {
        let mut story = Story::new(MasterConfig::direct()).discovered();
        story.unplug_two(true);
        let gone = Some(Health::Abnormal);
        while story.bus.role().health(NodeId::N2) != gone {
            story.run(1);
        }
        assert_eq!(story.bus.role().mode(NodeId::N2), Some(Mode::Velocity));
        let found = call!(is_async, story.bus, discover());
        assert_eq!(found.unwrap(), [(NodeId::N5, Mode::Position)]);
    }
}

#[test]
fn set_points_have_been_sent_when_the_call_returns_and_reach_the_right_node() {
    for is_async in BOTH {
        let mut story = Story::new(MasterConfig::direct()).discovered();
        let (to, at) = (rps(-2.5), Position::new(100, -3));
        call!(is_async, story.bus, set_velocity(NodeId::N2, to)).unwrap();
        call!(is_async, story.bus, set_position(NodeId::N5, at)).unwrap();
        assert_eq!(story.told_two(), Some(Target::Velocity(to)));
        assert_eq!(story.told_five(), Some(Target::Position(at)));
    }
}

#[test]
fn a_read_gives_what_the_node_measures_now() {
    for is_async in BOTH {
        for config in [MasterConfig::direct(), manual()] {
            let mut story = Story::new(config).discovered();
            for turn in 0..20 {
                // An older reading is available.
                story.bus.next_event(Duration::ZERO).unwrap();
                let (speed, place) = (rps(turn as f32), Position::new(turn, 0));
                story.two.borrow_mut().role_mut().set_velocity(speed);
                story.five.borrow_mut().role_mut().set_position(place);
                // Anything that was in flight has arrived by now.
                story.run(1);
                let mut read = |node| call!(is_async, story.bus, read(node));
                assert_eq!(read(NodeId::N2), Ok(Status::Velocity(speed.get())));
                assert_eq!(read(NodeId::N5), Ok(Status::Position(place)));
            }
        }
    }
}

#[test]
fn a_read_does_not_take_an_old_reading_for_the_answer() {
    let mut story = Story::new(manual()).discovered();
    story.ask(NodeId::N2);
    // The answer arrives and waits as an event.
    for _ in 0..50 {
        story.bus.service().unwrap();
        story.world.step(20);
    }
    story.two.borrow_mut().role_mut().set_velocity(rps(9.0));
    assert_eq!(story.bus.read(NodeId::N2), Ok(Status::Velocity(9.0)));
}

#[test]
fn stop_and_stop_all_have_been_confirmed_when_they_return() {
    for is_async in BOTH {
        let mut story = Story::new(only_two_and_five()).discovered();
        story.bus.set_velocity(NodeId::N2, rps(3.0)).unwrap();
        story.bus.set_position(NodeId::N5, Position::new(0, 9)).unwrap();
        let stopped = call!(is_async, story.bus, stop_all());
        assert_eq!(stopped, Ok(()));
        assert_eq!(story.told_two(), STOPPED);
        assert_eq!(story.told_five(), HELD);

        story.bus.set_velocity(NodeId::N2, rps(3.0)).unwrap();
        call!(is_async, story.bus, stop(NodeId::N2)).unwrap();
        assert_eq!(story.told_two(), STOPPED);
    }
}

#[test]
fn a_command_whose_node_is_lost_before_it_was_sent_is_not_reported_as_sent() {
    for is_async in BOTH {
        let lost = || {
            let mut config = manual();
            config.nodes = only_two_and_five().nodes;
            let mut story = Story::new(config).discovered();
            story.unplug_two(true);
            for _ in 0..2 {
                assert!(story.bus.read(NodeId::N2).is_err());
                story.world.step(1000);
            }
            // The third READ is on the line, and nothing else can be sent until its window closes.
            story.ask(NodeId::N2);
            story.bus.service().unwrap();
            assert_eq!(story.bus.role().health(NodeId::N2), Some(Health::Suspect(2)));
            story
        };
        let (mut one, mut other, two) = (lost(), lost(), NodeId::N2);
        let turned = call!(is_async, one.bus, set_velocity(two, rps(1.0)));
        assert_eq!(turned, Err(DriveError::Bus(CommandError::NotOnline { node: two })));
        let not_stopped = call!(is_async, other.bus, stop_all());
        assert_eq!(not_stopped, Err(DriveError::StopsOwed(two.into())));
    }
}

#[test]
fn a_read_of_an_unplugged_node_fails_with_its_id_and_its_health_is_reported() {
    for is_async in BOTH {
        let mut story = Story::new(MasterConfig::direct()).discovered();
        events(&mut story.bus);
        story.unplug_two(true);
        let start = story.world.now();
        let error = call!(is_async, story.bus, read(NodeId::N2)).unwrap_err();
        assert_eq!(error, DriveError::ReadFailed { node: NodeId::N2, cause: Cause::Silent });
        assert_eq!(error.to_string(), "node 2 did not answer: nothing was heard");
        assert!(story.world.now() - start < ms(10));
        // Events unrelated to the read have been kept, in order; readings have not.
        let told: Vec<_> = events(&mut story.bus).into_iter().collect();
        let health = |health| MasterEvent::Health { node: NodeId::N2, health };
        let expected = [Health::Suspect(1), Health::Suspect(2), Health::Abnormal].map(health);
        assert_eq!((&told[..], story.bus.role().lost_events()), (&expected[..], 0));
    }
}

#[test]
fn events_come_in_the_order_in_which_they_happened_wherever_they_were_kept() {
    let mut story = Story::new(manual()).discovered();
    story.unplug_two(true);
    for _ in 0..3 {
        assert!(story.bus.read(NodeId::N2).is_err());
        story.world.step(1000);
    }
    story.unplug_two(false);
    while story.bus.role().health(NodeId::N2) != Some(Health::Online) {
        story.bus.service().unwrap();
        story.world.step(20);
    }
    let told = events(&mut story.bus).into_iter().filter_map(|event| match event {
        MasterEvent::Health { health, .. } => Some(health),
        _ => None,
    });
    let expected = [Health::Suspect(1), Health::Suspect(2), Health::Abnormal, Health::Online];
    assert_eq!(told.collect::<Vec<_>>(), expected);
}

#[test]
fn events_without_room_are_counted() {
    let mut story = Story::new(MasterConfig::direct()).discovered();
    // Node 2 comes and goes, and the events are not taken.
    for _ in 0..10 {
        story.unplug_two(true);
        assert!(story.bus.read(NodeId::N2).is_err());
        story.unplug_two(false);
        assert_eq!(story.bus.discover().unwrap(), FOUND);
    }
    let kept = events(&mut story.bus).len();
    assert_eq!(kept, 16);
    // Four events per turn; some of the last turn may still be in the role.
    assert!(story.bus.role().lost_events() >= 40 - 16 - 1, "{}", story.bus.role().lost_events());
}

#[test]
fn a_stop_is_not_given_up_with_its_port_and_goes_on_when_the_port_is_back() {
    for is_async in BOTH {
        let mut story = Story::new(only_two_and_five()).discovered();
        let unplugged = story.bus.port().unplugged.clone();
        unplugged.set(true);
        let bus = &mut story.bus;
        let set = call!(is_async, *bus, set_velocity(NodeId::N2, rps(1.0)));
        assert_eq!(set, Err(GONE));
        let owed = DriveError::StopsOwed(only_two_and_five().nodes);
        assert_eq!(call!(is_async, *bus, stop_all()), Err(owed));
        // The port comes back: the driver continues, and the last command is the one in force.
        unplugged.set(false);
        // A silence follows what may have been cut off.
        bus.port().world.step(1000);
        assert_eq!(bus.discover(), Ok(FOUND.into_iter().collect()));
        assert_eq!(story.told_two(), STOPPED);
    }
}

#[test]
fn a_repeated_discovery_has_the_same_result_after_a_drop_and_cuts_no_packet() {
    dropped_at_any_await(100, |polls| {
        let mut story = Story::new(manual());
        (story.bus.port_mut().most, story.bus.port_mut().stutters) = (1, true);
        let done = story.world.poll_times(polls, story.bus.asynch().discover());
        let found = match done.clone() {
            Some(found) => found,
            None => story.world.block_on(story.bus.asynch().discover()),
        };
        assert_eq!(found.unwrap(), FOUND, "dropped after {polls} polls");
        for node in [&story.two, &story.five] {
            assert_eq!(node.borrow().role().counters().skipped(), 0, "after {polls} polls");
        }
        done.is_some()
    });
}

#[test]
fn a_repeated_read_or_command_has_the_same_result_after_a_drop() {
    dropped_at_any_await(20, |polls| {
        let mut story = Story::new(manual()).discovered();
        (story.bus.port_mut().most, story.bus.port_mut().stutters) = (1, true);
        let (world, bus) = (&story.world, &mut story.bus);
        let done = world
            .poll_times(polls, async {
                bus.asynch().set_velocity(NodeId::N2, rps(4.0)).await?;
                bus.asynch().read(NodeId::N5).await
            })
            .is_some();
        world.block_on(bus.asynch().set_velocity(NodeId::N2, rps(4.0))).unwrap();
        let read = world.block_on(bus.asynch().read(NodeId::N5));
        assert_eq!(read, Ok(Status::Position(Position::new(7, 1))), "after {polls} polls");
        assert_eq!(story.told_two(), Some(Target::Velocity(rps(4.0))));
        for node in [&story.two, &story.five] {
            assert_eq!(node.borrow().role().counters().skipped(), 0, "after {polls} polls");
        }
        done
    });
}

#[test]
fn a_read_that_fails_takes_no_failure_of_another_node() {
    for is_async in BOTH {
        let mut story = Story::new(manual()).discovered();
        events(&mut story.bus);
        for node in [&story.two, &story.five] {
            node.borrow().port().unplugged.set(true);
        }
        story.ask(NodeId::N5);
        for _ in 0..100 {
            story.bus.service().unwrap();
            story.world.pass(20);
        }
        let failed = call!(is_async, story.bus, read(NodeId::N2));
        assert!(matches!(failed, Err(DriveError::ReadFailed { node: NodeId::N2, .. })));
        let failures: Vec<_> = events(&mut story.bus)
            .into_iter()
            .filter_map(|event| match event {
                MasterEvent::ReadFailed { node, .. } => Some(node),
                _ => None,
            })
            .collect();
        assert_eq!(failures, [NodeId::N5]);
    }
}

#[test]
fn a_slaves_next_command_or_its_end_arrives_in_time_or_not_at_all() {
    for is_async in BOTH {
        let mut config = SlaveConfig::direct();
        config.watchdog = Some(ms(5));
        let (mut driver, mut far) = slave(config);
        let world = far.world.clone();
        let mut next = |within| call!(is_async, driver, next_command(within));
        assert_eq!(next(ms(2)), Ok(None));
        assert_eq!(world.now(), at_ms(2));
        let write = WriteRequest::velocity(NodeId::N2, rps(1.5));
        embedded_io::Write::write(&mut far, write.as_bytes()).unwrap();
        let command = SlaveEvent::Command(Target::Velocity(rps(1.5)));
        assert_eq!(next(ms(98)), Ok(Some(command)));
        assert_eq!(world.now(), Instant::from_micros(2160));
        // Then the watchdog ends the wait, but not that of the next call.
        assert_eq!(next(ms(98)), Ok(Some(SlaveEvent::Watchdog)));
        assert_eq!(world.now(), Instant::from_micros(7160));
        assert_eq!(next(ms(98)), Ok(None));
        assert_eq!(world.now(), Instant::from_micros(105_160));
        assert_eq!(driver.poll_event(), None);
    }
}

#[test]
fn an_answer_to_a_request_that_left_after_its_window_is_not_taken_for_the_next_one() {
    for is_async in BOTH {
        let mut config = manual();
        // Only the window itself can tell the answers apart.
        (config.attempts, config.accepts_early) = (3, true);
        let mut story = Story::new(config).discovered();
        let asked = story.bus.port().written.len();
        story.bus.port_mut().writes.push_back(Step::Blocks(3_000_000));
        let first = call!(is_async, story.bus, read(NodeId::N5));
        assert_eq!(first, Err(DriveError::Timeout(Operation::Read { node: NodeId::N5 })));
        assert_eq!(story.bus.port().written.len(), asked + 4, "one READ");
        // The node has answered, and turns.
        story.world.pass(100);
        let turned = Position::new(9, 2);
        story.five.borrow_mut().role_mut().set_position(turned);
        assert_eq!(story.bus.read(NodeId::N5), Ok(Status::Position(turned)), "async {is_async}");
        assert_eq!(story.bus.role().node_statistics(NodeId::N5).late, 1);
    }
}

#[test]
fn an_answer_to_a_request_whose_flush_was_dropped_and_came_late_is_not_taken_for_the_next_one() {
    let mut config = manual();
    (config.attempts, config.accepts_early) = (3, true);
    let mut story = Story::new(config).discovered();
    let asked = story.bus.port().written.len();
    let held_us = story.world.now().as_micros() + 300_000;
    story.bus.port_mut().holds_until_us = held_us;
    story.ask(NodeId::N5);
    // Every call is dropped while the port flushes.
    while story.world.now().as_micros() < held_us + 300 {
        story.world.poll_times(2, story.bus.asynch().service());
        story.world.pass(20);
    }
    assert_eq!(story.bus.port().written.len(), asked + 4, "one READ");
    let turned = Position::new(9, 2);
    story.five.borrow_mut().role_mut().set_position(turned);
    assert_eq!(
        story.world.block_on(story.bus.asynch().read(NodeId::N5)),
        Ok(Status::Position(turned))
    );
    assert_eq!(story.bus.role().node_statistics(NodeId::N5).late, 1);
}

#[test]
fn a_port_that_never_flushes_delays_the_next_request_by_a_second() {
    let mut story = Story::new(manual()).discovered();
    let (asked, begin) = (story.bus.port().written.len(), story.world.now());
    story.bus.port_mut().holds_until_us = 60_000_000;
    story.ask(NodeId::N5);
    story.world.poll_times(2, story.bus.asynch().service());
    story.ask(NodeId::N2);
    let mut next_at = None;
    while next_at.is_none() && story.world.now() - begin < ms(3000) {
        story.world.poll_times(2, story.bus.asynch().service());
        story.world.pass(200);
        next_at = (story.bus.port().written.len() > asked + 4).then(|| story.world.now() - begin);
    }
    let next_us = next_at.expect("a request").as_micros();
    assert!((1_000_000..1_002_000).contains(&next_us), "{next_us} us");
}
