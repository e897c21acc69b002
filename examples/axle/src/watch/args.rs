//! The arguments of `axle watch`.

use std::path::PathBuf;

use axlewire::time::Instant;

use crate::{
    args::{self, Protocol},
    help::MOTION_HELP,
    input::Form,
};

/// Watch a line without sending anything
///
/// On a terminal, shows a page: one row per node of a motor bus, or the values of a rover, with
/// rates, errors, and a log of gaps and events. Keys: q quit, p pause the picture (counting goes
/// on), f filter the log, r start and stop recording, ? help. Elsewhere, and with --plain, one line
/// is printed per second. Ctrl-C ends with a summary of all messages. A capture is summed up when
/// it has been read to its end.
///
/// Latencies are those from a READ to its answer as this machine heard them: behind a USB adapter,
/// that adds up to 16 ms.
///
/// It sends no requests, so it shows existing traffic only: robots report by themselves, nodes of a
/// motor bus answer only to a master, and on a four-wire bus an adapter hears one direction.
#[derive(Debug, clap::Args)]
#[command(after_help = MOTION_HELP)]
pub(crate) struct Args {
    #[command(flatten)]
    pub(super) from: From,

    #[command(flatten)]
    pub(super) form: Form,

    /// Line speed, bit/s; by default 500000 for Ikeya and 115200 for UCP
    #[arg(short, long, value_parser = clap::value_parser!(u32).range(1..))]
    pub(super) baud: Option<u32>,

    /// Protocol of the line; a pcapng or pcap file has its own
    #[arg(short = 'P', long, value_enum, required_unless_present = "files")]
    pub(super) protocol: Option<Protocol>,

    /// Print lines, on a terminal too
    #[arg(long)]
    pub(super) plain: bool,

    /// Print one JSON object per second, and one at the end
    #[arg(short, long)]
    pub(super) json: bool,

    /// End after this time, seconds; raw bytes of a capture have no times
    #[arg(short = 'f', long = "for", value_name = "SECONDS", value_parser = args::seconds)]
    pub(super) micros: Option<u64>,

    /// End after this number of frames; a line may have brought some more by then
    #[arg(short, long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..))]
    pub(super) count: Option<u64>,

    /// The line to sum up, if a capture has several: its number from 0, as decode shows it
    #[arg(long, value_name = "N", conflicts_with = "port")]
    pub(super) interface: Option<usize>,

    /// Record to this file, as axle record does, from the start; the key r ends it. Without this
    /// option, r records to a file of its own name
    #[arg(long, value_name = "FILE", conflicts_with = "files")]
    pub(super) record: Option<PathBuf>,

    /// Send each frame and gap to this host, as a datagram with the object of axle decode --json,
    /// without interface, as a line that is watched has no number; t is that of --record. Of a
    /// name with several addresses, to each. For PlotJuggler: UDP server, JSON, timestamp t
    #[arg(long, value_name = "HOST:PORT", conflicts_with = "files")]
    pub(super) udp: Option<String>,
}

/// What is watched.
#[derive(Debug, clap::Args)]
#[group(required = true, multiple = false)]
pub(super) struct From {
    /// The serial port, such as /dev/ttyUSB0 or COM3; or tcp:HOST:PORT, a server that passes the
    /// bytes on as they are, such as ser2net's raw
    #[arg(short, long, value_name = "PATH")]
    pub(super) port: Option<String>,

    /// A capture to be summed up; - is standard input. Several, and folders of them, follow each
    /// other in the order of time
    #[arg(value_name = "FILE")]
    pub(super) files: Vec<PathBuf>,
}

/// A line to be watched.
pub(super) struct Watched<'a> {
    pub(super) port: &'a str,
    pub(super) protocol: Protocol,
    pub(super) baud: u32,
    pub(super) args: &'a Args,
}

impl Watched<'_> {
    /// Whether the time is up or there are enough frames.
    pub(super) fn is_over(&self, start: Instant, now: Instant, frames: u64) -> bool {
        let end = self.args.micros.map(|micros| start.as_micros() + micros);
        end.is_some_and(|end| now.as_micros() >= end)
            || self.args.count.is_some_and(|count| frames >= count)
    }
}
