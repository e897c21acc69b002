//! Checksums, numbers, packets and frames.

use axlewire::{
    crc16,
    encode::Encode,
    ikeya::{
        Mode, NodeId, Position, PositionResponse, ReadRequest, Rps, VelocityResponse, WriteRequest,
        board::ThreeMotors,
        master::Schedule,
        slave::{DipSwitch, IdReading},
        three,
    },
    time::{Duration, Wrapping32, wire_time},
    ucp::{
        Body, Frame, Message, MessageId, MotorControl, RawFrame, Telemetry,
        message::{
            BiasRequest, Biases, CalibrationEnd, CalibrationEndAck, CalibrationKind,
            CalibrationStart, CalibrationStartAck, DocumentReport, ErrorCode, FirmwareReport,
            ImuBias, ImuBiasAck, MagBias, MagBiasAck, NetworkState, OtaAck, OtaRequest, OtaStatus,
            Ping, Pong, Report, SetNetworkState,
        },
    },
};

use crate::{any, duration, input, keep, now, room};

pub fn all() {
    keep(crc16::check(input()));
    keep(crc16::compute(input()));
    times();
    units();
    ikeya_packets();
    three_motor_packets();
    ucp_bodies();
    ucp_frames();
}

fn times() {
    keep(wire_time(any(0), any(0)));
    keep(duration() + duration());
    keep(duration().saturating_add(duration()));
    keep(duration().saturating_mul(any(0)));
    keep(Duration::from_millis(any(0)));
    keep(now() + duration());
    keep(now() - now());
    keep(now().max(now()));
    let mut later = now();
    later += duration();
    keep(later);
    keep(any(Wrapping32::new()).at(any(0)));
    let schedule = any(Schedule::new(8));
    keep(schedule.cycle_time());
    keep(schedule.cycles_per_second());
    keep(schedule.busy_pct());
    keep(schedule.exchange_time_of::<ThreeMotors>());
}

fn units() {
    keep(NodeId::new(any(0)));
    keep(any(NodeId::N1).get());
    if let Ok(dip) = DipSwitch::from_bits(any(0)) {
        keep((dip.bits(), dip.mode(), dip.node_id(any(IdReading::Value))));
    }
    keep(core::str::from_utf8(input()).map(str::parse::<DipSwitch>));
    keep((Rps::new(any(0.0)), Rps::from_rpm(any(0.0)), Rps::from_rad_per_s(any(0.0))));
    let rps = any(Rps::ZERO);
    keep((rps.get(), rps.rpm(), rps.rad_per_s(), any(Mode::Velocity)));
    keep(Position::new(any(0), any(0)));
    keep((Position::from_counts(any(0)), Position::from_counts_euclidean(any(0))));
    keep((Position::from_revolutions(any(0.0)), Position::from_radians(any(0.0))));
    let position = any(Position::default());
    keep((position.count(), position.rotation(), position.counts()));
    keep((position.revolutions(), position.radians()));
}

fn ikeya_packets() {
    let (id, rps, position) = (any(NodeId::N1), any(Rps::ZERO), any(Position::default()));
    encode(&ReadRequest::new(id));
    encode(&WriteRequest::velocity(id, rps));
    encode(&WriteRequest::position(id, position));
    encode(&VelocityResponse::new(id, rps));
    encode(&PositionResponse::new(id, position));
    keep(ReadRequest::parse(any(&[0; 4])).map(ReadRequest::id));
    if let Ok(write) = WriteRequest::parse(any(&[0; 8])) {
        keep((write.id(), write.as_velocity(), write.as_position(), write.payload()));
    }
    keep(VelocityResponse::parse(any(&[0; 8])).map(VelocityResponse::rps));
    keep(PositionResponse::parse(any(&[0; 8])).map(PositionResponse::position));
}

fn three_motor_packets() {
    let id = any(NodeId::N1);
    let (rps, positions) = (any([Rps::ZERO; 3]), any([Position::default(); 3]));
    encode(&three::WriteRequest::velocity(id, rps));
    encode(&three::WriteRequest::position(id, positions));
    encode(&three::VelocityResponse::new(id, rps));
    encode(&three::PositionResponse::new(id, positions));
    if let Ok(write) = three::WriteRequest::parse(any(&[0; 16])) {
        keep((write.id(), write.as_velocity(), write.as_position(), write.payload()));
    }
    keep(three::VelocityResponse::parse(any(&[0; 16])).map(three::VelocityResponse::rps));
    keep(three::PositionResponse::parse(any(&[0; 16])).map(three::PositionResponse::positions));
}

/// Every body that can be sent.
fn ucp_bodies() {
    let (kind, err) = (any(CalibrationKind::Imu), any(ErrorCode::Fine));
    let (imu, mag) = (ImuBias::new(any([0; 3]), any([0; 3])), MagBias::new(any([0; 3])));
    let telemetry = any(Telemetry::default());
    send(any(Ping {}));
    send(Pong::new(err));
    for command in [
        MotorControl::new(any(0), any(0)),
        MotorControl::turn_left(any(0), any(0)),
        MotorControl::turn_right(any(0), any(0)),
        MotorControl::yaw_left(any(0), any(0)),
        MotorControl::yaw_right(any(0), any(0)),
    ] {
        keep(command.map(|command| send(command.with_front_led(any(true)))));
    }
    send(CalibrationStart::new(kind));
    send(CalibrationStartAck::new(kind, err));
    send(CalibrationEnd::new(kind));
    send(CalibrationEndAck::new(kind, err));
    send(FirmwareReport::new(&telemetry, any(0)));
    send(DocumentReport::new(&telemetry));
    send(imu);
    send(ImuBiasAck::new(err));
    send(mag);
    send(MagBiasAck::new(err));
    send(any(BiasRequest {}));
    send(Biases::new(imu, mag).with_err(err));
    send(OtaRequest::start_firmware_update(any(0)));
    send(OtaAck::new(any(OtaStatus::Forbidden)));
    keep(SetNetworkState::new(any(NetworkState::Connected)).map(send));
}

fn ucp_frames() {
    let raw = RawFrame { id: any(0), index: any(0), body: input() };
    encode(&raw);
    keep(MessageId::from_u8(any(0)));
    if let Ok(frame) = Frame::parse(input()) {
        encode(&frame.relay_unchecked());
        keep((frame.header().len(), frame.header().is_empty(), frame.id(), frame.index()));
        read(frame.message());
    }
}

/// Every field of every message.
#[inline(never)]
fn read(message: Message<'_>) {
    match message {
        Message::Pong(it) => keep(it.err()),
        Message::MotorControl(it) => {
            keep((it.speed(), it.angular(), it.front_led(), it.back_led()));
            keep((it.version(), it.reserve1(), it.reserve2(), it.starts_update()));
            keep(MotorControl::try_from(*it));
        }
        Message::CalibrationStart(it) => keep(it.kind()),
        Message::CalibrationStartAck(it) => keep((it.kind(), it.err())),
        Message::CalibrationEnd(it) => keep(it.kind()),
        Message::CalibrationEndAck(it) => keep((it.kind(), it.err())),
        Message::Report(it) => report(it),
        Message::ImuBias(it) => keep((it.acc(), it.gyro())),
        Message::ImuBiasAck(it) => keep(it.err()),
        Message::MagBias(it) => keep(it.mag()),
        Message::MagBiasAck(it) => keep(it.err()),
        Message::Biases(it) => keep((it.err(), it.imu(), it.mag())),
        Message::OtaRequest(it) => keep(it.version()),
        Message::OtaAck(it) => keep(it.status()),
        Message::SetNetworkState(it) => keep(it.state()),
        Message::SetNetworkStateWide(it) => keep(it.state()),
        other => keep(other),
    }
}

fn report(report: Report<'_>) {
    let values = report.telemetry();
    keep((report.version(), values.battery(), values.volts(), values.amperes()));
    keep((values.acc_g(), values.gyro_deg_per_s()));
}

fn send<B: Body>(body: B) {
    encode(&body.frame(any(0)));
}

#[inline(never)]
fn encode(packet: &(impl Encode + ?Sized)) {
    let mut buffer = [0; 300];
    keep(packet.encoded_len());
    keep(packet.encode(room(&mut buffer)));
}
