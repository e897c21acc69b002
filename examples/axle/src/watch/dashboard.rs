//! The page at work: what it knows, how it looks, the terminal and the keys.

use axlewire::stream::Framing;
use ratatui_core::{buffer::Buffer, layout::Rect};

use super::{
    feed::Feed,
    model::{Heard, Model, OfLine},
    page::{self, Filter, View},
    screen::{self, Keys, Screen, Sink},
};
use crate::failure::Failure;

/// Shortest time between two pictures, microseconds.
const DRAW_PERIOD: u64 = 100_000;

/// The page of a line.
pub(crate) struct Dashboard<F> {
    pub(crate) feed: Feed<F>,
    pub(crate) view: View,
    screen: Screen,
    keys: Option<Keys>,
    /// What is shown instead while the picture is paused.
    frozen: Option<Box<Model>>,
    drawn_at: Option<u64>,
    /// Model revision and size of the last picture.
    drawn: (u64, Rect),
    /// The user has changed something.
    is_new: bool,
}

impl<F> Dashboard<F>
where
    F: Framing,
    for<'a> F::Frame<'a>: Heard,
{
    pub(crate) fn open(feed: Feed<F>, view: View, sink: Sink) -> Result<Self, Failure> {
        let screen = Screen::enter()?;
        let keys = screen.has_keys().then(|| Keys::listen(sink));
        let (frozen, drawn_at, drawn) = (None, None, (0, Rect::ZERO));
        Ok(Self { feed, view, screen, keys, frozen, drawn_at, drawn, is_new: true })
    }

    /// Takes in the time, and shows a new picture if one is due.
    pub(crate) fn tick(&mut self, now: u64) -> Result<(), Failure> {
        if self.drawn_at.is_some_and(|at| now < at + DRAW_PERIOD) {
            return Ok(());
        }
        self.drawn_at = Some(now);
        self.feed.tick(now);
        let model = self.frozen.as_deref().unwrap_or(&self.feed.model);
        let size = screen::size().unwrap_or(Rect::new(0, 0, 80, 24));
        let shown = (model.revision, size);
        if self.drawn == shown && !self.is_new {
            return Ok(());
        }
        (self.drawn, self.is_new) = (shown, false);
        let mut picture = Buffer::empty(size);
        page::draw(&self.view, model, &mut picture);
        self.screen.show(picture)
    }

    /// The next key that is not about the picture.
    pub(crate) fn key(&mut self) -> Option<u8> {
        loop {
            let key = self.keys.as_ref()?.next()?;
            self.is_new = true;
            match key {
                b'p' => {
                    self.view.is_paused = !self.view.is_paused;
                    let model = || Box::new(self.feed.model.clone());
                    self.frozen = self.view.is_paused.then(model);
                }
                b'f' => self.view.filter = self.next_filter(),
                b'?' => self.view.has_help = !self.view.has_help,
                key => return Some(key),
            }
        }
    }

    /// All, gaps only, then each node in turn.
    fn next_filter(&self) -> Filter {
        let nodes: Vec<_> = match &self.feed.model.line {
            OfLine::Bus(bus) => bus.nodes().map(|(id, _)| id).collect(),
            OfLine::Rover(_) => Vec::new(),
        };
        let next = match self.view.filter {
            Filter::All => return Filter::Gaps,
            Filter::Gaps => nodes.first(),
            Filter::Node(node) => nodes.iter().find(|other| other.get() > node.get()),
        };
        next.copied().map_or(Filter::All, Filter::Node)
    }

    /// Forces a redraw at the next tick.
    pub(crate) fn renew(&mut self) {
        self.is_new = true;
    }

    /// Gives the terminal away until `meanwhile` returns whether to come back.
    pub(crate) fn away(&mut self, meanwhile: impl FnOnce() -> bool) -> Result<(), Failure> {
        self.screen.leave();
        if meanwhile() {
            self.screen = Screen::enter()?;
            (self.is_new, self.drawn_at) = (true, None);
        }
        Ok(())
    }

    /// Leaves the page for good.
    pub(crate) fn leave(mut self) -> Feed<F> {
        self.screen.leave();
        self.feed
    }
}
