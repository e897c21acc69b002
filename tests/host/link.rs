//! The link: when it is up or lost, what pings and reports show, and which frames pass through raw
//! (U9, U10, U12).

use axlewire::error::EncodeError;

use crate::rig::*;

#[test]
fn the_link_goes_up_with_the_first_valid_frame() {
    let mut rig = Rig::new(ms(0));
    assert_eq!(rig.host.link(), Link::Waiting);
    rig.run_for(10);
    assert_eq!(rig.host.link(), Link::Up);
    assert_eq!(rig.host_events[0].1, HostEvent::LinkUp);
}

#[test]
fn the_link_is_lost_after_500_ms_without_a_valid_frame_and_not_earlier() {
    let mut host = Host::new(quiet_config(), ms(0));
    host.handle_input(&bytes(Pong::new(ErrorCode::Fine)), ms(100));
    assert_eq!(events(&mut host), [HostEvent::LinkUp]);
    // Noise is not a frame.
    host.handle_input(&[0x55; 40], ms(400));
    host.handle_timeout(us(599_999));
    assert_eq!((host.link(), events(&mut host)), (Link::Up, vec![]));
    assert_eq!(host.poll_timeout(), Some(ms(600)));
    host.handle_timeout(ms(600));
    assert_eq!((host.link(), events(&mut host)), (Link::Down, vec![HostEvent::LinkDown]));
    wait(&mut host, ms(5000));
    assert_eq!(events(&mut host), [], "reported once");
    assert_eq!(host.statistics().links_lost, 1);
    host.handle_input(&bytes(BiasRequest {}), ms(6000));
    assert_eq!(events(&mut host)[0], HostEvent::LinkUp);
    wait(&mut host, ms(7000));
    assert_eq!(host.statistics().links_lost, 2, "each time");
}

#[test]
fn the_last_link_event_is_the_latest_however_many_were_not_taken() {
    let mut host = Host::new(quiet_config(), ms(0));
    for second in 1..100 {
        host.handle_input(&bytes(Pong::new(ErrorCode::Fine)), ms(second * 1000));
        if second > 90 {
            let last = events(&mut host.clone()).into_iter().rfind(is_link_event);
            assert_eq!(last, Some(HostEvent::LinkUp));
        }
        host.handle_timeout(ms(second * 1000 + 500));
    }
    let links: Vec<_> = events(&mut host).into_iter().filter(is_link_event).collect();
    assert_eq!(links.last(), Some(&HostEvent::LinkDown));
    assert!(links.len() < 20, "{}", links.len());
}

fn is_link_event(event: &HostEvent) -> bool {
    matches!(event, HostEvent::LinkUp | HostEvent::LinkDown)
}

#[test]
fn a_robot_that_never_answers_is_reported_after_500_ms() {
    let mut host = Host::new(HostConfig::default(), ms(0));
    sent(&mut host, ms(0));
    wait(&mut host, us(499_999));
    assert_eq!(events(&mut host), []);
    let pings = wait(&mut host, ms(60_000));
    assert_eq!(events(&mut host), [HostEvent::LinkDown]);
    let pings = pings.iter().filter(|(_, frame)| is_ping(frame));
    assert_eq!(pings.count(), 120, "one ping per ping timeout, no flood");
    assert_eq!(host.statistics().pings_lost, 120);
}

#[test]
fn an_echoing_line_is_not_a_robot() {
    let mut host = Host::new(HostConfig::default(), ms(0));
    for now in (0..2000).step_by(10) {
        host.handle_timeout(ms(now));
        assert_eq!(host.drive(go(10), ms(now)).is_ok(), now < 500);
        for frame in sent(&mut host, ms(now)) {
            host.handle_input(&frame, ms(now));
        }
    }
    assert_eq!(host.link(), Link::Down);
    assert_eq!(events(&mut host), [HostEvent::LinkDown]);
    assert_eq!(u64::from(host.statistics().misdirected), host.counters().frames);
}

#[test]
fn a_pong_gives_the_round_trip_time() {
    let mut host = Host::new(HostConfig::default(), ms(0));
    let (fine, damaged) = (ErrorCode::Fine, ErrorCode::Damaged);
    for (turn, micros, err) in [(0, 3000, fine), (1, 1000, damaged), (2, 2000, fine)] {
        let at = ms(turn * 200);
        host.handle_timeout(at);
        assert!(sent(&mut host, at).iter().any(|frame| is_ping(frame)));
        let back = at + Duration::from_micros(micros);
        host.handle_input(&bytes(Pong::new(err)), back);
        let round_trip = Duration::from_micros(micros);
        assert!(events(&mut host).contains(&HostEvent::Pong { round_trip, err }));
    }
    let trip = host.statistics().round_trip;
    let micros = |span: Option<Duration>| span.unwrap().as_micros();
    assert_eq!((trip.count(), micros(trip.min()), micros(trip.max())), (3, 1000, 3000));
    assert_eq!(micros(trip.mean()), 2000);
    assert_eq!(HostStatistics::default().round_trip.mean(), None);
}

#[test]
fn a_late_pong_answers_no_ping() {
    let mut host = Host::new(HostConfig::default(), ms(0));
    sent(&mut host, ms(0));
    host.handle_timeout(ms(500));
    assert_eq!(host.statistics().pings_lost, 1);
    host.handle_input(&bytes(Pong::new(ErrorCode::Fine)), ms(500));
    assert_eq!(host.statistics().pongs_unasked, 1);
    assert_eq!(host.statistics().round_trip.count(), 0);
}

#[test]
fn missing_reports_are_counted_by_their_index() {
    let mut host = Host::new(quiet_config(), ms(0));
    let report = |host: &mut Host, index, at| {
        let body = FirmwareReport::new(&Telemetry::default(), 38);
        host.handle_input(body.frame(index).as_bytes(), ms(at));
        let HostEvent::Report(report) = events(host).pop().unwrap() else { panic!() };
        assert_eq!((report.index, report.version), (index, Some(38)));
        report.lost
    };
    assert_eq!(report(&mut host, 250, 0), 0, "nothing to count from");
    assert_eq!(report(&mut host, 251, 20), 0);
    assert_eq!(report(&mut host, 255, 100), 3);
    assert_eq!(report(&mut host, 0, 120), 0, "it wraps");
    assert_eq!(report(&mut host, 2, 160), 1);
    assert_eq!(report(&mut host, 2, 180), 0, "repeated");
    assert_eq!((host.statistics().reports_lost, host.statistics().reports_repeated), (4, 1));
    assert_eq!(report(&mut host, 0, 200), 253, "a restart in disguise");
    // A restart announced by the robot, or one that takes the link down, costs nothing.
    report(&mut host, 100, 220);
    host.handle_input(&bytes(BiasRequest {}), ms(230));
    events(&mut host);
    assert_eq!(report(&mut host, 0, 240), 0);
    host.handle_timeout(ms(740));
    assert_eq!(report(&mut host, 77, 800), 0);
    assert_eq!(host.statistics().reports, 10);
    assert_eq!(host.last_report().unwrap().index, 77);
}

#[test]
fn a_false_header_holds_a_report_back_no_longer_than_the_idle_margin() {
    let mut host = Host::new(quiet_config(), ms(0));
    // It announces 60 bytes, and the report has 44.
    let mut line = vec![0xFD, 0xFF, 60, 0, 5];
    line.extend(bytes(FirmwareReport::new(&Telemetry::default(), 38)));
    host.handle_input(&line, ms(10));
    assert_eq!(host.counters().frames, 0);
    let quiet = ms(30) + wire_time(2, BAUD);
    assert_eq!(host.poll_timeout(), Some(quiet));
    host.handle_timeout(quiet);
    assert_eq!((host.counters().frames, host.statistics().reports), (1, 1));
    assert_eq!(host.poll_timeout(), Some(ms(510)), "the link counts from its arrival");
}

#[test]
fn unknown_frames_pass_through_raw() {
    let mut host = Host::new(quiet_config(), ms(0));
    let mut buffer = [0; 64];
    let longest = [0xA5; 56];
    for raw in [
        RawFrame { id: 0x20, index: 9, body: &[1, 2, 3] },
        RawFrame { id: 0xFF, index: 0, body: &longest },
    ] {
        host.handle_input(raw.encode(&mut buffer).unwrap(), ms(1));
        let Some(HostEvent::Unknown(frame)) = events(&mut host).pop() else { panic!() };
        assert_eq!(frame.as_raw(), raw);
    }
    assert_eq!(host.statistics().unknown, 2);
}

#[test]
fn the_network_state_is_sent_on_change_and_when_the_robot_may_have_forgotten_it() {
    let mut host = Host::new(quiet_config(), ms(0));
    let state = |host: &mut Host, now| {
        let frames = sent(host, now);
        assert!(frames.len() <= 1);
        frames.first().map(|frame| match message(frame) {
            Message::SetNetworkState(body) => body.state(),
            other => panic!("{other:?}"),
        })
    };
    assert_eq!(state(&mut host, ms(0)), None);
    host.set_network_state(NetworkState::Connected, ms(1)).unwrap();
    assert_eq!(state(&mut host, ms(1)), Some(NetworkState::Connected));
    host.set_network_state(NetworkState::Connected, ms(2)).unwrap();
    assert_eq!(state(&mut host, ms(2)), None, "no change");
    host.set_network_state(NetworkState::Disconnected, ms(3)).unwrap();
    assert_eq!(state(&mut host, ms(3)), Some(NetworkState::Disconnected));
    // The link comes up, goes down and comes up again.
    for at in [10, 1000] {
        host.handle_input(&bytes(Pong::new(ErrorCode::Fine)), ms(at));
        assert_eq!(state(&mut host, ms(at)), Some(NetworkState::Disconnected));
        host.handle_timeout(ms(at + 500));
    }
    // The robot has booted.
    host.handle_input(&bytes(Pong::new(ErrorCode::Fine)), ms(2000));
    state(&mut host, ms(2000));
    host.handle_input(&bytes(BiasRequest {}), ms(2100));
    assert_eq!(state(&mut host, ms(2100)), Some(NetworkState::Disconnected));
    let refused = host.set_network_state(NetworkState::Other(256), ms(2200));
    assert_eq!(refused, Err(CommandError::Value(EncodeError::NetworkState { value: 256 })));
}

#[test]
fn a_round_trip_and_a_report_can_be_taken_once_each() {
    let mut config = quiet_config();
    config.ping_period = Some(Duration::from_millis(200));
    let mut host = Host::new(config, ms(0));
    assert_eq!((host.take_round_trip(), host.take_report()), (None, None));
    sent(&mut host, ms(0));
    host.handle_input(&bytes(Pong::new(ErrorCode::Fine)), ms(7));
    assert_eq!(host.take_round_trip(), Some(Duration::from_millis(7)));
    assert_eq!(host.take_round_trip(), None);
    let report = FirmwareReport::new(&Telemetry { battery_pct: 55, ..Telemetry::default() }, 40);
    host.handle_input(report.frame(3).as_bytes(), ms(8));
    let taken = host.take_report().unwrap();
    assert_eq!((taken.telemetry.battery_pct, taken.version), (55, Some(40)));
    assert_eq!((taken.index, taken.lost, host.take_report()), (3, 0, None));
    assert_eq!(host.last_report(), Some(&taken), "it is still the latest");
    // Each report is new: after a gap, and repeated.
    for (index, lost) in [(9, 5), (9, 0), (8, 254)] {
        host.handle_input(report.frame(index).as_bytes(), ms(9));
        let taken = host.take_report().unwrap();
        assert_eq!((taken.index, taken.lost), (index, lost));
    }
}

#[test]
fn a_network_state_that_is_refused_changes_nothing() {
    let mut host = begun();
    host.set_network_state(NetworkState::Connected, ms(1)).unwrap();
    assert_eq!(sent(&mut host, ms(1)).len(), 1);
    assert!(host.set_network_state(NetworkState::Other(256), ms(2)).is_err());
    // Sent again when the robot boots: the one before.
    host.handle_input(&bytes(BiasRequest {}), ms(3));
    let frames = sent(&mut host, ms(3));
    let Message::SetNetworkState(told) = message(&frames[0]) else { panic!("{frames:?}") };
    assert_eq!(told.state(), NetworkState::Connected);
    // The same state again is not sent.
    host.set_network_state(NetworkState::Connected, ms(4)).unwrap();
    assert_eq!(sent(&mut host, ms(4)), [] as [Vec<u8>; 0]);
}

#[test]
fn a_move_that_waits_for_its_port_is_outdated_once_the_robot_may_not_be_heard_any_more() {
    let mut config = quiet_config();
    config.dead_man = Duration::from_millis(60_000);
    let mut host = driven(Host::new(config, ms(0)), 60, 0);
    host.handle_input(&bytes(Pong::new(ErrorCode::Fine)), ms(10));
    assert_eq!(host.poll_transmit(ms(10)).and_then(speed), Some(60));
    host.handle_input(&[], ms(509));
    assert!(!host.is_outdated());
    host.handle_input(&[], ms(510));
    assert!(host.is_outdated(), "bytes may wait in the port, but who knows");
    assert_eq!(host.link(), Link::Up);
    host.handle_input(&bytes(Pong::new(ErrorCode::Fine)), ms(510));
    assert!(!host.is_outdated());
    // A stop goes out all the same.
    host.stop(ms(520));
    assert_eq!(host.poll_transmit(ms(520)).and_then(speed), Some(0));
    host.handle_input(&[], ms(2000));
    assert!(!host.is_outdated());
}
