//! Lists a capture with times: pcapng, or classic pcap.

use super::{
    Choice, Printer, Sheet,
    args::{Args, style},
    detect::no_frame_with_times,
    walk,
};
use crate::{failure::Failure, input::Input};

/// Length of the lines that are printed at once.
const LINES_LEN: usize = 32 * 1024;

/// Lists a capture; each interface and each direction is a stream of its own.
pub(super) fn run(args: &Args, mut input: Input, choice: Choice) -> Result<(), Failure> {
    let mut sheet = Sheet::new(None);
    let mut printer = None;
    let walked = walk(&mut input, choice, &mut sheet, |next, sheet| {
        let printer = printer.get_or_insert_with(|| {
            sheet.style = style(args, next.protocol, true);
            Printer::new(args.json, sheet.style)
        });
        if next.waits || sheet.out.0.len() > LINES_LEN {
            printer.print_sheet(sheet)?;
        }
        if next.waits {
            printer.flush()?;
        }
        Ok(true)
    });
    let mut printer = printer.unwrap_or_else(|| Printer::new(args.json, None));
    printer.print_sheet(&mut sheet)?;
    let account = walked.account;
    if let Some(failure) = walked.broken.or(walked.cut) {
        printer.break_off(&account, walked.times_back)?;
        return Err(failure);
    }
    printer.finish(&account, walked.times_back)?;
    if account.frames == 0 && account.received > 0 {
        let line = no_frame_with_times(choice.protocol, account.received);
        return Err(Failure::Failed(line));
    }
    Ok(())
}
