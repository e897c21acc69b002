//! Where a host keeps what calibrations have found (ruling U11).

use core::{error::Error, fmt};

use crate::ucp::body::{ImuBias, MagBias};

/// What the host keeps for the robot, which has no memory of its own.
///
/// The robot asks at every boot (id 8) and sends new values after a calibration (ids 6 and 7). The
/// calls are made from [`handle_input`](crate::endpoint::Endpoint::handle_input), at most one per
/// received frame, and [`load`](Self::load) from
/// [`poll_transmit`](crate::endpoint::Endpoint::poll_transmit): a store that takes its time is
/// better filled from a copy in memory.
pub trait BiasStore {
    /// Does a result that was taken without an error stay here? `false` if it is only passed on:
    /// then it is acknowledged only when its event has found room, because the application will
    /// find it nowhere else (ruling U15). As provided, `true`.
    fn keeps(&self) -> bool {
        true
    }

    /// What is kept of each kind; `None` if there is nothing, or it cannot be read. Read at the
    /// moment at which biases are sent, so that they are never superseded ones.
    fn load(&mut self) -> (Option<ImuBias>, Option<MagBias>);

    /// Keeps the result of an IMU calibration in place of the one before.
    ///
    /// # Errors
    ///
    /// [`NotStored`]: the result is then not acknowledged, so that the robot sends it again in a
    /// second.
    fn store_imu(&mut self, bias: ImuBias) -> Result<(), NotStored>;

    /// Keeps the result of a magnetometer calibration in place of the one before.
    ///
    /// # Errors
    ///
    /// [`NotStored`]: the result is then not acknowledged, so that the robot sends it again in a
    /// second.
    fn store_mag(&mut self, bias: MagBias) -> Result<(), NotStored>;
}

/// A store could not keep a value.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct NotStored;

impl fmt::Display for NotStored {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("the calibration result was not stored")
    }
}

impl Error for NotStored {}

/// Keeps biases as long as the program runs.
///
/// What an application keeps in a file or in flash it puts into the fields at start and takes out
/// of them, or of the events, after a calibration.
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

/// Keeps nothing: results reach the application as events alone, are acknowledged when these have
/// found room, and the robot's request at boot stays unanswered.
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
