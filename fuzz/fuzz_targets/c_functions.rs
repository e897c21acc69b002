//! The functions of the C header in any order, with pointers that are right or null; the roles of
//! Rust tell what they have to do.
//!
//! Frames of C are compared by length and CRC, which `axle_crc16` reads: there is no `unsafe` here.
#![no_main]

use std::{
    mem::MaybeUninit,
    ptr::{null, null_mut},
};

use arbitrary::{Arbitrary, Unstructured};
use axlewire::{
    crc16,
    endpoint::{Arrival, Endpoint, Transmit, Unsent},
    ikeya::{
        self, BothDirections, Master, Mode, NodeId, Packet, Rps, Slave, master::MasterConfig,
        slave::SlaveConfig,
    },
    stream::Event,
    time::Instant,
    ucp::{
        self, Host, MotorControl, Robot, Telemetry,
        host::{HostConfig, MemoryStore},
        robot::RobotConfig,
    },
};
use axlewire_c::*;

/// A call that every role has.
#[derive(Arbitrary, Debug)]
enum Call<'a> {
    Input(&'a [u8]),
    OldInput(&'a [u8], u16),
    Timeout,
    Transmit,
    Sent(u8),
    Outdated,
    Deadline,
    Event,
    Command(u8, i16, i16),
}

#[derive(Arbitrary, Debug)]
struct Step<'a> {
    role: u8,
    later_us: u16,
    /// Whether a pointer is null, if there is one.
    null: bool,
    call: Call<'a>,
}

const fn outcome(number: u8) -> Option<Transmit> {
    Some(match number {
        1 => Transmit::Taken,
        2 => Transmit::Flushed,
        3 => Transmit::Unsent(Unsent::Untouched),
        4 => Transmit::Unsent(Unsent::CutOff),
        5 => Transmit::Unsent(Unsent::Unflushed),
        _ => return None,
    })
}

/// A call of the object of C and of the role of Rust.
macro_rules! role {
    ($step:expr, $now:expr, $c:expr, $rust:expr, $input:ident $old:ident $timeout:ident $transmit:ident $sent:ident $outdated:ident $deadline:ident $event:ident $told:ty) => {{
        let (c, now, null_pointer) = ($c, Instant::from_micros($now), $step.null);
        let object = if null_pointer { null_mut() } else { c };
        match &$step.call {
            Call::Input(bytes) => {
                let result = $input(object, bytes.as_ptr(), bytes.len(), $now);
                if null_pointer {
                    assert_eq!(result, AXLE_ERROR_NULL);
                } else {
                    assert_eq!(result, AXLE_OK);
                    $rust.handle_input(bytes, now);
                }
            }
            Call::OldInput(bytes, ago) => {
                let since = $now.saturating_sub((*ago).into());
                let from = if null_pointer { null() } else { bytes.as_ptr() };
                let result = $old(c, from, bytes.len(), since, $now);
                if null_pointer && !bytes.is_empty() {
                    assert_eq!(result, AXLE_ERROR_NULL);
                } else {
                    assert_eq!(result, AXLE_OK);
                    let since = Instant::from_micros(since);
                    $rust.handle_input(bytes, Arrival::Between { since, now });
                }
            }
            Call::Timeout if null_pointer => {
                assert_eq!($timeout(null_mut(), $now), AXLE_ERROR_NULL);
            }
            Call::Timeout => {
                assert_eq!($timeout(c, $now), AXLE_OK);
                $rust.handle_timeout(now);
            }
            Call::Transmit => {
                let (mut bytes, mut length) = (null(), 0);
                let to = if null_pointer { null_mut() } else { &mut length };
                let result = $transmit(c, $now, &mut bytes, to);
                if null_pointer {
                    assert_eq!((result, bytes), (AXLE_ERROR_NULL, null()));
                } else {
                    let frame = $rust.poll_transmit(now);
                    assert_eq!(result == AXLE_OK, frame.is_some());
                    if let Some(frame) = frame {
                        assert_eq!(length, frame.len());
                        assert_eq!(
                            axle_crc16(bytes, length - 2),
                            crc16::compute(&frame[..length - 2])
                        );
                        assert_eq!(axle_crc16(bytes, length), crc16::compute(frame));
                    }
                }
            }
            Call::Sent(number) => {
                let number = number % 8;
                let result = $sent(object, number, $now);
                match outcome(number) {
                    None => assert_eq!(result, AXLE_ERROR_VALUE),
                    Some(_) if null_pointer => assert_eq!(result, AXLE_ERROR_NULL),
                    Some(outcome) => {
                        assert_eq!(result, AXLE_OK);
                        $rust.handle_transmit(outcome, now);
                    }
                }
            }
            Call::Outdated => {
                let expected = match (null_pointer, $rust.is_outdated()) {
                    (true, _) => AXLE_ERROR_NULL,
                    (false, true) => AXLE_OK,
                    (false, false) => AXLE_NONE,
                };
                assert_eq!($outdated(object), expected);
            }
            Call::Deadline if null_pointer => {
                assert_eq!($deadline(c, null_mut()), AXLE_ERROR_NULL);
            }
            Call::Deadline => {
                let mut at = 0;
                let result = $deadline(c, &mut at);
                let expected = $rust.poll_timeout().map(Instant::as_micros);
                assert_eq!((result == AXLE_OK).then_some(at), expected);
            }
            Call::Event if null_pointer => assert_eq!($event(c, null_mut()), AXLE_ERROR_NULL),
            Call::Event => {
                let mut told = <$told>::default();
                let result = $event(c, &mut told);
                assert_eq!(result == AXLE_OK, $rust.poll_event().is_some());
                assert_eq!(result == AXLE_OK, told.kind != 0);
            }
            Call::Command(..) => {}
        }
    }};
}

/// The bytes of a frame.
trait Bytes {
    fn bytes(&self) -> &[u8];
}

impl Bytes for Packet<'_> {
    fn bytes(&self) -> &[u8] {
        self.as_bytes()
    }
}

impl Bytes for &ucp::Frame {
    fn bytes(&self) -> &[u8] {
        self.as_bytes()
    }
}

/// An event of C is that of Rust.
fn told<F: Bytes>(c: &axle_stream_event, rust: Option<Event<F>>) {
    match rust {
        Some(Event::Frame(frame)) => {
            let frame = frame.bytes();
            assert_eq!((c.kind, c.length), (AXLE_STREAM_FRAME, frame.len()));
            let crc = |length| (axle_crc16(c.bytes, length), crc16::compute(&frame[..length]));
            for length in [frame.len() - 2, frame.len()] {
                let (c, rust) = crc(length);
                assert_eq!(c, rust);
            }
        }
        Some(Event::Skipped(gap)) => {
            assert_eq!((c.kind, c.skipped), (AXLE_STREAM_SKIPPED, gap.len));
        }
        None => panic!("nothing"),
    }
}

const NO_EVENT: axle_stream_event =
    axle_stream_event { kind: 0, reason: 0, bytes: null(), length: 0, skipped: 0 };

/// A call of the decoder of C and of that of Rust.
macro_rules! decoder {
    ($step:expr, $c:expr, $rust:expr, $decode:ident $many:ident $push:ident $poll:ident $idle:ident) => {{
        let (c, rust, null_pointer) = ($c, $rust, $step.null);
        let object = if null_pointer { null_mut() } else { c };
        let mut event = NO_EVENT;
        match &$step.call {
            Call::Input(bytes) => {
                let (mut data, mut length, mut rest) = (bytes.as_ptr(), bytes.len(), *bytes);
                loop {
                    let result = $decode(object, &mut data, &mut length, &mut event);
                    if result != AXLE_OK {
                        let expected = if null_pointer { AXLE_ERROR_NULL } else { AXLE_NONE };
                        assert_eq!(result, expected);
                        break;
                    }
                    told(&event, rust.decode(&mut rest));
                }
                assert!(null_pointer || length == 0 && rust.decode(&mut rest).is_none());
            }
            Call::OldInput(bytes, capacity) => {
                let (mut data, mut length, mut rest) = (bytes.as_ptr(), bytes.len(), *bytes);
                let (mut events, mut count) = ([NO_EVENT; 8], 0);
                let (at, most) = (events.as_mut_ptr(), usize::from(capacity % 8) + 1);
                while $many(object, &mut data, &mut length, at, most, &mut count) == AXLE_OK {
                    assert!((1..=most).contains(&count));
                    for event in &events[..count] {
                        told(event, rust.decode(&mut rest));
                    }
                }
                assert!(null_pointer || length == 0 && rust.decode(&mut rest).is_none());
            }
            Call::Sent(byte) if !null_pointer => {
                let result = $push(c, *byte);
                assert_eq!(result != AXLE_NONE, rust.push(*byte));
            }
            Call::Timeout if !null_pointer => {
                assert_eq!($idle(c), AXLE_OK);
                rust.idle();
            }
            _ if null_pointer => assert_eq!($poll(c, null_mut()), AXLE_ERROR_NULL),
            _ => match $poll(c, &mut event) {
                AXLE_OK => told(&event, rust.poll()),
                _ => assert!(rust.poll().is_none()),
            },
        }
    }};
}

fn run(data: &[u8]) -> arbitrary::Result<()> {
    let mut input = Unstructured::new(data);
    let (mut now, start) = (0_u64, Instant::from_micros(0));

    let mut memory = MaybeUninit::<axle_ikeya_master>::uninit();
    let master = memory.as_mut_ptr();
    let mut config = MaybeUninit::uninit();
    assert_eq!(axle_ikeya_master_config_direct(config.as_mut_ptr()), AXLE_OK);
    let size = AXLE_IKEYA_MASTER_SIZE;
    assert_eq!(axle_ikeya_master_init(master, size, config.as_ptr(), now), AXLE_OK);
    let mut rust_master = Master::new(MasterConfig::direct(), start);

    let mut memory = MaybeUninit::<axle_ikeya_slave>::uninit();
    let slave = memory.as_mut_ptr();
    let mut config = MaybeUninit::uninit();
    assert_eq!(axle_ikeya_slave_config_direct(config.as_mut_ptr()), AXLE_OK);
    let size = AXLE_IKEYA_SLAVE_SIZE;
    assert_eq!(axle_ikeya_slave_init(slave, size, 1, 1, config.as_ptr(), now), AXLE_OK);
    let mut rust_slave = Slave::new(NodeId::N1, Mode::Velocity, SlaveConfig::direct(), start);

    let mut memory = MaybeUninit::<axle_ucp_host>::uninit();
    let host = memory.as_mut_ptr();
    let mut config = MaybeUninit::uninit();
    assert_eq!(axle_ucp_host_config_direct(config.as_mut_ptr()), AXLE_OK);
    assert_eq!(axle_ucp_host_init(host, AXLE_UCP_HOST_SIZE, config.as_ptr(), now), AXLE_OK);
    let mut rust_host = Host::with_store(HostConfig::direct(), MemoryStore::default(), start);

    let mut memory = MaybeUninit::<axle_ucp_robot>::uninit();
    let robot = memory.as_mut_ptr();
    let mut config = MaybeUninit::uninit();
    assert_eq!(axle_ucp_robot_config_direct(config.as_mut_ptr()), AXLE_OK);
    assert_eq!(axle_ucp_robot_init(robot, AXLE_UCP_ROBOT_SIZE, config.as_ptr(), now), AXLE_OK);
    let mut rust_robot = Robot::new(RobotConfig::direct(), start);

    let mut memory = MaybeUninit::<axle_ikeya_decoder>::uninit();
    let bus = memory.as_mut_ptr();
    let framing = AXLE_IKEYA_BOTH_DIRECTIONS;
    assert_eq!(axle_ikeya_decoder_init(bus, AXLE_IKEYA_DECODER_SIZE, framing), AXLE_OK);
    let mut rust_bus = ikeya::Decoder::<BothDirections>::new();

    let mut memory = MaybeUninit::<axle_ucp_decoder>::uninit();
    let rover = memory.as_mut_ptr();
    assert_eq!(axle_ucp_decoder_init(rover, AXLE_UCP_DECODER_SIZE), AXLE_OK);
    let mut rust_rover = ucp::Decoder::new();

    while !input.is_empty() {
        let step = Step::arbitrary(&mut input)?;
        now += u64::from(step.later_us);
        let at = Instant::from_micros(now);
        if let (Call::Command(which, a, b), false) = (&step.call, step.null) {
            match step.role % 6 {
                0 => of_master(master, &mut rust_master, *which, *a, now),
                1 => {
                    let rps = f32::from(*a) / 100.0;
                    assert_eq!(axle_ikeya_slave_set_velocity(slave, rps), AXLE_OK);
                    rust_slave.set_velocity(Rps::new(rps).unwrap_or(Rps::ZERO));
                }
                2 => of_host(host, &mut rust_host, *which, (*a, *b), now),
                4 | 5 => {}
                _ => {
                    let telemetry = axle_ucp_telemetry { heading_deg: *a, ..Default::default() };
                    let result = axle_ucp_robot_set_telemetry(robot, &telemetry, now);
                    assert_eq!(result, AXLE_OK);
                    let telemetry = Telemetry { heading_deg: *a, ..Telemetry::default() };
                    rust_robot.set_telemetry(&telemetry, at);
                    let result = axle_ucp_robot_answer_update(robot, *which, now);
                    let expected = rust_robot.answer_update((*which).into(), at);
                    assert_eq!(result == AXLE_OK, expected);
                }
            }
            continue;
        }
        match step.role % 6 {
            4 => decoder!(step, bus, &mut rust_bus,
                axle_ikeya_decoder_decode axle_ikeya_decoder_decode_many axle_ikeya_decoder_push
                axle_ikeya_decoder_poll axle_ikeya_decoder_idle),
            5 => decoder!(step, rover, &mut rust_rover,
                axle_ucp_decoder_decode axle_ucp_decoder_decode_many axle_ucp_decoder_push
                axle_ucp_decoder_poll axle_ucp_decoder_idle),
            0 => role!(step, now, master, rust_master, axle_ikeya_master_handle_input
                axle_ikeya_master_handle_old_input axle_ikeya_master_handle_timeout
                axle_ikeya_master_poll_transmit axle_ikeya_master_handle_transmit
                axle_ikeya_master_is_outdated axle_ikeya_master_next_deadline
                axle_ikeya_master_poll_event axle_ikeya_master_event),
            1 => role!(step, now, slave, rust_slave, axle_ikeya_slave_handle_input
                axle_ikeya_slave_handle_old_input axle_ikeya_slave_handle_timeout
                axle_ikeya_slave_poll_transmit axle_ikeya_slave_handle_transmit
                axle_ikeya_slave_is_outdated axle_ikeya_slave_next_deadline
                axle_ikeya_slave_poll_event axle_ikeya_slave_event),
            2 => role!(step, now, host, rust_host, axle_ucp_host_handle_input
                axle_ucp_host_handle_old_input axle_ucp_host_handle_timeout
                axle_ucp_host_poll_transmit axle_ucp_host_handle_transmit
                axle_ucp_host_is_outdated axle_ucp_host_next_deadline axle_ucp_host_poll_event
                axle_ucp_host_event),
            _ => role!(step, now, robot, rust_robot, axle_ucp_robot_handle_input
                axle_ucp_robot_handle_old_input axle_ucp_robot_handle_timeout
                axle_ucp_robot_poll_transmit axle_ucp_robot_handle_transmit
                axle_ucp_robot_is_outdated axle_ucp_robot_next_deadline axle_ucp_robot_poll_event
                axle_ucp_robot_event),
        }
    }
    Ok(())
}

/// A command to the master, for any node.
fn of_master(c: *mut axle_ikeya_master, rust: &mut Master, which: u8, speed: i16, now: u64) {
    let (number, at) = (which % 10, Instant::from_micros(now));
    let Ok(node) = NodeId::new(number) else {
        assert_eq!(axle_ikeya_master_stop(c, number, now), AXLE_ERROR_NODE_ID);
        return;
    };
    let accepted = match which / 10 % 7 {
        0 => {
            rust.discover(at);
            axle_ikeya_master_discover(c, now) == AXLE_OK
        }
        1 => {
            rust.stop(node, at);
            axle_ikeya_master_stop(c, number, now) == AXLE_OK
        }
        2 => {
            rust.stop_all(at);
            axle_ikeya_master_stop_all(c, now) == AXLE_OK
        }
        3 => {
            rust.release(node);
            axle_ikeya_master_release(c, number) == AXLE_OK
        }
        4 => {
            let accepted = rust.read(node, at).is_ok();
            accepted == (axle_ikeya_master_read(c, number, now) == AXLE_OK)
        }
        5 => {
            let accepted = rust.confirm(node, at).is_ok();
            accepted == (axle_ikeya_master_confirm(c, number, now) == AXLE_OK)
        }
        _ => {
            let rps = f32::from(speed) / 100.0;
            let target = Rps::new(rps).unwrap_or(Rps::ZERO);
            let accepted = rust.set_velocity(node, target, at).is_ok();
            accepted == (axle_ikeya_master_set_velocity(c, number, rps, now) == AXLE_OK)
        }
    };
    assert!(accepted);
}

/// A command to the host.
fn of_host(
    c: *mut axle_ucp_host,
    rust: &mut Host<MemoryStore>,
    which: u8,
    (speed, turn): (i16, i16),
    now: u64,
) {
    let at = Instant::from_micros(now);
    let (done, expected) = match which % 6 {
        0 => {
            let command = MotorControl::new(speed, turn);
            let expected = command.is_ok_and(|command| rust.drive(command, at).is_ok());
            (axle_ucp_host_set_speed(c, speed, turn, now), expected)
        }
        1 => {
            rust.stop(at);
            (axle_ucp_host_stop(c, now), true)
        }
        2 => {
            let expected = rust.start_calibration((turn as u8 % 4).into(), at).is_ok();
            (axle_ucp_host_start_calibration(c, turn as u8 % 4, now), expected)
        }
        3 => {
            let state = u32::from(turn as u16);
            let expected = rust.set_network_state(state.into(), at).is_ok();
            (axle_ucp_host_set_network_state(c, state, now), expected)
        }
        4 => {
            let expected = rust.start_firmware_update(speed, at).is_ok();
            (axle_ucp_host_start_firmware_update(c, speed, now), expected)
        }
        _ => {
            rust.end_firmware_update(at);
            (axle_ucp_host_end_firmware_update(c, now), true)
        }
    };
    assert_eq!(done == AXLE_OK, expected);
}

libfuzzer_sys::fuzz_target!(|data: &[u8]| {
    let _ = run(data);
});
