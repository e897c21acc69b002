//! Every recorded frame, and noise, through the functions of the header: the same as in Rust.

use std::{path::Path, ptr::null};

use axlewire::{
    encode::Encode,
    error::EncodeError,
    ikeya::{self, three},
    sim::Rng,
    stream::{Decoder, Event, Framing, Reason},
    ucp::{
        Body, Frame, MotorControl, RawFrame, Ucp,
        message::{Message, SetNetworkState},
    },
};
use axlewire_c::*;
use serde_json::Value;

struct Vector {
    protocol: String,
    bytes: Vec<u8>,
    fields: Value,
}

fn hex(text: &str) -> Vec<u8> {
    let byte = |at: usize| u8::from_str_radix(&text[at..at + 2], 16).unwrap();
    (0..text.len()).step_by(2).map(byte).collect()
}

fn vectors(file: &str) -> Vec<Vector> {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/vectors").join(file);
    let text = std::fs::read_to_string(path).unwrap();
    let vector = |line: &str| {
        let mut line: Value = serde_json::from_str(line).unwrap();
        Vector {
            protocol: line["protocol"].as_str().unwrap().to_owned(),
            bytes: hex(line["hex"].as_str().unwrap()),
            fields: line["fields"].take(),
        }
    };
    text.lines().map(vector).collect()
}

fn int<T: TryFrom<i64>>(value: &Value) -> T {
    let value = value.as_i64().unwrap_or_else(|| panic!("no number: {value}"));
    T::try_from(value).ok().unwrap()
}

/// One number, or a list of them, padded with zeros.
fn ints<const N: usize>(value: &Value) -> [i16; N] {
    let mut numbers = [0; N];
    match value.as_array() {
        Some(list) => list.iter().zip(&mut numbers).for_each(|(value, to)| *to = int(value)),
        None => numbers[0] = int(value),
    }
    numbers
}

fn bits(value: &Value) -> [u32; 3] {
    let one = |value: &Value| {
        let text = value.as_str().unwrap();
        u32::from_str_radix(text.trim_start_matches("0x"), 16).unwrap()
    };
    let mut numbers = [0; 3];
    match value.as_array() {
        Some(list) => list.iter().zip(&mut numbers).for_each(|(value, to)| *to = one(value)),
        None => numbers[0] = one(value),
    }
    numbers
}

fn encode_ikeya(packet: &axle_ikeya_packet) -> Result<Vec<u8>, axle_result> {
    let (mut to, mut length) = ([0xEE; 16], 99);
    match axle_ikeya_encode(packet, to.as_mut_ptr(), to.len(), &mut length) {
        AXLE_OK => Ok(to[..length].to_vec()),
        error => {
            assert_eq!((to, length), ([0xEE; 16], 99), "a failed call has written");
            Err(error)
        }
    }
}

fn encode_ucp(message: &axle_ucp_message) -> Result<Vec<u8>, axle_result> {
    let (mut to, mut length) = ([0xEE; 64], 99);
    match axle_ucp_encode(message, to.as_mut_ptr(), to.len(), &mut length) {
        AXLE_OK => Ok(to[..length].to_vec()),
        error => {
            assert_eq!((to, length), ([0xEE; 64], 99), "a failed call has written");
            Err(error)
        }
    }
}

#[test]
fn every_packet_of_a_motor_bus_has_its_fields_in_c_and_is_encoded_again() {
    let (mut whole, mut refused) = (0, 0);
    for vector in vectors("ikeya.jsonl") {
        let Vector { protocol, bytes, fields } = vector;
        let mut packet = axle_ikeya_packet::default();
        let result = axle_ikeya_parse(bytes.as_ptr(), bytes.len(), &mut packet);
        let (header, id) = (int::<u8>(&fields["header"]), int::<u8>(&fields["id"]));
        let refusal = match (fields["crc_ok"] == false, header) {
            (true, _) => Some(AXLE_ERROR_CRC),
            (_, 0xAA | 0xBB | 0x55 | 0x56) if (1..=8).contains(&id) => None,
            (_, 0x57) => Some(AXLE_ERROR_FIELD),
            _ => Some(AXLE_ERROR_NODE_ID),
        };
        if let Some(reason) = refusal {
            assert_eq!(result, reason, "{bytes:02x?}");
            assert_eq!(packet, axle_ikeya_packet::default());
            refused += 1;
            continue;
        }
        assert_eq!(result, AXLE_OK, "{bytes:02x?}");
        whole += 1;
        assert_eq!(packet.node, id);
        let kinds: &[u8] = match header {
            0xAA => &[AXLE_IKEYA_PACKET_READ],
            0xBB => &[AXLE_IKEYA_PACKET_WRITE_VELOCITY, AXLE_IKEYA_PACKET_WRITE_POSITION],
            0x55 => &[AXLE_IKEYA_PACKET_VELOCITY],
            _ => &[AXLE_IKEYA_PACKET_POSITION],
        };
        if header == 0xBB {
            assert_eq!(packet.kind, AXLE_IKEYA_PACKET_WRITE);
            assert_eq!(encode_ikeya(&packet), Err(AXLE_ERROR_VALUE));
        } else {
            assert_eq!(packet.kind, kinds[0]);
        }
        let three = protocol == "ikeya-md-3motor";
        if header != 0xAA {
            assert_eq!(packet.motors, if three { 3 } else { 1 });
        }
        if fields["rps_bits"] != Value::Null {
            assert_eq!(packet.velocity_rps.map(f32::to_bits), bits(&fields["rps_bits"]));
        } else if fields["count"] != Value::Null {
            assert_eq!(packet.position.map(|it| it.count), ints(&fields["count"]));
            assert_eq!(packet.position.map(|it| it.rotation), ints(&fields["rotation"]));
        }
        for &kind in kinds {
            let again = encode_ikeya(&axle_ikeya_packet { kind, ..packet });
            let speeds =
                matches!(kind, AXLE_IKEYA_PACKET_WRITE_VELOCITY | AXLE_IKEYA_PACKET_VELOCITY);
            if speeds && packet.velocity_rps.iter().any(|rps| !rps.is_finite()) {
                assert_eq!(again, Err(AXLE_ERROR_NOT_FINITE));
            } else {
                assert_eq!(again.as_ref(), Ok(&bytes));
            }
        }
        damage(&bytes, |damaged| {
            axle_ikeya_parse(damaged.as_ptr(), damaged.len(), &mut axle_ikeya_packet::default())
        });
    }
    assert_eq!((whole, refused), (83, 10));
}

#[test]
fn every_message_of_a_rover_has_its_fields_in_c_and_is_encoded_again() {
    let (mut same, mut refused) = (0, 0);
    for Vector { mut bytes, fields, .. } in vectors("ucp.jsonl") {
        let trailing = fields["trailing_bytes"].as_str().map_or(0, |hex| hex.len() / 2);
        bytes.truncate(bytes.len() - trailing);
        let mut message = axle_ucp_message::default();
        assert_eq!(axle_ucp_parse(bytes.as_ptr(), bytes.len(), &mut message), AXLE_OK);
        has_fields(&message, &fields, bytes.len());

        let (frame, again) = (Frame::parse(&bytes).unwrap(), encode_ucp(&message));
        match expected(frame, &message) {
            Ok(built) => {
                assert_eq!(again.as_ref(), Ok(&built));
                assert_eq!(built, bytes);
                same += 1;
            }
            Err(error) => {
                assert_eq!(again, Err(error), "{message:?}");
                refused += 1;
            }
        }
        damage(&bytes, |damaged| {
            axle_ucp_parse(damaged.as_ptr(), damaged.len(), &mut axle_ucp_message::default())
        });
    }
    assert_eq!((same, refused), (71, 13));
}

/// What Rust builds of the message, or why it refuses; it has no call for the rest.
fn expected(frame: &Frame, message: &axle_ucp_message) -> Result<Vec<u8>, axle_result> {
    let index = frame.index();
    match frame.message() {
        Message::MotorControl(raw) => match MotorControl::try_from(*raw) {
            Err(EncodeError::StartsUpdate { .. }) => Err(AXLE_ERROR_STARTS_UPDATE),
            Err(EncodeError::Percent { .. }) => Err(AXLE_ERROR_PERCENT),
            Err(other) => panic!("{other:?}"),
            Ok(_) if raw.version() != 0 || raw.back_led() != 0 => Err(AXLE_ERROR_VALUE),
            Ok(_) if ![0, 100].contains(&raw.front_led()) => Err(AXLE_ERROR_VALUE),
            Ok(command) => Ok(command.frame(index).as_bytes().to_vec()),
        },
        Message::SetNetworkState(it) => match SetNetworkState::new(it.state()) {
            Ok(message) => Ok(message.frame(index).as_bytes().to_vec()),
            Err(error) => panic!("{error:?}"),
        },
        Message::SetNetworkStateWide(_) => Err(AXLE_ERROR_VALUE),
        Message::Unknown(raw) => {
            assert_eq!(message.body_length, raw.body.len());
            match (RawFrame { ..raw }).encode(&mut [0; 64]) {
                Ok(bytes) => Ok(bytes.to_vec()),
                Err(EncodeError::KnownId { .. }) => Err(AXLE_ERROR_KNOWN_ID),
                Err(other) => panic!("{other:?}"),
            }
        }
        _ => Ok(frame.as_bytes().to_vec()),
    }
}

/// Compares the message with the recorded fields.
fn has_fields(message: &axle_ucp_message, fields: &Value, length: usize) {
    let mut expected = axle_ucp_message {
        id: int(&fields["id"]),
        index: int(&fields["index"]),
        kind: match (int::<u8>(&fields["id"]), length) {
            (1, 8) => AXLE_UCP_PING,
            (1, 9) => AXLE_UCP_PONG,
            (2, _) => AXLE_UCP_MOTOR_CONTROL,
            (3, 9) => AXLE_UCP_CALIBRATION_START,
            (3, 10) => AXLE_UCP_CALIBRATION_START_ACK,
            (4, 9) => AXLE_UCP_CALIBRATION_END,
            (4, 10) => AXLE_UCP_CALIBRATION_END_ACK,
            (5, 44) => AXLE_UCP_REPORT,
            (5, 42) => AXLE_UCP_DOCUMENT_REPORT,
            (6, 20) => AXLE_UCP_IMU_BIAS,
            (6, 9) => AXLE_UCP_IMU_BIAS_ACK,
            (7, 14) => AXLE_UCP_MAG_BIAS,
            (7, 9) => AXLE_UCP_MAG_BIAS_ACK,
            (8, 8) => AXLE_UCP_BIAS_REQUEST,
            (8, 27) => AXLE_UCP_BIASES,
            (9, 10) => AXLE_UCP_OTA_REQUEST,
            (9, 9) => AXLE_UCP_OTA_ACK,
            (10, 9) => AXLE_UCP_SET_NETWORK_STATE,
            (10, 12) => AXLE_UCP_SET_NETWORK_STATE_WIDE,
            _ => AXLE_UCP_UNKNOWN,
        },
        ..axle_ucp_message::default()
    };
    for (name, value) in fields.as_object().unwrap() {
        let of = &mut expected;
        match name.as_str() {
            "err" if of.kind == AXLE_UCP_OTA_ACK => of.ota_status = int(value),
            "err" => of.err = int(value),
            "type" => of.calibration = int(value),
            "acc_bias" => of.imu_bias.acc = ints(value),
            "gyro_bias" => of.imu_bias.gyro = ints(value),
            "mag_bias" => of.mag_bias.mag = ints(value),
            "state" => of.network_state = int(value),
            "version" => of.version = int::<i64>(value) as u16 as i16,
            "speed" => of.speed_pct = int(value),
            "angular" => of.turn_pct = int(value),
            "front_led" => of.front_led = int(value),
            "back_led" => of.back_led = int(value),
            "battery_pct" => of.telemetry.battery_pct = int(value),
            "rpm" => of.telemetry.rpm = ints(value),
            "acc" => of.telemetry.acc = ints(value),
            "gyro" => of.telemetry.gyro = ints(value),
            "mag" => of.telemetry.mag = ints(value),
            "heading" => of.telemetry.heading_deg = int(value),
            "power_w" => of.telemetry.power_w = int(value),
            "voltage_dv" => of.telemetry.voltage_dv = int(value),
            "current_ca" => of.telemetry.current_ca = int(value),
            "body" => {
                let body = hex(value.as_str().unwrap());
                // SAFETY: a parsed body is in the frame, which still lives.
                let parsed =
                    unsafe { std::slice::from_raw_parts(message.body, message.body_length) };
                assert_eq!(parsed, body);
                (of.body, of.body_length) = (message.body, message.body_length);
            }
            _ => {}
        }
    }
    assert_eq!(format!("{message:?}"), format!("{expected:?}"));
}

/// A frame with any wrong bit, or with a byte more or less, is an error.
fn damage(bytes: &[u8], parse: impl Fn(&[u8]) -> axle_result) {
    for bit in 0..bytes.len() * 8 {
        let mut damaged = bytes.to_vec();
        damaged[bit / 8] ^= 1 << (bit % 8);
        assert!(parse(&damaged) < 0, "{damaged:02x?}");
    }
    for other in [&bytes[..bytes.len() - 1], &[bytes, &[0]].concat()] {
        match bytes.len() {
            // Of another length it is no packet of three motors: judged by its first 8 bytes.
            16 => assert_eq!(parse(other), AXLE_ERROR_CRC),
            _ => assert_eq!(parse(other), AXLE_ERROR_LENGTH),
        }
    }
}

#[test]
fn the_crc_is_that_of_the_crate() {
    let mut rng = Rng::new(5);
    for length in 0..600 {
        let bytes: Vec<u8> = (0..length).map(|_| rng.byte()).collect();
        assert_eq!(axle_crc16(bytes.as_ptr(), length), axlewire::crc16::compute(&bytes));
    }
    assert_eq!(axle_crc16(null(), 5), 0xFFFF);
    assert_eq!(axle_crc16(b"123456789".as_ptr(), 9), 0x4B37);
}

/// An event with its numbers of the header.
#[derive(Debug, PartialEq)]
enum Told {
    Frame(Vec<u8>),
    Gap(u8, u64),
}

/// What both sides do.
trait Stream {
    /// The next event of the bytes, and how many are left.
    fn decode(&mut self, input: &mut &[u8]) -> Option<Told>;
    /// The next events of the bytes, at most so many.
    fn decode_many(&mut self, input: &mut &[u8], capacity: usize) -> Vec<Told>;
    fn push(&mut self, byte: u8) -> bool;
    fn poll(&mut self) -> Option<Told>;
    /// Writes as many bytes as there is room for; returns their number.
    fn write(&mut self, bytes: &[u8]) -> usize;
    fn idle(&mut self);
    fn pending(&self) -> usize;
    fn counters(&self) -> [u64; 9];
}

trait Bytes {
    fn copy(&self) -> Vec<u8>;
}

macro_rules! bytes {
    ($($frame:ty),*) => {
        $(impl Bytes for $frame {
            fn copy(&self) -> Vec<u8> {
                self.as_bytes().to_vec()
            }
        })*
    };
}
bytes!(ikeya::Request<'_>, ikeya::Response<'_>, ikeya::Packet<'_>);
bytes!(three::Request<'_>, three::Response<'_>, three::Packet<'_>, &Frame);

fn told<F: Bytes>(event: Event<F>) -> Told {
    match event {
        Event::Frame(frame) => Told::Frame(frame.copy()),
        Event::Skipped(gap) => {
            let reason = match gap.reason {
                Reason::Crc => 1,
                Reason::Header => 2,
                Reason::Id => 3,
                Reason::Length => 4,
                Reason::Idle => 5,
                other => panic!("{other:?}"),
            };
            Told::Gap(reason, gap.len)
        }
    }
}

impl<F: Framing, const N: usize> Stream for Decoder<F, N>
where
    for<'a> F::Frame<'a>: Bytes,
{
    fn decode(&mut self, input: &mut &[u8]) -> Option<Told> {
        self.decode(input).map(told)
    }

    fn decode_many(&mut self, input: &mut &[u8], capacity: usize) -> Vec<Told> {
        (0..capacity).map_while(|_| self.decode(input).map(told)).collect()
    }

    fn push(&mut self, byte: u8) -> bool {
        self.push(byte)
    }

    fn poll(&mut self) -> Option<Told> {
        self.poll().map(told)
    }

    fn write(&mut self, bytes: &[u8]) -> usize {
        let spare = self.spare();
        let count = spare.len().min(bytes.len());
        spare[..count].copy_from_slice(&bytes[..count]);
        self.commit(count);
        count
    }

    fn idle(&mut self) {
        self.idle();
    }

    fn pending(&self) -> usize {
        self.pending()
    }

    fn counters(&self) -> [u64; 9] {
        let it = self.counters();
        [it.received, it.frames, it.framed, it.gaps, it.crc, it.header, it.id, it.length, it.idle]
    }
}

type DecodeMany<M> = extern "C" fn(
    *mut M,
    *mut *const u8,
    *mut usize,
    *mut axle_stream_event,
    usize,
    *mut usize,
) -> i32;

/// A decoder of C with its functions.
struct InC<M> {
    memory: Box<M>,
    decode: extern "C" fn(*mut M, *mut *const u8, *mut usize, *mut axle_stream_event) -> i32,
    decode_many: DecodeMany<M>,
    push: extern "C" fn(*mut M, u8) -> i32,
    poll: extern "C" fn(*mut M, *mut axle_stream_event) -> i32,
    spare: extern "C" fn(*mut M, *mut *mut u8, *mut usize) -> i32,
    commit: extern "C" fn(*mut M, usize) -> i32,
    idle: extern "C" fn(*mut M) -> i32,
    pending: extern "C" fn(*const M, *mut usize) -> i32,
    counters: extern "C" fn(*const M, *mut axle_counters) -> i32,
}

fn nothing() -> axle_stream_event {
    axle_stream_event { kind: 77, reason: 77, bytes: null(), length: 77, skipped: 77 }
}

fn event_of(result: axle_result, event: axle_stream_event) -> Option<Told> {
    match (result, event.kind) {
        (AXLE_NONE, 77) => None,
        (AXLE_OK, AXLE_STREAM_FRAME) => {
            assert_eq!((event.reason, event.skipped), (0, 0));
            // SAFETY: the frame is in the bytes handed in or in the decoder, and neither has
            // changed since.
            let frame = unsafe { std::slice::from_raw_parts(event.bytes, event.length) };
            Some(Told::Frame(frame.to_vec()))
        }
        (AXLE_OK, AXLE_STREAM_SKIPPED) => {
            assert!(event.bytes.is_null() && event.length == 0);
            Some(Told::Gap(event.reason, event.skipped))
        }
        other => panic!("{other:?}"),
    }
}

impl<M> Stream for InC<M> {
    fn decode(&mut self, input: &mut &[u8]) -> Option<Told> {
        let (mut data, mut length, mut event) = (input.as_ptr(), input.len(), nothing());
        let result = (self.decode)(&mut *self.memory, &mut data, &mut length, &mut event);
        *input = &input[input.len() - length..];
        assert_eq!(data, input.as_ptr());
        event_of(result, event)
    }

    fn decode_many(&mut self, input: &mut &[u8], capacity: usize) -> Vec<Told> {
        let (mut data, mut length, mut count) = (input.as_ptr(), input.len(), 77);
        let mut events: Vec<_> = (0..=capacity).map(|_| nothing()).collect();
        let (memory, at) = (&mut *self.memory, events.as_mut_ptr());
        let result = (self.decode_many)(memory, &mut data, &mut length, at, capacity, &mut count);
        *input = &input[input.len() - length..];
        assert_eq!(data, input.as_ptr());
        assert_eq!(result, if count > 0 { AXLE_OK } else { AXLE_NONE });
        assert!(count <= capacity && events[count..].iter().all(|event| event.kind == 77));
        events.into_iter().take(count).filter_map(|event| event_of(result, event)).collect()
    }

    fn push(&mut self, byte: u8) -> bool {
        match (self.push)(&mut *self.memory, byte) {
            AXLE_OK => true,
            AXLE_NONE => false,
            other => panic!("{other}"),
        }
    }

    fn poll(&mut self) -> Option<Told> {
        let mut event = nothing();
        let result = (self.poll)(&mut *self.memory, &mut event);
        event_of(result, event)
    }

    fn write(&mut self, bytes: &[u8]) -> usize {
        let (mut to, mut room) = (std::ptr::null_mut(), 0);
        assert_eq!((self.spare)(&mut *self.memory, &mut to, &mut room), AXLE_OK);
        let count = room.min(bytes.len());
        // SAFETY: there is room for so many bytes until the next call.
        unsafe { std::ptr::copy_nonoverlapping(bytes.as_ptr(), to, count) };
        assert_eq!((self.commit)(&mut *self.memory, count), AXLE_OK);
        count
    }

    fn idle(&mut self) {
        assert_eq!((self.idle)(&mut *self.memory), AXLE_OK);
    }

    fn pending(&self) -> usize {
        let mut count = 0;
        assert_eq!((self.pending)(&*self.memory, &mut count), AXLE_OK);
        count
    }

    fn counters(&self) -> [u64; 9] {
        let mut it = axle_counters::default();
        assert_eq!((self.counters)(&*self.memory, &mut it), AXLE_OK);
        let skipped =
            [it.skipped_crc, it.skipped_header, it.skipped_id, it.skipped_length, it.skipped_idle];
        let [crc, header, id, length, idle] = skipped;
        [it.received, it.frames, it.framed, it.gaps, crc, header, id, length, idle]
    }
}

fn ikeya_in_c(framing: u8) -> InC<axle_ikeya_decoder> {
    let mut memory = Box::<axle_ikeya_decoder>::new_uninit();
    let result = axle_ikeya_decoder_init(memory.as_mut_ptr(), AXLE_IKEYA_DECODER_SIZE, framing);
    assert_eq!(result, AXLE_OK);
    InC {
        // SAFETY: it is initialised.
        memory: unsafe { memory.assume_init() },
        decode: axle_ikeya_decoder_decode,
        decode_many: axle_ikeya_decoder_decode_many,
        push: axle_ikeya_decoder_push,
        poll: axle_ikeya_decoder_poll,
        spare: axle_ikeya_decoder_spare,
        commit: axle_ikeya_decoder_commit,
        idle: axle_ikeya_decoder_idle,
        pending: axle_ikeya_decoder_get_pending,
        counters: axle_ikeya_decoder_get_counters,
    }
}

fn ucp_in_c() -> InC<axle_ucp_decoder> {
    let mut memory = Box::<axle_ucp_decoder>::new_uninit();
    assert_eq!(axle_ucp_decoder_init(memory.as_mut_ptr(), AXLE_UCP_DECODER_SIZE), AXLE_OK);
    InC {
        // SAFETY: it is initialised.
        memory: unsafe { memory.assume_init() },
        decode: axle_ucp_decoder_decode,
        decode_many: axle_ucp_decoder_decode_many,
        push: axle_ucp_decoder_push,
        poll: axle_ucp_decoder_poll,
        spare: axle_ucp_decoder_spare,
        commit: axle_ucp_decoder_commit,
        idle: axle_ucp_decoder_idle,
        pending: axle_ucp_decoder_get_pending,
        counters: axle_ucp_decoder_get_counters,
    }
}

/// A file of frames, and a decoder for it in C and in Rust.
type Pair = (&'static str, Box<dyn Stream>, Box<dyn Stream>);

/// Both decoders of each framing.
fn pairs() -> Vec<Pair> {
    fn rust<F: Framing, const N: usize>(decoder: Decoder<F, N>) -> Box<dyn Stream>
    where
        Decoder<F, N>: Stream + 'static,
    {
        Box::new(decoder)
    }
    let in_c = |framing| -> Box<dyn Stream> { Box::new(ikeya_in_c(framing)) };
    let one = "ikeya.jsonl";
    vec![
        (one, in_c(AXLE_IKEYA_TO_SLAVE), rust(ikeya::Decoder::<ikeya::ToSlave>::new())),
        (one, in_c(AXLE_IKEYA_TO_MASTER), rust(ikeya::Decoder::<ikeya::ToMaster>::new())),
        (one, in_c(AXLE_IKEYA_BOTH_DIRECTIONS), {
            rust(ikeya::Decoder::<ikeya::BothDirections>::new())
        }),
        (one, in_c(AXLE_IKEYA3_TO_SLAVE), rust(three::Decoder::<three::ToSlave>::new())),
        (one, in_c(AXLE_IKEYA3_TO_MASTER), rust(three::Decoder::<three::ToMaster>::new())),
        (one, in_c(AXLE_IKEYA3_BOTH_DIRECTIONS), {
            rust(three::Decoder::<three::BothDirections>::new())
        }),
        ("ucp.jsonl", Box::new(ucp_in_c()), rust(Decoder::<Ucp, 64>::new())),
    ]
}

/// How bytes are handed in.
#[derive(Clone, Copy, Debug)]
enum Way {
    Chunks,
    Pushed,
    Written,
    Many,
    Mixed,
}

const WAYS: [Way; 5] = [Way::Chunks, Way::Pushed, Way::Written, Way::Many, Way::Mixed];

/// Hands the same bytes in on both sides, and compares all that is told; returns the frames.
fn side_by_side(
    c: &mut dyn Stream,
    rust: &mut dyn Stream,
    mut bytes: &[u8],
    way: Way,
    quiet: f64,
    rng: &mut Rng,
) -> usize {
    let mut frames = 0;
    let mut poll = |c: &mut dyn Stream, rust: &mut dyn Stream| {
        loop {
            let (told, expected) = (c.poll(), rust.poll());
            assert_eq!(told, expected);
            match told {
                Some(Told::Frame(_)) => frames += 1,
                Some(_) => {}
                None => break,
            }
        }
    };
    let mut by_decode = 0;
    while !bytes.is_empty() {
        let count = 1 + rng.below(90) as usize;
        let (mut chunk, rest) = bytes.split_at(count.min(bytes.len()));
        let turn = match way {
            Way::Mixed => WAYS[rng.below(4) as usize],
            way => way,
        };
        match turn {
            Way::Pushed => {
                for &byte in chunk {
                    assert_eq!(c.push(byte), rust.push(byte));
                    poll(c, rust);
                }
            }
            Way::Written => {
                while !chunk.is_empty() {
                    let taken = c.write(chunk);
                    assert_eq!(taken, rust.write(chunk));
                    assert!(taken > 0);
                    chunk = &chunk[taken..];
                    poll(c, rust);
                }
            }
            Way::Many => {
                let mut same = chunk;
                loop {
                    let many = c.decode_many(&mut chunk, 1 + rng.below(9) as usize);
                    for told in &many {
                        assert_eq!(rust.decode(&mut same).as_ref(), Some(told));
                        by_decode += usize::from(matches!(told, Told::Frame(_)));
                    }
                    if many.is_empty() {
                        break;
                    }
                }
                assert_eq!((rust.decode(&mut same), chunk, same), (None, &[][..], &[][..]));
            }
            Way::Chunks | Way::Mixed => loop {
                let mut same = chunk;
                let (told, expected) = (c.decode(&mut chunk), rust.decode(&mut same));
                assert_eq!((&told, chunk.len()), (&expected, same.len()));
                match told {
                    Some(Told::Frame(_)) => by_decode += 1,
                    Some(_) => {}
                    None => break,
                }
            },
        }
        assert_eq!((c.pending(), c.counters()), (rust.pending(), rust.counters()));
        if rng.chance(quiet) {
            c.idle();
            rust.idle();
            poll(c, rust);
        }
        bytes = rest;
    }
    while c.pending() > 0 {
        c.idle();
        rust.idle();
        poll(c, rust);
    }
    assert_eq!((c.pending(), c.counters()), (0, rust.counters()));
    frames + by_decode
}

#[test]
fn every_recorded_frame_is_decoded_in_c_as_in_rust_however_it_arrives() {
    let mut rng = Rng::new(1);
    for way in WAYS {
        let mut frames = Vec::new();
        for (file, mut c, mut rust) in pairs() {
            let mut found = 0;
            for Vector { bytes, .. } in vectors(file) {
                found += side_by_side(&mut *c, &mut *rust, &bytes, way, 0.0, &mut rng);
            }
            frames.push(found);
        }
        // All of its own in both directions; a READ is the same for both boards.
        let (one, three, rover) = (frames[2], frames[5], frames[6]);
        assert!(one >= 66 && three >= 17 && rover == 84, "{way:?}: {frames:?}");
    }
}

#[test]
fn noise_with_frames_in_it_is_told_in_c_as_in_rust_event_for_event() {
    let mut rng = Rng::new(2);
    let mut frames = vec![0; 7];
    for (place, (file, mut c, mut rust)) in pairs().into_iter().enumerate() {
        let vectors = vectors(file);
        for round in 0..400 {
            let mut stream = Vec::new();
            while stream.len() < 1000 {
                let frame = &vectors[rng.below(vectors.len() as u64) as usize].bytes;
                match rng.below(6) {
                    0 => stream.extend((0..rng.below(60)).map(|_| rng.byte())),
                    1 => {
                        let starts = [0xAA, 0xBB, 0x55, 0x56, 0xFD, 0xFF, 0x04, 0x28, 1, 2, 0];
                        let start = |_| starts[rng.below(11) as usize];
                        stream.extend((0..20).map(start));
                    }
                    2 => stream.extend(&frame[..rng.below(frame.len() as u64) as usize]),
                    3 => {
                        let mut damaged = frame.clone();
                        damaged[rng.below(frame.len() as u64) as usize] ^= 1 << rng.below(8);
                        stream.extend(damaged);
                    }
                    _ => stream.extend(frame),
                }
            }
            let way = WAYS[round % 5];
            frames[place] += side_by_side(&mut *c, &mut *rust, &stream, way, 0.02, &mut rng);
        }
    }
    assert!(frames.iter().all(|found| *found > 400), "{frames:?}");
}
