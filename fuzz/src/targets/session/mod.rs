//! Whole sessions: a master with slaves, or a host with its robot, on a line whose faults the
//! fuzzer chooses, with any calls of the application at any time. A model written from the rulings
//! alone says what may be sent and obeyed. At the end the faults are over: then every stop has to
//! be confirmed, and every motor to obey.

mod bus;
mod ears;
mod link;
mod station;
mod way;

use arbitrary::{Arbitrary, Result, Unstructured};
use axlewire::ikeya::board::{OneMotor, ThreeMotors};

use super::{Tally, oracle};

#[derive(Arbitrary, Clone, Copy, Debug)]
enum Kind {
    OneMotor,
    ThreeMotors,
    Link,
}

/// Most actions of the application and of the line.
const ACTIONS: usize = 40;

pub(super) fn session(data: &[u8], tally: &mut Tally) {
    let _ = play(&mut Unstructured::new(data), tally);
}

fn play(u: &mut Unstructured<'_>, tally: &mut Tally) -> Result<()> {
    match u.arbitrary()? {
        Kind::OneMotor => bus::play::<OneMotor>(u, tally),
        Kind::ThreeMotors => bus::play::<ThreeMotors>(u, tally),
        Kind::Link => link::play(u, tally),
    }
}
