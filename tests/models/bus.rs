//! A master, its application, a line and one or two nodes.
//!
//! The nodes are simulated here: a switch, a shaft that is somewhere else at each measurement, and
//! an answer that may be late. An answer later than its deadline plus `late_guard` is lost: the
//! protocol has no sequence numbers by which a master could distinguish it from the next one.

use axlewire::ikeya::master::StopProgress;

use super::{
    account::{Account, Confirm},
    action::{Action, Answer, Call, Exchange, Fate, Menu},
    fingerprint::{COUNTERS, COUNTERS_AND_STATUS},
    kit::{Reply, Sent},
    names::*,
};

/// Shorter than the time that a fingerprint remembers.
pub(super) const COAST: Duration = Duration::from_millis(60);

#[derive(Clone, Debug)]
pub(super) struct Motor {
    pub(super) mode: Mode,
    /// The last WRITE that it received was a stop in its mode.
    pub(super) is_told_to_stop: bool,
    /// Where its shaft is. While it is told to move, no two measurements are alike.
    pub(super) count: i16,
}

/// A READ, or an answered WRITE, whose window is open.
#[derive(Clone, Copy, Debug)]
pub(super) struct Asked {
    pub(super) node: NodeId,
    pub(super) end: Instant,
    pub(super) deadline: Instant,
    /// The node has received it and has not answered yet.
    pub(super) is_heard: bool,
    /// The position that a position node measures for it.
    pub(super) rotation: i16,
}

#[derive(Clone, Copy, Debug)]
pub(super) struct Late {
    pub(super) reply: Reply,
    until: Instant,
}

#[derive(Clone)]
pub(crate) struct Bus<B: Kit> {
    pub(crate) master: Master<B>,
    pub(crate) now: Instant,
    pub(super) motors: Vec<Motor>,
    pub(super) accounts: Vec<Account>,
    pub(super) asked: Option<Asked>,
    pub(super) late: Option<Late>,
    pub(super) line_free: Instant,
    /// The last sign of life of the application.
    alive_at: Instant,
    /// The application takes its events.
    pub(crate) takes_events: bool,
    /// Position nodes are at 13,000 turns or more: read as a speed, that is not a standstill.
    pub(crate) is_far: bool,
    pub(crate) menu: Menu,
}

impl<B: Kit> Bus<B> {
    /// Nodes 1 and up, in these modes, and a master that knows none of them.
    pub(crate) fn new(modes: &[Mode], config: MasterConfig, menu: Menu) -> Self {
        Self::at(Instant::from_micros(1_000_000), modes, config, menu)
    }

    /// The same, at this time.
    pub(crate) fn at(now: Instant, modes: &[Mode], mut config: MasterConfig, menu: Menu) -> Self {
        config.nodes = NodeId::ALL[..modes.len()].iter().copied().collect();
        config.coast = COAST;
        let motor = |&mode| Motor { mode, is_told_to_stop: true, count: 100 };
        Self {
            master: Master::for_board(config, now),
            now,
            motors: modes.iter().map(motor).collect(),
            accounts: vec![Account::default(); modes.len()],
            asked: None,
            late: None,
            line_free: now,
            alive_at: now,
            takes_events: true,
            is_far: false,
            menu,
        }
    }

    /// Runs these actions to reach a prepared state.
    pub(crate) fn after(mut self, actions: &[Action]) -> Self {
        for &action in actions {
            self.step(action).unwrap_or_else(|broken| panic!("{action:?}: {broken}"));
        }
        self
    }

    pub(super) fn account(&mut self, node: NodeId) -> &mut Account {
        &mut self.accounts[usize::from(node.get()) - 1]
    }

    /// Whether the master has something to send.
    pub(super) fn sends(&self) -> bool {
        let mut probe = self.master.clone();
        probe.handle_timeout(self.now);
        probe.poll_transmit(self.now).is_some()
    }

    fn answer_time(&self) -> Duration {
        wire_time(self.answer_len(), self.master.config().baud)
    }

    fn answer_len(&self) -> usize {
        if B::ANSWERS_WRITE { 16 } else { 8 }
    }

    fn call(&mut self, call: Call) -> Checked {
        let now = self.now;
        match call {
            Call::Set(node) => self.set(node)?,
            Call::Stop(node) => {
                self.expire_orders();
                let is_told = self.is_told_moving(node);
                self.master.stop(node, now);
                self.alive_at = now;
                self.account(node).stop(is_told, now);
            }
            Call::StopAll => {
                self.expire_orders();
                let are_told = NodeId::ALL.map(|node| self.is_told_moving(node));
                self.master.stop_all(now);
                self.alive_at = now;
                let accounts = self.accounts.iter_mut().zip(are_told);
                accounts.for_each(|(account, is_told)| account.stop(is_told, now));
            }
            Call::Release(node) => {
                self.master.release(node);
                let account = self.account(node);
                account.drop_target();
                account.may_hold_anew |= !account.is_owed;
                account.is_released = account.is_halted && !account.is_owed;
                account.is_let_go = account.is_halted;
            }
            Call::Confirm(node) => {
                if self.master.confirm(node, now).is_ok() {
                    self.account(node).confirm = Confirm::AfterWrite;
                }
            }
            Call::Read(node) => drop(self.master.read(node, now)),
            Call::Discover => self.master.discover(now),
            Call::KeepAlive => {
                self.expire_orders();
                self.master.keep_alive(now);
                self.alive_at = now;
            }
        }
        Ok(())
    }

    fn is_told_moving(&self, node: NodeId) -> bool {
        self.master.stop_progress(node) == StopProgress::StillMoving
    }

    /// A new set-point in the mode assumed by the application. A refused one has the number of the
    /// next one, which is never sent.
    fn set(&mut self, node: NodeId) -> Checked {
        self.expire_orders();
        let mode = self.master.mode(node).unwrap_or(Mode::Velocity);
        let mut after = *self.account(node);
        after.aim();
        let number = after.last_target;
        let set = match mode {
            Mode::Velocity => self.master.set_velocity(node, B::speed(f32::from(number)), self.now),
            Mode::Position => {
                let place = Position::new(7, 100 + i16::from(number));
                self.master.set_position(node, B::place(place), self.now)
            }
        };
        if set.is_ok() {
            let account = self.account(node);
            if !account.is_online() || account.is_owed || account.is_in_doubt {
                return Err("a set-point was accepted but had to be refused".into());
            }
            *account = after;
            self.alive_at = self.now;
        }
        Ok(())
    }

    /// Hands out the next packet; returns whether an answer is expected.
    pub(super) fn send(&mut self, fate: Fate) -> Result<Option<bool>, String> {
        self.pass_time()?;
        let Some(bytes) = self.master.poll_transmit(self.now).map(<[u8]>::to_vec) else {
            self.check_rest()?;
            return Ok(None);
        };
        let sent = Sent::read::<B>(&bytes);
        let is_exchange = sent.is_exchange::<B>();
        broken_if!(is_exchange && self.asked.is_some(), "a second request in an open window");
        self.check_order(&sent)?;
        let start = self.line_free.max(self.now);
        let end = start + wire_time(sent.len, self.master.config().baud);
        self.line_free = end;
        let rotation = self.account(sent.node).rotation();
        let fate = if fate == Fate::Parts { self.part(&sent)? } else { fate };
        if let Some(write) = sent.write.filter(|_| fate != Fate::GivenUp) {
            let (now, gap) = (self.now, self.master.config().turnaround_gap);
            self.account(sent.node).write(write, B::ANSWERS_WRITE, now, gap)?;
        }
        let arrives = matches!(fate, Fate::Arrives | Fate::UnflushedArrives);
        if is_exchange {
            let deadline = end + self.master.config().reply_timeout + self.answer_time();
            let node = sent.node;
            self.asked = Some(Asked { node, end, deadline, is_heard: arrives, rotation });
        }
        if let Some(write) = sent.write.filter(|_| arrives) {
            let is_halted = self.account(sent.node).is_halted;
            let motor = &mut self.motors[usize::from(sent.node.get()) - 1];
            let is_stop = match motor.mode {
                Mode::Velocity => f32::from_bits(write.speed).abs() < 0.05,
                Mode::Position => write.place.1 % 1000 == rotation,
            };
            motor.is_told_to_stop = is_halted && is_stop;
            if is_halted && is_stop && motor.mode == Mode::Position {
                motor.count = write.place.0;
            }
        }
        self.port_fails(fate, &sent, start);
        Ok(Some(is_exchange))
    }

    /// The port takes the packet in parts, and a late answer arrives in between. The rest is given
    /// up if the master says so.
    fn part(&mut self, sent: &Sent) -> Result<Fate, String> {
        if let Some(late) = self.late.take() {
            self.hear(late.reply, self.now)?;
        }
        let is_given_up = sent.write.is_some() && self.master.is_outdated();
        Ok(if is_given_up { Fate::GivenUp } else { Fate::Arrives })
    }

    /// The driver's report of a port that could not send.
    fn port_fails(&mut self, fate: Fate, sent: &Sent, start: Instant) {
        let unsent = match fate {
            Fate::Arrives | Fate::Parts | Fate::Lost => return,
            Fate::Untouched => Unsent::Untouched,
            Fate::CutOff | Fate::GivenUp => Unsent::CutOff,
            Fate::UnflushedArrives | Fate::UnflushedLost => Unsent::Unflushed,
        };
        self.master.handle_transmit(unsent, self.now);
        if sent.is_exchange::<B>() {
            // It is repeated, and was no turn.
            self.accounts.iter_mut().for_each(|it| it.waits = it.waits.saturating_sub(1));
        }
        if unsent == Unsent::Unflushed {
            self.accounts.iter_mut().for_each(Account::take_back_write);
        } else {
            self.line_free = if unsent == Unsent::Untouched { start } else { self.now };
            self.asked = self.asked.filter(|_| !sent.is_exchange::<B>());
            if sent.write.is_some() {
                self.account(sent.node).take_back_write();
            }
        }
    }

    /// The node that was asked answers.
    pub(super) fn answer(&mut self, answer: Answer) -> Checked {
        let Some(asked) = self.asked.filter(|asked| asked.is_heard) else { return Ok(()) };
        self.asked = Some(Asked { is_heard: answer == Answer::Leftover, ..asked });
        let reply = self.reply(asked.node, asked.rotation);
        let at = self.now.max(asked.end + self.answer_time() + Duration::from_micros(50));
        match answer {
            Answer::Right => self.hear(reply, at)?,
            // Any later, it could not be distinguished from the right one.
            Answer::Leftover if self.now >= asked.end => {}
            Answer::Leftover => {
                let place = (reply.place.0, 10);
                self.hear(Reply { place, ..reply }, self.now + Duration::from_micros(1))?;
            }
            Answer::Late => {
                let until = asked.deadline + self.master.config().late_guard;
                self.late = Some(Late { reply, until });
            }
            Answer::Damaged => {
                let mut bytes = reply.bytes::<B>();
                bytes[3] ^= 1;
                self.now = at;
                self.master.handle_input(&bytes, at);
            }
            Answer::OfAnother => {
                let other = if asked.node == NodeId::N1 { NodeId::N2 } else { NodeId::N1 };
                if self.motors.len() > 1 {
                    let reply = self.reply(other, 10);
                    self.hear(reply, at)?;
                } else {
                    let reply = Reply { node: NodeId::N8, ..reply };
                    self.now = at;
                    self.master.handle_input(&reply.bytes::<B>(), at);
                }
            }
        }
        Ok(())
    }

    /// The current measurement of a node.
    fn reply(&mut self, node: NodeId, rotation: i16) -> Reply {
        let motor = &mut self.motors[usize::from(node.get()) - 1];
        let is_moving = !motor.is_told_to_stop;
        if is_moving && motor.mode == Mode::Position {
            motor.count += 20;
        }
        let far = if self.is_far { 13_000 } else { 0 };
        Reply { node, mode: motor.mode, place: (motor.count, rotation + far), is_moving }
    }

    /// The master receives a complete answer.
    pub(super) fn hear(&mut self, reply: Reply, at: Instant) -> Checked {
        self.now = at;
        let earliest = Duration::from_micros(self.answer_time().as_micros() / 2);
        let is_in_window = self.asked.is_some_and(|asked| {
            asked.node == reply.node && at <= asked.deadline && at >= asked.end + earliest
        });
        let heard_before = self.master.status(reply.node).map(|(_, at)| at);
        self.master.handle_input(&reply.bytes::<B>(), at);
        let heard_after = self.master.status(reply.node).map(|(_, at)| at);
        if heard_after != heard_before && !is_in_window {
            return Err("an answer outside its window was accepted".into());
        }
        if is_in_window {
            self.asked = None;
            self.line_free = at + self.master.config().turnaround_gap;
            let account = self.account(reply.node);
            // A motor that comes back to what it holds moves too.
            let comes_back = account.last_count().is_some_and(|it| it.abs_diff(reply.place.0) > 16);
            let is_moving = reply.is_moving || reply.mode == Mode::Position && comes_back;
            account.hear_answer(reply.mode, reply.place, at);
            let is_late = account.coasts_from.is_some_and(|since| at >= since + COAST);
            if is_late && (is_moving || account.is_away) && !account.is_in_doubt {
                match account.coasting_since {
                    Some(_) => account.late_moves = (account.late_moves + 1).min(2),
                    None => account.has_moved_late = true,
                }
            }
        } else {
            self.account(reply.node).hear_outside(reply.mode);
        }
        self.take_events()
    }

    /// The dead-man: a late sign of life does not revive an order.
    fn expire_orders(&mut self) {
        let limit = self.master.config().dead_man;
        if limit.is_some_and(|limit| self.now >= self.alive_at + limit) {
            self.accounts.iter_mut().filter(|it| it.is_under_order).for_each(Account::owe);
        }
    }

    /// A driver's first steps: time, then events.
    pub(super) fn pass_time(&mut self) -> Checked {
        let config = *self.master.config();
        self.master.handle_timeout(self.now);
        if let Some(asked) = self.asked.filter(|asked| self.now >= asked.deadline) {
            self.asked = None;
            let guard = asked.deadline + config.late_guard;
            self.account(asked.node).miss(guard, config.stops_abnormal);
        }
        self.expire_orders();
        self.late = self.late.filter(|late| self.now <= late.until);
        self.take_events()
    }
}

impl<B: Kit> World for Bus<B> {
    type Action = Action;

    fn actions(&self) -> Vec<Action> {
        let is_heard = self.asked.is_some_and(|asked| asked.is_heard);
        self.menu.actions(self.motors.len(), self.sends(), is_heard, self.late.is_some())
    }

    fn step(&mut self, action: Action) -> Checked {
        match action {
            Action::Call(call) => self.call(call)?,
            Action::Send(fate) => drop(self.send(fate)?),
            Action::Answer(answer) => self.answer(answer)?,
            Action::LateAnswer => {
                if let Some(late) = self.late.take().filter(|late| self.now <= late.until) {
                    self.hear(late.reply, self.now)?;
                }
            }
            Action::Switch(node) => {
                let motor = &mut self.motors[usize::from(node.get()) - 1];
                motor.mode = match motor.mode {
                    Mode::Velocity => Mode::Position,
                    Mode::Position => Mode::Velocity,
                };
                motor.is_told_to_stop = true;
            }
            Action::Turn(node) => self.motors[usize::from(node.get()) - 1].count += 400,
            Action::Reset(node) => {
                self.motors[usize::from(node.get()) - 1].is_told_to_stop = true;
            }
            Action::Wait(wait) => self.wait(wait)?,
            Action::Command(node) => {
                self.set(node)?;
                self.exchange(Exchange::Right)?;
            }
            Action::Exchange(exchange) => self.exchange(exchange)?,
        }
        self.take_events()
    }

    fn fingerprint(&self) -> u64 {
        let is_status_needed = self.master.config().hold_age > Duration::ZERO;
        let skipped = if is_status_needed { COUNTERS } else { COUNTERS_AND_STATUS };
        let alive_at = self.master.config().dead_man.map(|_| self.alive_at);
        let late = self.late.map(|Late { reply, until }| {
            let place = Position::new(reply.place.0, reply.place.1);
            (reply.node, reply.mode, reply.is_moving, place, until)
        });
        let world = (&self.motors, &self.accounts, self.asked, late, alive_at);
        Merge { now: self.now, skipped }.fingerprint(&(&self.master, world))
    }
}
