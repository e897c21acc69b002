//! The progress bar of `axle decode`.

use std::process::Command;

use axlewire::ucp::{Body, message::Ping};

use super::support::{file, terminal::Terminal};

#[test]
fn the_progress_bar_fits_into_60_columns() {
    let frame = Ping {}.frame(7);
    let path = file("progress.bin", &frame.as_bytes().repeat(1_500_000));
    // The listing does not go to the terminal, so that the bar can.
    let command = format!("{} decode {} > /dev/null", env!("CARGO_BIN_EXE_axle"), path.display());
    let mut terminal = Terminal::spawn(Command::new("sh").args(["-c", &command]), (60, 10));
    let bar = terminal.row(" of ");
    assert!(bar.trim_end().ends_with(" left"), "{bar:?}");
    assert!(bar.contains('[') && bar.chars().count() <= 60, "{bar:?}");
    assert_eq!(terminal.code(), Some(0));
    std::fs::remove_file(&path).unwrap();
}

#[test]
fn a_file_up_to_8_mib_is_decoded_without_a_progress_bar() {
    for (len, has_bar) in [(8 << 20, false), ((8 << 20) + 1, true)] {
        let path = file("short.bin", &vec![0; len]);
        let command = format!(
            "{} decode --protocol ucp {} > /dev/null; echo done",
            env!("CARGO_BIN_EXE_axle"),
            path.display()
        );
        let mut terminal = Terminal::spawn(Command::new("sh").args(["-c", &command]), (80, 10));
        terminal.row("done");
        assert_eq!(terminal.has_had(" of 8.00 MiB ["), has_bar, "{len}");
        assert_eq!(terminal.code(), Some(0));
        std::fs::remove_file(&path).unwrap();
    }
}
