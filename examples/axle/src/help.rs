//! What the help of several subcommands ends with.

/// A macro, so that `concat!` accepts it.
macro_rules! exit_codes {
    () => {
        "\
Exit codes:
  0  done, or the reader of the output closed it
  1  the input, the output or the port failed, or a device on the line did not do as commanded
  2  the command line is wrong"
    };
}

pub(crate) const EXIT_CODES: &str = exit_codes!();

/// For subcommands on lines where something may be moving.
pub(crate) const MOTION_HELP: &str = concat!(
    exit_codes!(),
    "

After a kill -9, a SIGSTOP or a power cut of this machine (no program can prevent it):
  motor bus  keeps turning indefinitely, unless its slaves have watchdogs: the last command holds
  rover      a vendor robot stops 500 ms after the last byte on its line; any byte counts,
             including noise and bytes from other programs
  After a SIGSTOP and SIGCONT the tool stops what it moved. Otherwise run axle stop. A machine that
  can injure people needs an emergency stop that cuts power.

On Windows the tool stops what it moves on Ctrl-C, Ctrl-Break and when its window is closed. Windows
gives it about 5 seconds for that after the window is closed and at logoff and shutdown, at which
some programs are not told at all. It gives none after `End task` and taskkill /F."
);
