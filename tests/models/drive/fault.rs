//! What goes wrong on a line, and how the caller of a driver has to hear it.

/// What the port does at its next write.
#[derive(Clone, Copy, Debug, Eq, Hash, PartialEq)]
pub(crate) enum Writing {
    One,
    Half,
    Error,
    Zero,
    /// Comes back, with one byte taken, after longer than any pause inside a frame.
    Slow,
    /// Async: is never ready. Blocking: an error, after a second.
    Stall,
}

/// What the port does at its next read.
#[derive(Clone, Copy, Debug, Eq, Hash, PartialEq)]
pub(crate) enum Reading {
    /// Gives one byte of what is there.
    One,
    Error,
    /// Cannot even say whether there is something to read.
    ReadyError,
    /// The end of the file.
    Zero,
    /// Fails as soon as something has been written.
    ErrorAfterWrite,
    /// Fails a while after this was arranged.
    ErrorLater,
}

/// What the port does at its next flush.
#[derive(Clone, Copy, Debug, Eq, Hash, PartialEq)]
pub(crate) enum Flushing {
    /// Fails, and what was written since the last flush is lost.
    ErrorLost,
    /// Fails, and all of it has left.
    ErrorLeft,
    /// Async: is never ready. Blocking: an error, after a second.
    Stall,
}

/// What the pin does at its next change.
#[derive(Clone, Copy, Debug, Eq, Hash, PartialEq)]
pub(crate) enum Pinning {
    /// Fails to go on, and is on.
    On,
    /// Fails to go off, and stays on.
    Off,
}

/// Something that went wrong in a call, as the caller of the driver has to hear it.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub(crate) enum Failure {
    /// Numbered, so that the first can be told from the second.
    Port(u8),
    Pin(u8),
    /// Bytes were lost when the pin went off.
    Lost,
    Closed,
    WriteZero,
    Stalled,
}
