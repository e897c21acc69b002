//! What the scenarios use of the library.
pub(crate) use axlewire::{
    endpoint::{Arrival, Endpoint, Transmit, Unsent},
    ikeya::{
        Mode, NodeId, Position, ReadRequest, Rps, Slave,
        board::{Target, ThreeMotors},
        slave::{DipSwitch, IdReading, SlaveConfig, SlaveEvent},
    },
    time::{Duration, Instant},
};

pub(crate) use crate::packets::*;
