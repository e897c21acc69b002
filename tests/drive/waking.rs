//! Wake-ups: whatever an async call waits for wakes its task. The port and its world wake nobody
//! but the task that waits for them.

use std::{
    future::Future,
    sync::Arc,
    task::{Context, Poll, Waker},
};

use crate::{port::Wakes, rig::*};

/// A future, polled by hand.
struct Task<'a, T> {
    future: core::pin::Pin<Box<dyn Future<Output = T> + 'a>>,
    wakes: Arc<Wakes>,
    seen: usize,
}

impl<'a, T> Task<'a, T> {
    fn new(future: impl Future<Output = T> + 'a) -> Self {
        Self { future: Box::pin(future), wakes: Arc::default(), seen: 0 }
    }

    fn poll(&mut self) -> Poll<T> {
        let waker = Waker::from(self.wakes.clone());
        self.future.as_mut().poll(&mut Context::from_waker(&waker))
    }

    /// Whether it has been woken since the last time.
    fn is_woken(&mut self) -> bool {
        core::mem::replace(&mut self.seen, self.wakes.count()) < self.wakes.count()
    }
}

#[test]
fn a_byte_that_arrives_wakes_a_task_that_waits_for_an_event() {
    let (near, mut far) = Port::pair(&World::default(), 20);
    let world = near.world.clone();
    let mut driver = on(Recorder::default(), near);
    let within = at_ms(60_000) - driver.now();
    let mut task = Task::new(driver.asynch().next_event(within));
    assert!(task.poll().is_pending() && !task.is_woken());
    embedded_io::Write::write(&mut far, &[7]).unwrap();
    world.step(20);
    assert!(task.is_woken(), "by the byte");
    assert_eq!(task.poll(), Poll::Ready(Ok(Some(7))));
}

#[test]
fn a_delay_that_is_over_wakes_a_task_that_waits_for_an_event() {
    let mut driver = on(Recorder::default(), Port::default());
    let world = driver.port().world.clone();
    let within = at_ms(5) - driver.now();
    let mut task = Task::new(driver.asynch().next_event(within));
    assert!(task.poll().is_pending() && !task.is_woken());
    world.step(5000);
    assert!(task.is_woken(), "by the delay");
    assert_eq!(task.poll(), Poll::Ready(Ok(None)));
}

#[test]
fn a_port_that_goes_on_wakes_a_task_that_writes_or_flushes() {
    let mut port = Port::writing([Step::Late(100)]);
    port.flushes.push_back(Step::Late(100));
    let world = port.world.clone();
    let mut driver = on(Recorder::sending(&[b"12"]), port);
    let mut task = Task::new(driver.asynch().service());
    for _ in 0..2 {
        assert!(task.poll().is_pending() && !task.is_woken());
        world.step(100);
        assert!(task.is_woken());
    }
    assert_eq!(task.poll(), Poll::Ready(Ok(())));
}

#[test]
fn a_delay_that_is_over_wakes_a_task_whose_port_has_stalled() {
    for stalls_in_flush in BOTH {
        let mut port = Port::writing((!stalls_in_flush).then_some(Step::Stall));
        port.flushes.push_back(Step::Stall);
        let world = port.world.clone();
        let mut driver = on(Recorder::sending(&[b"12"]), port);
        let mut task = Task::new(driver.asynch().service());
        assert!(task.poll().is_pending() && !task.is_woken());
        // A write that has stalled is followed by a flush, which stalls as well.
        let mut rounds = 0;
        let result = loop {
            world.step(1_000_000);
            assert!(task.is_woken(), "by the delay");
            rounds += 1;
            // A call that fails yields once, and wakes itself.
            match task.poll() {
                Poll::Ready(result) => break result,
                Poll::Pending if task.is_woken() => match task.poll() {
                    Poll::Ready(result) => break result,
                    Poll::Pending => {}
                },
                Poll::Pending => {}
            }
            assert!(rounds < 5, "it hangs");
        };
        assert_eq!(result, Err(DriveError::Stalled));
    }
}

#[test]
fn an_async_call_that_fails_at_once_has_yielded_once_and_been_woken() {
    let failing = || Port { reads: [Step::Error].into(), ..Port::writing([Step::Error]) };
    for waits in BOTH {
        let mut driver = on(Recorder::sending(&[b"stop"]), failing());
        let mut task = match waits {
            true => Task::new(async {
                let within = at_ms(1000) - driver.now();
                driver.asynch().next_event(within).await.map(drop)
            }),
            false => Task::new(driver.asynch().service()),
        };
        assert_eq!((task.poll(), task.wakes.count()), (Poll::Pending, 1));
        assert_eq!(task.poll(), Poll::Ready(Err(GONE)));
    }
}

#[test]
fn a_read_that_fails_while_the_driver_waits_also_yields() {
    // The first read finds nothing, the waiting one fails.
    let mut driver = on(Recorder::default(), Port::reading([Step::Stall, Step::Error]));
    let within = at_ms(1000) - driver.now();
    let mut task = Task::new(driver.asynch().next_event(within));
    assert_eq!((task.poll(), task.wakes.count()), (Poll::Pending, 1));
    assert_eq!(task.poll(), Poll::Ready(Err(GONE)));
}
