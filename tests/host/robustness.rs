//! Under any calls, bytes and times a role keeps its contract, and a bad line causes no motion that
//! was not requested.

use std::collections::HashSet;

use crc::{CRC_16_MODBUS, Crc};
use proptest::{collection::vec, prelude::*};

use crate::{
    calls::{call, perform, start},
    rig::*,
};

proptest! {
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
                    if rig.host.drive(go(speed), rig.now).is_ok() {
                        asked.insert(speed);
                    }
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
}
