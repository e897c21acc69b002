//! The master of a motor bus.

use axlewire::{
    ikeya::{
        Master, NodeId, Position, Rps, WriteRequest,
        board::{Status, Target},
        master::{Cause, Health, MasterConfig, MasterEvent, NodeSet, Polling, StopProgress},
    },
    time::Duration,
};
use serde_json::{Value, json};
use wasm_bindgen::prelude::*;

use crate::{
    session::{Session, instant, span},
    thrown,
};

/// How long a browser may take to deliver an answer.
const DELIVERY: Duration = Duration::from_millis(40);

/// A position that was measured so long ago is held by a stop as it is: a page that closes has no
/// time to read another one.
const HOLD_AGE: Duration = Duration::from_millis(60);

/// The oldest position that a closing page holds.
const LAST_SEEN: Duration = Duration::from_millis(150);

/// How often each node is read, and told its set-point.
const PERIOD: Duration = Duration::from_millis(25);

/// A master with boards of one motor.
#[wasm_bindgen]
pub struct Bus {
    session: Session<Master>,
    /// Somebody has stopped all: what is found later is stopped too.
    is_stopped: bool,
    /// Once all known ones are seen to stand still, the others are searched for.
    is_search_due: bool,
}

#[wasm_bindgen]
impl Bus {
    /// A master that stops all motors if nobody gives a sign of life for this long.
    #[wasm_bindgen(constructor)]
    pub fn new(baud: u32, dead_man_ms: f64, now: f64) -> Self {
        let mut config = MasterConfig::usb_adapter();
        config.baud = baud;
        (config.reply_timeout, config.late_guard) = (DELIVERY, DELIVERY);
        config.polling = Polling::Every(PERIOD);
        config.hold_age = HOLD_AGE;
        config.dead_man = Some(span(dead_man_ms));
        // The clock of a page has steps of 100 µs.
        config.accepts_early = true;
        let mut lost = NodeSet::default();
        let news =
            move |t, event: &MasterEvent| told(t, event).filter(|_| is_news(event, &mut lost));
        let session = Session::new(Master::new(config, instant(now)), news, now);
        Self { session, is_stopped: false, is_search_due: false }
    }

    /// Takes in what was received.
    pub fn receive(&mut self, bytes: &[u8], now: f64) {
        self.session.receive(bytes, now);
    }

    /// The next packet to write, if one is due. Call it again until there is none.
    pub fn transmit(&mut self, now: f64) -> Option<Vec<u8>> {
        self.catch_up(now);
        self.session.transmit(now)
    }

    /// What has become of a packet.
    pub fn sent(&mut self, ok: bool, now: f64) {
        self.session.sent(ok, now);
    }

    /// Milliseconds until `transmit` is to be called, even if nothing is received.
    pub fn wait(&self, now: f64) -> Option<f64> {
        self.session.wait(now)
    }

    /// Asks all ids.
    pub fn discover(&mut self, now: f64) {
        self.session.role.discover(instant(now));
    }

    /// Turns a motor, turns per second.
    pub fn set_velocity(&mut self, node: u8, rps: f32, now: f64) -> Result<(), JsError> {
        let target = Rps::new(rps).map_err(thrown)?;
        self.session.role.set_velocity(id(node)?, target, instant(now)).map_err(thrown)
    }

    /// Moves a motor there, turns.
    pub fn set_position(&mut self, node: u8, turns: f64, now: f64) -> Result<(), JsError> {
        let target = Position::from_revolutions(turns).map_err(thrown)?;
        self.session.role.set_position(id(node)?, target, instant(now)).map_err(thrown)
    }

    /// Stops a motor; the stop is repeated until the motor is seen to stand still.
    pub fn stop(&mut self, node: u8, now: f64) -> Result<(), JsError> {
        self.session.role.stop(id(node)?, instant(now));
        Ok(())
    }

    /// Stops all that were heard, or are owed a stop; then searches for others, such as one that
    /// was plugged in later, and stops them.
    pub fn stop_all(&mut self, now: f64) {
        (self.is_stopped, self.is_search_due) = (true, true);
        let role = &mut self.session.role;
        for node in NodeId::ALL {
            if role.mode(node).is_some() || role.stops_owed().contains(node) {
                role.stop(node, instant(now));
            }
        }
    }

    /// Packets for a page that closes and will hear nothing more: they hold the position motors
    /// that were commanded where they were last seen, which the role would read anew before.
    /// Write them behind the other packets of a stop. A position older than some 150 ms is left
    /// out: the motor would be driven back to it.
    pub fn last_words(&self, now: f64) -> Vec<u8> {
        let (role, now) = (&self.session.role, instant(now));
        let owed = role.stops_owed();
        let hold = |node: NodeId| match role.status(node)? {
            (Status::Position(position), at) if owed.contains(node) && now < at + LAST_SEEN => {
                Some(WriteRequest::position(node, position))
            }
            _ => None,
        };
        let packets = NodeId::ALL.into_iter().filter_map(hold);
        packets.flat_map(|packet| packet.as_bytes().to_vec()).collect()
    }

    /// Somebody is there; if that comes too late, the dead-man has fired before.
    pub fn keep_alive(&mut self, now: f64) {
        self.catch_up(now);
        self.session.role.keep_alive(instant(now));
    }

    /// What the master knows.
    pub fn state(&self, now: f64) -> String {
        let role = &self.session.role;
        let nodes: Vec<_> = NodeId::ALL.into_iter().map(|node| self.node(node, now)).collect();
        let seen = role.statistics();
        json!({
            "discovering": role.is_discovering(),
            "nodes": nodes,
            "statistics": {
                "reads": seen.reads,
                "writes": seen.writes,
                "stale_bytes": seen.stale_bytes,
                "dead_man": seen.dead_man,
                "skipped": role.counters().skipped(),
            },
        })
        .to_string()
    }

    /// What has happened since the last call.
    pub fn events(&mut self) -> String {
        self.session.events()
    }

    fn catch_up(&mut self, now: f64) {
        for event in self.session.catch_up(now) {
            if let MasterEvent::Discovered { node, .. } = event
                && self.is_stopped
            {
                self.session.role.stop(node, instant(now));
            }
        }
        if self.is_search_due && self.is_settled() && !self.session.role.is_discovering() {
            self.is_search_due = false;
            self.session.role.discover(instant(now));
        }
    }

    /// Whether each node that answers is seen to obey its stop: one that does not must not keep the
    /// others from being searched for.
    fn is_settled(&self) -> bool {
        let role = &self.session.role;
        let is_stopping = |node| role.stops_owed().contains(node) || role.coasting().contains(node);
        let is_lost = |node| matches!(role.health(node), None | Some(Health::Abnormal));
        NodeId::ALL.into_iter().all(|node| !is_stopping(node) || is_lost(node))
    }

    fn node(&self, node: NodeId, now: f64) -> Value {
        let role = &self.session.role;
        let (velocity, position, age) = match role.status(node) {
            Some((Status::Velocity(rps), at)) => (Some(rps), None, Some(at)),
            Some((Status::Position(at_turns), at)) => {
                (None, Some(at_turns.revolutions()), Some(at))
            }
            None => (None, None, None),
        };
        let counts = role.node_statistics(node);
        json!({
            "id": node.get(),
            "mode": role.mode(node).map(|mode| mode.to_string()),
            "health": match role.health(node) {
                None => "unknown",
                Some(Health::Online) => "online",
                Some(Health::Suspect(_)) => "suspect",
                Some(Health::Abnormal) => "abnormal",
            },
            "velocity": velocity,
            "position": position,
            "age_ms": age.map(|at| now - at.as_micros() as f64 / 1e3),
            "target": role.set_point(node).map(|target| match target {
                Target::Velocity(rps) => rps.get(),
                Target::Position(at) => at.revolutions() as f32,
            }),
            "stop": match role.stop_progress(node) {
                StopProgress::NotAsked => "not_asked",
                StopProgress::Owed => "owed",
                StopProgress::Confirmed => "confirmed",
                StopProgress::StandingStill => "standing_still",
                StopProgress::StillMoving => "still_moving",
            },
            "timeouts": counts.timeouts,
            "replies": counts.replies,
        })
    }
}

fn id(node: u8) -> Result<NodeId, JsError> {
    NodeId::new(node).map_err(thrown)
}

/// Only a node that was lost answers again: on a noisy line, every other answer is missed.
fn is_news(event: &MasterEvent, lost: &mut NodeSet) -> bool {
    match event {
        MasterEvent::Health { node, health: Health::Online } => {
            let was_lost = lost.contains(*node);
            lost.remove(*node);
            was_lost
        }
        MasterEvent::Health { node, health: Health::Abnormal } => {
            lost.insert(*node);
            true
        }
        _ => true,
    }
}

/// An event as a sentence; a status is none, since it is a part of the state.
fn told(t: f64, event: &MasterEvent) -> Option<Value> {
    let (name, node, text) = match event {
        MasterEvent::Discovered { node, mode } => {
            ("discovered", Some(node), format!("motor {node} found, {mode} control"))
        }
        MasterEvent::DiscoveryDone { online } => {
            let motors = if *online == 1 { "motor" } else { "motors" };
            ("discovery_done", None, format!("scan done: {online} {motors}"))
        }
        MasterEvent::ReadFailed { node, cause } => {
            let why = match cause {
                Cause::Silent => "no answer",
                Cause::Damaged => "damaged bytes",
                _ => "no answer of its own",
            };
            ("read_failed", Some(node), format!("motor {node}: {why}"))
        }
        MasterEvent::Health { node, health } => {
            let text = match health {
                Health::Online => "answers again",
                Health::Suspect(_) => return None,
                Health::Abnormal => {
                    "does not answer any more. If it was moving, it is stopped when it answers"
                }
            };
            ("health", Some(node), format!("motor {node} {text}"))
        }
        MasterEvent::ModeChanged { node, mode } => {
            ("mode_changed", Some(node), format!("motor {node} is under {mode} control now"))
        }
        MasterEvent::ModeInDoubt { node } => {
            ("mode_in_doubt", Some(node), format!("motor {node}: its mode is in doubt"))
        }
        MasterEvent::StopBlocked { node } => {
            let text = "cannot be told to stop yet: its mode is not known";
            ("stop_blocked", Some(node), format!("motor {node} {text}"))
        }
        MasterEvent::Stopped { node } => {
            ("stopped", Some(node), format!("motor {node} has confirmed its stop"))
        }
        MasterEvent::StandingStill { node } => {
            ("standing_still", Some(node), format!("motor {node} is seen at standstill"))
        }
        MasterEvent::StillMoving { node, .. } => {
            let text = "has confirmed its stop, and STILL MOVES";
            ("still_moving", Some(node), format!("motor {node} {text}"))
        }
        MasterEvent::DeadMan => (
            "dead_man",
            None,
            "nobody has touched anything: all motors are told to stop".to_owned(),
        ),
        MasterEvent::NotConfirmed { node, .. } => {
            ("not_confirmed", Some(node), format!("motor {node} has not confirmed its command"))
        }
        // Status, and a command that was confirmed.
        _ => return None,
    };
    Some(json!({ "t": t, "event": name, "node": node.map(|node| node.get()), "text": text }))
}
