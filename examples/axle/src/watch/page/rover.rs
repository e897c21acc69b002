//! The values of a rover, the most important first.

use ratatui_core::{
    buffer::Buffer,
    layout::Rect,
    style::{Modifier, Style},
};

use super::{
    text::{fitting, millis, put, sparkline},
    view::{ALARM, DOUBT, FAINT, GOOD, PLAIN, View},
};
use crate::watch::model::{Link, Rover};

/// Width of the names.
const NAME_WIDTH: u16 = 9;

/// Pages from this width on have two columns.
const TWO_COLUMNS: u16 = 90;

/// Narrower pages have short names.
const NARROW: u16 = 40;

/// A line of the page: its name, long and short, and texts from long to short.
struct Line {
    name: [&'static str; 2],
    texts: Vec<String>,
    style: Style,
}

/// Draws the values; returns the number of rows.
pub(super) fn draw(view: &View, rover: &Rover, area: Rect, buffer: &mut Buffer) -> u16 {
    let lines = lines(view, rover);
    let is_wide = area.width >= TWO_COLUMNS;
    let per_column = if is_wide { lines.len().div_ceil(2) } else { lines.len() };
    let width = if is_wide { area.width / 2 } else { area.width };
    for (at, line) in lines.iter().enumerate() {
        let (column, row) = (at / per_column, at % per_column);
        let (x, y) = (area.x + column as u16 * width, area.y + row as u16);
        let [long, short] = line.name;
        let (name, name_width) = if width < NARROW { (short, 5) } else { (long, NAME_WIDTH) };
        put(buffer, area, x, y, name, FAINT);
        let text = fitting(&line.texts, width.saturating_sub(name_width + 1));
        put(buffer, area, x + name_width, y, &text, line.style);
    }
    (per_column as u16).min(area.height)
}

fn lines(view: &View, rover: &Rover) -> Vec<Line> {
    let (state, style) = match rover.link {
        Link::Unheard => ("not heard", DOUBT),
        Link::Up => ("up", GOOD),
        Link::Down => ("DOWN", ALARM),
    };
    let rate = rover.reports.per_second;
    let lost = rover.lost;
    let mut lines = vec![Line {
        name: ["link", "link"],
        texts: vec![
            format!("{state}, {rate:.0} reports/s, {lost} lost"),
            format!("{state}, {lost} lost"),
            state.to_owned(),
        ],
        style,
    }];
    let mut add = |name, style, texts| lines.push(Line { name, texts, style });
    let nothing = || vec!["-".to_owned()];
    add(["command", "cmd"], Style::new().add_modifier(Modifier::BOLD), command(rover));
    let Some(now) = rover.report else {
        add(["wheels", "rpm"], FAINT, nothing());
        return lines;
    };
    let [front_left, front_right, back_left, back_right] = now.rpm;
    let trend = sparkline(rover.trend.last(24), view.is_ascii);
    let wheels = format!("{front_left} {front_right} {back_left} {back_right}");
    let named = format!("front {front_left} {front_right}  back {back_left} {back_right} rpm");
    let pad = 32_usize.saturating_sub(named.len());
    add(["wheels", "rpm"], PLAIN, vec![format!("{named}{:pad$} {trend}", ""), named, wheels]);
    let battery = now
        .battery()
        .map_or_else(|| format!("invalid ({})", now.battery_pct), |percent| format!("{percent} %"));
    let is_low = now.battery().is_none_or(|percent| percent < 20);
    let style = if is_low { DOUBT } else { PLAIN };
    add(["battery", "batt"], style, vec![format!("{battery}, {:.1} V", now.volts()), battery]);
    let power = format!("{} W", now.power_w);
    add(["power", "pow"], PLAIN, vec![format!("{power}, {:.2} A", now.amperes()), power]);
    add(["heading", "head"], PLAIN, vec![format!("{} deg", now.heading_deg)]);
    let axes = |axes: [f32; 3], digits: usize, unit: &str| {
        let [x, y, z] = axes.map(|value| format!("{value:.digits$}"));
        vec![format!("x {x}  y {y}  z {z} {unit}"), format!("{x} {y} {z}")]
    };
    add(["accel.", "acc"], PLAIN, axes(now.acc_g(), 2, "g"));
    add(["gyro", "gyro"], PLAIN, axes(now.gyro_deg_per_s(), 1, "deg/s"));
    let [x, y, z] = now.mag;
    add(
        ["magnet.", "mag"],
        PLAIN,
        vec![format!("x {x}  y {y}  z {z} counts"), format!("{x} {y} {z}")],
    );
    let trip = rover.round_trip.map(|trip| format!(", {}", millis(trip))).unwrap_or_default();
    let (pings, pongs) = (rover.pings, rover.pongs);
    add(
        ["pings", "ping"],
        PLAIN,
        vec![format!("{pings}, {pongs} answered{trip}"), format!("{pongs}/{pings}")],
    );
    let text = |text: &Option<String>| vec![text.clone().unwrap_or_else(|| "-".to_owned())];
    add(["calibr.", "cal"], PLAIN, text(&rover.calibration));
    add(["network", "net"], PLAIN, text(&rover.network.map(|state| state.to_string())));
    add(["firmware", "fw"], PLAIN, text(&rover.firmware.map(|version| version.to_string())));
    lines
}

/// The last motor command; right and left as on shipped robots (ruling U6).
fn command(rover: &Rover) -> Vec<String> {
    let Some(command) = rover.command else {
        return vec!["none heard".to_owned(), "none".to_owned()];
    };
    let (speed, turn) = (command.speed, command.turn);
    let (side, letter) = match turn {
        0 => ("", ""),
        1.. => (" right", "R"),
        _ => (" left", "L"),
    };
    let lamp = if command.is_lamp_on { ", lamp on" } else { "" };
    let turn = turn.unsigned_abs();
    vec![
        format!("speed {speed} %, turn {turn} %{side}{lamp}  ({:.0}/s)", rover.commands.per_second),
        format!("speed {speed} %, turn {turn} %{side}{lamp}"),
        format!("speed {speed} %, turn {turn} %{side}"),
        format!("{speed} % {letter}{turn} %"),
        format!("{speed} {letter}{turn}"),
    ]
}
