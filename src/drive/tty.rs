//! Opening a serial port of the operating system, and what its errors mean.

use alloc::{format, string::String};
use core::time::Duration;
use std::{fs, io, path::PathBuf};

use serialport::{ClearBuffer, ErrorKind, SerialPortBuilder};

/// Longest time for a port to accept at least one byte. After that the role decides again what to
/// send, so that no outdated command leaves late (ruling U16).
pub(super) const WRITE_PATIENCE: Duration = Duration::from_millis(20);

/// Time after which a blocking port that sends none of its bytes has stalled.
#[cfg(feature = "serialport")]
pub(super) const STALL: Duration = Duration::from_secs(1);

/// Deviation from the requested baud rate at which a UART still reads the bytes, percent.
const BAUD_TOLERANCE_PCT: u64 = 3;

/// Opens a port for exclusive use with `open`, checks its speed, and discards the bytes that it
/// received before.
pub(super) fn open<T: serialport::SerialPort>(
    path: &str,
    baud: u32,
    open: impl FnOnce(&SerialPortBuilder) -> serialport::Result<T>,
) -> io::Result<T> {
    let refused =
        |kind, cause: &str| io::Error::new(kind, format!("cannot use port {path:?}: {cause}"));
    let explained = |error| {
        let (kind, cause) = explain(&error, path);
        refused(kind, &cause)
    };
    let tty = open(&serialport::new(path, baud).timeout(WRITE_PATIENCE)).map_err(explained)?;
    check_baud(&tty, baud).map_err(|cause| refused(io::ErrorKind::InvalidInput, &cause))?;
    tty.clear(ClearBuffer::Input).map_err(explained)?;
    Ok(tty)
}

/// Checks the speed of a port. Not every system can tell it.
pub(super) fn check_baud(tty: &dyn serialport::SerialPort, asked: u32) -> Result<(), String> {
    match tty.baud_rate() {
        Ok(actual) if !is_close(asked, actual) => {
            Err(format!("it runs at {actual} bit/s instead of {asked}"))
        }
        _ => Ok(()),
    }
}

/// Whether a port running at `actual` can read bytes sent at `asked`.
fn is_close(asked: u32, actual: u32) -> bool {
    u64::from(asked.abs_diff(actual)) * 100 <= u64::from(asked) * BAUD_TOLERANCE_PCT
}

/// A helpful reason why a port could not be opened.
fn explain(error: &serialport::Error, path: &str) -> (io::ErrorKind, String) {
    let is_no_tty = error.description == "Not a typewriter"
        || fs::metadata(path).is_ok_and(|found| found.is_file() || found.is_dir());
    match error.kind() {
        ErrorKind::Io(kind @ io::ErrorKind::NotFound) => (kind, "no such path".into()),
        ErrorKind::Io(kind @ io::ErrorKind::PermissionDenied) => {
            let cause = "permission denied (on Linux, serial ports belong to the group dialout)";
            (kind, cause.into())
        }
        _ if is_no_tty => (io::ErrorKind::InvalidInput, "not a serial port".into()),
        ErrorKind::NoDevice if cfg!(unix) => {
            (io::ErrorKind::ResourceBusy, "another program is using it".into())
        }
        // Windows says the same of a port that is not there and of one that is taken, except in
        // words of the user's language.
        ErrorKind::NoDevice if cfg!(windows) => {
            let words = error.description.trim_end_matches('.');
            let cause = format!("{words} (no such port, or another program is using it)");
            (io::ErrorKind::NotFound, cause)
        }
        _ => {
            let error = io::Error::from(error.clone());
            (error.kind(), format!("{error}"))
        }
    }
}

/// Whether a port is a pseudo-terminal, by its name or the target of this link.
pub(super) fn is_pseudo_terminal(tty: &dyn serialport::SerialPort) -> bool {
    tty.name().is_some_and(|path| is_pseudo_terminal_path(&path))
}

fn is_pseudo_terminal_path(path: &str) -> bool {
    let target = fs::canonicalize(path).unwrap_or_else(|_| PathBuf::from(path));
    // Linux has a directory of them; macOS numbers them, as in /dev/ttys003.
    let number = target.to_str().and_then(|path| path.strip_prefix("/dev/ttys"));
    target.starts_with("/dev/pts")
        || number.is_some_and(|it| cfg!(target_os = "macos") && it.parse::<u32>().is_ok())
}

/// The error of a port that has gone.
pub(super) fn lost(error: impl Into<io::Error>) -> io::Error {
    let error = error.into();
    io::Error::new(error.kind(), format!("disconnected ({error})"))
}

/// The error of a port that keeps its bytes.
#[cfg(feature = "serialport")]
pub(super) fn stalled(queued: u32) -> io::Error {
    let cause = format!("{queued} bytes have waited for a second to be sent");
    io::Error::new(io::ErrorKind::TimedOut, cause)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_speed_that_a_uart_would_not_read_is_another_speed() {
        assert!(is_close(500_000, 500_000) && is_close(115_200, 115_384));
        assert!(is_close(100_000, 103_000) && is_close(100_000, 97_000));
        assert!(!is_close(100_000, 103_001) && !is_close(100_000, 96_999));
        assert!(!is_close(500_000, 9600) && !is_close(500_000, 460_800) && !is_close(1, 0));
    }

    #[test]
    fn a_port_that_cannot_be_opened_has_its_reason_in_plain_words() {
        let of = |kind, words: &str| explain(&serialport::Error::new(kind, words), "/dev/ttyUSB0");
        let (kind, text) = of(ErrorKind::Io(io::ErrorKind::PermissionDenied), "13");
        assert_eq!(kind, io::ErrorKind::PermissionDenied);
        assert!(text.contains("permission denied") && text.contains("dialout"), "{text}");
        let (kind, text) = of(ErrorKind::Io(io::ErrorKind::NotFound), "2");
        assert_eq!((kind, &*text), (io::ErrorKind::NotFound, "no such path"));
        // What is not known is told as it is.
        let (kind, text) = of(ErrorKind::InvalidInput, "odd");
        assert_eq!((kind, &*text), (io::ErrorKind::InvalidInput, "odd"));
    }

    #[test]
    fn only_pseudo_terminals_have_no_line_speed() {
        assert!(is_pseudo_terminal_path("/dev/pts/0"));
        for path in ["/dev/ttyUSB0", "/dev/ttyS0", "/dev/ttyAMA0", "/dev/serial/by-id/usb-1", "x"] {
            assert!(!is_pseudo_terminal_path(path), "{path}");
        }
    }
}
