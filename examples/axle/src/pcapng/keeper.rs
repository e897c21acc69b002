//! Brings a growing file to the disk, so that a power cut costs at most a second of it, and
//! watches the space that is left. A separate thread does it, because a disk may take long.

use std::{
    fs::File,
    io,
    path::{Path, PathBuf},
    sync::{
        Arc, Mutex, PoisonError,
        atomic::{AtomicBool, Ordering},
    },
    thread,
    time::Duration,
};

use crate::failure::Failure;

/// Interval between two looks. With the time that the disk takes, it is less than a second.
const PERIOD: Duration = Duration::from_millis(500);

/// A recording ends while this much is free, so that other programs can go on: 16 MB, or a
/// twentieth of a small disk.
const LEAST_FREE: u64 = 16_000_000;
const LEAST_PART: u64 = 20;

/// Keeps a file until it is dropped.
pub(super) struct Keeper(Arc<Kept<dyn OnDisk>>);

struct Kept<F: ?Sized> {
    has_news: AtomicBool,
    failure: Mutex<Option<String>>,
    file: F,
}

/// A file on a disk.
trait OnDisk: Send + Sync + 'static {
    /// Returns once everything that was written is on the disk.
    fn bring(&self) -> io::Result<()>;

    /// Bytes that are free, and bytes in all; nothing if the system does not tell.
    fn space(&self) -> Option<(u64, u64)>;
}

impl OnDisk for (File, PathBuf) {
    fn bring(&self) -> io::Result<()> {
        self.0.sync_data()
    }

    fn space(&self) -> Option<(u64, u64)> {
        Some((fs4::available_space(&self.1).ok()?, fs4::total_space(&self.1).ok()?))
    }
}

impl Keeper {
    /// Keeps a regular file; others are on no disk.
    pub(super) fn new(file: &File, path: &Path) -> io::Result<Option<Self>> {
        if !file.metadata()?.is_file() {
            return Ok(None);
        }
        Ok(Some(Self::of((file.try_clone()?, path.to_owned()), path, PERIOD)))
    }

    fn of(file: impl OnDisk, path: &Path, period: Duration) -> Self {
        let kept = Kept { has_news: AtomicBool::new(false), failure: Mutex::new(None), file };
        let (keeper, path) = (Self(Arc::new(kept)), path.to_owned());
        let kept = Arc::downgrade(&keeper.0);
        thread::spawn(move || {
            while let Some(kept) = kept.upgrade() {
                let failure = match kept.bring_news() {
                    Err(error) => Some(format!("cannot write {path:?}: {error}")),
                    Ok(()) => {
                        kept.file.space().and_then(|(free, all)| too_little(&path, free, all))
                    }
                };
                if let Some(failure) = failure {
                    *kept.failure.lock().unwrap_or_else(PoisonError::into_inner) = Some(failure);
                    return;
                }
                drop(kept);
                thread::sleep(period);
            }
        });
        keeper
    }

    /// Something was written.
    pub(super) fn has_news(&self) {
        self.0.has_news.store(true, Ordering::Release);
    }

    /// Why nothing more should be written.
    pub(super) fn failure(&self) -> Option<Failure> {
        let failure = self.0.failure.lock().unwrap_or_else(PoisonError::into_inner).take();
        failure.map(Failure::Failed)
    }
}

impl Kept<dyn OnDisk> {
    fn bring_news(&self) -> io::Result<()> {
        let is_due = self.has_news.swap(false, Ordering::AcqRel);
        if is_due { self.file.bring() } else { Ok(()) }
    }
}

impl Drop for Keeper {
    fn drop(&mut self) {
        // The file is closed: nobody would hear of a failure.
        let _ = self.0.bring_news();
    }
}

fn too_little(path: &Path, free: u64, all: u64) -> Option<String> {
    let is_little = free < LEAST_FREE.min(all / LEAST_PART);
    is_little.then(|| {
        let megabytes = free as f64 / 1e6;
        format!(
            "{megabytes:.1} MB are left on the disk of {path:?}: the recording ends, and is complete"
        )
    })
}

#[cfg(test)]
mod tests {
    use std::{sync::mpsc, time::Instant};

    use super::*;

    struct Played {
        brought: mpsc::Sender<Instant>,
        free: u64,
    }

    impl OnDisk for Played {
        fn bring(&self) -> io::Result<()> {
            self.brought.send(Instant::now()).map_err(io::Error::other)
        }

        fn space(&self) -> Option<(u64, u64)> {
            Some((self.free, 1 << 40))
        }
    }

    #[test]
    fn what_was_written_is_brought_to_the_disk_and_nothing_else_is() {
        let (brought, looks) = mpsc::channel();
        let period = Duration::from_millis(5);
        let keeper = Keeper::of(Played { brought, free: 1 << 30 }, Path::new("file"), period);
        for _ in 0..5 {
            keeper.has_news();
            looks.recv_timeout(Duration::from_secs(10)).unwrap();
        }
        assert!(looks.recv_timeout(20 * period).is_err(), "there was nothing new");
        assert!(keeper.failure().is_none());
        drop(keeper);
        let ended = looks.recv_timeout(Duration::from_secs(10));
        assert_eq!(ended, Err(mpsc::RecvTimeoutError::Disconnected), "the thread is gone");
    }

    #[test]
    fn a_disk_that_fails_or_is_nearly_full_ends_the_recording() {
        let path = Path::new("file");
        let failure_of = |played| {
            let keeper = Keeper::of(played, path, Duration::from_millis(1));
            keeper.has_news();
            loop {
                match keeper.failure() {
                    Some(failure) => break failure.to_string(),
                    None => thread::yield_now(),
                }
            }
        };
        let (brought, _looks) = mpsc::channel();
        let says = "15.9 MB are left on the disk of \"file\": the recording ends, and is complete";
        assert_eq!(failure_of(Played { brought, free: 15_900_000 }), says);
        let (brought, _) = mpsc::channel();
        let failure = failure_of(Played { brought, free: 1 << 30 });
        assert!(failure.starts_with("cannot write \"file\": "), "{failure}");
        assert_eq!(too_little(path, 1_000_000, 19_999_999), None, "of a small disk");
        assert!(too_little(path, 1_000_000, 20_000_020).is_some());
    }
}
