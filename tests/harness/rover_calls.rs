//! Any calls, bytes and times for a role of UCP.

use axlewire::{encode::Encode, endpoint::Endpoint};
use proptest::{collection::vec, prelude::*, sample::Index};

use super::rig::*;

/// A single action on a role.
#[derive(Clone, Debug)]
pub(crate) enum Call {
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

pub(crate) fn call() -> impl Strategy<Value = Call> {
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
pub(crate) fn any_frame(which: &Index, salt: u8) -> Vec<u8> {
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
pub(crate) fn perform<R: Endpoint>(
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

pub(crate) fn start() -> impl Strategy<Value = u64> {
    prop_oneof![Just(0), any::<u64>(), (0..20_000_000_u64).prop_map(|before| u64::MAX - before)]
}
