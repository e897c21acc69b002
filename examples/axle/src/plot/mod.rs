//! `axle plot`: draws a capture.

#[cfg(feature = "plot")]
mod bus;
#[cfg(feature = "plot")]
mod canvas;
#[cfg(feature = "plot")]
mod columns;
#[cfg(feature = "plot")]
mod draw;
#[cfg(feature = "plot")]
mod errors;
#[cfg(feature = "plot")]
mod html;
#[cfg(feature = "plot")]
mod labels;
#[cfg(feature = "plot")]
mod letters;
#[cfg(feature = "plot")]
mod line;
#[cfg(feature = "plot")]
mod output;
#[cfg(feature = "plot")]
mod picture;
#[cfg(feature = "plot")]
mod png;
#[cfg(feature = "plot")]
mod read;
#[cfg(feature = "plot")]
mod rover;
#[cfg(feature = "plot")]
mod svg;

use std::path::PathBuf;

use crate::{args, decode::Named, failure::Failure, help::EXIT_CODES};
#[cfg(feature = "plot")]
use crate::{input::Input, signals::Signals};

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
    /// Protocol of the line; auto takes that of a pcapng file, or the one whose frames have the
    /// most bytes at the beginning of raw bytes
    #[arg(short = 'P', long, value_enum, default_value = "auto")]
    protocol: Named,

    /// The line to draw, if a pcapng file has several: its number from 0
    #[arg(long, value_name = "N")]
    interface: Option<usize>,

    /// Line speed of raw bytes, bit/s: the axis is time on the line
    #[arg(short, long, value_parser = args::baud())]
    baud: Option<u32>,

    /// The picture: .svg, .png or .html
    #[arg(short, long, value_name = "FILE")]
    output: PathBuf,

    /// Overwrite the picture if there is one
    #[arg(long)]
    force: bool,

    /// The capture, raw bytes or pcapng; - is standard input
    file: PathBuf,
}

#[cfg(feature = "plot")]
impl Args {
    /// Refuses an option that says nothing about this kind of capture.
    fn fit(&self, is_pcapng: bool) -> Result<(), Failure> {
        let line = match (is_pcapng, self.interface, self.baud) {
            (true, _, Some(_)) => "--baud is for raw bytes: a pcapng file has times",
            (false, Some(_), _) => "--interface is for pcapng files: raw bytes are one line",
            _ => return Ok(()),
        };
        Err(Failure::Usage(line.to_owned()))
    }
}

/// Runs the subcommand.
#[cfg(feature = "plot")]
pub(crate) fn run(args: &Args) -> Result<(), Failure> {
    let format = output::Format::of(&args.output)?;
    let signals = Signals::listen()?;
    let mut input = Input::open(Some(&args.file))?;
    args.fit(input.is_pcapng()?)?;
    let output = output::Output::create(&args.output, args.force, &input, &signals)?;
    let picture = read::picture(args, input, &signals)?;
    let bytes = match format {
        output::Format::Svg => draw::to_svg(&picture)?.into_bytes(),
        output::Format::Png => draw::to_png(&picture)?,
        output::Format::Html => html::page(&picture)?.into_bytes(),
    };
    output.finish(&bytes)
}

/// Runs the subcommand.
#[cfg(not(feature = "plot"))]
pub(crate) fn run(args: &Args) -> Result<(), Failure> {
    let Args { protocol: Named(_), interface: _, baud: _, output: _, force: _, file: _ } = args;
    Err(Failure::without_feature("plot"))
}
