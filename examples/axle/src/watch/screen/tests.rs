//! A page that panics: this program starts itself on a terminal, and looks at what is left of it.

use std::{
    fs::{File, OpenOptions},
    io::Read,
    os::unix::fs::OpenOptionsExt,
    process::{Command, Stdio},
    thread,
};

use rustix::{
    fs::OFlags,
    io::{FdFlags, fcntl_setfd},
    pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt},
};

use super::*;

/// Runs the ignored test of this name on a terminal; returns all that it has written, and whether
/// the settings are as before.
fn on_a_terminal(test: &str) -> (String, bool) {
    let mut ours = File::from(openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY).unwrap());
    fcntl_setfd(&ours, FdFlags::CLOEXEC).unwrap();
    grantpt(&ours).unwrap();
    unlockpt(&ours).unwrap();
    let path = ptsname(&ours, Vec::new()).unwrap().into_string().unwrap();
    let flags = OFlags::NOCTTY.bits() as i32;
    let theirs = OpenOptions::new().read(true).write(true).custom_flags(flags).open(path).unwrap();
    let settings = || format!("{:?}", termios::tcgetattr(&theirs).unwrap());
    let before = settings();
    let end = || Stdio::from(theirs.try_clone().unwrap());
    let mut child = Command::new(std::env::current_exe().unwrap())
        .args(["--ignored", "--exact", "--nocapture", test])
        .env("RUST_BACKTRACE", "0")
        .stdin(end())
        .stdout(end())
        .stderr(end())
        .spawn()
        .unwrap();
    let reader = thread::spawn(move || {
        let (mut text, mut buffer) = (Vec::new(), [0; 4096]);
        while let Ok(count @ 1..) = ours.read(&mut buffer) {
            text.extend(&buffer[..count]);
        }
        String::from_utf8(text).unwrap()
    });
    child.wait().unwrap();
    let is_as_before = settings() == before;
    drop(theirs);
    (reader.join().unwrap(), is_as_before)
}

fn show_something(screen: &Screen) {
    screen.show(Buffer::with_lines(["the page"])).unwrap();
    thread::sleep(Duration::from_millis(100));
}

#[test]
#[ignore = "started by a test below"]
fn panics_with_a_page() {
    let screen = Screen::enter().unwrap();
    show_something(&screen);
    panic!("planted");
}

#[test]
#[ignore = "started by a test below"]
fn panics_in_another_thread() {
    let mut screen = Screen::enter().unwrap();
    let panicked = thread::spawn(|| panic!("planted")).join();
    assert!(panicked.is_err());
    show_something(&screen);
    screen.leave();
    println!("afterwards");
}

#[test]
fn after_a_panic_the_terminal_is_as_before_and_the_message_is_readable() {
    let (text, is_as_before) = on_a_terminal("watch::screen::tests::panics_with_a_page");
    let at = |what: &str| text.find(what).unwrap_or_else(|| panic!("no {what:?} in {text:?}"));
    assert!(is_as_before);
    assert!(at(ansi::ENTER) < at("page") && at("page") < at(ansi::LEAVE), "{text:?}");
    assert!(at(ansi::LEAVE) < at("planted"), "{text:?}");
}

#[test]
fn a_panic_elsewhere_does_not_write_into_the_page() {
    let (text, is_as_before) = on_a_terminal("watch::screen::tests::panics_in_another_thread");
    let at = |what: &str| text.find(what).unwrap_or_else(|| panic!("no {what:?} in {text:?}"));
    assert!(is_as_before);
    assert!(at("page") < at(ansi::LEAVE) && at(ansi::LEAVE) < at("planted"), "{text:?}");
    assert!(at("planted") < at("afterwards"), "{text:?}");
}
