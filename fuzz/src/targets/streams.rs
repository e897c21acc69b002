//! Any stream, with any chunks and interruptions, against the oracle. A script comes first:
//!
//! ```text
//! byte 0       framing and buffer size
//! byte 1       low two bits: which CRCs are repaired; upper six bits: number of ops that follow
//! then         ops, one byte each: actions on the decoder, in order (see `op`)
//! then         the stream
//! ```

use axlewire::{
    ikeya::{self, three},
    ucp,
};

use super::{
    Tally,
    checked_line::{self, CheckedLine, Op},
    judged_work::check_work,
    known_framings::Known,
    oracle,
};

/// The six Ikeya framings.
pub(super) fn ikeya(data: &[u8], tally: &mut Tally) {
    let Some(script) = Script::read(data) else { return };
    match script.choice % 12 {
        0 => script.play::<ikeya::ToSlave, 8>(12, tally),
        1 => script.play::<ikeya::ToSlave, 37>(12, tally),
        2 => script.play::<ikeya::ToMaster, 8>(12, tally),
        3 => script.play::<ikeya::ToMaster, 37>(12, tally),
        4 => script.play::<ikeya::BothDirections, 8>(12, tally),
        5 => script.play::<ikeya::BothDirections, 37>(12, tally),
        6 => script.play::<three::ToSlave, 16>(12, tally),
        7 => script.play::<three::ToSlave, 37>(12, tally),
        8 => script.play::<three::ToMaster, 16>(12, tally),
        9 => script.play::<three::ToMaster, 37>(12, tally),
        10 => script.play::<three::BothDirections, 16>(12, tally),
        _ => script.play::<three::BothDirections, 37>(12, tally),
    }
}

/// The same for UCP, with the default, smallest and largest cap.
pub(super) fn ucp(data: &[u8], tally: &mut Tally) {
    let Some(script) = Script::read(data) else { return };
    match script.choice % 6 {
        0 => script.play::<ucp::Ucp, 64>(6, tally),
        1 => script.play::<ucp::Ucp, 150>(6, tally),
        2 => script.play::<ucp::Ucp<4>, 8>(6, tally),
        3 => script.play::<ucp::Ucp<4>, 37>(6, tally),
        4 => script.play::<ucp::Ucp<252>, 256>(6, tally),
        _ => script.play::<ucp::Ucp<252>, 300>(6, tally),
    }
}

struct Script<'a> {
    choice: u8,
    repair: Repair,
    ops: Vec<Op>,
    stream: &'a [u8],
}

/// Which candidates get a correct CRC, since a fuzzer cannot guess it.
#[derive(Clone, Copy)]
pub(super) enum Repair {
    None,
    /// Consecutive ones.
    Adjacent,
    /// All, inner ones first: frames in payloads.
    Nested,
    /// Every second one.
    Alternate,
}

impl<'a> Script<'a> {
    fn read(data: &'a [u8]) -> Option<Self> {
        let [choice, plan, rest @ ..] = data else { return None };
        let (ops, stream) = rest.split_at_checked(usize::from(plan >> 2))?;
        let ops = ops.iter().map(|&byte| op(byte)).collect();
        Some(Self { choice: *choice, repair: Repair::of(*plan), ops, stream })
    }

    fn play<F: Known, const N: usize>(&self, kinds: u8, tally: &mut Tally) {
        let mut stream = self.stream.to_vec();
        self.repair.repair::<F>(&mut stream);
        CheckedLine::<F, N>::new().play(&stream, &self.ops);
        check_work::<F, N>(&stream, &self.ops);
        checked_line::check_slice::<F>(&stream);
        // Batches are blocks of up to 128 bytes: more than most inputs have.
        checked_line::check_slice::<F>(&stream.repeat(1 + 256 / (stream.len() + 1)));
        let frames = oracle::answer(F::RULES, &stream, &[]).frames().len();
        tally.did_many(self.choice % kinds, frames);
    }
}

/// Reads one op of the script: its upper bits are the kind, its lower bits the amount.
fn op(byte: u8) -> Op {
    let amount = usize::from(byte & 0x1F);
    match byte >> 5 {
        0 => Op::Slice(amount),
        1 => Op::Slice(8 * amount),
        2 => Op::Commit(amount),
        3 => Op::Commit(8 * amount),
        4 => Op::Stop { len: 4 * amount, events: 1 },
        5 => Op::Stop { len: 4 * amount, events: 2 },
        6 if amount == 0 => Op::Drain,
        6 => Op::Push(amount),
        _ => Op::Idle,
    }
}

impl Repair {
    /// By the low two bits.
    pub(super) fn of(choice: u8) -> Self {
        match choice & 3 {
            0 => Self::None,
            1 => Self::Adjacent,
            2 => Self::Nested,
            _ => Self::Alternate,
        }
    }

    pub(super) fn repair<F: Known>(self, stream: &mut [u8]) {
        let (mut at, mut count) = (0, 0);
        while at < stream.len() {
            let promised = oracle::promised_len(F::RULES, &stream[at..]);
            let end = promised.ok().flatten().map(|len| at + len);
            let Some(end) = end.filter(|&end| end <= stream.len()) else {
                at += 1;
                continue;
            };
            count += 1;
            match self {
                Self::None => return,
                Self::Alternate if count % 2 == 0 => at += 1,
                Self::Adjacent | Self::Alternate => {
                    oracle::seal(&mut stream[at..end]);
                    at = end;
                }
                Self::Nested => {
                    Self::Adjacent.repair::<F>(&mut stream[at + 1..end - 2]);
                    oracle::seal(&mut stream[at..end]);
                    at = end;
                }
            }
        }
    }
}
