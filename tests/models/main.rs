//! Models: a master and a slave of a motor bus, and a host and a robot of UCP, in every order of
//! calls, answers and faults, up to a stated depth.
//!
//! A world is a role, its peers, and an independent account of what was called, sent and received,
//! and therefore of what may and must be sent (rulings I6 to I14 and U6 to U16). A search tries all
//! sequences of actions, shortest first, merges states that differ only in absolute time and in
//! counters, and prints the shortest sequence that breaks an invariant.
//!
//! # Actions
//!
//! * Calls: set-point, stop, stop of all, release, confirm, read, discovery, sign of life.
//! * Packets: arrive, are lost, also a WRITE whose READ is answered, any number of times, are
//!   refused by the port, cut off, taken in parts with a late answer between them, or not flushed.
//! * Answers: correct, missing, late, damaged, from another node, left over from an older request,
//!   in another mode because the switch was moved.
//! * Motors do what their node was last told: an answer shows a speed, or a place where the shaft
//!   was never before, until that is a stop. `Ok` and `StandingStill` are true only then.
//! * Nodes restart; time passes: briefly, up to a deadline, 1 us past it, 10 s.
//!
//! On UCP:
//!
//! * Calls of a host: two motor commands, one of them on the spot, zero, stop, start and end of a
//!   calibration, lamp, firmware update and its end; of a robot: its command, reports, results, the
//!   end of a calibration, the answer to an update.
//! * Frames: every message of the other side, correct, unsolicited, repeated, damaged, in halves,
//!   held back by a false header, old, our own echo, of no known message.
//! * Frames handed back unsent or cut off, and failing flushes, immediately or after other calls.
//! * A store that fails, or keeps nothing; events that are never taken, up to a full queue.
//!
//! # Outside the models
//!
//! An answer later than `late_guard`, which cannot be distinguished from the next one; more than
//! two nodes (three in the random stories of `random_masters.rs`); answers that a master receives
//! in pieces (see `tests/master/any_line.rs`).
//!
//! On UCP: settings other than `sends_first_stop`, `low_ids_only` and the robot's bias requests;
//! the content of reports and pongs (see `tests/host` and `tests/robot`); a host and a robot
//! talking to each other.
//!
//! # Depths
//!
//! A normal run tries 2 or 3 consecutive actions from each of over a hundred prepared states: an
//! abnormal node, a mode in doubt, a stop owed, a full event queue, other settings. The deep run
//! searches every world to its full depth, and prints the depth, states and time of each, in about
//! forty minutes and 4 GB (a name behind it, such as `deep_host`, selects worlds; `MODELS_DEPTH=5`
//! gives all of them that depth):
//!
//! ```sh
//! cargo test --release --test models -- --ignored --nocapture --test-threads 1
//! ```
//!
//! | World, for both kinds of boards | Consecutive actions | States in each |
//! |---|---|---|
//! | a fresh master of one node, in small steps | 7 | 48,000 to 52,000 |
//! | a fresh master of two nodes, in small steps | 6 | 55,000 to 57,000 |
//! | one known node, in small steps | 6 | 37,000 to 166,000 |
//! | two known nodes, in small steps | 4 | 22,000 to 24,000 |
//! | one node, an exchange at a time | 6 | 41,000 to 174,000 |
//! | one node whose mode is, or stays, in doubt | 4 | 2,800 to 6,700 |
//! | one node, with other settings | 6 | 29,000 to 163,000 |
//! | two nodes, an exchange at a time | 4 | 5,700 to 22,000 |
//! | two nodes that are commanded and stopped continuously | 9 | 99,000 to 120,000 |
//! | a slave | 4 | 19,000 to 26,000 |
//!
//! A normal run tries 2 or 3 consecutive actions from each of about thirty states of a host and a
//! robot, with 85 to 2,000 states each. The deep run:
//!
//! | UCP world | Consecutive actions | States in each |
//! |---|---|---|
//! | a host and its motor commands | 6 | 40,000 to 92,000 |
//! | a host and firmware updates | 5 | 21,000 to 59,000 |
//! | a host and calibrations | 4 | 15,000 to 39,000 |
//! | a host with a full queue | 4, halves of frames 6 | 16,000 to 36,000 |
//! | a robot and its motor commands | 5 | 161,000 to 180,000 |
//! | a robot and all other requests | 4 | 21,000 to 76,000 |
//!
//! Drivers, for one kind of board; a normal run tries 1 or 2 actions. The possible calls and the
//! behaviour of port, pin and clock are in `models/drive/action.rs`:
//!
//! | Driver world | Consecutive actions | States in each |
//! |---|---|---|
//! | a blocking driver of a master, commanded | 4 | 179,000 |
//! | the same in other states and settings | 3 | 6,300 to 13,000 |
//! | an async driver: commanded, cut off, in doubt, in position mode | 3 | 41,000 to 99,000 |
//! | the same in other states and settings | 2 | 1,100 to 3,100 |
//! | a driver of a host | 3 | 8,100 to 9,600 |
#![cfg(all(feature = "ikeya", feature = "ucp", feature = "std"))]
#![cfg(feature = "embedded-io-async")]

/// An invariant is broken if this is true: returns what to say of it.
macro_rules! broken_if {
    ($is_broken:expr, $($what:tt)+) => {
        if $is_broken {
            return Err(format!($($what)+));
        }
    };
}

mod account;
mod action;
mod bus;
mod checks;
mod drive;
mod exchange;
mod fingerprint;
mod host;
mod host_account;
mod host_calls;
mod host_checks;
mod host_motion;
mod host_request;
mod host_starts;
mod host_store;
mod kit;
mod merging;
mod names;
mod random_masters;
mod robot;
mod robot_account;
mod robot_checks;
mod robot_starts;
#[path = "../harness/rulings.rs"]
#[allow(dead_code, reason = "the fuzz target of a session uses more of it")]
mod rulings;
mod run;
mod search;
mod site;
mod slave;
mod sleep;
mod starts;
mod ucp;

use crate::names::*;
use run::Run;

/// A shallow and a deep test for each group of worlds.
macro_rules! models {
    ($($name:ident $deep:ident: $($group:literal, $worlds:expr);+;)+) => {$(
        #[test]
        fn $name() {
            $({
                let mut run = Run::new($group, false);
                $worlds(&mut run);
                run.end();
            })+
        }

        #[test]
        #[ignore = "takes minutes: see the top of this file"]
        fn $deep() {
            $({
                let mut run = Run::new($group, true);
                $worlds(&mut run);
                run.end();
            })+
        }
    )+};
}

models! {
    a_fresh_master_obeys_the_rulings deep_fresh:
        "one motor", starts::fresh::<OneMotor>;
        "three motors", starts::fresh::<ThreeMotors>;
    a_master_obeys_the_rulings_at_every_small_step deep_small_steps:
        "one motor", starts::small_steps::<OneMotor>;
        "three motors", starts::small_steps::<ThreeMotors>;
    a_master_of_one_node_obeys_the_rulings deep_one_node:
        "one motor", starts::one_node::<OneMotor>;
        "three motors", starts::one_node::<ThreeMotors>;
    a_master_with_other_settings_obeys_the_rulings deep_settings:
        "one motor", starts::settings::<OneMotor>;
        "three motors", starts::settings::<ThreeMotors>;
    a_master_of_two_nodes_obeys_the_rulings deep_two_nodes:
        "one motor", starts::two_nodes::<OneMotor>;
        "three motors", starts::two_nodes::<ThreeMotors>;
    nobody_waits_too_long_in_a_busy_queue deep_queues:
        "one motor", starts::queues::<OneMotor>;
        "three motors", starts::queues::<ThreeMotors>;
    a_slave_obeys_the_rulings deep_slave:
        "one motor", slave::lines::<OneMotor>;
        "three motors", slave::lines::<ThreeMotors>;
    a_host_moves_a_robot_as_its_application_says deep_host_motion:
        "host, motion", host_starts::motion;
    a_host_starts_an_update_by_its_own_call_alone deep_host_updates:
        "host, updates", host_starts::updates;
    a_host_acknowledges_what_is_kept deep_host_calibrations:
        "host, calibrations", host_starts::calibrations;
    a_host_with_a_full_queue_loses_nothing deep_host_queues:
        "host, queues", host_starts::queues;
    a_robot_obeys_the_last_valid_command_for_500_ms deep_robot_motion:
        "robot, motion", robot_starts::motion;
    a_robot_answers_what_it_is_asked deep_robot_answers:
        "robot, answers", robot_starts::answers;
    a_robot_with_a_full_queue_acknowledges_nothing deep_robot_queues:
        "robot, queues", robot_starts::queues;
    a_blocking_driver_of_a_master_obeys_the_rulings deep_blocking_driver:
        "blocking driver", drive::blocking;
    an_async_driver_of_a_master_obeys_the_rulings deep_async_driver:
        "async driver", drive::waiting;
    a_driver_of_a_host_obeys_the_rulings deep_driver_of_a_host:
        "driver of a host", drive::host;
}
