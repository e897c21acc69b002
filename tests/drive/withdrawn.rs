//! Set-points that are withdrawn because their calls fail: the node is owed a stop (I12).

use crate::rig::*;

fn set(story: &mut Story, is_async: bool) -> Result<(), DriveError<Unplugged>> {
    call!(is_async, story.bus, set_velocity(NodeId::N2, rps(3.0)))
}

/// How a port fails a set-point: it takes this many bytes, or all bytes and fails to flush.
fn fail_packet(story: &mut Story, taken: usize) {
    match taken {
        8 => story.bus.port_mut().flushes.push_back(Step::Error),
        0 => story.bus.port_mut().writes.push_back(Step::Error),
        _ => story.bus.port_mut().writes.extend([Step::Few(taken), Step::Error]),
    }
}

#[test]
fn a_set_point_that_is_withdrawn_because_its_call_fails_owes_the_node_a_stop() {
    for (taken, has_order) in (0..=8).flat_map(|taken| [(taken, false), (taken, true)]) {
        for is_async in BOTH {
            let mut story = Story::new(manual()).discovered();
            if has_order {
                story.bus.set_velocity(NodeId::N2, rps(1.0)).unwrap();
                story.world.pass(1000);
            }
            fail_packet(&mut story, taken);
            assert_eq!(set(&mut story, is_async), Err(DriveError::Port(Unplugged)));
            assert_eq!(story.bus.role().set_point(NodeId::N2), None);
            assert!(story.bus.unsent().is_empty(), "the rest would complete it");
            assert_eq!(story.bus.role().stops_owed(), only(NodeId::N2), "after {taken} bytes");
            story.run(20);
            assert_eq!(story.bus.role().stops_owed(), NodeSet::NONE);
            assert_eq!(story.told_two(), STOPPED, "after {taken} bytes");
        }
    }
}

#[test]
fn a_position_that_is_withdrawn_because_its_call_fails_is_held_where_the_node_is() {
    for taken in 0..=8 {
        for is_async in BOTH {
            let mut story = Story::new(manual()).discovered();
            fail_packet(&mut story, taken);
            let far = Position::new(0, 100);
            let moved = call!(is_async, story.bus, set_position(NodeId::N5, far));
            assert_eq!(moved, Err(DriveError::Port(Unplugged)));
            assert_eq!(story.bus.role().stops_owed(), only(NodeId::N5));
            story.run(20);
            assert_eq!(story.told_five(), HELD, "after {taken} bytes");
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
            story.bus.port_mut().reads.push_back(Step::Error);
        } else {
            // The WRITE and the beginning of the next READ.
            let steps = [Step::Few(8), Step::Few(2), Step::Error];
            story.bus.port_mut().writes.extend(steps);
        }
        assert_eq!(set(&mut story, is_async), Err(DriveError::Port(Unplugged)));
        assert_eq!(story.bus.role().set_point(NodeId::N2), None);
        assert_eq!(story.bus.role().stops_owed(), only(NodeId::N2));
        story.run(20);
        assert_eq!((story.bus.role().stops_owed(), story.told_two()), (NodeSet::NONE, STOPPED));
    }
}

#[test]
fn a_node_lost_while_its_set_point_waits_is_owed_a_stop_even_where_lost_nodes_are_not() {
    let mut config = only_two_and_five();
    config.stops_abnormal = false;
    let mut story = Story::new(config).discovered();
    let last = Some(Health::Suspect(2));
    story.unplug_two(true);
    // Its third READ without an answer is under way.
    let read = ReadRequest::new(NodeId::N2);
    let is_under_way = |bus: &Bus| {
        bus.role().health(NodeId::N2) == last && bus.port().written.ends_with(read.as_bytes())
    };
    while !is_under_way(&story.bus) {
        story.bus.service().unwrap();
        story.world.pass(20);
    }
    let refused = story.bus.set_velocity(NodeId::N2, rps(1.0));
    let not_online = CommandError::NotOnline { node: NodeId::N2 };
    assert_eq!(refused, Err(DriveError::Bus(not_online)));
    assert_eq!(story.bus.role().stops_owed(), NodeId::N2.into());
}
