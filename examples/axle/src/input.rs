//! Input bytes from a file or standard input, one chunk at a time.

use std::{
    fs::File,
    io::{self, ErrorKind, IsTerminal, Read},
    path::{Path, PathBuf},
};

use indicatif::{ProgressBar, ProgressFinish, ProgressStyle};

use crate::failure::Failure;

/// Maximum number of bytes read at once.
pub(crate) const CHUNK_LEN: usize = 64 * 1024;

/// Files up to this many bytes are decoded too quickly for a progress bar.
const NO_PROGRESS_UP_TO: u64 = 8 * 1024 * 1024;

/// A byte source of any length that holds one chunk in memory.
pub(crate) struct Input {
    path: Option<PathBuf>,
    reader: Box<dyn Read>,
    chunk: Box<[u8]>,
    progress: Option<ProgressBar>,
}

impl Input {
    /// Opens `path`, or standard input for `None` and `-`.
    pub(crate) fn open(path: Option<&Path>) -> Result<Self, Failure> {
        let chunk = vec![0; CHUNK_LEN].into_boxed_slice();
        let Some(path) = path.filter(|path| *path != "-") else {
            let reader = Box::new(io::stdin());
            return Ok(Self { path: None, reader, chunk, progress: None });
        };
        let cannot_open = |error| Failure::Open { path: path.to_owned(), error };
        let file = File::open(path).map_err(cannot_open)?;
        let metadata = file.metadata().map_err(cannot_open)?;
        if metadata.is_dir() {
            return Err(Failure::Directory { path: path.to_owned() });
        }
        let progress = metadata.is_file().then(|| progress(metadata.len())).flatten();
        Ok(Self { path: Some(path.to_owned()), reader: Box::new(file), chunk, progress })
    }

    /// The next bytes; empty at the end.
    pub(crate) fn read(&mut self) -> Result<&[u8], Failure> {
        let read = loop {
            match self.reader.read(&mut self.chunk) {
                Err(error) if error.kind() == ErrorKind::Interrupted => {}
                Err(error) => return Err(Failure::Read { path: self.path.clone(), error }),
                Ok(read) => break read,
            }
        };
        if let Some(progress) = &self.progress {
            progress.inc(read as u64);
        }
        Ok(self.chunk.get(..read).unwrap_or_default())
    }
}

/// A bar on standard error, if that is a terminal and the listing does not go to the terminal too.
fn progress(len: u64) -> Option<ProgressBar> {
    if len <= NO_PROGRESS_UP_TO || !io::stderr().is_terminal() || io::stdout().is_terminal() {
        return None;
    }
    let style = ProgressStyle::with_template(
        "{bytes} of {total_bytes} [{bar:30}] {bytes_per_sec}, {eta} left",
    )
    .unwrap_or_else(|_| ProgressStyle::default_bar());
    Some(ProgressBar::new(len).with_style(style).with_finish(ProgressFinish::AndClear))
}
