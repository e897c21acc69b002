//! Arguments shared by several subcommands, and their validation.

use std::path::{Path, PathBuf};

use axlewire::{
    ikeya::{self, NodeId, Position, Rps},
    time::Duration,
    ucp::{self, MotorControl},
};
use clap::{
    ValueEnum,
    builder::{PathBufValueParser, RangedI64ValueParser, TypedValueParser},
};

/// The port of a subcommand.
#[derive(Debug, clap::Args)]
pub(crate) struct PortArgs {
    /// The serial port, such as /dev/ttyUSB0 or COM3; or tcp:HOST:PORT, a server that passes the
    /// bytes on as they are, such as ser2net's raw
    #[arg(short, long, value_name = "PATH")]
    pub(crate) port: String,

    /// Line speed, bit/s, at least 9600; by default 500000 for Ikeya and 115200 for UCP
    #[arg(short, long, value_parser = baud())]
    pub(crate) baud: Option<u32>,

    /// The port has no line speed, such as one of com0com: accept an answer that comes sooner than
    /// --baud allows. Pseudo-terminals and tcp: to this machine are known
    #[arg(long)]
    pub(crate) instant: bool,

    /// Record what is sent and received, as pcapng
    #[arg(long, value_name = "FILE", value_parser = recording())]
    pub(crate) record: Option<PathBuf>,
}

impl PortArgs {
    /// A port with this speed.
    #[cfg(test)]
    pub(crate) fn new(baud: Option<u32>) -> Self {
        Self { port: "played".to_owned(), baud, instant: false, record: None }
    }

    /// The line speed for this protocol, bit/s.
    pub(crate) fn baud_for(&self, protocol: Protocol) -> u32 {
        self.baud.unwrap_or(protocol.default_baud())
    }
}

/// A line speed. On slower ones a stop would take minutes.
pub(crate) fn baud() -> RangedI64ValueParser<u32> {
    clap::value_parser!(u32).range(9600..)
}

/// A file for a recording.
pub(crate) fn recording() -> impl TypedValueParser<Value = PathBuf> {
    PathBufValueParser::new().try_map(|path| match path == Path::new("-") {
        true => Err("standard output carries the lines of this subcommand: name a file"),
        false => Ok(path),
    })
}

/// Protocol of a line.
#[derive(Clone, Copy, Debug, Eq, PartialEq, ValueEnum)]
pub(crate) enum Protocol {
    /// Link between the Linux board and the robot of a rover
    Ucp,
    /// Motor bus, one motor per board
    Ikeya,
    /// Motor bus, three motors per board
    #[value(name = "ikeya-3")]
    Ikeya3,
}

impl Protocol {
    /// Its name on the command line and in JSON.
    pub(crate) const fn name(self) -> &'static str {
        match self {
            Self::Ucp => "ucp",
            Self::Ikeya => "ikeya",
            Self::Ikeya3 => "ikeya-3",
        }
    }

    /// The protocol of this name.
    pub(crate) fn named(name: &str) -> Option<Self> {
        Self::value_variants().iter().copied().find(|it| it.name() == name)
    }

    /// Default speed of its lines, bit/s.
    pub(crate) const fn default_baud(self) -> u32 {
        match self {
            Self::Ucp => ucp::BAUD,
            Self::Ikeya | Self::Ikeya3 => ikeya::BAUD,
        }
    }

    /// Column title of a frame's number.
    pub(crate) const fn number(self) -> &'static str {
        match self {
            Self::Ucp => "index",
            Self::Ikeya | Self::Ikeya3 => "node",
        }
    }
}

/// Protocol of a motor bus.
#[derive(Clone, Copy, Debug, Eq, PartialEq, ValueEnum)]
pub(crate) enum BusProtocol {
    /// One motor per board
    Ikeya,
    /// Three motors per board
    #[value(name = "ikeya-3")]
    Ikeya3,
}

/// A node id, 1 to 8.
pub(crate) fn node(text: &str) -> Result<NodeId, String> {
    let id: u8 = text.parse().map_err(|_| "a node id is a number within 1..=8".to_owned())?;
    NodeId::new(id).map_err(|error| error.to_string())
}

/// A finite speed (ruling I4).
pub(crate) fn rps(text: &str) -> Result<Rps, String> {
    let rps: f32 = text.parse().map_err(|_| "not a number".to_owned())?;
    Rps::new(rps).map_err(|error| error.to_string())
}

/// A speed limit, above 0.
pub(crate) fn max_rps(text: &str) -> Result<Rps, String> {
    let limit = rps(text)?;
    if limit.get() > 0.0 { Ok(limit) } else { Err("a limit must be above 0".to_owned()) }
}

/// A limit of a distance, above 0.
pub(crate) fn max_turns(text: &str) -> Result<f64, String> {
    let limit: f64 = text.parse().map_err(|_| "not a number".to_owned())?;
    if limit > 0.0 { Ok(limit) } else { Err("a limit must be above 0".to_owned()) }
}

/// A speed or a steering of a rover, percent (ruling U6).
pub(crate) fn percent() -> RangedI64ValueParser<i16> {
    let limit = i64::from(MotorControl::LIMIT);
    clap::value_parser!(i16).range(-limit..=limit)
}

/// A finite distance that fits on the wire (rulings I4, I5).
pub(crate) fn revolutions(text: &str) -> Result<Position, String> {
    let revolutions: f64 = text.parse().map_err(|_| "not a number".to_owned())?;
    Position::from_revolutions(revolutions).map_err(|error| error.to_string())
}

/// Longest accepted time, seconds: one day.
const LONGEST: f64 = 86_400.0;

/// A time in seconds, as microseconds.
pub(crate) fn seconds(text: &str) -> Result<u64, String> {
    let seconds: f64 = text.parse().map_err(|_| "not a number".to_owned())?;
    if !(0.0..=LONGEST).contains(&seconds) {
        return Err(format!("it is not within 0..={LONGEST} seconds"));
    }
    Ok((seconds * 1e6) as u64)
}

/// How long a motor may coast.
pub(crate) fn coast(text: &str) -> Result<Duration, String> {
    time_within(text, 0.0, 60.0)
}

/// A gap between packets: a stop waits for some dozens of them.
pub(crate) fn gap(text: &str) -> Result<Duration, String> {
    time_within(text, 0.0, 0.02)
}

/// A time from `least` to `most` seconds.
pub(crate) fn time_within(text: &str, least: f64, most: f64) -> Result<Duration, String> {
    let seconds: f64 = text.parse().map_err(|_| "not a number".to_owned())?;
    match (least..=most).contains(&seconds) {
        true => Ok(Duration::from_micros((seconds * 1e6) as u32)),
        false => Err(format!("it is not within {least}..={most} seconds")),
    }
}

/// A probability.
#[cfg(unix)]
pub(crate) fn rate(text: &str) -> Result<f64, String> {
    let rate: f64 = text.parse().map_err(|_| "not a number".to_owned())?;
    if (0.0..=1.0).contains(&rate) { Ok(rate) } else { Err("it is not within 0..=1".to_owned()) }
}

/// A byte in two hex digits, with or without 0x.
#[cfg(unix)]
pub(crate) fn hex_byte(text: &str) -> Result<u8, String> {
    let digits = text.strip_prefix("0x").unwrap_or(text);
    let is_hex = digits.len() == 2 && digits.bytes().all(|digit| digit.is_ascii_hexdigit());
    let byte = is_hex.then(|| u8::from_str_radix(digits, 16).ok()).flatten();
    byte.ok_or("expected two hex digits, such as ff".to_owned())
}

#[cfg(test)]
mod tests;
