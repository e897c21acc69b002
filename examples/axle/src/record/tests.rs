//! What a recording has of a line.

use axlewire::{
    encode::Encode,
    ucp::{Body, MotorControl, RawFrame, Ucp},
};

use super::*;
use crate::pcapng::Reader;

fn frames(name: &str) -> (Frames<Ucp>, PathBuf) {
    clock::play();
    let path = std::env::temp_dir().join(format!("axle-{name}-{}", std::process::id()));
    let file = Recording::create(&path, true, Protocol::Ucp, "port", 115_200).unwrap();
    (Frames::new(file), path)
}

/// The packets of a file and their times; removes it.
fn recorded(path: &Path) -> (Vec<Vec<u8>>, Vec<u64>) {
    let written = std::fs::read(path).unwrap();
    std::fs::remove_file(path).unwrap();
    let mut reader = Reader::new(&written[..]);
    let (mut packets, mut times) = (Vec::new(), Vec::new());
    while let Ok(Some(packet)) = reader.next() {
        packets.push(packet.bytes.to_vec());
        times.push(packet.micros.unwrap());
    }
    (packets, times)
}

#[test]
fn a_frame_that_is_cut_off_is_written_after_a_pause_and_the_next_one_whole() {
    let (mut frames, path) = frames("cut");
    let frame = MotorControl::STOP.frame(0);
    let bytes = frame.as_bytes();
    frames.take(&bytes[..10]).unwrap();
    frames.take(&[]).unwrap();
    assert_eq!(frames.account().skipped(), 0, "it may go on");
    clock::sleep(Duration::from_micros(QUIET.as_micros().into()));
    frames.take(&[]).unwrap();
    assert_eq!(frames.account().skipped(), 10);
    frames.take(&[bytes, bytes].concat()).unwrap();
    frames.take(&bytes[..3]).unwrap();
    frames.finish().unwrap();
    let account = frames.account();
    assert_eq!((account.frames, account.skipped(), account.received), (2, 13, 61));
    let (packets, times) = recorded(&path);
    assert_eq!(packets, [&bytes[..10], bytes, bytes, &bytes[..3]]);
    assert!(times[1] - times[0] >= QUIET.as_micros().into(), "{times:?}");
    assert_eq!(times[1], times[2]);
    assert!(times.is_sorted() && times[0] > 0, "{times:?}");
}

#[test]
fn a_frame_that_is_found_late_has_the_time_at_which_it_came() {
    let (mut frames, path) = frames("late");
    let mut buffer = [0; 64];
    let other = RawFrame { id: 0x20, index: 0, body: &[0; 50] }.encode(&mut buffer).unwrap();
    let drive = MotorControl::STOP.frame(0);
    // It may be part of the other frame, until that one turns out to be none.
    frames.take(&[&other[..8], drive.as_bytes()].concat()).unwrap();
    assert_eq!(frames.account().frames, 0);
    clock::sleep(Duration::from_millis(2));
    frames.take(&[1; 40]).unwrap();
    frames.finish().unwrap();
    let (packets, times) = recorded(&path);
    assert_eq!(packets, [&other[..8], drive.as_bytes(), &[1; 40]]);
    assert!(times[0] == times[1] && times[1] + 2000 <= times[2], "{times:?}");
}

/// A folder of its own.
fn folder(name: &str) -> PathBuf {
    let folder = std::env::temp_dir().join(format!("axle-{name}-{}", std::process::id()));
    let _ = std::fs::remove_dir_all(&folder);
    std::fs::create_dir(&folder).unwrap();
    folder
}

fn rotated(folder: &Path, rotation: &str) -> Frames<Ucp> {
    clock::play();
    let rotation = rotation.parse().unwrap();
    let of = (Protocol::Ucp, "port", 115_200);
    Frames::new(Recording::create_first(&folder.join("a.b.pcapng"), false, rotation, of).unwrap())
}

/// The paths in a folder, by name.
fn listed(folder: &Path) -> Vec<PathBuf> {
    let mut paths: Vec<_> =
        std::fs::read_dir(folder).unwrap().map(|it| it.unwrap().path()).collect();
    paths.sort();
    paths
}

#[test]
fn a_recording_goes_on_in_another_file_before_one_has_more_than_its_size() {
    let folder = folder("sizes");
    let mut frames = rotated(&folder, "10kB");
    let frame = |index| MotorControl::STOP.frame(index).as_bytes().to_vec();
    for index in 0..=255 {
        frames.take(&[frame(index), frame(index)].concat()).unwrap();
        clock::sleep(Duration::from_millis(20));
    }
    frames.finish().unwrap();
    let last = frames.file.path().to_owned();
    assert_eq!(frames.file.files(), Some(4));
    drop(frames);
    let paths = listed(&folder);
    assert_eq!((paths.len(), paths.last()), (4, Some(&last)));
    let mut packets = Vec::new();
    for (number, path) in paths.iter().enumerate() {
        let name = path.file_name().unwrap().to_str().unwrap();
        let (start, rest) = name.split_at("a.b_00001_".len());
        assert_eq!(start, format!("a.b_{:05}_", number + 1));
        let digits = rest.strip_suffix(".pcapng").unwrap();
        assert!(digits.len() == 14 && digits.bytes().all(|it| it.is_ascii_digit()), "{name}");
        let len = std::fs::metadata(path).unwrap().len();
        assert!(len <= 10_000 && (number == 3 || len > 9900), "{len}");
        packets.extend(recorded(path).0);
    }
    let all: Vec<_> = (0..=255).flat_map(|index| [frame(index), frame(index)]).collect();
    assert_eq!(packets, all);
    std::fs::remove_dir(folder).unwrap();
}

#[test]
fn a_file_of_a_recording_has_no_packets_of_a_longer_time_and_silence_makes_no_files() {
    let folder = folder("times");
    let mut frames = rotated(&folder, "1h");
    let frame = MotorControl::STOP.frame(0);
    for minutes in [0, 30, 29, 1, 59, 300] {
        clock::sleep(Duration::from_secs(60 * minutes));
        frames.take(frame.as_bytes()).unwrap();
        frames.take(&[]).unwrap();
    }
    frames.finish().unwrap();
    drop(frames);
    let counts: Vec<_> = listed(&folder).iter().map(|path| recorded(path).0.len()).collect();
    assert_eq!(counts, [3, 2, 1]);
    std::fs::remove_dir(folder).unwrap();
}

#[test]
fn if_the_next_file_cannot_be_created_the_recording_ends_and_what_is_there_is_complete() {
    let folder = folder("gone");
    let mut frames = rotated(&folder, "1s");
    let frame = MotorControl::STOP.frame(0);
    frames.take(frame.as_bytes()).unwrap();
    let moved = folder.with_extension("moved");
    std::fs::rename(&folder, &moved).unwrap();
    clock::sleep(Duration::from_secs(1));
    let failure = frames.take(frame.as_bytes()).unwrap_err().to_string();
    assert!(failure.starts_with("cannot create "), "{failure}");
    assert_eq!(frames.file.files(), Some(1));
    drop(frames);
    assert_eq!(recorded(&listed(&moved)[0]).0, [frame.as_bytes()]);
    std::fs::remove_dir(moved).unwrap();
}

#[test]
fn sizes_and_times_of_files_are_read_as_they_are_written_by_hand() {
    for (text, expected) in [
        ("100MB", Rotation::Bytes(100_000_000)),
        ("1.5GB", Rotation::Bytes(1_500_000_000)),
        ("10 kB", Rotation::Bytes(10_000)),
        ("20000B", Rotation::Bytes(20_000)),
        ("1h", Rotation::Micros(3_600_000_000)),
        ("1h 30min", Rotation::Micros(5_400_000_000)),
        ("1s", Rotation::Micros(1_000_000)),
    ] {
        assert_eq!(text.parse(), Ok(expected), "{text}");
    }
    for text in
        ["10M", "1M", "", "100", "1 kB", "-1MB", "NaNMB", "MB", "1ms", "soon", "1€B", "1TBB"]
    {
        assert!(text.parse::<Rotation>().is_err(), "{text}");
    }
}

/// What a day costs is printed, and not judged: machines differ.
#[test]
#[ignore = "a minute; run it with --release and --nocapture"]
fn a_day_of_a_rover_is_recorded_in_constant_memory() {
    let memory = || {
        let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
        let peak = status.lines().find_map(|line| line.strip_prefix("VmHWM:"));
        peak.and_then(|kb| kb.split_whitespace().next()?.parse::<u64>().ok())
    };
    let folder = folder("day");
    let mut frames = rotated(&folder, "1h");
    let report = RawFrame { id: 0x20, index: 0, body: &[0; 36] };
    let mut buffer = [0; 64];
    let report = report.encode(&mut buffer).unwrap();
    let (start, mut early, mut bytes) = (Instant::now(), None, 0);
    for beat in 0..24 * 3600 * 50 {
        clock::sleep(Duration::from_millis(20));
        frames.take(report).unwrap();
        if frames.file.files() == Some(3) {
            early = early.or_else(memory);
        }
        // Room for the next hour.
        if beat % (3600 * 50) == 0 {
            for path in listed(&folder) {
                bytes += std::fs::metadata(&path).unwrap().len();
                std::fs::remove_file(path).unwrap();
            }
        }
    }
    let took = start.elapsed().as_secs_f64();
    println!("a day: {took:.1} s, {:.3} % of it, {bytes} bytes", took / 864.0);
    frames.finish().unwrap();
    assert_eq!((frames.account().frames, frames.file.files()), (4_320_000, Some(25)));
    let (early, late) = (early.unwrap_or(0), memory().unwrap_or(0));
    assert!(late <= early + 1000, "{early} kB became {late} kB");
    drop(frames);
    std::fs::remove_dir_all(folder).unwrap();
}
