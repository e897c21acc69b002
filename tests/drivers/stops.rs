//! Stops through a driver: `Ok` only for a paid one, and `drive_for` ends with one (I12).

use std::{cell::Cell, rc::Rc};

use axlewire::{
    drive::DriveError,
    endpoint::Endpoint,
    ikeya::{
        Mode, NodeId, Position, ReadRequest, Rps, Target, WriteRequest,
        board::OneMotor,
        master::{CommandError, Health, MasterConfig, MasterEvent, NodeSet, StopProgress},
    },
    time::{Duration, Instant},
};

use crate::{
    bus_rig::{Bus, Story, manual, only_two_and_five, rps},
    port::Unplugged,
};

type Outcome = Result<(), DriveError<Unplugged>>;

const OWED_2: DriveError<Unplugged> = DriveError::StopsOwed(only(NodeId::N2));
const MS: fn(u32) -> Duration = Duration::from_millis;

const fn only(node: NodeId) -> NodeSet {
    let mut nodes = NodeSet::NONE;
    nodes.insert(node);
    nodes
}

fn stop(story: &mut Story, is_async: bool) -> Outcome {
    match is_async {
        true => story.world.block_on(story.bus.stop_async(NodeId::N2)),
        false => story.bus.stop(NodeId::N2),
    }
}

fn drive_for(story: &mut Story, span: Duration, is_async: bool) -> Outcome {
    match is_async {
        true => story.world.block_on(story.bus.drive_for_async(NodeId::N2, rps(3.0), span)),
        false => story.bus.drive_for(NodeId::N2, rps(3.0), span),
    }
}

fn command(story: &Story) -> Option<Target<OneMotor>> {
    story.pass(1000);
    story.two.borrow().role().command(story.world.now())
}

const STOPPED: Option<Target<OneMotor>> = Some(Target::Velocity(Rps::ZERO));

/// From now on the port fails, for this long.
fn fail_port(story: &Story, from: Instant, span: Duration) {
    let (world, unplugged) = (story.world.clone(), story.bus.port().unplugged.clone());
    story.world.add(move || {
        let now = world.now();
        unplugged.set(now >= from && now < from + span);
    });
}

#[test]
fn a_stop_that_is_not_paid_is_an_error_at_its_stated_deadline_and_stays_owed() {
    for is_async in [false, true] {
        let mut story = Story::new(MasterConfig::direct()).discovered();
        story.bus.set_velocity(NodeId::N2, rps(3.0)).unwrap();
        story.two.borrow().port().unplugged.set(true);
        let (begin, bound) = (story.world.now(), story.bus.role().stop_bound());
        assert_eq!(bound, Duration::from_micros(151_200), "a tenth of a second and a half");
        assert_eq!(stop(&mut story, is_async), Err(OWED_2));
        let took = story.world.now() - begin;
        assert!(took >= bound && took < bound + MS(1), "{took:?} of {bound:?}");
        assert_eq!(story.bus.role().stops_owed(), only(NodeId::N2));
        // The next calls continue it.
        story.two.borrow().port().unplugged.set(false);
        let end = story.world.now() + MS(100);
        story.bus.run_until(end, |_, _, _| ()).unwrap();
        assert_eq!(story.bus.role().stops_owed(), NodeSet::NONE);
        assert_eq!(command(&story), STOPPED);
    }
    let told = OWED_2.to_string();
    assert_eq!(told, "stop of node 2 not confirmed: a motor may be running");
}

#[test]
fn a_stop_continues_through_errors_of_the_port() {
    for is_async in [false, true] {
        let mut story = Story::new(MasterConfig::direct()).discovered();
        story.bus.set_velocity(NodeId::N2, rps(3.0)).unwrap();
        let begin = story.world.now();
        fail_port(&story, begin, MS(10));
        assert_eq!(stop(&mut story, is_async), Ok(()));
        assert!(story.world.now() > begin + MS(10));
        assert_eq!(command(&story), STOPPED);
    }
}

#[test]
fn a_stop_of_all_lists_the_ids_that_have_never_answered() {
    for is_async in [false, true] {
        let mut story = Story::new(MasterConfig::direct());
        let stopped = match is_async {
            true => story.world.block_on(story.bus.stop_all_async()),
            false => story.bus.stop_all(),
        };
        let mut silent = NodeSet::ALL;
        silent.remove(NodeId::N2);
        silent.remove(NodeId::N5);
        assert_eq!(stopped, Err(DriveError::StopsOwed(silent)));
        assert_eq!(command(&story), STOPPED, "nodes that answer are stopped");
        let held = Some(Target::Position(Position::new(7, 1)));
        assert_eq!(story.five.borrow().role().command(story.world.now()), held);
        let mut story = Story::new(only_two_and_five());
        let stopped = match is_async {
            true => story.world.block_on(story.bus.stop_all_async()),
            false => story.bus.stop_all(),
        };
        assert_eq!(stopped, Ok(()), "no discovery is needed first");
    }
}

#[test]
fn drive_for_keeps_the_command_for_its_time_and_ends_with_a_paid_stop() {
    for is_async in [false, true] {
        let mut story = Story::new(MasterConfig::direct()).discovered();
        let begin = story.world.now();
        assert_eq!(drive_for(&mut story, MS(50), is_async), Ok(()));
        let took = story.world.now() - begin;
        assert!(took >= MS(50) && took < MS(55), "{took:?}");
        assert_eq!(story.bus.role().stop_progress(NodeId::N2), StopProgress::Paid);
        assert_eq!(command(&story), STOPPED);
        let writes = story.two.borrow().role().statistics().writes;
        assert!(writes > 20, "only {writes} writes: the command is not repeated");
    }
}

#[test]
fn drive_for_is_a_constant_sign_of_life_even_on_a_quiet_bus() {
    for limit in [Duration::from_micros(1), MS(1), MS(20)] {
        for is_async in [false, true] {
            let mut config = manual();
            config.dead_man = Some(limit);
            let mut story = Story::new(config).discovered();
            if limit >= MS(1) {
                assert_eq!(drive_for(&mut story, MS(100), is_async), Ok(()));
                assert_eq!(story.bus.role().statistics().dead_man, 0);
            } else {
                // The virtual clock is too coarse for this: the dead-man fires rightly, and the
                // call ends.
                assert!(drive_for(&mut story, MS(100), is_async).is_err());
            }
            assert_eq!(command(&story), STOPPED);
        }
    }
}

#[test]
fn drive_for_through_errors_of_the_port_ends_with_a_paid_stop_and_returns_the_error() {
    for (after, span) in [(0, 5), (1, 5), (20, 1), (20, 5)] {
        for is_async in [false, true] {
            let mut story = Story::new(MasterConfig::direct()).discovered();
            let begin = story.world.now();
            fail_port(&story, begin + MS(after), MS(span));
            let driven = drive_for(&mut story, MS(50), is_async);
            assert_eq!(driven, Err(DriveError::Port(Unplugged)), "{after} ms");
            assert!(story.world.now() < begin + MS(45), "it kept driving");
            assert_eq!(story.bus.role().stops_owed(), NodeSet::NONE);
            assert_eq!(command(&story), STOPPED);
        }
    }
}

#[test]
fn drive_for_of_a_lost_node_ends_with_the_owed_stop() {
    for is_async in [false, true] {
        let mut story = Story::new(MasterConfig::direct()).discovered();
        let (world, two) = (story.world.clone(), story.two.clone());
        let lost = story.world.now() + MS(10);
        let unplugged: Rc<Cell<bool>> = two.borrow().port().unplugged.clone();
        story.world.add(move || unplugged.set(world.now() >= lost));
        assert_eq!(drive_for(&mut story, MS(5000), is_async), Err(OWED_2));
        assert!(story.world.now() < lost + MS(500), "at once, not at the end of its time");
    }
}

#[test]
fn drive_for_that_is_refused_sends_nothing() {
    for is_async in [false, true] {
        let mut story = Story::new(manual()).discovered();
        let error = CommandError::WrongMode { node: NodeId::N5, mode: Mode::Position };
        let driven = match is_async {
            true => story.world.block_on(story.bus.drive_for_async(NodeId::N5, rps(1.0), MS(5))),
            false => story.bus.drive_for(NodeId::N5, rps(1.0), MS(5)),
        };
        assert_eq!(driven, Err(error.into()));
        assert_eq!(story.bus.role().statistics().writes, 0);
        assert_eq!(story.bus.role().stops_owed(), NodeSet::NONE);
    }
}

#[test]
fn a_dropped_drive_for_leaves_a_stop_that_the_next_call_sends() {
    let mut polls = 0;
    loop {
        let mut story = Story::new(manual()).discovered();
        (story.bus.port_mut().most, story.bus.port_mut().stutters) = (1, true);
        let drive = story.bus.drive_for_async(NodeId::N2, rps(3.0), MS(1));
        let is_done = story.world.poll_times(polls, drive).is_some();
        if polls > 0 && !is_done {
            assert_eq!(story.bus.role().stops_owed(), only(NodeId::N2), "after {polls} polls");
        }
        assert_eq!(story.bus.role().set_point(NodeId::N2).filter(|it| Some(*it) != STOPPED), None);
        // Any call.
        let end = story.world.now() + MS(30);
        story.world.block_on(story.bus.next_event_async(story.world.now())).unwrap();
        story.world.block_on(story.bus.run_until_async(end, |_, _, _| ())).unwrap();
        assert_eq!(story.bus.role().stops_owed(), NodeSet::NONE);
        let was_told = story.two.borrow().role().statistics().writes > 0;
        assert_eq!(command(&story), STOPPED.filter(|_| was_told), "after {polls} polls");
        assert!(was_told || polls == 0);
        // A set-point WRITE that had begun is not completed.
        assert!(story.two.borrow().role().counters().skipped() < WriteRequest::LEN as u64);
        if is_done {
            break;
        }
        polls += 1;
    }
    assert!(polls > 30, "{polls}");
}

#[test]
fn a_dropped_stop_is_owed_and_the_next_call_sends_it() {
    let mut story = Story::new(manual()).discovered();
    story.bus.set_velocity(NodeId::N2, rps(3.0)).unwrap();
    story.bus.port_mut().stutters = true;
    assert_eq!(story.world.poll_times(1, story.bus.stop_async(NodeId::N2)), None);
    assert_eq!(story.bus.role().stops_owed(), only(NodeId::N2));
    let end = story.world.now() + MS(10);
    story.bus.run_until(end, |_, _, _| ()).unwrap();
    assert_eq!(command(&story), STOPPED);
}

#[test]
fn await_standstill_waits_until_the_deadline_and_names_the_moving_nodes() {
    for config in [MasterConfig::direct(), manual()] {
        for is_async in [false, true] {
            let mut story = Story::new(config).discovered();
            let nodes = only_two_and_five().nodes;
            let wait = |story: &mut Story, deadline| match is_async {
                true => story.world.block_on(story.bus.await_standstill_async(nodes, deadline)),
                false => story.bus.await_standstill(nodes, deadline),
            };
            stop(&mut story, is_async).unwrap();
            // Node 2 reports that it still turns at 0.5 rps, and node 5 has not been stopped.
            let deadline = story.world.now() + MS(50);
            assert_eq!(wait(&mut story, deadline), Ok(nodes));
            assert!(story.world.now() >= deadline);
            story.two.borrow_mut().role_mut().set_velocity(rps(0.01));
            story.bus.stop(NodeId::N5).unwrap();
            let deadline = story.world.now() + MS(1000);
            assert_eq!(wait(&mut story, deadline), Ok(NodeSet::NONE));
            assert!(story.world.now() < deadline);
            let still = MasterEvent::StandingStill { node: NodeId::N5 };
            let mut events = core::iter::from_fn(|| story.bus.role_mut().poll_event());
            assert!(events.any(|event| event == still));
        }
    }
}

fn set(story: &mut Story, is_async: bool) -> Outcome {
    match is_async {
        true => story.world.block_on(story.bus.set_velocity_async(NodeId::N2, rps(3.0))),
        false => story.bus.set_velocity(NodeId::N2, rps(3.0)),
    }
}

/// How a port fails a set-point: it takes this many bytes, or all bytes and fails to flush.
fn fail_packet(story: &mut Story, taken: usize) {
    match taken {
        8 => story.bus.port_mut().fails_flush = true,
        _ => story.bus.port_mut().fails_after = Some(taken),
    }
}

#[test]
fn a_set_point_that_is_withdrawn_because_its_call_fails_owes_the_node_a_stop() {
    for (taken, has_order) in (0..=8).flat_map(|taken| [(taken, false), (taken, true)]) {
        for is_async in [false, true] {
            let mut story = Story::new(manual()).discovered();
            if has_order {
                story.bus.set_velocity(NodeId::N2, rps(1.0)).unwrap();
                story.pass(1000);
            }
            fail_packet(&mut story, taken);
            assert_eq!(set(&mut story, is_async), Err(DriveError::Port(Unplugged)));
            assert_eq!(story.bus.role().set_point(NodeId::N2), None);
            assert!(story.bus.unsent().is_empty(), "the rest would complete it");
            assert_eq!(story.bus.role().stops_owed(), only(NodeId::N2), "after {taken} bytes");
            let end = story.world.now() + MS(20);
            story.bus.run_until(end, |_, _, _| ()).unwrap();
            assert_eq!(story.bus.role().stops_owed(), NodeSet::NONE);
            assert_eq!(command(&story), STOPPED, "after {taken} bytes");
        }
    }
}

#[test]
fn a_position_that_is_withdrawn_because_its_call_fails_is_held_where_the_node_is() {
    for taken in 0..=8 {
        for is_async in [false, true] {
            let mut story = Story::new(manual()).discovered();
            fail_packet(&mut story, taken);
            let far = Position::new(0, 100);
            let moved = match is_async {
                true => story.world.block_on(story.bus.set_position_async(NodeId::N5, far)),
                false => story.bus.set_position(NodeId::N5, far),
            };
            assert_eq!(moved, Err(DriveError::Port(Unplugged)));
            assert_eq!(story.bus.role().stops_owed(), only(NodeId::N5));
            let end = story.world.now() + MS(20);
            story.bus.run_until(end, |_, _, _| ()).unwrap();
            story.pass(1000);
            let here = Target::Position(Position::new(7, 1));
            assert_eq!(
                story.five.borrow().role().command(story.world.now()),
                Some(here),
                "after {taken} bytes"
            );
        }
    }
}

#[test]
fn a_set_point_that_the_master_refuses_owes_no_stop() {
    let mut story = Story::new(manual()).discovered();
    for node in [NodeId::N5, NodeId::N8] {
        assert!(story.bus.set_velocity(node, rps(3.0)).is_err());
        assert_eq!(story.bus.role().stops_owed(), NodeSet::NONE);
    }
}

#[test]
fn a_set_point_that_has_left_is_withdrawn_as_well_where_its_call_fails() {
    for (is_async, is_deaf) in [(false, false), (false, true), (true, false), (true, true)] {
        let mut story = Story::new(only_two_and_five()).discovered();
        if is_deaf {
            story.bus.port_mut().failing_reads = 1;
        } else {
            // The WRITE and the beginning of the next READ.
            story.bus.port_mut().fails_after = Some(8 + 2);
        }
        assert_eq!(set(&mut story, is_async), Err(DriveError::Port(Unplugged)));
        assert_eq!(story.bus.role().set_point(NodeId::N2), None);
        assert_eq!(story.bus.role().stops_owed(), only(NodeId::N2));
        let end = story.world.now() + MS(20);
        story.bus.run_until(end, |_, _, _| ()).unwrap();
        assert_eq!((story.bus.role().stops_owed(), command(&story)), (NodeSet::NONE, STOPPED));
    }
}

#[test]
fn a_node_lost_while_its_set_point_waits_is_owed_a_stop_even_where_lost_nodes_are_not() {
    let mut config = only_two_and_five();
    config.stops_abnormal = false;
    let mut story = Story::new(config).discovered();
    let last = Some(Health::Suspect(2));
    story.two.borrow().port().unplugged.set(true);
    // Its third READ without an answer is under way.
    let read = ReadRequest::new(NodeId::N2);
    let is_under_way = |bus: &Bus| {
        bus.role().health(NodeId::N2) == last && bus.port().written.ends_with(read.as_bytes())
    };
    while !is_under_way(&story.bus) {
        story.bus.service().unwrap();
        story.pass(20);
    }
    let refused = story.bus.set_velocity(NodeId::N2, rps(1.0));
    let not_online = CommandError::NotOnline { node: NodeId::N2 };
    assert_eq!(refused, Err(DriveError::Bus(not_online)));
    assert_eq!(story.bus.role().stops_owed(), NodeId::N2.into());
}
