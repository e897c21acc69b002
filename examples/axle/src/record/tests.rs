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
    let (account, finished) = frames.finish();
    finished.unwrap();
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
    frames.finish().1.unwrap();
    let (packets, times) = recorded(&path);
    assert_eq!(packets, [&other[..8], drive.as_bytes(), &[1; 40]]);
    assert!(times[0] == times[1] && times[1] + 2000 <= times[2], "{times:?}");
}
