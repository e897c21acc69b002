//! Under any calls, bytes and times a role keeps its contract, and a bad line causes no motion that
//! was not requested.

use std::collections::HashSet;

use crc::{CRC_16_MODBUS, Crc};
use proptest::{collection::vec, prelude::*, sample::Index};

use crate::rig::*;

/// A single action on a role.
#[derive(Clone, Debug)]
enum Call {
    /// Time passes, microseconds, without checking the deadline.
    Sleep(u32),
    /// A driver runs up to this time, microseconds.
    Drive(u32),
    Noise(Vec<u8>),
    /// A good frame: which one, and its content.
    Frame(Index, u8),
    /// The same, cut off.
    Cut(Index, usize),
    Timeout,
    Transmit,
    Events,
    Command(u8, i16),
}

fn call() -> impl Strategy<Value = Call> {
    prop_oneof![
        (0..2_000_000_u32).prop_map(Call::Sleep),
        (0..2_000_000_u32).prop_map(Call::Drive),
        vec(prop_oneof![any::<u8>(), Just(0xFD), Just(0xFF), Just(4)], 0..100)
            .prop_map(Call::Noise),
        (any::<Index>(), any::<u8>()).prop_map(|(which, salt)| Call::Frame(which, salt)),
        (any::<Index>(), 0..44_usize).prop_map(|(which, len)| Call::Cut(which, len)),
        Just(Call::Timeout),
        Just(Call::Transmit),
        Just(Call::Events),
        (any::<u8>(), any::<i16>()).prop_map(|(which, value)| Call::Command(which, value)),
    ]
}

/// A frame of any message, both directions.
fn any_frame(which: &Index, salt: u8) -> Vec<u8> {
    let err = ErrorCode::from(salt % 3);
    let kind = CalibrationKind::from(salt % 4);
    let value = i16::from(salt) * 3 - 300;
    let mut buffer = [0; 64];
    let raw = RawFrame { id: 0x20, index: salt, body: &[salt; 56][..usize::from(salt % 57)] };
    let frames = [
        bytes(Ping {}),
        bytes(Pong::new(err)),
        (careless(value, -value, value, if salt == 7 { 39 } else { 0 })),
        bytes(CalibrationStart::new(kind)),
        bytes(CalibrationStartAck::new(kind, err)),
        bytes(CalibrationEnd::new(kind)),
        bytes(CalibrationEndAck::new(kind, err)),
        FirmwareReport::new(&Telemetry::default(), 38).frame(salt).as_bytes().to_vec(),
        bytes(ImuBias::new([value; 3], [0; 3])),
        bytes(ImuBiasAck::new(err)),
        bytes(MagBias::new([value; 3])),
        bytes(MagBiasAck::new(err)),
        bytes(BiasRequest {}),
        bytes(Biases::new(imu_bias(), mag_bias())),
        bytes(OtaRequest::start_firmware_update(value)),
        bytes(OtaAck::new(OtaStatus::from(salt % 4))),
        bytes(SetNetworkState::new(NetworkState::from(u32::from(salt))).unwrap()),
        // A few have FD FF in them, and are not sent.
        raw.encode(&mut buffer).map_or_else(|_| bytes(Ping {}), <[u8]>::to_vec),
    ];
    which.get(&frames).clone()
}

/// Runs a call; `command` is the role's own command.
fn perform<R: Endpoint>(
    role: &mut R,
    call: &Call,
    now: &mut Instant,
    command: impl Fn(&mut R, u8, i16, Instant),
) {
    match call {
        Call::Sleep(micros) => *now += Duration::from_micros(*micros),
        Call::Drive(micros) => {
            role.handle_timeout(*now);
            sent(role, *now);
            let end = *now + Duration::from_micros(*micros);
            let frames = wait(role, end);
            // Motor commands, pings, reports, results, requests: nothing is sent without a reason.
            let most = 30 + *micros / 5_000;
            assert!(frames.len() <= most as usize, "{} frames in {micros} us", frames.len());
            *now = end;
        }
        Call::Noise(noise) => role.handle_input(noise, *now),
        Call::Frame(which, salt) => role.handle_input(&any_frame(which, *salt), *now),
        Call::Cut(which, len) => {
            let frame = any_frame(which, 0);
            role.handle_input(&frame[..(*len).min(frame.len())], *now);
        }
        Call::Timeout => role.handle_timeout(*now),
        Call::Transmit => {
            let _ = role.poll_transmit(*now);
        }
        Call::Events => assert!(events(role).len() <= 16, "events are bounded"),
        Call::Command(which, value) => command(role, *which, *value, *now),
    }
    // A handled deadline is no longer in the past.
    role.handle_timeout(*now);
    sent(role, *now);
}

fn start() -> impl Strategy<Value = u64> {
    prop_oneof![Just(0), any::<u64>(), (0..20_000_000_u64).prop_map(|before| u64::MAX - before)]
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 500, ..ProptestConfig::default() })]

    #[test]
    fn a_host_survives_any_calls_bytes_and_times(
        calls in vec(call(), 0..60),
        start in start(),
    ) {
        let mut now = us(start);
        let mut host = Host::with_store(HostConfig::default(), MemoryStore::default(), now);
        for call in &calls {
            perform(&mut host, call, &mut now, |host, which, value, now| {
                let kind = CalibrationKind::from((value & 3) as u8);
                // A refusal does not matter here.
                let _ = match which % 8 {
                    0 => host.drive(go(value % 101), now),
                    1 => host.drive(MotorControl::new(0, value % 101).unwrap(), now),
                    2 => host.start_calibration(kind, now),
                    3 => host.end_calibration(kind, now),
                    4 => host.set_network_state(NetworkState::from(value as u32), now),
                    5 => host.start_firmware_update(value, now),
                    6 => { host.end_firmware_update(now); Ok(()) }
                    _ => { host.stop(now); Ok(()) }
                };
            });
            let line = host.counters();
            prop_assert!(line.received - line.framed - line.skipped() < 64);
        }
    }

    #[test]
    fn a_robot_survives_any_calls_bytes_and_times(
        calls in vec(call(), 0..60),
        start in start(),
    ) {
        let mut now = us(start);
        let mut robot = Robot::new(RobotConfig::default(), now);
        for call in &calls {
            perform(&mut robot, call, &mut now, |robot, which, value, now| {
                match which % 4 {
                    0 => robot.set_telemetry(&Telemetry::default(), now),
                    1 => robot.calibration_result_imu(ImuBias::new([value; 3], [0; 3]), now),
                    2 => robot.calibration_result_mag(MagBias::new([value; 3]), now),
                    _ => { robot.answer_update(OtaStatus::Accepted, now); }
                }
            });
            let command = robot.command(now);
            prop_assert!(command.speed().abs() <= 100 && command.angular().abs() <= 100);
            prop_assert!(matches!(command.front_led(), 0 | 100));
            prop_assert_eq!(RawMotorControl::from(command).version(), 0);
        }
    }
}

/// A bad line's effect on a frame: each byte may be lost, damaged or doubled.
#[derive(Clone, Copy, Debug)]
struct BadLine {
    seed: u64,
    /// Affected bytes per 1000.
    per_mille: u64,
}

impl BadLine {
    fn into_fault(self) -> Fault {
        let mut state = self.seed | 1;
        let mut dice = move || {
            state ^= state << 13;
            state ^= state >> 7;
            state ^= state << 17;
            state >> 11
        };
        Box::new(move |_, frame| {
            let mut out = Vec::new();
            for &byte in frame {
                match (dice() % 1000 < self.per_mille, dice() % 3) {
                    (false, _) => out.push(byte),
                    (true, 0) => {}
                    (true, 1) => out.push(byte ^ (1 << (dice() % 8))),
                    (true, _) => out.extend([byte, byte]),
                }
            }
            if holds_another(&out, frame) { frame.to_vec() } else { out }
        })
    }
}

/// Whether a bad line made another good frame of it. The CRC passes one damaged frame in 65,536,
/// which no role can detect.
fn holds_another(bytes: &[u8], frame: &[u8]) -> bool {
    let crc = Crc::<u16>::new(&CRC_16_MODBUS);
    (0..bytes.len()).any(|at| {
        let rest = &bytes[at..];
        let Some(&[0xFD, 0xFF, low, high]) = rest.first_chunk() else { return false };
        let found =
            rest.get(..usize::from(u16::from_le_bytes([low, high])) + 4).unwrap_or_default();
        found != frame
            && found
                .split_last_chunk::<2>()
                .is_some_and(|(body, end)| crc.checksum(body).to_le_bytes() == *end)
    })
}

#[test]
fn damage_that_the_crc_cannot_detect_is_recognised() {
    let command = |crc: [u8; 2]| {
        let mut frame = [0_u8; 24];
        frame[..8].copy_from_slice(&[0xFD, 0xFF, 0x14, 0, 2, 0x18, 0xCE, 0xFF]);
        frame[22..].copy_from_slice(&crc);
        frame
    };
    let frame = command([0xD0, 0x05]);
    assert!(Frame::parse(&frame).is_ok());
    assert!(!holds_another(&frame, &frame));
    // The index is doubled: the rest moves by one position, and the CRC is correct again.
    let mut doubled = frame.to_vec();
    doubled.insert(5, 0x18);
    assert!(Frame::parse(&doubled[..24]).is_ok());
    assert!(holds_another(&doubled, &frame));
    assert!(!holds_another(&command([0xD0, 0x04]), &frame));
}

/// The application's next action, and its duration, milliseconds.
#[derive(Clone, Copy, Debug)]
enum Act {
    Drive(i16, u32),
    Stop(u32),
    Silence(u32),
    Calibrate(bool, bool, u32),
    Unplug(u32),
}

fn act() -> impl Strategy<Value = Act> {
    prop_oneof![
        4 => (-100..=100_i16, 1..300_u32).prop_map(|(speed, millis)| Act::Drive(speed, millis)),
        1 => (1..300_u32).prop_map(Act::Stop),
        1 => (1..1500_u32).prop_map(Act::Silence),
        2 => (any::<bool>(), any::<bool>(), 1..300_u32)
            .prop_map(|(start, imu, millis)| Act::Calibrate(start, imu, millis)),
        1 => (1..1500_u32).prop_map(Act::Unplug),
    ]
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 150, ..ProptestConfig::default() })]

    #[test]
    fn over_a_bad_line_nothing_unrequested_is_done_and_nothing_hangs(
        acts in vec(act(), 1..25),
        seed in any::<u64>(),
        per_mille in 0..200_u64,
        start in start(),
    ) {
        let begin = us(start);
        let mut rig = Rig::new(begin);
        let line = BadLine { seed, per_mille };
        rig.fault = line.into_fault();
        rig.robot.set_telemetry(&Telemetry::default(), begin);
        let mut asked = HashSet::from([0]);
        let mut requests = Vec::new();
        for act in acts {
            match act {
                Act::Drive(speed, millis) => {
                    rig.host.drive(go(speed), rig.now).unwrap();
                    asked.insert(speed);
                    rig.run_for(millis);
                }
                Act::Stop(millis) => {
                    rig.host.stop(rig.now);
                    rig.run_for(millis);
                }
                Act::Silence(millis) => rig.run_for(millis),
                Act::Calibrate(start, imu, millis) => {
                    let kind = if imu { IMU } else { MAG };
                    let taken = match start {
                        true => rig.host.start_calibration(kind, rig.now),
                        false => rig.host.end_calibration(kind, rig.now),
                    };
                    if taken.is_ok() {
                        requests.push(rig.now);
                    }
                    rig.run_for(millis);
                }
                Act::Unplug(millis) => {
                    rig.unplug(true);
                    rig.run_for(millis);
                    rig.fault = line.into_fault();
                }
            }
        }
        // The application goes silent: dead-man, one frame on the line, and the robot stops.
        rig.run_for(500 + 3);
        if per_mille == 0 {
            prop_assert_eq!(rig.robot.command(rig.now).speed(), 0);
        }
        rig.run_for(500 + 3);
        prop_assert_eq!(rig.robot.command(rig.now).speed(), 0);
        // No speed that was not requested.
        for (at, speed) in &rig.motion {
            prop_assert!(asked.contains(speed), "{} at {:?}", speed, at);
        }
        // Every calibration request has ended, in order, within its bound.
        let bound = HostConfig::default().calibration_bound();
        let ends: Vec<_> = rig.host_events.iter().filter(|(_, event)| matches!(
            event,
            HostEvent::CalibrationStarted(_)
                | HostEvent::CalibrationEnded(_)
                | HostEvent::CalibrationFailed(_)
        )).collect();
        prop_assert_eq!(ends.len(), requests.len());
        for ((end, _), request) in ends.iter().zip(&requests) {
            prop_assert!(*end >= *request && *end <= *request + bound);
        }
        let failed = ends.iter().filter(|(_, e)| matches!(e, HostEvent::CalibrationFailed(_)));
        prop_assert_eq!(failed.count(), rig.host.statistics().calibration_failures as usize);
        // The events of a rig are taken out at every step.
        prop_assert_eq!((rig.host.lost_events(), rig.robot.lost_events()), (0, 0));
    }

    #[test]
    fn the_robot_stops_within_500_ms_of_the_last_valid_command(
        pauses in vec(0..900_u32, 1..40),
        noise in vec(any::<u8>(), 0..64),
        start in start(),
    ) {
        let mut now = us(start);
        let mut robot = quiet_robot_at(now);
        for (turn, pause) in pauses.into_iter().enumerate() {
            if turn % 3 == 0 {
                robot.handle_input(&noise, now);
                // A pause ends any frame that the noise has begun.
                now += Duration::from_millis(20);
                robot.handle_timeout(now);
                events(&mut robot);
            }
            robot.handle_input(&bytes(go(50)), now);
            let last = now;
            let end = now + Duration::from_millis(pause);
            while let Some(at) = robot.poll_timeout().filter(|&at| at <= end) {
                robot.handle_timeout(at);
                sent(&mut robot, at);
            }
            now = end;
            let moves = now < last + Duration::from_millis(500);
            prop_assert_eq!(robot.command(now).speed(), if moves { 50 } else { 0 });
            let stops = events(&mut robot).into_iter().filter(|e| *e == RobotEvent::Watchdog);
            prop_assert_eq!(stops.count(), usize::from(!moves));
        }
    }
}
