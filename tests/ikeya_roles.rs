//! Master and slave, called by hand: one story per sentence of rulings I2, I3 and I6 to I10.

#![cfg(feature = "ikeya")]

use axlewire::{
    endpoint::Endpoint,
    ikeya::{
        Cause, CommandError, DipSwitch, Health, IdReading, Master, MasterConfig, MasterEvent, Mode,
        NodeId, OneMotor, Polling, Position, PositionResponse, ReadRequest, Rps, Schedule, Slave,
        SlaveConfig, SlaveEvent, Status, Target, ThreeMotors, VelocityResponse, WriteRequest,
    },
    time::{Duration, Instant},
};

const US: fn(u32) -> Duration = Duration::from_micros;

fn rps(value: f32) -> Rps {
    Rps::new(value).unwrap()
}

fn read(node: NodeId) -> Vec<u8> {
    ReadRequest::new(node).as_bytes().to_vec()
}

fn velocity(node: NodeId, value: f32) -> Vec<u8> {
    VelocityResponse::new(node, rps(value)).as_bytes().to_vec()
}

fn position(node: NodeId, at: Position) -> Vec<u8> {
    PositionResponse::new(node, at).as_bytes().to_vec()
}

fn write(node: NodeId, value: f32) -> Vec<u8> {
    WriteRequest::velocity(node, rps(value)).as_bytes().to_vec()
}

/// A master, the time, and what it has sent and told.
struct Desk {
    master: Master,
    now: Instant,
    sent: Vec<Vec<u8>>,
    events: Vec<MasterEvent>,
}

impl Desk {
    fn new(config: MasterConfig) -> Self {
        Self::at(config, Instant::from_micros(1_000_000))
    }

    fn at(config: MasterConfig, now: Instant) -> Self {
        Self { master: Master::new(config), now, sent: vec![], events: vec![] }
    }

    /// A master that knows these nodes and has told so.
    fn with_nodes(config: MasterConfig, nodes: &[(NodeId, Mode)]) -> Self {
        let mut desk = Self::new(config);
        desk.master.discover();
        while desk.master.is_discovering() {
            let asked = desk.turn();
            let node = NodeId::new(asked[1]).unwrap();
            match nodes.iter().find(|(id, _)| *id == node) {
                Some((_, Mode::Velocity)) => desk.hear(290, &velocity(node, 0.0)),
                Some((_, Mode::Position)) => desk.hear(290, &position(node, Position::new(7, 3))),
                None => desk.silence(),
            }
        }
        desk.told();
        desk
    }

    /// Goes on to the next READ and returns it; what was sent before it is in `sent`.
    fn turn(&mut self) -> Vec<u8> {
        loop {
            let packet = self.packet();
            if packet[0] == 0xAA {
                return packet;
            }
            self.sent.push(packet);
        }
    }

    /// Goes on to the next packet and returns it.
    fn packet(&mut self) -> Vec<u8> {
        for _ in 0..100 {
            if let Some(bytes) = self.master.poll_transmit(self.now) {
                return bytes.to_vec();
            }
            let next = self.master.poll_timeout().expect("something to do");
            assert!(next > self.now, "a busy loop at {next:?}");
            self.now = next;
            self.master.handle_timeout(self.now);
        }
        panic!("nothing is sent");
    }

    /// Lets time pass and then hands in these bytes.
    fn hear(&mut self, after_us: u32, bytes: &[u8]) {
        self.now += US(after_us);
        self.master.handle_input(bytes, self.now);
    }

    /// Lets the window close.
    fn silence(&mut self) {
        self.now = self.master.poll_timeout().expect("a window");
        self.master.handle_timeout(self.now);
    }

    fn told(&mut self) -> Vec<MasterEvent> {
        while let Some(event) = self.master.poll_event() {
            self.events.push(event);
        }
        std::mem::take(&mut self.events)
    }
}

const N1: (NodeId, Mode) = (NodeId::N1, Mode::Velocity);
const N3: (NodeId, Mode) = (NodeId::N3, Mode::Position);

fn direct() -> MasterConfig {
    MasterConfig::direct()
}

// Discovery

#[test]
fn a_discovery_asks_every_id_once_and_silent_ones_again() {
    let mut desk = Desk::new(direct());
    desk.master.discover();
    let mut asked = vec![];
    while desk.master.is_discovering() {
        let request = desk.turn();
        assert_eq!(request[0], 0xAA);
        asked.push(request[1]);
        match request[1] {
            1 => desk.hear(290, &velocity(NodeId::N1, 0.0)),
            3 => desk.hear(290, &position(NodeId::N3, Position::new(0, 1))),
            _ => desk.silence(),
        }
    }
    assert_eq!(asked, [1, 2, 3, 4, 5, 6, 7, 8, 2, 4, 5, 6, 7, 8, 2, 4, 5, 6, 7, 8]);
    let events = desk.told();
    assert_eq!(events[0], MasterEvent::Discovered { node: NodeId::N1, mode: Mode::Velocity });
    assert_eq!(events[2], MasterEvent::Discovered { node: NodeId::N3, mode: Mode::Position });
    assert_eq!(events.last(), Some(&MasterEvent::DiscoveryDone { online: 2 }));
    assert_eq!(desk.master.mode(NodeId::N3), Some(Mode::Position));
    assert_eq!(desk.master.health(NodeId::N2), None);
}

#[test]
fn a_discovery_of_an_empty_bus_ends_and_leaves_nothing_to_do() {
    let mut desk = Desk::with_nodes(direct(), &[]);
    assert_eq!(desk.master.statistics().reads, 24);
    assert_eq!(desk.master.poll_timeout(), None);
    assert_eq!(desk.master.poll_transmit(desk.now), None);
}

#[test]
fn a_discovery_of_a_full_bus_asks_eight_times() {
    let nodes = NodeId::ALL.map(|node| (node, Mode::Velocity));
    let desk = Desk::with_nodes(direct(), &nodes);
    assert_eq!(desk.master.statistics().reads, 8);
    assert!(NodeId::ALL.iter().all(|&node| desk.master.health(node) == Some(Health::Online)));
}

#[test]
fn a_second_discovery_asks_only_who_is_not_online_and_lets_new_set_points_through() {
    let mut desk = Desk::with_nodes(direct(), &[N1]);
    desk.master.discover();
    assert_eq!(desk.turn(), read(NodeId::N2));
    desk.master.stop(NodeId::N1).unwrap();
    desk.silence();
    assert_eq!(desk.turn(), read(NodeId::N3));
    assert_eq!(desk.sent, [write(NodeId::N1, 0.0)], "a stop does not wait");
}

// Commands

#[test]
fn a_command_for_the_wrong_mode_or_an_unknown_node_is_refused() {
    let mut desk = Desk::with_nodes(direct(), &[N1, N3]);
    let wrong = CommandError::WrongMode { node: NodeId::N3, mode: Mode::Position };
    assert_eq!(desk.master.set_velocity(NodeId::N3, Rps::ZERO), Err(wrong));
    assert_eq!(wrong.to_string(), "node 3 is in position mode");
    let wrong = CommandError::WrongMode { node: NodeId::N1, mode: Mode::Velocity };
    assert_eq!(desk.master.set_position(NodeId::N1, Position::default()), Err(wrong));
    let unknown = CommandError::NotOnline { node: NodeId::N2 };
    assert_eq!(desk.master.set_velocity(NodeId::N2, Rps::ZERO), Err(unknown));
    assert_eq!(desk.master.stop(NodeId::N2), Err(unknown));
    assert_eq!(desk.master.confirm(NodeId::N2), Err(unknown));
    assert!(!desk.master.has_unsent_targets());
}

#[test]
fn the_latest_set_point_wins_and_is_repeated_every_cycle() {
    let mut desk = Desk::with_nodes(direct(), &[N1]);
    desk.master.set_velocity(NodeId::N1, rps(1.0)).unwrap();
    desk.master.set_velocity(NodeId::N1, rps(2.0)).unwrap();
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
fn stop_means_zero_for_velocity_and_hold_for_position_never_go_to_zero() {
    let mut desk = Desk::with_nodes(direct(), &[N1, N3]);
    assert_eq!(desk.master.stop_all(), 0);
    let mut written = vec![];
    for _ in 0..2 {
        let request = desk.turn();
        written.append(&mut desk.sent);
        match request[1] {
            1 => desk.hear(450, &velocity(NodeId::N1, 0.0)),
            _ => desk.hear(450, &position(NodeId::N3, Position::new(7, 3))),
        }
    }
    let hold = WriteRequest::position(NodeId::N3, Position::new(7, 3)).as_bytes().to_vec();
    assert!(written.contains(&write(NodeId::N1, 0.0)) && written.contains(&hold), "{written:02x?}");
}

#[test]
fn nodes_are_visited_in_turn_with_a_write_before_each_read() {
    let mut desk = Desk::with_nodes(direct(), &[N1, N3]);
    desk.master.set_velocity(NodeId::N1, rps(1.0)).unwrap();
    desk.master.set_position(NodeId::N3, Position::new(1, 2)).unwrap();
    let mut order = vec![];
    for _ in 0..6 {
        let request = desk.turn();
        order.extend(desk.sent.drain(..).chain([request.clone()]).map(|it| (it[0], it[1])));
        match request[1] {
            1 => desk.hear(450, &velocity(NodeId::N1, 0.0)),
            _ => desk.hear(450, &position(NodeId::N3, Position::new(7, 3))),
        }
    }
    let first = [(0xBB, 1), (0xBB, 3), (0xAA, 1), (0xAA, 3)];
    let cycle = [(0xBB, 1), (0xAA, 1), (0xBB, 3), (0xAA, 3)];
    assert_eq!(order[..4], first, "new set-points go at once");
    assert_eq!(order[4..], cycle.repeat(2));
}

#[test]
fn a_confirmed_write_is_told_after_the_read_that_followed_it() {
    let mut desk = Desk::with_nodes(direct(), &[N1]);
    desk.master.set_velocity(NodeId::N1, rps(1.0)).unwrap();
    desk.master.confirm(NodeId::N1).unwrap();
    desk.turn();
    assert_eq!(desk.told(), []);
    desk.hear(450, &velocity(NodeId::N1, 0.5));
    let confirmed = MasterEvent::Confirmed { node: NodeId::N1 };
    assert_eq!(desk.told().last(), Some(&confirmed));
    desk.turn();
    desk.hear(450, &velocity(NodeId::N1, 0.5));
    assert!(!desk.told().contains(&confirmed), "told once");
}

#[test]
fn a_write_that_cannot_be_confirmed_is_told_with_its_cause() {
    let mut desk = Desk::with_nodes(direct(), &[N1]);
    desk.master.set_velocity(NodeId::N1, rps(1.0)).unwrap();
    desk.master.confirm(NodeId::N1).unwrap();
    for _ in 0..3 {
        desk.turn();
        desk.silence();
    }
    let failed = MasterEvent::NotConfirmed { node: NodeId::N1, cause: Cause::Silent };
    assert_eq!(desk.told().last(), Some(&failed));
}

// Windows

#[test]
fn the_window_is_the_timeout_and_the_wire_time_behind_the_end_of_the_request() {
    let mut desk = Desk::with_nodes(direct(), &[N1]);
    desk.turn();
    // 80 us of request, 500 us of patience, 160 us of answer.
    assert_eq!(desk.master.poll_timeout(), Some(desk.now + US(740)));
    desk.hear(740, &velocity(NodeId::N1, 1.0));
    assert!(matches!(desk.told()[..], [MasterEvent::Status { .. }]), "at the deadline is in time");

    desk.turn();
    desk.hear(741, &velocity(NodeId::N1, 1.0));
    desk.master.handle_timeout(desk.now);
    let suspect = MasterEvent::Health { node: NodeId::N1, health: Health::Suspect(1) };
    assert_eq!(desk.told(), [suspect], "behind it is not");
    assert_eq!(desk.master.node_statistics(NodeId::N1).late, 1);
}

#[test]
fn behind_a_write_the_window_begins_when_both_requests_have_left() {
    let mut desk = Desk::with_nodes(direct(), &[N1]);
    desk.master.set_velocity(NodeId::N1, rps(1.0)).unwrap();
    desk.turn();
    assert_eq!(desk.master.poll_timeout(), Some(desk.now + US(160 + 740)));
}

#[test]
fn bytes_from_before_the_request_are_dropped() {
    let mut desk = Desk::with_nodes(direct(), &[N1]);
    let answer = velocity(NodeId::N1, 9.0);
    desk.hear(10, &answer[..5]);
    desk.turn();
    desk.hear(290, &answer[5..]);
    assert_eq!(desk.told(), []);
    assert_eq!(desk.master.statistics().stale_bytes, 5);
}

#[test]
fn a_stray_byte_before_every_answer_costs_nothing() {
    for stray in 0..=u8::MAX {
        let mut desk = Desk::with_nodes(direct(), &[N1]);
        for turn in 0..5 {
            desk.turn();
            let answer = [&[stray][..], &velocity(NodeId::N1, turn as f32)].concat();
            desk.hear(310, &answer);
            let status = Status::Velocity(turn as f32);
            assert_eq!(
                desk.told(),
                [MasterEvent::Status { node: NodeId::N1, status }],
                "{stray:#x}"
            );
        }
    }
}

#[test]
fn an_answer_of_another_node_is_counted_and_never_taken() {
    let mut desk = Desk::with_nodes(direct(), &[N1, N3]);
    assert_eq!(desk.turn(), read(NodeId::N1));
    desk.hear(290, &position(NodeId::N3, Position::new(1, 1)));
    assert_eq!(desk.told(), []);
    assert_eq!(desk.master.node_statistics(NodeId::N3).late, 1);
    desk.hear(100, &velocity(NodeId::N1, 2.0));
    let status = Status::Velocity(2.0);
    assert_eq!(
        desk.told(),
        [MasterEvent::Status { node: NodeId::N1, status }],
        "the window stayed open"
    );
}

#[test]
fn a_late_answer_is_not_taken_for_the_next_one() {
    let mut desk = Desk::with_nodes(direct(), &[N1]);
    desk.turn();
    desk.silence();
    // The node is not asked again before the guard is over, and the late answer meets no window.
    desk.hear(400, &velocity(NodeId::N1, 9.0));
    assert_eq!(desk.master.poll_transmit(desk.now), None);
    desk.turn();
    desk.hear(290, &velocity(NodeId::N1, 1.0));
    let statuses: Vec<_> = desk
        .told()
        .into_iter()
        .filter(|event| matches!(event, MasterEvent::Status { .. }))
        .collect();
    let status = Status::Velocity(1.0);
    assert_eq!(statuses, [MasterEvent::Status { node: NodeId::N1, status }]);
    assert_eq!(desk.master.node_statistics(NodeId::N1).late, 1);
}

#[test]
fn while_one_node_is_guarded_the_others_are_read() {
    let mut desk = Desk::with_nodes(direct(), &[N1, N3]);
    assert_eq!(desk.turn(), read(NodeId::N1));
    desk.silence();
    let closed = desk.now;
    assert_eq!(desk.turn(), read(NodeId::N3));
    assert_eq!(desk.now, closed);
}

#[test]
fn a_second_answer_to_one_request_is_late() {
    let mut desk = Desk::with_nodes(direct(), &[N1]);
    desk.turn();
    let twice = [velocity(NodeId::N1, 1.0), velocity(NodeId::N1, 2.0)].concat();
    desk.hear(450, &twice);
    let status = Status::Velocity(1.0);
    assert_eq!(desk.told(), [MasterEvent::Status { node: NodeId::N1, status }]);
    assert_eq!(desk.master.node_statistics(NodeId::N1).late, 1);
}

#[test]
fn any_f32_is_a_status() {
    let mut desk = Desk::with_nodes(direct(), &[N1]);
    desk.turn();
    let nan = [0x55, 0x01, 0x00, 0x00, 0xC0, 0x7F];
    let mut answer = nan.to_vec();
    answer.extend(axlewire::crc16::compute(&nan).to_le_bytes());
    desk.hear(290, &answer);
    let [MasterEvent::Status { status: Status::Velocity(rps), .. }] = desk.told()[..] else {
        panic!()
    };
    assert!(rps.is_nan());
}

// Health

#[test]
fn three_strikes_make_a_node_abnormal_and_one_answer_brings_it_back() {
    let mut desk = Desk::with_nodes(direct(), &[N1]);
    let mut told = vec![];
    for _ in 0..3 {
        desk.turn();
        desk.silence();
        told.append(&mut desk.told());
    }
    let health = |health| MasterEvent::Health { node: NodeId::N1, health };
    let failed = MasterEvent::ReadFailed { node: NodeId::N1, cause: Cause::Silent };
    let expected =
        [health(Health::Suspect(1)), health(Health::Suspect(2)), health(Health::Abnormal), failed];
    assert_eq!(told, expected);
    assert_eq!(desk.master.node_statistics(NodeId::N1).timeouts, 3);
    assert_eq!(desk.master.node_statistics(NodeId::N1).retries, 2);

    assert_eq!(desk.turn(), read(NodeId::N1));
    desk.hear(290, &velocity(NodeId::N1, 0.0));
    assert_eq!(desk.told()[0], health(Health::Online));
}

#[test]
fn one_answer_ends_a_series_of_strikes() {
    let mut desk = Desk::with_nodes(direct(), &[N1]);
    for _ in 0..10 {
        for _ in 0..2 {
            desk.turn();
            desk.silence();
        }
        desk.turn();
        desk.hear(290, &velocity(NodeId::N1, 0.0));
        assert_eq!(desk.master.health(NodeId::N1), Some(Health::Online));
    }
}

#[test]
fn a_write_does_not_reset_the_strikes() {
    let mut desk = Desk::with_nodes(direct(), &[N1]);
    for _ in 0..3 {
        assert_ne!(desk.master.health(NodeId::N1), Some(Health::Abnormal));
        desk.master.set_velocity(NodeId::N1, rps(1.0)).unwrap();
        desk.turn();
        assert!(!desk.sent.is_empty(), "a WRITE");
        desk.sent.clear();
        desk.silence();
    }
    assert_eq!(desk.master.health(NodeId::N1), Some(Health::Abnormal));
}

#[test]
fn a_node_that_comes_back_does_not_move_until_somebody_says_so() {
    let mut desk = Desk::with_nodes(direct(), &[N1]);
    desk.master.set_velocity(NodeId::N1, rps(5.0)).unwrap();
    for _ in 0..3 {
        desk.turn();
        desk.silence();
    }
    desk.sent.clear();
    let refused = CommandError::NotOnline { node: NodeId::N1 };
    assert_eq!(desk.master.set_velocity(NodeId::N1, rps(5.0)), Err(refused));
    for _ in 0..5 {
        assert_eq!(desk.turn(), read(NodeId::N1));
        desk.hear(290, &velocity(NodeId::N1, 0.0));
        assert!(desk.sent.is_empty(), "no WRITE");
    }
}

#[test]
fn a_stop_goes_to_an_abnormal_node_too_once() {
    let mut desk = Desk::with_nodes(direct(), &[N1]);
    desk.master.set_velocity(NodeId::N1, rps(5.0)).unwrap();
    for _ in 0..3 {
        desk.turn();
        desk.silence();
    }
    desk.sent.clear();
    desk.master.stop(NodeId::N1).unwrap();
    for _ in 0..3 {
        desk.turn();
        desk.silence();
    }
    assert_eq!(desk.sent, [write(NodeId::N1, 0.0)], "it may still hear");
}

#[test]
fn a_stop_that_waits_survives_the_third_strike() {
    let mut desk = Desk::with_nodes(direct(), &[N1]);
    for _ in 0..2 {
        desk.turn();
        desk.silence();
    }
    desk.turn();
    desk.master.stop(NodeId::N1).unwrap();
    desk.silence();
    assert_eq!(desk.master.health(NodeId::N1), Some(Health::Abnormal));
    assert_eq!(desk.packet(), write(NodeId::N1, 0.0));
}

#[test]
fn garbage_in_the_window_is_a_strike_that_names_its_cause() {
    for (bytes, cause) in [
        (vec![0x55, 1, 2, 3, 4, 5, 6, 7, 8], Cause::Damaged),
        (velocity(NodeId::N7, 1.0), Cause::Unexpected),
        (vec![], Cause::Silent),
    ] {
        let mut desk = Desk::with_nodes(direct(), &[N1]);
        for _ in 0..3 {
            desk.turn();
            desk.hear(300, &bytes);
            desk.silence();
        }
        let failed = MasterEvent::ReadFailed { node: NodeId::N1, cause };
        assert_eq!(desk.told().last(), Some(&failed));
        let damaged = if cause == Cause::Damaged { 3 } else { 0 };
        assert_eq!(desk.master.node_statistics(NodeId::N1).crc_errors, damaged);
    }
}

#[test]
fn looking_for_abnormal_nodes_costs_no_more_than_its_share() {
    let mut desk = Desk::with_nodes(direct(), &[N1, N3]);
    while desk.master.health(NodeId::N3) != Some(Health::Abnormal) {
        match desk.turn()[1] {
            1 => desk.hear(290, &velocity(NodeId::N1, 0.0)),
            _ => desk.silence(),
        }
    }
    let (begin, mut probing) = (desk.now, 0);
    while desk.now - begin < Duration::from_millis(1000) {
        let request = desk.turn();
        if request[1] == 1 {
            desk.hear(290, &velocity(NodeId::N1, 0.0));
        } else {
            let asked = desk.now;
            desk.silence();
            probing += (desk.now - asked).as_micros();
        }
        desk.told();
    }
    assert!((20_000..=50_000).contains(&probing), "{probing} us of a second, 5 % are allowed");
}

#[test]
fn a_mode_that_changes_at_run_time_is_believed_the_second_time_and_ends_the_set_point() {
    let mut desk = Desk::with_nodes(direct(), &[N1]);
    desk.master.set_velocity(NodeId::N1, rps(1.0)).unwrap();
    desk.turn();
    let at = Position::new(5, 6);
    desk.hear(450, &position(NodeId::N1, at));
    assert_eq!(desk.told(), [], "not believed yet");
    desk.turn();
    desk.hear(450, &position(NodeId::N1, at));
    let changed = MasterEvent::ModeChanged { node: NodeId::N1, mode: Mode::Position };
    let status = MasterEvent::Status { node: NodeId::N1, status: Status::Position(at) };
    assert_eq!(desk.told(), [changed, status]);
    desk.sent.clear();
    assert_eq!(desk.turn(), read(NodeId::N1));
    assert!(desk.sent.is_empty(), "1 rps would be 16,256 turns");
    assert_eq!(desk.master.node_statistics(NodeId::N1).other_mode, 1);
    assert_eq!(desk.master.health(NodeId::N1), Some(Health::Online));
}

// Settings

#[test]
fn polling_every_so_often_keeps_its_period_without_drift() {
    let mut config = direct();
    config.polling = Polling::Every(Duration::from_millis(10));
    let mut desk = Desk::with_nodes(config, &[N1]);
    desk.turn();
    desk.hear(290, &velocity(NodeId::N1, 0.0));
    desk.turn();
    let begin = desk.now;
    for turn in 1..100 {
        desk.hear(290, &velocity(NodeId::N1, 0.0));
        desk.turn();
        assert_eq!(desk.now, begin + Duration::from_millis(10 * turn));
    }
}

#[test]
fn manual_polling_reads_when_asked_and_writes_when_told() {
    let mut config = direct();
    config.polling = Polling::Manual;
    let mut desk = Desk::with_nodes(config, &[N1]);
    assert_eq!(desk.master.poll_timeout(), None);
    desk.master.set_velocity(NodeId::N1, rps(1.0)).unwrap();
    assert_eq!(desk.packet(), write(NodeId::N1, 1.0));
    assert_eq!(desk.master.poll_timeout(), None, "nothing more to do");
    desk.master.read(NodeId::N1).unwrap();
    let unknown = CommandError::NotOnline { node: NodeId::N2 };
    assert_eq!(desk.master.read(NodeId::N2), Err(unknown));
    desk.now += US(1000);
    assert_eq!(desk.turn(), read(NodeId::N1));
}

#[test]
fn a_turnaround_gap_is_kept_behind_requests_and_answers() {
    let mut config = direct();
    config.turnaround_gap = US(100);
    let mut desk = Desk::with_nodes(config, &[N1]);
    desk.turn();
    desk.hear(290, &velocity(NodeId::N1, 0.0));
    desk.master.set_velocity(NodeId::N1, rps(1.0)).unwrap();
    let heard = desk.now;
    assert_eq!(desk.packet(), write(NodeId::N1, 1.0));
    assert_eq!(desk.now, heard + US(100));
    let sent = desk.now;
    assert_eq!(desk.turn(), read(NodeId::N1));
    assert_eq!(desk.now, sent + US(160 + 100));
}

#[test]
fn an_echoing_line_is_freed_of_its_echo() {
    let mut config = direct();
    config.removes_echo = true;
    let mut desk = Desk::new(config);
    desk.master.discover();
    for node in NodeId::ALL {
        let request = desk.turn();
        desk.hear(80, &request[..2]);
        desk.hear(40, &request[2..]);
        desk.hear(160, &velocity(node, 0.0));
    }
    assert!(!desk.master.is_discovering());
    desk.told();
    desk.master.set_velocity(NodeId::N1, rps(1.0)).unwrap();
    let read = desk.turn();
    let line = [&desk.sent[0][..], &read, &velocity(NodeId::N1, 3.0)].concat();
    desk.hear(450, &line);
    let status = Status::Velocity(3.0);
    assert_eq!(desk.told(), [MasterEvent::Status { node: NodeId::N1, status }]);
    assert_eq!(desk.master.statistics().echo_bytes, 8 * 4 + 12);
    assert_eq!(desk.master.statistics().echo_errors, 0);
}

#[test]
fn a_line_without_the_echo_that_was_promised_still_works() {
    let mut config = direct();
    config.removes_echo = true;
    let desk = Desk::with_nodes(config, &[N1]);
    assert_eq!(desk.master.health(NodeId::N1), Some(Health::Online));
    assert!(desk.master.statistics().echo_errors > 0);
}

#[test]
fn a_queue_that_fills_keeps_the_oldest_events_and_counts_the_rest() {
    let mut desk = Desk::with_nodes(direct(), &[N1]);
    for turn in 0..20 {
        desk.turn();
        desk.hear(290, &velocity(NodeId::N1, turn as f32));
    }
    assert_eq!(desk.master.statistics().lost_events, 4);
    let events = desk.told();
    assert_eq!(events.len(), 16);
    let status = Status::Velocity(0.0);
    assert_eq!(events[0], MasterEvent::Status { node: NodeId::N1, status });
    assert_eq!(
        desk.master.status(NodeId::N1).unwrap().0,
        Status::Velocity(19.0),
        "the latest is known"
    );
}

#[test]
fn time_that_wraps_changes_nothing() {
    let begins =
        [u64::MAX - 3_000, u64::MAX - 740, u64::MAX / 2 - 3_000, 0].map(Instant::from_micros);
    let stories = begins.map(|begin| {
        let mut desk = Desk::at(direct(), begin);
        desk.master.discover();
        let mut story = vec![];
        for _ in 0..40 {
            let request = desk.turn();
            story.push(((desk.now - begin).as_micros(), request.clone()));
            match request[1] {
                1 => desk.hear(290, &velocity(NodeId::N1, 0.0)),
                _ => desk.silence(),
            }
        }
        story
    });
    assert!(stories.iter().all(|story| *story == stories[0]));
}

#[test]
fn latencies_are_measured_from_the_end_of_the_request_to_the_beginning_of_the_answer() {
    let mut desk = Desk::with_nodes(direct(), &[N1]);
    for latency in [10, 20, 90] {
        desk.turn();
        desk.hear(80 + latency + 160, &velocity(NodeId::N1, 0.0));
    }
    let statistics = desk.master.node_statistics(NodeId::N1);
    let found = [statistics.latency_min(), statistics.latency_mean(), statistics.latency_max()];
    // The discovery's answer took 50 us.
    assert_eq!(found, [US(10), US((10 + 20 + 90 + 50) / 4), US(90)]);
    assert_eq!((statistics.requests, statistics.replies), (4, 4));
}

#[test]
fn a_late_answer_to_the_third_strike_does_not_answer_the_search_for_the_node() {
    let mut desk = Desk::with_nodes(direct(), &[N1]);
    for _ in 0..3 {
        desk.turn();
        desk.silence();
    }
    desk.told();
    assert_eq!(desk.master.poll_transmit(desk.now), None);
    assert_eq!(desk.master.poll_timeout(), Some(desk.now + US(500)));
    desk.hear(400, &velocity(NodeId::N1, 9.0));
    assert_eq!((desk.told(), desk.master.health(NodeId::N1)), (vec![], Some(Health::Abnormal)));
    desk.turn();
    desk.hear(290, &velocity(NodeId::N1, 1.0));
    assert_eq!(desk.master.status(NodeId::N1).unwrap().0, Status::Velocity(1.0));
}

// Slave

fn slave(mode: Mode) -> Slave {
    Slave::new(NodeId::N2, mode, SlaveConfig::direct())
}

fn answers(slave: &mut Slave, bytes: &[u8], now: Instant) -> Vec<Vec<u8>> {
    slave.handle_input(bytes, now);
    core::iter::from_fn(|| slave.poll_transmit(now).map(<[u8]>::to_vec)).collect()
}

const T0: Instant = Instant::from_micros(5_000);

#[test]
fn a_slave_answers_a_read_for_its_own_id_and_nothing_else() {
    let mut slave = slave(Mode::Velocity);
    slave.set_velocity(rps(1.5));
    for node in NodeId::ALL {
        let expected = if node == NodeId::N2 { vec![velocity(node, 1.5)] } else { vec![] };
        assert_eq!(answers(&mut slave, &read(node), T0), expected);
        assert_eq!(answers(&mut slave, &write(node, 1.0), T0), Vec::<Vec<u8>>::new());
    }
    assert_eq!((slave.statistics().reads, slave.statistics().writes), (1, 1));
    assert_eq!((slave.statistics().foreign, slave.statistics().replies), (14, 1));
}

#[test]
fn a_slave_follows_foreign_traffic_and_does_not_look_inside_it() {
    let mut slave = slave(Mode::Velocity);
    // A WRITE for node 1 whose payload is a whole READ for node 2.
    let read = ReadRequest::new(NodeId::N2);
    let payload = f32::from_le_bytes(*read.as_bytes());
    let foreign = WriteRequest::velocity(NodeId::N1, rps(payload));
    assert_eq!(answers(&mut slave, foreign.as_bytes(), T0), Vec::<Vec<u8>>::new());
    assert_eq!(slave.statistics().foreign, 1);
}

#[test]
fn a_slave_reads_a_write_in_its_own_mode() {
    let bytes = write(NodeId::N2, 1.0);
    let mut turning = slave(Mode::Velocity);
    turning.handle_input(&bytes, T0);
    assert_eq!(turning.poll_event(), Some(SlaveEvent::Command(Target::Velocity(rps(1.0)))));
    let mut moving = slave(Mode::Position);
    moving.handle_input(&bytes, T0);
    let target = Target::Position(Position::new(0, 16_256));
    assert_eq!(moving.poll_event(), Some(SlaveEvent::Command(target)));
    assert_eq!(moving.command(), Some(target));
}

#[test]
fn on_any_error_the_previous_command_stays() {
    let mut slave = slave(Mode::Velocity);
    slave.handle_input(&write(NodeId::N2, 1.0), T0);
    slave.poll_event();
    let good = write(NodeId::N2, 2.0);
    for bit in 0..64 {
        let mut bad = good.clone();
        bad[bit / 8] ^= 1 << (bit % 8);
        slave.handle_input(&bad, T0);
        // A quiet line ends what the damage has begun.
        while let Some(at) = slave.poll_timeout() {
            slave.handle_timeout(at);
        }
    }
    let nan = WriteRequest::position(NodeId::N2, Position::new(0, 0x7FC0));
    slave.handle_input(nan.as_bytes(), T0);
    assert_eq!(slave.command(), Some(Target::Velocity(rps(1.0))));
    assert_eq!((slave.poll_event(), slave.statistics().refused), (None, 1));
}

#[test]
fn a_request_overtaken_by_another_packet_is_not_answered() {
    let mut slave = slave(Mode::Velocity);
    let both = [read(NodeId::N2), read(NodeId::N5)].concat();
    assert_eq!(answers(&mut slave, &both, T0), Vec::<Vec<u8>>::new());
    let twice = [read(NodeId::N2), read(NodeId::N2)].concat();
    assert_eq!(answers(&mut slave, &twice, T0).len(), 1, "one answer for the last");
    assert_eq!(slave.statistics().overtaken, 2);
}

#[test]
fn a_read_behind_a_false_header_is_answered_when_the_line_is_quiet() {
    let mut slave = slave(Mode::Velocity);
    let line = [&[0xBB][..], &read(NodeId::N2)].concat();
    assert_eq!(answers(&mut slave, &line, T0), Vec::<Vec<u8>>::new());
    let quiet = slave.poll_timeout().unwrap();
    assert_eq!(quiet, T0 + US(100));
    slave.handle_timeout(quiet);
    assert_eq!(slave.poll_transmit(quiet), Some(&velocity(NodeId::N2, 0.0)[..]));
    assert_eq!(slave.poll_timeout(), None);
}

#[test]
fn the_watchdog_ends_a_command_and_tells_it_once() {
    let mut config = SlaveConfig::direct();
    config.watchdog = Some(Duration::from_millis(100));
    let mut slave: Slave = Slave::new(NodeId::N2, Mode::Velocity, config);
    assert_eq!(slave.poll_timeout(), None, "nothing moves yet");
    slave.handle_input(&write(NodeId::N2, 1.0), T0);
    slave.poll_event();
    let end = T0 + Duration::from_millis(100);
    assert_eq!(slave.poll_timeout(), Some(end));
    slave.handle_timeout(Instant::from_micros(end.as_micros() - 1));
    assert_eq!(slave.poll_event(), None);
    slave.handle_timeout(end);
    assert_eq!((slave.poll_event(), slave.command()), (Some(SlaveEvent::Watchdog), None));
    slave.handle_timeout(end + Duration::from_millis(100));
    assert_eq!((slave.poll_event(), slave.poll_timeout()), (None, None));
}

#[test]
fn a_position_node_does_not_answer_before_it_knows_where_it_is() {
    let mut slave = slave(Mode::Position);
    assert_eq!(answers(&mut slave, &read(NodeId::N2), T0), Vec::<Vec<u8>>::new());
    slave.set_position(Position::new(4, -2));
    let expected = [position(NodeId::N2, Position::new(4, -2))];
    assert_eq!(answers(&mut slave, &read(NodeId::N2), T0), expected);
}

#[test]
fn a_slave_takes_id_and_mode_from_its_switch_as_told() {
    let dip: DipSwitch = "0101".parse().unwrap();
    let slave: Slave =
        Slave::from_dip(dip, IdReading::ValuePlusOne, SlaveConfig::direct()).unwrap();
    assert_eq!((slave.node(), slave.mode()), (NodeId::N3, Mode::Position));
    let dip: DipSwitch = "0000".parse().unwrap();
    assert!(Slave::<OneMotor>::from_dip(dip, IdReading::Value, SlaveConfig::direct()).is_err());
}

#[test]
fn a_turnaround_gap_holds_the_answer_back() {
    let mut config = SlaveConfig::direct();
    config.turnaround_gap = US(30);
    let mut slave: Slave = Slave::new(NodeId::N2, Mode::Velocity, config);
    assert_eq!(answers(&mut slave, &read(NodeId::N2), T0), Vec::<Vec<u8>>::new());
    assert_eq!(slave.poll_timeout(), Some(T0 + US(30)));
    assert!(slave.poll_transmit(T0 + US(30)).is_some());
}

#[test]
fn a_read_that_comes_to_light_with_the_next_bytes_is_not_answered_any_more() {
    let mut slave = slave(Mode::Velocity);
    // A false header in front of a READ, and nobody who calls when the line is quiet.
    let line = [&[0xBB][..], &read(NodeId::N2)].concat();
    assert_eq!(answers(&mut slave, &line, T0), Vec::<Vec<u8>>::new());
    let late = T0 + Duration::from_millis(90);
    assert_eq!(answers(&mut slave, &read(NodeId::N5), late), Vec::<Vec<u8>>::new());
    assert_eq!((slave.statistics().reads, slave.statistics().overtaken), (1, 1));
}

// Boards with three motors

#[test]
fn a_three_motor_board_answers_writes_and_its_master_waits_for_that() {
    let mut master: Master<ThreeMotors> = Master::new(direct());
    let mut slave: Slave<ThreeMotors> =
        Slave::new(NodeId::N1, Mode::Velocity, SlaveConfig::direct());
    master.discover();
    let mut now = T0;
    let (mut heard, mut written) = (0, 0);
    for _ in 0..40 {
        let request = master.poll_transmit(now).map(<[u8]>::to_vec);
        if let Some(request) = request {
            written += usize::from(request[0] == 0xBB);
            assert!(request[0] == 0xAA || request.len() == 16);
            slave.handle_input(&request, now);
            if let Some(answer) = slave.poll_transmit(now).map(<[u8]>::to_vec) {
                now += US(700);
                master.handle_input(&answer, now);
                continue;
            }
        }
        now = master.poll_timeout().unwrap();
        master.handle_timeout(now);
        while let Some(event) = master.poll_event() {
            if let MasterEvent::Status { status: Status::Velocity(_), .. } = event {
                heard += 1;
                let targets = [rps(1.0), rps(-2.0), rps(3.0)];
                master.set_velocity(NodeId::N1, targets).unwrap();
            }
        }
    }
    assert!(heard > 5 && written > 5, "{heard} answers, {written} writes");
    let targets = Target::Velocity([rps(1.0), rps(-2.0), rps(3.0)]);
    assert_eq!(slave.command(), Some(targets));
    assert_eq!(master.node_statistics(NodeId::N1).timeouts, 0);
    assert_eq!(slave.statistics().replies, slave.statistics().reads + slave.statistics().writes);
}

// Schedule

#[test]
fn the_schedule_tells_the_rate_of_a_bus_before_it_is_wired() {
    let plan = Schedule::new(8);
    assert_eq!((plan.cycle_time(), plan.cycles_per_second(), plan.busy_pct()), (US(3600), 277, 88));
    let mut reading = plan;
    reading.writes = false;
    assert_eq!(reading.exchange_time(), US(80 + 50 + 160));
    assert_eq!(plan.exchange_time_of::<ThreeMotors>(), US(320 + 50 + 320));
    let mut slow = plan;
    slow.baud = 57_600;
    assert_eq!(slow.exchange_time(), US(1389 + 695 + 50 + 1389));
    assert_eq!(Schedule::new(0).cycles_per_second(), 0);
}

#[test]
fn the_roles_fit_into_small_memories() {
    let sizes = [size_of::<Master>(), size_of::<Slave>(), size_of::<Master<ThreeMotors>>()];
    println!(
        "Master {} bytes, Slave {} bytes, three motors: Master {}",
        sizes[0], sizes[1], sizes[2]
    );
    assert!(sizes[0] <= 2048 && sizes[1] <= 384 && sizes[2] <= 3072, "{sizes:?}");
}

#[test]
fn a_flood_of_set_points_does_not_keep_the_others_from_being_read() {
    let mut desk = Desk::with_nodes(direct(), &[N1, N3]);
    let mut reads = [0; 9];
    for _ in 0..200 {
        desk.master.set_velocity(NodeId::N1, rps(1.0)).unwrap();
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

#[test]
fn all_nodes_are_stopped_before_the_next_exchange() {
    let nodes = NodeId::ALL.map(|node| (node, Mode::Velocity));
    let mut desk = Desk::with_nodes(direct(), &nodes);
    assert_eq!(desk.master.stop_all(), 0);
    let begin = desk.now;
    desk.turn();
    let stops = NodeId::ALL.map(|node| write(node, 0.0));
    assert_eq!(desk.sent, stops);
    assert_eq!(desk.now, begin + US(7 * 160), "one behind the other");
}
