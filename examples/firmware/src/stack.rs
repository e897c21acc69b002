//! Deepest use of the stack.

use core::ptr;

use cortex_m_rt::STACK_PAINT_VALUE;

unsafe extern "C" {
    /// Start of the stack: just past the end of RAM.
    static _stack_start: u32;
    /// Start of free RAM.
    static _stack_end: u32;
}

/// Distance searched below the deepest known use, bytes: twice the largest buffer on the stack,
/// which may be in use but still painted; and short enough not to delay answers.
const REACH: usize = 1024;

/// Stack use, found by the paint that it overwrites: cortex-m-rt paints all free RAM at startup.
pub struct Stack {
    deepest: usize,
}

impl Stack {
    /// No use is known yet.
    pub fn new() -> Self {
        Self { deepest: (&raw const _stack_start).addr() }
    }

    /// Largest number of stack bytes ever in use.
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

/// Whether the word at this address still has its startup value.
fn is_painted(at: usize) -> bool {
    // SAFETY: aligned, within the RAM between `_stack_end` and `_stack_start`, and not part of any
    // Rust object until the stack reaches it. Volatile, because an interrupt may write to it.
    unsafe { ptr::with_exposed_provenance::<u32>(at).read_volatile() == STACK_PAINT_VALUE }
}
