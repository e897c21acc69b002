//! What must hold on the line of a rover at every look.

use axlewire::ucp;

use crate::rover::{LATE_US, Link, MOTOR, Order, PING, REPORT};

/// Time from 120 rpm to 0.5 rpm, which a report rounds to 0: ln(240) time constants of 150 ms.
const RUN_OUT_MS: u64 = 825;

/// Bytes that may be on their way at a look.
const SLACK: u64 = 64;

impl Link {
    /// Longest time until everything is well after the last fault: the next report, and the next
    /// motor command.
    fn recovery_bound_us(&self) -> u64 {
        self.slowed(150) + self.plan.step_us
    }

    pub(crate) fn check(&mut self) {
        let is_well = self.is_quiet_for(self.recovery_bound_us());
        self.check_command(is_well);
        self.check_motion();
        let cut_off = self.cut_off_us.map_or(0, |since| self.line.elapsed() - since);
        if cut_off > self.slowed(550) {
            // A host that was reset meanwhile still waits.
            assert_ne!(self.host().link(), ucp::host::Link::Up);
            assert!(self.robot().command(self.line.tail(0).role_now()).stands_still());
            self.account.checks.watchdogs += 1;
        }
        if is_well {
            self.account.checks.health += 1;
            assert_eq!(self.host().link(), ucp::host::Link::Up);
            let lag = self.line.tail(0).beats.lag_us();
            self.account.checks.lags += 1;
            self.account.lag_us = self.account.lag_us.max(lag);
            assert!(lag <= 2 * LATE_US, "a report comes {lag} us after its time");
            self.check_flow();
        }
        self.looks += 1;
        if self.looks.is_multiple_of(16) {
            self.check_host_sums();
            self.check_robot_sums();
        }
    }

    /// The robot does what the application says, and nothing without it.
    fn check_command(&mut self, is_well: bool) {
        let command = self.robot().command(self.line.tail(0).role_now());
        let elapsed = self.line.elapsed();
        match self.order {
            Order::Drive(wanted) if is_well && elapsed >= self.ordered_us + self.slowed(250) => {
                self.account.checks.commands += 1;
                assert_eq!(command, wanted, "the robot does not have its command");
                assert_eq!(self.host().command(), Some(wanted));
            }
            Order::Stop if is_well && elapsed >= self.ordered_us + self.slowed(250) => {
                self.account.checks.paid += 1;
                assert!(self.host().is_stop_sent());
                assert!(command.stands_still(), "{command:?} after a stop");
            }
            _ => {}
        }
        // Whatever the line does: the last valid command that moves is older than the watchdog.
        let silence = match self.order {
            Order::Stop => self.slowed(520),
            Order::Hang => self.slowed(500 + 520),
            Order::Drive(_) => u64::MAX / 2,
        };
        if elapsed > self.ordered_us + silence && !command.stands_still() {
            // Damage that passed for a command.
            self.account.phantoms += 1;
            assert!(!is_well, "{command:?} while the application says {:?}", self.order);
        }
    }

    fn check_motion(&mut self) {
        let silence = match self.order {
            Order::Stop => self.slowed(520),
            Order::Hang => self.slowed(500 + 520),
            Order::Drive(_) => return,
        };
        if self.line.elapsed() > self.ordered_us + silence + 1000 * RUN_OUT_MS + self.plan.step_us {
            self.account.checks.standstills += 1;
            let wheels = self.line.tail(0).role.rover().telemetry().rpm;
            let is_hit = self.account.phantoms > 0 && !self.schedule.is_quiet();
            assert!(wheels == [0; 4] || is_hit, "{wheels:?} with {:?}", self.order);
        }
    }

    /// What one end sends, the other hears; no report is lost.
    fn check_flow(&mut self) {
        let (head, tail) = (self.line.head(), self.line.tail(0));
        let host = self.host().statistics();
        let flow = [
            head.bytes_out,
            tail.bytes_in,
            tail.bytes_out,
            head.bytes_in,
            tail.frames[REPORT],
            host.reports.into(),
            host.reports_lost.into(),
        ];
        if let Some(before) = self.flow {
            let [sent, heard, said, received, reports, got, lost] =
                [0, 1, 2, 3, 4, 5, 6].map(|i| flow[i] - before[i]);
            assert!(sent.abs_diff(heard) <= SLACK, "{heard} of {sent} bytes arrived");
            assert!(said.abs_diff(received) <= SLACK, "{received} of {said} bytes arrived");
            assert!(reports.abs_diff(got) <= 1 && lost == 0, "{got} of {reports}, {lost} lost");
        }
        self.flow = Some(flow);
    }

    /// The counts of the host agree with what was counted beside it.
    pub(crate) fn check_host_sums(&mut self) {
        self.account.checks.sums += 1;
        let (head, host) = (self.line.head(), self.host());
        let (all, counters) = (host.statistics(), host.counters());
        assert_eq!(counters.received, head.bytes_in);
        assert!(counters.received - counters.framed - counters.skipped() < 64, "{counters:?}");
        assert_eq!(u64::from(all.commands), head.frames[MOTOR]);
        assert_eq!(u64::from(all.pings), head.frames[PING]);
        let in_flight = all.pings - all.round_trip.count() - all.pings_lost;
        assert!(in_flight <= 1, "{all:?}");
        assert_eq!(host.lost_events(), 0);
        // FD FF | 14 00 | 02 | index | speed: a motor command to stand still (U16).
        if let Some(first) = head.first_frame {
            assert_eq!((&first[..5], &first[6..]), (&[0xFD, 0xFF, 20, 0, 2][..], &[0, 0][..]));
        }
    }

    /// The same for the robot.
    pub(crate) fn check_robot_sums(&mut self) {
        let (tail, robot) = (self.line.tail(0), self.robot());
        let (all, counters) = (robot.statistics(), robot.counters());
        assert_eq!(counters.received, tail.bytes_in);
        assert!(counters.received - counters.framed - counters.skipped() < 64, "{counters:?}");
        assert_eq!(u64::from(all.reports), tail.frames[REPORT]);
        assert_eq!(u64::from(all.pongs), tail.frames[PING]);
        assert!(all.pongs <= all.pings && all.reports_skipped == 0, "{all:?}");
        assert_eq!(robot.lost_events(), 0);
    }
}
