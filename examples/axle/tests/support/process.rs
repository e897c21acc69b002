//! The tool as a running process, with its lines as they come, and signals by process id.

use std::{
    io::{BufRead, BufReader, Read},
    process::{Child, Command, Stdio},
    sync::{Arc, Condvar, Mutex},
    thread::{self, JoinHandle},
    time::{Duration, Instant},
};

use super::axle;

/// Far longer than any step here takes, even on a busy machine.
const PATIENCE: Duration = Duration::from_secs(60);

/// A running tool; killed when it is dropped.
pub(crate) struct Process {
    child: Child,
    stdout: Lines,
    stderr: Lines,
}

/// How a tool has exited.
#[derive(Debug)]
pub(crate) struct Ended {
    pub(crate) code: Option<i32>,
    pub(crate) stdout: Vec<String>,
    pub(crate) stderr: Vec<String>,
}

impl Process {
    /// Starts the tool with these arguments, separated by spaces.
    pub(crate) fn start(args: &str) -> Self {
        let args: Vec<_> = args.split_whitespace().collect();
        Self::spawn(&mut axle(&args)).unwrap()
    }

    pub(crate) fn spawn(command: &mut Command) -> std::io::Result<Self> {
        let mut child =
            command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn()?;
        let stdout = Lines::of(child.stdout.take().unwrap());
        let stderr = Lines::of(child.stderr.take().unwrap());
        Ok(Self { child, stdout, stderr })
    }

    /// The first line that contains `what`, as soon as there is one.
    pub(crate) fn line(&self, what: &str) -> String {
        self.lines_up_to(what).pop().unwrap()
    }

    /// All lines up to the first that contains `what`, as soon as there is one.
    pub(crate) fn lines_up_to(&self, what: &str) -> Vec<String> {
        self.stdout.up_to(what)
    }

    /// All lines so far.
    pub(crate) fn lines(&self) -> Vec<String> {
        self.stdout.all()
    }

    /// Sends a signal by name, such as INT, to this process only.
    pub(crate) fn signal(&self, name: &str) {
        let command = format!("kill -{name} {}", self.child.id());
        assert!(Command::new("sh").args(["-c", &command]).status().unwrap().success());
    }

    /// The process state as reported by the system, such as `T` for suspended.
    pub(crate) fn state(&self) -> char {
        let stat = std::fs::read_to_string(format!("/proc/{}/stat", self.child.id())).unwrap();
        stat.rsplit(") ").next().unwrap().chars().next().unwrap()
    }

    /// The signals that it catches, a bit each; the first is bit 0.
    pub(crate) fn caught_signals(&self) -> u64 {
        let path = format!("/proc/{}/status", self.child.id());
        let status = std::fs::read_to_string(path).unwrap();
        let mask = status.lines().find_map(|line| line.strip_prefix("SigCgt:")).unwrap();
        u64::from_str_radix(mask.trim(), 16).unwrap()
    }

    pub(crate) fn id(&self) -> u32 {
        self.child.id()
    }

    /// The error lines so far.
    pub(crate) fn complaints(&self) -> Vec<String> {
        self.stderr.all()
    }

    /// Kills it, as a power cut would.
    pub(crate) fn kill(mut self) {
        self.child.kill().unwrap();
        self.child.wait().unwrap();
    }

    /// Waits until it exits by itself.
    pub(crate) fn end(mut self) -> Ended {
        let start = Instant::now();
        let status = loop {
            match self.child.try_wait().unwrap() {
                Some(status) => break status,
                None if start.elapsed() > PATIENCE => {
                    panic!("does not exit; lines: {:?}", self.lines());
                }
                None => thread::sleep(Duration::from_millis(5)),
            }
        };
        let (stdout, stderr) = (self.stdout.finish(), self.stderr.finish());
        Ended { code: status.code(), stdout, stderr }
    }

    /// Waits until it exits successfully without error lines; returns its lines.
    pub(crate) fn success(self) -> Vec<String> {
        let ended = self.end();
        assert_eq!((ended.code, &*ended.stderr), (Some(0), &[][..]), "{ended:?}");
        ended.stdout
    }

    /// Waits until it exits with `code`; returns its single error line.
    pub(crate) fn complaint(self, code: i32) -> String {
        let ended = self.end();
        assert_eq!((ended.code, ended.stderr.len()), (Some(code), 1), "{ended:?}");
        ended.stderr[0].strip_prefix("axle: ").expect("the tool's name first").to_owned()
    }
}

impl Drop for Process {
    fn drop(&mut self) {
        // It may have exited long ago.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// Lines of a stream, read by a separate thread.
struct Lines {
    shared: Arc<(Mutex<Vec<String>>, Condvar)>,
    reader: Option<JoinHandle<()>>,
}

impl Lines {
    fn of(stream: impl Read + Send + 'static) -> Self {
        let shared = Arc::new((Mutex::new(Vec::new()), Condvar::new()));
        let filled = Arc::clone(&shared);
        let reader = thread::spawn(move || {
            for line in BufReader::new(stream).lines().map_while(Result::ok) {
                filled.0.lock().unwrap().push(line);
                filled.1.notify_all();
            }
        });
        Self { shared, reader: Some(reader) }
    }

    fn all(&self) -> Vec<String> {
        self.shared.0.lock().unwrap().clone()
    }

    fn up_to(&self, what: &str) -> Vec<String> {
        let (lines, filled) = &*self.shared;
        let is_missing = |lines: &mut Vec<String>| !lines.iter().any(|line| line.contains(what));
        let (lines, wait) =
            filled.wait_timeout_while(lines.lock().unwrap(), PATIENCE, is_missing).unwrap();
        assert!(!wait.timed_out(), "no line with {what:?} in {lines:?}");
        let count = lines.iter().position(|line| line.contains(what)).unwrap() + 1;
        lines[..count].to_vec()
    }

    /// All lines, once the stream has ended.
    fn finish(&mut self) -> Vec<String> {
        self.reader.take().unwrap().join().unwrap();
        self.all()
    }
}
