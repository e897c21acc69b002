//! Every high-level call, blocking and async: a failing port and a refusal come back as they are.

use crate::rig::*;

const PLACE: Position = Position::new(1, 2);

fn story() -> Story {
    Story::new(only_two_and_five()).discovered()
}

fn unplugged() -> Story {
    let story = story();
    story.bus.port().unplugged.set(true);
    story
}

#[test]
fn a_port_that_has_gone_is_the_error_of_every_call_of_a_master() {
    let (two, five, span, turn) = (NodeId::N2, NodeId::N5, ms(5), rps(1.0));
    /// The result of both forms of a call.
    macro_rules! gone {
        ($name:ident($($argument:expr),*)) => {
            both(|is_async| {
                let mut story = unplugged();
                call!(is_async, story.bus, $name($($argument),*))
            })
        };
    }
    assert_eq!(gone!(discover()), Err(GONE));
    assert_eq!(gone!(read(five)), Err(GONE));
    assert_eq!(gone!(set_velocity(two, turn)), Err(GONE));
    assert_eq!(gone!(set_position(five, PLACE)), Err(GONE));
    let owed = |node| Err(DriveError::StopsOwed(only(node)));
    assert_eq!(gone!(drive_for(two, turn, span)), owed(two));
    assert_eq!(gone!(stop(five)), owed(five));
    assert_eq!(gone!(next_event(span)), Err(GONE));
    assert_eq!(gone!(run_for(span, |_, _, _| {})), Err(GONE));
}

#[test]
fn a_refusal_of_the_master_is_the_error_of_its_call_and_sends_nothing() {
    let (two, five) = (NodeId::N2, NodeId::N5);
    let written = |story: &Story| story.bus.port().written.len();
    let before = written(&story());
    let absent = DriveError::Bus(CommandError::NotOnline { node: NodeId::N7 });
    let is_position = DriveError::Bus(CommandError::WrongMode { node: five, mode: Mode::Position });
    let is_velocity = DriveError::Bus(CommandError::WrongMode { node: two, mode: Mode::Velocity });
    for is_async in BOTH {
        let mut story = story();
        let bus = &mut story.bus;
        let read = call!(is_async, *bus, read(NodeId::N7)).map(drop);
        let aimed = call!(is_async, *bus, set_velocity(five, rps(1.0)));
        let placed = call!(is_async, *bus, set_position(two, PLACE));
        let driven = call!(is_async, *bus, drive_for(five, rps(1.0), ms(5)));
        assert_eq!((read, aimed), (Err(absent), Err(is_position)));
        assert_eq!((placed, driven), (Err(is_velocity), Err(is_position)));
        assert_eq!((written(&story), story.bus.role().stops_owed()), (before, NodeSet::NONE));
    }
}

#[test]
fn a_port_that_has_gone_is_the_error_of_a_slave_that_waits_for_a_command() {
    for is_async in BOTH {
        let (mut slave, _far) = slave(SlaveConfig::direct());
        slave.port().unplugged.set(true);
        let within = at_ms(5) - slave.now();
        let command = call!(is_async, slave, next_command(within));
        assert_eq!(command, Err(GONE));
    }
}

/// A bus whose settings name node 2 only; node 5 is heard because it is stopped.
fn five_is_not_named() -> Story {
    let mut config = only_two_and_five();
    config.nodes = NodeId::N2.into();
    let mut story = Story::new(config);
    assert_eq!(story.bus.discover().unwrap().len(), 1);
    story.bus.stop(NodeId::N5).unwrap();
    story
}

#[test]
fn a_stop_of_all_lists_a_silent_node_although_the_settings_do_not_name_it() {
    for is_async in BOTH {
        let mut story = five_is_not_named();
        story.five.borrow().port().unplugged.set(true);
        let stopped = call!(is_async, story.bus, stop_all());
        assert_eq!(stopped, Err(DriveError::StopsOwed(NodeId::N5.into())));
    }
}
