//! Whether a robot obeys a stop is in its reports (U16).

use axlewire::ucp::{
    host::StopProgress::{self, *},
    message::DocumentReport,
};

use crate::rig::*;

fn wheels(rpm: [i16; 4]) -> Vec<u8> {
    bytes(FirmwareReport::new(&Telemetry { rpm, ..Telemetry::default() }, 38))
}

/// A host that has driven, and whose stop is flushed at 100 ms, if `tells` by the word of the port;
/// these reports arrive after it, one each 20 ms.
fn stopped(tells: bool, reports: &[Vec<u8>]) -> Host {
    let mut host = driven(begun(), 40, 20);
    wait(&mut host, ms(20));
    host.stop(ms(90));
    assert!(host.poll_transmit(ms(90)).is_some());
    if tells {
        host.handle_taken(ms(90));
        assert_eq!((sent(&mut host, ms(95)).len(), host.stop_progress()), (0, Due));
        host.handle_flushed(ms(100));
    }
    assert_eq!(host.stop_progress(), if tells { NoReports } else { Due });
    (0..2).for_each(|_| assert_eq!(sent(&mut host, ms(100)).len(), 0));
    assert_eq!(host.stop_progress(), NoReports);
    for (at, report) in (120..).step_by(20).zip(reports) {
        host.handle_input(report, ms(at));
    }
    host
}

fn after(reports: &[[i16; 4]]) -> StopProgress {
    stopped(true, &reports.iter().map(|&rpm| wheels(rpm)).collect::<Vec<_>>()).stop_progress()
}

#[test]
fn a_robot_stands_still_once_three_reports_in_a_row_show_every_wheel_at_2_rpm_or_less() {
    let still = [2, -2, 0, 1];
    assert_eq!(after(&[still; 2]), StillMoving { rpm: still });
    assert_eq!(after(&[still; 3]), StandingStill);
    for (wheel, speed) in (0..4).flat_map(|it| [3, -3, i16::MIN].map(|speed| (it, speed))) {
        let mut rpm = still;
        rpm[wheel] = speed;
        assert_eq!(after(&[rpm; 9]), StillMoving { rpm });
        assert_eq!(after(&[still, still, rpm]), StillMoving { rpm });
        assert_eq!(after(&[still, still, rpm, still, still]), StillMoving { rpm: still });
        assert_eq!(after(&[still, still, still, rpm]), StillMoving { rpm }, "pushed");
        assert_eq!(after(&[rpm, still, still, still]), StandingStill);
    }
    // The other layout has wheel speeds as well.
    let reports = [(); 3].map(|()| bytes(DocumentReport::new(&Telemetry::default())));
    assert_eq!(stopped(false, &reports).stop_progress(), StandingStill);
}

#[test]
fn reports_from_before_a_stop_was_flushed_do_not_count() {
    for tells in [false, true] {
        let mut host = stopped(tells, &[]);
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
        let mut host = stopped(true, &[(); 3].map(|()| wheels([0; 4])));
        host.handle_unsent(unsent, ms(170));
        for copy in 0..=copies(unsent) {
            let expected = if copy == copies(unsent) { NoReports } else { Due };
            assert_eq!(host.stop_progress(), expected, "{unsent:?}");
            assert_eq!(host.poll_transmit(ms(171)).is_some(), expected == Due);
            host.handle_taken(ms(171));
            host.handle_flushed(ms(171));
        }
    }
}

#[test]
fn a_command_to_move_is_no_stop_however_slow_and_one_to_stand_still_is() {
    for (speed, angular) in [(1, 0), (-5, 0), (0, 1), (100, 100)] {
        let mut host = stopped(true, &[(); 3].map(|()| wheels([0; 4])));
        host.drive(MotorControl::new(speed, angular).unwrap(), ms(161)).unwrap();
        assert_eq!(host.stop_progress(), NotAsked);
        host.drive(MotorControl::STOP, ms(162)).unwrap();
        assert_eq!(host.stop_progress(), Due);
    }
}

#[test]
fn reports_that_have_ceased_for_500_ms_show_nothing() {
    let mut host = Host::new(quiet_config(), ms(0));
    host.stop(ms(0));
    assert_eq!((sent(&mut host, ms(0)).len(), sent(&mut host, ms(10)).len()), (1, 0));
    [20, 40, 60].into_iter().for_each(|at| host.handle_input(&wheels([0; 4]), ms(at)));
    // Pings may still be answered.
    host.handle_input(&bytes(Pong::new(ErrorCode::Fine)), ms(400));
    wait(&mut host, us(559_999));
    assert_eq!((host.stop_progress(), host.link()), (StandingStill, Link::Up));
    host.handle_timeout(ms(560));
    assert_eq!((host.stop_progress(), host.link()), (NoReports, Link::Up));
}
