//! Captures named by files and folders, in the order of time.

use std::{
    collections::BTreeSet,
    fs,
    path::{Path, PathBuf},
};

use crate::{
    failure::Failure,
    input::{self, Form, Input},
    pcapng::{LATEST_US, Reader},
};

/// What a folder may hold besides captures.
const EXTENSIONS: [&str; 4] = [".pcapng", ".pcap", ".pcapng.gz", ".pcap.gz"];

/// Opens files and folders of captures, or standard input for none and `-`.
pub(crate) fn open(paths: &[PathBuf], form: Form) -> Result<Input, Failure> {
    match paths {
        [] => Input::open_one(None, form),
        [path] if !path.is_dir() => Input::open_one(Some(path), form),
        paths => open_all(paths, form),
    }
}

/// Opens a collection: in the order of the times of the first packets, then of their names. All
/// must be captures with times; of what is damaged from its first bytes on, the failures are kept.
fn open_all(paths: &[PathBuf], form: Form) -> Result<Input, Failure> {
    let (mut timed, mut left_out, mut seen) = (Vec::new(), Vec::new(), BTreeSet::new());
    for path in paths {
        let is_folder = path.is_dir();
        let files = if is_folder { below(path)? } else { vec![path.clone()] };
        for file in files {
            // However it is spelt.
            if !seen.insert(file.canonicalize().unwrap_or_else(|_| file.clone())) {
                continue;
            }
            match first_time(&file, form) {
                Ok(micros) => timed.push((micros, file)),
                Err(failure @ Failure::Open { .. }) if !is_folder => return Err(failure),
                Err(Failure::Usage(line)) if !is_folder => {
                    return Err(Failure::Usage(format!("{line}: give it alone")));
                }
                Err(Failure::Usage(line)) => left_out.push(Failure::Failed(line)),
                Err(failure) => left_out.push(failure),
            }
        }
    }
    if timed.is_empty() && !left_out.is_empty() {
        return Err(left_out.swap_remove(0));
    }
    timed.sort();
    let files: Vec<_> = timed.into_iter().map(|(_, file)| file).collect();
    let root = folder_of_all(&files);
    Input::collection(files, root, left_out, form)
}

/// The folder that all files are in or below.
fn folder_of_all(files: &[PathBuf]) -> PathBuf {
    let mut folders = files.iter().map(|file| input::folder_of(file));
    let mut root = folders.next().unwrap_or_default();
    for folder in folders {
        while !folder.starts_with(&root) && root.pop() {}
    }
    root
}

/// The captures in a folder and those below it; links are not followed.
fn below(folder: &Path) -> Result<Vec<PathBuf>, Failure> {
    let cannot_open = |error| Failure::Open { path: folder.to_owned(), error };
    let (mut folders, mut files) = (vec![folder.to_owned()], Vec::new());
    while let Some(folder) = folders.pop() {
        for entry in fs::read_dir(&folder).map_err(cannot_open)? {
            let entry = entry.map_err(cannot_open)?;
            let (path, kind) = (entry.path(), entry.file_type().map_err(cannot_open)?);
            let name = entry.file_name().to_string_lossy().to_ascii_lowercase();
            if kind.is_dir() {
                folders.push(path);
            } else if EXTENSIONS.iter().any(|extension| name.ends_with(extension)) {
                files.push(path);
            }
        }
    }
    if files.is_empty() {
        let line = format!("{folder:?} has no files that end in .pcapng or .pcap, or that and .gz");
        return Err(Failure::Failed(line));
    }
    Ok(files)
}

/// The time of the first packet; without one, the end of all times.
fn first_time(path: &Path, form: Form) -> Result<u64, Failure> {
    // What a pipe has cannot be read twice, and opening it may take forever.
    let cannot_open = |error| Failure::Open { path: path.to_owned(), error };
    if !fs::metadata(path).map_err(cannot_open)?.is_file() {
        return Err(Failure::Usage(format!("{path:?} is not a file")));
    }
    let mut input = Input::open_one(Some(path), form)?;
    if input.peek(1, |_| false)?.is_empty() {
        return Err(Failure::Failed(format!("{path:?} is empty")));
    }
    if !input.has_times()? {
        return Err(Failure::Usage(format!("{path:?} is no pcapng or pcap")));
    }
    // Damage is told when the file is read.
    let mut reader = Reader::new(&mut input);
    while let Ok(Some(packet)) = reader.next() {
        if let Some(micros) = packet.micros.filter(|micros| *micros <= LATEST_US) {
            return Ok(micros);
        }
    }
    Ok(u64::MAX)
}

/// The names for a message.
pub(crate) fn named(paths: &[PathBuf]) -> String {
    paths.iter().map(|path| format!("{path:?}")).collect::<Vec<_>>().join(", ")
}
