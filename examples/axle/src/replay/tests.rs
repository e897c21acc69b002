//! Captures and the frames that they become.

use std::fs;

use axlewire::ikeya::{NodeId, ReadRequest, Rps, VelocityResponse, WriteRequest};
use clap::Parser;

use super::*;
use crate::pcapng::Writer;

#[derive(Debug, Parser)]
struct Only {
    #[command(flatten)]
    args: Args,
}

/// A file that is removed with it.
struct Capture(PathBuf);

impl Drop for Capture {
    fn drop(&mut self) {
        let _ = fs::remove_file(&self.0);
    }
}

fn file(name: &str, bytes: &[u8]) -> Capture {
    let path = std::env::temp_dir().join(format!("axle-replay-{}-{name}", std::process::id()));
    fs::write(&path, bytes).unwrap();
    Capture(path)
}

/// A capture of a bus: times in milliseconds.
fn capture(name: &str, packets: &[(u64, Option<Direction>, &[u8])]) -> Capture {
    let mut writer = Writer::new(Protocol::Ikeya, "port", 500_000);
    for (millis, direction, packet) in packets {
        writer.packet(1_000_000_000 + millis * 1000, *direction, packet);
    }
    file(name, &writer.blocks)
}

fn parsed(capture: &Capture, words: &str) -> Args {
    let words = ["replay", "-p", "x"].into_iter().chain(words.split_whitespace());
    let words = words.map(str::to_owned).chain([capture.0.to_str().unwrap().to_owned()]);
    Only::try_parse_from(words).unwrap().args
}

/// Times in microseconds, and the first four bytes.
fn frames(capture: &Capture, words: &str) -> Result<Vec<(u64, [u8; 4])>, String> {
    let args = parsed(capture, words);
    let (plan, _) = plan(&args).map_err(|failure| failure.to_string())?;
    let start = |bytes: &[u8]| [bytes[0], bytes[1], bytes[2], bytes[3]];
    Ok(plan.frames.iter().map(|due| (due.after_us, start(&due.bytes))).collect())
}

fn read() -> [u8; 4] {
    *ReadRequest::new(NodeId::N1).as_bytes()
}

fn write() -> [u8; 8] {
    *WriteRequest::velocity(NodeId::N1, Rps::new(1.0).unwrap()).as_bytes()
}

fn answer() -> [u8; 8] {
    *VelocityResponse::new(NodeId::N1, Rps::ZERO).as_bytes()
}

#[test]
fn times_are_those_of_the_capture_from_the_first_frame_on_at_the_speed_that_was_asked_for() {
    let read = read();
    let packets: [(u64, Option<Direction>, &[u8]); 3] =
        [(0, None, &read), (100, None, &read), (350, None, &read)];
    let capture = capture("times", &packets);
    for (speed, expected) in [
        ("", [0, 100_000, 350_000]),
        ("--speed 4", [0, 25_000, 87_500]),
        ("--speed 0.5", [0, 200_000, 700_000]),
    ] {
        let at: Vec<_> = frames(&capture, speed).unwrap().iter().map(|(at, _)| *at).collect();
        assert_eq!(at, expected, "{speed}");
    }
    for speed in ["0", "0.0009", "1001", "-1", "nan", "x"] {
        assert!(factor(speed).is_err(), "{speed}");
    }
}

#[test]
fn what_is_due_in_ages_or_may_not_be_sent_is_refused_with_the_rest() {
    let read = read();
    let far: [(u64, Option<Direction>, &[u8]); 2] =
        [(0, None, &read), (366 * 86_400_000, None, &read)];
    let says = "frame 2 is due after more than a year";
    let slow = "--longest-pause 86400 --speed 0.001";
    assert_eq!(frames(&capture("far", &far), slow).unwrap_err(), says);
    assert!(frames(&capture("faster", &far), "--speed 2").is_ok());
    let mut update = vec![0xFD, 0xFF, 20, 0, 2, 0];
    update.extend([0; 16]);
    update[14] = 39;
    update.extend(axlewire::crc16::compute(&update).to_le_bytes());
    let raw = file("update", &update);
    let says = "the capture has a motor command that starts a firmware update (ruling U7): nothing \
                is sent";
    assert_eq!(frames(&raw, "-P ucp --move").unwrap_err(), says);
    let says = "no frame of a device in the capture";
    assert_eq!(frames(&raw, "-P ucp --move --as device").unwrap_err(), says);
}

/// Times and notes of a capture of READs at these times, milliseconds.
fn paced(name: &str, millis: &[u64], words: &str) -> (Vec<u64>, Vec<String>) {
    let read = read();
    let packets: Vec<_> = millis.iter().map(|at| (*at, None, &read[..])).collect();
    let capture = capture(name, &packets);
    let args = parsed(&capture, words);
    let (plan, _) = plan(&args).unwrap();
    (plan.frames.iter().map(|due| due.after_us / 1000).collect(), plan.notes)
}

#[test]
fn behind_a_clock_that_was_set_back_the_pace_is_that_of_the_capture_and_it_is_said() {
    let (times, notes) = paced("back", &[5000, 5100, 1000, 1100, 1250], "");
    assert_eq!(times, [0, 100, 100, 200, 350]);
    let says = "the clock of the capture goes back 1 time, by up to 4s 100ms: the frame behind \
                that is sent at once";
    assert_eq!(notes, [says]);
    let (times, _) = paced("twice", &[5000, 4000, 4100, 10, 30], "--speed 0.5");
    assert_eq!(times, [0, 0, 200, 200, 240]);
}

#[test]
fn a_pause_of_hours_is_shortened_and_it_is_said() {
    let hours = 3 * 3_600_000;
    let (times, notes) = paced("hours", &[0, 100, hours + 100, hours + 200], "");
    assert_eq!(times, [0, 100, 10_100, 10_200]);
    assert_eq!(notes, ["1 pause of up to 3h shortened to 10s, see --longest-pause"]);
    let (times, notes) = paced("longer", &[0, 20_000], "--longest-pause 30");
    assert_eq!((times, notes), (vec![0, 20_000], vec![]));
}

#[test]
fn raw_bytes_follow_each_other_at_the_interval_that_was_asked_for() {
    let raw = file("raw", &read().repeat(3));
    for (every, expected) in [("", [0, 20_000, 40_000]), ("--every 0.5", [0, 500_000, 1_000_000])] {
        let found = frames(&raw, &format!("-P ikeya {every}")).unwrap();
        assert_eq!(found.iter().map(|(at, _)| *at).collect::<Vec<_>>(), expected, "{every}");
    }
    assert!(frames(&raw, "").unwrap_err().contains("--protocol is needed"));
}

#[test]
fn one_side_is_sent_and_a_command_only_with_move() {
    let (read, write, answer) = (read(), write(), answer());
    let packets: [(u64, Option<Direction>, &[u8]); 3] =
        [(0, None, &read), (1, None, &answer), (2, None, &write)];
    let capture = capture("sides", &packets);
    let says = "1 of 2 frames move something: use --move if you mean it; nothing is sent";
    assert_eq!(frames(&capture, "").unwrap_err(), says);
    let found = frames(&capture, "--move").unwrap();
    assert_eq!(found, [(0, read), (2000, [write[0], write[1], write[2], write[3]])]);
    let found = frames(&capture, "--as device").unwrap();
    assert_eq!(found, [(0, [answer[0], answer[1], answer[2], answer[3]])]);
}

#[test]
fn the_options_reach_the_plan_and_the_answers_say_how_a_command_was_meant() {
    let (write, answer) = (write(), answer());
    let packets: [(u64, Option<Direction>, &[u8]); 2] = [(0, None, &write), (1, None, &answer)];
    let capture = capture("options", &packets);
    let args = parsed(&capture, "--move --max-rps 5 --max-turns 7 -j");
    let (found, _) = plan(&args).unwrap();
    assert_eq!((found.limits.max_rps.get(), found.limits.max_turns), (5.0, 7.0));
    assert!(found.is_json && found.side == Side::Commander && found.linger_us == 200_000);
    assert_eq!(found.frames[0].meant, Some(axlewire::ikeya::Mode::Velocity));
    let args = parsed(&capture, "--as device");
    let (found, _) = plan(&args).unwrap();
    assert!(!found.is_json && found.side == Side::Device);
}

#[test]
fn only_the_echo_of_what_was_sent_is_left_out() {
    let (read, write) = (read(), write());
    let (sent, heard) = (Some(Direction::Out), Some(Direction::In));
    // A WRITE of others, an echo, the same READ of others, and one that is too late for an echo.
    let packets: [(u64, Option<Direction>, &[u8]); 6] = [
        (0, heard, &write),
        (10, sent, &read),
        (11, heard, &read),
        (20, heard, &read),
        (30, sent, &read),
        (1500, None, &read),
    ];
    let found = frames(&capture("echoes", &packets), "--move").unwrap();
    let times: Vec<_> = found.iter().map(|(micros, _)| micros / 1000).collect();
    assert_eq!(times, [0, 10, 20, 30, 1500]);
    // A stop of others is no echo of an own one before their command.
    let stop = *WriteRequest::velocity(NodeId::N1, Rps::ZERO).as_bytes();
    let packets: [(u64, Option<Direction>, &[u8]); 3] =
        [(0, sent, &stop), (100, heard, &write), (300, heard, &stop)];
    let found = frames(&capture("stop", &packets), "--move").unwrap();
    assert_eq!(found.len(), 3);
}

#[test]
fn packets_of_two_directions_may_be_in_the_wrong_order_by_a_moment() {
    let (read, write) = (read(), write());
    let (sent, heard) = (Some(Direction::Out), Some(Direction::In));
    // As two files that overlap: the second begins at 500 ms.
    let packets: [(u64, Option<Direction>, &[u8]); 5] = [
        (0, sent, &read),
        (11, heard, &answer()),
        (10, sent, &read),
        (1000, sent, &write),
        (500, sent, &read),
    ];
    let set_back = frames(&capture("set-back", &packets), "--move").unwrap();
    assert_eq!(set_back.last().unwrap().1, read[..4], "the clock was set");
    let found = frames(&capture("moment", &packets[..4]), "--move").unwrap();
    let times: Vec<_> = found.iter().map(|(micros, _)| micros / 1000).collect();
    assert_eq!(times, [0, 10, 1000]);
}

#[test]
fn a_frame_that_a_stray_byte_holds_back_is_sent_at_its_time() {
    let (read, answer) = (read(), answer());
    let (sent, heard) = (Some(Direction::Out), Some(Direction::In));
    let packets: [(u64, Option<Direction>, &[u8]); 6] = [
        (0, sent, &read),
        (100, sent, &[0xBB]),
        (200, sent, &read),
        (900, heard, &answer),
        (1000, sent, &read),
        (2000, sent, &read),
    ];
    let capture = capture("stray", &packets);
    let args = parsed(&capture, "");
    let (plan, _) = plan(&args).unwrap();
    let times: Vec<_> = plan.frames.iter().map(|due| due.after_us / 1000).collect();
    assert_eq!((times, plan.notes), (vec![0, 200, 1000, 2000], vec![]));
}

#[test]
fn where_the_recording_program_has_sent_something_what_it_heard_of_it_is_left_out() {
    let read = read();
    let (sent, heard) = (Some(Direction::Out), Some(Direction::In));
    let both: [(u64, Option<Direction>, &[u8]); 2] = [(0, sent, &read), (1, heard, &read)];
    assert_eq!(frames(&capture("echo", &both), "").unwrap().len(), 1);
    let only: [(u64, Option<Direction>, &[u8]); 2] = [(0, heard, &read), (1, heard, &read)];
    assert_eq!(frames(&capture("heard", &only), "").unwrap().len(), 2);
}

#[test]
fn without_move_nothing_leaves_that_any_receiver_could_take_for_a_command() {
    // The answers of a three-motor board, one of which is a WRITE for a node with one motor.
    let answer = |payload: &[u8]| {
        let frame = [&[0x55, 1][..], payload].concat();
        [&frame[..], &axlewire::crc16::compute(&frame).to_le_bytes()].concat()
    };
    let fast = WriteRequest::velocity(NodeId::N1, Rps::new(19.0).unwrap());
    let hidden = answer(&[&[0; 2], &fast.as_bytes()[..], &[0; 2]].concat());
    let harmless = answer(&[0; 12]);
    let raw = file("hidden", &[&harmless[..], &hidden].concat());
    for protocol in ["ikeya-3 --move", "ikeya-3"] {
        let args = parsed(&raw, &format!("-P {protocol} --as device"));
        let says = "another frame is hidden in frame 2, and a motor may take it (ruling I3): \
                    nothing is sent";
        assert_eq!(run(&args).unwrap_err().to_string(), says);
    }
    let args = parsed(&file("harmless", &harmless), "-P ikeya-3 --as device");
    assert!(!run(&args).unwrap_err().to_string().contains("hidden"), "no such port");
}
