//! What the models use of the library, and of their frame.

pub(crate) use axlewire::{
    drive::{DriveError, Driver, Rs485, asynch},
    endpoint::{Arrival, Endpoint, Unsent},
    ikeya::{
        Master, Mode, NodeId, Position, Rps, Target, VelocityResponse,
        board::{OneMotor, ThreeMotors},
        master::{Health, MasterConfig, Polling},
    },
    stream::Counters,
    time::{Duration, Instant, wire_time},
    ucp::{
        Frame, Host, Message, MotorControl, Robot, Telemetry,
        host::{CalibrationStep, HostConfig, HostEvent},
        message::{CalibrationKind, ErrorCode, ImuBias, MagBias, NetworkState, OtaStatus, Pong},
        robot::{RobotConfig, RobotEvent},
    },
};

pub(crate) use crate::{
    fingerprint::Merge,
    kit::Kit,
    run::{Depth, Run},
    search::World,
    sleep::check_sleep,
    ucp::{Checked, Feed, bytes, check_kept, damaged, halted, imu, mag, merge, ms, queue, unknown},
};
