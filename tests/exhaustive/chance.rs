use axlewire::ikeya;

use super::*;

/// Trials whose bytes are damaged at random and pass all the same. The first bytes, which tell the
/// length and the node, are those of a frame; all others, CRC included, are random.
fn passed<F: Framing>(start: &[u8], len: usize, trials: u64, seed: u64) -> u64 {
    let count = |trials: Range<u64>| {
        let mut dice = Dice((seed ^ trials.start).wrapping_mul(0xD134_2543_DE82_EF95));
        let mut bytes = [0; 64];
        let mut passed = 0;
        for _ in trials {
            dice.fill(&mut bytes[..len]);
            bytes[..start.len()].copy_from_slice(start);
            passed += u64::from(F::judge(&bytes[..len]) == Verdict::Frame { len });
        }
        passed
    };
    on_all_cores(trials, count).iter().sum()
}

/// Passes in so many trials with probability 2^-16 each, within four standard deviations. Chance
/// alone fails such a test once in 16,000 times; but the seeds are fixed.
fn assert_chance<F: Framing>(name: &str, start: &[u8], len: usize, trials: u64) {
    let expected = trials as f64 / 65_536.0;
    let sigma = (expected * (1.0 - 1.0 / 65_536.0)).sqrt();
    let found = passed::<F>(start, len, trials, len as u64);
    let deviation = (found as f64 - expected) / sigma;
    println!(
        "{name:26}{len:>3} bytes: {found} of {trials} pass, expected {expected} ± {sigma:.1}: \
         {deviation:+.2} sigma"
    );
    assert!(deviation.abs() < 4.0, "{name}: {found} of {trials}");
}

fn every_kind(trials: u64) {
    assert_chance::<ikeya::ToSlave>("READ", &[0xAA, 1], 4, trials);
    assert_chance::<ikeya::ToSlave>("WRITE", &[0xBB, 3], 8, trials);
    assert_chance::<ikeya::ToMaster>("velocity", &[0x55, 8], 8, trials);
    assert_chance::<three::ToMaster>("position, three motors", &[0x56, 2], 16, trials);
    for len in [8, 24, 44, 64] {
        assert_chance::<Ucp>("UCP", &[0xFD, 0xFF, len - 4, 0], len.into(), trials);
    }
}

#[test]
fn random_damage_seldom_passes() {
    every_kind(1 << 18);
}

#[test]
#[ignore = "takes a minute: see the top of main.rs"]
fn random_damage_passes_once_in_65536_times() {
    every_kind(1 << 28);
}
