//! `axle noise`: what is left of the traffic on noisy lines, by each way to decode it.

// The line and the oracle of the library's tests: the oracle shares no code with the library.
#[path = "../../../../tests/harness/dice.rs"]
#[allow(dead_code, reason = "the tests of the library use all of it")]
mod dice;
#[path = "../../../../tests/harness/noisy_line.rs"]
#[allow(dead_code, reason = "the tests of the library use all of it")]
mod noisy_line;
#[path = "../../../../tests/harness/oracle.rs"]
#[allow(dead_code, reason = "the tests of the library use all of it")]
mod oracle;
mod print;
mod receiver;
#[path = "../../../../tests/harness/traffic.rs"]
mod traffic;

use std::io::{self, Write};

use crate::{args::Protocol, failure::Failure, help::EXIT_CODES};
use noisy_line::{Noise, transmit};
use print::{Row, Table};
use receiver::Receiver;
use traffic::Traffic;

/// Compare decoders on noisy lines
///
/// Sends frames over simulated lines with noise of every kind, always the same for one --seed:
/// flipped bits (bits), lost and inserted bytes (slips), random bytes between frames (bursts),
/// bytes there that look like headers (headers), and frames that end early (cuts). Every stream is
/// decoded by the library in all its ways, and by a plain receiver such as firmware often has: it
/// collects the frame that a header announces, and drops it whole if it is bad.
///
/// The ways: Frames, the iterator; each, with SIMD where the processor has it, and portable,
/// without; by N, a Decoder that is given N bytes at a time; pushed, one that is given each byte.
///
/// A frame is intact if it arrives whole, and no byte of it belongs to something valid before it. A
/// phantom is a frame that was delivered but did not arrive. Noise makes valid frames by chance,
/// about once in 65536 tries: these are unavoidable, and are counted by a decoder that shares no
/// code with the library.
///
/// The exit code is 1 if a decoder of the library loses an intact frame, or delivers a phantom that
/// is not one of the unavoidable ones.
#[derive(Debug, clap::Args)]
#[command(after_help = EXIT_CODES)]
pub(crate) struct Args {
    /// Only the streams of this protocol
    #[arg(short = 'P', long, value_enum)]
    protocol: Option<Protocol>,

    /// Only the streams whose name contains this, such as ucp/bits
    #[arg(long, value_name = "TEXT")]
    stream: Option<String>,

    /// Frames per stream
    #[arg(
        long,
        value_name = "N",
        default_value_t = 10_000,
        value_parser = clap::value_parser!(u32).range(1..=1_000_000)
    )]
    frames: u32,

    /// Seed of all chance
    #[arg(long, value_name = "N", default_value_t = 1)]
    seed: u64,

    /// Print one JSON object per stream and decoder
    #[arg(short, long)]
    json: bool,
}

/// The protocol of the traffic.
const fn protocol_of(traffic: Traffic) -> Protocol {
    match traffic {
        Traffic::Ucp | Traffic::UcpToRobot => Protocol::Ucp,
        Traffic::Ikeya | Traffic::IkeyaRequests => Protocol::Ikeya,
        Traffic::Ikeya3 => Protocol::Ikeya3,
    }
}

/// The streams that were asked for.
fn streams(args: &Args) -> Vec<(String, Traffic, Noise)> {
    let all = Traffic::ALL.into_iter().flat_map(|traffic| {
        let name = move |noise: Noise| format!("{}/{}", traffic.name(), noise.name());
        Noise::ALL.into_iter().map(move |noise| (name(noise), traffic, noise))
    });
    let is_wanted = |(name, traffic, _): &(String, Traffic, Noise)| {
        args.protocol.is_none_or(|protocol| protocol == protocol_of(*traffic))
            && args.stream.as_deref().is_none_or(|text| name.contains(text))
    };
    all.filter(is_wanted).collect()
}

/// Runs the subcommand.
pub(crate) fn run(args: &Args) -> Result<(), Failure> {
    let mut out = io::stdout().lock();
    compare(args, &Receiver::ALL, &mut out)
}

/// Prints what these receivers make of the streams; fails if one of the library is not perfect.
fn compare(args: &Args, receivers: &[Receiver], out: &mut impl Write) -> Result<(), Failure> {
    let streams = streams(args);
    if streams.is_empty() {
        return Err(Failure::Usage("no stream has such a name; without --stream: all".to_owned()));
    }
    let mut table = Table::new(args.json, receivers);
    table.titles(out).map_err(Failure::Write)?;
    let mut faults = Vec::new();
    for (name, traffic, noise) in &streams {
        let arrival = transmit(*traffic, *noise, args.frames as usize, args.seed);
        let rows: Vec<_> = receivers
            .iter()
            .map(|&receiver| {
                let tally = arrival.tally(&receiver.receive(*traffic, &arrival.bytes));
                Row { stream: name, receiver, frames: args.frames, tally }
            })
            .collect();
        faults.extend(rows.iter().filter_map(Row::fault));
        table.stream(out, &rows).and_then(|()| out.flush()).map_err(Failure::Write)?;
    }
    table.totals(out).and_then(|()| out.flush()).map_err(Failure::Write)?;
    match &*faults {
        [] => Ok(()),
        [fault] => Err(Failure::Failed(fault.clone())),
        [fault, more @ ..] => Err(Failure::Failed(format!("{fault}; and {} more", more.len()))),
    }
}

#[cfg(test)]
mod tests {
    use super::{Args, Noise, Receiver, Traffic, compare, streams, transmit};

    const ARGS: Args = Args { protocol: None, stream: None, frames: 300, seed: 7, json: true };

    fn outcome(args: &Args, receivers: &[Receiver]) -> (String, Option<String>) {
        let mut out = Vec::new();
        let result = compare(args, receivers, &mut out);
        (String::from_utf8(out).unwrap(), result.err().map(|failure| failure.to_string()))
    }

    #[test]
    fn a_decoder_that_loses_one_frame_fails_the_comparison() {
        let args = Args { stream: Some("ucp/bits-1e-3".to_owned()), ..ARGS };
        assert_eq!(outcome(&args, &[Receiver::Frames, Receiver::Plain]).1, None);
        let (_, fault) = outcome(&args, &[Receiver::Frames, Receiver::Forgetful]);
        let says = "ucp/bits-1e-3: forgetful has lost 1 intact frame";
        assert_eq!(fault.as_deref(), Some(says));
        let (_, fault) = outcome(&ARGS, &[Receiver::Forgetful]);
        assert_eq!(fault.unwrap(), "ucp/clean: forgetful has lost 1 intact frame; and 49 more");
    }

    #[test]
    fn a_decoder_that_delivers_a_frame_twice_fails_the_comparison() {
        let args = Args { stream: Some("ikeya/clean".to_owned()), json: false, ..ARGS };
        let (_, fault) = outcome(&args, &[Receiver::Stuttering]);
        let says = "ikeya/clean: stuttering has delivered 1 phantom that the noise has not made";
        assert_eq!(fault.as_deref(), Some(says));
    }

    #[test]
    fn every_stream_has_a_name_of_its_own() {
        let mut names: Vec<_> = streams(&ARGS).into_iter().map(|(name, ..)| name).collect();
        assert_eq!(names.len(), 50);
        names.sort_unstable();
        names.dedup();
        assert_eq!(names.len(), 50);
    }

    #[test]
    fn the_plain_receiver_finds_all_frames_of_a_clean_line_and_loses_some_behind_headers() {
        for traffic in Traffic::ALL {
            let clean = transmit(traffic, Noise::None, 300, 1);
            let found = Receiver::Plain.receive(traffic, &clean.bytes);
            assert_eq!(found, clean.valid, "{traffic:?}");
            let (mut damaged, [most @ .., _]) = (clean.bytes.clone(), &clean.valid[..]) else {
                panic!("no frames");
            };
            *damaged.last_mut().unwrap() ^= 1;
            assert_eq!(Receiver::Plain.receive(traffic, &damaged), most, "{traffic:?}");
            let noisy = transmit(traffic, Noise::HeaderBursts(2), 300, 1);
            let tally = noisy.tally(&Receiver::Plain.receive(traffic, &noisy.bytes));
            assert!(tally.delivered < 290 && tally.delivered > 100, "{traffic:?}: {tally:?}");
        }
    }
}
