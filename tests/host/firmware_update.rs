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
fn only_the_application_ends_the_silence_of_an_update() {
    for end in [Host::stop as fn(&mut Host, Instant), Host::end_firmware_update] {
        let (mut host, now) = asked();
        assert_eq!(ids(&sent(&mut host, now)), [2, 2, 9]);
        // An answer may be that to a request before.
        for status in [OtaStatus::Forbidden, OtaStatus::Accepted, OtaStatus::Forbidden] {
            host.handle_input(&bytes(OtaAck::new(status)), now);
            assert!(events(&mut host).contains(&HostEvent::UpdateAnswered(status)));
            assert_eq!(wait(&mut host, ms(4000)), []);
            assert!(host.is_updating());
        }
        // A flush that fails does not tell that the request was lost.
        host.handle_transmit(Unsent::Unflushed, ms(4000));
        assert_eq!(wait(&mut host, ms(5000)), []);
        end(&mut host, ms(5000));
        assert!(!host.is_updating());
        assert_eq!(speeds(&wait(&mut host, ms(5000)))[0], (5_000_000, 0));
        host.handle_input(&bytes(OtaAck::new(OtaStatus::Accepted)), ms(5000));
        assert!(!host.is_updating(), "a late answer is an event, no more");
        host.handle_input(&report(0), ms(5000));
        assert_eq!(host.drive(go(10), ms(5000)), Ok(()));
    }
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

/// The update has been given up, and its request is not sent any more.
fn assert_given_up(host: &mut Host, now: Instant) {
    assert!(events(host).contains(&HostEvent::UpdateNotSent));
    assert!(!host.is_updating());
    for at in 1..300 {
        host.handle_input(&report(0), now + Duration::from_millis(20 * at));
        let frames = wait(host, now + Duration::from_millis(20 * at));
        assert!(frames.iter().all(|(_, frame)| frame[4] != 9), "{at}");
    }
    assert_eq!(host.drive(go(10), now + Duration::from_millis(6000)), Ok(()));
}

#[test]
fn an_update_is_given_up_if_a_stop_before_its_request_is_lost() {
    for unsent in [Unsent::Untouched, Unsent::CutOff, Unsent::Unflushed] {
        for stops in [1, 2] {
            let (mut host, now) = asked();
            (0..stops).for_each(|_| assert!(host.poll_transmit(now).and_then(speed).is_some()));
            host.handle_transmit(unsent, now);
            assert!(sent(&mut host, now).iter().all(|frame| frame[4] == 2), "{unsent:?}");
            assert_given_up(&mut host, now);
        }
    }
}

#[test]
fn an_update_is_given_up_if_its_request_does_not_leave_whole() {
    for (unsent, stops) in [(Unsent::Untouched, 1), (Unsent::CutOff, 2)] {
        let (mut host, now) = asked();
        assert_eq!(ids(&sent(&mut host, now)), [2, 2, 9]);
        host.handle_transmit(unsent, now);
        assert_eq!(ids(&sent(&mut host, now)), vec![2; stops], "{unsent:?}");
        assert_given_up(&mut host, now);
    }
}

#[test]
fn an_update_is_given_up_if_its_robot_is_not_seen_to_stand_still_when_the_request_is_due() {
    let (mut host, now) = asked();
    host.handle_input(&report(30), now); // it waited in the port
    assert_eq!(ids(&sent(&mut host, now)), [2, 2]);
    assert_given_up(&mut host, now);
    // A driver that comes back late has read no report since.
    let (mut host, now) = asked();
    let late = now + host.config().link_timeout;
    assert_eq!(ids(&sent(&mut host, late)), [2, 2]);
    assert!(events(&mut host).contains(&HostEvent::UpdateNotSent));
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
        host.handle_transmit(Unsent::Untouched, now);
        assert!(!events(&mut host).contains(&HostEvent::UpdateNotSent), "it was the application");
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
fn a_repeated_stop_puts_off_no_repetition_however_long_the_pause_between_commands() {
    let mut config = unheard_config(true);
    config.command_gap = Duration::from_millis(1000);
    let mut host = Host::new(config, ms(0));
    assert_eq!(speeds(&wait(&mut host, ms(0))), [(0, 0)]);
    host.stop(ms(10));
    // 50 ms after the last one, the longest pause that counts.
    assert_eq!(speeds(&wait(&mut host, ms(200))), [(50_000, 0), (150_000, 0)]);
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
    host.handle_input(&[], now + Duration::from_millis(9));
    assert!(!host.is_outdated());
    assert_eq!(host.poll_timeout(), Some(now + Duration::from_millis(10)), "its driver looks then");
    host.handle_input(&[], now + Duration::from_millis(10));
    assert!(host.is_outdated());
    host.handle_transmit(Unsent::Untouched, now + Duration::from_millis(10));
    assert!(events(&mut host).contains(&HostEvent::UpdateNotSent));
    assert!(!host.is_updating());
}
