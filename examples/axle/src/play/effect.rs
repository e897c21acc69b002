//! What a frame does to the device that receives it, and whether it may be sent at all.

use core::fmt;

use axlewire::{
    encode::Encode,
    ikeya::{self, Mode, NodeId, Position, Rps, Status, Target, three},
    stream::{Frames, Framing},
    ucp::{self, Body, Message, MotorControl},
};

use crate::{
    args::{self, Protocol},
    bus::Boards,
};

/// The end of a line that sends a frame.
#[derive(Clone, Copy, Debug, Eq, PartialEq, clap::ValueEnum)]
pub(crate) enum Side {
    /// The master of a bus, or the host of a rover
    Commander,
    /// A node of a bus, or the robot
    Device,
}

impl fmt::Display for Side {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Commander => "commander",
            Self::Device => "device",
        })
    }
}

/// What a frame does.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Effect {
    /// Moves nothing.
    Nothing,
    /// Asks a node for its status.
    Ask(NodeId),
    /// Commands the motors of a node.
    Write(Box<Write>),
    /// Commands the wheels of a rover.
    Wheels(MotorControl),
}

impl Effect {
    /// Whether something moves because of it.
    pub(crate) const fn moves(&self) -> bool {
        match self {
            Self::Write(_) => true,
            Self::Wheels(command) => !command.stands_still(),
            Self::Ask(_) | Self::Nothing => false,
        }
    }
}

/// A command in both readings: its bytes do not say which one is meant (ruling I3).
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Write {
    pub(crate) node: NodeId,
    speeds: Vec<f32>,
    positions: Vec<Position>,
}

/// Limits of commands.
#[derive(Clone, Copy, Debug, clap::Args)]
pub(crate) struct Limits {
    /// Refuse a speed above this, in either direction
    #[arg(long, value_name = "X", default_value = "20", value_parser = args::max_rps)]
    pub(crate) max_rps: Rps,

    /// Refuse a position farther than this from where the motor is before the first frame, turns
    #[arg(long, value_name = "X", default_value = "100", value_parser = args::max_turns)]
    pub(crate) max_turns: f64,
}

/// The sender and the effect of one frame; an error if it is not a frame, or may not be sent.
pub(crate) fn of(protocol: Protocol, bytes: &[u8]) -> Result<(Side, Effect), String> {
    match protocol {
        Protocol::Ikeya => Ok(match whole::<ikeya::BothDirections>(bytes)? {
            ikeya::Packet::Request(ikeya::Request::Read(read)) => ask(read.id()),
            ikeya::Packet::Request(ikeya::Request::Write(write)) => {
                command(write.id(), &[write.as_velocity()], &[write.as_position()])
            }
            ikeya::Packet::Response(_) => (Side::Device, Effect::Nothing),
        }),
        Protocol::Ikeya3 => Ok(match whole::<three::BothDirections>(bytes)? {
            three::Packet::Request(three::Request::Read(read)) => ask(read.id()),
            three::Packet::Request(three::Request::Write(write)) => {
                command(write.id(), &write.as_velocity(), &write.as_position())
            }
            three::Packet::Response(_) => (Side::Device, Effect::Nothing),
        }),
        Protocol::Ucp => of_frame(whole::<ucp::Ucp>(bytes)?),
    }
}

const fn ask(node: NodeId) -> (Side, Effect) {
    (Side::Commander, Effect::Ask(node))
}

fn command(node: NodeId, speeds: &[f32], positions: &[Position]) -> (Side, Effect) {
    let write = Write { node, speeds: speeds.into(), positions: positions.into() };
    (Side::Commander, Effect::Write(write.into()))
}

/// The frame that these bytes are, all of them.
fn whole<F: Framing>(bytes: &[u8]) -> Result<F::Frame<'_>, String> {
    let mut frames = Frames::<F>::new(bytes);
    let (frame, counters) = (frames.next(), frames.counters());
    match frame {
        Some(frame) if counters.framed == bytes.len() as u64 => Ok(frame),
        _ => Err("not one whole frame with a correct CRC".to_owned()),
    }
}

fn of_frame(frame: &ucp::Frame) -> Result<(Side, Effect), String> {
    let message = frame.message();
    let commander = |effect| Ok((Side::Commander, effect));
    match &message {
        Message::MotorControl(command) => match MotorControl::try_from(**command) {
            Ok(command) if command.frame(frame.index()).as_bytes() != frame.as_bytes() => {
                Err("a motor command with values that no host sends (ruling U7)".to_owned())
            }
            Ok(command) => commander(Effect::Wheels(command)),
            Err(_) if command.starts_update() => {
                Err("a motor command that starts a firmware update (ruling U7)".to_owned())
            }
            Err(error) => Err(format!("a motor command out of range (ruling U7): {error}")),
        },
        Message::OtaRequest(_) => {
            Err("a request for a firmware update: after it the robot leaves the protocol"
                .to_owned())
        }
        Message::Ping(_)
        | Message::CalibrationStart(_)
        | Message::CalibrationEnd(_)
        | Message::ImuBiasAck(_)
        | Message::MagBiasAck(_)
        | Message::Biases(_)
        | Message::SetNetworkState(_)
        | Message::SetNetworkStateWide(_) => commander(Effect::Nothing),
        _ if message.is_from_host() == Some(false) => Ok((Side::Device, Effect::Nothing)),
        Message::Unknown(frame) if ucp::MessageId::from_u8(frame.id).is_some() => Err(format!(
            "message id {} with a body of {} bytes, which shipped robots misread (ruling U13)",
            frame.id,
            frame.body.len()
        )),
        Message::Unknown(frame) => match frame.encode(&mut [0; 64]) {
            Ok(_) => commander(Effect::Nothing),
            Err(error) => Err(format!("a frame that harms shipped robots (ruling U13): {error}")),
        },
        _ => Err("a message that this version does not know".to_owned()),
    }
}

impl Write {
    /// The command for its node, which is at `status`, if it is within the limits. `meant` is the
    /// mode that it was meant for, if that is known.
    pub(crate) fn target<B: Boards>(
        &self,
        status: Status<B>,
        meant: Option<Mode>,
        limits: &Limits,
    ) -> Result<Target<B>, String> {
        let (node, mode) = (self.node, status.mode());
        if let Some(meant) = meant.filter(|meant| *meant != mode) {
            return Err(format!(
                "node {node} is in {mode} mode, but a command is for {meant} mode"
            ));
        }
        let target = match B::positions(status) {
            Some(here) => B::position(self.near(&here, limits.max_turns)?).map(Target::Position),
            None => B::velocity(&self.slow(limits.max_rps)?).map(Target::Velocity),
        };
        target.ok_or_else(|| format!("node {node} has another number of motors"))
    }

    /// The positions, if they are near enough to `here`.
    fn near(&self, here: &[Position], max_turns: f64) -> Result<&[Position], String> {
        for (from, to) in here.iter().zip(&self.positions) {
            let (from, to) = (from.revolutions(), to.revolutions());
            if (to - from).abs() > max_turns {
                return Err(format!(
                    "{to:.4} turns for node {}, which is at {from:.4}, is farther than \
                     --max-turns {max_turns}: a speed, or a typo?",
                    self.node
                ));
            }
        }
        Ok(&self.positions)
    }

    /// The speeds, if they are slow enough.
    pub(super) fn slow(&self, max_rps: Rps) -> Result<Vec<Rps>, String> {
        let slow = |&rps: &f32| {
            let within = Rps::new(rps).ok().filter(|rps| rps.get().abs() <= max_rps.get());
            within.ok_or_else(|| {
                format!(
                    "{rps:?} rps for node {} is more than --max-rps {}: a position, or a typo?",
                    self.node,
                    max_rps.get()
                )
            })
        };
        self.speeds.iter().map(slow).collect()
    }
}

#[cfg(test)]
mod tests {
    use axlewire::{
        crc16,
        ikeya::{
            WriteRequest,
            board::{OneMotor, ThreeMotors},
        },
    };

    use super::*;

    fn limits() -> Limits {
        Limits { max_rps: Rps::new(20.0).unwrap(), max_turns: 100.0 }
    }

    fn write(packet: &WriteRequest) -> Write {
        match of(Protocol::Ikeya, packet.as_bytes()) {
            Ok((Side::Commander, Effect::Write(write))) => *write,
            other => panic!("{other:?}"),
        }
    }

    fn velocity(rps: f32) -> Write {
        write(&WriteRequest::velocity(NodeId::N3, Rps::new(rps).unwrap()))
    }

    fn frame(id: u8, body: &[u8]) -> Result<(Side, Effect), String> {
        let mut frame = vec![0xFD, 0xFF, body.len() as u8 + 4, 0, id, 0];
        frame.extend(body);
        frame.extend(crc16::compute(&frame).to_le_bytes());
        of(Protocol::Ucp, &frame)
    }

    #[test]
    fn a_command_for_the_other_mode_is_refused_if_that_is_known() {
        let at = Status::<OneMotor>::Position(Position::new(0, 0));
        let error = velocity(1.0).target(at, Some(Mode::Velocity), &limits()).unwrap_err();
        assert_eq!(error, "node 3 is in position mode, but a command is for velocity mode");
        let still = Status::<OneMotor>::Velocity(0.0);
        velocity(1.0).target(still, Some(Mode::Velocity), &limits()).unwrap();
        velocity(1.0).target(still, None, &limits()).unwrap();
    }

    #[test]
    fn a_speed_that_a_position_node_would_take_for_a_place_is_too_far() {
        let at = Status::<OneMotor>::Position(Position::new(0, 0));
        let error = velocity(1.0).target(at, None, &limits()).unwrap_err();
        assert!(error.starts_with("16256.0000 turns for node 3, which is at 0.0000"), "{error}");
        let near = write(&WriteRequest::position(NodeId::N3, Position::new(0, -100)));
        near.target(at, None, &limits()).unwrap();
        let far = write(&WriteRequest::position(NodeId::N3, Position::new(1, 100)));
        far.target(at, None, &limits()).unwrap_err();
    }

    #[test]
    fn a_speed_above_the_limit_or_none_at_all_is_refused() {
        let still = Status::<OneMotor>::Velocity(0.0);
        velocity(-20.0).target(still, None, &limits()).unwrap();
        velocity(-20.1).target(still, None, &limits()).unwrap_err();
        let nan = write(&WriteRequest::position(NodeId::N1, Position::new(0, 0x7FC0)));
        nan.target(still, None, &limits()).unwrap_err();
    }

    #[test]
    fn the_limits_hold_for_each_of_three_motors() {
        let check =
            |packet: &three::WriteRequest, status| match of(Protocol::Ikeya3, packet.as_bytes()) {
                Ok((Side::Commander, Effect::Write(write))) => {
                    write.target::<ThreeMotors>(status, None, &limits())
                }
                other => panic!("{other:?}"),
            };
        let (still, place) = (Status::Velocity([0.0; 3]), Position::new(0, 50));
        let there = Status::Position([place; 3]);
        for motor in 0..3 {
            for (rps, is_fine) in [(20.0, true), (-20.0, true), (20.5, false), (-20.5, false)] {
                let mut speeds = [Rps::ZERO; 3];
                speeds[motor] = Rps::new(rps).unwrap();
                let write = three::WriteRequest::velocity(NodeId::N2, speeds);
                assert_eq!(check(&write, still).is_ok(), is_fine, "{motor} {rps}");
            }
            for (turns, is_fine) in [(150, true), (-50, true), (151, false), (-51, false)] {
                let mut places = [place; 3];
                places[motor] = Position::new(0, turns);
                let write = three::WriteRequest::position(NodeId::N2, places);
                assert_eq!(check(&write, there).is_ok(), is_fine, "{motor} {turns}");
            }
        }
        let answer = three::VelocityResponse::new(NodeId::N1, [Rps::ZERO; 3]);
        let found = of(Protocol::Ikeya3, answer.as_bytes());
        assert_eq!(found, Ok((Side::Device, Effect::Nothing)));
    }

    #[test]
    fn what_moves_is_a_write_or_a_motor_command_that_is_not_zero() {
        let drive = Effect::Wheels(MotorControl::new(0, 1).unwrap());
        let stand = Effect::Wheels(MotorControl::STOP);
        let write = Effect::Write(velocity(0.0).into());
        let all = [write, drive, stand, Effect::Ask(NodeId::N1), Effect::Nothing];
        assert_eq!(all.map(|effect| effect.moves()), [true, true, false, false, false]);
    }

    #[test]
    fn what_harms_a_robot_is_refused() {
        let mut update = [0; 16];
        (update[8], update[0]) = (39, 10);
        assert!(frame(2, &update).unwrap_err().contains("firmware update (ruling U7)"));
        let mut fast = [0; 16];
        fast[0] = 101;
        assert!(frame(2, &fast).unwrap_err().contains("out of range (ruling U7)"));
        for field in [4, 6, 8, 10, 12, 15] {
            let mut odd = [0; 16];
            odd[field] = 1;
            assert!(frame(2, &odd).unwrap_err().contains("(ruling U7)"), "{field}");
        }
        let mut lamp = [0; 16];
        lamp[4] = 100;
        let lit = MotorControl::STOP.with_front_led(true);
        assert_eq!(frame(2, &lamp), Ok((Side::Commander, Effect::Wheels(lit))));
        assert!(frame(9, &[1, 0]).unwrap_err().contains("firmware update"));
        for (id, len) in [(1, 2), (2, 15), (3, 0), (5, 1), (8, 5), (10, 2)] {
            let error = frame(id, &vec![0; len]).unwrap_err();
            assert!(error.contains("bytes, which shipped robots misread (ruling U13)"), "{error}");
        }
        // A frame in a frame: shipped robots give the outer one up, and take the inner one.
        let ping = [0xFD, 0xFF, 0x04, 0x00, 0x01, 0x00, 0x01, 0x42];
        let nested = frame(0x40, &ping).unwrap_err();
        assert!(nested.contains("(ruling U13): FD FF at byte 6"), "{nested}");
    }

    #[test]
    fn every_message_has_a_sender() {
        let robots = [(1, 1), (3, 2), (4, 2), (5, 36), (6, 12), (7, 6), (8, 0), (9, 1)];
        for (id, len) in robots {
            assert_eq!(frame(id, &vec![0; len]).unwrap().0, Side::Device, "{id}");
        }
        let hosts = [(1, 0), (3, 1), (4, 1), (6, 1), (7, 1), (8, 19), (10, 1), (10, 4), (0x40, 3)];
        for (id, len) in hosts {
            assert_eq!(frame(id, &vec![0; len]).unwrap(), (Side::Commander, Effect::Nothing));
        }
    }

    #[test]
    fn what_is_not_one_whole_frame_is_not_sent() {
        let read = [0xAA, 0x01, 0xBE, 0xD0];
        assert!(of(Protocol::Ikeya, &read).is_ok());
        for bytes in [&read[..3], &[&read[..], &[0]].concat(), &[&read[..], &read].concat(), &[]] {
            assert!(of(Protocol::Ikeya, bytes).is_err(), "{bytes:?}");
        }
    }
}
