//! What the model makes of packets, without a page.

use axlewire::ikeya::{
    NodeId, Position, PositionResponse, ReadRequest, Rps, VelocityResponse, WriteRequest,
};

use super::*;

const N1: NodeId = NodeId::N1;
const N2: NodeId = NodeId::N2;

struct Played {
    model: Model,
    at: u64,
}

impl Played {
    fn new() -> Self {
        Self { model: Model::new(Protocol::Ikeya), at: 0 }
    }

    /// A packet, 1 ms after the one before.
    fn hear(&mut self, packet: &ikeya::Packet<'_>) {
        self.at += 1000;
        self.model.frame(packet, self.at);
    }

    fn read(&mut self, node: NodeId) {
        let read = ReadRequest::new(node);
        self.hear(&ikeya::Packet::Request(ikeya::Request::Read(&read)));
    }

    fn write(&mut self, node: NodeId, rps: f32) {
        let write = WriteRequest::velocity(node, Rps::new(rps).unwrap());
        self.hear(&ikeya::Packet::Request(ikeya::Request::Write(&write)));
    }

    fn velocity(&mut self, node: NodeId, rps: f32) {
        let answer = VelocityResponse::new(node, Rps::new(rps).unwrap());
        self.hear(&ikeya::Packet::Response(ikeya::Response::Velocity(&answer)));
    }

    fn position(&mut self, node: NodeId, turns: f64) {
        let answer = PositionResponse::new(node, Position::from_revolutions(turns).unwrap());
        self.hear(&ikeya::Packet::Response(ikeya::Response::Position(&answer)));
    }

    fn tick(&mut self) {
        let counters = self.model.counters;
        self.model.tick(counters, self.at);
    }

    fn node(&self, node: NodeId) -> Node {
        let OfLine::Bus(bus) = &self.model.line else { panic!() };
        bus.nodes().find(|(id, _)| *id == node).expect("a known node").1.clone()
    }

    /// The newest entries of the log, the newest last.
    fn log(&self) -> Vec<String> {
        let mut texts: Vec<_> = self.model.log.newest().map(|entry| entry.text.clone()).collect();
        texts.reverse();
        texts
    }
}

#[test]
fn three_reads_without_an_answer_make_a_node_silent_and_an_answer_ends_that() {
    let mut bus = Played::new();
    bus.read(N1);
    bus.velocity(N1, 1.0);
    assert_eq!(bus.node(N1).health(bus.at), Health::Fine);
    // A READ without an answer shows at the next request.
    for expected in [Health::Fine, Health::Missing(1), Health::Missing(2), Health::Silent] {
        bus.read(N1);
        assert_eq!(bus.node(N1).health(bus.at), expected);
    }
    bus.velocity(N1, 1.0);
    let node = bus.node(N1);
    assert_eq!((node.health(bus.at), node.missing), (Health::Fine, 3));
    let expected = [
        "node 1 answers, in velocity mode",
        "node 1 no longer answers: 3 are missing",
        "node 1 answers again, 3 were missing",
    ];
    assert_eq!(bus.log(), expected);
}

#[test]
fn a_read_with_no_request_after_it_is_missing_after_a_second() {
    let mut bus = Played::new();
    bus.read(N1);
    bus.at += 999_999;
    bus.tick();
    assert_eq!(bus.node(N1).missing, 0);
    bus.at += 2;
    bus.tick();
    assert_eq!(bus.node(N1).missing, 1);
    // Only once.
    bus.read(N2);
    assert_eq!(bus.node(N1).missing, 1);
}

#[test]
fn the_latency_is_that_of_the_node_that_was_asked() {
    let mut bus = Played::new();
    bus.read(N1);
    bus.at += 1500;
    bus.velocity(N1, 1.0);
    assert_eq!(bus.node(N1).latency, Some(2500));
    bus.read(N1);
    bus.velocity(N2, 1.0);
    assert_eq!(bus.node(N2).latency, None);
    assert!(bus.log().contains(&"node 2 answered when node 1 was asked".to_owned()));
    bus.velocity(N1, 1.0);
    let node = bus.node(N1);
    assert_eq!((node.latency, node.missing), (Some(2000), 0), "still in time");
    // An answer that nobody asked for has none.
    bus.at += 9000;
    bus.velocity(N1, 1.0);
    assert_eq!(bus.node(N1).latency, Some(2000));
}

#[test]
fn a_write_is_read_as_the_mode_of_its_node_says() {
    let mut bus = Played::new();
    bus.write(N1, 1.5);
    assert_eq!(bus.node(N1).commanded(), None, "a speed or a position");
    assert_eq!(bus.node(N1).health(bus.at), Health::Commanded);
    bus.velocity(N1, 0.0);
    assert_eq!(bus.node(N1).commanded(), Some(Values::new(&[1.5])));
    bus.position(N1, 2.0);
    assert_eq!(bus.node(N1).commanded(), None, "the change has ended it");
    bus.write(N1, 1.5);
    assert_eq!(bus.node(N1).commanded(), Some(Values::new(&[16320.0])));
    assert_eq!(bus.log()[1], "node 1 has changed from velocity to position mode");
    // It is not answered, so nothing is missing.
    bus.write(N1, 1.5);
    bus.write(N1, 1.5);
    assert_eq!(bus.node(N1).missing, 0);
}

#[test]
fn rates_are_measured_over_a_second() {
    let mut bus = Played::new();
    for _ in 0..500 {
        bus.read(N1);
        bus.velocity(N1, 1.0);
        bus.tick();
    }
    assert!((bus.node(N1).packets.per_second - 1000.0).abs() < 2.0);
    bus.at += 2_000_000;
    bus.tick();
    assert_eq!(bus.node(N1).packets.per_second, 0.0);
    assert_eq!(bus.node(N1).health(bus.at), Health::Quiet);
}

#[test]
fn whatever_changes_the_page_is_a_revision_of_its_own() {
    let mut played = Played::new();
    let mut seen = vec![played.model.revision];
    played.read(N1);
    seen.push(played.model.revision);
    let gap = Gap { len: 3, reason: axlewire::stream::Reason::Crc };
    played.model.gap(gap, None, 5000);
    seen.push(played.model.revision);
    played.model.note("a note".to_owned(), 6000);
    seen.push(played.model.revision);
    played.model.tick(Counters::default(), RATE_PERIOD + 7000);
    seen.push(played.model.revision);
    seen.dedup();
    assert_eq!(seen.len(), 5, "{seen:?}");
}
