//! The tool on a terminal: a pseudo-terminal that the test holds, and what it would show.

use std::{
    fs::{File, OpenOptions},
    io::{Read, Write},
    os::unix::fs::OpenOptionsExt,
    process::{Child, Command, Stdio},
    sync::{
        Arc, Mutex, MutexGuard,
        atomic::{AtomicBool, Ordering},
    },
    thread,
    time::{Duration, Instant},
};

use rustix::{
    fs::{OFlags, fcntl_setfl},
    io::{FdFlags, fcntl_setfd},
    pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt},
    termios::{Termios, Winsize, tcgetattr, tcsetwinsize},
};

use super::axle;

/// Far longer than any step here takes, even on a busy machine.
const PATIENCE: Duration = Duration::from_secs(60);

/// A running tool on a terminal; killed when it is dropped.
pub(crate) struct Terminal {
    child: Child,
    /// The end of the person in front of it.
    ours: File,
    /// The end of the tool, kept open to look at its settings.
    theirs: File,
    /// The settings before the tool began.
    before: Termios,
    shown: Arc<Mutex<Shown>>,
    is_stalled: Arc<AtomicBool>,
    is_gone: Arc<AtomicBool>,
}

/// What has come.
pub(crate) struct Shown {
    bytes: Vec<u8>,
    parser: vt100::Parser,
}

/// How a tool has left its terminal.
#[derive(Debug)]
pub(crate) struct Left {
    pub(crate) code: Option<i32>,
    /// What is on the terminal behind the page.
    pub(crate) text: String,
}

impl Terminal {
    /// Starts the tool with these arguments, separated by spaces, on a terminal of this size.
    pub(crate) fn start(args: &str, size: (u16, u16)) -> Self {
        let args: Vec<_> = args.split_whitespace().collect();
        Self::spawn(&mut axle(&args), size)
    }

    pub(crate) fn spawn(command: &mut Command, (columns, rows): (u16, u16)) -> Self {
        let ours = openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY).unwrap();
        // If the tool held it too, the terminal could not go away.
        fcntl_setfd(&ours, FdFlags::CLOEXEC).unwrap();
        grantpt(&ours).unwrap();
        unlockpt(&ours).unwrap();
        let path = ptsname(&ours, Vec::new()).unwrap().into_string().unwrap();
        let no_control = OFlags::NOCTTY.bits() as i32;
        let theirs =
            OpenOptions::new().read(true).write(true).custom_flags(no_control).open(path).unwrap();
        let before = tcgetattr(&theirs).unwrap();
        let ours = File::from(ours);
        let end = || Stdio::from(theirs.try_clone().unwrap());
        set_size(&ours, (columns, rows));
        if !command.get_envs().any(|(name, _)| name == "LC_ALL") {
            command.env("LC_ALL", "C.UTF-8");
        }
        let child = command
            .stdin(end())
            .stdout(end())
            .stderr(end())
            .env("TERM", "xterm-256color")
            .spawn()
            .unwrap();
        let parser = vt100::Parser::new(rows, columns, 0);
        let shown = Arc::new(Mutex::new(Shown { bytes: Vec::new(), parser }));
        let is_stalled = Arc::new(AtomicBool::new(false));
        let (filled, stalls) = (Arc::clone(&shown), Arc::clone(&is_stalled));
        let is_gone = Arc::new(AtomicBool::new(false));
        let ends = Arc::clone(&is_gone);
        let mut from = ours.try_clone().unwrap();
        // It does not block, so that it can close its end.
        fcntl_setfl(&from, OFlags::RDWR | OFlags::NONBLOCK).unwrap();
        thread::spawn(move || {
            let mut buffer = [0; 4096];
            while !ends.load(Ordering::SeqCst) {
                thread::sleep(Duration::from_millis(2));
                while !stalls.load(Ordering::SeqCst)
                    && let Ok(count @ 1..) = from.read(&mut buffer)
                {
                    let mut shown = filled.lock().unwrap();
                    let bytes = &buffer[..count];
                    shown.bytes.extend(bytes);
                    shown.parser.process(bytes);
                }
            }
        });
        Self { child, ours, theirs, before, shown, is_stalled, is_gone }
    }

    fn shown(&self) -> MutexGuard<'_, Shown> {
        self.shown.lock().unwrap()
    }

    /// The text on the screen.
    pub(crate) fn text(&self) -> String {
        self.shown().parser.screen().contents()
    }

    /// Whether the page is on the screen.
    pub(crate) fn has_page(&self) -> bool {
        self.shown().parser.screen().alternate_screen()
    }

    /// Whether there was a page at any time.
    pub(crate) fn has_had_page(&self) -> bool {
        self.has_had("\x1b[?1049h")
    }

    /// Whether these bytes came at any time.
    pub(crate) fn has_had(&self, text: &str) -> bool {
        self.shown().bytes.windows(text.len()).any(|part| part == text.as_bytes())
    }

    /// The first row with this text, as soon as there is one.
    pub(crate) fn row(&self, what: &str) -> String {
        let found = || self.text().lines().find(|row| row.contains(what)).map(ToOwned::to_owned);
        self.wait(what, || found().is_some());
        found().unwrap_or_default()
    }

    /// Waits until a condition holds.
    pub(crate) fn wait(&self, what: &str, is_so: impl Fn() -> bool) {
        let start = Instant::now();
        while !is_so() {
            assert!(start.elapsed() < PATIENCE, "{what} did not happen:\n{}", self.text());
            thread::sleep(Duration::from_millis(5));
        }
    }

    /// Presses keys.
    pub(crate) fn press(&mut self, keys: &str) {
        self.ours.write_all(keys.as_bytes()).unwrap();
    }

    pub(crate) fn resize(&self, (columns, rows): (u16, u16)) {
        set_size(&self.ours, (columns, rows));
        if columns > 0 && rows > 0 {
            self.shown().parser.screen_mut().set_size(rows, columns);
        }
    }

    /// Takes nothing from the tool any more, or again.
    pub(crate) fn stall(&self, is_stalled: bool) {
        self.is_stalled.store(is_stalled, Ordering::SeqCst);
    }

    /// Sends a signal by name, such as INT, to this process only.
    pub(crate) fn signal(&self, name: &str) {
        let command = format!("kill -{name} {}", self.child.id());
        assert!(Command::new("sh").args(["-c", &command]).status().unwrap().success());
    }

    pub(crate) fn id(&self) -> u32 {
        self.child.id()
    }

    /// The process state as reported by the system, such as `T` for suspended.
    pub(crate) fn state(&self) -> char {
        let stat = std::fs::read_to_string(format!("/proc/{}/stat", self.child.id())).unwrap();
        stat.rsplit(") ").next().unwrap().chars().next().unwrap()
    }

    /// Closes the terminal, as when its window is closed or its cable is pulled out.
    pub(crate) fn hang_up(&mut self) {
        let nothing = || File::open("/dev/null").unwrap();
        self.is_gone.store(true, Ordering::SeqCst);
        (self.ours, self.theirs) = (nothing(), nothing());
    }

    /// The exit code, once the tool has exited.
    pub(crate) fn code(&mut self) -> Option<i32> {
        let start = Instant::now();
        loop {
            match self.child.try_wait().unwrap() {
                Some(status) => return status.code(),
                None if start.elapsed() > PATIENCE => panic!("does not exit:\n{}", self.text()),
                None => thread::sleep(Duration::from_millis(5)),
            }
        }
    }

    /// Asserts that the terminal is as it was before the tool: settings, screen and cursor.
    pub(crate) fn assert_clean(&self) {
        let shown = self.shown();
        let screen = shown.parser.screen();
        assert!(!screen.alternate_screen(), "the page was not left:\n{}", screen.contents());
        assert!(!screen.hide_cursor(), "the cursor is hidden");
        let count = |sequence: &[u8]| {
            shown.bytes.windows(sequence.len()).filter(|part| part == &sequence).count()
        };
        assert_eq!(count(b"\x1b[?1049h"), count(b"\x1b[?1049l"));
        let after = tcgetattr(&self.theirs).unwrap();
        assert_eq!(format!("{after:?}"), format!("{:?}", self.before));
    }

    /// Waits until the tool exits by itself and has left the terminal clean.
    pub(crate) fn end(mut self) -> Left {
        let code = self.code();
        // The last bytes may still be on their way.
        self.wait("the way back", || !self.has_page());
        thread::sleep(Duration::from_millis(50));
        self.assert_clean();
        Left { code, text: self.text() }
    }
}

impl Drop for Terminal {
    fn drop(&mut self) {
        // It may have exited long ago.
        let _ = self.child.kill();
        let _ = self.child.wait();
        self.is_gone.store(true, Ordering::SeqCst);
    }
}

fn set_size(terminal: &File, (columns, rows): (u16, u16)) {
    let size = Winsize { ws_col: columns, ws_row: rows, ws_xpixel: 0, ws_ypixel: 0 };
    tcsetwinsize(terminal, size).unwrap();
}
