//! The bodies of the fuzz targets.
//!
//! The two stream bodies read a script, then the stream:
//!
//! ```text
//! byte 0       framing and buffer size
//! byte 1       low two bits: which CRCs are repaired; upper six bits: number of ops that follow
//! then         ops, one byte each: actions on the decoder, in order (see `op`)
//! then         the stream
//! ```

use arbitrary::{Result, Unstructured};
use axlewire::{
    crc16,
    encode::Encode,
    error::EncodeError,
    ikeya::{self, NodeId, Position, Rps, three},
    stream::{Frames, Framing, Portable},
    ucp::{self, Body, Message, RawFrame, Telemetry, message::Report},
};

#[path = "../../tests/support/checked_line.rs"]
#[allow(dead_code, reason = "tests/stream.rs uses more of it")]
mod checked_line;
#[path = "../../tests/support/known_framings.rs"]
mod known_framings;
#[path = "../../tests/support/oracle.rs"]
#[allow(dead_code, reason = "tests/stream.rs uses more of it")]
mod oracle;

use checked_line::{CheckedLine, Op};
use known_framings::Known;

/// Checks any stream, with any chunks and interruptions, against the oracle: the six Ikeya
/// framings.
pub fn ikeya_stream(data: &[u8]) {
    let Some(script) = Script::read(data) else { return };
    match script.choice % 12 {
        0 => script.play::<ikeya::ToSlave, 8>(),
        1 => script.play::<ikeya::ToSlave, 37>(),
        2 => script.play::<ikeya::ToMaster, 8>(),
        3 => script.play::<ikeya::ToMaster, 37>(),
        4 => script.play::<ikeya::BothDirections, 8>(),
        5 => script.play::<ikeya::BothDirections, 37>(),
        6 => script.play::<three::ToSlave, 16>(),
        7 => script.play::<three::ToSlave, 37>(),
        8 => script.play::<three::ToMaster, 16>(),
        9 => script.play::<three::ToMaster, 37>(),
        10 => script.play::<three::BothDirections, 16>(),
        _ => script.play::<three::BothDirections, 37>(),
    }
}

/// The same for UCP, with the default, smallest and largest cap.
pub fn ucp_stream(data: &[u8]) {
    let Some(script) = Script::read(data) else { return };
    match script.choice % 6 {
        0 => script.play::<ucp::Ucp, 64>(),
        1 => script.play::<ucp::Ucp, 150>(),
        2 => script.play::<ucp::Ucp<4>, 8>(),
        3 => script.play::<ucp::Ucp<4>, 37>(),
        4 => script.play::<ucp::Ucp<252>, 256>(),
        _ => script.play::<ucp::Ucp<252>, 300>(),
    }
}

struct Script<'a> {
    choice: u8,
    repair: Repair,
    ops: Vec<Op>,
    stream: &'a [u8],
}

/// Which candidates get a correct CRC, since a fuzzer cannot guess it.
#[derive(Clone, Copy)]
enum Repair {
    None,
    /// Consecutive ones.
    Adjacent,
    /// All, inner ones first: frames in payloads.
    Nested,
    /// Every second one.
    Alternate,
}

impl<'a> Script<'a> {
    fn read(data: &'a [u8]) -> Option<Self> {
        let [choice, plan, rest @ ..] = data else { return None };
        let repair = match plan & 3 {
            0 => Repair::None,
            1 => Repair::Adjacent,
            2 => Repair::Nested,
            _ => Repair::Alternate,
        };
        let (ops, stream) = rest.split_at_checked(usize::from(plan >> 2))?;
        let ops = ops.iter().map(|&byte| op(byte)).collect();
        Some(Self { choice: *choice, repair, ops, stream })
    }

    fn play<F: Known, const N: usize>(&self) {
        let mut stream = self.stream.to_vec();
        self.repair.repair::<F>(&mut stream);
        CheckedLine::<F, N>::new().play(&stream, &self.ops);
        checked_line::check_slice::<F>(&stream);
        checked_line::check_slice::<Portable<F>>(&stream);
        // Feature `simd` works on blocks of 128 bytes: more than most inputs have.
        checked_line::check_slice::<F>(&stream.repeat(1 + 256 / (stream.len() + 1)));
    }
}

/// Runs one op of the script: its upper bits are the kind, its lower bits the amount.
fn op(byte: u8) -> Op {
    let amount = usize::from(byte & 0x1F);
    match byte >> 5 {
        0 => Op::Slice(amount),
        1 => Op::Slice(8 * amount),
        2 => Op::Commit(amount),
        3 => Op::Commit(8 * amount),
        4 => Op::Stop { len: 4 * amount, events: 1 },
        5 => Op::Stop { len: 4 * amount, events: 2 },
        6 if amount == 0 => Op::Drain,
        6 => Op::Push(amount),
        _ => Op::Idle,
    }
}

impl Repair {
    fn repair<F: Known>(self, stream: &mut [u8]) {
        let (mut at, mut count) = (0, 0);
        while at < stream.len() {
            let promised = oracle::promised_len(F::RULES, &stream[at..]);
            let end = promised.ok().flatten().map(|len| at + len);
            let Some(end) = end.filter(|&end| end <= stream.len()) else {
                at += 1;
                continue;
            };
            count += 1;
            match self {
                Self::None => return,
                Self::Alternate if count % 2 == 0 => at += 1,
                Self::Adjacent | Self::Alternate => {
                    oracle::seal(&mut stream[at..end]);
                    at = end;
                }
                Self::Nested => {
                    Self::Adjacent.repair::<F>(&mut stream[at + 1..end - 2]);
                    oracle::seal(&mut stream[at..end]);
                    at = end;
                }
            }
        }
    }
}

/// Compares the CRC of any bytes, computed and checked, with a bitwise CRC.
pub fn crc16(data: &[u8]) {
    let crc = oracle::crc(data);
    assert_eq!(crc16::compute(data), crc);

    let mut frame = [data, &crc.to_le_bytes()].concat();
    assert!(crc16::check(&frame));
    // Two of these errors keep the remainder modulo one factor of the polynomial, and two the
    // parity.
    for other in [0xC001, 0x0003, 0xFFFF] {
        let [.., low, high] = &mut frame[..] else { return };
        [*low, *high] = (crc ^ other).to_le_bytes();
        assert!(!crc16::check(&frame));
    }

    if let Some((body, found)) = data.split_last_chunk() {
        assert_eq!(crc16::check(data), oracle::crc(body) == u16::from_le_bytes(*found));
    }
}

/// Any value of any packet or message survives encoding and decoding.
pub fn roundtrip(data: &[u8]) {
    // Too few bytes for a value are not a finding.
    let _ = roundtrip_of(&mut Unstructured::new(data));
}

fn roundtrip_of(u: &mut Unstructured<'_>) -> Result<()> {
    match u.int_in_range(0..=8_u8)? {
        0 => ikeya_request(u),
        1 => ikeya_response(u),
        2 => three_request(u),
        3 => three_response(u),
        4 => ucp_command(u),
        5 => ucp_calibration(u),
        6 => ucp_biases(u),
        7 => ucp_report(u),
        _ => ucp_raw(u),
    }
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

/// U3: frames without a known message are relayed unchanged.
fn ucp_raw(u: &mut Unstructured<'_>) -> Result<()> {
    let (id, index) = (u.arbitrary()?, u.arbitrary()?);
    let raw = RawFrame { id, index, body: u.bytes(u.len().min(70))? };
    let mut buffer = [0; 100];
    match raw.encode(&mut buffer) {
        Ok(_) => found::<ucp::Ucp>(&raw, |frame| frame.message() == Message::Unknown(raw)),
        Err(EncodeError::KnownId { id }) => assert!((1..=0x0A).contains(&id)),
        Err(EncodeError::BodyTooLong { length, .. }) => assert!(length > 56),
        Err(other) => panic!("{other}"),
    }
    Ok(())
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
