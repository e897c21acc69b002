//! A master's stops and set-points when switches move, ports fail and applications go silent.

use crate::{
    motor_line::{Wire, owe_stop, run},
    rig::*,
};

const POLLINGS: [Polling; 2] = [Polling::Fastest, Polling::Every(ms(20))];

/// A motor that has turned at 5 rps for four seconds, and its master.
fn turned(polling: Polling) -> (Wire, Bus) {
    let (wire, mut bus) = Wire::one_motor(Mode::Velocity, |config| config.polling = polling);
    bus.set_velocity(NodeId::N1, rps(5.0)).unwrap();
    run(&mut bus, 4000);
    assert!(wire.turns() > 19.0);
    (wire, bus)
}

/// Distance that the motor turns when its switch is moved to position mode, turns.
fn way_after_switch(wire: &Wire, bus: &mut Bus) -> f64 {
    let before = wire.turns();
    wire.motor().switch(Mode::Position, wire.world.now_us());
    run(bus, 5000);
    assert_eq!(bus.role().mode(NodeId::N1), Some(Mode::Position));
    (wire.turns() - before).abs()
}

#[test]
fn a_mode_that_changes_under_a_paid_stop_owes_another_one() {
    for polling in POLLINGS {
        let (wire, mut bus) = turned(polling);
        bus.stop(NodeId::N1).unwrap();
        run(&mut bus, 500);
        assert_eq!(bus.role().stop_progress(NodeId::N1), StopProgress::StandingStill);
        // The pending repeat of 0 rps now means "go to 0".
        let way = way_after_switch(&wire, &mut bus);
        assert!(way < 1.0, "{polling:?}: a stopped motor makes {way} turns");
        assert_eq!(bus.role().stop_progress(NodeId::N1), StopProgress::StandingStill);
    }
}

#[test]
fn a_mode_that_changes_under_a_set_point_owes_a_stop() {
    for polling in POLLINGS {
        let (wire, mut bus) = turned(polling);
        // 5 rps is a position far away.
        let way = way_after_switch(&wire, &mut bus);
        assert!(way < 1.0, "{polling:?}: it makes {way} turns to a position that nobody requested");
        assert_eq!(bus.role().stop_progress(NodeId::N1), StopProgress::StandingStill);
    }
}

/// The port takes bytes again, and a stop leaves the motor where it is.
fn assert_is_stopped_where_it_is(wire: &Wire, bus: &mut Bus) {
    let before = wire.turns();
    wire.write_all();
    bus.stop(NodeId::N1).unwrap();
    run(bus, 10_000);
    let way = wire.turns() - before;
    assert!(way.abs() < 1.0, "the stop drives the motor {way} turns");
}

#[test]
fn a_held_position_that_could_not_be_written_at_once_is_measured_again() {
    let (wire, mut bus) = Wire::one_motor(Mode::Position, |_| ());
    bus.set_position(NodeId::N1, Position::new(0, 3000)).unwrap();
    run(&mut bus, 1000);
    // The stop's READ leaves, then the port takes nothing for five seconds.
    owe_stop(&mut bus);
    let reads = wire.motor().reads;
    while wire.motor().reads == reads {
        bus.service().unwrap();
    }
    wire.write_only(0);
    for _ in 0..1000 {
        let _ = bus.service();
        wire.world.step(5);
    }
    run(&mut bus, 5000);
    assert!(wire.turns() > 100.0, "it is still moving");
    assert_is_stopped_where_it_is(&wire, &mut bus);
}

#[test]
fn a_position_stop_is_paid_in_a_loop_that_is_always_too_late_for_its_write() {
    for (loop_us, gap_us) in [(1000, 50), (25_000, 50), (25_000, 1000), (59_000, 5000)] {
        let wire = Wire::bus(Some(Mode::Position));
        let mut bus = wire.master(|config| {
            config.turnaround_gap = Duration::from_micros(gap_us);
            config.reply_timeout = Duration::from_millis(100);
            config.late_guard = Duration::from_millis(5);
        });
        bus.discover().unwrap();
        bus.set_position(NodeId::N1, Position::new(0, 3000)).unwrap();
        owe_stop(&mut bus);
        let mut rounds = 0;
        while !bus.role().stops_owed().is_empty() {
            bus.service().unwrap();
            wire.world.step(loop_us);
            rounds += 1;
            assert!(rounds < 40, "not paid with a loop of {loop_us} us and a gap of {gap_us} us");
        }
    }
}

#[test]
fn a_position_from_before_the_stop_is_held_only_if_it_can_be_written_soon() {
    let (wire, mut bus) =
        Wire::one_motor(Mode::Position, |config| config.hold_age = Duration::from_millis(100));
    bus.set_position(NodeId::N1, Position::new(0, 3000)).unwrap();
    run(&mut bus, 1000);
    wire.write_only(0);
    assert!(bus.stop(NodeId::N1).is_err());
    run(&mut bus, 2000);
    assert_is_stopped_where_it_is(&wire, &mut bus);
}

#[test]
fn a_set_point_that_failed_is_not_sent_by_a_later_call() {
    for is_async in [false, true] {
        let (wire, mut bus) =
            Wire::one_motor(Mode::Velocity, |config| config.polling = Polling::Manual);
        wire.world.step(1000);
        wire.write_only(0);
        let failed = call!(is_async, bus, set_velocity(NodeId::N1, rps(10.0)));
        assert_eq!(failed, Err(DriveError::Port(Unplugged)));
        wire.world.step(10_000_000);
        wire.write_all();
        bus.read(NodeId::N1).unwrap();
        run(&mut bus, 100);
        let motor = wire.motor();
        let mut payloads = motor.writes.iter().map(|&(_, payload)| payload);
        assert!(payloads.all(|payload| payload == [0; 4]), "sent ten seconds after it failed");
    }
}
