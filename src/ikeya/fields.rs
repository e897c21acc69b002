//! The fields of packets, as a table.

use super::{three, wire};
use crate::{
    field::{Field, field},
    record::{BYTES, Record},
};

pub(super) const NODE: Field = field! {
    /// The addressed or responding node.
    "node": u8, by "I1", within(1, 8)
};
pub(super) const RPS: Field = field! {
    /// Speed in revolutions per second.
    "rps": f32, "1/s" by "I4"
};
pub(super) const COUNT: Field = field! {
    /// Position within a turn; the whole position is `rotation` · 8192 + `count` counts.
    "count": i16, "1/8192 turn" by "I5"
};
pub(super) const ROTATION: Field = field! {
    /// Whole turns.
    "rotation": i16, "turn" by "I5"
};
pub(super) const PAYLOAD: Field = field! {
    /// The bytes that are both readings: they do not tell a speed from a position.
    "payload": &[u8], by "I3"
};
const MODE: Field = field! {
    /// The mode in which the node last answered, so the reading that counts; only in the tool's
    /// output, and once the node has answered.
    "mode": &str, by "I3", named(&["velocity", "position"]), optional(), of_tool()
};

/// The packets of one kind of board.
macro_rules! records {
    ($protocol:literal, $of:ident, $speed:ty, $integer:ty) => {{
        const SPEED: Field = RPS.of::<$speed>();
        const POSITION: [Field; 2] = [COUNT.of::<$integer>(), ROTATION.of::<$integer>()];
        const fn packet(
            name: &'static str,
            len: usize,
            own: &'static [&'static [Field]],
        ) -> Record {
            Record::frame($protocol, (name, None), (len, len), own, &[BYTES])
        }
        &[
            packet("read_request", wire::ReadRequest::LEN, &[&[NODE]]),
            Record::frame(
                $protocol,
                ("write", None),
                ($of::WriteRequest::LEN, $of::WriteRequest::LEN),
                &[&[NODE, SPEED], &POSITION, &[PAYLOAD]],
                &[BYTES, MODE],
            ),
            packet("velocity_response", $of::VelocityResponse::LEN, &[&[NODE, SPEED]]),
            packet("position_response", $of::PositionResponse::LEN, &[&[NODE], &POSITION]),
        ]
    }};
}
pub(crate) const ONE: &[Record] = records!("ikeya", wire, f32, i16);
pub(crate) const THREE: &[Record] = records!("ikeya-3", three, [f32; 3], [i16; 3]);
