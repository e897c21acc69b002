//! Times that a caller can know in advance: the rate of a bus before it is wired, and the bounds of
//! a master's calls.

use axlewire::ikeya::master::Schedule;

use crate::rig::*;

#[test]
fn the_schedule_gives_the_rate_of_a_bus_before_it_is_wired() {
    let plan = Schedule::new(8);
    assert_eq!((plan.nodes, plan.writes, plan.baud), (8, true, 500_000));
    assert_eq!((plan.response_time, plan.turnaround_gap), (US(50), US(0)));
    assert_eq!((plan.cycle_time(), plan.cycles_per_second(), plan.busy_pct()), (US(3600), 277, 88));
    let mut reading = plan;
    reading.writes = false;
    assert_eq!(reading.exchange_time(), US(80 + 50 + 160));
    assert_eq!(plan.exchange_time_of::<ThreeMotors>(), US(320 + 50 + 320));
    assert_eq!(reading.exchange_time_of::<ThreeMotors>(), US(80 + 50 + 320));
    let mut slow = plan;
    slow.baud = 57_600;
    assert_eq!(slow.exchange_time(), US(1389 + 695 + 50 + 1389));
    assert_eq!((Schedule::new(0).cycles_per_second(), Schedule::new(0).cycle_time()), (0, US(0)));
}

#[test]
fn a_gap_after_each_packet_is_silence_in_the_schedule() {
    let mut plan = Schedule::new(3);
    plan.turnaround_gap = US(200);
    let mut reading = plan;
    reading.writes = false;
    assert_eq!(plan.exchange_time(), US(160 + 200 + 80 + 50 + 160 + 200));
    assert_eq!(plan.busy_pct(), 400 * 100 / 850);
    assert_eq!(plan.cycle_time(), US(3 * 850));
    assert_eq!(reading.exchange_time(), US(80 + 50 + 160 + 200));
    assert_eq!(reading.busy_pct(), 240 * 100 / 490);
    assert_eq!(plan.exchange_time_of::<ThreeMotors>(), US(320 + 50 + 320 + 200));
}

#[test]
fn the_bounds_of_a_master_follow_from_its_settings() {
    let bounds = |gap_us, guard_us, attempts: u8| {
        let mut config = direct();
        (config.turnaround_gap, config.late_guard) = (US(gap_us), US(guard_us));
        config.attempts = attempts;
        let (now, three) = (Desk::new(config).now, Master::<ThreeMotors>::for_board);
        let (one, three) = (Master::new(config, now), three(config, now));
        [one.read_bound(), one.stop_bound(), three.read_bound(), three.stop_bound()]
    };
    // The time of a WRITE, the longest of both kinds, and of an exchange: of a WRITE, a READ, 500
    // us and the answer.
    let expected = |gap: u32, guard: u32, attempts: u32| {
        let write = 320 + gap;
        let (one, three) = (write + 80 + 500 + 160 + gap, write + 80 + 500 + 320 + gap);
        [
            attempts * (guard + 16 * (one + 8 * write)),
            4 * attempts * (guard + 9 * one + 8 * write),
            attempts * (guard + 16 * (three + 8 * three)),
            4 * attempts * (guard + 9 * three + 8 * write),
        ]
        .map(US)
    };
    assert_eq!(bounds(0, 500, 3), expected(0, 500, 3));
    assert_eq!(bounds(70, 20_000, 5), expected(70, 20_000, 5));
    assert_eq!(bounds(0, 500, 0), bounds(0, 500, 1), "0 counts as 1");
}

#[test]
fn no_attempts_count_as_one() {
    for attempts in [0, 1] {
        let mut desk = Desk::tuned(|config| config.attempts = attempts, &[N1]);
        assert!(desk.master.health(N1.0).is_some(), "found in the one pass");
        desk.told();
        desk.master.read(N1.0, desk.now).unwrap();
        desk.miss();
        assert!(desk.master.read_outcome(N1.0).unwrap().is_err(), "failed after one");
    }
}

#[test]
fn each_time_of_a_master_has_a_setting_of_its_own() {
    let mut config = direct();
    (config.reply_timeout, config.late_guard) = (US(700), US(1100));
    config.turnaround_gap = US(130);
    let mut desk = Desk::asking(config);
    let asked = desk.now;
    // The READ, the timeout and the answer.
    assert_eq!(desk.master.poll_timeout(), Some(asked + US(80 + 700 + 160)));
    desk.silence();
    let closed = desk.now;
    assert_eq!(desk.master.poll_timeout(), Some(closed + US(1100)));
    desk.turn();
    assert_eq!(desk.now, closed + US(1100));
    desk.hear(600, &velocity(N1.0, 0.0));
    let heard = desk.now;
    desk.turn();
    assert_eq!(desk.now, heard + US(130));
    // From the end of the request to the start of the answer.
    let latency = desk.master.node_statistics(N1.0).latency;
    assert_eq!(latency.last(), Some(US(600 - 80 - 160)));
}
