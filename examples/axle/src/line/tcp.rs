//! A serial port behind a TCP server that passes the bytes on as they are, such as ser2net's `raw`.

use std::{
    io::{self, ErrorKind, Read as _, Write as _},
    net::{TcpStream, ToSocketAddrs},
    ops::Range,
    time::Duration,
};

use embedded_io::{ErrorType, Read, ReadReady, Write};

use super::wire::Wire;

/// Longest time for a server to accept a connection.
const CONNECT_PATIENCE: Duration = Duration::from_secs(3);

/// Longest time for the connection to accept a part of a frame. After that the role decides again
/// what to send, so that no outdated command leaves late (ruling U16).
const WRITE_PATIENCE: Duration = Duration::from_millis(20);

/// A connection to `HOST:PORT`.
pub(super) struct TcpPort {
    stream: TcpStream,
    held: [u8; 1024],
    unread: Range<usize>,
}

impl TcpPort {
    pub(super) fn connect(address: &str) -> io::Result<Self> {
        let mut failure = io::Error::new(ErrorKind::InvalidInput, "the name has no address");
        for address in address.to_socket_addrs()? {
            match TcpStream::connect_timeout(&address, CONNECT_PATIENCE) {
                Ok(stream) => {
                    stream.set_nodelay(true)?;
                    stream.set_write_timeout(Some(WRITE_PATIENCE))?;
                    return Ok(Self { stream, held: [0; 1024], unread: 0..0 });
                }
                Err(error) => failure = error,
            }
        }
        Err(failure)
    }

    /// Whether the server is on this machine.
    pub(super) fn is_local(&self) -> bool {
        self.stream.peer_addr().is_ok_and(|peer| peer.ip().is_loopback())
    }

    /// A signal ends the wait, so that endless signals cannot prolong it.
    fn receive(&mut self) -> io::Result<bool> {
        match self.stream.read(&mut self.held) {
            Ok(0) => Err(lost("the server has closed the connection")),
            Ok(count) => {
                self.unread = 0..count;
                Ok(true)
            }
            Err(error) => match error.kind() {
                ErrorKind::Interrupted | ErrorKind::TimedOut | ErrorKind::WouldBlock => Ok(false),
                _ => Err(lost(&error.to_string())),
            },
        }
    }
}

fn lost(cause: &str) -> io::Error {
    io::Error::new(ErrorKind::ConnectionAborted, format!("disconnected ({cause})"))
}

impl Wire for TcpPort {
    fn wait(&mut self, patience: Duration) -> io::Result<bool> {
        if !self.unread.is_empty() {
            return Ok(true);
        }
        if patience.is_zero() {
            self.stream.set_nonblocking(true)?;
            let received = self.receive();
            self.stream.set_nonblocking(false)?;
            return received;
        }
        self.stream.set_read_timeout(Some(patience))?;
        self.receive()
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
        match self.stream.write(bytes) {
            Ok(count) => Ok(count),
            Err(error) => match error.kind() {
                // A signal came, or the time is over, before a byte was taken.
                ErrorKind::Interrupted | ErrorKind::WouldBlock | ErrorKind::TimedOut => {
                    Err(ErrorKind::TimedOut.into())
                }
                _ => Err(lost(&error.to_string())),
            },
        }
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
