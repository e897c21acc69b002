//! Whether a robot obeys a stop is in its reports (U16).

use std::collections::VecDeque;

use axlewire::ucp::{
    host::{
        COAST,
        StopProgress::{self, *},
    },
    message::DocumentReport,
};

use crate::rig::*;

fn wheels(rpm: [i16; 4]) -> Vec<u8> {
    bytes(FirmwareReport::new(&Telemetry { rpm, ..Telemetry::default() }, 38))
}

/// A host that has sent its first frame, and whose robot reports what it measures.
fn measured() -> Host {
    let mut config = unheard_config(true);
    config.rpm_average = Duration::ZERO;
    let mut host = Host::new(config, ms(0));
    wait(&mut host, ms(0));
    host
}

/// A host that has driven, and whose stop is flushed at 100 ms, if `tells` by the word of the port;
/// these reports arrive after it, one each 20 ms.
fn stopped(tells: bool, reports: &[Vec<u8>]) -> Host {
    let mut host = driven(measured(), 40, 20);
    wait(&mut host, ms(20));
    host.stop(ms(90));
    assert!(host.poll_transmit(ms(90)).is_some());
    if tells {
        host.handle_transmit(Transmit::Taken, ms(90));
        assert_eq!((sent(&mut host, ms(95)).len(), host.stop_progress()), (0, Due));
        host.handle_transmit(Transmit::Flushed, ms(100));
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
        (0..90).for_each(|_| {
            host.handle_input(&wheels([0; 4]), Arrival::Between { since: ms(103), now: ms(400) })
        });
        assert_eq!(host.stop_progress(), NoReports);
        host.handle_input(&wheels([7; 4]), us(103_820));
        assert_eq!(host.stop_progress(), StillMoving { rpm: [7; 4] });
    }
}

#[test]
fn a_stop_that_is_due_again_shows_nothing_until_it_has_been_flushed_as_often_as_needed() {
    for unsent in EVERY {
        let mut host = stopped(true, &[(); 3].map(|()| wheels([0; 4])));
        host.handle_transmit(unsent, ms(170));
        for copy in 0..=copies(unsent) {
            let expected = if copy == copies(unsent) { NoReports } else { Due };
            assert_eq!(host.stop_progress(), expected, "{unsent:?}");
            assert_eq!(host.poll_transmit(ms(171)).is_some(), expected == Due);
            host.handle_transmit(Transmit::Taken, ms(171));
            host.handle_transmit(Transmit::Flushed, ms(171));
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
    let mut config = quiet_config();
    config.rpm_average = Duration::ZERO;
    let mut host = Host::new(config, ms(0));
    host.stop(ms(0));
    assert_eq!((sent(&mut host, ms(0)).len(), sent(&mut host, ms(10)).len()), (1, 0));
    [20, 40, 60].into_iter().for_each(|at| host.handle_input(&wheels([0; 4]), ms(at)));
    // Pings may still be answered.
    host.handle_input(&bytes(Pong::new(ErrorCode::Fine)), ms(400));
    wait(&mut host, us(559_999));
    assert_eq!((host.stop_progress(), host.link()), (StandingStill, Link::Up));
    // A driver that is late hands in a report first.
    let mut late = host.clone();
    late.handle_input(&wheels([0; 4]), ms(560));
    assert_eq!(late.stop_progress(), StillMoving { rpm: [0; 4] });
    host.handle_timeout(ms(560));
    assert_eq!((host.stop_progress(), host.link()), (NoReports, Link::Up));
}

#[test]
fn an_average_from_before_a_stop_shows_no_standstill() {
    for average in [0, 100, 1100] {
        let mut config = quiet_config();
        config.rpm_average = Duration::from_millis(average);
        let mut host = Host::new(config, ms(0));
        host.stop(ms(0));
        assert_eq!((sent(&mut host, ms(0)).len(), sent(&mut host, ms(10)).len()), (1, 0));
        // 44 bytes take 3.82 ms.
        let settled = us(13_820 + 1000 * u64::from(average));
        let mut reports = (1..60).map(|it| us(it * 20_000));
        let told = std::iter::from_fn(|| {
            reports.next().map(|at| {
                host.handle_input(&wheels([0; 4]), at);
                (at, host.stop_progress())
            })
        });
        let is_still = |(at, progress): &(Instant, StopProgress)| {
            assert!([StandingStill, StillMoving { rpm: [0; 4] }].contains(progress), "{at:?}");
            *progress == StandingStill
        };
        let (at, _) = told.into_iter().find(is_still).unwrap();
        let first = (1..60).map(|it| us(it * 20_000)).find(|at| *at >= settled).unwrap();
        assert_eq!(at, first.max(ms(60)), "{average} ms");
    }
}

/// A wheel as the vendor's firmware measures it: with a lag of 150 ms, in multiples of 6 rpm, and
/// as the average of ten values, one each 100 ms.
struct Wheel {
    rpm: f64,
    /// Turns since the last value.
    turns: f64,
    values: VecDeque<i16>,
    until_next: u32,
}

impl Wheel {
    const STEP_MS: u32 = 5;

    /// At rest; its first value comes this much later, milliseconds.
    fn new(until_next: u32) -> Self {
        Self { rpm: 0.0, turns: 0.0, values: [0; 10].into(), until_next }
    }

    /// Goes on for 5 ms with this speed as its target; returns what it reports.
    fn step(&mut self, target: f64) -> i16 {
        let step_ms = f64::from(Self::STEP_MS);
        self.rpm += (target - self.rpm) * (1.0 - (-step_ms / 150.0).exp());
        self.turns += self.rpm * step_ms / 60_000.0;
        self.until_next -= Self::STEP_MS;
        if self.until_next == 0 {
            // A turn in 100 ms is 600 rpm.
            self.values.pop_front();
            self.values.push_back((self.turns * 100.0) as i16 * 6);
            (self.turns, self.until_next) = (0.0, 100);
        }
        self.values.iter().sum::<i16>() / 10
    }
}

/// Drives, stops, and tells whether the robot is ever said to stand still while a wheel turns
/// faster than 6 rpm. It takes its first value at this phase; the first stops are `lost`.
fn is_wrong(average: Duration, (speed, span, phase, lost): (i16, u32, u32, usize)) -> bool {
    let mut config = HostConfig::default();
    config.rpm_average = average;
    let robot = Robot::new(RobotConfig::default(), ms(0));
    let mut rig = Rig::of(Host::new(config, ms(0)), robot, ms(0));
    rig.run_for(500);
    let (mut is_driven, mut lost) = (false, lost);
    rig.fault = Box::new(move |_, frame| {
        let speed = self::speed(frame);
        is_driven |= speed.is_some_and(|it| it != 0);
        let is_lost = is_driven && lost > 0 && speed == Some(0);
        lost -= usize::from(is_lost);
        if is_lost { Vec::new() } else { frame.to_vec() }
    });
    rig.host.drive(go(speed), rig.now).unwrap();
    let stop_at = rig.now + Duration::from_millis(span);
    let (mut wheel, mut is_still, mut is_wrong) = (Wheel::new(phase), false, false);
    while rig.now < stop_at + COAST {
        if rig.now == stop_at {
            rig.host.stop(rig.now);
        }
        rig.run_for(Wheel::STEP_MS);
        let full_rpm = f64::from(rig.robot.command(rig.now).speed()) * 1.2;
        let rpm = [wheel.step(full_rpm); 4];
        rig.robot.set_telemetry(&Telemetry { rpm, ..Telemetry::default() }, rig.now);
        is_still = rig.host.stop_progress() == StandingStill;
        is_wrong |= is_still && wheel.rpm > 6.0;
    }
    assert!(is_still, "{:?}", rig.host.stop_progress());
    is_wrong
}

#[test]
fn a_robot_that_reports_averages_never_stands_still_while_a_wheel_turns_faster_than_6_rpm() {
    let phases = (5..=100).step_by(5).flat_map(|phase| [0, 1, 2].map(|lost| (phase, lost)));
    let drives =
        [10, 40, 100].into_iter().flat_map(|speed| [40, 100, 200, 400].map(|at| (speed, at)));
    let mut all = drives.flat_map(|(speed, span)| {
        phases.clone().map(move |(phase, lost)| (speed, span, phase, lost))
    });
    let average = HostConfig::default().rpm_average;
    assert_eq!(all.clone().find(|&it| is_wrong(average, it)), None);
    // The setting is what does it.
    assert!(all.any(|it| is_wrong(Duration::ZERO, it)));
}

#[test]
fn a_report_that_a_false_header_held_back_counts_as_old_as_it_may_be() {
    let mut host = stopped(true, &[wheels([0; 4]), wheels([0; 4])]);
    assert_eq!(host.stop_progress(), StillMoving { rpm: [0; 4] });
    // Found in the port after a hold-up: it may be from before the stop was flushed.
    let late = ms(1000);
    let held = [&[0xFD, 0xFF, 56, 0][..], &wheels([0; 4])].concat();
    host.handle_input(&held, Arrival::Between { since: ms(50), now: late });
    wait(&mut host, ms(1100));
    assert_ne!(host.stop_progress(), StandingStill);
}

#[test]
fn a_report_that_false_headers_held_back_counts_however_small_the_chunks() {
    for chunk in [1, 2, 4, 16, 64] {
        let mut host = begun();
        let (mut at, mut last) = (ms(1), Due);
        while at < ms(3000) {
            let noise = [&[0xFD, 0xFF, 60, 0, 2, 0][..], &[7; 26]].concat();
            let line = [noise.repeat(5), noise[..8].to_vec(), wheels([0; 4]), noise].concat();
            for bytes in line.chunks(chunk) {
                at += Duration::from_micros(87 * chunk as u32);
                host.handle_input(bytes, at);
                wait(&mut host, at);
            }
            last = host.stop_progress();
        }
        assert_eq!(last, StandingStill, "{chunk}");
    }
}

/// When a stop at 190 ms is seen, milliseconds, if the reports pause from 200 ms on, with index 4
/// the last, and go on with this one.
fn seen_after_a_pause(pause_ms: u64, index: u8) -> u64 {
    let mut host = driven(measured(), 40, 20);
    wait(&mut host, ms(20));
    let report = |host: &mut Host, index: u8, at: u64| {
        let report = FirmwareReport::new(&Telemetry::default(), 38).frame(index);
        host.handle_input(report.as_bytes(), ms(at));
    };
    (0..5).for_each(|index| report(&mut host, index, 100 + 20 * u64::from(index)));
    host.stop(ms(190));
    (190..195).for_each(|at| drop(sent(&mut host, ms(at))));
    report(&mut host, 5, 200);
    let times = (220 + pause_ms..9000).step_by(20);
    let mut indices = (0..=u8::MAX).cycle().skip(index.into());
    let mut seen = times.zip(&mut indices).filter(|&(at, index)| {
        host.handle_timeout(ms(at));
        report(&mut host, index, at);
        sent(&mut host, ms(at));
        host.stop_progress() == StandingStill
    });
    seen.next().unwrap().0
}

#[test]
fn a_robot_that_may_have_restarted_stands_still_only_once_it_has_had_the_time_to_coast() {
    for (pause_ms, index, has_restarted) in [
        (0, 6, false),
        (0, 12, false),
        (400, 26, false),
        (400, 6, false),
        // In bursts, without a pause, and behind one.
        (0, 13, true),
        (0, 0, true),
        (400, 0, true),
        (400, 60, true),
        (800, 46, false),
        (800, 0, true),
    ] {
        let first = 220 + pause_ms;
        // The second and third in a row; all three if nothing counts that was before.
        let expected = if has_restarted { first + COAST.as_millis() as u64 } else { first + 20 };
        let seen = seen_after_a_pause(pause_ms, index);
        assert!((expected..=expected + 60).contains(&seen), "{pause_ms} {index}: {seen}");
    }
}

#[test]
fn nothing_is_known_of_a_robot_whose_link_was_lost_until_it_is_seen_to_move() {
    let mut config = quiet_config();
    config.rpm_average = Duration::ZERO;
    let mut host = Host::new(config, ms(0));
    host.stop(ms(0));
    let mut progress = |at: u64, rpm: Option<i16>| {
        host.handle_timeout(ms(at));
        sent(&mut host, ms(at));
        if let Some(rpm) = rpm {
            let telemetry = Telemetry { rpm: [rpm; 4], ..Telemetry::default() };
            let report = FirmwareReport::new(&telemetry, 38).frame((at / 20) as u8);
            host.handle_input(report.as_bytes(), ms(at));
        }
        host.stop_progress()
    };
    let mut last = |times: std::ops::Range<u64>, rpm| {
        times.step_by(20).map(|at| progress(at, rpm)).last().unwrap()
    };
    assert_eq!(last(0..300, Some(0)), StandingStill);
    assert_eq!(last(300..1000, None), NoReports);
    let back = 1000 + u64::from(COAST.as_millis());
    assert_eq!(last(1000..back, Some(0)), StillMoving { rpm: [0; 4] });
    assert_eq!(last(back..back + 20, Some(0)), StandingStill);
    assert_eq!(last(back + 20..back + 1000, None), NoReports);
    // What reports a motion has not restarted since.
    assert_eq!(last(back + 1000..back + 1020, Some(6)), StillMoving { rpm: [6; 4] });
    assert_eq!(last(back + 1020..back + 1080, Some(0)), StandingStill);
}
