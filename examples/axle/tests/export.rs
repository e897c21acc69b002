//! `axle export`: exact files, bad input, and nothing half-written. export.py reads MCAP and
//! Parquet back and compares every value.

mod support;

use std::{
    fs,
    path::{Path, PathBuf},
    process::Output,
};

use support::{axle, bytes, pcapng::PcapNg, run};

/// An empty folder.
fn folder(name: &str) -> PathBuf {
    let path = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(format!("export-{name}"));
    let _ = fs::remove_dir_all(&path);
    fs::create_dir(&path).unwrap();
    path
}

/// All names in a folder, hidden ones too.
fn names(folder: &Path) -> Vec<String> {
    let files = fs::read_dir(folder).unwrap();
    let mut names: Vec<_> =
        files.map(|file| file.unwrap().file_name().into_string().unwrap()).collect();
    names.sort();
    names
}

fn capture(name: &str) -> String {
    format!("{}/../captures/{name}", env!("CARGO_MANIFEST_DIR"))
}

/// Exports a file, or standard input for `-`.
fn export(from: &str, input: &[u8], to: &Path, more: &[&str]) -> Output {
    run(&[&["export", from, "-o", to.to_str().unwrap()], more].concat(), input)
}

/// The one line on standard error of a run that failed with this exit code.
fn complaint(output: &Output, code: i32) -> String {
    let stderr = String::from_utf8(output.stderr.clone()).unwrap();
    assert_eq!((output.status.code(), stderr.lines().count()), (Some(code), 1), "{stderr}");
    assert!(output.stdout.is_empty());
    stderr.strip_prefix("axle: ").unwrap().trim_end().to_owned()
}

/// The forms that this build has.
fn forms() -> Vec<&'static str> {
    let mut forms = vec!["csv", "jsonl"];
    forms.extend(cfg!(feature = "mcap").then_some("mcap"));
    forms.extend(cfg!(feature = "parquet").then_some("parquet"));
    forms
}

#[test]
fn csv_is_a_folder_with_a_table_per_message_and_the_units() {
    let folder = folder("csv");
    let to = folder.join("bus.csv");
    let output = export(&capture("ikeya.bin"), &[], &to, &[]);
    let told = support::stdout(output);
    assert!(told.starts_with("        90 bytes received\n        68 in 11 frames\n"), "{told}");
    assert!(told.ends_with(&format!("\nwritten to {to:?}\n")), "{told}");
    assert_eq!(names(&folder), ["bus.csv"]);
    let read = |name: &str| fs::read_to_string(to.join(name)).unwrap();
    let tables = [
        "columns.csv",
        "ikeya.position_response.csv",
        "ikeya.read_request.csv",
        "ikeya.velocity_response.csv",
        "ikeya.write.csv",
        "skipped.csv",
    ];
    assert_eq!(names(&to), tables);
    assert_eq!(
        read("ikeya.position_response.csv"),
        "offset,length,node,count,rotation,bytes\n\
         17,8,3,4096,1,5603001001004878\n\
         66,8,1,426,-12098,5601aa01bed031c9\n"
    );
    let gaps = read("skipped.csv");
    let mut lines = gaps.lines();
    let titles = "offset,length,reason,reasons_header,reasons_length,reasons_id,reasons_crc,";
    assert_eq!(lines.next(), Some(&*format!("{titles}reasons_idle")));
    assert_eq!(lines.next(), Some("12,1,header,,,,,"));
    let columns = read("columns.csv");
    assert!(columns.starts_with("table,column,unit,type\n"), "{columns}");
    for line in [
        "ikeya.position_response,offset,byte,u64",
        "ikeya.position_response,count,1/8192 turn,i16",
        "ikeya.velocity_response,rps,1/s,f32",
        "ikeya.write,mode,none,name",
        "skipped,reasons_crc,byte,u64",
    ] {
        assert!(columns.lines().any(|found| found == line), "{line}");
    }
}

#[test]
fn a_capture_with_times_has_columns_of_time_interface_and_direction() {
    let folder = folder("times");
    let (answer, write) = (bytes("5501cdcccc3d5b9c"), bytes("bb01000000008518"));
    let packets = [(9, 1, &answer[..]), (1_000_008, 2, &write[..]), (1_000_009, 0, &[1, 2][..])];
    let from = folder.join("bus.pcapng");
    fs::write(&from, PcapNg::new(147, &packets).0).unwrap();
    let to = folder.join("bus.csv");
    support::stdout(export(from.to_str().unwrap(), &[], &to, &[]));
    let read = |name: &str| fs::read_to_string(to.join(name)).unwrap();
    assert_eq!(
        read("ikeya.velocity_response.csv"),
        "offset,t,interface,direction,length,node,rps,bytes\n\
         0,0.000009,0,in,8,1,0.1,5501cdcccc3d5b9c\n"
    );
    let gaps = read("skipped.csv");
    assert!(gaps.contains("\n0,1.000009,0,,2,header,,,,,\n"), "{gaps}");
}

#[test]
fn json_lines_are_those_of_decode() {
    let folder = folder("jsonl");
    for (name, args) in [("ucp.bin", &[][..]), ("ikeya.bin", &["-P", "ikeya"])] {
        let (from, to) = (capture(name), folder.join(format!("{name}.jsonl")));
        support::stdout(export(&from, &[], &to, args));
        let listing = support::stdout(run(&[&["decode", "--json", &from], args].concat(), &[]));
        assert_eq!(fs::read_to_string(to).unwrap(), listing, "{name}");
    }
}

#[test]
fn standard_input_is_exported_too() {
    let folder = folder("stdin");
    let input = fs::read(capture("ucp.bin")).unwrap();
    for form in forms() {
        let to = folder.join(format!("out.{form}"));
        support::stdout(export("-", &input, &to, &[]));
        assert!(to.exists());
    }
}

#[test]
fn mcap_and_parquet_begin_and_end_with_their_magic() {
    let folder = folder("magic");
    for (form, file, magic) in
        [("mcap", "", &b"\x89MCAP0\r\n"[..]), ("parquet", "ucp.report.parquet", b"PAR1")]
    {
        let to = folder.join(format!("out.{form}"));
        let output = export(&capture("ucp.bin"), &[], &to, &[]);
        if !forms().contains(&form) {
            let line = format!("this axle was built without the feature {form}: build it with");
            assert_eq!(complaint(&output, 2), format!("{line} --features {form}"));
            assert!(!to.exists());
            continue;
        }
        support::stdout(output);
        let written = fs::read(to.join(file).to_str().unwrap().trim_end_matches('/')).unwrap();
        assert!(written.starts_with(magic) && written.ends_with(magic), "{form}");
    }
}

#[test]
fn another_extension_is_a_usage_error() {
    let folder = folder("extension");
    for name in ["out", "out.txt", "out.csv.gz", "mcap"] {
        let to = folder.join(name);
        let line = complaint(&export(&capture("ucp.bin"), &[], &to, &[]), 2);
        assert_eq!(line, format!("{to:?} does not end in .csv, .jsonl, .mcap or .parquet"));
    }
    for name in [".csv", ".JSONL"] {
        let line = complaint(&export(&capture("ucp.bin"), &[], Path::new(name), &[]), 2);
        assert_eq!(line, format!("{name:?} is an extension without a name: use out{name}"));
    }
    let to = folder.join("out.jsonl/");
    let line = complaint(&export(&capture("ucp.bin"), &[], &to, &[]), 2);
    assert_eq!(line, format!("{to:?} is the name of a folder, not of a file"));
    assert!(names(&folder).is_empty());
}

#[test]
fn the_capture_itself_is_never_replaced() {
    let folder = folder("itself");
    let bytes = fs::read(capture("ucp.bin")).unwrap();
    let mut pictures = vec![];
    pictures.extend(cfg!(feature = "plot").then_some("svg"));
    for form in forms().into_iter().chain(pictures) {
        let to = folder.join(format!("in.{form}"));
        let is_folder = ["csv", "parquet"].contains(&form);
        let from = if is_folder { to.join("in.bin") } else { to.clone() };
        if is_folder {
            support::stdout(export(&capture("ucp.bin"), &[], &to, &[]));
        }
        fs::write(&from, &bytes).unwrap();
        let command = if form == "svg" { "plot" } else { "export" };
        let [from_text, to_text] = [&from, &to].map(|path| path.to_str().unwrap());
        let what = if is_folder { "contains the capture itself" } else { "is the capture itself" };
        let says = format!("{:?} {what}: choose another name", to);
        for more in [&[][..], &["--force"]] {
            let args = [&[command, from_text, "-o", to_text], more].concat();
            assert_eq!(complaint(&run(&args, &[]), 2), says);
        }
        assert_eq!(fs::read(&from).unwrap(), bytes);
    }
}

#[test]
fn a_protocol_that_was_named_and_is_not_that_of_the_capture_is_told() {
    let folder = folder("named");
    let to = folder.join("out.jsonl");
    let noise = PcapNg::new(147, &[(1, 1, &[7; 60])]).0;
    let line = complaint(&export("-", &noise, &to, &["-P", "ucp"]), 1);
    assert_eq!(line, "no frame in 60 bytes as ucp: without --protocol, the capture says it");
}

/// One line, exit code 1, and no file or folder is left.
#[test]
fn bad_input_leaves_nothing_behind() {
    let folder = folder("bad");
    let ucp = fs::read(capture("ucp.bin")).unwrap();
    let of_other = PcapNg::new(1, &[(1, 1, &[0; 60])]).0;
    let quiet = PcapNg::new(150, &[]).0;
    let noisy = PcapNg::new(150, &[(1, 1, &[7; 60])]).0;
    let cases: [(&[u8], &[&str], &str); 7] = [
        (&of_other, &[], "interface 0 (\"tty0\") has link type 1, not one of axle's"),
        (&quiet, &[], "the capture is empty"),
        (&noisy, &[], "no frame in 60 bytes: use --protocol if it is another one"),
        (&[], &[], "the capture is empty"),
        (&[], &["-P", "ucp"], "the capture is empty"),
        (&[7; 99], &[], "no frame of any protocol in the first 99 bytes"),
        (&ucp, &["-P", "ikeya"], "no ikeya frame in 405 bytes, but 15 of ucp: use --protocol ucp"),
    ];
    for (input, args, says) in cases {
        for form in forms() {
            let to = folder.join(format!("out.{form}"));
            let line = complaint(&export("-", input, &to, args), 1);
            assert!(line.starts_with(says), "{form}: {line}, not {says}");
            assert_eq!(names(&folder), [""; 0], "{form}: {says}");
        }
    }
    for form in forms() {
        let to = folder.join(format!("out.{form}"));
        let line = complaint(&export(folder.to_str().unwrap(), &[], &to, &[]), 1);
        assert!(
            line.starts_with(&format!("{folder:?} has no files that end in .pcapng")),
            "{line}"
        );
        let line = complaint(&export("/no/such/file", &[], &to, &[]), 1);
        assert!(line.starts_with("cannot open \"/no/such/file\": "), "{line}");
        let nowhere = folder.join("nowhere").join(format!("out.{form}"));
        let line = complaint(&export(&capture("ucp.bin"), &[], &nowhere, &[]), 1);
        assert!(line.starts_with(&format!("cannot create {nowhere:?}: ")), "{line}");
    }
    assert!(names(&folder).is_empty());
}

#[test]
fn what_is_before_the_end_of_a_recording_that_was_cut_is_exported_and_it_is_said() {
    let folder = folder("cut");
    let ucp = fs::read(capture("ucp.bin")).unwrap();
    let whole = PcapNg::new(150, &[(1, 1, &ucp[..]), (2, 1, &ucp[..])]).0;
    let cut = &whole[..whole.len() - 9];
    for form in forms() {
        let to = folder.join(format!("out.{form}"));
        let output = export("-", cut, &to, &[]);
        let line = String::from_utf8(output.stderr).unwrap();
        let says = "axle: \"standard input\": the file ends inside the pcapng block at byte 512; what \
                    is before that was taken\n";
        assert_eq!((output.status.code(), &*line), (Some(1), says), "{form}");
        assert!(to.exists(), "{form}");
        if form == "jsonl" {
            let lines = fs::read_to_string(&to).unwrap();
            assert!(lines.lines().count() > 20, "{lines}");
        }
    }
}

#[test]
fn what_is_there_is_not_overwritten_without_force() {
    let folder = folder("there");
    for form in forms() {
        let to = folder.join(format!("out.{form}"));
        let from = capture("ucp.bin");
        support::stdout(export(&from, &[], &to, &[]));
        let line = complaint(&export(&from, &[], &to, &[]), 1);
        let says = format!("cannot create {to:?}: ");
        assert!(line.starts_with(&says), "{line}");
        assert!(line.ends_with(": remove it first, or choose another name"), "{line}");
        // Of the other protocol, so that it shows which of the two is there.
        support::stdout(export(&capture("ikeya.bin"), &[], &to, &["--force"]));
        if to.is_dir() {
            assert!(names(&to).contains(&"skipped.csv".replace("csv", form)));
            assert!(names(&to).iter().all(|name| !name.contains("ucp")), "{:?}", names(&to));
        } else {
            let written = fs::read(&to).unwrap();
            assert!(String::from_utf8_lossy(&written).contains("read_request"));
        }
        // A failure leaves what was there.
        complaint(&export(&from, &[], &to, &["--force", "-P", "ikeya"]), 1);
        assert!(to.exists());
    }
    let mut expected: Vec<_> = forms().iter().map(|form| format!("out.{form}")).collect();
    expected.sort();
    assert_eq!(names(&folder), expected);
}

#[test]
fn with_force_no_other_kind_of_thing_is_replaced() {
    let folder = folder("kinds");
    for form in forms() {
        let to = folder.join(format!("out.{form}"));
        let force = |says: &str| {
            let line = complaint(&export(&capture("ucp.bin"), &[], &to, &["--force"]), 1);
            assert_eq!(line, format!("cannot create {to:?}: {says}"));
        };
        if ["csv", "parquet"].contains(&form) {
            fs::write(&to, "a file").unwrap();
            force("it exists and is not a folder");
            assert_eq!(fs::read(&to).unwrap(), b"a file");
            fs::remove_file(&to).unwrap();
            fs::create_dir(&to).unwrap();
            fs::write(to.join("thesis.odt"), "years of work").unwrap();
            force("it has no columns.csv, so it is no export");
            assert_eq!(names(&to), ["thesis.odt"]);
            fs::write(to.join("columns.csv"), "name,value\n").unwrap();
            force("columns.csv in it is not of an export");
            fs::write(to.join("columns.csv"), "table,column,unit,type\nucp.ping,id,none,u8\n")
                .unwrap();
            force("\"thesis.odt\" in it is not of an export");
            fs::remove_file(to.join("thesis.odt")).unwrap();
            for name in ["results", "ucp.pong", "ucp.ping.csv"] {
                fs::write(to.join(format!("{name}.{form}")), "years of work").unwrap();
                force(&format!("\"{name}.{form}\" in it is not of an export"));
                fs::remove_file(to.join(format!("{name}.{form}"))).unwrap();
            }
            fs::create_dir(to.join(format!("ucp.ping.{form}"))).unwrap();
            force(&format!("\"ucp.ping.{form}\" in it is not of an export"));
        } else {
            fs::create_dir(&to).unwrap();
            force("it exists and is not a file");
            assert!(to.is_dir());
        }
    }
    assert_eq!(names(&folder).len(), forms().len());
}

#[test]
fn a_packet_with_an_impossible_time_has_none_and_it_is_said() {
    let folder = folder("late");
    let read = bytes("aa01bed0");
    let late = PcapNg::new(147, &[(5, 1, &read[..]), (u64::MAX, 1, &read[..])]).0;
    let listing = String::from_utf8(run(&["decode", "--json"], &late).stdout).unwrap();
    let (events, _) = support::events(&listing);
    assert_eq!(events[0]["t"].as_f64(), Some(5e-6));
    assert!(events[1].get("t").is_none_or(serde_json::Value::is_null), "{}", events[1]);
    for form in forms() {
        let output = export("-", &late, &folder.join(format!("out.{form}")), &[]);
        let said = String::from_utf8_lossy(&output.stderr).into_owned();
        let says =
            "axle: 1 packet has an impossible time, which is left out: the first is packet 2\n";
        assert_eq!((output.status.code(), &*said), (Some(0), says), "{form}");
    }
}

#[cfg(feature = "parquet")]
#[test]
fn parquet_of_a_folder_has_a_file_per_table_day_and_line_and_is_replaced_as_a_whole() {
    const DAY_US: u64 = 86_400_000_000;
    let folder = folder("fleet");
    let read = bytes("aa01bed0");
    // An impossible time is none: that packet is in the day of the one before it.
    for (rover, times) in [("a/b", &[0, DAY_US, 1][..]), ("工場", &[DAY_US - 1, u64::MAX])] {
        let packets: Vec<_> = times.iter().map(|at| (*at, 1, &read[..])).collect();
        fs::create_dir_all(folder.join("in").join(rover)).unwrap();
        fs::write(folder.join("in").join(rover).join("x.pcapng"), PcapNg::new(147, &packets).0)
            .unwrap();
    }
    let from = folder.join("in");
    let to = folder.join("out.parquet");
    let table = to.join("ikeya.read_request.parquet");
    for more in [&[][..], &["--force"]] {
        let output = export(from.to_str().unwrap(), &[], &to, more);
        assert_eq!(output.status.code(), Some(0), "{output:?}");
        let mut found = Vec::new();
        for day in names(&table) {
            for line in names(&table.join(&day)) {
                let files = names(&table.join(&day).join(&line)).len();
                found.push(format!("{day}/{line}: {files}"));
            }
        }
        let expected = [
            "day=1970-01-01/line=a%2Fb%2Ftty0: 1",
            "day=1970-01-01/line=工場%2Ftty0: 1",
            "day=1970-01-02/line=a%2Fb%2Ftty0: 1",
        ];
        assert_eq!(found, expected);
        assert_eq!(names(&to), ["columns.csv", "ikeya.read_request.parquet"]);
    }
    // What is not of an export stays.
    for foreign in ["x.odt", "day=1970-01-01/x", "day=1970-01-01/line=工場%2Ftty0/x.parquet"] {
        fs::write(table.join(foreign), "years of work").unwrap();
        let line = complaint(&export(from.to_str().unwrap(), &[], &to, &["--force"]), 1);
        assert!(
            line.ends_with("\"ikeya.read_request.parquet\" in it is not of an export"),
            "{line}"
        );
        fs::remove_file(table.join(foreign)).unwrap();
    }
    // A folder of one capture is one, too; a file is none.
    let one = folder.join("in/工場");
    assert!(export(one.to_str().unwrap(), &[], &to, &["--force"]).status.success());
    assert_eq!(names(&table.join("day=1970-01-01")), ["line=tty0"]);
    let file = one.join("x.pcapng");
    assert!(export(file.to_str().unwrap(), &[], &to, &["--force"]).status.success());
    assert!(table.is_file());
}

#[cfg(unix)]
mod unix {
    use std::{
        io::Write,
        process::{Command, Stdio},
        thread,
        time::{Duration, Instant},
    };

    use super::*;

    /// A disk without room: the system limits the length of a file in the same way.
    #[test]
    fn a_full_disk_leaves_nothing_behind() {
        let folder = folder("full");
        let input = folder.join("long.bin");
        fs::write(&input, fs::read(capture("ucp.bin")).unwrap().repeat(2000)).unwrap();
        for form in forms() {
            let to = folder.join(format!("out.{form}"));
            let mut limited = Command::new("bash");
            let program = env!("CARGO_BIN_EXE_axle");
            limited.args(["-c", "ulimit -f 16; exec \"$0\" \"$@\"", program, "export"]);
            let output = limited.arg(&input).arg("-o").arg(&to).output().unwrap();
            let line = complaint(&output, 1);
            assert!(line.starts_with(&format!("cannot write {to:?}: ")), "{line}");
            assert!(line.contains("File too large"), "{line}");
            assert!(line.ends_with("; nothing was kept"), "{line}");
            assert_eq!(names(&folder), ["long.bin"], "{form}");
        }
    }

    /// While it reads, and while it waits for a pipe that says nothing.
    #[test]
    fn a_signal_leaves_nothing_behind() {
        let folder = folder("signal");
        let block = fs::read(capture("ucp.bin")).unwrap().repeat(100);
        for (form, is_busy) in forms().into_iter().flat_map(|form| [(form, true), (form, false)]) {
            let to = folder.join(format!("out.{form}"));
            let mut child = axle(&["export", "-P", "ucp", "-", "-o", to.to_str().unwrap()])
                .stdin(Stdio::piped())
                .stderr(Stdio::piped())
                .stdout(Stdio::piped())
                .spawn()
                .unwrap();
            let mut stdin = child.stdin.take().unwrap();
            stdin.write_all(&block).unwrap();
            let start = Instant::now();
            while names(&folder).is_empty() && start.elapsed() < Duration::from_secs(300) {
                thread::sleep(Duration::from_millis(5));
            }
            assert_eq!(names(&folder).len(), 1, "{form}: it was written beside");
            assert!(names(&folder)[0].starts_with(&format!(".out.{form}.")));
            let kill = Command::new("kill").args(["-INT", &child.id().to_string()]).status();
            assert!(kill.unwrap().success());
            while is_busy && stdin.write_all(&block).is_ok() {}
            let output = child.wait_with_output().unwrap();
            assert_eq!(complaint(&output, 1), "interrupted: nothing was written", "{form}");
            assert!(names(&folder).is_empty(), "{form}: {:?}", names(&folder));
        }
    }

    #[test]
    fn a_file_behind_a_link_is_replaced_and_not_the_link() {
        let folder = folder("link");
        let (file, link) = (folder.join("real.jsonl"), folder.join("link.jsonl"));
        fs::write(&file, "old").unwrap();
        std::os::unix::fs::symlink(&file, &link).unwrap();
        complaint(&export(&capture("ucp.bin"), &[], &link, &[]), 1);
        support::stdout(export(&capture("ucp.bin"), &[], &link, &["--force"]));
        assert!(fs::symlink_metadata(&link).unwrap().is_symlink());
        assert!(fs::read_to_string(&file).unwrap().starts_with("{\"event\":\"protocol\""));
    }

    #[test]
    fn a_capture_under_another_name_is_not_replaced_either() {
        let folder = folder("other-name");
        let (from, link) = (folder.join("in.bin"), folder.join("in.jsonl"));
        let hard = folder.join("hard.jsonl");
        fs::copy(capture("ucp.bin"), &from).unwrap();
        std::os::unix::fs::symlink(&from, &link).unwrap();
        fs::hard_link(&from, &hard).unwrap();
        for to in [&link, &hard] {
            let line = complaint(&export(from.to_str().unwrap(), &[], to, &["--force"]), 2);
            assert!(line.ends_with(" is the capture itself: choose another name"), "{line}");
            let mut stdin = axle(&["export", "-", "--force", "-o", to.to_str().unwrap()]);
            let line = complaint(&stdin.stdin(fs::File::open(&from).unwrap()).output().unwrap(), 2);
            assert!(line.ends_with(" is the capture itself: choose another name"), "{line}");
        }
        assert_eq!(fs::read(from).unwrap(), fs::read(capture("ucp.bin")).unwrap());
    }

    #[test]
    fn what_is_replaced_keeps_its_mode() {
        use std::os::unix::fs::PermissionsExt;

        let folder = folder("mode");
        for form in forms() {
            let to = folder.join(format!("out.{form}"));
            support::stdout(export(&capture("ucp.bin"), &[], &to, &[]));
            let private = if to.is_dir() { 0o700 } else { 0o600 };
            fs::set_permissions(&to, PermissionsExt::from_mode(private)).unwrap();
            support::stdout(export(&capture("ikeya.bin"), &[], &to, &["--force"]));
            assert_eq!(fs::metadata(&to).unwrap().permissions().mode() & 0o777, private, "{form}");
        }
    }
}
