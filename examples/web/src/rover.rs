//! The host of a rover.

use axlewire::{
    encode::Encode,
    ucp::{
        Body, Frame, Host, MAX_LEN, MotorControl,
        host::{HostConfig, HostEvent, Link, ReceivedReport, StopProgress},
        message::{DocumentReport, FirmwareReport},
    },
};
use serde_json::{Value, json};
use wasm_bindgen::prelude::*;

use crate::{
    session::{Session, instant, span},
    thrown,
};

/// A host.
#[wasm_bindgen]
pub struct Rover {
    session: Session<Host>,
    round_trip_ms: Option<f64>,
    /// When the latest report came, milliseconds.
    reported: Option<f64>,
}

#[wasm_bindgen]
impl Rover {
    /// A host that stops the rover if nobody gives a command for this long.
    #[wasm_bindgen(constructor)]
    pub fn new(dead_man_ms: f64, now: f64) -> Self {
        let mut config = HostConfig::usb_adapter();
        config.dead_man = span(dead_man_ms);
        let session = Session::new(Host::new(config, instant(now)), told, now);
        Self { session, round_trip_ms: None, reported: None }
    }

    /// Takes in what was received.
    pub fn receive(&mut self, bytes: &[u8], now: f64) {
        self.session.receive(bytes, now);
    }

    /// The next frame to write, if one is due. Call it again until there is none.
    pub fn transmit(&mut self, now: f64) -> Option<Vec<u8>> {
        let frame = self.session.transmit(now);
        if let Some(trip) = self.session.role.take_round_trip() {
            self.round_trip_ms = Some(f64::from(trip.as_micros()) / 1e3);
        }
        if self.session.role.take_report().is_some() {
            self.reported = Some(now);
        }
        frame
    }

    /// What has become of a frame.
    pub fn sent(&mut self, ok: bool, now: f64) {
        self.session.sent(ok, now);
    }

    /// Milliseconds until `transmit` is to be called, even if nothing is received.
    pub fn wait(&self, now: f64) -> Option<f64> {
        self.session.wait(now)
    }

    /// Drives: percent of the speed ahead, and percent of turn, to the right.
    pub fn drive(&mut self, speed: i16, angular: i16, now: f64) -> Result<(), JsError> {
        let role = &mut self.session.role;
        let lamp = role.command().map_or(0, |command| command.front_led());
        let command = MotorControl::new(speed, angular).map_err(thrown)?;
        role.drive(command.with_front_led(lamp != 0), instant(now)).map_err(thrown)
    }

    /// Switches the front lamp, without a change of speed.
    pub fn lamp(&mut self, on: bool, now: f64) -> Result<(), JsError> {
        let role = &mut self.session.role;
        let standing = MotorControl::new(0, 0).map_err(thrown)?;
        let command = role.command().unwrap_or(standing);
        role.drive(command.with_front_led(on), instant(now)).map_err(thrown)
    }

    /// Somebody is there: a command that is still in force goes on. If that comes too late, the
    /// dead-man has fired before.
    pub fn keep_alive(&mut self, now: f64) {
        drop(self.session.catch_up(now));
        let role = &mut self.session.role;
        let moving = role.command().filter(|command| !command.stands_still());
        if let Some(command) = moving.filter(|_| role.stop_progress() == StopProgress::NotAsked) {
            // Refused if the rover is not heard: then it was told to stop.
            let _ = role.drive(command, instant(now));
        }
    }

    /// Stops; the stop is repeated.
    pub fn stop(&mut self, now: f64) {
        self.session.role.stop(instant(now));
    }

    /// What the host knows.
    pub fn state(&self, now: f64) -> String {
        let role = &self.session.role;
        let seen = role.statistics();
        json!({
            "link": match role.link() {
                Link::Waiting => "waiting",
                Link::Up => "up",
                Link::Down => "down",
            },
            "stop": match role.stop_progress() {
                StopProgress::NotAsked => "not_asked",
                StopProgress::Due => "owed",
                StopProgress::NoReports => "no_reports",
                StopProgress::StillMoving { .. } => "still_moving",
                StopProgress::StandingStill => "standing_still",
            },
            "stop_text": role.stop_progress().to_string(),
            "report": role.last_report().and_then(report),
            "age_ms": self.reported.map(|at| now - at),
            "round_trip_ms": self.round_trip_ms,
            "command": role.command().map(|it| json!({
                "speed": it.speed(), "angular": it.angular(), "lamp": it.front_led() != 0,
            })),
            "statistics": {
                "commands": seen.commands,
                "dead_man": seen.dead_man,
                "pings": seen.pings,
                "pings_lost": seen.pings_lost,
                "reports": seen.reports,
                "reports_lost": seen.reports_lost,
                "skipped": role.counters().skipped(),
            },
        })
        .to_string()
    }

    /// What has happened since the last call.
    pub fn events(&mut self) -> String {
        self.session.events()
    }
}

/// The fields of a report, as in the lines of `axle decode --json`.
fn report(report: &ReceivedReport) -> Option<Value> {
    let ReceivedReport { telemetry, version, index, .. } = report;
    let mut memory = [0; MAX_LEN];
    let frame = match version {
        Some(version) => FirmwareReport::new(telemetry, *version).frame(*index).encode(&mut memory),
        None => DocumentReport::new(telemetry).frame(*index).encode(&mut memory),
    };
    serde_json::to_value(Frame::parse(frame.ok()?).ok()?).ok()
}

/// An event as a sentence; reports and pongs are none, since they are a part of the state.
fn told(t: f64, event: &HostEvent) -> Option<Value> {
    let (name, text) = match event {
        HostEvent::LinkUp => ("link_up", "the rover is heard"),
        HostEvent::LinkDown => (
            "link_down",
            "the rover is not heard any more: it may be moving, and is told to stop until it answers",
        ),
        HostEvent::DeadMan => {
            ("dead_man", "nobody has touched anything: the rover is told to stop")
        }
        HostEvent::BiasesSent => {
            ("biases_sent", "the rover has started, and has the offsets of its sensors (biases)")
        }
        HostEvent::BiasesMissing { .. } => (
            "biases_missing",
            "the rover has started, and asks for the offsets of its sensors (biases): none are kept here",
        ),
        HostEvent::Unknown(_) => ("unknown", "a frame that this page does not know"),
        _ => return None,
    };
    Some(json!({ "t": t, "event": name, "node": null, "text": text }))
}
