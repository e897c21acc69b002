//! Events of a slave.

use crate::ikeya::board::{Board, OneMotor, Target};

/// What the slave tells its application.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum SlaveEvent<B: Board = OneMotor> {
    /// A command for this node, in its mode. Repeated as often as the master repeats it.
    Command(Target<B>),
    /// No command for [`SlaveConfig::watchdog`](super::SlaveConfig::watchdog): stop what moves.
    Watchdog,
}
