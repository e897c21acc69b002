//! The forms of a capture: each is listed like the others, and what is none of them is named.

mod support;

use std::{
    fs,
    io::{BufRead, BufReader, Write},
    path::PathBuf,
    process::Stdio,
};

use axlewire::{
    ikeya::{NodeId, Position, PositionResponse, ReadRequest, WriteRequest},
    ucp::{Body, message::Ping},
};
use flate2::{Compression, write::GzEncoder};
use serde_json::Value;
use support::{
    axle, decode,
    pcapng::{Packet, PcapNg, outcome},
    run,
};

/// A moment in 2026, microseconds since 1970.
const T: u64 = 1_795_386_000_000_000;

const UCP: u16 = 150;

fn pings() -> [Vec<u8>; 3] {
    [0, 1, 2].map(|index| Ping {}.frame(index).as_bytes().to_vec())
}

/// The pings 20 ms apart, in pcapng and in classic pcap of each kind.
fn captures() -> Vec<Vec<u8>> {
    let pings = pings();
    let at = |number: usize| T + 20_000 * number as u64;
    let packets: Vec<Packet<'_>> =
        pings.iter().enumerate().map(|(number, ping)| (at(number), 0, &ping[..])).collect();
    let mut captures = vec![PcapNg::new(UCP, &packets).0];
    for (magic, per_micro) in [(0xA1B2_C3D4_u32, 1), (0xA1B2_3C4D, 1000)] {
        for is_big in [false, true] {
            let word = |it: u32| if is_big { it.to_be_bytes() } else { it.to_le_bytes() };
            let half = |it: u16| if is_big { it.to_be_bytes() } else { it.to_le_bytes() };
            let mut file = [&word(magic)[..], &half(2), &half(4), &[0; 8]].concat();
            file.extend([word(65535), word(UCP.into())].concat());
            for (micros, _, bytes) in &packets {
                let (seconds, fraction) = (micros / 1_000_000, micros % 1_000_000 * per_micro);
                let len = bytes.len() as u32;
                file.extend([seconds as u32, fraction as u32, len, len].map(word).concat());
                file.extend(*bytes);
            }
            captures.push(file);
        }
    }
    captures
}

fn packed(bytes: &[u8]) -> Vec<u8> {
    let mut packed = GzEncoder::new(vec![], Compression::default());
    packed.write_all(bytes).unwrap();
    packed.finish().unwrap()
}

#[test]
fn pcapng_and_every_kind_of_pcap_packed_or_not_are_listed_alike() {
    let captures = captures();
    let expected = decode(&[], &captures[0]);
    assert_eq!((expected.0.len(), &expected.0[2]["t"]), (3, &serde_json::json!(1_795_386_000.04)));
    for capture in &captures {
        assert_eq!(decode(&[], capture), expected, "{capture:02x?}");
        assert_eq!(decode(&[], &packed(capture)), expected, "{capture:02x?}");
        // Two packed files in a row are one, as gzip has it.
        let (first, second) = capture.split_at(70);
        assert_eq!(decode(&[], &[packed(first), packed(second)].concat()), expected);
    }
}

#[test]
fn raw_bytes_packed_or_as_hex_text_are_listed_alike() {
    let raw = pings().concat();
    let expected = decode(&[], &raw);
    let text: String = raw.iter().map(|byte| format!("{byte:02X}\n")).collect();
    assert_eq!(decode(&[], &packed(&raw)), expected);
    assert_eq!(decode(&["--hex"], text.as_bytes()), expected);
    assert_eq!(decode(&["--hex"], &packed(text.as_bytes())), expected);
}

#[test]
fn a_packed_or_classic_capture_that_was_cut_gives_all_that_is_there_and_one_line() {
    let classic = &captures()[1];
    let cut = &classic[..classic.len() - 9];
    let whole = packed(classic);
    let cases = [
        (cut, "\"standard input\": the file ends inside the pcap record at byte 72"),
        (&whole[..whole.len() - 9], "cannot read standard input: "),
    ];
    for (input, says) in cases {
        let (listing, code, line) = outcome(run(&["decode", "--json"], input));
        assert!(listing.lines().count() >= 2, "{listing}");
        assert!(code == Some(1) && line.starts_with(&format!("axle: {says}")), "{line}");
        assert_eq!(line.lines().count(), 1);
    }
}

#[test]
fn hex_text_and_telnet_are_named() {
    let text = "fd ff 04 00 01 00 e2 75\n".repeat(3);
    for command in ["decode", "watch", "replay --port /none"] {
        let mut words: Vec<_> = command.split(' ').collect();
        let path = support::file("hex.txt", text.as_bytes());
        words.push(path.to_str().unwrap());
        let (_, code, line) = outcome(run(&words, &[]));
        let says = "axle: the capture is hex text: use --hex\n";
        assert_eq!((code, &*line), (Some(2), says), "{command}");
    }
    let telnet = [&[0xFF, 0xFB, 3, 0xFF, 0xFB, 1][..], &pings().concat()].concat();
    let (_, code, line) = outcome(run(&["decode"], &telnet));
    assert_eq!(code, Some(0));
    assert!(line.starts_with("axle: the capture begins as telnet does,"), "{line}");
}

#[test]
fn each_packet_of_a_capture_from_a_pipe_is_listed_before_the_next_one_arrives() {
    for capture in captures() {
        let mut child = axle(&["decode", "--json", "-"])
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .unwrap();
        let mut input = child.stdin.take().unwrap();
        let mut lines = BufReader::new(child.stdout.take().unwrap()).lines();
        let rest = pings().iter().rev().try_fold(capture.as_slice(), |rest, ping| {
            let at = rest.windows(ping.len()).rposition(|bytes| bytes == ping)?;
            Some(&rest[..at])
        });
        let header = rest.unwrap().len();
        let step = (capture.len() - header).div_ceil(3);
        let ends: Vec<_> = (1..=3).map(|count| capture.len() - (3 - count) * step).collect();
        let mut from = 0;
        for end in ends {
            input.write_all(&capture[from..end.min(capture.len())]).unwrap();
            from = end;
            assert!(lines.next().unwrap().unwrap().contains("\"ping"), "one per packet");
        }
        drop(input);
        assert!(lines.next().unwrap().unwrap().contains("summary"));
        assert!(child.wait().unwrap().success());
    }
}

/// A recording in several files, as of `--rotate`, the second packed, in a folder with other files.
fn set(name: &str) -> (PathBuf, String) {
    let folder = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(name);
    let _ = fs::remove_dir_all(&folder);
    fs::create_dir_all(&folder).unwrap();
    let ping = Ping {}.frame(0);
    let capture = |begin: u64| {
        let packet = |at: u64| (begin + 20_000 * at, 1, ping.as_bytes());
        PcapNg::new(150, &[packet(0), packet(1), packet(2)]).0
    };
    // Their names do not tell the order.
    fs::write(folder.join("c.pcapng"), capture(1_000_000)).unwrap();
    fs::write(folder.join("a.pcapng.gz"), packed(&capture(2_000_000))).unwrap();
    fs::write(folder.join("b.pcapng"), capture(3_000_000)).unwrap();
    let path = folder.to_str().unwrap().to_owned();
    (folder, path)
}

#[test]
fn several_files_and_a_folder_are_one_capture_in_the_order_of_time() {
    let (folder, path) = set("set");
    let run = |args: &[&str]| {
        let output = axle(args).output().unwrap();
        assert!(output.status.success(), "{args:?}: {output:?}");
        String::from_utf8(output.stdout).unwrap()
    };
    let files = ["b.pcapng", "a.pcapng.gz", "c.pcapng"].map(|it| format!("{path}/{it}"));
    let [b, a, c] = files.each_ref().map(String::as_str);
    let times = |lines: &str| -> Vec<_> {
        let lines = lines.lines().map(|line| serde_json::from_str::<Value>(line).unwrap());
        lines.filter_map(|line| line["t"].as_f64()).collect()
    };
    let whole = [0.0, 1.0, 2.0].map(|at| [at, at + 0.02, at + 0.04]).concat();
    let absolute: Vec<_> = whole.iter().map(|at| at + 1.0).collect();
    assert_eq!(times(&run(&["decode", "--json", &path])), absolute);
    assert_eq!(times(&run(&["replay", "--dry-run", "--json", &path])), whole);
    assert!(run(&["watch", &path]).contains("9 frames"));
    for command in [&["decode"][..], &["watch", "--json"], &["replay", "--dry-run"]] {
        let expected = run(&[command, &[&path]].concat());
        assert_eq!(run(&[command, &[b, a, c]].concat()), expected, "{command:?}");
    }
    let output = folder.join("set.jsonl");
    run(&["export", &path, "-o", output.to_str().unwrap()]);
    assert_eq!(times(&fs::read_to_string(output).unwrap()), absolute);
}

#[test]
fn captures_in_different_folders_are_of_different_lines() {
    let (folder, path) = set("folders");
    fs::create_dir(folder.join("other")).unwrap();
    fs::rename(folder.join("b.pcapng"), folder.join("other/b.pcapng")).unwrap();
    let output = axle(&["replay", "--dry-run", &path]).output().unwrap();
    let error = String::from_utf8(output.stderr).unwrap();
    assert!(error.contains("has more than one line"), "{error}");
    let output = axle(&["decode", "--json", &path]).output().unwrap();
    let lines = String::from_utf8(output.stdout).unwrap();
    let interfaces: Vec<_> = lines
        .lines()
        .filter_map(|line| serde_json::from_str::<Value>(line).unwrap()["interface"].as_u64())
        .collect();
    assert_eq!(interfaces, [0, 0, 0, 0, 0, 0, 1, 1, 1]);
}

#[test]
fn a_file_is_read_once_however_it_is_named() {
    let (folder, path) = set("names-twice");
    let again = format!("{path}/../names-twice/b.pcapng");
    let c = folder.join("c.pcapng");
    let output = axle(&["decode", &path, &again, c.to_str().unwrap()]).output().unwrap();
    let listing = String::from_utf8(output.stdout).unwrap();
    assert!(listing.contains(" in 9 frames"), "{listing}");
}

#[test]
fn a_node_keeps_its_mode_from_one_file_of_a_line_to_the_next() {
    let folder = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join("modes");
    let _ = fs::remove_dir_all(&folder);
    fs::create_dir_all(&folder).unwrap();
    let answer = *PositionResponse::new(NodeId::N1, Position::new(0, 1)).as_bytes();
    let write = *WriteRequest::position(NodeId::N1, Position::new(0, 2)).as_bytes();
    for (name, at, direction, bytes) in [("a", 1_000_000, 1, answer), ("b", 2_000_000, 2, write)] {
        let file = PcapNg::new(147, &[(at, direction, &bytes)]).0;
        fs::write(folder.join(format!("{name}.pcapng")), file).unwrap();
    }
    let path = folder.to_str().unwrap();
    for command in [&["decode"][..], &["replay", "--dry-run"]] {
        let output = axle(&[command, &[path]].concat()).output().unwrap();
        let listing = String::from_utf8(output.stdout).unwrap();
        assert!(listing.contains("2.0000 turns") && !listing.contains(" rps"), "{listing}");
    }
}

#[test]
fn sections_of_one_line_in_a_file_of_several_are_one_line() {
    let (folder, path) = set("sections");
    let [b, c] = ["b.pcapng", "c.pcapng"].map(|name| fs::read(folder.join(name)).unwrap());
    fs::write(folder.join("c.pcapng"), [c, b].concat()).unwrap();
    fs::remove_file(folder.join("b.pcapng")).unwrap();
    let output = axle(&["replay", "--dry-run", &path]).output().unwrap();
    assert!(output.status.success(), "{output:?}");
}

#[test]
fn two_lines_of_one_name_in_a_file_of_several_are_not_mixed() {
    let (folder, path) = set("names");
    let frame = Ping {}.frame(0);
    let (front, back) = frame.as_bytes().split_at(3);
    let mut file = PcapNg::new(150, &[]);
    file.interface(150);
    for (at, part) in [front, front, back, back].into_iter().enumerate() {
        file.packet(at as u32 % 2, (4_000_000 + at as u64, 1, part));
    }
    fs::write(folder.join("d.pcapng"), file.0).unwrap();
    let output = axle(&["decode", &path]).output().unwrap();
    let listing = String::from_utf8(output.stdout).unwrap();
    assert!(listing.contains(" in 11 frames\n         0 skipped"), "{listing}");
}

#[test]
fn a_bad_file_among_several_is_named_and_costs_nothing_of_the_others() {
    let (folder, path) = set("bad-set");
    let cut = fs::read(folder.join("c.pcapng")).unwrap();
    fs::write(folder.join("c.pcapng"), &cut[..cut.len() - 10]).unwrap();
    let output = axle(&["decode", "--json", &path]).output().unwrap();
    let [out, error] = [output.stdout, output.stderr].map(|it| String::from_utf8(it).unwrap());
    assert_eq!(output.status.code(), Some(1));
    assert!(error.contains("c.pcapng"), "{error}");
    assert_eq!(out.lines().filter(|line| line.contains("\"ping\"")).count(), 9, "{out}");
    // Each is told: others that are empty, packed and cut in their first bytes, or no captures.
    fs::write(folder.join("empty.pcapng"), []).unwrap();
    fs::write(folder.join("cut.pcapng.gz"), &packed(&cut)[..5]).unwrap();
    fs::write(folder.join("odd.pcap"), "years of work").unwrap();
    let ethernet = PcapNg::new(1, &[(4_000_000, 1, &[0; 60])]).0;
    fs::write(folder.join("net.pcapng"), ethernet).unwrap();
    let pipe = folder.join("pipe.pcap");
    #[cfg(unix)]
    std::process::Command::new("mkfifo").arg(&pipe).status().unwrap();
    #[cfg(not(unix))]
    fs::write(&pipe, []).unwrap();
    let output = axle(&["decode", "--json", &path]).output().unwrap();
    let [out, error] = [output.stdout, output.stderr].map(|it| String::from_utf8(it).unwrap());
    assert_eq!(output.status.code(), Some(1));
    let names = [
        "c.pcapng",
        "empty.pcapng\" is empty",
        "cut.pcapng.gz",
        "odd.pcap\" is no pcapng or pcap",
        "net.pcapng\": interface 0",
        "pipe.pcap\" is",
    ];
    for name in names {
        assert_eq!(error.matches(name).count(), 1, "{name}: {error}");
    }
    assert_eq!(out.lines().filter(|line| line.contains("\"ping\"")).count(), 9, "{out}");
    for name in ["empty.pcapng", "cut.pcapng.gz", "odd.pcap", "net.pcapng", "pipe.pcap"] {
        fs::remove_file(folder.join(name)).unwrap();
    }
    // Raw bytes have no times, and a folder without captures has nothing.
    fs::write(folder.join("raw.bin"), [0; 8]).unwrap();
    let raw = folder.join("raw.bin");
    let output = axle(&["decode", &path, raw.to_str().unwrap()]).output().unwrap();
    let error = String::from_utf8(output.stderr).unwrap();
    assert!(error.contains("raw.bin\" is no pcapng or pcap"), "{error}");
    let read = *ReadRequest::new(NodeId::N1).as_bytes();
    fs::write(folder.join("bus.pcapng"), PcapNg::new(147, &[(4_000_000, 2, &read)]).0).unwrap();
    let output = axle(&["replay", "--dry-run", &path]).output().unwrap();
    let error = String::from_utf8(output.stderr).unwrap();
    assert!(error.contains("has more than one line"), "{error}");
    let empty = folder.join("empty");
    fs::create_dir(&empty).unwrap();
    let output = axle(&["watch", empty.to_str().unwrap()]).output().unwrap();
    let error = String::from_utf8(output.stderr).unwrap();
    assert!(error.contains("has no files that end in .pcapng"), "{error}");
}

/// A folder of captures, each with these interfaces and one WRITE on each.
fn folder_of(name: &str, captures: &[(&str, &[&str])]) -> String {
    let (folder, path) = set(name);
    fs::remove_dir_all(&folder).unwrap();
    for (number, (name, interfaces)) in captures.iter().enumerate() {
        let path = folder.join(name);
        fs::create_dir_all(path.parent().unwrap()).unwrap();
        let mut file = PcapNg(PcapNg::new(147, &[]).0[..28].to_vec());
        interfaces.iter().for_each(|port| file.named(147, port));
        for (at, _) in interfaces.iter().enumerate() {
            let write = WriteRequest::position(NodeId::N1, Position::new(1, at as i16));
            let micros = (number as u64 + 1) * 1_000_000 + at as u64;
            file.packet(at as u32, (micros, 2, write.as_bytes()));
        }
        fs::write(path, file.0).unwrap();
    }
    path
}

#[test]
fn a_line_is_its_folder_and_its_port_however_both_are_written() {
    let (one, other) = (["/dev/serial/x"], ["/dev/x"]);
    let apart = folder_of("apart", &[("a.pcapng", &one), ("serial/b.pcapng", &other)]);
    let output = axle(&["replay", "--dry-run", &apart]).output().unwrap();
    assert!(String::from_utf8(output.stderr).unwrap().contains("has more than one line"));
    // The order of the interfaces is of no matter.
    let (one, other) = (["ttyS4", "ttyS5"], ["ttyS5", "ttyS4"]);
    let turned = folder_of("turned", &[("a.pcapng", &one), ("b.pcapng", &other)]);
    let (rows, ..) = outcome(axle(&["decode", "--json", &turned]).output().unwrap());
    let interfaces = rows
        .lines()
        .filter_map(|line| serde_json::from_str::<Value>(line).unwrap()["interface"].as_u64());
    assert_eq!(interfaces.collect::<Vec<_>>(), [0, 1, 1, 0]);
}

#[test]
fn one_line_of_several_can_be_chosen() {
    let folder = folder_of("chosen", &[("a.pcapng", &["ttyS4", "ttyS5"])]);
    let file = format!("{folder}/a.pcapng");
    let twice = format!("{folder}/twice.cap");
    fs::write(&twice, [fs::read(&file).unwrap(), fs::read(&file).unwrap()].concat()).unwrap();
    for (path, number, says) in [
        (&file, "2", "has nothing on interface 2"),
        (&twice, "3", "interface 3 is one line with interface 1: choose that"),
    ] {
        for command in [&["replay", "--dry-run"][..], &["watch"]] {
            let chosen = [command, &["--interface", number, path]].concat();
            let (listing, code, error) = outcome(axle(&chosen).output().unwrap());
            assert_eq!((&*listing, code), ("", Some(1)));
            assert!(error.contains(says), "{error}");
        }
    }
    for command in [&["replay", "--dry-run", "--json"][..], &["watch", "--json"]] {
        let (_, code, error) = outcome(axle(&[command, &[&folder]].concat()).output().unwrap());
        assert!(code == Some(1) && error.contains("choose one with --interface"), "{error}");
        let chosen = [command, &["--interface", "1", &folder]].concat();
        let (listing, code, error) = outcome(axle(&chosen).output().unwrap());
        assert!(code == Some(0) && error.is_empty(), "{error}");
        assert!(command[0] == "watch" || listing.contains("\"count\":1"), "{listing}");
    }
}

#[test]
fn frames_in_front_of_a_fault_in_hex_text_are_listed_whether_or_not_the_protocol_is_named() {
    let text: String = pings().concat().iter().map(|byte| format!("{byte:02x}")).collect();
    for options in [&["decode", "--hex", "--json"][..], &["decode", "--hex", "-P", "ucp", "--json"]]
    {
        let (rows, code, error) = outcome(run(options, format!("{text} # end").as_bytes()));
        assert_eq!((rows.matches("\"ping\"").count(), code), (3, Some(1)), "{error}");
        assert!(error.contains("line 1 is not hex text"), "{error}");
    }
}

#[test]
fn times_before_1970_are_impossible_ones() {
    let mut file = PcapNg(PcapNg::new(147, &[]).0[..28].to_vec());
    let offset = (-2_i64).to_le_bytes();
    let body = [&[147, 0, 0, 0, 0, 0, 0, 0, 14, 0, 8, 0][..], &offset, &[0; 4]].concat();
    file.block(1, &body);
    let read = *ReadRequest::new(NodeId::N1).as_bytes();
    for micros in [0, 500_000, 3_000_000] {
        file.packet(0, (micros, 2, &read));
    }
    let (rows, code, error) = outcome(run(&["decode", "--json"], &file.0));
    assert_eq!(code, Some(0));
    assert!(error.contains("2 packets have an impossible time"), "{error}");
    let times = rows.lines().map(|row| serde_json::from_str::<Value>(row).unwrap()["t"].as_f64());
    assert_eq!(times.take(3).collect::<Vec<_>>(), [None, None, Some(1.0)]);
}

#[test]
fn what_is_packed_by_others_is_named() {
    let read = *ReadRequest::new(NodeId::N1).as_bytes();
    for (begin, says) in [
        (&[0x28, 0xB5, 0x2F, 0xFD][..], "packed by zstd"),
        (&[0x34, 0xCD, 0xB2, 0xA1], "a modified pcap file"),
        (&packed(&packed(&read)), "packed twice"),
    ] {
        let file = if says == "packed twice" { begin.to_vec() } else { [begin, &read].concat() };
        let (_, code, error) = outcome(run(&["decode"], &file));
        assert!(code == Some(1) && error.contains(says), "{says}: {error}");
    }
}
