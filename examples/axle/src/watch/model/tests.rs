//! What the model makes of packets, without a page.

use axlewire::{
    crc16,
    ikeya::{NodeId, Position, PositionResponse, ReadRequest, Rps, VelocityResponse, WriteRequest},
    ucp::{
        Body, Frame, Telemetry,
        message::{
            CalibrationEnd, CalibrationEndAck, CalibrationKind, CalibrationStart,
            CalibrationStartAck, ErrorCode, FirmwareReport, ImuBias, MagBias, NetworkState,
            SetNetworkState,
        },
    },
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
    bus.at += 1_000_000;
    bus.tick();
    assert_eq!(bus.node(N1).missing, 0);
    bus.at += 1;
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
    assert!(seen.is_sorted_by(|before, after| before < after), "{seen:?}");
}

/// What is known of a rover after these frames, 1 ms apart.
fn rover(frames: &[impl AsRef<[u8]>]) -> (Rover, Vec<String>) {
    let mut model = Model::new(Protocol::Ucp);
    for (at, frame) in (0..).step_by(1000).zip(frames) {
        model.frame(&Frame::parse(frame.as_ref()).unwrap(), at);
    }
    let OfLine::Rover(rover) = model.line else { panic!() };
    let mut log: Vec<_> = model.log.newest().map(|entry| entry.text.clone()).collect();
    log.reverse();
    (*rover, log)
}

fn bytes(body: impl Body) -> Vec<u8> {
    body.frame(0).as_bytes().to_vec()
}

#[test]
fn the_state_of_the_network_is_known_from_both_widths_and_logged_when_it_changes() {
    // Of 4 bytes, as nothing here builds it.
    let mut wide = vec![0xFD, 0xFF, 8, 0, 0x0A, 0, 3, 0, 0, 0];
    wide.extend(crc16::compute(&wide).to_le_bytes());
    let narrow = bytes(SetNetworkState::new(NetworkState::Connected).unwrap());
    for frames in [[&narrow, &wide], [&wide, &narrow]] {
        let (rover, log) = rover(&frames);
        assert_eq!(rover.network, Some(NetworkState::Connected));
        assert_eq!(log, ["network connected"]);
    }
}

#[test]
fn each_step_of_a_calibration_is_the_last_one_until_the_next() {
    let (kind, fine) = (CalibrationKind::Imu, ErrorCode::Fine);
    let steps = [
        (bytes(CalibrationStart::new(kind)), "calibration start"),
        (bytes(CalibrationStartAck::new(kind, fine)), "calibration start ack"),
        (bytes(CalibrationEnd::new(kind)), "calibration end"),
        (bytes(CalibrationEndAck::new(kind, fine)), "calibration end ack"),
        (bytes(ImuBias::new([1; 3], [2; 3])), "imu bias"),
        (bytes(MagBias::new([3; 3])), "mag bias"),
    ];
    for count in 1..=steps.len() {
        let (frames, names): (Vec<_>, Vec<_>) = steps[..count].iter().cloned().unzip();
        assert_eq!(rover(&frames).0.calibration.as_deref(), names.last().copied());
    }
}

#[test]
fn a_report_that_comes_twice_is_no_gap_and_those_missing_between_two_are_counted() {
    let report = |index| FirmwareReport::new(&Telemetry::default(), 38).frame(index);
    for (indices, lost) in
        [([7, 7], 0), ([7, 8], 0), ([7, 9], 1), ([7, 10], 2), ([255, 0], 0), ([254, 0], 1)]
    {
        let [first, second] = indices.map(report);
        let (rover, log) = rover(&[first.as_bytes(), second.as_bytes()]);
        assert_eq!((rover.lost, rover.reports.count), (lost, 2), "{indices:?}");
        assert_eq!(log.iter().any(|text| text.contains("lost")), lost > 0, "{log:?}");
    }
}

#[test]
fn the_trend_of_a_rover_is_the_mean_of_its_wheels_while_it_is_heard() {
    let telemetry = Telemetry { rpm: [81, 39, -80, 50], ..Telemetry::default() };
    let report = FirmwareReport::new(&telemetry, 38).frame(0);
    let mut model = Model::new(Protocol::Ucp);
    model.frame(&Frame::parse(report.as_bytes()).unwrap(), 0);
    model.tick(Counters::default(), 0);
    model.tick(Counters::default(), 1_000_000);
    let OfLine::Rover(rover) = model.line else { panic!() };
    let trend: Vec<_> = rover.trend.last(3).collect();
    assert_eq!(trend[0], 22.5);
    assert!(trend[1].is_nan() && trend[2].is_nan(), "{trend:?}");
}

#[test]
fn a_node_that_is_only_asked_is_missing_and_has_not_ceased_to_answer() {
    let mut bus = Played::new();
    bus.read(N1);
    let node = bus.node(N1);
    assert_eq!((node.health(bus.at), node.reads), (Health::Fine, 1), "not commanded");
    for _ in 0..5 {
        bus.read(N1);
    }
    let node = bus.node(N1);
    assert_eq!((node.health(bus.at), node.reads, node.missing), (Health::Silent, 6, 5));
    assert_eq!(bus.log(), [""; 0]);
}

#[test]
fn a_node_is_quiet_once_more_than_a_second_has_passed() {
    let mut bus = Played::new();
    bus.velocity(N1, 1.0);
    assert_eq!(bus.node(N1).health(bus.at + 1_000_000), Health::Fine);
    assert_eq!(bus.node(N1).health(bus.at + 1_000_001), Health::Quiet);
}
