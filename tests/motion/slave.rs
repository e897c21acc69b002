//! The slave: when it must no longer talk.

use axlewire::{
    endpoint::Endpoint,
    ikeya::{Mode, NodeId, ReadRequest, Slave, slave::SlaveConfig},
    time::{Duration, Instant},
};

fn slave(config: SlaveConfig) -> Slave {
    Slave::new(NodeId::N2, Mode::Velocity, config, Instant::from_micros(0))
}

/// A slave that has just been asked, and the time of the request.
fn asked() -> (Slave, Instant) {
    let (mut slave, now) = (slave(SlaveConfig::direct()), Instant::from_millis(1000));
    slave.handle_input(ReadRequest::new(NodeId::N2).as_bytes(), now);
    assert_eq!(slave.poll_timeout(), Some(now), "no answer is due");
    (slave, now)
}

#[test]
fn a_slave_drops_its_answer_when_the_next_packet_has_begun() {
    let (mut slave, now) = asked();
    let next = ReadRequest::new(NodeId::N3);
    slave.handle_input(&next.as_bytes()[..1], now + Duration::from_micros(20));
    let answer = slave.poll_transmit(now + Duration::from_micros(20));
    assert_eq!(answer, None, "the slave talks while its master does");
}

#[test]
fn a_slave_drops_its_answer_when_the_next_packet_begins_in_the_same_chunk() {
    let (mut slave, now) = (slave(SlaveConfig::direct()), Instant::from_millis(1000));
    let (read, next) = (ReadRequest::new(NodeId::N2), ReadRequest::new(NodeId::N3));
    slave.handle_input(&[&read.as_bytes()[..], &next.as_bytes()[..1]].concat(), now);
    let answer = slave.poll_transmit(now);
    assert_eq!(answer, None, "the slave talks although the next packet came with its request");
}

#[test]
fn a_slave_does_not_answer_when_its_driver_comes_an_hour_late() {
    let (mut slave, now) = asked();
    let answer = slave.poll_transmit(now + Duration::from_millis(3_600_000));
    assert_eq!(answer, None, "the slave answers an hour-old request");
}
