//! Messages as text for people: names, units, and codes in words. Plain bodies print themselves.

use core::fmt;

use super::{
    body::{Biases, SetNetworkState, SetNetworkStateWide},
    frame::{Frame, RawFrame},
    message::Message,
    motor::RawMotorControl,
    report::{Report, Telemetry},
    update::RawOtaRequest,
    value::{List, Print, Value},
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
        self.0.print(&mut line, "");
        line.end()
    }
}

/// Name and contents.
impl fmt::Display for Message<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut line = Line::new(f);
        line.text(self.name());
        self.print(&mut line, ": ");
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
        message.print(&mut line, ": ");
        line.end()
    }
}

impl Print for RawFrame<'_> {
    fn print(&self, line: &mut Line<'_>, before: &'static str) {
        line.text(before);
        line.text("id ");
        line.integer(self.id.into(), 0);
        line.text(", body ");
        Hex(self.body).print(line);
    }
}

impl Print for RawOtaRequest {
    fn print(&self, line: &mut Line<'_>, before: &'static str) {
        List::new(line, before).value("version", self.version(), "");
    }
}

impl Print for SetNetworkState {
    fn print(&self, line: &mut Line<'_>, before: &'static str) {
        line.text(before);
        self.state().print(line);
        line.text(", in 1 byte");
    }
}

impl Print for SetNetworkStateWide {
    fn print(&self, line: &mut Line<'_>, before: &'static str) {
        line.text(before);
        self.state().print(line);
        line.text(", in 4 bytes");
    }
}

impl Print for Biases {
    fn print(&self, line: &mut Line<'_>, before: &'static str) {
        let (imu, mag) = (self.imu(), self.mag());
        List::new(line, before)
            .value("err", self.err(), "")
            .value("acc", imu.acc(), "")
            .value("gyro", imu.gyro(), "")
            .value("mag", mag.mag(), "");
    }
}

/// Always prints speed, turn and lamp; the other fields, 0 in an ordinary command, only if nonzero.
impl Print for RawMotorControl {
    fn print(&self, line: &mut Line<'_>, before: &'static str) {
        line.text(before);
        line.text("speed ");
        line.integer(self.speed().into(), 4);
        line.text(" %  angular ");
        line.integer(self.angular().into(), 4);
        line.text(" %  front led ");
        match self.front_led() {
            0 => line.text("off"),
            100 => line.text("on"),
            other => line.integer(other.into(), 0),
        }
        if self.back_led() != 0 {
            line.text("  back led ");
            line.integer(self.back_led().into(), 0);
        }
        let rest: [(&str, u32); 3] = [
            ("  version ", self.version().into()),
            ("  reserve1 ", self.reserve1().into()),
            ("  reserve2 ", self.reserve2()),
        ];
        for (name, value) in rest {
            if value != 0 {
                line.text(name);
                line.fixed::<0>(false, value, 0);
            }
        }
        if self.starts_update() {
            line.text("  (starts a firmware update)");
        }
    }
}

impl Print for Report<'_> {
    fn print(&self, line: &mut Line<'_>, before: &'static str) {
        line.text(before);
        let values = self.telemetry();
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
        match self.version() {
            Some(version) => {
                line.text("  firmware ");
                line.integer(version.into(), 0);
            }
            None => line.text("  (document layout)"),
        }
    }
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
