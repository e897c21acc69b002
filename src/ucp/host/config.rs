//! Host settings.

use crate::{
    time::{Duration, wire_time},
    ucp::{body::CalibrationStart, frame::FrameOf, header::BAUD, role::SHORTEST},
};

/// Settings of a [`Host`](super::Host): start from [`direct`](Self::direct) or
/// [`usb_adapter`](Self::usb_adapter) and change what differs.
///
/// A period or timeout under 1 ms counts as 1 ms, because a driver would spin otherwise.
///
/// ```
/// use axlewire::ucp::host::HostConfig;
/// let mut config = HostConfig::default();
/// config.ping_period = None; // the reports say enough
/// ```
#[derive(Clone, Copy, Debug, Eq, Hash, PartialEq)]
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
    /// Begins with a zero motor command, before any ping or answer (ruling U16); `true`.
    ///
    /// A vendor robot keeps driving while *any* byte arrives. A host that is restarted within 500
    /// ms and only pings would keep it moving, so it is told to stand still at once, and again
    /// every 100 ms until the application drives. `false` is for hosts that only listen: no motor
    /// command goes out before the first call, and what another program has told the robot goes on.
    pub sends_first_stop: bool,
    /// Dead-man: after this much silence of the application the robot is told to stand still
    /// (ruling U10); 500 ms.
    pub dead_man: Duration,
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
    pub idle_margin: Duration,
    /// Never sends an id in 5..=0x0A, for robots that hang on them (ruling U14); `false`.
    ///
    /// Firmware built from the vendor's main branch hangs for ever on any such frame, the answer to
    /// its own boot request included. v6.38, which ships, does not. To recognise such a build: the
    /// first ping after the biases is never answered, and no report comes any more.
    ///
    /// With it set, calibration results are kept but not acknowledged, so the robot repeats them
    /// every 1000 ms. Its request for biases is not answered, and each is a
    /// [`HostEvent::BiasesNotAnswered`](super::HostEvent::BiasesNotAnswered): its measurements are
    /// off. [`Host::set_network_state`](super::Host::set_network_state) and
    /// [`Host::start_firmware_update`](super::Host::start_firmware_update) are refused with
    /// [`CommandError::LowIdsOnly`](super::CommandError::LowIdsOnly).
    pub low_ids_only: bool,
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
            command_period: self.command_period.max(SHORTEST),
            command_gap: self.command_gap.max(SHORTEST),
            dead_man: self.dead_man.max(SHORTEST),
            ping_period: self.ping_period.map(|period| period.max(SHORTEST)),
            ping_timeout: self.ping_timeout.max(SHORTEST),
            link_timeout: self.link_timeout.max(SHORTEST),
            ack_timeout: self.ack_timeout.max(SHORTEST),
            ..self
        }
    }
}

/// [`usb_adapter`](HostConfig::usb_adapter), which suits every host with an operating system.
impl Default for HostConfig {
    fn default() -> Self {
        Self::usb_adapter()
    }
}

impl HostConfig {
    /// For a UART of the processor itself: a frame is cut off by a pause of little more than 1 ms.
    #[must_use]
    pub const fn direct() -> Self {
        Self { idle_margin: Duration::from_millis(1), ..Self::usb_adapter() }
    }

    /// For a USB adapter or an operating system, which may hold back bytes for 16 ms.
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
            ack_timeout: Duration::from_millis(200),
            attempts: 3,
            idle_margin: Duration::from_millis(20),
            low_ids_only: false,
        }
    }
}
