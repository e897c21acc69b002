//! A store of biases that fails on request.

use crate::names::*;
use axlewire::ucp::host::{BiasStore, NotStored};

#[derive(Clone, Debug, Default)]
pub(crate) struct Shelf {
    pub(crate) imu: Option<ImuBias>,
    pub(crate) mag: Option<MagBias>,
    /// It only passes results on.
    pub(crate) is_open: bool,
    pub(crate) fails: bool,
}

impl BiasStore for Shelf {
    fn keeps(&self) -> bool {
        !self.is_open
    }

    fn load(&mut self) -> (Option<ImuBias>, Option<MagBias>) {
        (self.imu, self.mag)
    }

    fn store_imu(&mut self, bias: ImuBias) -> Result<(), NotStored> {
        if self.fails {
            return Err(NotStored);
        }
        self.imu = Some(bias).filter(|_| !self.is_open);
        Ok(())
    }

    fn store_mag(&mut self, bias: MagBias) -> Result<(), NotStored> {
        if self.fails {
            return Err(NotStored);
        }
        self.mag = Some(bias).filter(|_| !self.is_open);
        Ok(())
    }
}
