//! Limits of the simulated line, to the microsecond and to the byte: pieces, collisions, strays,
//! jitter, and rounds without end.

use std::collections::BTreeSet;

use crate::talker::*;

/// When each piece was there, and its length. The loop has seen it `late` microseconds later.
fn pieces(line: &Line<Talker, Talker>, late: u32) -> Vec<(u64, usize)> {
    line.tail(0).heard.iter().map(|(at, it)| (*at - u64::from(late), it.len())).collect()
}

/// Three bytes that end at 20, 120 and 240 us.
fn three_bytes_with_pauses() -> Line<Talker, Talker> {
    let mut line = one_way(500_000, 0, &[1]);
    line.head_mut().say(at(100), &[2]);
    line.head_mut().say(at(220), &[3]);
    line
}

#[test]
fn a_longer_pause_ends_a_piece_of_dma_and_an_equal_one_does_not() {
    for (pause, expected) in [
        (99, vec![(119, 1), (219, 1), (339, 1)]),
        (100, vec![(220, 2), (340, 1)]),
        (120, vec![(360, 3)]),
    ] {
        for late in [0, 5] {
            let mut line = three_bytes_with_pauses();
            let input = Input::AfterPause { pause: us(pause), at_most: 8 };
            line.timing_mut(Who::Tail(0)).input = input;
            line.timing_mut(Who::Tail(0)).latency = us(late);
            line.run_for(us(2000)).unwrap();
            assert_eq!(pieces(&line, late), expected, "{pause} us, {late} us late");
        }
    }
}

#[test]
fn a_piece_of_an_adapter_is_full_or_ends_with_its_timer() {
    for (wait, expected) in
        [(219, vec![(239, 2), (459, 1)]), (220, vec![(240, 3)]), (1000, vec![(240, 3)])]
    {
        for late in [0, 5] {
            let mut line = three_bytes_with_pauses();
            line.timing_mut(Who::Tail(0)).input = Input::AfterFirst { wait: us(wait), at_most: 3 };
            line.timing_mut(Who::Tail(0)).latency = us(late);
            line.run_for(us(2000)).unwrap();
            assert_eq!(pieces(&line, late), expected, "{wait} us, {late} us late");
        }
    }
}

#[test]
fn jitter_of_a_microsecond_is_none_or_one() {
    let mut line = one_way(500_000, 4, &[0; 256]);
    line.pair_mut(Direction::ToTails).jitter = us(1);
    line.run_for(us(10_000)).unwrap();
    let delays: BTreeSet<u64> =
        line.tail(0).times().iter().zip(1..).map(|(at, count)| at - 20 * count).collect();
    assert_eq!(delays.into_iter().collect::<Vec<_>>(), [0, 1]);
}

#[test]
fn a_stray_byte_at_a_receiver_comes_before_every_transmission() {
    let mut line = one_way(500_000, 0, b"ab");
    line.add(Talker::default());
    line.head_mut().say(at(0), b"cd");
    line.stub_mut(Who::Tail(1)).stray = Some(0xFF);
    line.run_for(us(1000)).unwrap();
    assert_eq!(line.tail(0).bytes(), b"abcd");
    assert_eq!(line.tail(1).bytes(), [0xFF, b'a', b'b', 0xFF, b'c', b'd']);
}

#[test]
fn a_doubled_first_byte_has_one_stray_byte_before_it_at_a_receiver() {
    let mut line = one_way(500_000, 0, b"a");
    line.pair_mut(Direction::ToTails).duplicated = 1.0;
    line.stub_mut(Who::Tail(0)).stray = Some(0xFF);
    line.run_for(us(1000)).unwrap();
    assert_eq!(line.tail(0).bytes(), [0xFF, b'a', b'a']);
}

#[test]
fn bytes_that_touch_do_not_collide() {
    let mut line = Line::new(500_000, 5, Talker::default());
    line.add(Talker::saying(at(100), &[0x11; 4])); // until 180
    line.add(Talker::saying(at(180), &[0x22; 4]));
    line.add(Talker::saying(at(20), &[0x33; 4])); // until 100
    line.run_for(us(1000)).unwrap();
    assert_eq!(line.statistics(Direction::ToHead).collided, 0);
    assert_eq!(line.head().bytes(), [[0x33; 4], [0x11; 4], [0x22; 4]].concat());
    // The second byte of one meets the first of the other. What is behind them only touches.
    for (first, second) in [(4, 1), (2, 2)] {
        let mut line = Line::new(500_000, 5, Talker::default());
        line.add(Talker::saying(at(0), &vec![0x11; first]));
        line.add(Talker::saying(at(20), &vec![0x22; second]));
        line.run_for(us(1000)).unwrap();
        assert_eq!(line.statistics(Direction::ToHead).collided, 2, "{first}, {second}");
    }
}

#[test]
fn every_byte_of_a_collision_is_damaged() {
    let mut line = Line::new(500_000, 5, Talker::default());
    for _ in 0..2 {
        line.add(Talker::saying(at(0), &[0xFF; 1000]));
    }
    line.run_for(us(200_000)).unwrap();
    assert_eq!(line.statistics(Direction::ToHead).collided, 2000);
    let heard = line.head().bytes();
    assert_eq!((heard.len(), heard.contains(&0xFF)), (2000, false));
}

#[test]
fn the_rounds_of_each_station_are_counted() {
    let mut line = one_way(500_000, 0, &[1, 2, 3]);
    line.run_for(us(1000)).unwrap();
    let before = line.polls(Who::Tail(0));
    assert!(before >= 3, "{before}: one for each byte");
    line.head_mut().say(at(1500), &[4; 5]);
    line.run_for(us(1000)).unwrap();
    assert_eq!(line.polls(Who::Tail(0)), before + 5);
}

/// Tells something in every round, and asks for the next one: at once, or every other one a
/// microsecond later.
#[derive(Debug, Default)]
struct Restless {
    rests: bool,
    is_second: bool,
    has_news: bool,
    due: Instant,
    rounds: u32,
}

impl Endpoint for Restless {
    type Event = ();
    fn handle_input(&mut self, _: &[u8], _: impl Into<Arrival>) {}
    fn handle_timeout(&mut self, now: Instant) {
        self.has_news = true;
        self.rounds += 1;
        if self.rests && self.is_second {
            self.due = now + us(1);
        }
        self.is_second = !self.is_second;
    }
    fn poll_transmit(&mut self, _: Instant) -> Option<&[u8]> {
        None
    }
    fn poll_event(&mut self) -> Option<()> {
        core::mem::take(&mut self.has_news).then_some(())
    }
    fn poll_timeout(&self) -> Option<Instant> {
        Some(self.due)
    }
}

#[test]
fn rounds_without_end_at_one_instant_are_an_error_and_at_many_instants_are_not() {
    let run = |rests| {
        let mut line: Line<Talker, Restless> = Line::new(500_000, 0, Talker::default());
        line.add(Restless { rests, due: at(100), ..Restless::default() });
        let result = line.run_for(at(20_100) - line.now());
        (result, line.tail(0).rounds)
    };
    let (result, rounds) = run(false);
    assert_eq!((result, rounds), (Err(Stuck::Endless { who: Who::Tail(0), at: at(100) }), 10_000));
    let (result, rounds) = run(true);
    assert_eq!(result, Ok(()));
    assert!(rounds >= 40_000, "{rounds}");
}

#[test]
fn random_numbers_are_those_of_splitmix64() {
    // The reference implementation by Vigna, seed 1234567.
    let expected: [u64; 3] = [6457827717110365317, 3203168211198807973, 9817491932198370423];
    let mut rng = Rng::new(1_234_567);
    assert_eq!([rng.next_u64(), rng.next_u64(), rng.next_u64()], expected);
    let mut rng = Rng::new(1_234_567);
    assert_eq!([rng.byte(), rng.byte(), rng.byte()], expected.map(|bits| (bits >> 56) as u8));
}
