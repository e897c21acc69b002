//! The link to the robot.

/// State of the link to the robot.
#[derive(Clone, Copy, Debug, Eq, Hash, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Link {
    /// No valid frame has arrived yet, and the link timeout has not passed.
    Waiting,
    /// Valid frames arrive.
    Up,
    /// No valid frame has arrived within the link timeout.
    Down,
}
