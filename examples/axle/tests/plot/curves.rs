//! The values of the curves.

use std::{
    collections::BTreeMap,
    fs,
    io::Write,
    path::Path,
    process::{Child, Stdio},
};

use axlewire::ikeya::{NodeId, ReadRequest, Rps, VelocityResponse};
use serde_json::Value;

use crate::{
    CAPTURES, Folder,
    support::{axle, events, pcapng::PcapNg, stdout},
};

/// Draws one of our captures, or a file with its path.
pub(crate) fn plot(capture: &str, more: &[&str], output: &str) -> Vec<u8> {
    let path = Path::new(CAPTURES).join(capture);
    let args = [&["plot", path.to_str().unwrap(), "--force", "-o", output], more].concat();
    assert_eq!(stdout(axle(&args).output().unwrap()), "");
    fs::read(output).unwrap()
}

/// The data in the page of a capture.
pub(crate) fn page(capture: &str, more: &[&str]) -> Value {
    let folder = Folder::new("page");
    let page = String::from_utf8(plot(capture, more, &folder.path("a.html"))).unwrap();
    let (_, rest) = page.split_once("<script id=\"data\" type=\"application/json\">").unwrap();
    serde_json::from_str(rest.split_once("</script>").unwrap().0).unwrap()
}

/// What `axle decode --json` says.
fn listing(capture: &str, more: &[&str]) -> Vec<Value> {
    let path = Path::new(CAPTURES).join(capture);
    let args = [&["decode", "--json", path.to_str().unwrap()], more].concat();
    events(&stdout(axle(&args).output().unwrap())).0
}

type Curves = BTreeMap<(String, String), Vec<(f64, f64)>>;

/// The points of all curves by panel and name.
pub(crate) fn curves(page: &Value) -> Curves {
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
fn seconds(line: &Value, first: &Value) -> f64 {
    let micros = |line: &Value| (line["t"].as_f64().unwrap() * 1e6).round();
    (micros(line) - micros(first)) / 1e6
}

/// The numbers of a field, one or several.
fn numbers(field: &Value) -> Vec<f64> {
    match field.as_array() {
        Some(several) => several.iter().map(|one| one.as_f64().unwrap()).collect(),
        None => vec![field.as_f64().unwrap()],
    }
}

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
                if let Some((_, since)) = asked.take_if(|(of, _)| *of == node) {
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
fn same(found: &[(f64, f64)], expected: &[(f64, f64)], name: &(String, String)) {
    assert_eq!(found.len(), expected.len(), "{name:?}");
    for (found, expected) in found.iter().zip(expected) {
        let is_near = (found.1 - expected.1).abs() <= 1e-12 * expected.1.abs();
        assert!(found.0 == expected.0 && is_near, "{name:?}: {found:?} is not {expected:?}");
    }
}

/// The number of all values of a curve.
pub(crate) fn count_of(page: &Value, (title, name): &(String, String)) -> u64 {
    let panels = page["panels"].as_array().unwrap();
    let panel = panels.iter().find(|panel| panel["title"] == **title).unwrap();
    let series = panel["series"].as_array().unwrap().iter();
    let series = series.clone().find(|series| series["name"] == **name).unwrap();
    series["count"].as_u64().unwrap()
}

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
pub(crate) fn answers(speeds: &[f32]) -> Vec<u8> {
    let mut capture = PcapNg::new(147, &[]);
    for (at, speed) in (1_000_000..).step_by(100_000).zip(speeds) {
        let answer = VelocityResponse::new(NodeId::N1, Rps::new(*speed).unwrap());
        capture.packet(0, (at, 1, ReadRequest::new(NodeId::N1).as_bytes()));
        capture.packet(0, (at + 250, 1, answer.as_bytes()));
    }
    capture.0
}

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
