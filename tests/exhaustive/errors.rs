use std::ops::Range;

use axlewire::ucp;

use super::*;

/// The longest burst that is always found: as long as the CRC.
const BURST: usize = 16;

/// Damages `bytes` by every error of one, two and three bits, and undoes it after each call. The
/// first bit of the error is one of `starts`, in the order of the wire: least significant first.
pub(crate) fn with_errors_of_three_bits(
    bytes: &mut [u8],
    starts: Range<usize>,
    mut visit: impl FnMut(&[u8]),
) {
    let flip = |bytes: &mut [u8], bit: usize| bytes[bit / 8] ^= 1 << (bit % 8);
    let bits = 8 * bytes.len();
    for first in starts {
        flip(bytes, first);
        visit(bytes);
        for second in first + 1..bits {
            flip(bytes, second);
            visit(bytes);
            for third in second + 1..bits {
                flip(bytes, third);
                visit(bytes);
                flip(bytes, third);
            }
            flip(bytes, second);
        }
        flip(bytes, first);
    }
}

/// The same for bursts: every pattern of up to 16 bits from its first one to its last one.
pub(crate) fn with_bursts(bytes: &mut [u8], starts: Range<usize>, mut visit: impl FnMut(&[u8])) {
    let bits = 8 * bytes.len();
    for first in starts {
        let room = BURST.min(bits - first) - 1;
        for behind in 0..1_u32 << room {
            let burst = (behind << 1 | 1) << (first % 8);
            let apply = |bytes: &mut [u8]| {
                let damaged = bytes[first / 8..].iter_mut().zip(burst.to_le_bytes());
                damaged.for_each(|(byte, damage)| *byte ^= damage);
            };
            apply(bytes);
            visit(bytes);
            apply(bytes);
        }
    }
}

/// Numbers of errors that the two functions above produce in so many bytes.
fn numbers(len: u64) -> (u64, u64) {
    let bits = 8 * len;
    let few = bits + bits * (bits - 1) / 2 + bits * (bits - 1) * (bits - 2) / 6;
    // 2^15 from each bit that has room, and all patterns of the last 15 bits.
    (few, ((bits - 15) << 15) + (1 << 15) - 1)
}

#[test]
fn every_error_and_every_burst_is_produced_once() {
    for len in [2, 3, 4] {
        let mut bytes = vec![0; len];
        let (mut few, mut bursts) = (Vec::new(), Vec::new());
        with_errors_of_three_bits(&mut bytes, 0..8 * len, |error| few.push(error.to_vec()));
        with_bursts(&mut bytes, 0..8 * len, |error| bursts.push(error.to_vec()));
        assert_eq!(bytes, vec![0; len]);
        assert_eq!((few.len() as u64, bursts.len() as u64), numbers(len as u64));
        let ones = |error: &Vec<u8>| error.iter().map(|byte| byte.count_ones()).sum::<u32>();
        assert!(few.iter().all(|error| (1..=3).contains(&ones(error))));
        for errors in [&mut few, &mut bursts] {
            let count = errors.len();
            errors.sort_unstable();
            errors.dedup();
            assert_eq!(errors.len(), count);
        }
    }
}

/// A check of bytes whose length is known.
type Check = fn(&[u8]) -> bool;

/// `parse` of a packet of fixed length.
macro_rules! parse {
    ($packet:ty) => {
        |bytes| bytes.try_into().is_ok_and(|bytes| <$packet>::parse(bytes).is_ok())
    };
}

fn encoded(packet: &impl Encode) -> Vec<u8> {
    let mut buffer = [0; 64];
    packet.encode(&mut buffer).unwrap().to_vec()
}

/// The checks of this length, each with a frame that passes it. Random bytes with a CRC are enough
/// for the CRC alone, from 4 to 64; the others are those of both protocols, CRC in its place.
fn checks(len: usize) -> Vec<(&'static str, Vec<u8>, Check)> {
    let (mut dice, id) = (Dice(len as u64), NodeId::N5);
    let (rps, place) = (Rps::new(-2.75).unwrap(), Position::new(-4711, 12));
    let sealed = |mut frame: Vec<u8>| {
        oracle::seal(&mut frame);
        frame
    };
    let mut checks: Vec<(_, _, Check)> =
        vec![("crc16::check", sealed(dice.bytes(len)), crc16::check)];
    let mut add = |name, frame: Vec<u8>, check: Check| {
        if frame.len() == len {
            checks.push((name, frame, check));
        }
    };
    add("READ", encoded(&ReadRequest::new(id)), parse!(ReadRequest));
    add("WRITE", encoded(&WriteRequest::velocity(id, rps)), parse!(WriteRequest));
    add("velocity", encoded(&VelocityResponse::new(id, rps)), parse!(VelocityResponse));
    add("position", encoded(&PositionResponse::new(id, place)), parse!(PositionResponse));
    let three = three::WriteRequest::position(id, [place; 3]);
    add("WRITE, three motors", encoded(&three), parse!(three::WriteRequest));
    if len >= 8 {
        let start = [0xFD, 0xFF, len as u8 - 4, 0, 5, 77];
        let frame = sealed([&start[..], &dice.bytes(len - 6)].concat());
        add("UCP", frame, |bytes| ucp::Frame::parse(bytes).is_ok());
    }
    checks
}

/// Tries every error of this length; returns how many were tried.
fn refuse_every_error(len: usize) -> u64 {
    let mut tried = 0;
    for (name, mut frame, check) in checks(len) {
        assert!(check(&frame), "{name}, {len} bytes");
        let (mut few, mut bursts) = (0, 0);
        with_errors_of_three_bits(&mut frame, 0..8 * len, |bytes| {
            assert!(!check(bytes), "{name}: {bytes:02x?}");
            few += 1;
        });
        with_bursts(&mut frame, 0..8 * len, |bytes| {
            assert!(!check(bytes), "{name}: {bytes:02x?}");
            bursts += 1;
        });
        assert!(check(&frame), "{name}, {len} bytes");
        assert_eq!((few, bursts), numbers(len as u64), "{name}, {len} bytes");
        tried += few + bursts;
    }
    tried
}

#[test]
fn every_error_of_three_bits_and_every_burst_in_a_read_is_refused() {
    assert_eq!(checks(4).len(), 2);
    assert_eq!(refuse_every_error(4), 2 * (5488 + 589_823));
}

#[test]
fn every_error_of_three_bits_in_other_packets_of_the_bus_is_refused() {
    assert_eq!(checks(8).len(), 5);
    for (name, mut frame, check) in checks(8) {
        with_errors_of_three_bits(&mut frame, 0..64, |bytes| {
            assert!(!check(bytes), "{name}: {bytes:02x?}");
        });
    }
}

#[test]
#[ignore = "takes a minute: see the top of main.rs"]
fn every_error_of_three_bits_and_every_burst_is_refused_from_4_to_64_bytes() {
    let work =
        |lens: Range<u64>| -> u64 { lens.map(|len| refuse_every_error(len as usize + 4)).sum() };
    let tried: u64 = on_all_cores(61, work).iter().sum();
    println!("{tried} damaged frames of 4 to 64 bytes, none accepted");
    assert_eq!(tried, (4..=64).map(|len| checks(len as usize).len() as u64 * count(len)).sum());
}

fn count(len: u64) -> u64 {
    let (few, bursts) = numbers(len);
    few + bursts
}

/// Why one frame of each length is enough: whether damage passes depends on the damage alone. A
/// sample: damage that passes, made of a frame, and damage that does not, in other frames.
#[test]
fn damage_that_passes_in_one_frame_passes_in_all_of_this_length() {
    let mut dice = Dice(3);
    for len in 4..=64 {
        let [mut first, mut second] = [dice.bytes(len), dice.bytes(len)];
        oracle::seal(&mut first);
        oracle::seal(&mut second);
        let sum = |a: &[u8], b: &[u8]| a.iter().zip(b).map(|(a, b)| a ^ b).collect::<Vec<u8>>();
        // The difference of two frames is damage that passes.
        let passing = sum(&first, &second);
        for _ in 0..20 {
            let mut other = dice.bytes(len);
            oracle::seal(&mut other);
            assert!(crc16::check(&sum(&other, &passing)));
            let damage = dice.bytes(len);
            let passes = crc16::check(&sum(&first, &damage));
            assert_eq!(crc16::check(&sum(&other, &damage)), passes);
        }
    }
}
