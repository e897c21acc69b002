//! Where plotters draws: its backend for the two pens of the tool. Its coordinates are whole
//! numbers, so a pixel is many of them, and curves stay smooth.

use core::convert::Infallible;

use plotters::prelude::DrawingBackend;
use plotters_backend::{
    BackendColor, BackendCoord, BackendStyle, BackendTextStyle, DrawingErrorKind, FontStyle,
    text_anchor::{HPos, VPos},
};

use super::letters::Letters;

/// Coordinates per pixel.
pub(super) const FINE: i32 = 16;

/// A place in pixels.
pub(super) type Place = (f32, f32);

/// Colour and opacity.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Ink {
    pub(super) rgb: (u8, u8, u8),
    pub(super) opacity: f32,
}

/// A text and how it looks.
#[derive(Clone, Copy, Debug)]
pub(super) struct Text<'a> {
    pub(super) text: &'a str,
    pub(super) size: f32,
    pub(super) is_bold: bool,
    pub(super) ink: Ink,
    /// How much of its width is in front of its place: 0, a half or 1.
    pub(super) before: f32,
}

/// Draws on something.
pub(super) trait Pen {
    fn line(&mut self, points: &[Place], width: f32, ink: Ink);
    fn dot(&mut self, centre: Place, radius: f32, ink: Ink);
    fn area(&mut self, corners: &[Place], ink: Ink);
    /// A text at this place of its base line.
    fn text(&mut self, text: &Text<'_>, at: Place, letters: &Letters);
}

/// A picture of this size in pixels.
pub(super) struct Canvas<'a, P> {
    pub(super) pen: &'a mut P,
    pub(super) letters: &'a Letters,
    pub(super) size: (u32, u32),
}

type Drawn = Result<(), DrawingErrorKind<Infallible>>;

fn place((x, y): BackendCoord) -> Place {
    (x as f32 / FINE as f32, y as f32 / FINE as f32)
}

fn ink(color: BackendColor) -> Ink {
    Ink { rgb: color.rgb, opacity: color.alpha as f32 }
}

fn pixels(length: f64) -> f32 {
    (length / f64::from(FINE)) as f32
}

impl<P: Pen> Canvas<'_, P> {
    fn stroke(&mut self, points: &[Place], style: &impl BackendStyle) -> Drawn {
        let width = pixels(style.stroke_width().into());
        if style.color().alpha > 0.0 && width > 0.0 {
            self.pen.line(points, width, ink(style.color()));
        }
        Ok(())
    }
}

impl<P: Pen> DrawingBackend for Canvas<'_, P> {
    type ErrorType = Infallible;

    fn get_size(&self) -> (u32, u32) {
        let fine = FINE.unsigned_abs();
        (self.size.0 * fine, self.size.1 * fine)
    }

    fn ensure_prepared(&mut self) -> Drawn {
        Ok(())
    }

    fn present(&mut self) -> Drawn {
        Ok(())
    }

    fn draw_pixel(&mut self, point: BackendCoord, color: BackendColor) -> Drawn {
        self.pen.dot(place(point), 0.5, ink(color));
        Ok(())
    }

    fn draw_line<S: BackendStyle>(
        &mut self,
        from: BackendCoord,
        to: BackendCoord,
        style: &S,
    ) -> Drawn {
        self.stroke(&[place(from), place(to)], style)
    }

    fn draw_path<S: BackendStyle, I: IntoIterator<Item = BackendCoord>>(
        &mut self,
        path: I,
        style: &S,
    ) -> Drawn {
        let points: Vec<_> = path.into_iter().map(place).collect();
        self.stroke(&points, style)
    }

    fn draw_rect<S: BackendStyle>(
        &mut self,
        upper_left: BackendCoord,
        bottom_right: BackendCoord,
        style: &S,
        fill: bool,
    ) -> Drawn {
        let ((left, top), (right, bottom)) = (place(upper_left), place(bottom_right));
        let corners = [(left, top), (right, top), (right, bottom), (left, bottom), (left, top)];
        if !fill {
            return self.stroke(&corners, style);
        }
        self.pen.area(&corners, ink(style.color()));
        Ok(())
    }

    fn draw_circle<S: BackendStyle>(
        &mut self,
        center: BackendCoord,
        radius: u32,
        style: &S,
        _: bool,
    ) -> Drawn {
        self.pen.dot(place(center), pixels(radius.into()), ink(style.color()));
        Ok(())
    }

    fn fill_polygon<S: BackendStyle, I: IntoIterator<Item = BackendCoord>>(
        &mut self,
        vert: I,
        style: &S,
    ) -> Drawn {
        let corners: Vec<_> = vert.into_iter().map(place).collect();
        self.pen.area(&corners, ink(style.color()));
        Ok(())
    }

    fn draw_text<T: BackendTextStyle>(&mut self, text: &str, style: &T, at: BackendCoord) -> Drawn {
        let size = pixels(style.size());
        let before = match style.anchor().h_pos {
            HPos::Left => 0.0,
            HPos::Center => 0.5,
            HPos::Right => 1.0,
        };
        let below = match style.anchor().v_pos {
            VPos::Top => 1.0,
            VPos::Center => 0.5,
            VPos::Bottom => 0.0,
        };
        let (x, y) = place(at);
        let is_bold = matches!(style.style(), FontStyle::Bold);
        let text = Text { text, size, is_bold, ink: ink(style.color()), before };
        self.pen.text(&text, (x, y + below * self.letters.height(size)), self.letters);
        Ok(())
    }

    fn estimate_text_size<T: BackendTextStyle>(
        &self,
        text: &str,
        style: &T,
    ) -> Result<(u32, u32), DrawingErrorKind<Infallible>> {
        let size = style.size() as f32;
        let is_bold = matches!(style.style(), FontStyle::Bold);
        let (width, height) = (self.letters.width(text, size, is_bold), self.letters.height(size));
        Ok((width.ceil() as u32, height.ceil() as u32))
    }
}
