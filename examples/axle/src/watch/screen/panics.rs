//! Messages of panics, held back while there is a page: on it nobody could read them, and writing
//! them could wait for a stalled terminal.

use std::{
    io::{self, Write},
    panic,
    sync::{Mutex, Once, PoisonError},
};

/// The messages; `None` while there is no page.
static HELD: Mutex<Option<Vec<String>>> = Mutex::new(None);

/// Holds messages back from now on.
pub(super) fn hold() {
    static HOOK: Once = Once::new();
    HOOK.call_once(|| {
        let before = panic::take_hook();
        panic::set_hook(Box::new(move |info| {
            let mut held = HELD.lock().unwrap_or_else(PoisonError::into_inner);
            match &mut *held {
                Some(messages) => messages.push(info.to_string()),
                None => {
                    drop(held);
                    before(info);
                }
            }
        }));
    });
    HELD.lock().unwrap_or_else(PoisonError::into_inner).get_or_insert_default();
}

/// Prints the messages that were held back, and holds no more.
pub(super) fn release() {
    let held = HELD.lock().unwrap_or_else(PoisonError::into_inner).take();
    for message in held.into_iter().flatten() {
        // If standard error is closed, there is nowhere left to report.
        let _ = writeln!(io::stderr(), "{message}");
    }
}
