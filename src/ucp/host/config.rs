//! Settings of a host.

use crate::{
    time::{Duration, wire_time},
    ucp::{body::CalibrationStart, frame::FrameOf, header::BAUD, role::SHORTEST},
};

/// Longest [`HostConfig::command_gap`]: half of the time that a driver gives a stop to leave.
const LONGEST_GAP: Duration = Duration::from_millis(50);

/// Settings of a [`Host`](crate::ucp::Host): start from [`direct`](Self::direct) or
/// [`usb_adapter`](Self::usb_adapter) and change what differs.
///
/// A period or timeout below 1 ms counts as 1 ms, because a driver would spin otherwise.
///
/// ```
/// use axlewire::{time::Duration, ucp::host::HostConfig};
/// let mut config = HostConfig::default();
/// config.ping_period = None; // the reports say enough
/// config.command_period = Duration::from_millis(40); // the robot's watchdog fires after 100 ms
/// config.link_timeout = Duration::from_millis(100);
/// ```
#[derive(Clone, Copy, Debug, Eq, Hash, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[non_exhaustive]
pub struct HostConfig {
    /// Speed of the line, bit/s; 115,200. Not less than it really is: a pause inside a frame would
    /// count as its time on the line.
    pub baud: u32,
    /// Period at which the latest motor command is repeated (ruling U10); 100 ms.
    pub command_period: Duration,
    /// Shortest pause between two different motor commands; 20 ms, a tenth of the line. Within it
    /// the latest wins. A command to stand still does not wait for it, but behind another one. At
    /// most 50 ms: a driver gives a stop 100 ms to leave.
    pub command_gap: Duration,
    /// Whether the first frame is a zero motor command, before any ping or answer (ruling U16);
    /// `true`.
    ///
    /// A vendor robot keeps driving while *any* byte arrives. A host that is restarted within
    /// 500 ms and only pings would keep it moving, so the host tells it to stand still at once,
    /// and again every 100 ms until the application drives. Set `false` for hosts that only
    /// listen: no motor command is sent before the first call, and the robot keeps following
    /// any other program.
    pub sends_first_stop: bool,
    /// Dead-man: after this much silence from the application the robot is told to stand still
    /// (ruling U10); 500 ms.
    pub dead_man: Duration,
    /// Period of pings; 200 ms, `None` for no pings.
    pub ping_period: Option<Duration>,
    /// Time after which a ping without a pong counts as lost; 500 ms. The next ping waits until
    /// then: a pong does not say which ping it answers.
    pub ping_timeout: Duration,
    /// Time without a valid frame after which the link is down and the robot is told to stand
    /// still (rulings U10 and U16); 500 ms. On a line on which the robot cannot answer, it is
    /// the time for which it is driven at all. Allow some report periods, and 10 ms for a driver
    /// that is held up.
    pub link_timeout: Duration,
    /// Time over which the robot averages the wheel speeds that it reports; 1100 ms, as the
    /// vendor's firmware: ten values, one each 100 ms. After a stop the robot is not seen to
    /// stand still before this time is over (ruling U16). Zero for a robot that reports what
    /// it measures; then a standstill may be seen before a damaged command has been repeated,
    /// as with any time below `command_period`, and a report of which a part arrived before the
    /// stop may count.
    pub rpm_average: Duration,
    /// Longest time for the acknowledgement of a calibration request, from the end of the request
    /// on the wire; 200 ms.
    pub ack_timeout: Duration,
    /// Number of times a calibration request is sent before it fails; 3, at least 1.
    pub attempts: u8,
    /// Pause that cuts off a frame, in addition to two byte times; 20 ms, because USB adapters and
    /// operating systems deliver bytes up to 16 ms late. On a bare UART 1 ms is enough.
    pub idle_margin: Duration,
    /// Whether to send no id in 5..=0x0A, for robots that hang on them (ruling U14); `false`.
    ///
    /// Firmware built from the vendor's main branch hangs forever on any such frame, the answer to
    /// its own boot request included. v6.38, which ships, does not. To recognise such a build: the
    /// first ping after the biases is never answered, and no more reports arrive.
    ///
    /// If set, calibration results are kept but not acknowledged, so the robot repeats them every
    /// 1000 ms. Its requests for biases are not answered, so its measurements are off; each is a
    /// [`HostEvent::BiasesNotAnswered`](super::HostEvent::BiasesNotAnswered).
    /// [`Host::set_network_state`](crate::ucp::Host::set_network_state) and
    /// [`Host::start_firmware_update`](crate::ucp::Host::start_firmware_update) are refused with
    /// [`CommandError::LowIdsOnly`](super::CommandError::LowIdsOnly).
    pub low_ids_only: bool,
}

impl HostConfig {
    /// Time within which a calibration request has been acknowledged or has failed, if the driver
    /// is called in time.
    #[must_use]
    pub fn calibration_bound(&self) -> Duration {
        self.sane().ack_wait().saturating_mul(self.attempts.max(1).into())
    }

    /// Time from the start of a calibration request to the end of the wait for its acknowledgement.
    pub(super) fn ack_wait(&self) -> Duration {
        wire_time(FrameOf::<CalibrationStart>::LEN, self.baud) + self.ack_timeout
    }

    /// The same settings, with periods and timeouts that a driver can keep.
    pub(super) fn sane(self) -> Self {
        Self {
            command_period: self.command_period.max(SHORTEST),
            command_gap: self.command_gap.clamp(SHORTEST, LONGEST_GAP),
            dead_man: self.dead_man.max(SHORTEST),
            ping_period: self.ping_period.map(|period| period.max(SHORTEST)),
            ping_timeout: self.ping_timeout.max(SHORTEST),
            link_timeout: self.link_timeout.max(SHORTEST),
            ack_timeout: self.ack_timeout.max(SHORTEST),
            ..self
        }
    }
}

/// Same as [`usb_adapter`](HostConfig::usb_adapter), which suits every host with an operating
/// system.
impl Default for HostConfig {
    fn default() -> Self {
        Self::usb_adapter()
    }
}

impl HostConfig {
    /// For one of the processor's own UARTs: a pause of little more than 1 ms cuts off a frame.
    #[must_use]
    pub const fn direct() -> Self {
        Self { idle_margin: Duration::from_millis(1), ..Self::usb_adapter() }
    }

    /// For a USB adapter or an operating system, which may delay bytes by 16 ms.
    #[must_use]
    pub const fn usb_adapter() -> Self {
        Self {
            baud: BAUD,
            command_period: Duration::from_millis(100),
            command_gap: Duration::from_millis(20),
            sends_first_stop: true,
            dead_man: Duration::from_millis(500),
            ping_period: Some(Duration::from_millis(200)),
            ping_timeout: Duration::from_millis(500),
            link_timeout: Duration::from_millis(500),
            rpm_average: Duration::from_millis(1100),
            ack_timeout: Duration::from_millis(200),
            attempts: 3,
            idle_margin: Duration::from_millis(20),
            low_ids_only: false,
        }
    }
}
