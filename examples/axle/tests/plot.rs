//! `axle plot`: the curves are what `axle decode --json` says, and bad input leaves no file.

mod support;

use std::{
    fs,
    path::{Path, PathBuf},
};

#[cfg(feature = "plot")]
use std::{
    collections::BTreeMap,
    io::Write,
    process::{Child, Stdio},
};

#[cfg(feature = "plot")]
use axlewire::ikeya::{NodeId, ReadRequest, Rps, VelocityResponse};
#[cfg(feature = "plot")]
use serde_json::Value;
use support::axle;
#[cfg(feature = "plot")]
use support::{events, pcapng::PcapNg, stdout};

const CAPTURES: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../captures/");

/// A folder of its own, removed at the end.
struct Folder(PathBuf);

impl Folder {
    fn new(name: &str) -> Self {
        let path = std::env::temp_dir().join(format!("axle-plot-{}-{name}", std::process::id()));
        fs::create_dir_all(&path).unwrap();
        Self(path)
    }

    fn path(&self, name: &str) -> String {
        self.0.join(name).to_str().unwrap().to_owned()
    }

    /// Everything in it, hidden files too.
    fn names(&self) -> Vec<String> {
        let names = fs::read_dir(&self.0).unwrap();
        let mut names: Vec<_> =
            names.map(|it| it.unwrap().file_name().into_string().unwrap()).collect();
        names.sort();
        names
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        let _ = fs::remove_dir_all(&self.0);
    }
}

/// The single error line of a run that fails with this code.
fn complaint(args: &[&str], code: i32) -> String {
    let output = axle(&[&["plot"], args].concat()).output().unwrap();
    let said = String::from_utf8(output.stderr).unwrap();
    assert_eq!((output.status.code(), said.lines().count()), (Some(code), 1), "{args:?}: {said}");
    assert!(output.stdout.is_empty());
    said.trim().strip_prefix("axle: ").unwrap().to_owned()
}

#[cfg(not(feature = "plot"))]
#[test]
fn a_build_without_the_feature_says_which_one_is_missing() {
    let folder = Folder::new("without");
    let capture = Path::new(CAPTURES).join("motors.pcapng");
    let said = complaint(&[capture.to_str().unwrap(), "-o", &folder.path("a.svg")], 2);
    let expected = "this axle was built without the feature plot: build it with --features plot";
    assert_eq!(said, expected);
    assert!(folder.names().is_empty());
}

/// Draws one of our captures, or a file with its path.
#[cfg(feature = "plot")]
fn plot(capture: &str, more: &[&str], output: &str) -> Vec<u8> {
    let path = Path::new(CAPTURES).join(capture);
    let args = [&["plot", path.to_str().unwrap(), "--force", "-o", output], more].concat();
    assert_eq!(stdout(axle(&args).output().unwrap()), "");
    fs::read(output).unwrap()
}

/// The data in the page of a capture.
#[cfg(feature = "plot")]
fn page(capture: &str, more: &[&str]) -> Value {
    let folder = Folder::new(&format!("page-{}", more.len() + capture.len()));
    let page = String::from_utf8(plot(capture, more, &folder.path("a.html"))).unwrap();
    let (_, rest) = page.split_once("<script id=\"data\" type=\"application/json\">").unwrap();
    serde_json::from_str(rest.split_once("</script>").unwrap().0).unwrap()
}

/// What `axle decode --json` says.
#[cfg(feature = "plot")]
fn listing(capture: &str, more: &[&str]) -> Vec<Value> {
    let path = Path::new(CAPTURES).join(capture);
    let args = [&["decode", "--json", path.to_str().unwrap()], more].concat();
    events(&stdout(axle(&args).output().unwrap())).0
}

#[cfg(feature = "plot")]
type Curves = BTreeMap<(String, String), Vec<(f64, f64)>>;

/// The points of all curves by panel and name.
#[cfg(feature = "plot")]
fn curves(page: &Value) -> Curves {
    let mut curves = Curves::new();
    for panel in page["panels"].as_array().unwrap() {
        for series in panel["series"].as_array().unwrap() {
            let numbers = |of: &str| series[of].as_array().unwrap().clone();
            let points = numbers("x").into_iter().zip(numbers("y"));
            let points = points.filter_map(|(x, y)| Some((x.as_f64()?, y.as_f64()?)));
            let text = |of: &Value| of.as_str().unwrap().to_owned();
            curves.insert((text(&panel["title"]), text(&series["name"])), points.collect());
        }
    }
    curves
}

/// Seconds since the first line.
#[cfg(feature = "plot")]
fn seconds(line: &Value, first: &Value) -> f64 {
    let micros = |line: &Value| (line["t"].as_f64().unwrap() * 1e6).round();
    (micros(line) - micros(first)) / 1e6
}

/// The numbers of a field, one or several.
#[cfg(feature = "plot")]
fn numbers(field: &Value) -> Vec<f64> {
    match field.as_array() {
        Some(several) => several.iter().map(|one| one.as_f64().unwrap()).collect(),
        None => vec![field.as_f64().unwrap()],
    }
}

#[cfg(feature = "plot")]
#[test]
fn the_curves_of_a_bus_are_what_decode_says() {
    let (page, lines) = (page("motors.pcapng", &[]), listing("motors.pcapng", &[]));
    let mut expected = Curves::new();
    let mut put = |panel: &str, name: String, x: f64, y: f64| {
        expected.entry((panel.to_owned(), name)).or_default().push((x, y));
    };
    let (mut asked, mut modes) = (None, BTreeMap::new());
    for line in &lines {
        let x = seconds(line, &lines[0]);
        let Some(node) = line["node"].as_u64() else {
            let has_crc = line["reasons"]["crc"].is_u64();
            let row = match line["reason"].as_str().unwrap() {
                _ if has_crc => "bad CRC",
                "crc" => "bad CRC",
                "header" => "no header",
                "id" => "bad id",
                other => panic!("{other}"),
            };
            put("Errors", row.to_owned(), x, 1.0);
            continue;
        };
        let turns =
            || line["rotation"].as_f64().unwrap() + line["count"].as_f64().unwrap() / 8192.0;
        let message = line["message"].as_str().unwrap();
        if let "read_request" | "write" = message
            && let Some((silent, since)) = asked.take()
        {
            put("Errors", format!("node {silent} silent"), since, 1.0);
        }
        match (message, line["mode"].as_str()) {
            ("read_request", _) => asked = Some((node, x)),
            ("write", Some("velocity")) => {
                put(
                    "Velocity",
                    format!("node {node}, set-point"),
                    x,
                    line["rps"].as_f64().unwrap(),
                );
            }
            ("write", Some("position")) => {
                put("Position", format!("node {node}, set-point"), x, turns());
            }
            ("write", _) => panic!("its mode is not known: {line}"),
            (response, _) => {
                let (panel, value) = match response {
                    "velocity_response" => ("Velocity", line["rps"].as_f64()),
                    _ => ("Position", Some(turns())),
                };
                match value {
                    Some(value) => put(panel, format!("node {node}"), x, value),
                    None => put("Errors", format!("node {node} NaN"), x, 1.0),
                }
                if let Some((of, since)) = asked.take() {
                    assert_eq!(of, node);
                    let millis = ((x - since) * 1e6).round() / 1e3;
                    put("Response time", format!("node {node}"), x, millis);
                } else {
                    put("Errors", format!("node {node} late"), x, 1.0);
                }
                assert_eq!(modes.insert(node, response).unwrap_or(response), response);
            }
        }
    }
    let found = curves(&page);
    let names = |of: &Curves| of.keys().cloned().collect::<Vec<_>>();
    assert_eq!(names(&found), names(&expected));
    for (name, points) in &expected {
        // Of values of the same microsecond, the page has each once.
        let mut points = points.clone();
        if name.0 == "Errors" {
            assert_eq!(count_of(&page, name), points.len() as u64, "{name:?}");
            points.dedup();
        }
        same(&found[name], &points, name);
    }
    assert!(found.len() > 30 && lines.len() > 2000);
}

/// The same points. Reading a number from JSON may change its last bit.
#[cfg(feature = "plot")]
fn same(found: &[(f64, f64)], expected: &[(f64, f64)], name: &(String, String)) {
    assert_eq!(found.len(), expected.len(), "{name:?}");
    for (found, expected) in found.iter().zip(expected) {
        let is_near = (found.1 - expected.1).abs() <= 1e-12 * expected.1.abs();
        assert!(found.0 == expected.0 && is_near, "{name:?}: {found:?} is not {expected:?}");
    }
}

/// The number of all values of a curve.
#[cfg(feature = "plot")]
fn count_of(page: &Value, (title, name): &(String, String)) -> u64 {
    let panels = page["panels"].as_array().unwrap();
    let panel = panels.iter().find(|panel| panel["title"] == **title).unwrap();
    let series = panel["series"].as_array().unwrap().iter();
    let series = series.clone().find(|series| series["name"] == **name).unwrap();
    series["count"].as_u64().unwrap()
}

#[cfg(feature = "plot")]
#[test]
fn the_curves_of_a_rover_are_what_decode_says() {
    let (page, lines) = (page("drive.pcapng", &[]), listing("drive.pcapng", &[]));
    let fields: [(&str, &str, f64, &[&str]); 11] = [
        ("Command", "speed", 1.0, &["speed"]),
        ("Command", "angular", 1.0, &["steering"]),
        ("Wheel speed", "rpm", 1.0, &["front left", "front right", "back left", "back right"]),
        ("Heading", "heading", 1.0, &["heading"]),
        ("Acceleration", "acc", 16384.0, &["x", "y", "z"]),
        ("Angular velocity", "gyro", 16.4, &["x", "y", "z"]),
        ("Magnetic field", "mag", 1.0, &["x", "y", "z"]),
        ("Battery", "battery_pct", 1.0, &["battery"]),
        ("Voltage", "voltage_dv", 10.0, &["voltage"]),
        ("Current", "current_ca", 100.0, &["current"]),
        ("Power", "power_w", 1.0, &["power"]),
    ];
    let mut expected = Curves::new();
    let (mut last, mut lost, mut gaps) = (None, 0, BTreeMap::<&str, u64>::new());
    for line in &lines {
        let x = seconds(line, &lines[0]);
        for (panel, field, one, names) in fields {
            if line[field].is_null() || line["message"] == "ota_request" {
                continue;
            }
            let values = numbers(&line[field]);
            assert_eq!(values.len(), names.len());
            for (name, value) in names.iter().zip(values) {
                let name = (panel.to_owned(), (*name).to_owned());
                expected.entry(name).or_default().push((x, value / one));
            }
        }
        if line["message"] == "report" {
            let index = line["index"].as_u64().unwrap();
            let missing = |last| (index + 255 - last) % 256;
            lost += last.replace(index).map_or(0, missing);
        }
        match line["reason"].as_str() {
            Some("crc") => *gaps.entry("bad CRC").or_default() += 1,
            Some(_) if line["reasons"]["crc"].is_u64() => *gaps.entry("bad CRC").or_default() += 1,
            Some("length") => *gaps.entry("bad length").or_default() += 1,
            Some(other) => panic!("{other}"),
            None => {}
        }
    }
    let mut found = curves(&page);
    let errors = |name: &str| ("Errors".to_owned(), name.to_owned());
    assert_eq!(count_of(&page, &errors("report lost")), lost);
    for (name, count) in gaps {
        assert_eq!(count_of(&page, &errors(name)), count, "{name}");
    }
    found.retain(|(panel, _), _| panel != "Errors");
    assert_eq!(found.len(), 20);
    for (name, points) in &expected {
        same(&found[name], points, name);
    }
    assert!(lost > 40, "the loose plug: {lost}");
}

#[cfg(feature = "plot")]
#[test]
fn raw_bytes_are_drawn_by_their_offset_or_by_their_time_on_the_line() {
    let by_offset = page("ucp.bin", &[]);
    assert_eq!(by_offset["axis"], "byte offset: the capture has no times");
    let reports: Vec<f64> = listing("ucp.bin", &["-P", "ucp"])
        .iter()
        .filter(|line| line["message"] == "report")
        .map(|line| line["offset"].as_f64().unwrap())
        .collect();
    let places = |page: &Value| -> Vec<f64> {
        let battery = ("Battery".to_owned(), "battery".to_owned());
        curves(page)[&battery].iter().map(|(x, _)| *x).collect()
    };
    assert_eq!(places(&by_offset), reports);
    let by_time = page("ucp.bin", &["--baud", "115200"]);
    assert_eq!(by_time["axis"], "time on the line at 115200 bit/s, s, without pauses");
    let times: Vec<_> = reports.iter().map(|offset| offset / 11520.0).collect();
    assert_eq!(places(&by_time), times);
    let notes = page("ikeya.bin", &[])["notes"].to_string();
    assert!(notes.contains("1 command before the first answer of the node"), "{notes}");
}

/// A velocity answer of node 1 each 100 ms.
#[cfg(feature = "plot")]
fn answers(speeds: &[f32]) -> Vec<u8> {
    let mut capture = PcapNg::new(147, &[]);
    for (at, speed) in (1_000_000..).step_by(100_000).zip(speeds) {
        let answer = VelocityResponse::new(NodeId::N1, Rps::new(*speed).unwrap());
        capture.packet(0, (at, 1, ReadRequest::new(NodeId::N1).as_bytes()));
        capture.packet(0, (at + 250, 1, answer.as_bytes()));
    }
    capture.0
}

/// Absolute points of the path of an SVG that is drawn with this ink and width.
#[cfg(feature = "plot")]
fn path_of(svg: &str, stroke: &str, width: &str) -> Vec<(f64, f64)> {
    let ink = format!("stroke=\"{stroke}\" stroke-width=\"{width}\"");
    let line = svg.lines().find(|line| line.contains(&ink)).expect("the curve");
    let (_, path) = line.split_once(" d=\"M").unwrap();
    let path = path.strip_suffix("\"/>").unwrap();
    let mut points: Vec<(f64, f64)> = vec![];
    let mut rest = path;
    let mut command = 'l';
    loop {
        let end = rest.find(|it: char| it.is_ascii_alphabetic()).unwrap_or(rest.len());
        let numbers = rest[..end].replace('-', " -");
        let numbers: Vec<f64> = numbers.split_whitespace().map(|it| it.parse().unwrap()).collect();
        let (x, y) = points.last().copied().unwrap_or_default();
        points.push(match (command, &numbers[..]) {
            ('h', [dx]) => (x + dx, y),
            ('v', [dy]) => (x, y + dy),
            ('l', [dx, dy]) => (x + dx, y + dy),
            other => panic!("{other:?}"),
        });
        let Some(next) = rest[end..].chars().next() else { return points };
        (command, rest) = (next, &rest[end + 1..]);
    }
}

#[cfg(feature = "plot")]
#[test]
fn an_svg_has_each_point_at_its_place() {
    let folder = Folder::new("svg");
    let speeds = [0.0, 1.0, -1.0, 2.0, 0.5, 0.5, 0.5, -2.0];
    let capture = folder.path("made.pcapng");
    fs::write(&capture, answers(&speeds)).unwrap();
    let svg = String::from_utf8(plot(&capture, &[], &folder.path("a.svg"))).unwrap();
    let curve = path_of(&svg, "#0072b2", "1.2");
    // The third 0.5 in a row is on the line between the others.
    assert_eq!(curve.len(), speeds.len() - 1, "{curve:?}");
    // The axis tells what a value is in pixels: its labels of 0 and 2.
    let label = |text: &str| -> f64 {
        let end = format!("text-anchor=\"end\">{text}</text>");
        let line = svg.lines().find(|line| line.ends_with(&end)).expect("a label");
        line.split("y=\"").nth(1).unwrap().split('"').next().unwrap().parse().unwrap()
    };
    let per_turn = (label("0") - label("2")) / 2.0;
    assert!(per_turn > 20.0);
    let drawn = [0.0, 1.0, -1.0, 2.0, 0.5, 0.5, -2.0];
    for ((_, y), speed) in curve.iter().zip(drawn) {
        let found = (curve[0].1 - y) / per_turn;
        assert!((found - speed).abs() < 0.02, "{found} is not {speed}");
    }
    // The first is 0.25 ms behind the request, with which the axis begins; the last is its end.
    let span = curve[6].0 - curve[0].0;
    for ((x, _), at) in curve.iter().zip([0.0, 1.0, 2.0, 3.0, 4.0, 6.0, 7.0]) {
        assert!((x - curve[0].0 - span * at / 7.0).abs() < 0.2, "{curve:?}");
    }
    for expected in [
        "<title>made.pcapng  ·  ikeya  ·  16 frames</title>",
        ">Velocity</text>",
        ">, 1/s</text>",
        ">, ms</text>",
        ">time, s, from 1970-01-01 00:00:01.000 UTC</text>",
        ">node 1</text>",
    ] {
        assert!(svg.contains(expected), "{expected}");
    }
}

/// The labels of an SVG with this anchor, and the place of each.
#[cfg(feature = "plot")]
fn labels(svg: &str, anchor: &str) -> Vec<(f64, String)> {
    let middle = format!("fill=\"#6a727c\" text-anchor=\"{anchor}\">");
    let lines = svg.lines().filter_map(|line| line.split_once(&middle));
    let labels = lines.map(|(place, text)| {
        let x = place.strip_prefix("<text x=\"").unwrap().split('"').next().unwrap();
        (x.parse().unwrap(), text.strip_suffix("</text>").unwrap().to_owned())
    });
    labels.collect()
}

#[cfg(feature = "plot")]
#[test]
fn the_numbers_of_an_axis_are_right_and_fit_in_front_of_it() {
    let folder = Folder::new("labels");
    let path = folder.path("made.pcapng");
    let drawn = |places: &[u64], speeds: &[f32]| {
        let mut capture = PcapNg::new(147, &[]);
        for (at, speed) in places.iter().zip(speeds) {
            let answer = VelocityResponse::new(NodeId::N1, Rps::new(*speed).unwrap());
            capture.packet(0, (1_000_000 + at, 1, answer.as_bytes()));
        }
        fs::write(&path, &capture.0).unwrap();
        let svg = String::from_utf8(plot(&path, &[], &folder.path("a.svg"))).unwrap();
        let texts = |anchor| -> Vec<String> {
            labels(&svg, anchor)
                .into_iter()
                .map(|(_, text)| text.replace('\u{2212}', "-"))
                .collect()
        };
        for (x, text) in labels(&svg, "end") {
            // A digit of ten pixels is less than 6.5 wide.
            assert!(x >= 6.5 * text.chars().count() as f64, "{text} begins left of the picture");
        }
        (texts("end"), texts("middle"))
    };
    let (up, across) = drawn(&[0, 1, 2, 3], &[3.4e38, -3.4e38, 1e-45, 0.0]);
    assert_eq!(up, ["-3e38", "-2e38", "-1e38", "0", "1e38", "2e38", "3e38"]);
    let across = &across[..across.len() - 1];
    assert_eq!(across, ["0", "5e-7", "1e-6", "1.5e-6", "2e-6", "2.5e-6", "3e-6"]);
    let (up, _) = drawn(&[0, 100, 200], &[1e-7, -1e-7, 0.0]);
    assert_eq!(up, ["-1e-7", "-5e-8", "0", "5e-8", "1e-7"]);
    let (up, across) = drawn(&[0, 1_000_000], &[12_345_678.0, 12_345_680.0]);
    assert_eq!(up, ["12345678", "12345678.5", "12345679", "12345679.5", "12345680"]);
    assert_eq!(across.first().map(String::as_str), Some("0"));
    for value in [1e-45, 3.402_823_5e38, -16_777_216.0] {
        let (up, _) = drawn(&[0, 1], &[value, value]);
        assert!(!up.is_empty(), "{value}");
    }
}

#[cfg(feature = "plot")]
#[test]
fn a_set_point_ends_with_the_mode_and_no_value_is_invented() {
    use axlewire::ikeya::{Position, PositionResponse, WriteRequest};
    let folder = Folder::new("mode");
    let path = folder.path("made.pcapng");
    let velocity = VelocityResponse::new(NodeId::N1, Rps::new(1.0).unwrap());
    let position = PositionResponse::new(NodeId::N1, Position::from_counts(8192).unwrap());
    let write = WriteRequest::velocity(NodeId::N1, Rps::new(2.5).unwrap());
    let mut capture = PcapNg::new(147, &[(0, 1, velocity.as_bytes()), (10, 1, write.as_bytes())]);
    capture.packet(0, (20, 1, position.as_bytes()));
    capture.packet(0, (30, 1, velocity.as_bytes()));
    fs::write(&path, &capture.0).unwrap();
    let page = page(&path, &[]);
    let set_point = &page["panels"][0]["series"][0];
    assert_eq!(set_point["name"], "node 1, set-point");
    assert_eq!((&set_point["count"], &set_point["open"]), (&1.into(), &false.into()));
    assert_eq!(set_point["x"], serde_json::json!([1e-5, 2e-5]));
    assert_eq!(set_point["y"], serde_json::json!([2.5, null]));
    // The picture has it until the change.
    let svg = String::from_utf8(plot(&path, &[], &folder.path("a.svg"))).unwrap();
    let [(from, _), (to, _)] = path_of(&svg, "#0072b2", "4")[..] else { panic!("{svg}") };
    let span = 960.0 - 2.0 * 14.0 - 34.0 - 48.0;
    assert!((to - from - span / 3.0).abs() < 2.0, "{from} to {to}");
}

#[cfg(feature = "plot")]
#[test]
fn a_packet_without_a_time_does_not_take_the_times_of_the_others() {
    let folder = Folder::new("timeless");
    let path = folder.path("made.pcapng");
    let answer = |speed| *VelocityResponse::new(NodeId::N1, Rps::new(speed).unwrap()).as_bytes();
    let mut capture = PcapNg::new(147, &[]);
    let untimed = answer(9.0);
    capture.block(3, &[&(untimed.len() as u32).to_le_bytes(), &untimed[..]].concat());
    capture.packet(0, (1_000_000, 1, &answer(1.0)));
    capture.packet(0, (3_000_000, 1, &answer(2.0)));
    fs::write(&path, &capture.0).unwrap();
    let page = page(&path, &[]);
    assert_eq!(page["axis"], "time, s, from 1970-01-01 00:00:01.000 UTC");
    assert_eq!(page["notes"], serde_json::json!(["1 frame or gap without a time: not drawn"]));
    let velocity = ("Velocity".to_owned(), "node 1".to_owned());
    assert_eq!(curves(&page), [(velocity, vec![(0.0, 1.0), (2.0, 2.0)])].into());
}

#[cfg(feature = "plot")]
#[test]
fn each_direction_has_its_count_of_reports() {
    use axlewire::ucp::{Body, Telemetry, message::FirmwareReport};
    let folder = Folder::new("counts");
    let path = folder.path("made.pcapng");
    let mut capture = PcapNg::new(150, &[]);
    let indices = [(1, 10), (2, 20), (1, 11), (2, 21), (1, 13), (2, 22), (1, 14), (2, 24)];
    for (at, (direction, index)) in (0..).zip(indices) {
        let report = FirmwareReport::new(&Telemetry::default(), 38).frame(index);
        capture.packet(0, (at * 20_000, direction, report.as_bytes()));
    }
    fs::write(&path, &capture.0).unwrap();
    let lost = ("Errors".to_owned(), "report lost".to_owned());
    assert_eq!(count_of(&page(&path, &[]), &lost), 2);
}

#[cfg(feature = "plot")]
#[test]
fn the_pictures_of_the_readme_are_up_to_date() {
    let folder = Folder::new("readme");
    for name in ["motors", "drive"] {
        let drawn = plot(&format!("{name}.pcapng"), &[], &folder.path("a.svg"));
        let shots = Path::new(env!("CARGO_MANIFEST_DIR")).join("screenshots");
        let kept = fs::read(shots.join(format!("{name}.svg"))).unwrap();
        assert!(drawn == kept, "{name}.svg is not: screenshots.sh draws it anew");
        assert!(drawn.len() < 120_000, "{} bytes", drawn.len());
    }
}

#[cfg(feature = "plot")]
#[test]
fn a_curve_ends_where_a_node_falls_silent() {
    let folder = Folder::new("silent");
    let read = *ReadRequest::new(NodeId::N1).as_bytes();
    let mut capture = PcapNg(answers(&[1.0, 1.5]));
    for at in 0..4 {
        capture.packet(0, (2_000_000 + at * 1000, 1, &read));
    }
    let again = VelocityResponse::new(NodeId::N1, Rps::new(0.5).unwrap());
    capture.packet(0, (2_003_200, 1, again.as_bytes()));
    let path = folder.path("made.pcapng");
    fs::write(&path, &capture.0).unwrap();
    let page = page(&path, &[]);
    let velocity = &page["panels"][0]["series"][0];
    assert_eq!(velocity["y"], serde_json::json!([1.0, 1.5, null, 0.5]));
    let errors = page["panels"].as_array().unwrap().last().unwrap();
    let [row] = &errors["series"].as_array().unwrap()[..] else { panic!("{errors}") };
    assert_eq!((&row["name"], &row["count"]), (&"node 1 silent".into(), &3.into()));
}

#[cfg(feature = "plot")]
#[test]
fn a_png_has_its_size_and_the_colours_of_the_curves() {
    let folder = Folder::new("png");
    let svg = String::from_utf8(plot("motors.pcapng", &[], &folder.path("a.svg"))).unwrap();
    let height = svg.split("height=\"").nth(1).unwrap().split('"').next().unwrap();
    let height: u32 = height.parse().unwrap();
    let png = plot("motors.pcapng", &[], &folder.path("a.png"));
    let picture = tiny_skia::Pixmap::decode_png(&png).unwrap();
    assert_eq!((picture.width(), picture.height()), (2 * 960, 2 * height));
    let count = |rgb: (u8, u8, u8)| {
        let is_it =
            |dot: &&tiny_skia::PremultipliedColorU8| (dot.red(), dot.green(), dot.blue()) == rgb;
        picture.pixels().iter().filter(is_it).count()
    };
    assert!(count((0x00, 0x72, 0xB2)) > 1000, "node 1");
    assert!(count((0x9A, 0x8F, 0x00)) > 1000, "node 7");
    assert!(count((0x22, 0x26, 0x2B)) > 100, "letters");
    assert!(count((0xFF, 0xFF, 0xFF)) > 1_000_000, "paper");
}

#[cfg(feature = "plot")]
#[test]
fn the_page_needs_no_network_and_a_file_name_cannot_end_its_script() {
    let folder = Folder::new("name");
    let capture = folder.path("a<script>alert(1)&{{data}}{{script}}<!--\u{7}.bin");
    fs::copy(Path::new(CAPTURES).join("ucp.bin"), &capture).unwrap();
    let page = String::from_utf8(plot(&capture, &[], &folder.path("a.html"))).unwrap();
    let lower = page.to_lowercase();
    for needing in ["http:", "https:", "src=", "@import", "url(", "fetch(", "xmlhttp", "import("] {
        assert!(!lower.contains(needing), "{needing}");
    }
    assert_eq!(page.matches("<script").count(), 2);
    assert_eq!(page.matches("</script>").count(), 2);
    let title = "<title>a&lt;script>alert(1)&amp;{{data}}{{script}}&lt;!--\u{FFFD}.bin  ·  ucp";
    assert!(page.contains(title), "{}", &page[..300]);
    assert!(!page.contains('\u{7}') && !page.contains("<!--"));
    let svg = String::from_utf8(plot(&capture, &[], &folder.path("a.svg"))).unwrap();
    assert!(svg.contains("a&lt;script&gt;alert(1)&amp;{{data}}") && !svg.contains('\u{7}'));
    // XML has no place for these at all.
    let capture = folder.path("b\u{FFFE}\u{FFFF}.bin");
    fs::copy(Path::new(CAPTURES).join("ucp.bin"), &capture).unwrap();
    let svg = String::from_utf8(plot(&capture, &[], &folder.path("a.svg"))).unwrap();
    assert!(
        svg.contains("<title>b\u{FFFD}\u{FFFD}.bin") && !svg.contains(['\u{FFFE}', '\u{FFFF}'])
    );
}

#[cfg(feature = "plot")]
#[test]
fn bad_input_and_a_bad_output_leave_no_file() {
    let folder = Folder::new("bad");
    let motors = fs::read(Path::new(CAPTURES).join("motors.pcapng")).unwrap();
    let mut two = PcapNg(answers(&[1.0]));
    two.interface(147);
    two.packet(1, (2_000_000, 1, ReadRequest::new(NodeId::N1).as_bytes()));
    let mut foreign = PcapNg::new(1, &[(1, 1, &[1, 2, 3, 4])]);
    foreign.packet(0, (2, 1, &[5, 6]));
    let reads = PcapNg::new(147, &[(1, 1, ReadRequest::new(NodeId::N1).as_bytes())]);
    let inputs: [(&str, &[u8], &[&str], &str); 9] = [
        ("cut.pcapng", &motors[..5000], &[], "the file ends inside the pcapng block at byte 4960"),
        ("empty.bin", &[], &[], "the capture is empty"),
        ("empty.pcapng", &PcapNg::new(147, &[]).0, &[], "the capture is empty"),
        ("noise.bin", &[7; 1000], &[], "no frame of any protocol in the first 1000 bytes"),
        ("other.pcapng", &motors, &["-P", "ucp"], "no frame in "),
        ("foreign.pcapng", &foreign.0, &[], "link type 1"),
        ("two.pcapng", &two.0, &[], "more than one line: choose one with --interface"),
        ("two.pcapng", &two.0, &["--interface", "7"], "nothing on that interface"),
        ("reads.pcapng", &reads.0, &[], "no ikeya frame of this capture has a value to draw"),
    ];
    for (name, bytes, more, expected) in inputs {
        let path = folder.path(name);
        fs::write(&path, bytes).unwrap();
        for picture in ["a.svg", "a.png", "a.html"] {
            let output = folder.path(picture);
            let said = complaint(&[&[&*path, "-o", &output], more].concat(), 1);
            assert!(said.contains(expected), "{name}: {said}");
        }
        assert_eq!(folder.names(), [name], "nothing is left");
        fs::remove_file(path).unwrap();
    }

    let good = folder.path("good.pcapng");
    fs::write(&good, answers(&[1.0, 2.0])).unwrap();
    let nowhere = folder.path("no/such/folder.svg");
    assert!(complaint(&[&good, "-o", &nowhere], 1).starts_with("cannot create "));
    for (output, code) in [("a.pdf", 2), ("a", 2), ("-", 2)] {
        let said = complaint(&[&good, "-o", &folder.path(output)], code);
        assert!(said.ends_with("does not end in .svg, .png or .html"), "{said}");
    }
    fs::create_dir(folder.path("folder.svg")).unwrap();
    complaint(&[&good, "--force", "-o", &folder.path("folder.svg")], 1);
    let old = folder.path("old.svg");
    fs::write(&old, "old").unwrap();
    assert!(complaint(&[&good, "-o", &old], 1).contains("remove it first"));
    assert_eq!(fs::read_to_string(&old).unwrap(), "old");
    assert_eq!(folder.names(), ["folder.svg", "good.pcapng", "old.svg"]);
    let missing = complaint(&[&folder.path("none"), "-o", &folder.path("a.svg")], 1);
    assert!(missing.starts_with("cannot open "), "{missing}");
    plot(&good, &[], &old);
    assert!(fs::read_to_string(&old).unwrap().starts_with("<svg"));
}

#[cfg(feature = "plot")]
#[test]
fn one_line_of_several_is_drawn_when_it_is_chosen() {
    let folder = Folder::new("two");
    let mut two = PcapNg(answers(&[1.0, 2.0]));
    two.interface(147);
    let answer = VelocityResponse::new(NodeId::N5, Rps::new(-3.0).unwrap());
    two.packet(1, (1_500_000, 1, answer.as_bytes()));
    let path = folder.path("two.pcapng");
    fs::write(&path, &two.0).unwrap();
    let names = |interface: &str| -> Vec<_> {
        curves(&page(&path, &["--interface", interface])).into_keys().collect()
    };
    let expected = |all: &[(&str, &str)]| -> Vec<_> {
        all.iter().map(|(panel, name)| ((*panel).to_owned(), (*name).to_owned())).collect()
    };
    assert_eq!(names("0"), expected(&[("Response time", "node 1"), ("Velocity", "node 1")]));
    assert_eq!(names("1"), expected(&[("Velocity", "node 5")]));
}

#[cfg(feature = "plot")]
#[test]
fn each_motor_of_a_board_of_three_has_its_curves() {
    use axlewire::ikeya::three;
    let folder = Folder::new("three");
    let speeds = |first: f32| [first, -1.0, 2.5].map(|rps| Rps::new(rps).unwrap());
    let mut bytes = vec![];
    for first in [0.5, 0.75, 1.0] {
        bytes.extend(ReadRequest::new(NodeId::N2).as_bytes());
        bytes.extend(three::VelocityResponse::new(NodeId::N2, speeds(first)).as_bytes());
    }
    let path = folder.path("three.bin");
    fs::write(&path, &bytes).unwrap();
    let page = page(&path, &["-P", "ikeya-3"]);
    let velocity = |motor: &str| ("Velocity".to_owned(), format!("node 2, motor {motor}"));
    let found = curves(&page);
    let expected = [
        (velocity("1"), vec![(4.0, 0.5), (24.0, 0.75), (44.0, 1.0)]),
        (velocity("2"), vec![(4.0, -1.0), (24.0, -1.0), (44.0, -1.0)]),
        (velocity("3"), vec![(4.0, 2.5), (24.0, 2.5), (44.0, 2.5)]),
    ];
    assert_eq!(found, expected.into());
    assert!(page["panels"][0]["hint"].as_str().unwrap().contains("the three motors of a node"));
}

/// Draws a rover's reports from standard input; the peak of the tool's memory in KiB, and the page.
#[cfg(all(feature = "plot", target_os = "linux"))]
fn peak_of(reports: usize, folder: &Folder) -> (usize, Value) {
    use axlewire::ucp::{Body, Telemetry, message::FirmwareReport};
    let output = folder.path("a.html");
    let args = ["plot", "-P", "ucp", "-", "--force", "-o", &output];
    let mut child: Child = axle(&args).stdin(Stdio::piped()).spawn().unwrap();
    let mut stdin = child.stdin.take().unwrap();
    for number in 0..reports {
        let wheel = if number == reports / 3 { 30_000 } else { (number % 200) as i16 };
        let telemetry = Telemetry { rpm: [wheel; 4], ..Telemetry::default() };
        let report = FirmwareReport::new(&telemetry, 38).frame(number as u8);
        stdin.write_all(report.as_bytes()).unwrap();
    }
    // The pipe holds the last of it, and the rest has been read.
    let status = fs::read_to_string(format!("/proc/{}/status", child.id())).unwrap();
    let peak = status.lines().find_map(|line| line.strip_prefix("VmHWM:")).unwrap();
    let peak = peak.trim().trim_end_matches(" kB").parse().unwrap();
    drop(stdin);
    assert!(child.wait().unwrap().success());
    let page = fs::read_to_string(&output).unwrap();
    let (_, rest) = page.split_once("<script id=\"data\" type=\"application/json\">").unwrap();
    (peak, serde_json::from_str(rest.split_once("</script>").unwrap().0).unwrap())
}

#[cfg(all(feature = "plot", target_os = "linux"))]
#[test]
fn memory_does_not_grow_with_the_capture_and_no_peak_is_lost() {
    let folder = Folder::new("long");
    let (short, _) = peak_of(20_000, &folder);
    let (long, page) = peak_of(160_000, &folder);
    assert!(long < short + 2048, "{short} KiB, then {long} KiB");
    let notes = page["notes"].to_string();
    assert!(notes.contains("first, lowest, highest and last value of each"), "{notes}");
    for ((panel, name), points) in curves(&page) {
        assert!(points.len() <= 4 * 4096, "{name}");
        if panel == "Wheel speed" {
            let ys: Vec<_> = points.iter().map(|(_, y)| *y).collect();
            assert_eq!(ys.iter().copied().fold(0.0, f64::max), 30_000.0);
            assert_eq!(count_of(&page, &(panel, name)), 160_000);
        }
    }
}

/// Names of the series of the errors of a capture of raw bytes, with their number of points.
#[cfg(feature = "plot")]
fn errors_of(name: &str, bytes: &[u8]) -> Vec<(String, u64)> {
    let folder = Folder::new(name);
    let capture = folder.path("a.bin");
    fs::write(&capture, bytes).unwrap();
    let page = page(&capture, &[]);
    let panels = page["panels"].as_array().unwrap();
    let Some(errors) = panels.iter().find(|panel| panel["title"] == "Errors") else {
        return Vec::new();
    };
    let series = errors["series"].as_array().unwrap().iter();
    series
        .map(|it| (it["name"].as_str().unwrap().to_owned(), it["count"].as_u64().unwrap()))
        .collect()
}

#[cfg(feature = "plot")]
#[test]
fn a_second_answer_to_one_request_is_an_error_and_one_before_any_request_is_not() {
    let answer = |node| VelocityResponse::new(node, Rps::new(1.0).unwrap());
    let (one, two) = (answer(NodeId::N1), answer(NodeId::N2));
    let read = ReadRequest::new(NodeId::N1);
    let (one, two, read) =
        (one.as_bytes().as_slice(), two.as_bytes().as_slice(), read.as_bytes().as_slice());
    let found = errors_of("unasked", &[one, read, one, one, two].concat());
    assert_eq!(found, [("node 1 unasked".to_owned(), 1), ("node 2 unasked".to_owned(), 1)]);
    assert_eq!(errors_of("asked", &[one, two, read, one].concat()), []);
}

#[cfg(feature = "plot")]
#[test]
fn an_option_that_does_not_fit_the_capture_is_an_error() {
    let folder = Folder::new("options");
    let [raw, timed] =
        ["ucp.bin", "drive.pcapng"].map(|it| Path::new(CAPTURES).join(it).display().to_string());
    let output = folder.path("a.svg");
    let said = complaint(&[&raw, "-o", &output, "--interface", "5"], 2);
    assert_eq!(said, "--interface is for pcapng files: raw bytes are one line");
    let said = complaint(&[&timed, "-o", &output, "--baud", "9600"], 2);
    assert_eq!(said, "--baud is for raw bytes: a pcapng file has times");
    assert!(folder.names().is_empty());
}

#[cfg(feature = "plot")]
#[test]
fn a_rover_that_starts_again_has_lost_no_report() {
    use axlewire::ucp::{Body, Telemetry, message::FirmwareReport};
    let report = |index| {
        let sent = FirmwareReport::new(&Telemetry::default(), 38).frame(index);
        sent.as_bytes().to_vec()
    };
    let bytes =
        |indices: &[u8]| indices.iter().flat_map(|index| report(*index)).collect::<Vec<_>>();
    assert_eq!(errors_of("again", &bytes(&[10, 11, 11, 12, 0, 1, 2])), []);
    let lost = [("report lost".to_owned(), 3)];
    assert_eq!(errors_of("lost", &bytes(&[254, 255, 0, 4, 5])), lost);
}
