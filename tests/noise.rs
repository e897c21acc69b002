//! Every frame that survives a noisy line is delivered, and nothing else is.
//!
//! Streams of 10,000 frames with a fixed seed. The generator knows which frames are intact and
//! where they are; the decoder has to find exactly those. Frames go missing for one reason only:
//! they share a byte with one accepted before (ruling B2), as when a frame that has lost its last
//! byte is completed by the identical first byte of the next.
//!
//! `cargo test --test noise -- --nocapture` prints the figures.
#![cfg(all(feature = "ikeya", feature = "ucp"))]

#[path = "support/known_framings.rs"]
#[allow(dead_code, reason = "only the bytes of frames matter here")]
mod known_framings;
#[path = "support/oracle.rs"]
#[allow(dead_code, reason = "too slow for a stream this long")]
mod oracle;

use std::collections::HashSet;

use axlewire::{
    ikeya::{self, NodeId, Position, Rps, three},
    stream::{Decoder, Event, Frames},
    ucp::{
        self, Body, MotorControl, Ucp,
        message::{CalibrationKind, ErrorCode, NetworkState},
    },
};
use known_framings::Known;

const FRAMES: usize = 10_000;

/// The faults of a line.
#[derive(Clone, Copy, Debug)]
enum Noise {
    None,
    /// Flips one bit in this many.
    BitErrors(usize),
    /// Inserts or deletes a byte at one in this many.
    Slips(usize),
    /// Sends 1 to 64 random bytes before one frame in this many.
    Bursts(usize),
    /// Sends 1 to 16 bytes that look like headers before one frame in this many.
    HeaderBursts(usize),
    /// Truncates one frame in this many.
    Truncation(usize),
}

const NOISES: [Noise; 10] = [
    Noise::None,
    Noise::BitErrors(100_000),
    Noise::BitErrors(10_000),
    Noise::BitErrors(1_000),
    Noise::Slips(10_000),
    Noise::Slips(1_000),
    Noise::Bursts(10),
    Noise::Bursts(1),
    Noise::HeaderBursts(2),
    Noise::Truncation(20),
];

#[test]
fn ucp_motor_commands_and_reports() {
    survive::<Ucp, 64>("UCP 24 and 44 bytes", &[0xFD, 0xFD, 0xFF, 0x04, 0x00], |dice, index| {
        if dice.one_in(2) { motor_control(dice, index) } else { report(dice, index) }
    });
}

#[test]
fn ucp_everything_that_goes_to_a_robot() {
    survive::<Ucp, 64>(
        "UCP to the robot",
        &[0xFD, 0xFD, 0xFF, 0x04, 0x00],
        |dice, index| match dice.below(6) {
            0 => ucp::message::Ping {}.frame(index).as_bytes().to_vec(),
            1 => {
                let start = ucp::message::CalibrationStart::new(CalibrationKind::Imu);
                start.frame(index).as_bytes().to_vec()
            }
            2 => {
                let state = NetworkState::from(dice.below(5) as u32);
                ucp::message::SetNetworkState::new(state).unwrap().frame(index).as_bytes().to_vec()
            }
            3 => {
                let imu = ucp::message::ImuBias::new(dice.vector(), dice.vector());
                let biases =
                    ucp::message::Biases::new(imu, ucp::message::MagBias::new(dice.vector()));
                biases.with_err(ErrorCode::Fine).frame(index).as_bytes().to_vec()
            }
            _ => motor_control(dice, index),
        },
    );
}

#[test]
fn ikeya_responses_of_8_bytes() {
    let headers = [0x55, 0x56, 0xAA, 0xBB, 0x01];
    survive::<ikeya::ToMaster, 8>("Ikeya 8 bytes", &headers, |dice, _| {
        let id = dice.node();
        if dice.one_in(2) {
            ikeya::VelocityResponse::new(id, dice.rps()).as_bytes().to_vec()
        } else {
            ikeya::PositionResponse::new(id, dice.position()).as_bytes().to_vec()
        }
    });
}

#[test]
fn ikeya_responses_of_16_bytes() {
    let headers = [0x55, 0x56, 0xAA, 0xBB, 0x01];
    survive::<three::ToMaster, 16>("Ikeya 16 bytes", &headers, |dice, _| {
        let id = dice.node();
        if dice.one_in(2) {
            let current = [dice.rps(), dice.rps(), dice.rps()];
            three::VelocityResponse::new(id, current).as_bytes().to_vec()
        } else {
            let current = [dice.position(), dice.position(), dice.position()];
            three::PositionResponse::new(id, current).as_bytes().to_vec()
        }
    });
}

fn motor_control(dice: &mut Dice, index: u8) -> Vec<u8> {
    let percent = |dice: &mut Dice| dice.below(201) as i16 - 100;
    let command = MotorControl::new(percent(dice), percent(dice)).unwrap();
    command.with_front_led(dice.one_in(2)).frame(index).as_bytes().to_vec()
}

fn report(dice: &mut Dice, index: u8) -> Vec<u8> {
    let telemetry = ucp::Telemetry {
        battery_pct: dice.below(101) as u16,
        rpm: [dice.below(200) as i16 - 100; 4],
        acc: dice.vector(),
        gyro: dice.vector(),
        mag: dice.vector(),
        heading_deg: dice.below(361) as i16,
        power_w: dice.below(40) as u8,
        voltage_dv: 119,
        current_ca: dice.below(256) as u16,
    };
    ucp::message::FirmwareReport::new(&telemetry, 38).frame(index).as_bytes().to_vec()
}

/// Sends `FRAMES` frames over every kind of line and checks what comes out.
fn survive<F: Known, const N: usize>(
    name: &str,
    headers: &[u8],
    frame: impl Fn(&mut Dice, u8) -> Vec<u8>,
) {
    println!("{name:24}{:>20}{:>9}{:>9}{:>11}", "noise", "bytes", "intact", "delivered");
    for (seed, noise) in NOISES.into_iter().enumerate() {
        let mut dice = Dice(1 + seed as u64);
        let sent: Vec<_> = (0..FRAMES).map(|index| frame(&mut dice, index as u8)).collect();
        let (stream, intact) = transmit(&sent, noise, headers, &mut dice);
        let delivered = delivered::<F, N>(&stream, &mut dice);
        let title = format!("{noise:?}");
        let (bytes, count) = (stream.len(), intact.len());
        println!("{:24}{title:>20}{bytes:>9}{count:>9}{:>11}", "", delivered.len());

        let known: HashSet<&[u8]> = sent.iter().map(Vec::as_slice).collect();
        for &(offset, len) in &delivered {
            let frame = &stream[offset..offset + len];
            assert!(known.contains(frame), "{name}, {noise:?}: phantom {frame:02x?} at {offset}");
        }
        let found: HashSet<_> = delivered.iter().copied().collect();
        let mut shared = 0;
        for &(offset, len) in intact.iter().filter(|&place| !found.contains(place)) {
            let sharing = |&&(at, len): &&(usize, usize)| at < offset && offset < at + len;
            let before = delivered.iter().find(sharing);
            assert!(before.is_some(), "{name}, {noise:?}: frame of {len} at {offset} is lost");
            shared += 1;
        }
        assert!(shared <= 3, "{name}, {noise:?}: {shared} frames lost to others is too many");
        if matches!(noise, Noise::None) {
            assert_eq!(delivered, intact, "{name}: a clean line");
        }
    }
}

/// The bytes that arrive, with position and length of every frame that arrives whole.
fn transmit(
    sent: &[Vec<u8>],
    noise: Noise,
    headers: &[u8],
    dice: &mut Dice,
) -> (Vec<u8>, Vec<(usize, usize)>) {
    let (mut stream, mut intact) = (Vec::new(), Vec::new());
    for frame in sent {
        match noise {
            Noise::Bursts(rate) if dice.one_in(rate) => {
                let len = 1 + dice.below(64);
                stream.extend((0..len).map(|_| dice.below(256) as u8));
            }
            Noise::HeaderBursts(rate) if dice.one_in(rate) => {
                let len = 1 + dice.below(16);
                stream.extend((0..len).map(|_| headers[dice.below(headers.len())]));
            }
            _ => {}
        }
        let end = match noise {
            Noise::Truncation(rate) if dice.one_in(rate) => dice.below(frame.len()),
            _ => frame.len(),
        };
        let (mut start, mut whole) = (stream.len(), end == frame.len());
        for (index, &byte) in frame[..end].iter().enumerate() {
            match noise {
                Noise::BitErrors(rate) => {
                    let flips = (0..8).filter(|_| dice.one_in(rate)).map(|bit| 1_u8 << bit);
                    let flips = flips.fold(0, |all, flip| all | flip);
                    whole &= flips == 0;
                    stream.push(byte ^ flips);
                }
                Noise::Slips(rate) if dice.one_in(rate) => {
                    if dice.one_in(2) {
                        // An extra byte before the first one is harmless.
                        start += usize::from(index == 0);
                        whole &= index == 0;
                        stream.extend([dice.below(256) as u8, byte]);
                    } else {
                        whole = false;
                    }
                }
                _ => stream.push(byte),
            }
        }
        if whole {
            intact.push((start, frame.len()));
        }
    }
    (stream, intact)
}

/// Position and length of every frame that a decoder finds in chunks of any size; the slice
/// iterator has to find the same.
fn delivered<F: Known, const N: usize>(stream: &[u8], dice: &mut Dice) -> Vec<(usize, usize)> {
    let mut decoder = Decoder::<F, N>::new();
    let (mut places, mut frames) = (Vec::new(), Frames::<F>::new(stream));
    let (mut rest, mut at) = (stream, 0);
    while !rest.is_empty() {
        let (mut chunk, behind) = rest.split_at((1 + dice.below(100)).min(rest.len()));
        rest = behind;
        while let Some(event) = decoder.decode(&mut chunk) {
            match event {
                Event::Skipped(gap) => at += gap.len as usize,
                Event::Frame(frame) => {
                    let bytes = F::bytes(&frame);
                    assert_eq!(bytes, &stream[at..at + bytes.len()]);
                    assert_eq!(frames.next().as_ref().map(F::bytes), Some(bytes));
                    places.push((at, bytes.len()));
                    at += bytes.len();
                }
            }
        }
    }
    assert!(frames.next().is_none());
    assert_eq!(frames.rest().len(), decoder.pending());
    let counters = decoder.counters();
    let booked = counters.framed + counters.skipped() + decoder.pending() as u64;
    assert_eq!((counters.received, booked), (stream.len() as u64, stream.len() as u64));
    places
}

/// The same numbers on every run: splitmix64.
struct Dice(u64);

impl Dice {
    fn below(&mut self, end: usize) -> usize {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut word = self.0;
        word = (word ^ (word >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        word = (word ^ (word >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        ((word ^ (word >> 31)) % end as u64) as usize
    }

    fn one_in(&mut self, rate: usize) -> bool {
        self.below(rate) == 0
    }

    /// A sensor's three axes, around zero.
    fn vector(&mut self) -> [i16; 3] {
        [0; 3].map(|_: i16| self.below(4001) as i16 - 2000)
    }

    fn node(&mut self) -> NodeId {
        NodeId::ALL[self.below(NodeId::ALL.len())]
    }

    fn rps(&mut self) -> Rps {
        Rps::new((self.below(20_001) as f32 - 10_000.0) / 100.0).unwrap()
    }

    fn position(&mut self) -> Position {
        Position::from_counts(self.below(2_000_001) as i32 - 1_000_000).unwrap()
    }
}
