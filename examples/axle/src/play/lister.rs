//! The listing of what is sent and received.

use std::{
    cell::RefCell,
    io::{self, Write},
    mem,
    rc::Rc,
    time::{SystemTime, UNIX_EPOCH},
};

use super::plan::Plan;
use crate::{
    args::Protocol,
    clock,
    decode::{self, Sheet, Stream},
    line::Line,
    listing::{Modes, Style, TimeColumn},
    pcapng::Direction,
};

/// Lists what is sent and received on a line, once it is asked to.
pub(super) struct Lister(Rc<RefCell<Lists>>);

struct Lists {
    is_on: bool,
    sheet: Sheet,
    sent: Box<dyn Stream>,
    received: Box<dyn Stream>,
    start: std::time::Instant,
    /// The system's time at the start, microseconds since 1970.
    epoch_us: u64,
}

impl Lister {
    /// The same line, whose bytes are listed.
    pub(super) fn tap(plan: &Plan<'_>, line: Line) -> (Self, Line) {
        let lists = Rc::new(RefCell::new(Lists::new(plan.protocol, style(plan))));
        let tapped = Rc::clone(&lists);
        let line = line.tapped(move |direction, bytes| tapped.borrow_mut().take(direction, bytes));
        (Self(lists), line)
    }

    /// Lists what is said from now on, with what is known of the modes of the nodes.
    pub(super) fn begin(&self, modes: Modes) {
        let mut lists = self.0.borrow_mut();
        (lists.is_on, lists.sheet.modes) = (true, modes);
    }

    /// Lists what is held back, and nothing that is said from now on.
    pub(super) fn end(&self) -> Option<String> {
        let lists = &mut *self.0.borrow_mut();
        lists.is_on = false;
        lists.received.finish(&mut lists.sheet);
        lists.sent.finish(&mut lists.sheet);
        lists.lines()
    }

    /// Finished lines.
    pub(super) fn lines(&self) -> Option<String> {
        self.0.borrow_mut().lines()
    }
}

/// Lists the frames of a plan as they would be sent.
pub(super) fn list(plan: &Plan<'_>, out: &mut dyn Write) -> io::Result<()> {
    let mut lists = Lists::new(plan.protocol, style(plan));
    lists.sheet.modes = plan.modes;
    for due in &plan.frames {
        lists.sent.feed(&due.bytes, Some(due.after_us), &mut lists.sheet);
        out.write_all(&mem::take(&mut lists.sheet.out.0))?;
    }
    lists.sent.finish(&mut lists.sheet);
    out.write_all(&lists.sheet.out.0)
}

fn style(plan: &Plan<'_>) -> Style {
    match plan.is_json {
        true => Style::Json,
        false => Style::text(plan.protocol.number(), TimeColumn::Relative),
    }
}

impl Lists {
    fn new(protocol: Protocol, style: Style) -> Self {
        let mut sheet = Sheet::new(Some(style));
        style.titles(&mut sheet.out);
        Self {
            is_on: false,
            sheet,
            sent: decode::stream_of(protocol, Direction::Out),
            received: decode::stream_of(protocol, Direction::In),
            start: clock::now(),
            epoch_us: SystemTime::now()
                .duration_since(UNIX_EPOCH)
                .map_or(0, |since| since.as_micros() as u64),
        }
    }

    fn take(&mut self, direction: Direction, bytes: &[u8]) {
        let stream = match direction {
            Direction::Out => &mut self.sent,
            Direction::In => &mut self.received,
        };
        if self.is_on && !bytes.is_empty() {
            let micros = self.epoch_us + clock::since(self.start).as_micros() as u64;
            stream.feed(bytes, Some(micros), &mut self.sheet);
        }
    }

    fn lines(&mut self) -> Option<String> {
        let lines = mem::take(&mut self.sheet.out.0);
        (!lines.is_empty()).then(|| String::from_utf8_lossy(&lines).trim_end().to_owned())
    }
}

#[cfg(all(test, unix))]
mod tests {
    use axlewire::ikeya::{NodeId, Position, PositionResponse, ReadRequest};

    use super::*;

    fn lists(column: TimeColumn) -> Lists {
        let mut lists = Lists::new(Protocol::Ikeya, Style::text("node", column));
        lists.is_on = true;
        lists
    }

    fn read(node: NodeId) -> [u8; 4] {
        *ReadRequest::new(node).as_bytes()
    }

    fn answer() -> [u8; 8] {
        *PositionResponse::new(NodeId::N1, Position::new(0, 0)).as_bytes()
    }

    fn all(lists: Lists) -> String {
        Lister(Rc::new(RefCell::new(lists))).end().unwrap()
    }

    #[test]
    fn each_line_has_its_time_and_the_last_one_comes_at_the_end() {
        let _ = crate::played::silence(true);
        let mut lists = lists(TimeColumn::Relative);
        let mut later = |millis, bytes: &[u8]| {
            clock::sleep(std::time::Duration::from_millis(millis));
            lists.take(Direction::In, bytes);
        };
        later(10, &answer());
        later(25, &answer());
        later(5, &[0x55, 1, 2]);
        let text = all(lists);
        let times: Vec<_> = text.lines().map(|line| line.split_whitespace().next()).collect();
        assert_eq!(times, ["time", "0.000000", "0.025000", "0.030000"].map(Some), "{text}");
    }

    #[test]
    fn what_is_said_before_the_first_frame_and_while_all_is_stopped_is_not_listed() {
        let mut lists = lists(TimeColumn::None);
        lists.is_on = false;
        lists.take(Direction::Out, &read(NodeId::N1));
        let lister = Lister(Rc::new(RefCell::new(lists)));
        lister.begin(Modes::default());
        lister.0.borrow_mut().take(Direction::Out, &read(NodeId::N2));
        assert_eq!(lister.end().unwrap().lines().count(), 2, "the titles and one frame");
        lister.0.borrow_mut().take(Direction::In, &answer());
        assert_eq!(lister.lines(), None);
    }
}
