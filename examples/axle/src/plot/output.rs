//! A file that is there as a whole or not at all.

use std::{
    ffi::OsString,
    fs::{self, File},
    io::{self, Write},
    path::{Path, PathBuf},
};

use crate::failure::Failure;

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
        let end = path.extension().map(|end| end.to_ascii_lowercase());
        match end.as_deref().and_then(|end| end.to_str()) {
            Some("svg") => Ok(Self::Svg),
            Some("png") => Ok(Self::Png),
            Some("html") => Ok(Self::Html),
            _ => {
                let line = format!("the name of the picture {path:?} ends in no .svg, .png or .html");
                Err(Failure::Usage(line))
            }
        }
    }
}

/// Writes a file beside the one that is meant, and gives it its name once it is whole.
pub(super) fn write(path: &Path, bytes: &[u8]) -> Result<(), Failure> {
    let beside = beside(path);
    let written = put(&beside, bytes).and_then(|()| fs::rename(&beside, path));
    written.map_err(|error| {
        // If it was never made, there is nothing to remove.
        let _ = fs::remove_file(&beside);
        Failure::Failed(format!("cannot write {path:?}: {error}"))
    })
}

fn put(path: &Path, bytes: &[u8]) -> io::Result<()> {
    let mut file = File::create(path)?;
    file.write_all(bytes)?;
    // A full disk may tell it no earlier.
    file.sync_all()
}

/// A name in the same folder, which no other run of the tool takes at the same time.
fn beside(path: &Path) -> PathBuf {
    let mut name = OsString::from(".");
    name.push(path.file_name().unwrap_or_default());
    name.push(format!(".{}.part", std::process::id()));
    path.with_file_name(name)
}
