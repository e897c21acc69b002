//! Frames and messages as data for `serde`: flat maps with the fields of `axle decode --json`.
//!
//! Plain bodies have theirs from the table of messages. The others are written by hand: a derive
//! would need a second set of types, and flattening copies every field.

use serde::{Serialize, Serializer, ser::SerializeMap};

use super::{
    body::{Biases, SetNetworkState, SetNetworkStateWide},
    frame::{Frame, RawFrame},
    message::Message,
    motor::RawMotorControl,
    report::Report,
    update::RawOtaRequest,
};
use crate::{map::Fields, text::Hex};

/// A map: `length`, `protocol`, `message`, `id`, `index`, the fields of the message, and `bytes`:
/// the whole frame in lower-case hex digits. The page `fields` describes each.
impl Serialize for Frame {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        self.as_map(serializer)
    }
}

impl Fields for Frame {
    fn put<M: SerializeMap>(&self, map: &mut M) -> Result<(), M::Error> {
        let (bytes, message) = (self.as_bytes(), self.message());
        map.serialize_entry("length", &bytes.len())?;
        map.serialize_entry("protocol", "ucp")?;
        map.serialize_entry("message", message.name())?;
        map.serialize_entry("id", &self.id())?;
        map.serialize_entry("index", &self.index())?;
        message.put_fields(map)?;
        map.serialize_entry("bytes", &Hex(bytes))
    }
}

/// A map: `message`, `id` and the fields of the message. The page `fields` describes each.
impl Serialize for Message<'_> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        self.as_map(serializer)
    }
}

impl Fields for Message<'_> {
    fn put<M: SerializeMap>(&self, map: &mut M) -> Result<(), M::Error> {
        map.serialize_entry("message", self.name())?;
        map.serialize_entry("id", &self.id())?;
        self.put_fields(map)
    }
}

impl Fields for RawFrame<'_> {
    fn put<M: SerializeMap>(&self, map: &mut M) -> Result<(), M::Error> {
        map.serialize_entry("body", &Hex(self.body))
    }
}

impl Fields for RawMotorControl {
    fn put<M: SerializeMap>(&self, map: &mut M) -> Result<(), M::Error> {
        map.serialize_entry("speed", &self.speed())?;
        map.serialize_entry("angular", &self.angular())?;
        map.serialize_entry("front_led", &self.front_led())?;
        map.serialize_entry("back_led", &self.back_led())?;
        map.serialize_entry("version", &self.version())?;
        map.serialize_entry("reserve1", &self.reserve1())?;
        map.serialize_entry("reserve2", &self.reserve2())
    }
}

impl Fields for Report<'_> {
    fn put<M: SerializeMap>(&self, map: &mut M) -> Result<(), M::Error> {
        let layout = match self {
            Self::Firmware(_) => "firmware",
            Self::Document(_) => "document",
        };
        let values = self.telemetry();
        map.serialize_entry("layout", layout)?;
        map.serialize_entry("battery_pct", &values.battery_pct)?;
        map.serialize_entry("rpm", &values.rpm)?;
        map.serialize_entry("acc", &values.acc)?;
        map.serialize_entry("gyro", &values.gyro)?;
        map.serialize_entry("mag", &values.mag)?;
        map.serialize_entry("heading", &values.heading_deg)?;
        map.serialize_entry("power_w", &values.power_w)?;
        map.serialize_entry("voltage_dv", &values.voltage_dv)?;
        map.serialize_entry("current_ca", &values.current_ca)?;
        match self.version() {
            Some(version) => map.serialize_entry("version", &version),
            None => Ok(()),
        }
    }
}

impl Fields for Biases {
    fn put<M: SerializeMap>(&self, map: &mut M) -> Result<(), M::Error> {
        map.serialize_entry("err", &self.err())?;
        map.serialize_entry("acc_bias", &self.imu().acc())?;
        map.serialize_entry("gyro_bias", &self.imu().gyro())?;
        map.serialize_entry("mag_bias", &self.mag().mag())
    }
}

impl Fields for RawOtaRequest {
    fn put<M: SerializeMap>(&self, map: &mut M) -> Result<(), M::Error> {
        map.serialize_entry("version", &self.version())
    }
}

impl Fields for SetNetworkState {
    fn put<M: SerializeMap>(&self, map: &mut M) -> Result<(), M::Error> {
        map.serialize_entry("state", &self.state())?;
        map.serialize_entry("state_width", &1)
    }
}

impl Fields for SetNetworkStateWide {
    fn put<M: SerializeMap>(&self, map: &mut M) -> Result<(), M::Error> {
        map.serialize_entry("state", &self.state())?;
        map.serialize_entry("state_width", &4)
    }
}
