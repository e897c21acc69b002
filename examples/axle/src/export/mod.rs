//! `axle export`: a capture as a file for other tools.

mod csv;
mod folder;
mod job;
mod lines;
#[cfg(feature = "mcap")]
mod mcap;
#[cfg(feature = "parquet")]
mod parquet;

use std::{
    io::{self, Write},
    path::{Path, PathBuf},
};

use job::Job;

use crate::{
    captures,
    decode::{self, Named, Walked},
    failure::Failure,
    help::EXIT_CODES,
    input::Form,
    listing,
    signals::Signals,
};

/// Export a capture for Foxglove, PlotJuggler, DuckDB, pandas and spreadsheets
///
/// Reads what `axle decode` reads and gives the same values as `axle decode --json`. The extension
/// of the output chooses its form:
///
///   .jsonl    the lines of `axle decode --json`
///   .mcap     a topic per message, with a JSON Schema; for Foxglove and PlotJuggler
///   .csv      a folder with a table per message, and columns.csv with the units
///   .parquet  the same as Parquet
///
/// Of several captures or a folder, a table of .parquet is a folder with files for each day and
/// line, such as day=2026-11-27/line=ttyS4/0.parquet.
///
/// A table has the name of its protocol and message, such as ucp.report; the gaps are in skipped.
/// Times are those of a pcapng or pcap file. Raw bytes have none: their tables have no columns for
/// time, interface and direction, and MCAP has the offset instead, a nanosecond per byte.
///
/// The output is written under another name first, so that it is there as a whole or not at all.
/// Of a capture that is cut off, it has what comes before the cut, and the exit code is 1.
/// Memory use does not grow with the input, except for the index that MCAP and Parquet files have
/// at their end: less than a thousandth of the file.
#[derive(Debug, clap::Args)]
#[command(after_help = EXIT_CODES, verbatim_doc_comment)]
pub(crate) struct Args {
    /// Protocol of the line; auto takes that of a pcapng or pcap file, or the one whose frames
    /// have the most bytes at the beginning of raw bytes
    #[arg(short = 'P', long, value_enum, default_value = "auto")]
    protocol: Named,

    /// The file or, for .csv and .parquet, the folder
    #[arg(short, long, value_name = "FILE")]
    output: PathBuf,

    /// Overwrite the output if there is one
    #[arg(long)]
    force: bool,

    #[command(flatten)]
    form: Form,

    /// The capture; - is standard input. Several, and folders of them, follow each other in the
    /// order of time
    #[arg(value_name = "FILE", required = true)]
    files: Vec<PathBuf>,
}

/// A form of the output.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
enum Format {
    Csv,
    Lines,
    Mcap,
    Parquet,
}

/// Runs the subcommand.
pub(crate) fn run(args: &Args) -> Result<(), Failure> {
    let format = format_of(&args.output)?;
    let signals = Signals::listen()?;
    let mut input = captures::open(&args.files, args.form)?;
    let chosen = decode::choose(&mut input, args.protocol.0)?;
    let (output, force) = (&*args.output, args.force);
    let job = Job { input, chosen, output, force, signals };
    let walked = match format {
        Format::Csv => folder::export::<csv::Csv>(job),
        Format::Lines => lines::export(job),
        #[cfg(feature = "mcap")]
        Format::Mcap => mcap::export(job),
        #[cfg(feature = "parquet")]
        Format::Parquet => folder::export::<parquet::Parquet>(job),
        #[allow(unreachable_patterns, reason = "with all features")]
        Format::Mcap | Format::Parquet => return Ok(()),
    }?;
    tell(&walked, &args.output).map_err(Failure::Write)?;
    walked.missing()
}

fn tell(walked: &Walked, output: &Path) -> io::Result<()> {
    let mut out = io::stdout().lock();
    listing::print_summary(&mut out, &walked.account, false)?;
    writeln!(out, "written to {output:?}")?;
    out.flush()
}

/// The format of this file, if this build has it.
fn format_of(output: &Path) -> Result<Format, Failure> {
    let extension = output.extension().and_then(|it| it.to_str()).unwrap_or_default();
    let (format, feature) = match extension.to_ascii_lowercase().as_str() {
        "csv" => (Format::Csv, None),
        "jsonl" => (Format::Lines, None),
        "mcap" => (Format::Mcap, (!cfg!(feature = "mcap")).then_some("mcap")),
        "parquet" => (Format::Parquet, (!cfg!(feature = "parquet")).then_some("parquet")),
        _ => {
            let name = output.file_name().and_then(|it| it.to_str()).unwrap_or_default();
            let line = match name.to_ascii_lowercase().as_str() {
                ".csv" | ".jsonl" | ".mcap" | ".parquet" => {
                    format!("{output:?} is an extension without a name: use out{name}")
                }
                _ => format!("{output:?} does not end in .csv, .jsonl, .mcap or .parquet"),
            };
            return Err(Failure::Usage(line));
        }
    };
    match feature {
        None => Ok(format),
        Some(feature) => Err(Failure::without_feature(feature)),
    }
}
