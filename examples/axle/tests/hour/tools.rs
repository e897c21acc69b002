//! Two subcommands of the tool that run as long as they can, and record.

use std::{
    fs::{self, File},
    path::PathBuf,
    process::{Child, Stdio},
    sync::{
        Arc,
        atomic::{AtomicU32, Ordering},
    },
    thread::{self, JoinHandle},
    time::{Duration, Instant},
};

use crate::{
    machine::Control,
    processes::Processes,
    sim,
    support::{axle, process::Process},
};

pub(crate) struct Tools {
    _sims: [Process; 2],
    spins: JoinHandle<Vec<String>>,
    spin_id: Arc<AtomicU32>,
    watch: Tool,
}

struct Tool {
    child: Child,
    /// Its output and its recording.
    files: [PathBuf; 2],
}

impl Tool {
    fn start(name: &str, args: &str) -> Self {
        let files = ["txt", "pcapng"].map(|kind| {
            let name = format!("hour-{name}-{}.{kind}", std::process::id());
            PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(name)
        });
        let args = format!("{args} --record {}", files[1].display());
        let args: Vec<_> = args.split(' ').collect();
        let output =
            || Stdio::from(File::options().append(true).create(true).open(&files[0]).unwrap());
        let mut command = axle(&args);
        let child = command.stdin(Stdio::null()).stdout(output()).stderr(output()).spawn().unwrap();
        Self { child, files }
    }

    /// Its exit code and its output, once it has exited.
    fn end_within(mut self, patience: Duration) -> (Option<i32>, String) {
        let start = Instant::now();
        let code = loop {
            match self.child.try_wait().unwrap() {
                Some(status) => break status.code(),
                None if start.elapsed() > patience => {
                    let _ = self.child.kill();
                    break None;
                }
                None => thread::sleep(Duration::from_millis(20)),
            }
        };
        let output = fs::read_to_string(&self.files[0]).unwrap();
        for file in &self.files {
            let _ = fs::remove_file(file);
        }
        (code, output)
    }
}

/// A stall of the machine that may cost three answers in a row: the tool then stops the motor, as
/// it should, and is started again.
const COSTLY: Duration = Duration::from_millis(50);

/// Turns a motor for this long; returns what the tool said when it gave up.
fn spin(path: &str, length: Duration, id: &AtomicU32) -> Vec<String> {
    let begin = Instant::now();
    let mut complaints = Vec::new();
    loop {
        let left = length.saturating_sub(begin.elapsed()).as_secs_f64();
        if left < 1.0 {
            return complaints;
        }
        let tool = Tool::start("spin", &format!("spin -p {path} -n 1 --rps 2 -f {left} --json"));
        id.store(tool.child.id(), Ordering::SeqCst);
        let (code, said) = tool.end_within(length + Duration::from_secs(60));
        let last = said.lines().last().unwrap_or_default();
        if code != Some(0) || !last.contains("\"at_rest\":true") {
            complaints.push(format!("{code:?} {last}"));
        }
    }
}

impl Tools {
    pub(crate) fn start(length: Duration) -> Self {
        let (bus, bus_path) = sim("ikeya -n 1:velocity --watchdog 2");
        let (rover, rover_path) = sim("ucp");
        let spin_id = Arc::new(AtomicU32::new(0));
        let id = Arc::clone(&spin_id);
        let spins = thread::spawn(move || spin(&bus_path, length, &id));
        let seconds = length.as_secs_f64();
        let watch =
            Tool::start("watch", &format!("watch -p {rover_path} -P ucp --plain -f {seconds}"));
        Self { _sims: [bus, rover], spins, spin_id, watch }
    }

    pub(crate) fn watch(&self, processes: &mut Processes) {
        processes.add_current("axle spin", Arc::clone(&self.spin_id));
        processes.add("axle watch", self.watch.child.id());
    }

    pub(crate) fn report(self, length: Duration, control: &Control, complaints: &mut Vec<String>) {
        let said = self.spins.join().unwrap();
        println!("spin: gave up {} times; the last: {:?}", said.len(), said.last());
        let is_excused = control.worst() >= COSTLY;
        if !said.is_empty() && (!is_excused || said.iter().any(|line| !line.starts_with("Some(1)")))
        {
            complaints.push(format!("spin failed: {said:?}"));
        }
        let (code, said) = self.watch.end_within(Duration::from_secs(60));
        // 5  report  N ...
        let row = said.lines().find_map(|line| line.strip_prefix("   5  report"));
        let count = row.and_then(|row| row.split_whitespace().next()?.parse::<u64>().ok());
        let (reports, beats) = (count.unwrap_or_default(), length.as_millis() as u64 / 20);
        let skipped = said.lines().any(|line| line.trim() == "0 skipped");
        println!("watch: exit code {code:?}, {reports} reports, no byte skipped: {skipped}");
        if code != Some(0) || !skipped || reports > beats + 2 || reports < beats * 9 / 10 {
            complaints.push(format!("watch showed {reports} reports in {beats} beats"));
        }
    }
}
