//! Every frame that survives a noisy line is delivered, and nothing else is.
//!
//! Streams of 10,000 frames with a fixed seed. The line knows which frames arrive whole, and where;
//! the decoder has to find exactly those. Frames go missing for one reason only: they share a byte
//! with one accepted before (ruling B2), as when a frame that has lost its last byte is completed
//! by the identical first byte of the next.
//!
//! `cargo test --test stream noise -- --nocapture` prints the figures. `cargo bench --bench noise`
//! sends over the same lines and shows them for every way to decode.

use axlewire::ikeya;

use crate::{
    dice::Dice,
    noisy_line::{Arrival, Noise, Place, Tally, transmit},
    oracle,
    rig::*,
    traffic::Traffic,
};

const FRAMES: usize = 10_000;

#[test]
fn ucp_motor_commands_and_reports() {
    survive::<Ucp, 64>(Traffic::Ucp);
}

#[test]
fn ucp_everything_that_goes_to_a_robot() {
    survive::<Ucp, 64>(Traffic::UcpToRobot);
}

#[test]
fn ikeya_responses_of_8_bytes() {
    survive::<ikeya::ToMaster, 8>(Traffic::Ikeya);
}

#[test]
fn ikeya_reads_and_writes() {
    survive::<ikeya::ToSlave, 8>(Traffic::IkeyaRequests);
}

#[test]
fn ikeya_responses_of_16_bytes() {
    survive::<three::ToMaster, 16>(Traffic::Ikeya3);
}

/// Sends `FRAMES` frames over every kind of line and checks what comes out.
fn survive<F: Known, const N: usize>(traffic: Traffic) {
    println!(
        "{:16}{:>12}{:>9}{:>9}{:>11}",
        traffic.name(),
        "noise",
        "bytes",
        "intact",
        "delivered"
    );
    for (seed, noise) in Noise::ALL.into_iter().enumerate() {
        let line = transmit(traffic, noise, FRAMES, 1 + seed as u64);
        let tally = line.tally(&delivered::<F, N>(&line.bytes, &mut Dice(seed as u64)));
        let (name, bytes) = (noise.name(), line.bytes.len());
        println!("{:16}{name:>12}{bytes:>9}{:>9}{:>11}", "", tally.intact, tally.delivered);
        assert!(tally.is_perfect(), "{traffic:?}, {noise:?}: {tally:?}");
        assert!(line.contested() <= 3, "{traffic:?}, {noise:?}: {} shared", line.contested());
        let is_clean = noise == Noise::None;
        let without_loss = is_clean || matches!(noise, Noise::Bursts(_) | Noise::HeaderBursts(_));
        assert!(if without_loss { tally.intact >= FRAMES - 3 } else { tally.intact < FRAMES });
        assert!(tally.intact > FRAMES / 2 && (!is_clean || tally.unavoidable == 0));
    }
}

/// Position and length of every frame that a decoder finds in chunks of any size; the slice
/// iterator has to find the same.
fn delivered<F: Known, const N: usize>(stream: &[u8], dice: &mut Dice) -> Vec<Place> {
    let mut decoder = Decoder::<F, N>::new();
    let (mut places, mut frames) = (Vec::new(), Frames::<F>::new(stream));
    let (mut rest, mut at) = (stream, 0);
    loop {
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
        if rest.is_empty() {
            assert!(frames.next().is_none());
            assert_eq!(frames.rest().len(), decoder.pending());
            if decoder.pending() == 0 {
                break;
            }
            decoder.idle();
            frames.idle();
        }
    }
    let counters = decoder.counters();
    let booked = counters.framed + counters.skipped();
    assert_eq!((counters.received, booked), (stream.len() as u64, stream.len() as u64));
    places
}

#[test]
fn a_frame_that_is_lost_or_invented_is_noticed() {
    let line = transmit(Traffic::Ucp, Noise::BitErrors(1_000), 1_000, 1);
    let good = delivered::<Ucp, 64>(&line.bytes, &mut Dice(1));
    assert_eq!(good, line.valid);
    let tally = line.tally(&good);
    assert!(tally.is_perfect() && (tally.delivered, tally.invented) == (tally.intact, 0));

    let lost = line.tally(&good[1..]);
    assert_eq!(lost, Tally { delivered: tally.intact - 1, ..tally });
    assert!(!lost.is_perfect());
    for more in [(good[0].0 + 1, good[0].1), good[9], (usize::MAX, 8)] {
        let invented = line.tally(&[&good[..], &[more]].concat());
        let phantoms = tally.phantoms + 1;
        assert_eq!(invented, Tally { phantoms, invented: 1, ..tally }, "{more:?}");
        assert!(!invented.is_perfect());
    }
}

#[test]
fn a_frame_that_the_noise_makes_valid_is_unavoidable_and_one_completed_by_the_next_is_whole() {
    let arrival = |valid: &[Place], whole: &[Place]| {
        let whole = whole.iter().copied().collect();
        Arrival::new(Traffic::Ikeya.rules(), vec![0; 24], valid.to_vec(), whole)
    };
    // A valid frame that did not arrive whole, and a whole one behind it.
    let line = arrival(&[(0, 8), (10, 8)], &[(10, 8)]);
    let tally = line.tally(&[(0, 8), (10, 8)]);
    let expected = Tally { intact: 1, delivered: 1, phantoms: 1, unavoidable: 1, invented: 0 };
    assert_eq!(tally, expected);
    // Two whole ones that share a byte: only the first is there for a receiver.
    let line = arrival(&[(0, 8)], &[(0, 8), (7, 8)]);
    assert_eq!(line.contested(), 1);
    let expected = Tally { intact: 1, delivered: 1, ..Tally::default() };
    assert_eq!(line.tally(&[(0, 8)]), expected);
    assert_eq!(line.tally(&[(7, 8)]), Tally { delivered: 0, ..expected });
}

#[test]
fn a_frame_inside_a_foreign_packet_is_there_for_nobody() {
    // An answer of node 9, as far as its CRC says, that begins in the rest of a damaged one.
    let mut foreign = [0x55, 9, 1, 2, 0x55, 3, 0, 0, 0, 0, 0, 0];
    oracle::seal(&mut foreign[..8]);
    oracle::seal(&mut foreign[4..]);
    let whole = [(4, 8)].into_iter().collect();
    let line = Arrival::new(Traffic::Ikeya.rules(), foreign.to_vec(), vec![], whole);
    assert_eq!((line.contested(), line.tally(&[]).intact), (1, 0));
}

#[test]
#[should_panic = "the oracle has lost the frame at 8"]
fn an_oracle_that_loses_a_frame_is_noticed() {
    let whole = [(0, 8), (8, 8)].into_iter().collect();
    let _ = Arrival::new(Traffic::Ikeya.rules(), vec![0; 16], vec![(0, 8)], whole);
}
