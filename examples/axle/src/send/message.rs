//! The messages that can be sent, and their bytes.

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
    args::{self, Protocol},
    rover,
};

#[derive(Debug, clap::Subcommand)]
pub(super) enum Message {
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
pub(super) enum Packet {
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
pub(super) enum UcpMessage {
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
    /// Show a state of the network on the robot's lamp
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

impl Message {
    pub(super) const fn protocol(&self) -> Protocol {
        match self {
            Self::Ikeya(_) => Protocol::Ikeya,
            Self::Ikeya3(_) => Protocol::Ikeya3,
            Self::Ucp(_) => Protocol::Ucp,
        }
    }

    /// For a WRITE, the mode that it is meant for, if its bytes were not given.
    pub(super) const fn mode(&self) -> Option<Mode> {
        match self {
            Self::Ikeya(Packet::Velocity { .. }) | Self::Ikeya3(Packet::Velocity { .. }) => {
                Some(Mode::Velocity)
            }
            Self::Ikeya(Packet::Position { .. }) | Self::Ikeya3(Packet::Position { .. }) => {
                Some(Mode::Position)
            }
            _ => None,
        }
    }

    /// Its bytes, as the frame with this index of a host (ruling U9); those of hex digits are
    /// always the same.
    pub(super) fn bytes(&self, index: u8) -> Result<Vec<u8>, String> {
        match self {
            Self::Ikeya(packet) => one(packet),
            Self::Ikeya3(packet) => three(packet),
            Self::Ucp(message) => ucp(message, index),
        }
    }
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
