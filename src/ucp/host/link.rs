//! The link to the robot.

/// What is known about the robot.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Link {
    /// Nothing has been heard yet, and the link timeout is not over.
    Waiting,
    /// Valid frames arrive.
    Up,
    /// None has for the link timeout.
    Down,
}
