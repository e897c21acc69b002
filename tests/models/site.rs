//! The frame of the worlds of a host and of a robot: the role, its application, its port, and a
//! peer that sends anything at any time.

use std::fmt::Debug;

use super::{names::*, ucp::Fate};

/// Capacity of the event queue.
pub(crate) const ROOM: usize = 16;

/// Number of bytes before the pause inside a frame that comes in halves.
pub(crate) const HALF: usize = 11;

#[derive(Clone, Copy, Debug)]
pub(crate) enum Act<C, H> {
    /// The application does something.
    Call(C),
    Hear(H),
    TakeEvent,
    /// The driver does everything that is due.
    Round(Fate),
    /// One frame is handed out, without a prior `handle_timeout`.
    One,
    /// The last frame handed out comes back, or the flush after it fails.
    Fail(Unsent),
    Wait(u32),
    /// Until the deadline, plus this many microseconds.
    ToDeadline(u32),
    /// The driver runs for this long, milliseconds.
    Run(u32),
}

impl<C: Copy + 'static, H: Copy + 'static> Act<C, H> {
    pub(crate) const DONE: Self = Self::Round(Fate::Flushed);
    pub(crate) const CUT: Self = Self::Round(Fate::First(Unsent::CutOff));

    pub(crate) const fn calls<const N: usize>(calls: [C; N]) -> [Self; N] {
        let (mut acts, mut at) = ([Self::TakeEvent; N], 0);
        while at < N {
            acts[at] = Self::Call(calls[at]);
            at += 1;
        }
        acts
    }

    pub(crate) const fn hears<const N: usize>(heard: [H; N]) -> [Self; N] {
        let (mut acts, mut at) = ([Self::TakeEvent; N], 0);
        while at < N {
            acts[at] = Self::Hear(heard[at]);
            at += 1;
        }
        acts
    }

    /// Every fate of the frames.
    pub(crate) const FATES: &'static [Self] = &[
        Self::DONE,
        Self::Round(Fate::NotFlushed),
        Self::Round(Fate::First(Unsent::Untouched)),
        Self::CUT,
        Self::One,
        Self::Fail(Unsent::Untouched),
        Self::Fail(Unsent::Unflushed),
    ];
}

/// What a decoder makes of received bytes.
pub(crate) enum Part<H> {
    Nothing,
    Whole,
    Front,
    /// The rest of this frame, behind its front.
    Rest(H),
}

/// A host or a robot.
pub(crate) trait Side: Clone + Default {
    type Role: Endpoint<Event: Clone + PartialEq + Debug> + Clone + Debug;
    type Account: Clone + Debug;
    type Call: Copy + Debug + 'static;
    type Hear: Copy + Debug + PartialEq + 'static;

    fn counters(role: &Self::Role) -> Counters;
    fn bytes(hear: Self::Hear) -> Vec<u8>;
    fn part(hear: Self::Hear) -> Part<Self::Hear>;
    /// Events that recur by themselves, and those of which only the latest counts.
    fn is_frequent(event: &EventOf<Self>) -> bool;
}

pub(crate) type EventOf<S> = <<S as Side>::Role as Endpoint>::Event;
type ActOf<S> = Act<<S as Side>::Call, <S as Side>::Hear>;

/// What a host and a robot do differently.
pub(crate) trait Acts<S: Side> {
    fn call(&mut self, call: S::Call) -> Checked;
    /// Hands out a frame; returns whether there was one.
    fn hand_out(&mut self) -> Result<bool, String>;
    /// The last frame comes back, or a flush has failed.
    fn unsent(&mut self, unsent: Unsent);
    fn flushed(&mut self) {}
    /// The latest time for the next action.
    fn owed(&self) -> Option<Instant>;
    /// Time has passed, before and after the frames that had arrived count.
    fn expire(&mut self) {}
    fn settled(&mut self) -> Checked;
}

/// Their invariants.
pub(crate) trait Checks<S: Side> {
    /// The role has taken in a whole frame.
    fn heard(&mut self, hear: S::Hear, at: Instant, before: &[EventOf<S>]) -> Checked;
    /// An event is taken.
    fn told(&mut self, event: &EventOf<S>) -> Checked;
    /// All events are taken.
    fn all_told(&self) -> Checked;
    /// Everything due has been sent and flushed.
    fn check_rest(&mut self) -> Checked {
        Ok(())
    }
    /// At any time.
    fn check(&self, events: &[EventOf<S>]) -> Checked;
}

pub(crate) type Menu<S> = &'static [&'static [ActOf<S>]];

#[derive(Clone, Debug)]
pub(crate) struct Site<S: Side> {
    pub(super) role: S::Role,
    pub(super) now: Instant,
    pub(super) menu: Menu<S>,
    pub(super) account: S::Account,
    feed: Feed<S::Hear>,
    /// The driver takes the events.
    takes_events: bool,
    /// A failing flush may still lose frames.
    is_unflushed: bool,
    /// Events taken in this step.
    pub(super) popped: Vec<EventOf<S>>,
    /// What else is known of this step.
    pub(super) step: S,
}

impl<S: Side> Site<S>
where
    Self: Acts<S> + Checks<S>,
{
    pub(crate) fn of(role: S::Role, account: S::Account, now: Instant, menu: Menu<S>) -> Self {
        Self {
            role,
            now,
            menu,
            account,
            feed: Feed::new(),
            takes_events: true,
            is_unflushed: false,
            popped: Vec::new(),
            step: S::default(),
        }
    }

    pub(crate) fn undrained(mut self) -> Self {
        self.takes_events = false;
        self
    }

    /// The state after these actions, none of which breaks an invariant.
    pub(crate) fn after(mut self, actions: &[ActOf<S>]) -> Self {
        for &action in actions {
            self.step(action).unwrap_or_else(|broken| panic!("{action:?}: {broken}"));
        }
        self
    }

    /// Takes an event; checks that what it reports has happened.
    fn take_event(&mut self) -> Result<bool, String> {
        let Some(event) = self.role.poll_event() else { return Ok(false) };
        self.told(&event)?;
        self.popped.push(event);
        Ok(true)
    }

    pub(super) fn take_events(&mut self) -> Checked {
        while self.take_event()? {}
        self.all_told()
    }

    /// The other side sends something, which has been here since then.
    pub(super) fn hear(&mut self, hear: S::Hear, since: Instant) -> Checked {
        let before = queue(&self.role);
        let (bytes, part) = (S::bytes(hear), S::part(hear));
        let was_half = std::mem::replace(&mut self.feed.is_half, matches!(part, Part::Front));
        match part {
            Part::Rest(whole) if was_half => self.feed.push(whole, HALF + bytes.len(), true),
            Part::Whole => self.feed.push(hear, bytes.len(), false),
            _ => {}
        }
        self.role.handle_input(&bytes, Arrival::Between { since, now: self.now });
        let counters = S::counters(&self.role);
        for (arrived, at) in self.feed.arrived(&counters, since)? {
            self.heard(arrived, at, &before)?;
        }
        self.feed.took(bytes.len(), &counters, since);
        Ok(())
    }

    /// The driver looks at the clock.
    pub(super) fn settle(&mut self) -> Checked {
        let before = if self.feed.is_holding() { queue(&self.role) } else { Vec::new() };
        self.role.handle_timeout(self.now);
        self.expire();
        let counters = S::counters(&self.role);
        for (hear, at) in self.feed.arrived(&counters, self.now)? {
            self.heard(hear, at, &before)?;
        }
        self.settled()
    }

    fn fail(&mut self, unsent: Unsent) {
        self.role.handle_transmit(unsent, self.now);
        self.unsent(unsent);
        self.is_unflushed &= unsent != Unsent::Unflushed;
    }

    fn one(&mut self) -> Result<bool, String> {
        let is_sent = self.hand_out()?;
        self.is_unflushed |= is_sent;
        Ok(is_sent)
    }

    /// Nothing can come back now.
    fn flush(&mut self) {
        self.is_unflushed = false;
        self.flushed();
    }

    fn round(&mut self, fate: Fate) -> Checked {
        self.settle()?;
        if self.takes_events {
            self.take_events()?;
        }
        let mut frames = 0;
        while self.one()? {
            frames += 1;
            if let Fate::First(unsent) = fate {
                self.fail(unsent);
                return Ok(());
            }
            broken_if!(frames > 16, "it never stops sending");
        }
        if fate == Fate::NotFlushed && self.is_unflushed {
            self.fail(Unsent::Unflushed);
            return Ok(());
        }
        self.flush();
        self.check_rest()?;
        if self.owed().is_some_and(|at| at <= self.now) {
            return Err(format!("owed and not sent: {:?}", self.account));
        }
        check_sleep(&self.role, self.now)
    }

    /// The driver runs, and wakes at the role's deadlines.
    fn run(&mut self, millis: u32) -> Checked {
        let end = self.now + ms(millis);
        while let Some(at) = self.role.poll_timeout().filter(|&at| at <= end) {
            self.now = self.now.max(at);
            self.round(Fate::Flushed)?;
        }
        self.now = end;
        Ok(())
    }

    fn act(&mut self, act: ActOf<S>) -> Checked {
        match act {
            Act::Call(call) => return self.call(call),
            Act::Hear(hear) => return self.hear(hear, self.now),
            Act::TakeEvent => drop(self.take_event()?),
            Act::Round(fate) => return self.round(fate),
            Act::One => {
                if !self.one()? {
                    self.flush();
                }
            }
            Act::Fail(unsent) => self.fail(unsent),
            Act::Wait(micros) => self.now += Duration::from_micros(micros),
            Act::ToDeadline(past) => {
                let at = self.role.poll_timeout().unwrap_or(self.now);
                self.now = self.now.max(at) + Duration::from_micros(past);
            }
            Act::Run(millis) => return self.run(millis),
        }
        Ok(())
    }
}

impl<S: Side> World for Site<S>
where
    Self: Acts<S> + Checks<S>,
{
    type Action = ActOf<S>;

    fn actions(&self) -> Vec<ActOf<S>> {
        let is_possible = |act: &&ActOf<S>| !matches!(act, Act::Fail(_)) || self.is_unflushed;
        self.menu.iter().copied().flatten().filter(is_possible).copied().collect()
    }

    fn step(&mut self, act: ActOf<S>) -> Checked {
        let before = queue(&self.role);
        (self.popped, self.step) = (Vec::new(), S::default());
        self.act(act)?;
        let after = queue(&self.role);
        check_kept(&before, &self.popped, &after, |event| !S::is_frequent(event))?;
        let (owed, wake_up) = (self.owed(), self.role.poll_timeout());
        if owed.is_some_and(|owed| wake_up.is_none_or(|at| at > owed.max(self.now))) {
            let account = &self.account;
            return Err(format!("wakes up at {wake_up:?}, owed: {owed:?}: {account:?}"));
        }
        self.check(&after)
    }

    fn fingerprint(&self) -> u64 {
        let all = (&self.role, &self.account, &self.feed, self.is_unflushed);
        merge(self.now, &S::counters(&self.role)).fingerprint(&all)
    }
}
