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
    robot::{Call, Hear, RobotSide, Rover, UPDATE_TO},
    robot_account::Account,
    site::{Checks, HALF, Part, ROOM, Side},
};

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

const fn is_calibration(event: &RobotEvent) -> bool {
    matches!(event, RobotEvent::CalibrationStart { .. } | RobotEvent::CalibrationEnd(_))
}

impl Side for RobotSide {
    type Role = Robot;
    type Account = Account;
    type Call = Call;
    type Hear = Hear;

    fn counters(robot: &Robot) -> Counters {
        robot.counters()
    }

    fn bytes(hear: Hear) -> Vec<u8> {
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

    fn part(hear: Hear) -> Part<Hear> {
        match hear {
            Hear::LongFront | Hear::DamagedMotor => Part::Nothing,
            Hear::Front => Part::Front,
            Hear::Rest => Part::Rest(Hear::Motor(1)),
            _ => Part::Whole,
        }
    }

    fn is_frequent(event: &RobotEvent) -> bool {
        matches!(event, RobotEvent::Motor(_) | RobotEvent::Watchdog | RobotEvent::NetworkState(_))
    }
}

impl Checks<RobotSide> for Rover {
    fn heard(&mut self, hear: Hear, at: Instant, before: &[RobotEvent]) -> Checked {
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

    fn told(&mut self, event: &RobotEvent) -> Checked {
        match event {
            RobotEvent::Motor(command) => self.account.told = *command,
            RobotEvent::Watchdog => self.account.told = halted(self.account.told),
            _ => {}
        }
        Ok(())
    }

    /// They match the robot's current motion.
    fn all_told(&self) -> Checked {
        let (told, expected) = (self.account.told, self.account.expected(self.now));
        if (told.speed(), told.angular()) != (expected.speed(), expected.angular()) {
            return Err(format!("the events report {told:?} instead of {expected:?}"));
        }
        Ok(())
    }

    fn check(&self, events: &[RobotEvent]) -> Checked {
        let (account, now) = (&self.account, self.now);
        // Each of two kinds may have one more.
        if events.iter().filter(|event| RobotSide::is_frequent(event)).count() > ROOM / 2 + 2 {
            return Err("frequent events take the room of rare ones".into());
        }
        let (command, expected) = (self.role.command(now), account.expected(now));
        broken_if!(command != expected, "the command is {command:?} instead of {expected:?}");
        if self.role.calibrating() != account.calibrating.map(|(kind, _)| kind) {
            return Err(format!("calibrates {:?}", self.role.calibrating()));
        }
        if self.role.network_state().map(u32::from) != account.network {
            return Err(format!("the network is {:?}", self.role.network_state()));
        }
        Ok(())
    }
}

impl Rover {
    /// An event counts if and only if it found room (ruling U15).
    fn rare(&mut self, event: RobotEvent, before: &[RobotEvent]) -> Checked {
        let after = queue(&self.role);
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
}
