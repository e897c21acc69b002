//! The faults of a simulated line as options.

use axlewire::{
    sim::{Faults, Wire},
    time::{Duration, Instant},
};

use crate::args;

/// Faults of the line.
#[derive(Clone, Debug, Default, clap::Args)]
#[command(next_help_heading = "Faults of the line, in both directions")]
pub(super) struct FaultArgs {
    /// Bit error rate, from 0 (none) to 1 (all); 1e-4 is one bit in 10,000
    #[arg(long, value_name = "RATE", default_value = "0", value_parser = args::rate)]
    noise: f64,

    /// Rate of lost bytes, from 0 to 1
    #[arg(long, value_name = "RATE", default_value = "0", value_parser = args::rate)]
    lost: f64,

    /// Rate of bytes that arrive twice, from 0 to 1
    #[arg(long, value_name = "RATE", default_value = "0", value_parser = args::rate)]
    duplicated: f64,

    /// Rate of random bytes in front of others, from 0 to 1
    #[arg(long, value_name = "RATE", default_value = "0", value_parser = args::rate)]
    inserted: f64,

    /// A byte in front of whatever is sent at once, two hex digits, as from a transceiver that is
    /// switched on
    #[arg(long, value_name = "BYTE", value_parser = args::hex_byte)]
    stray: Option<u8>,

    /// Constant delay of each byte, seconds
    #[arg(long, value_name = "SECONDS", default_value = "0", value_parser = args::seconds)]
    delay: u64,

    /// Random extra delay of each byte, from none to this, seconds; the order is kept
    #[arg(long, value_name = "SECONDS", default_value = "0", value_parser = args::seconds)]
    jitter: u64,

    /// The other program hears what it sends, as with a two-wire adapter
    #[arg(long)]
    echo: bool,

    /// Let nothing through from AT on, for FOR: seconds since the beginning, and a number of
    /// seconds; may be repeated
    #[arg(long = "unplug", value_name = "AT:FOR", value_parser = outage)]
    outages: Vec<Outage>,

    /// Seed of all that is random: the same seed and the same bytes give the same faults
    #[arg(long, value_name = "N", default_value = "1")]
    seed: u64,
}

/// A time without a connection, microseconds since the beginning.
#[derive(Clone, Copy, Debug)]
pub(super) struct Outage {
    from: u64,
    until: u64,
}

fn outage(text: &str) -> Result<Outage, String> {
    let (at, span) =
        text.split_once(':').ok_or("expected AT:FOR in seconds, as in 2:0.5".to_owned())?;
    let from = args::seconds(at)?;
    Ok(Outage { from, until: from + args::seconds(span)? })
}

impl FaultArgs {
    /// Whether the line is unplugged at `now`.
    pub(super) fn is_unplugged(&self, now: Instant) -> bool {
        let now = now.as_micros();
        self.outages.iter().any(|outage| (outage.from..outage.until).contains(&now))
    }

    /// The wires from the other program and to it. Their random numbers are separate, so that the
    /// timing of one does not affect the other.
    pub(super) fn wires(&self) -> (Wire, Wire) {
        let mut faults = Faults::noise(self.noise);
        (faults.lost, faults.duplicated) = (self.lost, self.duplicated);
        (faults.inserted, faults.stray) = (self.inserted, self.stray);
        (faults.delay, faults.jitter) = (span(self.delay), span(self.jitter));
        let outgoing = Wire::new(faults, !self.seed);
        // The simulated devices do not hear themselves.
        faults.echo = self.echo;
        (Wire::new(faults, self.seed), outgoing)
    }
}

fn span(micros: u64) -> Duration {
    Duration::from_micros(u32::try_from(micros).unwrap_or(u32::MAX))
}

#[cfg(test)]
mod tests;
