//! What the tests of the firmware use of the library.

pub(crate) use axlewire::{
    drive::{DriveError, Driver},
    encode::Encode,
    endpoint::{Arrival, Endpoint},
    ikeya::{
        Master, Mode, NodeId, Position, ReadRequest, Response, Rps, Target, ToMaster, WriteRequest,
        master::{Health, MasterConfig, MasterEvent, Polling},
        slave::{SlaveConfig, SlaveEvent},
    },
    sim::{MotorNode, Rng},
    stream::Frames,
    time::{Duration, Instant},
    ucp::{
        Body, MotorControl,
        host::{HostEvent, MemoryStore},
        message::{ImuBias, MagBias, Ping},
    },
};

pub(crate) use crate::{
    qemu::{Board, PATIENCE, Program, Report},
    slave::{NODE, packet, rps},
    wire::{Wire, WireClock},
};
