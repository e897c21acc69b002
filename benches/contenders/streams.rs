//! Byte streams to decode, identical on every run and every machine.

use axlewire::{
    ikeya::{NodeId, Position, PositionResponse, ReadRequest, Rps, VelocityResponse, WriteRequest},
    ucp::{
        Body, Telemetry,
        message::{
            BiasRequest, CalibrationKind, CalibrationStartAck, ErrorCode, FirmwareReport, ImuBias,
            MagBias, Pong,
        },
    },
};

use crate::{IKEYA, Protocol, UCP};

/// A stream and what is known about it.
#[derive(Clone, Debug)]
pub struct Stream {
    /// Name for reports.
    pub name: String,
    /// Protocol, with its decoders.
    pub protocol: Protocol,
    /// The stream.
    pub bytes: Vec<u8>,
    /// Number of frames sent.
    pub sent: usize,
    /// End offsets of the frames that arrived undamaged.
    pub intact: Vec<usize>,
}

impl Stream {
    /// The same stream with every bit flipped with a probability of 1 in `n`.
    #[must_use]
    pub fn with_bit_errors(&self, n: u32) -> Self {
        let mut rng = Rng::new(u64::from(n));
        let mut bytes = self.bytes.clone();
        for bit in 0..8 * bytes.len() {
            if rng.below(n) == 0 {
                bytes[bit / 8] ^= 1 << (bit % 8);
            }
        }
        let starts = std::iter::once(0).chain(self.intact.iter().copied());
        let intact = starts
            .zip(self.intact.iter().copied())
            .filter(|&(start, end)| bytes[start..end] == self.bytes[start..end])
            .map(|(_, end)| end)
            .collect();
        Self { name: format!("{}, BER 1 in {n}", self.name), bytes, intact, ..*self }
    }
}

/// Three clean streams of `len` bytes or slightly more: see the functions that make them.
#[must_use]
pub fn clean(len: usize) -> [Stream; 3] {
    [responses(len), requests_and_responses(len), reports(len)]
}

/// Answers of 8 nodes polled in turn, half of them in each mode: 8-byte packets.
#[must_use]
pub fn responses(len: usize) -> Stream {
    let mut rng = Rng::new(1);
    from_rounds("Ikeya responses", IKEYA, len, |frames| {
        for id in NodeId::ALL {
            frames.push(&response(&mut rng, id));
        }
    })
}

/// Both directions: each of 8 nodes is read, answers and is commanded.
#[must_use]
pub fn requests_and_responses(len: usize) -> Stream {
    let mut rng = Rng::new(2);
    from_rounds("Ikeya requests and responses", IKEYA, len, |frames| {
        for id in NodeId::ALL {
            frames.push(ReadRequest::new(id).as_bytes());
            frames.push(&response(&mut rng, id));
            frames.push(&command(&mut rng, id));
        }
    })
}

/// Telemetry of a rover in 44-byte frames, with 2 % other messages at random places.
#[must_use]
pub fn reports(len: usize) -> Stream {
    let mut rng = Rng::new(3);
    let mut index = 0;
    from_rounds("UCP reports", UCP, len, |frames| {
        index = u8::wrapping_add(index, 1);
        if rng.below(50) > 0 {
            let report = FirmwareReport::new(&telemetry(&mut rng), 38);
            return frames.push(report.frame(index).as_bytes());
        }
        let fine = ErrorCode::Fine;
        match rng.below(5) {
            0 => frames.push(Pong::new(fine).frame(index).as_bytes()),
            1 => frames.push(BiasRequest {}.frame(index).as_bytes()),
            2 => frames.push(ImuBias::new(rng.i16s(), rng.i16s()).frame(index).as_bytes()),
            3 => frames.push(MagBias::new(rng.i16s()).frame(index).as_bytes()),
            _ => frames.push(
                CalibrationStartAck::new(CalibrationKind::Magnetometer, fine)
                    .frame(index)
                    .as_bytes(),
            ),
        }
    })
}

/// Streams of exactly `len` bytes: noise, and worst-case patterns. Their only frames are a few at
/// their end, so that a decoder that finds nothing gives a wrong answer: more than C loses.
///
/// The patterns contain as many headers of maximum-length frames as possible, or make the next byte
/// as unpredictable as possible.
#[must_use]
pub fn hostile(len: usize) -> Vec<Stream> {
    let mut rng = Rng::new(4);
    let mut any = |of: &[u8]| (0..len).map(|_| of[rng.below(of.len() as u32) as usize]).collect();
    let all_bytes: Vec<u8> = (0..=255).collect();
    let noise: Vec<u8> = any(&all_bytes);
    let headers = any(&[0xAA, 0xBB, 0x55, 0x56]);
    let headers_and_ids = any(&[0xAA, 0xBB, 0x55, 0x56, 1, 2]);
    let repeated = |pattern: &[u8]| pattern.iter().copied().cycle().take(len).collect();

    [
        ("noise", IKEYA, noise.clone()),
        ("all BB", IKEYA, repeated(&[0xBB])),
        ("BB 01 repeated", IKEYA, repeated(&[0xBB, 1])),
        ("AA 01 repeated", IKEYA, repeated(&[0xAA, 1])),
        ("random of AA BB 55 56", IKEYA, headers),
        ("random of AA BB 55 56 01 02", IKEYA, headers_and_ids),
        ("noise", UCP, noise),
        ("all FD", UCP, repeated(&[0xFD])),
        ("FD FF repeated", UCP, repeated(&[0xFD, 0xFF])),
        ("FD FF 28 00 repeated", UCP, repeated(&[0xFD, 0xFF, 40, 0])),
        ("FD FF 3C 00 repeated", UCP, repeated(&[0xFD, 0xFF, 60, 0])),
    ]
    .map(|(name, protocol, mut bytes)| {
        let name = format!("{} {name}", protocol.name);
        let last = (protocol.last_frame)();
        bytes.truncate(len - LAST_FRAMES * last.len());
        let intact = (1..=LAST_FRAMES).map(|count| bytes.len() + count * last.len()).collect();
        bytes.extend(last.repeat(LAST_FRAMES));
        Stream { name, protocol, bytes, sent: LAST_FRAMES, intact }
    })
    .into()
}

/// Frames at the end of a hostile stream.
const LAST_FRAMES: usize = 16;

/// An answer of node 8.
pub(crate) fn last_ikeya_frame() -> Vec<u8> {
    VelocityResponse::new(NodeId::N8, Rps::ZERO).as_bytes().to_vec()
}

/// A request for biases.
pub(crate) fn last_ucp_frame() -> Vec<u8> {
    BiasRequest {}.frame(0).as_bytes().to_vec()
}

/// SplitMix64: small, reproducible, and random enough to fill frames.
#[derive(Clone, Debug)]
pub struct Rng(u64);

impl Rng {
    /// The sequence with this seed.
    #[must_use]
    pub const fn new(seed: u64) -> Self {
        Self(seed)
    }

    /// The next number of the sequence.
    pub fn number(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        z ^ (z >> 31)
    }

    /// A number below `n`.
    pub fn below(&mut self, n: u32) -> u32 {
        (((self.number() >> 32) * u64::from(n)) >> 32) as u32
    }

    /// A byte.
    pub fn byte(&mut self) -> u8 {
        self.number() as u8
    }

    fn i16(&mut self) -> i16 {
        self.number() as i16
    }

    fn i16s<const N: usize>(&mut self) -> [i16; N] {
        std::array::from_fn(|_| self.i16())
    }
}

/// Collects frames and their end offsets.
#[derive(Default)]
struct Sent {
    bytes: Vec<u8>,
    ends: Vec<usize>,
}

impl Sent {
    fn push(&mut self, frame: &[u8]) {
        self.bytes.extend(frame);
        self.ends.push(self.bytes.len());
    }
}

/// Whole rounds of frames, until at least `len` bytes.
fn from_rounds(
    name: &str,
    protocol: Protocol,
    len: usize,
    mut round: impl FnMut(&mut Sent),
) -> Stream {
    let mut sent = Sent::default();
    while sent.bytes.len() < len {
        round(&mut sent);
    }
    let Sent { bytes, ends } = sent;
    Stream { name: name.into(), protocol, bytes, sent: ends.len(), intact: ends }
}

fn response(rng: &mut Rng, id: NodeId) -> [u8; 8] {
    if id.get().is_multiple_of(2) {
        *PositionResponse::new(id, position(rng)).as_bytes()
    } else {
        *VelocityResponse::new(id, rps(rng)).as_bytes()
    }
}

fn command(rng: &mut Rng, id: NodeId) -> [u8; 8] {
    if id.get().is_multiple_of(2) {
        *WriteRequest::position(id, position(rng)).as_bytes()
    } else {
        *WriteRequest::velocity(id, rps(rng)).as_bytes()
    }
}

fn position(rng: &mut Rng) -> Position {
    Position::new(rng.i16(), rng.i16())
}

/// Up to 128 revolutions per second in either direction, with as many digits as a measured value.
fn rps(rng: &mut Rng) -> Rps {
    Rps::new(rng.number() as i32 as f32 / (1 << 24) as f32).unwrap_or_default()
}

fn telemetry(rng: &mut Rng) -> Telemetry {
    Telemetry {
        battery_pct: rng.below(101) as u16,
        rpm: rng.i16s(),
        acc: rng.i16s(),
        gyro: rng.i16s(),
        mag: rng.i16s(),
        heading_deg: rng.below(361) as i16,
        power_w: rng.byte(),
        voltage_dv: rng.byte(),
        current_ca: rng.below(256) as u16,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const LEN: usize = 200_000;

    #[test]
    fn a_stream_is_the_same_every_time() {
        let (first, second) = (clean(LEN), clean(LEN));
        for (first, second) in first.iter().zip(&second) {
            assert_eq!(first.bytes, second.bytes, "{}", first.name);
            assert_eq!(
                first.with_bit_errors(1000).bytes,
                second.with_bit_errors(1000).bytes,
                "{}",
                first.name
            );
        }
    }

    #[test]
    fn bits_are_flipped_as_often_as_asked_for() {
        for stream in clean(LEN) {
            let noisy = stream.with_bit_errors(1000);
            let flipped: u32 =
                stream.bytes.iter().zip(&noisy.bytes).map(|(a, b)| (a ^ b).count_ones()).sum();
            let expected = 8 * stream.bytes.len() as u32 / 1000;
            assert!(flipped.abs_diff(expected) < expected / 10, "{flipped} of {expected}");
        }
    }

    #[test]
    fn two_in_a_hundred_ucp_frames_are_no_reports() {
        let stream = reports(20 * LEN);
        let mut start = 0;
        let mut others = 0;
        for &end in &stream.intact {
            others += usize::from(end - start != 44);
            start = end;
        }
        let share = others as f64 / stream.intact.len() as f64;
        assert!((0.018..0.022).contains(&share), "{share}");
    }

    #[test]
    fn axlewire_finds_every_intact_frame_and_nothing_else() {
        for stream in clean(LEN) {
            for stream in [stream.with_bit_errors(10_000), stream.with_bit_errors(1000), stream] {
                let ends = (stream.protocol.frame_ends)(&stream.bytes);
                assert_eq!(ends, stream.intact, "{}", stream.name);
            }
        }
    }

    #[test]
    fn a_hostile_stream_ends_with_frames_that_all_find_and_c_in_part() {
        for Stream { name, protocol, bytes, sent, intact } in hostile(LEN) {
            assert_eq!((bytes.len(), intact.len(), intact.last()), (LEN, sent, Some(&LEN)));
            assert!((protocol.frame_ends)(&bytes).ends_with(&intact), "{name}");
            for c in [protocol.c_table, protocol.c_bitwise] {
                assert!(c(&bytes).frames > 5, "{name}: {:?}", c(&bytes));
            }
        }
    }

    #[test]
    fn axlewire_and_the_oracle_agree_on_every_stream() {
        let clean = clean(LEN);
        let noisy = clean.each_ref().map(|stream| stream.with_bit_errors(1000));
        for Stream { name, protocol, bytes, .. } in clean.iter().chain(&noisy).chain(&hostile(LEN))
        {
            let expected = (protocol.oracle)(bytes);
            assert_eq!((protocol.frames)(bytes), expected, "{name}, frames");
            assert_eq!((protocol.each)(bytes), expected, "{name}, each");
            assert_eq!((protocol.pushed)(bytes), expected, "{name}, pushed");
            assert_ne!(expected, crate::Tally::default(), "{name}");
            for chunk in [1, 7, 64, 512, 4096] {
                assert_eq!((protocol.decoder)(bytes, chunk), expected, "{name}, by {chunk}");
            }
        }
    }
}
