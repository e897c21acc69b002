//! Wake-ups: whatever an async call waits for wakes its task. The ports here wake nobody but the
//! task that waits for them, and the executor polls nobody who was not woken.

use std::{
    cell::{Cell, RefCell},
    future::{Future, poll_fn},
    pin::Pin,
    rc::Rc,
    sync::{
        Arc,
        atomic::{AtomicUsize, Ordering},
    },
    task::{Context, Poll, Wake, Waker},
};

use axlewire::{
    drive::{Clock, DriveError, Driver},
    time::Instant,
};

use crate::{
    port::Unplugged,
    recorder::{Recorder, at_ms},
};

/// Something that is not ready yet, and the task that waits for it.
#[derive(Default)]
struct Gate {
    is_open: Cell<bool>,
    waiting: RefCell<Option<Waker>>,
}

impl Gate {
    /// Ready once it is open; it then closes.
    async fn pass(&self) {
        poll_fn(|context| {
            if self.is_open.take() {
                return Poll::Ready(());
            }
            *self.waiting.borrow_mut() = Some(context.waker().clone());
            Poll::Pending
        })
        .await;
    }

    /// Opens, and wakes the task that waits here now.
    fn open(&self) {
        self.is_open.set(true);
        if let Some(waker) = self.waiting.take() {
            waker.wake();
        }
    }
}

/// A port and a clock, each part of them with a gate of its own.
#[derive(Clone, Default)]
struct Parts {
    read: Rc<Gate>,
    write: Rc<Gate>,
    flush: Rc<Gate>,
    delay: Rc<Gate>,
    now: Rc<Cell<u64>>,
    is_broken: Rc<Cell<bool>>,
}

impl embedded_io::ErrorType for Parts {
    type Error = Unplugged;
}

impl embedded_io_async::Read for Parts {
    async fn read(&mut self, buffer: &mut [u8]) -> Result<usize, Unplugged> {
        if self.is_broken.get() {
            return Err(Unplugged);
        }
        self.read.pass().await;
        buffer[0] = 7;
        Ok(1)
    }
}

impl embedded_io_async::Write for Parts {
    async fn write(&mut self, bytes: &[u8]) -> Result<usize, Unplugged> {
        if !bytes.is_empty() {
            self.write.pass().await;
        }
        Ok(bytes.len())
    }

    async fn flush(&mut self) -> Result<(), Unplugged> {
        self.flush.pass().await;
        Ok(())
    }
}

impl Clock for Parts {
    fn now(&mut self) -> Instant {
        Instant::from_micros(self.now.get())
    }
}

impl embedded_hal_async::delay::DelayNs for Parts {
    async fn delay_ns(&mut self, _: u32) {
        self.delay.pass().await;
    }
}

/// The number of times a task was woken.
#[derive(Default)]
struct Wakes(AtomicUsize);

impl Wake for Wakes {
    fn wake(self: Arc<Self>) {
        self.0.fetch_add(1, Ordering::Relaxed);
    }
}

/// A future, polled by hand.
struct Task<F> {
    future: Pin<Box<F>>,
    wakes: Arc<Wakes>,
}

impl<F: Future> Task<F> {
    fn new(future: F) -> Self {
        Self { future: Box::pin(future), wakes: Arc::default() }
    }

    fn poll(&mut self) -> Poll<F::Output> {
        let waker = Waker::from(self.wakes.clone());
        self.future.as_mut().poll(&mut Context::from_waker(&waker))
    }

    /// Whether it has been woken since the last time.
    fn is_woken(&self) -> bool {
        self.wakes.0.swap(0, Ordering::Relaxed) > 0
    }
}

fn driver(parts: &Parts, frames: &[&[u8]]) -> Driver<Recorder, Parts, Parts> {
    Driver::new(Recorder::sending(frames), parts.clone(), parts.clone())
}

#[test]
fn a_byte_that_arrives_wakes_a_task_that_waits_for_an_event() {
    let parts = Parts::default();
    let mut driver = driver(&parts, &[]);
    let mut task = Task::new(driver.next_event_async(at_ms(60_000)));
    assert!(task.poll().is_pending() && !task.is_woken());
    parts.read.open();
    assert!(task.is_woken(), "by the byte");
    assert_eq!(task.poll(), Poll::Ready(Ok(Some(7))));
}

#[test]
fn a_delay_that_is_over_wakes_a_task_that_waits_for_an_event() {
    let parts = Parts::default();
    let mut driver = driver(&parts, &[]);
    let mut task = Task::new(driver.next_event_async(at_ms(5)));
    assert!(task.poll().is_pending() && !task.is_woken());
    parts.now.set(5000);
    parts.delay.open();
    assert!(task.is_woken(), "by the delay");
    assert_eq!(task.poll(), Poll::Ready(Ok(None)));
}

#[test]
fn a_port_that_goes_on_wakes_a_task_that_writes_or_flushes() {
    let parts = Parts::default();
    let mut driver = driver(&parts, &[b"12"]);
    let mut task = Task::new(driver.service_async());
    for gate in [&parts.write, &parts.flush] {
        assert!(task.poll().is_pending() && !task.is_woken());
        gate.open();
        assert!(task.is_woken());
    }
    assert_eq!(task.poll(), Poll::Ready(Ok(())));
}

#[test]
fn a_delay_that_is_over_wakes_a_task_whose_port_has_stalled() {
    for stalls_in_flush in [false, true] {
        let parts = Parts::default();
        let mut driver = driver(&parts, &[b"12"]);
        parts.write.is_open.set(stalls_in_flush);
        let mut task = Task::new(driver.service_async());
        assert!(task.poll().is_pending() && !task.is_woken());
        // A write that has stalled is followed by a flush, which stalls as well.
        let mut rounds = 0;
        let result = loop {
            parts.delay.open();
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
fn a_call_that_fails_has_yielded_and_woken_itself() {
    let parts = Parts::default();
    parts.is_broken.set(true);
    let mut driver = driver(&parts, &[]);
    let mut task = Task::new(driver.service_async());
    assert!(task.poll().is_pending());
    assert!(task.is_woken(), "or nobody would poll it again");
    assert_eq!(task.poll(), Poll::Ready(Err(DriveError::Port(Unplugged))));
}
