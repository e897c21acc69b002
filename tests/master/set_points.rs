//! Set-points: the latest one is repeated, and a confirmation always ends in one event.

use axlewire::ikeya::Rps;

use crate::rig::*;

#[test]
fn a_command_for_the_wrong_mode_or_an_unknown_node_is_refused() {
    let mut desk = Desk::with_nodes(direct(), &[N1, N3]);
    let wrong = CommandError::WrongMode { node: NodeId::N3, mode: Mode::Position };
    assert_eq!(desk.master.set_velocity(NodeId::N3, Rps::ZERO, desk.now), Err(wrong));
    assert_eq!(wrong.to_string(), "node 3 is in position mode");
    let wrong = CommandError::WrongMode { node: NodeId::N1, mode: Mode::Velocity };
    assert_eq!(desk.master.set_position(NodeId::N1, Position::default(), desk.now), Err(wrong));
    let unknown = CommandError::NotOnline { node: NodeId::N2 };
    assert_eq!(desk.master.set_velocity(NodeId::N2, Rps::ZERO, desk.now), Err(unknown));
    assert_eq!(desk.master.confirm(NodeId::N2, desk.now), Err(unknown));
    let is_kept = |&node: &NodeId| desk.master.set_point(node).is_some();
    assert!(!NodeId::ALL.iter().any(is_kept));
    assert_eq!(writes(&desk.packets(10)), [[0; 0]; 0]);
}

#[test]
fn the_latest_set_point_wins_and_is_repeated_every_cycle() {
    let mut desk = Desk::turning(direct(), 1.0);
    desk.master.set_velocity(NodeId::N1, rps(2.0), desk.now).unwrap();
    for _ in 0..5 {
        assert_eq!(desk.turn(), read(NodeId::N1));
        assert_eq!(desk.sent, [write(NodeId::N1, 2.0)]);
        desk.sent.clear();
        desk.hear(450, &velocity(NodeId::N1, 1.9));
    }
    desk.master.release(NodeId::N1);
    assert_eq!(desk.turn(), read(NodeId::N1));
    assert!(desk.sent.is_empty());
}

#[test]
fn nodes_are_visited_in_turn_with_a_write_before_each_read() {
    let mut desk = Desk::with_nodes(direct(), &[N1, N3]);
    desk.master.set_velocity(NodeId::N1, rps(1.0), desk.now).unwrap();
    desk.master.set_position(NodeId::N3, Position::new(1, 2), desk.now).unwrap();
    let mut order = vec![];
    for _ in 0..6 {
        let request = desk.turn();
        order.extend(desk.sent.drain(..).chain([request.clone()]).map(|it| (it[0], it[1])));
        match request[1] {
            1 => desk.hear(450, &velocity(NodeId::N1, 0.0)),
            _ => desk.hear(450, &position(NodeId::N3, Position::new(7, 3))),
        }
    }
    let first = [(0xBB, 3), (0xBB, 1), (0xAA, 1), (0xAA, 3)];
    let cycle = [(0xBB, 1), (0xAA, 1), (0xBB, 3), (0xAA, 3)];
    assert_eq!(order[..4], first, "new set-points go at once");
    assert_eq!(order[4..], cycle.repeat(2));
}

#[test]
fn a_confirmed_write_is_reported_after_the_read_that_followed_it() {
    let mut desk = Desk::turning(direct(), 1.0);
    desk.master.confirm(NodeId::N1, desk.now).unwrap();
    desk.turn();
    assert_eq!(desk.told(), []);
    desk.hear(450, &velocity(NodeId::N1, 0.5));
    let confirmed = MasterEvent::Confirmed { node: NodeId::N1 };
    assert_eq!(desk.told().last(), Some(&confirmed));
    desk.turn_with(450, &velocity(NodeId::N1, 0.5));
    assert!(!desk.told().contains(&confirmed), "reported once");
}

#[test]
fn a_flood_of_set_points_does_not_keep_the_others_from_being_read() {
    let mut desk = Desk::with_nodes(direct(), &[N1, N3]);
    let mut reads = [0; 9];
    for _ in 0..200 {
        desk.master.set_velocity(NodeId::N1, rps(1.0), desk.now).unwrap();
        let packet = desk.packet();
        if packet[0] == 0xAA {
            reads[usize::from(packet[1])] += 1;
            match packet[1] {
                1 => desk.hear(450, &velocity(NodeId::N1, 0.0)),
                _ => desk.hear(450, &position(NodeId::N3, Position::new(7, 3))),
            }
        }
    }
    assert!(reads[1] >= 40 && reads[3] >= 40, "{reads:?}");
}

/// Sets a node's speed and requests its confirmation.
fn confirming() -> Desk {
    let mut desk = Desk::turning(direct(), 1.0);
    desk.master.confirm(NodeId::N1, desk.now).unwrap();
    desk
}

#[test]
fn a_confirmation_always_ends_in_one_event() {
    type Story = fn(&mut Desk);
    let dropped = Cause::Dropped;
    let stories: [(Story, Option<Cause>); 6] = [
        (|_| (), None),
        (|desk| desk.master.release(NodeId::N1), Some(dropped)),
        (|desk| desk.master.stop(NodeId::N1, desk.now), Some(dropped)),
        (|desk| desk.master.stop_all(desk.now), Some(dropped)),
        (|desk| desk.answer(NodeId::N1, Answer::Silence), Some(Cause::Silent)),
        (|desk| desk.answer(NodeId::N1, Answer::Position(turns(1))), Some(dropped)),
    ];
    for (index, (story, cause)) in stories.into_iter().enumerate() {
        for sent in 0..2 {
            let mut desk = confirming();
            if sent == 1 {
                // The WRITE is on the line.
                assert_eq!(desk.packet(), write(NodeId::N1, 1.0));
            }
            story(&mut desk);
            desk.run(MS(50));
            let ends = |event: &MasterEvent| {
                matches!(event, MasterEvent::Confirmed { .. } | MasterEvent::NotConfirmed { .. })
            };
            let told: Vec<_> = desk.news().into_iter().filter(ends).collect();
            let node = NodeId::N1;
            let end = match cause {
                None => MasterEvent::Confirmed { node },
                Some(cause) => MasterEvent::NotConfirmed { node, cause },
            };
            assert_eq!(told, [end], "story {index}, {sent}");
        }
    }
}

#[test]
fn there_is_nothing_to_confirm_without_a_set_point() {
    let mut desk = Desk::with_nodes(direct(), &[N1]);
    let error = CommandError::NoSetPoint { node: NodeId::N1 };
    assert_eq!(desk.master.confirm(NodeId::N1, desk.now), Err(error));
    assert_eq!(error.to_string(), "node 1 has no set-point");
}

#[test]
fn after_a_failed_flush_an_answer_does_not_confirm_the_write_in_front_of_its_read() {
    let mut desk = confirming();
    desk.turn();
    assert_eq!(desk.sent, [write(NodeId::N1, 1.0)]);
    desk.master.handle_transmit(Unsent::Unflushed, desk.now);
    desk.hear(450, &velocity(NodeId::N1, 0.0));
    assert_eq!(desk.news(), [], "the WRITE may not have left");
    desk.sent.clear();
    desk.turn();
    assert_eq!(desk.sent, [write(NodeId::N1, 1.0)]);
    desk.hear(450, &velocity(NodeId::N1, 0.0));
    assert_eq!(desk.news(), [MasterEvent::Confirmed { node: NodeId::N1 }]);
}
