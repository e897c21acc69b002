//! How long a master waits for an answer.

use core::{fmt, str::FromStr};

use axlewire::{ikeya::master::MasterConfig, time::Duration};

use crate::args;

/// The value of `--reply-timeout`.
#[derive(Clone, Copy, Debug, Eq, Ord, PartialEq, PartialOrd)]
pub(crate) enum Patience {
    /// As the protocol specifies, for a UART built into this machine.
    Direct,
    /// For a USB adapter, which may keep bytes for 16 ms.
    Usb,
    /// For a line behind a network.
    Network,
    For(Duration),
}

/// Longest time for an answer.
const LONGEST: Duration = Duration::from_secs(1);

/// The longest answers that leave some room until the end of the time, µs.
const FITTING: [(u32, Patience); 3] =
    [(350, Patience::Direct), (17_000, Patience::Usb), (70_000, Patience::Network)];

impl Patience {
    /// Settings of a master.
    pub(crate) fn config(self) -> MasterConfig {
        match self {
            Self::Direct => MasterConfig::direct(),
            Self::Usb => MasterConfig::usb_adapter(),
            Self::Network => with_reply_timeout(Self::Usb.config(), Duration::from_millis(100)),
            Self::For(timeout) => with_reply_timeout(Self::Usb.config(), timeout),
        }
    }

    /// What a line needs on which the slowest answer took this long; otherwise half of it more, in
    /// steps of 10 ms.
    pub(crate) fn for_slowest(slowest: Duration) -> Self {
        let micros = slowest.as_micros();
        let fitting = FITTING.into_iter().find(|(most, _)| micros <= *most);
        fitting.map_or_else(
            || {
                let steps = (u64::from(micros) * 3 / 2).div_ceil(10_000);
                Self::For(Duration::from_millis(10 * steps as u32).min(LONGEST))
            },
            |(_, patience)| patience,
        )
    }
}

/// A late answer may be that late as well.
pub(super) const fn with_reply_timeout(
    mut config: MasterConfig,
    timeout: Duration,
) -> MasterConfig {
    (config.reply_timeout, config.late_guard) = (timeout, timeout);
    config
}

impl FromStr for Patience {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        match text {
            "direct" => return Ok(Self::Direct),
            "usb" => return Ok(Self::Usb),
            "network" => return Ok(Self::Network),
            _ => {}
        }
        let micros = args::seconds(text)
            .map_err(|_| "expected direct, usb, network, or seconds".to_owned())?;
        match u32::try_from(micros).map(Duration::from_micros) {
            Ok(timeout) if timeout > Duration::ZERO && timeout <= LONGEST => Ok(Self::For(timeout)),
            _ => Err("it is not above 0 and up to 1 second".to_owned()),
        }
    }
}

impl fmt::Display for Patience {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Direct => f.write_str("direct"),
            Self::Usb => f.write_str("usb"),
            Self::Network => f.write_str("network"),
            Self::For(time) => write!(f, "{}", f64::from(time.as_micros()) / 1e6),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_proposal_is_a_value_of_the_option_and_leaves_room_for_the_slowest_answer() {
        for micros in [0, 350, 351, 17_000, 17_001, 70_000, 70_001, 100_000, 666_666, 2_000_000] {
            let proposal = Patience::for_slowest(Duration::from_micros(micros));
            assert_eq!(proposal.to_string().parse(), Ok(proposal), "{micros}");
            let timeout = proposal.config().reply_timeout;
            assert!(timeout.as_micros() * 10 > micros * 11 || timeout == LONGEST, "{micros}");
        }
        let proposed = |micros| Patience::for_slowest(Duration::from_micros(micros)).to_string();
        assert_eq!(
            [200, 16_000, 60_000, 120_000].map(proposed),
            ["direct", "usb", "network", "0.18"]
        );
    }

    #[test]
    fn presets_are_those_of_the_library_and_a_time_is_above_0_and_up_to_a_second() {
        assert_eq!(Patience::Direct.config(), MasterConfig::direct());
        assert_eq!(Patience::Usb.config(), MasterConfig::usb_adapter());
        for text in ["0", "1.1", "-1", "fast", "NaN"] {
            assert!(text.parse::<Patience>().is_err(), "{text}");
        }
        let config = "0.25".parse::<Patience>().unwrap().config();
        assert_eq!(config.reply_timeout, Duration::from_millis(250));
        assert_eq!(config.late_guard, config.reply_timeout);
    }
}
