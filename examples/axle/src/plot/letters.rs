//! The letters of a picture: their width, and their outlines where they have to be drawn.

use ttf_parser::{Face, GlyphId, OutlineBuilder};

use crate::failure::Failure;

/// A font in two weights. Its bytes are part of the tool, so that a picture looks the same
/// everywhere.
pub(super) struct Letters {
    regular: Face<'static>,
    bold: Face<'static>,
}

/// Moves of a pen along an outline, in pixels.
pub(super) trait Outline {
    fn go(&mut self, to: (f32, f32));
    fn line(&mut self, to: (f32, f32));
    fn curve(&mut self, by: (f32, f32), to: (f32, f32));
    fn close(&mut self);
}

impl Letters {
    pub(super) fn new() -> Result<Self, Failure> {
        let face = |bytes| Face::parse(bytes, 0);
        let faces = face(dejavu::sans::regular()).and_then(|regular| {
            let bold = face(dejavu::sans::bold())?;
            Ok(Self { regular, bold })
        });
        faces.map_err(|error| Failure::Failed(format!("the font of the tool is odd: {error}")))
    }

    const fn face(&self, is_bold: bool) -> &Face<'static> {
        if is_bold { &self.bold } else { &self.regular }
    }

    /// Height of a capital letter, for letters of this size.
    pub(super) fn height(&self, size: f32) -> f32 {
        let capital = self
            .regular
            .capital_height()
            .map_or(0.73, |height| f32::from(height) / f32::from(self.regular.units_per_em()));
        capital * size
    }

    /// Width of a text.
    pub(super) fn width(&self, text: &str, size: f32, is_bold: bool) -> f32 {
        let face = self.face(is_bold);
        text.chars().map(|char| advance(face, glyph(face, char), size)).sum()
    }

    /// Draws a text that begins here, on its base line.
    pub(super) fn outline(
        &self,
        text: &str,
        size: f32,
        is_bold: bool,
        (x, y): (f32, f32),
        to: &mut impl Outline,
    ) {
        let face = self.face(is_bold);
        let scale = size / f32::from(face.units_per_em());
        let mut at = x;
        for char in text.chars() {
            let glyph = glyph(face, char);
            // A space has no outline.
            face.outline_glyph(glyph, &mut Scaled { to, at: (at, y), scale });
            at += advance(face, glyph, size);
        }
    }
}

/// The glyph of a character; that of no character for one that the font does not have.
fn glyph(face: &Face<'_>, char: char) -> GlyphId {
    face.glyph_index(char).unwrap_or(GlyphId(0))
}

fn advance(face: &Face<'_>, glyph: GlyphId, size: f32) -> f32 {
    let units = f32::from(face.glyph_hor_advance(glyph).unwrap_or(0));
    units * size / f32::from(face.units_per_em())
}

/// From the units of a font to pixels.
struct Scaled<'a, O> {
    to: &'a mut O,
    at: (f32, f32),
    scale: f32,
}

impl<O> Scaled<'_, O> {
    fn place(&self, x: f32, y: f32) -> (f32, f32) {
        (self.at.0 + x * self.scale, self.at.1 - y * self.scale)
    }
}

impl<O: Outline> OutlineBuilder for Scaled<'_, O> {
    fn move_to(&mut self, x: f32, y: f32) {
        self.to.go(self.place(x, y));
    }

    fn line_to(&mut self, x: f32, y: f32) {
        self.to.line(self.place(x, y));
    }

    fn quad_to(&mut self, x1: f32, y1: f32, x: f32, y: f32) {
        self.to.curve(self.place(x1, y1), self.place(x, y));
    }

    /// TrueType has no such curves.
    fn curve_to(&mut self, x1: f32, y1: f32, _: f32, _: f32, x: f32, y: f32) {
        self.quad_to(x1, y1, x, y);
    }

    fn close(&mut self) {
        self.to.close();
    }
}
