//! The pen for SVG. What is drawn the same way becomes one path, with one decimal, relative to the
//! point before: a picture of thousands of values has some ten kilobytes.

use core::fmt::Write;

use super::{
    canvas::{Ink, Pen, Place, Text},
    letters::Letters,
};

/// Tenths of a pixel.
type Fixed = (i32, i32);

/// The text of a picture.
pub(super) struct Svg {
    text: String,
    /// The path that grows: how it is drawn, and where it is.
    open: Option<(Stroke, Fixed)>,
}

#[derive(Clone, Copy, PartialEq)]
struct Stroke {
    ink: Ink,
    width: f32,
    is_round: bool,
}

impl Svg {
    /// A picture of this size in pixels.
    pub(super) fn new((width, height): (u32, u32), title: &str) -> Self {
        let mut svg = Self { text: String::new(), open: None };
        svg.write(format_args!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {width} {height}\" \
             width=\"{width}\" height=\"{height}\" font-family=\"Inter,'Helvetica Neue',Arial,\
             'DejaVu Sans',sans-serif\" role=\"img\">\n<title>{}</title>\n",
            escaped(title)
        ));
        svg
    }

    /// The whole text.
    pub(super) fn finish(mut self) -> String {
        self.end_path();
        self.text.push_str("</svg>\n");
        self.text
    }

    fn write(&mut self, arguments: core::fmt::Arguments<'_>) {
        // Writing to memory does not fail.
        let _ = self.text.write_fmt(arguments);
    }

    fn end_path(&mut self) {
        if self.open.take().is_some() {
            self.text.push_str("\"/>\n");
        }
    }

    /// Goes on with the open path if it is drawn that way, or begins one.
    fn path(&mut self, stroke: Stroke, begin: Fixed) {
        match self.open {
            Some((open, at)) if open == stroke => {
                self.text.push('m');
                self.pair(begin.0 - at.0, begin.1 - at.1);
            }
            _ => {
                self.end_path();
                let Stroke { ink, width, is_round } = stroke;
                let cap = if is_round { " stroke-linecap=\"round\"" } else { "" };
                let opacity = opacity(ink, "stroke-");
                self.write(format_args!(
                    "<path fill=\"none\" stroke=\"{}\" stroke-width=\"{}\" \
                     stroke-linejoin=\"round\"{cap}{opacity} d=\"M",
                    colour(ink),
                    decimal((width * 10.0).round() as i32),
                ));
                self.pair(begin.0, begin.1);
            }
        }
        self.open = Some((stroke, begin));
    }

    /// Two numbers, in as few characters as possible.
    fn pair(&mut self, x: i32, y: i32) {
        let separator = if y < 0 { "" } else { " " };
        self.write(format_args!("{}{separator}{}", decimal(x), decimal(y)));
    }

    fn step(&mut self, to: Fixed) {
        let Some((stroke, at)) = self.open else { return };
        let by = (to.0 - at.0, to.1 - at.1);
        match by {
            (0, 0) => return,
            (x, 0) => self.write(format_args!("h{}", decimal(x))),
            (0, y) => self.write(format_args!("v{}", decimal(y))),
            (x, y) => {
                self.text.push('l');
                self.pair(x, y);
            }
        }
        self.open = Some((stroke, to));
    }
}

impl Pen for Svg {
    fn line(&mut self, points: &[Place], width: f32, ink: Ink) {
        let mut points = points.iter().map(|point| fixed(*point));
        let Some(begin) = points.next() else { return };
        self.path(Stroke { ink, width, is_round: false }, begin);
        points.for_each(|point| self.step(point));
    }

    /// A line of no length with round ends.
    fn dot(&mut self, centre: Place, radius: f32, ink: Ink) {
        self.path(Stroke { ink, width: 2.0 * radius, is_round: true }, fixed(centre));
        self.text.push_str("h0");
    }

    fn area(&mut self, corners: &[Place], ink: Ink) {
        self.end_path();
        let opacity = opacity(ink, "fill-");
        self.write(format_args!("<path fill=\"{}\"{opacity} d=\"", colour(ink)));
        for (number, corner) in corners.iter().enumerate() {
            self.text.push(if number == 0 { 'M' } else { 'L' });
            let (x, y) = fixed(*corner);
            self.pair(x, y);
        }
        self.text.push_str("z\"/>\n");
    }

    fn text(&mut self, text: &Text<'_>, (x, y): Place, _: &Letters) {
        self.end_path();
        let anchor = match text.before {
            0.0 => "",
            1.0 => " text-anchor=\"end\"",
            _ => " text-anchor=\"middle\"",
        };
        let weight = if text.is_bold { " font-weight=\"600\"" } else { "" };
        let (x, y) = fixed((x, y));
        self.write(format_args!(
            "<text x=\"{}\" y=\"{}\" font-size=\"{}\" fill=\"{}\"{anchor}{weight}>{}</text>\n",
            decimal(x),
            decimal(y),
            text.size,
            colour(text.ink),
            escaped(text.text)
        ));
    }
}

fn fixed((x, y): Place) -> Fixed {
    ((x * 10.0).round() as i32, (y * 10.0).round() as i32)
}

/// Tenths as a decimal number: `-.5`, `3`, `12.4`.
fn decimal(tenths: i32) -> String {
    let (whole, tenth) = (tenths.unsigned_abs() / 10, tenths.unsigned_abs() % 10);
    let sign = if tenths < 0 { "-" } else { "" };
    match (whole, tenth) {
        (whole, 0) => format!("{sign}{whole}"),
        (0, tenth) => format!("{sign}.{tenth}"),
        (whole, tenth) => format!("{sign}{whole}.{tenth}"),
    }
}

fn colour(ink: Ink) -> String {
    let (red, green, blue) = ink.rgb;
    format!("#{red:02x}{green:02x}{blue:02x}")
}

fn opacity(ink: Ink, of: &str) -> String {
    match ink.opacity {
        1.0 => String::new(),
        opacity => format!(" {of}opacity=\"{opacity:.2}\""),
    }
}

fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_drawn_the_same_way_is_one_path() {
        let mut svg = Svg::new((10, 10), "a < b");
        let ink = Ink { rgb: (1, 2, 255), opacity: 1.0 };
        svg.line(&[(1.0, 2.0), (1.5, 2.0), (1.5, 1.96), (3.0, 0.25)], 1.0, ink);
        svg.line(&[(0.0, 0.0), (0.0, -10.0)], 1.0, ink);
        svg.dot((5.0, 5.0), 0.5, ink);
        let text = svg.finish();
        assert!(text.contains("<title>a &lt; b</title>"));
        let paths: Vec<_> = text.lines().filter(|line| line.starts_with("<path")).collect();
        assert_eq!(paths.len(), 2, "{text}");
        assert!(paths[0].ends_with("d=\"M1 2h.5l1.5-1.7m-3-.3v-10\"/>"), "{text}");
        assert!(paths[1].ends_with("stroke-linecap=\"round\" d=\"M5 5h0\"/>"), "{text}");
        assert!(text.contains("#0102ff") && text.ends_with("</svg>\n"));
    }
}
