//! The host of the library with a simulated rover, which reports every 20 ms.

use std::time::{Duration, Instant};

use axlewire::{
    drive::{Driver, SerialPort, StdClock},
    ucp::{
        BAUD, MotorControl,
        host::{HostConfig, HostEvent, HostStatistics},
    },
};

use crate::machine::{Control, Gaps};

const PERIOD: Duration = Duration::from_millis(20);

/// Longest time without a report that the machine does not explain.
const LONGEST: Duration = Duration::from_millis(45);

/// Furthest that the beat may have moved at the end.
const DRIFT_US: i64 = 1000;

pub(crate) struct Outcome {
    gaps: Gaps,
    reports: u64,
    /// From the first report to the last.
    span: Duration,
    /// Where in 20 ms the reports came in the first and in the last part, as counts per 0.1 ms.
    phases: [[u32; 200]; 2],
    statistics: HostStatistics,
    lost_events: u32,
    is_account_whole: bool,
}

pub(crate) fn run(path: &str, length: Duration, control: Control, sim: u32) -> Outcome {
    let port = SerialPort::open(path, BAUD).unwrap();
    let mut link = Driver::host(HostConfig::usb_adapter(), port, StdClock::new());
    let mut gaps = None;
    let (begin, mut driven) = (Instant::now(), None::<Instant>);
    let (mut first, mut last, mut reports) = (None::<Instant>, begin, 0);
    let mut phases = [[0; 200]; 2];
    let part = (length / 10).min(Duration::from_secs(60));
    while begin.elapsed() < length {
        if driven.is_none_or(|at| at.elapsed() > Duration::from_millis(100)) {
            driven = Some(Instant::now());
            let now = link.now();
            link.role_mut().drive(MotorControl::new(20, 0).unwrap(), now).unwrap();
        }
        link.service().unwrap();
        while let Some(event) = link.poll_event() {
            if let HostEvent::Report(_) = event {
                let now = Instant::now();
                let first = *first.get_or_insert(now);
                // The wait for the first report is no gap.
                gaps.get_or_insert_with(|| Gaps::new(control.clone(), sim)).heard(now);
                (last, reports) = (now, reports + 1);
                let phase = (now - first).as_micros() % PERIOD.as_micros() / 100;
                if now - first < part {
                    phases[0][phase as usize] += 1;
                } else if begin.elapsed() + part > length {
                    phases[1][phase as usize] += 1;
                }
            }
        }
        let (now, due) = (link.now(), link.poll_timeout());
        let pause = due.map_or(5000, |due| (due - now).as_micros().min(5000));
        if pause > 0 {
            link.port_mut().wait(Duration::from_micros(pause.into())).unwrap();
        }
    }
    link.stop().unwrap();
    let host = link.role();
    let counters = host.counters();
    let pending = counters.received - counters.framed - counters.skipped();
    Outcome {
        gaps: gaps.expect("a report"),
        reports,
        span: last - first.unwrap(),
        phases,
        statistics: *host.statistics(),
        lost_events: host.lost_events(),
        is_account_whole: pending < 64,
    }
}

/// The usual place in a period, µs: where most of them came.
fn usual(phases: &[u32; 200]) -> i64 {
    let (at, _) = phases.iter().enumerate().max_by_key(|(_, count)| **count).unwrap();
    at as i64 * 100
}

impl Outcome {
    /// Prints the figures, and complains of what is wrong; `told` is what the simulation printed.
    pub(crate) fn report(&self, told: &[String], complaints: &mut Vec<String>) {
        let beats = (self.span.as_secs_f64() / PERIOD.as_secs_f64()).round() as u64;
        let missing = (beats + 1).saturating_sub(self.reports);
        let [begin, end] = self.phases.each_ref().map(usual);
        // Both ways around the period.
        let drift = (end - begin + 10_000).rem_euclid(20_000) - 10_000;
        let mean = self.span.as_secs_f64() * 1e3 / (self.reports - 1).max(1) as f64;
        println!(
            "rover: {} reports, one every {mean:.4} ms, {missing} of {beats} beats without one; the beat has moved \
             by {drift} us; longest gap {:.1?}, of which the machine does not explain {:.1?}; {} pings, {} without \
             a pong; {} reports lost",
            self.reports,
            self.gaps.longest,
            self.gaps.longest_own,
            self.statistics.pings,
            self.statistics.pings_lost,
            self.statistics.reports_lost,
        );
        // N commands, N pings, N reports
        let counts = told.last().map(|line| {
            let words = line.split([' ', ',']);
            words.filter_map(|word| word.parse::<u64>().ok()).collect::<Vec<_>>()
        });
        println!("rover: the robot says: {:?}", told.last());
        let mut check = |is_so: bool, what: &str| {
            if !is_so {
                complaints.push(format!("rover: {what}"));
            }
        };
        // A robot that the machine keeps waiting for a beat leaves that beat out.
        let excused = self.gaps.explained.as_millis() as u64 / 20;
        check(missing <= 2 + excused, "reports are missing");
        check(self.reports <= beats + 3, "there are too many reports");
        check(excused > 0 || (mean - 20.0).abs() < 0.02, "the mean period is wrong");
        check(drift.abs() <= DRIFT_US, "the beat has moved");
        check(self.gaps.are_within(LONGEST), "the line stalled");
        let statistics = &self.statistics;
        // The simulation drops what nobody reads for a second, as a wire does.
        let is_halted = self.gaps.longest - self.gaps.longest_own.min(self.gaps.longest)
            >= Duration::from_millis(400);
        check(statistics.reports_lost == 0 || is_halted, "reports were lost on the line");
        check(statistics.links_lost == 0 || is_halted, "the link was lost");
        // One more may have come during the stop. Others were not told because the machine kept us
        // from taking them out.
        let more = u64::from(statistics.reports).saturating_sub(self.reports);
        check(more <= 1 + u64::from(self.lost_events), "the reports do not add up");
        check(self.lost_events == 0 || excused > 0, "events were lost");
        check(self.is_account_whole, "bytes are missing in the account");
        let sent = [u64::from(statistics.commands), u64::from(statistics.pings)];
        let is_heard = counts.is_some_and(|counts| {
            let reported = counts.last().copied().unwrap_or_default();
            counts[counts.len() - 3..counts.len() - 1] == sent && reported >= self.reports
        });
        check(is_heard, &format!("the robot did not hear what the host sent: {sent:?}"));
    }
}
