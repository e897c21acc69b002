//! Several nodes as one end of a line do what a single one does.

use axlewire::ikeya::{ReadRequest, Rps, WriteRequest};

use axlewire::endpoint::Unsent;

use super::*;

const WATCHDOG: Duration = Duration::from_millis(200);

fn at(millis: u64) -> Instant {
    Instant::from_micros(1000 * millis)
}

fn motor(node: NodeId) -> MotorNode {
    let mut config = SlaveConfig::usb_adapter();
    config.watchdog = Some(WATCHDOG);
    MotorNode::from_parts(Slave::new(node, Mode::Velocity, config, at(0)), Motor::new())
}

/// Nodes 1 and 2 on a line, and node 2 alone.
fn nodes() -> (Nodes<OneMotor>, MotorNode) {
    let node = |id| Node { motor: motor(id), is_dead: false, told: None, is_under_way: false };
    let all = [NodeId::N1, NodeId::N2].map(node).into();
    (Nodes { all, sender: 0 }, motor(NodeId::N2))
}

fn write() -> [u8; 8] {
    *WriteRequest::velocity(NodeId::N2, Rps::new(2.0).unwrap()).as_bytes()
}

fn read() -> [u8; 4] {
    *ReadRequest::new(NodeId::N2).as_bytes()
}

/// Both do this, and are the same afterwards.
fn same<T: fmt::Debug + PartialEq>(
    pair: &mut (Nodes<OneMotor>, MotorNode),
    on_line: impl Fn(&mut Nodes<OneMotor>) -> T,
    alone: impl Fn(&mut MotorNode) -> T,
) -> T {
    let (nodes, one) = pair;
    let found = on_line(nodes);
    assert_eq!(found, alone(one));
    assert_eq!(nodes.all[1].motor.slave().statistics(), one.slave().statistics());
    assert_eq!(nodes.poll_timeout(), one.poll_timeout());
    assert_eq!(nodes.is_outdated(), one.is_outdated());
    found
}

#[test]
fn a_driver_is_told_the_limits_of_a_single_node() {
    let (nodes, one) = nodes();
    assert_eq!(nodes.line_rules(), one.line_rules());
    assert_ne!(nodes.line_rules(), LineRules::default());
}

#[test]
fn an_answer_that_does_not_leave_is_given_back_to_the_node_that_sent_it() {
    let mut pair = nodes();
    same(&mut pair, |it| it.handle_input(&read(), at(1)), |it| it.handle_input(&read(), at(1)));
    let due = pair.1.poll_timeout().unwrap();
    let is_answer = |bytes: Option<&[u8]>| bytes.is_some_and(|bytes| bytes.len() == 8);
    for _ in 0..2 {
        assert!(same(
            &mut pair,
            |it| is_answer(it.poll_transmit(due)),
            |it| is_answer(it.poll_transmit(due)),
        ));
        assert!(!pair.0.is_outdated() && pair.0.sender == 1);
        same(
            &mut pair,
            |it| it.handle_transmit(Unsent::Untouched, due),
            |it| it.handle_transmit(Unsent::Untouched, due),
        );
    }
    same(&mut pair, |it| it.poll_transmit(due).is_some(), |it| it.poll_transmit(due).is_some());
    same(&mut pair, |it| it.handle_input(&write(), due), |it| it.handle_input(&write(), due));
    assert!(pair.0.is_outdated(), "the master has gone on");
}

#[test]
fn the_watchdog_of_a_node_ends_at_its_time() {
    let mut pair = nodes();
    same(&mut pair, |it| it.handle_input(&write(), at(1)), |it| it.handle_input(&write(), at(1)));
    assert_eq!(pair.0.poll_timeout(), Some(at(1) + WATCHDOG));
    assert!(matches!(pair.0.poll_event(), Some(Event::Command { node: NodeId::N2, .. })));
    pair.0.handle_timeout(at(201));
    assert!(matches!(pair.0.poll_event(), Some(Event::Watchdog { node: NodeId::N2 })));
}

#[test]
fn a_command_that_has_waited_longer_than_the_watchdog_turns_nothing() {
    let mut pair = nodes();
    let (since, now) = (at(1), at(500));
    same(
        &mut pair,
        |it| it.handle_input(&write(), Arrival::Between { since, now }),
        |it| it.handle_input(&write(), Arrival::Between { since, now }),
    );
    assert_eq!(pair.0.all[1].motor.slave().statistics().writes, 1, "it was heard");
    assert_eq!(pair.0.all[1].motor.motor().velocity(), pair.1.motor().velocity());
}

#[test]
fn the_motors_of_a_board_are_those_it_was_given() {
    let slow = || Motor::new().with_time_constant(TIME_CONSTANT);
    let turned = |mut motor: Motor| {
        motor.turn(Rps::new(2.0).unwrap());
        motor.step(TIME_CONSTANT);
        motor.velocity()
    };
    let expected = turned(slow());
    assert_ne!(expected, turned(Motor::default()));
    assert_eq!(turned(OneMotor::motors(slow())), expected);
    for motor in ThreeMotors::motors(slow()) {
        assert_eq!(turned(motor), expected);
    }
}
