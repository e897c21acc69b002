//! A motor bus on a port, with its master: what `scan` and `spin` share.

use core::fmt;

use axlewire::{
    ikeya::{self, Master, MasterConfig, Mode, NodeId, OneMotor, Polling, Status},
    time::{Duration, Instant},
};

use crate::{
    args,
    ctrl_c::CtrlC,
    failure::Failure,
    port::{Line, Port},
};

/// How often each node is read, and its set-point repeated: often enough for every motor, and a USB
/// adapter keeps up with three nodes.
const PERIOD: Duration = Duration::from_millis(20);

/// The arguments of a master.
#[derive(Debug, clap::Args)]
pub(crate) struct MasterArgs {
    #[command(flatten)]
    line: args::Line,

    /// Wait 500 us for an answer, as the protocol says, instead of the 20 ms that a USB adapter may
    /// need: for a UART of this machine itself
    #[arg(long)]
    direct: bool,
}

/// A port and the master on it.
pub(crate) struct Bus {
    pub(crate) port: Port,
    pub(crate) master: Master,
    pub(crate) baud: u32,
}

impl Bus {
    pub(crate) fn open(args: &MasterArgs) -> Result<Self, Failure> {
        let mut config =
            if args.direct { MasterConfig::direct() } else { MasterConfig::usb_adapter() };
        config.baud = args.line.baud.unwrap_or(ikeya::BAUD);
        config.polling = Polling::Every(PERIOD);
        let port = Port::open(&args.line, ikeya::BAUD)?;
        Ok(Self { port, master: Master::new(config), baud: config.baud })
    }

    /// Asks all ids who is there; `false` if Ctrl-C came first.
    pub(crate) fn discover(&mut self, ctrl_c: &CtrlC) -> Result<bool, Failure> {
        self.master.discover();
        while self.master.is_discovering() && !ctrl_c.is_pressed() {
            self.round(self.port.now() + Duration::from_millis(1000))?;
        }
        Ok(!ctrl_c.is_pressed())
    }

    pub(crate) fn round(&mut self, until: Instant) -> Result<(), Failure> {
        self.port.round(&mut self.master, until)
    }

    /// What a node measured last.
    pub(crate) fn status(&self, node: NodeId) -> Option<Status<OneMotor>> {
        self.master.status(node).map(|(status, _)| status)
    }

    /// Who has answered so far, and how.
    pub(crate) fn nodes(&self) -> impl Iterator<Item = (NodeId, Mode, Status<OneMotor>)> {
        NodeId::ALL.into_iter().filter_map(|node| {
            let status = self.status(node)?;
            Some((node, status.mode(), status))
        })
    }
}

/// A status in its unit.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Measured(pub(crate) Status<OneMotor>);

impl fmt::Display for Measured {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.0 {
            Status::Velocity(rps) => write!(f, "{rps:.2} rps"),
            Status::Position(position) => write!(f, "{:.4} turns", position.revolutions()),
        }
    }
}
