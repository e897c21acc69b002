//! Pages of many sizes, from traffic that is known.

use axlewire::{
    encode::Encode,
    ikeya::{
        self, NodeId, Position, PositionResponse, ReadRequest, Rps, VelocityResponse, WriteRequest,
        three,
    },
    ucp::{self, Body, MotorControl, RawFrame, Telemetry},
};
use ratatui_core::{backend::TestBackend, style::Color, terminal::Terminal};

use super::*;
use crate::{
    args::Protocol,
    watch::feed::{Feed, Source},
};

const SIZES: [(u16, u16); 12] = [
    (80, 24),
    (120, 40),
    (20, 5),
    (20, 1),
    (20, 2),
    (1, 1),
    (1, 40),
    (2, 3),
    (3, 6),
    (300, 3),
    (500, 500),
    (0, 0),
];

/// A page, through the backend that ratatui has for tests.
fn picture(view: &View, model: &Model, (width, height): (u16, u16)) -> Buffer {
    let mut terminal = Terminal::new(TestBackend::new(width, height)).unwrap();
    terminal.draw(|frame| draw(view, model, frame.buffer_mut())).unwrap();
    terminal.backend().buffer().clone()
}

/// The rows of a page.
fn drawn(view: &View, model: &Model, (width, height): (u16, u16)) -> Vec<String> {
    let buffer = picture(view, model, (width, height));
    let row = |y| (0..width).map(|x| buffer[(x, y)].symbol()).collect::<String>();
    (0..height).map(|y| row(y).trim_end().to_owned()).collect()
}

fn view() -> View {
    let title = "axle watch  /dev/ttyUSB0  ikeya  500000 bit/s".to_owned();
    View { title, baud: 500_000, ..View::default() }
}

/// A bus on which node 1 turns, node 2 has stopped answering and node 3 holds a position.
fn bus() -> Model {
    let mut feed = Feed::<ikeya::BothDirections>::new(Model::new(Protocol::Ikeya), None);
    let mut at = 0;
    let mut say = |bytes: &[u8], pause| {
        at += pause;
        feed.take(Source::Received, bytes, at);
        feed.tick(at);
    };
    let (n1, n2, n3) = (NodeId::N1, NodeId::N2, NodeId::N3);
    let position = Position::from_counts(-12_288).unwrap();
    for round in 0..100_u8 {
        let rps = Rps::new(f32::from(round) / 10.0).unwrap();
        say(WriteRequest::velocity(n1, Rps::new(10.0).unwrap()).as_bytes(), 8000);
        say(ReadRequest::new(n1).as_bytes(), 1000);
        say(VelocityResponse::new(n1, rps).as_bytes(), 1500);
        say(ReadRequest::new(n2).as_bytes(), 4500);
        if round < 50 {
            say(VelocityResponse::new(n2, Rps::new(-2.5).unwrap()).as_bytes(), 500);
        }
        say(ReadRequest::new(n3).as_bytes(), 4000);
        if round % 10 == 0 {
            say(&[0x55, 3, 9], 100);
        }
        say(PositionResponse::new(n3, position).as_bytes(), 400);
    }
    feed.model
}

fn rover() -> Model {
    let mut feed = Feed::<ucp::Ucp>::new(Model::new(Protocol::Ucp), None);
    let telemetry = Telemetry {
        battery_pct: 87,
        rpm: [81, 39, 80, 40],
        acc: [0, 0, 16384],
        heading_deg: 123,
        voltage_dv: 121,
        current_ca: 80,
        power_w: 9,
        ..Telemetry::default()
    };
    for index in 0..100_u8 {
        let at = u64::from(index) * 20_000;
        // Two are lost.
        if ![10, 11].contains(&index) {
            let report = ucp::message::FirmwareReport::new(&telemetry, 38).frame(index);
            feed.take(Source::Received, report.as_bytes(), at);
        }
        if index % 5 == 0 {
            let command = MotorControl::turn_right(60, 50).unwrap().with_front_led(true);
            feed.take(Source::Sent, command.frame(index).as_bytes(), at);
        }
        feed.tick(at);
    }
    feed.model
}

#[test]
fn no_size_of_any_page_panics_or_leaves_its_area() {
    let three = Model::new(Protocol::Ikeya3);
    for model in [bus(), rover(), three, Model::new(Protocol::Ucp)] {
        for role in [Role::Watching, Role::Moving, Role::Stopping] {
            let view = View { role, has_help: true, recording: Some("x".repeat(50)), ..view() };
            for size in SIZES {
                assert_eq!(drawn(&view, &model, size).len(), usize::from(size.1));
            }
        }
    }
}

#[test]
fn a_bus_has_one_row_per_node_with_all_of_its_values() {
    let rows = drawn(&view(), &bus(), (120, 40));
    assert!(rows[0].starts_with(" axle watch  /dev/ttyUSB0") || rows[0].starts_with("axle watch"));
    let words = |at: usize| rows[at].split_whitespace().collect::<Vec<_>>();
    assert_eq!(words(2)[..5], ["node", "mode", "state", "value", "commanded"]);
    assert_eq!(words(2)[8..], ["per", "s", "latency", "missing", "damaged"]);
    let node = words(3);
    assert_eq!(node[..7], ["1", "velocity", "ok", "9.90", "rps", "10.00", "rps"]);
    assert_eq!(node[node.len() - 4..], ["1.5", "ms", "0", "0"]);
    let node = words(4);
    assert_eq!(node[..5], ["2", "velocity", "silent", "-2.50", "rps"]);
    assert_eq!(node[node.len() - 2..], ["50", "0"]);
    let node = words(5);
    assert_eq!(node[..5], ["3", "position", "ok", "-1.5000", "turns"]);
    assert_eq!(node[node.len() - 4..], ["0.4", "ms", "0", "30"], "skipped after its READs");
    assert!(rows.iter().any(|row| row.ends_with("node 2 no longer answers: 3 are missing")));
    assert!(rows[39].starts_with("q quit"));
}

#[test]
fn a_narrow_page_keeps_the_values_and_cuts_no_number() {
    let rows = drawn(&view(), &bus(), (20, 5));
    assert_eq!(rows[1], "1 ok        9.90 rps");
    assert_eq!(rows[2], "2 silent   -2.50 rps");
    assert_eq!(rows[3], "3 ok       -1.5000 t");
    assert_eq!(rows[4], "q quit p f r ?");
    let rows = drawn(&view(), &bus(), (80, 24));
    assert!(rows[3].contains("9.90 rps") && rows[3].contains("ms"), "{rows:?}");
    assert!(rows[3].contains(['▁', '█']), "{rows:?}");
}

#[test]
fn nodes_that_nothing_is_heard_of_are_quiet_and_ids_only_searched_for_are_not_shown() {
    let mut feed = Feed::<ikeya::BothDirections>::new(Model::new(Protocol::Ikeya), None);
    feed.take(Source::Received, ReadRequest::new(NodeId::N7).as_bytes(), 0);
    let answer = VelocityResponse::new(NodeId::N2, Rps::ZERO);
    feed.take(Source::Received, answer.as_bytes(), 0);
    feed.tick(1_500_000);
    let rows = drawn(&view(), &feed.model, (80, 12));
    assert!(rows[3].starts_with("2    velocity quiet"), "{rows:?}");
    assert!(!rows[4].starts_with('7'), "{rows:?}");
}

#[test]
fn three_motors_have_three_values() {
    let mut feed = Feed::<three::BothDirections>::new(Model::new(Protocol::Ikeya3), None);
    let rps = [1.0, -2.0, 30.0].map(|rps| Rps::new(rps).unwrap());
    // These boards answer WRITEs as well.
    let write = three::WriteRequest::velocity(NodeId::N4, rps);
    let answer = three::VelocityResponse::new(NodeId::N4, rps);
    feed.take(Source::Received, write.as_bytes(), 1000);
    feed.take(Source::Received, answer.as_bytes(), 3500);
    feed.tick(4000);
    let rows = drawn(&view(), &feed.model, (100, 10));
    assert!(rows[3].contains("1.00 -2.00 30.00 rps"), "{rows:?}");
    assert!(rows[3].contains("2.5 ms"), "{rows:?}");
    let rows = drawn(&view(), &feed.model, (20, 5));
    assert_eq!(rows[2], "4 ok     1 -2 30 rps");
}

#[test]
fn a_rover_has_its_values_in_the_order_of_their_weight() {
    let model = rover();
    let rows = drawn(&view(), &model, (80, 24));
    assert_eq!(rows[2], "link     up, 49 reports/s, 2 lost");
    assert_eq!(rows[3], "command  speed 60 %, turn 50 % right, lamp on  (11/s)");
    assert!(rows[4].starts_with("wheels   front 81 39  back 80 40 rpm"), "{rows:?}");
    assert_eq!(rows[5], "battery  87 %, 12.1 V");
    assert_eq!(rows[6], "power    9 W, 0.80 A");
    assert_eq!(rows[7], "heading  123 deg");
    assert_eq!(rows[8], "accel.   x 0.00  y 0.00  z 1.00 g");
    assert!(rows.iter().any(|row| row.ends_with("2 reports lost, by their indices")), "{rows:?}");
    let rows = drawn(&view(), &model, (20, 5));
    assert_eq!(rows[1..4], ["link up, 2 lost", "cmd  60 % R50 %", "rpm  81 39 80 40"]);
}

#[test]
fn a_rover_that_goes_silent_is_down() {
    let mut model = rover();
    let counters = model.counters;
    model.tick(counters, 2_400_000);
    assert!(drawn(&view(), &model, (80, 24))[2].contains("up"));
    model.tick(counters, 2_600_000);
    assert!(drawn(&view(), &model, (80, 24))[2].contains("DOWN"));
}

#[test]
fn the_filter_shows_gaps_only_or_one_node() {
    let model = bus();
    let log = |filter| {
        let rows = drawn(&View { filter, ..view() }, &model, (80, 40));
        rows[7..39].join("\n")
    };
    assert!(log(Filter::All).contains("skipped") && log(Filter::All).contains("node 1 answers"));
    assert!(!log(Filter::Gaps).contains("answers"));
    let node = log(Filter::Node(NodeId::N2));
    assert!(node.contains("no longer answers") && !node.contains("skipped"), "{node}");
}

#[test]
fn what_the_keys_do_and_what_the_tool_does_is_on_the_page() {
    let model = bus();
    let recording = Some("line.pcapng".to_owned());
    let view = View { is_paused: true, recording, ..view() };
    assert!(drawn(&view, &model, (80, 24))[0].ends_with("PAUSED  REC line.pcapng  0:01"));
    let moving = View { role: Role::Moving, ..view.clone() };
    assert!(drawn(&moving, &model, (80, 24))[23].contains("STOP"));
    assert!(drawn(&moving, &model, (20, 5))[4].contains("STOP"));
    let help = View { has_help: true, ..view };
    assert!(drawn(&help, &model, (80, 24))[23].contains("USB adapter"));
}

#[test]
fn text_from_the_line_is_never_a_control_sequence() {
    let mut feed = Feed::<ucp::Ucp>::new(Model::new(Protocol::Ucp), None);
    let mut buffer = [0; 64];
    let frame = RawFrame { id: 0x1B, index: 0, body: b"\x1b[2J\x07" };
    feed.take(Source::Received, frame.encode(&mut buffer).unwrap(), 0);
    let view = View { title: "\x1b[2J\u{202e}".to_owned(), ..view() };
    for row in drawn(&view, &feed.model, (80, 24)) {
        assert!(!row.contains(char::is_control), "{row:?}");
    }
}

/// The colour in which this text is on the page.
fn colour_of(text: &str, model: &Model, size: (u16, u16)) -> Option<Color> {
    let rows = drawn(&view(), model, size);
    let found = rows.iter().enumerate().find_map(|(y, row)| Some((row.find(text)?, y)));
    let (x, y) = found.unwrap_or_else(|| panic!("no {text:?} in {rows:?}"));
    let before = rows[y][..x].chars().count();
    picture(&view(), model, size)[(before as u16, y as u16)].style().fg
}

/// What is known of a rover after these bytes.
fn heard(bytes: &[u8]) -> Model {
    let mut feed = Feed::<ucp::Ucp>::new(Model::new(Protocol::Ucp), None);
    feed.take(Source::Received, bytes, 0);
    feed.tick(100_000);
    feed.model
}

#[test]
fn the_totals_are_in_doubt_once_bytes_were_skipped() {
    let colour = |bytes| colour_of(" skipped", &heard(bytes), (80, 24));
    let ping = ucp::message::Ping {}.frame(0);
    assert_ne!(colour(ping.as_bytes()), DOUBT.fg);
    assert_eq!(colour(&[0; 5]), DOUBT.fg);
}

#[test]
fn a_battery_below_a_fifth_is_in_doubt() {
    for (percent, is_low) in [(0, true), (19, true), (20, false), (21, false), (100, false)] {
        let telemetry = Telemetry { battery_pct: percent, ..Telemetry::default() };
        let report = ucp::message::FirmwareReport::new(&telemetry, 38).frame(0);
        let model = heard(report.as_bytes());
        let text = format!("{percent} %, ");
        let colour = colour_of(&text, &model, (80, 24));
        assert_eq!(colour == DOUBT.fg, is_low, "{percent}");
    }
}

#[test]
fn a_command_names_its_side_unless_it_is_straight() {
    for (turn, long, short) in [
        (0, "command  speed 60 %, turn 0 %  (0/s)", "cmd  60 % 0 %"),
        (1, "command  speed 60 %, turn 1 % right  (0/s)", "cmd  60 % R1 %"),
        (-50, "command  speed 60 %, turn 50 % left  (0/s)", "cmd  60 % L50 %"),
    ] {
        let model = heard(MotorControl::new(60, turn).unwrap().frame(0).as_bytes());
        assert_eq!(drawn(&view(), &model, (80, 24))[3], long);
        assert_eq!(drawn(&view(), &model, (20, 5))[2], short);
    }
}

#[test]
fn a_value_of_a_rover_leaves_a_column_to_the_next_one() {
    let model = rover();
    for width in 20..=90 {
        let rows = drawn(&view(), &model, (width, 19));
        // The rows of values have a blank behind them; in two columns, both columns.
        for row in &rows[2..if width < 90 { 15 } else { 9 }] {
            let blanks = if width < 90 { vec![width] } else { vec![width / 2, width] };
            for blank in blanks {
                let cell = row.chars().nth(usize::from(blank) - 1).unwrap_or(' ');
                assert_eq!(cell, ' ', "{width} {row:?}");
            }
        }
    }
}

#[test]
fn the_log_has_times_where_there_is_room_for_them() {
    let mut model = Model::new(Protocol::Ikeya);
    model.note("a note".to_owned(), 1_234_567);
    let row = |width| {
        let rows = drawn(&view(), &model, (width, 12));
        rows.into_iter().find(|row| row.contains("a note")).unwrap()
    };
    for width in [20, 38, 39] {
        assert_eq!(row(width), "a note", "{width}");
    }
    for width in [40, 41, 80] {
        assert_eq!(row(width), "    1.235 s  a note", "{width}");
    }
}

#[test]
fn a_narrow_bus_has_short_titles_and_states_and_a_wide_one_has_long_ones() {
    let (n1, n2) = (NodeId::N1, NodeId::N2);
    let mut feed = Feed::<ikeya::BothDirections>::new(Model::new(Protocol::Ikeya), None);
    let command = WriteRequest::velocity(n2, Rps::ZERO);
    let (read, answer) = (ReadRequest::new(n1), VelocityResponse::new(n1, Rps::ZERO));
    for bytes in [&read.as_bytes()[..], answer.as_bytes(), read.as_bytes(), command.as_bytes()] {
        feed.take(Source::Received, bytes, 1000);
    }
    let words = |width| -> Vec<Vec<String>> {
        let rows = drawn(&view(), &feed.model, (width, 12));
        let of_row = |row: &String| row.split_whitespace().map(str::to_owned).collect();
        rows[2..5].iter().map(of_row).collect()
    };
    let narrow = words(20);
    assert_eq!(narrow[0], ["n", "state", "value"]);
    assert_eq!(narrow[1][..3], ["1", "miss", "1"]);
    assert_eq!(narrow[2][..2], ["2", "cmds"]);
    let wide = words(80);
    assert_eq!(wide[0][..4], ["node", "mode", "state", "value"]);
    assert_eq!(wide[1][..4], ["1", "velocity", "missing", "1"]);
    assert_eq!(wide[2][..2], ["2", "commanded"]);
}

#[test]
fn a_latency_has_tenths_below_100_ms() {
    for (micros, text) in [(0, "0.0 ms"), (99_900, "99.9 ms"), (100_000, "100 ms")] {
        assert_eq!(text::millis(micros), text);
    }
}

/// Whatever is on a line, in whatever pieces and at whatever times, the page shows it, and every
/// frame and every skipped byte of a bus is booked on a node.
#[test]
fn any_bytes_at_any_times_are_shown_and_booked() {
    let mut seed = 1_u64;
    let mut random = |below: u64| {
        seed ^= seed << 13;
        seed ^= seed >> 7;
        seed ^= seed << 17;
        seed % below
    };
    for _ in 0..20 {
        let mut feed = Feed::<ikeya::BothDirections>::new(Model::new(Protocol::Ikeya), None);
        // Bytes before the first frame are near nobody.
        feed.take(Source::Received, ReadRequest::new(NodeId::N1).as_bytes(), 0);
        let mut sizes = SIZES.iter().cycle();
        for _ in 0..300 {
            let id = NodeId::ALL[random(8) as usize];
            let value = f32::from_bits(random(1 << 32) as u32);
            let rps = Rps::new(value).unwrap_or(Rps::ZERO);
            let counts = random(1 << 29) as i32 - (1 << 28);
            let position = Position::from_counts(counts / 2).unwrap();
            let mut bytes = match random(5) {
                0 => ReadRequest::new(id).as_bytes().to_vec(),
                1 => WriteRequest::velocity(id, rps).as_bytes().to_vec(),
                2 => VelocityResponse::new(id, rps).as_bytes().to_vec(),
                3 => PositionResponse::new(id, position).as_bytes().to_vec(),
                _ => (0..random(30)).map(|_| random(256) as u8).collect(),
            };
            if random(4) == 0 && !bytes.is_empty() {
                let at = random(bytes.len() as u64) as usize;
                bytes[at] ^= 1 << random(8);
            }
            let at = random(10_000_000);
            let split = random(bytes.len() as u64 + 1) as usize;
            feed.take(Source::Received, &bytes[..split], at);
            feed.take(Source::Received, &bytes[split..], at);
            if random(10) == 0 {
                feed.tick(at);
                drawn(&view(), &feed.model, *sizes.next().unwrap());
            }
        }
        // The line goes quiet: what waits is decided.
        for late in 11..30 {
            feed.tick(late * 1_000_000);
        }
        let counters = feed.counters();
        assert_eq!(counters.received, counters.framed + counters.skipped());
        let OfLine::Bus(bus) = &feed.model.line else { panic!() };
        let packets: u64 = bus.nodes().map(|(_, node)| node.packets.count).sum();
        let damaged: u64 = bus.nodes().map(|(_, node)| node.damaged).sum();
        assert_eq!((packets, damaged), (counters.frames, counters.skipped()));
    }
}
