//! The account of a host: what was called and received, what may be sent, and what is owed.

use axlewire::ucp::host::Link;

use super::{
    host_motion::Motion,
    host_request::{Ack, Request, Results},
    host_store::Shelf,
    names::*,
};

#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Update {
    None,
    /// The request goes after one more stop.
    Asked {
        version: i16,
        needs_stop: bool,
    },
    /// Nothing is sent.
    Silent,
}

/// The content of the last frame.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Last {
    Motor,
    ImuAck,
    MagAck,
    Biases,
    Calibration,
    Network,
    Update,
    Ping,
}

#[derive(Clone, Debug)]
pub(crate) struct Account {
    pub(crate) motion: Motion,
    pub(crate) low_ids_only: bool,
    pings: bool,
    ping_at: Instant,
    ping_until: Option<Instant>,
    pub(crate) link: Link,
    link_until: Option<Instant>,
    pub(crate) update: Update,
    /// Updates that were given up, and whose events have not been taken.
    pub(crate) untold_updates: u32,
    pub(crate) request: Option<Request>,
    /// Attempts of the latest request that could not be sent again in time.
    pub(crate) given_up: Option<u8>,
    /// The outcome of the latest request.
    pub(crate) settled: Option<bool>,
    /// Ends of requests whose events have not been taken.
    pub(crate) untold: Vec<(CalibrationStep, CalibrationKind, bool)>,
    pub(crate) imu: Results,
    pub(crate) mag: Results,
    pub(crate) biases: Ack,
    pub(crate) network: Option<u32>,
    pub(crate) is_network_due: bool,
    last: Option<Last>,
    index: u8,
}

impl Account {
    pub(crate) fn new(config: &HostConfig, now: Instant) -> Self {
        Self {
            motion: Motion::new(config.sends_first_stop, now),
            low_ids_only: config.low_ids_only,
            pings: config.ping_period.is_some(),
            ping_at: now,
            ping_until: None,
            link: Link::Waiting,
            link_until: Some(now + ms(500)),
            update: Update::None,
            untold_updates: 0,
            request: None,
            given_up: None,
            settled: None,
            untold: Vec::new(),
            imu: Results::new(),
            mag: Results::new(),
            biases: Ack::No,
            network: None,
            is_network_due: false,
            last: None,
            index: 0,
        }
    }

    /// The robot has sent something.
    pub(crate) fn heard(&mut self, now: Instant) {
        self.link_until = Some(now + ms(500));
        if self.link != Link::Up {
            self.link = Link::Up;
            self.is_network_due = self.network.is_some();
        }
    }

    pub(crate) fn pong(&mut self) {
        self.ping_until = None;
    }

    pub(crate) fn calibrate(&mut self, step: CalibrationStep, kind: CalibrationKind) {
        (self.request, self.settled) = (Some(Request::new(step, kind)), None);
        match kind {
            _ if step == CalibrationStep::End => {}
            CalibrationKind::Imu => self.imu.popped = None,
            _ => self.mag.popped = None,
        }
    }

    /// An acknowledgement: a good one has to name the requested kind; a refusing robot may name
    /// another.
    pub(crate) fn acknowledged(
        &mut self,
        step: CalibrationStep,
        kind: CalibrationKind,
        err: ErrorCode,
    ) {
        let Some(request) = self.request.as_mut().filter(|it| it.step == step && it.attempts > 0)
        else {
            return;
        };
        if err != ErrorCode::Fine {
            self.retry();
        } else if kind == request.kind {
            self.settle(true);
        }
    }

    fn retry(&mut self) {
        match &mut self.request {
            Some(request) if request.attempts < 3 => request.until = None,
            _ => self.settle(false),
        }
    }

    fn settle(&mut self, is_fine: bool) {
        if let Some(Request { step, kind, .. }) = self.request.take() {
            self.settled = Some(is_fine);
            self.untold.push((step, kind, is_fine));
        }
    }

    /// The application has been silent, or the robot was not heard, for 500 ms; returns whether
    /// the former is new.
    pub(crate) fn expire_command(&mut self, now: Instant) -> bool {
        let is_silent = self.motion.expire(now);
        if self.link_until.is_some_and(|at| at <= now) {
            (self.link, self.link_until) = (Link::Down, None);
            self.motion.halt();
        }
        is_silent
    }

    /// The driver looks at the clock.
    pub(crate) fn expire(&mut self, now: Instant) {
        let is_reached = |at: Option<Instant>| at.is_some_and(|at| at <= now);
        if is_reached(self.ping_until) {
            self.ping_until = None;
        }
        if is_reached(self.request.as_ref().and_then(|request| request.until)) {
            self.retry();
        } else if self.request.as_ref().is_some_and(|it| it.until.is_none() && is_reached(it.bound))
        {
            self.given_up = self.request.as_ref().map(|it| it.attempts);
            self.settle(false);
        }
    }

    /// A frame is sent.
    pub(crate) fn frame(&mut self, bytes: &[u8], shelf: &Shelf, now: Instant) -> Checked {
        let frame = Frame::parse(bytes).map_err(|error| format!("not a frame: {error:?}"))?;
        let message = frame.message();
        if frame.index() != self.index || bytes.len() > 64 {
            return Err(format!("index {}, {} bytes", frame.index(), bytes.len()));
        }
        self.index = self.index.wrapping_add(1);
        broken_if!(self.update == Update::Silent, "{message:?} during a firmware update");
        broken_if!(self.low_ids_only && frame.id() > 4, "{message:?} to a robot that hangs on it");
        if let Message::MotorControl(command) = message {
            self.motion.frame(command, now)?;
            if let Update::Asked { needs_stop, .. } = &mut self.update {
                *needs_stop = false;
            }
            self.last = Some(Last::Motor);
            return Ok(());
        }
        broken_if!(self.motion.is_due(now), "{message:?} before a motor command that is due");
        self.motion.other_frame();
        let (is_right, last) = match message {
            Message::Ping(_) => {
                let is_right = self.pings && self.ping_until.is_none() && self.ping_at <= now;
                (self.ping_at, self.ping_until) = (now + ms(200), Some(now + ms(500)));
                (is_right, Last::Ping)
            }
            Message::ImuBiasAck(ack) => {
                let may = std::mem::replace(&mut self.imu.ack, Ack::No) != Ack::No;
                (may && ack.err() == ErrorCode::Fine, Last::ImuAck)
            }
            Message::MagBiasAck(ack) => {
                let may = std::mem::replace(&mut self.mag.ack, Ack::No) != Ack::No;
                (may && ack.err() == ErrorCode::Fine, Last::MagAck)
            }
            Message::Biases(biases) => {
                let may = std::mem::replace(&mut self.biases, Ack::No) != Ack::No;
                let is_stored = (shelf.imu, shelf.mag) == (Some(biases.imu()), Some(biases.mag()));
                (may && is_stored, Last::Biases)
            }
            Message::CalibrationStart(start) => {
                (self.asks(CalibrationStep::Start, start.kind(), now), Last::Calibration)
            }
            Message::CalibrationEnd(end) => {
                (self.asks(CalibrationStep::End, end.kind(), now), Last::Calibration)
            }
            Message::SetNetworkState(body) => {
                let is_due = std::mem::take(&mut self.is_network_due);
                (is_due && self.network == Some(body.state().into()), Last::Network)
            }
            Message::OtaRequest(request) => {
                let version = request.version();
                let is_right = matches!(
                    self.update,
                    Update::Asked { version: asked, needs_stop: false, .. } if asked == version
                ) && self.motion.is_stop_sent();
                self.update = Update::Silent;
                (is_right, Last::Update)
            }
            _ => (false, Last::Ping),
        };
        self.last = Some(last);
        if is_right { Ok(()) } else { Err(format!("{message:?} must not be sent")) }
    }

    fn asks(&mut self, step: CalibrationStep, kind: CalibrationKind, now: Instant) -> bool {
        self.request.as_mut().is_some_and(|request| request.frame(step, kind, now))
    }

    /// The last frame comes back, or a flush has failed.
    pub(crate) fn unsent(&mut self, unsent: Unsent, now: Instant) {
        let last = self.last.take();
        self.motion.unsent(unsent);
        let was_request = last == Some(Last::Update) && self.update == Update::Silent;
        if was_request && unsent != Unsent::Unflushed {
            self.give_up_update();
        }
        if unsent == Unsent::Unflushed {
            self.is_network_due = self.network.is_some();
            return;
        }
        self.index = self.index.wrapping_sub(u8::from(last.is_some()));
        let again = |results: &Results| if results.is_kept { Ack::Must } else { Ack::No };
        match last {
            Some(Last::ImuAck) => self.imu.ack = again(&self.imu),
            Some(Last::MagAck) => self.mag.ack = again(&self.mag),
            Some(Last::Biases) => self.biases = Ack::Must,
            Some(Last::Network) => self.is_network_due = true,
            Some(Last::Calibration) => {
                if let Some(request) = &mut self.request {
                    (request.attempts, request.until) = (request.attempts.saturating_sub(1), None);
                }
            }
            Some(Last::Ping) if self.ping_until.take().is_some() => self.ping_at = now,
            _ => {}
        }
    }

    /// The request of an update was not sent.
    pub(crate) fn give_up_update(&mut self) {
        self.end_update();
        self.untold_updates += 1;
    }

    /// The line belongs to the host again.
    pub(crate) fn end_update(&mut self) {
        self.motion.is_called |= self.update == Update::Silent;
        self.update = Update::None;
    }

    /// The latest time for the next action.
    pub(crate) fn owed(&self, now: Instant) -> Option<Instant> {
        if self.update == Update::Silent {
            return self.link_until;
        }
        let is_due = self.is_network_due
            || self.update != Update::None
            || [self.imu.ack, self.mag.ack, self.biases].contains(&Ack::Must);
        let ping = self.pings.then(|| self.ping_until.unwrap_or(self.ping_at));
        let request = self.request.as_ref().map(|request| request.until.unwrap_or(now));
        let dead_man = self.motion.dead_man;
        let times = [self.link_until, self.motion.due(now), dead_man, ping, request];
        times.into_iter().flatten().chain(is_due.then_some(now)).min()
    }
}
