//! Telemetry, robot to host every 20 ms: two layouts, one view (ruling U5).

use super::body::body;

body! {
    /// The report that the vendor firmware sends: 36 bytes, `len` 40.
    ///
    /// `battery: u16 | rpm: 4 × i16 | acc: 3 × i16 | gyro: 3 × i16 | mag: 3 × i16 | heading: i16 |
    /// power: u8 | voltage: u8 | current: u16 | version: u16`
    pub struct FirmwareReport(Report) {
        battery: [u8; 2],
        rpm: [[u8; 2]; 4],
        acc: [[u8; 2]; 3],
        gyro: [[u8; 2]; 3],
        mag: [[u8; 2]; 3],
        heading: [u8; 2],
        power: u8,
        voltage: u8,
        current: [u8; 2],
        version: [u8; 2]
    } => telemetry, version;

    /// The report as printed in the protocol document: 34 bytes, `len` 38. No known robot sends it.
    ///
    /// `battery: u16 | rpm: 4 × i16 | power: u8 | voltage: u8 | current: u16 | acc: 3 × i16 |
    /// gyro: 3 × i16 | mag: 3 × i16 | heading: i16`
    pub struct DocumentReport(Report) {
        battery: [u8; 2],
        rpm: [[u8; 2]; 4],
        power: u8,
        voltage: u8,
        current: [u8; 2],
        acc: [[u8; 2]; 3],
        gyro: [[u8; 2]; 3],
        mag: [[u8; 2]; 3],
        heading: [u8; 2]
    } => telemetry;
}

/// The values of a report: the layouts differ in the order of their fields, not in their names.
macro_rules! telemetry_of {
    ($report:expr) => {
        Telemetry {
            battery_pct: u16::from_le_bytes($report.battery),
            rpm: $report.rpm.map(i16::from_le_bytes),
            acc: $report.acc.map(i16::from_le_bytes),
            gyro: $report.gyro.map(i16::from_le_bytes),
            mag: $report.mag.map(i16::from_le_bytes),
            heading_deg: i16::from_le_bytes($report.heading),
            power_w: $report.power,
            voltage_dv: $report.voltage,
            current_ca: u16::from_le_bytes($report.current),
        }
    };
}

impl FirmwareReport {
    /// Creates a report of these values from a robot with firmware `version`.
    #[must_use]
    pub fn new(telemetry: &Telemetry, version: u16) -> Self {
        Self {
            battery: telemetry.battery_pct.to_le_bytes(),
            rpm: telemetry.rpm.map(i16::to_le_bytes),
            acc: telemetry.acc.map(i16::to_le_bytes),
            gyro: telemetry.gyro.map(i16::to_le_bytes),
            mag: telemetry.mag.map(i16::to_le_bytes),
            heading: telemetry.heading_deg.to_le_bytes(),
            power: telemetry.power_w,
            voltage: telemetry.voltage_dv,
            current: telemetry.current_ca.to_le_bytes(),
            version: version.to_le_bytes(),
        }
    }

    /// The values common to both layouts.
    #[inline]
    #[must_use]
    pub fn telemetry(&self) -> Telemetry {
        telemetry_of!(self)
    }

    /// Version of the robot's firmware.
    #[must_use]
    pub const fn version(&self) -> u16 {
        u16::from_le_bytes(self.version)
    }
}

impl DocumentReport {
    /// Creates a report of these values.
    #[must_use]
    pub fn new(telemetry: &Telemetry) -> Self {
        Self {
            battery: telemetry.battery_pct.to_le_bytes(),
            rpm: telemetry.rpm.map(i16::to_le_bytes),
            power: telemetry.power_w,
            voltage: telemetry.voltage_dv,
            current: telemetry.current_ca.to_le_bytes(),
            acc: telemetry.acc.map(i16::to_le_bytes),
            gyro: telemetry.gyro.map(i16::to_le_bytes),
            mag: telemetry.mag.map(i16::to_le_bytes),
            heading: telemetry.heading_deg.to_le_bytes(),
        }
    }

    /// The values common to both layouts.
    #[must_use]
    pub fn telemetry(&self) -> Telemetry {
        telemetry_of!(self)
    }
}

/// A report of either layout, distinguished by its length.
///
/// ```
/// use axlewire::ucp::{message::{FirmwareReport, Report}, Telemetry};
///
/// let sent = FirmwareReport::new(&Telemetry { voltage_dv: 119, ..Default::default() }, 38);
/// let report = Report::Firmware(&sent);
/// assert_eq!(report.telemetry().volts(), 11.9);
/// assert_eq!(report.version(), Some(38));
/// ```
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
pub enum Report<'a> {
    /// The layout that robots send.
    Firmware(&'a FirmwareReport),
    /// The layout in the document.
    Document(&'a DocumentReport),
}

impl Report<'_> {
    /// The values common to both layouts.
    #[must_use]
    pub fn telemetry(&self) -> Telemetry {
        match self {
            Self::Firmware(report) => report.telemetry(),
            Self::Document(report) => report.telemetry(),
        }
    }

    /// Version of the robot's firmware, if the layout has it.
    #[must_use]
    pub const fn version(&self) -> Option<u16> {
        match self {
            Self::Firmware(report) => Some(report.version()),
            Self::Document(_) => None,
        }
    }
}

/// The values of a report: raw integers as fields, SI units from methods.
#[derive(Clone, Copy, Debug, Default, Eq, Hash, PartialEq)]
#[cfg_attr(feature = "arbitrary", derive(arbitrary::Arbitrary))]
#[cfg_attr(feature = "defmt", derive(defmt::Format))]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Telemetry {
    /// Battery, percent; invalid above 100, see [`battery`](Self::battery).
    pub battery_pct: u16,
    /// Wheel speeds, rpm: front left, front right, back left, back right. The vendor firmware
    /// measures one wheel per side, and takes its sign from the command.
    pub rpm: [i16; 4],
    /// Acceleration x, y, z; 16384 is 1 g.
    pub acc: [i16; 3],
    /// Angular velocity x, y, z; 16.4 is 1 degree per second.
    pub gyro: [i16; 3],
    /// Magnetic field x, y, z, sensor counts: the wire does not say which sensor.
    pub mag: [i16; 3],
    /// Heading, degrees, 0..=360.
    pub heading_deg: i16,
    /// Power, watts, truncated.
    pub power_w: u8,
    /// Voltage, tenths of a volt, truncated.
    pub voltage_dv: u8,
    /// Current, hundredths of an ampere. Vendor firmware 38 fills only the low byte, so it wraps
    /// every 2.56 A.
    pub current_ca: u16,
}

impl Telemetry {
    /// Raw acceleration of 1 g.
    pub const ACC_PER_G: f32 = 16384.0;

    /// Raw angular velocity of 1 degree per second.
    pub const GYRO_PER_DEG_PER_S: f32 = 16.4;

    /// Battery, percent; `None` if the raw value is above 100, which is invalid.
    #[must_use]
    pub const fn battery(&self) -> Option<u8> {
        if self.battery_pct <= 100 { Some(self.battery_pct as u8) } else { None }
    }

    /// Voltage, volts.
    #[must_use]
    pub fn volts(&self) -> f32 {
        f32::from(self.voltage_dv) / 10.0
    }

    /// Current, amperes.
    #[must_use]
    pub fn amperes(&self) -> f32 {
        f32::from(self.current_ca) / 100.0
    }

    /// Acceleration x, y, z, in units of g.
    #[must_use]
    pub fn acc_g(&self) -> [f32; 3] {
        self.acc.map(|raw| f32::from(raw) / Self::ACC_PER_G)
    }

    /// Angular velocity x, y, z, degrees per second.
    #[must_use]
    pub fn gyro_deg_per_s(&self) -> [f32; 3] {
        self.gyro.map(|raw| f32::from(raw) / Self::GYRO_PER_DEG_PER_S)
    }
}
