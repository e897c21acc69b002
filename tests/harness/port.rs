//! The scripted port: gives, takes, fails and stalls according to a list of steps. It has no notion
//! of time; for ports on a simulated line see `virtual_time.rs` and `adverse/wire.rs`.

use std::{
    cell::RefCell,
    collections::VecDeque,
    future::{Future, pending},
    pin::Pin,
    rc::Rc,
    task::{Context, Poll, Waker},
};

/// The port was pulled out.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub(crate) struct Unplugged;

impl core::fmt::Display for Unplugged {
    fn fmt(&self, f: &mut core::fmt::Formatter<'_>) -> core::fmt::Result {
        f.write_str("unplugged")
    }
}

impl core::error::Error for Unplugged {}

impl embedded_io::Error for Unplugged {
    fn kind(&self) -> embedded_io::ErrorKind {
        embedded_io::ErrorKind::NotConnected
    }
}

/// A log that several parts write to.
pub(crate) type Log = Rc<RefCell<Vec<String>>>;

/// What the port does on one call.
#[derive(Clone, Debug)]
pub(crate) enum Step {
    /// Gives these bytes, or takes as many as there are.
    Bytes(Vec<u8>),
    /// Fails.
    Error,
    /// Reports end of file, or that it takes nothing.
    Zero,
    /// Async only: this call never completes; the next one continues with the next step.
    Stall,
}

/// Follows its scripts. After that it has nothing to give, and takes everything.
#[derive(Debug, Default)]
pub(crate) struct Script {
    pub(crate) reads: VecDeque<Step>,
    /// Having nothing to give means end of file.
    pub(crate) is_file: bool,
    pub(crate) writes: VecDeque<Step>,
    pub(crate) flushes: VecDeque<Step>,
    pub(crate) written: Vec<u8>,
    pub(crate) flushed: usize,
    /// Every call of `write` and of `flush`.
    pub(crate) log: Log,
}

impl Script {
    pub(crate) fn reading(steps: impl IntoIterator<Item = Step>) -> Self {
        Self { reads: steps.into_iter().collect(), ..Self::default() }
    }

    pub(crate) fn file(steps: impl IntoIterator<Item = Step>) -> Self {
        Self { is_file: true, ..Self::reading(steps) }
    }

    pub(crate) fn writing(steps: impl IntoIterator<Item = Step>) -> Self {
        Self { writes: steps.into_iter().collect(), ..Self::default() }
    }

    fn note(&self, call: &str) {
        self.log.borrow_mut().push(call.into());
    }

    fn give(&mut self, buffer: &mut [u8]) -> Result<usize, Unplugged> {
        assert!(!buffer.is_empty(), "an empty buffer would look like an end of file");
        let end = self.is_file.then_some(Step::Zero);
        let step = self.reads.pop_front().or(end);
        match step.expect("a read without a byte would block forever") {
            Step::Bytes(mut bytes) => {
                let rest = bytes.split_off(bytes.len().min(buffer.len()));
                if !rest.is_empty() {
                    self.reads.push_front(Step::Bytes(rest));
                }
                buffer[..bytes.len()].copy_from_slice(&bytes);
                Ok(bytes.len())
            }
            Step::Error => Err(Unplugged),
            Step::Zero => Ok(0),
            Step::Stall => panic!("a blocking port cannot stall"),
        }
    }

    fn take(&mut self, buffer: &[u8]) -> Result<usize, Unplugged> {
        assert!(!buffer.is_empty(), "nothing to write");
        let count = match self.writes.pop_front() {
            Some(Step::Bytes(bytes)) => bytes.len().min(buffer.len()),
            Some(Step::Error) => return Err(Unplugged),
            Some(Step::Zero) => 0,
            Some(Step::Stall) => panic!("a blocking port cannot stall"),
            None => buffer.len(),
        };
        self.written.extend(&buffer[..count]);
        Ok(count)
    }

    fn flushing(&mut self) -> Result<(), Unplugged> {
        match self.flushes.pop_front() {
            Some(Step::Error) => Err(Unplugged),
            _ => {
                self.flushed += 1;
                Ok(())
            }
        }
    }
}

/// Never completes this call if the script says so; the next call continues.
async fn stall(steps: &mut VecDeque<Step>) {
    if matches!(steps.front(), Some(Step::Stall)) {
        steps.pop_front();
        pending::<()>().await;
    }
}

impl embedded_io::ErrorType for Script {
    type Error = Unplugged;
}

impl embedded_io::ReadReady for Script {
    fn read_ready(&mut self) -> Result<bool, Unplugged> {
        Ok(!self.reads.is_empty())
    }
}

impl embedded_io::Read for Script {
    fn read(&mut self, buffer: &mut [u8]) -> Result<usize, Unplugged> {
        self.give(buffer)
    }
}

impl embedded_io::Write for Script {
    fn write(&mut self, buffer: &[u8]) -> Result<usize, Unplugged> {
        self.note("write");
        self.take(buffer)
    }

    fn flush(&mut self) -> Result<(), Unplugged> {
        self.note("flush");
        self.flushing()
    }
}

impl embedded_io_async::Read for Script {
    async fn read(&mut self, buffer: &mut [u8]) -> Result<usize, Unplugged> {
        stall(&mut self.reads).await;
        if self.reads.is_empty() && !self.is_file {
            pending::<()>().await;
        }
        self.give(buffer)
    }
}

impl embedded_io_async::Write for Script {
    async fn write(&mut self, buffer: &[u8]) -> Result<usize, Unplugged> {
        self.note("write");
        stall(&mut self.writes).await;
        self.take(buffer)
    }

    async fn flush(&mut self) -> Result<(), Unplugged> {
        self.note("flush");
        stall(&mut self.flushes).await;
        self.flushing()
    }
}

pub(crate) fn poll<T>(future: Pin<&mut impl Future<Output = T>>) -> Poll<T> {
    future.poll(&mut Context::from_waker(Waker::noop()))
}
