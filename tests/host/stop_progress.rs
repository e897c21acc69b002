//! Whether a robot obeys a stop is in its reports; one that is not heard is not driven (U16).

use axlewire::ucp::{
    host::StopProgress::{self, *},
    message::DocumentReport,
};

use crate::rig::*;

fn wheels(rpm: [i16; 4]) -> Vec<u8> {
    bytes(FirmwareReport::new(&Telemetry { rpm, ..Telemetry::default() }, 38))
}

/// A host that has driven, and whose stop is flushed at 100 ms, if `tells` by the word of the port.
fn stopped(tells: bool) -> Host {
    let mut host = driven(begun(), 40, 20);
    wait(&mut host, ms(20));
    host.stop(ms(90));
    assert!(host.poll_transmit(ms(90)).is_some());
    if tells {
        host.handle_taken(ms(90));
    }
    assert_eq!((sent(&mut host, ms(90)).len(), host.stop_progress()), (0, Due));
    if tells {
        assert_eq!((sent(&mut host, ms(95)).len(), host.stop_progress()), (0, Due));
        host.handle_flushed(ms(100));
    }
    assert_eq!((sent(&mut host, ms(100)).len(), host.stop_progress()), (0, NoReports));
    host
}

/// What is known after reports of these wheel speeds, one each 20 ms.
fn after(reports: &[[i16; 4]]) -> StopProgress {
    let mut host = stopped(true);
    for (at, rpm) in (120..).step_by(20).zip(reports) {
        host.handle_input(&wheels(*rpm), ms(at));
    }
    host.stop_progress()
}

#[test]
fn a_robot_stands_still_once_three_reports_in_a_row_show_every_wheel_at_2_rpm_or_less() {
    let still = [2, -2, 0, 1];
    assert_eq!(after(&[still; 2]), StillMoving { rpm: still });
    assert_eq!(after(&[still; 3]), StandingStill);
    for wheel in 0..4 {
        for speed in [3, -3, i16::MAX, i16::MIN] {
            let mut rpm = still;
            rpm[wheel] = speed;
            assert_eq!(after(&[rpm; 9]), StillMoving { rpm });
            assert_eq!(after(&[still, still, rpm]), StillMoving { rpm });
            assert_eq!(after(&[still, still, rpm, still, still]), StillMoving { rpm: still });
            assert_eq!(after(&[still, still, still, rpm]), StillMoving { rpm }, "pushed");
            assert_eq!(after(&[rpm, still, still, still]), StandingStill);
        }
    }
}

#[test]
fn reports_of_both_layouts_count() {
    let mut host = stopped(false);
    for at in [120, 140, 160] {
        host.handle_input(&bytes(DocumentReport::new(&Telemetry::default())), ms(at));
    }
    assert_eq!(host.stop_progress(), StandingStill);
}

#[test]
fn reports_from_before_a_stop_was_flushed_do_not_count() {
    for tells in [false, true] {
        let mut host = stopped(tells);
        // 44 bytes take 3.82 ms: this one began before.
        host.handle_input(&wheels([0; 4]), us(103_819));
        (0..90).for_each(|_| host.handle_old_input(&wheels([0; 4]), ms(103), ms(400)));
        assert_eq!(host.stop_progress(), NoReports);
        host.handle_input(&wheels([7; 4]), us(103_820));
        assert_eq!(host.stop_progress(), StillMoving { rpm: [7; 4] });
    }
}

#[test]
fn a_stop_that_is_due_again_shows_nothing_until_it_has_been_flushed_as_often_as_needed() {
    for unsent in EVERY {
        let mut host = stopped(true);
        for at in [120, 140, 160] {
            host.handle_input(&wheels([0; 4]), ms(at));
        }
        host.handle_unsent(unsent, ms(170));
        assert_eq!(host.stop_progress(), Due, "{unsent:?}");
        for copy in 1..=copies(unsent) {
            assert!(host.poll_transmit(ms(171)).is_some());
            host.handle_taken(ms(171));
            host.handle_flushed(ms(171));
            let expected = if copy == copies(unsent) { NoReports } else { Due };
            assert_eq!(host.stop_progress(), expected, "{unsent:?}");
        }
    }
}

#[test]
fn a_command_to_move_is_no_stop_however_slow_and_one_to_stand_still_is() {
    for (speed, angular) in [(1, 0), (-5, 0), (0, 1), (100, 100)] {
        let mut host = stopped(true);
        host.drive(MotorControl::new(speed, angular).unwrap(), ms(130)).unwrap();
        assert_eq!(host.stop_progress(), NotAsked);
        host.drive(MotorControl::STOP, ms(131)).unwrap();
        assert_eq!(host.stop_progress(), Due);
    }
}

#[test]
fn reports_that_have_ceased_for_500_ms_show_nothing() {
    let mut config = HostConfig::default();
    config.ping_period = None;
    let mut host = Host::new(config, ms(0));
    assert_eq!((sent(&mut host, ms(0)).len(), sent(&mut host, ms(10)).len()), (1, 0));
    for at in [20, 40, 60] {
        host.handle_input(&wheels([0; 4]), ms(at));
    }
    // Pings may still be answered.
    host.handle_input(&bytes(Pong::new(ErrorCode::Fine)), ms(400));
    wait(&mut host, us(559_999));
    assert_eq!((host.stop_progress(), host.link()), (StandingStill, Link::Up));
    host.handle_timeout(ms(560));
    assert_eq!((host.stop_progress(), host.link()), (NoReports, Link::Up));
}

#[test]
fn a_host_that_has_not_heard_the_robot_for_500_ms_sends_zero_tells_it_and_refuses_to_drive() {
    let mut host = Host::new(HostConfig::default(), ms(0));
    let (mut told, mut news) = (Vec::new(), Vec::new());
    for at in (0..2000).step_by(10) {
        let is_heard = (100..1000).contains(&at) || at >= 1800;
        if is_heard {
            host.handle_input(&wheels([9; 4]), ms(at));
        }
        let result = host.drive(go(40), ms(at));
        told.extend(speeds(&wait(&mut host, ms(at))));
        news.extend(events(&mut host));
        let is_lost = (1500..1800).contains(&at);
        let expected = if is_lost { Err(CommandError::LinkDown) } else { Ok(()) };
        assert!(result == expected || at == 1490, "{at}: {result:?}");
    }
    let lost = (1_490_000, 1_800_000);
    let is_lost = |at: u64| (lost.0..lost.1).contains(&at);
    let first = (0, 0);
    assert!(told.iter().all(|&(at, speed)| (speed == 0) == (is_lost(at) || (at, speed) == first)));
    assert_eq!(told.iter().filter(|&&(at, _)| is_lost(at)).count(), 4, "and every 100 ms");
    assert_eq!(news.iter().filter(|it| **it == HostEvent::LinkDown).count(), 1);
    assert_eq!((host.statistics().dead_man, host.drive(go(0), ms(2600))), (0, Ok(())));
}
