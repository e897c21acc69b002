//! Memory use does not grow with the input.
#![cfg(target_os = "linux")]

mod support;

use std::{
    fs,
    io::{BufRead, BufReader, Write},
    process::Stdio,
    thread,
};

use axlewire::ucp::{Body, message::Ping};
use support::axle;

/// Total number of bytes fed in.
const FED: usize = 200 * 1024 * 1024;

/// Limit of the tool's peak memory, KiB.
const PEAK_LIMIT_KIB: usize = 16 * 1024;

#[test]
fn memory_does_not_grow_with_the_input() {
    let mut child = axle(&["decode", "--protocol", "ucp", "--json"])
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .spawn()
        .unwrap();
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
    let status = fs::read_to_string(format!("/proc/{}/status", child.id())).unwrap();
    drop(stdin);
    assert!(child.wait().unwrap().success());
    assert_eq!(frames.join().unwrap(), blocks / 2);

    let peak = status.lines().find_map(|line| line.strip_prefix("VmHWM:")).unwrap();
    let peak: usize = peak.trim().trim_end_matches(" kB").parse().unwrap();
    assert!(peak < PEAK_LIMIT_KIB, "the tool held {peak} KiB");
}
