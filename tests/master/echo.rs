//! The echo of an echoing line where the record of it is full, or a packet did not leave.

use crate::rig::*;

#[test]
fn the_echo_of_the_packet_that_no_longer_fitted_into_the_record_is_removed() {
    let config = with(direct(), |config| config.removes_echo = true);
    // The adapter does not echo at first, and nobody answers: 33 READs fill the record.
    let mut desk = Desk::new(config);
    for _ in 0..33 {
        desk.master.discover(desk.now);
        desk.miss();
    }
    desk.master.discover(desk.now);
    let asked = desk.turn();
    desk.hear(80, &asked);
    let statistics = desk.master.statistics();
    assert_eq!((statistics.echo_bytes, statistics.echo_errors), (4, 0));
}

#[test]
fn an_echo_of_a_packet_that_was_taken_back_does_not_shift_the_next_one() {
    let config = with(direct(), |config| config.removes_echo = true);
    let mut desk = Desk::new(config);
    desk.master.discover(desk.now);
    let asked = desk.turn();
    // A port that is wrong about what has left.
    desk.hear(40, &asked[..2]);
    desk.master.handle_unsent(Unsent::Untouched, desk.now);
    desk.now += MS(1);
    assert_eq!(desk.turn(), asked);
    desk.hear(80, &asked);
    let statistics = desk.master.statistics();
    assert_eq!((statistics.echo_bytes, statistics.echo_errors, statistics.reads), (6, 0, 1));
}
