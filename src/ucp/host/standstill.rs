//! Whether the robot obeys a stop: what its reports show once the stop has been flushed (U16).

use core::fmt;

use crate::time::{Duration, Instant};

/// Time in which a rover is seen to stand still after its stop, 3 s: 2 s to coast, and one more
/// until the average that it reports shows it. `Driver::drive_for` waits that long.
pub const COAST: Duration = Duration::from_secs(3);

/// Number of reports in a row that must show all wheels still, 3: one alone may show wheels that
/// are just reversing.
pub const STILL_REPORTS: u8 = 3;

/// Shortest time between two reports of a robot: vendor robots report every 20 ms.
const SHORTEST_PERIOD: Duration = Duration::from_millis(16);

/// How much later than another a report may arrive, without the line having been lost.
const JITTER: Duration = Duration::from_millis(100);

/// Fastest turn of a wheel that stands still, rpm.
const STILL_RPM: u16 = 2;

/// Progress of a stop, see [`Host::stop_progress`](crate::ucp::Host::stop_progress).
#[derive(Clone, Copy, Debug, Eq, Hash, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum StopProgress {
    /// The latest command, if any, is to move, however slowly.
    NotAsked,
    /// The stop has not been flushed yet, or not as often as needed.
    Due,
    /// The stop has been flushed, and no report has arrived since, or none within the
    /// [link timeout](super::HostConfig::link_timeout). **The robot may be moving.**
    NoReports,
    /// Reports have arrived since, but the latest three do not all show every wheel at standstill,
    /// or are averages that may not show yet how the wheels turn
    /// ([`HostConfig::rpm_average`](super::HostConfig::rpm_average)). **The robot may be moving.**
    StillMoving {
        /// The wheel speeds of the latest report, rpm.
        rpm: [i16; 4],
    },
    /// The latest three reports, all received since, show every wheel at 2 rpm or less, and the
    /// last of them is an average of the time since. If the robot may have restarted since (the
    /// index of its reports does not go on, or they paused for the link timeout), it is one of
    /// [`COAST`] later: a vendor robot then reports 0 until its next move.
    StandingStill,
}

impl fmt::Display for StopProgress {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NotAsked => f.write_str("it was not told to stop"),
            Self::Due => f.write_str("the stop has not been sent yet"),
            Self::NoReports => f.write_str("it was told to stop, but sends no reports"),
            Self::StillMoving { rpm } if are_still(rpm) => {
                f.write_str("it was told to stop, but its reports do not show a standstill yet")
            }
            Self::StillMoving { rpm: [front_left, front_right, back_left, back_right] } => write!(
                f,
                "it was told to stop, but its wheels turn, at {front_left}, {front_right}, \
                 {back_left} and {back_right} rpm"
            ),
            Self::StandingStill => f.write_str("it stands still"),
        }
    }
}

/// The watch over the wheels of a robot that has been told to stand still.
#[derive(Clone, Copy, Debug)]
pub(super) enum Standstill {
    /// Nothing counts yet: the stop has not been flushed.
    Untold,
    /// The stop was flushed at this time: reports that begin later count.
    Told(Instant),
    /// The latest report that counts, how many in a row have shown a standstill, and until when
    /// this says something.
    Reported { told: Instant, rpm: [i16; 4], still: u8, until: Instant },
}

/// A report.
pub(super) struct Wheels {
    pub(super) rpm: [i16; 4],
    /// When it arrived.
    pub(super) at: Instant,
    /// Time that it took on the line.
    pub(super) on_line: Duration,
    /// Time of which its speeds are the average.
    pub(super) average: Duration,
    /// From when on it shows a standstill: the wheels may coast until then, and show 0.
    pub(super) shows_from: Instant,
    /// When it no longer says anything.
    pub(super) until: Instant,
}

/// Whether a robot may have restarted in this pause between two reports: the index goes back, or on
/// by more than the pause holds. A restart within a second is not seen if the index happens to go
/// on as if nothing had been, in one of five to one of ten.
pub(super) fn may_be_a_restart(pause: Duration, steps: u8) -> bool {
    SHORTEST_PERIOD.saturating_mul(steps.into()) > pause + JITTER
}

/// Whether all wheels stand still: turning on the spot is also motion.
pub(super) fn are_still(rpm: &[i16; 4]) -> bool {
    rpm.iter().all(|wheel| wheel.unsigned_abs() <= STILL_RPM)
}

impl Standstill {
    pub(super) const fn is_untold(&self) -> bool {
        matches!(self, Self::Untold)
    }

    /// The stop has been flushed.
    pub(super) const fn tell(&mut self, now: Instant) {
        *self = Self::Told(now);
    }

    /// Takes in a report.
    pub(super) fn report(&mut self, wheels: &Wheels) {
        let (told, before) = match *self {
            Self::Told(told) if wheels.at - told >= wheels.on_line => (told, 0),
            Self::Reported { until, .. } if until <= wheels.at => (wheels.at, 0),
            Self::Reported { told, still, .. } => (told, still),
            _ => return,
        };
        // An average from before the stop may not show yet that the wheels turn.
        let is_settled =
            wheels.at - told >= wheels.average + wheels.on_line && wheels.at >= wheels.shows_from;
        let most = if is_settled { STILL_REPORTS } else { STILL_REPORTS - 1 };
        let still = if are_still(&wheels.rpm) { before.saturating_add(1).min(most) } else { 0 };
        *self = Self::Reported { told, rpm: wheels.rpm, still, until: wheels.until };
    }

    /// Forgets the reports once there have been none for too long.
    pub(super) fn expire(&mut self, now: Instant) {
        match *self {
            Self::Reported { until, .. } if until <= now => *self = Self::Told(now),
            _ => {}
        }
    }

    /// Reports may wait in the port: those read so far are not the latest.
    pub(super) const fn doubt(&mut self) {
        if let Self::Reported { still, .. } = self {
            *still = 0;
        }
    }

    pub(super) const fn progress(&self) -> StopProgress {
        match *self {
            Self::Untold => StopProgress::Due,
            Self::Told(_) => StopProgress::NoReports,
            Self::Reported { still: STILL_REPORTS, .. } => StopProgress::StandingStill,
            Self::Reported { rpm, .. } => StopProgress::StillMoving { rpm },
        }
    }
}
