//! What a robot receives, and the invariants after every step.

use axlewire::{
    crc16,
    ucp::{
        message::{
            Biases, CalibrationEnd, CalibrationStart, ImuBiasAck, MagBiasAck, OtaRequest, Ping,
            SetNetworkState,
        },
        robot::UpdateSource,
    },
};

use super::{
    names::*,
    robot::{Hear, ROOM, Rover, UPDATE_TO},
    sleep::check_sleep,
    ucp::{Checked, bytes, damaged, halted, queue, unknown},
};

pub(crate) fn imu(value: i16) -> ImuBias {
    ImuBias::new([value; 3], [-value; 3])
}

pub(crate) fn mag(value: i16) -> MagBias {
    MagBias::new([value; 3])
}

/// Speed, turn and lamp as received: 1 ahead with the lamp on, 2 on the spot, 3 a zero command, 4
/// out of range.
const COMMANDS: [(i16, i16, i16); 4] = [(60, 0, 100), (0, 50, 0), (0, 0, 0), (360, -400, 0)];

/// A motor command as a careless host sends it.
fn motor((speed, angular, lamp): (i16, i16, i16), version: i16) -> Vec<u8> {
    let mut frame = vec![0xFD, 0xFF, 20, 0, 2, 0];
    for field in [speed, angular, lamp, 0, version, 0, 0, 0] {
        frame.extend(field.to_le_bytes());
    }
    frame.extend(crc16::compute(&frame).to_le_bytes());
    frame
}

/// The robot's reading of a received command: out-of-range values are clamped.
fn command(number: u8) -> MotorControl {
    let (speed, angular, lamp) = COMMANDS[usize::from(number) - 1];
    let command = MotorControl::new(speed.clamp(-100, 100), angular.clamp(-100, 100)).unwrap();
    command.with_front_led(lamp == 100)
}

fn biases() -> Biases {
    Biases::new(imu(9), mag(9))
}

/// Number of bytes before the pause inside a frame that comes in halves.
const HALF: usize = 11;

fn wire(hear: Hear) -> Vec<u8> {
    let first = motor(COMMANDS[0], 0);
    match hear {
        Hear::Motor(number) => motor(COMMANDS[usize::from(number) - 1], 0),
        Hear::MotorUpdate => motor(COMMANDS[0], UPDATE_TO),
        Hear::DamagedMotor => damaged(first),
        Hear::Ping => bytes(Ping {}),
        Hear::Start(kind) => bytes(CalibrationStart::new(kind)),
        Hear::End(kind) => bytes(CalibrationEnd::new(kind)),
        Hear::ImuAck(err) => bytes(ImuBiasAck::new(err)),
        Hear::MagAck => bytes(MagBiasAck::new(ErrorCode::Fine)),
        Hear::Biases => bytes(biases()),
        Hear::Update => bytes(OtaRequest::start_firmware_update(UPDATE_TO)),
        Hear::Show(state) => bytes(SetNetworkState::new(NetworkState::from(state)).unwrap()),
        Hear::Unknown => unknown(),
        Hear::Echo => bytes(Pong::new(ErrorCode::Fine)),
        Hear::Front => first[..HALF].to_vec(),
        Hear::Rest => first[HALF..].to_vec(),
        // The first part of the longest possible frame holds back two whole ones.
        Hear::LongFront => vec![0xFD, 0xFF, 60, 0, 2, 0, 0, 0, 0, 0, 0],
    }
}

const fn is_calibration(event: &RobotEvent) -> bool {
    matches!(event, RobotEvent::CalibrationStart { .. } | RobotEvent::CalibrationEnd(_))
}

/// Events of which only the latest counts.
pub(crate) const fn is_frequent(event: &RobotEvent) -> bool {
    matches!(event, RobotEvent::Motor(_) | RobotEvent::Watchdog | RobotEvent::NetworkState(_))
}

impl Rover {
    /// The host sends something, this long ago.
    pub(super) fn hear(&mut self, hear: Hear, since: Instant) -> Checked {
        let before = queue(&self.robot);
        let bytes = wire(hear);
        let was_half = std::mem::replace(&mut self.feed.is_half, hear == Hear::Front);
        match hear {
            Hear::Front | Hear::LongFront | Hear::DamagedMotor => {}
            Hear::Rest if was_half => self.feed.push(Hear::Motor(1), HALF + bytes.len(), true),
            Hear::Rest => {}
            whole => self.feed.push(whole, bytes.len(), false),
        }
        self.robot.handle_old_input(&bytes, since, self.now);
        let counters = self.robot.counters();
        for (arrived, at) in self.feed.arrived(&counters, since)? {
            self.heard(arrived, at, &before)?;
        }
        self.feed.took(bytes.len(), &counters, since);
        Ok(())
    }

    /// The role has taken in a whole frame.
    pub(super) fn heard(&mut self, hear: Hear, at: Instant, before: &[RobotEvent]) -> Checked {
        let account = &mut self.account;
        let newest_calibration = before.iter().rev().find(|event| is_calibration(event));
        let event = match hear {
            Hear::Motor(number) => {
                account.commanded(command(number), at);
                return Ok(());
            }
            Hear::Ping => {
                account.pong = true;
                return Ok(());
            }
            Hear::Show(state) => {
                account.network = Some(state);
                return Ok(());
            }
            Hear::Start(kind) => {
                let repeated = account.calibrating.is_some_and(|(running, _)| running == kind);
                let waits = match newest_calibration {
                    Some(RobotEvent::CalibrationStart { kind: waiting, .. }) => *waiting == kind,
                    _ => false,
                };
                if repeated && waits {
                    account.start_ack = Some(kind);
                    account.calibrating = Some((kind, false));
                    return Ok(());
                }
                RobotEvent::CalibrationStart { kind, repeated }
            }
            Hear::End(kind) => {
                if account.calibrating.is_none_or(|(running, _)| running != kind) {
                    account.end_ack = Some(kind);
                    return Ok(());
                }
                RobotEvent::CalibrationEnd(kind)
            }
            Hear::ImuAck(ErrorCode::Fine) if account.imu.was_sent() => RobotEvent::ImuBiasTaken,
            Hear::MagAck if account.mag.was_sent() => RobotEvent::MagBiasTaken,
            Hear::Biases => RobotEvent::Biases(biases()),
            Hear::Update => {
                RobotEvent::UpdateRequested { version: UPDATE_TO, by: UpdateSource::Request }
            }
            Hear::MotorUpdate => {
                RobotEvent::UpdateRequested { version: UPDATE_TO, by: UpdateSource::MotorCommand }
            }
            _ => return Ok(()),
        };
        self.rare(event, before)
    }

    /// An event counts if and only if it found room (ruling U15).
    fn rare(&mut self, event: RobotEvent, before: &[RobotEvent]) -> Checked {
        let after = queue(&self.robot);
        let is_same_sort = |other: &&RobotEvent| {
            std::mem::discriminant(*other) == std::mem::discriminant(&event)
                && matches!(event, RobotEvent::Biases(_) | RobotEvent::UpdateRequested { .. })
        };
        let waits = before.iter().rev().find(is_same_sort) == Some(&event);
        let is_pushed = after.iter().skip(before.len()).any(|other| *other == event);
        if !(is_pushed || waits) {
            let is_full = before.len() >= ROOM;
            return if is_full { Ok(()) } else { Err(format!("{event:?} is not reported")) };
        }
        let account = &mut self.account;
        match event {
            RobotEvent::CalibrationStart { kind, .. } => {
                account.calibrating = Some((kind, false));
                account.start_ack = Some(kind);
            }
            RobotEvent::CalibrationEnd(kind) => {
                account.calibrating = None;
                account.end_ack = Some(kind);
            }
            RobotEvent::ImuBiasTaken => {
                account.imu.end();
                let is_over = Some((CalibrationKind::Imu, true));
                account.calibrating =
                    account.calibrating.filter(|_| account.calibrating != is_over);
            }
            RobotEvent::MagBiasTaken => {
                account.mag.end();
                let is_over = Some((CalibrationKind::Magnetometer, true));
                account.calibrating =
                    account.calibrating.filter(|_| account.calibrating != is_over);
            }
            RobotEvent::Biases(_) => account.bias_request.end(),
            RobotEvent::UpdateRequested { by: UpdateSource::Request, .. } => {
                account.is_update_asked = true;
            }
            _ => {}
        }
        Ok(())
    }

    /// An event is taken.
    pub(super) fn told(&mut self, event: &RobotEvent) {
        match event {
            RobotEvent::Motor(command) => self.account.told = *command,
            RobotEvent::Watchdog => self.account.told = halted(self.account.told),
            _ => {}
        }
    }

    /// All events are taken: they match the robot's current motion.
    pub(super) fn check_told(&self) -> Checked {
        let (told, expected) = (self.account.told, self.account.expected(self.now));
        if (told.speed(), told.angular()) != (expected.speed(), expected.angular()) {
            return Err(format!("the events report {told:?} instead of {expected:?}"));
        }
        Ok(())
    }

    /// Everything due has been sent and flushed: nothing is owed now, and the deadline is in the
    /// future.
    pub(super) fn check_rest(&self) -> Checked {
        if self.account.owed(self.now).is_some_and(|at| at <= self.now) {
            return Err(format!("owed and not sent: {:?}", self.account));
        }
        check_sleep(&self.robot, self.now)?;
        Ok(())
    }

    /// Invariants at any time.
    pub(super) fn check(&self, events: &[RobotEvent]) -> Checked {
        let (account, now) = (&self.account, self.now);
        // Each of two kinds may have one more.
        if events.iter().filter(|event| is_frequent(event)).count() > ROOM / 2 + 2 {
            return Err("frequent events take the room of rare ones".into());
        }
        let (command, expected) = (self.robot.command(now), account.expected(now));
        if command != expected {
            return Err(format!("the command is {command:?} instead of {expected:?}"));
        }
        let wake_up = self.robot.poll_timeout();
        if let Some(owed) = account.owed(now).map(|at| at.max(now)) {
            if wake_up.is_none_or(|at| at > owed) {
                return Err(format!("wakes up at {wake_up:?}, and {owed:?} is owed: {account:?}"));
            }
        }
        if self.robot.calibrating() != account.calibrating.map(|(kind, _)| kind) {
            return Err(format!("calibrates {:?}", self.robot.calibrating()));
        }
        if self.robot.network_state().map(u32::from) != account.network {
            return Err(format!("the network is {:?}", self.robot.network_state()));
        }
        Ok(())
    }
}
