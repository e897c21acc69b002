//! The async calls of a port, and of its clock.

use std::{future::poll_fn, task::Poll};

use super::{Broken, Call, Fault, Port};

impl embedded_hal_async::delay::DelayNs for Port {
    async fn delay_ns(&mut self, ns: u32) {
        let end = {
            let mut world = self.world();
            (world.calls, world.idles) = (world.calls + 1, world.idles + 1);
            world.now_us + u64::from(ns).div_ceil(1000)
        };
        self.until(end).await;
    }
}

impl Port {
    async fn until(&self, end_us: u64) {
        poll_fn(|context| {
            let mut world = self.world();
            if world.now_us >= end_us {
                return Poll::Ready(());
            }
            world.sleepers.push((end_us, context.waker().clone()));
            Poll::Pending
        })
        .await;
    }

    fn span(&self, units: u16) -> (u64, u64) {
        let begin = self.world().now_us;
        (begin, begin + u64::from(units) * 64)
    }
}

impl embedded_io_async::Read for Port {
    async fn read(&mut self, buffer: &mut [u8]) -> Result<usize, Broken> {
        poll_fn(|context| {
            let mut world = self.world();
            world.calls += 1;
            match world.faults[0].front().copied() {
                Some(Fault::Error) => {
                    world.faults[0].pop_front();
                    return Poll::Ready(Err(Broken));
                }
                Some(Fault::Zero) => {
                    world.faults[0].pop_front();
                    return Poll::Ready(Ok(0));
                }
                _ => {}
            }
            if !world.is_file && !world.has_arrived() {
                if let Some(&(at, _)) = world.inbox.front() {
                    world.sleepers.push((at, context.waker().clone()));
                }
                return Poll::Pending;
            }
            let most = match world.faults[0].pop_front() {
                Some(Fault::Few(count)) => usize::from(count).max(1),
                _ => usize::MAX,
            };
            Poll::Ready(Ok(world.give(buffer, most)))
        })
        .await
    }
}

impl embedded_io_async::Write for Port {
    async fn write(&mut self, bytes: &[u8]) -> Result<usize, Broken> {
        let fault = self.world().next(Call::Write);
        if bytes.is_empty() {
            return Ok(0);
        }
        let most = match fault {
            Fault::None => usize::MAX,
            Fault::Few(count) => usize::from(count).max(1),
            Fault::Error => return Err(Broken),
            Fault::Zero => 0,
            Fault::Late(units) => {
                let (begin, end) = self.span(units);
                self.until(end).await;
                self.world().stalled_us += end - begin;
                usize::MAX
            }
        };
        Ok(self.world().take(bytes, most))
    }

    async fn flush(&mut self) -> Result<(), Broken> {
        let (fault, free) = {
            let mut world = self.world();
            world.flushes += 1;
            (world.next(Call::Flush), world.free_us)
        };
        match fault {
            Fault::Error | Fault::Zero => return Err(Broken),
            Fault::Late(units) => {
                let (begin, end) = self.span(units);
                self.until(end).await;
                self.world().stalled_us += end - begin;
            }
            Fault::None | Fault::Few(_) => {}
        }
        self.until(free).await;
        self.world().flushed();
        Ok(())
    }
}
