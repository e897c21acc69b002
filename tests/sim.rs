//! The simulated line: what it does to bytes, time and roles.
#![cfg(feature = "sim")]

use std::collections::{BTreeSet, VecDeque};

use axlewire::{
    endpoint::Endpoint,
    sim::{Direction, Faults, Input, Line, Rng, Stuck, Who},
    time::{Duration, Instant},
};

const fn us(micros: u32) -> Duration {
    Duration::from_micros(micros)
}

const fn at(micros: u64) -> Instant {
    Instant::from_micros(micros)
}

/// Says what it is told to say, and remembers what it hears and when.
#[derive(Debug, Default)]
struct Talker {
    to_say: VecDeque<(Instant, Vec<u8>)>,
    saying: Vec<u8>,
    heard: Vec<(u64, Vec<u8>)>,
}

impl Talker {
    fn say(&mut self, at: Instant, bytes: &[u8]) {
        self.to_say.push_back((at, bytes.to_vec()));
    }

    fn saying(at: Instant, bytes: &[u8]) -> Self {
        let mut talker = Self::default();
        talker.say(at, bytes);
        talker
    }

    fn bytes(&self) -> Vec<u8> {
        self.heard.iter().flat_map(|(_, bytes)| bytes.iter().copied()).collect()
    }

    fn times(&self) -> Vec<u64> {
        self.heard.iter().map(|(at, _)| *at).collect()
    }
}

impl Endpoint for Talker {
    type Event = usize;

    fn handle_input(&mut self, bytes: &[u8], now: Instant) {
        self.heard.push((now.as_micros(), bytes.to_vec()));
    }

    fn handle_timeout(&mut self, _: Instant) {}

    fn poll_transmit(&mut self, now: Instant) -> Option<&[u8]> {
        self.to_say.front().filter(|(at, _)| now >= *at)?;
        self.saying = self.to_say.pop_front()?.1;
        Some(&self.saying)
    }

    fn poll_event(&mut self) -> Option<usize> {
        None
    }

    fn poll_timeout(&self) -> Option<Instant> {
        self.to_say.front().map(|(at, _)| *at)
    }
}

/// A head that says `bytes` at 0, and one silent tail.
fn one_way(baud: u32, seed: u64, bytes: &[u8]) -> Line<Talker, Talker> {
    let mut line = Line::new(baud, seed, Talker::saying(at(0), bytes));
    line.add(Talker::default());
    line
}

/// So many bytes of chance.
fn random_bytes(count: usize) -> Vec<u8> {
    let mut rng = Rng::new(99);
    (0..count).map(|_| rng.byte()).collect()
}

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
fn bits_are_wrong_as_often_as_asked() {
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
fn after(faults: impl Fn(&mut Faults)) -> (usize, axlewire::sim::PairStatistics) {
    let mut line = one_way(1_000_000, 2, &random_bytes(100_000));
    faults(line.pair_mut(Direction::ToTails));
    line.run_for(Duration::from_millis(2000)).unwrap();
    (line.tail(0).bytes().len(), *line.statistics(Direction::ToTails))
}

#[test]
fn bytes_are_lost_doubled_and_inserted_as_often_as_asked() {
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
fn the_answer_of_a_delayed_stub_comes_onto_the_pair_later() {
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
    assert_eq!(line.head().bytes(), b"own"); // the adapter is well, the cable is not
    assert_eq!(line.tail(0).bytes(), b"");
}

#[test]
fn what_is_unplugged_hears_and_says_nothing_until_it_is_plugged_in_again() {
    let mut line = one_way(500_000, 0, &[1; 10]);
    line.add(Talker::saying(at(0), &[2; 10]));
    line.stub_mut(Who::Tail(1)).unplugged = true;
    line.run_until(at(100)).unwrap();
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
fn the_trace_says_who_sent_what_and_when() {
    let mut line = one_way(500_000, 0, &[7]);
    line.add(Talker::saying(at(5), &[8]));
    line.record();
    line.run_for(us(100)).unwrap();
    let trace: Vec<_> = line.trace().iter().map(|it| (it.at, it.who, it.byte)).collect();
    assert_eq!(trace, [(at(20), Who::Head, 7), (at(25), Who::Tail(1), 8)]);
}

#[test]
fn a_pause_or_a_full_buffer_ends_a_piece_of_dma() {
    let mut line = one_way(500_000, 0, &[0; 10]);
    line.head_mut().say(at(1000), &[1; 3]);
    line.driver_mut(Who::Tail(0)).input = Input::AfterPause { pause: us(40), at_most: 8 };
    line.run_for(us(2000)).unwrap();
    let pieces: Vec<_> = line.tail(0).heard.iter().map(|(at, it)| (*at, it.len())).collect();
    assert_eq!(pieces, [(160, 8), (240, 2), (1100, 3)]);
}

#[test]
fn a_usb_adapter_hands_in_after_its_latency_timer_or_when_it_is_full() {
    let mut line = one_way(500_000, 0, &[0; 70]);
    line.driver_mut(Who::Tail(0)).input = Input::usb_adapter();
    line.run_for(Duration::from_millis(50)).unwrap();
    let pieces: Vec<_> = line.tail(0).heard.iter().map(|(at, it)| (*at, it.len())).collect();
    assert_eq!(pieces, [(62 * 20, 62), (63 * 20 + 16_000, 8)]);
}

#[test]
fn a_slow_loop_sees_bytes_and_deadlines_later() {
    let mut line = one_way(500_000, 0, &[1, 2, 3]);
    line.head_mut().say(at(500), &[4]);
    line.driver_mut(Who::Head).latency = us(7);
    line.driver_mut(Who::Tail(0)).latency = us(50);
    line.run_for(us(2000)).unwrap();
    assert_eq!(line.tail(0).times(), [77, 97, 117, 577]);
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

#[test]
fn what_is_injected_stands_on_the_line_as_if_it_had_been_sent() {
    let mut line = one_way(500_000, 0, b"head");
    line.inject(Who::Tail(0), b"ghost");
    line.run_for(us(1000)).unwrap();
    assert_eq!(line.head().bytes(), b"ghost");
    assert_eq!(line.tail(0).bytes(), b"head");
}

#[test]
fn nothing_ever_happens_on_a_line_without_talk() {
    let mut line: Line<Talker, Talker> = Line::new(500_000, 0, Talker::default());
    assert_eq!(line.step(), Ok(Some(at(0)))); // everybody is asked once
    assert_eq!(line.step(), Ok(None));
    line.run_for(Duration::from_millis(1_000_000)).unwrap();
    assert_eq!(line.polls(Who::Head), 1);
}

/// An endpoint that breaks the contract.
#[derive(Debug)]
enum Bad {
    Impatient,
    Babbling,
    Insatiable,
}

impl Endpoint for Bad {
    type Event = ();
    fn handle_input(&mut self, _: &[u8], _: Instant) {}
    fn handle_timeout(&mut self, _: Instant) {}

    fn poll_transmit(&mut self, _: Instant) -> Option<&[u8]> {
        matches!(self, Self::Babbling).then_some(b"x")
    }

    fn poll_event(&mut self) -> Option<()> {
        matches!(self, Self::Insatiable).then_some(())
    }

    fn poll_timeout(&self) -> Option<Instant> {
        matches!(self, Self::Impatient).then_some(at(100))
    }
}

#[test]
fn an_endpoint_that_would_make_a_driver_spin_is_an_error() {
    let run = |bad| {
        let mut line: Line<Talker, Bad> = Line::new(500_000, 0, Talker::default());
        line.add(bad);
        line.run_until(at(1000))
    };
    let who = Who::Tail(0);
    assert_eq!(run(Bad::Impatient), Err(Stuck::BusyLoop { who, at: at(100) }));
    assert_eq!(run(Bad::Babbling), Err(Stuck::Endless { who, at: at(0) }));
    assert_eq!(run(Bad::Insatiable), Err(Stuck::Endless { who, at: at(0) }));
    let said = Stuck::BusyLoop { who, at: at(100) }.to_string();
    assert_eq!(
        said,
        "tail 0 makes its driver spin at 100 µs: its poll_timeout has passed and stays so"
    );
}

#[cfg(feature = "ikeya")]
mod motor_bus {
    use axlewire::{
        ikeya::{
            Health, Master, MasterConfig, MasterEvent, Mode, NodeId, Position, Rps, Schedule,
            Slave, SlaveConfig,
        },
        sim::{Motor, MotorNode},
        time::wire_time,
    };

    use super::*;

    const fn mode_of(node: NodeId) -> Mode {
        if node.get() % 2 == 1 { Mode::Velocity } else { Mode::Position }
    }

    /// A bus with these nodes, odd ones in velocity mode, answering after 50 µs.
    fn bus(nodes: &[NodeId], config: MasterConfig) -> Line<Master, MotorNode> {
        let mut line = Line::new(config.baud, 1, Master::new(config, at(0)));
        for &node in nodes {
            let mut slave = SlaveConfig::direct();
            slave.idle = wire_time(5, config.baud);
            let slave = Slave::new(node, mode_of(node), slave);
            let tail = line.add(MotorNode::from_parts(slave, Motor::new()));
            line.driver_mut(Who::Tail(tail)).latency = us(50);
        }
        line
    }

    fn discovered(line: &mut Line<Master, MotorNode>) -> (Vec<(NodeId, Mode)>, Option<u8>) {
        let now = line.now();
        line.head_mut().discover(now);
        while line.head().is_discovering() {
            assert!(line.step().unwrap().is_some());
        }
        line.run_for(us(0)).unwrap();
        let (mut found, mut online) = (Vec::new(), None);
        for (_, event) in line.take_head_events() {
            match event {
                MasterEvent::Discovered { node, mode } => found.push((node, mode)),
                MasterEvent::DiscoveryDone { online: count } => online = Some(count),
                _ => {}
            }
        }
        (found, online)
    }

    #[test]
    fn a_master_discovers_none_one_and_eight_nodes() {
        for nodes in [&[][..], &[NodeId::N6], &NodeId::ALL] {
            let mut line = bus(nodes, MasterConfig::direct());
            let expected: Vec<_> = nodes.iter().map(|&node| (node, mode_of(node))).collect();
            assert_eq!(discovered(&mut line), (expected, Some(nodes.len() as u8)));
        }
    }

    #[test]
    fn commands_move_the_motors_and_the_master_reads_how_they_move() {
        let mut line = bus(&[NodeId::N1, NodeId::N2], MasterConfig::direct());
        discovered(&mut line);
        let target = Position::from_revolutions(-1.25).unwrap();
        let now = line.now();
        line.head_mut().set_velocity(NodeId::N1, Rps::new(3.0).unwrap(), now).unwrap();
        line.head_mut().set_position(NodeId::N2, target, now).unwrap();
        line.run_for(Duration::from_millis(2000)).unwrap();
        assert!((line.tail(0).motor().velocity().get() - 3.0).abs() < 1e-3);
        assert_eq!(line.tail(1).motor().position(), target);
        assert_eq!(line.head().health(NodeId::N2), Some(Health::Online));
        let (status, _) = line.head().status(NodeId::N2).unwrap();
        assert_eq!(status, axlewire::ikeya::Status::Position(target));
        assert_eq!(line.head().node_statistics(NodeId::N1).timeouts, 0);
    }

    /// Visits of each of eight nodes in `span`, with a WRITE and a READ each, and how much of it
    /// somebody was talking, percent.
    fn visits(config: MasterConfig, span: Duration) -> (u32, u64) {
        let mut line = bus(&NodeId::ALL, config);
        discovered(&mut line);
        let now = line.now();
        for node in NodeId::ALL {
            match mode_of(node) {
                Mode::Velocity => line.head_mut().set_velocity(node, Rps::ZERO, now).unwrap(),
                Mode::Position => {
                    line.head_mut().set_position(node, Position::new(1, 1), now).unwrap();
                }
            }
        }
        line.run_for(Duration::from_millis(100)).unwrap(); // the new set-points go first
        let busy = |line: &Line<_, _>| {
            let both = [Direction::ToTails, Direction::ToHead];
            both.map(|direction| line.statistics(direction).busy_us).iter().sum::<u64>()
        };
        let replies = |line: &Line<Master, _>| {
            NodeId::ALL.map(|node| line.head().node_statistics(node).replies)
        };
        let (writes, reads) = (line.head().statistics().writes, replies(&line));
        let talked = busy(&line);
        line.run_for(span).unwrap();
        let visits: Vec<u32> = replies(&line).iter().zip(reads).map(|(a, b)| a - b).collect();
        let fewest = *visits.iter().min().unwrap();
        assert!(visits.iter().max().unwrap() - fewest <= 1, "unfair: {visits:?}");
        // The first READ of the span may belong to a WRITE from before it.
        assert!(line.head().statistics().writes - writes + 1 >= 8 * fewest);
        (fewest, (busy(&line) - talked) * 100 / u64::from(span.as_micros()))
    }

    #[test]
    fn eight_nodes_are_written_and_read_at_ninety_percent_of_what_the_line_allows() {
        const CYCLES: u32 = 100;
        for baud in [500_000, 57_600, 2_000_000] {
            let mut config = MasterConfig::direct();
            config.baud = baud;
            let mut plan = Schedule::new(8);
            plan.baud = baud;
            let span = plan.cycle_time().saturating_mul(CYCLES);
            let (visits, busy_pct) = visits(config, span);
            println!(
                "{baud} bit/s: computed {} cycles/s, {} % busy; measured {:.1} cycles/s, {busy_pct} % busy",
                plan.cycles_per_second(),
                plan.busy_pct(),
                f64::from(visits) * 1e6 / f64::from(span.as_micros()),
            );
            assert!(visits * 100 >= CYCLES * 90, "{visits} of {CYCLES}");
            assert!(visits <= CYCLES + 1, "{visits} are more than the line allows");
            assert!(busy_pct * 100 >= u64::from(plan.busy_pct()) * 90);
        }
    }

    #[test]
    fn an_unplugged_node_is_abnormal_after_three_strikes_and_comes_back() {
        let mut line = bus(&[NodeId::N1, NodeId::N2], MasterConfig::direct());
        discovered(&mut line);
        line.stub_mut(Who::Tail(0)).unplugged = true;
        line.run_for(Duration::from_millis(20)).unwrap();
        assert_eq!(line.head().health(NodeId::N1), Some(Health::Abnormal));
        assert_eq!(line.head().health(NodeId::N2), Some(Health::Online));
        line.stub_mut(Who::Tail(0)).unplugged = false;
        line.run_for(Duration::from_millis(100)).unwrap();
        assert_eq!(line.head().health(NodeId::N1), Some(Health::Online));
    }

    #[test]
    fn a_motor_moves_the_same_in_one_step_and_in_many() {
        let motion = |target: f32, steps: u32| {
            let mut motor = Motor::new();
            motor.turn(Rps::new(target).unwrap());
            for _ in 0..steps {
                motor.step(us(200_000 / steps));
            }
            (motor.velocity().get(), motor.position().revolutions())
        };
        let ((fast, far), (slow, near)) = (motion(4.0, 1), motion(4.0, 1000));
        assert!((fast - slow).abs() < 1e-5 && (far - near).abs() < 2e-4);
        // 4 rps over 0.2 s, less what a lag of 50 ms costs.
        assert!((far - (4.0 * 0.2 - 4.0 * 0.05 * (1.0 - (-4.0_f64).exp()))).abs() < 2e-4, "{far}");
        let (back, behind) = motion(-4.0, 7);
        assert!((back + fast).abs() < 1e-3 && (behind + far).abs() < 2e-3);
    }

    #[test]
    fn a_motor_goes_to_a_position_at_its_limit_and_stays() {
        let mut motor = Motor::new().with_speed_limit(Rps::new(-2.0).unwrap());
        motor.go_to(Position::from_revolutions(1.0).unwrap());
        motor.step(us(250_000));
        assert_eq!((motor.position().revolutions(), motor.velocity().get()), (0.5, 2.0));
        motor.step(us(10_000_000));
        assert_eq!((motor.position().revolutions(), motor.velocity().get()), (1.0, 0.0));
        motor.turn(Rps::new(1.0).unwrap());
        motor.step(us(100_000));
        motor.hold();
        let held = motor.position();
        motor.step(us(100_000));
        assert_eq!((motor.position(), motor.velocity()), (held, Rps::ZERO));
    }

    #[test]
    fn a_motor_beyond_the_wire_stays_at_its_end() {
        let mut motor = Motor::new().with_time_constant(Duration::ZERO);
        motor.turn(Rps::new(-1e30).unwrap());
        motor.step(Duration::from_millis(4_000_000));
        assert_eq!(motor.position().counts(), -268_443_647);
        motor.turn(Rps::new(1e30).unwrap());
        motor.step(Duration::from_millis(4_294_967));
        assert_eq!(motor.position().counts(), 268_435_455);
    }

    #[test]
    fn a_node_without_commands_stands_still_after_its_watchdog() {
        let mut config = SlaveConfig::direct();
        config.watchdog = Some(Duration::from_millis(100));
        let slave = Slave::new(NodeId::N1, Mode::Velocity, config);
        let master: Master = Master::new(MasterConfig::direct(), at(0));
        let mut line = Line::new(500_000, 0, master);
        line.add(MotorNode::from_parts(slave, Motor::new()));
        let now = line.now();
        line.head_mut().discover(now);
        line.run_for(Duration::from_millis(100)).unwrap();
        let now = line.now();
        line.head_mut().set_velocity(NodeId::N1, Rps::new(1.0).unwrap(), now).unwrap();
        line.run_for(Duration::from_millis(1000)).unwrap();
        assert!(line.tail(0).motor().velocity().get() > 0.99);
        line.head_mut().release(NodeId::N1);
        line.run_for(Duration::from_millis(1000)).unwrap();
        assert!(line.tail(0).motor().velocity().get() < 0.01);
    }
}

#[cfg(feature = "ucp")]
mod rover {
    use axlewire::{sim::Rover, time::Duration, ucp::MotorControl};

    const SECOND: Duration = Duration::from_millis(1000);

    #[test]
    fn a_rover_drives_ahead_and_keeps_its_heading() {
        let mut rover = Rover::new();
        rover.command(&MotorControl::new(50, 0).unwrap());
        rover.step(SECOND);
        rover.step(SECOND);
        let telemetry = rover.telemetry();
        assert_eq!((telemetry.rpm, telemetry.heading_deg), ([60; 4], 0));
        // 60 rpm of 0.4 m, less what a lag of 150 ms costs.
        assert!((rover.distance_m() - 0.4 * (2.0 - 0.15)).abs() < 1e-4);
        rover.command(&MotorControl::STOP);
        rover.step(SECOND);
        rover.step(SECOND);
        assert_eq!(rover.telemetry().rpm, [0; 4]);
    }

    #[test]
    fn a_positive_turn_is_to_the_right() {
        let mut rover = Rover::new();
        rover.command(&MotorControl::turn_right(0, 20).unwrap());
        rover.step(SECOND);
        let telemetry = rover.telemetry();
        assert_eq!(telemetry.rpm, [17, -17, 17, -17]);
        assert!((1..180).contains(&telemetry.heading_deg), "{telemetry:?}");
        assert!(telemetry.gyro[2] < 0 && telemetry.mag[1] > 0, "{telemetry:?}");
        let turned = rover.heading_deg();
        rover.command(&MotorControl::turn_left(0, 20).unwrap());
        rover.step(SECOND);
        rover.step(SECOND);
        let back = rover.heading_deg();
        assert!(back < turned || back > 180.0, "{back}");
    }

    /// What the wheels do once they have reached their speed, percent: left, right.
    fn wheels(commands: &[(i16, i16)]) -> (i16, i16) {
        let mut rover = Rover::new();
        for &(speed, angular) in commands {
            rover.command(&MotorControl::new(speed, angular).unwrap());
            (0..10).for_each(|_| rover.step(SECOND));
        }
        let percent = |rpm: i16| (f64::from(rpm) / Rover::FULL_RPM * 100.0).round() as i16;
        let [left, right, ..] = rover.telemetry().rpm;
        (percent(left), percent(right))
    }

    #[test]
    fn a_rover_mixes_as_the_vendors_motor_c_does() {
        assert_eq!(wheels(&[(60, 50)]), (81, 39));
        assert_eq!(wheels(&[(60, -50)]), (39, 81));
        assert_eq!(wheels(&[(-60, 50)]), (-81, -39), "in reverse the nose swings left");
        assert_eq!(wheels(&[(-60, -50)]), (-39, -81));
        assert_eq!(wheels(&[(100, 100)]), (100, 30), "limited");
        assert_eq!(wheels(&[(0, 50)]), (35, -35), "on the spot");
        assert_eq!(wheels(&[(0, -50)]), (-35, 35));
    }

    #[test]
    fn a_yaw_to_the_right_swings_the_nose_right_in_reverse_too() {
        for speed in [-100, -60, -6, -5, 0, 5, 6, 60, 100] {
            for (yaw, expected) in [
                (MotorControl::yaw_right(speed, 50).unwrap(), 1.0),
                (MotorControl::yaw_left(speed, 50).unwrap(), -1.0),
            ] {
                let mut rover = Rover::new();
                rover.command(&yaw);
                rover.step(Duration::from_millis(100));
                let turned = (rover.heading_deg() + 180.0).rem_euclid(360.0) - 180.0;
                assert!(turned * expected > 0.0, "{yaw:?}: {turned}");
            }
        }
    }

    #[test]
    fn a_rover_has_the_dead_bands_of_the_vendors_motor_c() {
        assert_eq!(wheels(&[(0, 10)]), (0, 0), "turning on the spot needs more than 10");
        assert_eq!(wheels(&[(0, 11)]), (7, -7));
        assert_eq!(wheels(&[(5, 0)]), (0, 0), "a duty of 5 % moves nothing");
        assert_eq!(wheels(&[(6, 0)]), (6, 6));
        assert_eq!(wheels(&[(94, 0)]), (94, 94));
        assert_eq!(wheels(&[(95, 0)]), (100, 100), "and from 95 % on it is full speed");
        assert_eq!(wheels(&[(60, 5)]), (63, 63), "little steering does not steer");
        // Below both thresholds the direction of the command before stays selected.
        assert_eq!(wheels(&[(-50, 0), (5, 5)]), (-8, -8));
        assert_eq!(wheels(&[(50, 0), (-5, 5)]), (8, 8));
        assert_eq!(wheels(&[(50, 0), (0, 0)]), (0, 0));
    }

    #[test]
    fn the_battery_drains_and_an_empty_one_stops_the_wheels() {
        let full = Rover::new().telemetry();
        assert_eq!((full.battery(), full.voltage_dv), (Some(100), 126));
        let mut rover = Rover::new().with_battery(50.0);
        rover.command(&MotorControl::new(100, 0).unwrap());
        rover.step(SECOND);
        let driving = rover.telemetry();
        assert!(driving.power_w > full.power_w && driving.current_ca > full.current_ca);
        assert!(driving.voltage_dv < full.voltage_dv && rover.battery() < 50.0);
        for _ in 0..3600 {
            rover.step(SECOND);
        }
        assert_eq!((rover.telemetry().battery(), rover.telemetry().rpm), (Some(0), [0; 4]));
    }
}
