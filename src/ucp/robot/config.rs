//! Robot settings.

use crate::{
    time::Duration,
    ucp::{header::BAUD, role::SHORTEST},
};

/// Settings of a [`Robot`](super::Robot): start from [`direct`](Self::direct) or
/// [`usb_adapter`](Self::usb_adapter) and change what differs.
///
/// A period or timeout under 1 ms counts as 1 ms, because a driver would spin otherwise.
///
/// ```
/// use axlewire::ucp::robot::{ReportLayout, RobotConfig};
/// let mut config = RobotConfig::default();
/// config.layout = ReportLayout::Firmware { version: 40 };
/// config.bias_request_period = None; // this robot keeps its biases itself
/// ```
#[derive(Clone, Copy, Debug, Eq, Hash, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub struct RobotConfig {
    /// Speed of the line, bit/s; 115,200.
    pub baud: u32,
    /// Speed and turn become 0 after this long without a valid command (ruling U10); 500 ms.
    pub watchdog: Duration,
    /// How often a report is sent (ruling U10); 20 ms.
    pub report_period: Duration,
    /// How a report is laid out (ruling U5); as firmware 38 does it.
    pub layout: ReportLayout,
    /// How often a calibration result is sent until it is acknowledged (ruling U11); 1000 ms.
    pub result_period: Duration,
    /// How often biases are asked for, from the first moment until they come (ruling U11); 1000 ms,
    /// `None` for never.
    pub bias_request_period: Option<Duration>,
    /// A frame is cut off by a pause of two byte times and this; 5 ms, which a host with a USB
    /// adapter does not make within a frame.
    pub idle_margin: Duration,
}

impl RobotConfig {
    /// The same with nothing shorter than a driver can keep.
    pub(super) fn sane(self) -> Self {
        Self {
            baud: self.baud,
            watchdog: self.watchdog.max(SHORTEST),
            report_period: self.report_period.max(SHORTEST),
            layout: self.layout,
            result_period: self.result_period.max(SHORTEST),
            bias_request_period: self.bias_request_period.map(|period| period.max(SHORTEST)),
            idle_margin: self.idle_margin,
        }
    }
}

/// [`direct`](RobotConfig::direct).
impl Default for RobotConfig {
    fn default() -> Self {
        Self::direct()
    }
}

impl RobotConfig {
    /// For a robot on a host, behind a USB adapter or an operating system, which may hold back bytes
    /// for 16 ms.
    #[must_use]
    pub const fn usb_adapter() -> Self {
        Self { idle_margin: Duration::from_millis(20), ..Self::direct() }
    }

    /// For a UART of the processor itself. The host may have a USB adapter.
    #[must_use]
    pub const fn direct() -> Self {
        Self {
            baud: BAUD,
            watchdog: Duration::from_millis(500),
            report_period: Duration::from_millis(20),
            layout: ReportLayout::Firmware { version: 38 },
            result_period: Duration::from_millis(1000),
            bias_request_period: Some(Duration::from_millis(1000)),
            idle_margin: Duration::from_millis(5),
        }
    }
}

/// The two layouts of a report (ruling U5).
#[derive(Clone, Copy, Debug, Eq, Hash, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum ReportLayout {
    /// What shipped robots send.
    Firmware {
        /// Version of the robot's firmware.
        version: u16,
    },
    /// What the protocol document prints.
    Document,
}
