//! A slave whose switch is moved, and how old its driver takes received bytes to be.

use crate::rig::*;

const T0: Instant = Instant::from_micros(1_000_000);
const NODE: NodeId = NodeId::N1;

fn watched() -> Slave {
    let config = with(SlaveConfig::direct(), |config| config.watchdog = Some(MS(100)));
    let mut slave = Slave::new(NODE, Mode::Velocity, config, T0);
    slave.handle_input(&write(NODE, 2.0), T0);
    slave
}

#[test]
fn a_switch_that_is_moved_drops_the_command_with_its_event_and_its_watchdog() {
    let mut slave = watched();
    slave.set_mode(Mode::Position);
    assert_eq!((slave.mode(), slave.command(T0)), (Mode::Position, None));
    assert_eq!(slave.poll_event(), None, "2 rps would be a position");
    assert_eq!(slave.poll_timeout(), None);
    slave.handle_timeout(T0 + MS(100));
    assert_eq!((slave.poll_event(), slave.statistics().watchdog), (None, 0));
    // It answers in its new mode, and obeys in it.
    slave.set_position(turns(5));
    slave.handle_input(ReadRequest::new(NODE).as_bytes(), T0 + MS(200));
    assert_eq!(slave.poll_transmit(T0 + MS(200)), Some(&position(NODE, turns(5))[..]));
    slave.handle_input(&hold(NODE, Position::new(3, 4)), T0 + MS(300));
    let target = Target::Position(Position::new(3, 4));
    assert_eq!(slave.poll_event(), Some(SlaveEvent::Command(target)));
}

#[test]
fn a_switch_that_is_moved_the_other_way_does_the_same() {
    let config = with(SlaveConfig::direct(), |config| config.watchdog = Some(MS(100)));
    let mut slave = Slave::new(NODE, Mode::Position, config, T0);
    slave.set_position(turns(5));
    slave.handle_input(&hold(NODE, Position::new(3, 4)), T0);
    slave.set_mode(Mode::Velocity);
    assert_eq!((slave.mode(), slave.command(T0)), (Mode::Velocity, None));
    assert_eq!((slave.poll_event(), slave.poll_timeout()), (None, None));
    slave.handle_input(&read(NODE), T0 + MS(1));
    assert_eq!(slave.poll_transmit(T0 + MS(1)), None, "its speed is not known");
    slave.handle_input(&write(NODE, 1.5), T0 + MS(2));
    let target = Target::Velocity(rps(1.5));
    assert_eq!(slave.poll_event(), Some(SlaveEvent::Command(target)));
}

#[test]
fn a_speed_from_before_the_switch_was_moved_is_not_reported() {
    let mut slave = Slave::new(NODE, Mode::Velocity, SlaveConfig::direct(), T0);
    slave.set_mode(Mode::Position);
    slave.set_mode(Mode::Velocity);
    slave.handle_input(&read(NODE), T0);
    assert_eq!(slave.poll_transmit(T0), None, "a motor in motion would look still");
    slave.set_velocity(rps(2.0));
    slave.handle_input(&read(NODE), T0 + MS(1));
    assert_eq!(slave.poll_transmit(T0 + MS(1)), Some(&velocity(NODE, 2.0)[..]));
}

#[test]
fn a_position_from_before_the_switch_was_moved_is_not_reported() {
    let mut slave = Slave::new(NODE, Mode::Position, SlaveConfig::direct(), T0);
    slave.set_position(turns(5));
    slave.set_mode(Mode::Velocity);
    slave.set_mode(Mode::Position);
    slave.handle_input(&read(NODE), T0);
    assert_eq!(slave.poll_transmit(T0), None, "it has turned since");
    slave.set_position(turns(7));
    slave.handle_input(&read(NODE), T0 + MS(1));
    assert_eq!(slave.poll_transmit(T0 + MS(1)), Some(&position(NODE, turns(7))[..]));
}

#[test]
fn anything_behind_a_read_in_the_same_chunk_means_that_the_master_has_moved_on() {
    let packets = [read(NODE), read(NodeId::N2), write(NodeId::N2, 1.0), write(NODE, 1.0)];
    for packet in packets {
        for len in 1..=packet.len() {
            let mut slave = Slave::new(NODE, Mode::Velocity, SlaveConfig::direct(), T0);
            slave.handle_input(&[&read(NODE), &packet[..len]].concat(), T0);
            let is_own_read = packet == read(NODE) && len == packet.len();
            assert_eq!(slave.poll_transmit(T0).is_some(), is_own_read, "{:02x?}", &packet[..len]);
            assert_eq!(slave.statistics().overtaken, 1);
        }
    }
}

#[test]
fn a_switch_that_stays_where_it_is_drops_nothing() {
    let mut slave = watched();
    slave.set_mode(Mode::Velocity);
    let target = Target::Velocity(rps(2.0));
    assert_eq!(slave.command(T0), Some(target));
    assert_eq!(slave.poll_event(), Some(SlaveEvent::Command(target)));
    assert_eq!(slave.poll_timeout(), Some(T0 + MS(100)));
}

#[test]
fn the_report_of_a_watchdog_survives_a_moved_switch() {
    let mut slave = watched();
    slave.handle_timeout(T0 + MS(100));
    slave.set_mode(Mode::Position);
    assert_eq!(slave.poll_event(), Some(SlaveEvent::Watchdog));
    assert_eq!(slave.lost_events(), 1, "the command was replaced by it");
}

#[test]
fn a_slave_is_held_up_after_the_time_for_an_answer_but_at_least_4_and_at_most_20_ms() {
    for (within, limit) in
        [(US(0), 4000), (US(500), 4000), (US(3999), 4000), (US(4001), 4001), (MS(7), 7000)]
            .into_iter()
            .chain([(US(19_999), 19_999), (MS(20), 20_000), (US(20_001), 20_000)])
    {
        let config = with(SlaveConfig::direct(), |config| config.answer_within = within);
        let slave = Slave::new(NODE, Mode::Velocity, config, T0);
        assert_eq!(slave.line_rules().held_up_after, Some(US(limit)));
        assert_eq!(
            slave.line_rules().frame_pause,
            US(100),
            "as long as it waits for the rest of a packet"
        );
    }
}

#[test]
fn the_time_for_an_answer_begins_after_the_gap_and_its_end_is_in_time() {
    let mut config = SlaveConfig::direct();
    (config.turnaround_gap, config.answer_within) = (US(30), US(200));
    for (after_us, is_sent, expired) in
        [(29, false, 0), (30, true, 0), (229, true, 0), (230, true, 0), (231, false, 1)]
    {
        let mut slave = Slave::new(NODE, Mode::Velocity, config, T0);
        slave.set_velocity(rps(1.0));
        slave.handle_input(&read(NODE), T0);
        assert_eq!(slave.poll_timeout(), Some(T0 + US(30)));
        assert_eq!(slave.poll_transmit(T0 + US(after_us)).is_some(), is_sent, "{after_us} us");
        let statistics = slave.statistics();
        assert_eq!((statistics.reads, statistics.expired), (1, expired), "{after_us} us");
        assert_eq!(statistics.replies, u32::from(is_sent));
    }
}

#[test]
fn the_gap_is_kept_behind_a_request_of_unknown_age_too() {
    let mut config = SlaveConfig::direct();
    (config.turnaround_gap, config.answer_within) = (US(30), US(200));
    let mut slave = Slave::new(NODE, Mode::Velocity, config, T0);
    let now = T0 + US(100);
    slave.handle_input(&read(NODE), Arrival::Between { since: T0, now });
    assert!(slave.poll_transmit(now + US(29)).is_none(), "it may have ended now");
    assert!(slave.poll_transmit(now + US(30)).is_some(), "it may have ended at once");
    // Then its time is over before the gap.
    let now = T0 + US(1201);
    slave.handle_input(&read(NODE), Arrival::Between { since: T0 + US(1000), now });
    assert!(slave.poll_transmit(now + US(30)).is_none());
    assert_eq!((slave.statistics().replies, slave.statistics().expired), (1, 1));
}

#[test]
fn the_gap_is_kept_behind_a_request_that_only_a_pause_has_found() {
    let mut config = SlaveConfig::direct();
    (config.turnaround_gap, config.answer_within) = (US(1000), US(6000));
    let mut slave = Slave::new(NODE, Mode::Velocity, config, T0);
    let now = T0 + US(6100);
    let cut_off = [&[0xBB, 3][..], &read(NODE)].concat();
    slave.handle_input(&cut_off, Arrival::Between { since: T0, now });
    slave.handle_timeout(now + US(100));
    assert_eq!(slave.statistics().reads, 1);
    assert!(slave.poll_transmit(now + US(1000)).is_none(), "it may have ended now");
}

#[test]
fn an_answer_that_its_port_does_not_take_is_outdated_the_time_of_a_packet_after_its_own() {
    /// Time of the longest packet of any board.
    const LONGEST: u32 = wire_time(three::MAX_LEN, BAUD).as_micros();
    let mut slave = Slave::new(NODE, Mode::Velocity, SlaveConfig::direct(), T0);
    let ask = |slave: &mut Slave, at| {
        slave.handle_input(&read(NODE), at);
        assert!(slave.poll_transmit(at).is_some());
    };
    ask(&mut slave, T0);
    slave.handle_input(&[], T0 + US(500 + LONGEST));
    assert!(!slave.is_outdated());
    slave.handle_input(&[], T0 + US(500 + LONGEST + 1));
    assert!(slave.is_outdated());
    slave.handle_transmit(Unsent::Untouched, T0 + US(901));
    assert!(slave.poll_transmit(T0 + US(901)).is_none());
    assert_eq!((slave.statistics().replies, slave.statistics().expired), (0, 1));
    // Once it has been taken, nothing is outdated.
    ask(&mut slave, T0 + MS(1));
    slave.handle_transmit(Transmit::Taken, T0 + MS(1));
    slave.handle_input(&[], T0 + MS(9));
    assert!(!slave.is_outdated());
}

#[test]
fn an_answer_that_did_not_leave_before_more_was_heard_counts_as_overtaken() {
    let mut slave = Slave::new(NODE, Mode::Velocity, SlaveConfig::direct(), T0);
    slave.handle_input(&read(NODE), T0);
    assert!(slave.poll_transmit(T0).is_some());
    slave.handle_input(&[0], T0);
    assert!(slave.is_outdated());
    slave.handle_transmit(Unsent::Untouched, T0);
    assert_eq!((slave.statistics().replies, slave.statistics().overtaken), (0, 1));
    assert!(slave.poll_transmit(T0).is_none());
}

#[test]
fn a_command_ends_with_its_watchdog_to_the_microsecond_even_if_nobody_calls() {
    let mut slave = watched();
    let (just_before, end) = (T0 + US(99_999), T0 + MS(100));
    assert_eq!(slave.command(just_before), Some(Target::Velocity(rps(2.0))));
    assert_eq!(slave.command(end), None);
    slave.handle_timeout(just_before);
    assert_eq!(slave.poll_event(), Some(SlaveEvent::Command(Target::Velocity(rps(2.0)))));
    slave.handle_timeout(end);
    assert_eq!(slave.poll_event(), Some(SlaveEvent::Watchdog));
    assert_eq!((slave.command(T0), slave.poll_timeout()), (None, None));
    assert_eq!(slave.statistics().watchdog, 1);
}

#[test]
fn each_candidate_behind_one_that_a_pause_ends_waits_for_as_long_again() {
    let read = read(NODE);
    // The start of a WRITE, or of nothing but a byte that looks like one, and a READ behind it.
    let start = [&[0xBB][..], &read[..2]].concat();
    for (rest_at, reads) in [(US(150), 1), (US(199), 1), (US(200), 0)] {
        let mut slave = Slave::new(NODE, Mode::Velocity, SlaveConfig::direct(), T0);
        slave.handle_input(&start, T0);
        assert_eq!(slave.poll_timeout(), Some(T0 + US(100)));
        slave.handle_timeout(T0 + US(100));
        assert_eq!((slave.counters().idle, slave.poll_timeout()), (1, Some(T0 + US(200))));
        slave.handle_timeout(T0 + rest_at);
        slave.handle_input(&read[2..], T0 + rest_at);
        assert_eq!(slave.statistics().reads, reads, "{rest_at:?}");
    }
}

#[test]
fn an_answer_that_is_being_sent_is_outdated_once_another_byte_is_heard() {
    let mut slave = Slave::new(NODE, Mode::Velocity, SlaveConfig::direct(), T0);
    slave.handle_input(&read(NODE), T0);
    assert!(slave.poll_transmit(T0).is_some());
    assert!(!slave.is_outdated());
    slave.handle_input(&[], T0);
    slave.handle_timeout(T0 + US(50));
    assert!(!slave.is_outdated());
    slave.handle_input(&[0], T0 + US(60));
    assert!(slave.is_outdated());
}

#[test]
fn a_read_that_a_false_header_held_back_is_not_answered_if_more_is_held_behind_it() {
    // Eight bytes that begin as a WRITE: its CRC is wrong, and a READ is found inside it.
    for behind in [[0xAA, 2, 0], [0xBB, 2, 0], [0, 0, 0xAA], [0, 0xBB, 1]] {
        let mut slave = Slave::new(NODE, Mode::Velocity, SlaveConfig::direct(), T0);
        slave.handle_input(&[&[0xBB][..], &read(NODE), &behind].concat(), T0);
        assert_eq!(slave.poll_transmit(T0), None, "{behind:02x?}");
        assert_eq!((slave.statistics().reads, slave.statistics().overtaken), (1, 1));
    }
}

#[test]
fn each_repetition_of_a_command_feeds_the_watchdog() {
    let mut slave = watched();
    for at in [60, 120, 180] {
        slave.handle_timeout(T0 + MS(at));
        slave.handle_input(&write(NODE, 2.0), T0 + MS(at));
        assert_eq!(slave.poll_timeout(), Some(T0 + MS(at + 100)));
        assert_eq!(slave.command(T0 + MS(at + 99)), Some(Target::Velocity(rps(2.0))));
    }
    assert_eq!((slave.command(T0 + MS(280)), slave.statistics().watchdog), (None, 0));
    // After it has fired, the next command starts it again.
    slave.handle_timeout(T0 + MS(280));
    slave.handle_input(&write(NODE, 3.0), T0 + MS(500));
    assert_eq!(slave.command(T0 + MS(599)), Some(Target::Velocity(rps(3.0))));
    slave.handle_timeout(T0 + MS(600));
    assert_eq!(slave.statistics().watchdog, 2);
}
