//! Whole captures: long ones, with runs of good frames as batches like them, decoded as a slice,
//! frame by frame, by `each`, in parts, and as a list of events; always against the oracle.
//!
//! The data is a plan of up to 64 pieces, four bytes each: what, how often, and two for a value.

use axlewire::{
    ikeya::{self, three},
    stream::{self, Frames},
    ucp,
};

use super::{
    Tally,
    checked_line::{check_finished_slice, check_slice, located},
    known_framings::Known,
    oracle::{self, Event, Rules},
    streams::Repair,
};

/// A capture in one of eight framings.
pub(super) fn captures(data: &[u8], tally: &mut Tally) {
    let [choice, repair, plan @ ..] = data else { return };
    let repair = Repair::of(*repair);
    match choice % 8 {
        0 => check::<ikeya::ToSlave>(0, plan, repair, tally),
        1 => check::<ikeya::ToMaster>(1, plan, repair, tally),
        2 => check::<ikeya::BothDirections>(2, plan, repair, tally),
        3 => check::<three::ToSlave>(3, plan, repair, tally),
        4 => check::<three::ToMaster>(4, plan, repair, tally),
        5 => check::<three::BothDirections>(5, plan, repair, tally),
        6 => check::<ucp::Ucp>(6, plan, repair, tally),
        _ => check::<ucp::Ucp<252>>(7, plan, repair, tally),
    }
}

fn check<F: Known>(kind: u8, plan: &[u8], repair: Repair, tally: &mut Tally) {
    let mut stream = Vec::new();
    for piece in plan.chunks_exact(4).take(64) {
        let piece: [u8; 4] = piece.try_into().expect("four bytes");
        extend(&mut stream, F::RULES, piece);
        if stream.len() > 3000 {
            break;
        }
    }
    repair.repair::<F>(&mut stream);
    check_slice::<F>(&stream);
    check_finished_slice::<F>(&stream);
    check_idle_between::<F>(&stream);
    let told = oracle::answer(F::RULES, &stream, &[]);
    check_parts::<F>(&stream, &told);
    tally.did_many(kind, told.frames().len());
}

/// Appends a piece: `how often` times a frame, a false start or a byte.
fn extend(stream: &mut Vec<u8>, rules: Rules, [what, count, low, high]: [u8; 4]) {
    let count = usize::from(count % 64);
    let header = match rules {
        Rules::Ikeya { .. } => [0xAA, 0xBB, 0x55, 0x56][usize::from(low % 4)],
        Rules::Ucp { .. } => 0xFD,
    };
    for number in 0..count {
        let value = low.wrapping_add((number as u8).wrapping_mul(high));
        match (what % 8, rules) {
            (0..=3, Rules::Ikeya { long, .. }) => {
                let len = if header == 0xAA { 4 } else { long };
                let start = stream.len();
                // One id in 16 is none.
                let id = if value % 16 == 15 { value } else { 1 + value % 8 };
                stream.extend([header, id]);
                stream.extend((2..len).map(|at| value.wrapping_mul(at as u8)));
                oracle::seal(&mut stream[start..]);
                // A damaged frame now and then.
                if what % 8 == 3 && number % 5 == 4 {
                    stream[start + usize::from(value) % len] ^= 1 << (value % 8);
                }
            }
            (0..=3, Rules::Ucp { cap }) => {
                let body = usize::from(high) % (cap - 3);
                let start = stream.len();
                stream.extend([0xFD, 0xFF, (body + 4) as u8, 0, value, number as u8]);
                stream.extend((0..body).map(|at| value ^ at as u8));
                stream.extend([0, 0]);
                oracle::seal(&mut stream[start..]);
                if what % 8 == 3 && number % 5 == 4 {
                    let len = stream.len() - start;
                    stream[start + usize::from(value) % len] ^= 1 << (value % 8);
                }
            }
            (4, _) => stream.push(header),
            (5, _) => stream.extend([header, 0xFF, value]),
            (6, _) => stream.extend([value]),
            _ => stream.truncate(stream.len().saturating_sub(usize::from(high % 8))),
        }
    }
}

/// Silences between frames, in the middle of the iteration: a rest that was given up is not
/// delivered, and the account holds.
fn check_idle_between<F: Known>(stream: &[u8]) {
    let half = stream.len() / 2;
    let mut frames = Frames::<F>::new(&stream[..half]);
    while frames.next().is_some() {}
    while !frames.rest().is_empty() {
        let before = frames.rest().len();
        frames.idle();
        while frames.next().is_some() {}
        assert!(frames.rest().len() < before, "a silence gives up at least one byte (B3)");
    }
    let counters = frames.counters();
    assert_eq!(counters.received, half as u64);
    assert_eq!(counters.framed + counters.skipped(), half as u64);
}

/// Parts, decoded apart, give what the whole gives.
fn check_parts<F: Known>(stream: &[u8], told: &oracle::Answer) {
    for len in [1, 64, stream.len() / 3 + 1] {
        let (mut found, mut skipped, mut at, mut rest) = (Vec::new(), 0, 0, 0);
        for part in stream::parts::<F>(stream, len) {
            assert!(part.len() >= len.min(stream.len() - at), "a part is too short");
            let mut frames = Frames::<F>::new(part);
            for frame in frames.by_ref() {
                let bytes = F::bytes(&frame);
                let offset = bytes.as_ptr().addr() - stream.as_ptr().addr();
                found.push((offset, bytes.len()));
            }
            skipped += frames.counters().skipped();
            rest = frames.rest().len();
            at += part.len();
            assert!(rest == 0 || at == stream.len(), "a part ends inside a frame");
        }
        assert_eq!((found, rest, at), (told.frames(), told.pending, stream.len()));
        assert_eq!(skipped as usize, told.skipped.iter().sum::<usize>());
        // A split point is the end of a frame.
        if let Some(split) = stream::split_point::<F>(stream, len) {
            assert!(split > len.min(stream.len()), "before where it was asked for");
            let (head, tail) = stream.split_at(split);
            let (mut events, _) = stream::decode_capture::<F>(head);
            let first: Vec<_> = events.drain(..).map(|event| located::<F>(event)).collect();
            assert!(matches!(first.last(), Some(Event::Frame { .. })), "{first:?}");
            let mut behind = oracle::answer(F::RULES, tail, &[]);
            behind.move_by(split);
            let mut frames = oracle::Answer { events: first, ..oracle::Answer::default() }.frames();
            frames.extend(behind.frames());
            assert_eq!(frames, told.frames());
        }
    }
}
