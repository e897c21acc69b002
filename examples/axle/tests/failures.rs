//! Every failure gives one clear line on standard error, and an exit code.

mod support;

use std::{
    io::{BufRead, BufReader, Read},
    process::{Output, Stdio},
};

use support::{Capture, axle, file, run, stdout};

/// The single error line of a run that exited with `code` and printed nothing else.
fn complaint(output: Output, code: i32) -> String {
    let stderr = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(code), "{stderr}");
    assert_eq!(String::from_utf8(output.stdout).unwrap(), "");
    let line = stderr.strip_suffix('\n').expect("a whole line");
    assert!(!line.contains('\n'), "more than one line: {stderr}");
    line.strip_prefix("axle: ").expect("the tool's name first").to_owned()
}

#[test]
fn a_wrong_command_line_is_explained_in_one_line() {
    let cases: [(&[&str], &str); 6] = [
        (&["encode"], "unrecognized subcommand 'encode'"),
        (&["decode", "--jobs", "0"], "0 is not in 1..=256"),
        (
            &["decode", "--protocol", "can"],
            "'can' for '--protocol <PROTOCOL>' [possible values: auto, ucp, ikeya, ikeya-3]",
        ),
        (
            &["decode", "--protocol", "ikeya", "--direction", "up"],
            "[possible values: to-slave, to-master]",
        ),
        (
            &["decode", "--protocol", "ucp", "--direction", "to-slave"],
            "--direction is for ikeya and ikeya-3",
        ),
        (&["decode", "--protocol", "ucp", "--jason"], "unexpected argument '--jason'"),
    ];
    for (args, expected) in cases {
        let line = complaint(run(args, &[]), 2);
        assert!(line.contains(expected), "{args:?} gives {line:?}");
        assert!(!line.starts_with("error") && !line.contains("Usage"), "{line:?}");
    }
}

#[test]
fn without_a_subcommand_a_short_help_is_a_usage_error() {
    let output = run(&[], &[]);
    let help = String::from_utf8(output.stderr).unwrap();
    assert_eq!((output.status.code(), &*output.stdout), (Some(2), &b""[..]));
    for expected in ["Usage: axle <COMMAND>", "  decode ", "  ping ", "Exit codes:"] {
        assert!(help.contains(expected), "{expected} is not in {help}");
    }
    assert!(!help.contains('\x1b'), "no colours in a pipe");
}

#[test]
fn help_and_version_are_no_failures() {
    for args in [&["--help"][..], &["decode", "--help"], &["decode", "-h"]] {
        let help = stdout(run(args, &[]));
        assert!(help.contains("Usage: axle"));
        for code in ["0  done", "1  the input", "2  the command line"] {
            assert!(help.contains(code), "exit code {code} is missing in {help}");
        }
    }
    assert_eq!(stdout(run(&["--version"], &[])), concat!("axle ", env!("CARGO_PKG_VERSION"), "\n"));
}

#[test]
fn the_list_of_ports_ends_with_their_number() {
    let lines = stdout(run(&["ports", "--json"], &[]));
    let lines: Vec<_> = lines.lines().collect();
    let expected = format!(r#"{{"event":"summary","ports":{}}}"#, lines.len() - 1);
    assert_eq!(lines.last(), Some(&&*expected));
}

#[test]
fn a_file_that_does_not_exist_is_named() {
    let line = complaint(run(&["decode", "--protocol", "ucp", "no such\nfile"], &[]), 1);
    assert!(line.starts_with(r#"cannot open "no such\nfile": "#), "{line}");
}

#[test]
fn a_folder_without_captures_is_named() {
    let folder = concat!(env!("CARGO_TARGET_TMPDIR"), "/no-captures");
    std::fs::create_dir_all(folder).unwrap();
    let line = complaint(run(&["decode", "--protocol", "ikeya", folder], &[]), 1);
    assert!(line.starts_with(&format!("{folder:?} has no files that end in .pcapng")), "{line}");
}

#[test]
#[cfg(unix)]
fn a_file_that_may_not_be_read_is_named() {
    use std::{
        fs::{self, File, Permissions},
        os::unix::fs::PermissionsExt,
    };

    let path = file("secret.bin", &[0xAA]);
    fs::set_permissions(&path, Permissions::from_mode(0o000)).unwrap();
    if File::open(&path).is_ok() {
        eprintln!("skipped: this user can read everything");
        return;
    }
    let args = ["decode", "--protocol", "ucp", path.to_str().unwrap()];
    let line = complaint(run(&args, &[]), 1);
    assert!(line.contains("secret.bin") && line.contains("ermission"), "{line}");
}

/// A process's own memory opens as a file, but has nothing at offset 0.
#[test]
#[cfg(target_os = "linux")]
fn a_read_error_is_one_line() {
    let line = complaint(run(&["decode", "--protocol", "ucp", "/proc/self/mem"], &[]), 1);
    assert!(line.starts_with(r#"cannot read "/proc/self/mem": "#), "{line}");
}

#[test]
#[cfg(unix)]
fn a_read_error_on_standard_input_is_one_line() {
    let folder = std::fs::File::open(env!("CARGO_TARGET_TMPDIR")).unwrap();
    let output = axle(&["decode", "--protocol", "ucp"]).stdin(folder).output().unwrap();
    let line = complaint(output, 1);
    assert!(line.starts_with("cannot read standard input: "), "{line}");
}

#[test]
#[cfg(target_os = "linux")]
fn a_full_disk_is_one_line() {
    let full = std::fs::File::options().write(true).open("/dev/full").unwrap();
    let path = file("full.bin", &[0x00]);
    let args = ["decode", "--protocol", "ucp", path.to_str().unwrap()];
    let output = axle(&args).stdout(full).output().unwrap();
    let line = complaint(output, 1);
    assert!(line.starts_with("cannot write the output: "), "{line}");
}

#[test]
fn a_reader_that_has_seen_enough_ends_the_run_quietly() {
    // Far more output than fits in a pipe.
    let path = file("closed.bin", &Capture::noisy(1_000_000, 7).bytes);
    for style in [&["--json"][..], &[]] {
        let args = [&["decode", "--protocol", "ucp", path.to_str().unwrap()], style].concat();
        let mut child = axle(&args).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
        let mut line = String::new();
        BufReader::with_capacity(64, child.stdout.take().unwrap()).read_line(&mut line).unwrap();
        assert!(line.contains("offset"), "{line}");

        let mut stderr = String::new();
        child.stderr.take().unwrap().read_to_string(&mut stderr).unwrap();
        assert_eq!((child.wait().unwrap().code(), &*stderr), (Some(0), ""));
    }
}
