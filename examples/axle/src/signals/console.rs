//! What Windows tells the programs in a console window. Its C library knows no closed window, and
//! its handlers run in a thread of their own.

use std::{
    io,
    task::{Context, Poll, Waker},
};

use tokio::signal::windows::{
    CtrlBreak, CtrlC, CtrlClose, CtrlLogoff, CtrlShutdown, ctrl_break, ctrl_c, ctrl_close,
    ctrl_logoff, ctrl_shutdown,
};

/// As long as it exists, none of these ends the tool at once. Windows ends it about five seconds
/// after its window was closed, or the user has logged off.
#[derive(Debug)]
pub(super) struct Console {
    interrupt: CtrlC,
    stop: CtrlBreak,
    close: CtrlClose,
    logoff: CtrlLogoff,
    shutdown: CtrlShutdown,
}

impl Console {
    pub(super) fn listen() -> io::Result<Self> {
        Ok(Self {
            interrupt: ctrl_c()?,
            stop: ctrl_break()?,
            close: ctrl_close()?,
            logoff: ctrl_logoff()?,
            shutdown: ctrl_shutdown()?,
        })
    }

    /// Whether anything has come since the last call. Needs no runtime.
    pub(super) fn has_told(&mut self) -> bool {
        let context = &mut Context::from_waker(Waker::noop());
        let polled = [
            self.interrupt.poll_recv(context),
            self.stop.poll_recv(context),
            self.close.poll_recv(context),
            self.logoff.poll_recv(context),
            self.shutdown.poll_recv(context),
        ];
        polled.iter().any(Poll::is_ready)
    }
}
