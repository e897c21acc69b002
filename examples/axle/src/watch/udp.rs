//! Sends what is watched as JSON, a datagram for each line of `axle decode --json`: for PlotJuggler
//! and other programs that draw it live.

use std::{
    io,
    net::{Ipv4Addr, Ipv6Addr, SocketAddr, ToSocketAddrs, UdpSocket},
    time::Instant,
};

use super::Watched;
use crate::{
    decode::{self, Sheet, Stream},
    failure::Failure,
    line::QUIET,
    listing::Style,
    pcapng::{Direction, Stamp},
};

/// The sender, if there is one.
pub(super) struct Udp(Option<Sender>);

struct Sender {
    /// As on the command line.
    name: String,
    to: SocketAddr,
    /// Never waited for: what does not fit into its queue is lost, as a datagram may be anywhere.
    socket: UdpSocket,
    stream: Box<dyn Stream>,
    sheet: Sheet,
    stamp: Stamp,
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
        let to = found.into_iter().next().ok_or_else(|| cannot("there is no such host"))?;
        let from: SocketAddr = match to {
            SocketAddr::V4(_) => (Ipv4Addr::UNSPECIFIED, 0).into(),
            SocketAddr::V6(_) => (Ipv6Addr::UNSPECIFIED, 0).into(),
        };
        let socket = UdpSocket::bind(from).and_then(|socket| {
            socket.set_nonblocking(true)?;
            Ok(socket)
        });
        let socket = socket.map_err(|error| cannot(&error.to_string()))?;
        Ok(Self(Some(Sender {
            name: name.clone(),
            to,
            socket,
            stream: decode::stream_of(watched.protocol, Direction::In),
            sheet: Sheet::new(Some(Style::Json)),
            stamp: Stamp::new(),
            heard_at: Instant::now(),
            is_open: false,
            sent: 0,
            lost: None,
        })))
    }

    /// Takes in what has just been received, possibly nothing.
    pub(super) fn take(&mut self, bytes: &[u8]) {
        let Some(sender) = &mut self.0 else { return };
        if !bytes.is_empty() {
            (sender.heard_at, sender.is_open) = (Instant::now(), true);
            let micros = sender.stamp.micros();
            sender.stream.feed(bytes, Some(micros), &mut sender.sheet);
        } else if sender.is_open
            && sender.heard_at.elapsed().as_micros() >= QUIET.as_micros().into()
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

impl Sender {
    /// Sends the lines of the sheet, and empties it.
    fn send(&mut self) {
        let Self { to, socket, sheet, sent, lost, .. } = self;
        for line in sheet.out.0.split(|byte| *byte == b'\n').filter(|line| !line.is_empty()) {
            match (socket.send_to(line, *to), &mut *lost) {
                (Ok(_), _) => *sent += 1,
                (Err(_), Some((count, _))) => *count += 1,
                (Err(error), none) => *none = Some((1, error)),
            }
        }
        sheet.out.0.clear();
    }
}
