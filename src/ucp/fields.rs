//! The fields of all messages, as a table. Plain bodies have theirs from the table of messages; the
//! others are here, each field once: with `serde`, its value too.

use super::{
    body::*,
    catalogue::catalogue,
    codes::{ErrorCode, NetworkState},
    frame::RawFrame,
    header::{Header, MAX_LEN},
    message::Held,
    motor::RawMotorControl,
    report::{Report, Telemetry},
    update::RawOtaRequest,
    value::{Described, Layout},
};
use crate::{
    field::{Field, field},
    record::{BYTES, Record},
};
#[cfg(feature = "serde")]
use crate::{map::Fields, text::Hex};

/// The fields of a body: doc comment, key, type, unit, ruling, and the value in the body.
macro_rules! described {
    ($($body:ty, $it:ident {$(
        $(#[doc = $doc:literal])+
        $key:literal: $of:ty, $($unit:literal)? by $source:literal = $value:expr;
    )+})+) => {$(
        impl Described for $body {
            const LAYOUTS: &'static [Layout] = &[&[&[$(
                field! { $(#[doc = $doc])+ $key: $of, $($unit)? by $source }
            ),+]]];
        }

        #[cfg(feature = "serde")]
        impl Fields for $body {
            fn put<M: serde::ser::SerializeMap>(&self, map: &mut M) -> Result<(), M::Error> {
                let $it = self;
                $(map.serialize_entry($key, &$value)?;)+
                Ok(())
            }
        }
    )+};
}

described! {
    RawFrame<'_>, it {
        /// The body of a frame with an unknown id, or of a length that no message has.
        "body": &[u8], by "U3" = Hex(it.body);
    }

    RawMotorControl, it {
        /// Speed, positive forward; -100 to 100 from a correct sender.
        "speed": i16, "percent" by "U7" = it.speed();
        /// Turn of the steering wheel, positive to the right in the vendor firmware; -100 to 100
        /// from a correct sender.
        "angular": i16, "percent" by "U6, U7" = it.angular();
        /// Lamp: 100 on, 0 off.
        "front_led": i16, by "U7" = it.front_led();
        /// Reserved, 0.
        "back_led": i16, by "U7" = it.back_led();
        /// Reserved, 0; 39 to 32767 start a firmware update in a shipped robot.
        "version": u16, by "U7" = it.version();
        /// Reserved, 0.
        "reserve1": u16, by "U7" = it.reserve1();
        /// Reserved, 0.
        "reserve2": u32, by "U7" = it.reserve2();
    }

    Telemetry, it {
        /// Battery; invalid above 100.
        "battery_pct": u16, "percent" by "U5" = it.battery_pct;
        /// Wheel speeds: front left, front right, back left, back right.
        "rpm": [i16; 4], "1/min" by "U5" = it.rpm;
        /// Acceleration x, y, z.
        "acc": [i16; 3], "1/16384 g" by "U5" = it.acc;
        /// Angular velocity x, y, z.
        "gyro": [i16; 3], "1/16.4 °/s" by "U5" = it.gyro;
        /// Magnetic field x, y, z.
        "mag": [i16; 3], "sensor count" by "U5" = it.mag;
        /// Heading; 0 to 360 from a correct sender.
        "heading": i16, "°" by "U5" = it.heading_deg;
        /// Power, truncated.
        "power_w": u8, "W" by "U5" = it.power_w;
        /// Voltage, truncated.
        "voltage_dv": u8, "0.1 V" by "U5" = it.voltage_dv;
        /// Current; firmware 38 fills only the low byte, which wraps every 2.56 A.
        "current_ca": u16, "0.01 A" by "U5" = it.current_ca;
    }

    Biases, it {
        /// Normally 0; the vendor firmware ignores it.
        "err": ErrorCode, by "U12" = it.err();
        /// Bias of the accelerometer x, y, z.
        "acc_bias": [i16; 3], "1/16384 g" by "U11" = it.imu().acc();
        /// Bias of the gyroscope x, y, z.
        "gyro_bias": [i16; 3], "1/16.4 °/s" by "U11" = it.imu().gyro();
        /// Bias of the magnetometer x, y, z.
        "mag_bias": [i16; 3], "sensor count" by "U11" = it.mag().mag();
    }

    RawOtaRequest, it {
        /// Version of the firmware that is offered.
        "version": i16, by "U4" = it.version();
    }
}

const LAYOUT: Field = field! {
    /// Order of the fields on the wire: as the vendor firmware sends them, or as the document
    /// prints them.
    "layout": &str, by "U5"
};
const VERSION: Field = field! {
    /// Version of the robot's firmware; only in the layout `firmware`.
    "version": u16, by "U5"
};

impl Described for Report<'_> {
    const LAYOUTS: &'static [Layout] = &[
        &[&[LAYOUT.named(&["firmware"])], Telemetry::LAYOUTS[0][0], &[VERSION]],
        &[&[LAYOUT.named(&["document"])], Telemetry::LAYOUTS[0][0]],
    ];
}

#[cfg(feature = "serde")]
impl Fields for Report<'_> {
    fn put<M: serde::ser::SerializeMap>(&self, map: &mut M) -> Result<(), M::Error> {
        let layout = match self {
            Self::Firmware(_) => "firmware",
            Self::Document(_) => "document",
        };
        map.serialize_entry(LAYOUT.name, layout)?;
        self.telemetry().put(map)?;
        match self.version() {
            Some(version) => map.serialize_entry(VERSION.name, &version),
            None => Ok(()),
        }
    }
}

const STATE: Field = field! {
    /// State of the network.
    "state": NetworkState, by "U8"
};
const STATE_WIDTH: Field = field! {
    /// Width of the state on the wire.
    "state_width": u8, "byte" by "U8"
};

/// The two widths of a network state.
macro_rules! network_state {
    ($($body:ident: $of:ident, $width:literal;)+) => {$(
        impl Described for $body {
            const LAYOUTS: &'static [Layout] =
                &[&[&[STATE.of::<$of>(), STATE_WIDTH.within($width, $width)]]];
        }

        #[cfg(feature = "serde")]
        impl Fields for $body {
            fn put<M: serde::ser::SerializeMap>(&self, map: &mut M) -> Result<(), M::Error> {
                map.serialize_entry(STATE.name, &self.state())?;
                map.serialize_entry(STATE_WIDTH.name, &$width)
            }
        }
    )+};
}
network_state! { SetNetworkState: u8, 1; SetNetworkStateWide: u32, 4; }

/// A message of the table.
struct Entry {
    name: &'static str,
    id: u8,
    /// Lengths of its bodies, by layout.
    lengths: &'static [usize],
    layouts: &'static [Layout],
}

macro_rules! entries {
    ($(
        $(#[$id_doc:meta])*
        $id:ident = $number:literal {$(
            $(#[$doc:meta])*
            $direction:ident $name:literal $variant:ident($held:ty) $body:tt
        )+}
    )+) => {
        const ENTRIES: &[Entry] = &[$($({
            type Of<'a> = $held;
            let (lengths, layouts) = (<Of<'_> as Held<'_>>::LENGTHS, <Of<'_> as Described>::LAYOUTS);
            Entry { name: $name, id: $number, lengths, layouts }
        },)+)+];
    };
}
catalogue! { entries }

/// Bytes of a frame around its body.
const AROUND_BODY: usize = Header::LEN + 2;

/// A frame that is no message of the table.
const UNKNOWN: Record = record(("unknown", None), (AROUND_BODY, MAX_LEN), RawFrame::LAYOUTS[0]);

const fn record(
    message: (&'static str, Option<u8>),
    length: (usize, usize),
    own: Layout,
) -> Record {
    Record::frame("ucp", message, length, own, &[BYTES])
}

/// Each layout of each message, and last what is none of them.
pub(crate) const RECORDS: &[Record] = &records::<{ count(ENTRIES) + 1 }>();

const fn count(entries: &[Entry]) -> usize {
    match entries {
        [] => 0,
        [first, rest @ ..] => first.layouts.len() + count(rest),
    }
}

const fn records<const N: usize>() -> [Record; N] {
    let mut records = [UNKNOWN; N];
    let (mut entry, mut layout, mut at) = (0, 0, 0);
    while entry < ENTRIES.len() {
        let Entry { name, id, lengths, layouts } = ENTRIES[entry];
        if layout < layouts.len() {
            let len = lengths[layout] + AROUND_BODY;
            records[at] = record((name, Some(id)), (len, len), layouts[layout]);
            (layout, at) = (layout + 1, at + 1);
        } else {
            (entry, layout) = (entry + 1, 0);
        }
    }
    records
}

#[cfg(test)]
mod tests {
    use core::hint::black_box;

    use super::*;

    #[test]
    fn the_records_are_the_same_when_they_are_made_while_a_program_runs() {
        assert_eq!(count(black_box(ENTRIES)) + 1, RECORDS.len());
        assert_eq!(records::<{ count(ENTRIES) + 1 }>()[..], *RECORDS);
    }
}
