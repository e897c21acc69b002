//! Faults of a line and of its stubs: each occurs at the requested rate and place.

use std::collections::BTreeSet;

use axlewire::sim::PairStatistics;

use crate::talker::*;

#[test]
fn bits_are_flipped_at_the_requested_rate() {
    let sent = random_bytes(50_000);
    let mut line = one_way(500_000, 1, &sent);
    *line.pair_mut(Direction::ToTails) = Faults::noise(0.01);
    line.run_for(Duration::from_millis(2000)).unwrap();
    let heard = line.tail(0).bytes();
    let wrong = sent.iter().zip(&heard).map(|(a, b)| (a ^ b).count_ones()).sum::<u32>();
    assert_eq!(u64::from(wrong), line.statistics(Direction::ToTails).bit_errors);
    assert!((3_750..4_250).contains(&wrong), "{wrong} of 400,000"); // 4 standard deviations
}

/// What 100,000 bytes become with `faults`, and the statistics of that.
fn after(faults: impl Fn(&mut Faults)) -> (usize, PairStatistics) {
    let mut line = one_way(1_000_000, 2, &random_bytes(100_000));
    faults(line.pair_mut(Direction::ToTails));
    line.run_for(Duration::from_millis(2000)).unwrap();
    (line.tail(0).bytes().len(), *line.statistics(Direction::ToTails))
}

#[test]
fn bytes_are_lost_doubled_and_inserted_at_the_requested_rate() {
    let expected = 9_700..10_300;
    let (len, statistics) = after(|faults| faults.lost = 0.1);
    assert!(expected.contains(&statistics.lost), "{statistics:?}");
    assert_eq!(len as u64, 100_000 - statistics.lost);

    let (len, statistics) = after(|faults| faults.duplicated = 0.1);
    assert!(expected.contains(&statistics.duplicated), "{statistics:?}");
    assert_eq!(len as u64, 100_000 + statistics.duplicated);

    let (len, statistics) = after(|faults| faults.inserted = 0.1);
    assert!(expected.contains(&statistics.inserted), "{statistics:?}");
    assert_eq!(len as u64, 100_000 + statistics.inserted);

    let (len, _) = after(|faults| faults.lost = 1.0);
    assert_eq!(len, 0);
    let (len, statistics) = after(|_| {});
    assert_eq!((len, statistics.busy_us), (100_000, 1_000_000));
}

#[test]
fn faults_of_a_stub_concern_its_station_alone() {
    let mut line = one_way(500_000, 3, b"all of it");
    line.add(Talker::saying(at(500), b"and back"));
    line.stub_mut(Who::Tail(1)).lost = 1.0;
    line.run_for(us(2000)).unwrap();
    assert_eq!(line.tail(0).bytes(), b"all of it");
    assert_eq!(line.tail(1).bytes(), b"");
    assert_eq!(line.head().bytes(), b"");
    assert_eq!(line.statistics(Direction::ToTails).lost, 9);
    assert_eq!(line.statistics(Direction::ToHead).lost, 8);
}

#[test]
fn a_stray_byte_comes_before_every_transmission() {
    let mut line = one_way(500_000, 0, b"ab");
    line.head_mut().say(at(0), b"cd");
    line.pair_mut(Direction::ToTails).stray = Some(0xFF);
    line.run_for(us(1000)).unwrap();
    assert_eq!(line.tail(0).bytes(), [0xFF, b'a', b'b', 0xFF, b'c', b'd']);
}

#[test]
fn delay_and_jitter_keep_the_order() {
    let sent: Vec<u8> = (0..=255).collect();
    let mut line = one_way(500_000, 4, &sent);
    line.pair_mut(Direction::ToTails).delay = us(300);
    line.run_for(us(10_000)).unwrap();
    assert_eq!(line.tail(0).times()[..3], [320, 340, 360]);

    let mut line = one_way(500_000, 4, &sent);
    line.pair_mut(Direction::ToTails).delay = us(300);
    line.pair_mut(Direction::ToTails).jitter = us(100);
    line.run_for(us(10_000)).unwrap();
    assert_eq!(line.tail(0).bytes(), sent);
    let pieces = line.tail(0).heard.iter().flat_map(|(at, bytes)| bytes.iter().map(move |_| at));
    let delays: Vec<u64> = pieces.zip(1..).map(|(at, count)| at - 20 * count).collect();
    assert!(delays.iter().all(|delay| (300..=400).contains(delay)), "{delays:?}");
    assert!(delays.iter().collect::<BTreeSet<_>>().len() > 20, "{delays:?}");
}

#[test]
fn the_answer_of_a_delayed_stub_arrives_later() {
    let mut line = one_way(500_000, 0, b"");
    line.add(Talker::saying(at(0), b"late"));
    line.tail_mut(0).say(at(0), b"soon");
    line.stub_mut(Who::Tail(1)).delay = us(700);
    line.run_for(us(2000)).unwrap();
    assert_eq!(line.head().times(), [20, 40, 60, 80, 720, 740, 760, 780]);
    assert_eq!(line.head().bytes(), b"soonlate");
}

#[test]
fn an_echoing_adapter_hears_its_own_bytes() {
    let mut line = one_way(500_000, 0, b"own");
    line.pair_mut(Direction::ToTails).echo = true;
    line.run_for(us(1000)).unwrap();
    assert_eq!((line.head().bytes(), line.head().times()), (b"own".to_vec(), vec![20, 40, 60]));
    assert_eq!(line.tail(0).bytes(), b"own");

    let mut line = one_way(500_000, 0, b"own");
    *line.stub_mut(Who::Head) = Faults::CLEAN;
    line.stub_mut(Who::Head).echo = true;
    line.stub_mut(Who::Head).unplugged = true;
    line.run_for(us(1000)).unwrap();
    assert_eq!(line.head().bytes(), b"own"); // the adapter works, the cable does not
    assert_eq!(line.tail(0).bytes(), b"");
}

#[test]
fn an_unplugged_station_neither_receives_nor_sends_until_it_is_plugged_in_again() {
    let mut line = one_way(500_000, 0, &[1; 10]);
    line.add(Talker::saying(at(0), &[2; 10]));
    line.stub_mut(Who::Tail(1)).unplugged = true;
    line.run_for(at(100) - line.now()).unwrap();
    line.stub_mut(Who::Tail(1)).unplugged = false;
    line.run_for(us(1000)).unwrap();
    assert_eq!(line.tail(0).bytes().len(), 10);
    assert_eq!(line.tail(1).times(), [120, 140, 160, 180, 200]);
    assert_eq!(line.head().times(), [120, 140, 160, 180, 200]);

    let mut line = one_way(500_000, 0, &[1; 10]);
    line.pair_mut(Direction::ToTails).unplugged = true;
    line.run_for(us(1000)).unwrap();
    assert_eq!(line.tail(0).bytes(), b"");
}
