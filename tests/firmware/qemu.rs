//! The firmware images, and a board in QEMU that runs one of them.

use std::{
    collections::HashMap,
    env, fs,
    io::{BufRead, BufReader, Write},
    os::unix::net::UnixStream,
    path::{Path, PathBuf},
    process::{Child, Command, Stdio},
    sync::{
        Arc, Mutex, OnceLock,
        atomic::{AtomicU32, Ordering},
    },
    thread,
    time::{Duration, Instant},
};

/// Time limit for any single wait.
pub(crate) const PATIENCE: Duration = Duration::from_secs(30);

/// The program that checks its own USART.
const UART_CHECK: &str = "uart_check";

/// The firmware programs.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Program {
    Slave,
    Master,
    Robot,
}

impl Program {
    const fn name(self) -> &'static str {
        match self {
            Self::Slave => "ikeya_slave",
            Self::Master => "ikeya_master",
            Self::Robot => "ucp_robot",
        }
    }

    /// Stack limit, bytes: the measured use plus about a fifth.
    const fn stack_limit(self) -> i64 {
        match self {
            Self::Slave => 2048,
            Self::Master => 5760,
            Self::Robot => 2944,
        }
    }
}

/// The folder with the images, or the reason for having none. They are built once per run.
///
/// `AXLEWIRE_FIRMWARE_IMAGES` names a folder with images already built.
fn images() -> &'static Result<PathBuf, String> {
    static IMAGES: OnceLock<Result<PathBuf, String>> = OnceLock::new();
    IMAGES.get_or_init(|| {
        let found = find_images();
        if let Err(reason) = &found {
            assert!(!is_required(), "the firmware cannot be tested: {reason}");
            // Not with eprintln!, whose output is hidden when a test passes.
            let _ = writeln!(std::io::stderr(), "SKIPPED, the firmware is not tested: {reason}");
        }
        found
    })
}

fn is_required() -> bool {
    env::var("AXLEWIRE_FIRMWARE").is_ok_and(|value| value == "required")
}

/// The script that builds the images; not part of the published package.
fn script() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("examples/firmware/run.sh")
}

fn find_images() -> Result<PathBuf, String> {
    if let Some(folder) = env::var_os("AXLEWIRE_FIRMWARE_IMAGES") {
        return Ok(folder.into());
    }
    let script = script();
    if !script.is_file() {
        return Err("its sources are missing".to_owned());
    }
    let build = build(&script).stdin(Stdio::null()).output();
    let build = build.map_err(|error| format!("bash: {error}"))?;
    let said = String::from_utf8_lossy(&build.stderr).trim().to_owned();
    if let Some(missing) = missing(build.status.code(), said) {
        return Err(missing);
    }
    let paths = String::from_utf8_lossy(&build.stdout).into_owned();
    let first = paths.lines().next().map(Path::new).and_then(Path::parent);
    Ok(first.expect("the build names its images").to_owned())
}

/// The command that builds the images.
fn build(script: &Path) -> Command {
    let programs = [Program::Slave, Program::Master, Program::Robot];
    let mut build = Command::new("bash");
    build.arg(script).arg("--build").args(programs.map(Program::name)).arg(UART_CHECK);
    if !is_required() {
        build.env("INSTALL", "no");
    }
    build
}

/// Which tools are missing, if that is why a build ended with this status: the only reason to skip
/// a test.
///
/// # Panics
///
/// If the build failed for any other reason.
fn missing(status: Option<i32>, said: String) -> Option<String> {
    match status {
        Some(0) => None,
        Some(77) => Some(said),
        _ => panic!("the images cannot be built: {said}"),
    }
}

#[test]
fn only_missing_tools_are_a_reason_to_skip_a_test_of_the_firmware() {
    assert_eq!(missing(Some(0), "warning".to_owned()), None);
    assert_eq!(missing(Some(77), "no qemu".to_owned()), Some("no qemu".to_owned()));
    for status in [Some(1), Some(101), None] {
        assert!(std::panic::catch_unwind(|| missing(status, "error".to_owned())).is_err());
    }
}

#[test]
fn the_images_are_built_when_the_tests_themselves_are_built_by_a_wrapper_with_flags() {
    let script = script();
    // Without a compiler there is nothing to wrap.
    if !script.is_file() || images().is_err() {
        return;
    }
    let mut build = build(&script);
    // As cargo-llvm-cov sets them; each of these alone would end the build.
    for name in ["RUSTC_WRAPPER", "RUSTC_WORKSPACE_WRAPPER", "CARGO_BUILD_RUSTC_WRAPPER", "RUSTC"] {
        build.env(name, "/no/such/compiler");
    }
    for name in ["RUSTFLAGS", "CARGO_ENCODED_RUSTFLAGS", "CARGO_BUILD_RUSTFLAGS"] {
        build.env(name, "--no-such-flag");
    }
    build.env("LLVM_PROFILE_FILE", "/no/such/folder").env("CARGO_PROFILE_RELEASE_PANIC", "none");
    let build = build.stdin(Stdio::null()).output().expect("bash starts");
    assert!(build.status.success(), "{}", String::from_utf8_lossy(&build.stderr));
}

/// Runs the program that checks its own USART; returns its status and output.
pub(crate) fn check_uart() -> Option<(bool, String)> {
    let image = images().as_ref().ok()?.join(UART_CHECK);
    let mut run = Command::new("qemu-system-arm")
        .args(["-M", "netduinoplus2", "-display", "none", "-monitor", "none", "-icount", "shift=0"])
        .args(["-semihosting-config", "enable=on,target=native", "-kernel"])
        .arg(image)
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .expect("qemu-system-arm starts");
    // A `flush` may wait for ever.
    let end = Instant::now() + PATIENCE;
    while run.try_wait().unwrap().is_none() {
        if Instant::now() >= end {
            run.kill().unwrap();
        }
        thread::sleep(Duration::from_millis(5));
    }
    let run = run.wait_with_output().unwrap();
    let said = [run.stdout, run.stderr].concat();
    Some((run.status.success(), String::from_utf8_lossy(&said).into_owned()))
}

/// A board that runs a program. Dropping it ends the board and closes its sockets.
pub(crate) struct Board {
    program: Program,
    qemu: Child,
    folder: PathBuf,
    text: UnixStream,
    lines: Arc<Mutex<Vec<String>>>,
    /// The socket of the line, until a wire takes it.
    bus: Option<UnixStream>,
}

impl Board {
    /// Starts a board; `None` if it cannot be tested.
    ///
    /// It starts running once both of its sockets are connected, so that nothing is missed.
    pub(crate) fn start(program: Program) -> Option<Self> {
        Self::start_with(program, &[])
    }

    /// The same with a log of every access to a register, for [`accesses`](Self::accesses).
    pub(crate) fn start_logged(program: Program) -> Option<Self> {
        let kinds = ["-trace", "memory_region_ops_write", "-trace", "memory_region_ops_read"];
        Self::start_with(program, &kinds)
    }

    /// Ends the board, and returns the log of every register access.
    pub(crate) fn accesses(mut self) -> String {
        // A request to end, so that it writes its log.
        self.signal("-TERM");
        self.qemu.wait().unwrap();
        fs::read_to_string(self.folder.join("accesses")).unwrap()
    }

    /// Halts the board, like an operating system with other work. Its time continues.
    pub(crate) fn halt(&self, span: Duration) {
        self.signal("-STOP");
        thread::sleep(span);
        self.signal("-CONT");
    }

    fn signal(&self, signal: &str) {
        let id = self.qemu.id().to_string();
        let sent = Command::new("kill").args([signal, &id]).status().expect("kill starts");
        assert!(sent.success());
    }

    fn start_with(program: Program, options: &[&str]) -> Option<Self> {
        static COUNT: AtomicU32 = AtomicU32::new(0);
        let image = images().as_ref().ok()?.join(program.name());
        let number = COUNT.fetch_add(1, Ordering::Relaxed);
        let folder = env::temp_dir().join(format!("axlewire-{}-{number}", std::process::id()));
        fs::create_dir_all(&folder).unwrap();
        let serial =
            |name: &str| format!("unix:{},server=on,wait=on", folder.join(name).to_str().unwrap());
        let mut qemu = Command::new("qemu-system-arm")
            .args(["-M", "netduinoplus2", "-display", "none", "-monitor", "none"])
            .args(["-serial", &serial("bus"), "-serial", &serial("text")])
            .args(options)
            .arg("-D")
            .arg(folder.join("accesses"))
            .arg("-kernel")
            .arg(image)
            .stdin(Stdio::null())
            .stdout(Stdio::null())
            .stderr(fs::File::create(folder.join("errors")).unwrap())
            .spawn()
            .expect("qemu-system-arm starts");
        let bus = connect(&folder.join("bus"), &mut qemu);
        let text = connect(&folder.join("text"), &mut qemu);
        let lines = Arc::new(Mutex::new(Vec::new()));
        let (reader, sink) = (BufReader::new(text.try_clone().unwrap()), lines.clone());
        thread::spawn(move || {
            for line in reader.lines().map_while(Result::ok) {
                sink.lock().unwrap().push(line.trim_end().to_owned());
            }
        });
        let mut board = Self { program, qemu, folder, text, lines, bus: Some(bus) };
        board.await_first_line();
        Some(board)
    }

    /// A USART that has not been started drops incoming bytes.
    fn await_first_line(&mut self) {
        let end = Instant::now() + PATIENCE;
        while self.lines.lock().unwrap().is_empty() {
            assert_runs(&mut self.qemu, &self.folder);
            assert!(Instant::now() < end, "the firmware prints nothing");
            thread::sleep(Duration::from_millis(5));
        }
    }

    /// The line of the board; a new connection if the previous one has closed.
    pub(crate) fn bus(&mut self) -> UnixStream {
        self.bus.take().unwrap_or_else(|| connect(&self.folder.join("bus"), &mut self.qemu))
    }

    /// Requests a report without waiting for it: a running role continues.
    pub(crate) fn ask(&mut self) {
        self.text.write_all(b"?").unwrap();
    }

    /// Asks so often, with a pause behind each request.
    pub(crate) fn ask_for_a_while(&mut self, times: u32, pause: Duration) {
        for _ in 0..times {
            self.ask();
            thread::sleep(pause);
        }
    }

    /// Sends more to the text port than its queue holds. Byte by byte: QEMU forgets the interrupt
    /// of a byte that is already waiting when its predecessor is fetched, until a line is sent.
    pub(crate) fn flood_text(&mut self) {
        for _ in 0..1500 {
            self.ask();
            thread::sleep(Duration::from_micros(300));
        }
    }

    /// All reports so far.
    pub(crate) fn reports(&self) -> Vec<Report> {
        self.lines().iter().filter_map(|line| Report::parse(line)).collect()
    }

    /// Everything that the firmware has written.
    pub(crate) fn lines(&self) -> Vec<String> {
        self.lines.lock().unwrap().clone()
    }

    /// Requests reports until one matches.
    pub(crate) fn report_when(&mut self, what: &str, done: impl Fn(&Report) -> bool) -> Report {
        let end = Instant::now() + PATIENCE;
        let mut seen = self.lines().len();
        loop {
            self.ask();
            thread::sleep(Duration::from_millis(10));
            let lines = self.lines();
            for report in lines[seen..].iter().filter_map(|line| Report::parse(line)) {
                if done(&report) {
                    self.assert_stack(&report);
                    return report;
                }
            }
            seen = lines.len();
            assert!(
                Instant::now() < end,
                "timed out waiting for: {what}; the last lines: {:#?}",
                tail(&lines)
            );
        }
    }

    /// The stack stays within its limit. Also printed: `check.sh` shows it.
    fn assert_stack(&self, report: &Report) {
        let (used, limit) = (report.at("stack"), self.program.stack_limit());
        println!("stack {} {used}", self.program.name());
        assert!((1..=limit).contains(&used), "{:?} uses {used} bytes of stack", self.program);
    }

    /// Whether the firmware has written these lines in this order, ignoring lines in between.
    pub(crate) fn has_written(&self, wanted: &[&str]) -> bool {
        let lines = self.lines();
        let mut lines = lines.iter();
        wanted.iter().all(|wanted| lines.any(|line| line == wanted))
    }
}

impl Drop for Board {
    fn drop(&mut self) {
        let _ = self.qemu.kill();
        let _ = self.qemu.wait();
        let _ = fs::remove_dir_all(&self.folder);
    }
}

fn tail(lines: &[String]) -> &[String] {
    &lines[lines.len().saturating_sub(5)..]
}

fn assert_runs(qemu: &mut Child, folder: &Path) {
    if let Some(status) = qemu.try_wait().unwrap() {
        let errors = fs::read_to_string(folder.join("errors"));
        panic!("QEMU has ended, {status}: {errors:?}");
    }
}

/// Connects to a socket that QEMU is about to make.
fn connect(path: &Path, qemu: &mut Child) -> UnixStream {
    let end = Instant::now() + PATIENCE;
    loop {
        match UnixStream::connect(path) {
            Ok(stream) => return stream,
            Err(error) => assert!(Instant::now() < end, "{path:?}: {error}"),
        }
        assert_runs(qemu, path.parent().unwrap());
        thread::sleep(Duration::from_millis(5));
    }
}

/// A line of names and numbers.
#[derive(Debug)]
pub(crate) struct Report(HashMap<String, i64>);

impl Report {
    /// `None` for a line that reports an event.
    fn parse(line: &str) -> Option<Self> {
        let mut words = line.split(' ').peekable();
        if !["slave", "master", "robot"].contains(&words.next()?) {
            return None;
        }
        let mut values = HashMap::new();
        while let Some(name) = words.next() {
            if let Some(value) = words.next_if(|word| word.parse::<i64>().is_ok()) {
                values.insert(name.to_owned(), value.parse().unwrap());
            }
        }
        Some(Self(values))
    }

    /// The number after a name, if present.
    pub(crate) fn get(&self, name: &str) -> Option<i64> {
        self.0.get(name).copied()
    }

    /// The number after a name that is always present.
    pub(crate) fn at(&self, name: &str) -> i64 {
        self.get(name).unwrap_or_else(|| panic!("no {name} in {self:?}"))
    }

    /// No byte was lost on its way into the decoder.
    pub(crate) fn assert_nothing_lost(&self) {
        assert_eq!(["overruns", "lost", "damaged"].map(|name| self.at(name)), [0; 3], "{self:?}");
    }
}
