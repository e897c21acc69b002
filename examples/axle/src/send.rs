//! `axle send`: sends single messages, and shows what is said on the line.

use std::collections::VecDeque;

use axlewire::{
    ikeya::{self, Mode, NodeId, Position, Rps, three},
    ucp::{
        Body,
        message::{
            Biases, CalibrationEnd, CalibrationKind, CalibrationStart, ErrorCode, ImuBias,
            ImuBiasAck, MagBias, MagBiasAck, NetworkState, Ping, SetNetworkState,
        },
    },
};

use crate::{
    MOTION_HELP,
    args::{self, Protocol},
    bus,
    failure::Failure,
    play::{self, Due, Effect, Limits, Plan, Side},
    rover,
};

/// Send one message, and show what is said on the line
///
/// The message is sent once, or --count times every --every seconds, and the line is shown for
/// --for seconds more. Before a WRITE, the mode of its node is read. A node that does not answer,
/// or is in the other mode, gets none, and none gets a speed above --max-rps or a position farther
/// away than --max-turns. Behind each WRITE goes a READ, and a node that answers in the other mode
/// gets no more commands. Before a motor command that is not zero, a robot must be heard.
///
/// At the end, on every error and on every signal that can be caught, what was commanded is
/// stopped, as by `axle spin` and `axle drive`. Firmware updates, motor commands out of range and
/// bodies of a wrong length are refused (rulings U7 and U13), also as hex digits.
///
/// Frames follow each other no faster than --baud allows. A robot is told to stop by the first
/// frame, and every 0.1 s until a motor command of yours goes out (ruling U16): it would drive on
/// while it hears anything.
#[derive(Debug, clap::Args)]
#[command(after_help = MOTION_HELP, arg_required_else_help = false)]
pub(crate) struct Args {
    #[command(flatten)]
    bus: bus::MasterArgs,

    #[command(flatten)]
    times: Times,

    #[command(subcommand)]
    message: Message,
}

#[derive(Debug, clap::Args)]
struct Times {
    /// How often to send the message
    #[arg(short, long, value_name = "N", default_value = "1", value_parser = clap::value_parser!(u32).range(1..=1_000_000))]
    count: u32,

    /// Interval between two of them, seconds
    #[arg(long, value_name = "SECONDS", default_value = "0.1", value_parser = args::seconds)]
    every: u64,

    /// How long to listen behind the last one, seconds; what moves does so meanwhile
    #[arg(short = 'f', long = "for", value_name = "SECONDS", default_value = "0.5", value_parser = args::seconds)]
    linger_us: u64,

    /// Whose frames these are: a device's would harm a robot, and are answers that no node gave
    #[arg(long = "as", value_enum, default_value = "commander")]
    side: Side,

    #[command(flatten)]
    limits: Limits,

    /// Print one JSON object per line
    #[arg(short, long)]
    json: bool,
}

#[derive(Debug, clap::Subcommand)]
enum Message {
    /// To a node of a motor bus with one motor per board
    #[command(subcommand)]
    Ikeya(Packet),
    /// To a node of a motor bus with three motors per board
    #[command(subcommand, name = "ikeya-3")]
    Ikeya3(Packet),
    /// To a robot
    #[command(subcommand)]
    Ucp(UcpMessage),
}

#[derive(Debug, clap::Subcommand)]
enum Packet {
    /// Ask a node for its status
    Read {
        /// The node, 1 to 8
        #[arg(value_parser = args::node)]
        node: NodeId,
    },
    /// Command a velocity node
    Velocity {
        /// The node, 1 to 8
        #[arg(value_parser = args::node)]
        node: NodeId,
        /// Revolutions per second; three of them for three motors
        #[arg(required = true, allow_negative_numbers = true, value_parser = args::rps)]
        rps: Vec<Rps>,
    },
    /// Command a position node
    Position {
        /// The node, 1 to 8
        #[arg(value_parser = args::node)]
        node: NodeId,
        /// Revolutions from the zero position; three of them for three motors
        #[arg(required = true, allow_negative_numbers = true, value_parser = args::revolutions)]
        revolutions: Vec<Position>,
    },
    /// One whole packet in hex digits, with its CRC
    Hex {
        /// Such as AA 01 BE D0
        #[arg(required = true)]
        bytes: Vec<String>,
    },
}

#[derive(Debug, clap::Subcommand)]
enum UcpMessage {
    /// Ask the robot to answer
    Ping,
    /// Drive
    Motor {
        /// Speed, -100 to 100 percent; positive is forward
        #[arg(allow_negative_numbers = true, value_parser = args::percent())]
        speed: i16,
        /// Steering, -100 to 100 percent; positive is to the right
        #[arg(allow_negative_numbers = true, value_parser = args::percent())]
        turn: i16,
        /// Switch the front lamp on
        #[arg(long)]
        lamp: bool,
    },
    /// Begin a calibration
    CalibrationStart {
        /// What to calibrate
        #[arg(value_enum)]
        kind: Kind,
    },
    /// End a calibration
    CalibrationEnd {
        /// What to calibrate
        #[arg(value_enum)]
        kind: Kind,
    },
    /// Show a state of the network by the robot's lamp
    NetworkState {
        /// The state
        #[arg(value_enum)]
        state: Network,
    },
    /// Acknowledge a result of the IMU calibration
    ImuBiasAck,
    /// Acknowledge a result of the magnetometer calibration
    MagBiasAck,
    /// Biases of accelerometer, gyroscope and magnetometer, as raw values
    Biases {
        /// Three each
        #[arg(num_args = 9, allow_negative_numbers = true, value_names = ["AX", "AY", "AZ", "GX", "GY", "GZ", "MX", "MY", "MZ"])]
        values: Vec<i16>,
    },
    /// One whole frame in hex digits, with its CRC
    Hex {
        /// Such as FD FF 04 00 01 00 01 42
        #[arg(required = true)]
        bytes: Vec<String>,
    },
}

/// What can be calibrated.
#[derive(Clone, Copy, Debug, clap::ValueEnum)]
pub(crate) enum Kind {
    /// The magnetometer: turn the robot meanwhile
    Magnetometer,
    /// Accelerometer and gyroscope: keep the robot still meanwhile
    Imu,
}

impl Kind {
    pub(crate) const fn kind(self) -> CalibrationKind {
        match self {
            Self::Magnetometer => CalibrationKind::Magnetometer,
            Self::Imu => CalibrationKind::Imu,
        }
    }
}

/// States of the network.
#[derive(Clone, Copy, Debug, clap::ValueEnum)]
pub(crate) enum Network {
    /// Not known
    Unknown,
    /// No SIM card
    SimAbsent,
    /// No network
    Disconnected,
    /// Connected
    Connected,
    /// A firmware update is in progress
    Ota,
}

impl Network {
    pub(crate) const fn state(self) -> NetworkState {
        match self {
            Self::Unknown => NetworkState::Unknown,
            Self::SimAbsent => NetworkState::SimAbsent,
            Self::Disconnected => NetworkState::Disconnected,
            Self::Connected => NetworkState::Connected,
            Self::Ota => NetworkState::Ota,
        }
    }
}

/// Time from a WRITE to the READ behind it, microseconds.
const READ_AFTER_US: u64 = 2000;

/// Runs the subcommand.
pub(crate) fn run(args: &Args) -> Result<(), Failure> {
    let (protocol, bytes) = match &args.message {
        Message::Ikeya(packet) => (Protocol::Ikeya, one(packet)),
        Message::Ikeya3(packet) => (Protocol::Ikeya3, three(packet)),
        Message::Ucp(message) => (Protocol::Ucp, ucp(message, 0)),
    };
    let meant = match &args.message {
        Message::Ikeya(Packet::Velocity { .. }) | Message::Ikeya3(Packet::Velocity { .. }) => {
            Some(Mode::Velocity)
        }
        Message::Ikeya(Packet::Position { .. }) | Message::Ikeya3(Packet::Position { .. }) => {
            Some(Mode::Position)
        }
        _ => None,
    };
    let (first, times) = (bytes.map_err(Failure::Usage)?, &args.times);
    let (side, effect) = play::effect_of(protocol, &first)
        .map_err(|why| Failure::Usage(format!("nothing is sent: {why}")))?;
    if side != times.side {
        let line = format!("nothing is sent: the frame is one of a {side}, see --as");
        return Err(Failure::Usage(line));
    }
    let mut frames = VecDeque::new();
    for at in 0..times.count {
        let bytes = match &args.message {
            // Each has its own index, as of a host (U9).
            Message::Ucp(message) => ucp(message, at as u8).unwrap_or_else(|_| first.clone()),
            _ => first.clone(),
        };
        let after_us = u64::from(at) * times.every;
        frames.push_back(Due { after_us, bytes: bytes.into(), meant, effect: effect.clone() });
        if let Effect::Write(write) = &effect {
            // A node may start anew in the other mode, and only its answers tell.
            let bytes = ikeya::ReadRequest::new(write.node).as_bytes()[..].into();
            let after_us = after_us + READ_AFTER_US.min(times.every / 2);
            frames.push_back(Due { after_us, bytes, meant: None, effect: Effect::Nothing });
        }
    }
    play::run(Plan {
        bus: &args.bus,
        protocol,
        side,
        frames,
        linger_us: times.linger_us,
        limits: times.limits,
        is_json: times.json,
    })
}

fn one(packet: &Packet) -> Result<Vec<u8>, String> {
    Ok(match packet {
        Packet::Read { node } => ikeya::ReadRequest::new(*node).as_bytes().to_vec(),
        Packet::Velocity { node, rps } => match rps[..] {
            [rps] => ikeya::WriteRequest::velocity(*node, rps).as_bytes().to_vec(),
            _ => return Err("a board with one motor takes one speed".to_owned()),
        },
        Packet::Position { node, revolutions } => match revolutions[..] {
            [to] => ikeya::WriteRequest::position(*node, to).as_bytes().to_vec(),
            _ => return Err("a board with one motor takes one position".to_owned()),
        },
        Packet::Hex { bytes } => hex(bytes)?,
    })
}

fn three(packet: &Packet) -> Result<Vec<u8>, String> {
    Ok(match packet {
        Packet::Velocity { node, rps } => match rps[..] {
            [a, b, c] => three::WriteRequest::velocity(*node, [a, b, c]).as_bytes().to_vec(),
            _ => return Err("a board with three motors takes three speeds".to_owned()),
        },
        Packet::Position { node, revolutions } => match revolutions[..] {
            [a, b, c] => three::WriteRequest::position(*node, [a, b, c]).as_bytes().to_vec(),
            _ => return Err("a board with three motors takes three positions".to_owned()),
        },
        same => return one(same),
    })
}

fn ucp(message: &UcpMessage, index: u8) -> Result<Vec<u8>, String> {
    fn frame<B: Body>(body: B, index: u8) -> Vec<u8> {
        body.frame(index).as_bytes().to_vec()
    }
    Ok(match message {
        UcpMessage::Ping => frame(Ping {}, index),
        UcpMessage::Motor { speed, turn, lamp } => {
            let command = rover::motor_control(*speed, *turn).map_err(|error| error.to_string())?;
            frame(command.with_front_led(*lamp), index)
        }
        UcpMessage::CalibrationStart { kind } => frame(CalibrationStart::new(kind.kind()), index),
        UcpMessage::CalibrationEnd { kind } => frame(CalibrationEnd::new(kind.kind()), index),
        UcpMessage::NetworkState { state } => {
            let body = SetNetworkState::new(state.state()).map_err(|error| error.to_string())?;
            frame(body, index)
        }
        UcpMessage::ImuBiasAck => frame(ImuBiasAck::new(ErrorCode::Fine), index),
        UcpMessage::MagBiasAck => frame(MagBiasAck::new(ErrorCode::Fine), index),
        UcpMessage::Biases { values } => match values[..] {
            [ax, ay, az, gx, gy, gz, mx, my, mz] => frame(
                Biases::new(ImuBias::new([ax, ay, az], [gx, gy, gz]), MagBias::new([mx, my, mz])),
                index,
            ),
            _ => return Err("nine values are needed".to_owned()),
        },
        UcpMessage::Hex { bytes } => hex(bytes)?,
    })
}

/// Bytes from hex digits, in words of any even length.
fn hex(words: &[String]) -> Result<Vec<u8>, String> {
    let digits: String = words.concat();
    let digits = digits.replace([':', ','], "");
    if !digits.len().is_multiple_of(2) || !digits.bytes().all(|digit| digit.is_ascii_hexdigit()) {
        return Err(format!("{digits:?} is not an even number of hex digits"));
    }
    let pairs = (0..digits.len() / 2).map(|at| digits.get(2 * at..2 * at + 2).unwrap_or_default());
    let byte =
        |pair| u8::from_str_radix(pair, 16).map_err(|_| format!("{pair:?} is not two hex digits"));
    pairs.map(byte).collect()
}

#[cfg(test)]
mod tests {
    use super::hex;

    fn bytes(words: &[&str]) -> Result<Vec<u8>, String> {
        hex(&words.iter().map(|word| (*word).to_owned()).collect::<Vec<_>>())
    }

    #[test]
    fn hex_digits_may_be_grouped_in_any_way() {
        let expected = Ok(vec![0xAA, 0x01, 0xBE, 0xD0]);
        for words in
            [&["AA", "01", "be", "d0"][..], &["aa01BED0"], &["AA:01:BE:D0"], &["AA01", "BED0"]]
        {
            assert_eq!(bytes(words), expected, "{words:?}");
        }
        for words in [&["AA0"][..], &["XY"], &["+1"], &["é0"]] {
            assert!(bytes(words).is_err(), "{words:?}");
        }
    }
}
