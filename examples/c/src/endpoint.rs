//! The calls that all roles have: bytes and time in, bytes and deadlines out.

use axlewire::endpoint::{Arrival, Endpoint, Transmit, Unsent};

use crate::{
    memory::{Memory, Out, enter, enter_with, get},
    result::{AXLE_ERROR_VALUE, AXLE_NONE, AXLE_OK, axle_result, of},
    time::at,
};

/// What has become of a frame: one of `AXLE_TRANSMIT_`.
pub type axle_transmit = u8;

/// The port has taken all of the frame, but may still hold it.
pub const AXLE_TRANSMIT_TAKEN: axle_transmit = 1;
/// All bytes that the port has taken have left by now.
pub const AXLE_TRANSMIT_FLUSHED: axle_transmit = 2;
/// The frame did not leave at all, and will not be sent.
pub const AXLE_TRANSMIT_UNTOUCHED: axle_transmit = 3;
/// Part of the frame has left, and no more of it will be sent.
pub const AXLE_TRANSMIT_CUT_OFF: axle_transmit = 4;
/// The port took all of the frame, and then failed to send what it held.
pub const AXLE_TRANSMIT_UNFLUSHED: axle_transmit = 5;

/// What a role requires of its line.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default)]
pub struct axle_line_rules {
    /// Longest pause inside a frame that is sent, microseconds: give up one with a longer pause.
    pub frame_pause_us: u32,
    /// Speed of the line, bit/s; 0 if it is not known.
    pub baud: u32,
    /// How long the port may go unread before the bytes in it count as old, microseconds;
    /// `UINT32_MAX` if they never do. Hand in older ones by `handle_old_input`. With 0, as of a
    /// host, bytes count from when the port was last found empty: hand in all of them so, if
    /// others came before or a frame was sent since.
    pub held_up_after_us: u32,
}

/// Received bytes for a role.
pub(crate) fn input<M: Memory>(
    role: *mut M,
    bytes: *const u8,
    length: usize,
    arrival: Arrival,
) -> axle_result
where
    M::Value: Endpoint,
{
    of(enter_with(role, bytes, length, |role, bytes| role.handle_input(bytes, arrival)))
}

/// The next frame of a role.
pub(crate) fn transmit<M: Memory>(
    role: *mut M,
    now_us: u64,
    bytes: *mut *const u8,
    length: *mut usize,
) -> axle_result
where
    M::Value: Endpoint,
{
    let poll = || {
        let (bytes, length) = (Out::new(bytes)?, Out::new(length)?);
        let frame = enter(role, |role| {
            role.poll_transmit(at(now_us)).map(|frame| (frame.as_ptr(), frame.len()))
        })?;
        let Some((start, count)) = frame else { return Ok(AXLE_NONE) };
        bytes.write(start);
        Ok(length.write(count))
    };
    poll().unwrap_or_else(|error| error)
}

/// What has become of a frame of a role.
pub(crate) fn transmitted<M: Memory>(
    role: *mut M,
    outcome: axle_transmit,
    now_us: u64,
) -> axle_result
where
    M::Value: Endpoint,
{
    let outcome = match outcome {
        AXLE_TRANSMIT_TAKEN => Transmit::Taken,
        AXLE_TRANSMIT_FLUSHED => Transmit::Flushed,
        AXLE_TRANSMIT_UNTOUCHED => Transmit::Unsent(Unsent::Untouched),
        AXLE_TRANSMIT_CUT_OFF => Transmit::Unsent(Unsent::CutOff),
        AXLE_TRANSMIT_UNFLUSHED => Transmit::Unsent(Unsent::Unflushed),
        _ => return AXLE_ERROR_VALUE,
    };
    of(enter(role, |role| role.handle_transmit(outcome, at(now_us))))
}

/// Whether the latest frame of a role is outdated.
pub(crate) fn outdated<M: Memory>(role: *const M) -> axle_result
where
    M::Value: Endpoint,
{
    match enter(role, |role| role.is_outdated()) {
        Ok(true) => AXLE_OK,
        Ok(false) => AXLE_NONE,
        Err(error) => error,
    }
}

/// When a role wants to be called again.
pub(crate) fn deadline<M: Memory>(role: *const M, at_us: *mut u64) -> axle_result
where
    M::Value: Endpoint,
{
    get(role, at_us, |role| role.poll_timeout().map(|deadline| deadline.as_micros()))
}

/// The rules of a role's line.
pub(crate) fn rules<M: Memory>(role: *const M, rules: *mut axle_line_rules) -> axle_result
where
    M::Value: Endpoint,
{
    get(role, rules, |role| {
        let rules = role.line_rules();
        Some(axle_line_rules {
            frame_pause_us: rules.frame_pause.as_micros(),
            baud: rules.baud,
            held_up_after_us: rules.held_up_after.map_or(u32::MAX, |it| it.as_micros()),
        })
    })
}

/// The functions of a role with these names.
macro_rules! endpoint {
    ($role:ident: $input:ident $old_input:ident $timeout:ident $poll:ident $sent:ident
        $outdated:ident $deadline:ident $rules:ident) => {
        /// Takes in all received bytes, which have just arrived.
        ///
        /// Hand in all of them before the next `poll_transmit`; none is fine, too.
        #[unsafe(no_mangle)]
        pub extern "C" fn $input(
            role: *mut $role,
            bytes: *const u8,
            length: usize,
            now_us: u64,
        ) -> axle_result {
            crate::endpoint::input(role, bytes, length, at(now_us).into())
        }

        /// Takes in received bytes that may have waited since `since_us`: the program was held up,
        /// or a frame was handed out before they were read. An old command must not count as new.
        #[unsafe(no_mangle)]
        pub extern "C" fn $old_input(
            role: *mut $role,
            bytes: *const u8,
            length: usize,
            since_us: u64,
            now_us: u64,
        ) -> axle_result {
            let arrival =
                axlewire::endpoint::Arrival::Between { since: at(since_us), now: at(now_us) };
            crate::endpoint::input(role, bytes, length, arrival)
        }

        /// Lets time pass. Call it when `next_deadline` is reached, with a time read before the
        /// port was last found empty.
        #[unsafe(no_mangle)]
        pub extern "C" fn $timeout(role: *mut $role, now_us: u64) -> axle_result {
            of(enter(role, |role| axlewire::endpoint::Endpoint::handle_timeout(role, at(now_us))))
        }

        /// The next frame to be sent, whole and at once; `AXLE_NONE` if there is none now. The
        /// bytes are valid until the next call with this object.
        #[unsafe(no_mangle)]
        pub extern "C" fn $poll(
            role: *mut $role,
            now_us: u64,
            bytes: *mut *const u8,
            length: *mut usize,
        ) -> axle_result {
            crate::endpoint::transmit(role, now_us, bytes, length)
        }

        /// Tells what has become of the latest frame, before any other call.
        ///
        /// Needed if a frame did not leave whole: a command is then never sent late, and a stop is
        /// due again. If the port holds bytes back, tell of `AXLE_TRANSMIT_TAKEN` after each frame
        /// and of `AXLE_TRANSMIT_FLUSHED` once the bytes have left: both or neither.
        #[unsafe(no_mangle)]
        pub extern "C" fn $sent(
            role: *mut $role,
            outcome: crate::endpoint::axle_transmit,
            now_us: u64,
        ) -> axle_result {
            crate::endpoint::transmitted(role, outcome, now_us)
        }

        /// Whether a frame of which only a part was sent has become wrong: `AXLE_OK` if so: give
        /// up the rest and tell of `AXLE_TRANSMIT_CUT_OFF`; `AXLE_NONE` if not.
        #[unsafe(no_mangle)]
        pub extern "C" fn $outdated(role: *const $role) -> axle_result {
            crate::endpoint::outdated(role)
        }

        /// When to call `handle_timeout` and `poll_transmit` again at the latest; `AXLE_NONE` if
        /// only bytes or commands can change anything. Ask again after every other call.
        #[unsafe(no_mangle)]
        pub extern "C" fn $deadline(role: *const $role, at_us: *mut u64) -> axle_result {
            crate::endpoint::deadline(role, at_us)
        }

        /// What the role requires of its line.
        #[unsafe(no_mangle)]
        pub extern "C" fn $rules(
            role: *const $role,
            rules: *mut crate::endpoint::axle_line_rules,
        ) -> axle_result {
            crate::endpoint::rules(role, rules)
        }
    };
}
