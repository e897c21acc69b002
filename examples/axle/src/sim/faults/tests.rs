//! What the faults of a line depend on.

use super::*;

#[test]
fn both_directions_have_faults_of_their_own_that_only_the_seed_decides() {
    let carried = |seed| {
        let args = FaultArgs { noise: 0.1, seed, ..FaultArgs::default() };
        let (from, to) = args.wires();
        [from, to].map(|mut wire| {
            let (mut buffer, now) = ([0; 100], Instant::from_micros(0));
            wire.send(&buffer, now);
            let count = wire.receive(&mut buffer, now);
            buffer[..count].to_vec()
        })
    };
    let [from, to] = carried(1);
    assert!(from.iter().any(|byte| *byte != 0) && from != to, "{from:?} {to:?}");
    assert_eq!(carried(1), [from.clone(), to.clone()]);
    assert!(!carried(2).contains(&from) && !carried(2).contains(&to));
}
