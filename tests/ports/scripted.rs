//! A port whose calls are scripted: signals, speeds and bytes that do not leave, which no
//! pseudo-terminal has.

use std::{
    collections::VecDeque,
    io::{self, ErrorKind, Read, Write},
    sync::{Arc, Mutex},
    time::{Duration, Instant},
};

use axlewire::drive::SerialPort;
use embedded_io::{Read as _, ReadReady, Write as _};
use serialport::{ClearBuffer, DataBits, FlowControl, Parity, Result, StopBits};

use crate::motor::in_time;

/// A result for each call; after that, reads and writes time out and nothing is queued.
#[derive(Default)]
struct Script {
    baud: u32,
    reads: VecDeque<io::Result<Vec<u8>>>,
    writes: VecDeque<io::Result<usize>>,
    /// Bytes that are still to be sent, as told call by call; the last one stays.
    queued: Vec<u32>,
    flushes: Arc<Mutex<u32>>,
    /// Whether every other call is interrupted.
    signals_forever: bool,
}

impl Script {
    /// How calls end that have no result of their own.
    fn end(&self) -> ErrorKind {
        if self.signals_forever { ErrorKind::Interrupted } else { ErrorKind::TimedOut }
    }

    fn port(self) -> SerialPort {
        SerialPort::from(Box::new(Scripted(Mutex::new(self))) as Box<dyn serialport::SerialPort>)
    }
}

struct Scripted(Mutex<Script>);

impl Read for Scripted {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let mut script = self.0.lock().unwrap();
        let end = script.end();
        let bytes = script.reads.pop_front().unwrap_or_else(|| Err(end.into()))?;
        buffer[..bytes.len()].copy_from_slice(&bytes);
        Ok(bytes.len())
    }
}

impl Write for Scripted {
    fn write(&mut self, _: &[u8]) -> io::Result<usize> {
        let mut script = self.0.lock().unwrap();
        let end = script.end();
        script.writes.pop_front().unwrap_or_else(|| Err(end.into()))
    }

    fn flush(&mut self) -> io::Result<()> {
        *self.0.lock().unwrap().flushes.lock().unwrap() += 1;
        Ok(())
    }
}

impl serialport::SerialPort for Scripted {
    fn name(&self) -> Option<String> {
        Some("/dev/ttyUSB0".to_owned())
    }

    fn baud_rate(&self) -> Result<u32> {
        Ok(self.0.lock().unwrap().baud)
    }

    fn bytes_to_write(&self) -> Result<u32> {
        let queued = &mut self.0.lock().unwrap().queued;
        Ok(if queued.len() > 1 { queued.remove(0) } else { queued.first().copied().unwrap_or(0) })
    }

    fn timeout(&self) -> Duration {
        Duration::ZERO
    }

    fn set_timeout(&mut self, _: Duration) -> Result<()> {
        Ok(())
    }

    fn bytes_to_read(&self) -> Result<u32> {
        unreachable!("it may be zero for ever")
    }

    // Nothing below is used.
    fn data_bits(&self) -> Result<DataBits> {
        unreachable!()
    }
    fn flow_control(&self) -> Result<FlowControl> {
        unreachable!()
    }
    fn parity(&self) -> Result<Parity> {
        unreachable!()
    }
    fn stop_bits(&self) -> Result<StopBits> {
        unreachable!()
    }
    fn set_baud_rate(&mut self, _: u32) -> Result<()> {
        unreachable!()
    }
    fn set_data_bits(&mut self, _: DataBits) -> Result<()> {
        unreachable!()
    }
    fn set_flow_control(&mut self, _: FlowControl) -> Result<()> {
        unreachable!()
    }
    fn set_parity(&mut self, _: Parity) -> Result<()> {
        unreachable!()
    }
    fn set_stop_bits(&mut self, _: StopBits) -> Result<()> {
        unreachable!()
    }
    fn write_request_to_send(&mut self, _: bool) -> Result<()> {
        unreachable!()
    }
    fn write_data_terminal_ready(&mut self, _: bool) -> Result<()> {
        unreachable!()
    }
    fn read_clear_to_send(&mut self) -> Result<bool> {
        unreachable!()
    }
    fn read_data_set_ready(&mut self) -> Result<bool> {
        unreachable!()
    }
    fn read_ring_indicator(&mut self) -> Result<bool> {
        unreachable!()
    }
    fn read_carrier_detect(&mut self) -> Result<bool> {
        unreachable!()
    }
    fn clear(&self, _: ClearBuffer) -> Result<()> {
        unreachable!()
    }
    fn try_clone(&self) -> Result<Box<dyn serialport::SerialPort>> {
        unreachable!()
    }
    fn set_break(&self) -> Result<()> {
        unreachable!()
    }
    fn clear_break(&self) -> Result<()> {
        unreachable!()
    }
}

fn fails<T>(kind: ErrorKind) -> io::Result<T> {
    Err(kind.into())
}

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
fn a_flush_waits_until_the_system_has_sent_everything_and_then_for_the_uart() {
    let flushes = Arc::default();
    let script =
        Script { queued: vec![9, 9, 4, 0], flushes: Arc::clone(&flushes), ..Script::default() };
    let mut port = script.port();
    port.flush().unwrap();
    assert_eq!(*flushes.lock().unwrap(), 1);
    assert_eq!(port.get_ref().bytes_to_write().unwrap(), 0);
}

#[test]
fn bytes_that_do_not_leave_for_a_second_end_a_flush() {
    let flushes = Arc::default();
    let queued = vec![9, 8, 7];
    let mut port = Script { queued, flushes: Arc::clone(&flushes), ..Script::default() }.port();
    let start = Instant::now();
    let error = in_time(move || port.flush()).unwrap_err();
    assert!(start.elapsed() >= Duration::from_secs(1));
    assert_eq!(error.kind(), ErrorKind::TimedOut);
    assert_eq!(error.to_string(), "7 bytes have waited for a second to be sent");
    // The UART would never become empty.
    assert_eq!(*flushes.lock().unwrap(), 0);
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
    assert_eq!(port.get_mut().name(), port.get_ref().name());
    assert_eq!(port.into_inner().name().as_deref(), Some("/dev/ttyUSB0"));
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
