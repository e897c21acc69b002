//! The arguments of `axle decode`.

use std::path::PathBuf;

use clap::{ValueEnum, builder::PossibleValue};

use crate::{
    args::Protocol,
    help::EXIT_CODES,
    input::Form,
    listing::{Style, TimeColumn},
};

/// List the frames of a capture, and the gaps between them
///
/// Reads raw bytes, pcapng as `axle record` writes it, or pcap, packed with gzip or not; standard
/// input too. Every byte appears in exactly one line: a frame, or a gap with the reason why no
/// frame starts there. The end of the input, or of a section of pcapng, counts as a quiet line: a
/// truncated frame becomes a gap. Times do not: how long a line was quiet cannot be told from the
/// moments at which its bytes were read.
/// Memory use does not grow with the input.
///
/// The time of a frame is that of its last byte: of the moment when the recording program got it
/// from the system, with all bytes of the same chunk. Behind a USB adapter, that can be 16 ms after
/// it was on the line. Raw bytes have no times.
#[derive(Debug, clap::Args)]
#[command(after_help = EXIT_CODES)]
pub(crate) struct Args {
    /// Protocol of the line; auto takes that of a pcapng or pcap file, or the one whose frames
    /// have the most bytes at the beginning of raw bytes
    #[arg(short = 'P', long, value_enum, default_value = "auto")]
    pub(super) protocol: Named,

    /// Ikeya: decode packets of one direction only; by default, of both
    #[arg(short, long, value_enum)]
    pub(super) direction: Option<Direction>,

    /// Print one JSON object per line; t is in seconds since 1970
    #[arg(short, long)]
    pub(super) json: bool,

    /// Print the byte counts only
    #[arg(short, long)]
    pub(super) summary: bool,

    /// Time column, if the capture has times
    #[arg(short, long, value_enum, default_value = "relative")]
    pub(super) time: TimeColumn,

    /// Threads for a file of raw bytes, at most 16 of which are used; by default, as many as there
    /// are cores
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..=256))]
    pub(super) jobs: Option<u16>,

    #[command(flatten)]
    pub(super) form: Form,

    /// The capture; if omitted or -, standard input. Several, and folders of them, follow each
    /// other in the order of time
    #[arg(value_name = "FILE")]
    pub(super) files: Vec<PathBuf>,
}

#[derive(Clone, Copy, Debug, ValueEnum)]
pub(crate) enum Direction {
    /// Sent by the master
    ToSlave,
    /// Sent by the slaves
    ToMaster,
}

/// What `--protocol` accepts: a protocol, or `None` for auto.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub(crate) struct Named(pub(crate) Option<Protocol>);

impl ValueEnum for Named {
    fn value_variants<'a>() -> &'a [Self] {
        const ALL: [Named; 4] = [
            Named(None),
            Named(Some(Protocol::Ucp)),
            Named(Some(Protocol::Ikeya)),
            Named(Some(Protocol::Ikeya3)),
        ];
        &ALL
    }

    fn to_possible_value(&self) -> Option<PossibleValue> {
        let auto = || Some(PossibleValue::new("auto").help("Find it out"));
        self.0.as_ref().map_or_else(auto, Protocol::to_possible_value)
    }
}

/// The form of the lines; `None` for the summary alone.
pub(super) fn style(args: &Args, protocol: Protocol, has_times: bool) -> Option<Style> {
    let time = if has_times { args.time } else { TimeColumn::None };
    match (args.summary, args.json) {
        (true, _) => None,
        (false, true) => Some(Style::Json),
        (false, false) => Some(Style::text(protocol.number(), time)),
    }
}
