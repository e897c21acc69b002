//! Which traits public types have, by kind: the table is in CONTRIBUTING.md.
#![cfg(all(feature = "ikeya", feature = "ucp", feature = "sim"))]
#![cfg(all(feature = "serialport", feature = "embedded-io-async"))]
#![allow(unused_qualifications, reason = "two modules have the same names")]

use std::{error::Error, fmt, hash::Hash};

use axlewire::{
    drive::{self, *},
    endpoint::*,
    error::*,
    fields::*,
    ikeya::{
        self,
        board::{self, *},
        master::*,
        slave::*,
        three, *,
    },
    io::{self, FrameReader, FrameWriter, WriteError},
    sim,
    stats::Latency,
    stream::{self, *},
    time::{Duration, Instant, Wrapping32},
    ucp::{self, host::*, message::*, robot::*, *},
};

#[cfg(feature = "defmt")]
use defmt::Format;

/// Without the feature, everything has it.
#[cfg(not(feature = "defmt"))]
trait Format {}
#[cfg(not(feature = "defmt"))]
impl<T: ?Sized> Format for T {}

/// Checks at compile time that these types have these traits, and lists their names.
macro_rules! kinds {
    ($($name:ident: $($bound:path),+ => $($ty:ty),+;)+) => {
        $(#[allow(dead_code, reason = "it need only compile")]
        fn $name() {
            fn has<T: $($bound +)+ ?Sized>() {}
            $(has::<$ty>();)+
        })+
        const LISTED: &[&str] = &[$($(stringify!($ty)),+),+];
    };
}

kinds! {
    values: fmt::Debug, Format, Copy, PartialEq, Eq, Hash, Send, Sync =>
        Arrival, Transmit, Unsent, ikeya::Mode, ikeya::NodeId, ikeya::Position, DipSwitch,
        IdReading, NodeSet, Cause, Health, ikeya::master::StopProgress, ucp::host::StopProgress,
        CalibrationKind, CalibrationStep, ErrorCode, NetworkState, OtaStatus, FailureCause, Link,
        MessageId, ReportLayout, UpdateSource, Reason, Duration, Instant;
    numbers: fmt::Debug, Format, Copy, PartialEq, Send, Sync =>
        Rps, Telemetry, ikeya::Status<OneMotor>, board::Status<OneMotor>, ikeya::Target<OneMotor>,
        board::Target<OneMotor>, Polling, Verdict, Gap, Counters,
        Latency, LineRules, Operation, ReceivedReport, CalibrationFailure, Schedule;
    events: fmt::Debug, Format, Clone, PartialEq, Send, Sync =>
        MasterEvent, SlaveEvent, HostEvent, RobotEvent, UnknownFrame;
    settings: fmt::Debug, Format, Copy, PartialEq, Default, Send, Sync =>
        MasterConfig, SlaveConfig, HostConfig, RobotConfig;
    statistics: fmt::Debug, Format, Copy, PartialEq, Default, Send, Sync =>
        MasterStatistics, NodeStatistics, SlaveStatistics, HostStatistics, RobotStatistics;
    errors: fmt::Debug, Format, fmt::Display, Error, Clone, PartialEq, Send, Sync =>
        EncodeError, ParseError, ikeya::master::CommandError, ucp::host::CommandError, NotStored,
        DriveError<NotStored>, Rs485Error<NotStored, NotStored>, WriteError<NotStored>;
    packets: fmt::Debug, Format, Copy, PartialEq, Send, Sync =>
        ikeya::ReadRequest, ikeya::WriteRequest, ikeya::VelocityResponse, ikeya::PositionResponse,
        three::ReadRequest, three::WriteRequest, three::VelocityResponse, three::PositionResponse,
        Ping, Pong, MotorControl, RawMotorControl, CalibrationStart, CalibrationStartAck,
        CalibrationEnd, CalibrationEndAck, DocumentReport, FirmwareReport, ImuBias, ImuBiasAck,
        MagBias, MagBiasAck, Biases, BiasRequest, OtaRequest, RawOtaRequest, OtaAck,
        SetNetworkState, SetNetworkStateWide, Header, FrameOf<Ping>;
    views: fmt::Debug, Format, Copy, PartialEq, Send, Sync =>
        ikeya::Packet<'static>, ikeya::Request<'static>, ikeya::Response<'static>,
        three::Packet<'static>, three::Request<'static>, three::Response<'static>,
        ucp::Message<'static>, ucp::message::Message<'static>, Report<'static>, RawFrame<'static>, RelayedFrame<'static>,
        stream::Event<&'static ucp::Frame>;
    printers: fmt::Debug, fmt::Display =>
        ikeya::Contents, ucp::Contents<'static>, ucp::Frame;
    markers: fmt::Debug, Copy =>
        OneMotor, ThreeMotors, ToSlave, ToMaster, BothDirections, three::ToSlave, three::ToMaster,
        three::BothDirections, Ucp, NoStore, MemoryStore;
    described: fmt::Debug, Copy => Field, Kind, Shape, Record;
    simulated: fmt::Debug, Copy, PartialEq, Send, Sync =>
        sim::Direction, sim::Who, sim::Faults, sim::Input, sim::Timing, sim::PairStatistics,
        sim::Stuck;
    machines: fmt::Debug, Clone =>
        Master, Slave, Host, Robot, stream::Decoder<Ucp, 64>, Frames<'static, Ucp>, stream::Echo,
        Parts<'static, Ucp>, Wrapping32, StdClock, sim::Motor, sim::MotorNode, sim::Rover,
        sim::RoverNode, sim::Rng;
    ports: fmt::Debug =>
        Driver<Host, (), StdClock>, drive::asynch::Driver<Host, (), StdClock>, Bus, drive::Rover,
        SerialPort, Rs485<(), ()>, NoDelay, WithDelay<StdClock, ()>, WithoutEcho<()>,
        io::asynch::FrameReader<(), Ucp, 64>, io::asynch::FrameWriter<(), 64>,
        FrameReader<(), Ucp, 64>, FrameWriter<(), 64>, sim::Line<Master, sim::MotorNode>,
        sim::Traced, sim::Wire;
}

#[test]
fn every_public_type_has_the_traits_of_its_kind() {
    let last = |path: &str| {
        let path = path.split('<').next().unwrap().trim();
        path.rsplit("::").next().unwrap().trim().to_owned()
    };
    let mut listed: Vec<String> = LISTED.iter().map(|name| last(name)).collect();
    let mut public: Vec<String> = include_str!("../api.txt")
        .lines()
        .filter_map(|line| {
            let (_, name) = line.split_once("pub struct ").or(line.split_once("pub enum "))?;
            Some(last(name.split(['(', ' ']).next()?))
        })
        // Made by derives, or behind a feature that this test does without.
        .filter(|name| !name.ends_with("Bits") && !name.starts_with("Tokio"))
        .collect();
    // A name as often as there are types of it.
    listed.retain(|name| match public.iter().position(|other| other == name) {
        Some(at) => public.swap_remove(at) != *name,
        None => true,
    });
    assert_eq!((public, listed), (vec![], vec![]), "not listed, not public");
}
