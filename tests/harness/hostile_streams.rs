//! Hostile streams: everything that lines have been seen to do, in any mixture.

use axlewire::{
    encode::Encode,
    ikeya::{self, NodeId, Position, Rps, three},
    ucp::{self, Body, message::ErrorCode},
};
use proptest::{collection::vec, prelude::*, sample::Index, strategy::Union};

use super::{
    checked_line::Op,
    oracle::{self, Rules},
};

/// A stream of whole, damaged and nested frames, false headers and noise; then damaged as a whole.
pub(crate) fn stream(rules: Rules) -> impl Strategy<Value = Vec<u8>> {
    (vec(piece(rules), 0..10), vec(damage(), 0..4)).prop_map(|(pieces, damages)| {
        damages.into_iter().fold(pieces.concat(), |stream, damage| damage.done_to(stream))
    })
}

/// A user's actions on a decoder, in any order.
pub(crate) fn ops() -> impl Strategy<Value = Vec<Op>> {
    let op = prop_oneof![
        4 => (0..80_usize).prop_map(Op::Slice),
        2 => (0..80_usize, 0..4_usize).prop_map(|(len, events)| Op::Stop { len, events }),
        4 => (0..80_usize).prop_map(Op::Commit),
        2 => (0..80_usize).prop_map(Op::Push),
        2 => Just(Op::Drain),
        2 => Just(Op::Idle),
    ];
    vec(op, 1..12)
}

fn piece(rules: Rules) -> BoxedStrategy<Vec<u8>> {
    prop_oneof![
        6 => frame(rules),
        2 => (frame(rules), any::<Index>()).prop_map(|(mut frame, at)| {
            frame.truncate(at.index(frame.len()));
            frame
        }),
        2 => (frame(rules), damage()).prop_map(|(frame, damage)| damage.done_to(frame)),
        2 => nest(rules),
        1 => (nest(rules), damage()).prop_map(|(frame, damage)| damage.done_to(frame)),
        2 => false_header(rules),
        2 => vec(treacherous_byte(rules), 0..24),
    ]
    .boxed()
}

/// Whole frames, most of them of a kind that `rules` accept.
pub(crate) fn frame(rules: Rules) -> BoxedStrategy<Vec<u8>> {
    match rules {
        Rules::Ikeya { long: 8, .. } => ikeya_frame().boxed(),
        Rules::Ikeya { .. } => three_frame().boxed(),
        Rules::Ucp { .. } => ucp_frame().boxed(),
    }
}

fn encoded(packet: &impl Encode) -> Vec<u8> {
    let mut buffer = [0; 256];
    packet.encode(&mut buffer).unwrap().to_vec()
}

fn node() -> impl Strategy<Value = NodeId> {
    (1..=8_u8).prop_map(|id| NodeId::new(id).unwrap())
}

fn rps() -> impl Strategy<Value = Rps> {
    (-100.0..100.0_f32).prop_map(|rps| Rps::new(rps).unwrap())
}

fn position() -> impl Strategy<Value = Position> {
    any::<(i16, i16)>().prop_map(|(count, rotation)| Position::new(count, rotation))
}

fn ikeya_frame() -> impl Strategy<Value = Vec<u8>> {
    (0..5, node(), rps(), position()).prop_map(|(kind, id, rps, position)| match kind {
        0 => encoded(&ikeya::ReadRequest::new(id)),
        1 => encoded(&ikeya::WriteRequest::velocity(id, rps)),
        2 => encoded(&ikeya::WriteRequest::position(id, position)),
        3 => encoded(&ikeya::VelocityResponse::new(id, rps)),
        _ => encoded(&ikeya::PositionResponse::new(id, position)),
    })
}

fn three_frame() -> impl Strategy<Value = Vec<u8>> {
    let (speeds, positions) = ([rps(), rps(), rps()], [position(), position(), position()]);
    (0..5, node(), speeds, positions).prop_map(|(kind, id, speeds, positions)| match kind {
        0 => encoded(&three::ReadRequest::new(id)),
        1 => encoded(&three::WriteRequest::velocity(id, speeds)),
        2 => encoded(&three::WriteRequest::position(id, positions)),
        3 => encoded(&three::VelocityResponse::new(id, speeds)),
        _ => encoded(&three::PositionResponse::new(id, positions)),
    })
}

fn ucp_frame() -> impl Strategy<Value = Vec<u8>> {
    let known = (0..6, any::<u8>(), -100..=100_i16).prop_map(|(kind, index, value)| match kind {
        0 => encoded(&ucp::message::Ping {}.frame(index)),
        1 => encoded(&ucp::message::Pong::new(ErrorCode::Fine).frame(index)),
        2 => encoded(&ucp::MotorControl::new(value, -value).unwrap().frame(index)),
        3 => encoded(&ucp::message::MagBias::new([value; 3]).frame(index)),
        4 => encoded(&ucp::message::BiasRequest {}.frame(index)),
        _ => {
            let telemetry = ucp::Telemetry { rpm: [value; 4], ..Default::default() };
            encoded(&ucp::message::FirmwareReport::new(&telemetry, 38).frame(index))
        }
    });
    // Without the encoder, which refuses FD FF in a body.
    let foreign =
        (0x0B..=255_u8, any::<u8>(), vec(any::<u8>(), 0..=56)).prop_map(|(id, index, body)| {
            let mut frame = ucp_frame_around(id, &body);
            frame[5] = index;
            oracle::seal(&mut frame);
            frame
        });
    // Longer than anything the library sends, but within what a chosen cap may accept.
    let long = vec(any::<u8>(), 57..=255).prop_map(|body| ucp_frame_around(0x20, &body));
    prop_oneof![6 => known, 3 => foreign, 1 => long]
}

/// A UCP frame that the library itself might refuse to create.
pub(crate) fn ucp_frame_around(id: u8, body: &[u8]) -> Vec<u8> {
    let len = (body.len() as u16 + 4).to_le_bytes();
    let mut frame = [&[0xFD, 0xFF, len[0], len[1], id, 0], body, &[0, 0]].concat();
    oracle::seal(&mut frame);
    frame
}

/// A packet with a good CRC and any id around `payload`, which determines its length.
pub(crate) fn ikeya_packet_around(header: u8, id: u8, payload: &[u8]) -> Vec<u8> {
    let mut packet = [&[header, id], payload, &[0, 0]].concat();
    oracle::seal(&mut packet);
    packet
}

/// A good frame, or a good packet with a bad id, whose payload holds frames.
fn nest(rules: Rules) -> BoxedStrategy<Vec<u8>> {
    match rules {
        Rules::Ikeya { long, .. } => {
            let header = prop::sample::select(vec![0xBB, 0x55, 0x56]);
            let id = prop_oneof![1..=8_u8, any::<u8>()];
            (header, id, vec(frame(rules), 1..4), any::<Index>())
                .prop_map(move |(header, id, inner, at)| {
                    // Any window of the contents: whole READs, and halves of longer packets.
                    let mut inner = inner.concat();
                    inner.extend([0; 16]);
                    let at = at.index(inner.len() - (long - 4));
                    ikeya_packet_around(header, id, &inner[at..at + long - 4])
                })
                .boxed()
        }
        Rules::Ucp { .. } => (any::<u8>(), vec(ucp_frame(), 1..4), any::<Index>())
            .prop_map(|(id, inner, end)| {
                let mut inner = inner.concat();
                inner.truncate(8 + end.index(200));
                ucp_frame_around(id, &inner)
            })
            .boxed(),
    }
}

/// A header that announces a frame which does not come.
fn false_header(rules: Rules) -> BoxedStrategy<Vec<u8>> {
    match rules {
        Rules::Ikeya { .. } => {
            vec(prop::sample::select(vec![0xAA, 0xBB, 0x55, 0x56]), 1..4).boxed()
        }
        Rules::Ucp { .. } => {
            let len = prop_oneof![
                4..=60_u16,
                prop::sample::select(vec![0, 3, 4, 60, 61, 252, 253, 255, 256, 260, 0x0400]),
                any::<u16>(),
            ];
            (len, 1..=4_usize)
                .prop_map(|(len, cut)| {
                    let len = len.to_le_bytes();
                    [0xFD, 0xFF, len[0], len[1]][..cut].to_vec()
                })
                .boxed()
        }
    }
}

/// Noise that looks like a header more often than by chance.
fn treacherous_byte(rules: Rules) -> Union<BoxedStrategy<u8>> {
    let headers = match rules {
        Rules::Ikeya { .. } => vec![0xAA, 0xBB, 0x55, 0x56, 0x01, 0x09],
        Rules::Ucp { .. } => vec![0xFD, 0xFD, 0xFF, 0x04, 0x00, 0x3C],
    };
    Union::new([any::<u8>().boxed(), prop::sample::select(headers).boxed()])
}

/// The faults of a line.
#[derive(Clone, Debug)]
enum Damage {
    Flip(Index, u8),
    Insert(Index, u8),
    Delete(Index),
}

fn damage() -> impl Strategy<Value = Damage> {
    prop_oneof![
        (any::<Index>(), 0..8_u8).prop_map(|(at, bit)| Damage::Flip(at, bit)),
        (any::<Index>(), any::<u8>()).prop_map(|(at, byte)| Damage::Insert(at, byte)),
        any::<Index>().prop_map(Damage::Delete),
    ]
}

impl Damage {
    fn done_to(self, mut bytes: Vec<u8>) -> Vec<u8> {
        match self {
            Self::Insert(at, byte) => bytes.insert(at.index(bytes.len() + 1), byte),
            _ if bytes.is_empty() => {}
            Self::Flip(at, bit) => {
                let at = at.index(bytes.len());
                bytes[at] ^= 1 << bit;
            }
            Self::Delete(at) => {
                bytes.remove(at.index(bytes.len()));
            }
        }
        bytes
    }
}
