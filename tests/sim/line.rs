//! A line without faults: how long bytes take, which stations receive them, its trace and its seed.

use crate::talker::*;

#[test]
fn a_byte_takes_ten_bit_times_and_bytes_follow_one_another() {
    let mut line = one_way(500_000, 0, &[1, 2, 3]);
    line.head_mut().say(at(10), &[4]); // while the line is still busy
    line.head_mut().say(at(200), &[5]);
    line.run_for(us(1000)).unwrap();
    assert_eq!(line.tail(0).times(), [20, 40, 60, 80, 220]);
    assert_eq!(line.tail(0).bytes(), [1, 2, 3, 4, 5]);
    let statistics = line.statistics(Direction::ToTails);
    assert_eq!((statistics.bytes, statistics.busy_us), (5, 100));
    assert_eq!(line.now(), at(1000));
}

#[test]
fn rounding_up_to_microseconds_does_not_add_up() {
    let mut line = one_way(115_200, 0, &random_bytes(115_200));
    line.run_for(Duration::from_millis(11_000)).unwrap();
    let times = line.tail(0).times();
    assert_eq!(times[..3], [87, 174, 261]); // 86.8, 173.6, 260.4
    assert_eq!(times.last(), Some(&10_000_000));
    assert_eq!(line.statistics(Direction::ToTails).busy_us, 10_000_000);
}

#[test]
fn every_tail_hears_the_head_and_no_tail_hears_another() {
    let mut line = one_way(500_000, 0, b"down");
    line.add(Talker::saying(at(0), b"up"));
    line.run_for(us(1000)).unwrap();
    assert_eq!(line.tail(0).bytes(), b"down");
    assert_eq!(line.tail(1).bytes(), b"down");
    assert_eq!(line.head().bytes(), b"up"); // at the same time, on the other pair
    assert_eq!(line.statistics(Direction::ToHead).collided, 0);
}

#[test]
fn bytes_of_two_senders_at_the_same_time_are_garbled() {
    let mut line = Line::new(500_000, 5, Talker::default());
    line.add(Talker::saying(at(0), &[0x11; 4])); // until 80
    line.add(Talker::saying(at(50), &[0x22; 4])); // from 50 to 130
    line.add(Talker::saying(at(130), &[0x33; 2]));
    line.run_for(us(1000)).unwrap();
    assert_eq!(line.head().times(), [20, 40, 60, 70, 80, 90, 110, 130, 150, 170]);
    let heard = line.head().bytes();
    assert_eq!(heard[..2], [0x11, 0x11]);
    assert_eq!(heard[6..], [0x22, 0x22, 0x33, 0x33]);
    for (byte, sent) in heard[2..6].iter().zip([0x11, 0x22, 0x11, 0x22]) {
        assert_ne!(*byte, sent);
    }
    let statistics = line.statistics(Direction::ToHead);
    assert_eq!((statistics.collided, statistics.busy_us), (4, 170));
}

#[test]
fn an_unplugged_sender_collides_with_nobody() {
    let mut line = Line::new(500_000, 5, Talker::default());
    line.add(Talker::saying(at(0), &[0x11; 4]));
    let other = line.add(Talker::saying(at(0), &[0x22; 4]));
    line.stub_mut(Who::Tail(other)).unplugged = true;
    line.run_for(us(1000)).unwrap();
    assert_eq!(line.head().bytes(), [0x11; 4]);
    assert_eq!(line.statistics(Direction::ToHead).bytes, 4);
}

#[test]
fn injected_bytes_are_on_the_line_as_if_they_had_been_sent() {
    let mut line = one_way(500_000, 0, b"head");
    line.inject(Who::Tail(0), b"ghost");
    line.run_for(us(1000)).unwrap();
    assert_eq!(line.head().bytes(), b"ghost");
    assert_eq!(line.tail(0).bytes(), b"head");
}

#[test]
fn nothing_happens_on_a_silent_line() {
    let mut line: Line<Talker, Talker> = Line::new(500_000, 0, Talker::default());
    assert_eq!(line.step(), Ok(Some(at(0)))); // every station is asked once
    assert_eq!(line.step(), Ok(None));
    line.run_for(Duration::from_millis(1_000_000)).unwrap();
    assert_eq!(line.polls(Who::Head), 1);
}

#[test]
fn time_may_wrap() {
    let start = Instant::from_micros(u64::MAX - 50);
    let mut line = Line::new(500_000, 0, Talker::saying(start, &[1; 5])).starting_at(start);
    line.add(Talker::default());
    line.run_for(us(1000)).unwrap();
    let since = |at: u64| at.wrapping_sub(start.as_micros());
    let times: Vec<u64> = line.tail(0).times().into_iter().map(since).collect();
    assert_eq!(times, [20, 40, 60, 80, 100]);
    assert_eq!(line.now(), start + us(1000));
}

/// Everything at once.
fn noisy_trace(seed: u64) -> (Vec<axlewire::sim::Traced>, Vec<(u64, Vec<u8>)>) {
    let mut line = one_way(500_000, seed, &random_bytes(500));
    line.add(Talker::saying(at(100), &random_bytes(300)));
    line.add(Talker::saying(at(1000), &random_bytes(300)));
    for direction in [Direction::ToTails, Direction::ToHead] {
        let faults = line.pair_mut(direction);
        *faults = Faults::noise(0.01);
        (faults.lost, faults.duplicated, faults.inserted) = (0.01, 0.01, 0.01);
        faults.jitter = us(50);
    }
    line.record();
    line.run_for(us(20_000)).unwrap();
    (line.trace().to_vec(), line.head().heard.clone())
}

#[test]
fn the_same_seed_gives_the_same_bytes_at_the_same_times() {
    assert_eq!(noisy_trace(7), noisy_trace(7));
    assert_ne!(noisy_trace(7), noisy_trace(8));
    assert!(noisy_trace(7).0.is_sorted_by_key(|traced| traced.at));
}

#[test]
fn the_trace_records_every_sender_byte_and_time() {
    let mut line = one_way(500_000, 0, &[7]);
    line.add(Talker::saying(at(5), &[8]));
    line.record();
    line.run_for(us(100)).unwrap();
    let trace: Vec<_> = line.trace().iter().map(|it| (it.at, it.who, it.byte)).collect();
    assert_eq!(trace, [(at(20), Who::Head, 7), (at(25), Who::Tail(1), 8)]);
}
