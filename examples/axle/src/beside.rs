//! A file or a folder that is there as a whole or not at all: it is written beside its place, under
//! another name, and renamed at the end.

use std::{
    fs::{self, File},
    io,
    path::{Path, PathBuf},
    process,
    sync::{Arc, Mutex, PoisonError},
    thread,
    time::Duration,
};

use crate::{failure::Failure, signals::Signals};

/// What is being written. Dropped before [`keep`](Self::keep), it is removed.
#[derive(Debug)]
pub(crate) struct Beside {
    path: PathBuf,
    kind: Kind,
    force: bool,
    /// What is to be removed; `None` once it has its own name.
    temporary: Arc<Mutex<Option<PathBuf>>>,
}

#[derive(Clone, Copy, Debug, Eq, PartialEq)]
enum Kind {
    File,
    /// With files of these extensions only.
    Folder(&'static str),
}

/// How often a signal is looked for.
const PERIOD: Duration = Duration::from_millis(50);

/// After a signal, the time to end by itself: reading may wait for a pipe that says nothing.
const GRACE: Duration = Duration::from_millis(500);

impl Beside {
    /// A file for `path`, which is not overwritten unless `force` is set.
    pub(crate) fn file(path: &Path, force: bool) -> Result<(Self, File), Failure> {
        // Through links, so that the file behind them is replaced.
        let path = fs::canonicalize(path).unwrap_or_else(|_| path.to_owned());
        let (beside, temporary) = Self::new(path, Kind::File, force)?;
        let file = File::options().write(true).create_new(true).open(&temporary);
        let file = file.map_err(|error| cannot_create(&beside.path, &error))?;
        beside.will_remove(temporary);
        Ok((beside, file))
    }

    /// A folder for `path`. One that is there is not replaced unless `force` is set and all that is
    /// in it are files with this extension or `csv`. Returns where to write the files.
    pub(crate) fn folder(
        path: &Path,
        force: bool,
        extension: &'static str,
    ) -> Result<(Self, PathBuf), Failure> {
        let (beside, temporary) = Self::new(path.to_owned(), Kind::Folder(extension), force)?;
        fs::create_dir(&temporary).map_err(|error| cannot_create(&beside.path, &error))?;
        beside.will_remove(temporary.clone());
        Ok((beside, temporary))
    }

    fn new(path: PathBuf, kind: Kind, force: bool) -> Result<(Self, PathBuf), Failure> {
        let temporary = beside(&path, "part")?;
        let beside = Self { path, kind, force, temporary: Arc::default() };
        beside.check()?;
        Ok((beside, temporary))
    }

    fn will_remove(&self, temporary: PathBuf) {
        *self.temporary.lock().unwrap_or_else(PoisonError::into_inner) = Some(temporary);
    }

    /// From now on a signal ends the tool even while it waits for its input, and nothing is left.
    pub(crate) fn end_on(&self, signals: &Signals) {
        let (temporary, signals) = (Arc::downgrade(&self.temporary), signals.watcher());
        thread::spawn(move || {
            while !signals.is_raised() {
                thread::sleep(PERIOD);
                if temporary.strong_count() == 0 {
                    return;
                }
            }
            thread::sleep(GRACE);
            let Some(temporary) = temporary.upgrade() else { return };
            let mut path = temporary.lock().unwrap_or_else(PoisonError::into_inner);
            if let Some(path) = path.take() {
                remove(&path);
                // The tool may have written its last file: a lock is held until it is gone.
                let _ = interrupted().report();
                process::exit(1);
            }
        });
    }

    /// Gives it its name, and replaces what has it.
    pub(crate) fn keep(self) -> Result<(), Failure> {
        self.check()?;
        let mut temporary = self.temporary.lock().unwrap_or_else(PoisonError::into_inner);
        let Some(from) = temporary.as_deref() else { return Err(interrupted()) };
        let cannot = |error: io::Error| cannot_create(&self.path, &error);
        if matches!(self.kind, Kind::Folder(_)) && self.path.exists() {
            let old = beside(&self.path, "old")?;
            fs::rename(&self.path, &old).map_err(cannot)?;
            if let Err(error) = fs::rename(from, &self.path) {
                // Back to what was there.
                let _ = fs::rename(&old, &self.path);
                return Err(cannot(error));
            }
            remove(&old);
        } else {
            fs::rename(from, &self.path).map_err(cannot)?;
        }
        *temporary = None;
        Ok(())
    }

    /// Whether what has the name, if anything, may be replaced.
    fn check(&self) -> Result<(), Failure> {
        let Ok(known) = fs::symlink_metadata(&self.path) else { return Ok(()) };
        let cannot = |why: &str| Failure::Failed(format!("cannot create {:?}: {why}", self.path));
        match self.kind {
            _ if !self.force => {
                Err(cannot_create(&self.path, &io::ErrorKind::AlreadyExists.into()))
            }
            Kind::File if known.is_file() => Ok(()),
            Kind::File => Err(cannot("there is something else than a file")),
            Kind::Folder(_) if !known.is_dir() => {
                Err(cannot("there is something else than a folder"))
            }
            Kind::Folder(extension) => {
                let files = fs::read_dir(&self.path);
                let files = files.map_err(|error| cannot_create(&self.path, &error))?;
                for file in files {
                    let Ok(file) = file else { continue };
                    let path = file.path();
                    let is_ours = [extension, "csv"]
                        .iter()
                        .any(|known| path.extension().is_some_and(|found| found == *known));
                    if !is_ours || !file.file_type().is_ok_and(|kind| kind.is_file()) {
                        let name = file.file_name();
                        return Err(cannot(&format!("{name:?} in it is not of an export")));
                    }
                }
                Ok(())
            }
        }
    }
}

impl Drop for Beside {
    fn drop(&mut self) {
        if let Some(path) = self.temporary.lock().unwrap_or_else(PoisonError::into_inner).take() {
            remove(&path);
        }
    }
}

/// What is said after a signal.
pub(crate) fn interrupted() -> Failure {
    Failure::Failed("interrupted: nothing was written".to_owned())
}

fn cannot_create(path: &Path, error: &io::Error) -> Failure {
    let hint = match error.kind() {
        io::ErrorKind::AlreadyExists => ": remove it first, or choose another name",
        _ => "",
    };
    Failure::Failed(format!("cannot create {path:?}: {error}{hint}"))
}

/// A hidden name in the same folder, so that it can be renamed.
fn beside(path: &Path, what: &str) -> Result<PathBuf, Failure> {
    let Some(name) = path.file_name() else {
        return Err(Failure::Usage(format!("{path:?} is not the name of a file")));
    };
    let mut hidden = std::ffi::OsString::from(".");
    hidden.push(name);
    hidden.push(format!(".{}.{what}", process::id()));
    Ok(path.with_file_name(hidden))
}

fn remove(path: &Path) {
    // If that is not allowed any more, nothing else would help.
    let _ = if path.is_dir() { fs::remove_dir_all(path) } else { fs::remove_file(path) };
}
