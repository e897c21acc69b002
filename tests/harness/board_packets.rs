//! The packets of either kind of board, by what they say: for tests that are generic over boards.

use axlewire::{
    encode::Encode,
    ikeya::{
        NodeId, PositionResponse, Target, VelocityResponse, WriteRequest,
        board::{Board, OneMotor, ThreeMotors},
        three,
    },
};

pub(crate) trait BoardPackets: Board {
    /// A WRITE of this target.
    fn write(node: NodeId, target: Target<Self>) -> Vec<u8>;

    /// The answer of a node that measures this.
    fn answer(node: NodeId, measured: Target<Self>) -> Vec<u8>;
}

macro_rules! board_packets {
    ($board:ty, $write:ty, $velocity:ty, $position:ty) => {
        impl BoardPackets for $board {
            fn write(node: NodeId, target: Target<Self>) -> Vec<u8> {
                match target {
                    Target::Velocity(to) => bytes(&<$write>::velocity(node, to)),
                    Target::Position(to) => bytes(&<$write>::position(node, to)),
                }
            }

            fn answer(node: NodeId, measured: Target<Self>) -> Vec<u8> {
                match measured {
                    Target::Velocity(speed) => bytes(&<$velocity>::new(node, speed)),
                    Target::Position(place) => bytes(&<$position>::new(node, place)),
                }
            }
        }
    };
}

board_packets!(OneMotor, WriteRequest, VelocityResponse, PositionResponse);
board_packets!(ThreeMotors, three::WriteRequest, three::VelocityResponse, three::PositionResponse);

fn bytes(packet: &impl Encode) -> Vec<u8> {
    let mut buffer = [0; 16];
    packet.encode(&mut buffer).expect("a packet fits").to_vec()
}
