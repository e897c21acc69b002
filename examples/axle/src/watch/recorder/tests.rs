//! The files of recordings.

use std::time::Duration;

use axlewire::ucp::Ucp;

use super::{super::Args, *};
use crate::watch::args::From;

#[test]
fn recordings_have_names_of_their_own() {
    assert_eq!(numbered(Path::new("a/line.pcapng"), 2), Path::new("a/line-2.pcapng"));
    assert_eq!(numbered(Path::new("line"), 3), Path::new("line-3"));
    let time = SystemTime::UNIX_EPOCH + Duration::from_secs(1_000_000_000);
    assert_eq!(automatic(time), Path::new("axle-20010909-014640.pcapng"));
}

#[test]
fn a_second_recording_is_another_file() {
    let named = std::env::temp_dir().join(format!("axle-second-{}.pcapng", std::process::id()));
    let (port, protocol, baud) = ("port", Protocol::Ucp, 115_200);
    let args = Args {
        udp: None,
        form: crate::input::Form::default(),
        from: From { port: Some(port.to_owned()), files: Vec::new() },
        baud: None,
        protocol: Some(protocol),
        plain: false,
        json: false,
        micros: None,
        count: None,
        interface: None,
        record: Some(named.clone()),
    };
    let mut recorder =
        Recorder::<Ucp>::new(&Watched { port, protocol, baud, args: &args }).unwrap();
    recorder.take(&[0xFD, 0xFF, 4], 1).unwrap();
    recorder.finish().unwrap();
    let recorded = std::fs::read(&named).unwrap();
    let has_all = recorded.windows(3).any(|part| part == [0xFD, 0xFF, 4]);
    assert!(has_all, "the beginning of a frame that the end cuts off is recorded too");
    let mut paths = vec![named.clone()];
    for number in 2..4 {
        recorder.finish().unwrap();
        recorder.start().unwrap();
        paths.push(numbered(&named, number));
    }
    recorder.finish().unwrap();
    recorder.start().unwrap();
    assert!(recorder.running.is_some());
    recorder.drop_it();
    assert!(recorder.running.is_none(), "what has failed is given up");
    paths.push(numbered(&named, 4));
    assert_eq!(unused(&named), numbered(&named, 5), "the others are there");
    for path in paths {
        std::fs::remove_file(&path).unwrap();
    }
    assert_eq!(unused(&named), named);
}
