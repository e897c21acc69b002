//! The four roles without drivers, called in any order, with any settings.

use axlewire::{
    endpoint::{Endpoint, Unsent},
    ikeya::{
        Master, Mode, NodeId, Position, Rps, Slave, Target,
        board::{Board, OneMotor, ThreeMotors},
        master::MasterConfig,
        slave::{DipSwitch, IdReading, SlaveConfig},
    },
    ucp::{
        Host, MotorControl, Robot, Telemetry,
        host::{BiasStore, HostConfig, MemoryStore, NoStore},
        message::{CalibrationKind, ImuBias, MagBias, NetworkState, OtaStatus},
        robot::RobotConfig,
    },
};

use crate::{any, input, keep, now};

pub fn all() {
    master::<OneMotor>(Rps::ZERO, Position::default());
    master::<ThreeMotors>([Rps::ZERO; 3], [Position::default(); 3]);
    slave::<OneMotor>(Rps::ZERO, Position::default());
    slave::<ThreeMotors>([Rps::ZERO; 3], [Position::default(); 3]);
    host(NoStore);
    host(MemoryStore::default());
    robot();
}

#[inline(never)]
fn master<B: Board>(velocity: B::Velocity, position: B::Position) {
    let mut master = any(Master::<B>::for_board(any(MasterConfig::usb_adapter()), now()));
    while any(true) {
        let (node, now) = (any(NodeId::N1), now());
        match any(0) {
            0 => master.discover(now),
            1 => keep(master.set_velocity(node, any(velocity), now)),
            2 => keep(master.set_position(node, any(position), now)),
            3 => master.stop(node, now),
            4 => master.stop_all(now),
            5 => master.release(node),
            6 => keep(master.confirm(node, now)),
            7 => keep(master.read(node, now)),
            8 => keep((master.health(node), master.mode(node), master.status(node))),
            9 => keep((master.set_point(node), master.is_discovering(), master.stop_bound())),
            16 => keep(master.read_bound()),
            11 => {
                keep((master.stop_progress(node), master.stops_owed(), master.last_failure(node)))
            }
            12 => keep((master.is_set_point_sent(node), master.is_mode_in_doubt(node))),
            13 => keep((master.check(node, &Target::Velocity(any(velocity))), master.config())),
            14 => master.keep_alive(now),
            15 => keep((master.lost_events(), master.counters())),
            10 => {
                let statistics = master.node_statistics(node);
                keep((statistics.latency.min(), statistics.latency.max()));
                keep((statistics.latency.mean(), master.statistics()));
            }
            _ => turn(&mut master),
        }
    }
}

#[inline(never)]
fn slave<B: Board>(velocity: B::Velocity, position: B::Position) {
    let config = any(SlaveConfig::at(any(0)));
    if let Ok(dip) = DipSwitch::from_bits(any(0)) {
        keep(dip.node_id(any(IdReading::Value)));
    }
    let mut slave = any(Slave::<B>::for_board(any(NodeId::N1), any(Mode::Velocity), config, now()));
    while any(true) {
        match any(0) {
            0 => slave.set_velocity(any(velocity)),
            1 => slave.set_position(any(position)),
            2 => slave.set_mode(any(Mode::Position)),
            3 => keep((slave.node(), slave.mode(), slave.command(now()))),
            4 => keep((slave.statistics(), slave.counters())),
            _ => turn(&mut slave),
        }
    }
}

#[inline(never)]
fn host<S: BiasStore>(store: S) {
    let mut host = any(Host::with_store(any(HostConfig::default()), any(store), now()));
    while any(true) {
        let (now, kind) = (now(), any(CalibrationKind::Imu));
        match any(0) {
            0 => keep(host.drive(any(MotorControl::STOP), now)),
            1 => host.stop(now),
            2 => keep(host.set_network_state(any(NetworkState::Connected), now)),
            3 => keep(host.start_calibration(kind, now)),
            4 => keep(host.end_calibration(kind, now)),
            5 => keep(host.start_firmware_update(any(0), now)),
            6 => host.end_firmware_update(now),
            7 => keep((host.link(), host.last_report(), host.command(), host.lost_events())),
            8 => {
                let round_trip = host.statistics().round_trip;
                keep((round_trip.min(), round_trip.mean(), round_trip.max()));
            }
            9 => keep((host.statistics(), host.counters(), host.config().calibration_bound())),
            10 => keep(host.store_mut().load()),
            11 => keep((host.take_report(), host.is_stop_sent(), host.calibration_outcome())),
            12 => keep(host.stop_progress()),
            _ => turn(&mut host),
        }
    }
}

#[inline(never)]
fn robot() {
    let mut robot = any(Robot::new(any(RobotConfig::default()), now()));
    while any(true) {
        let now = now();
        match any(0) {
            0 => keep(robot.command(now)),
            1 => robot.set_telemetry(&any(Telemetry::default()), now),
            2 => robot.calibration_result_imu(ImuBias::new(any([0; 3]), any([0; 3])), now),
            3 => robot.calibration_result_mag(MagBias::new(any([0; 3])), now),
            4 => keep(robot.answer_update(any(OtaStatus::Forbidden), now)),
            5 => keep((robot.calibrating(), robot.lost_events(), robot.network_state())),
            7 => keep((robot.take_command(now), robot.abort_calibration())),
            6 => keep((robot.statistics(), robot.counters())),
            _ => turn(&mut robot),
        }
    }
}

/// Calls common to all roles.
fn turn(role: &mut impl Endpoint) {
    match any(0) {
        0 => role.handle_input(input(), now()),
        1 => role.handle_timeout(now()),
        2 => keep(role.poll_event()),
        3 => keep(role.poll_transmit(now())),
        4 => role.handle_transmit(any(Unsent::Untouched), now()),
        _ => keep(role.poll_timeout()),
    }
}
