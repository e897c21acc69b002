//! The master: its commands, and the calls of its driver.

use super::{
    config::MasterConfig,
    event::{CommandError, MasterEvent},
    line::{Line, frame_pause},
    node::{Node, Request},
    queue::{Queue, View, index_of},
    statistics::MasterStatistics,
};
use crate::{
    endpoint::{Arrival, Endpoint, LineRules, Transmit, Unsent},
    events::Events,
    ikeya::{
        board::{Board, OneMotor, PACKET_LEN, Target},
        units::{NodeId, speed},
    },
    stats::count_apart,
    time::{Instant, reached, wire_time},
};

/// Capacity of the event queue.
const EVENTS: usize = 16;

/// The master: discovers nodes, repeats the latest set-points, reads every node in turn, sends
/// stops until the motors are seen to be still, and accepts only genuine replies.
///
/// ```
/// use axlewire::{endpoint::Endpoint, ikeya::{master::MasterConfig, Master}, time::Instant};
///
/// let now = Instant::from_micros(0);
/// let mut master = Master::new(MasterConfig::direct(), now);
/// master.discover(now);
/// assert_eq!(master.poll_transmit(now), Some(&[0xAA, 0x01, 0xBE, 0xD0][..])); // READ 1
/// assert_eq!(master.poll_transmit(now), None); // until the window closes
/// assert_eq!(master.poll_timeout(), Some(Instant::from_micros(80 + 500 + 160)));
/// ```
///
/// It has no clock and no port; see [`Endpoint`] for what to call when. A cycle visits every online
/// node: a WRITE if it has a set-point, then a READ (I8). With
/// [`ThreeMotors`](crate::ikeya::board::ThreeMotors) the WRITE is answered, so it also serves as
/// the READ (I10).
///
/// # Stops
///
/// A stop is a debt (I12). As soon as [`stop`](Self::stop) is called, the set-point is gone and new
/// ones are refused, until the stop is confirmed: two of its WRITEs have each been followed by an
/// answer from the node ([`MasterEvent::Stopped`]). An answer shows that the READ was heard, not
/// the WRITE, so the stop is repeated until two answers of a velocity node, or three of a position
/// node, at least 20 ms apart, show a motor that is still ([`MasterEvent::StandingStill`]),
/// whatever happens on the line, in the port or in the event queue. A motor that still moves after
/// [`MasterConfig::coast`] is reported ([`MasterEvent::StillMoving`]), and stopped further; so is
/// one that is polled and moves again.
///
/// * A velocity node is told 0 rps.
/// * A position node is read, and told to hold the position of that answer (I6). It may move back
///   by the distance it has run since the measurement: the speed times the time from the answer to
///   the WRITE. The WRITE is sent next, so that time is about 0.2 ms on a dedicated line. A USB
///   adapter that delays answers adds its delay. It counts as still only within 1/32 of a turn of
///   that position. When the node is read again, or stopped again, it keeps the position unless it
///   is farther away: a loaded motor stands beside what it holds.
/// * A velocity node that is abnormal is told 0 rps blind, every 20 ms; a position node is read in
///   every other turn of the search, and stopped when it answers (I13).
/// * A node that becomes abnormal while under a set-point is owed a stop; so is every node under a
///   set-point after [`MasterConfig::dead_man`].
///
/// # Answers
///
/// A READ opens a window that ends [`MasterConfig::reply_timeout`] plus the answer's wire time
/// after the request has left the line (I7). Packets outside the window or from another node are
/// counted and dropped. A node that did not answer is not polled again for
/// [`MasterConfig::late_guard`], so that a late answer meets a closed window. An answer later than
/// that cannot be told from the next one: the protocol has no sequence numbers.
///
/// A port may hold a request back. If its flush ends within the window, the window begins there. If
/// it ends later, the answer is not taken, and the line is kept free for it; the node is not polled
/// again before its guard is over. If it has not ended a second after the port took the request,
/// the master continues, but takes no answer until a flush has ended.
///
/// # Modes
///
/// An answer in a mode other than the one on record, even a late one, puts the mode in doubt (I11).
/// The node is read again at once, and the next answer decides. A change of mode ends the
/// set-point, and the node is owed a stop if it has ever had a command, since a WRITE may have been
/// read in the new mode. While in doubt the node gets no WRITE, with one exception: a stop may
/// write a position that a velocity node would read as standstill. A switch moved while a command
/// is in flight cannot be detected: move it only while the machine is at rest.
///
/// # Health
///
/// A window without the answer is a strike, whatever else was heard in it. Three in a row make the
/// node abnormal, one answer brings it back online, and a WRITE changes nothing (I7). The set-point
/// of a node that becomes abnormal is dropped.
// Most used fields first: short instructions can reach them there.
#[derive(Clone, Debug)]
#[repr(C)]
pub struct Master<B: Board = OneMotor> {
    pub(super) config: MasterConfig,
    pub(super) queue: Queue,
    /// Time of the last call.
    pub(super) now: Instant,
    pub(super) events: Events<MasterEvent<B>, EVENTS>,
    pub(super) statistics: MasterStatistics,
    pub(super) line: Line<B>,
    /// Time of the application's last sign of life.
    alive_at: Instant,
    pub(super) nodes: [Node<B>; 8],
}

impl Master {
    /// Creates a master that knows no nodes yet; call [`discover`](Self::discover) to find them.
    /// For the usual board; see [`for_board`](Self::for_board) for the other one.
    #[must_use]
    #[inline] // Otherwise it would be compiled here, apart from the program that uses it.
    pub fn new(config: MasterConfig, now: Instant) -> Self {
        Self::for_board(config, now)
    }
}

/// Commands.
impl<B: Board> Master<B> {
    /// Creates a master of nodes with this [`Board`].
    ///
    /// ```
    /// use axlewire::{ikeya::{Master, board::ThreeMotors, master::MasterConfig}, time::Instant};
    ///
    /// let now = Instant::from_micros(0);
    /// let master = Master::<ThreeMotors>::for_board(MasterConfig::direct(), now);
    /// # let _ = master;
    /// ```
    #[must_use]
    pub fn for_board(config: MasterConfig, now: Instant) -> Self {
        let mut config = config;
        config.attempts = config.attempts.max(1);
        config.baud = speed(config.baud);
        Self {
            config,
            queue: Queue::default(),
            now,
            alive_at: now,
            statistics: MasterStatistics::default(),
            line: Line::new(&config, now),
            nodes: core::array::from_fn(|_| Node::new(now)),
            events: Events::new(),
        }
    }

    /// Polls every id of [`MasterConfig::nodes`] that is not online: one READ each, repeated for
    /// silent ids up to [`MasterConfig::attempts`]. Ends with [`MasterEvent::DiscoveryDone`].
    ///
    /// A call during a discovery joins it. After every second discovery each online node has a turn
    /// in the cycle before the next one begins, so call this as often as you like.
    pub fn discover(&mut self, now: Instant) {
        self.now = now;
        if self.queue.begin_discovery() {
            self.nodes.iter_mut().for_each(Node::begin_scan);
            self.settle_discovery();
        }
    }

    /// Turns a velocity node at `target` from the next cycle on. The latest set-point wins.
    ///
    /// # Errors
    ///
    /// [`CommandError`] if the node is not online, is not in velocity mode, has its mode in doubt,
    /// or is owed a stop. The command is then not kept.
    pub fn set_velocity(
        &mut self,
        node: NodeId,
        target: B::Velocity,
        now: Instant,
    ) -> Result<(), CommandError> {
        self.aim(node, Target::Velocity(target), now)
    }

    /// Moves a position node to `target` from the next cycle on. The latest set-point wins.
    ///
    /// # Errors
    ///
    /// [`CommandError`] if the node is not online, is not in position mode, has its mode in doubt,
    /// or is owed a stop. The command is then not kept.
    pub fn set_position(
        &mut self,
        node: NodeId,
        target: B::Position,
        now: Instant,
    ) -> Result<(), CommandError> {
        self.aim(node, Target::Position(target), now)
    }

    /// Stops a node: 0 rps, or *hold where you are*, never "go to 0" (I6). The stop is owed until
    /// the motor is seen to be still ([`MasterEvent::StandingStill`], I12); see
    /// [`stop_progress`](Self::stop_progress).
    ///
    /// A node that has never answered is read first. A repeated call joins the stop that is owed;
    /// if the application was told that the motor still moves, [`MasterConfig::coast`] begins
    /// anew. A call after the node is still begins a new stop: a position node is read, and holds
    /// the same position if it is there.
    pub fn stop(&mut self, node: NodeId, now: Instant) {
        self.sign_of_life(now);
        self.owe_stop(node);
    }

    /// Stops every node of [`MasterConfig::nodes`] and every node that has ever answered. Ids that
    /// have never answered are read first; they remain owed a stop, which goes to whatever answers.
    pub fn stop_all(&mut self, now: Instant) {
        self.sign_of_life(now);
        for id in NodeId::ALL {
            if self.config.nodes.contains(id) || self.node(id).health().is_some() {
                self.owe_stop(id);
            }
        }
    }

    /// Shows that the application is alive, for [`MasterConfig::dead_man`].
    pub fn keep_alive(&mut self, now: Instant) {
        self.sign_of_life(now);
    }

    /// Stops sending set-points to a node. The node keeps the last one it received. A stop goes on
    /// until the node is still.
    pub fn release(&mut self, node: NodeId) {
        let changes = self.node_mut(node).release();
        self.tell_changes(node, changes);
    }

    /// Requests a confirmation: [`MasterEvent::Confirmed`] comes once the node has answered a READ
    /// that followed the next WRITE of its set-point (I8), or [`MasterEvent::NotConfirmed`] if that
    /// READ fails or the set-point is dropped first. It is about that WRITE: a set-point that
    /// replaces it before the answer comes needs a confirmation of its own.
    ///
    /// # Errors
    ///
    /// [`CommandError::NotOnline`], and [`CommandError::NoSetPoint`] if there is none to confirm:
    /// none is repeated for a node that is still after a stop with
    /// [`Polling::Manual`](super::Polling::Manual).
    pub fn confirm(&mut self, node: NodeId, now: Instant) -> Result<(), CommandError> {
        self.now = now;
        let polling = self.config.polling;
        self.node_mut(node).confirm(node, polling)
    }

    /// Reads a node once, in addition to polling. Use it with
    /// [`Polling::Manual`](super::Polling::Manual).
    ///
    /// Ends with [`MasterEvent::Status`] or [`MasterEvent::ReadFailed`].
    ///
    /// # Errors
    ///
    /// [`CommandError::NotOnline`].
    pub fn read(&mut self, node: NodeId, now: Instant) -> Result<(), CommandError> {
        self.now = now;
        self.node_mut(node).read(node)
    }

    fn aim(&mut self, id: NodeId, target: Target<B>, now: Instant) -> Result<(), CommandError> {
        self.now = now;
        self.expire_commands(now);
        self.node_mut(id).aim(id, target)?;
        self.alive_at = now;
        Ok(())
    }

    /// Makes the node owed a stop, unless it already is.
    fn owe_stop(&mut self, id: NodeId) {
        let (now, hold_age) = (self.now, self.config.hold_age);
        let changes = self.node_mut(id).owe_stop(hold_age, now);
        self.tell_changes(id, changes);
    }
}

/// The dead-man: stops the nodes when the application is silent (I13).
impl<B: Board> Master<B> {
    /// Records a sign of life, which does not revive an expired command.
    fn sign_of_life(&mut self, now: Instant) {
        self.now = now;
        self.expire_commands(now);
        self.alive_at = now;
    }

    /// Time at which the dead-man stops the nodes.
    fn dead_man_at(&self) -> Option<Instant> {
        let is_armed = self.nodes.iter().any(|node| node.order().is_set_point());
        self.config.dead_man.filter(|_| is_armed).map(|limit| self.alive_at + limit)
    }

    fn expire_commands(&mut self, now: Instant) {
        if reached(self.dead_man_at(), now) {
            count_apart(&mut self.statistics.dead_man);
            self.tell(MasterEvent::DeadMan);
            for id in NodeId::ALL {
                if self.node(id).order().is_set_point() {
                    self.owe_stop(id);
                }
            }
        }
    }
}

impl<B: Board> Master<B> {
    pub(super) fn node(&self, node: NodeId) -> &Node<B> {
        &self.nodes[index_of(node)]
    }

    pub(super) fn node_mut(&mut self, node: NodeId) -> &mut Node<B> {
        &mut self.nodes[index_of(node)]
    }

    /// Removes the events that `stays` rejects.
    pub(crate) fn retain_events(&mut self, stays: impl FnMut(&MasterEvent<B>) -> bool) {
        self.events.retain(stays);
    }

    pub(super) fn tell(&mut self, event: MasterEvent<B>) {
        self.events.push(event);
    }
}

/// Requests.
impl<B: Board> Master<B> {
    pub(super) const fn view(&self) -> View<'_, B> {
        View { nodes: &self.nodes, config: &self.config, now: self.now }
    }

    /// Hands out the next request, if the line is free for it.
    fn send_next(&mut self, now: Instant) -> Option<&[u8]> {
        if !self.line.is_ready(now) {
            return None;
        }
        for node in &mut self.nodes {
            node.forget_old_hold(now, self.line.write_time(&self.config));
        }
        let turn = self.queue.choose(self.view())?;
        let node = &mut self.nodes[index_of(turn.node)];
        let request = node.request(turn.reason, self.config.polling);
        if !self.line.takes(turn, &request, now) {
            return None;
        }
        self.line.send(turn, request, &self.config, &mut self.statistics, now)?;
        let exchange = self.line.window_time(&self.config) + self.config.turnaround_gap;
        self.queue.book::<B>(turn, request.is_exchange(), exchange, &self.config, now);
        if matches!(request, Request::Write(_)) {
            node.wrote(now);
        }
        if request.is_exchange() {
            node.asked(self.queue.is_discovering(), &self.config, now);
        }
        self.line.packet()
    }

    /// Takes in received bytes.
    fn receive(&mut self, bytes: &[u8], now: Instant) {
        self.now = now;
        let mut bytes = bytes;
        self.line.note(bytes);
        while let Some((node, status)) = self.line.next_response(&mut bytes) {
            self.hear(node, status, now);
        }
    }

    /// All packets have left.
    fn flushed(&mut self, now: Instant) {
        let Some(overdue) = self.line.flushed(now, &self.config) else { return };
        self.miss(overdue.closed);
        let guard = overdue.answer_by + self.config.late_guard;
        for id in NodeId::ALL {
            if overdue.concerns(id) {
                self.node_mut(id).guard_until(guard);
            }
        }
    }

    /// Whether the packet handed out last is a WRITE that the node would not get now: its set-point
    /// was dropped or replaced, its mode is in doubt or another one (I11), or what it holds was
    /// measured too long ago (I6).
    fn has_sent_old_write(&self) -> bool {
        self.line.sent().is_some_and(|sent| match sent.request {
            Request::Write(target) => {
                let node = self.node(sent.turn.node);
                !node.takes(target)
                    || node.has_old_hold(self.now, self.line.write_time(&self.config))
            }
            Request::Read => false,
        })
    }

    /// The packet handed out last has not left: its request, or the one that has replaced it, is to
    /// be sent again.
    fn take_back(&mut self, unsent: Unsent, now: Instant) {
        if unsent == Unsent::Unflushed {
            // It is unknown which of the latest WRITEs have left: send all of them again, and do
            // not count an answer that comes now for any of them.
            self.nodes.iter_mut().for_each(Node::take_back_write);
            self.queue.take_back_writes();
            // A part of a packet may still leave, although its flush has failed.
            let end = now + wire_time(PACKET_LEN, self.config.baud);
            self.line.cut_off(&self.config, end);
            return;
        }
        let taken_back = self.line.take_back(unsent, &self.config, &mut self.statistics, now);
        let Some(sent) = taken_back else { return };
        self.queue.take_back(sent.turn);
        let node = &mut self.nodes[index_of(sent.turn.node)];
        if matches!(sent.request, Request::Write(_)) {
            node.take_back_write();
        }
        if sent.is_open {
            node.take_back_request(self.queue.is_discovering());
        }
    }
}

impl<B: Board> Endpoint for Master<B> {
    type Event = MasterEvent<B>;

    /// Bytes that may be from before the request are no answer to it: its window opens behind them.
    fn handle_input(&mut self, bytes: &[u8], arrived: impl Into<Arrival>) {
        match arrived.into() {
            Arrival::Now(now) => self.receive(bytes, now),
            Arrival::Between { since, now } => {
                let aside = self.line.set_window_aside(since);
                self.receive(bytes, now);
                self.line.put_window_back(aside, !bytes.is_empty());
            }
        }
    }

    fn handle_timeout(&mut self, now: Instant) {
        self.now = now;
        let expired = self.line.expire_window(now);
        self.miss(expired);
        self.expire_commands(now);
    }

    fn poll_transmit(&mut self, now: Instant) -> Option<&[u8]> {
        self.now = now;
        // A set-point must not outlive its application because the driver is late.
        self.expire_commands(now);
        if self.line.is_waiting() {
            return None;
        }
        self.send_next(now)
    }

    fn handle_transmit(&mut self, outcome: impl Into<Transmit>, now: Instant) {
        self.now = now;
        match outcome.into() {
            Transmit::Taken => self.line.hold(&self.config, now),
            Transmit::Flushed => self.flushed(now),
            Transmit::Unsent(unsent) => self.take_back(unsent, now),
        }
    }

    /// Whether it is a WRITE that has been dropped or replaced, whose mode is in doubt, or which
    /// holds a position that was measured too long ago; or anything, once the dead-man has fired: a
    /// set-point must not outlive its application.
    fn is_outdated(&self) -> bool {
        self.has_sent_old_write() || reached(self.dead_man_at(), self.now)
    }

    fn line_rules(&self) -> LineRules {
        LineRules {
            frame_pause: frame_pause(&self.config),
            baud: self.config.baud,
            held_up_after: None,
        }
    }

    fn poll_event(&mut self) -> Option<MasterEvent<B>> {
        self.events.pop()
    }

    fn poll_timeout(&self) -> Option<Instant> {
        let work = self.line.next_at(|| self.queue.due(self.view()));
        let dead_man = self.dead_man_at();
        // By hand: `earliest` would take 140 more bytes of flash here.
        work.map_or(dead_man, |at| Some(dead_man.unwrap_or(at).min(at)))
    }
}
