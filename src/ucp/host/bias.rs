//! Where a host keeps the results of calibrations (ruling U11).

use core::{error::Error, fmt};

use crate::ucp::body::{ImuBias, MagBias};

/// Storage that the host provides for the robot, which has none of its own.
///
/// The robot asks at every boot (id 8) and sends new values after a calibration (ids 6 and 7). The
/// methods are called from [`handle_input`](crate::endpoint::Endpoint::handle_input), at most one
/// per received frame, and [`load`](Self::load) from
/// [`poll_transmit`](crate::endpoint::Endpoint::poll_transmit): a slow store should work on a copy
/// in memory.
///
/// ```
/// use axlewire::time::Instant;
/// use axlewire::ucp::message::{ImuBias, MagBias};
/// use axlewire::ucp::{Host, host::{BiasStore, HostConfig, NotStored}};
///
/// /// A robot whose IMU needs no biases.
/// struct OnlyMag(Option<MagBias>);
///
/// impl BiasStore for OnlyMag {
///     fn load(&mut self) -> (Option<ImuBias>, Option<MagBias>) {
///         (None, self.0) // the robot is then not answered: it needs both
///     }
///     fn store_imu(&mut self, _: ImuBias) -> Result<(), NotStored> {
///         Err(NotStored) // the robot sends it again
///     }
///     fn store_mag(&mut self, bias: MagBias) -> Result<(), NotStored> {
///         self.0 = Some(bias);
///         Ok(())
///     }
/// }
/// let now = Instant::from_micros(0);
/// let host = Host::with_store(HostConfig::default(), OnlyMag(None), now);
/// # let _ = host;
/// ```
pub trait BiasStore {
    /// Whether results that were stored without an error stay in the store; the default is `true`.
    /// `false` means that they are only passed on. A result is then acknowledged only when its
    /// event has found room, because the application will find it nowhere else (ruling U15).
    fn keeps(&self) -> bool {
        true
    }

    /// Stored result of each kind; `None` if there is none or it cannot be read. Called at the
    /// moment at which biases are sent, so that they are never outdated.
    fn load(&mut self) -> (Option<ImuBias>, Option<MagBias>);

    /// Stores the result of an IMU calibration, replacing the previous one.
    ///
    /// # Errors
    ///
    /// [`NotStored`]: the result is then not acknowledged, so the robot sends it again after a
    /// second.
    fn store_imu(&mut self, bias: ImuBias) -> Result<(), NotStored>;

    /// Stores the result of a magnetometer calibration, replacing the previous one.
    ///
    /// # Errors
    ///
    /// [`NotStored`]: the result is then not acknowledged, so the robot sends it again after a
    /// second.
    fn store_mag(&mut self, bias: MagBias) -> Result<(), NotStored>;
}

/// Error of a store that could not keep a value.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct NotStored;

impl fmt::Display for NotStored {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("the calibration result was not stored")
    }
}

impl Error for NotStored {}

/// Keeps biases while the program runs.
///
/// To keep them in a file or in flash, set the fields at start, and save them, or the values of the
/// events, after a calibration.
#[derive(Clone, Copy, Debug, Default, Eq, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct MemoryStore {
    /// Result of the last IMU calibration.
    pub imu: Option<ImuBias>,
    /// Result of the last magnetometer calibration.
    pub mag: Option<MagBias>,
}

impl BiasStore for MemoryStore {
    fn load(&mut self) -> (Option<ImuBias>, Option<MagBias>) {
        (self.imu, self.mag)
    }

    fn store_imu(&mut self, bias: ImuBias) -> Result<(), NotStored> {
        self.imu = Some(bias);
        Ok(())
    }

    fn store_mag(&mut self, bias: MagBias) -> Result<(), NotStored> {
        self.mag = Some(bias);
        Ok(())
    }
}

/// Keeps nothing: results reach the application only as events and are acknowledged when these have
/// found room, and the robot's request at boot is not answered.
#[derive(Clone, Copy, Debug, Default, Eq, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct NoStore;

impl BiasStore for NoStore {
    fn keeps(&self) -> bool {
        false
    }

    fn load(&mut self) -> (Option<ImuBias>, Option<MagBias>) {
        (None, None)
    }

    fn store_imu(&mut self, _: ImuBias) -> Result<(), NotStored> {
        Ok(())
    }

    fn store_mag(&mut self, _: MagBias) -> Result<(), NotStored> {
        Ok(())
    }
}

impl<S: BiasStore + ?Sized> BiasStore for &mut S {
    fn keeps(&self) -> bool {
        (**self).keeps()
    }

    fn load(&mut self) -> (Option<ImuBias>, Option<MagBias>) {
        (**self).load()
    }

    fn store_imu(&mut self, bias: ImuBias) -> Result<(), NotStored> {
        (**self).store_imu(bias)
    }

    fn store_mag(&mut self, bias: MagBias) -> Result<(), NotStored> {
        (**self).store_mag(bias)
    }
}
