//! The end of a session of a bus, when nothing is faulty any more: stops are confirmed and obeyed,
//! commands are obeyed, and a silent master is noticed.

use axlewire::{
    ikeya::{
        Mode, Position, Target,
        master::{Polling, StopProgress},
    },
    time::Duration,
};

use super::Session;
use crate::{kit::Kit, rulings::Aim};

const MS: fn(u32) -> Duration = Duration::from_millis;

/// Time in which a healthy bus confirms its stops.
const RECOVERY_MS: u32 = 500;

pub(super) fn check<B: Kit>(session: &mut Session<B>) {
    session.heal();
    // What was on its way arrives.
    session.run_for(MS(2));
    let now = session.now;
    session.master.discover(now);
    session.stop_all();
    let ids: Vec<_> = session.stations.iter().map(|station| station.id).collect();
    for id in &ids {
        session.stop((*id).into());
    }
    for ms in 0.. {
        let owed = session.master.stops_owed();
        // The switch may have been moved after the last answer.
        let knows_modes =
            session.stations.iter().all(|it| session.master.mode(it.id) == Some(it.slave.mode()));
        if session.is_over || knows_modes && !ids.iter().any(|id| owed.contains(*id)) {
            break;
        }
        assert!(ms < RECOVERY_MS, "not confirmed on a healthy bus: {owed:?}");
        session.run_for(MS(1));
    }
    if session.is_over {
        return;
    }
    for station in &session.stations {
        let held = session.master.set_point(station.id);
        let command = station.slave.command(session.now);
        assert!(station.is_stopped(held, session.now), "confirmed, but it obeys {command:?}");
        assert_ne!(session.master.stop_progress(station.id), StopProgress::Owed);
    }
    obey(session);
    if !session.is_over {
        silence(session);
    }
}

/// A new set-point reaches its node.
fn obey<B: Kit>(session: &mut Session<B>) {
    for tail in 0..session.stations.len() {
        let station = &session.stations[tail];
        let (id, is_turning) = (station.id, station.slave.mode() == Mode::Velocity);
        let aim = if is_turning { Aim::Rps(77.0) } else { Aim::Place((7, 777)) };
        assert!(session.aim(id, aim), "a stopped node refuses a set-point");
        // It is in force unless a dead-man has ended it since. Stops of silent nodes go first.
        let bound = session.now + session.master.read_bound() + session.master.read_bound();
        let has_dead_man = session.master.config().dead_man.is_some();
        while session.stations[tail].slave.command(session.now) != Some(aim_of::<B>(aim)) {
            if session.is_over || has_dead_man {
                break;
            }
            assert!(session.now < bound, "a set-point does not reach its node");
            session.run_for(MS(1));
        }
        // Its repetitions feed the watchdog.
        if !has_dead_man && session.master.config().polling != Polling::Manual {
            // A discovery goes before the cycle: a timeout for each attempt at a silent id.
            let bound = session.now + MS(60);
            while session.master.is_discovering() && !session.is_over {
                assert!(session.now < bound, "an endless discovery");
                session.run_for(MS(1));
            }
            session.run_for(MS(8));
            for _ in 0..24 {
                session.run_for(MS(1));
                let command = session.stations[tail].slave.command(session.now);
                let is_in_force = command == Some(aim_of::<B>(aim));
                assert!(session.is_over || is_in_force, "{command:?} although it is repeated");
            }
        }
    }
}

fn aim_of<B: Kit>(aim: Aim) -> Target<B> {
    match aim {
        Aim::Rps(rps) => Target::Velocity(B::speed(rps)),
        Aim::Place((count, rotation)) => Target::Position(B::place(Position::new(count, rotation))),
    }
}

/// Without a master a slave stops by its watchdog, and not before.
fn silence<B: Kit>(session: &mut Session<B>) {
    session.kill_master();
    let last = session.now;
    session.run_for(MS(14));
    for station in &session.stations {
        if let Some(watchdog) = station.slave.config().watchdog {
            assert!(session.now - last > watchdog, "the test is too short");
            assert_eq!(station.slave.command(session.now), None, "it moves without a master");
        }
    }
}
