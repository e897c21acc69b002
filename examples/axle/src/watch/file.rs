//! A capture instead of a line: the table of its messages.

use std::io;

use axlewire::time::Instant;

use super::args::Args;
use crate::{
    args::Protocol,
    captures,
    decode::{self, Choice, Sheet},
    failure::Failure,
    listing::{self, Table},
};

pub(super) fn run(args: &Args) -> Result<(), Failure> {
    let mut input = captures::open(&args.from.files, args.form)?;
    let (mut sheet, mut found) = (Sheet::new(None), None);
    sheet.wanted = args.count;
    // The times of a capture, microseconds since the first; raw bytes have none.
    let (mut first, mut last) = (None, 0);
    let mut is_ambiguous = false;
    let choice = Choice {
        protocol: args.protocol,
        interface: args.interface,
        joins_sections: true,
        ..Choice::default()
    };
    let walked = decode::walk(&mut input, choice, &mut sheet, |next, sheet| {
        let line = (next.protocol, next.interface);
        if *found.get_or_insert(line) != line {
            is_ambiguous = true;
            let line = "the capture has more than one line: choose one with --interface";
            return Err(Failure::Failed(line.to_owned()));
        }
        if let Some(micros) = next.micros {
            let after = micros.saturating_sub(*first.get_or_insert(micros));
            if args.micros.is_some_and(|limit| after > limit) {
                return Ok(false);
            }
            last = last.max(after);
        }
        sheet.table.get_or_insert_with(|| Table::new(next.protocol, Instant::from_micros(0)));
        Ok(true)
    });
    let (counters, end) = (walked.account, Instant::from_micros(last));
    let is_empty = counters.received == 0;
    let broken = walked.broken.or(walked.cut);
    match broken {
        Some(failure) if is_empty || is_ambiguous => return Err(failure),
        None if is_empty && args.interface.is_some() => {
            return Err(Failure::Failed(decode::nothing(&args.from.files, args.interface)));
        }
        _ => {}
    }
    // Without a frame, the table of every protocol is the same.
    let protocol = found.map(|(it, _)| it).or(args.protocol).unwrap_or(Protocol::Ucp);
    let no_table = || Table::new(protocol, Instant::from_micros(0));
    let mut table = sheet.table.unwrap_or_else(no_table);
    let mut out = io::stdout().lock();
    let told = if args.json {
        table.measure_all(end);
        table.print_json(&mut out, "summary", &counters, end)
    } else if is_empty {
        listing::print_summary(&mut out, &counters, false)
    } else {
        table.finish(&mut out, &counters, end)
    };
    told.map_err(Failure::Write)?;
    broken.map_or(Ok(()), Err)
}
