//! What a master's user can set.

use crate::{ikeya::BAUD, time::Duration};

/// Settings of a [`Master`](super::Master): start from [`direct`](Self::direct) or
/// [`usb_adapter`](Self::usb_adapter) and change what differs.
///
/// ```
/// use axlewire::{ikeya::MasterConfig, time::Duration};
/// let mut config = MasterConfig::usb_adapter();
/// config.reply_timeout = Duration::from_millis(5); // an adapter with its latency timer set to 1 ms
/// ```
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub struct MasterConfig {
    /// Speed of the line, bit/s.
    pub baud: u32,
    /// How long an answer may take to begin, from the end of the request on the wire. The wire time
    /// of the answer is added (ruling I7).
    pub reply_timeout: Duration,
    /// How long a node that did not answer is not asked again, so that a late answer meets a closed
    /// window. Other nodes are asked meanwhile.
    pub late_guard: Duration,
    /// Silence kept behind a request or an answer before the next request, for transceivers that
    /// need it.
    pub turnaround_gap: Duration,
    /// How often a READ is tried before it is reported as failed (ruling I8); 0 counts as 1.
    pub attempts: u8,
    /// When nodes are read.
    pub polling: Polling,
    /// How much of the line's time abnormal nodes may cost while they are looked for, percent; 0
    /// never looks for them, and more than 50 counts as 50.
    pub recovery_share_pct: u8,
    /// Whether the line is a 2-wire one whose adapter hears its own bytes: they are then removed.
    pub removes_echo: bool,
}

/// When a master reads its nodes.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Polling {
    /// One after the other, as fast as the line allows.
    Fastest,
    /// Each node once in this time; its set-point is repeated as often.
    Every(Duration),
    /// Only when asked; a set-point is then sent when it is given and with each read.
    Manual,
}

impl MasterConfig {
    /// For a UART of the processor itself: 500 kbit/s, answers within 500 µs.
    #[must_use]
    pub const fn direct() -> Self {
        Self {
            baud: BAUD,
            reply_timeout: Duration::from_micros(500),
            late_guard: Duration::from_micros(500),
            turnaround_gap: Duration::ZERO,
            attempts: 3,
            polling: Polling::Fastest,
            recovery_share_pct: 5,
            removes_echo: false,
        }
    }

    /// For a USB adapter, which may hold back an answer for 16 ms: answers within 20 ms.
    #[must_use]
    pub const fn usb_adapter() -> Self {
        Self {
            reply_timeout: Duration::from_millis(20),
            late_guard: Duration::from_millis(20),
            ..Self::direct()
        }
    }
}

/// [`direct`](MasterConfig::direct).
impl Default for MasterConfig {
    fn default() -> Self {
        Self::direct()
    }
}
