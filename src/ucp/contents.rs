//! Messages as text for people: names, units, and codes in words.

use core::fmt;

use super::{
    body::Biases,
    frame::{Frame, RawFrame},
    message::Message,
    motor::RawMotorControl,
    report::{Report, Telemetry},
};
use crate::text::{Hex, Line};

/// Contents of a message as text without its name, on one line, with units; empty for a message
/// without a body. From [`Message::contents`].
///
/// Numbers of a report have fixed widths, so that reports below each other form columns.
#[derive(Clone, Copy, Debug)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub struct Contents<'a>(Message<'a>);

impl<'a> Message<'a> {
    /// The contents as text without the name, for tables.
    ///
    /// ```
    /// use axlewire::ucp::{Body, Frame, Message, MotorControl};
    ///
    /// let sent = MotorControl::new(60, -20)?.frame(7);
    /// let frame = Frame::parse(sent.as_bytes())?;
    /// let contents = "speed   60 %  angular  -20 %  front led off";
    /// assert_eq!(frame.message().contents().to_string(), contents);
    /// assert_eq!(frame.message().to_string(), format!("motor_control: {contents}"));
    /// assert_eq!(frame.to_string(), format!("motor_control, index 7: {contents}"));
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    #[must_use]
    pub const fn contents(&self) -> Contents<'a> {
        Contents(*self)
    }
}

impl fmt::Display for Contents<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut line = Line::new(f);
        contents(&mut line, &self.0);
        line.end()
    }
}

/// Name and contents.
impl fmt::Display for Message<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut line = Line::new(f);
        line.text(self.name());
        behind_name(&mut line, self);
        line.end()
    }
}

/// Name, index and contents.
impl fmt::Display for Frame {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let message = self.message();
        let mut line = Line::new(f);
        line.text(message.name());
        line.text(", index ");
        line.integer(self.index().into(), 0);
        behind_name(&mut line, &message);
        line.end()
    }
}

fn behind_name(line: &mut Line<'_>, message: &Message<'_>) {
    if !matches!(message, Message::Ping(_) | Message::BiasRequest(_)) {
        line.text(": ");
        contents(line, message);
    }
}

fn contents(line: &mut Line<'_>, message: &Message<'_>) {
    match message {
        Message::Ping(_) | Message::BiasRequest(_) => {}
        Message::Pong(body) => body.err().print(line),
        Message::MotorControl(body) => motor_control(line, body),
        Message::CalibrationStart(body) => body.kind().print(line),
        Message::CalibrationEnd(body) => body.kind().print(line),
        Message::CalibrationStartAck(body) => {
            body.kind().print(line);
            line.text(", ");
            body.err().print(line);
        }
        Message::CalibrationEndAck(body) => {
            body.kind().print(line);
            line.text(", ");
            body.err().print(line);
        }
        Message::Report(body) => report(line, *body),
        Message::ImuBias(body) => imu(line, body.acc(), body.gyro()),
        Message::MagBias(body) => mag(line, body.mag()),
        Message::ImuBiasAck(body) => body.err().print(line),
        Message::MagBiasAck(body) => body.err().print(line),
        Message::Biases(body) => biases(line, body),
        Message::OtaRequest(body) => {
            line.text("version ");
            line.integer(body.version().into(), 0);
        }
        Message::OtaAck(body) => body.status().print(line),
        Message::SetNetworkState(body) => {
            body.state().print(line);
            line.text(", in 1 byte");
        }
        Message::SetNetworkStateWide(body) => {
            body.state().print(line);
            line.text(", in 4 bytes");
        }
        Message::Unknown(RawFrame { id, body, .. }) => {
            line.text("id ");
            line.integer((*id).into(), 0);
            line.text(", body ");
            Hex(body).print(line);
        }
    }
}

/// Always prints speed, turn and lamp; the other fields, 0 in an ordinary command, only if nonzero.
fn motor_control(line: &mut Line<'_>, body: &RawMotorControl) {
    line.text("speed ");
    line.integer(body.speed().into(), 4);
    line.text(" %  angular ");
    line.integer(body.angular().into(), 4);
    line.text(" %  front led ");
    match body.front_led() {
        0 => line.text("off"),
        100 => line.text("on"),
        other => line.integer(other.into(), 0),
    }
    if body.back_led() != 0 {
        line.text("  back led ");
        line.integer(body.back_led().into(), 0);
    }
    let rest: [(&str, u32); 3] = [
        ("  version ", body.version().into()),
        ("  reserve1 ", body.reserve1().into()),
        ("  reserve2 ", body.reserve2()),
    ];
    for (name, value) in rest {
        if value != 0 {
            line.text(name);
            line.fixed::<0>(false, value, 0);
        }
    }
    if body.starts_update() {
        line.text("  (starts a firmware update)");
    }
}

fn report(line: &mut Line<'_>, report: Report<'_>) {
    let values = report.telemetry();
    line.text("battery ");
    match values.battery() {
        Some(percent) => {
            line.integer(percent.into(), 3);
            line.text(" %");
        }
        None => {
            line.integer(values.battery_pct.into(), 0);
            line.text(" (no percentage)");
        }
    }
    line.text("  ");
    line.fixed::<1>(false, values.voltage_dv.into(), 4);
    line.text(" V  ");
    line.fixed::<2>(false, values.current_ca.into(), 5);
    line.text(" A  ");
    line.integer(values.power_w.into(), 3);
    line.text(" W  rpm ");
    line.spaced(values.rpm, |line, rpm| line.integer(rpm.into(), 4));
    line.text("  acc ");
    line.spaced(values.acc, acceleration);
    line.text(" g  gyro ");
    line.spaced(values.gyro, angular_velocity);
    line.text(" deg/s  mag ");
    line.spaced(values.mag, |line, mag| line.integer(mag.into(), 5));
    line.text("  heading ");
    line.integer(values.heading_deg.into(), 3);
    line.text(" deg");
    match report.version() {
        Some(version) => {
            line.text("  firmware ");
            line.integer(version.into(), 0);
        }
        None => line.text("  (document layout)"),
    }
}

fn imu(line: &mut Line<'_>, acc: [i16; 3], gyro: [i16; 3]) {
    line.text("acc ");
    line.spaced(acc, |line, acc| line.integer(acc.into(), 0));
    line.text(", gyro ");
    line.spaced(gyro, |line, gyro| line.integer(gyro.into(), 0));
}

fn mag(line: &mut Line<'_>, mag: [i16; 3]) {
    line.text("mag ");
    line.spaced(mag, |line, mag| line.integer(mag.into(), 0));
}

fn biases(line: &mut Line<'_>, body: &Biases) {
    body.err().print(line);
    line.text(", ");
    imu(line, body.imu().acc(), body.imu().gyro());
    line.text(", ");
    mag(line, body.mag().mag());
}

/// Raw acceleration in hundredths of g, rounded half to even as core rounds
/// [`Telemetry::acc_g`].
fn acceleration(line: &mut Line<'_>, raw: i16) {
    let (scaled, unit) = (u32::from(raw.unsigned_abs()) * 100, Telemetry::ACC_PER_G as u32);
    line.fixed::<2>(raw < 0, rounded(scaled, unit), 5);
}

/// Raw angular velocity in tenths of a degree per second; 164 is 10 degrees per second. The middle
/// between two tenths does not occur.
fn angular_velocity(line: &mut Line<'_>, raw: i16) {
    line.fixed::<1>(raw < 0, rounded(u32::from(raw.unsigned_abs()) * 100, 164), 6);
}

/// `scaled` / `unit`, rounded half to even.
const fn rounded(scaled: u32, unit: u32) -> u32 {
    let (floor, rest) = (scaled / unit, scaled % unit);
    if 2 * rest > unit || (2 * rest == unit && floor % 2 == 1) { floor + 1 } else { floor }
}
