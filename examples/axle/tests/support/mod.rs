//! Runs the real binary, and builds captures with known events.
#![allow(dead_code, reason = "each test file uses a part of it")]

#[path = "../../src/clock.rs"]
mod clock;
pub(crate) mod devices;
pub(crate) mod pcapng;
pub(crate) mod process;
pub(crate) mod schema;
#[cfg(unix)]
pub(crate) mod terminal;

use std::{
    fs,
    io::Write,
    path::PathBuf,
    process::{Command, Output, Stdio},
    thread,
};

use axlewire::{
    encode::Encode,
    ucp::{Body, MotorControl, RawFrame, message::Ping},
};
use serde_json::{Map, Value, json};

/// The tool with these arguments.
pub(crate) fn axle(args: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_axle"));
    command.args(args);
    command
}

/// Runs the tool with `input` on standard input.
pub(crate) fn run(args: &[&str], input: &[u8]) -> Output {
    run_in_pieces(args, input, input.len().max(1))
}

/// Runs the tool with `input` on standard input, written `piece` bytes at a time.
pub(crate) fn run_in_pieces(args: &[&str], input: &[u8], piece: usize) -> Output {
    let mut child = axle(args)
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let mut stdin = child.stdin.take().unwrap();
    thread::scope(|scope| {
        // The tool may refuse its arguments and exit before reading anything.
        scope.spawn(move || input.chunks(piece).try_for_each(|piece| stdin.write_all(piece)));
        child.wait_with_output().unwrap()
    })
}

/// Standard output of a run that succeeded without any message.
pub(crate) fn stdout(output: Output) -> String {
    let stderr = String::from_utf8(output.stderr).unwrap();
    assert_eq!((output.status.code(), &*stderr), (Some(0), ""));
    String::from_utf8(output.stdout).unwrap()
}

/// The events in a listing of JSON lines, and its summary.
pub(crate) fn events(listing: &str) -> (Vec<Value>, Value) {
    let mut records: Vec<Value> =
        listing.lines().map(|line| serde_json::from_str(line).unwrap()).collect();
    let summary = records.pop().unwrap();
    assert_eq!(summary["event"], "summary");
    (records, summary)
}

/// Decodes `input` to JSON. Without any frame in it, that is a failure with a hint.
pub(crate) fn decode(args: &[&str], input: &[u8]) -> (Vec<Value>, Value) {
    let args = [&["decode", "--json"], args].concat();
    let output = run(&args, input);
    let listing = String::from_utf8(output.stdout).unwrap();
    let (events, summary) = events(&listing);
    let stderr = String::from_utf8(output.stderr).unwrap();
    let has_failed = summary["frames"] == 0 && summary["received"] != 0;
    assert_eq!(output.status.code(), Some(i32::from(has_failed)), "{stderr}");
    let is_told = stderr.starts_with("axle: no ") && stderr.contains(" frame in ");
    assert!(if has_failed { is_told } else { stderr.is_empty() }, "{stderr}");
    (events, summary)
}

/// Skipped bytes by reason in all gaps among `events`.
pub(crate) fn skipped_by(events: &[Value]) -> Value {
    let mut all = Map::new();
    for event in events.iter().filter(|event| event["event"] == "skipped") {
        let reason = event["reason"].as_str().unwrap();
        let of_one = Map::from_iter([(reason.to_owned(), event["length"].clone())]);
        let reasons = event.get("reasons").map_or(&of_one, |reasons| reasons.as_object().unwrap());
        assert!(event.get("reasons").is_none() || reasons.len() > 1, "{event}");
        let bytes = |reasons: &Map<String, Value>| -> u64 {
            reasons.values().map(|bytes| bytes.as_u64().unwrap()).sum()
        };
        assert_eq!(event["length"], bytes(reasons), "{event}");
        for (reason, bytes) in reasons {
            let so_far = all.get(reason).and_then(Value::as_u64).unwrap_or_default();
            all.insert(reason.clone(), (so_far + bytes.as_u64().unwrap()).into());
        }
    }
    all.into()
}

/// A file with these bytes in the build directory.
pub(crate) fn file(name: &str, bytes: &[u8]) -> PathBuf {
    let path = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(name);
    fs::write(&path, bytes).unwrap();
    path
}

/// Bytes from hex digits; spaces are ignored.
pub(crate) fn bytes(hex: &str) -> Vec<u8> {
    let digits: Vec<u8> =
        hex.chars().filter_map(|c| c.to_digit(16)).map(|digit| digit as u8).collect();
    digits.chunks(2).map(|pair| pair[0] << 4 | pair[1]).collect()
}

/// A UCP stream and the events that it must give, known from its construction.
#[derive(Default)]
pub(crate) struct Capture {
    pub(crate) bytes: Vec<u8>,
    pub(crate) events: Vec<Value>,
    /// Skipped bytes by reason in the gap at the end.
    headers_and_crcs: [usize; 2],
}

impl Capture {
    /// At least `len` bytes of frames, noise and damaged frames in a random order.
    pub(crate) fn noisy(len: usize, seed: u64) -> Self {
        let mut random = Random(seed);
        let mut capture = Self::default();
        while capture.bytes.len() < len {
            let index = random.below(256) as u8;
            match random.below(5) {
                0 => {
                    let noise: Vec<u8> = (0..=random.below(90)).map(|_| random.quiet()).collect();
                    capture.gap("header", &noise);
                }
                1 => {
                    // It has no FD but its first byte, so only that byte is skipped as a wrong CRC.
                    let mut frame = Ping {}.frame(index & 0x7F).as_bytes().to_vec();
                    frame[6] ^= 0x01;
                    if frame[6] != 0xFD && frame[7] != 0xFD {
                        capture.gap("crc", &frame);
                    }
                }
                2 => {
                    let fields = json!({"message": "ping", "id": 1, "index": index});
                    capture.frame(Ping {}.frame(index).as_bytes(), fields);
                }
                3 => {
                    let (speed, turn) = (random.below(101) as i16, random.below(101) as i16);
                    let command = MotorControl::turn_left(speed, turn).unwrap().frame(index);
                    let fields = json!({
                        "message": "motor_control", "id": 2, "index": index, "speed": speed,
                        "angular": -turn, "front_led": 0, "back_led": 0, "version": 0,
                        "reserve1": 0, "reserve2": 0,
                    });
                    capture.frame(command.as_bytes(), fields);
                }
                _ => {
                    let body: Vec<u8> = (0..random.below(57)).map(|_| random.quiet()).collect();
                    let mut buffer = [0; 64];
                    let frame = RawFrame { id: 0x20, index, body: &body };
                    let hex: String = body.iter().map(|byte| format!("{byte:02x}")).collect();
                    let fields =
                        json!({"message": "unknown", "id": 0x20, "index": index, "body": hex});
                    // A few have FD FF in their CRC, and are not sent.
                    if let Ok(bytes) = frame.encode(&mut buffer) {
                        capture.frame(bytes, fields);
                    }
                }
            }
        }
        capture
    }

    fn frame(&mut self, frame: &[u8], mut event: Value) {
        event["event"] = "frame".into();
        event["protocol"] = "ucp".into();
        event["offset"] = self.bytes.len().into();
        event["length"] = frame.len().into();
        event["bytes"] = frame.iter().map(|byte| format!("{byte:02x}")).collect::<String>().into();
        self.headers_and_crcs = [0; 2];
        self.events.push(event);
        self.bytes.extend(frame);
    }

    /// Adds a gap, or extends the gap at the end of the capture.
    fn gap(&mut self, reason: &str, bytes: &[u8]) {
        let offset = self.bytes.len();
        match self.events.last_mut() {
            Some(last) if last["event"] == "skipped" => {
                last["length"] = (last["length"].as_u64().unwrap() + bytes.len() as u64).into();
            }
            _ => self.events.push(json!({
                "event": "skipped", "offset": offset, "length": bytes.len(), "reason": reason,
            })),
        }
        self.bytes.extend(bytes);
        let [headers, crcs] = &mut self.headers_and_crcs;
        let damaged = usize::from(reason == "crc");
        *headers += bytes.len() - damaged;
        *crcs += damaged;
        if let (1.., 1.., Some(event)) = (*headers, *crcs, self.events.last_mut()) {
            event["reasons"] = json!({"header": headers, "crc": crcs});
        }
    }
}

/// Xorshift, with the same numbers on every machine.
struct Random(u64);

impl Random {
    fn below(&mut self, limit: u64) -> u64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        self.0 % limit
    }

    /// A byte that starts no frame.
    fn quiet(&mut self) -> u8 {
        self.below(0xFD) as u8
    }
}
