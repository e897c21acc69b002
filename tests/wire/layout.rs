//! Size, alignment and offset of every wire struct: the struct is the layout.

#![cfg(all(feature = "ikeya", feature = "ucp"))]

use axlewire::{ikeya, ucp};

use crate::rig::*;

/// Asserts length and alignment 1 of a packet.
macro_rules! is_packed {
    ($($packet:ty: $len:expr),+ $(,)?) => {$(
        assert_eq!((size_of::<$packet>(), align_of::<$packet>()), ($len, 1), stringify!($packet));
    )+};
}

#[test]
fn ikeya_packets_have_their_size_and_no_alignment() {
    is_packed! {
        ReadRequest: 4,
        WriteRequest: 8,
        VelocityResponse: 8,
        PositionResponse: 8,
        three::WriteRequest: 16,
        three::VelocityResponse: 16,
        three::PositionResponse: 16,
        NodeId: 1,
    }
    assert_eq!(ReadRequest::LEN, 4);
    assert_eq!(WriteRequest::LEN, ikeya::MAX_LEN);
    assert_eq!(three::WriteRequest::LEN, three::MAX_LEN);
}

#[test]
fn ucp_bodies_and_frames_have_their_size_and_no_alignment() {
    is_packed! {
        ucp::Header: 6,
        Ping: 0,
        Pong: 1,
        MotorControl: 16,
        RawMotorControl: 16,
        CalibrationStart: 1,
        CalibrationStartAck: 2,
        CalibrationEnd: 1,
        CalibrationEndAck: 2,
        FirmwareReport: 36,
        DocumentReport: 34,
        ImuBias: 12,
        ImuBiasAck: 1,
        MagBias: 6,
        MagBiasAck: 1,
        BiasRequest: 0,
        Biases: 19,
        OtaRequest: 2,
        RawOtaRequest: 2,
        OtaAck: 1,
        SetNetworkState: 1,
        SetNetworkStateWide: 4,
        FrameOf<Ping>: 8,
        FrameOf<MotorControl>: 24,
        FrameOf<FirmwareReport>: 44,
        FrameOf<DocumentReport>: 42,
        FrameOf<Biases>: 27,
    }
    assert_eq!(FrameOf::<FirmwareReport>::LEN, 44);
    assert_eq!((ucp::MAX_LEN, ucp::SYNC), (64, [0xFD, 0xFF]));
}

#[test]
fn ikeya_fields_have_the_documented_offsets() {
    #[track_caller]
    fn begins(packet: &[u8], bytes: &[u8]) {
        assert_eq!(packet[..bytes.len()], *bytes);
    }
    let id = NodeId::N7;
    let rps = |bits| Rps::new(f32::from_bits(bits)).unwrap();
    let position = Position::new(0x1234, 0x5678);
    begins(ReadRequest::new(id).as_bytes(), &[0xAA, 7]);
    begins(
        WriteRequest::velocity(id, rps(0x4433_2211)).as_bytes(),
        &[0xBB, 7, 0x11, 0x22, 0x33, 0x44],
    );
    begins(WriteRequest::position(id, position).as_bytes(), &[0xBB, 7, 0x34, 0x12, 0x78, 0x56]);
    begins(
        VelocityResponse::new(id, rps(0x4433_2211)).as_bytes(),
        &[0x55, 7, 0x11, 0x22, 0x33, 0x44],
    );
    begins(PositionResponse::new(id, position).as_bytes(), &[0x56, 7, 0x34, 0x12, 0x78, 0x56]);
}

#[test]
fn three_motor_positions_are_three_counts_then_three_rotations() {
    let positions = [Position::new(1, -1), Position::new(2, -2), Position::new(3, -3)];
    let packet = three::PositionResponse::new(NodeId::N8, positions);
    let expected = [0x56, 8, 1, 0, 2, 0, 3, 0, 0xFF, 0xFF, 0xFE, 0xFF, 0xFD, 0xFF];
    assert_eq!(packet.as_bytes()[..14], expected);
    assert_eq!(
        three::WriteRequest::position(NodeId::N8, positions).as_bytes()[2..14],
        expected[2..]
    );
    let speeds = [1.0, -2.0, 3.5].map(|rps| Rps::new(rps).unwrap());
    let packet = three::VelocityResponse::new(NodeId::N1, speeds);
    assert_eq!(packet.as_bytes()[2..14], [0, 0, 0x80, 0x3F, 0, 0, 0, 0xC0, 0, 0, 0x60, 0x40]);
}

/// Values whose bytes are all different, so that a swapped field cannot hide.
fn telemetry() -> Telemetry {
    Telemetry {
        battery_pct: 0x0201,
        rpm: [0x0403, 0x0605, 0x0807, 0x0A09],
        acc: [0x0C0B, 0x0E0D, 0x100F],
        gyro: [0x1211, 0x1413, 0x1615],
        mag: [0x1817, 0x1A19, 0x1C1B],
        heading_deg: 0x1E1D,
        power_w: 0x1F,
        voltage_dv: 0x20,
        current_ca: 0x2221,
    }
}

#[test]
fn the_firmware_report_is_in_the_order_of_the_firmware() {
    let frame = FirmwareReport::new(&telemetry(), 0x2423).frame(9);
    let body: Vec<u8> = (1..=36).collect();
    assert_eq!(frame.as_bytes()[..6], [0xFD, 0xFF, 40, 0, 5, 9]);
    assert_eq!(frame.as_bytes()[6..42], body);
}

#[test]
fn the_document_report_is_in_the_order_of_the_document() {
    let frame = DocumentReport::new(&telemetry()).frame(9);
    let body: Vec<u8> = (1..=10).chain(0x1F..=0x22).chain(0x0B..=0x1E).collect();
    assert_eq!(frame.as_bytes()[..6], [0xFD, 0xFF, 38, 0, 5, 9]);
    assert_eq!(frame.as_bytes()[6..40], body);
}

#[test]
fn motor_control_is_in_the_order_of_the_document() {
    let frame = MotorControl::new(-2, 100).unwrap().with_front_led(true).frame(3);
    let expected =
        [0xFD, 0xFF, 20, 0, 2, 3, 0xFE, 0xFF, 100, 0, 100, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0];
    assert_eq!(frame.as_bytes()[..22], expected);
}

#[cfg(feature = "bytemuck")]
#[test]
fn bytemuck_and_zerocopy_agree_on_what_is_a_packet() {
    use bytemuck::checked::try_from_bytes;
    use zerocopy::TryFromBytes;

    for header in 0..=u8::MAX {
        for id in 0..=u8::MAX {
            let bytes = [header, id, 1, 2, 3, 4, 5, 6];
            let by_zerocopy = [
                ReadRequest::try_ref_from_bytes(&bytes[..4]).is_ok(),
                WriteRequest::try_ref_from_bytes(&bytes).is_ok(),
                VelocityResponse::try_ref_from_bytes(&bytes).is_ok(),
                PositionResponse::try_ref_from_bytes(&bytes).is_ok(),
            ];
            let by_bytemuck = [
                try_from_bytes::<ReadRequest>(&bytes[..4]).is_ok(),
                try_from_bytes::<WriteRequest>(&bytes).is_ok(),
                try_from_bytes::<VelocityResponse>(&bytes).is_ok(),
                try_from_bytes::<PositionResponse>(&bytes).is_ok(),
            ];
            let good_id = (1..=8).contains(&id);
            let expected = [0xAA, 0xBB, 0x55, 0x56].map(|good| good_id && header == good);
            assert_eq!((by_zerocopy, by_bytemuck), (expected, expected), "{bytes:02x?}");
        }
    }
    let body = [7; 16];
    assert_eq!(bytemuck::from_bytes::<RawMotorControl>(&body).speed(), 0x0707);
}
