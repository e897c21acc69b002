//! The end of a page, and what it is told.

use axlewire::ucp::Ucp;
use embedded_io::{Read, Write};

use super::*;
use crate::played;

impl Tell {
    /// One without a page, and what it tells.
    pub(super) fn to_memory() -> (Self, Receiver<News>) {
        let (news, queue) = mpsc::sync_channel(QUEUE);
        (Self { news, lost: Arc::default(), start: Instant::now() }, queue)
    }
}

#[test]
fn what_moves_is_stopped_when_the_page_ends_or_panics() {
    for is_panic in [false, true] {
        let flag = Arc::new(AtomicBool::new(false));
        let stop = StopAtTheEnd(Arc::clone(&flag));
        let page = thread::spawn(move || {
            let _stop = stop;
            assert!(!is_panic, "planted");
        });
        assert_eq!(page.join().is_err(), is_panic);
        assert!(flag.load(Ordering::SeqCst));
    }
}

#[test]
fn a_page_that_gave_up_cannot_be_left_as_if_nothing_had_happened() {
    let mut live = Live::that_gave_up();
    assert_eq!(live.leave().unwrap_err().to_string(), given_up().to_string());
    live.leave().unwrap();
}

#[test]
fn a_second_of_a_full_bus_waits_for_the_page_and_what_is_more_is_counted() {
    let (tell, queue) = Tell::to_memory();
    let piece = || What::Bytes(Source::Received, [1, 2, 3, 4].into());
    // 50,000 bytes per second, in packets of 4 and 8.
    (0..10_000).for_each(|_| tell.tell(piece()));
    assert_eq!(tell.lost.load(Ordering::Relaxed), 0);
    (0..QUEUE).for_each(|_| tell.tell(piece()));
    assert_eq!(tell.lost.load(Ordering::Relaxed), 4 * 10_000);
    assert_eq!(queue.try_iter().count(), QUEUE);
}

#[test]
fn each_byte_is_told_once() {
    let (tell, queue) = Tell::to_memory();
    let line = played::played((), |(), said| if said.is_empty() { vec![] } else { vec![7] });
    let mut line = tell.tap(line.line);
    assert_eq!(line.write(&[1, 2, 3]).unwrap(), 3);
    line.read(&mut [0; 8]).unwrap();
    let told: Vec<_> = queue
        .try_iter()
        .map(|News(_, what)| match what {
            What::Bytes(source, bytes) => (source, bytes.into_vec()),
            _ => panic!("nothing else was told"),
        })
        .collect();
    assert_eq!(told, [(Source::Sent, vec![1, 2, 3]), (Source::Received, vec![7])]);
}

#[test]
fn a_note_reaches_the_page_and_a_page_that_is_too_slow_loses_a_known_number_of_bytes() {
    let (tell, queue) = Tell::to_memory();
    let live = Live { tell, is_over: Arc::default(), end: mpsc::channel().1, is_left: true };
    live.note("a note".to_owned());
    let News(_, told) = queue.try_recv().unwrap();
    assert!(matches!(told, What::Note(text) if text == "a note"));
    for _ in 0..QUEUE + 2 {
        live.tell.tell(What::Bytes(Source::Received, [7; 5].into()));
    }
    assert_eq!(live.tell.lost.load(Ordering::SeqCst), 10);
}

#[test]
#[ignore = "started on a terminal by a test of the screen"]
fn looks_on_too_slowly() {
    let (tell, queue) = Tell::to_memory();
    tell.tell(What::Note("a note".to_owned()));
    let is_over = Arc::new(AtomicBool::new(false));
    let (lost, start) = (Arc::new(AtomicU64::new(10)), tell.start);
    let looker = Looker { queue, lost, is_over: Arc::clone(&is_over), start };
    thread::spawn(move || {
        thread::sleep(Duration::from_millis(400));
        is_over.store(true, Ordering::SeqCst);
    });
    let feed = Feed::<Ucp>::new(Model::new(Protocol::Ucp), None);
    looker.look_on(Dashboard::open(feed, View::default(), Sink::default()).unwrap()).unwrap();
}

#[test]
fn a_flush_of_a_tapped_line_is_one_of_its_port() {
    let played = played::played((), |(), _| Vec::new());
    let (tell, _queue) = Tell::to_memory();
    let mut line = tell.tap(played.line);
    assert!(line.flush().is_ok());
    played.is_gone.set(true);
    assert!(line.flush().is_err());
}

#[test]
fn a_page_that_is_no_longer_wanted_is_left() {
    let (tell, _queue) = Tell::to_memory();
    let is_over = Arc::new(AtomicBool::new(false));
    let (_ended, end) = mpsc::channel();
    drop(Live { tell, is_over: Arc::clone(&is_over), end, is_left: false });
    assert!(is_over.load(Ordering::SeqCst));
}
