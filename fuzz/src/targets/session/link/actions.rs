//! What the application and the line do in a session of a link.

use arbitrary::Arbitrary;
use axlewire::{
    endpoint::Unsent,
    ucp::{
        Host, MotorControl, Robot,
        host::Link as State,
        message::{CalibrationKind, ImuBias, MagBias},
    },
};

use super::{super::way::Damage, End, HOST, Link, ROBOT, US};

#[derive(Arbitrary, Clone, Copy, Debug)]
pub(super) enum Action {
    Wait { units: u16 },
    Drive { speed: i8, angular: i8 },
    Stop,
    Network { state: u8 },
    Calibrate { is_imu: bool, is_end: bool },
    Result { is_imu: bool },
    Abort,
    Damage { to_host: bool, damage: Damage },
    Noise { to_host: bool, bytes: [u8; 3] },
    Plug { is_in: bool },
    ResetRobot,
    ResetHost,
    Fail { is_host: bool, unsent: u8, cut: u8 },
    HoldUp { is_host: bool, units: u16 },
}

impl Link {
    pub(super) fn perform(&mut self, action: Action) -> u8 {
        let now = self.now;
        self.fruitful += 1;
        match action {
            Action::Wait { units } => {
                let span = US(u32::from(units) * 16).min(self.budget);
                self.budget = US(self.budget.as_micros() - span.as_micros());
                self.run_for(span);
                0
            }
            Action::Drive { speed, angular } => {
                self.drive(speed, angular);
                1
            }
            Action::Stop => {
                self.stop();
                2
            }
            Action::Network { state } => {
                let refused = self.host.set_network_state(u32::from(state).into(), now).is_err();
                assert_eq!(refused, self.host_config.low_ids_only);
                3
            }
            Action::Calibrate { is_imu, is_end } => {
                let kind =
                    if is_imu { CalibrationKind::Imu } else { CalibrationKind::Magnetometer };
                // Refused while another request is unanswered.
                let _ = match is_end {
                    true => self.host.end_calibration(kind, now),
                    false => self.host.start_calibration(kind, now),
                };
                4
            }
            Action::Result { is_imu } => {
                self.results += 1;
                let value = [self.results; 3];
                match is_imu {
                    true => self.robot.calibration_result_imu(ImuBias::new(value, value), now),
                    false => self.robot.calibration_result_mag(MagBias::new(value), now),
                }
                5
            }
            Action::Abort => {
                self.robot.abort_calibration();
                6
            }
            Action::Damage { to_host, damage } => {
                self.ways[usize::from(!to_host)].damage(damage);
                7
            }
            Action::Noise { to_host, bytes } => {
                self.ways[usize::from(!to_host)].noise(&bytes, now);
                8
            }
            Action::Plug { is_in } => {
                self.is_plugged = is_in;
                9
            }
            Action::ResetRobot => {
                self.robot = Robot::new(self.robot_config, now);
                self.ends[ROBOT] = End::new(now);
                self.heard.clear();
                self.measure();
                10
            }
            Action::ResetHost => {
                self.host = Host::with_store(self.host_config, *self.host.store(), now);
                self.ends[HOST] = End::new(now);
                (self.wanted, self.told, self.is_first) = (None, None, true);
                self.has_stopped = true;
                11
            }
            Action::Fail { is_host, unsent, cut } => {
                let unsent =
                    [Unsent::Untouched, Unsent::CutOff, Unsent::Unflushed][usize::from(unsent % 3)];
                self.ends[usize::from(!is_host)].fail = Some((unsent, usize::from(cut)));
                12
            }
            Action::HoldUp { is_host, units } => {
                self.ends[usize::from(!is_host)].asleep_until = now + US(u32::from(units) * 8);
                13
            }
        }
    }

    /// A command of the application; out of range, it is none.
    pub(super) fn drive(&mut self, speed: i8, angular: i8) {
        let (speed, angular) = (i16::from(speed), i16::from(angular));
        let in_range = |value: i16| (-100..=100).contains(&value);
        let Ok(command) = MotorControl::new(speed, angular) else {
            return assert!(!in_range(speed) || !in_range(angular));
        };
        let is_refused = self.host.link() == State::Down && (speed, angular) != (0, 0);
        assert_eq!(self.host.drive(command, self.now).is_err(), is_refused, "unheard (U16)");
        if is_refused {
            return;
        }
        self.wanted = Some(((speed, angular), self.now));
        self.has_stopped = (speed, angular) == (0, 0);
    }

    pub(super) fn stop(&mut self) {
        self.host.stop(self.now);
        (self.wanted, self.has_stopped) = (None, true);
    }

    /// The robot measures something that it has not measured before.
    pub(super) fn measure(&mut self) {
        self.telemetry.acc[0] = self.telemetry.acc[0].wrapping_add(1);
        self.robot.set_telemetry(&self.telemetry, self.now);
        self.reported.push(self.telemetry);
    }

    pub(super) fn heal(&mut self) {
        self.is_plugged = true;
        for end in 0..2 {
            self.ways[end].heal();
            (self.ends[end].fail, self.ends[end].asleep_until) = (None, self.now);
        }
    }

    pub(super) fn unplug(&mut self) {
        self.is_plugged = false;
    }
}
