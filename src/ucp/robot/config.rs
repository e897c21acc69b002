//! Settings of a robot.

use crate::{
    time::Duration,
    ucp::{header::BAUD, role::SHORTEST},
};

/// Settings of a [`Robot`](crate::ucp::Robot): start from [`direct`](Self::direct) or
/// [`usb_adapter`](Self::usb_adapter) and change what differs.
///
/// A period or timeout below 1 ms counts as 1 ms, because a driver would spin otherwise.
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
    /// Time without a valid command after which speed and turn become 0 (ruling U10); 500 ms.
    pub watchdog: Duration,
    /// Period of reports (ruling U10); 20 ms.
    pub report_period: Duration,
    /// Layout of a report (ruling U5); that of firmware 38.
    pub layout: ReportLayout,
    /// Period at which a calibration result is repeated until it is acknowledged (ruling U11);
    /// 1000 ms.
    pub result_period: Duration,
    /// Period of requests for biases, from the start until the biases arrive (ruling U11); 1000
    /// ms, `None` for no requests.
    pub bias_request_period: Option<Duration>,
    /// Pause that cuts off a frame, in addition to two byte times; 5 ms, longer than the pauses of
    /// a host with a USB adapter within a frame.
    pub idle_margin: Duration,
}

impl RobotConfig {
    /// The same settings, with periods and timeouts raised to what a driver can keep.
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

/// Same as [`direct`](RobotConfig::direct).
impl Default for RobotConfig {
    fn default() -> Self {
        Self::direct()
    }
}

impl RobotConfig {
    /// For a robot on a host, behind a USB adapter or an operating system, which may delay bytes by
    /// 16 ms.
    #[must_use]
    pub const fn usb_adapter() -> Self {
        Self { idle_margin: Duration::from_millis(20), ..Self::direct() }
    }

    /// For one of the processor's own UARTs. The host may have a USB adapter.
    #[must_use]
    pub const fn direct() -> Self {
        Self {
            baud: BAUD,
            watchdog: Duration::from_millis(500),
            report_period: Duration::from_millis(20),
            layout: ReportLayout::Firmware { version: 38 },
            result_period: Duration::from_secs(1),
            bias_request_period: Some(Duration::from_secs(1)),
            idle_margin: Duration::from_millis(5),
        }
    }
}

/// The two layouts of a report (ruling U5).
#[derive(Clone, Copy, Debug, Eq, Hash, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum ReportLayout {
    /// The layout that shipped robots send.
    Firmware {
        /// Version of the robot's firmware.
        version: u16,
    },
    /// The layout in the protocol document.
    Document,
}
