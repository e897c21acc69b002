//! A robot, its application, its port, and a host that sends anything at any time.

use super::{
    names::*,
    robot_account::Account,
    site::{self, Acts, Menu},
};

/// A message from the host.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Hear {
    /// 1: ahead, with the lamp on. 2: on the spot. 3: a zero command. 4: out of range.
    Motor(u8),
    /// A motor command that would start an update.
    MotorUpdate,
    DamagedMotor,
    Ping,
    Start(CalibrationKind),
    End(CalibrationKind),
    ImuAck(ErrorCode),
    MagAck,
    Biases,
    Update,
    Show(u32),
    Unknown,
    /// A pong: our own, on a line that echoes.
    Echo,
    /// The first part of motor command 1, and the rest of it.
    Front,
    Rest,
    /// The first part of a frame longer than two motor commands.
    LongFront,
}

#[derive(Clone, Copy, Debug)]
pub(crate) enum Call {
    /// It arrived up to 400 ms ago: the driver was held up.
    HearOld(Hear),
    /// The application polls for a new command.
    TakeCommand,
    Telemetry(u16),
    /// A calibration has its result.
    Imu(i16),
    Mag(i16),
    Abort,
    AnswerUpdate(OtaStatus),
    /// Takes all events, and handles the time.
    TakeEvents,
}

/// Firmware version on offer.
pub(super) const UPDATE_TO: i16 = 39;

#[derive(Clone, Debug, Default)]
pub(crate) struct RobotSide;

pub(crate) type Act = site::Act<Call, Hear>;
pub(crate) type Rover = site::Site<RobotSide>;

impl Rover {
    pub(crate) fn new(config: RobotConfig, menu: Menu<RobotSide>) -> Self {
        let now = Instant::from_micros(1_000_000);
        Self::of(Robot::new(config, now), Account::new(&config, now), now, menu)
    }

    /// The robot stopped for lack of a command, and has registered that.
    fn watch(&mut self, now: Instant) {
        if self.account.until.is_some_and(|until| until <= now) {
            (self.account.command, self.account.until) = (halted(self.account.command), None);
        }
    }

    fn has_result(&mut self, of: CalibrationKind) {
        if let Some((kind, has_result)) = &mut self.account.calibrating {
            *has_result |= *kind == of;
        }
    }
}

impl Acts<RobotSide> for Rover {
    fn call(&mut self, call: Call) -> Checked {
        let now = self.now;
        match call {
            Call::HearOld(hear) => {
                let since = Instant::from_micros(now.as_micros() - 400_000);
                self.hear(hear, since)?;
            }
            Call::TakeCommand => {
                let taken = self.role.take_command(now);
                self.watch(now);
                self.account.taken = taken.unwrap_or(self.account.taken);
                if self.account.taken != self.account.expected(now) {
                    return Err(format!("take_command: {taken:?}: {:?}", self.account));
                }
            }
            Call::Telemetry(battery_pct) => {
                let telemetry = Telemetry { battery_pct, ..Telemetry::default() };
                self.role.set_telemetry(&telemetry, now);
                self.account.telemetry = telemetry;
                self.account.report_at.get_or_insert(now);
            }
            Call::Imu(value) => {
                self.role.calibration_result_imu(imu(value), now);
                self.account.imu.begin(value, now);
                self.has_result(CalibrationKind::Imu);
            }
            Call::Mag(value) => {
                self.role.calibration_result_mag(mag(value), now);
                self.account.mag.begin(value, now);
                self.has_result(CalibrationKind::Magnetometer);
            }
            Call::Abort => {
                let was = self.account.calibrating.take().map(|(kind, _)| kind);
                broken_if!(self.role.abort_calibration() != was, "aborted: {was:?}");
            }
            Call::AnswerUpdate(status) => {
                let was_asked = std::mem::take(&mut self.account.is_update_asked);
                if self.role.answer_update(status, now) != was_asked {
                    return Err(format!("an update was asked for: {was_asked}"));
                }
                if was_asked {
                    self.account.update_answer = Some((status, true));
                }
            }
            Call::TakeEvents => {
                self.settle()?;
                self.take_events()?;
            }
        }
        Ok(())
    }

    fn hand_out(&mut self) -> Result<bool, String> {
        let Some(frame) = self.role.poll_transmit(self.now) else { return Ok(false) };
        self.account.frame(frame, self.now)?;
        Ok(true)
    }

    fn unsent(&mut self, unsent: Unsent) {
        self.account.unsent(unsent, self.now);
    }

    fn owed(&self) -> Option<Instant> {
        self.account.owed(self.now)
    }

    fn settled(&mut self) -> Checked {
        self.watch(self.now);
        Ok(())
    }
}
