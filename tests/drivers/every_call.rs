//! Every high-level call, blocking and async: a failing port and a refusal come back as they are.

use axlewire::{
    drive::{DriveError, Driver},
    ikeya::{
        Mode, NodeId, Position, Slave, Target,
        master::{CommandError, NodeSet, StopProgress},
        slave::SlaveConfig,
    },
    time::{Duration, Instant},
};

use crate::{
    bus_rig::{Story, only_two_and_five, rps},
    port::Unplugged,
    virtual_time::{End, VirtualClock, World},
};

const GONE: DriveError<Unplugged> = DriveError::Port(Unplugged);
const PLACE: Position = Position::new(1, 2);

/// The result of a blocking call and of its async twin, each in a story of its own.
macro_rules! both {
    ($story:expr, |$bus:ident| $blocking:expr, $async:expr) => {{
        let mut story = $story;
        let $bus = &mut story.bus;
        let blocking = $blocking;
        let mut story = $story;
        let (world, $bus) = (story.world.clone(), &mut story.bus);
        assert_eq!(world.block_on($async), blocking);
        blocking
    }};
}

fn story() -> Story {
    Story::new(only_two_and_five()).discovered()
}

fn unplugged() -> Story {
    let story = story();
    story.bus.port().unplugged.set(true);
    story
}

fn later(bus: &mut crate::bus_rig::Bus) -> Instant {
    bus.now() + Duration::from_millis(5)
}

#[test]
fn a_port_that_has_gone_is_the_error_of_every_call_of_a_master() {
    let (two, five) = (NodeId::N2, NodeId::N5);
    let span = Duration::from_millis(5);
    let found = both!(unplugged(), |bus| bus.discover(), bus.discover_async());
    assert_eq!(found, Err(GONE));
    let read = both!(unplugged(), |bus| bus.read(five), bus.read_async(five));
    assert_eq!(read, Err(GONE));
    let sent = both!(
        unplugged(),
        |bus| bus.set_velocity(two, rps(1.0)),
        bus.set_velocity_async(two, rps(1.0))
    );
    assert_eq!(sent, Err(GONE));
    let sent = both!(
        unplugged(),
        |bus| bus.set_position(five, PLACE),
        bus.set_position_async(five, PLACE)
    );
    assert_eq!(sent, Err(GONE));
    let driven = both!(
        unplugged(),
        |bus| bus.drive_for(two, rps(1.0), span),
        bus.drive_for_async(two, rps(1.0), span)
    );
    assert_eq!(driven, Err(DriveError::StopsOwed(two.into())));
    let stopped = both!(unplugged(), |bus| bus.stop(five), bus.stop_async(five));
    assert_eq!(stopped, Err(DriveError::StopsOwed(five.into())));
    let still = both!(
        unplugged(),
        |bus| {
            let deadline = later(bus);
            bus.await_standstill(NodeSet::ALL, deadline)
        },
        {
            let deadline = later(bus);
            bus.await_standstill_async(NodeSet::ALL, deadline)
        }
    );
    assert_eq!(still, Err(GONE));
    let event = both!(
        unplugged(),
        |bus| {
            let deadline = later(bus);
            bus.next_event(deadline)
        },
        {
            let deadline = later(bus);
            bus.next_event_async(deadline)
        }
    );
    assert_eq!(event, Err(GONE));
    let run = both!(
        unplugged(),
        |bus| {
            let deadline = later(bus);
            bus.run_until(deadline, |_, _, _| {})
        },
        {
            let deadline = later(bus);
            bus.run_until_async(deadline, |_, _, _| {})
        }
    );
    assert_eq!(run, Err(GONE));
}

#[test]
fn a_refusal_of_the_master_is_the_error_of_its_call_and_sends_nothing() {
    let (two, five, span) = (NodeId::N2, NodeId::N5, Duration::from_millis(5));
    let written = |story: &Story| story.bus.port().written.len();
    let before = written(&story());
    let absent = DriveError::Bus(CommandError::NotOnline { node: NodeId::N7 });
    let is_position = DriveError::Bus(CommandError::WrongMode { node: five, mode: Mode::Position });
    let is_velocity = DriveError::Bus(CommandError::WrongMode { node: two, mode: Mode::Velocity });
    for is_async in [false, true] {
        let mut story = story();
        let (world, bus) = (story.world.clone(), &mut story.bus);
        let (read, aimed, placed, driven);
        if is_async {
            read = world.block_on(bus.read_async(NodeId::N7)).map(drop);
            aimed = world.block_on(bus.set_velocity_async(five, rps(1.0)));
            placed = world.block_on(bus.set_position_async(two, PLACE));
            driven = world.block_on(bus.drive_for_async(five, rps(1.0), span));
        } else {
            read = bus.read(NodeId::N7).map(drop);
            aimed = bus.set_velocity(five, rps(1.0));
            placed = bus.set_position(two, PLACE);
            driven = bus.drive_for(five, rps(1.0), span);
        }
        assert_eq!((read, aimed), (Err(absent), Err(is_position)));
        assert_eq!((placed, driven), (Err(is_velocity), Err(is_position)));
        assert_eq!((written(&story), story.bus.role().stops_owed()), (before, NodeSet::NONE));
    }
}

#[test]
fn a_port_that_has_gone_is_the_error_of_a_slave_that_waits_for_a_command() {
    for is_async in [false, true] {
        let world = World::default();
        let slave: Slave =
            Slave::new(NodeId::N2, Mode::Velocity, SlaveConfig::direct(), Instant::from_micros(0));
        let mut driver = Driver::new(slave, End::new(&world, 20), VirtualClock(world.clone()));
        driver.port().unplugged.set(true);
        let deadline = Instant::from_millis(5);
        let command = match is_async {
            false => driver.next_command(deadline),
            true => world.block_on(driver.next_command_async(deadline)),
        };
        assert_eq!(command, Err(GONE));
    }
}

#[test]
fn a_stop_of_all_stops_a_node_that_has_answered_although_the_settings_do_not_name_it() {
    for is_async in [false, true] {
        let mut config = only_two_and_five();
        config.nodes = NodeId::N2.into();
        let mut story = Story::new(config);
        let (world, bus) = (story.world.clone(), &mut story.bus);
        assert_eq!(bus.discover().unwrap().len(), 1);
        // It is heard because it is stopped.
        bus.stop(NodeId::N5).unwrap();
        bus.set_position(NodeId::N5, PLACE).unwrap();
        match is_async {
            true => world.block_on(bus.stop_all_async()).unwrap(),
            false => bus.stop_all().unwrap(),
        }
        for node in [NodeId::N2, NodeId::N5] {
            assert_ne!(bus.role().stop_progress(node), StopProgress::NotAsked, "{node}");
        }
        assert_ne!(bus.role().set_point(NodeId::N5), Some(Target::Position(PLACE)));
    }
}

#[test]
fn a_stop_of_all_lists_a_silent_node_although_the_settings_do_not_name_it() {
    for is_async in [false, true] {
        let mut config = only_two_and_five();
        config.nodes = NodeId::N2.into();
        let mut story = Story::new(config);
        let (world, bus) = (story.world.clone(), &mut story.bus);
        bus.discover().unwrap();
        bus.stop(NodeId::N5).unwrap();
        story.five.borrow().port().unplugged.set(true);
        let stopped = match is_async {
            true => world.block_on(bus.stop_all_async()),
            false => bus.stop_all(),
        };
        assert_eq!(stopped, Err(DriveError::StopsOwed(NodeId::N5.into())));
    }
}
