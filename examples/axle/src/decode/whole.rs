//! A whole capture as tables, files or plots.

use super::{
    Choice, Next, Sheet, Walked,
    detect::{self, Guess, guess, no_frame, no_frame_with_times},
    walk,
};
use crate::{
    args::Protocol,
    failure::Failure,
    input::Input,
    tables::{Sink, Tables},
};

/// What a capture is, before it is decoded.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Chosen {
    /// Names the protocol of raw bytes.
    choice: Choice,
    /// Whether the capture has times, interfaces and directions: pcapng.
    pub(crate) has_times: bool,
    /// How the protocol of raw bytes was found out, if it was not named.
    pub(crate) guess: Option<Guess>,
}

/// Finds out what `input` is, as `axle decode` does: pcapng tells its protocols, and raw bytes are
/// of the named one, or of the one that they look like.
pub(crate) fn choose(input: &mut Input, named: Option<Protocol>) -> Result<Chosen, Failure> {
    let mut choice = Choice { protocol: named, ..Choice::default() };
    let has_times = input.has_times()?;
    let mut found = None;
    if !has_times && named.is_none() {
        let guess = guess(choice, input)?;
        choice.protocol = Some(guess.protocol());
        found = Some(guess);
    }
    // For a hint at the end, if there are no frames.
    input.keep_first(detect::SAMPLE_LEN);
    Ok(Chosen { choice, has_times, guess: found })
}

impl Chosen {
    /// Walks over the whole capture, as far as it can be read. It fails if there is no frame.
    pub(crate) fn walk(
        &self,
        input: &mut Input,
        sheet: &mut Sheet,
        go_on: impl FnMut(Next, &mut Sheet) -> Result<(), Failure>,
    ) -> Result<Walked, Failure> {
        let walked = self.walk_over(input, sheet, go_on)?;
        self.must_have_frames(input, walked)
    }

    /// The same without the last.
    fn walk_over(
        &self,
        input: &mut Input,
        sheet: &mut Sheet,
        mut go_on: impl FnMut(Next, &mut Sheet) -> Result<(), Failure>,
    ) -> Result<Walked, Failure> {
        let mut walked = walk(input, self.choice, sheet, |next, sheet| {
            go_on(next, sheet)?;
            Ok(true)
        });
        walked.broken.take().map_or(Ok(walked), Err)
    }

    /// Fails if there is no frame in what was walked over.
    pub(crate) fn must_have_frames(
        &self,
        input: &Input,
        walked: Walked,
    ) -> Result<Walked, Failure> {
        let account = &walked.account;
        if account.frames > 0 {
            return Ok(walked);
        }
        if let Some(cut) = walked.cut {
            return Err(cut);
        }
        Err(Failure::Failed(match (account.received, self.has_times, self.choice.protocol) {
            (0, ..) => "the capture is empty".to_owned(),
            (_, false, Some(protocol)) => {
                no_frame(protocol, account, &detect::shares(input.first()))
            }
            (received, _, protocol) => no_frame_with_times(protocol, received),
        }))
    }
}

/// Decodes a capture into tables, and hands their rows to `sink`, if there are any. `go_on` is
/// called at least once for every 16 KB, and ends the walk with its failure.
pub(crate) fn walk_into(
    input: &mut Input,
    chosen: &Chosen,
    sink: &mut dyn Sink,
    mut go_on: impl FnMut() -> Result<(), Failure>,
) -> Result<Walked, Failure> {
    let mut sheet = Sheet::new(None);
    sheet.tables = Some(Tables::new(chosen.has_times, sink.takes_partitions()));
    let walked = chosen.walk_over(input, &mut sheet, |_, sheet| {
        go_on()?;
        sheet.tables.as_mut().map_or(Ok(()), |tables| tables.give_full(sink))
    })?;
    sheet.tables.as_mut().map_or(Ok(()), |tables| tables.give_rest(sink))?;
    Ok(walked)
}
