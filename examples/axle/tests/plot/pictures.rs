//! SVG, PNG and the page, and captures that make none.

use std::{fs, path::Path};

use axlewire::ikeya::{NodeId, ReadRequest, Rps, VelocityResponse};

use crate::{
    CAPTURES, Folder, complaint,
    curves::{answers, page, plot},
    support::pcapng::PcapNg,
};

/// Absolute points of the path of an SVG that is drawn with this ink and width.
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
fn labels(svg: &str, anchor: &str) -> Vec<(f64, String)> {
    let middle = format!("fill=\"#6a727c\" text-anchor=\"{anchor}\">");
    let lines = svg.lines().filter_map(|line| line.split_once(&middle));
    let labels = lines.map(|(place, text)| {
        let x = place.strip_prefix("<text x=\"").unwrap().split('"').next().unwrap();
        (x.parse().unwrap(), text.strip_suffix("</text>").unwrap().to_owned())
    });
    labels.collect()
}

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

#[test]
fn what_is_before_the_end_of_a_recording_that_was_cut_is_drawn_and_it_is_said() {
    let folder = Folder::new("cut");
    let motors = fs::read(Path::new(CAPTURES).join("motors.pcapng")).unwrap();
    let path = folder.path("cut.pcapng");
    fs::write(&path, &motors[..5000]).unwrap();
    for picture in ["a.svg", "a.png", "a.html"] {
        let output = folder.path(picture);
        let said = complaint(&[&path, "-o", &output], 1);
        let says = "the file ends inside the pcapng block at byte 4960; what is before that was \
                    taken";
        assert!(said.ends_with(says), "{said}");
        assert!(fs::metadata(&output).unwrap().len() > 1000, "{picture}");
    }
}

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
    let inputs: [(&str, &[u8], &[&str], &str); 8] = [
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
