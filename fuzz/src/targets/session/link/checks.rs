//! What must hold in a session of a link.

use axlewire::{
    time::Instant,
    ucp::{
        Frame, Message,
        host::HostEvent,
        message::{ImuBias, MagBias},
    },
};

use super::{HOST, Link, ROBOT, motion_of};

impl Link {
    /// A role takes only frames that were sent.
    pub(super) fn took(&mut self, end: usize, frames: u64) {
        assert!(frames as usize <= self.ends[end].unheard, "a frame that was never sent");
        self.ends[end].unheard -= frames as usize;
        let counters = if end == HOST { self.host.counters() } else { self.robot.counters() };
        if counters.framed + counters.skipped() == counters.received {
            self.ends[end].unheard = 0;
        }
    }

    pub(super) fn check_account(&self, end: usize) {
        let counters = if end == HOST { self.host.counters() } else { self.robot.counters() };
        assert_eq!(counters.received, self.ends[end].given);
        assert!(counters.received - counters.framed - counters.skipped() < 64);
    }

    /// The robot moves only by a command that it has heard within its watchdog's time (U10).
    pub(super) fn check_robot(&mut self) {
        let (now, limit) = (self.now, self.robot_config.watchdog);
        let doing = self.robot.command(now);
        let motion = (doing.speed(), doing.angular());
        let is_told = |&(told, at): &((i16, i16), Instant)| told == motion && now - at < limit;
        assert!(motion == (0, 0) || self.heard.iter().rev().any(is_told), "{motion:?} unheard");
        let len = self.heard.len();
        self.heard.drain(..len.saturating_sub(100));
    }

    /// What the host says that it has received was sent; `at_once` are the events of one moment.
    pub(super) fn check_events(&self, at_once: &[HostEvent]) {
        let (mut imu, mut mag) = (None, None);
        for event in at_once {
            match event {
                HostEvent::Report(report) => {
                    let is_known = self.reported.contains(&report.telemetry);
                    assert!(is_known, "a report of nothing measured");
                }
                HostEvent::ImuBias(bias) => {
                    let is_it = |value| *bias == ImuBias::new([value; 3], [value; 3]);
                    assert!((1..=self.results).any(is_it), "{bias:?} was never measured");
                    imu = Some(*bias);
                }
                HostEvent::MagBias(bias) => {
                    let is_it = |value| *bias == MagBias::new([value; 3]);
                    assert!((1..=self.results).any(is_it), "{bias:?} was never measured");
                    mag = Some(*bias);
                }
                _ => {}
            }
        }
        // Two may arrive at once; the later one is kept.
        let store = self.host.store();
        assert!(imu.is_none() || imu == store.imu, "{imu:?} is not kept");
        assert!(mag.is_none() || mag == store.mag, "{mag:?} is not kept");
    }

    pub(super) fn check_frame(&mut self, end: usize, frame: &[u8]) {
        let message = Frame::parse(frame).expect("a good frame").message();
        if end == ROBOT {
            assert_ne!(message.is_from_host(), Some(true), "{message:?} from a robot (U13)");
            return;
        }
        assert_eq!(message.is_from_host(), Some(true), "{message:?} from a host (U13)");
        assert!(!self.host_config.low_ids_only || frame[4] < 5, "it hangs some builds (U14)");
        let motion = motion_of(frame);
        if core::mem::take(&mut self.is_first) {
            assert_eq!(motion, Some((0, 0)), "the first frame (U16)");
        }
        match message {
            Message::ImuBiasAck(_) => assert!(self.host.store().imu.is_some(), "nothing is kept"),
            Message::MagBiasAck(_) => assert!(self.host.store().mag.is_some(), "nothing is kept"),
            _ => {}
        }
        let Some(motion) = motion else { return };
        assert_eq!(frame[12..22], [0; 10], "more than a motion (U7)");
        let is_wanted = self.wanted.is_some_and(|(wanted, at)| {
            wanted == motion && self.now - at < self.host_config.dead_man
        });
        assert!(motion == (0, 0) || is_wanted, "{motion:?} is not wanted any more");
        self.told = Some((motion, self.now));
    }

    /// After a round without a failure the robot has been told what is wanted, lately; a stop at
    /// once (U16), a motion after the gap between two commands.
    pub(super) fn check_told(&self) {
        let Some((told, at)) = self.told else { panic!("the robot was told nothing") };
        assert!(self.now - at < self.host_config.command_period, "it is not told again");
        if self.has_stopped {
            assert_eq!(told, (0, 0), "a stop waits");
        }
    }
}
