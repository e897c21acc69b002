//! How the roles of the programs are configured, on a board and in QEMU.
//!
//! Without hardware: tests on a host include this file and check both, because QEMU shows only one.

use axlewire::{
    ikeya::{master::MasterConfig, slave::SlaveConfig},
    time::Duration,
    ucp::robot::RobotConfig,
};

/// Time for which an emulator may delay the next byte, because its host may be busy.
const EMULATOR_PATIENCE: Duration = Duration::from_millis(100);

/// Time without a command after which a slave stops its motor. The protocol document defines no
/// such time, but a motor without commands should stop.
const WATCHDOG: Duration = Duration::from_millis(500);

/// The configurations for this machine.
#[derive(Clone, Copy, Debug)]
pub struct Configs {
    is_emulated: bool,
}

impl Configs {
    /// Those for an emulator, whose line transfers bytes instantly, or for a board.
    pub const fn new(is_emulated: bool) -> Self {
        Self { is_emulated }
    }

    /// A slave of a motor bus.
    pub fn slave(&self) -> SlaveConfig {
        let mut config = SlaveConfig::direct();
        config.watchdog = Some(WATCHDOG);
        config.idle = self.patience(config.idle);
        // A request may only be found after waiting for the rest of a false packet. Allow five such
        // waits, as on a 500 kbit/s line.
        config.answer_within = config.answer_within.max(config.idle.saturating_mul(5));
        config
    }

    /// The master of a motor bus.
    pub fn master(&self) -> MasterConfig {
        let mut config = MasterConfig::direct();
        config.reply_timeout = self.patience(config.reply_timeout);
        config.accepts_early = self.is_emulated;
        config
    }

    /// The robot of a rover link.
    pub fn robot(&self) -> RobotConfig {
        let mut config = RobotConfig::direct();
        config.idle_margin = self.patience(config.idle_margin);
        config
    }

    /// The timeout `on_board`; longer in an emulator, whose host is not real-time.
    fn patience(&self, on_board: Duration) -> Duration {
        if self.is_emulated { on_board.max(EMULATOR_PATIENCE) } else { on_board }
    }
}
