//! The loop of `Endpoint`, over any role.

use std::{cell::RefCell, error::Error};

#[cfg(feature = "ucp")]
use axlewire::ucp;
use axlewire::{
    drive::{Clock, DriveError, Driver, StdClock, WithDelay},
    endpoint::Endpoint,
    ikeya::{self, NodeId},
    time::{Duration, Instant},
};
use embedded_hal_async::delay::DelayNs;

use crate::{
    port::{Script, Step, Unplugged},
    recorder::{ASYNC, Call, ROUNDS, Recorder, scripted},
    virtual_time::{End, VirtualClock, World},
};

fn bytes(count: usize) -> Step {
    Step::Bytes(vec![0; count])
}

fn at_ms(millis: u64) -> Instant {
    Instant::from_millis(millis)
}

#[test]
fn a_round_takes_in_then_lets_time_pass_then_sends_and_flushes_once() {
    for round in ROUNDS {
        let mut role = Recorder::sending(&[b"one", b"two"]);
        role.timeout = Some(at_ms(0));
        let mut driver = scripted(role, Script::reading([Step::Bytes(b"in".into())]));
        assert_eq!(round(&mut driver), Some(Ok(())));
        let expected = [
            Call::Input(b"in".into()),
            Call::Timeout,
            Call::Transmit(Some(b"one".into())),
            Call::Transmit(Some(b"two".into())),
            Call::Transmit(None),
        ];
        assert_eq!(driver.role().calls, expected);
        assert_eq!((&driver.port().written[..], driver.port().flushed), (&b"onetwo"[..], 1));
        // With nothing sent there is nothing to flush.
        assert_eq!(round(&mut driver), Some(Ok(())));
        assert_eq!(driver.port().flushed, 1);
    }
}

#[test]
fn time_passes_only_when_the_role_has_asked_for_it() {
    for round in ROUNDS {
        let mut role = Recorder::default();
        role.timeout = Some(at_ms(1));
        let world = World::default();
        let mut driver = Driver::new(role, Script::default(), VirtualClock(world.clone()));
        world.step(999);
        assert_eq!(round(&mut driver), Some(Ok(())));
        assert_eq!(driver.role().calls, [Call::Transmit(None)]);
        world.step(1);
        assert_eq!(round(&mut driver), Some(Ok(())));
        assert_eq!(driver.role().calls[1..], [Call::Timeout, Call::Transmit(None)]);
    }
}

#[test]
fn what_arrives_while_a_frame_is_sent_is_taken_in_before_the_next_one() {
    for is_async in [false, true] {
        let world = World::default();
        let (mut near, mut far) = End::pair(&world, 20);
        (near.most, near.stutters) = (1, true);
        let (inbox, time) = (near.inbox.clone(), world.clone());
        let mut role = Recorder::sending(&[b"first", b"second", b"third"]);
        role.nothing_waits = Some(std::rc::Rc::new(move || {
            let arrived = |&(at, _): &(u64, u8)| Instant::from_micros(at) <= time.now();
            !inbox.borrow().front().is_some_and(arrived)
        }));
        // The other end sends all the time.
        let mut count = 0_u8;
        world.add(move || {
            embedded_io::Write::write(&mut far, &[count]).unwrap();
            count = count.wrapping_add(1);
        });
        let mut driver = Driver::new(role, near, VirtualClock(world.clone()));
        if is_async {
            world.block_on(driver.service_async()).unwrap();
        } else {
            world.step(20);
            world.step(20);
            driver.service().unwrap();
        }
        let received = &driver.role().received;
        assert!(!received.is_empty());
        assert!(received.iter().zip(0..).all(|(&byte, count)| byte == count), "{received:?}");
    }
}

#[test]
fn a_receiver_without_a_buffer_loses_nothing_while_the_sender_sends_byte_by_byte() {
    /// Sends and receives one byte at a time.
    #[derive(Default)]
    struct Bufferless {
        held: Option<u8>,
        count: u8,
        overruns: usize,
    }
    impl embedded_io::ErrorType for Bufferless {
        type Error = Unplugged;
    }
    impl embedded_io::ReadReady for Bufferless {
        fn read_ready(&mut self) -> Result<bool, Unplugged> {
            Ok(self.held.is_some())
        }
    }
    impl embedded_io::Read for Bufferless {
        fn read(&mut self, buffer: &mut [u8]) -> Result<usize, Unplugged> {
            buffer[0] = self.held.take().unwrap();
            Ok(1)
        }
    }
    impl embedded_io::Write for Bufferless {
        fn write(&mut self, _: &[u8]) -> Result<usize, Unplugged> {
            self.overruns += usize::from(self.held.replace(self.count).is_some());
            self.count += 1;
            Ok(1)
        }
        fn flush(&mut self) -> Result<(), Unplugged> {
            Ok(())
        }
    }
    let role = Recorder::sending(&[b"12345", b"678"]);
    let mut driver = Driver::new(role, Bufferless::default(), VirtualClock(World::default()));
    driver.service().unwrap();
    assert_eq!((driver.port().overruns, driver.port().count), (0, 8));
    assert_eq!(driver.role().received, [0, 1, 2, 3, 4, 5, 6, 7]);
}

#[test]
fn reads_and_writes_of_every_size_move_every_byte_once() {
    let (incoming, outgoing): (Vec<u8>, Vec<u8>) = ((0..200).collect(), (0..60).rev().collect());
    for size in 1..=60 {
        for round in ROUNDS {
            let port = Script {
                reads: incoming.chunks(size).map(|chunk| Step::Bytes(chunk.into())).collect(),
                writes: (0..200).map(|_| bytes(size)).collect(),
                ..Script::default()
            };
            let mut driver = scripted(Recorder::sending(&[&outgoing, &outgoing]), port);
            // One round takes in 64 reads.
            for _ in 0..4 {
                assert_eq!(round(&mut driver), Some(Ok(())));
            }
            assert_eq!(driver.role().received, incoming, "reads of {size}");
            assert_eq!(driver.port().written, outgoing.repeat(2), "writes of {size}");
            assert!(driver.unsent().is_empty());
        }
    }
}

#[test]
fn a_write_that_fails_inside_a_frame_leaves_the_rest_for_the_next_call() {
    for (failure, error) in
        [(Step::Error, DriveError::Port(Unplugged)), (Step::Zero, DriveError::WriteZero)]
    {
        for cut in 1..5 {
            for round in ROUNDS {
                let steps = [bytes(cut), failure.clone(), failure.clone()];
                let mut driver =
                    scripted(Recorder::sending(&[b"12345", b"67"]), Script::writing(steps));
                assert_eq!(round(&mut driver), Some(Err(error)));
                assert_eq!(driver.unsent(), &b"12345"[cut..]);
                assert_eq!(round(&mut driver), Some(Err(error)));
                assert_eq!(driver.unsent(), &b"12345"[cut..]);
                assert_eq!(round(&mut driver), Some(Ok(())));
                assert_eq!(
                    (&driver.port().written[..], driver.port().flushed),
                    (&b"1234567"[..], 3)
                );
            }
        }
    }
}

#[test]
fn what_is_unsent_can_be_given_up() {
    for round in ROUNDS {
        let steps = [bytes(2), Step::Error];
        let mut driver = scripted(Recorder::sending(&[b"12345", b"67"]), Script::writing(steps));
        assert_eq!(round(&mut driver), Some(Err(DriveError::Port(Unplugged))));
        assert_eq!((driver.discard(), driver.discard()), (3, 0));
        assert_eq!(round(&mut driver), Some(Ok(())));
        assert_eq!(driver.port().written, b"1267");
    }
}

#[test]
fn a_flush_that_fails_is_made_again_by_the_next_call() {
    for round in ROUNDS {
        let port = Script { flushes: [Step::Error].into(), ..Script::default() };
        let mut driver = scripted(Recorder::sending(&[b"12"]), port);
        assert_eq!(round(&mut driver), Some(Err(DriveError::Port(Unplugged))));
        assert_eq!(round(&mut driver), Some(Ok(())));
        assert_eq!((&driver.port().written[..], driver.port().flushed), (&b"12"[..], 1));
    }
}

#[test]
fn a_read_that_fails_or_ends_is_told_after_what_came_before_and_loses_nothing() {
    for (failure, error) in
        [(Step::Error, DriveError::Port(Unplugged)), (Step::Zero, DriveError::Closed)]
    {
        for round in ROUNDS {
            let (head, tail) = (Step::Bytes(b"he".into()), Step::Bytes(b"ad".into()));
            let mut driver =
                scripted(Recorder::default(), Script::reading([head, failure.clone(), tail]));
            assert_eq!(round(&mut driver), Some(Err(error)));
            assert_eq!(driver.role().received, b"he");
            assert_eq!(round(&mut driver), Some(Ok(())));
            assert_eq!(driver.role().received, b"head");
        }
    }
}

#[test]
fn a_round_is_bounded_whatever_port_and_role_do() {
    for round in ROUNDS {
        let flood = (0..2000).map(|_| bytes(64));
        let frames = vec![&b"frame"[..]; 1000];
        let mut driver = scripted(Recorder::sending(&frames), Script::reading(flood));
        assert_eq!(round(&mut driver), Some(Ok(())));
        assert_eq!(driver.port().written.len(), 8 * 5);
        // 64 in front of each frame, and what comes while it is sent.
        let reads = 2000 - driver.port().reads.len();
        assert!((8 * 64..=9 * 64).contains(&reads), "{reads}");
    }
}

#[test]
fn a_frame_that_no_driver_has_room_for_is_refused() {
    for round in ROUNDS {
        let mut driver = scripted(Recorder::sending(&[&[7; 65], &[8; 64]]), Script::default());
        let error = DriveError::FrameTooLong { length: 65, limit: 64 };
        assert_eq!(round(&mut driver), Some(Err(error)));
        assert_eq!(round(&mut driver), Some(Ok(())));
        assert_eq!(driver.port().written, [8; 64]);
    }
}

#[test]
fn on_a_silent_line_the_next_event_is_waited_for_until_the_deadline_and_not_longer() {
    let world = World::default();
    let (near, _far) = End::pair(&world, 20);
    let mut driver = Driver::new(Recorder::default(), near, VirtualClock(world.clone()));
    assert_eq!(driver.next_event(at_ms(10)), Ok(None));
    assert_eq!(world.now(), at_ms(10));
    assert_eq!(world.block_on(driver.next_event_async(at_ms(20))), Ok(None));
    assert_eq!(world.now(), at_ms(20));
    // No deadline in the past costs time, and none leaves out the round.
    driver.role_mut().frames.push_back(b"12".into());
    assert_eq!(driver.next_event(at_ms(0)), Ok(None));
    assert_eq!(driver.port().outboxes[0].borrow().len(), 2);
    driver.role_mut().frames.push_back(b"34".into());
    assert_eq!(world.block_on(driver.next_event_async(at_ms(0))), Ok(None));
    assert_eq!(driver.port().outboxes[0].borrow().len(), 4);
    assert_eq!(world.now(), at_ms(20));
}

#[test]
fn a_waiting_driver_wakes_for_its_role() {
    let world = World::default();
    let (near, _far) = End::pair(&world, 20);
    let mut driver = Driver::new(Recorder::default(), near, VirtualClock(world.clone()));
    driver.role_mut().timeout = Some(at_ms(5));
    assert_eq!(world.block_on(driver.next_event_async(at_ms(10))), Ok(None));
    let calls = &driver.role().calls;
    assert_eq!(calls.iter().filter(|call| **call == Call::Timeout).count(), 1);
    // Asleep but for the role: a round at first, at 5 ms and at the end.
    assert_eq!(calls.len(), 4, "{calls:?}");
}

#[test]
fn a_role_whose_deadline_is_always_over_does_not_keep_its_driver_for_ever() {
    let late = Plain { timeout: Some(at_ms(0)), ..Plain::default() };
    let world = World::default();
    let mut driver = Driver::new(late, End::new(&world, 20), VirtualClock(world.clone()));
    assert_eq!(driver.next_event(at_ms(1)), Ok(None));
    assert_eq!(world.now(), at_ms(1));
}

/// A role with nothing but what it has to have.
#[derive(Default)]
struct Plain {
    heard: Vec<(Vec<u8>, Instant)>,
    timeout: Option<Instant>,
}

impl Endpoint for Plain {
    type Event = ();
    fn handle_input(&mut self, bytes: &[u8], now: Instant) {
        self.heard.push((bytes.to_vec(), now));
    }
    fn handle_timeout(&mut self, _: Instant) {}
    fn poll_transmit(&mut self, _: Instant) -> Option<&[u8]> {
        None
    }
    fn poll_event(&mut self) -> Option<()> {
        None
    }
    fn poll_timeout(&self) -> Option<Instant> {
        self.timeout
    }
}

#[test]
fn as_provided_a_role_takes_old_bytes_for_new_ones_and_frames_may_pause_for_20_ms() {
    let mut role = Plain::default();
    role.handle_old_input(b"12", at_ms(1), at_ms(9));
    assert_eq!(role.heard, [(b"12".to_vec(), at_ms(9))]);
    assert_eq!(role.held_up_after(), None);
    assert_eq!(role.frame_pause(), Duration::from_millis(20));
    assert_eq!(role.wire_time(64), Duration::ZERO);
}

#[test]
fn every_event_is_handed_out_until_the_deadline() {
    let world = World::default();
    let (near, mut far) = End::pair(&world, 20);
    embedded_io::Write::write(&mut far, b"abc").unwrap();
    let mut driver = Driver::new(Recorder::default(), near, VirtualClock(world.clone()));
    let mut events = vec![];
    driver.run_until(at_ms(1), |_, event, _| events.push(event)).unwrap();
    assert_eq!((&events[..], world.now()), (&b"abc"[..], at_ms(1)));
    embedded_io::Write::write(&mut far, b"def").unwrap();
    let run = driver.run_until_async(at_ms(2), |role, event, _| {
        events.push(event);
        role.frames.push_back(vec![event]);
    });
    world.block_on(run).unwrap();
    assert_eq!((&events[..], world.now()), (&b"abcdef"[..], at_ms(2)));
    assert_eq!(driver.port().outboxes[0].borrow().len(), 3);
}

#[test]
fn an_async_call_dropped_at_any_await_and_made_again_loses_no_byte_and_cuts_no_frame() {
    let incoming: Vec<u8> = (0..40).collect();
    let frames: [&[u8]; 3] = [b"first", b"second", b"third"];
    let whole = frames.concat();
    // A write that is ready at the second poll never gets further with one.
    for polls in 2..200 {
        let world = World::default();
        let (mut near, mut far) = End::pair(&world, 20);
        (near.most, near.stutters) = (1, true);
        embedded_io::Write::write(&mut far, &incoming).unwrap();
        let mut role = Recorder::sending(&frames);
        role.repeats = true;
        let mut driver = Driver::new(role, near, VirtualClock(world.clone()));
        let mut events = vec![];
        let mut dropped = 0;
        // Every call is dropped after so many polls, and again, and again.
        for _ in 0..1000 {
            match world.poll_times(polls, driver.next_event_async(at_ms(1000))) {
                Some(event) => events.extend(event.unwrap()),
                None => dropped += 1,
            }
            world.step(20);
        }
        assert!(dropped > 0);
        assert_eq!(events, incoming, "dropped after {polls} polls");
        let sent: Vec<u8> =
            driver.port().outboxes[0].borrow().iter().map(|&(_, byte)| byte).collect();
        assert_eq!(sent, whole, "dropped after {polls} polls");
    }
}

#[test]
fn a_stalled_write_or_flush_that_is_dropped_is_made_good_by_the_next_call() {
    let port = Script {
        writes: [bytes(3), Step::Stall, bytes(1), Step::Stall].into(),
        flushes: [Step::Stall, Step::Stall].into(),
        ..Script::default()
    };
    let mut driver = scripted(Recorder::sending(&[b"12345"]), port);
    assert_eq!(ASYNC(&mut driver), None);
    assert_eq!(driver.unsent(), b"45");
    assert_eq!(ASYNC(&mut driver), None);
    assert_eq!(driver.unsent(), b"5");
    for _ in 0..2 {
        assert_eq!(ASYNC(&mut driver), None);
        assert_eq!((driver.unsent(), driver.port().flushed), (&b""[..], 0));
    }
    assert_eq!(ASYNC(&mut driver), Some(Ok(())));
    assert_eq!((&driver.port().written[..], driver.port().flushed), (&b"12345"[..], 1));
}

#[test]
fn a_clock_that_goes_backwards_goes_on_for_the_role_from_where_it_was() {
    let mut readings = [100, 50, 70, 120].into_iter().cycle();
    let clock = move || Instant::from_micros(readings.next().unwrap());
    let flood = (0..100).map(|_| bytes(1));
    // The recorder itself asserts the order of times.
    let mut driver = Driver::new(Recorder::default(), Script::reading(flood), clock);
    driver.service().unwrap();
    assert_eq!(driver.role().received.len(), 64);

    // One reading is an hour ahead: the steps before and after it count all the same.
    let hour = 3_600_000_000;
    let mut readings = [1000, hour + 1000, 1500, 2500, 2400, 2700].into_iter();
    let clock = move || Instant::from_micros(readings.next().unwrap());
    let mut driver = Driver::new(Recorder::default(), Script::default(), clock);
    let times: Vec<u64> = (0..5).map(|_| driver.now().as_micros() - hour).collect();
    assert_eq!(times, [1000, 1000, 2000, 2000, 2300]);
}

#[test]
fn the_clock_of_std_naps_for_less_than_a_deadline_and_never_past_one_that_is_over() {
    let mut clock = StdClock::default();
    let start = clock.now();
    clock.idle_until(start);
    let far = start + Duration::from_millis(60_000);
    let begin = clock.now();
    clock.idle_until(far);
    let end = clock.now();
    assert!(end >= begin + Duration::from_micros(200) && end < far);
}

#[test]
fn an_error_of_the_port_is_the_source_and_every_error_is_one_line() {
    let error = DriveError::Port(Unplugged);
    assert_eq!(error.source().unwrap().to_string(), "unplugged");
    assert_eq!(error.to_string(), "port failed: unplugged");
    assert!(DriveError::<Unplugged>::Closed.source().is_none());
    assert_eq!(
        DriveError::<Unplugged>::Closed.to_string(),
        "port is closed: its other end has gone"
    );
    assert_eq!(DriveError::<Unplugged>::WriteZero.to_string(), "port took no bytes");
    let bus = ikeya::CommandError::NotOnline { node: NodeId::N2 };
    let told = DriveError::<Unplugged>::from(bus).source().unwrap().to_string();
    assert_eq!(told, bus.to_string());
}

#[cfg(feature = "ucp")]
#[test]
fn a_refused_value_is_the_source_of_the_refusal_and_that_of_the_error() {
    let value = ucp::MotorControl::new(101, 0).unwrap_err();
    let rover = ucp::CommandError::Value(value);
    assert_eq!(rover.source().unwrap().to_string(), value.to_string());
    let told = DriveError::<Unplugged>::from(rover).source().unwrap().to_string();
    assert_eq!(told, rover.to_string());
}

#[test]
fn a_clock_and_a_delay_are_joined_and_each_does_its_part() {
    let said = RefCell::new(vec![]);
    struct Says<'a>(&'a RefCell<Vec<String>>);
    impl Clock for Says<'_> {
        fn now(&mut self) -> Instant {
            at_ms(7)
        }
        fn idle_until(&mut self, until: Instant) {
            self.0.borrow_mut().push(format!("idle until {}", until.as_micros()));
        }
    }
    impl DelayNs for Says<'_> {
        async fn delay_ns(&mut self, ns: u32) {
            self.0.borrow_mut().push(format!("{ns} ns"));
        }
        async fn delay_us(&mut self, us: u32) {
            self.0.borrow_mut().push(format!("{us} us"));
        }
        async fn delay_ms(&mut self, ms: u32) {
            self.0.borrow_mut().push(format!("{ms} ms"));
        }
    }
    let mut both = WithDelay { clock: Says(&said), delay: Says(&said) };
    assert_eq!(both.now(), at_ms(7));
    both.idle_until(at_ms(9));
    let world = World::default();
    world.block_on(async {
        both.delay_ns(1).await;
        both.delay_us(2).await;
        both.delay_ms(3).await;
    });
    assert_eq!(*said.borrow(), ["idle until 9000", "1 ns", "2 us", "3 ms"]);
}
