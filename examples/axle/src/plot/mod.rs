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
mod options;
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

use crate::failure::Failure;
#[cfg(feature = "plot")]
use crate::{captures, signals::Signals};
pub(crate) use options::Args;

/// Runs the subcommand.
#[cfg(feature = "plot")]
pub(crate) fn run(args: &Args) -> Result<(), Failure> {
    let format = output::Format::of(&args.output)?;
    let signals = Signals::listen()?;
    let mut input = captures::open(&args.files, args.form)?;
    args.fit(input.has_times()?)?;
    let output = output::Output::create(&args.output, args.force, &input, &signals)?;
    let (picture, walked) = read::picture(args, input, &signals)?;
    let bytes = match format {
        output::Format::Svg => draw::to_svg(&picture)?.into_bytes(),
        output::Format::Png => draw::to_png(&picture)?,
        output::Format::Html => html::page(&picture)?.into_bytes(),
    };
    output.finish(&bytes)?;
    walked.missing()
}

/// Runs the subcommand.
#[cfg(not(feature = "plot"))]
pub(crate) fn run(args: &Args) -> Result<(), Failure> {
    let Args {
        protocol: crate::decode::Named(_),
        interface: _,
        baud: _,
        output: _,
        force: _,
        form: _,
        files: _,
    } = args;
    Err(Failure::without_feature("plot"))
}
