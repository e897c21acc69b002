//! The clock of `std`.

use axlewire::{
    drive::{Clock, StdClock},
    time::Duration,
};

#[test]
fn the_clock_of_std_never_sleeps_past_a_deadline() {
    let mut clock = StdClock::default();
    let start = clock.now();
    clock.idle_until(start);
    let far = start + Duration::from_millis(60_000);
    let begin = clock.now();
    clock.idle_until(far);
    let end = clock.now();
    assert!(end >= begin + Duration::from_micros(200) && end < far);
}

#[test]
fn a_nap_of_the_clock_of_std_is_short_compared_with_an_answer() {
    // The system may be busy now and then, but not each time.
    let nap = || {
        let mut clock = StdClock::new();
        let start = clock.now();
        clock.idle_until(start + Duration::from_millis(60_000));
        clock.now() - start
    };
    let shortest = (0..20).map(|_| nap()).min().unwrap();
    assert!(shortest < Duration::from_millis(5), "{shortest:?}");
}
