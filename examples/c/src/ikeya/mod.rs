//! The motor bus: packets, master and slave.

mod master;
mod packet;
mod schedule;
mod slave;

use axlewire::{
    error::EncodeError,
    ikeya::{
        self, Mode, NodeId, Rps, Status, Target,
        board::{OneMotor, ThreeMotors},
    },
};

pub use master::*;
pub use packet::*;
pub use schedule::*;
pub use slave::*;

use crate::result::{AXLE_ERROR_VALUE, axle_result, of_encode};

/// What a node controls: one of `AXLE_IKEYA_MODE_`.
pub type axle_ikeya_mode = u8;

kinds! {
    /// The name of a mode, such as "velocity"; "?" for another number.
    axle_ikeya_mode_name: axle_ikeya_mode;
    /// The speed of its motors.
    AXLE_IKEYA_MODE_VELOCITY = 1, c"velocity";
    /// The position of its motors.
    AXLE_IKEYA_MODE_POSITION = 2, c"position";
}

/// A position of a motor (ruling I5): `rotation` turns of 8192 counts, and `count` counts. Any
/// values are a position, the sum of both parts: 2 turns and 8192 counts are 3 turns.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, Eq, PartialEq)]
pub struct axle_ikeya_position {
    /// Whole turns.
    pub rotation: i16,
    /// Counts, 8192 a turn.
    pub count: i16,
}
plain!(axle_ikeya_position);

/// Counts of a turn.
pub const AXLE_IKEYA_COUNTS_PER_REVOLUTION: i32 = 8192;

const _: () = assert!(AXLE_IKEYA_COUNTS_PER_REVOLUTION == ikeya::Position::COUNTS_PER_REVOLUTION);

/// The position as counts in all.
#[unsafe(no_mangle)]
pub extern "C" fn axle_ikeya_position_counts(position: axle_ikeya_position) -> i32 {
    ikeya::Position::from(position).counts()
}

/// The position at so many counts. Both parts have one sign, as in C; fails with
/// `AXLE_ERROR_POSITION` beyond 32,767 turns and 8,191 counts, or -32,768 turns and -8,191 counts.
#[unsafe(no_mangle)]
pub extern "C" fn axle_ikeya_position_from_counts(
    counts: i32,
    position: *mut axle_ikeya_position,
) -> axle_result {
    let get = || {
        let out = crate::memory::Out::new(position)?;
        Ok(out.write(ikeya::Position::from_counts(counts).map_err(of_encode)?.into()))
    };
    get().unwrap_or_else(|error| error)
}

/// Speeds or positions of the motors of a node: measured or commanded.
///
/// Boards with three motors use all elements, others the first.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct axle_ikeya_motion {
    /// One of `AXLE_IKEYA_MODE_`, which tells what follows; 0 if nothing does.
    pub mode: axle_ikeya_mode,
    /// Speeds, turns per second; 0 in position mode.
    pub velocity_rps: [f32; 3],
    /// Positions; 0 in velocity mode.
    pub position: [axle_ikeya_position; 3],
}
plain!(axle_ikeya_motion);

impl From<ikeya::Position> for axle_ikeya_position {
    fn from(position: ikeya::Position) -> Self {
        Self { rotation: position.rotation(), count: position.count() }
    }
}

impl From<axle_ikeya_position> for ikeya::Position {
    fn from(position: axle_ikeya_position) -> Self {
        Self::new(position.count, position.rotation)
    }
}

/// Values of a board's motors as those of C and back.
pub(crate) trait Motors: ikeya::board::Board {
    fn velocities(velocity: Self::RawVelocity) -> [f32; 3];
    fn raw(velocity: Self::Velocity) -> Self::RawVelocity;
    fn velocity(rps: [f32; 3]) -> Result<Self::Velocity, EncodeError>;
    fn positions(position: Self::Position) -> [ikeya::Position; 3];
    fn position(positions: [ikeya::Position; 3]) -> Self::Position;
}

impl Motors for OneMotor {
    fn velocities(velocity: f32) -> [f32; 3] {
        [velocity, 0.0, 0.0]
    }

    fn raw(velocity: Rps) -> f32 {
        velocity.get()
    }

    fn velocity([rps, ..]: [f32; 3]) -> Result<Rps, EncodeError> {
        Rps::new(rps)
    }

    fn positions(position: ikeya::Position) -> [ikeya::Position; 3] {
        [position, ikeya::Position::new(0, 0), ikeya::Position::new(0, 0)]
    }

    fn position([position, ..]: [ikeya::Position; 3]) -> ikeya::Position {
        position
    }
}

impl Motors for ThreeMotors {
    fn velocities(velocity: [f32; 3]) -> [f32; 3] {
        velocity
    }

    fn raw(velocity: [Rps; 3]) -> [f32; 3] {
        velocity.map(Rps::get)
    }

    fn velocity([a, b, c]: [f32; 3]) -> Result<[Rps; 3], EncodeError> {
        Ok([Rps::new(a)?, Rps::new(b)?, Rps::new(c)?])
    }

    fn positions(positions: [ikeya::Position; 3]) -> [ikeya::Position; 3] {
        positions
    }

    fn position(positions: [ikeya::Position; 3]) -> [ikeya::Position; 3] {
        positions
    }
}

impl axle_ikeya_motion {
    fn of_velocity(velocity_rps: [f32; 3]) -> Self {
        Self { mode: AXLE_IKEYA_MODE_VELOCITY, velocity_rps, ..Self::default() }
    }

    fn of_position(positions: [ikeya::Position; 3]) -> Self {
        let position = positions.map(Into::into);
        Self { mode: AXLE_IKEYA_MODE_POSITION, position, ..Self::default() }
    }

    pub(crate) fn of_status<B: Motors>(status: Status<B>) -> Self {
        match status {
            Status::Velocity(velocity) => Self::of_velocity(B::velocities(velocity)),
            Status::Position(position) => Self::of_position(B::positions(position)),
        }
    }

    pub(crate) fn of_target<B: Motors>(target: Target<B>) -> Self {
        match target {
            Target::Velocity(velocity) => Self::of_velocity(B::velocities(B::raw(velocity))),
            Target::Position(position) => Self::of_position(B::positions(position)),
        }
    }
}

pub(crate) const fn mode_of(mode: Mode) -> axle_ikeya_mode {
    match mode {
        Mode::Velocity => AXLE_IKEYA_MODE_VELOCITY,
        Mode::Position => AXLE_IKEYA_MODE_POSITION,
    }
}

pub(crate) const fn mode_from(mode: axle_ikeya_mode) -> Result<Mode, axle_result> {
    match mode {
        AXLE_IKEYA_MODE_VELOCITY => Ok(Mode::Velocity),
        AXLE_IKEYA_MODE_POSITION => Ok(Mode::Position),
        _ => Err(AXLE_ERROR_VALUE),
    }
}

pub(crate) fn node_from(node: u8) -> Result<NodeId, axle_result> {
    NodeId::new(node).map_err(of_encode)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_counts_of_a_position_are_8192_for_each_rotation_and_one_for_each_count() {
        let position = axle_ikeya_position { rotation: 2, count: -3 };
        assert_eq!(axle_ikeya_position_counts(position), 16_381);
        assert_eq!(axle_ikeya_position::from(ikeya::Position::from(position)), position);
    }
}
