//! Input bytes from a file or standard input, one chunk at a time.

use std::{
    collections::VecDeque,
    fs::File,
    io::{self, ErrorKind, IsTerminal, Read},
    mem,
    path::{Path, PathBuf},
};

use flate2::read::MultiGzDecoder;
#[cfg(not(target_family = "wasm"))]
use indicatif::{ProgressBar, ProgressFinish, ProgressStyle};

use crate::{
    failure::Failure,
    hex::{self, Hex},
    pcapng,
};

/// How files begin that are no captures which this tool reads, and what they are.
const FOREIGN: &[(&[u8], &str)] = &[
    (&GZIP, "packed twice"),
    (&[0x28, 0xB5, 0x2F, 0xFD], "packed by zstd"),
    (&[0x04, 0x22, 0x4D, 0x18], "packed by lz4"),
    (&[0xFD, b'7', b'z', b'X', b'Z', 0], "packed by xz"),
    (b"BZh", "packed by bzip2"),
    (b"PK\x03\x04", "a zip file"),
    (&[0x34, 0xCD, 0xB2, 0xA1], "a modified pcap file"),
    (&[0xA1, 0xB2, 0xCD, 0x34], "a modified pcap file"),
];

/// Maximum number of bytes read at once.
pub(crate) const CHUNK_LEN: usize = 64 * 1024;

/// The first bytes of a file that is packed with gzip, and how.
const GZIP: [u8; 3] = [0x1F, 0x8B, 8];

/// Number of bytes that tell text from other captures.
const SAMPLE_LEN: usize = 16;

/// Files up to this many bytes are decoded too quickly for a progress bar.
const NO_PROGRESS_UP_TO: u64 = 8 * 1024 * 1024;

/// How the bytes of an input are written.
#[derive(Clone, Copy, Debug, Default, clap::Args)]
pub(crate) struct Form {
    /// The capture is text: two hexadecimal digits for each byte
    #[arg(long)]
    hex: bool,
}

/// Is told of each read how many bytes it gave.
type Progress = Box<dyn Fn(u64)>;

/// A byte source of any length that holds one chunk in memory.
pub(crate) struct Input {
    path: Option<PathBuf>,
    reader: Box<dyn Read>,
    chunk: Box<[u8]>,
    /// Bytes at the front that were read ahead, to look at them first.
    ahead: Vec<u8>,
    /// Why no more could be read ahead.
    failure: Option<Failure>,
    /// The first bytes, up to the length that was asked for.
    first: Vec<u8>,
    first_len: usize,
    /// A second handle and the length, if it is a regular file.
    file: Option<(File, u64)>,
    /// It is read as it is, neither packed nor text.
    is_plain: bool,
    progress: Option<Progress>,
    is_quiet: bool,
    form: Form,
    /// The files behind this one, and all of them.
    rest: VecDeque<PathBuf>,
    all: Vec<PathBuf>,
    /// The folder that holds all of a collection; `None` for a single capture.
    root: Option<PathBuf>,
    /// Why captures of a collection were left out.
    left_out: Vec<Failure>,
}

impl Input {
    /// Opens these files, one at a time. `root` is the folder that holds all of them, and
    /// `left_out` tells why others were left out.
    pub(crate) fn collection(
        all: Vec<PathBuf>,
        root: PathBuf,
        left_out: Vec<Failure>,
        form: Form,
    ) -> Result<Self, Failure> {
        let mut rest = VecDeque::from(all.clone());
        let first = rest.pop_front();
        let mut input = Self::open_one(first.as_deref(), form)?;
        if !rest.is_empty() {
            (input.file, input.progress) = (None, None);
        }
        Ok(Self { rest, all, root: Some(root), left_out, ..input })
    }

    /// Whether there are several files, or a folder of them.
    pub(crate) const fn is_of_a_collection(&self) -> bool {
        self.root.is_some()
    }

    /// The folders between that of the collection and the file.
    pub(crate) fn folder(&self) -> PathBuf {
        let folder = self.path.as_deref().map(folder_of).unwrap_or_default();
        let below = self.root.as_deref().and_then(|root| folder.strip_prefix(root).ok());
        below.unwrap_or_else(|| Path::new("")).to_owned()
    }

    /// Why captures were left out.
    pub(crate) fn take_left_out(&mut self) -> Vec<Failure> {
        mem::take(&mut self.left_out)
    }

    /// Goes on with the next file; `false` if this was the last.
    pub(crate) fn advance(&mut self) -> Result<bool, Failure> {
        let Some(path) = self.rest.pop_front() else { return Ok(false) };
        let next = Self::open_one(Some(&path), self.form)?;
        let (rest, all) = (mem::take(&mut self.rest), mem::take(&mut self.all));
        let (root, is_quiet) = (self.root.take(), self.is_quiet);
        *self = Self { rest, all, root, is_quiet, file: None, progress: None, ..next };
        Ok(true)
    }

    /// Opens `path`, or standard input for `None` and `-`.
    pub(crate) fn open_one(path: Option<&Path>, form: Form) -> Result<Self, Failure> {
        let Some(path) = path.filter(|path| *path != "-") else {
            let reader = Box::new(io::stdin());
            return Self::new(None, reader, None, None).unpack(form);
        };
        let cannot_open = |error| Failure::Open { path: path.to_owned(), error };
        let file = File::open(path).map_err(cannot_open)?;
        let metadata = file.metadata().map_err(cannot_open)?;
        let mut whole = None;
        if metadata.is_file() {
            whole = Some((file.try_clone().map_err(cannot_open)?, metadata.len()));
        }
        let progress = whole.as_ref().and_then(|(_, len)| progress(*len));
        Self::new(Some(path.to_owned()), Box::new(file), whole, progress).unpack(form)
    }

    /// What a reader gives.
    pub(crate) fn of(reader: Box<dyn Read>) -> Result<Self, Failure> {
        Self::new(None, reader, None, None).unpack(Form::default())
    }

    /// Nothing is told on standard error.
    pub(crate) fn be_quiet(&mut self) {
        (self.is_quiet, self.progress) = (true, None);
    }

    /// Whether nothing is told on standard error.
    pub(crate) const fn is_quiet(&self) -> bool {
        self.is_quiet
    }

    fn new(
        path: Option<PathBuf>,
        reader: Box<dyn Read>,
        file: Option<(File, u64)>,
        progress: Option<Progress>,
    ) -> Self {
        let chunk = vec![0; CHUNK_LEN].into_boxed_slice();
        let (ahead, first) = (Vec::new(), Vec::new());
        let (first_len, is_plain) = (0, true);
        let (form, rest, all) = (Form::default(), VecDeque::new(), Vec::new());
        Self {
            path,
            reader,
            chunk,
            ahead,
            failure: None,
            first,
            first_len,
            file,
            is_plain,
            progress,
            is_quiet: false,
            form,
            rest,
            all,
            root: None,
            left_out: Vec::new(),
        }
    }

    /// Keeps the first `len` bytes.
    pub(crate) const fn keep_first(&mut self, len: usize) {
        self.first_len = len;
    }

    /// The first bytes that were kept.
    pub(crate) fn first(&self) -> &[u8] {
        &self.first
    }

    /// The file and its length, if the input is a regular file and not a stream, nor packed, nor
    /// text.
    pub(crate) fn file(&self) -> Option<(&File, u64)> {
        self.file.as_ref().filter(|_| self.is_plain).map(|(file, len)| (file, *len))
    }

    /// Its path; `None` is standard input.
    pub(crate) fn path(&self) -> Option<&Path> {
        self.path.as_deref()
    }

    /// Whether it is the file of this name, or in the folder of this name, so that replacing that
    /// would lose it. Standard input may be a file, too.
    pub(crate) fn is_at(&self, other: &Path) -> bool {
        let Ok(place) = other.canonicalize() else { return self.is_same(other) };
        let mut paths = self.path.iter().chain(&self.all).filter_map(|it| it.canonicalize().ok());
        paths.any(|path| path.starts_with(&place)) || self.is_same(other)
    }

    /// Whether it is the same file under any name.
    #[cfg(unix)]
    fn is_same(&self, other: &Path) -> bool {
        use std::os::{fd::AsFd, unix::fs::MetadataExt};

        let file = match (&self.file, &self.path) {
            (Some((file, _)), _) => file.try_clone(),
            (None, None) => io::stdin().as_fd().try_clone_to_owned().map(File::from),
            (None, Some(_)) => return false,
        };
        let known = file.and_then(|file| file.metadata());
        known
            .ok()
            .zip(other.metadata().ok())
            .is_some_and(|(known, other)| (known.dev(), known.ino()) == (other.dev(), other.ino()))
    }

    #[cfg(not(unix))]
    const fn is_same(&self, _: &Path) -> bool {
        false
    }

    /// Whether the input is a capture with times.
    pub(crate) fn has_times(&mut self) -> Result<bool, Failure> {
        let front = self.peek(4, |_| false)?;
        Ok(pcapng::is_capture(front))
    }

    /// Unpacks the input, if it is packed, and turns text into bytes.
    fn unpack(mut self, form: Form) -> Result<Self, Failure> {
        self.form = form;
        let front = self.peek(GZIP.len(), |front| !GZIP.starts_with(front))?;
        if front.starts_with(&GZIP) {
            self = self.behind(|packed| Box::new(MultiGzDecoder::new(packed)));
        }
        if form.hex {
            return Ok(self.behind(|text| Box::new(Hex::new(io::BufReader::new(text)))));
        }
        let front = self.peek(SAMPLE_LEN, |front| !hex::is_hex(front))?;
        if front.len() >= SAMPLE_LEN && hex::is_hex(front) {
            return Err(Failure::Usage("the capture is hex text: use --hex".to_owned()));
        }
        if let Some((_, kind)) = FOREIGN.iter().find(|(magic, _)| front.starts_with(magic)) {
            let named = self.path.as_ref().map_or("the capture".to_owned(), |it| format!("{it:?}"));
            let line = format!("{named} is {kind}: unpack or convert it first");
            return Err(Failure::Failed(line));
        }
        if is_telnet(front) {
            eprintln!(
                "axle: the capture begins as telnet does, which doubles each FF byte: frames with \
                 such a byte are lost; record from a raw TCP port"
            );
        }
        Ok(self)
    }

    /// Reads through another reader from now on.
    fn behind(mut self, with: impl FnOnce(Box<dyn Read>) -> Box<dyn Read>) -> Self {
        // Its reader will fail again.
        self.failure = None;
        let ahead = io::Cursor::new(mem::take(&mut self.ahead));
        self.reader = with(Box::new(ahead.chain(self.reader)));
        (self.is_plain, self.progress) = (false, None);
        self
    }

    /// Reads ahead: up to `len` bytes, fewer at the end of the input, or once they are enough
    /// for `is_enough`. The next `read` returns them again.
    pub(crate) fn peek(
        &mut self,
        len: usize,
        is_enough: impl Fn(&[u8]) -> bool,
    ) -> Result<&[u8], Failure> {
        let mut ahead = mem::take(&mut self.ahead);
        while ahead.len() < len && !is_enough(&ahead) {
            match self.read() {
                Ok([]) => break,
                Ok(bytes) => ahead.extend_from_slice(bytes),
                // What is in front of a fault is read; it is told behind that.
                Err(failure) => {
                    self.failure = Some(failure);
                    break;
                }
            }
        }
        self.ahead = ahead;
        match self.failure.take_if(|_| self.ahead.is_empty()) {
            Some(failure) => Err(failure),
            None => Ok(&self.ahead),
        }
    }

    /// The next bytes; empty at the end.
    pub(crate) fn read(&mut self) -> Result<&[u8], Failure> {
        if !self.ahead.is_empty() {
            self.chunk = mem::take(&mut self.ahead).into_boxed_slice();
            self.keep(self.chunk.len());
            return Ok(&self.chunk);
        }
        if let Some(failure) = self.failure.take() {
            return Err(failure);
        }
        if self.chunk.len() < CHUNK_LEN {
            self.chunk = vec![0; CHUNK_LEN].into_boxed_slice();
        }
        let read = loop {
            match self.reader.read(&mut self.chunk) {
                Err(error) if error.kind() == ErrorKind::Interrupted => {}
                Err(error) => return Err(Failure::Read { path: self.path.clone(), error }),
                Ok(read) => break read,
            }
        };
        if let Some(progress) = &self.progress {
            progress(read as u64);
        }
        self.keep(read);
        Ok(self.chunk.get(..read).unwrap_or_default())
    }

    /// Reads on at the end of `bytes`, until there are `len` of them or the input ends; returns
    /// whether it has ended.
    pub(crate) fn fill(&mut self, bytes: &mut Vec<u8>, len: usize) -> Result<bool, Failure> {
        if !self.ahead.is_empty() {
            let ahead = self.read()?;
            bytes.extend_from_slice(ahead);
        }
        let begin = bytes.len();
        let mut held = begin;
        bytes.resize(len.max(held), 0);
        let is_over = loop {
            let room = bytes.get_mut(held..).unwrap_or_default();
            if room.is_empty() {
                break Ok(false);
            }
            match self.reader.read(room) {
                Ok(0) => break Ok(true),
                Ok(read) => held += read,
                Err(error) if error.kind() == ErrorKind::Interrupted => {}
                Err(error) => break Err(Failure::Read { path: self.path.clone(), error }),
            }
        };
        bytes.truncate(held);
        let missing = self.first_len - self.first.len();
        self.first.extend(bytes.iter().skip(begin).take(missing));
        if let Some(progress) = &self.progress {
            progress((held - begin) as u64);
        }
        is_over
    }

    fn keep(&mut self, read: usize) {
        let missing = self.first_len - self.first.len();
        if missing > 0 {
            self.first.extend(self.chunk.iter().take(read.min(missing)));
        }
    }
}

/// For readers of a format: the same bytes.
impl Read for &mut Input {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let Input { ahead, reader, progress, .. } = &mut **self;
        if !ahead.is_empty() {
            let count = ahead.len().min(buffer.len());
            buffer.iter_mut().zip(ahead.drain(..count)).for_each(|(slot, byte)| *slot = byte);
            return Ok(count);
        }
        let count = reader.read(buffer)?;
        if let Some(progress) = progress {
            progress(count as u64);
        }
        Ok(count)
    }
}

/// The folder that a file is in, by the name that the system has for it.
pub(crate) fn folder_of(file: &Path) -> PathBuf {
    let folder = file.parent().filter(|it| !it.as_os_str().is_empty());
    let folder = folder.unwrap_or_else(|| Path::new("."));
    folder.canonicalize().unwrap_or_else(|_| folder.to_owned())
}

/// Whether bytes begin as telnet does: with two of the options that a server offers and asks for,
/// so that a part of a frame is not taken for it.
pub(crate) const fn is_telnet(front: &[u8]) -> bool {
    matches!(front, [0xFF, 0xFB..=0xFE, 0..=49, 0xFF, 0xFB..=0xFE, 0..=49, ..])
}

/// A bar on standard error, if that is a terminal and the listing does not go to the terminal too.
#[cfg(not(target_family = "wasm"))]
fn progress(len: u64) -> Option<Progress> {
    if len <= NO_PROGRESS_UP_TO || !io::stderr().is_terminal() || io::stdout().is_terminal() {
        return None;
    }
    // The bar takes what the texts leave of the width of the terminal, so that no line wraps.
    let style = ProgressStyle::with_template("{bytes} of {total_bytes} [{wide_bar}] {eta} left")
        .unwrap_or_else(|_| ProgressStyle::default_bar());
    let bar = ProgressBar::new(len).with_style(style).with_finish(ProgressFinish::AndClear);
    Some(Box::new(move |read| bar.inc(read)))
}

/// A page shows its own.
#[cfg(target_family = "wasm")]
fn progress(_: u64) -> Option<Progress> {
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Gives one byte at a time, each after an interruption as by a signal, and fails at the end.
    struct Rough {
        rest: &'static [u8],
        is_interrupted: bool,
    }

    impl Read for Rough {
        fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
            self.is_interrupted = !self.is_interrupted;
            if self.is_interrupted {
                return Err(ErrorKind::Interrupted.into());
            }
            let (&byte, rest) = self.rest.split_first().ok_or(ErrorKind::BrokenPipe)?;
            (buffer[0], self.rest) = (byte, rest);
            Ok(1)
        }
    }

    fn rough(rest: &'static [u8], progress: Option<Progress>) -> Input {
        let reader = Rough { rest, is_interrupted: false };
        Input::new(None, Box::new(reader), None, progress)
    }

    #[test]
    fn an_interrupted_read_is_tried_again_and_a_failed_one_is_told() {
        let mut input = rough(&[1, 2], None);
        assert_eq!(input.read().unwrap(), [1]);
        assert_eq!(input.read().unwrap(), [2]);
        assert!(matches!(input.read(), Err(Failure::Read { .. })));

        let (mut input, mut bytes) = (rough(&[1, 2, 3], None), Vec::new());
        assert!(!input.fill(&mut bytes, 2).unwrap());
        assert_eq!(bytes, [1, 2]);
        assert!(matches!(input.fill(&mut bytes, 4), Err(Failure::Read { .. })));
        assert_eq!(bytes, [1, 2, 3], "what came before the failure");
    }

    #[test]
    fn the_progress_is_the_number_of_bytes_read() {
        let bar = ProgressBar::hidden();
        let of_it = bar.clone();
        let (mut input, mut bytes) =
            (rough(&[1, 2, 3, 4, 5], Some(Box::new(move |read| of_it.inc(read)))), Vec::new());
        for (len, expected) in [(2, 2), (4, 4), (3, 4)] {
            input.fill(&mut bytes, len).unwrap();
            assert_eq!(bar.position(), expected);
        }
        input.read().unwrap();
        assert_eq!(bar.position(), 5);
    }

    #[test]
    fn the_chunk_after_what_was_read_ahead_is_a_long_one() {
        let reader = io::Cursor::new(vec![7; 2 * CHUNK_LEN + 3]);
        let mut input =
            Input::new(None, Box::new(io::Cursor::new(vec![1; 3]).chain(reader)), None, None);
        assert_eq!(input.peek(3, |_| false).unwrap(), [1; 3]);
        let lens = [(); 4].map(|()| input.read().unwrap().len());
        assert_eq!(lens, [3, CHUNK_LEN, CHUNK_LEN, 3]);
    }
}
