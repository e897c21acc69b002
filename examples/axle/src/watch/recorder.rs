//! A recording that can be switched on and off while a line is watched.

use std::{
    path::{Path, PathBuf},
    time::SystemTime,
};

use axlewire::stream::Framing;

use super::args::Watched;
use crate::{args::Protocol, failure::Failure, listing::Shown, pcapng::Recording, record::Frames};

/// The recording of a line, if there is one at present.
pub(super) struct Recorder<F> {
    running: Option<(PathBuf, Frames<F>)>,
    /// The file from the command line.
    named: Option<PathBuf>,
    /// Number of recordings so far.
    count: u32,
    protocol: Protocol,
    port: String,
    baud: u32,
}

impl<F> Recorder<F>
where
    F: Framing,
    for<'a> F::Frame<'a>: Shown,
{
    /// Begins to record, if the command line says so.
    pub(super) fn new(watched: &Watched<'_>) -> Result<Self, Failure> {
        let mut recorder = Self {
            running: None,
            named: watched.args.record.clone(),
            count: 0,
            protocol: watched.protocol,
            port: watched.port.to_owned(),
            baud: watched.baud,
        };
        if recorder.named.is_some() {
            recorder.start()?;
        }
        Ok(recorder)
    }

    /// Begins a recording. It never replaces a file.
    pub(super) fn start(&mut self) -> Result<(), Failure> {
        let path = self.next_path();
        let file = Recording::create(&path, false, self.protocol, &self.port, self.baud)?;
        self.count += 1;
        self.running = Some((path, Frames::new(file)));
        Ok(())
    }

    /// The file of the next recording: as named on the command line, then with a number, or named
    /// after the time.
    fn next_path(&self) -> PathBuf {
        match &self.named {
            Some(named) if self.count == 0 => named.clone(),
            Some(named) => numbered(named, self.count + 1),
            None => unused(&automatic(SystemTime::now())),
        }
    }

    /// Takes in what has just been received, and when: microseconds since 1970.
    pub(super) fn take(&mut self, bytes: &[u8], micros: u64) -> Result<(), Failure> {
        match &mut self.running {
            Some((_, frames)) => frames.take_at(bytes, micros),
            None => Ok(()),
        }
    }

    /// The file of the running recording.
    #[cfg(all(unix, feature = "dashboard"))]
    pub(super) fn path(&self) -> Option<&Path> {
        self.running.as_ref().map(|(path, _)| &**path)
    }

    /// Ends the recording, if there is one.
    pub(super) fn finish(&mut self) -> Result<(), Failure> {
        self.running.take().map_or(Ok(()), |(_, mut frames)| frames.finish())
    }

    /// Gives up a recording that has failed.
    pub(super) fn drop_it(&mut self) {
        self.running = None;
    }
}

/// The path, or with a number if there is a file of that name: two recordings may begin within a
/// second.
fn unused(path: &Path) -> PathBuf {
    let numbers = (2..100).map(|number| numbered(path, number));
    let mut paths = std::iter::once(path.to_owned()).chain(numbers);
    paths.find(|path| !path.exists()).unwrap_or_else(|| path.to_owned())
}

/// `line.pcapng` as `line-2.pcapng`.
fn numbered(path: &Path, number: u32) -> PathBuf {
    let mut name = path.file_stem().unwrap_or_default().to_owned();
    name.push(format!("-{number}"));
    if let Some(extension) = path.extension() {
        name.push(".");
        name.push(extension);
    }
    path.with_file_name(name)
}

/// `axle-20261122-224500.pcapng`, in UTC.
fn automatic(now: SystemTime) -> PathBuf {
    let time = humantime::format_rfc3339_seconds(now).to_string();
    let digits: String = time.chars().filter(char::is_ascii_digit).collect();
    let (date, time) = digits.split_at_checked(8).unwrap_or((&digits, ""));
    format!("axle-{date}-{time}.pcapng").into()
}

#[cfg(test)]
mod tests;
