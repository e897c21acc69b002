//! Keys, read by a separate thread, so that nothing waits for one.

use std::{
    io::{self, Read},
    sync::{
        Arc,
        atomic::{AtomicBool, Ordering},
        mpsc::{self, Receiver, SyncSender},
    },
    thread,
};

/// Number of keys that may wait. Further ones are lost.
const QUEUE: usize = 64;

/// The escape key, and the front of arrow keys.
const ESCAPE: u8 = 0x1B;

/// The keys that were pressed.
pub(crate) struct Keys(Receiver<u8>);

/// What the thread does with a key besides.
#[derive(Clone, Debug, Default)]
pub(crate) struct Sink {
    /// Raised at once by the keys that stop what moves, and when the terminal has gone away.
    pub(crate) stop: Option<Arc<AtomicBool>>,
}

impl Keys {
    /// Reads standard input until the tool exits.
    pub(crate) fn listen(sink: Sink) -> Self {
        let (keys, queue) = mpsc::sync_channel(QUEUE);
        thread::spawn(move || {
            pass_on(io::stdin(), &keys, &sink);
        });
        Self(queue)
    }

    /// The next key, if there is one.
    pub(crate) fn next(&self) -> Option<u8> {
        self.0.try_recv().ok()
    }
}

/// Passes keys on until the input ends.
fn pass_on(mut input: impl Read, keys: &SyncSender<u8>, sink: &Sink) {
    let stop = || sink.stop.iter().for_each(|stop| stop.store(true, Ordering::SeqCst));
    let mut key = [0];
    loop {
        match input.read(&mut key) {
            Ok(1..) => {}
            Err(error) if error.kind() == io::ErrorKind::Interrupted => continue,
            // No more keys can come.
            Ok(0) | Err(_) => return stop(),
        }
        // With Caps Lock the keys are the same.
        let key = key[0].to_ascii_lowercase();
        if matches!(key, b' ' | b's' | b'q' | ESCAPE) {
            stop();
        }
        // A full queue loses them.
        let _ = keys.try_send(key);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn is_stopped_by(mut typed: &[u8]) -> bool {
        let stop = Arc::new(AtomicBool::new(false));
        let (keys, _queue) = mpsc::sync_channel(QUEUE);
        // The end of the input stops too, so it is left out here.
        let endless = Read::chain(&mut typed, Panics);
        let sink = Sink { stop: Some(Arc::clone(&stop)) };
        let passed = std::panic::catch_unwind(std::panic::AssertUnwindSafe(|| {
            pass_on(endless, &keys, &sink);
        }));
        assert!(passed.is_err());
        stop.load(Ordering::SeqCst)
    }

    struct Panics;

    impl Read for Panics {
        fn read(&mut self, _: &mut [u8]) -> io::Result<usize> {
            panic!("the end");
        }
    }

    #[test]
    fn each_of_the_stop_keys_stops_and_no_other() {
        for key in [b" ", b"s", b"q", b"S", b"Q", b"\x1b"] {
            assert!(is_stopped_by(key), "{key:?}");
        }
        assert!(is_stopped_by(b"ppf?q"));
        assert!(!is_stopped_by(b"pfr?xPFRX"));
    }

    #[test]
    fn a_flood_of_keys_does_not_hide_the_one_that_stops() {
        let flood = [vec![b'p'; 10 * QUEUE], vec![b's']].concat();
        assert!(is_stopped_by(&flood));
    }

    #[test]
    fn a_terminal_that_has_gone_away_stops_what_moves() {
        let stop = Arc::new(AtomicBool::new(false));
        let (keys, _queue) = mpsc::sync_channel(QUEUE);
        pass_on(&b""[..], &keys, &Sink { stop: Some(Arc::clone(&stop)) });
        assert!(stop.load(Ordering::SeqCst));
    }

    #[test]
    fn a_signal_loses_no_key_and_any_other_error_is_the_end() {
        /// What each read gives; none is allowed after the last.
        struct Fails(Vec<Result<u8, io::ErrorKind>>);
        impl Read for Fails {
            fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
                buffer[0] = self.0.remove(0)?;
                Ok(1)
            }
        }
        let typed = |front: &[_]| {
            let stop = Arc::new(AtomicBool::new(false));
            let (keys, queue) = mpsc::sync_channel(QUEUE);
            let sink = Sink { stop: Some(Arc::clone(&stop)) };
            let all = [front, &[Ok(b'x'), Err(io::ErrorKind::Other)]].concat();
            pass_on(Fails(all), &keys, &sink);
            assert!(stop.load(Ordering::SeqCst));
            queue.try_iter().collect::<Vec<u8>>()
        };
        assert_eq!(typed(&[]), b"x");
        assert_eq!(typed(&[Err(io::ErrorKind::Interrupted); 2]), b"x");
        assert_eq!(typed(&[Err(io::ErrorKind::BrokenPipe)]), b"");
    }
}
