//! An object of C and a role of Rust as one endpoint.

use std::{cell::RefCell, fmt::Debug};

use axlewire::{
    endpoint::{Arrival, Endpoint, LineRules, Transmit, Unsent},
    stats::Latency,
    stream::Counters,
    time::{Duration, Instant},
};
use axlewire_c::*;

/// The functions that every object has.
pub(crate) trait Object: Sized {
    fn input(object: *mut Self, bytes: *const u8, length: usize, now: u64) -> axle_result;
    fn old(object: *mut Self, bytes: *const u8, length: usize, since: u64, now: u64)
    -> axle_result;
    fn timeout(object: *mut Self, now: u64) -> axle_result;
    fn transmit(
        object: *mut Self,
        now: u64,
        bytes: *mut *const u8,
        length: *mut usize,
    ) -> axle_result;
    fn transmitted(object: *mut Self, outcome: axle_transmit, now: u64) -> axle_result;
    fn outdated(object: *const Self) -> axle_result;
    fn deadline(object: *const Self, at: *mut u64) -> axle_result;
    fn rules(object: *const Self, rules: *mut axle_line_rules) -> axle_result;
}

macro_rules! object {
    ($object:ident: $input:ident $old:ident $timeout:ident $transmit:ident $transmitted:ident
        $outdated:ident $deadline:ident $rules:ident) => {
        impl crate::twin::Object for $object {
            fn input(it: *mut Self, bytes: *const u8, length: usize, now: u64) -> axle_result {
                $input(it, bytes, length, now)
            }
            fn old(
                it: *mut Self,
                bytes: *const u8,
                length: usize,
                since: u64,
                now: u64,
            ) -> axle_result {
                $old(it, bytes, length, since, now)
            }
            fn timeout(it: *mut Self, now: u64) -> axle_result {
                $timeout(it, now)
            }
            fn transmit(
                it: *mut Self,
                now: u64,
                bytes: *mut *const u8,
                length: *mut usize,
            ) -> axle_result {
                $transmit(it, now, bytes, length)
            }
            fn transmitted(it: *mut Self, outcome: axle_transmit, now: u64) -> axle_result {
                $transmitted(it, outcome, now)
            }
            fn outdated(it: *const Self) -> axle_result {
                $outdated(it)
            }
            fn deadline(it: *const Self, at: *mut u64) -> axle_result {
                $deadline(it, at)
            }
            fn rules(it: *const Self, rules: *mut axle_line_rules) -> axle_result {
                $rules(it, rules)
            }
        }
    };
}
pub(crate) use object;

/// A role, and its object in C. What C should tell is made of what Rust tells, with the numbers of
/// the header, and not by the package.
pub(crate) trait Pair: Endpoint {
    type Object: Object;
    type Told: Debug + Default;

    fn poll_in_c(object: *mut Self::Object, event: *mut Self::Told) -> axle_result;
    fn expected(event: &Self::Event) -> Self::Told;
    /// Compares all that both tell of themselves.
    fn same(&self, object: *mut Self::Object, now: Instant);
}

/// What the port does with frames.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Port {
    /// Sends them, and tells nothing.
    Quiet,
    /// Tells that it has taken each, and later that it has left.
    Holds,
    /// Does not send the next ones.
    Fails(u32, Unsent),
}

/// Both.
pub(crate) struct Twin<R: Pair> {
    // In a cell, because the getters of C take a pointer that may be written to.
    object: Box<RefCell<R::Object>>,
    rust: R,
    now: Instant,
    frame: Vec<u8>,
    pub(crate) port: Port,
    held: bool,
    pub(crate) failed: u32,
    /// Calls since all was compared.
    calls: u32,
}

/// An answer, or that there is none.
pub(crate) fn value<T: Default>(call: impl FnOnce(*mut T) -> axle_result) -> Option<T> {
    let mut to = T::default();
    match call(&mut to) {
        AXLE_OK => Some(to),
        AXLE_NONE => None,
        error => panic!("{}", error_name(error)),
    }
}

pub(crate) fn error_name(error: axle_result) -> String {
    // SAFETY: it is a text that ends in 0, and lives forever.
    let name = unsafe { std::ffi::CStr::from_ptr(axle_result_name(error)) };
    name.to_str().unwrap().to_owned()
}

#[track_caller]
pub(crate) fn same<T: Debug>(c: T, rust: T) {
    // As text: numbers that are none are equal, too.
    assert_eq!(format!("{c:?}"), format!("{rust:?}"));
}

impl<R: Pair> Twin<R> {
    /// `init` gets memory that was never written to.
    pub(crate) fn new(
        rust: R,
        now: Instant,
        init: impl FnOnce(*mut R::Object) -> axle_result,
    ) -> Self {
        let mut memory = Box::<R::Object>::new_uninit();
        assert_eq!(init(memory.as_mut_ptr()), AXLE_OK);
        // SAFETY: `init` has returned AXLE_OK.
        let object = unsafe { memory.assume_init() };
        let object = Box::new(RefCell::new(*object));
        let (frame, port) = (Vec::new(), Port::Quiet);
        let twin = Self { object, rust, now, frame, port, held: false, failed: 0, calls: 0 };
        twin.check();
        twin
    }

    pub(crate) fn rust(&self) -> &R {
        &self.rust
    }

    pub(crate) fn rust_mut(&mut self) -> &mut R {
        &mut self.rust
    }

    pub(crate) fn c(&self) -> *mut R::Object {
        self.object.as_ptr()
    }

    /// Gives both the same command, and compares what they say to it.
    #[track_caller]
    pub(crate) fn both(
        &mut self,
        c: impl FnOnce(*mut R::Object) -> axle_result,
        rust: impl FnOnce(&mut R) -> axle_result,
    ) -> axle_result {
        let (answer, expected) = (c(self.c()), rust(&mut self.rust));
        assert_eq!(error_name(answer), error_name(expected));
        self.check();
        answer
    }

    /// All is compared with every command, and with some of the many other calls.
    fn check_now_and_then(&mut self) {
        self.calls += 1;
        if self.calls.is_multiple_of(997) {
            self.check();
        }
    }

    pub(crate) fn check(&self) {
        self.rust.same(self.c(), self.now);
        let LineRules { frame_pause, baud, held_up_after, .. } = self.rust.line_rules();
        let rules = axle_line_rules {
            frame_pause_us: frame_pause.as_micros(),
            baud,
            held_up_after_us: held_up_after.map_or(u32::MAX, Duration::as_micros),
        };
        same(value(|to| R::Object::rules(self.c(), to)), Some(rules));
    }

    pub(crate) fn tell(&mut self, outcome: Transmit, now: Instant) {
        let number = match outcome {
            Transmit::Taken => 1,
            Transmit::Flushed => 2,
            Transmit::Unsent(Unsent::Untouched) => 3,
            Transmit::Unsent(Unsent::CutOff) => 4,
            Transmit::Unsent(Unsent::Unflushed) => 5,
        };
        assert_eq!(R::Object::transmitted(self.c(), number, now.as_micros()), AXLE_OK);
        self.rust.handle_transmit(outcome, now);
        self.check_now_and_then();
    }

    fn flush(&mut self, now: Instant) {
        if std::mem::take(&mut self.held) {
            self.tell(Transmit::Flushed, now);
        }
    }

    /// The next frame of both.
    fn next_frame(&mut self, now: Instant) -> bool {
        let (mut bytes, mut length) = (std::ptr::null(), 0);
        let result = R::Object::transmit(self.c(), now.as_micros(), &mut bytes, &mut length);
        match self.rust.poll_transmit(now) {
            None => assert_eq!((result, bytes.is_null(), length), (AXLE_NONE, true, 0)),
            Some(frame) => {
                assert_eq!(result, AXLE_OK);
                // SAFETY: the bytes of a frame, valid until the next call.
                let sent = unsafe { std::slice::from_raw_parts(bytes, length) };
                assert_eq!(sent, frame);
                self.frame = frame.to_vec();
            }
        }
        result == AXLE_OK
    }
}

/// All is compared at the end of a story.
impl<R: Pair> Drop for Twin<R> {
    fn drop(&mut self) {
        if !std::thread::panicking() {
            self.check();
        }
    }
}

impl<R: Pair> Endpoint for Twin<R> {
    type Event = R::Event;

    fn handle_input(&mut self, bytes: &[u8], arrived: impl Into<Arrival>) {
        let arrived = arrived.into();
        self.now = arrived.now();
        self.flush(self.now);
        let (from, length) = (bytes.as_ptr(), bytes.len());
        let result = match arrived {
            Arrival::Now(now) => R::Object::input(self.c(), from, length, now.as_micros()),
            Arrival::Between { since, now } => {
                R::Object::old(self.c(), from, length, since.as_micros(), now.as_micros())
            }
        };
        assert_eq!(result, AXLE_OK);
        self.rust.handle_input(bytes, arrived);
    }

    fn handle_timeout(&mut self, now: Instant) {
        self.now = now;
        self.flush(now);
        assert_eq!(R::Object::timeout(self.c(), now.as_micros()), AXLE_OK);
        self.rust.handle_timeout(now);
        self.check_now_and_then();
    }

    fn poll_transmit(&mut self, now: Instant) -> Option<&[u8]> {
        self.now = now;
        while self.next_frame(now) {
            match self.port {
                Port::Fails(times @ 1.., how) => {
                    self.port = Port::Fails(times - 1, how);
                    self.failed += 1;
                    self.tell(Transmit::Unsent(how), now);
                    continue;
                }
                Port::Holds => {
                    self.tell(Transmit::Taken, now);
                    self.held = true;
                }
                _ => {}
            }
            return Some(&self.frame);
        }
        None
    }

    fn is_outdated(&self) -> bool {
        let outdated = self.rust.is_outdated();
        let expected = if outdated { AXLE_OK } else { AXLE_NONE };
        assert_eq!(R::Object::outdated(self.c()), expected);
        outdated
    }

    fn line_rules(&self) -> LineRules {
        self.rust.line_rules()
    }

    fn poll_event(&mut self) -> Option<R::Event> {
        let told = value(|to| R::poll_in_c(self.c(), to));
        let event = self.rust.poll_event();
        if told.is_some() || event.is_some() {
            same(told, event.as_ref().map(R::expected));
            self.check_now_and_then();
        }
        event
    }

    fn poll_timeout(&self) -> Option<Instant> {
        self.is_outdated();
        let at = self.rust.poll_timeout();
        assert_eq!(value(|to| R::Object::deadline(self.c(), to)), at.map(Instant::as_micros));
        at
    }
}

pub(crate) fn counters(of: Counters) -> axle_counters {
    axle_counters {
        received: of.received,
        frames: of.frames,
        framed: of.framed,
        gaps: of.gaps,
        skipped_crc: of.crc,
        skipped_header: of.header,
        skipped_id: of.id,
        skipped_length: of.length,
        skipped_idle: of.idle,
    }
}

pub(crate) fn latency(of: Latency) -> axle_latency {
    let us = |span: Option<Duration>| span.map_or(0, Duration::as_micros);
    axle_latency {
        count: of.count(),
        last_us: us(of.last()),
        min_us: us(of.min()),
        max_us: us(of.max()),
        mean_us: us(of.mean()),
    }
}
