//! The master: what it writes to which node, and when it must not.

use axlewire::{
    endpoint::Endpoint,
    ikeya::{
        Master, Mode, NodeId, Position, PositionResponse, Rps, VelocityResponse, WriteRequest,
        master::{CommandError, Health, MasterConfig, MasterEvent, Polling},
    },
    sim::{Line, MotorNode, Who},
    time::{Duration, Instant},
};

// The calls under test.

fn discover(master: &mut Master, now: Instant) {
    master.discover(now);
}

fn set_velocity(
    master: &mut Master,
    node: NodeId,
    value: f32,
    now: Instant,
) -> Result<(), CommandError> {
    master.set_velocity(node, rps(value), now)
}

fn confirm(master: &mut Master, node: NodeId, now: Instant) {
    master.confirm(node, now).unwrap();
}

fn stop(master: &mut Master, node: NodeId, now: Instant) {
    master.stop(node, now);
}

// The bus.

const US: fn(u32) -> Duration = Duration::from_micros;
const MS: fn(u32) -> Duration = Duration::from_millis;

const WRITE: u8 = 0xBB;
const READ: u8 = 0xAA;

fn rps(value: f32) -> Rps {
    Rps::new(value).unwrap()
}

fn turns(rotation: i16) -> Position {
    Position::new(0, rotation)
}

fn with_polling(polling: Polling) -> MasterConfig {
    let mut config = MasterConfig::direct();
    config.polling = polling;
    config
}

fn writes(packets: &[Vec<u8>]) -> Vec<Vec<u8>> {
    packets.iter().filter(|packet| packet[0] == WRITE).cloned().collect()
}

/// What a node answers.
#[derive(Clone, Copy)]
enum Answer {
    Silence,
    Velocity(f32),
    Position(Position),
}

impl Answer {
    fn of(self, node: NodeId) -> Option<Vec<u8>> {
        match self {
            Self::Silence => None,
            Self::Velocity(at) => Some(VelocityResponse::new(node, rps(at)).as_bytes().to_vec()),
            Self::Position(at) => Some(PositionResponse::new(node, at).as_bytes().to_vec()),
        }
    }
}

/// A master, the time, and the nodes' answers.
struct Desk {
    master: Master,
    now: Instant,
    answers: [Answer; 8],
    events: Vec<MasterEvent>,
}

impl Desk {
    /// A master that has discovered these nodes.
    fn new(config: MasterConfig, nodes: &[(NodeId, Answer)]) -> Self {
        let now = Instant::from_millis(1000);
        let master = Master::new(config, now);
        let mut desk = Self { master, now, answers: [Answer::Silence; 8], events: vec![] };
        nodes.iter().for_each(|&(node, answer)| desk.set(node, answer));
        discover(&mut desk.master, desk.now);
        while desk.master.is_discovering() {
            desk.packet();
        }
        desk.events.clear();
        desk
    }

    fn set(&mut self, node: NodeId, answer: Answer) {
        self.answers[usize::from(node.get()) - 1] = answer;
    }

    /// Advances to the next packet, and, for a READ, past the answer or the end of the window;
    /// `None` if there is nothing to do.
    fn packet(&mut self) -> Option<Vec<u8>> {
        let sent = self.sent()?;
        if sent[0] == READ {
            let node = NodeId::new(sent[1]).unwrap();
            match self.answers[usize::from(sent[1]) - 1].of(node) {
                Some(answer) => self.hear(450, &answer),
                None => self.expire(),
            }
        }
        self.events.extend(core::iter::from_fn(|| self.master.poll_event()));
        Some(sent)
    }

    /// Advances to the next packet, and no further.
    fn sent(&mut self) -> Option<Vec<u8>> {
        for _ in 0..100 {
            if let Some(bytes) = self.master.poll_transmit(self.now) {
                return Some(bytes.to_vec());
            }
            self.master.poll_timeout()?;
            self.expire();
        }
        panic!("nothing is ever sent");
    }

    /// The next packets, at most this many.
    fn packets(&mut self, most: usize) -> Vec<Vec<u8>> {
        core::iter::from_fn(|| self.packet()).take(most).collect()
    }

    fn expire(&mut self) {
        self.now = self.master.poll_timeout().expect("a deadline");
        self.master.handle_timeout(self.now);
    }

    fn hear(&mut self, after_us: u32, bytes: &[u8]) {
        self.now += US(after_us);
        self.master.handle_input(bytes, self.now);
    }
}

const TURNING: (NodeId, Answer) = (NodeId::N1, Answer::Velocity(0.0));

/// A velocity node with a set-point that has just answered as a position node at 7 turns.
fn in_doubt() -> Desk {
    let mut desk = Desk::new(MasterConfig::direct(), &[TURNING]);
    set_velocity(&mut desk.master, NodeId::N1, 1.0, desk.now).unwrap();
    desk.set(NodeId::N1, Answer::Position(turns(7)));
    assert_eq!(desk.packets(2).iter().map(|sent| sent[0]).collect::<Vec<_>>(), [WRITE, READ]);
    desk
}

// A stop of a position node

#[test]
fn a_stop_of_a_position_node_holds_a_position_measured_after_the_call() {
    let there = (NodeId::N3, Answer::Position(turns(7)));
    let mut desk = Desk::new(with_polling(Polling::Manual), &[there]);
    desk.set(NodeId::N3, Answer::Position(turns(40)));
    desk.now += MS(8000);
    stop(&mut desk.master, NodeId::N3, desk.now);
    let hold = WriteRequest::position(NodeId::N3, turns(40)).as_bytes().to_vec();
    let written = writes(&desk.packets(6));
    assert_eq!(written.first(), Some(&hold), "the node is sent back to where it was 8 s ago");
}

#[test]
fn a_stop_of_an_abnormal_position_node_waits_for_its_next_answer() {
    let there = (NodeId::N3, Answer::Position(turns(7)));
    let mut desk = Desk::new(MasterConfig::direct(), &[there]);
    desk.set(NodeId::N3, Answer::Silence);
    while desk.master.health(NodeId::N3) != Some(Health::Abnormal) {
        desk.packet();
    }
    desk.now += MS(3_600_000);
    stop(&mut desk.master, NodeId::N3, desk.now);
    assert_eq!(writes(&desk.packets(4)), [[0; 0]; 0], "an hour-old position is written");
    desk.set(NodeId::N3, Answer::Position(turns(40)));
    let hold = WriteRequest::position(NodeId::N3, turns(40)).as_bytes().to_vec();
    assert_eq!(writes(&desk.packets(6)).first(), Some(&hold), "it holds its reported position");
}

// The mode

#[test]
fn nothing_is_written_while_the_mode_of_a_node_is_in_doubt() {
    let mut desk = in_doubt();
    // Once the mode is known, the node is stopped where it is.
    let hold = WriteRequest::position(NodeId::N1, turns(7)).as_bytes().to_vec();
    let written = writes(&desk.packets(6));
    let is_held = written.iter().all(|write| *write == hold);
    assert!(is_held, "1.0 rps is sent to a node that reads it as 16256 turns: {written:02x?}");
}

#[test]
fn an_answer_in_another_mode_confirms_nothing() {
    let mut desk = Desk::new(MasterConfig::direct(), &[TURNING]);
    set_velocity(&mut desk.master, NodeId::N1, 1.0, desk.now).unwrap();
    confirm(&mut desk.master, NodeId::N1, desk.now);
    desk.set(NodeId::N1, Answer::Position(turns(7)));
    desk.packets(10);
    let confirmed = MasterEvent::Confirmed { node: NodeId::N1 };
    let is_told = desk.events.contains(&confirmed);
    assert!(!is_told, "the set-point of the old mode is reported as confirmed");
}

#[test]
fn a_stop_while_the_mode_is_in_doubt_is_never_go_to_0() {
    let mut desk = in_doubt();
    stop(&mut desk.master, NodeId::N1, desk.now);
    let hold = WriteRequest::position(NodeId::N1, turns(7)).as_bytes().to_vec();
    assert_eq!(writes(&desk.packets(10)).first(), Some(&hold), "the stop sends the node to 0");
}

#[test]
fn a_set_point_is_refused_while_the_mode_is_in_doubt() {
    let mut desk = in_doubt();
    let taken = set_velocity(&mut desk.master, NodeId::N1, 2.0, desk.now);
    assert!(taken.is_err(), "the set-point is kept for an unknown mode");
}

#[test]
fn a_late_answer_in_another_mode_puts_the_mode_in_doubt() {
    let mut desk = Desk::new(MasterConfig::direct(), &[TURNING]);
    set_velocity(&mut desk.master, NodeId::N1, 1.0, desk.now).unwrap();
    desk.packets(2);
    let late = Answer::Position(turns(7));
    desk.set(NodeId::N1, late);
    desk.hear(10, &late.of(NodeId::N1).unwrap());
    let next = desk.packet().unwrap();
    assert_eq!(next[0], READ, "the late answer in the other mode is ignored");
}

// A stop that is owed

/// A bus in virtual time on which node 1 turns at 10 rps.
fn at_10_rps() -> Line<Master, MotorNode> {
    let mut line = Line::new(500_000, 1, Master::new(MasterConfig::direct(), Instant::default()));
    line.add(MotorNode::new(NodeId::N1, Mode::Velocity));
    let now = line.now();
    discover(line.head_mut(), now);
    line.run_for(MS(50)).unwrap();
    let now = line.now();
    set_velocity(line.head_mut(), NodeId::N1, 10.0, now).unwrap();
    line.run_for(MS(500)).unwrap();
    assert!(line.tail(0).motor().velocity().get() > 9.9);
    line
}

fn pull_out(line: &mut Line<Master, MotorNode>, is_out: bool) {
    line.stub_mut(Who::Tail(0)).unplugged = is_out;
}

/// Node 1 comes back after it was abnormal; its speed five seconds later.
fn rps_after_its_return(mut line: Line<Master, MotorNode>) -> f32 {
    line.run_for(MS(100)).unwrap();
    assert_eq!(line.head().health(NodeId::N1), Some(Health::Abnormal));
    pull_out(&mut line, false);
    line.run_for(MS(5000)).unwrap();
    assert_eq!(line.head().health(NodeId::N1), Some(Health::Online));
    line.tail(0).motor().velocity().get()
}

#[test]
fn a_stop_that_a_pulled_cable_has_swallowed_is_given_again_when_the_node_is_back() {
    let mut line = at_10_rps();
    pull_out(&mut line, true);
    let now = line.now();
    stop(line.head_mut(), NodeId::N1, now);
    let rps = rps_after_its_return(line);
    assert!(rps.abs() < 0.05, "the stop is forgotten, and the motor keeps running");
}

#[test]
fn a_node_that_became_abnormal_under_a_set_point_is_stopped_when_it_is_back() {
    let mut line = at_10_rps();
    pull_out(&mut line, true);
    let rps = rps_after_its_return(line);
    assert!(rps.abs() < 0.05, "the motor keeps running without a command");
}

#[test]
fn a_stop_is_written_until_two_have_been_followed_by_an_answer_in_manual_polling_too() {
    let mut desk = Desk::new(with_polling(Polling::Manual), &[TURNING]);
    stop(&mut desk.master, NodeId::N1, desk.now);
    let order: Vec<_> = desk.packets(4).iter().map(|packet| packet[0]).collect();
    assert_eq!(order, [WRITE, READ, WRITE, READ], "after one lost packet the motor keeps running");
}

// Answers

#[test]
fn the_echo_of_eight_writes_and_a_read_is_removed() {
    let nodes = NodeId::ALL.map(|node| (node, Answer::Velocity(0.0)));
    let mut config = MasterConfig::direct();
    let mut desk = Desk::new(config, &nodes);
    // The same on a line that echoes, found by hand.
    config.removes_echo = true;
    desk.master = Master::new(config, desk.now);
    discover(&mut desk.master, desk.now);
    while desk.master.is_discovering() {
        let request = desk.sent().unwrap();
        let node = NodeId::new(request[1]).unwrap();
        desk.hear(450, &[request, Answer::Velocity(0.0).of(node).unwrap()].concat());
    }
    assert_eq!(desk.master.statistics().echo_errors, 0);
    for node in NodeId::ALL {
        set_velocity(&mut desk.master, node, 1.0, desk.now).unwrap();
    }
    let mut echo = vec![];
    while echo.len() < 8 * 8 + 4 {
        echo.extend(desk.sent().unwrap());
    }
    desk.hear(300, &echo);
    assert_eq!(desk.master.statistics().echo_errors, 0, "a perfect echo is counted as an error");
}

#[test]
fn an_answer_that_is_whole_before_its_request_has_left_is_no_answer() {
    let mut desk = Desk::new(MasterConfig::direct(), &[TURNING]);
    assert_eq!(desk.sent().unwrap()[0], READ);
    desk.hear(1, &Answer::Velocity(9.0).of(NodeId::N1).unwrap());
    let told = desk.master.poll_event();
    assert_eq!(told, None, "an answer from before its request counts as current");
}

#[test]
fn a_confirmation_that_was_asked_for_comes_to_an_end_when_the_node_is_released() {
    let mut desk = Desk::new(MasterConfig::direct(), &[TURNING]);
    set_velocity(&mut desk.master, NodeId::N1, 1.0, desk.now).unwrap();
    confirm(&mut desk.master, NodeId::N1, desk.now);
    desk.master.release(NodeId::N1);
    desk.packets(50);
    let is_end = |event: &MasterEvent| {
        matches!(event, MasterEvent::Confirmed { .. } | MasterEvent::NotConfirmed { .. })
    };
    assert!(desk.events.iter().any(is_end), "the confirmation is never reported");
}
