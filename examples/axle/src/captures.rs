//! Captures named by files and folders, in the order of time.

use std::{
    fs,
    path::{Path, PathBuf},
};

use crate::{
    failure::Failure,
    input::{Form, Input},
    pcapng::Reader,
};

/// What a folder may hold besides captures.
const EXTENSIONS: [&str; 4] = [".pcapng", ".pcap", ".pcapng.gz", ".pcap.gz"];

/// Opens files and folders of captures, or standard input for none and `-`.
pub(crate) fn open(paths: &[PathBuf], form: Form) -> Result<Input, Failure> {
    let is_collection = paths.len() > 1 || paths.iter().any(|path| path.is_dir());
    let files = in_order(paths, form)?;
    let root = is_collection.then(|| folder_of_all(&files));
    Input::open(files, root, form)
}

/// The folder that all files are in or below.
fn folder_of_all(files: &[PathBuf]) -> PathBuf {
    let mut parents = files.iter().filter_map(|file| file.parent());
    let mut root = parents.next().unwrap_or_else(|| Path::new("")).to_owned();
    for parent in parents {
        while !parent.starts_with(&root) && root.pop() {}
    }
    root
}

/// The files, in the order of the times of their first packets, and then of their names. Several
/// must all be captures with times.
fn in_order(paths: &[PathBuf], form: Form) -> Result<Vec<PathBuf>, Failure> {
    let mut files = Vec::new();
    for path in paths {
        if path.is_dir() { below(path, &mut files)? } else { files.push(path.clone()) }
    }
    if files.len() < 2 {
        return Ok(files);
    }
    let mut timed = Vec::new();
    for path in files {
        timed.push((first_time(&path, form)?.unwrap_or(u64::MAX), path));
    }
    timed.sort();
    timed.dedup();
    Ok(timed.into_iter().map(|(_, path)| path).collect())
}

/// The captures in a folder and those below it; links are not followed.
fn below(folder: &Path, files: &mut Vec<PathBuf>) -> Result<(), Failure> {
    let cannot_open = |error| Failure::Open { path: folder.to_owned(), error };
    let (mut folders, begin) = (vec![folder.to_owned()], files.len());
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
    if files.len() == begin {
        let line = format!("{folder:?} has no files that end in .pcapng or .pcap, or that and .gz");
        return Err(Failure::Failed(line));
    }
    Ok(())
}

/// The time of the first packet, if there is one.
fn first_time(path: &Path, form: Form) -> Result<Option<u64>, Failure> {
    let mut input = Input::open_one(Some(path), form)?;
    if !input.has_times()? {
        let line = format!("{path:?} is no pcapng or pcap: without times, give one file at a time");
        return Err(Failure::Usage(line));
    }
    // Damage is told when the file is read.
    let mut reader = Reader::new(&mut input);
    Ok(reader.next().ok().flatten().and_then(|packet| packet.micros))
}

/// The names for a message.
pub(crate) fn named(paths: &[PathBuf]) -> String {
    paths.iter().map(|path| format!("{path:?}")).collect::<Vec<_>>().join(", ")
}
