//! A rover: commands, what its reports say, and what was lost.

use axlewire::ucp::Telemetry;

use super::{
    columns::Columns,
    errors::Errors,
    line::{Line, Numbers},
    picture::{Look, Panel, Series, Size},
};

/// What 1 is in the fields of a report; see the page `fields` of the library.
const G: f64 = Telemetry::ACC_PER_G as f64;
/// The same number as the library's, which as an `f32` is a little below 16.4.
const DEGREES_PER_SECOND: f64 = 16.4;
const _: () = assert!(DEGREES_PER_SECOND as f32 == Telemetry::GYRO_PER_DEG_PER_S);
const VOLT: f64 = 10.0;
const AMPERE: f64 = 100.0;

/// Time without a report after which the curves are interrupted (ruling U10), microseconds.
const LINK_TIMEOUT: u64 = 500_000;
/// Microseconds from one report to the next.
const REPORT_PERIOD: u64 = 20_000;

/// A larger step of the heading is one over north, degrees.
const HALF_TURN: f64 = 180.0;

const WHEELS: [&str; 4] = ["front left", "front right", "back left", "back right"];
const AXES: [&str; 3] = ["x", "y", "z"];

/// The curves of a rover.
#[derive(Debug)]
pub(super) struct Rover {
    command: Group,
    wheels: Group,
    heading: Group,
    acceleration: Group,
    turning: Group,
    field: Group,
    battery: Group,
    voltage: Group,
    current: Group,
    power: Group,
    errors: Errors,
    /// Index and place of the last report, of those sent and of the others: a sender has its own
    /// count (ruling U9).
    last: [Option<(u8, u64)>; 2],
}

/// A panel that fills.
#[derive(Debug)]
struct Group(Panel);

impl Group {
    fn new(
        (title, unit, size): (&'static str, &'static str, Size),
        look: Look,
        least: Option<(f64, f64)>,
        names: &[&str],
    ) -> Self {
        let is_named = names.len() > 1;
        let series = names.iter().enumerate().map(|(colour, name)| Series {
            name: if is_named { (*name).to_owned() } else { title.to_lowercase() },
            look,
            colour,
            is_named,
            columns: Columns::default(),
        });
        Self(Panel { title, unit, size, least, series: series.collect(), hint: "" })
    }

    /// The wheels of one side turn alike: those in front are wide and pale behind the others.
    fn with_wide_front(mut self) -> Self {
        for (number, series) in self.0.series.iter_mut().enumerate() {
            let is_front = number < 2;
            series.look = if is_front { Look::Wide } else { Look::Line };
            (series.colour, series.is_named) = (number % 2, !is_front);
        }
        self.0.hint = "wide and pale: front";
        self
    }

    fn cut(&mut self) {
        self.0.series.iter_mut().for_each(|series| series.columns.cut());
    }

    /// Takes in a value for each of its curves; `one` is what 1 of the unit is.
    fn put(&mut self, x: u64, values: &Numbers, one: f64) {
        for (series, value) in self.0.series.iter_mut().zip(values.all()) {
            series.columns.push(x, value / one);
        }
    }
}

impl Default for Rover {
    fn default() -> Self {
        use Look::{Line, Step};
        use Size::{Half, Low, Tall};
        let with_zero = Some((0.0, 0.0));
        Self {
            command: Group::new(("Command", "%", Low), Step, with_zero, &["speed", "steering"]),
            wheels: Group::new(("Wheel speed", "1/min", Tall), Line, with_zero, &WHEELS)
                .with_wide_front(),
            heading: Group::new(("Heading", "°", Half), Line, Some((0.0, 360.0)), &[""]),
            field: Group::new(("Magnetic field", "counts", Half), Line, None, &AXES),
            acceleration: Group::new(("Acceleration", "g", Half), Line, None, &AXES),
            turning: Group::new(("Angular velocity", "°/s", Half), Line, None, &AXES),
            battery: Group::new(("Battery", "%", Half), Line, Some((0.0, 100.0)), &[""]),
            voltage: Group::new(("Voltage", "V", Half), Line, None, &[""]),
            current: Group::new(("Current", "A", Half), Line, with_zero, &[""]),
            power: Group::new(("Power", "W", Half), Line, with_zero, &[""]),
            errors: Errors::default(),
            last: [None; 2],
        }
    }
}

impl Rover {
    /// Takes in a line; `has_times` says whether the places are times.
    pub(super) fn take(&mut self, line: &Line<'_>, x: u64, has_times: bool) {
        if line.event != "frame" {
            return self.errors.gap(line, x);
        }
        match line.message {
            "motor_control" => {
                let [command, steering] = [&line.speed, &line.angular];
                let both = command.beside(steering);
                self.command.put(x, &both, 1.0);
            }
            "report" => self.report(line, x, has_times),
            // What it means in the answer to an update is something else.
            "ota_ack" => {}
            _ if line.err.is_some_and(|err| err != 0) => self.errors.refused(x),
            _ => {}
        }
    }

    fn report(&mut self, line: &Line<'_>, x: u64, has_times: bool) {
        let [received, sent] = &mut self.last;
        let of_sender = if line.direction == Some("out") { sent } else { received };
        let last = line.index.and_then(|index| of_sender.replace((index, x)));
        if let (Some(index), Some((before, since))) = (line.index, last) {
            // The same one again: none is missing.
            let lost = index.wrapping_sub(before).saturating_sub(1);
            // The robot has started again if there was no time for so many.
            let is_plausible = match has_times {
                true => x.saturating_sub(since) >= u64::from(lost) * REPORT_PERIOD / 2,
                false => lost < 128,
            };
            self.errors.lost(if is_plausible { lost } else { 0 }, x);
            if has_times && x.saturating_sub(since) > LINK_TIMEOUT {
                self.measured().for_each(Group::cut);
            }
        }
        let before = self.heading.0.series.first().and_then(|series| series.columns.last());
        if let (Some(before), [now]) = (before, line.heading.all())
            && (now - before.y).abs() > HALF_TURN
        {
            self.heading.cut();
        }
        self.wheels.put(x, &line.rpm, 1.0);
        self.heading.put(x, &line.heading, 1.0);
        self.acceleration.put(x, &line.acc, G);
        self.turning.put(x, &line.gyro, DEGREES_PER_SECOND);
        self.field.put(x, &line.mag, 1.0);
        self.battery.put(x, &line.battery_pct, 1.0);
        self.voltage.put(x, &line.voltage_dv, VOLT);
        self.current.put(x, &line.current_ca, AMPERE);
        self.power.put(x, &line.power_w, 1.0);
    }

    /// All that reports fill.
    fn measured(&mut self) -> impl Iterator<Item = &mut Group> {
        let Self { wheels, heading, acceleration, turning, field, battery, .. } = self;
        let Self { voltage, current, power, .. } = self;
        [wheels, heading, acceleration, turning, field, battery, voltage, current, power]
            .into_iter()
    }

    /// The panels that have something to show.
    pub(super) fn panels(self) -> Vec<Panel> {
        let groups = [
            self.command,
            self.wheels,
            self.heading,
            self.turning,
            self.acceleration,
            self.field,
            self.battery,
            self.power,
            self.voltage,
            self.current,
        ];
        let mut panels: Vec<_> = groups.into_iter().map(|Group(panel)| panel).collect();
        panels.push(self.errors.panel());
        for panel in &mut panels {
            panel.series.retain(|series| !series.columns.is_empty());
        }
        panels.retain(|panel| !panel.series.is_empty());
        panels
    }
}
