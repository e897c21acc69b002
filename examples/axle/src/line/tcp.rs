//! A serial port behind a TCP server that passes the bytes on as they are, such as ser2net's `raw`.

use std::{
    io::{self, ErrorKind, Read as _, Write as _},
    mem,
    net::{SocketAddr, TcpStream, ToSocketAddrs},
    ops::Range,
    time::{Duration, Instant as Clock},
};

use embedded_io::{ErrorType, Read, ReadReady, Write};

use super::wire::Wire;
use crate::{clock, input::is_telnet};

/// Longest time for a server to accept a connection.
const CONNECT_PATIENCE: Duration = Duration::from_secs(3);

/// Longest time for the connection to accept a part of a frame. After that the role decides again
/// what to send, so that no outdated command leaves late (ruling U16).
const WRITE_PATIENCE: Duration = Duration::from_millis(20);

/// The same, after a connection was lost: a stop may be waiting.
const RECONNECT_PATIENCE: Duration = Duration::from_secs(1);

/// Interval between two attempts to connect again.
const RECONNECT_PERIOD: Duration = Duration::from_millis(50);

/// A connection to `HOST:PORT`. If it is lost, that is an error; what is asked of the port then
/// connects again, so that a stop gets through as soon as the server is back.
pub(super) struct TcpPort {
    address: SocketAddr,
    connection: Connection,
    /// Nothing was received on this connection yet.
    is_new: bool,
    held: [u8; 1024],
    unread: Range<usize>,
}

enum Connection {
    Open(TcpStream),
    /// Why, and when it was last tried to connect.
    Lost(String, Clock),
}

impl TcpPort {
    pub(super) fn connect(address: &str) -> io::Result<Self> {
        let mut failure = io::Error::new(ErrorKind::InvalidInput, "the name has no address");
        for address in address.to_socket_addrs()? {
            match open(&address, CONNECT_PATIENCE) {
                Ok(stream) => {
                    let (connection, is_new) = (Connection::Open(stream), true);
                    let (held, unread) = ([0; 1024], 0..0);
                    return Ok(Self { address, connection, is_new, held, unread });
                }
                Err(error) => failure = error,
            }
        }
        Err(failure)
    }

    /// Whether the server is on this machine.
    pub(super) const fn is_local(&self) -> bool {
        self.address.ip().is_loopback()
    }

    /// Does this with the connection; one that was lost is opened again. `None` if it takes longer
    /// than it may, or a signal came, so that endless signals cannot prolong it.
    fn with<T>(
        &mut self,
        act: impl FnOnce(&mut TcpStream, &mut [u8]) -> io::Result<T>,
    ) -> io::Result<Option<T>> {
        let stream = match &mut self.connection {
            Connection::Open(stream) => stream,
            Connection::Lost(cause, tried_at) => {
                if clock::since(*tried_at) < RECONNECT_PERIOD {
                    return Err(lost(cause));
                }
                let opened = open(&self.address, RECONNECT_PATIENCE);
                *tried_at = clock::now();
                self.connection = Connection::Open(opened.map_err(|_| lost(cause))?);
                self.is_new = true;
                let Connection::Open(stream) = &mut self.connection else { return Ok(None) };
                stream
            }
        };
        let cause = match act(stream, &mut self.held) {
            Ok(done) => return Ok(Some(done)),
            Err(error) => match error.kind() {
                ErrorKind::Interrupted | ErrorKind::TimedOut | ErrorKind::WouldBlock => {
                    return Ok(None);
                }
                ErrorKind::UnexpectedEof => "the server has closed the connection".to_owned(),
                _ => error.to_string(),
            },
        };
        Err(self.close(cause))
    }

    fn close(&mut self, cause: impl Into<String>) -> io::Error {
        let cause = cause.into();
        let failure = lost(&cause);
        self.connection = Connection::Lost(cause, clock::now());
        failure
    }
}

fn open(address: &SocketAddr, patience: Duration) -> io::Result<TcpStream> {
    let stream = TcpStream::connect_timeout(address, patience)?;
    stream.set_nodelay(true)?;
    stream.set_write_timeout(Some(WRITE_PATIENCE))?;
    Ok(stream)
}

fn lost(cause: &str) -> io::Error {
    io::Error::new(ErrorKind::ConnectionAborted, format!("disconnected ({cause})"))
}

impl Wire for TcpPort {
    fn wait(&mut self, patience: Duration) -> io::Result<bool> {
        if !self.unread.is_empty() {
            return Ok(true);
        }
        let received = self.with(|stream, held| {
            let received = if patience.is_zero() {
                stream.set_nonblocking(true)?;
                let received = stream.read(held);
                stream.set_nonblocking(false)?;
                received
            } else {
                stream.set_read_timeout(Some(patience))?;
                stream.read(held)
            };
            match received? {
                0 => Err(ErrorKind::UnexpectedEof.into()),
                count => Ok(count),
            }
        })?;
        let Some(count) = received else { return Ok(false) };
        if mem::take(&mut self.is_new) && is_telnet(self.held.get(..count).unwrap_or_default()) {
            return Err(self.close("it speaks telnet, which changes FF bytes: use a raw TCP port"));
        }
        self.unread = 0..count;
        Ok(true)
    }
}

impl ErrorType for TcpPort {
    type Error = io::Error;
}

impl ReadReady for TcpPort {
    fn read_ready(&mut self) -> io::Result<bool> {
        self.wait(Duration::ZERO)
    }
}

impl Read for TcpPort {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        while self.unread.is_empty() {
            self.wait(Duration::from_millis(50))?;
        }
        let unread = self.held.get(self.unread.clone()).unwrap_or_default();
        let count = unread.len().min(buffer.len());
        buffer.iter_mut().zip(unread).for_each(|(slot, byte)| *slot = *byte);
        self.unread.start += count;
        Ok(count)
    }
}

impl Write for TcpPort {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        let taken = self.with(|stream, _| stream.write(bytes))?;
        taken.ok_or_else(|| ErrorKind::TimedOut.into())
    }

    /// Nothing to wait for: only the server knows when the bytes are on the line.
    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use std::{net::TcpListener, thread};

    use super::*;

    fn pair() -> (TcpPort, TcpStream) {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let address = listener.local_addr().unwrap().to_string();
        let port = thread::spawn(move || TcpPort::connect(&address).unwrap());
        let (stream, _) = listener.accept().unwrap();
        (port.join().unwrap(), stream)
    }

    #[test]
    fn bytes_pass_in_both_directions_and_in_any_pieces() {
        let (mut port, mut server) = pair();
        assert!(port.is_local() && !port.read_ready().unwrap());
        server.write_all(&[1, 2, 3]).unwrap();
        assert!(port.wait(Duration::from_secs(10)).unwrap());
        let mut buffer = [0; 2];
        assert_eq!((port.read(&mut buffer).unwrap(), buffer), (2, [1, 2]));
        assert!(port.read_ready().unwrap());
        assert_eq!((port.read(&mut buffer).unwrap(), buffer[0]), (1, 3));
        assert_eq!(port.write(&[7, 8]).unwrap(), 2);
        server.read_exact(&mut buffer).unwrap();
        assert_eq!(buffer, [7, 8]);
    }

    #[test]
    fn a_server_that_has_gone_is_an_error_and_not_a_silence() {
        let (mut port, mut server) = pair();
        server.write_all(&[9]).unwrap();
        drop(server);
        let mut buffer = [0; 2];
        assert_eq!(port.read(&mut buffer).unwrap(), 1, "what it sent before is not lost");
        let error = port.wait(Duration::from_secs(10)).unwrap_err();
        assert_eq!(error.to_string(), "disconnected (the server has closed the connection)");
        assert!(port.read_ready().is_err() && port.read(&mut buffer).is_err());
    }

    #[test]
    fn a_lost_connection_is_opened_again_by_what_is_asked_next() {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let address = listener.local_addr().unwrap().to_string();
        let mut port = TcpPort::connect(&address).unwrap();
        drop(listener.accept().unwrap());
        assert!(port.wait(Duration::from_secs(10)).is_err());
        // Not at once: a server that closes every connection is not overrun.
        assert!(port.write(&[1]).is_err());
        thread::sleep(RECONNECT_PERIOD);
        assert_eq!(port.write(&[2]).unwrap(), 1);
        let (mut server, mut buffer) = (listener.accept().unwrap().0, [0; 2]);
        assert_eq!((server.read(&mut buffer).unwrap(), buffer[0]), (1, 2));
        server.write_all(&[3]).unwrap();
        assert_eq!((port.read(&mut buffer).unwrap(), buffer[0]), (1, 3));
    }

    #[test]
    fn a_server_that_speaks_telnet_is_refused() {
        let (mut port, mut server) = pair();
        // It offers to suppress "go ahead", and to echo.
        let offers = [0xFF, 0xFB, 3, 0xFF, 0xFB, 1];
        server.write_all(&offers).unwrap();
        let error = port.wait(Duration::from_secs(10)).unwrap_err().to_string();
        assert!(error.contains("it speaks telnet"), "{error}");
        let (mut port, mut server) = pair();
        // In the middle they mean nothing, and negative numbers are none.
        for bytes in [[0xFF, 0xFE, 0xFF, 0xFD, 0xFF, 0xFF], offers] {
            server.write_all(&bytes).unwrap();
            assert!(port.wait(Duration::from_secs(10)).unwrap());
            let mut buffer = [0; 6];
            assert_eq!((port.read(&mut buffer).unwrap(), buffer), (6, bytes));
        }
    }

    #[test]
    fn a_server_that_takes_nothing_ends_a_write_in_time() {
        let (mut port, _server) = pair();
        let error = loop {
            match port.write(&[0; 65_536]) {
                Ok(taken) => assert!(taken > 0),
                Err(error) => break error,
            }
        };
        assert_eq!(error.kind(), ErrorKind::TimedOut);
    }
}
