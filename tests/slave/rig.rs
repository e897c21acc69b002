//! What the scenarios use of the library.
pub(crate) use axlewire::{
    endpoint::{Arrival, Endpoint, Transmit, Unsent},
    ikeya::{
        BAUD, Mode, NodeId, Position, ReadRequest, Rps, Slave,
        board::{Target, ThreeMotors},
        slave::{DipSwitch, IdReading, SlaveConfig, SlaveEvent},
        three,
    },
    time::{Duration, Instant, wire_time},
};

pub(crate) use crate::packets::*;
