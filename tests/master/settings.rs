//! Settings of a master: polling, gaps, queues, defaults and memory.

use crate::rig::*;

#[test]
fn a_line_without_a_speed_has_the_usual_one() {
    let mut config = MasterConfig::direct();
    config.baud = 0;
    assert_eq!(Master::new(config, Instant::default()).config().baud, 500_000);
}

#[test]
fn periodic_polling_keeps_its_period_without_drift() {
    let (mut desk, begin) = read_every_10_ms();
    for turn in 1..100 {
        desk.turn();
        assert_eq!(desk.now, begin + Duration::from_millis(10 * turn));
        desk.hear(290, &velocity(NodeId::N1, 0.0));
    }
}

#[test]
fn a_requested_node_is_read_at_once_whatever_its_period() {
    let mut config = direct();
    config.polling = Polling::Every(Duration::from_millis(100));
    let mut desk = Desk::with_nodes(config, &[N1]);
    desk.turn_with(290, &velocity(NodeId::N1, 0.0));
    assert!(desk.master.poll_timeout() > Some(desk.now + Duration::from_millis(90)));
    desk.master.read(NodeId::N1, desk.now).unwrap();
    let asked_at = desk.now;
    assert_eq!(desk.turn(), read(NodeId::N1));
    assert!(desk.now < asked_at + US(500), "at once");
}

/// A bus with one node that is read every 10 ms; the READ at the returned time has been answered.
fn read_every_10_ms() -> (Desk, Instant) {
    let mut desk = Desk::tuned(|config| config.polling = Polling::Every(MS(10)), &[N1]);
    // The first is late: it was due during the discovery.
    desk.turn_with(290, &velocity(NodeId::N1, 0.0));
    desk.turn();
    let begin = desk.now;
    desk.hear(290, &velocity(NodeId::N1, 0.0));
    (desk, begin)
}

/// When the next READ is sent by a driver that is called at this time and punctually afterwards.
fn next_read(desk: &mut Desk, called_at: Instant) -> Instant {
    desk.now = called_at;
    desk.master.handle_timeout(desk.now);
    assert_eq!(desk.turn(), read(NodeId::N1));
    let sent_at = desk.now;
    desk.hear(290, &velocity(NodeId::N1, 0.0));
    sent_at
}

#[test]
fn a_read_that_is_late_does_not_shift_the_next_ones() {
    for late in [1, 5_000, 9_500] {
        let (mut desk, begin) = read_every_10_ms();
        let late_at = begin + MS(10) + US(late);
        assert_eq!(next_read(&mut desk, late_at), late_at);
        let called_at = desk.now;
        assert_eq!(next_read(&mut desk, called_at), begin + MS(20), "{late} us late");
    }
}

#[test]
fn after_a_pause_of_whole_periods_there_is_one_read_and_then_the_period() {
    for pause in [20_000, 20_001, 55_000, 3_600_000_000] {
        let (mut desk, begin) = read_every_10_ms();
        let back_at = begin + US(pause);
        assert_eq!(next_read(&mut desk, back_at), back_at);
        let called_at = desk.now;
        assert_eq!(next_read(&mut desk, called_at), back_at + MS(10), "a pause of {pause} us");
    }
}

#[test]
fn a_requested_read_does_not_cost_the_next_turn() {
    let (mut desk, begin) = read_every_10_ms();
    desk.now = begin + MS(4);
    desk.master.read(NodeId::N1, desk.now).unwrap();
    assert_eq!(next_read(&mut desk, begin + MS(4)), begin + MS(4));
    let called_at = desk.now;
    assert_eq!(next_read(&mut desk, called_at), begin + MS(10));
}

#[test]
fn an_unanswered_read_is_retried_right_after_the_guard_whatever_the_polling() {
    for polling in [Polling::Manual, Polling::Every(MS(100)), Polling::Fastest] {
        let config = with(direct(), |config| config.polling = polling);
        let mut desk = Desk::with_nodes(config, &[N1]);
        desk.master.read(NodeId::N1, desk.now).unwrap();
        for _ in 0..config.attempts {
            assert_eq!(desk.turn(), read(NodeId::N1), "{polling:?}");
            desk.silence();
            let guarded_until = desk.now + config.late_guard;
            assert_eq!(desk.master.poll_timeout(), Some(guarded_until), "{polling:?}");
        }
        let failed = |event: &MasterEvent| matches!(event, MasterEvent::ReadFailed { .. });
        assert_eq!(desk.told().iter().filter(|event| failed(event)).count(), 1, "{polling:?}");
    }
}

#[test]
fn manual_polling_reads_when_asked_and_writes_when_told() {
    let mut desk = Desk::tuned(|config| config.polling = Polling::Manual, &[N1]);
    assert_eq!(desk.master.poll_timeout(), None);
    desk.master.set_velocity(NodeId::N1, rps(1.0), desk.now).unwrap();
    assert_eq!(desk.packet(), write(NodeId::N1, 1.0));
    assert_eq!(desk.master.poll_timeout(), None, "nothing more to do");
    desk.master.read(NodeId::N1, desk.now).unwrap();
    let unknown = CommandError::NotOnline { node: NodeId::N2 };
    assert_eq!(desk.master.read(NodeId::N2, desk.now), Err(unknown));
    desk.now += US(1000);
    assert_eq!(desk.turn(), read(NodeId::N1));
}

#[test]
fn a_turnaround_gap_is_kept_after_requests_and_answers() {
    let mut desk = Desk::tuned(|config| config.turnaround_gap = US(100), &[N1]);
    desk.turn_with(290, &velocity(NodeId::N1, 0.0));
    desk.master.set_velocity(NodeId::N1, rps(1.0), desk.now).unwrap();
    let heard = desk.now;
    assert_eq!(desk.packet(), write(NodeId::N1, 1.0));
    assert_eq!(desk.now, heard + US(100));
    let sent = desk.now;
    assert_eq!(desk.turn(), read(NodeId::N1));
    assert_eq!(desk.now, sent + US(160 + 100));
}

#[test]
fn a_turnaround_gap_begins_when_a_slow_port_has_taken_the_write() {
    let mut desk = Desk::tuned(|config| config.turnaround_gap = US(100), &[N1]);
    desk.turn_with(290, &velocity(NodeId::N1, 0.0));
    desk.master.set_velocity(NodeId::N1, rps(1.0), desk.now).unwrap();
    assert_eq!(desk.packet(), write(NodeId::N1, 1.0));
    desk.now += US(5000);
    desk.master.handle_transmit(Transmit::Taken, desk.now);
    let taken = desk.now;
    assert_eq!(desk.turn(), read(NodeId::N1));
    assert_eq!(desk.now, taken + US(160 + 100));
}

#[test]
fn a_turnaround_gap_is_kept_behind_a_request_that_leaves_late() {
    let mut desk = Desk::tuned(|config| config.turnaround_gap = MS(5), &[N1]);
    desk.turn();
    desk.master.handle_transmit(Transmit::Taken, desk.now);
    desk.now += MS(4);
    desk.master.handle_transmit(Transmit::Flushed, desk.now);
    let left = desk.now;
    desk.packet();
    assert!(desk.now - left >= MS(5), "{:?}", desk.now - left);
}

#[test]
fn a_queue_that_fills_keeps_the_oldest_events_and_counts_the_rest() {
    let mut desk = Desk::with_nodes(direct(), &[N1]);
    for turn in 0..20 {
        desk.turn_with(290, &velocity(NodeId::N1, turn as f32));
    }
    assert_eq!(desk.master.lost_events(), 12);
    let events = desk.told();
    assert_eq!(events.len(), 8, "readings leave half of the queue for rarer events");
    assert_eq!(events[0], reading(NodeId::N1, Status::Velocity(0.0)));
    assert_eq!(
        desk.master.status(NodeId::N1).unwrap().0,
        Status::Velocity(19.0),
        "the latest is known"
    );
}

#[test]
fn time_that_wraps_changes_nothing() {
    let begins =
        [u64::MAX - 3_000, u64::MAX - 740, u64::MAX / 2 - 3_000, 0].map(Instant::from_micros);
    let stories = begins.map(|begin| {
        let mut desk = Desk::at(direct(), begin);
        desk.master.discover(desk.now);
        let mut story = vec![];
        for _ in 0..40 {
            let request = desk.turn();
            story.push(((desk.now - begin).as_micros(), request.clone()));
            match request[1] {
                1 => desk.hear(290, &velocity(NodeId::N1, 0.0)),
                _ => desk.silence(),
            }
        }
        story
    });
    assert!(stories.iter().all(|story| *story == stories[0]));
}

#[test]
fn the_roles_fit_into_small_memories() {
    let sizes = [size_of::<Master>(), size_of::<Slave>(), size_of::<Master<ThreeMotors>>()];
    println!(
        "Master {} bytes, Slave {} bytes, three motors: Master {}",
        sizes[0], sizes[1], sizes[2]
    );
    assert!(sizes[0] <= 2560 && sizes[1] <= 384 && sizes[2] <= 3072, "{sizes:?}");
    if cfg!(target_arch = "x86_64") {
        let document = include_str!("../../BENCHMARKS.md");
        for size in [
            format!("`Master` {} bytes", sizes[0]),
            format!("`Slave` {} bytes", sizes[1]),
            format!("three-motor boards {} bytes", sizes[2]),
        ] {
            assert!(document.contains(&size), "BENCHMARKS.md does not say {size}");
        }
    }
}

#[test]
fn the_defaults_of_a_master_are_those_of_the_rulings() {
    let config = MasterConfig::default();
    assert_eq!(config, MasterConfig::direct());
    assert_eq!((config.baud, config.nodes), (500_000, NodeSet::ALL));
    assert_eq!((config.reply_timeout, config.late_guard), (US(500), US(500)));
    assert_eq!((config.turnaround_gap, config.attempts), (US(0), 3));
    assert_eq!((config.polling, config.recovery_share_pct), (Polling::Fastest, 5));
    assert!(!config.accepts_early);
    assert_eq!((config.hold_age, config.dead_man), (US(0), None));
    assert!(config.stops_abnormal);
    let adapter = MasterConfig::usb_adapter();
    assert_eq!((adapter.reply_timeout, adapter.late_guard), (MS(20), MS(20)));
    let mut other = adapter;
    (other.reply_timeout, other.late_guard) = (config.reply_timeout, config.late_guard);
    assert_eq!(other, config, "and nothing else differs");
}

#[test]
fn rare_events_have_room_however_many_readings_are_waiting() {
    let mut desk = Desk::with_nodes(direct(), &[N1]);
    for _ in 0..100 {
        desk.turn_with(290, &velocity(NodeId::N1, 1.0));
    }
    let lost = desk.master.lost_events();
    desk.master.stop(NodeId::N1, desk.now);
    for _ in 0..2 {
        desk.turn_with(450, &velocity(NodeId::N1, 1.0));
    }
    assert_eq!(desk.news(), [MasterEvent::Stopped { node: NodeId::N1 }]);
    assert_eq!(desk.master.lost_events(), lost + 2, "two readings");
}

#[test]
fn an_answer_earlier_than_the_line_allows_is_accepted_if_configured() {
    for accepts_early in [false, true] {
        let mut desk = Desk::tuned(|config| config.accepts_early = accepts_early, &[N1]);
        desk.turn_with(1, &velocity(NodeId::N1, 9.0));
        assert_eq!(!desk.told().is_empty(), accepts_early);
        let early = desk.master.node_statistics(NodeId::N1).early;
        assert_eq!(early, u32::from(!accepts_early));
    }
    // The line needs 80 us for the READ and 160 us for the answer; half of the answer is tolerated.
    for (after, is_taken) in [(80 + 79, false), (80 + 80, true)] {
        let mut desk = Desk::asking(direct());
        desk.hear(after, &velocity(NodeId::N1, 9.0));
        assert_eq!(!desk.told().is_empty(), is_taken, "{after} us");
        // The window stays open for the genuine one.
        desk.hear(100, &velocity(NodeId::N1, 1.0));
        let status = Status::Velocity(if is_taken { 9.0 } else { 1.0 });
        assert_eq!(desk.master.status(NodeId::N1).unwrap().0, status);
    }
}

#[test]
fn a_discovery_asks_only_the_nodes_in_the_settings() {
    let nodes = [NodeId::N2, NodeId::N7];
    let mut desk = Desk::new(only(&nodes));
    desk.master.discover(desk.now);
    let mut asked = vec![];
    while desk.master.is_discovering() {
        asked.push(desk.exchange().unwrap()[1]);
    }
    assert_eq!(asked, [2, 7, 2, 7, 2, 7]);
}
