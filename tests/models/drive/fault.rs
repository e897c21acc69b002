//! Faults on a line, and the errors that the caller of a driver has to get.

/// What the port does on its next write.
#[derive(Clone, Copy, Debug, Eq, Hash, PartialEq)]
pub(crate) enum Writing {
    One,
    Half,
    /// The same, and returns only shortly before the rest would be too late.
    Part,
    Error,
    Zero,
    /// Returns, with one byte taken, after longer than any pause inside a frame.
    Slow,
    /// Takes all, and holds it until a flush.
    Held,
    /// Async: is never ready. Blocking: fails after a second.
    Stall,
}

/// What the port does on its next read.
#[derive(Clone, Copy, Debug, Eq, Hash, PartialEq)]
pub(crate) enum Reading {
    /// Returns one byte of those available.
    One,
    Error,
    /// Fails even to report whether there is something to read.
    ReadyError,
    /// End of file.
    Zero,
    /// Fails as soon as something has been written.
    ErrorAfterWrite,
    /// Fails some time after it was scheduled.
    ErrorLater,
}

/// What the port does on its next flush.
#[derive(Clone, Copy, Debug, Eq, Hash, PartialEq)]
pub(crate) enum Flushing {
    /// Fails, and everything written since the last flush is lost.
    ErrorLost,
    /// Fails, but everything has left.
    ErrorLeft,
    /// Succeeds, after longer than any pause inside a frame.
    Late,
    /// Async: is never ready. Blocking: fails after a second.
    Stall,
}

/// What the pin does on its next change.
#[derive(Clone, Copy, Debug, Eq, Hash, PartialEq)]
pub(crate) enum Pinning {
    /// Fails to switch on, but is on.
    On,
    /// Fails to switch off, and stays on.
    Off,
}

/// A fault during a call, as the caller of the driver has to see it.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub(crate) enum Failure {
    /// Numbered, to distinguish the first from the second.
    Port(u8),
    Pin(u8),
    /// Bytes were lost when the pin was switched off.
    Lost,
    Closed,
    WriteZero,
    Stalled,
}
