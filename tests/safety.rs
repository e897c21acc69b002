//! Every hazard of the safety page has a test, unless nothing can be done about it: every test that
//! it names exists.

#![cfg(not(target_os = "none"))]

use std::{
    collections::HashSet,
    fs,
    path::{Path, PathBuf},
};

const PAGE: &str = include_str!("../src/safety.md");
const SECURITY: &str = include_str!("../SECURITY.md");

/// All functions below a folder that are tests, and are run.
fn tests_below(folder: &Path, found: &mut HashSet<String>) {
    let entries: Vec<PathBuf> = match fs::read_dir(folder) {
        Ok(entries) => entries.map(|entry| entry.unwrap().path()).collect(),
        // A published crate does not include the tool and the firmware.
        Err(_) => return,
    };
    for path in entries {
        if path.is_dir() && !path.ends_with("target") {
            tests_below(&path, found);
        } else if path.extension().is_some_and(|extension| extension == "rs") {
            let source = fs::read_to_string(&path).unwrap();
            let (mut is_test, mut is_ignored) = (false, false);
            for line in source.lines().map(str::trim) {
                if line.starts_with("#[") {
                    is_test |= line.starts_with("#[test]");
                    is_ignored |= line.starts_with("#[ignore") || line.contains(", ignore");
                } else if let Some(rest) = line.strip_prefix("fn ") {
                    // Inside `proptest!` the attribute is the same.
                    if is_test && !is_ignored {
                        found.extend(rest.split('(').next().map(str::to_owned));
                    }
                    (is_test, is_ignored) = (false, false);
                } else if !line.starts_with("//") {
                    (is_test, is_ignored) = (false, false);
                }
            }
        }
    }
}

/// The rows of the tables of hazards, cell by cell; no text may contain the bar between two cells.
fn rows() -> impl Iterator<Item = Vec<&'static str>> {
    let mut is_table = false;
    let rows = PAGE.lines().filter(move |line| {
        let is_row = is_table && line.starts_with("| ");
        is_table = line.starts_with("| hazard") || is_table && line.starts_with('|');
        is_row
    });
    rows.map(|line| {
        let cells: Vec<_> = line.trim_matches('|').split('|').map(str::trim).collect();
        assert_eq!(cells.len(), 5, "{line}");
        cells
    })
}

#[test]
fn every_test_that_the_safety_page_names_exists() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut tests = HashSet::new();
    tests_below(&root.join("tests"), &mut tests);
    tests_below(&root.join("src"), &mut tests);
    assert!(tests.contains("every_test_that_the_safety_page_names_exists"), "the search is blind");
    let mut named = 0;
    for row in rows() {
        if row[3] == "-" {
            continue;
        }
        for name in row[3].split("<br>") {
            let bare = name.strip_prefix('`').and_then(|name| name.strip_suffix('`'));
            assert!(bare.is_some_and(|bare| tests.contains(bare)), "no test is called {name}");
            named += 1;
        }
    }
    assert!(named > 30, "only {named} tests are named");
}

#[test]
fn every_test_that_the_threat_model_names_exists() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut tests = HashSet::new();
    for folder in ["tests", "src", "examples/axle"] {
        tests_below(&root.join(folder), &mut tests);
    }
    let names =
        SECURITY.split('`').skip(1).step_by(2).filter(|name| name.matches('_').count() >= 2);
    let mut named = 0;
    for name in names.filter(|name| !name.contains(['/', ' ', '.'])) {
        // The tool's tests are not in the package.
        assert!(
            tests.contains(name) || !root.join("examples/axle").exists(),
            "no test is called {name}"
        );
        named += 1;
    }
    assert!(named >= 8, "only {named} tests are named");
}

#[test]
fn every_hazard_has_a_test_and_says_what_remains() {
    let mut count = 0;
    for row in rows() {
        let is_beyond_us = row[2].starts_with("nothing can be done");
        assert_eq!(is_beyond_us, row[3] == "-", "no test: {}", row[0]);
        assert!(row.iter().all(|cell| !cell.is_empty()), "{row:?}");
        count += 1;
    }
    assert!(count >= 25, "{count} hazards");
}
