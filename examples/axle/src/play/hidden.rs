//! Frames that begin inside others: what a receiver takes that has lost its place.

use axlewire::crc16;

use super::{
    effect::{Effect, Side},
    plan::{Due, Plan},
};
use crate::{args::Protocol, failure::Failure};

/// Fails if a frame is hidden in what leaves as it is. A command does not: a role sends its own
/// frame for it.
pub(super) fn refuse(plan: &Plan<'_>) -> Result<(), Failure> {
    let frame = |due: &Due| match due.effect {
        Effect::Write(_) | Effect::Wheels(_) => Default::default(),
        Effect::Ask(_) | Effect::Nothing => due.bytes.clone(),
    };
    let frames: Vec<_> = plan.frames.iter().map(frame).collect();
    let has_host = plan.protocol == Protocol::Ucp && plan.side == Side::Commander;
    let Some((number, taker)) = find(&frames, has_host) else { return Ok(()) };
    Err(Failure::Failed(format!(
        "another frame is hidden in frame {}, and {taker}: nothing is sent",
        number + 1
    )))
}

/// The number, from 0, of the first of these frames in which another one begins, and who takes it:
/// behind noise, behind a frame that it does not know, or because it is of another kind. The other
/// frame may end in the next one. With `has_host`, a host speaks in between, so what begins and
/// does not end may end in anything.
fn find(frames: &[impl AsRef<[u8]>], has_host: bool) -> Option<(usize, &'static str)> {
    let all: Vec<u8> = frames.iter().flat_map(|frame| frame.as_ref()).copied().collect();
    let mut end = 0;
    frames.iter().enumerate().find_map(|(number, frame)| {
        let begin = end;
        end += frame.as_ref().len();
        let mut inside = begin + 1..end;
        inside.find_map(|at| Some((number, taker(all.get(at..)?, end - at, has_host)?)))
    })
}

/// Who takes a frame at the front of these bytes, of which `own` are of the outer frame.
///
/// The receiver of a shipped robot ignores the high byte of `len`, and takes any body of an id from
/// 1 to 10 (ruling U13).
fn taker(bytes: &[u8], own: usize, has_host: bool) -> Option<&'static str> {
    let is_whole = |len| bytes.get(..len).is_some_and(crc16::check);
    match *bytes {
        [0xBB, 1..=8, ..] if is_whole(8) || is_whole(16) => Some("a motor may take it (ruling I3)"),
        [0xFD, 0xFF, len @ 4..=127, _, 1..=10, ..] => {
            let len = 4 + usize::from(len);
            let is_taken = is_whole(len) || has_host && len > own;
            is_taken.then_some("a shipped robot may take it (ruling U13)")
        }
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use axlewire::ikeya::{NodeId, Rps, WriteRequest, three};

    use super::*;

    const PING: [u8; 8] = [0xFD, 0xFF, 4, 0, 1, 0, 1, 0x42];

    fn sealed(body: &[u8]) -> Vec<u8> {
        [body, &crc16::compute(body).to_le_bytes()].concat()
    }

    /// Biases hold any bytes: three that are -3, for example, are FD FF each.
    fn biases(at: usize, hidden: &[u8]) -> Vec<u8> {
        let mut frame = [0xEE; 25];
        frame[..6].copy_from_slice(&[0xFD, 0xFF, 23, 0, 8, 0]);
        frame[at..at + hidden.len()].copy_from_slice(hidden);
        sealed(&frame)
    }

    fn hidden(frames: &[&[u8]], has_host: bool) -> Option<usize> {
        find(frames, has_host).map(|(number, _)| number)
    }

    #[test]
    fn what_is_sent_hides_no_frame_for_a_robot_that_has_lost_its_place() {
        let update = [0xFD, 0xFF, 6, 0, 9, 0, 40, 0];
        let whole = sealed(&update);
        let harmless = biases(6, &[0xFD, 0xFF].repeat(3));
        for has_host in [true, false] {
            assert_eq!(hidden(&[&PING, &harmless, &PING, &whole], has_host), None);
            for at in 6..=15 {
                assert_eq!(hidden(&[&PING, &harmless, &biases(at, &whole)], has_host), Some(2));
            }
            // The robot ignores the high byte of the length.
            for (at, value, is_taken) in
                [(3, 1, true), (4, 0, false), (4, 10, true), (4, 11, false), (2, 3, false)]
            {
                let mut other = update;
                other[at] = value;
                let found = hidden(&[&biases(6, &sealed(&other))], has_host);
                assert_eq!(found, is_taken.then_some(0), "{other:02X?}");
            }
        }
    }

    #[test]
    fn what_begins_in_one_frame_and_ends_in_the_next_is_hidden_too() {
        // One of 31 bytes: 8 of them here, and 23 there.
        let first = biases(19, &[0xFD, 0xFF, 27, 0, 1, 0]);
        let next = biases(6, &[]);
        let crc = crc16::compute(&[&first[19..], &next[..21]].concat());
        let next = biases(21, &crc.to_le_bytes());
        assert_eq!(hidden(&[&PING, &first, &next], false), Some(1));
        assert_eq!(hidden(&[&PING, &first, &PING, &next], false), None);
        // With a host, anything may follow: a stop, for example.
        for frames in [&[&first[..]][..], &[&first, &PING], &[&PING, &first, &PING, &next]] {
            assert!(hidden(frames, true).is_some());
        }
    }

    #[test]
    fn a_write_for_either_kind_of_board_is_hidden_in_an_answer_or_across_two() {
        let write = *WriteRequest::velocity(NodeId::N1, Rps::new(19.0).unwrap()).as_bytes();
        let answer = |payload: &[u8]| sealed(&[&[0x55, 2], payload].concat());
        let padded = |at: usize| [&[7; 4][..at], &write, &[7; 4][at..]].concat();
        for at in 0..=4 {
            assert_eq!(hidden(&[&answer(&[7; 12]), &answer(&padded(at))], false), Some(1));
        }
        // One that begins in an answer of 8 bytes and ends with its CRC in the next one.
        let found = (0..=u8::MAX).find_map(|free| {
            let first = sealed(&[0x55, 1, free, 0xBB, 1, 0]);
            let crc = crc16::compute(&[&first[3..], &[0x55]].concat()).to_le_bytes();
            let is_id = (1..=8).contains(&crc[0]);
            is_id.then(|| (first, sealed(&[0x55, crc[0], crc[1], 0, 0, 0])))
        });
        let (first, next) = found.unwrap();
        assert_eq!(hidden(&[&next, &first, &next], false), Some(1));
        assert_eq!(hidden(&[&next, &first, &first], false), None);
        // 16 bytes across three answers of 8.
        let write = three::WriteRequest::velocity(NodeId::N8, [Rps::ZERO; 3]);
        let frames: Vec<_> = [&[7; 4][..], write.as_bytes(), &[7; 4]].concat();
        let frames: Vec<_> = frames.chunks(8).collect();
        assert_eq!(hidden(&frames, false), Some(0));
    }
}
