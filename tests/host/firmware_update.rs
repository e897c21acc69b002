//! A firmware update starts only on request, after a stop, and is followed by silence (U7, U13).

use axlewire::ucp::host::StopProgress;

use crate::rig::*;

#[test]
fn a_firmware_update_is_requested_once_and_followed_by_silence() {
    let mut host = Host::new(HostConfig::default(), ms(0));
    host.start_calibration(IMU, ms(0)).unwrap();
    assert_eq!(host.start_firmware_update(40, ms(0)), Err(CommandError::Calibrating));
    sent(&mut host, ms(0));
    host.handle_input(&bytes(CalibrationStartAck::new(IMU, ErrorCode::Fine)), ms(10));
    host.drive(go(10), ms(50)).unwrap();
    sent(&mut host, ms(50));
    assert_eq!(host.start_firmware_update(40, ms(100)), Err(CommandError::Moving));
    assert_eq!(sent(&mut host, ms(100)), [] as [Vec<u8>; 0], "a refused call sends nothing");
    host.stop(ms(110));
    assert_eq!(speeds(&wait(&mut host, ms(110))), [(110_000, 0)]);
    let now = seen_still(&mut host, 120);
    host.start_firmware_update(40, now).unwrap();
    assert_eq!(host.drive(go(10), now), Err(CommandError::Updating));
    assert_eq!(host.start_calibration(IMU, now), Err(CommandError::Updating));
    let frames = sent(&mut host, now);
    assert_eq!((speed(&frames[0]), speed(&frames[1])), (Some(0), Some(0)));
    assert!(matches!(message(&frames[2]), Message::OtaRequest(request) if request.version() == 40));
    assert_eq!(frames.len(), 3);
    // Whatever arrives meanwhile, nothing is sent.
    host.handle_input(&bytes(imu_bias()), ms(2000));
    host.handle_input(&bytes(OtaAck::new(OtaStatus::Accepted)), ms(2000));
    assert_eq!(wait(&mut host, ms(60_000)), []);
    assert!(events(&mut host).contains(&HostEvent::UpdateAnswered(OtaStatus::Accepted)));
    host.end_firmware_update(ms(60_000));
    assert_eq!(host.poll_timeout(), Some(ms(60_000)), "the deadline is not in the past");
    host.handle_timeout(ms(60_000));
    assert!(sent(&mut host, ms(60_000)).iter().any(|frame| is_ping(frame)));
}

#[test]
fn a_refused_update_and_a_stop_end_the_silence() {
    let (mut host, now) = asked();
    assert_eq!(ids(&sent(&mut host, now)), [2, 2, 9]);
    host.handle_input(&bytes(OtaAck::new(OtaStatus::Forbidden)), ms(2000));
    host.drive(go(10), ms(2010)).unwrap();
    assert_eq!(sent(&mut host, ms(2010)).len(), 1);
    host.stop(ms(2030));
    sent(&mut host, ms(2030));
    let now = seen_still(&mut host, 2040);
    host.start_firmware_update(40, now).unwrap();
    sent(&mut host, now);
    host.stop(ms(5000));
    assert_eq!(speeds(&wait(&mut host, ms(5000))), [(5_000_000, 0)]);
}

/// A report of wheels of which one turns so fast.
fn report(rpm: i16) -> Vec<u8> {
    let telemetry = Telemetry { rpm: [0, 0, 0, rpm], ..Telemetry::default() };
    bytes(FirmwareReport::new(&telemetry, 38))
}

/// Reports of wheels that stand still, one each 20 ms, until the host has seen it; returns when.
pub(crate) fn seen_still<S: BiasStore>(host: &mut Host<S>, from: u64) -> Instant {
    let mut at = ms(from);
    while host.stop_progress() != StopProgress::StandingStill {
        at += Duration::from_millis(20);
        host.handle_input(&report(0), at);
        wait(host, at);
    }
    at
}

/// A host that has just been asked for an update to version 40, and when.
pub(crate) fn asked() -> (Host, Instant) {
    let mut host = begun();
    let now = seen_still(&mut host, 10);
    host.start_firmware_update(40, now).unwrap();
    (host, now)
}

/// The port has been flushed: the host is asked for the next frame.
fn flushed(host: &mut Host, now: Instant) {
    assert_eq!(sent(host, now), [] as [Vec<u8>; 0]);
}

/// A host whose robot has been told to drive.
fn driving() -> Host {
    let mut host = fresh_host();
    sent(&mut host, ms(0));
    host.drive(go(60), ms(30)).unwrap();
    sent(&mut host, ms(30));
    host
}

#[test]
fn an_update_is_refused_until_the_stop_has_left() {
    let mut host = fresh_host();
    let refused = Err(CommandError::Moving);
    assert_eq!(host.start_firmware_update(40, ms(0)), refused, "the first frame is due");

    for unsent in [Unsent::Untouched, Unsent::CutOff, Unsent::Unflushed] {
        let mut host = driving();
        host.stop(ms(40));
        assert_eq!(host.start_firmware_update(40, ms(40)), refused, "requested");
        assert_eq!(host.poll_transmit(ms(40)).and_then(speed), Some(0));
        host.handle_transmit(unsent, ms(41));
        assert_eq!(host.start_firmware_update(40, ms(41)), refused, "{unsent:?}");
        sent(&mut host, ms(41));
        assert_eq!(host.start_firmware_update(40, ms(41)), refused, "handed out");
        flushed(&mut host, ms(42));
        assert_eq!(host.start_firmware_update(40, ms(42)), refused, "no report has come since");
        let now = seen_still(&mut host, 42);
        assert_eq!(host.start_firmware_update(40, now), Ok(()));
    }
}

#[test]
fn two_more_stops_precede_an_update_request() {
    let mut host = driving();
    let mut robot = quiet_robot();
    robot.handle_input(&bytes(go(60)), ms(30));
    host.stop(ms(40));
    let mut stop = sent(&mut host, ms(40)).concat();
    stop[7] ^= 4; // damaged on the line
    robot.handle_input(&stop, ms(41));
    // It began to move only after these reports.
    let now = seen_still(&mut host, 41);
    host.start_firmware_update(40, now).unwrap();
    for frame in sent(&mut host, now) {
        robot.handle_input(&frame, now);
    }
    let asked = RobotEvent::UpdateRequested { version: 40, by: UpdateSource::Request };
    assert!(events(&mut robot).contains(&asked));
    assert_eq!(robot.command(now).speed(), 0);
}

#[test]
fn an_update_request_waits_for_a_stop_that_did_not_leave() {
    for unsent in [Unsent::Untouched, Unsent::CutOff, Unsent::Unflushed] {
        // A stop is lost before the request, or along with it.
        for frames in [1, 3] {
            // The stops before an untouched request may have left.
            let stops = vec![2; if frames == 3 { copies(unsent) } else { 2 }];
            let mut host = driving();
            host.stop(ms(40));
            sent(&mut host, ms(40));
            let now = seen_still(&mut host, 40);
            host.start_firmware_update(40, now).unwrap();
            (0..frames).for_each(|_| assert!(host.poll_transmit(now).is_some()));
            host.handle_transmit(unsent, now);
            assert!(!host.is_stop_sent(), "{unsent:?}");
            let again = sent(&mut host, now);
            assert_eq!(ids(&again), stops, "{unsent:?}");
            // What was seen before does not count any more.
            let (mut at, mut is_sent) = (now, false);
            while !is_sent {
                at += Duration::from_millis(20);
                host.handle_input(&report(0), at);
                is_sent = wait(&mut host, at).iter().any(|(_, frame)| frame[4] == 9);
            }
            assert!(at - now >= HostConfig::default().rpm_average, "{unsent:?}");
            assert_eq!(wait(&mut host, ms(60_000)), [], "and then silence");
        }
    }
}

#[test]
fn whatever_was_asked_for_during_an_update_is_due_when_it_ends() {
    type Ask = fn(&mut Host<MemoryStore>);
    let asks: [(u8, Ask); 4] = [
        (6, |host| host.handle_input(&bytes(imu_bias()), ms(2005))),
        (7, |host| host.handle_input(&bytes(mag_bias()), ms(2005))),
        (8, |host| host.handle_input(&bytes(BiasRequest {}), ms(2005))),
        (10, |host| host.set_network_state(NetworkState::Connected, ms(2005)).unwrap()),
    ];
    for (id, ask) in asks {
        let store = MemoryStore { imu: Some(imu_bias()), mag: Some(mag_bias()) };
        let mut host = Host::with_store(unheard_config(true), store, ms(0));
        wait(&mut host, ms(0));
        let now = seen_still(&mut host, 10);
        host.start_firmware_update(50, now).unwrap();
        assert_eq!(ids(&sent(&mut host, now)), [2, 2, 9]);
        ask(&mut host);
        assert_eq!(sent(&mut host, ms(2007)), [] as [Vec<u8>; 0], "the line is silent");
        host.end_firmware_update(ms(2009));
        assert_eq!(host.poll_timeout(), Some(ms(2009)), "id {id}");
        assert!(sent(&mut host, ms(2009)).iter().any(|frame| frame[4] == id));
    }
}

#[test]
fn the_rest_of_an_update_request_that_was_ended_is_outdated() {
    for end in [Host::stop as fn(&mut Host, Instant), Host::end_firmware_update] {
        let (mut host, now) = asked();
        while let Some(frame) = host.poll_transmit(now) {
            if frame[4] == 9 {
                break;
            }
        }
        assert!(!host.is_outdated());
        end(&mut host, now);
        assert!(host.is_outdated(), "a robot in an update hears no stop");
    }
}

#[test]
fn an_update_is_refused_while_reports_show_that_a_wheel_turns() {
    let mut host = begun();
    flushed(&mut host, ms(10));
    for at in 2..200 {
        host.handle_input(&report(if at < 100 { 20 } else { 0 }), ms(20 * at));
        sent(&mut host, ms(20 * at));
        let is_still = host.stop_progress() == StopProgress::StandingStill;
        let mut asked = host.clone();
        let answer = asked.start_firmware_update(40, ms(20 * at));
        assert_eq!(answer, if is_still { Ok(()) } else { Err(CommandError::Moving) }, "{at}");
        assert_eq!(is_still, at >= 102);
    }
}

#[test]
fn a_robot_that_is_not_seen_to_stand_still_is_not_updated() {
    // It answers, but sends no reports.
    for sends_first_stop in [true, false] {
        let mut host = Host::new(unheard_config(sends_first_stop), ms(0));
        for at in 1..300 {
            host.handle_input(&bytes(Pong::new(ErrorCode::Fine)), ms(at * 10));
            wait(&mut host, ms(at * 10));
            let asked = host.start_firmware_update(40, ms(at * 10));
            assert_eq!(asked, Err(CommandError::Moving), "{at}");
        }
    }
    // Its reports show a standstill, but no stop was asked for.
    let mut host = quiet_host();
    for at in 1..300 {
        host.handle_input(&report(0), ms(at * 20));
        assert_eq!(host.start_firmware_update(40, ms(at * 20)), Err(CommandError::Moving), "{at}");
    }
    // They ended, and nobody has looked at the clock since.
    let mut config = quiet_config();
    config.sends_first_stop = true;
    let mut host = Host::new(config, ms(0));
    wait(&mut host, ms(0));
    let now = seen_still(&mut host, 10);
    let late = now + config.link_timeout;
    assert_eq!(host.stop_progress(), StopProgress::StandingStill);
    assert_eq!(host.start_firmware_update(40, late), Err(CommandError::Moving));
}

#[test]
fn an_update_request_that_cannot_be_sent_for_3_s_is_given_up_with_an_event() {
    for unsent in [Unsent::Untouched, Unsent::CutOff, Unsent::Unflushed] {
        let (mut host, now) = asked();
        sent(&mut host, now);
        host.handle_transmit(unsent, now);
        // No report arrives any more.
        let before = wait(&mut host, now + Duration::from_micros(2_999_999));
        assert!(before.iter().all(|(_, frame)| frame[4] == 2), "{unsent:?}");
        assert_eq!(host.drive(go(10), ms(4000)), Err(CommandError::Updating));
        assert!(!events(&mut host).contains(&HostEvent::UpdateNotSent));
        let end = now + Duration::from_millis(3000);
        wait(&mut host, end);
        assert!(events(&mut host).contains(&HostEvent::UpdateNotSent));
        assert_eq!(host.drive(go(10), end), Ok(()));
        seen_still(&mut driven(host, 0, 5000), 5001);
    }
}

#[test]
fn an_accepted_update_whose_flush_failed_is_followed_by_silence() {
    let (mut host, now) = asked();
    sent(&mut host, now);
    host.handle_transmit(Unsent::Unflushed, now);
    host.handle_input(&bytes(OtaAck::new(OtaStatus::Accepted)), now);
    assert_eq!(wait(&mut host, ms(60_000)), [], "it had arrived");
    host.handle_transmit(Unsent::Unflushed, ms(60_000));
    assert_eq!(wait(&mut host, ms(120_000)), [], "and is not asked for again");
    // A refusal ends it.
    let (mut host, now) = asked();
    sent(&mut host, now);
    host.handle_transmit(Unsent::Unflushed, now);
    host.handle_input(&bytes(OtaAck::new(OtaStatus::Forbidden)), now);
    assert_eq!(host.drive(go(10), now), Ok(()));
    // Not so if the request cannot have arrived.
    let (mut host, now) = asked();
    host.handle_input(&bytes(OtaAck::new(OtaStatus::Accepted)), now);
    assert_eq!(ids(&sent(&mut host, now)), [2, 2, 9]);
}

#[test]
fn a_repeated_stop_is_sent_20_ms_behind_the_last_one_and_counts_once_it_was() {
    let mut host = begun();
    host.stop(ms(100));
    assert_eq!(speeds(&wait(&mut host, ms(100))), [(100_000, 0)]);
    assert!(host.is_stop_sent());
    host.stop(ms(101));
    assert!(!host.is_stop_sent(), "the robot may have been moved since");
    assert_eq!(speeds(&wait(&mut host, ms(150))), [(120_000, 0)]);
    assert!(host.is_stop_sent());
    // Also if a command in between never left.
    host.drive(go(60), ms(151)).unwrap();
    let _ = host.poll_transmit(ms(151)).unwrap();
    host.handle_transmit(Unsent::Untouched, ms(151));
    host.stop(ms(152));
    assert_eq!(speeds(&wait(&mut host, ms(152))), [(152_000, 0)]);
}

#[test]
fn a_stop_asked_for_at_a_standstill_needs_new_reports() {
    let mut host = begun();
    let now = seen_still(&mut host, 30);
    host.stop(now);
    assert_eq!(host.stop_progress(), StopProgress::Due, "another host may have moved it");
    wait(&mut host, now + Duration::from_millis(20));
    assert!(
        seen_still(&mut host, now.as_micros() / 1000) - now >= HostConfig::default().rpm_average
    );
}

#[test]
fn a_request_that_has_been_flushed_is_not_sent_again_for_a_port_that_is_replaced() {
    let (mut host, now) = asked();
    while host.poll_transmit(now).is_some() {
        host.handle_transmit(Transmit::Taken, now);
    }
    host.handle_transmit(Transmit::Flushed, now);
    host.handle_transmit(Unsent::Unflushed, ms(60_000));
    assert_eq!(wait(&mut host, ms(120_000)), [], "the robot may be waiting for YMODEM");
}

#[test]
fn an_update_request_waits_while_reports_that_came_since_show_no_standstill() {
    let (mut host, now) = asked();
    host.handle_input(&report(30), now); // it waited in the port
    assert_eq!(ids(&sent(&mut host, now)), [2, 2]);
    assert_eq!(host.stop_progress(), StopProgress::StillMoving { rpm: [0, 0, 0, 30] });
    let mut reports = 0;
    while wait(&mut host, now + Duration::from_millis(20 * reports))
        .iter()
        .all(|(_, frame)| frame[4] != 9)
    {
        reports += 1;
        host.handle_input(&report(0), now + Duration::from_millis(20 * reports));
    }
    assert_eq!(reports, 3, "which show a standstill again");
}

#[test]
fn a_repeated_stop_puts_off_no_repetition_however_long_the_pause_between_commands() {
    let mut config = unheard_config(true);
    config.command_gap = Duration::from_millis(1000);
    let mut host = Host::new(config, ms(0));
    assert_eq!(speeds(&wait(&mut host, ms(0))), [(0, 0)]);
    host.stop(ms(10));
    assert_eq!(speeds(&wait(&mut host, ms(250))), [(100_000, 0), (200_000, 0)]);
}

#[test]
fn an_update_request_that_comes_back_again_and_again_is_given_up_after_3_s_too() {
    for unsent in [Unsent::Untouched, Unsent::CutOff, Unsent::Unflushed] {
        let (mut host, begin) = asked();
        let (mut at, mut requests, mut is_over) = (begin, 0, false);
        while !is_over {
            at += Duration::from_millis(20);
            assert!(at - begin <= Duration::from_millis(3000), "{unsent:?}");
            host.handle_input(&report(0), at);
            host.handle_timeout(at);
            while let Some(frame) = host.poll_transmit(at) {
                if frame[4] == 9 {
                    requests += 1;
                    host.handle_transmit(unsent, at);
                }
            }
            is_over = events(&mut host).contains(&HostEvent::UpdateNotSent);
            assert_eq!(host.is_updating(), !is_over);
        }
        assert!(requests >= 2, "{unsent:?}: {requests}");
        assert_eq!(host.drive(go(10), at), Ok(()));
    }
}

#[test]
fn a_request_that_may_have_left_once_is_answered_even_if_it_did_not_leave_again() {
    let (mut host, now) = asked();
    sent(&mut host, now);
    host.handle_transmit(Unsent::Unflushed, now);
    let now = seen_still(&mut host, now.as_micros() / 1000);
    host.handle_transmit(Unsent::Untouched, now);
    host.handle_input(&bytes(OtaAck::new(OtaStatus::Accepted)), now);
    assert_eq!(wait(&mut host, ms(60_000)), []);
}

#[test]
fn an_update_request_that_waits_for_its_port_is_outdated_once_a_wheel_turns() {
    let (mut host, now) = asked();
    while host.poll_transmit(now).is_some_and(|frame| frame[4] != 9) {}
    assert!(!host.is_outdated());
    host.handle_input(&report(30), now);
    assert!(host.is_outdated());
    // Reports that may say so wait in the port meanwhile.
    let (mut host, now) = asked();
    while host.poll_transmit(now).is_some_and(|frame| frame[4] != 9) {}
    host.handle_input(&[], now + Duration::from_millis(19));
    assert!(!host.is_outdated());
    assert_eq!(host.poll_timeout(), Some(now + Duration::from_millis(20)), "its driver looks then");
    host.handle_input(&[], now + Duration::from_millis(20));
    assert!(host.is_outdated());
    host.handle_transmit(Unsent::Untouched, now + Duration::from_millis(20));
    seen_still(&mut host, now.as_micros() / 1000 + 20);
    assert!(host.is_updating(), "it is sent again");
}

#[test]
fn a_refusal_that_a_robot_repeats_does_not_hide_that_it_accepts_the_next_request() {
    let (mut host, now) = asked();
    let forbidden = bytes(OtaAck::new(OtaStatus::Forbidden));
    let accepted = bytes(OtaAck::new(OtaStatus::Accepted));
    sent(&mut host, now);
    host.handle_input(&forbidden, now);
    assert_eq!(host.start_firmware_update(41, now), Ok(()), "still seen to stand still");
    assert_eq!(ids(&sent(&mut host, now)), [2, 2, 9]);
    host.handle_input(&forbidden, now);
    assert!(!host.is_updating());
    let mut stopped = host.clone();
    let mut driven = host.clone();
    host.handle_input(&accepted, now);
    assert!(host.is_updating());
    assert_eq!(wait(&mut host, ms(60_000)), [], "the line belongs to the update");
    // What the application has done since counts more.
    stopped.stop(now);
    driven.drive(go(10), now).unwrap();
    for mut host in [stopped, driven] {
        host.handle_input(&accepted, now);
        assert!(!host.is_updating());
    }
}

#[test]
fn a_flush_that_fails_long_after_the_request_does_not_end_the_silence() {
    // By a driver that tells neither of frames taken nor of flushes.
    let (mut host, now) = asked();
    assert_eq!(ids(&sent(&mut host, now)), [2, 2, 9]);
    host.handle_transmit(Unsent::Unflushed, now + Duration::from_millis(3000));
    assert_eq!(wait(&mut host, ms(60_000)), []);
    // Its own does, however late it was sent.
    let (mut host, now) = asked();
    let late = now + Duration::from_millis(2900);
    for at in 1..=145 {
        host.handle_input(&report(30), now + Duration::from_millis(20 * at));
    }
    for _ in 0..3 {
        host.handle_input(&report(0), late);
    }
    assert_eq!(ids(&sent(&mut host, late)), [2, 2, 9]);
    host.handle_transmit(Unsent::Unflushed, late + Duration::from_millis(200));
    assert_ne!(wait(&mut host, ms(60_000)), []);
    assert!(events(&mut host).contains(&HostEvent::UpdateNotSent));
}
