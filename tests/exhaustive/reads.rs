use std::ops::Range;

use axlewire::{
    ikeya,
    stream::{Decoder, Event},
};

use super::*;

/// The READs that rulings B1 and I1 allow.
pub(crate) fn legal_reads() -> Vec<[u8; 4]> {
    let sealed = |id| {
        let mut read = [0xAA, id, 0, 0];
        oracle::seal(&mut read);
        read
    };
    (1..=8).map(sealed).collect()
}

/// The strings that a way in accepts; the first byte is the most significant of the number.
type Way = fn(Range<u64>) -> Vec<[u8; 4]>;

#[inline(always)]
fn accepted(strings: Range<u64>, is_accepted: impl Fn(&[u8; 4]) -> bool) -> Vec<[u8; 4]> {
    strings.map(|string| (string as u32).to_be_bytes()).filter(is_accepted).collect()
}

fn judged<F: Framing>(strings: Range<u64>) -> Vec<[u8; 4]> {
    accepted(strings, |string| matches!(F::judge(string), Verdict::Frame { .. }))
}

fn iterated<F: Framing>(strings: Range<u64>) -> Vec<[u8; 4]> {
    accepted(strings, |string| Frames::<F>::new(string).next().is_some())
}

fn each<F: Framing>(strings: Range<u64>) -> Vec<[u8; 4]> {
    accepted(strings, |string| {
        let mut count = 0;
        Frames::<F>::new(string).each(|_| count += 1);
        count > 0
    })
}

/// Handed over `chunk` bytes at a time.
fn decoded<const CHUNK: usize>(strings: Range<u64>) -> Vec<[u8; 4]> {
    accepted(strings, |string| {
        let mut decoder = ikeya::Decoder::<ikeya::ToSlave>::new();
        let mut is_frame = false;
        for mut chunk in string.chunks(CHUNK) {
            while let Some(event) = decoder.decode(&mut chunk) {
                is_frame |= matches!(event, Event::Frame(_));
            }
        }
        is_frame
    })
}

fn polled(decoder: &mut Decoder<ikeya::ToSlave, 8>) -> bool {
    let mut is_frame = false;
    while let Some(event) = decoder.poll() {
        is_frame |= matches!(event, Event::Frame(_));
    }
    is_frame
}

fn pushed(strings: Range<u64>) -> Vec<[u8; 4]> {
    accepted(strings, |string| {
        let mut decoder = ikeya::Decoder::new();
        string
            .iter()
            .fold(false, |is_frame, &byte| is_frame | (decoder.push(byte) && polled(&mut decoder)))
    })
}

fn committed(strings: Range<u64>) -> Vec<[u8; 4]> {
    accepted(strings, |string| {
        let mut decoder = ikeya::Decoder::new();
        decoder.spare()[..4].copy_from_slice(string);
        decoder.commit(4);
        polled(&mut decoder)
    })
}

const WAYS: [(&str, Way); 11] = [
    ("ReadRequest::parse", |strings| accepted(strings, |bytes| ReadRequest::parse(bytes).is_ok())),
    ("judge, ToSlave", judged::<ikeya::ToSlave>),
    ("judge, BothDirections", judged::<ikeya::BothDirections>),
    ("judge, three::ToSlave", judged::<three::ToSlave>),
    ("judge, three::BothDirections", judged::<three::BothDirections>),
    ("Frames", iterated::<ikeya::ToSlave>),
    ("Frames::each", each::<ikeya::ToSlave>),
    ("Decoder::decode, whole", decoded::<4>),
    ("Decoder::decode, byte by byte", decoded::<1>),
    ("Decoder::push", pushed),
    ("Decoder::commit", committed),
];

/// Framings in which no frame has four bytes.
const CLOSED_WAYS: [(&str, Way); 4] = [
    ("judge, ToMaster", judged::<ikeya::ToMaster>),
    ("judge, three::ToMaster", judged::<three::ToMaster>),
    ("judge, Ucp", judged::<Ucp>),
    ("judge, Ucp<252>", judged::<Ucp<252>>),
];

#[test]
fn all_crcs_behind_four_ids_make_a_read_of_the_legal_ones_only() {
    let (first, last) = (legal_reads()[0], legal_reads()[7]);
    for (id, legal) in [(0, None), (1, Some(first)), (8, Some(last)), (9, None)] {
        let start = 0xAA00_0000 + 0x1_0000 * id;
        for (name, way) in WAYS {
            assert_eq!(way(start..start + 0x1_0000), Vec::from_iter(legal), "{name}, id {id}");
        }
        for (name, way) in CLOSED_WAYS {
            assert_eq!(way(start..start + 0x1_0000), [[0; 4]; 0], "{name}, id {id}");
        }
    }
}

#[test]
#[ignore = "takes minutes: see the top of main.rs"]
fn of_all_strings_of_four_bytes_exactly_the_eight_legal_reads_are_accepted() {
    for (name, way) in WAYS {
        let mut found = on_all_cores(1 << 32, way).concat();
        found.sort_unstable();
        assert_eq!(found, legal_reads(), "{name}");
        println!("{name}: {} of 2^32", found.len());
    }
    for (name, way) in CLOSED_WAYS {
        let found = on_all_cores(1 << 32, way).concat();
        assert_eq!(found, [[0; 4]; 0], "{name}");
        println!("{name}: none of 2^32");
    }
}

/// READs in a row, so that they are judged in batches.
const RUN: usize = 37;

/// The strings that are accepted as the frame at their own place in a run of good READs.
fn accepted_in_a_run<F>(strings: Range<u64>) -> Vec<[u8; 4]>
where
    F: for<'a> Framing<Frame<'a> = ikeya::Request<'a>>,
{
    let clean = legal_reads()[4].repeat(RUN);
    let mut run = clean.clone();
    strings
        .filter_map(|string| {
            let bytes = (string as u32).to_be_bytes();
            // Every string has one place; neighbours have different ones.
            let place = 4 * (string as usize % RUN);
            run[place..place + 4].copy_from_slice(&bytes);
            let (mut is_accepted, start) = (false, run[place..].as_ptr());
            Frames::<F>::new(&run).each(|request| {
                if let ikeya::Request::Read(read) = request {
                    is_accepted |= read.as_bytes().as_ptr() == start;
                }
            });
            run[place..place + 4].copy_from_slice(&clean[..4]);
            is_accepted.then_some(bytes)
        })
        .collect()
}

#[test]
fn a_batch_accepts_a_read_only_if_it_is_legal() {
    let legal = [legal_reads()[3]];
    assert_eq!(accepted_in_a_run::<ikeya::ToSlave>(0xAA04_0000..0xAA04_8000), legal);
}

/// Strings with another header are left out: `judge` has refused them above, and a batch judges no
/// packet whose header it does not know.
#[test]
#[ignore = "takes a minute: see the top of main.rs"]
fn of_all_strings_that_begin_like_a_read_a_batch_accepts_the_eight_legal_ones() {
    let shifted = |part: Range<u64>| {
        accepted_in_a_run::<ikeya::ToSlave>(0xAA00_0000 + part.start..0xAA00_0000 + part.end)
    };
    let mut found = on_all_cores(1 << 24, shifted).concat();
    found.sort_unstable();
    assert_eq!(found, legal_reads());
    println!("Frames::each in a run: {} of 2^24", found.len());
}
