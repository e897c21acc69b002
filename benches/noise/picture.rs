//! `benches/noise.svg`: what the plain receiver delivers of each line, as bars.

use std::fmt::Write;

use super::noisy_line::Tally;

/// Title and rate of each noise, in the order of `Noise::ALL`.
const NOISES: [[&str; 2]; 10] = [
    ["no noise", ""],
    ["bits", "10⁻⁵"],
    ["bits", "10⁻⁴"],
    ["bits", "10⁻³"],
    ["lost bytes", "10⁻⁴"],
    ["lost bytes", "10⁻³"],
    ["bursts", "1 in 10"],
    ["bursts", "always"],
    ["headers", "1 in 2"],
    ["cut off", "1 in 20"],
];

/// Title and colour of each kind of traffic, in the order of `Traffic::ALL`.
const TRAFFICS: [[&str; 2]; 5] = [
    ["UCP, both ways", "#c05a2b"],
    ["UCP, to the robot", "#d99a2b"],
    ["Ikeya, answers", "#7a4b9a"],
    ["Ikeya, requests", "#b06fa8"],
    ["Ikeya, three motors", "#4f6fae"],
];

const OURS: &str = "#0d3b4c";
const LEFT: f64 = 66.0;
const RIGHT: f64 = 900.0;
const TOP: f64 = 64.0;
const BOTTOM: f64 = 300.0;

/// The picture of the tallies of all lines: for each traffic, all noises.
///
/// # Panics
///
/// If a line is missing.
pub(super) fn of(plain: &[Tally]) -> String {
    assert_eq!(plain.len(), NOISES.len() * TRAFFICS.len(), "the picture is of all lines");
    let height_of = |share: f64| BOTTOM - (BOTTOM - TOP) * share / 100.0;
    let mut svg = Svg(String::new());
    svg.add(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 920 420\" \
         font-family=\"sans-serif\" font-size=\"12\" fill=\"#222\">",
    );
    svg.add("<rect width=\"920\" height=\"420\" fill=\"#fff\"/>");
    svg.text(LEFT, 26.0, "Intact frames delivered on a noisy line", "font-weight=\"bold\"");
    for share in [0.0, 20.0, 40.0, 60.0, 80.0, 100.0] {
        svg.line(height_of(share), "stroke=\"#ddd\"");
        svg.text(LEFT - 8.0, height_of(share) + 4.0, &format!("{share} %"), END);
    }

    let group = (RIGHT - LEFT) / NOISES.len() as f64;
    let bar = group / (TRAFFICS.len() + 1) as f64;
    for (at, [title, rate]) in NOISES.into_iter().enumerate() {
        let start = LEFT + at as f64 * group + bar / 2.0;
        let mut lowest = 100.0_f64;
        for (number, [_, colour]) in TRAFFICS.into_iter().enumerate() {
            let tally = &plain[number * NOISES.len() + at];
            let share = 100.0 * tally.delivered as f64 / tally.intact as f64;
            let (x, y) = (start + number as f64 * bar, height_of(share));
            svg.rect(x, y, [bar - 2.0, BOTTOM - y], colour);
            lowest = lowest.min(share);
        }
        // Never rounded up to 100.
        let tenths = (10.0 * lowest).floor() / 10.0;
        let lowest = if lowest == 100.0 { "100 %".into() } else { format!("{tenths:.1} %") };
        let middle = start + bar * TRAFFICS.len() as f64 / 2.0;
        svg.text(middle, BOTTOM + 18.0, title, MIDDLE);
        svg.text(middle, BOTTOM + 34.0, rate, MIDDLE);
        svg.text(middle, BOTTOM + 50.0, &lowest, &format!("{MIDDLE} font-weight=\"bold\""));
    }

    // Last, so that it lies on the bars.
    svg.line(TOP, &format!("stroke=\"{OURS}\" stroke-width=\"4\""));
    let style = format!("{END} font-weight=\"bold\" fill=\"{OURS}\"");
    svg.text(RIGHT, TOP - 10.0, "axlewire, in all its ways to decode: 100 %", &style);
    let legend = "Bars: a plain receiver, which drops a bad frame whole. In bold: the lowest of the \
                  five.";
    svg.text(LEFT, BOTTOM + 78.0, legend, "");
    for (number, [title, colour]) in TRAFFICS.into_iter().enumerate() {
        let x = LEFT + number as f64 * 160.0;
        svg.rect(x, BOTTOM + 90.0, [11.0, 11.0], colour);
        svg.text(x + 17.0, BOTTOM + 100.0, title, "");
    }
    svg.add("</svg>");
    svg.0
}

const MIDDLE: &str = "text-anchor=\"middle\"";
const END: &str = "text-anchor=\"end\"";

struct Svg(String);

impl Svg {
    fn add(&mut self, element: &str) {
        writeln!(self.0, "{element}").expect("strings grow");
    }

    fn text(&mut self, x: f64, y: f64, words: &str, style: &str) {
        self.add(&format!("<text x=\"{x:.1}\" y=\"{y:.1}\" {style}>{words}</text>"));
    }

    fn rect(&mut self, x: f64, y: f64, [width, height]: [f64; 2], colour: &str) {
        self.add(&format!(
            "<rect x=\"{x:.1}\" y=\"{y:.1}\" width=\"{width:.1}\" height=\"{height:.1}\" \
             fill=\"{colour}\"/>"
        ));
    }

    fn line(&mut self, y: f64, style: &str) {
        self.add(&format!(
            "<line x1=\"{LEFT}\" y1=\"{y:.1}\" x2=\"{RIGHT}\" y2=\"{y:.1}\" {style}/>"
        ));
    }
}
