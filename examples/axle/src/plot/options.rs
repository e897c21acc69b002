//! Arguments of `axle plot`.

use std::path::PathBuf;

#[cfg(feature = "plot")]
use crate::failure::Failure;
use crate::{args, decode::Named, help::EXIT_CODES, input::Form};

/// Draw a capture: as SVG, as PNG, or as a page to zoom in
///
/// A motor bus: set-point and measured value of each node, response times, errors. A rover:
/// commands, wheel speeds, heading, sensors, battery, power, and what was lost. The values are
/// those of `axle decode --json`; the page is one file and needs no network.
///
/// Raw bytes have no times: the axis is the byte offset, or with --baud the time that the bytes
/// take on the line, without pauses.
///
/// Memory use does not grow with the input: of a long capture, first, lowest, highest and last
/// value of each of some thousand columns are kept, and the picture says how wide a column is.
/// Needs the feature plot of the tool.
#[derive(Debug, clap::Args)]
#[command(after_help = EXIT_CODES)]
pub(crate) struct Args {
    /// Protocol of the line; auto takes that of a pcapng or pcap file, or the one whose frames
    /// have the most bytes at the beginning of raw bytes
    #[arg(short = 'P', long, value_enum, default_value = "auto")]
    pub(super) protocol: Named,

    /// The line to draw, if a pcapng file has several: its number from 0
    #[arg(long, value_name = "N")]
    pub(super) interface: Option<usize>,

    /// Line speed of raw bytes, bit/s: the axis is time on the line
    #[arg(short, long, value_parser = args::baud())]
    pub(super) baud: Option<u32>,

    /// The picture: .svg, .png or .html
    #[arg(short, long, value_name = "FILE")]
    pub(super) output: PathBuf,

    /// Overwrite the picture if there is one
    #[arg(long)]
    pub(super) force: bool,

    #[command(flatten)]
    pub(super) form: Form,

    /// The capture; - is standard input. Several, and folders of them, follow each other in the
    /// order of time
    #[arg(value_name = "FILE", required = true)]
    pub(super) files: Vec<PathBuf>,
}

#[cfg(feature = "plot")]
impl Args {
    /// Refuses an option that says nothing about this kind of capture.
    pub(super) fn fit(&self, is_pcapng: bool) -> Result<(), Failure> {
        let line = match (is_pcapng, self.interface, self.baud) {
            (true, _, Some(_)) => "--baud is for raw bytes: a pcapng file has times",
            (false, Some(_), _) => "--interface is for pcapng files: raw bytes are one line",
            _ => return Ok(()),
        };
        Err(Failure::Usage(line.to_owned()))
    }
}
