//! The dead-man of a master: a silent application stops its nodes (I13).

use crate::rig::*;

fn armed() -> MasterConfig {
    with(direct(), |config| config.dead_man = Some(MS(100)))
}

/// Node 1 was told to turn at this time.
fn turning(config: MasterConfig) -> (Desk, Instant) {
    let mut desk = Desk::with_nodes(config, &[N1, N3]);
    desk.master.set_velocity(NodeId::N1, rps(5.0), desk.now).unwrap();
    let told = desk.now;
    (desk, told)
}

fn has_died(desk: &mut Desk) -> bool {
    desk.news().contains(&MasterEvent::DeadMan)
}

#[test]
fn a_master_has_no_dead_man_by_default() {
    let (mut desk, _) = turning(direct());
    for _ in 0..100 {
        // For hours, with a dead application.
        desk.now += MS(360_000);
        let written = writes(&desk.packets(10));
        assert!(written.iter().all(|it| *it == write(NodeId::N1, 5.0)) && !written.is_empty());
    }
    assert_eq!(desk.master.statistics().dead_man, 0);
}

#[test]
fn a_silent_application_stops_every_node_whose_latest_order_is_no_stop() {
    let (mut desk, told) = turning(armed());
    let mut last = None;
    while !has_died(&mut desk) {
        let packet = desk.exchange().unwrap();
        if packet == write(NodeId::N1, 5.0) {
            last = Some(desk.now);
        }
    }
    assert!(last.unwrap() < told + MS(100), "a set-point outlives its application");
    assert!(desk.now < told + MS(102));
    assert_eq!(desk.master.stops_owed(), NodeId::N1.into(), "node 3 was never told to move");
    let written = writes(&desk.run(MS(50)));
    assert!(written.len() > 2 && written.iter().all(|it| *it == write(NodeId::N1, 0.0)));
    assert_eq!(desk.master.statistics().dead_man, 1);
    assert!(!has_died(&mut desk), "reported once");
    // The application is back.
    assert_eq!(desk.master.set_velocity(NodeId::N1, rps(5.0), desk.now), Ok(()));
    desk.run(MS(90));
    assert!(!has_died(&mut desk));
    desk.run(MS(20));
    assert!(has_died(&mut desk));
    assert_eq!(desk.master.statistics().dead_man, 2, "each time");
}

#[test]
fn the_deadline_of_the_dead_man_is_reported_and_kept_to_the_microsecond() {
    let config = with(armed(), |config| config.polling = Polling::Manual);
    let (mut desk, told) = turning(config);
    desk.packets(1);
    let end = told + MS(100);
    assert_eq!(desk.master.poll_timeout(), Some(end));
    desk.master.handle_timeout(Instant::from_micros(end.as_micros() - 1));
    assert!(!has_died(&mut desk));
    desk.master.handle_timeout(end);
    assert!(has_died(&mut desk));
}

#[test]
fn a_late_driver_sends_no_set_point_of_a_dead_application() {
    let (mut desk, told) = turning(armed());
    // Not even handle_timeout was called.
    desk.now = told + MS(100);
    let sent = desk.master.poll_transmit(desk.now).map(<[u8]>::to_vec);
    assert_eq!(sent, Some(write(NodeId::N1, 0.0)));
}

#[test]
fn a_set_point_a_stop_and_keep_alive_are_signs_of_life() {
    type Sign = fn(&mut Desk);
    let signs: [Sign; 4] = [
        |desk| desk.master.set_position(NodeId::N3, turns(1), desk.now).unwrap(),
        |desk| desk.master.stop(NodeId::N3, desk.now),
        |desk| desk.master.stop_all(desk.now),
        |desk| desk.master.keep_alive(desk.now),
    ];
    for (index, sign) in signs.into_iter().enumerate() {
        let (mut desk, told) = turning(armed());
        desk.run(MS(90));
        sign(&mut desk);
        desk.run(MS(90));
        assert!(!has_died(&mut desk), "sign {index}");
        let is_stopped = index == 2;
        desk.run(MS(20));
        assert_eq!(has_died(&mut desk), !is_stopped, "sign {index}");
        assert!(desk.now >= told + MS(200));
    }
}

#[test]
fn a_refused_set_point_or_a_query_is_not_a_sign_of_life() {
    let (mut desk, told) = turning(armed());
    let refused = CommandError::NotOnline { node: NodeId::N2 };
    while desk.now < told + MS(110) {
        assert_eq!(desk.master.set_velocity(NodeId::N2, rps(1.0), desk.now), Err(refused));
        assert!(desk.master.set_position(NodeId::N1, turns(1), desk.now).is_err());
        desk.master.read(NodeId::N1, desk.now).unwrap();
        let _ = desk.master.confirm(NodeId::N1, desk.now);
        assert!(desk.master.status(NodeId::N1).is_some());
        // Also takes the events.
        desk.exchange();
    }
    assert!(has_died(&mut desk));
}

#[test]
fn a_released_node_is_stopped_by_the_dead_man_because_it_turns_on() {
    let (mut desk, _) = turning(armed());
    desk.packets(2);
    desk.master.release(NodeId::N1);
    desk.run(MS(110));
    assert!(has_died(&mut desk));
    assert_eq!(desk.master.set_point(NodeId::N1).map(|it| it.mode()), Some(N1.1));
    assert_eq!(desk.master.stops_owed(), NodeSet::NONE, "it has been stopped by now");
}

#[test]
fn the_dead_man_stops_a_node_that_was_lost_without_its_stop() {
    let config = with(armed(), |config| config.stops_abnormal = false);
    let (mut desk, _) = turning(config);
    desk.packets(2);
    desk.lose(NodeId::N1);
    assert_eq!(desk.master.stops_owed(), NodeSet::NONE);
    desk.run(MS(110));
    assert_eq!(desk.master.stops_owed(), NodeId::N1.into());
}

#[test]
fn a_node_that_has_been_stopped_needs_no_sign_of_life() {
    let (mut desk, _) = turning(armed());
    desk.master.stop(NodeId::N1, desk.now);
    desk.run(MS(500));
    assert!(!has_died(&mut desk));
    assert_eq!(desk.master.statistics().dead_man, 0);
}

#[test]
fn the_deadline_of_the_dead_man_is_reported_however_late_the_next_request_is_due() {
    let mut config = armed();
    config.polling = Polling::Every(MS(1000));
    let (mut desk, told) = turning(config);
    assert_eq!(desk.packets(1), [write(NodeId::N1, 5.0)]);
    assert_eq!(desk.master.poll_timeout(), Some(told + MS(100)), "and not in a second");
    config.polling = Polling::Every(MS(20));
    let (mut desk, told) = turning(config);
    assert_eq!(desk.packets(1), [write(NodeId::N1, 5.0)]);
    assert!(desk.master.poll_timeout().unwrap() < told + MS(100), "a request goes before it");
}

#[test]
fn each_node_under_an_order_is_stopped_whatever_its_id_and_its_mode() {
    for node in NodeId::ALL {
        for mode in [Mode::Velocity, Mode::Position] {
            let config = with(armed(), |config| config.polling = Polling::Manual);
            let mut desk = Desk::with_nodes(config, &[(node, mode)]);
            assert_eq!(desk.master.poll_timeout(), None, "nobody has an order");
            let told = desk.now;
            match mode {
                Mode::Velocity => desk.master.set_velocity(node, rps(1.0), told).unwrap(),
                Mode::Position => desk.master.set_position(node, turns(9), told).unwrap(),
            }
            desk.packets(1);
            assert_eq!(desk.master.poll_timeout(), Some(told + MS(100)));
            desk.now = told + MS(100);
            desk.master.handle_timeout(desk.now);
            assert_eq!(desk.master.stops_owed(), node.into());
            let stop = match mode {
                Mode::Velocity => write(node, 0.0),
                Mode::Position => hold(node, Position::new(7, 3)),
            };
            let written = writes(&desk.until(node, StopProgress::Confirmed));
            assert_eq!(written, [stop.clone(), stop], "{node}, {mode}");
        }
    }
}
