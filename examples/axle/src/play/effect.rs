//! What a frame does to the device that receives it, and whether it may be sent at all.

use core::fmt;

use axlewire::{
    crc16,
    encode::Encode,
    ikeya::{self, Mode, NodeId, Position, Rps, Status, three},
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
    /// Drives a rover.
    Drive,
    /// Tells a rover to stand still.
    Stand,
}

impl Effect {
    /// Whether something moves because of it.
    pub(crate) const fn moves(&self) -> bool {
        matches!(self, Self::Write(_) | Self::Drive)
    }

    /// Whether it is a motor command for a rover.
    pub(crate) const fn is_for_wheels(&self) -> bool {
        matches!(self, Self::Drive | Self::Stand)
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
            ikeya::Packet::Request(ikeya::Request::Read(read)) => {
                (Side::Commander, Effect::Ask(read.id()))
            }
            ikeya::Packet::Request(ikeya::Request::Write(write)) => {
                let (speeds, positions) = (vec![write.as_velocity()], vec![write.as_position()]);
                (Side::Commander, Write { node: write.id(), speeds, positions }.into())
            }
            ikeya::Packet::Response(_) => (Side::Device, Effect::Nothing),
        }),
        Protocol::Ikeya3 => Ok(match whole::<three::BothDirections>(bytes)? {
            three::Packet::Request(three::Request::Read(read)) => {
                (Side::Commander, Effect::Ask(read.id()))
            }
            three::Packet::Request(three::Request::Write(write)) => {
                let (speeds, positions) =
                    (write.as_velocity().to_vec(), write.as_position().to_vec());
                (Side::Commander, Write { node: write.id(), speeds, positions }.into())
            }
            three::Packet::Response(_) => (Side::Device, Effect::Nothing),
        }),
        Protocol::Ucp => of_frame(whole::<ucp::Ucp>(bytes)?),
    }
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
            Ok(command) if command.stands_still() => commander(Effect::Stand),
            Ok(_) => commander(Effect::Drive),
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

/// The number, from 0, of the first of these frames for a robot in which another one begins: what a
/// shipped robot takes if it has lost its place, by noise or by a frame with an unknown id.
///
/// Its receiver ignores the high byte of `len` and takes any body of an id from 1 to 10 (ruling
/// U13). The other frame may go on in what is sent next: in the next frame, or in a stop, which the
/// tool sends on its own, in front of any frame and behind the last.
pub(crate) fn hidden_frame<'a>(frames: impl IntoIterator<Item = &'a [u8]>) -> Option<usize> {
    let frames: Vec<_> = frames.into_iter().collect();
    let mut left = CONTINUATIONS;
    frames.iter().enumerate().position(|(number, frame)| {
        let behind = frames.get(number + 1..).unwrap_or_default();
        let begins = frame.iter().enumerate().skip(1).filter(|(_, byte)| **byte == 0xFD);
        let mut begun = begins.map(|(at, _)| frame.get(at..).unwrap_or_default().to_vec());
        begun.any(|mut begun| becomes_a_frame(&mut begun, behind, &mut left))
    })
}

/// Maximum number of continuations to try. A capture with more is certainly hiding something.
const CONTINUATIONS: u32 = 1_000_000;

/// Whether these bytes, with what may be sent behind them, begin with a frame that a shipped robot
/// takes.
fn becomes_a_frame(begun: &mut Vec<u8>, behind: &[&[u8]], left: &mut u32) -> bool {
    let is = |at: usize, fits: fn(u8) -> bool| begun.get(at).is_none_or(|&byte| fits(byte));
    let is_header = is(0, |sync| sync == 0xFD)
        && is(1, |sync| sync == 0xFF)
        && is(2, |len| (4..=127).contains(&len))
        && is(4, |id| (1..=10).contains(&id));
    if !is_header {
        return false;
    }
    let whole = begun.get(2).map_or(usize::MAX, |&len| 4 + usize::from(len));
    if let Some(frame) = begun.get(..whole) {
        return crc16::check(frame);
    }
    if *left == 0 {
        return true;
    }
    *left -= 1;
    let (stop, len) = (MotorControl::STOP.frame(0), begun.len());
    let mut goes_on = |next: &[u8], behind: &[&[u8]]| {
        begun.extend_from_slice(next);
        let becomes_one = becomes_a_frame(begun, behind, left);
        begun.truncate(len);
        becomes_one
    };
    goes_on(stop.as_bytes(), behind)
        || behind.split_first().is_some_and(|(next, behind)| goes_on(next, behind))
}

impl From<Write> for Effect {
    fn from(write: Write) -> Self {
        Self::Write(write.into())
    }
}

impl Write {
    /// Checks the command for its node, which is at `status`. `meant` is the mode that it was meant
    /// for, if that is known.
    pub(crate) fn check<B: Boards>(
        &self,
        status: Status<B>,
        meant: Option<Mode>,
        limits: &Limits,
    ) -> Result<(), String> {
        let (node, mode) = (self.node, status.mode());
        if let Some(meant) = meant.filter(|meant| *meant != mode) {
            return Err(format!(
                "node {node} is in {mode} mode, but a command is for {meant} mode"
            ));
        }
        let Some(positions) = B::positions(status) else {
            return self.check_speeds(limits.max_rps.get());
        };
        for (from, to) in positions.iter().zip(&self.positions) {
            let (from, to) = (from.revolutions(), to.revolutions());
            if (to - from).abs() > limits.max_turns {
                return Err(format!(
                    "{to:.4} turns for node {node}, which is at {from:.4}, is farther than \
                     --max-turns {}: a speed, or a typo?",
                    limits.max_turns
                ));
            }
        }
        Ok(())
    }

    fn check_speeds(&self, max_rps: f32) -> Result<(), String> {
        for &rps in &self.speeds {
            if rps.is_nan() || rps.abs() > max_rps {
                let node = self.node;
                return Err(format!(
                    "{rps:?} rps for node {node} is more than --max-rps {max_rps}: a position, or \
                     a typo?"
                ));
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use axlewire::ikeya::{
        WriteRequest,
        board::{OneMotor, ThreeMotors},
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
        let error = velocity(1.0).check(at, Some(Mode::Velocity), &limits()).unwrap_err();
        assert_eq!(error, "node 3 is in position mode, but a command is for velocity mode");
        let still = Status::<OneMotor>::Velocity(0.0);
        velocity(1.0).check(still, Some(Mode::Velocity), &limits()).unwrap();
        velocity(1.0).check(still, None, &limits()).unwrap();
    }

    #[test]
    fn a_speed_that_a_position_node_would_take_for_a_place_is_too_far() {
        let at = Status::<OneMotor>::Position(Position::new(0, 0));
        let error = velocity(1.0).check(at, None, &limits()).unwrap_err();
        assert!(error.starts_with("16256.0000 turns for node 3, which is at 0.0000"), "{error}");
        let near = write(&WriteRequest::position(NodeId::N3, Position::new(0, -100)));
        near.check(at, None, &limits()).unwrap();
        let far = write(&WriteRequest::position(NodeId::N3, Position::new(1, 100)));
        far.check(at, None, &limits()).unwrap_err();
    }

    #[test]
    fn a_speed_above_the_limit_or_none_at_all_is_refused() {
        let still = Status::<OneMotor>::Velocity(0.0);
        velocity(-20.0).check(still, None, &limits()).unwrap();
        velocity(-20.1).check(still, None, &limits()).unwrap_err();
        let nan = write(&WriteRequest::position(NodeId::N1, Position::new(0, 0x7FC0)));
        nan.check(still, None, &limits()).unwrap_err();
    }

    #[test]
    fn the_limits_hold_for_each_of_three_motors() {
        let check =
            |packet: &three::WriteRequest, status| match of(Protocol::Ikeya3, packet.as_bytes()) {
                Ok((Side::Commander, Effect::Write(write))) => {
                    write.check::<ThreeMotors>(status, None, &limits())
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
    fn what_moves_is_a_write_or_a_drive_and_what_is_for_wheels_a_drive_or_a_stop() {
        let write = Effect::from(velocity(0.0));
        let all =
            [&write, &Effect::Drive, &Effect::Stand, &Effect::Ask(NodeId::N1), &Effect::Nothing];
        assert_eq!(all.map(Effect::moves), [true, true, false, false, false]);
        assert_eq!(all.map(Effect::is_for_wheels), [false, true, true, false, false]);
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
        assert_eq!(frame(2, &lamp), Ok((Side::Commander, Effect::Stand)));
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
    fn what_is_sent_hides_no_frame_for_a_robot_that_has_lost_its_place() {
        let sealed = |body: &[u8]| [body, &crc16::compute(body).to_le_bytes()].concat();
        let hidden = |frames: &[&[u8]]| hidden_frame(frames.iter().copied());
        let (ping, update) = ([0xFD, 0xFF, 4, 0, 1, 0], [0xFD, 0xFF, 6, 0, 9, 0, 40, 0]);
        let (ping, whole_update) = (sealed(&ping), sealed(&update));
        // Biases hold any bytes: three that are -3, for example, are FD FF each.
        let biases = |at: usize, hidden: &[u8]| {
            let mut frame = [0xEE; 25];
            frame[..6].copy_from_slice(&[0xFD, 0xFF, 23, 0, 8, 0]);
            frame[at..at + hidden.len()].copy_from_slice(hidden);
            sealed(&frame)
        };
        let harmless = biases(6, &[0xFD, 0xFF].repeat(3));
        assert_eq!(hidden(&[&ping, &harmless, &ping, &whole_update]), None);
        for at in 6..=15 {
            assert_eq!(hidden(&[&ping, &harmless, &biases(at, &whole_update)]), Some(2));
        }
        // The robot ignores the high byte of the length.
        for (at, value, is_taken) in
            [(3, 1, true), (4, 0, false), (4, 10, true), (4, 11, false), (2, 3, false)]
        {
            let mut other = update;
            other[at] = value;
            let found = hidden(&[&biases(6, &sealed(&other))]);
            assert_eq!(found, is_taken.then_some(0), "{other:02X?}");
        }
        // One of 31 bytes that ends in the next frame: 8 of them here, and 23 there.
        let first = biases(19, &[0xFD, 0xFF, 27, 0, 1, 0]);
        let next = biases(6, &[]);
        let crc = crc16::compute(&[&first[19..], &next[..21]].concat());
        let next = biases(21, &crc.to_le_bytes());
        assert_eq!(hidden(&[&ping, &first, &next]), Some(1));
        assert_eq!(hidden(&[&ping, &first, &ping, &next]), None);
    }

    #[test]
    fn a_frame_that_a_stop_of_the_tool_would_complete_is_hidden() {
        // The end of these biases and the front of a stop are a motor command.
        let mut biases = [0; 27];
        biases[..6].copy_from_slice(&[0xFD, 0xFF, 23, 0, 8, 0]);
        biases[9..15].copy_from_slice(&[0xFD, 0xFF, 20, 0, 2, 0]);
        biases[15] = 100;
        let stop = MotorControl::STOP.frame(0);
        let stop = stop.as_bytes();
        let ping = [0xFD, 0xFF, 4, 0, 1, 0, 1, 0x42];
        // What is taken for its CRC is in the stop, so the CRC of the biases has to fit.
        let fits = (0..1_u32 << 20).find(|free| {
            [biases[6], biases[7], biases[8], _] = free.to_le_bytes();
            let crc = crc16::compute(&biases[..25]);
            biases[25..].copy_from_slice(&crc.to_le_bytes());
            crc16::check(&[&biases[9..], &stop[..6]].concat())
        });
        assert!(fits.is_some());
        for frames in [vec![&biases[..]], vec![&ping, &biases, &ping], vec![&biases[..], &ping]] {
            let number = frames.iter().position(|frame| *frame == biases);
            assert_eq!(hidden_frame(frames.iter().copied()), number);
        }
        // With another value in front of it, it has the wrong CRC.
        biases[6] ^= 1;
        let crc = crc16::compute(&biases[..25]);
        biases[25..].copy_from_slice(&crc.to_le_bytes());
        assert_eq!(hidden_frame([&biases[..], &ping]), None);
    }

    #[test]
    fn a_capture_with_endless_ways_to_go_on_is_refused_in_bounded_work() {
        // Each has a header of 127 bytes at its end, behind which 8 bytes follow again and again.
        let mut biases = [0xEE; 25];
        biases[..6].copy_from_slice(&[0xFD, 0xFF, 23, 0, 8, 0]);
        biases[20..].copy_from_slice(&[0xFD, 0xFF, 127, 0, 1]);
        let biases = [&biases[..], &crc16::compute(&biases).to_le_bytes()].concat();
        let ping = [0xFD, 0xFF, 4, 0, 1, 0, 1, 0x42];
        let mut frames = vec![&biases[..]];
        frames.extend([&ping[..]; 16]);
        let many: Vec<_> = frames.iter().copied().cycle().take(100_000).collect();
        assert_eq!(hidden_frame(frames), None);
        assert!(hidden_frame(many).is_some_and(|number| number > 17));
    }

    #[test]
    fn zero_moves_nothing_on_a_rover_and_something_on_a_bus() {
        assert_eq!(frame(2, &[0; 16]), Ok((Side::Commander, Effect::Stand)));
        let mut slow = [0; 16];
        slow[2] = 1;
        assert_eq!(frame(2, &slow), Ok((Side::Commander, Effect::Drive)));
        assert!(matches!(velocity(0.0), Write { node: NodeId::N3, .. }));
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
