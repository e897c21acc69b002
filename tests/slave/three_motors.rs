//! The slave of a board with three motors (I10): everything that one motor's slave does, three
//! times over.

use axlewire::ikeya::three::{PositionResponse, VelocityResponse, WriteRequest};

use crate::rig::*;

const T0: Instant = Instant::from_micros(1_000_000);
const NODE: NodeId = NodeId::N3;
const PLACES: [Position; 3] = [Position::new(1, 2), Position::new(3, 4), Position::new(-5, -6)];

fn speeds() -> [Rps; 3] {
    [rps(1.0), rps(-2.0), rps(3.0)]
}

fn slave(mode: Mode, config: SlaveConfig) -> Slave<ThreeMotors> {
    Slave::for_board(NODE, mode, config, T0)
}

/// Hands in a packet, and returns the answer.
fn answer(slave: &mut Slave<ThreeMotors>, packet: &[u8], at: Instant) -> Option<Vec<u8>> {
    slave.handle_input(packet, at);
    slave.poll_transmit(at).map(<[u8]>::to_vec)
}

/// A WRITE of these bits, as from a careless master.
fn write_of(speeds: [f32; 3]) -> Vec<u8> {
    let mut packet = vec![0xBB, NODE.get()];
    packet.extend(speeds.iter().flat_map(|speed| speed.to_le_bytes()));
    packet.extend(axlewire::crc16::compute(&packet).to_le_bytes());
    packet
}

#[test]
fn a_speed_that_is_no_number_for_any_of_the_motors_is_refused_for_all_and_feeds_no_watchdog() {
    let config = with(SlaveConfig::direct(), |config| config.watchdog = Some(MS(100)));
    for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
        for motor in 0..3 {
            let mut slave = slave(Mode::Velocity, config);
            let good = WriteRequest::velocity(NODE, speeds());
            slave.handle_input(good.as_bytes(), T0);
            let target = Target::Velocity(speeds());
            assert_eq!(slave.poll_event(), Some(SlaveEvent::Command(target)));

            let mut values = [4.0, 5.0, 6.0];
            values[motor] = bad;
            let is_answered = answer(&mut slave, &write_of(values), T0 + MS(60)).is_some();
            assert!(is_answered, "the answer says what the motors do");
            assert_eq!(slave.poll_event(), None, "{values:?}");
            assert_eq!(slave.command(T0 + MS(99)), Some(target), "the previous one stays");
            assert_eq!((slave.statistics().writes, slave.statistics().refused), (2, 1));
            assert_eq!(slave.command(T0 + MS(100)), None, "and ends in its own time");
            slave.handle_timeout(T0 + MS(100));
            assert_eq!(slave.poll_event(), Some(SlaveEvent::Watchdog));
        }
    }
}

#[test]
fn reads_and_writes_are_answered_with_the_status_of_the_mode() {
    let read = ReadRequest::new(NODE);
    let moved = [rps(0.25), rps(0.5), rps(-0.75)];
    let mut turning = slave(Mode::Velocity, SlaveConfig::direct());
    turning.set_velocity(moved);
    let expected = VelocityResponse::new(NODE, moved).as_bytes().to_vec();
    let write = WriteRequest::velocity(NODE, speeds());
    for packet in [&read.as_bytes()[..], &write.as_bytes()[..]] {
        assert_eq!(answer(&mut turning, packet, T0), Some(expected.clone()));
    }

    let mut going = slave(Mode::Position, SlaveConfig::direct());
    going.set_position(PLACES);
    let expected = PositionResponse::new(NODE, PLACES).as_bytes().to_vec();
    let targets = [Position::new(7, 0), Position::new(0, 7), Position::new(-7, 7)];
    let write = WriteRequest::position(NODE, targets);
    for packet in [&read.as_bytes()[..], &write.as_bytes()[..]] {
        assert_eq!(answer(&mut going, packet, T0), Some(expected.clone()));
    }
    assert_eq!(going.command(T0), Some(Target::Position(targets)));
}

#[test]
fn a_position_board_does_not_answer_before_it_knows_where_it_is() {
    let mut slave = slave(Mode::Position, SlaveConfig::direct());
    let (read, write) = (ReadRequest::new(NODE), WriteRequest::position(NODE, PLACES));
    for packet in [&read.as_bytes()[..], &write.as_bytes()[..]] {
        assert_eq!(answer(&mut slave, packet, T0), None);
    }
    assert_eq!(slave.statistics().replies, 0);
    assert_eq!(slave.command(T0), Some(Target::Position(PLACES)), "but it obeys");
    slave.set_position(PLACES);
    assert!(answer(&mut slave, read.as_bytes(), T0).is_some());
}

#[test]
fn on_two_wires_the_answers_of_other_boards_are_followed_and_not_obeyed() {
    let config = with(SlaveConfig::direct(), |config| config.two_wire = true);
    let mut slave = slave(Mode::Position, config);
    slave.set_position(PLACES);
    // Each answer contains a READ for this node, and comes from its own id or from another.
    let inside = [0, 0xAA, NODE.get(), 0, 0, 0, 0, 0, 0, 0, 0, 0];
    for (header, id) in [(0x55, 3), (0x56, 3), (0x55, 4), (0x56, 4)] {
        let mut packet = vec![header, id];
        packet.extend(inside);
        let crc = axlewire::crc16::compute(&packet[3..5]).to_le_bytes();
        packet[5..7].copy_from_slice(&crc);
        packet.extend(axlewire::crc16::compute(&packet).to_le_bytes());
        assert_eq!(answer(&mut slave, &packet, T0), None);
    }
    let statistics = slave.statistics();
    assert_eq!((statistics.answers, statistics.reads, statistics.foreign), (4, 0, 0));
    assert_eq!(slave.poll_event(), None);
    assert!(answer(&mut slave, ReadRequest::new(NODE).as_bytes(), T0).is_some());
}
