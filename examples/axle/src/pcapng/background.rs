//! A recording while something moves, written by a separate thread: a stalled disk must not keep a
//! stop from being sent.

use std::{
    sync::mpsc::{self, Receiver, SyncSender, TrySendError},
    thread,
    time::Duration,
};

use super::{Direction, Recording, recording::Stamp};
use crate::{args::Protocol, failure::Failure};

/// Number of packets that may wait for the disk: more than a second of a full bus.
const QUEUE: usize = 16 * 1024;

/// Time allowed for the disk to take the last packets.
const FAREWELL: Duration = Duration::from_secs(2);

/// Records without ever waiting for the disk.
pub(crate) struct Background {
    /// `None` once it was checked.
    news: Option<SyncSender<News>>,
    /// The failure of the recording, once nothing more is recorded.
    end: Receiver<Result<(), Failure>>,
    stamp: Stamp,
    path: String,
    /// Number of packets for which the disk was too slow.
    lost: u64,
}

enum News {
    Packet(u64, Direction, Box<[u8]>),
    /// What follows is of another line.
    Line(Protocol, Box<str>, u32),
}

impl Background {
    pub(crate) fn new(mut recording: Recording) -> Self {
        let (news, queue) = mpsc::sync_channel(QUEUE);
        let (ended, end) = mpsc::channel();
        let (stamp, path) = (recording.stamp(), recording.path().display().to_string());
        thread::spawn(move || {
            for news in queue {
                match news {
                    News::Packet(micros, direction, bytes) => {
                        recording.packet(micros, Some(direction), &bytes);
                        recording.flush();
                    }
                    News::Line(protocol, port, baud) => {
                        recording.change_line(protocol, &port, baud);
                    }
                }
            }
            // Fails only if the receiver is gone.
            let _ = ended.send(recording.check());
        });
        Self { news: Some(news), end, stamp, path, lost: 0 }
    }

    /// Records what has just been sent or received.
    pub(crate) fn add(&mut self, direction: Direction, bytes: &[u8]) {
        if !bytes.is_empty() {
            self.tell(News::Packet(self.stamp.micros(), direction, bytes.into()));
        }
    }

    /// What follows is of another line.
    pub(crate) fn change_line(&mut self, protocol: Protocol, port: &str, baud: u32) {
        self.tell(News::Line(protocol, port.into(), baud));
    }

    fn tell(&mut self, news: News) {
        let Some(queue) = &self.news else { return };
        if let Err(TrySendError::Full(_)) = queue.try_send(news) {
            self.lost += 1;
        }
    }

    /// Ends the recording, for use while nothing moves; fails if it is incomplete.
    pub(crate) fn check(&mut self) -> Result<(), Failure> {
        if self.news.take().is_none() {
            return Ok(());
        }
        let path = &self.path;
        match self.end.recv_timeout(FAREWELL) {
            Ok(Ok(())) if self.lost == 0 => Ok(()),
            Ok(Err(failure)) => Err(failure),
            Ok(Ok(())) => {
                let line = format!("{path:?} is incomplete: too slow for {} packets", self.lost);
                Err(Failure::Failed(line))
            }
            Err(_) => Err(Failure::Failed(format!("cannot write {path:?}: it has stalled"))),
        }
    }
}

impl Drop for Background {
    fn drop(&mut self) {
        // Another failure is reported already.
        if let Err(failure) = self.check() {
            let _ = failure.report();
        }
    }
}

#[cfg(all(test, unix))]
mod tests {
    use std::{fs::File, io::Read, os::fd::OwnedFd, time::Instant};

    use super::*;
    use crate::pcapng::Reader;

    #[test]
    #[ignore = "real time"]
    fn a_disk_that_stalls_delays_nobody_and_is_told() {
        let (_reader, writer) = std::io::pipe().unwrap();
        let mut recording = Background::new(Recording::to_file(File::from(OwnedFd::from(writer))));
        let start = Instant::now();
        for _ in 0..2 * QUEUE {
            recording.add(Direction::Out, &[0; 8]);
        }
        assert!(start.elapsed() < Duration::from_secs(5), "{:?}", start.elapsed());
        assert!(recording.lost > 0);
        let error = recording.check().unwrap_err();
        assert_eq!(error.to_string(), "cannot write \"file\": it has stalled");
    }

    #[test]
    #[ignore = "real time"]
    fn packets_for_which_the_disk_was_too_slow_are_told_at_the_end() {
        let (mut reader, writer) = std::io::pipe().unwrap();
        let mut recording = Background::new(Recording::to_file(File::from(OwnedFd::from(writer))));
        while recording.lost < 3 {
            recording.add(Direction::Out, &[0; 8]);
        }
        let read = thread::spawn(move || {
            let mut file = Vec::new();
            reader.read_to_end(&mut file).map(|_| file)
        });
        let error = recording.check().unwrap_err().to_string();
        assert_eq!(error, "\"file\" is incomplete: too slow for 3 packets");
        drop(recording);
        assert!(read.join().unwrap().is_ok());
    }

    #[test]
    fn all_packets_are_written_in_their_order_before_the_end() {
        let (mut reader, writer) = std::io::pipe().unwrap();
        let mut recording = Background::new(Recording::to_file(File::from(OwnedFd::from(writer))));
        let read = thread::spawn(move || {
            let mut file = Vec::new();
            reader.read_to_end(&mut file).map(|_| file)
        });
        for at in 0..1000_u32 {
            recording.add(Direction::In, &at.to_le_bytes());
        }
        drop(recording);
        let file = read.join().unwrap().unwrap();
        let mut packets = Reader::new(&file[..]);
        for at in 0..1000_u32 {
            assert_eq!(packets.next().unwrap().unwrap().bytes, at.to_le_bytes());
        }
        assert!(packets.next().unwrap().is_none());
    }
}
