//! JSON lines: those of `axle decode --json`.

use std::io::{BufWriter, Write};

use super::job::Job;
use crate::{
    beside::{Beside, cannot_write},
    decode::{Sheet, Walked},
    failure::Failure,
    listing::{self, Out, Style},
};

pub(super) fn export(mut job: Job<'_>) -> Result<Walked, Failure> {
    let (beside, file) = Beside::file(job.output, job.force, &job.input)?;
    beside.end_on(&job.signals);
    let mut file = BufWriter::new(file);
    let cannot = |error| cannot_write(job.output, &error);
    if let Some(guess) = &job.chosen.guess {
        writeln!(file, "{}", guess.json()).map_err(cannot)?;
    }
    let mut sheet = Sheet::new(Some(Style::Json));
    let walked = job.chosen.walk(&mut job.input, &mut sheet, |_, sheet| {
        Job::go_on(&job.signals)?;
        file.write_all(&sheet.out.0).map_err(cannot)?;
        sheet.out.0.clear();
        Ok(())
    })?;
    let mut summary = Out::default();
    listing::json_summary(&mut summary, &walked.account, walked.times_back);
    file.write_all(&sheet.out.0).map_err(cannot)?;
    file.write_all(&summary.0).map_err(cannot)?;
    file.flush().map_err(cannot)?;
    drop(file);
    beside.keep()?;
    Ok(walked)
}
