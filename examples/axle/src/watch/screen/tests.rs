//! Pages on terminals: this program starts itself on one, and looks at what is left of it.

use std::{
    env,
    fs::{File, OpenOptions},
    io::{Read, Write as _},
    net::TcpListener,
    os::unix::fs::OpenOptionsExt,
    process::{Command, Stdio},
    thread,
};

use axlewire::{encode::Encode, ucp::RawFrame};
use clap::{Args as _, FromArgMatches};
use ratatui_core::style::{Color, Modifier, Style};
use rustix::{
    fs::OFlags,
    io::{FdFlags, fcntl_setfd},
    pty::{OpenptFlags, grantpt, openpt, ptsname, unlockpt},
    termios::{Winsize, tcsetwinsize},
};

use super::*;
use crate::watch;

/// Rows and columns of the terminal.
const SIZE: (u16, u16) = (24, 100);

/// Runs the ignored test of this name on a terminal; returns all that it has written, and whether
/// the settings are as before.
fn on_a_terminal(test: &str) -> (String, bool) {
    prepared_on_a_terminal(test, "", |command| command)
}

/// The same as `prepare` says, and with these keys pressed before it starts.
fn prepared_on_a_terminal(
    test: &str,
    keys: &str,
    prepare: impl FnOnce(&mut Command) -> &mut Command,
) -> (String, bool) {
    let mut ours = File::from(openpt(OpenptFlags::RDWR | OpenptFlags::NOCTTY).unwrap());
    let size = Winsize { ws_row: SIZE.0, ws_col: SIZE.1, ws_xpixel: 0, ws_ypixel: 0 };
    tcsetwinsize(&ours, size).unwrap();
    fcntl_setfd(&ours, FdFlags::CLOEXEC).unwrap();
    grantpt(&ours).unwrap();
    unlockpt(&ours).unwrap();
    let path = ptsname(&ours, Vec::new()).unwrap().into_string().unwrap();
    let flags = OFlags::NOCTTY.bits() as i32;
    let theirs = OpenOptions::new().read(true).write(true).custom_flags(flags).open(path).unwrap();
    let settings = || format!("{:?}", termios::tcgetattr(&theirs).unwrap());
    let before = settings();
    let end = || Stdio::from(theirs.try_clone().unwrap());
    ours.write_all(keys.as_bytes()).unwrap();
    let mut command = Command::new(env::current_exe().unwrap());
    command
        .args(["--ignored", "--exact", "--nocapture", test])
        .env("RUST_BACKTRACE", "0")
        .env("TERM", "xterm")
        .stdin(end())
        .stdout(end())
        .stderr(end());
    prepare(&mut command);
    let mut child = command.spawn().unwrap();
    drop(command);
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

#[test]
#[ignore = "real time"]
fn after_a_panic_the_terminal_is_as_before_and_the_message_is_readable() {
    let (text, is_as_before) = on_a_terminal("watch::screen::tests::started::panics_with_a_page");
    let at = |what: &str| text.find(what).unwrap_or_else(|| panic!("no {what:?} in {text:?}"));
    assert!(is_as_before);
    assert!(at(ansi::ENTER) < at("page") && at("page") < at(ansi::LEAVE), "{text:?}");
    assert!(at(ansi::LEAVE) < at("planted"), "{text:?}");
}

#[test]
#[ignore = "real time"]
fn a_panic_elsewhere_does_not_write_into_the_page() {
    let (text, is_as_before) =
        on_a_terminal("watch::screen::tests::started::panics_in_another_thread");
    let at = |what: &str| text.find(what).unwrap_or_else(|| panic!("no {what:?} in {text:?}"));
    assert!(is_as_before);
    assert!(at("page") < at(ansi::LEAVE) && at(ansi::LEAVE) < at("planted"), "{text:?}");
    assert!(at("planted") < at("afterwards"), "{text:?}");
}

/// What the page showed last.
fn page(text: &str) -> String {
    let mut parser = vt100::Parser::new(SIZE.0, SIZE.1, 0);
    parser.process(text.split(ansi::LEAVE).next().unwrap().as_bytes());
    parser.screen().contents()
}

/// What `axle watch` with these options writes to a terminal; `say` is the other end of its line.
fn watched(
    options: &str,
    keys: &str,
    say: impl FnOnce(&mut dyn Write) + Send + 'static,
    prepare: impl FnOnce(&mut Command) -> &mut Command,
) -> String {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let port = listener.local_addr().unwrap();
    let speaker = thread::spawn(move || {
        let (mut stream, _) = listener.accept().unwrap();
        stream.set_nodelay(true).unwrap();
        say(&mut stream);
        // Until the watch has ended.
        let _ = stream.read(&mut [0]);
    });
    let (text, is_as_before) =
        prepared_on_a_terminal("watch::screen::tests::started::watches", keys, |command| {
            command.env("AXLE_WATCH", format!("watch -p tcp:{port} -P ucp {options}"));
            prepare(command)
        });
    speaker.join().unwrap();
    assert!(is_as_before);
    text
}

#[test]
#[ignore = "real time"]
fn there_is_a_page_on_a_terminal_that_can_show_one_unless_lines_are_wanted() {
    for (options, term, has_page) in [
        ("", "xterm", true),
        ("--plain", "xterm", false),
        ("--json", "xterm", false),
        ("", "dumb", false),
        ("", "", false),
    ] {
        let options = format!("--for 0.05 {options}");
        let text = watched(&options, "", |_| {}, |command| command.env("TERM", term));
        assert_eq!(text.contains(ansi::ENTER), has_page, "{options} {term:?} {text:?}");
        assert!(text.contains("outcome: Ok(())"), "{text:?}");
    }
}

#[test]
#[ignore = "real time"]
fn a_recording_that_cannot_start_is_on_the_page_and_in_the_outcome() {
    // No file can be created there.
    let text = watched("--for 0.5", "r", |_| {}, |command| command.current_dir("/proc"));
    let page = page(&text);
    assert!(page.contains("cannot create \"axle-") && !page.contains("REC"), "{page}");
    assert!(text.contains("outcome: Err(\"cannot create"), "{text:?}");
}

#[test]
#[ignore = "real time"]
fn a_frame_that_comes_while_a_line_is_printed_is_whole() {
    let say = |stream: &mut dyn Write| {
        let (mut buffer, raw) = ([0; 64], RawFrame { id: 0x70, index: 0, body: &[7; 54] });
        let frame = raw.encode(&mut buffer).unwrap();
        thread::sleep(Duration::from_millis(600));
        for byte in frame {
            stream.write_all(&[*byte]).unwrap();
            thread::sleep(Duration::from_millis(12));
        }
    };
    let text = watched("--plain --for 1.7", "", say, |command| command);
    assert!(text.contains("62 in 1 frame\r\n"), "{text:?}");
}

#[test]
#[ignore = "real time"]
fn keys_come_from_a_terminal_only() {
    let tells = "watch::screen::tests::started::tells_whether_it_has_keys";
    assert!(on_a_terminal(tells).0.contains("has keys: true"));
    let (text, _) = prepared_on_a_terminal(tells, "", |command| command.stdin(Stdio::null()));
    assert!(text.contains("has keys: false"), "{text:?}");
}

#[test]
#[ignore = "real time"]
fn the_first_variable_that_is_set_decides_whether_a_terminal_shows_only_ascii() {
    for (values, expected) in [
        ([None, None, None], false),
        ([Some("C"), None, None], true),
        ([Some("C"), None, Some("en_GB.UTF-8")], true),
        ([Some("en_GB.UTF-8"), Some("C"), Some("C")], false),
        ([None, Some("de_DE.utf8"), Some("C")], false),
        ([None, Some("de_DE@euro"), None], true),
        ([Some(""), Some(""), Some("POSIX")], true),
        ([Some(""), None, Some("C.utf8")], false),
    ] {
        let tells = "watch::screen::tests::started::tells_whether_it_is_ascii";
        let (text, _) = prepared_on_a_terminal(tells, "", |command| {
            for (name, value) in ["LC_ALL", "LC_CTYPE", "LANG"].into_iter().zip(values) {
                match value {
                    Some(value) => command.env(name, value),
                    None => command.env_remove(name),
                };
            }
            command
        });
        assert!(text.contains(&format!("is ASCII: {expected}")), "{values:?} {text:?}");
    }
}

#[test]
#[ignore = "real time"]
fn bytes_that_the_page_was_too_slow_for_are_told_once_and_only_if_there_are_some() {
    let (text, _) = on_a_terminal("watch::live::tests::looks_on_too_slowly");
    let page = page(&text);
    assert_eq!(page.matches("too slow").count(), 1, "{page}");
    assert!(page.contains("the page was too slow for 10 bytes"), "{page}");
    assert!(page.contains("a note"), "{page}");
}

#[test]
fn each_colour_of_the_page_is_one_of_the_terminal() {
    for (colour, code) in [
        (Some(Color::Red), 31),
        (Some(Color::Green), 32),
        (Some(Color::Yellow), 33),
        (Some(Color::DarkGray), 90),
        (None, 39),
    ] {
        let mut after = Buffer::empty(Rect::new(0, 0, 1, 1));
        let style = colour.map_or(Style::new(), |colour| Style::new().fg(colour));
        after.set_string(0, 0, "x", style.add_modifier(Modifier::BOLD));
        let text = ansi::change(&Buffer::empty(Rect::new(0, 0, 1, 1)), &after);
        assert_eq!(text, format!("\x1b[1;1H\x1b[0;1;{code}mx"));
    }
}

/// What the tests above start.
mod started {
    use super::*;

    fn show_something(screen: &Screen) {
        screen.show(Buffer::with_lines(["the page"])).unwrap();
        thread::sleep(Duration::from_millis(100));
    }

    #[test]
    #[ignore = "started by tests above"]
    fn watches() {
        let args = watch::Args::augment_args(clap::Command::new("watch"));
        let line = env::var("AXLE_WATCH").unwrap();
        let matches = args.get_matches_from(line.split_whitespace());
        let outcome = watch::run(&watch::Args::from_arg_matches(&matches).unwrap());
        println!("outcome: {:?}", outcome.map_err(|failure| failure.to_string()));
    }

    #[test]
    #[ignore = "started by a test above"]
    fn panics_with_a_page() {
        let screen = Screen::enter().unwrap();
        show_something(&screen);
        panic!("planted");
    }

    #[test]
    #[ignore = "started by a test above"]
    fn panics_in_another_thread() {
        let mut screen = Screen::enter().unwrap();
        let panicked = thread::spawn(|| panic!("planted")).join();
        assert!(panicked.is_err());
        show_something(&screen);
        screen.leave();
        println!("afterwards");
    }

    #[test]
    #[ignore = "started by a test above"]
    fn tells_whether_it_has_keys() {
        let mut screen = Screen::enter().unwrap();
        let has_keys = screen.has_keys();
        screen.leave();
        println!("has keys: {has_keys}");
    }

    #[test]
    #[ignore = "started by a test above"]
    fn tells_whether_it_is_ascii() {
        println!("is ASCII: {}", is_ascii());
    }
}
