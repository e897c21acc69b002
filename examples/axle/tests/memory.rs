//! Memory use does not grow with the input.
#![cfg(target_os = "linux")]

mod support;

use std::{
    fs,
    io::{BufRead, BufReader, Read, Write},
    process::{Child, Stdio},
    thread,
    time::Duration,
};

use axlewire::{
    ikeya::{NodeId, ReadRequest},
    ucp::{Body, message::Ping},
};
use support::{axle, bytes, file, pcapng::PcapNg};

/// Total number of bytes fed in.
const FED: usize = 200 * 1024 * 1024;

/// Limit of the tool's peak memory, KiB.
const PEAK_LIMIT_KIB: usize = 16 * 1024;

/// The same while several threads list a file; 11 MiB of it is the program, in a debug build with
/// all its formats.
const THREADS_LIMIT_KIB: usize = 22 * 1024;

const UCP: u16 = 150;
const IKEYA: u16 = 147;

#[test]
fn memory_does_not_grow_with_the_input() {
    let mut child = start(&["decode", "--protocol", "ucp", "--json"]);
    let output = BufReader::new(child.stdout.take().unwrap());
    let frames = thread::spawn(move || {
        output.lines().map_while(Result::ok).filter(|line| line.contains("ping")).count()
    });

    // First one endless gap, then occasional frames.
    let mut block = vec![0; 64 * 1024];
    let mut stdin = child.stdin.take().unwrap();
    let blocks = FED / block.len();
    for at in 0..blocks {
        if at == blocks / 2 {
            block[..8].copy_from_slice(Ping {}.frame(0).as_bytes());
        }
        stdin.write_all(&block).unwrap();
    }
    // Standard input is still open, so the tool is still running.
    let peak = peak(&child).unwrap();
    drop(stdin);
    assert!(child.wait().unwrap().success());
    assert_eq!(frames.join().unwrap(), blocks / 2);
    assert!(peak < PEAK_LIMIT_KIB, "the tool held {peak} KiB");
}

#[test]
fn memory_does_not_grow_with_the_packets_of_a_capture() {
    let packets = |kind: u16, bytes: &[u8]| {
        let mut capture = PcapNg::new(kind, &[]);
        let header = capture.0.len();
        for at in 0..1000 {
            capture.packet(0, (at, 1, bytes));
        }
        (capture.0[..header].to_vec(), capture.0[header..].to_vec())
    };
    let noise = packets(UCP, &[1, 2, 3, 4]);
    let empty = packets(UCP, &[]);
    let section = (Vec::new(), PcapNg::new(UCP, &[(0, 1, Ping {}.frame(0).as_bytes())]).0);
    let mut long = packets(IKEYA, &ReadRequest::new(NodeId::N1).as_bytes().repeat(200_000));
    long.1.truncate(long.1.len() / 1000);
    for (what, (header, block), times) in [
        ("noise", noise, 1000),
        ("empty", empty, 1000),
        ("sections", section, 50_000),
        ("long", long, 3),
    ] {
        for args in [["decode", "--json"], ["watch", "-"]] {
            let mut child = start(&args);
            let mut output = child.stdout.take().unwrap();
            let reader = thread::spawn(move || std::io::copy(&mut output, &mut std::io::sink()));
            let mut stdin = child.stdin.take().unwrap();
            stdin.write_all(&header).unwrap();
            for _ in 0..times {
                stdin.write_all(&block).unwrap();
            }
            let peak = peak(&child).unwrap();
            drop(stdin);
            child.wait().unwrap();
            reader.join().unwrap().unwrap();
            assert!(peak < PEAK_LIMIT_KIB, "{what}, {args:?}: the tool held {peak} KiB");
        }
    }
}

/// Limit while rows are collected for a file: those of a table with 64 Ki rows, and more of others.
const EXPORT_LIMIT_KIB: usize = 48 * 1024;

#[test]
fn an_export_holds_a_batch_of_rows_at_most() {
    let mut forms = vec!["jsonl", "csv"];
    forms.extend(cfg!(feature = "mcap").then_some("mcap"));
    forms.extend(cfg!(feature = "parquet").then_some("parquet"));
    let report = bytes(
        "fdff2800050000000000000000000000000000000000000000000000000000000000000000000000\
         2600d16a",
    );
    let block = [&report[..], Ping {}.frame(0).as_bytes(), &[0; 3]].concat().repeat(1000);
    for form in forms {
        let path = file(&format!("long.{form}"), &[]);
        fs::remove_file(&path).unwrap();
        let to = path.to_str().unwrap();
        let mut child = start(&["export", "-P", "ucp", "-", "-o", to]);
        let mut stdin = child.stdin.take().unwrap();
        // Twice as much at the end as in the middle.
        let mut peaks = Vec::new();
        for _ in 0..2 {
            for _ in 0..300 {
                stdin.write_all(&block).unwrap();
            }
            peaks.push(peak(&child).unwrap());
        }
        drop(stdin);
        assert!(child.wait().unwrap().success());
        assert!(peaks[1] < EXPORT_LIMIT_KIB, "{form}: the tool held {peaks:?} KiB");
        assert!(peaks[1] < peaks[0] + 2048, "{form}: {peaks:?} KiB");
        let remove = if path.is_dir() { fs::remove_dir_all } else { fs::remove_file };
        remove(path).unwrap();
    }
}

/// Where candidates overlap all the time, there is no place to split.
#[test]
fn memory_does_not_grow_where_a_file_can_hardly_be_split() {
    let read = *ReadRequest::new(NodeId::N1).as_bytes();
    let solid = [&[0xBB][..], &read].concat().repeat(200_000);
    let with_places = |len: usize, times| [&solid[..len], &[0; 64]].concat().repeat(times);
    let files = [("rare.bin", with_places(60_000, 30)), ("seldom.bin", with_places(1_000_000, 2))];
    for (name, bytes) in files {
        let path = file(name, &bytes);
        for jobs in ["2", "16", "256"] {
            let path = path.to_str().unwrap();
            let mut child = start(&["decode", "-P", "ikeya", "--json", "--jobs", jobs, path]);
            // While nobody reads the output, the threads go on as far as they may.
            let (mut buffer, mut highest) = (vec![0; 1 << 20], 0);
            thread::sleep(Duration::from_millis(1500));
            let mut output = child.stdout.take().unwrap();
            while output.read(&mut buffer).unwrap() > 0 {
                highest = highest.max(peak(&child).unwrap_or(0));
            }
            assert!(child.wait().unwrap().success());
            let limit = THREADS_LIMIT_KIB;
            assert!(highest < limit, "{name} --jobs {jobs}: the tool held {highest} KiB");
        }
        fs::remove_file(path).unwrap();
    }
}

fn start(args: &[&str]) -> Child {
    let piped = Stdio::piped;
    axle(args).stdin(piped()).stdout(piped()).stderr(Stdio::null()).spawn().unwrap()
}

/// The most memory so far, KiB.
fn peak(child: &Child) -> Option<usize> {
    let status = fs::read_to_string(format!("/proc/{}/status", child.id())).ok()?;
    let peak = status.lines().find_map(|line| line.strip_prefix("VmHWM:"))?;
    Some(peak.trim().trim_end_matches(" kB").parse().unwrap())
}
