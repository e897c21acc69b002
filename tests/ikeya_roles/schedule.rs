//! The schedule gives the rate of a bus before it is wired.

use axlewire::ikeya::{board::ThreeMotors, master::Schedule};

use crate::rig::*;

#[test]
fn the_schedule_gives_the_rate_of_a_bus_before_it_is_wired() {
    let plan = Schedule::new(8);
    assert_eq!((plan.cycle_time(), plan.cycles_per_second(), plan.busy_pct()), (US(3600), 277, 88));
    let mut reading = plan;
    reading.writes = false;
    assert_eq!(reading.exchange_time(), US(80 + 50 + 160));
    assert_eq!(plan.exchange_time_of::<ThreeMotors>(), US(320 + 50 + 320));
    let mut slow = plan;
    slow.baud = 57_600;
    assert_eq!(slow.exchange_time(), US(1389 + 695 + 50 + 1389));
    assert_eq!(Schedule::new(0).cycles_per_second(), 0);
}
