//! `drive::SerialPort` over a terminal whose calls are scripted: what takes real time.

use std::{
    collections::VecDeque,
    io::ErrorKind,
    sync::Arc,
    time::{Duration, Instant},
};

use embedded_io::{Read as _, ReadReady, Write as _};

use crate::{
    motor::in_time,
    tty::{Script, fails},
};

#[test]
fn a_signal_interrupts_no_call() {
    let interrupted = || fails(ErrorKind::Interrupted);
    let reads = [fails(ErrorKind::Interrupted), Ok(vec![7]), fails(ErrorKind::Interrupted)];
    let writes = [interrupted(), interrupted(), Ok(2)].into();
    let mut port = Script { reads: reads.into(), writes, ..Script::default() }.port();
    assert!(port.read_ready().unwrap());
    let mut byte = [0; 4];
    assert_eq!((port.read(&mut byte).unwrap(), byte[0]), (1, 7));
    assert!(!port.read_ready().unwrap());
    assert_eq!(port.write(b"12").unwrap(), 2);
}

#[test]
fn signals_that_never_end_do_not_keep_a_write_from_returning() {
    let mut port = Script { signals_forever: true, ..Script::default() }.port();
    let written = in_time(move || port.write(b"1"));
    assert_eq!(written.unwrap_err().kind(), ErrorKind::TimedOut);
}

#[test]
fn signals_that_never_end_do_not_keep_a_wait_or_a_look_from_returning() {
    let port = || Script { signals_forever: true, ..Script::default() }.port();
    let start = Instant::now();
    assert!(!in_time(move || port().wait(Duration::from_millis(20))).unwrap());
    assert!(start.elapsed() >= Duration::from_millis(20));
    assert!(!in_time(move || port().read_ready()).unwrap());
}

#[test]
fn a_flush_waits_until_the_system_has_sent_everything_and_then_for_the_uart() {
    let flushes = Arc::default();
    let script =
        Script { queued: vec![9, 9, 4, 0], flushes: Arc::clone(&flushes), ..Script::default() };
    let mut port = script.port();
    port.flush().unwrap();
    assert_eq!(*flushes.lock().unwrap(), 1);
    assert_eq!(port.get_mut().bytes_to_write().unwrap(), 0);
}

#[test]
fn bytes_that_do_not_leave_for_a_second_end_a_flush() {
    let flushes = Arc::default();
    let queued = vec![9, 8, 7];
    let mut port = Script { queued, flushes: Arc::clone(&flushes), ..Script::default() }.port();
    let start = Instant::now();
    let error = in_time(move || port.flush()).unwrap_err();
    assert!((1..9).contains(&start.elapsed().as_secs()), "{:?}", start.elapsed());
    assert_eq!(error.kind(), ErrorKind::TimedOut);
    assert_eq!(error.to_string(), "7 bytes have waited for a second to be sent");
    // The UART would never become empty.
    assert_eq!(*flushes.lock().unwrap(), 0);
}

#[test]
fn a_flush_may_take_longer_than_a_second_while_bytes_leave() {
    let mut port = Script { queued: (0..7000).rev().collect(), ..Script::default() }.port();
    let start = Instant::now();
    in_time(move || port.flush()).unwrap();
    assert!(start.elapsed() > Duration::from_secs(1));
}

#[test]
fn bytes_not_handed_out_yet_are_told_at_once() {
    let reads = VecDeque::from([Ok(vec![1, 2, 3])]);
    let mut port = Script { reads, ..Script::default() }.port();
    let mut one = [0];
    assert_eq!(port.read(&mut one).unwrap(), 1);
    let begin = Instant::now();
    assert!(port.read_ready().unwrap());
    assert!(port.wait(Duration::from_secs(60)).unwrap());
    assert!(begin.elapsed() < Duration::from_secs(30));
    let mut rest = [0; 8];
    assert_eq!((port.read(&mut rest).unwrap(), &rest[..2]), (2, &[2, 3][..]));
    assert!(!port.read_ready().unwrap());
}
