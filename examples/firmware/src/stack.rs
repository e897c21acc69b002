//! How deep the stack has been.

use core::ptr;

use cortex_m_rt::STACK_PAINT_VALUE;

unsafe extern "C" {
    /// Where the stack begins: behind the end of the RAM.
    static _stack_start: u32;
    /// Where the RAM is free from.
    static _stack_end: u32;
}

/// How far below the deepest known use the next look goes, bytes: twice the largest buffer on the
/// stack, which may be in use and still painted; and not so far that answers wait for it.
const REACH: usize = 1024;

/// The mark that the stack has left in the paint: cortex-m-rt has painted all free RAM at the start.
pub struct Stack {
    deepest: usize,
}

impl Stack {
    /// Nothing is known yet.
    pub fn new() -> Self {
        Self { deepest: (&raw const _stack_start).addr() }
    }

    /// Bytes of stack that have been in use at the same time, at the most.
    pub fn used(&mut self) -> u32 {
        let lowest = (&raw const _stack_end).addr();
        loop {
            let mut at = self.deepest.saturating_sub(REACH).max(lowest);
            while at < self.deepest && is_painted(at) {
                at += 4;
            }
            if at == self.deepest {
                break;
            }
            self.deepest = at;
        }
        ((&raw const _stack_start).addr() - self.deepest) as u32
    }
}

impl Default for Stack {
    fn default() -> Self {
        Self::new()
    }
}

/// Is the word at this address as it was at the start?
fn is_painted(at: usize) -> bool {
    // SAFETY: aligned, within the RAM between `_stack_end` and `_stack_start`, and no object of
    // Rust's as long as the stack has not come there. Volatile, because an interrupt may write to it.
    unsafe { ptr::with_exposed_provenance::<u32>(at).read_volatile() == STACK_PAINT_VALUE }
}
