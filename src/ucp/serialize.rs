//! Frames and messages as data for `serde`: flat maps with the fields of `axle decode --json`.
//!
//! Written by hand: a derive would need a second set of types, and flattening copies every field.

use serde::{Serialize, Serializer, ser::SerializeMap};

use super::{
    frame::{Frame, RawFrame},
    message::Message,
    motor::RawMotorControl,
    report::Report,
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
        fields(&message, map)?;
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
        fields(self, map)
    }
}

fn fields<M: SerializeMap>(message: &Message<'_>, map: &mut M) -> Result<(), M::Error> {
    match message {
        Message::Ping(_) | Message::BiasRequest(_) => Ok(()),
        Message::Pong(body) => map.serialize_entry("err", &body.err()),
        Message::MotorControl(body) => motor_control(body, map),
        Message::CalibrationStart(body) => map.serialize_entry("type", &body.kind()),
        Message::CalibrationEnd(body) => map.serialize_entry("type", &body.kind()),
        Message::CalibrationStartAck(body) => {
            map.serialize_entry("type", &body.kind())?;
            map.serialize_entry("err", &body.err())
        }
        Message::CalibrationEndAck(body) => {
            map.serialize_entry("type", &body.kind())?;
            map.serialize_entry("err", &body.err())
        }
        Message::Report(body) => report(*body, map),
        Message::ImuBias(body) => {
            map.serialize_entry("acc_bias", &body.acc())?;
            map.serialize_entry("gyro_bias", &body.gyro())
        }
        Message::MagBias(body) => map.serialize_entry("mag_bias", &body.mag()),
        Message::ImuBiasAck(body) => map.serialize_entry("err", &body.err()),
        Message::MagBiasAck(body) => map.serialize_entry("err", &body.err()),
        Message::Biases(body) => {
            map.serialize_entry("err", &body.err())?;
            map.serialize_entry("acc_bias", &body.imu().acc())?;
            map.serialize_entry("gyro_bias", &body.imu().gyro())?;
            map.serialize_entry("mag_bias", &body.mag().mag())
        }
        Message::OtaRequest(body) => map.serialize_entry("version", &body.version()),
        Message::OtaAck(body) => map.serialize_entry("err", &body.status()),
        Message::SetNetworkState(body) => {
            map.serialize_entry("state", &body.state())?;
            map.serialize_entry("state_width", &1)
        }
        Message::SetNetworkStateWide(body) => {
            map.serialize_entry("state", &body.state())?;
            map.serialize_entry("state_width", &4)
        }
        Message::Unknown(RawFrame { body, .. }) => map.serialize_entry("body", &Hex(body)),
    }
}

fn motor_control<M: SerializeMap>(body: &RawMotorControl, map: &mut M) -> Result<(), M::Error> {
    map.serialize_entry("speed", &body.speed())?;
    map.serialize_entry("angular", &body.angular())?;
    map.serialize_entry("front_led", &body.front_led())?;
    map.serialize_entry("back_led", &body.back_led())?;
    map.serialize_entry("version", &body.version())?;
    map.serialize_entry("reserve1", &body.reserve1())?;
    map.serialize_entry("reserve2", &body.reserve2())
}

fn report<M: SerializeMap>(report: Report<'_>, map: &mut M) -> Result<(), M::Error> {
    let layout = match report {
        Report::Firmware(_) => "firmware",
        Report::Document(_) => "document",
    };
    let values = report.telemetry();
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
    match report.version() {
        Some(version) => map.serialize_entry("version", &version),
        None => Ok(()),
    }
}
