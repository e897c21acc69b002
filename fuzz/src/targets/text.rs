//! The text of packets and messages, against core's formatting of the bytes' own values.

use axlewire::{
    encode::Encode,
    ikeya::{self, Mode, Position, three},
    ucp::{Frame, Message, RawFrame},
};

use super::{Tally, oracle};

/// What is printed comes first, then its bytes.
pub(super) fn text(data: &[u8], tally: &mut Tally) {
    let [kind, rest @ ..] = data else { return };
    let is_done = match kind % 7 {
        0 => ikeya_write(rest),
        1 => ikeya_answers(rest),
        2 => three_motors(rest),
        3 => motor_control(rest),
        4 => report(rest, 36),
        5 => report(rest, 34),
        _ => unknown(rest),
    };
    if is_done.is_some() {
        tally.did(kind % 7);
    }
}

fn spaced(values: impl IntoIterator<Item = String>) -> String {
    values.into_iter().collect::<Vec<_>>().join(" ")
}

fn i16_at(bytes: &[u8], at: usize) -> i16 {
    i16::from_le_bytes([bytes[at], bytes[at + 1]])
}

/// Speeds, positions: `count` motors in `payload`, counts before rotations.
fn speeds(payload: &[u8]) -> String {
    let speed =
        |bytes: &[u8]| format!("{:?}", f32::from_le_bytes(bytes.try_into().expect("four bytes")));
    spaced(payload.chunks_exact(4).map(speed)) + " rps"
}

fn places(payload: &[u8]) -> String {
    let motors = payload.len() / 4;
    let places: Vec<_> = (0..motors)
        .map(|motor| (i16_at(payload, 2 * motor), i16_at(payload, 2 * (motors + motor))))
        .collect();
    // The order on the wire is count, rotation (I5, I10).
    let turns = |&(count, rotation): &(i16, i16)| {
        format!("{:.4}", f64::from(i32::from(rotation) * 8192 + i32::from(count)) / 8192.0)
    };
    format!(
        "{} turns (rotation {}, count {})",
        spaced(places.iter().map(turns)),
        spaced(places.iter().map(|place| place.1.to_string())),
        spaced(places.iter().map(|place| place.0.to_string())),
    )
}

fn packet<const N: usize>(header: u8, payload: &[u8]) -> [u8; N] {
    let mut packet = [0; N];
    packet[..2].copy_from_slice(&[header, 3]);
    packet[2..N - 2].copy_from_slice(payload);
    oracle::seal(&mut packet);
    packet
}

fn ikeya_write(rest: &[u8]) -> Option<()> {
    let payload: &[u8; 4] = rest.first_chunk()?;
    let write = packet::<8>(0xBB, payload);
    let write = ikeya::Request::Write(ikeya::WriteRequest::parse(&write).expect("a packet"));
    let (speed, place) = (speeds(payload), places(payload));
    assert_eq!(write.contents().to_string(), format!("{speed} or {place}"));
    assert_eq!(write.contents().in_mode(Mode::Velocity).to_string(), speed);
    assert_eq!(write.contents().in_mode(Mode::Position).to_string(), place);
    assert_eq!(write.to_string(), format!("write, node 3: {speed} or {place}"));
    Some(())
}

fn ikeya_answers(rest: &[u8]) -> Option<()> {
    let payload: &[u8; 4] = rest.first_chunk()?;
    let answer = packet::<8>(0x55, payload);
    let answer = ikeya::VelocityResponse::parse(&answer).expect("a packet");
    let text = ikeya::Response::Velocity(answer).to_string();
    assert_eq!(text, format!("velocity_response, node 3: {}", speeds(payload)));
    let answer = packet::<8>(0x56, payload);
    let answer = ikeya::PositionResponse::parse(&answer).expect("a packet");
    let text = ikeya::Response::Position(answer).to_string();
    assert_eq!(text, format!("position_response, node 3: {}", places(payload)));
    // Words that fill columns keep the width.
    let at = Position::new(i16_at(payload, 0), i16_at(payload, 2));
    assert_eq!((at.count(), at.rotation()), (i16_at(payload, 0), i16_at(payload, 2)));
    Some(())
}

fn three_motors(rest: &[u8]) -> Option<()> {
    let payload: &[u8; 12] = rest.first_chunk()?;
    let write = packet::<16>(0xBB, payload);
    let write = three::Request::Write(three::WriteRequest::parse(&write).expect("a packet"));
    let (speed, place) = (speeds(payload), places(payload));
    assert_eq!(write.to_string(), format!("write, node 3: {speed} or {place}"));
    let answer = packet::<16>(0x55, payload);
    let answer = three::VelocityResponse::parse(&answer).expect("a packet");
    let text = three::Response::Velocity(answer).to_string();
    assert_eq!(text, format!("velocity_response, node 3: {speed}"));
    let answer = packet::<16>(0x56, payload);
    let answer = three::PositionResponse::parse(&answer).expect("a packet");
    let text = three::Response::Position(answer).to_string();
    assert_eq!(text, format!("position_response, node 3: {place}"));
    Some(())
}

fn frame(id: u8, body: &[u8]) -> Vec<u8> {
    let mut frame = vec![0xFD, 0xFF, body.len() as u8 + 4, 0, id, 9];
    frame.extend(body);
    frame.extend([0, 0]);
    oracle::seal(&mut frame);
    frame
}

fn motor_control(rest: &[u8]) -> Option<()> {
    let body: &[u8; 16] = rest.first_chunk()?;
    let lamp = match i16_at(body, 4) {
        0 => "off".to_owned(),
        100 => "on".to_owned(),
        other => other.to_string(),
    };
    let (speed, angular) = (i16_at(body, 0), i16_at(body, 2));
    let mut told = format!("speed {speed:>4} %  angular {angular:>4} %  front led {lamp}");
    let version = i16_at(body, 8) as u16;
    let last = u32::from_le_bytes([body[12], body[13], body[14], body[15]]);
    for (name, value) in [
        ("back led", i64::from(i16_at(body, 6))),
        ("version", version.into()),
        ("reserve1", (i16_at(body, 10) as u16).into()),
        ("reserve2", last.into()),
    ] {
        if value != 0 {
            told += &format!("  {name} {value}");
        }
    }
    if version as i16 > 38 {
        told += "  (starts a firmware update)";
    }
    shows(&frame(2, body), &format!("motor_control, index 9: {told}"));
    Some(())
}

/// Numbers in columns, fractions as core rounds them.
fn report(rest: &[u8], len: usize) -> Option<()> {
    let body = rest.get(..len)?;
    // The two layouts differ in where the last four fields are (U5).
    let (power, motion) = if len == 36 { (30, 10) } else { (10, 14) };
    let signed = |at: usize, count: usize| (0..count).map(move |n| i16_at(body, at + 2 * n));
    let battery = match i16_at(body, 0) as u16 {
        percent @ 0..=100 => format!("{percent:>3} %"),
        other => format!("{other} (no percentage)"),
    };
    let amperes = f32::from(i16_at(body, power + 2) as u16) / 100.0;
    let version = match len {
        36 => format!("firmware {}", i16_at(body, 34) as u16),
        _ => "(document layout)".to_owned(),
    };
    let heading = if len == 36 { 28 } else { 32 };
    let told = format!(
        "battery {battery}  {:>4.1} V  {amperes:>5.2} A  {:>3} W  rpm {}  acc {} g  gyro {} deg/s  \
         mag {}  heading {:>3} deg  {version}",
        f32::from(body[power + 1]) / 10.0,
        body[power],
        spaced(signed(2, 4).map(|rpm| format!("{rpm:>4}"))),
        spaced(signed(motion, 3).map(|acc| format!("{:>5.2}", f32::from(acc) / 16384.0))),
        spaced(signed(motion + 6, 3).map(|gyro| format!("{:>6.1}", f32::from(gyro) / 16.4))),
        spaced(signed(motion + 12, 3).map(|mag| format!("{mag:>5}"))),
        i16_at(body, heading),
    );
    shows(&frame(5, body), &format!("report, index 9: {told}"));
    Some(())
}

fn unknown(rest: &[u8]) -> Option<()> {
    let (&id, body) = rest.split_first()?;
    let body = &body[..body.len().min(56)];
    let bytes = frame(id, body);
    let Message::Unknown(RawFrame { body, .. }) = Frame::parse(&bytes).expect("a frame").message()
    else {
        return None;
    };
    let hex: String = body.iter().map(|byte| format!("{byte:02x}")).collect();
    shows(&bytes, &format!("unknown, index 9: id {id}, body {hex}"));
    let mut buffer = [0; 64];
    let raw = RawFrame { id, index: 9, body };
    if raw.encode(&mut buffer).is_ok() {
        assert_eq!(buffer[..bytes.len()], bytes);
    }
    Some(())
}

fn shows(bytes: &[u8], told: &str) {
    assert_eq!(Frame::parse(bytes).expect("a frame").to_string(), told, "{bytes:02x?}");
}
