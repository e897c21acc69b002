//! A line within this process, with devices that a test plays: no terminal and no other process.

#[path = "../tests/support/devices.rs"]
mod devices;

use std::{
    cell::{Cell, RefCell},
    collections::VecDeque,
    io::{self, ErrorKind},
    rc::Rc,
    time::{Duration, Instant},
};

use embedded_io::{ErrorType, Read, ReadReady, Write};

use crate::{
    clock,
    line::{Line, Wire},
};
pub(crate) use devices::{
    BusEar, BusState, Node, PlayedRover, RoverState, Said, confirmable_stops, speeds,
};

/// A line and what is at its other end.
pub(crate) struct Played<T> {
    pub(crate) line: Line,
    pub(crate) state: Rc<RefCell<T>>,
    /// Whether the port has failed.
    pub(crate) is_gone: Rc<Cell<bool>>,
    /// When a port that has failed works again.
    pub(crate) back_at: Rc<Cell<Option<Instant>>>,
    /// Number of bytes that the port takes at once, at most.
    pub(crate) most: Rc<Cell<usize>>,
}

struct PlayedWire<P> {
    /// Gets what was sent, possibly nothing, and returns the answer.
    play: P,
    unread: VecDeque<u8>,
    is_gone: Rc<Cell<bool>>,
    back_at: Rc<Cell<Option<Instant>>>,
    most: Rc<Cell<usize>>,
}

/// A bus with these nodes; `on_request` is called before a node reacts.
pub(crate) fn bus(
    nodes: &[Node],
    mut on_request: impl FnMut(Said, &mut BusState) + 'static,
) -> Played<BusState> {
    let mut ear = BusEar::default();
    let state = BusState { nodes: nodes.to_vec(), ..BusState::default() };
    played(state, move |bus, bytes| ear.hear(bus, bytes, &mut on_request))
}

/// A rover; `on_bytes` is called before it hears something.
pub(crate) fn rover(mut on_bytes: impl FnMut(&mut RoverState) + 'static) -> Played<RoverState> {
    let mut rover = PlayedRover::default();
    played(RoverState::default(), move |state, bytes| {
        on_bytes(state);
        rover.hear(state, bytes)
    })
}

/// A silent line.
pub(crate) fn silence(is_instant: bool) -> Line {
    let play = |_: &[u8]| Vec::new();
    clock::play();
    let (is_gone, back_at, most) = (Rc::default(), Rc::default(), Rc::new(Cell::new(usize::MAX)));
    let wire = PlayedWire { play, unread: VecDeque::new(), is_gone, back_at, most };
    Line::new("played", wire, is_instant)
}

/// A line at whose other end `play` gets what was sent, possibly nothing, and returns the answer.
pub(crate) fn played<T: 'static>(
    state: T,
    mut play: impl FnMut(&mut T, &[u8]) -> Vec<u8> + 'static,
) -> Played<T> {
    clock::play();
    let (state, is_gone) = (Rc::new(RefCell::new(state)), Rc::new(Cell::new(false)));
    let (back_at, most) = (Rc::new(Cell::new(None)), Rc::new(Cell::new(usize::MAX)));
    let theirs = Rc::clone(&state);
    let wire = PlayedWire {
        play: move |bytes: &[u8]| play(&mut theirs.borrow_mut(), bytes),
        unread: VecDeque::new(),
        is_gone: Rc::clone(&is_gone),
        back_at: Rc::clone(&back_at),
        most: Rc::clone(&most),
    };
    Played { line: Line::new("played", wire, true), state, is_gone, back_at, most }
}

impl Played<BusState> {
    /// All requests so far.
    pub(crate) fn said(&self) -> Vec<Said> {
        self.state.borrow().said.iter().map(|(said, _)| *said).collect()
    }

    /// All speeds commanded so far.
    pub(crate) fn speeds(&self) -> Vec<f32> {
        speeds(&self.said())
    }
}

impl<P: FnMut(&[u8]) -> Vec<u8>> PlayedWire<P> {
    fn check(&self) -> io::Result<()> {
        let is_back = self.back_at.get().is_some_and(|at| clock::now() >= at);
        match self.is_gone.get() && !is_back {
            true => Err(io::Error::new(ErrorKind::BrokenPipe, "unplugged")),
            false => Ok(()),
        }
    }
}

impl<P: FnMut(&[u8]) -> Vec<u8>> Wire for PlayedWire<P> {
    fn wait(&mut self, patience: Duration) -> io::Result<bool> {
        let begin = clock::now();
        loop {
            self.check()?;
            let said = (self.play)(&[]);
            self.unread.extend(said);
            let left = patience.saturating_sub(clock::since(begin));
            if !self.unread.is_empty() || left.is_zero() {
                return Ok(!self.unread.is_empty());
            }
            clock::sleep(left.min(Duration::from_millis(1)));
        }
    }
}

impl<P> ErrorType for PlayedWire<P> {
    type Error = io::Error;
}

impl<P: FnMut(&[u8]) -> Vec<u8>> ReadReady for PlayedWire<P> {
    fn read_ready(&mut self) -> io::Result<bool> {
        self.wait(Duration::ZERO)
    }
}

impl<P: FnMut(&[u8]) -> Vec<u8>> Read for PlayedWire<P> {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        while !self.wait(Duration::from_millis(50))? {}
        let count = self.unread.len().min(buffer.len());
        buffer.iter_mut().zip(self.unread.drain(..count)).for_each(|(slot, byte)| *slot = byte);
        Ok(count)
    }
}

impl<P: FnMut(&[u8]) -> Vec<u8>> Write for PlayedWire<P> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.check()?;
        let bytes = &bytes[..bytes.len().min(self.most.get())];
        let said = (self.play)(bytes);
        self.unread.extend(said);
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        self.check()
    }
}
