//! A file or a folder that is there as a whole or not at all: it is written beside its place, under
//! another name, and renamed at the end.

use std::{
    collections::BTreeSet,
    fmt::Display,
    fs::{self, File},
    io,
    path::{Path, PathBuf, is_separator},
    process,
    sync::{Arc, Mutex, PoisonError},
    thread,
    time::Duration,
};

use crate::{failure::Failure, input::Input, signals::Signals};

/// An unfinished output. Dropped before [`keep`](Self::keep), it is removed.
#[derive(Debug)]
pub(crate) struct Beside {
    path: PathBuf,
    kind: Kind,
    force: bool,
    /// The temporary path; `None` once it has been renamed.
    temporary: Arc<Mutex<Option<PathBuf>>>,
}

#[derive(Clone, Copy, Debug, Eq, PartialEq)]
enum Kind {
    File,
    /// Only files with this extension, and the list of their columns.
    Folder(&'static str),
}

/// The file of a folder that lists its tables and their columns, and its first line.
pub(crate) const LIST: &str = "columns.csv";
pub(crate) const COLUMNS: &str = "table,column,unit,type";

/// Maximum number of temporary names to try.
const ATTEMPTS: u32 = 100;

/// Interval between two checks for a signal.
const PERIOD: Duration = Duration::from_millis(50);

/// Time to end cleanly after a signal: reading may block on a silent pipe.
const GRACE: Duration = Duration::from_millis(500);

impl Beside {
    /// A file for `path`, made from `input`. An existing file is not overwritten unless `force` is
    /// set, and the input never.
    pub(crate) fn file(path: &Path, force: bool, input: &Input) -> Result<(Self, File), Failure> {
        if path
            .as_os_str()
            .as_encoded_bytes()
            .last()
            .is_some_and(|last| is_separator(*last as char))
        {
            return Err(Failure::Usage(format!("{path:?} is the name of a folder, not of a file")));
        }
        // Through links, so that the file behind them is replaced.
        let path = fs::canonicalize(path).unwrap_or_else(|_| path.to_owned());
        let beside = Self::new(path, Kind::File, force, input)?;
        let file = beside.create(|to| File::options().write(true).create_new(true).open(to))?;
        Ok((beside, file))
    }

    /// A folder for `path`, made from `input`. An existing one is not replaced unless `force` is
    /// set and it is an export with this extension, and nothing else. Returns where to write the
    /// files.
    pub(crate) fn folder(
        path: &Path,
        force: bool,
        extension: &'static str,
        input: &Input,
    ) -> Result<(Self, PathBuf), Failure> {
        let beside = Self::new(path.to_owned(), Kind::Folder(extension), force, input)?;
        let temporary = beside.create(|to| fs::create_dir(to).map(|()| to.to_owned()))?;
        Ok((beside, temporary))
    }

    fn new(path: PathBuf, kind: Kind, force: bool, input: &Input) -> Result<Self, Failure> {
        if input.is_at(&path) && (kind != Kind::File || !path.is_dir()) {
            let what =
                if path.is_dir() { "contains the capture itself" } else { "is the capture itself" };
            return Err(Failure::Usage(format!("{path:?} {what}: choose another name")));
        }
        let beside = Self { path, kind, force, temporary: Arc::default() };
        beside.check()?;
        Ok(beside)
    }

    /// Creates the temporary file or folder under the first free name: after a `kill -9`
    /// one of an earlier process with the same id may be left.
    fn create<T>(&self, make: impl Fn(&Path) -> io::Result<T>) -> Result<T, Failure> {
        for attempt in 0..ATTEMPTS {
            let temporary = beside(&self.path, "part", attempt)?;
            match make(&temporary) {
                Ok(made) => {
                    self.take_mode(&temporary);
                    self.will_remove(temporary);
                    return Ok(made);
                }
                Err(error) if error.kind() == io::ErrorKind::AlreadyExists => {}
                Err(error) => return Err(Failure::cannot_create(&self.path, &error)),
            }
        }
        let line = "all temporary names are taken: remove the hidden .part files beside it";
        Err(Failure::Failed(format!("cannot create {:?}: {line}", self.path)))
    }

    /// The new file gets the permissions of the one it replaces.
    fn take_mode(&self, temporary: &Path) {
        if let Ok(known) = fs::metadata(&self.path)
            && (self.kind == Kind::File || !known.permissions().readonly())
        {
            // Some file systems have none.
            let _ = fs::set_permissions(temporary, known.permissions());
        }
    }

    fn will_remove(&self, temporary: PathBuf) {
        *self.temporary.lock().unwrap_or_else(PoisonError::into_inner) = Some(temporary);
    }

    /// From now on a signal ends the tool even while it waits for input, and nothing is left.
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

    /// Renames it to its final path, and replaces what is there.
    pub(crate) fn keep(self) -> Result<(), Failure> {
        self.check()?;
        let mut temporary = self.temporary.lock().unwrap_or_else(PoisonError::into_inner);
        let Some(from) = temporary.as_deref() else { return Err(interrupted()) };
        let cannot = |error: io::Error| Failure::cannot_create(&self.path, &error);
        if matches!(self.kind, Kind::Folder(_)) && self.path.exists() {
            let mut names = (0..ATTEMPTS).map(|attempt| beside(&self.path, "old", attempt));
            let free = names.find(|name| name.as_ref().is_ok_and(|name| !name.exists()));
            let old = free.unwrap_or_else(|| beside(&self.path, "old", 0))?;
            fs::rename(&self.path, &old).map_err(cannot)?;
            if let Err(error) = fs::rename(from, &self.path) {
                // Back to what was there.
                let _ = fs::rename(&old, &self.path);
                return Err(cannot(error));
            }
            *temporary = None;
            return fs::remove_dir_all(&old).map_err(|error| {
                let path = &self.path;
                let line = format!("{path:?} is written, but what was there is left as {old:?}");
                Failure::Failed(format!("{line}: {error}"))
            });
        }
        fs::rename(from, &self.path).map_err(cannot)?;
        *temporary = None;
        Ok(())
    }

    /// Whether an existing file or folder at the path may be replaced.
    fn check(&self) -> Result<(), Failure> {
        let Ok(known) = fs::symlink_metadata(&self.path) else { return Ok(()) };
        let cannot = |why: &str| Failure::Failed(format!("cannot create {:?}: {why}", self.path));
        match self.kind {
            _ if !self.force => {
                Err(Failure::cannot_create(&self.path, &io::ErrorKind::AlreadyExists.into()))
            }
            Kind::File if known.is_file() => Ok(()),
            Kind::File => Err(cannot("it exists and is not a file")),
            Kind::Folder(_) if !known.is_dir() => Err(cannot("it exists and is not a folder")),
            Kind::Folder(extension) => match not_of_export(&self.path, extension) {
                Ok(None) => Ok(()),
                Ok(Some(why)) => Err(cannot(&why)),
                Err(error) => Err(Failure::cannot_create(&self.path, &error)),
            },
        }
    }
}

/// What in a folder is not of an export with this extension, which has a list of its columns and
/// files of the tables in that list.
fn not_of_export(folder: &Path, extension: &str) -> io::Result<Option<String>> {
    let list = match fs::read_to_string(folder.join(LIST)) {
        Ok(list) if list.lines().next() == Some(COLUMNS) => list,
        Ok(_) => return Ok(Some(format!("{LIST} in it is not of an export"))),
        Err(error) if error.kind() == io::ErrorKind::NotFound => {
            return Ok(Some(format!("it has no {LIST}, so it is no export")));
        }
        Err(error) => return Err(error),
    };
    let tables: BTreeSet<_> =
        list.lines().skip(1).filter_map(|line| line.split(',').next()).collect();
    for file in fs::read_dir(folder)? {
        let file = file?;
        let (name, kind) = (file.file_name(), file.file_type()?);
        let table = name.to_str().and_then(|it| it.strip_suffix(extension)?.strip_suffix('.'));
        let is_table = table.is_some_and(|table| tables.contains(table));
        let is_ours = match (kind.is_file(), kind.is_dir()) {
            (true, _) => is_table || name == LIST,
            (_, true) => is_table && has_only(&file.path(), &["day=", "line="], extension)?,
            _ => false,
        };
        if !is_ours {
            return Ok(Some(format!("{name:?} in it is not of an export")));
        }
    }
    Ok(None)
}

/// Whether a folder has numbered files with this extension, below folders whose names begin like
/// this, and nothing else.
fn has_only(folder: &Path, levels: &[&str], extension: &str) -> io::Result<bool> {
    let mut has_some = false;
    for entry in fs::read_dir(folder)? {
        let entry = entry?;
        let (name, kind) = (entry.file_name(), entry.file_type()?);
        let name = name.to_str().unwrap_or_default();
        let is_ours = match levels.split_first() {
            Some((first, rest)) if kind.is_dir() && name.starts_with(first) => {
                has_only(&entry.path(), rest, extension)?
            }
            Some(_) => false,
            None => {
                let number = name.strip_suffix(extension).and_then(|it| it.strip_suffix('.'));
                kind.is_file() && number.is_some_and(|it| it.parse::<u64>().is_ok())
            }
        };
        if !is_ours {
            return Ok(false);
        }
        has_some = true;
    }
    Ok(has_some)
}

impl Drop for Beside {
    fn drop(&mut self) {
        if let Some(path) = self.temporary.lock().unwrap_or_else(PoisonError::into_inner).take() {
            remove(&path);
        }
    }
}

/// The failure after a signal.
pub(crate) fn interrupted() -> Failure {
    Failure::Failed("interrupted: nothing was written".to_owned())
}

/// The failure to write this path.
pub(crate) fn cannot_write(path: &Path, error: &dyn Display) -> Failure {
    Failure::Failed(format!("cannot write {path:?}: {error}; nothing was kept"))
}

/// A hidden name in the same folder, so that it can be renamed; another one for each attempt.
fn beside(path: &Path, what: &str, attempt: u32) -> Result<PathBuf, Failure> {
    let Some(name) = path.file_name() else {
        return Err(Failure::Usage(format!("{path:?} is not the name of a file")));
    };
    let mut hidden = std::ffi::OsString::from(".");
    hidden.push(name);
    hidden.push(match attempt {
        0 => format!(".{}.{what}", process::id()),
        _ => format!(".{}-{attempt}.{what}", process::id()),
    });
    Ok(path.with_file_name(hidden))
}

fn remove(path: &Path) {
    // If that is not allowed any more, nothing else would help.
    let _ = if path.is_dir() { fs::remove_dir_all(path) } else { fs::remove_file(path) };
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::input::Form;

    #[test]
    fn what_another_process_of_the_same_number_has_left_is_no_obstacle() {
        let path = std::env::temp_dir().join(format!("axle-{}-beside.jsonl", process::id()));
        let input = Input::open_one(None, Form::default()).unwrap();
        let left = beside(&path, "part", 0).unwrap();
        fs::write(&left, "left").unwrap();
        let (second, file) = Beside::file(&path, false, &input).unwrap();
        drop(file);
        second.keep().unwrap();
        assert_eq!(fs::read(&path).unwrap(), b"");
        assert_eq!(fs::read(&left).unwrap(), b"left");
        for path in [path, left] {
            fs::remove_file(path).unwrap();
        }
    }

    #[test]
    fn if_all_names_are_taken_that_is_said() {
        let folder = std::env::temp_dir().join(format!("axle-{}-taken", process::id()));
        fs::create_dir(&folder).unwrap();
        let path = folder.join("out.csv");
        for attempt in 0..ATTEMPTS {
            fs::create_dir(beside(&path, "part", attempt).unwrap()).unwrap();
        }
        let input = Input::open_one(None, Form::default()).unwrap();
        let failure = Beside::folder(&path, false, "csv", &input).unwrap_err();
        assert!(failure.to_string().contains("remove the hidden .part files"), "{failure}");
        fs::remove_dir_all(folder).unwrap();
    }
}
