//! A fixed amount of one kind of work, whose instructions `instructions.sh` counts.
//!
//! `instructions list` lists the kinds and their frames per round; `instructions NAME N` runs N
//! rounds of one kind and checks the answers. The script takes the difference between two counts,
//! which cancels the cost of startup and of making the streams.

use std::{env, hint::black_box, process::ExitCode};

use axlewire::crc16;
use axlewire_contenders::{
    IKEYA, Tally, UCP, reference,
    streams::{self, Stream},
};

/// Short, because valgrind is slow, but long enough to contain the rare frames.
const STREAM_LEN: usize = 256 << 10;

/// Number of CRCs in one round.
const CRCS: u64 = 1000;

type Decode = fn(&[u8]) -> Tally;
type Compute = fn(&[u8]) -> u16;

/// A kind of work.
enum Kind {
    Stream(fn(usize) -> Stream, Decode),
    Crc(usize, Compute),
}

#[rustfmt::skip]
const KINDS: [(&str, Kind); 18] = [
    ("ikeya8_frames", Kind::Stream(streams::responses, IKEYA.frames)),
    ("ikeya8_each", Kind::Stream(streams::responses, IKEYA.each)),
    ("ikeya_mixed_each", Kind::Stream(streams::requests_and_responses, IKEYA.each)),
    ("ikeya_mixed_frames", Kind::Stream(streams::requests_and_responses, IKEYA.frames)),
    ("ucp44_frames", Kind::Stream(streams::reports, UCP.frames)),
    ("ikeya8_decoder4096", Kind::Stream(streams::responses, |b| (IKEYA.decoder)(b, 4096))),
    ("ucp44_decoder4096", Kind::Stream(streams::reports, |b| (UCP.decoder)(b, 4096))),
    ("ikeya8_decoder1", Kind::Stream(streams::responses, IKEYA.pushed)),
    ("ucp44_decoder1", Kind::Stream(streams::reports, UCP.pushed)),
    ("crc6", Kind::Crc(6, crc16::compute)),
    ("crc42", Kind::Crc(42, crc16::compute)),
    ("c_ikeya8", Kind::Stream(streams::responses, IKEYA.c_table)),
    ("c_ikeya_mixed", Kind::Stream(streams::requests_and_responses, IKEYA.c_table)),
    ("c_ucp44", Kind::Stream(streams::reports, UCP.c_table)),
    ("c_crc6", Kind::Crc(6, reference::crc_table)),
    ("c_crc42", Kind::Crc(42, reference::crc_table)),
    ("c_bitwise_crc6", Kind::Crc(6, reference::crc_bitwise)),
    ("c_bitwise_crc42", Kind::Crc(42, reference::crc_bitwise)),
];

fn main() -> ExitCode {
    let arguments: Vec<String> = env::args().skip(1).collect();
    match arguments.iter().map(String::as_str).collect::<Vec<_>>()[..] {
        ["list"] => {
            for (name, kind) in KINDS {
                println!("{name} {}", kind.frames());
            }
            ExitCode::SUCCESS
        }
        [name, rounds] => {
            let kind = KINDS.iter().find(|(known, _)| *known == name);
            let (Some((_, kind)), Ok(rounds)) = (kind, rounds.parse()) else { return usage() };
            kind.run(rounds);
            ExitCode::SUCCESS
        }
        _ => usage(),
    }
}

fn usage() -> ExitCode {
    eprintln!("usage: instructions list | instructions NAME ROUNDS");
    ExitCode::from(2)
}

impl Kind {
    /// Number of frames or CRCs in one round.
    fn frames(&self) -> u64 {
        match self {
            Self::Stream(make, _) => make(STREAM_LEN).sent as u64,
            Self::Crc(..) => CRCS,
        }
    }

    fn run(&self, rounds: u32) {
        match *self {
            Self::Stream(make, decode) => {
                let stream = make(STREAM_LEN);
                let right = (stream.protocol.oracle)(&stream.bytes);
                assert_eq!(right.frames, stream.sent as u64);
                for _ in 0..rounds {
                    assert_eq!(black_box(decode)(black_box(&stream.bytes)), right);
                }
            }
            Self::Crc(len, compute) => {
                let bytes = vec![0x5A; len];
                let right = reference::crc_bitwise(&bytes);
                for _ in 0..u64::from(rounds) * CRCS {
                    assert_eq!(black_box(compute)(black_box(&bytes)), right);
                }
            }
        }
    }
}
