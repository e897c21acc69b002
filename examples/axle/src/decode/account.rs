//! The account of a whole file with several threads: each reads its own parts.
//!
//! Part *k* begins at the first place to split ([`split_point`](stream::split_point)) behind *k*
//! times the length of a part. Each thread finds both ends of its parts independently: whether
//! a position is a split point depends only on the bytes around it.

use std::{
    fs::File,
    io,
    sync::{
        Mutex,
        atomic::{AtomicU64, Ordering},
    },
    thread,
};

use axlewire::stream::{self, Counters, Frames, Framing};

/// Length of a part: it stays in a processor's own cache between reading and decoding.
const PART: usize = 256 * 1024;

/// How far after its nominal start or end a part may actually start or end.
const SLACK: usize = 16 * 1024;

/// The account of a file of `len` bytes, its end included. `None` if it is short, if it cannot be
/// read, or if it has no split point where one is needed: then one thread has to do it.
pub(super) fn of_file<F: Framing>(file: &File, len: u64, jobs: usize) -> Option<Counters> {
    let parts = len / PART as u64;
    if parts < 2 {
        return None;
    }
    let (next, sum) = (AtomicU64::new(0), Mutex::new(Some(Counters::default())));
    thread::scope(|scope| {
        for _ in 0..jobs {
            scope.spawn(|| {
                let mut bytes = vec![0; F::MAX_LEN + PART + SLACK];
                loop {
                    let part = next.fetch_add(1, Ordering::Relaxed);
                    if part >= parts {
                        return;
                    }
                    let end = (part + 1 < parts).then_some((part + 1) * PART as u64);
                    let found = account::<F>(file, part * PART as u64, end, len, &mut bytes);
                    let Ok(mut sum) = sum.lock() else { return };
                    match (found, &mut *sum) {
                        (Some(found), Some(sum)) => *sum += found,
                        // The others can stop.
                        (None, sum) => {
                            *sum = None;
                            next.store(parts, Ordering::Relaxed);
                        }
                        (Some(_), None) => {}
                    }
                }
            });
        }
    });
    sum.into_inner().ok().flatten()
}

/// The account from the first split point after `begin` to the first after `end`, or to the end of
/// the file.
fn account<F: Framing>(
    file: &File,
    begin: u64,
    end: Option<u64>,
    len: u64,
    buffer: &mut Vec<u8>,
) -> Option<Counters> {
    // The bytes before a position tell whether it is a split point.
    let from = begin.saturating_sub(F::MAX_LEN as u64);
    let to = end.map_or(len, |end| (end + SLACK as u64).min(len));
    buffer.resize((to - from) as usize, 0);
    read_at(file, buffer, from).ok()?;
    let place = |at: u64| stream::split_point::<F>(buffer, (at - from) as usize);
    let first = if begin == 0 { 0 } else { place(begin)? };
    let last = match end {
        Some(end) => place(end)?,
        None => buffer.len(),
    };
    // Only the end of the file cuts a candidate off.
    Some(of_bytes::<F>(buffer.get(first..last)?))
}

/// The account of these bytes, behind which nothing follows (ruling B3).
pub(super) fn of_bytes<F: Framing>(bytes: &[u8]) -> Counters {
    let mut frames = Frames::<F>::new(bytes);
    frames.each(|_| {});
    while !frames.rest().is_empty() {
        frames.idle();
        frames.each(|_| {});
    }
    frames.counters()
}

/// Fills `bytes` from this offset.
fn read_at(file: &File, bytes: &mut [u8], offset: u64) -> io::Result<()> {
    #[cfg(unix)]
    return std::os::unix::fs::FileExt::read_exact_at(file, bytes, offset);
    #[cfg(not(any(unix, windows)))]
    return Err(io::ErrorKind::Unsupported.into());
    #[cfg(windows)]
    {
        let (mut rest, mut at) = (bytes, offset);
        while !rest.is_empty() {
            let read = std::os::windows::fs::FileExt::seek_read(file, rest, at)?;
            if read == 0 {
                return Err(io::ErrorKind::UnexpectedEof.into());
            }
            rest = rest.get_mut(read..).unwrap_or_default();
            at += read as u64;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use std::io::Write;

    use axlewire::ucp::{Body, Ucp, message::Ping};

    use super::*;

    /// A file of pings with a damaged one in 13, and its bytes.
    fn pings(name: &str, len: usize) -> (File, Vec<u8>) {
        let mut bytes: Vec<u8> = Vec::new();
        for number in 0.. {
            if bytes.len() >= len {
                break;
            }
            bytes.extend(Ping {}.frame(number as u8).as_bytes());
            if number % 13 == 0 {
                *bytes.last_mut().unwrap() ^= 1;
            }
        }
        let path = std::env::temp_dir().join(format!("axle-{}-{name}", std::process::id()));
        let mut options = File::options();
        let mut file =
            options.read(true).write(true).create(true).truncate(true).open(&path).unwrap();
        std::fs::remove_file(path).unwrap();
        file.write_all(&bytes).unwrap();
        (file, bytes)
    }

    #[test]
    fn several_threads_give_the_account_of_the_whole_file() {
        let (file, bytes) = pings("whole", 5 * PART + 77);
        for jobs in [1, 2, 5] {
            let found = of_file::<Ucp>(&file, bytes.len() as u64, jobs);
            assert_eq!(found, Some(of_bytes::<Ucp>(&bytes)), "{jobs} threads");
        }
    }

    #[test]
    fn a_short_file_and_one_that_is_shorter_than_it_was_are_left_to_one_thread() {
        let (file, bytes) = pings("short", 2 * PART - 1000);
        assert_eq!(of_file::<Ucp>(&file, bytes.len() as u64, 2), None);
        let (file, bytes) = pings("cut", 2 * PART);
        assert!(of_file::<Ucp>(&file, bytes.len() as u64, 2).is_some());
        assert_eq!(of_file::<Ucp>(&file, bytes.len() as u64 + 1, 2), None);
    }
}
