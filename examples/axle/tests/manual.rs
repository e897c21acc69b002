//! What the tool says about itself: help, completions, man pages, colours, and its README.

mod support;

use std::{fs, path::PathBuf};

use support::{axle, run, stdout};

const README: &str = include_str!("../README.md");

/// The names of all subcommands, from the help.
fn subcommands(of: &[&str]) -> Vec<String> {
    let help = stdout(run(&[of, &["-h"]].concat(), &[]));
    let list = help.split_once("Commands:\n").map(|(_, rest)| rest).unwrap_or_default();
    let names = list.lines().take_while(|line| line.starts_with("  ")).filter_map(|line| {
        // Text that continues from the line before is indented further.
        let is_name = !line.starts_with("   ");
        line.split_whitespace().next().filter(|_| is_name).map(str::to_owned)
    });
    names.filter(|name| name != "help").collect()
}

#[test]
fn there_are_all_subcommands() {
    let names = subcommands(&[]);
    for expected in ["decode", "scan", "spin", "drive", "stop", "ping", "calibrate", "lamp"] {
        assert!(names.iter().any(|name| name == expected), "{expected} is not in {names:?}");
    }
    assert_eq!(subcommands(&["sim"]), ["ikeya", "ikeya-3", "ucp"]);
}

#[test]
fn every_subcommand_has_an_example_in_the_readme() {
    let code: String = README.split("```").skip(1).step_by(2).collect();
    for name in subcommands(&[]) {
        assert!(code.contains(&format!("axle {name} ")), "no example of axle {name}");
    }
}

#[test]
fn the_help_of_every_subcommand_and_the_readme_have_the_same_exit_codes() {
    let help = stdout(run(&["--help"], &[]));
    let (_, table) = help.split_once("Exit codes:\n").expect("a table");
    let rows: Vec<_> = table.lines().map(str::trim).filter(|line| !line.is_empty()).collect();
    assert_eq!(rows.len(), 3);
    for row in &rows {
        let (code, meaning) = row.split_once("  ").unwrap();
        assert!(README.contains(&format!("| {code} | {meaning} |")), "{row} is not in the README");
    }
    let mut helps = vec![];
    for name in subcommands(&[]) {
        for inner in subcommands(&[&name]) {
            // A message of `send` is not a subcommand with an end of its own.
            if name == "sim" {
                helps.push(vec![name.clone(), inner]);
            }
        }
        helps.push(vec![name]);
    }
    for of in helps {
        let args: Vec<_> = of.iter().map(String::as_str).chain(["--help"]).collect();
        let help = stdout(run(&args, &[]));
        assert!(rows.iter().all(|row| help.contains(row)), "{args:?} lacks the exit codes: {help}");
    }
}

#[test]
fn the_same_short_options_mean_the_same_everywhere() {
    let meanings = [
        ("-P", "--protocol"),
        ("-p", "--port"),
        ("-b", "--baud"),
        ("-n", "--node"),
        ("-f", "--for"),
        ("-j", "--json"),
        ("-t", "--time"),
        ("-o", "--output"),
        ("-c", "--count"),
    ];
    let mut seen = 0;
    let mut pages: Vec<Vec<String>> = subcommands(&[]).into_iter().map(|name| vec![name]).collect();
    pages.extend(subcommands(&["sim"]).into_iter().map(|name| vec!["sim".to_owned(), name]));
    for page in pages {
        let args: Vec<_> = page.iter().map(String::as_str).chain(["-h"]).collect();
        let help = stdout(run(&args, &[]));
        for line in help.lines().map(str::trim_start).filter(|line| line.starts_with('-')) {
            for (short, long) in meanings {
                let names: Vec<_> = line.split([' ', ',']).filter(|it| !it.is_empty()).collect();
                let has_short = names.first() == Some(&short);
                let has_long = names.iter().take(2).any(|name| *name == long);
                assert_eq!(has_short, has_long, "{args:?}: {line}");
                seen += u32::from(has_short);
            }
        }
    }
    assert!(seen > 40, "{seen}");
}

#[test]
fn completions_name_the_subcommands_and_options_for_each_shell() {
    for shell in ["bash", "zsh", "fish", "elvish", "powershell"] {
        let script = stdout(run(&["completions", shell], &[]));
        for expected in ["calibrate", "ikeya-3", "no-bias-requests"] {
            assert!(script.contains(expected), "{shell}: no {expected}");
        }
    }
}

#[test]
fn man_pages_are_written_for_the_tool_and_for_every_subcommand() {
    let directory = PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join("man").join("new");
    let _ = fs::remove_dir_all(&directory);
    let path = directory.to_str().unwrap();
    assert_eq!(stdout(run(&["man", path], &[])), "");
    for name in subcommands(&[]) {
        let page = fs::read_to_string(directory.join(format!("axle-{name}.1"))).unwrap();
        assert!(page.contains(".SH SYNOPSIS") && page.contains(&name), "{name}: {page}");
    }
    assert!(directory.join("axle.1").exists());

    let file = support::file("not-a-directory", b"");
    let output = run(&["man", file.to_str().unwrap()], &[]);
    let stderr = String::from_utf8(output.stderr).unwrap();
    assert_eq!(output.status.code(), Some(1));
    assert!(stderr.starts_with("axle: cannot write the man pages to "), "{stderr}");
}

#[test]
fn errors_are_red_where_colours_are_wanted_and_nowhere_else() {
    let stderr = |variables: &[(&str, &str)]| {
        let mut command = axle(&["dcode"]);
        for name in ["NO_COLOR", "CLICOLOR", "CLICOLOR_FORCE"] {
            command.env_remove(name);
        }
        let output = command.envs(variables.iter().copied()).output().unwrap();
        String::from_utf8(output.stderr).unwrap()
    };
    let plain = "axle: unrecognized subcommand 'dcode'; did you mean 'decode'?\n";
    assert_eq!(stderr(&[]), plain, "a pipe");
    assert_eq!(stderr(&[("NO_COLOR", "1"), ("CLICOLOR", "1")]), plain);
    let red = stderr(&[("CLICOLOR_FORCE", "1")]);
    assert!(red.starts_with("\x1b[1m\x1b[31maxle:\x1b[0m unrecognized"), "{red:?}");
}
