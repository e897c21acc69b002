//! What is sent over the noisy lines.

use axlewire::{
    ikeya::{self, NodeId, Position, Rps, three},
    ucp::{
        self, Body, MotorControl,
        message::{CalibrationKind, ErrorCode, NetworkState},
    },
};

use super::{dice::Dice, oracle::Rules};

/// What is sent.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub(crate) enum Traffic {
    /// Motor commands of 24 bytes and reports of 44.
    Ucp,
    /// Everything that goes to a robot: many short frames.
    UcpToRobot,
    /// Answers of 8 bytes.
    Ikeya,
    /// READs of 4 bytes and WRITEs of 8.
    IkeyaRequests,
    /// Answers of 16 bytes.
    Ikeya3,
}

impl Traffic {
    pub(crate) const ALL: [Self; 5] =
        [Self::Ucp, Self::UcpToRobot, Self::Ikeya, Self::IkeyaRequests, Self::Ikeya3];

    pub(crate) const fn name(self) -> &'static str {
        match self {
            Self::Ucp => "ucp",
            Self::UcpToRobot => "ucp-robot",
            Self::Ikeya => "ikeya",
            Self::IkeyaRequests => "ikeya-slave",
            Self::Ikeya3 => "ikeya-3",
        }
    }

    /// What a receiver of this traffic takes for a frame.
    pub(crate) const fn rules(self) -> Rules {
        match self {
            Self::Ucp | Self::UcpToRobot => Rules::Ucp { cap: 60 },
            Self::Ikeya => Rules::Ikeya { to_slave: false, to_master: true, long: 8 },
            Self::IkeyaRequests => Rules::Ikeya { to_slave: true, to_master: false, long: 8 },
            Self::Ikeya3 => Rules::Ikeya { to_slave: false, to_master: true, long: 16 },
        }
    }

    /// Bytes that look like the start of a frame.
    pub(crate) const fn header_bytes(self) -> [u8; 5] {
        match self {
            Self::Ucp | Self::UcpToRobot => [0xFD, 0xFD, 0xFF, 0x04, 0x00],
            Self::Ikeya | Self::IkeyaRequests | Self::Ikeya3 => [0x55, 0x56, 0xAA, 0xBB, 0x01],
        }
    }

    /// A frame with random contents.
    pub(crate) fn frame(self, dice: &mut Dice, index: u8) -> Vec<u8> {
        match self {
            Self::Ucp if dice.one_in(2) => motor_control(dice, index),
            Self::Ucp => report(dice, index),
            Self::UcpToRobot => to_robot(dice, index),
            Self::Ikeya => answer(dice),
            Self::IkeyaRequests => request(dice),
            Self::Ikeya3 => answer_of_three(dice),
        }
    }
}

fn motor_control(dice: &mut Dice, index: u8) -> Vec<u8> {
    let mut percent = || dice.below(201) as i16 - 100;
    let command = MotorControl::new(percent(), percent()).unwrap();
    command.with_front_led(dice.one_in(2)).frame(index).as_bytes().to_vec()
}

fn report(dice: &mut Dice, index: u8) -> Vec<u8> {
    let telemetry = ucp::Telemetry {
        battery_pct: dice.below(101) as u16,
        rpm: [dice.below(200) as i16 - 100; 4],
        acc: vector(dice),
        gyro: vector(dice),
        mag: vector(dice),
        heading_deg: dice.below(361) as i16,
        power_w: dice.below(40) as u8,
        voltage_dv: 119,
        current_ca: dice.below(256) as u16,
    };
    ucp::message::FirmwareReport::new(&telemetry, 38).frame(index).as_bytes().to_vec()
}

fn to_robot(dice: &mut Dice, index: u8) -> Vec<u8> {
    match dice.below(6) {
        0 => ucp::message::Ping {}.frame(index).as_bytes().to_vec(),
        1 => {
            let start = ucp::message::CalibrationStart::new(CalibrationKind::Imu);
            start.frame(index).as_bytes().to_vec()
        }
        2 => {
            let state = NetworkState::from(dice.below(5) as u32);
            ucp::message::SetNetworkState::new(state).unwrap().frame(index).as_bytes().to_vec()
        }
        3 => {
            let imu = ucp::message::ImuBias::new(vector(dice), vector(dice));
            let biases = ucp::message::Biases::new(imu, ucp::message::MagBias::new(vector(dice)));
            biases.with_err(ErrorCode::Fine).frame(index).as_bytes().to_vec()
        }
        _ => motor_control(dice, index),
    }
}

fn answer(dice: &mut Dice) -> Vec<u8> {
    let id = node(dice);
    if dice.one_in(2) {
        ikeya::VelocityResponse::new(id, rps(dice)).as_bytes().to_vec()
    } else {
        ikeya::PositionResponse::new(id, position(dice)).as_bytes().to_vec()
    }
}

fn request(dice: &mut Dice) -> Vec<u8> {
    let id = node(dice);
    match dice.below(4) {
        0 => ikeya::WriteRequest::velocity(id, rps(dice)).as_bytes().to_vec(),
        1 => ikeya::WriteRequest::position(id, position(dice)).as_bytes().to_vec(),
        _ => ikeya::ReadRequest::new(id).as_bytes().to_vec(),
    }
}

fn answer_of_three(dice: &mut Dice) -> Vec<u8> {
    let id = node(dice);
    if dice.one_in(2) {
        let current = [rps(dice), rps(dice), rps(dice)];
        three::VelocityResponse::new(id, current).as_bytes().to_vec()
    } else {
        let current = [position(dice), position(dice), position(dice)];
        three::PositionResponse::new(id, current).as_bytes().to_vec()
    }
}

/// A sensor's three axes, around zero.
fn vector(dice: &mut Dice) -> [i16; 3] {
    [0; 3].map(|_: i16| dice.below(4001) as i16 - 2000)
}

fn node(dice: &mut Dice) -> NodeId {
    NodeId::ALL[dice.below(NodeId::ALL.len())]
}

fn rps(dice: &mut Dice) -> Rps {
    Rps::new((dice.below(20_001) as f32 - 10_000.0) / 100.0).unwrap()
}

fn position(dice: &mut Dice) -> Position {
    Position::from_counts(dice.below(2_000_001) as i32 - 1_000_000).unwrap()
}
