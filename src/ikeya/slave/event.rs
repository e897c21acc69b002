//! Events of a slave.

use crate::ikeya::board::{Board, OneMotor, Target};

/// An event of a slave.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub enum SlaveEvent<B: Board = OneMotor> {
    /// A command for this node, in its mode; sent again whenever the master repeats it.
    Command(Target<B>),
    /// No command for [`SlaveConfig::watchdog`](super::SlaveConfig::watchdog): stop all motion.
    Watchdog,
}
