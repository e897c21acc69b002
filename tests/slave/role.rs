//! The slave answers requests for its own id in time and in its mode, and its watchdog ends
//! commands (I2, I3, I9, I14).

use axlewire::ikeya::WriteRequest;

use crate::rig::*;

fn slave(mode: Mode) -> Slave {
    Slave::new(NodeId::N2, mode, SlaveConfig::direct(), Instant::from_micros(0))
}

fn answers(slave: &mut Slave, bytes: &[u8], now: Instant) -> Vec<Vec<u8>> {
    slave.handle_input(bytes, now);
    core::iter::from_fn(|| slave.poll_transmit(now).map(<[u8]>::to_vec)).collect()
}

const T0: Instant = Instant::from_micros(5_000);

#[test]
fn a_slave_answers_a_read_for_its_own_id_and_nothing_else() {
    let mut slave = slave(Mode::Velocity);
    slave.set_velocity(rps(1.5));
    for node in NodeId::ALL {
        let expected = if node == NodeId::N2 { vec![velocity(node, 1.5)] } else { vec![] };
        assert_eq!(answers(&mut slave, &read(node), T0), expected);
        assert_eq!(answers(&mut slave, &write(node, 1.0), T0), Vec::<Vec<u8>>::new());
    }
    assert_eq!((slave.statistics().reads, slave.statistics().writes), (1, 1));
    assert_eq!((slave.statistics().foreign, slave.statistics().replies), (14, 1));
}

#[test]
fn a_slave_follows_foreign_traffic_and_does_not_look_inside_it() {
    let mut slave = slave(Mode::Velocity);
    // A WRITE for node 1 whose payload is a whole READ for node 2.
    let read = ReadRequest::new(NodeId::N2);
    let payload = f32::from_le_bytes(*read.as_bytes());
    let foreign = WriteRequest::velocity(NodeId::N1, rps(payload));
    assert_eq!(answers(&mut slave, foreign.as_bytes(), T0), Vec::<Vec<u8>>::new());
    assert_eq!(slave.statistics().foreign, 1);
}

#[test]
fn a_slave_reads_a_write_in_its_own_mode() {
    let bytes = write(NodeId::N2, 1.0);
    let mut turning = slave(Mode::Velocity);
    turning.handle_input(&bytes, T0);
    assert_eq!(turning.poll_event(), Some(SlaveEvent::Command(Target::Velocity(rps(1.0)))));
    let mut moving = slave(Mode::Position);
    moving.handle_input(&bytes, T0);
    let target = Target::Position(Position::new(0, 16_256));
    assert_eq!(moving.poll_event(), Some(SlaveEvent::Command(target)));
    assert_eq!(moving.command(T0), Some(target));
}

#[test]
fn on_any_error_the_previous_command_stays() {
    let mut slave = slave(Mode::Velocity);
    slave.handle_input(&write(NodeId::N2, 1.0), T0);
    slave.poll_event();
    let good = write(NodeId::N2, 2.0);
    for bit in 0..64 {
        let mut bad = good.clone();
        bad[bit / 8] ^= 1 << (bit % 8);
        slave.handle_input(&bad, T0);
        // A quiet line ends the partial packet.
        while let Some(at) = slave.poll_timeout() {
            slave.handle_timeout(at);
        }
    }
    let nan = WriteRequest::position(NodeId::N2, Position::new(0, 0x7FC0));
    slave.handle_input(nan.as_bytes(), T0);
    assert_eq!(slave.command(T0), Some(Target::Velocity(rps(1.0))));
    assert_eq!((slave.poll_event(), slave.statistics().refused), (None, 1));
}

#[test]
fn a_request_overtaken_by_another_packet_is_not_answered() {
    let mut slave = slave(Mode::Velocity);
    let both = [read(NodeId::N2), read(NodeId::N5)].concat();
    assert_eq!(answers(&mut slave, &both, T0), Vec::<Vec<u8>>::new());
    let twice = [read(NodeId::N2), read(NodeId::N2)].concat();
    assert_eq!(answers(&mut slave, &twice, T0).len(), 1, "one answer, to the last");
    assert_eq!(slave.statistics().overtaken, 2);
}

#[test]
fn a_read_behind_a_false_header_is_answered_when_the_line_is_quiet() {
    // On two wires an answer can be cut off as well.
    for (two_wire, header) in [(false, 0xBB), (true, 0xBB), (true, 0x55)] {
        let config = with(SlaveConfig::direct(), |config| config.two_wire = two_wire);
        let mut slave = Slave::new(NodeId::N2, Mode::Velocity, config, T0);
        let line = [&[header][..], &read(NodeId::N2)].concat();
        assert_eq!(answers(&mut slave, &line, T0), Vec::<Vec<u8>>::new());
        let quiet = slave.poll_timeout().unwrap();
        assert_eq!(quiet, T0 + US(100));
        slave.handle_timeout(quiet);
        assert_eq!(slave.poll_transmit(quiet), Some(&velocity(NodeId::N2, 0.0)[..]));
        assert_eq!(slave.poll_timeout(), None);
    }
}

#[test]
fn the_watchdog_ends_a_command_and_reports_it_once() {
    let mut config = SlaveConfig::direct();
    config.watchdog = Some(Duration::from_millis(100));
    let mut slave = Slave::new(NodeId::N2, Mode::Velocity, config, Instant::from_micros(0));
    assert_eq!(slave.poll_timeout(), None, "nothing is moving yet");
    slave.handle_input(&write(NodeId::N2, 1.0), T0);
    slave.poll_event();
    let end = T0 + Duration::from_millis(100);
    assert_eq!(slave.poll_timeout(), Some(end));
    let last = Instant::from_micros(end.as_micros() - 1);
    slave.handle_timeout(last);
    assert_eq!(slave.poll_event(), None);
    // Correct at any time, whether or not the timeout has been handled.
    assert_eq!(slave.command(last), Some(Target::Velocity(rps(1.0))));
    assert_eq!(slave.command(end), None);
    slave.handle_timeout(end);
    assert_eq!((slave.poll_event(), slave.command(end)), (Some(SlaveEvent::Watchdog), None));
    slave.handle_timeout(end + Duration::from_millis(100));
    assert_eq!((slave.poll_event(), slave.poll_timeout()), (None, None));
}

#[test]
fn a_slave_takes_id_and_mode_from_its_switch_as_configured() {
    let dip: DipSwitch = "0101".parse().unwrap();
    let node = dip.node_id(IdReading::ValuePlusOne).unwrap();
    let slave = Slave::new(node, dip.mode(), SlaveConfig::direct(), Instant::from_micros(0));
    assert_eq!((slave.node(), slave.mode()), (NodeId::N3, Mode::Position));
    let dip: DipSwitch = "0000".parse().unwrap();
    assert!(dip.node_id(IdReading::Value).is_err());
}

#[test]
fn a_slave_whose_speed_alone_was_changed_waits_for_packets_of_that_speed() {
    for (baud, idle_us) in [(9600, 5209), (500_000, 100), (1_000_000, 100), (0, 100)] {
        let config = with(SlaveConfig::direct(), |config| config.baud = baud);
        let slave = Slave::new(NodeId::N1, Mode::Velocity, config, T0);
        assert_eq!(slave.config().idle, US(idle_us), "{baud}");
        assert!(slave.config().baud > 0);
    }
}

#[test]
fn a_turnaround_gap_holds_the_answer_back() {
    let config = with(SlaveConfig::direct(), |config| config.turnaround_gap = US(30));
    let mut slave = Slave::new(NodeId::N2, Mode::Velocity, config, Instant::from_micros(0));
    assert_eq!(answers(&mut slave, &read(NodeId::N2), T0), Vec::<Vec<u8>>::new());
    assert_eq!(slave.poll_timeout(), Some(T0 + US(30)));
    assert!(slave.poll_transmit(T0 + US(30)).is_some());
}

#[test]
fn a_read_found_only_with_the_next_bytes_is_not_answered() {
    let mut slave = slave(Mode::Velocity);
    // A false header before a READ, and no call when the line is quiet.
    let line = [&[0xBB][..], &read(NodeId::N2)].concat();
    assert_eq!(answers(&mut slave, &line, T0), Vec::<Vec<u8>>::new());
    let late = T0 + Duration::from_millis(90);
    assert_eq!(answers(&mut slave, &read(NodeId::N5), late), Vec::<Vec<u8>>::new());
    assert_eq!((slave.statistics().reads, slave.statistics().overtaken), (1, 1));
}

// Answers that are no longer due (I14)

#[test]
fn a_slave_drops_its_answer_when_a_single_byte_follows_its_request() {
    for (first, rest) in [(0, 1), (1, 0)] {
        let mut slave = slave(Mode::Velocity);
        let next = read(NodeId::N3);
        let request = [&read(NodeId::N2)[..], &next[..first]].concat();
        slave.handle_input(&request, T0);
        slave.handle_input(&next[..rest], T0 + US(10));
        assert_eq!(slave.poll_transmit(T0 + US(10)), None);
        assert_eq!((slave.statistics().overtaken, slave.statistics().replies), (1, 0));
    }
}

#[test]
fn a_slave_drops_its_answer_after_answer_within_and_not_earlier() {
    for (config, within) in [(SlaveConfig::direct(), US(500)), (SlaveConfig::usb_adapter(), MS(20))]
    {
        assert_eq!(config.answer_within, within);
        for gap in [0, 30] {
            let mut config = config;
            config.turnaround_gap = US(gap);
            let asked = || {
                let mut slave: Slave =
                    Slave::new(NodeId::N2, Mode::Velocity, config, Instant::from_micros(0));
                slave.handle_input(&read(NodeId::N2), T0);
                slave
            };
            let last = T0 + US(gap) + within;
            assert!(asked().poll_transmit(last).is_some());
            let mut late = asked();
            assert_eq!(late.poll_transmit(last + US(1)), None);
            assert_eq!((late.statistics().expired, late.statistics().replies), (1, 0));
            assert_eq!(late.poll_timeout(), None, "no deadline remains");
        }
    }
}

/// An answer of node 1 whose payload is a READ for node 2.
fn trap() -> Vec<u8> {
    let payload = f32::from_le_bytes(*ReadRequest::new(NodeId::N2).as_bytes());
    velocity(NodeId::N1, payload)
}

#[test]
fn on_two_wires_a_slave_finds_no_request_inside_another_nodes_answer() {
    let config = with(SlaveConfig::direct(), |config| config.two_wire = true);
    let mut slave = Slave::new(NodeId::N2, Mode::Velocity, config, Instant::from_micros(0));
    assert_eq!(answers(&mut slave, &trap(), T0), [[0; 0]; 0]);
    assert_eq!((slave.statistics().answers, slave.statistics().reads), (1, 0));
    // It still obeys and answers its own requests.
    let line = [trap(), write(NodeId::N2, 1.0), read(NodeId::N2)].concat();
    assert_eq!(answers(&mut slave, &line, T0).len(), 1);
    assert_eq!(slave.command(T0), Some(Target::Velocity(rps(1.0))));
    // Byte by byte, too.
    for &byte in &trap() {
        assert_eq!(answers(&mut slave, &[byte], T0), [[0; 0]; 0]);
    }
    assert_eq!((slave.statistics().answers, slave.statistics().reads), (3, 1));
}

#[test]
fn on_four_wires_a_slave_hears_no_answers_and_searches_only_for_requests() {
    let mut slave = slave(Mode::Velocity);
    answers(&mut slave, &trap(), T0);
    assert_eq!((slave.statistics().answers, slave.statistics().reads), (0, 1));
}

#[test]
fn a_nan_speed_does_not_feed_the_watchdog() {
    let config = with(SlaveConfig::direct(), |config| config.watchdog = Some(MS(100)));
    for bad in [Position::new(0, 0x7FC0), Position::new(0, 0x7F80), Position::new(1, -128)] {
        let mut slave: Slave =
            Slave::new(NodeId::N2, Mode::Velocity, config, Instant::from_micros(0));
        slave.handle_input(&write(NodeId::N2, 1.0), T0);
        let end = slave.poll_timeout();
        assert_eq!(end, Some(T0 + MS(100)));
        slave.poll_event();
        slave.handle_input(WriteRequest::position(NodeId::N2, bad).as_bytes(), T0 + MS(99));
        assert_eq!((slave.statistics().refused, slave.poll_timeout()), (1, end));
        slave.handle_timeout(T0 + MS(100));
        assert_eq!(
            (slave.poll_event(), slave.command(T0 + MS(100))),
            (Some(SlaveEvent::Watchdog), None)
        );
    }
}

#[test]
fn a_foreign_or_damaged_write_does_not_feed_the_watchdog() {
    let config = with(SlaveConfig::direct(), |config| config.watchdog = Some(MS(100)));
    let mut slave = Slave::new(NodeId::N2, Mode::Velocity, config, Instant::from_micros(0));
    slave.handle_input(&write(NodeId::N2, 1.0), T0);
    let mut damaged = write(NodeId::N2, 2.0);
    damaged[4] ^= 1;
    for bytes in [write(NodeId::N3, 1.0), read(NodeId::N2), damaged] {
        slave.handle_input(&bytes, T0 + MS(90));
    }
    slave.poll_event();
    slave.handle_timeout(T0 + MS(100));
    assert_eq!(slave.poll_event(), Some(SlaveEvent::Watchdog));
}

#[test]
fn a_held_up_slave_dates_old_bytes_to_their_earliest_arrival() {
    let config = with(SlaveConfig::direct(), |config| config.watchdog = Some(MS(100)));
    let mut slave = Slave::new(NodeId::N2, Mode::Velocity, config, Instant::from_micros(0));
    let now = T0 + MS(70);
    slave.handle_input(&write(NodeId::N2, 1.0), Arrival::Between { since: T0, now });
    assert_eq!(slave.command(now), Some(Target::Velocity(rps(1.0))), "it is accepted");
    assert_eq!(slave.poll_timeout(), Some(T0 + MS(100)), "70 ms have passed");
    // The master no longer waits for an answer to an old READ.
    slave.handle_input(&read(NodeId::N2), Arrival::Between { since: T0, now });
    assert_eq!(slave.poll_transmit(now), None);
    assert_eq!((slave.statistics().reads, slave.statistics().expired), (1, 1));
}

#[test]
fn an_old_command_for_which_the_watchdog_is_over_is_no_command_but_a_watchdog() {
    let config = with(SlaveConfig::direct(), |config| config.watchdog = Some(MS(100)));
    for (age_ms, event) in
        [(99, SlaveEvent::Command(Target::Velocity(rps(5.0)))), (100, SlaveEvent::Watchdog)]
    {
        let mut slave = Slave::new(NodeId::N2, Mode::Velocity, config, T0);
        slave.handle_input(
            &write(NodeId::N2, 5.0),
            Arrival::Between { since: T0, now: T0 + MS(age_ms) },
        );
        assert_eq!(slave.poll_event(), Some(event), "{age_ms} ms");
        assert_eq!(slave.poll_event(), None);
    }
}

#[test]
fn an_old_request_that_a_false_header_held_back_is_not_answered() {
    let now = T0 + MS(70);
    let held = [&[0xBB, 0x02], &read(NodeId::N2)[..]].concat();
    for (since, replies) in [(now, 1), (T0, 0)] {
        let mut slave = slave(Mode::Velocity);
        slave.handle_input(&held, Arrival::Between { since, now });
        assert_eq!(slave.poll_timeout(), Some(now + US(100)), "the rest may still come");
        slave.handle_timeout(now + US(100));
        slave.poll_transmit(now + US(100));
        assert_eq!(slave.statistics().reads, 1, "it is found");
        assert_eq!(slave.statistics().replies, replies);
    }
}

#[test]
fn a_slave_drops_an_answer_that_pauses_for_five_byte_times() {
    assert_eq!(slave(Mode::Velocity).line_rules().frame_pause, US(100));
    assert_eq!(slave(Mode::Velocity).line_rules().wire_time(8), US(160));
    let config = with(SlaveConfig::direct(), |config| config.idle = MS(3));
    let patient = Slave::new(NodeId::N2, Mode::Velocity, config, Instant::from_micros(0));
    assert_eq!(patient.line_rules().frame_pause, MS(3), "as long as its own wait");
}

#[test]
fn a_slave_has_no_deadline_when_nothing_is_pending() {
    let mut slave = slave(Mode::Velocity);
    assert_eq!(slave.poll_timeout(), None);
    slave.handle_input(&[0x55, 0x00, 0x01], T0);
    assert_eq!(slave.poll_timeout(), None, "none of them starts a packet");
    slave.handle_input(&[0xBB], T0);
    let idle = T0 + US(100);
    assert_eq!(slave.poll_timeout(), Some(idle), "it may be a WRITE");
    slave.handle_timeout(idle);
    assert_eq!(slave.poll_timeout(), None, "it was not");
}

#[test]
fn an_answer_of_which_no_byte_has_left_is_sent_within_its_time() {
    let answer = velocity(NodeId::N2, 0.0);
    for (unsent, is_due) in
        [(Unsent::Untouched, true), (Unsent::CutOff, false), (Unsent::Unflushed, false)]
    {
        let mut slave = slave(Mode::Velocity);
        assert_eq!(answers(&mut slave, &read(NodeId::N2), T0), std::slice::from_ref(&answer));
        slave.handle_transmit(unsent, T0 + US(10));
        let again = slave.poll_transmit(T0 + US(500)).map(<[u8]>::to_vec);
        assert_eq!(again, is_due.then(|| answer.clone()), "{unsent:?}");
        assert_eq!(slave.statistics().replies, 1);
    }
    // Not later, and not when the master has moved on.
    let mut late = slave(Mode::Velocity);
    answers(&mut late, &read(NodeId::N2), T0);
    late.handle_transmit(Unsent::Untouched, T0 + US(10));
    assert_eq!(late.poll_transmit(T0 + US(501)), None);
    assert_eq!(late.statistics().replies, 0);
    let mut overtaken = slave(Mode::Velocity);
    answers(&mut overtaken, &read(NodeId::N2), T0);
    overtaken.handle_input(&[0xAA], T0 + US(5));
    overtaken.handle_transmit(Unsent::Untouched, T0 + US(10));
    assert_eq!(overtaken.poll_transmit(T0 + US(10)), None);
}

#[test]
fn the_defaults_of_a_slave_are_those_of_the_rulings() {
    let config = SlaveConfig::default();
    assert_eq!(config, SlaveConfig::direct());
    assert_eq!(config.watchdog, None, "the protocol has none");
    assert_eq!((config.turnaround_gap, config.idle), (US(0), US(100)));
    assert_eq!((config.answer_within, config.two_wire), (US(500), false));
    assert_eq!(SlaveConfig::at(57_600).idle, US(869));
    let adapter = SlaveConfig::usb_adapter();
    assert_eq!((adapter.idle, adapter.answer_within), (MS(20), MS(20)));
    assert_eq!((adapter.watchdog, adapter.turnaround_gap), (None, US(0)));
    assert!(!adapter.two_wire);
}
