//! A master called by hand, in time controlled by the test.

/// What the scenarios use of the library.
pub(crate) use axlewire::{
    endpoint::{Arrival, Endpoint, Transmit, Unsent},
    ikeya::{
        Master, Mode, NodeId, Position, Slave, Status, Target, WriteRequest,
        board::ThreeMotors,
        master::{
            Cause, CommandError, Health, MasterConfig, MasterEvent, NodeSet, Polling, StopProgress,
        },
    },
    sim::{Line, Who},
    time::{Duration, Instant},
};

pub(crate) use crate::packets::*;

pub(crate) const READ: u8 = 0xAA;
pub(crate) const WRITE: u8 = 0xBB;

pub(crate) fn direct() -> MasterConfig {
    MasterConfig::direct()
}

pub(crate) fn manual() -> MasterConfig {
    with(direct(), |config| config.polling = Polling::Manual)
}

/// Settings of a bus with these nodes only.
pub(crate) fn only(nodes: &[NodeId]) -> MasterConfig {
    with(direct(), |config| config.nodes = nodes.iter().copied().collect())
}

pub(crate) const N1: (NodeId, Mode) = (NodeId::N1, Mode::Velocity);
pub(crate) const N3: (NodeId, Mode) = (NodeId::N3, Mode::Position);

/// Header and node of a packet.
pub(crate) fn kind(packet: &[u8]) -> (u8, u8) {
    (packet[0], packet[1])
}

pub(crate) fn kinds(packets: &[Vec<u8>]) -> Vec<(u8, u8)> {
    packets.iter().map(|packet| kind(packet)).collect()
}

pub(crate) fn writes(packets: &[Vec<u8>]) -> Vec<Vec<u8>> {
    packets.iter().filter(|packet| packet[0] == WRITE).cloned().collect()
}

/// A position this far beside another one.
pub(crate) fn beside(place: Position, counts: i32) -> Position {
    Position::from_counts(place.counts() + counts).unwrap()
}

/// The event of a reading.
pub(crate) fn reading(node: NodeId, status: Status) -> MasterEvent {
    MasterEvent::Status { node, status }
}

/// The event of a health.
pub(crate) fn turned(node: NodeId, health: Health) -> MasterEvent {
    MasterEvent::Health { node, health }
}

/// A node's answer.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Answer {
    Silence,
    Velocity(f32),
    Position(Position),
}

impl Answer {
    fn packet(self, node: NodeId) -> Option<Vec<u8>> {
        match self {
            Self::Silence => None,
            Self::Velocity(at) => Some(velocity(node, at)),
            Self::Position(at) => Some(position(node, at)),
        }
    }
}

/// A master, the time, the nodes' answers, and what the master has sent and reported.
#[derive(Clone)]
pub(crate) struct Desk {
    pub(crate) master: Master,
    pub(crate) now: Instant,
    pub(crate) sent: Vec<Vec<u8>>,
    events: Vec<MasterEvent>,
    answers: [Answer; 8],
    is_behind_write: bool,
}

impl Desk {
    pub(crate) fn new(config: MasterConfig) -> Self {
        Self::at(config, Instant::from_micros(1_000_000))
    }

    pub(crate) fn at(config: MasterConfig, now: Instant) -> Self {
        let master = Master::new(config, now);
        Self {
            master,
            now,
            sent: vec![],
            events: vec![],
            answers: [Answer::Silence; 8],
            is_behind_write: false,
        }
    }

    /// A master that has discovered these nodes and reported it. They answer 0 rps, or 7 turns and
    /// 3 counts, unless the test answers itself.
    pub(crate) fn with_nodes(config: MasterConfig, nodes: &[(NodeId, Mode)]) -> Self {
        let mut desk = Self::new(config);
        for &(node, mode) in nodes {
            desk.answer(
                node,
                match mode {
                    Mode::Velocity => Answer::Velocity(0.0),
                    Mode::Position => Answer::Position(Position::new(7, 3)),
                },
            );
        }
        desk.master.discover(desk.now);
        while desk.master.is_discovering() {
            let asked = desk.turn();
            desk.reply(&asked, 290);
        }
        desk.told();
        desk
    }

    /// The same with a change to the settings of a direct line.
    pub(crate) fn tuned(change: impl FnOnce(&mut MasterConfig), nodes: &[(NodeId, Mode)]) -> Self {
        Self::with_nodes(with(direct(), change), nodes)
    }

    /// Node 1, commanded to turn.
    pub(crate) fn turning(config: MasterConfig, speed: f32) -> Self {
        let mut desk = Self::with_nodes(config, &[N1]);
        desk.master.set_velocity(NodeId::N1, rps(speed), desk.now).unwrap();
        desk
    }

    /// One node, told to stop.
    pub(crate) fn stopping(config: MasterConfig, node: (NodeId, Mode)) -> Self {
        let mut desk = Self::with_nodes(config, &[node]);
        desk.master.stop(node.0, desk.now);
        desk
    }

    /// Node 3, told to stop, which it answers at this place.
    pub(crate) fn stopping_at(config: MasterConfig, place: Position) -> Self {
        let mut desk = Self::stopping(config, N3);
        desk.answer(NodeId::N3, Answer::Position(place));
        desk
    }

    /// Node 1, silent until it is abnormal.
    pub(crate) fn losing(config: MasterConfig) -> Self {
        let mut desk = Self::with_nodes(config, &[N1]);
        desk.lose(NodeId::N1);
        desk
    }

    /// Node 1, just asked by a READ.
    pub(crate) fn asking(config: MasterConfig) -> Self {
        let mut desk = Self::with_nodes(config, &[N1]);
        desk.turn();
        desk
    }

    /// From now on a node answers this.
    pub(crate) fn answer(&mut self, node: NodeId, answer: Answer) {
        self.answers[usize::from(node.get()) - 1] = answer;
    }

    /// Answers a READ like the node, or lets its window close.
    fn reply(&mut self, request: &[u8], after_us: u32) {
        let node = NodeId::new(request[1]).unwrap();
        match self.answers[usize::from(request[1]) - 1].packet(node) {
            Some(answer) => self.hear(after_us, &answer),
            None => self.silence(),
        }
    }

    /// Advances to the next packet, and, for a READ, past its answer or the end of its window;
    /// `None` if there is nothing to do.
    pub(crate) fn exchange(&mut self) -> Option<Vec<u8>> {
        while self.master.poll_timeout().is_some() {
            if let Some(packet) = self.master.poll_transmit(self.now).map(<[u8]>::to_vec) {
                self.is_behind_write = packet[0] == WRITE;
                if packet[0] == READ {
                    let wait = self.answer_us();
                    self.reply(&packet, wait);
                }
                self.keep_events();
                return Some(packet);
            }
            self.expire();
        }
        None
    }

    /// When the answer to the READ just handed out is complete: 100 us after the READ has left,
    /// which may have packets before it, plus its own 160 us.
    fn answer_us(&self) -> u32 {
        let deadline = self.master.poll_timeout().expect("a window");
        // It may be the dead-man's deadline, which is not waited for.
        (deadline - self.now).as_micros().saturating_sub(400).max(340)
    }

    /// The next packets, at most this many.
    pub(crate) fn packets(&mut self, most: usize) -> Vec<Vec<u8>> {
        core::iter::from_fn(|| self.exchange()).take(most).collect()
    }

    /// Runs for this long while the nodes answer; returns the packets.
    pub(crate) fn run(&mut self, span: Duration) -> Vec<Vec<u8>> {
        let (end, mut sent) = (self.now + span, vec![]);
        while self.now < end {
            match self.exchange() {
                Some(packet) => sent.push(packet),
                None => break,
            }
        }
        self.now = self.now.max(end);
        sent
    }

    /// Runs until the stop of a node has come this far; returns the packets.
    pub(crate) fn until(&mut self, node: NodeId, progress: StopProgress) -> Vec<Vec<u8>> {
        let mut sent = vec![];
        while self.master.stop_progress(node) != progress {
            sent.push(self.exchange().expect("nothing is sent"));
            assert!(sent.len() < 10_000, "never {progress:?}");
        }
        sent
    }

    /// Runs for this long while a node answers by the time since the call, in microseconds; returns
    /// what it was sent, and when.
    pub(crate) fn follow(
        &mut self,
        node: NodeId,
        span: Duration,
        motor: impl Fn(u32) -> Answer,
    ) -> Vec<(u32, Vec<u8>)> {
        let (begin, mut sent) = (self.now, vec![]);
        let is_over = |at: Instant| at - begin >= span;
        while !is_over(self.now) {
            let at = (self.now - begin).as_micros();
            if let Some(packet) = self.master.poll_transmit(self.now).map(<[u8]>::to_vec) {
                self.is_behind_write = packet[0] == WRITE;
                self.answer(node, motor(at));
                if packet[0] == READ {
                    let wait = self.answer_us();
                    self.reply(&packet, wait);
                }
                if packet[1] == node.get() {
                    sent.push((at, packet));
                }
                self.keep_events();
            } else if self.master.poll_timeout().is_none_or(is_over) {
                break;
            } else {
                self.expire();
            }
        }
        self.now = self.now.max(begin + span);
        sent
    }

    /// A node goes silent; runs until it is abnormal.
    pub(crate) fn lose(&mut self, node: NodeId) {
        self.answer(node, Answer::Silence);
        while self.master.health(node) != Some(Health::Abnormal) {
            self.exchange().expect("nothing is sent");
        }
    }

    /// The same with [`Polling::Manual`].
    pub(crate) fn lose_by_hand(&mut self, node: NodeId) {
        self.answer(node, Answer::Silence);
        while self.master.read(node, self.now).is_ok() {
            self.exchange().expect("nothing is sent");
        }
    }

    /// Advances to the next READ and returns it; packets sent before it are in `sent`.
    pub(crate) fn turn(&mut self) -> Vec<u8> {
        loop {
            let packet = self.packet();
            if packet[0] == READ {
                return packet;
            }
            self.sent.push(packet);
        }
    }

    /// Advances to the next READ; these bytes arrive this much later.
    pub(crate) fn turn_with(&mut self, after_us: u32, bytes: &[u8]) {
        self.turn();
        self.hear(after_us, bytes);
    }

    /// Advances to the next READ, which is not answered.
    pub(crate) fn miss(&mut self) {
        self.turn();
        self.silence();
    }

    /// Advances to the next packet and returns it, unanswered.
    pub(crate) fn packet(&mut self) -> Vec<u8> {
        for _ in 0..100 {
            if let Some(bytes) = self.master.poll_transmit(self.now) {
                self.is_behind_write = bytes[0] == WRITE;
                return bytes.to_vec();
            }
            self.expire();
        }
        panic!("nothing is sent");
    }

    /// Advances to the master's next deadline.
    fn expire(&mut self) {
        let next = self.master.poll_timeout().expect("something to do");
        assert!(next > self.now, "a busy loop at {next:?}");
        self.check_sleep(next);
        self.now = next;
        self.master.handle_timeout(self.now);
    }

    /// A driver that sleeps until the next deadline misses nothing. A packet handed out behind a
    /// WRITE that is still leaving would not leave any earlier.
    fn check_sleep(&self, next: Instant) {
        if self.is_behind_write {
            return;
        }
        let just_before = Instant::from_micros(next.as_micros() - 1);
        let mut asleep = self.master.clone();
        asleep.handle_timeout(just_before);
        assert_eq!(asleep.poll_transmit(just_before), None, "it was due before {next:?}");
    }

    /// Lets time pass and then passes in these bytes.
    pub(crate) fn hear(&mut self, after_us: u32, bytes: &[u8]) {
        self.now += US(after_us);
        self.master.handle_input(bytes, self.now);
    }

    /// Lets the window close.
    pub(crate) fn silence(&mut self) {
        self.now = self.master.poll_timeout().expect("a window");
        self.master.handle_timeout(self.now);
    }

    fn keep_events(&mut self) {
        while let Some(event) = self.master.poll_event() {
            self.events.push(event);
        }
    }

    /// Everything reported since the last call.
    pub(crate) fn told(&mut self) -> Vec<MasterEvent> {
        self.keep_events();
        std::mem::take(&mut self.events)
    }

    /// The same without readings and health.
    pub(crate) fn news(&mut self) -> Vec<MasterEvent> {
        let is_news = |event: &MasterEvent| {
            !matches!(event, MasterEvent::Status { .. } | MasterEvent::Health { .. })
        };
        self.told().into_iter().filter(is_news).collect()
    }
}
