//! The pictures of the README: pages of simulated lines, as SVG. `screenshots.sh` writes them anew;
//! a test checks that they show what the page looks like.

use std::{fmt::Write, fs, path::Path};

use axlewire::{
    endpoint::Endpoint,
    ikeya::{
        BothDirections, Master, Mode, NodeId, Position, Rps,
        master::{MasterConfig, NodeSet, Polling},
    },
    sim::{Line, MotorNode, RoverNode, Who},
    time::{Duration, Instant},
    ucp::{
        Host, MotorControl, Ucp,
        host::{HostConfig, MemoryStore},
        message::{ImuBias, MagBias, NetworkState},
        robot::RobotConfig,
    },
};
use ratatui_core::{backend::TestBackend, style::Color, terminal::Terminal};

use super::*;
use crate::{
    args::Protocol,
    watch::feed::{Feed, Source},
    watch::model::Heard,
};

/// Size of a cell, pixels.
const CELL: (usize, usize) = (8, 17);

const SIZE: (u16, u16) = (104, 26);

fn start() -> Instant {
    Instant::from_micros(0)
}

/// What a watcher hears of a line until now.
fn hear<F, H, T>(line: &Line<H, T>, protocol: Protocol) -> Model
where
    F: axlewire::stream::Framing,
    for<'a> F::Frame<'a>: Heard,
    H: Endpoint,
    T: Endpoint,
{
    let mut feed = Feed::<F>::new(Model::new(protocol), None);
    for traced in line.trace() {
        let at = traced.at.as_micros();
        // A host and a robot talk at the same time.
        let is_sent = protocol == Protocol::Ucp && traced.who == Who::Head;
        let source = if is_sent { Source::Sent } else { Source::Received };
        feed.take(source, &[traced.byte], at);
        feed.tick(at);
    }
    feed.tick(line.now().as_micros());
    feed.model
}

/// Eight nodes: six turn, two hold positions; node 5 is unplugged, and node 7 has a bad cable.
fn bus() -> Buffer {
    let mut config = MasterConfig::direct();
    config.nodes = NodeSet::ALL;
    config.polling = Polling::Every(Duration::from_millis(10));
    let mut line: Line<Master, MotorNode> = Line::new(500_000, 7, Master::new(config, start()));
    for node in NodeId::ALL {
        let mode = if node.get() % 4 == 3 { Mode::Position } else { Mode::Velocity };
        line.add(MotorNode::new(node, mode));
    }
    line.stub_mut(Who::Tail(6)).bit_errors = 4e-4;
    line.record();
    line.head_mut().discover(start());
    line.run_for(Duration::from_millis(500)).unwrap();
    for step in 0..24_u32 {
        let now = line.now();
        for node in NodeId::ALL {
            let phase = f64::from(step) * 0.45 + f64::from(node.get());
            let wave = phase.sin() * f64::from(node.get());
            let master = line.head_mut();
            // A node that does not answer takes no command.
            let _ = match master.mode(node) {
                Some(Mode::Position) => {
                    let turns = Position::from_revolutions(wave * 2.0).unwrap();
                    master.set_position(node, turns, now)
                }
                _ => master.set_velocity(node, Rps::new(wave as f32).unwrap(), now),
            };
        }
        if step == 16 {
            line.stub_mut(Who::Tail(4)).unplugged = true;
        }
        line.run_for(Duration::from_millis(500)).unwrap();
    }
    let model = hear::<BothDirections, _, _>(&line, Protocol::Ikeya);
    let title = "axle watch  /dev/ttyUSB0  ikeya  500000 bit/s".to_owned();
    picture(&View { title, baud: 500_000, ..View::default() }, &model)
}

/// A rover that drives a bend with its lamp on; some reports are lost.
fn rover() -> Buffer {
    let imu = ImuBias::new([12, -7, 90], [3, 1, -2]);
    let store = MemoryStore { imu: Some(imu), mag: Some(MagBias::new([5, 0, -9])) };
    let host = Host::with_store(HostConfig::default(), store, start());
    let mut line = Line::new(115_200, 3, host);
    line.add(RoverNode::new(RobotConfig::default(), start()));
    line.record();
    line.stub_mut(Who::Tail(0)).bit_errors = 1e-5;
    for step in 0..60_i16 {
        let now = line.now();
        let speed = (step * 3).min(60);
        let command = MotorControl::turn_right(speed, 20).unwrap().with_front_led(true);
        line.head_mut().drive(command, now).unwrap();
        if step == 5 {
            line.head_mut().set_network_state(NetworkState::Connected, now).unwrap();
        }
        line.run_for(Duration::from_millis(200)).unwrap();
    }
    let model = hear::<Ucp, _, _>(&line, Protocol::Ucp);
    let title = "axle drive  /dev/ttyUSB0  ucp  115200 bit/s".to_owned();
    picture(&View { title, baud: 115_200, role: Role::Moving, ..View::default() }, &model)
}

fn picture(view: &View, model: &Model) -> Buffer {
    let mut terminal = Terminal::new(TestBackend::new(SIZE.0, SIZE.1)).unwrap();
    terminal.draw(|frame| draw(view, model, frame.buffer_mut())).unwrap();
    terminal.backend().buffer().clone()
}

/// A picture of a terminal: one text per run of cells of one style.
fn svg(buffer: &Buffer) -> String {
    let (columns, rows) = (usize::from(buffer.area.width), usize::from(buffer.area.height));
    let (width, height) = ((columns + 2) * CELL.0, (rows + 1) * CELL.1);
    let mut text = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {width} {height}\" \
         width=\"{width}\" font-family=\"monospace\" font-size=\"13\">\n\
         <rect width=\"100%\" height=\"100%\" rx=\"6\" fill=\"#1c1f26\"/>\n"
    );
    for y in 0..buffer.area.height {
        let mut x = 0;
        while x < buffer.area.width {
            let style = buffer[(x, y)].style();
            let end = (x..buffer.area.width).find(|x| buffer[(*x, y)].style() != style);
            let end = end.unwrap_or(buffer.area.width);
            let run: String = (x..end).map(|x| buffer[(x, y)].symbol()).collect();
            let modifier = style.add_modifier;
            let (left, top) = ((usize::from(x) + 1) * CELL.0, usize::from(y) * CELL.1 + 8);
            let length = usize::from(end - x) * CELL.0;
            let mut colour = colour(style.fg);
            if modifier.contains(Modifier::REVERSED) {
                let height = CELL.1;
                let _ = writeln!(
                    text,
                    "<rect x=\"{left}\" y=\"{top}\" width=\"{length}\" height=\"{height}\" \
                     fill=\"{colour}\"/>"
                );
                colour = "#1c1f26";
            }
            if !run.trim().is_empty() {
                let weight =
                    if modifier.contains(Modifier::BOLD) { " font-weight=\"bold\"" } else { "" };
                let base = top + 13;
                let run = run.replace('&', "&amp;").replace('<', "&lt;");
                let _ = writeln!(
                    text,
                    "<text x=\"{left}\" y=\"{base}\" textLength=\"{length}\" fill=\"{colour}\"\
                     {weight} xml:space=\"preserve\">{run}</text>"
                );
            }
            x = end;
        }
    }
    text + "</svg>\n"
}

const fn colour(colour: Option<Color>) -> &'static str {
    match colour {
        Some(Color::Red) => "#ff6c6b",
        Some(Color::Green) => "#8fc379",
        Some(Color::Yellow) => "#e5c07b",
        Some(Color::DarkGray) => "#8a919e",
        _ => "#dcdfe4",
    }
}

fn shots() -> [(&'static str, String); 2] {
    [("bus.svg", svg(&bus())), ("rover.svg", svg(&rover()))]
}

fn path_of(name: &str) -> std::path::PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("screenshots").join(name)
}

#[test]
fn the_pictures_of_the_readme_show_what_the_page_looks_like() {
    for (name, picture) in shots() {
        let file = fs::read_to_string(path_of(name)).unwrap_or_default();
        assert!(file == picture, "{name} shows another page: run examples/axle/screenshots.sh");
    }
}

#[test]
#[ignore = "writes the pictures: examples/axle/screenshots.sh"]
fn write_the_pictures() {
    for (name, picture) in shots() {
        fs::write(path_of(name), picture).unwrap();
    }
}
