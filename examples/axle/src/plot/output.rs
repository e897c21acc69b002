//! The file of a picture.

use std::{fs::File, io::Write, path::Path};

use crate::{
    beside::{Beside, cannot_write},
    failure::Failure,
    input::Input,
    signals::Signals,
};

/// What a picture is made as.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub(super) enum Format {
    Svg,
    Png,
    Html,
}

impl Format {
    /// The format that the end of a name says.
    pub(super) fn of(path: &Path) -> Result<Self, Failure> {
        let extension = path.extension().and_then(|it| it.to_str()).unwrap_or_default();
        match extension.to_ascii_lowercase().as_str() {
            "svg" => Ok(Self::Svg),
            "png" => Ok(Self::Png),
            "html" => Ok(Self::Html),
            _ => Err(Failure::Usage(format!("{path:?} does not end in .svg, .png or .html"))),
        }
    }
}

/// A file that is there as a whole or not at all; a signal ends the tool and leaves nothing.
pub(super) struct Output<'a> {
    path: &'a Path,
    beside: Beside,
    file: File,
}

impl<'a> Output<'a> {
    /// Fails at once if the file cannot be written, not after a long capture.
    pub(super) fn create(
        path: &'a Path,
        force: bool,
        input: &Input,
        signals: &Signals,
    ) -> Result<Self, Failure> {
        let (beside, file) = Beside::file(path, force, input)?;
        beside.end_on(signals);
        Ok(Self { path, beside, file })
    }

    /// Writes all of it.
    pub(super) fn finish(self, bytes: &[u8]) -> Result<(), Failure> {
        let Self { path, beside, mut file } = self;
        // A full disk may tell it no earlier than at the end.
        let written = file.write_all(bytes).and_then(|()| file.sync_all());
        written.map_err(|error| cannot_write(path, &error))?;
        beside.keep()
    }
}
