//! Properties of every framing on hostile streams: whatever a user does, the decoder gives the same
//! result as the slow oracle, and neither delay nor work grows without bound.

use axlewire::ikeya;
use proptest::{collection::vec, prelude::*};

use crate::{
    checked_line::{self, Op},
    judged_work::check_work,
    oracle,
    rig::*,
    split,
};

macro_rules! properties {
    ($($name:ident: $framing:ty, $max_len:literal;)+) => {$(
        mod $name {
            use super::*;

            type F = $framing;
            const MAX_LEN: usize = $max_len;

            fn stream() -> impl Strategy<Value = Vec<u8>> {
                hostile_streams::stream(F::RULES)
            }

            #[test]
            fn the_smallest_buffer_is_the_longest_frame() {
                assert_eq!(<F as Framing>::MAX_LEN, MAX_LEN);
            }

            // The oracle tries every start before every frame: a quarter of the cases.
            proptest! {
                #![proptest_config(ProptestConfig::with_cases(ProptestConfig::default().cases / 4))]

                #[test]
                fn parts_give_what_the_oracle_says_of_the_whole(
                    stream in stream(),
                    len in 0..300_usize,
                ) {
                    split::check_split_points::<F>(&stream);
                    split::check_parts::<F>(&stream, len);
                }
            }

            proptest! {
                #[test]
                fn a_slice_gives_what_the_oracle_says(stream in stream()) {
                    checked_line::check_slice::<F>(&stream);
                }

                #[test]
                fn a_finished_slice_gives_what_the_oracle_says(stream in stream()) {
                    checked_line::check_finished_slice::<F>(&stream);
                }

                #[test]
                fn single_bytes_give_what_the_oracle_says(stream in stream()) {
                    CheckedLine::<F, MAX_LEN>::new().play(&stream, &[Op::Slice(1)]);
                    CheckedLine::<F, MAX_LEN>::new().play(&stream, &[Op::Commit(1), Op::Drain]);
                }

                #[test]
                fn pushed_bytes_give_what_the_oracle_says(stream in stream()) {
                    CheckedLine::<F, MAX_LEN>::new().play(&stream, &[Op::Push(1)]);
                    CheckedLine::<F, MAX_LEN>::new().play(&stream, &[Op::Push(5), Op::Slice(3), Op::Idle]);
                }

                #[test]
                fn chunks_do_not_matter(stream in stream(), chunks in vec(0..80_usize, 1..8)) {
                    let ops: Vec<_> = chunks.into_iter().map(Op::Slice).collect();
                    CheckedLine::<F, MAX_LEN>::new().play(&stream, &ops);
                }

                #[test]
                fn a_port_may_fill_the_buffer(
                    stream in stream(),
                    chunks in vec((0..300_usize, any::<bool>()), 1..8),
                ) {
                    let drained = |(len, drain)| [Op::Commit(len), if drain { Op::Drain } else { Op::Commit(1) }];
                    let mut ops: Vec<_> = chunks.into_iter().flat_map(drained).collect();
                    ops.push(Op::Drain);
                    CheckedLine::<F, MAX_LEN>::new().play(&stream, &ops);
                    CheckedLine::<F, { MAX_LEN + 1 }>::new().play(&stream, &ops);
                    CheckedLine::<F, 512>::new().play(&stream, &ops);
                }

                #[test]
                fn an_idle_line_ends_candidates_anywhere(
                    stream in stream(),
                    chunks in vec(0..40_usize, 1..8),
                ) {
                    let quiet = |len| [Op::Slice(len), Op::Idle];
                    let ops: Vec<_> = chunks.into_iter().flat_map(quiet).collect();
                    CheckedLine::<F, MAX_LEN>::new().play(&stream, &ops);
                }

                #[test]
                fn an_idle_line_loses_no_frame_that_is_still_in_the_buffer(
                    stream in stream(),
                    chunks in vec(0..300_usize, 1..8),
                ) {
                    let quiet = |len| [Op::Commit(len), Op::Idle, Op::Drain];
                    let ops: Vec<_> = chunks.into_iter().flat_map(quiet).collect();
                    CheckedLine::<F, MAX_LEN>::new().play(&stream, &ops);
                    CheckedLine::<F, 512>::new().play(&stream, &ops);
                }

                #[test]
                fn stopping_early_loses_nothing(
                    stream in stream(),
                    stops in vec((1..200_usize, 0..4_usize), 1..8),
                ) {
                    let stop = |(len, events)| Op::Stop { len, events };
                    let ops: Vec<_> = stops.into_iter().map(stop).collect();
                    CheckedLine::<F, MAX_LEN>::new().play(&stream, &ops);
                }

                #[test]
                fn nothing_that_a_user_does_matters(stream in stream(), ops in hostile_streams::ops()) {
                    CheckedLine::<F, MAX_LEN>::new().play(&stream, &ops);
                    CheckedLine::<F, { MAX_LEN + 1 }>::new().play(&stream, &ops);
                    CheckedLine::<F, 512>::new().play(&stream, &ops);
                }

                #[test]
                fn a_start_delays_a_frame_by_less_than_a_frame(
                    stream in stream(),
                    frame in hostile_streams::frame(F::RULES),
                ) {
                    check_stall::<F, MAX_LEN>(&stream, &frame);
                }

                #[test]
                fn work_is_bounded(stream in stream(), ops in hostile_streams::ops()) {
                    check_work::<F, MAX_LEN>(&stream, &ops);
                    check_work::<F, MAX_LEN>(&stream, &[Op::Slice(1)]);
                }
            }
        }
    )+};
}

properties! {
    ikeya_to_slave: ikeya::ToSlave, 8;
    ikeya_to_master: ikeya::ToMaster, 8;
    ikeya_either: ikeya::BothDirections, 8;
    three_to_slave: three::ToSlave, 16;
    three_to_master: three::ToMaster, 16;
    three_either: three::BothDirections, 16;
    ucp_by_default: Ucp, 64;
    ucp_with_the_largest_cap: Ucp<252>, 256;
}

/// B3: whatever came before, less than a longest frame is held back, and a quiet line ends that;
/// the first good frame is then delivered with its last byte and as the first event.
fn check_stall<F: Known, const N: usize>(stream: &[u8], frame: &[u8]) {
    let mut line = CheckedLine::<F, N>::new();
    line.slice(stream);
    loop {
        let before = line.decoder().pending();
        assert!(before < F::MAX_LEN);
        line.idle();
        line.slice(&[]);
        if before == 0 {
            break;
        }
        assert!(line.decoder().pending() < before, "an idle line ends nothing");
    }
    let seen = line.events().len();
    line.slice(frame);
    assert_eq!(line.events().len() - seen, oracle::answer(F::RULES, frame, &[]).events.len());
    line.finish();
}
