//! An account of the bytes taken by a port: whole frames, or cut-off ones followed by silence.

use std::{collections::VecDeque, hash::Hash};

/// What the bytes seen so far are.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub(crate) enum Shape {
    /// A part of a frame.
    Part,
    Whole,
    /// Neither.
    Bad,
}

/// The frames of a protocol, and the longest pause inside one.
#[derive(Clone, Copy)]
pub(crate) struct Speech {
    pub(crate) shape: fn(&[u8]) -> Shape,
    /// Whether a whole frame is a command that moves something.
    pub(crate) moves: fn(&[u8]) -> bool,
    pub(crate) byte_us: u64,
    pub(crate) pause_us: u64,
    /// A frame that was cut off is followed by a silence of more than `pause_us`.
    pub(crate) needs_silence: bool,
}

/// A frame that a driver has offered to its port, whether or not the port took any of it.
#[derive(Clone, Debug)]
pub(crate) struct Offer {
    /// The time of the role.
    pub(crate) role_us: u64,
    /// Frames of this call that the port had taken whole before this one.
    pub(crate) taken: usize,
    pub(crate) frame: Vec<u8>,
}

#[derive(Clone, Debug)]
pub(crate) struct Taken {
    pub(crate) frame: Vec<u8>,
    pub(crate) is_flushed: bool,
    /// A flush has failed: it may be lost, whatever the next flush returns.
    is_doubtful: bool,
}

pub(crate) struct Wire {
    pub(crate) speech: Speech,
    /// A frame that has begun and not ended.
    pub(crate) open: Vec<u8>,
    /// It is a command that moves something.
    is_moving: bool,
    /// A stop was requested after it.
    is_outdated: bool,
    /// When the last byte has left.
    last_us: u64,
    /// When the first write of the open frame began.
    pub(crate) begun_us: u64,
    /// The same as `last_us` if each byte had left when its write began. The truth, unknown to a
    /// driver, lies between.
    early_us: u64,
    /// The frame may have paused too long.
    is_doubtful: bool,
    /// The last frame was taken in parts: unless a driver knows of its flush, that goes before the
    /// next one.
    pub(crate) is_in_parts: bool,
    /// The rest of a frame came late: a silence must follow.
    is_noisy: bool,
    /// The application has discarded a frame: a new one may follow.
    pub(crate) is_given_up: bool,
    unheard: VecDeque<Vec<u8>>,
    /// Of the current call.
    pub(crate) offers: Vec<Offer>,
    pub(crate) taken: Vec<Taken>,
    /// Frames that were cut off for good.
    pub(crate) cuts: u32,
}

impl Wire {
    pub(crate) fn new(speech: Speech) -> Self {
        Self {
            speech,
            open: vec![],
            is_moving: false,
            is_outdated: false,
            last_us: 0,
            begun_us: 0,
            early_us: 0,
            is_doubtful: false,
            is_in_parts: false,
            is_noisy: false,
            is_given_up: false,
            unheard: VecDeque::new(),
            offers: vec![],
            taken: vec![],
            cuts: 0,
        }
    }

    pub(crate) fn begin(&mut self) {
        self.offers.clear();
        self.taken.clear();
        self.cuts = 0;
    }

    /// A stop is requested.
    pub(crate) fn stop(&mut self) {
        self.is_outdated = self.is_moving && !self.open.is_empty();
    }

    /// A driver offers bytes to its port: a whole frame, or the rest of the current one.
    pub(crate) fn offer(&mut self, bytes: &[u8], at_us: u64, role_us: u64) -> Result<(), String> {
        if (self.speech.shape)(bytes) == Shape::Whole {
            if !self.open.is_empty() {
                // A command may have been replaced.
                self.is_given_up |= self.is_moving || self.is_doubtful || self.may_be_late(at_us);
                broken_if!(!self.is_given_up, "a frame is offered inside another");
            }
            (self.is_moving, self.is_outdated) = ((self.speech.moves)(bytes), false);
            self.offers.push(Offer { role_us, taken: self.taken.len(), frame: bytes.to_vec() });
            return Ok(());
        }
        let whole = [&self.open[..], bytes].concat();
        if self.open.is_empty() || (self.speech.shape)(&whole) != Shape::Whole {
            return Err(format!("{bytes:02X?} is offered after {:02X?}", self.open));
        }
        broken_if!(self.is_outdated, "the rest of a command is offered after a stop");
        broken_if!(self.is_late(at_us), "the rest of a frame is offered after too long a pause");
        Ok(())
    }

    /// When a pause is definitely too long, including the time of the next byte on the line, for a
    /// write that begins now.
    pub(crate) fn too_late_us(&self, now_us: u64) -> u64 {
        self.last_us.max(now_us) + self.speech.pause_us + 200
    }

    fn is_late(&self, at_us: u64) -> bool {
        at_us.saturating_sub(self.last_us) > self.speech.pause_us
    }

    /// As far as a driver can tell, knowing when its writes began and returned.
    fn may_be_late(&self, at_us: u64) -> bool {
        at_us + self.speech.byte_us > self.early_us + self.speech.pause_us
    }

    /// The port has taken bytes at `at_us`, in a write that began at `begun_us`. They leave by
    /// `end_us`.
    pub(crate) fn carry(
        &mut self,
        bytes: &[u8],
        begun_us: u64,
        at_us: u64,
        end_us: u64,
    ) -> Result<(), String> {
        if self.is_noisy {
            if self.speech.needs_silence && !self.is_late(at_us) {
                return Err("no silence after a cut-off frame".into());
            }
            self.is_noisy = false;
        }
        if !self.open.is_empty() && self.is_given_up && !self.speech.needs_silence {
            self.open.clear();
            self.cuts += 1;
        } else if !self.open.is_empty() && self.is_late(at_us) {
            self.open.clear();
            self.cuts += 1;
            // The port returned late with a part of the rest, which cannot be known in advance.
            if !self.is_late(begun_us) {
                (self.is_noisy, self.last_us) = (true, end_us);
                return Ok(());
            }
        } else if !self.open.is_empty() && self.is_given_up {
            return Err("no silence after a discarded frame".into());
        }
        self.is_given_up = false;
        self.last_us = end_us;
        if self.open.is_empty() {
            (self.begun_us, self.early_us, self.is_doubtful) = (begun_us, begun_us, false);
            self.is_in_parts = false;
        }
        self.is_in_parts |= !self.open.is_empty();
        self.is_doubtful |= !self.open.is_empty() && self.may_be_late(at_us);
        self.early_us = self.early_us.max(begun_us) + self.speech.byte_us * bytes.len() as u64;
        for &byte in bytes {
            self.open.push(byte);
            match (self.speech.shape)(&self.open) {
                Shape::Part => {}
                Shape::Whole => {
                    let frame = std::mem::take(&mut self.open);
                    self.unheard.push_back(frame.clone());
                    self.taken.push(Taken { frame, is_flushed: false, is_doubtful: false });
                }
                Shape::Bad => return Err(format!("on the line: {:02X?}", self.open)),
            }
        }
        Ok(())
    }

    pub(crate) fn flushed(&mut self) {
        self.taken.iter_mut().for_each(|taken| taken.is_flushed |= !taken.is_doubtful);
    }

    /// A frame that was cut off has no rest then (U16).
    pub(crate) fn flush_failed(&mut self) {
        self.is_given_up |= !self.open.is_empty();
        self.taken.iter_mut().for_each(|taken| taken.is_doubtful |= !taken.is_flushed);
    }

    pub(crate) fn next_unheard(&mut self) -> Option<Vec<u8>> {
        self.unheard.pop_front()
    }

    /// Some of these bytes have left, and the rest may still be sent.
    pub(crate) fn goes_on_with(&self, rest: &[u8]) -> bool {
        let whole = [&self.open[..], rest].concat();
        !self.open.is_empty() && (self.speech.shape)(&whole) == Shape::Whole
    }

    /// The state that affects the future.
    pub(crate) fn digest(&self, now_us: u64) -> impl Hash {
        let since =
            |at_us: u64| (now_us as i64 - at_us as i64).min(self.speech.pause_us as i64 + 1);
        let flags = (self.is_noisy, self.is_given_up, self.is_doubtful, self.is_in_parts);
        let command = (self.is_moving, self.is_outdated);
        (self.open.clone(), since(self.last_us), since(self.early_us), flags, command)
    }
}
