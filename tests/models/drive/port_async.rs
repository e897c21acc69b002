//! The port, pin and clock of `port.rs` for async calls: the same behaviour, but a waiting task
//! sleeps.

use std::{
    future::poll_fn,
    task::{Context, Poll},
};

use super::{
    port::{Broken, Pin, SECOND_US},
    *,
};

/// The least time that a port gets, however long it has been waiting, microseconds: twice the time
/// of 64 bytes of a master, plus a millisecond.
const LEAST_US: u64 = 2 * 64 * 20 + 1000;

/// An operation in progress; notes a stall of a second when the driver gives up on it. The second
/// may have begun in a call that was dropped.
struct Sending<'a> {
    line: &'a Shared,
    begun_us: u64,
    is_over: bool,
}

impl<'a> Sending<'a> {
    fn begin(line: &'a Shared) -> Self {
        line.line().is_sending = true;
        Self { line, begun_us: line.line().now_us, is_over: false }
    }

    fn end(mut self) {
        self.is_over = true;
    }
}

impl Drop for Sending<'_> {
    fn drop(&mut self) {
        let mut line = self.line.line();
        line.is_sending = false;
        // The pin already had its time.
        if line.now_us + 100 >= self.begun_us + SECOND_US {
            line.is_given_up = true;
            line.held.clear();
            line.failed(Failure::Stalled);
        } else if !self.is_over {
            let waits_since_us = *line.waits_since_us.get_or_insert(self.begun_us);
            let is_long = line.now_us >= self.begun_us + LEAST_US;
            line.may_have_stalled |= is_long && line.now_us + 100 >= waits_since_us + SECOND_US;
            line.is_given_up |= line.may_have_stalled;
            // A write of the pin's port is given up while that port flushes behind its failure.
            line.may_be_untold |= !line.failures.is_empty();
        }
    }
}

/// Removes a sleeper when the waiting task is dropped.
struct Sleep<'a>(&'a Shared, Option<u32>);

impl Drop for Sleep<'_> {
    fn drop(&mut self) {
        if let Some(number) = self.1 {
            self.0.line().sleepers.retain(|&(_, other, _)| other != number);
        }
    }
}

impl Sleep<'_> {
    /// Ready at this time; wakes the task then.
    fn poll_until(&mut self, until_us: u64, context: &Context<'_>) -> Poll<()> {
        let mut line = self.0.line();
        line.count();
        if line.now_us >= until_us {
            return Poll::Ready(());
        }
        let number = *self.1.get_or_insert_with(|| line.next_sleeper());
        line.sleepers.retain(|&(_, other, _)| other != number);
        if until_us != u64::MAX {
            line.sleepers.push((until_us, number, context.waker().clone()));
        }
        Poll::Pending
    }
}

impl Shared {
    async fn sleep_until(&self, until_us: u64) {
        let mut sleep = Sleep(self, None);
        poll_fn(|context| sleep.poll_until(until_us, context)).await;
    }
}

impl embedded_io_async::Read for Shared {
    async fn read(&mut self, buffer: &mut [u8]) -> Result<usize, Broken> {
        let mut sleep = Sleep(self, None);
        poll_fn(|context| {
            self.line().is_touched = true;
            let is_ready = self.line().reading().is_some() || self.line().has_arrived();
            if is_ready {
                return Poll::Ready(());
            }
            let until_us = self.line().readable_us();
            sleep.poll_until(until_us, context)
        })
        .await;
        self.give(buffer)
    }
}

impl embedded_io_async::Write for Shared {
    async fn write(&mut self, bytes: &[u8]) -> Result<usize, Broken> {
        // A driver asks for this when the port has stalled.
        if bytes.is_empty() {
            return Ok(0);
        }
        let begun_us = self.line().now_us;
        let writing = self.begin_write(bytes);
        let sending = Sending::begin(self);
        match writing {
            Some(Writing::Slow) => {
                let late_us = self.line().wire.too_late_us(begun_us);
                self.sleep_until(late_us).await;
            }
            Some(Writing::Part) => self.sleep_until(begun_us + PART_US).await,
            Some(Writing::Stall) => self.sleep_until(u64::MAX).await,
            _ => {}
        }
        sending.end();
        self.end_write(bytes, writing, begun_us)
    }

    async fn flush(&mut self) -> Result<(), Broken> {
        let flushing = self.begin_flush();
        let sending = Sending::begin(self);
        let held_until_us = self.held_until_us(flushing);
        self.sleep_until(held_until_us).await;
        self.release(flushing);
        match flushing {
            None | Some(Flushing::Late) => {
                let free_us = self.line().free_us;
                self.sleep_until(free_us).await;
            }
            Some(Flushing::Stall) => self.sleep_until(u64::MAX).await,
            Some(_) => {}
        }
        sending.end();
        self.end_flush(flushing)
    }
}

/// The delay of the clock.
impl embedded_hal_async::delay::DelayNs for Shared {
    async fn delay_ns(&mut self, ns: u32) {
        let end_us = self.line().now_us + u64::from(ns.div_ceil(1000));
        self.sleep_until(end_us).await;
    }
}

impl embedded_hal_async::delay::DelayNs for Pin {
    async fn delay_ns(&mut self, ns: u32) {
        let end_us = self.0.line().now_us + u64::from(ns.div_ceil(1000));
        let _sending = Sending::begin(&self.0);
        self.0.sleep_until(end_us).await;
    }
}
