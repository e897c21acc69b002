//! Whether a signal ends the tool at once.

#[cfg(unix)]
use std::sync::{
    Arc, LazyLock,
    atomic::{AtomicBool, Ordering},
};

/// Does what may take forever, such as printing, while nothing moves: Ctrl-C and similar signals
/// then end the tool at once.
pub(crate) fn freely<T>(run: impl FnOnce() -> T) -> T {
    #[cfg(unix)]
    let before = free().swap(true, Ordering::SeqCst);
    let done = run();
    #[cfg(unix)]
    free().store(before, Ordering::SeqCst);
    done
}

/// Whether a signal that ends every subcommand ends the tool at once.
#[cfg(unix)]
pub(crate) fn free() -> &'static Arc<AtomicBool> {
    static FREE: LazyLock<Arc<AtomicBool>> = LazyLock::new(Arc::default);
    &FREE
}
