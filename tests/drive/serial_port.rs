//! `drive::SerialPort` over a terminal whose calls are scripted. What takes real time is in `ptys`.

use std::{collections::VecDeque, io::ErrorKind, time::Duration};

use embedded_io::{Read as _, ReadReady, Write as _};

use crate::tty::{Script, fails};

#[test]
fn a_port_that_takes_no_byte_has_timed_out_and_may_take_the_next() {
    let writes = [fails(ErrorKind::TimedOut), fails(ErrorKind::WouldBlock), Ok(1)].into();
    let mut port = Script { writes, ..Script::default() }.port();
    assert_eq!(port.write(b"1").unwrap_err().kind(), ErrorKind::TimedOut);
    assert_eq!(port.write(b"1").unwrap_err().kind(), ErrorKind::TimedOut);
    assert_eq!(port.write(b"1").unwrap(), 1);
    // So Windows says it.
    let mut windows = Script { writes: [Ok(0)].into(), ..Script::default() }.port();
    assert_eq!(windows.write(b"1").unwrap_err().kind(), ErrorKind::TimedOut);
    // A write of nothing reaches no port.
    assert_eq!(port.write(b"").unwrap(), 0);
}

#[test]
fn a_write_waits_for_20_ms_at_most_so_that_no_outdated_command_leaves_late() {
    let mut port = Script { writes: [Ok(1)].into(), ..Script::default() }.port();
    port.wait(Duration::from_secs(60)).unwrap();
    assert!(port.get_mut().timeout() > Duration::from_secs(50));
    port.write(b"1").unwrap();
    assert_eq!(port.get_mut().timeout(), Duration::from_millis(20));
    // Nor does a look at what was received wait.
    port.read_ready().unwrap();
    assert_eq!(port.get_mut().timeout(), Duration::ZERO);
    // With that a signal would end a flush.
    port.flush().unwrap();
    assert_eq!(port.get_mut().timeout(), Duration::from_millis(20));
}

#[test]
fn an_end_of_file_and_an_error_mean_that_the_port_has_gone() {
    let reads = [Ok(vec![]), fails(ErrorKind::BrokenPipe)].into();
    let writes = [fails(ErrorKind::BrokenPipe)].into();
    let mut port = Script { reads, writes, ..Script::default() }.port();
    let errors = [
        port.read_ready().unwrap_err(),
        port.read(&mut [0]).unwrap_err(),
        port.write(b"1").unwrap_err(),
    ];
    for error in errors {
        assert!(error.to_string().starts_with("disconnected ("), "{error}");
        assert_ne!(error.kind(), ErrorKind::TimedOut);
    }
}

#[test]
fn a_speed_that_a_uart_would_not_read_is_refused() {
    let port = |baud| Script { baud, ..Script::default() }.port();
    port(115_384).check_baud(115_200).unwrap();
    let error = port(460_800).check_baud(500_000).unwrap_err();
    assert_eq!(error.kind(), ErrorKind::InvalidInput);
    assert_eq!(error.to_string(), "it runs at 460800 bit/s instead of 500000");
}

#[test]
fn what_was_received_is_handed_out_in_pieces_and_in_order() {
    let reads = [Ok((0..200).collect()), Ok(vec![200])].into();
    let mut port = Script { reads, ..Script::default() }.port();
    let (mut bytes, mut chunk) = (Vec::<u8>::new(), [0; 64]);
    while port.read_ready().unwrap() {
        let count = port.read(&mut chunk).unwrap();
        bytes.extend(&chunk[..count]);
    }
    assert_eq!(bytes, (0..=200).collect::<Vec<u8>>());
    assert!(!port.is_pseudo_terminal());
    let text = r#"SerialPort { name: Some("/dev/ttyUSB0"), unread: 0 }"#;
    assert_eq!(format!("{port:?}"), text);
    assert_eq!(port.get_mut().name().as_deref(), Some("/dev/ttyUSB0"));
    assert_eq!(port.into_inner().name().as_deref(), Some("/dev/ttyUSB0"));
}

#[test]
fn a_read_or_write_of_nothing_does_not_touch_the_port() {
    let reads = VecDeque::from([Err(ErrorKind::NotConnected.into())]);
    let writes = VecDeque::from([Err(ErrorKind::NotConnected.into())]);
    let mut port = Script { reads, writes, ..Script::default() }.port();
    assert_eq!(port.read(&mut []).unwrap(), 0);
    assert_eq!(port.write(&[]).unwrap(), 0);
    // Both still fail when they are asked.
    assert!(port.read(&mut [0]).is_err());
    assert!(port.write(&[0]).is_err());
}
