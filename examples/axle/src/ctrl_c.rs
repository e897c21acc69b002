//! Ctrl-C, the polite kill and the terminal that is closed: a flag, looked at between two rounds.

use std::sync::{
    Arc,
    atomic::{AtomicBool, Ordering},
};

use crate::failure::Failure;

/// Whether somebody wants the tool to end.
#[derive(Debug)]
pub(crate) struct CtrlC(Arc<AtomicBool>);

impl CtrlC {
    /// From now on such a wish no longer ends the process by itself.
    pub(crate) fn listen() -> Result<Self, Failure> {
        let flag = Arc::new(AtomicBool::new(false));
        let handler = Arc::clone(&flag);
        ctrlc::set_handler(move || handler.store(true, Ordering::SeqCst))
            .map_err(|error| Failure::Undone(format!("cannot listen for Ctrl-C: {error}")))?;
        Ok(Self(flag))
    }

    pub(crate) fn is_pressed(&self) -> bool {
        self.0.load(Ordering::SeqCst)
    }
}
