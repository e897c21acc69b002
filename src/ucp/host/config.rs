//! What a host can be told to do differently.

use crate::{
    time::{Duration, wire_time},
    ucp::{BAUD, CalibrationStart, FrameOf, role::SHORTEST},
};

/// Periods and timeouts of a [`Host`](super::Host).
///
/// Take the default and change what has to be different. A period or timeout under 1 ms counts as
/// 1 ms, because a driver would spin otherwise.
///
/// ```
/// use axlewire::ucp::HostConfig;
/// let mut config = HostConfig::default();
/// config.ping_period = None; // the reports say enough
/// ```
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub struct HostConfig {
    /// Speed of the line, bit/s; 115,200.
    pub baud: u32,
    /// How often the latest motor command is sent (ruling U10); 100 ms.
    pub command_period: Duration,
    /// Shortest pause between two motor commands that differ; 20 ms, a tenth of the line. In
    /// between the latest wins. A command to stand still does not wait for it.
    pub command_gap: Duration,
    /// Dead-man: after this much silence of the application the robot is told to stand still
    /// (ruling U10); 500 ms.
    pub command_timeout: Duration,
    /// How often a ping is sent; 200 ms, `None` for never.
    pub ping_period: Option<Duration>,
    /// How long a pong may take before the ping counts as lost; 500 ms. The next ping waits for it:
    /// pongs do not say which ping they answer.
    pub ping_timeout: Duration,
    /// The link is down after this long without a valid frame (ruling U10); 500 ms.
    pub link_timeout: Duration,
    /// How long the acknowledgement of a calibration request may take, from the end of the request
    /// on the wire; 200 ms.
    pub ack_timeout: Duration,
    /// How often a calibration request is sent before it has failed; 3, at least 1.
    pub attempts: u8,
    /// A frame is cut off by a pause of two byte times and this; 20 ms, because USB adapters and
    /// operating systems hand in bytes up to 16 ms late. On a bare UART 1 ms will do.
    pub quiet_margin: Duration,
}

impl HostConfig {
    /// A calibration request has been acknowledged or has failed this long after it was sent, if
    /// the driver is in time.
    #[must_use]
    pub fn calibration_bound(&self) -> Duration {
        self.sane().ack_wait().saturating_mul(self.attempts.max(1).into())
    }

    /// From the start of a calibration request to the end of the wait for its acknowledgement.
    pub(super) fn ack_wait(&self) -> Duration {
        wire_time(FrameOf::<CalibrationStart>::LEN, self.baud) + self.ack_timeout
    }

    /// The same with nothing shorter than a driver can keep.
    pub(super) fn sane(self) -> Self {
        Self {
            baud: self.baud,
            command_period: self.command_period.max(SHORTEST),
            command_gap: self.command_gap.max(SHORTEST),
            command_timeout: self.command_timeout.max(SHORTEST),
            ping_period: self.ping_period.map(|period| period.max(SHORTEST)),
            ping_timeout: self.ping_timeout.max(SHORTEST),
            link_timeout: self.link_timeout.max(SHORTEST),
            ack_timeout: self.ack_timeout.max(SHORTEST),
            attempts: self.attempts.max(1),
            quiet_margin: self.quiet_margin,
        }
    }
}

impl Default for HostConfig {
    fn default() -> Self {
        Self {
            baud: BAUD,
            command_period: Duration::from_millis(100),
            command_gap: Duration::from_millis(20),
            command_timeout: Duration::from_millis(500),
            ping_period: Some(Duration::from_millis(200)),
            ping_timeout: Duration::from_millis(500),
            link_timeout: Duration::from_millis(500),
            ack_timeout: Duration::from_millis(200),
            attempts: 3,
            quiet_margin: Duration::from_millis(20),
        }
    }
}
