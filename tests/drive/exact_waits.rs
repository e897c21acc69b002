//! Waits of a driver, to the microsecond: between attempts, inside a frame, and on a clock that has
//! gone backwards.

use std::{cell::RefCell, rc::Rc};

use embedded_hal_async::delay::DelayNs;

use crate::rig::*;

/// Plugs the port in again at this time.
fn replug(world: &World, port: &Port, at_us: u64) {
    port.unplugged.set(true);
    let (unplugged, clock) = (port.unplugged.clone(), world.clone());
    world.add(move || unplugged.set(clock.now() < Instant::from_micros(at_us)));
}

#[test]
fn a_stop_is_tried_again_a_millisecond_after_the_port_has_failed() {
    for is_async in BOTH {
        let mut story = Story::new(only_two_and_five()).discovered();
        let world = story.world.clone();
        let begin = world.now().as_micros();
        replug(&world, story.bus.port(), begin + 5500);
        call!(is_async, story.bus, stop(NodeId::N2)).unwrap();
        // Exchanges follow for 20 ms, until the motor is seen to be still.
        let took = world.now().as_micros() - begin;
        assert!((25_500..28_500).contains(&took), "{took} us, async {is_async}");
        assert_ne!(story.bus.role().stop_progress(NodeId::N2), StopProgress::Owed);
    }
}

#[cfg(feature = "ucp")]
#[test]
fn a_stop_of_a_rover_is_tried_again_a_millisecond_after_the_port_has_failed() {
    for is_async in BOTH {
        let mut rover = host();
        let world = rover.port().world.clone();
        replug(&world, rover.port(), 5500);
        call!(is_async, rover, stop()).unwrap();
        let took = world.now_us();
        assert!((5500..7500).contains(&took), "{took} us, async {is_async}");
    }
}

/// A role that sends one frame, in which it permits pauses of a millisecond. A byte takes 20 us.
/// It may send the frame again if it did not leave.
#[derive(Default)]
pub(crate) struct Pausing {
    pub(crate) is_sent: bool,
    pub(crate) repeats: bool,
    pub(crate) unsent: Vec<Unsent>,
    /// What it knew of that when all had left.
    pub(crate) unsent_when_flushed: Option<Vec<Unsent>>,
}

impl Endpoint for Pausing {
    type Event = ();
    fn handle_input(&mut self, _: &[u8], _: impl Into<Arrival>) {}
    fn handle_timeout(&mut self, _: Instant) {}
    fn poll_transmit(&mut self, _: Instant) -> Option<&[u8]> {
        (!core::mem::replace(&mut self.is_sent, true)).then_some(&b"0123456789"[..])
    }
    fn line_rules(&self) -> LineRules {
        LineRules { frame_pause: ms(1), baud: 500_000, held_up_after: None }
    }
    fn handle_transmit(&mut self, outcome: impl Into<Transmit>, _: Instant) {
        match outcome.into() {
            Transmit::Taken => {}
            Transmit::Flushed => self.unsent_when_flushed = Some(self.unsent.clone()),
            Transmit::Unsent(unsent) => {
                self.unsent.push(unsent);
                self.is_sent &= !self.repeats;
            }
        }
    }
    fn poll_event(&mut self) -> Option<()> {
        None
    }
    fn poll_timeout(&self) -> Option<Instant> {
        None
    }
}

#[test]
fn the_pause_inside_a_frame_is_from_the_end_of_a_byte_to_the_end_of_the_next() {
    // Three bytes leave at once, and take 60 us. The next takes 20 us of the pause.
    for (late_us, is_cut_off) in [(60 + 979, false), (60 + 980, false), (60 + 981, true)] {
        let mut driver = on(Pausing::default(), Port::writing([Step::Few(3), Step::Error]));
        let world = driver.port().world.clone();
        assert!(driver.service().is_err());
        assert_eq!(driver.unsent().len(), 7);
        world.step(late_us);
        driver.service().unwrap();
        let expected = if is_cut_off { vec![Unsent::CutOff] } else { vec![] };
        assert_eq!(driver.role().unsent, expected, "{late_us} us");
        assert_eq!(driver.port().written.len(), if is_cut_off { 3 } else { 10 });
    }
}

/// A port that takes three bytes at once and the rest after a while, and is flushed 300 us later.
fn in_two(rest_after_us: u64, failing_flushes: usize) -> On<Pausing> {
    let mut port = Port::writing([Step::Few(3), Step::Late(rest_after_us)]);
    port.flushes.extend(vec![Step::BlocksAndFails(300); failing_flushes]);
    port.flushes.extend([Step::Late(300), Step::Late(300)]);
    on(Pausing::default(), port)
}

#[test]
fn a_frame_taken_in_parts_counts_as_sent_if_no_pause_was_too_long_else_its_role_is_told_at_once() {
    // Its flush, 300 us after its last part was taken, is within its own 200 us and a pause.
    for (rest_after_us, is_cut_off) in [(879, false), (880, false), (881, true)] {
        let mut driver = in_two(rest_after_us, 0);
        driver.service().unwrap();
        let expected = if is_cut_off { vec![Unsent::CutOff] } else { vec![] };
        assert_eq!(driver.role().unsent, expected, "{rest_after_us} us");
        // Before it is told that all has left.
        assert_eq!(driver.role().unsent_when_flushed, Some(expected), "{rest_after_us} us");
    }
    // So it is if the last of three parts is taken at once.
    for (flush_us, expected) in [(179, vec![]), (180, vec![Unsent::CutOff])] {
        let mut port = Port::writing([Step::Few(1), Step::Lags(1001, 8)]);
        port.flushes.push_back(Step::Blocks(flush_us));
        let mut driver = on(Pausing::default(), port);
        (0..2).for_each(|_| driver.service().unwrap());
        assert_eq!(driver.role().unsent, expected, "{flush_us} us");
    }
}

#[test]
fn a_failed_flush_behind_a_frame_in_parts_counts_for_it_and_for_the_frames_before() {
    for rest_after_us in [0, 881] {
        let mut driver = in_two(rest_after_us, 1);
        assert_eq!(driver.service(), Err(DriveError::Port(Unplugged)));
        assert_eq!(driver.role().unsent, [Unsent::CutOff, Unsent::Unflushed], "{rest_after_us} us");
    }
}

#[test]
fn no_pause_is_hidden_by_frames_whose_flush_failed_or_by_a_clock_that_is_about_to_wrap() {
    // Behind 50 lost frames, 10 ms on a line, and for a driver that begins before the wrap.
    for (begin_us, lost) in [(0, 0), (0, 50), (u64::MAX - 100_000, 0), (u64::MAX - 100_000, 50)] {
        let world = World::starting_at(begin_us);
        let mut port = Port::new(&world, 0);
        port.flushes.extend(vec![Step::Error; lost]);
        let mut driver = on(Pausing { repeats: true, ..Pausing::default() }, port);
        for _ in 0..lost {
            assert!(driver.service().is_err());
        }
        driver.port_mut().writes.extend([Step::Few(3), Step::Late(5000)]);
        let before = driver.role().unsent.len();
        driver.service().unwrap();
        assert!(driver.role().unsent[before..].contains(&Unsent::CutOff), "{begin_us} {lost}");
    }
}

/// A delay that is late by 1 %, and notes how long it was asked to wait.
struct Late(World, Rc<RefCell<Vec<u32>>>);

impl DelayNs for Late {
    async fn delay_ns(&mut self, _: u32) {
        panic!("asked for microseconds");
    }
    async fn delay_us(&mut self, us: u32) {
        self.1.borrow_mut().push(us);
        self.0.step(u64::from(us) * 101 / 100);
    }
}

#[test]
fn an_async_call_delays_for_a_second_at_most_and_asks_its_clock_in_between() {
    let (world, asked) = (World::default(), Rc::default());
    let delay = Late(world.clone(), Rc::clone(&asked));
    let time = WithDelay { clock: world.clone(), delay };
    let mut driver = On::new(Recorder::default(), Port::new(&world, 20), time);
    let deadline = Instant::from_micros(2_500_000);
    let within = deadline - driver.now();
    assert_eq!(world.block_on(driver.asynch().next_event(within)), Ok(None));
    assert_eq!(*asked.borrow(), [1_000_000, 1_000_000, 480_000]);
    assert_eq!(world.now() - deadline, Duration::from_micros(4800), "errors do not add up");
}

/// A clock that is set back by 500 us once, and notes until when it is asked to idle.
#[derive(Clone, Default)]
struct SetBack(Rc<RefCell<(Vec<u64>, Vec<u64>)>>);

impl Clock for SetBack {
    fn now(&self) -> Instant {
        let mut parts = self.0.borrow_mut();
        let reading = if parts.0.len() > 1 { parts.0.remove(0) } else { parts.0[0] };
        Instant::from_micros(reading)
    }
    fn idle_until(&mut self, until: Instant) {
        let mut parts = self.0.borrow_mut();
        parts.1.push(until.as_micros());
        parts.0 = vec![until.as_micros()];
    }
}

#[test]
fn a_driver_whose_clock_was_set_back_idles_until_the_deadline_on_that_clock() {
    let clock = SetBack::default();
    clock.0.borrow_mut().0 = vec![1000, 500];
    let mut driver = On::new(Recorder::default(), Port::default(), clock.clone());
    let now = driver.now();
    assert_eq!(now, Instant::from_micros(1000), "the role's time goes on");
    let deadline = now + Duration::from_micros(2000);
    let within = deadline - driver.now();
    assert_eq!(driver.next_event(within), Ok(None));
    assert_eq!(clock.0.borrow().1, [2500]);
    assert_eq!(driver.now(), deadline);
}

#[test]
fn a_stop_behind_a_failing_port_naps_for_a_millisecond_on_a_clock_that_was_set_back() {
    let clock = SetBack::default();
    clock.0.borrow_mut().0 = vec![1000, 500];
    let master = Master::new(MasterConfig::direct(), Instant::from_micros(0));
    let mut bus = On::new(master, Port::writing([Step::Error]), clock.clone());
    let _ = bus.stop(NodeId::N1);
    // The clock stays at 500; the time of the role goes on from 1000.
    assert_eq!(clock.0.borrow().1.first(), Some(&1500));
}

#[cfg(feature = "ucp")]
#[test]
fn a_stop_of_a_rover_naps_for_a_millisecond_on_a_clock_that_was_set_back() {
    let clock = SetBack::default();
    clock.0.borrow_mut().0 = vec![1000, 500];
    let host = Host::new(HostConfig::default(), Instant::from_micros(0));
    let mut rover = On::new(host, Port::writing([Step::Error]), clock.clone());
    rover.stop().unwrap();
    assert_eq!(clock.0.borrow().1.first(), Some(&1500));
}

#[test]
fn a_driver_idles_until_its_role_wants_something_and_then_until_the_deadline() {
    let clock = SetBack::default();
    clock.0.borrow_mut().0 = vec![1000];
    let mut role = Recorder::default();
    role.timeout = Some(Instant::from_micros(4000));
    let mut driver = On::new(role, Port::default(), clock.clone());
    let within = Instant::from_micros(9000) - driver.now();
    assert_eq!(driver.next_event(within), Ok(None));
    assert_eq!(clock.0.borrow().1, [4000, 9000]);
}
