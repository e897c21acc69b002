//! The text of UCP messages, against core's formatting of the same values.

use axlewire::ucp::message::BiasRequest;
use proptest::prelude::*;

use super::spaced;
use crate::rig::*;

fn contents(frame: &[u8]) -> String {
    Frame::parse(frame).unwrap().message().contents().to_string()
}

/// The text of a report, from core's formatting of the values in SI units.
fn report_text(values: &Telemetry, version: Option<u16>) -> String {
    let battery = match values.battery() {
        Some(percent) => format!("battery {percent:>3} %"),
        None => format!("battery {} (no percentage)", values.battery_pct),
    };
    let end = match version {
        Some(version) => format!("firmware {version}"),
        None => "(document layout)".to_owned(),
    };
    format!(
        "{battery}  {:>4.1} V  {:>5.2} A  {:>3} W  rpm {}  acc {} g  gyro {} deg/s  mag {}  \
         heading {:>3} deg  {end}",
        values.volts(),
        values.amperes(),
        values.power_w,
        spaced(values.rpm.map(|rpm| format!("{rpm:>4}"))),
        spaced(values.acc_g().map(|acc| format!("{acc:>5.2}"))),
        spaced(values.gyro_deg_per_s().map(|gyro| format!("{gyro:>6.1}"))),
        spaced(values.mag.map(|mag| format!("{mag:>5}"))),
        values.heading_deg,
    )
}

#[test]
fn reports_have_the_numbers_that_core_prints_for_their_units() {
    proptest!(|(body: [u8; 36], is_percent: bool)| {
        let mut body = body;
        if is_percent {
            [body[0], body[1]] = [body[0] % 101, 0];
        }
        for body in [&body[..], &body[..34]] {
            let bytes = frame(5, 0, body);
            let Message::Report(report) = Frame::parse(&bytes)?.message() else { panic!() };
            prop_assert_eq!(contents(&bytes), report_text(&report.telemetry(), report.version()));
        }
    });
}

#[test]
fn every_acceleration_rate_voltage_and_current_is_rounded_as_core_does() {
    for raw in 0..=u16::MAX {
        let values = Telemetry {
            acc: [raw as i16, 0, 0],
            gyro: [0, 0, raw as i16],
            voltage_dv: raw as u8,
            current_ca: raw,
            ..Telemetry::default()
        };
        let report = FirmwareReport::new(&values, 38);
        assert_eq!(
            Message::Report(Report::Firmware(&report)).contents().to_string(),
            report_text(&values, Some(38))
        );
    }
}

#[test]
fn a_motor_command_shows_what_is_not_zero() {
    proptest!(|(fields: (i16, i16, i16, i16, u16, u16, u32), mask: u8)| {
        let keep = |bit: u8| mask >> bit & 1;
        let (speed, angular, front, back, version, reserve1, reserve2) = fields;
        let front = [0, 100, front, front][usize::from(mask >> 6)];
        let back = back * i16::from(keep(0));
        let version = version * u16::from(keep(1));
        let (reserve1, reserve2) =
            (reserve1 * u16::from(keep(2)), reserve2 * u32::from(keep(3)));
        let mut body = Vec::new();
        for field in [speed, angular, front, back] {
            body.extend(field.to_le_bytes());
        }
        body.extend(version.to_le_bytes());
        body.extend(reserve1.to_le_bytes());
        body.extend(reserve2.to_le_bytes());

        let lamp = match front {
            0 => "off".to_owned(),
            100 => "on".to_owned(),
            other => other.to_string(),
        };
        let mut expected = format!("speed {speed:>4} %  angular {angular:>4} %  front led {lamp}");
        for (name, value) in [
            ("back led", i64::from(back)),
            ("version", version.into()),
            ("reserve1", reserve1.into()),
            ("reserve2", reserve2.into()),
        ] {
            if value != 0 {
                expected += &format!("  {name} {value}");
            }
        }
        if version as i16 > 38 {
            expected += "  (starts a firmware update)";
        }
        prop_assert_eq!(contents(&frame(2, 0, &body)), expected);
    });
}

#[test]
fn biases_and_versions_have_the_numbers_that_core_prints() {
    proptest!(|(acc: [i16; 3], gyro: [i16; 3], mag: [i16; 3], version: i16, err: u8)| {
        let imu = ImuBias::new(acc, gyro);
        let imu_text = format!("acc {}, gyro {}", spaced(acc), spaced(gyro));
        let mag_text = format!("mag {}", spaced(mag));
        let text = |message: Message<'_>| message.contents().to_string();
        prop_assert_eq!(text(Message::ImuBias(&imu)), imu_text.clone());
        prop_assert_eq!(text(Message::MagBias(&MagBias::new(mag))), mag_text.clone());
        let err = ErrorCode::from(err);
        let biases = Biases::new(imu, MagBias::new(mag)).with_err(err);
        prop_assert_eq!(
            text(Message::Biases(&biases)),
            format!("{err}, {imu_text}, {mag_text}")
        );
        let request = OtaRequest::start_firmware_update(version).into();
        prop_assert_eq!(text(Message::OtaRequest(&request)), format!("version {version}"));
    });
}

#[test]
fn unknown_frames_show_their_id_and_body_in_hex_up_to_the_longest() {
    for len in [0, 1, 15, 16, 17, 100, 248] {
        let body: Vec<u8> = (0..len).collect();
        let hex = hex(&body);
        let bytes = frame(0x20, 3, &body);
        assert_eq!(contents(&bytes), format!("id 32, body {hex}"));
        assert_eq!(
            Frame::parse(&bytes).unwrap().to_string(),
            format!("unknown, index 3: id 32, body {hex}")
        );
    }
}

/// One message of each kind and body length, with its id, name and contents.
pub(crate) fn each_kind(mut tell: impl FnMut(Message<'_>, u8, &str, &str)) {
    use {CalibrationKind::Imu, CalibrationKind::Magnetometer};

    let fine = ErrorCode::Fine;
    let telemetry = Telemetry { battery_pct: 87, ..Telemetry::default() };
    let command = MotorControl::new(-60, 20).unwrap().with_front_led(true).into();
    let (firmware, document) =
        (FirmwareReport::new(&telemetry, 38), DocumentReport::new(&telemetry));
    let (imu, mag) = (ImuBias::new([1, -2, 3], [4, 5, 6]), MagBias::new([7, -8, 9]));
    let ota = OtaRequest::start_firmware_update(-5).into();
    let state = SetNetworkState::new(NetworkState::Connected).unwrap();
    let wide = frame(0x0A, 0, &[3, 0, 0, 0]);
    let raw = RawFrame { id: 0x20, index: 0, body: &[0xAB, 0x01] };
    let numbers = "0.0 V   0.00 A    0 W  rpm    0    0    0    0  acc  0.00  0.00  0.00 g  \
                   gyro    0.0    0.0    0.0 deg/s  mag     0     0     0  heading   0 deg";

    tell(Message::Ping(&Ping {}), 1, "ping", "");
    tell(Message::Pong(&Pong::new(fine)), 1, "pong", "fine");
    let motion = "speed  -60 %  angular   20 %  front led on";
    tell(Message::MotorControl(&command), 2, "motor_control", motion);
    let start = CalibrationStart::new(Imu);
    tell(Message::CalibrationStart(&start), 3, "calibration_start", "IMU");
    let ack = CalibrationStartAck::new(Magnetometer, ErrorCode::Damaged);
    let name = "calibration_start_ack";
    tell(Message::CalibrationStartAck(&ack), 3, name, "magnetometer, damaged");
    let end = CalibrationEnd::new(CalibrationKind::Other(9));
    tell(Message::CalibrationEnd(&end), 4, "calibration_end", "type 9");
    let ack = CalibrationEndAck::new(Imu, ErrorCode::Other(7));
    tell(Message::CalibrationEndAck(&ack), 4, "calibration_end_ack", "IMU, err 7");
    let report = Message::Report(Report::Firmware(&firmware));
    tell(report, 5, "report", &format!("battery  87 %   {numbers}  firmware 38"));
    let report = Message::Report(Report::Document(&document));
    tell(report, 5, "report", &format!("battery  87 %   {numbers}  (document layout)"));
    tell(Message::ImuBias(&imu), 6, "imu_bias", "acc 1 -2 3, gyro 4 5 6");
    tell(Message::ImuBiasAck(&ImuBiasAck::new(fine)), 6, "imu_bias_ack", "fine");
    tell(Message::MagBias(&mag), 7, "mag_bias", "mag 7 -8 9");
    tell(Message::MagBiasAck(&MagBiasAck::new(fine)), 7, "mag_bias_ack", "fine");
    tell(Message::BiasRequest(&BiasRequest {}), 8, "bias_request", "");
    let text = "fine, acc 1 -2 3, gyro 4 5 6, mag 7 -8 9";
    tell(Message::Biases(&Biases::new(imu, mag)), 8, "biases", text);
    tell(Message::OtaRequest(&ota), 9, "ota_request", "version -5");
    tell(Message::OtaAck(&OtaAck::new(OtaStatus::Forbidden)), 9, "ota_ack", "forbidden");
    let text = "connected, in 1 byte";
    tell(Message::SetNetworkState(&state), 10, "network_state", text);
    let text = "connected, in 4 bytes";
    tell(Frame::parse(&wide).unwrap().message(), 10, "network_state", text);
    tell(Message::Unknown(raw), 0x20, "unknown", "id 32, body ab01");
}

#[test]
fn each_message_has_its_name_its_id_and_its_contents() {
    each_kind(|message, id, name, contents| {
        assert_eq!((message.id(), message.name()), (id, name));
        assert_eq!(message.contents().to_string(), contents, "{name}");
        let colon = if contents.is_empty() { "" } else { ": " };
        assert_eq!(message.to_string(), format!("{name}{colon}{contents}"));
    });
}

#[test]
fn a_frame_adds_its_index() {
    assert_eq!(Frame::parse(Ping {}.frame(255).as_bytes()).unwrap().to_string(), "ping, index 255");
    let pong = Pong::new(ErrorCode::Fine).frame(3);
    assert_eq!(Frame::parse(pong.as_bytes()).unwrap().to_string(), "pong, index 3: fine");
}

#[test]
fn codes_print_in_words_or_as_numbers_and_fill_columns() {
    assert_eq!(format!("{:<9}|{:>9}", ErrorCode::Fine, ErrorCode::Other(7)), "fine     |    err 7");
    assert_eq!(CalibrationKind::Other(255).to_string(), "type 255");
    assert_eq!(OtaStatus::Accepted.to_string(), "accepted");
    assert_eq!(OtaStatus::Failed.to_string(), "failed");
    assert_eq!(OtaStatus::Other(3).to_string(), "err 3");
    let states = [
        (0, "unknown"),
        (1, "SIM absent"),
        (2, "disconnected"),
        (3, "connected"),
        (4, "firmware update"),
        (5, "state 5"),
        (u32::MAX, "state 4294967295"),
    ];
    for (raw, text) in states {
        assert_eq!(NetworkState::from(raw).to_string(), text);
        let bytes = frame(0x0A, 0, &raw.to_le_bytes());
        assert_eq!(contents(&bytes), format!("{text}, in 4 bytes"));
    }
}
