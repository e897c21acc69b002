//! Sends what is watched as JSON, a datagram for each line of `axle decode --json`: for PlotJuggler
//! and other programs that draw it live.

use std::{
    io,
    net::{Ipv4Addr, Ipv6Addr, SocketAddr, ToSocketAddrs, UdpSocket},
    time::Instant,
};

use super::args::Watched;
use crate::{
    clock,
    decode::{self, Sheet, Stream},
    failure::Failure,
    line::QUIET,
    listing::Style,
    pcapng::Direction,
};

/// The sender, if there is one.
pub(super) struct Udp(Option<Sender>);

struct Sender {
    /// As on the command line.
    name: String,
    /// Each address of that name: the receiver may listen on one of them alone. Never waited for:
    /// what does not fit into a queue is lost, as a datagram may be anywhere.
    to: Vec<(UdpSocket, SocketAddr)>,
    stream: Box<dyn Stream>,
    sheet: Sheet,
    heard_at: Instant,
    /// Whether bytes have come since the line was quiet.
    is_open: bool,
    sent: u64,
    /// What was not sent, and why the first was not.
    lost: Option<(u64, io::Error)>,
}

impl Udp {
    /// Finds the host of the command line, if there is one.
    pub(super) fn new(watched: &Watched<'_>) -> Result<Self, Failure> {
        let Some(name) = &watched.args.udp else { return Ok(Self(None)) };
        let cannot = |why: &str| Failure::Failed(format!("cannot send to {name:?}: {why}"));
        let found = name.to_socket_addrs().map_err(|error| cannot(&error.to_string()))?;
        let to = open(found).map_err(|error| cannot(&error.to_string()))?;
        Ok(Self(Some(Sender {
            name: name.clone(),
            to,
            stream: decode::stream_of(watched.protocol, Direction::In),
            sheet: Sheet::new(Some(Style::Json)),
            heard_at: clock::now(),
            is_open: false,
            sent: 0,
            lost: None,
        })))
    }

    /// Takes in what has just been received, possibly nothing, and when: microseconds since 1970.
    pub(super) fn take(&mut self, bytes: &[u8], micros: u64) {
        let Some(sender) = &mut self.0 else { return };
        if !bytes.is_empty() {
            (sender.heard_at, sender.is_open) = (clock::now(), true);
            sender.stream.feed(bytes, Some(micros), &mut sender.sheet);
        } else if sender.is_open
            && clock::since(sender.heard_at).as_micros() >= QUIET.as_micros().into()
        {
            // A partial frame has ended (ruling B3).
            sender.is_open = false;
            sender.stream.finish(&mut sender.sheet);
        }
        sender.send();
    }

    /// Sends what is left. Fails if anything was not sent.
    pub(super) fn finish(self) -> Result<(), Failure> {
        let Some(mut sender) = self.0 else { return Ok(()) };
        sender.stream.finish(&mut sender.sheet);
        sender.send();
        let Sender { name, sent, lost, .. } = sender;
        lost.map_or(Ok(()), |(lost, error)| {
            let all = sent + lost;
            let line = format!("{lost} of {all} datagrams to {name:?} were not sent: {error}");
            Err(Failure::Failed(line))
        })
    }
}

/// A socket for each address, but for those of a family that the system does not have.
fn open(found: impl Iterator<Item = SocketAddr>) -> io::Result<Vec<(UdpSocket, SocketAddr)>> {
    let (mut to, mut why) = (Vec::<(UdpSocket, SocketAddr)>::new(), None);
    for address in found {
        let from: SocketAddr = match address {
            SocketAddr::V4(_) => (Ipv4Addr::UNSPECIFIED, 0).into(),
            SocketAddr::V6(_) => (Ipv6Addr::UNSPECIFIED, 0).into(),
        };
        let is_there = to.iter().any(|(_, other)| *other == address);
        match UdpSocket::bind(from) {
            Ok(socket) if !is_there => {
                socket.set_nonblocking(true)?;
                to.push((socket, address));
            }
            Ok(_) => {}
            Err(error) => why = Some(error),
        }
    }
    let none = || why.unwrap_or_else(|| io::Error::other("there is no such host"));
    if to.is_empty() { Err(none()) } else { Ok(to) }
}

/// Sends a datagram to each address; an error if none of them took it.
fn send_to_each(to: &[(UdpSocket, SocketAddr)], line: &[u8]) -> io::Result<()> {
    let mut sent = Ok(());
    let mut is_sent = false;
    for (socket, address) in to {
        match socket.send_to(line, address) {
            Ok(_) => is_sent = true,
            Err(error) => sent = Err(error),
        }
    }
    if is_sent { Ok(()) } else { sent }
}

impl Sender {
    /// Sends the lines of the sheet, and empties it.
    fn send(&mut self) {
        let Self { to, sheet, sent, lost, .. } = self;
        for line in sheet.out.0.split(|byte| *byte == b'\n').filter(|line| !line.is_empty()) {
            match (send_to_each(to, line), &mut *lost) {
                (Ok(()), _) => *sent += 1,
                (Err(_), Some((count, _))) => *count += 1,
                (Err(error), none) => *none = Some((1, error)),
            }
        }
        sheet.out.0.clear();
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_address_of_a_name_is_sent_to_and_one_that_takes_it_is_enough() {
        let receiver = UdpSocket::bind((Ipv4Addr::LOCALHOST, 0)).expect("a socket");
        receiver.set_read_timeout(Some(std::time::Duration::from_secs(5))).expect("a timeout");
        let there = receiver.local_addr().expect("an address");
        // As a resolver gives them: the other family first, and one of them twice.
        let port = there.port();
        let found = [(Ipv6Addr::LOCALHOST, port).into(), there, there];
        let to = open(found.into_iter()).expect("a socket for one of them at least");
        assert_eq!(to.iter().filter(|(_, address)| *address == there).count(), 1);
        send_to_each(&to, b"{}").expect("one has taken it");
        let mut buffer = [0; 8];
        assert_eq!(receiver.recv(&mut buffer).expect("a datagram"), 2);

        // Nobody may send to a broadcast address by default.
        let nowhere = open([(Ipv4Addr::BROADCAST, port).into()].into_iter()).expect("a socket");
        assert!(send_to_each(&nowhere, b"{}").is_err());
        assert!(open(std::iter::empty()).is_err());
    }
}
