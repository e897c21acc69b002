//! Any value of any packet or message survives encoding and decoding.

use arbitrary::{Result, Unstructured};
use axlewire::{
    encode::Encode,
    error::EncodeError,
    ikeya::{self, NodeId, Position, Rps, three},
    stream::{Frames, Framing},
    ucp::{self, Body, Message, RawFrame, Telemetry, message::Report},
};

use super::{Tally, oracle};

/// Values of one kind.
pub(super) fn roundtrip(data: &[u8], tally: &mut Tally) {
    // Too few bytes for a value are not a finding.
    let _ = roundtrip_of(&mut Unstructured::new(data), tally);
}

fn roundtrip_of(u: &mut Unstructured<'_>, tally: &mut Tally) -> Result<()> {
    let kind = u.int_in_range(0..=8_u8)?;
    match kind {
        0 => ikeya_request(u),
        1 => ikeya_response(u),
        2 => three_request(u),
        3 => three_response(u),
        4 => ucp_command(u),
        5 => ucp_calibration(u),
        6 => ucp_biases(u),
        7 => ucp_report(u),
        _ => ucp_raw(u),
    }?;
    tally.did(kind);
    Ok(())
}

fn ikeya_request(u: &mut Unstructured<'_>) -> Result<()> {
    let (id, target, position) = (value::node(u)?, value::rps(u)?, value::position(u)?);

    let read = ikeya::ReadRequest::new(id);
    assert_eq!(ikeya::ReadRequest::parse(read.as_bytes()), Ok(&read));
    found::<ikeya::ToSlave>(&read, |found| found == ikeya::Request::Read(&read));
    found::<three::ToSlave>(&read, |found| found == three::Request::Read(&read));
    assert_eq!(read.id(), id);

    let velocity = ikeya::WriteRequest::velocity(id, target);
    assert_eq!(ikeya::WriteRequest::parse(velocity.as_bytes()), Ok(&velocity));
    found::<ikeya::ToSlave>(&velocity, |found| found == ikeya::Request::Write(&velocity));
    assert_eq!((velocity.id(), velocity.as_velocity().to_bits()), (id, target.get().to_bits()));
    assert_eq!(velocity.payload(), target.get().to_le_bytes());

    let go = ikeya::WriteRequest::position(id, position);
    let request = ikeya::Request::Write(&go);
    found::<ikeya::BothDirections>(&go, |found| found == ikeya::Packet::Request(request));
    assert_eq!((go.id(), go.as_position()), (id, position));
    Ok(())
}

fn ikeya_response(u: &mut Unstructured<'_>) -> Result<()> {
    let (id, current, position) = (value::node(u)?, value::rps(u)?, value::position(u)?);

    let velocity = ikeya::VelocityResponse::new(id, current);
    assert_eq!(ikeya::VelocityResponse::parse(velocity.as_bytes()), Ok(&velocity));
    found::<ikeya::ToMaster>(&velocity, |found| found == ikeya::Response::Velocity(&velocity));
    assert_eq!((velocity.id(), velocity.rps().to_bits()), (id, current.get().to_bits()));

    let status = ikeya::PositionResponse::new(id, position);
    assert_eq!(ikeya::PositionResponse::parse(status.as_bytes()), Ok(&status));
    let response = ikeya::Response::Position(&status);
    found::<ikeya::BothDirections>(&status, |found| found == ikeya::Packet::Response(response));
    assert_eq!((status.id(), status.position()), (id, position));

    // I5: where the split is defined, it and its inverse agree.
    if let Ok(split) = Position::from_counts(position.counts()) {
        assert_eq!(split.counts(), position.counts());
        assert!(i32::from(split.count()).abs() < Position::COUNTS_PER_REVOLUTION);
        assert_eq!(Position::from_revolutions(split.revolutions()), Ok(split));
    }
    if let Ok(split) = Position::from_counts_euclidean(position.counts()) {
        assert_eq!(split.counts(), position.counts());
        assert!((0..Position::COUNTS_PER_REVOLUTION).contains(&i32::from(split.count())));
    }
    Ok(())
}

fn three_request(u: &mut Unstructured<'_>) -> Result<()> {
    let id = value::node(u)?;
    let targets = [value::rps(u)?, value::rps(u)?, value::rps(u)?];
    let positions = [value::position(u)?, value::position(u)?, value::position(u)?];

    let velocity = three::WriteRequest::velocity(id, targets);
    assert_eq!(three::WriteRequest::parse(velocity.as_bytes()), Ok(&velocity));
    found::<three::ToSlave>(&velocity, |found| found == three::Request::Write(&velocity));
    let bits = |rps: [f32; 3]| rps.map(f32::to_bits);
    assert_eq!((velocity.id(), bits(velocity.as_velocity())), (id, bits(targets.map(Rps::get))));

    let go = three::WriteRequest::position(id, positions);
    let request = three::Request::Write(&go);
    found::<three::BothDirections>(&go, |found| found == three::Packet::Request(request));
    assert_eq!((go.id(), go.as_position()), (id, positions));
    Ok(())
}

fn three_response(u: &mut Unstructured<'_>) -> Result<()> {
    let id = value::node(u)?;
    let current = [value::rps(u)?, value::rps(u)?, value::rps(u)?];
    let positions = [value::position(u)?, value::position(u)?, value::position(u)?];

    let velocity = three::VelocityResponse::new(id, current);
    assert_eq!(three::VelocityResponse::parse(velocity.as_bytes()), Ok(&velocity));
    found::<three::ToMaster>(&velocity, |found| found == three::Response::Velocity(&velocity));
    let bits = |rps: [f32; 3]| rps.map(f32::to_bits);
    assert_eq!((velocity.id(), bits(velocity.rps())), (id, bits(current.map(Rps::get))));

    let status = three::PositionResponse::new(id, positions);
    assert_eq!(three::PositionResponse::parse(status.as_bytes()), Ok(&status));
    let response = three::Response::Position(&status);
    found::<three::BothDirections>(&status, |found| found == three::Packet::Response(response));
    assert_eq!((status.id(), status.positions()), (id, positions));
    Ok(())
}

/// Ping, motor control, update and network state.
fn ucp_command(u: &mut Unstructured<'_>) -> Result<()> {
    let index = u.arbitrary()?;

    message(index, ucp::message::Ping {}, |said, body| said == Message::Ping(body));
    let err = value::error(u)?;
    message(index, ucp::message::Pong::new(err), |said, body| {
        body.err() == err && said == Message::Pong(body)
    });

    let (speed, angular, lamp) = (u.arbitrary()?, u.arbitrary()?, u.arbitrary()?);
    let in_range = |percent| (-100..=100).contains(&percent);
    match ucp::MotorControl::new(speed, angular) {
        Ok(command) => message(index, command.with_front_led(lamp), |said, body| {
            let raw = ucp::message::RawMotorControl::from(*body);
            let harmless = (raw.back_led(), raw.version(), raw.reserve1(), raw.reserve2());
            in_range(speed)
                && in_range(angular)
                && (body.speed(), body.angular()) == (speed, angular)
                && body.front_led() == if lamp { 100 } else { 0 }
                && harmless == (0, 0, 0, 0)
                && !raw.starts_update()
                && said == Message::MotorControl(&raw)
                && ucp::MotorControl::try_from(raw) == Ok(*body)
        }),
        Err(error) => {
            assert!(matches!(error, EncodeError::Percent { value, .. } if !in_range(value)));
        }
    }

    let version = u.arbitrary()?;
    message(index, ucp::message::OtaRequest::start_firmware_update(version), |said, body| {
        body.version() == version
            && said == Message::OtaRequest(&ucp::message::RawOtaRequest::from(*body))
    });
    let status = value::ota(u)?;
    message(index, ucp::message::OtaAck::new(status), |said, body| {
        body.status() == status && said == Message::OtaAck(body)
    });

    let state = value::network(u)?;
    match ucp::message::SetNetworkState::new(state) {
        Ok(body) => message(index, body, |said, body| {
            u32::from(body.state()) == u32::from(state) && said == Message::SetNetworkState(body)
        }),
        Err(error) => {
            let value = u32::from(state);
            assert_eq!((error, value > 255), (EncodeError::NetworkState { value }, true));
        }
    }
    Ok(())
}

/// Starts and ends of calibrations, and their acknowledgements.
fn ucp_calibration(u: &mut Unstructured<'_>) -> Result<()> {
    let (index, kind, err) = (u.arbitrary()?, value::calibration(u)?, value::error(u)?);
    message(index, ucp::message::CalibrationStart::new(kind), |said, body| {
        body.kind() == kind && said == Message::CalibrationStart(body)
    });
    message(index, ucp::message::CalibrationStartAck::new(kind, err), |said, body| {
        (body.kind(), body.err()) == (kind, err) && said == Message::CalibrationStartAck(body)
    });
    message(index, ucp::message::CalibrationEnd::new(kind), |said, body| {
        body.kind() == kind && said == Message::CalibrationEnd(body)
    });
    message(index, ucp::message::CalibrationEndAck::new(kind, err), |said, body| {
        (body.kind(), body.err()) == (kind, err) && said == Message::CalibrationEndAck(body)
    });
    Ok(())
}

/// The results of calibrations.
fn ucp_biases(u: &mut Unstructured<'_>) -> Result<()> {
    let index = u.arbitrary()?;
    let (acc, gyro, mag) = (u.arbitrary()?, u.arbitrary()?, u.arbitrary()?);
    let err = value::error(u)?;
    let (imu, magnetometer) =
        (ucp::message::ImuBias::new(acc, gyro), ucp::message::MagBias::new(mag));

    message(index, imu, |said, body| {
        (body.acc(), body.gyro()) == (acc, gyro) && said == Message::ImuBias(body)
    });
    message(index, ucp::message::ImuBiasAck::new(err), |said, body| {
        body.err() == err && said == Message::ImuBiasAck(body)
    });
    message(index, magnetometer, |said, body| body.mag() == mag && said == Message::MagBias(body));
    message(index, ucp::message::MagBiasAck::new(err), |said, body| {
        body.err() == err && said == Message::MagBiasAck(body)
    });
    message(index, ucp::message::BiasRequest {}, |said, body| said == Message::BiasRequest(body));
    message(index, ucp::message::Biases::new(imu, magnetometer).with_err(err), |said, body| {
        (body.err(), body.imu(), body.mag()) == (err, imu, magnetometer)
            && said == Message::Biases(body)
    });
    Ok(())
}

/// Both layouts of the report.
fn ucp_report(u: &mut Unstructured<'_>) -> Result<()> {
    let (index, telemetry, version) = (u.arbitrary()?, value::telemetry(u)?, u.arbitrary()?);
    message(index, ucp::message::FirmwareReport::new(&telemetry, version), |said, body| {
        (body.telemetry(), body.version()) == (telemetry, version)
            && said == Message::Report(Report::Firmware(body))
    });
    message(index, ucp::message::DocumentReport::new(&telemetry), |said, body| {
        body.telemetry() == telemetry && said == Message::Report(Report::Document(body))
    });
    Ok(())
}

/// U3: frames without a known message are relayed unchanged; U13: unless a shipped robot would find
/// another frame in them.
fn ucp_raw(u: &mut Unstructured<'_>) -> Result<()> {
    let (id, index) = (u.arbitrary()?, u.arbitrary()?);
    let raw = RawFrame { id, index, body: u.bytes(u.len().min(70))? };
    let mut buffer = [0; 100];
    match raw.encode(&mut buffer) {
        Ok(sent) => {
            assert_eq!(nested(sent), None);
            found::<ucp::Ucp>(&raw, |frame| frame.message() == Message::Unknown(raw));
        }
        Err(EncodeError::NestedHeader { at }) => {
            let len = raw.body.len() as u8 + 4;
            let mut frame = [&[0xFD, 0xFF, len, 0, id, index], raw.body, &[0; 2]].concat();
            oracle::seal(&mut frame);
            assert_eq!(nested(&frame), Some(at));
        }
        Err(EncodeError::KnownId { id }) => assert!((1..=0x0A).contains(&id)),
        Err(EncodeError::BodyTooLong { length, .. }) => assert!(length > 56),
        Err(other) => panic!("{other}"),
    }
    Ok(())
}

fn nested(frame: &[u8]) -> Option<usize> {
    (2..frame.len() - 1).find(|&at| frame[at] == 0xFD && frame[at + 1] == 0xFF)
}

/// A body makes a frame that parses as the same body with the same values.
fn message<B: Body>(index: u8, body: B, is_same: impl Fn(Message<'_>, &B) -> bool) {
    let frame = body.frame(index);
    let parsed = ucp::Frame::parse(frame.as_bytes()).expect("own frame");
    assert_eq!((parsed.id(), parsed.index()), (B::ID as u8, index));
    assert!(is_same(parsed.message(), &body), "{:?} as {:?}", frame.as_bytes(), parsed.message());
    found::<ucp::Ucp>(&frame, |found| is_same(found.message(), &body));
}

/// A packet is encoded into a large enough buffer and refused by a smaller one; in noise it is
/// found unchanged.
fn found<F: Framing>(packet: &impl Encode, is_same: impl Fn(F::Frame<'_>) -> bool) {
    let (mut buffer, len) = ([0xEE; 300], packet.encoded_len());
    assert_eq!(packet.encode(&mut buffer).map(<[u8]>::len), Ok(len));
    assert!(buffer[len..].iter().all(|&byte| byte == 0xEE), "written past the frame");

    let mut small = [0xEE; 300];
    let refusal = packet.encode(&mut small[..len - 1]).map(<[u8]>::len);
    assert_eq!(refusal, Err(EncodeError::BufferTooSmall { needed: len, available: len - 1 }));
    assert_eq!(small, [0xEE; 300], "written although refused");

    let line = [&[0, 0], &buffer[..len], &[0]].concat();
    let mut frames = Frames::<F>::new(&line);
    assert!(frames.next().is_some_and(is_same), "not found in {line:02x?}");
    assert!(frames.next().is_none());
    assert_eq!((frames.counters().header, frames.counters().framed), (3, len as u64));
}

/// Values from the library's own derives.
mod value {
    use super::{NodeId, Position, Result, Rps, Telemetry, Unstructured, ucp};

    macro_rules! derived {
        ($($name:ident: $type:ty;)+) => {$(
            pub(super) fn $name(u: &mut Unstructured<'_>) -> Result<$type> {
                u.arbitrary()
            }
        )+};
    }

    derived! {
        node: NodeId;
        rps: Rps;
        position: Position;
        telemetry: Telemetry;
        error: ucp::message::ErrorCode;
        calibration: ucp::message::CalibrationKind;
        ota: ucp::message::OtaStatus;
        network: ucp::message::NetworkState;
    }
}
