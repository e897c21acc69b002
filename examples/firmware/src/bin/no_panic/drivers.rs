//! Drivers, the driver-enable pin, frame readers and writers, over a port and a pin that may fail
//! at any call, and a port that may report more bytes than requested.

use axlewire::{
    drive::{Driver, Rs485},
    endpoint::Endpoint,
    ikeya::{
        self, Master, Mode, NodeId, Position, Rps, Slave,
        board::{Board, OneMotor, ThreeMotors},
        master::MasterConfig,
        slave::SlaveConfig,
    },
    io::{FrameReader, FrameWriter},
    stream::Framing,
    time::Instant,
    ucp::{
        Host, RawFrame, Robot, Ucp,
        host::{HostConfig, MemoryStore},
        message::CalibrationKind,
        robot::RobotConfig,
    },
};
use embedded_hal::{
    delay::DelayNs,
    digital::{self, OutputPin},
};
use embedded_io::{ErrorKind, ErrorType, Read, ReadReady, Write};

use crate::{any, duration, input, keep, now};

pub fn all() {
    master::<OneMotor>(Rps::ZERO, Position::default());
    master::<ThreeMotors>([Rps::ZERO; 3], [Position::default(); 3]);
    slave::<OneMotor>();
    slave::<ThreeMotors>();
    host();
    robot();
    directed();
    reader::<ikeya::ToMaster, 8>();
    reader::<Ucp, 64>();
    writer();
}

/// A port with arbitrary behaviour.
struct Port;

impl ErrorType for Port {
    type Error = ErrorKind;
}

impl Read for Port {
    fn read(&mut self, buffer: &mut [u8]) -> Result<usize, ErrorKind> {
        any(buffer).fill(any(0));
        any(Ok(0))
    }
}

impl ReadReady for Port {
    fn read_ready(&mut self) -> Result<bool, ErrorKind> {
        any(Ok(true))
    }
}

impl Write for Port {
    fn write(&mut self, bytes: &[u8]) -> Result<usize, ErrorKind> {
        keep(bytes);
        any(Ok(0))
    }

    fn flush(&mut self) -> Result<(), ErrorKind> {
        any(Ok(()))
    }
}

/// A pin that may fail.
struct Pin;

impl digital::ErrorType for Pin {
    type Error = digital::ErrorKind;
}

impl OutputPin for Pin {
    fn set_high(&mut self) -> Result<(), digital::ErrorKind> {
        any(Ok(()))
    }

    fn set_low(&mut self) -> Result<(), digital::ErrorKind> {
        any(Ok(()))
    }
}

struct Delay;

impl DelayNs for Delay {
    fn delay_ns(&mut self, ns: u32) {
        keep(ns);
    }
}

/// Calls common to all drivers.
fn turn<R: Endpoint>(driver: &mut Driver<R, Port, fn() -> Instant>) {
    match any(0) {
        0 => keep(driver.service()),
        1 => keep(driver.next_event(duration())),
        2 => keep(driver.run_for(duration(), |_, event, _| keep(event))),
        3 => keep(driver.poll_event()),
        4 => keep((driver.poll_timeout(), driver.now())),
        5 => keep(driver.unsent()),
        _ => keep(driver.discard()),
    }
}

fn driver<R: Endpoint>(role: R) -> Driver<R, Port, fn() -> Instant> {
    any(Driver::new(role, Port, now))
}

#[inline(never)]
fn master<B: Board>(velocity: B::Velocity, position: B::Position) {
    let mut driver = driver(Master::<B>::for_board(any(MasterConfig::direct()), now()));
    while any(true) {
        let node = any(NodeId::N1);
        match any(0) {
            0 => keep(driver.discover()),
            1 => keep(driver.set_velocity(node, any(velocity))),
            2 => keep(driver.set_position(node, any(position))),
            3 => keep(driver.stop(node)),
            4 => keep(driver.stop_all()),
            5 => keep(driver.read(node)),
            6 => keep(driver.drive_for(node, any(velocity), duration())),
            _ => turn(&mut driver),
        }
    }
}

#[inline(never)]
fn slave<B: Board>() {
    let config = any(SlaveConfig::direct());
    let mut driver = driver(Slave::<B>::for_board(
        any(NodeId::N1),
        any(Mode::Velocity),
        config,
        Instant::from_micros(0),
    ));
    while any(true) {
        match any(0) {
            0 => keep(driver.next_command(duration())),
            _ => turn(&mut driver),
        }
    }
}

#[inline(never)]
fn host() {
    let store = any(MemoryStore::default());
    let mut driver = driver(Host::with_store(any(HostConfig::default()), store, now()));
    while any(true) {
        let kind = any(CalibrationKind::Imu);
        match any(0) {
            0 => keep(driver.ping(duration())),
            1 => keep(driver.drive(any(0), any(0))),
            2 => keep(driver.stop()),
            3 => keep(driver.next_report(duration())),
            4 => keep(driver.start_calibration(kind, duration())),
            5 => keep(driver.end_calibration(kind, duration())),
            6 => keep(driver.drive_for(any(0), any(0), duration())),
            7 => keep(driver.await_standstill(duration())),
            _ => turn(&mut driver),
        }
    }
}

#[inline(never)]
fn robot() {
    let mut driver = driver(Robot::new(any(RobotConfig::default()), now()));
    while any(true) {
        match any(0) {
            0 => keep(driver.next_command(duration())),
            _ => turn(&mut driver),
        }
    }
}

#[inline(never)]
fn directed() {
    let Ok(port) = Rs485::with_delays(Port, Pin, Delay, duration(), duration()) else { return };
    let mut port = any(port);
    while any(true) {
        match any(0) {
            0 => keep(port.write(input())),
            1 => keep(port.flush()),
            2 => keep(port.read(any(&mut []))),
            3 => keep(port.read_ready()),
            4 => keep(port.release()),
            _ => keep(port.is_on()),
        }
    }
}

#[inline(never)]
fn reader<F: Framing, const N: usize>() {
    let mut reader = any(FrameReader::<Port, F, N>::new(Port));
    while any(true) {
        match any(0) {
            0 => keep(reader.read_event()),
            1 => reader.idle(),
            _ => keep((reader.pending(), reader.decoder().counters())),
        }
    }
}

#[inline(never)]
fn writer() {
    let mut writer = any(FrameWriter::<Port, 64>::new(Port));
    while any(true) {
        let frame = RawFrame { id: any(0), index: any(0), body: input() };
        match any(0) {
            0 => keep(writer.write(&frame)),
            1 => keep(writer.queue(&frame)),
            2 => keep(writer.flush()),
            3 => keep(writer.discard()),
            _ => keep(writer.unsent()),
        }
    }
}
