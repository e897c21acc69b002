//! Contents of motor bus packets, in revolutions per second and turns.

use core::{fmt, slice};
use std::io::{self, Write};

use axlewire::ikeya::Position;

use super::Spaced;
use crate::record::ikeya::{Fields, Motors, Positions, Rps};

pub(super) fn contents(out: &mut impl Write, fields: &Fields<'_>) -> io::Result<()> {
    match fields {
        Fields::Read {} => Ok(()),
        Fields::Write { rps, positions, .. } => {
            write!(out, "  {} or {}", Speed(rps), Place(positions))
        }
        Fields::Velocity { rps } => write!(out, "  {}", Speed(rps)),
        Fields::Position(positions) => write!(out, "  {}", Place(positions)),
    }
}

struct Speed<'a>(&'a Motors<Rps>);

impl fmt::Display for Speed<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        // `Debug` of a float is as exact as `Display`, and uses an exponent where that is shorter.
        write!(f, "{:?} rps", Spaced(each(&self.0.map(|Rps(rps)| rps))))
    }
}

struct Place<'a>(&'a Positions);

impl fmt::Display for Place<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Positions(positions) = self.0;
        write!(
            f,
            "{:.4} turns (rotation {}, count {})",
            Spaced(each(&positions.map(Position::revolutions))),
            Spaced(each(&positions.map(Position::rotation))),
            Spaced(each(&positions.map(Position::count))),
        )
    }
}

fn each<T>(motors: &Motors<T>) -> &[T] {
    match motors {
        Motors::One(value) => slice::from_ref(value),
        Motors::Three(values) => values,
    }
}
