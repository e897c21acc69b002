//! From a capture to a picture.

use std::time::{Duration, SystemTime};

use super::{
    bus::Bus,
    line::Line,
    options::Args,
    picture::{Axis, Panel, Picture},
    rover::Rover,
};
use crate::{
    args::Protocol,
    beside,
    captures::named,
    decode::{self, Sheet, Walked},
    failure::Failure,
    input::Input,
    listing::Style,
    signals::Signals,
};

/// Bits of a byte on the line, with start and stop bit.
const BITS: f64 = 10.0;

/// Reads the capture of these arguments, as far as it can be read.
pub(super) fn picture(
    args: &Args,
    mut input: Input,
    signals: &Signals,
) -> Result<(Picture, Walked), Failure> {
    let chosen = decode::choose(&mut input, args.protocol.0)?;
    let mut sheet = Sheet::new(Some(Style::Json));
    let mut reading = Reading::new(args);
    let walked = chosen.walk(&mut input, &mut sheet, |next, sheet| {
        if signals.is_raised() {
            return Err(beside::interrupted());
        }
        reading.lines(sheet)?;
        reading.is_next(next.protocol, next.interface)
    })?;
    reading.lines(&mut sheet)?;
    Ok((reading.finish()?, walked))
}

/// What was read so far.
struct Reading<'a> {
    args: &'a Args,
    /// The line that is drawn: protocol and interface.
    line: Option<(Protocol, Option<usize>)>,
    /// Whether the capture has times: any frame or gap so far.
    has_times: Option<bool>,
    curves: Option<Curves>,
    frames: u64,
    /// First and last place.
    reach: Option<(u64, u64)>,
    /// All frames and gaps.
    taken: u64,
    /// Frames and gaps without a time in a capture with times.
    timeless: u64,
}

enum Curves {
    Bus(Box<Bus>),
    Rover(Box<Rover>),
}

impl Curves {
    fn of(protocol: Protocol) -> Self {
        match protocol {
            Protocol::Ucp => Self::Rover(Box::default()),
            Protocol::Ikeya => Self::Bus(Box::new(Bus::new(false))),
            Protocol::Ikeya3 => Self::Bus(Box::new(Bus::new(true))),
        }
    }
}

impl<'a> Reading<'a> {
    const fn new(args: &'a Args) -> Self {
        let (line, has_times, curves, reach) = (None, None, None, None);
        Self { args, line, has_times, curves, frames: 0, reach, taken: 0, timeless: 0 }
    }

    /// What follows is of this line.
    fn is_next(&mut self, protocol: Protocol, interface: Option<usize>) -> Result<(), Failure> {
        if self.args.interface.is_some_and(|wanted| interface.is_some_and(|it| it != wanted)) {
            return Ok(());
        }
        if *self.line.get_or_insert((protocol, interface)) != (protocol, interface) {
            let line = "the capture has more than one line: choose one with --interface";
            return Err(Failure::Failed(line.to_owned()));
        }
        self.curves.get_or_insert_with(|| Curves::of(protocol));
        Ok(())
    }

    /// With times, and without what was drawn without them.
    fn begin_anew(&mut self) {
        self.timeless = self.taken - 1;
        (self.has_times, self.frames, self.reach) = (Some(true), 0, None);
        self.curves = self.line.map(|(protocol, _)| Curves::of(protocol));
    }

    /// Takes in the lines of a sheet, and empties it.
    fn lines(&mut self, sheet: &mut Sheet) -> Result<(), Failure> {
        for line in sheet.out.0.split(|byte| *byte == b'\n').filter(|line| !line.is_empty()) {
            let line: Line<'_> = serde_json::from_slice(line).map_err(|error| {
                Failure::Failed(format!("the tool has a bug: a line of its own is odd: {error}"))
            })?;
            self.take(&line);
        }
        sheet.out.0.clear();
        Ok(())
    }

    fn take(&mut self, line: &Line<'_>) {
        let Some((_, interface)) = self.line else { return };
        if line.interface != interface {
            return;
        }
        self.taken += 1;
        if self.has_times == Some(false) && line.t.is_some() {
            // Those in front of it have none.
            self.begin_anew();
        }
        let has_times = *self.has_times.get_or_insert(line.t.is_some());
        let x = match (has_times, line.t) {
            // Microseconds, of which a double has room for some hundred years.
            (true, Some(seconds)) => (seconds * 1e6).round() as u64,
            (true, None) => {
                self.timeless += 1;
                return;
            }
            (false, _) => line.offset,
        };
        let (first, last) = self.reach.unwrap_or((x, x));
        self.reach = Some((first.min(x), last.max(x)));
        self.frames += u64::from(line.event == "frame");
        match &mut self.curves {
            Some(Curves::Bus(bus)) => bus.take(line, x, has_times),
            Some(Curves::Rover(rover)) => rover.take(line, x, has_times),
            None => {}
        }
    }

    fn finish(self) -> Result<Picture, Failure> {
        let failed = |line| Err(Failure::Failed(line));
        let (Some((protocol, _)), Some(curves), Some(reach)) = (self.line, self.curves, self.reach)
        else {
            return failed(format!("{} has nothing on that interface", named(&self.args.files)));
        };
        let name = protocol.name();
        let axis = axis(self.has_times == Some(true), self.args.baud, reach);
        let mut notes = match &curves {
            Curves::Bus(bus) => bus.notes(),
            Curves::Rover(_) => vec![],
        };
        match self.timeless {
            0 => {}
            1 => notes.push("1 frame or gap without a time: not drawn".to_owned()),
            count => notes.push(format!("{count} frames and gaps without a time: not drawn")),
        }
        let panels = match curves {
            Curves::Bus(bus) => bus.panels(),
            Curves::Rover(rover) => rover.panels(),
        };
        if panels.is_empty() {
            return failed(format!("no {name} frame of this capture has a value to draw"));
        }
        notes.extend(reduced(&panels, &axis));
        let files = self.args.files.iter().map(|file| {
            let name = file.file_name().unwrap_or(file.as_os_str()).to_string_lossy();
            printable(&name).to_string()
        });
        let files = files.collect::<Vec<_>>().join(", ");
        let title = format!("{files}  ·  {name}  ·  {} frames", self.frames);
        Ok(Picture { title, axis, panels, notes })
    }
}

/// The axis of a capture with these first and last places.
fn axis(has_times: bool, baud: Option<u32>, (first, last): (u64, u64)) -> Axis {
    let (title, unit, origin, per_unit) = match baud.filter(|_| !has_times) {
        _ if has_times => (format!("time, s, from {}", date(first)), "s", first, 1e6),
        Some(baud) => {
            let title = format!("time on the line at {baud} bit/s, s, without pauses");
            (title, "s", 0, f64::from(baud) / BITS)
        }
        None => ("byte offset: the capture has no times".to_owned(), "bytes", 0, 1.0),
    };
    Axis { title, unit, origin, per_unit, end: last }
}

/// Date and time of day.
fn date(micros: u64) -> String {
    let time = SystemTime::UNIX_EPOCH.checked_add(Duration::from_micros(micros));
    // The year 10000 has no date there.
    match time.filter(|_| micros < 253_402_300_800 * 1_000_000) {
        Some(time) => {
            let text = humantime::format_rfc3339_millis(time).to_string();
            text.replace('T', " ").replace('Z', " UTC")
        }
        None => format!("{} s", micros / 1_000_000),
    }
}

/// A note on what was left out.
fn reduced(panels: &[Panel], axis: &Axis) -> Option<String> {
    let series = panels.iter().flat_map(|panel| &panel.series);
    let widest = series.map(|series| series.columns.width()).max().filter(|width| *width > 1)?;
    let width = widest as f64 / axis.per_unit;
    let width = match axis.unit {
        "s" => format!("{:.3} ms", width * 1e3),
        unit => format!("{width} {unit}"),
    };
    Some(format!("first, lowest, highest and last value of each {width} at most"))
}

/// Text without control characters, and without those that XML has no place for.
fn printable(text: &str) -> String {
    let is_bad = |char: char| char.is_control() || matches!(char, '\u{FFFE}' | '\u{FFFF}');
    text.chars().map(|char| if is_bad(char) { '\u{FFFD}' } else { char }).collect()
}
